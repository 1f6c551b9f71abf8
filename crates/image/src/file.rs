//! Image files of any kind: which decoder a file needs, and the bytes in and out.

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

/// Writes `bytes` to `path`, making missing folders. Whoever reads the file meanwhile, and whatever ends this program,
/// the file is the old or the new one, never a part.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder
        .map_or(Ok(()), fs::create_dir_all)
        .and_then(|()| replace(path, bytes))
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    // A link stays, what it points to is replaced; what is no file (a pipe) can only be written to.
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&target).is_ok_and(|known| !known.is_file()) {
        return fs::write(&target, bytes);
    }
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = target.with_file_name(name);
    let written = fs::write(&part, bytes).and_then(|()| fs::rename(&part, &target));
    if written.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_file(&part);
    }
    written
}
