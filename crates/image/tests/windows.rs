//! Pictures that are not stored as a whole from the top left: EXR's windows and chroma, Radiance's orders and units.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use chiaro_image::{
    CompareOptions, Comparison, Image, ImageError, Metrics, Precision, Region, read, read_layers, write_exr,
};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, SmallVec, Vec2, WritableImage,
};

/// A file in the folder that cargo keeps for this test.
fn scratch(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("image_windows");
    fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// First column and row, columns and rows.
type Window = ([i32; 2], [usize; 2]);

/// An EXR of these channels, whose values come from the pixel's absolute place.
fn exr_of(
    name: &str,
    (data_at, [width, height]): Window,
    display: Window,
    channels: &[(&str, fn(i32, i32) -> f32)],
) -> PathBuf {
    let channel = |(name, value): &(&str, fn(i32, i32) -> f32)| {
        let places = (0..height as i32).flat_map(|y| (0..width as i32).map(move |x| (x, y)));
        let values = places.map(|(x, y)| value(data_at[0] + x, data_at[1] + y)).collect();
        AnyChannel::new(*name, FlatSamples::F32(values))
    };
    let channels: SmallVec<[_; 4]> = channels.iter().map(channel).collect();
    let attributes =
        LayerAttributes { layer_position: Vec2(data_at[0], data_at[1]), ..LayerAttributes::default() };
    let layer =
        Layer::new(Vec2(width, height), attributes, Encoding::UNCOMPRESSED, AnyChannels::sort(channels));
    let (at, size) = display;
    let window = IntegerBounds::new(Vec2(at[0], at[1]), Vec2(size[0], size[1]));
    let file = ExrImage::new(ImageAttributes::new(window), layer);
    let path = scratch(name);
    file.write().to_file(&path).unwrap();
    path
}

/// Red is 1 + the column, green the row, blue 1.
fn crop(name: &str, data: Window, display: Window) -> PathBuf {
    exr_of(name, data, display, &[("R", |x, _| 1.0 + x as f32), ("G", |_, y| y as f32), ("B", |_, _| 1.0)])
}

fn compared(a: &Image, b: &Image) -> Result<Metrics, ImageError> {
    Ok(Comparison::new(a, b, &CompareOptions::default())?.metrics())
}

#[test]
fn a_crop_lies_where_its_data_window_says_and_the_rest_is_black() {
    let image = read(crop("crop.exr", ([4, 1], [3, 2]), ([0, 0], [8, 4]))).unwrap();
    assert_eq!((image.size(), image.origin()), ((8, 4), [0, 0]));
    assert_eq!(image.held(), Region { start: [4, 1], size: [3, 2] });
    for (x, y) in (0..4).flat_map(|y| (0..8).map(move |x| (x, y))) {
        let is_held = (4..7).contains(&x) && (1..3).contains(&y);
        let expected = if is_held { [1.0 + x as f32, y as f32, 1.0] } else { [0.0; 3] };
        assert_eq!(image.pixel(x, y), expected, "({x}, {y})");
    }
}

#[test]
fn a_margin_around_the_display_window_is_cut_off_wherever_that_begins() {
    let image = read(crop("margin.exr", ([-30, 5], [40, 20]), ([-20, 10], [8, 4]))).unwrap();
    assert_eq!((image.size(), image.origin()), ((8, 4), [-20, 10]));
    assert_eq!(image.held(), Region { start: [0, 0], size: [8, 4] });
    assert_eq!((image.pixel(0, 0), image.pixel(7, 3)), ([-19.0, 10.0, 1.0], [-12.0, 13.0, 1.0]));
}

#[test]
fn crops_are_compared_where_both_hold_pixels_and_not_at_all_where_they_do_not_meet() {
    let frame = ([0, 0], [16, 8]);
    let full = read(crop("full.exr", frame, frame)).unwrap();
    let left = read(crop("left.exr", ([0, 0], [10, 8]), frame)).unwrap();
    let right = read(crop("right.exr", ([8, 2], [8, 6]), frame)).unwrap();
    let metrics = compared(&left, &full).unwrap();
    assert_eq!((metrics.pixels, metrics.nmae), (80, 0.0));
    let metrics = compared(&left, &right).unwrap();
    assert_eq!((metrics.pixels, metrics.nmae, metrics.mean_ratio), (12, 0.0, 1.0));
    // What is subtracted must be held, too; a mask masks nothing where it holds nothing.
    let options = CompareOptions { minus_b: Some(&right), ..CompareOptions::default() };
    assert!(
        Comparison::new(&left, &full, &options).is_err_and(|e| matches!(e, ImageError::NoReference { .. }))
    );
    let options = CompareOptions { mask: Some(&right), ..CompareOptions::default() };
    assert_eq!(Comparison::new(&full, &full, &options).unwrap().metrics().pixels, 16 * 8 - 8 * 6);

    let far = read(crop("far.exr", ([10, 0], [6, 8]), frame)).unwrap();
    for (a, b) in [(&left, &far), (&far, &left)] {
        let error = compared(a, b).unwrap_err().to_string();
        assert!(
            error.contains("no pixel in common") && error.contains("10×8") && error.contains("(10, 0)"),
            "{error}"
        );
    }
    let elsewhere = read(crop("elsewhere.exr", ([16, 0], [16, 8]), ([16, 0], [16, 8]))).unwrap();
    let error = compared(&elsewhere, &full).unwrap_err().to_string();
    assert!(error.contains("(16, 0)") && error.contains("display window"), "{error}");
}

#[test]
fn layers_tell_that_they_are_a_part() {
    let frame = ([0, 0], [16, 8]);
    assert!(!read_layers(crop("layers.exr", frame, frame)).unwrap().is_part());
    let part = read_layers(crop("part.exr", ([8, 2], [8, 6]), frame)).unwrap();
    assert!(part.is_part());
    assert_eq!(part.size(), (8, 6));
}

/// The bytes of a small EXR with this window (x and y of the first and last pixel) instead of its own.
fn with_window(attribute: &str, window: [i32; 4]) -> Vec<u8> {
    let path = scratch(&format!("{attribute}.exr"));
    write_exr(&path, &Image::filled(4, 2, [1.0; 3]), Precision::Float).unwrap();
    let mut bytes = fs::read(path).unwrap();
    let name = format!("{attribute}\0box2i\0");
    let at = bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap() + name.len() + 4;
    for (k, value) in window.into_iter().enumerate() {
        bytes[at + 4 * k..at + 4 * k + 4].copy_from_slice(&value.to_le_bytes());
    }
    bytes
}

#[test]
fn windows_out_of_all_bounds_are_one_error_that_names_the_file() {
    let hostile = [
        [0, 0, i32::MAX, i32::MAX],
        [i32::MIN, i32::MIN, i32::MAX, i32::MAX],
        [i32::MIN, 0, i32::MIN + 3, 1],
        [0, 0, 1 << 29, 1 << 29],
        [-(1 << 29), -(1 << 29), 1 << 29, 1 << 29],
        [0, 0, (1 << 28) - 1, 1],
        [0, 0, 20_000, 12_000],
    ];
    let path = scratch("hostile.exr");
    for window in hostile {
        for attribute in ["dataWindow", "displayWindow"] {
            fs::write(&path, with_window(attribute, window)).unwrap();
            let error = read(&path).expect_err(&format!("{attribute} {window:?}")).to_string();
            assert!(error.contains("hostile.exr"), "{error}");
        }
        fs::write(&path, with_window("dataWindow", window)).unwrap();
        assert!(read_layers(&path).is_err());
    }
    // The windows miss each other.
    fs::write(&path, with_window("displayWindow", [100, 100, 103, 101])).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("hostile.exr") && error.contains("outside"), "{error}");
    // Corners in the wrong order, and one pixel: whatever they mean, nothing panics.
    for window in [[3, 1, 0, 0], [0, 0, -1, -1], [2, 1, 2, 1]] {
        for attribute in ["dataWindow", "displayWindow"] {
            fs::write(&path, with_window(attribute, window)).unwrap();
            let _ = read(&path);
        }
    }
}

#[test]
fn luminance_and_chroma_of_full_size_become_colours_and_other_chroma_is_refused_by_name() {
    // (0.4, 0.2, 0.1) and grey.
    let y: fn(i32, i32) -> f32 = |x, _| if x == 0 { 0.2126 * 0.4 + 0.7152 * 0.2 + 0.0722 * 0.1 } else { 0.5 };
    let ry: fn(i32, i32) -> f32 =
        |x, _| if x == 0 { 0.4 / (0.2126 * 0.4 + 0.7152 * 0.2 + 0.0722 * 0.1) - 1.0 } else { 0.0 };
    let by: fn(i32, i32) -> f32 =
        |x, _| if x == 0 { 0.1 / (0.2126 * 0.4 + 0.7152 * 0.2 + 0.0722 * 0.1) - 1.0 } else { 0.0 };
    let frame = ([0, 0], [2, 2]);
    let image = read(exr_of("chroma.exr", frame, frame, &[("Y", y), ("RY", ry), ("BY", by)])).unwrap();
    for (found, expected) in image.pixels()[..2].iter().flatten().zip([0.4, 0.2, 0.1, 0.5, 0.5, 0.5]) {
        assert!((found - expected).abs() < 1e-6, "{image:?}");
    }
    assert_eq!(read(exr_of("grey.exr", frame, frame, &[("Y", y)])).unwrap().pixel(1, 1), [0.5; 3]);
    let error = read(exr_of("half.exr", frame, frame, &[("Y", y), ("RY", ry)])).unwrap_err().to_string();
    assert!(error.contains("RY"), "{error}");

    // Sampling 2 × 2 in the channel list: after the name, type, linearity and padding.
    let path = exr_of("sub.exr", frame, frame, &[("Y", y), ("RY", ry), ("BY", by)]);
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.windows(3).position(|w| w == b"BY\0").unwrap() + 3 + 8;
    for at in [at, at + 4] {
        assert_eq!(bytes[at..at + 4], [1, 0, 0, 0]);
        bytes[at] = 2;
    }
    fs::write(&path, bytes).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("sub.exr") && error.contains("luminance-chroma"), "{error}");
}

/// Tests run beside each other.
static NUMBER: AtomicU32 = AtomicU32::new(0);

/// A Radiance file of pixels one after the other, in which red is the number from 0.
fn hdr(header: &str, order: &str, pixels: u8) -> Result<Image, ImageError> {
    let mut file = format!("#?RADIANCE\n{header}FORMAT=32-bit_rle_rgbe\n\n{order}\n").into_bytes();
    file.extend((0..pixels).flat_map(|i| [i, 16, 32, 136]));
    let path = scratch(&format!("{}.orders.hdr", NUMBER.fetch_add(1, Ordering::Relaxed)));
    fs::write(&path, file).unwrap();
    let image = read(&path);
    fs::remove_file(path).unwrap();
    image
}

#[test]
fn radiance_pixels_are_put_in_their_places_from_all_eight_orders() {
    // Rows from the top of a picture three wide and two high, by the number of the pixel in the file.
    for (order, rows) in [
        ("-Y 2 +X 3", [[0, 1, 2], [3, 4, 5]]),
        ("-Y 2 -X 3", [[2, 1, 0], [5, 4, 3]]),
        ("+Y 2 +X 3", [[3, 4, 5], [0, 1, 2]]),
        ("+Y 2 -X 3", [[5, 4, 3], [2, 1, 0]]),
        ("+X 3 -Y 2", [[0, 2, 4], [1, 3, 5]]),
        ("+X 3 +Y 2", [[1, 3, 5], [0, 2, 4]]),
        ("-X 3 -Y 2", [[4, 2, 0], [5, 3, 1]]),
        ("-X 3 +Y 2", [[5, 3, 1], [4, 2, 0]]),
    ] {
        let image = hdr("", order, 6).unwrap();
        assert_eq!(image.size(), (3, 2), "{order}");
        let red: Vec<f32> = image.pixels().iter().map(|pixel| pixel[0]).collect();
        assert_eq!(red, rows.as_flattened().iter().map(|&i| i as f32).collect::<Vec<_>>(), "{order}");
    }
}

#[test]
fn radiance_values_are_divided_by_all_exposures_and_corrections() {
    let image =
        hdr("EXPOSURE=4\nCOLORCORR=1 2 4\nEXPOSURE=0.5\nCOLORCORR=0.5 1 1\n", "-Y 1 +X 4", 4).unwrap();
    assert_eq!(image.pixel(3, 0), [3.0, 4.0, 4.0]);
    for header in ["EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=nan\n", "COLORCORR=1 0 1\n", "EXPOSURE=inf\n"] {
        let error = hdr(header, "-Y 1 +X 4", 4).unwrap_err().to_string();
        assert!(error.contains("orders.hdr") && error.contains("EXPOSURE"), "{error}");
    }
}

#[test]
fn damaged_radiance_files_are_one_error_that_names_the_file() {
    for order in [
        "",
        "-Y 2",
        "-Y 2 +Y 3",
        "+X 2 -X 3",
        "-Y two +X 3",
        "-Z 2 +X 3",
        "-Y 2 +X -3",
        "-Y 4294967296 +X 1",
        "-Y 4294967295 +X 4294967295",
        "-Y 2 +X 4",
        "-Y 16384 +X 16384",
    ] {
        let error = hdr("", order, 6).unwrap_err().to_string();
        assert!(error.contains("orders.hdr"), "{order}: {error}");
    }
    let path = scratch("headless.hdr");
    for file in [
        &b"#?RADIANCE"[..],
        b"#?RADIANCE\n\n",
        b"#?RADIANCE\n\n-Y 1 +X 1",
        b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd",
    ] {
        fs::write(&path, file).unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("headless.hdr"));
    }
}
