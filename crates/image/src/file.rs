//! Image files of any kind: which decoder a file needs.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};

use crate::colour::linear_from_srgb;
use crate::linear::MAX_PIXELS;
use crate::{Image, ImageError, exr_file, hdr_file};

/// Reads an EXR, Radiance HDR or PNG file, told apart by their content.
///
/// Of an EXR the channels R, G and B (or luminance and chroma Y, RY and BY, or the grey channel Y) are taken, from the
/// first part that has them, and further channels ignored; the image is what its display window shows, black where it
/// holds no data. HDR values are divided by the header's EXPOSURE and COLORCORR. PNG values are taken as sRGB and made linear, 1
/// being white; alpha is dropped.
///
/// # Errors
/// [`ImageError::Read`] when the file cannot be opened, [`ImageError::Invalid`] when its content cannot be used.
pub fn read(path: impl AsRef<Path>) -> Result<Image, ImageError> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| ImageError::Read { path: path.to_owned(), source })?;
    if bytes.starts_with(b"\x76\x2f\x31\x01") {
        exr_file::decode(path, &bytes)
    } else if bytes.starts_with(b"\x89PNG") {
        let mut image = decode_png(path, &bytes)?;
        for value in image.pixels_mut().iter_mut().flatten() {
            *value = linear_from_srgb(*value as f64) as f32;
        }
        Ok(image)
    } else if bytes.starts_with(b"#?") {
        hdr_file::decode(path, &bytes)
    } else {
        Err(ImageError::Invalid {
            path: path.to_owned(),
            problem: if bytes.is_empty() { "the file is empty" } else { "neither EXR, Radiance HDR nor PNG" }
                .to_owned(),
            advice: "convert it to one of these three".to_owned(),
        })
    }
}

/// Decodes a PNG without touching its transfer function.
fn decode_png(path: &Path, bytes: &[u8]) -> Result<Image, ImageError> {
    let invalid = |problem: String, advice: &str| ImageError::Invalid {
        path: path.to_owned(),
        problem,
        advice: advice.to_owned(),
    };
    let mut reader = ImageReader::with_format(Cursor::new(bytes), ImageFormat::Png);
    let mut limits = Limits::default();
    limits.max_alloc = Some(16 * MAX_PIXELS); // More than PNG decodes to.
    reader.limits(limits);
    let decoded: DynamicImage = reader
        .decode()
        .map_err(|error| invalid(error.to_string(), "the file is damaged or too large: write it again"))?;
    let rgb = decoded.into_rgb32f();
    let (width, height) = rgb.dimensions();
    let (triples, _) = rgb.as_raw().as_chunks::<3>();
    Image::from_pixels(width, height, triples.to_vec())
}
