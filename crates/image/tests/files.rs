//! Image files: what goes out comes back, and broken files are refused in words.

use std::fs;
use std::path::PathBuf;

use chiaro_image::{
    Image, ImageError, Layers, Picture, Precision, read, read_layers, write_exr, write_layers, write_png,
};

/// A file in the folder that cargo keeps for this test.
fn scratch(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("image_files").join(name)
}

fn sample() -> Image {
    Image::from_fn(37, 21, |x, y| [x as f32 / 8.0, y as f32 * 1000.0, (x * y) as f32 / 3.0])
}

#[test]
fn float_exr_keeps_every_bit() {
    let mut image = sample();
    image.pixels_mut()[5] = [f32::INFINITY, -1.0, f32::MIN_POSITIVE];
    let path = scratch("folder/that/is/missing/float.exr");
    write_exr(&path, &image, Precision::Float).unwrap();
    assert_eq!(read(&path).unwrap(), image);
}

#[test]
fn half_exr_keeps_eleven_bits() {
    let image = sample();
    let path = scratch("half.exr");
    write_exr(&path, &image, Precision::Half).unwrap();
    for (found, expected) in
        read(&path).unwrap().pixels().iter().flatten().zip(image.pixels().iter().flatten())
    {
        assert!((found - expected).abs() <= expected / 2048.0, "{found} for {expected}");
    }
}

#[test]
fn the_same_image_gives_the_same_bytes() {
    // Large enough for many compressed blocks, which are made in parallel.
    let image = Image::from_fn(300, 400, |x, y| [(x ^ y) as f32, (x * y % 91) as f32, 0.5]);
    let files = [scratch("once.exr"), scratch("twice.exr")].map(|path| {
        write_exr(&path, &image, Precision::Half).unwrap();
        fs::read(path).unwrap()
    });
    assert!(files[0] == files[1]);
}

#[test]
fn half_refuses_what_it_would_make_infinite() {
    let mut image = sample();
    image.pixels_mut()[37 * 2 + 4] = [0.0, 70_000.0, 0.0];
    let error = write_exr(scratch("overflow.exr"), &image, Precision::Half).unwrap_err().to_string();
    assert!(error.contains("(4, 2)") && error.contains("70000"), "{error}");
}

#[test]
fn png_comes_back_linear() {
    let picture = Picture::from_linear(&Image::filled(3, 2, [0.25, 0.5, 2.0]), 1.0);
    assert_eq!(picture.pixel(1, 1), [137, 188, 255]);
    let path = scratch("picture.png");
    write_png(&path, &picture).unwrap();
    let [red, green, blue] = read(&path).unwrap().pixel(2, 0);
    // Half a step of 8 bits is 0.2 % of white, a little more in linear light.
    assert!((red - 0.25).abs() < 0.004 && (green - 0.5).abs() < 0.004 && blue == 1.0, "{red} {green} {blue}");
}

#[test]
fn radiance_hdr_is_read_with_its_exponents() {
    // Flat (not run-length coded) RGBE: mantissa/256 · 2^(exponent − 128).
    let mut file = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    file.extend([128, 64, 32, 129, 200, 100, 50, 138]);
    let path = scratch("environment.hdr");
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, file).unwrap();
    let image = read(&path).unwrap();
    assert_eq!(image.pixels(), [[1.0, 0.5, 0.25], [800.0, 400.0, 200.0]]);
}

#[test]
fn an_empty_image_is_refused() {
    let empty = Image::filled(0, 5, [0.0; 3]);
    assert!(matches!(
        write_exr(scratch("empty.exr"), &empty, Precision::Float),
        Err(ImageError::Unstorable { .. })
    ));
    let picture = Picture::from_linear(&empty, 1.0);
    assert!(matches!(write_png(scratch("empty.png"), &picture), Err(ImageError::Unstorable { .. })));
}

#[test]
fn a_missing_file_is_named() {
    let error = read(scratch("nowhere.exr")).unwrap_err().to_string();
    assert!(error.contains("nowhere.exr"), "{error}");
}

#[test]
fn damaged_files_never_panic_and_short_ones_are_errors() {
    let image = Image::from_fn(19, 17, |x, y| [x as f32, y as f32, 1.0]);
    let exr = scratch("whole.exr");
    write_exr(&exr, &image, Precision::Half).unwrap();
    let png = scratch("whole.png");
    write_png(&png, &Picture::from_linear(&image, 0.05)).unwrap();
    for whole in [exr, png] {
        let bytes = fs::read(&whole).unwrap();
        let damaged = whole.with_extension("damaged");
        // What is missing of the last quarter may be a trailer that nobody needs.
        for length in (0..bytes.len() * 3 / 4).step_by(7) {
            fs::write(&damaged, &bytes[..length]).unwrap();
            assert!(read(&damaged).is_err(), "{} cut to {length} bytes was read", whole.display());
        }
        for index in 0..bytes.len().min(600) {
            let mut bytes = bytes.clone();
            bytes[index] ^= 0xff;
            fs::write(&damaged, &bytes).unwrap();
            // Some bytes do not matter; what counts is that nothing panics or takes all memory.
            let _ = read(&damaged);
        }
    }
}

#[test]
fn layers_keep_every_bit_and_what_they_are_about() {
    let odd = [0.0, -0.0, f32::MIN_POSITIVE / 4.0, f32::NAN, f32::INFINITY, 16_777_217.0];
    let mut layers = Layers::new(3, 2);
    layers.insert_image("", &Image::from_fn(3, 2, |x, y| [x as f32, y as f32, 0.5])).unwrap();
    layers.insert("samples", vec![64.0; 6]).unwrap();
    let texels: Vec<f32> = (0..24).map(|i| odd[i % 6] + (i / 6) as f32).collect();
    layers.insert_texels("sum", &texels).unwrap();
    layers.about.insert("scene".into(), "Würfel 立方体: two\nlines".into());
    layers.about.insert("seed".into(), "7".into());
    let path = scratch("layers.exr");
    write_layers(&path, &layers).unwrap();

    let back = read_layers(&path).unwrap();
    let bits = |values: Option<Vec<f32>>| values.unwrap().into_iter().map(f32::to_bits).collect::<Vec<_>>();
    assert_eq!(back.names().collect::<Vec<_>>(), layers.names().collect::<Vec<_>>());
    assert_eq!(bits(back.texels("sum")), bits(Some(texels)));
    assert_eq!(back.channel("samples"), Some(&[64.0; 6][..]));
    assert_eq!(back.about["scene"], "Würfel 立方体: two lines");
    assert_eq!(back.about["seed"], "7");
    // Who knows of no layers sees the picture.
    assert_eq!(read(&path).unwrap().pixel(2, 1), [2.0, 1.0, 0.5]);

    let again = scratch("layers_again.exr");
    write_layers(&again, &layers).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(&again).unwrap());
}

#[test]
fn a_layer_needs_a_value_for_every_pixel() {
    let mut layers = Layers::new(3, 2);
    let error = layers.insert("samples", vec![1.0; 5]).unwrap_err().to_string();
    assert!(error.contains("5 values") && error.contains('6'), "{error}");
    assert!(write_layers(scratch("none.exr"), &layers).unwrap_err().to_string().contains("empty"));
}

#[test]
fn damaged_layers_are_one_error_that_names_the_file() {
    let mut layers = Layers::new(16, 9);
    layers.insert("samples", (0..144).map(|i| i as f32).collect()).unwrap();
    layers.about.insert("seed".into(), "7".into());
    let path = scratch("layers_cut.exr");
    write_layers(&path, &layers).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for length in (0..bytes.len()).step_by(7) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let error = read_layers(&path).unwrap_err().to_string();
        assert!(error.contains("layers_cut.exr") && error.contains("damaged"), "{length}: {error}");
    }
}

#[cfg(unix)]
#[test]
fn writing_replaces_the_file_behind_a_link_and_leaves_nothing_else() {
    let folder = scratch("whole");
    let _ = std::fs::remove_dir_all(&folder);
    let (file, link) = (folder.join("file.exr"), folder.join("link.exr"));
    write_exr(&file, &sample(), Precision::Float).unwrap();
    std::os::unix::fs::symlink("file.exr", &link).unwrap();
    write_exr(&link, &Image::filled(2, 2, [1.0; 3]), Precision::Float).unwrap();
    assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(read(&file).unwrap().size(), (2, 2));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 2);
}

#[test]
fn whole_numbers_come_back_exactly() {
    let path = scratch("words.exr");
    let mut layers = Layers::new(2, 1);
    layers.insert_words("Y", vec![(1 << 24) + 1, u32::MAX]).unwrap();
    layers.insert("A", vec![0.5, 1.5]).unwrap();
    assert!(layers.insert_words("Z", vec![1]).is_err());
    write_layers(&path, &layers).unwrap();
    assert_eq!(read_layers(&path).unwrap(), layers);
}
