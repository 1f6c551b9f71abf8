//! Golden images: small pictures under `goldens/` that a person has looked at.

use std::path::Path;

use chiaro_image::{Image, Picture, colour, write_png};

use crate::files::root;

/// Goldens are committed, so they stay small.
const MAX_BYTES: u64 = 64 << 10;

/// How far a picture may be from its golden, in 8-bit sRGB code values.
#[derive(Clone, Copy, Debug)]
pub struct Tolerance {
    /// Mean absolute difference over all channels.
    pub mean: f64,
    /// A pixel differs when any channel is further off than this.
    pub level: u8,
    /// Largest share of the pixels that may differ.
    pub share: f64,
}

impl Default for Tolerance {
    /// Software Vulkan repeats itself to the bit. Other drivers round differently, which the dither turns into single
    /// code values, and rasterise edges differently, which changes a pixel's mean over its samples.
    fn default() -> Self {
        Self { mean: 1.0, level: 8, share: 0.01 }
    }
}

/// Compares a picture with `goldens/NAME.png`. With `CHIARO_BLESS=1` writes it there instead.
///
/// # Panics
/// When they differ, or there is no golden: the picture then lies under `target/goldens`, and both paths are named.
pub fn assert_golden(name: &str, actual: &Picture, tolerance: Tolerance) {
    let golden = root().join("goldens").join(format!("{name}.png"));
    if std::env::var_os("CHIARO_BLESS").is_some_and(|value| value == "1") {
        write(&golden, actual);
        let bytes = std::fs::metadata(&golden).map_or(0, |file| file.len());
        assert!(bytes <= MAX_BYTES, "{} has {bytes} bytes, more than {MAX_BYTES}", golden.display());
        return;
    }
    let problem = match chiaro_image::read(&golden) {
        Err(error) => Some(error.to_string()),
        Ok(image) => difference(actual, &image, tolerance),
    };
    if let Some(problem) = problem {
        let folder = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), Into::into);
        let path = folder.join("goldens").join(format!("{name}.png"));
        write(&path, actual);
        panic!(
            "{name}: {problem}\n  golden {}\n  actual {}\nCHIARO_BLESS=1 makes the actual picture the golden",
            golden.display(),
            path.display()
        );
    }
}

fn write(path: &Path, picture: &Picture) {
    if let Err(error) = write_png(path, picture) {
        panic!("{error}");
    }
}

/// What is wrong with `actual`, or nothing.
fn difference(actual: &Picture, golden: &Image, tolerance: Tolerance) -> Option<String> {
    if golden.size() != (actual.width(), actual.height()) {
        return Some(format!("{}×{} pixels instead of {:?}", actual.width(), actual.height(), golden.size()));
    }
    let golden: Vec<u8> =
        golden.pixels().iter().flatten().map(|&value| colour::srgb8_from_linear(value)).collect();
    let off: Vec<u8> = actual.bytes().iter().zip(&golden).map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = off.iter().map(|&d| f64::from(d)).sum::<f64>() / off.len() as f64;
    let (pixels, _) = off.as_chunks::<3>();
    let differing = pixels.iter().filter(|pixel| pixel.iter().any(|&d| d > tolerance.level)).count();
    let share = differing as f64 / pixels.len() as f64;
    (mean > tolerance.mean || share > tolerance.share).then(|| {
        format!(
            "code values are off by {mean:.3} on average (allowed {}), and {:.2} % of the pixels by more than {} \
             (allowed {} %)",
            tolerance.mean,
            100.0 * share,
            tolerance.level,
            100.0 * tolerance.share
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(level: u8) -> Picture {
        Picture::from_bytes(10, 10, vec![level; 300]).unwrap()
    }

    fn image(picture: &Picture) -> Image {
        let (bytes, _) = picture.bytes().as_chunks::<3>();
        let pixels = bytes.iter().map(|b| b.map(|v| colour::linear_from_srgb(f64::from(v) / 255.0) as f32));
        Image::from_pixels(picture.width(), picture.height(), pixels.collect()).unwrap()
    }

    #[test]
    fn equal_pictures_pass_and_a_brighter_one_does_not() {
        let golden = image(&grey(100));
        assert_eq!(difference(&grey(100), &golden, Tolerance { mean: 0.0, level: 0, share: 0.0 }), None);
        assert!(difference(&grey(102), &golden, Tolerance::default()).is_some());
    }

    #[test]
    fn two_wrong_pixels_of_a_hundred_are_found() {
        let golden = image(&grey(100));
        let mut bytes = vec![100; 300];
        bytes[30] = 150;
        assert_eq!(
            difference(&Picture::from_bytes(10, 10, bytes.clone()).unwrap(), &golden, Tolerance::default()),
            None
        );
        bytes[60] = 150;
        assert!(
            difference(&Picture::from_bytes(10, 10, bytes).unwrap(), &golden, Tolerance::default()).is_some()
        );
    }

    #[test]
    fn another_size_is_a_difference() {
        let golden = Image::filled(10, 9, [0.0; 3]);
        assert!(difference(&grey(0), &golden, Tolerance::default()).unwrap().contains("pixels"));
    }
}
