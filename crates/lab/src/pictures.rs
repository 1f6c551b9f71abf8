//! Pixels that come back from the device as images.

use chiaro::Pixels;
use chiaro_image::{Image, Picture};

use crate::Error;

/// What a screen shows.
///
/// # Errors
/// When the pixels are not those of a picture.
pub fn screen(pixels: &Pixels) -> Result<Picture, Error> {
    let rgb = pixels.bytes.chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
    Ok(Picture::from_bytes(pixels.width, pixels.height, rgb)?)
}

/// The mean of a sum of so many samples.
///
/// # Errors
/// When the pixels are not Rgba32Float.
pub fn mean(sum: &Pixels, samples: u32) -> Result<Image, Error> {
    let share = 1.0 / samples.max(1) as f32;
    let pixels = sum
        .floats()
        .chunks_exact(4)
        .map(|rgba| [rgba[0] * share, rgba[1] * share, rgba[2] * share])
        .collect();
    Ok(Image::from_pixels(sum.width, sum.height, pixels)?)
}
