//! Pictures for the eye: 8-bit sRGB, and PNG files of them.

use std::io::Cursor;
use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::colour::srgb8_from_linear;
use crate::write::write_bytes;
use crate::{Image, ImageError};

/// 8-bit sRGB, three bytes a pixel, row after row from the top left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    width: u32,
    height: u32,
    bytes: Vec<u8>,
}

impl Picture {
    /// A picture of bytes that are tone-mapped and sRGB-encoded already.
    ///
    /// # Errors
    /// [`ImageError::BufferLength`] unless there are exactly `3 · width · height` bytes.
    pub fn from_bytes(width: u32, height: u32, bytes: Vec<u8>) -> Result<Self, ImageError> {
        let expected = 3 * width as usize * height as usize;
        if bytes.len() == expected {
            Ok(Self { width, height, bytes })
        } else {
            Err(ImageError::BufferLength { what: "the picture", width, height, expected, found: bytes.len() })
        }
    }

    /// A linear image times `exposure`, clamped and sRGB-encoded, without any tone curve: for debug views and heat
    /// maps. Frames for people go through the renderer's tone mapping instead.
    pub fn from_linear(image: &Image, exposure: f32) -> Self {
        let bytes =
            image.pixels().iter().flatten().map(|&value| srgb8_from_linear(value * exposure)).collect();
        Self { width: image.width(), height: image.height(), bytes }
    }

    /// A black picture to draw on.
    pub(crate) fn black(width: u32, height: u32) -> Self {
        Self { width, height, bytes: vec![0; 3 * width as usize * height as usize] }
    }

    /// Sets one pixel; what lies outside the picture is clipped.
    pub(crate) fn set(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            let start = 3 * (y as usize * self.width as usize + x as usize);
            self.bytes[start..start + 3].copy_from_slice(&colour);
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All bytes, `r g b r g b …`, row after row from the top left.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The pixel at column `x` and row `y`.
    ///
    /// # Panics
    /// Outside the picture.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 3] {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) of a {}×{} picture",
            self.width,
            self.height
        );
        let start = 3 * (y as usize * self.width as usize + x as usize);
        [self.bytes[start], self.bytes[start + 1], self.bytes[start + 2]]
    }
}

/// Writes an 8-bit PNG; missing folders of `path` are made. The same picture gives the same bytes.
///
/// # Errors
/// [`ImageError::Write`] when the operating system refuses, [`ImageError::Unstorable`] for a picture without pixels.
pub fn write_png(path: impl AsRef<Path>, picture: &Picture) -> Result<(), ImageError> {
    let path = path.as_ref();
    let mut encoded = Cursor::new(Vec::new());
    PngEncoder::new(&mut encoded)
        .write_image(&picture.bytes, picture.width, picture.height, ExtendedColorType::Rgb8)
        .map_err(|error| ImageError::Unstorable {
            path: path.to_owned(),
            problem: error.to_string(),
            advice: "a PNG needs at least one pixel".to_owned(),
        })?;
    write_bytes(path, &encoded.into_inner())
}
