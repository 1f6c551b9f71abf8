//! An image of linear colours in memory.

use crate::ImageError;

/// Pixels that an image file may hold at most (16,384²), so that a damaged header cannot ask for all memory.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Linear Rec. 709 colours, three `f32` a pixel, row after row from the top left.
///
/// The unit is the image's own: scene radiance in nits for a picture, metres for a depth image, and so on. There is
/// no alpha: chiaro's images are opaque, and files' alpha is ignored.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[f32; 3]>,
}

impl Image {
    /// An image of one colour.
    pub fn filled(width: u32, height: u32, colour: [f32; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    /// An image whose pixel at column `x` and row `y` is `colour(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut colour: impl FnMut(u32, u32) -> [f32; 3]) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                pixels.push(colour(x, y));
            }
        }
        Self { width, height, pixels }
    }

    /// An image of the given pixels, row after row from the top left.
    ///
    /// # Errors
    /// [`ImageError::BufferLength`] unless there are exactly `width · height` pixels.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Result<Self, ImageError> {
        let expected = width as usize * height as usize;
        if pixels.len() == expected {
            Ok(Self { width, height, pixels })
        } else {
            Err(ImageError::BufferLength { what: "the image", width, height, expected, found: pixels.len() })
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

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// All pixels, row after row from the top left.
    pub fn pixels(&self) -> &[[f32; 3]] {
        &self.pixels
    }

    /// All pixels, to be changed in place.
    pub fn pixels_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.pixels
    }

    /// All pixels, without a copy.
    pub fn into_pixels(self) -> Vec<[f32; 3]> {
        self.pixels
    }

    /// The pixel at column `x` and row `y`.
    ///
    /// # Panics
    /// Outside the image.
    pub fn pixel(&self, x: u32, y: u32) -> [f32; 3] {
        assert!(
            x < self.width && y < self.height,
            "pixel ({x}, {y}) of a {}×{} image",
            self.width,
            self.height
        );
        self.pixels[y as usize * self.width as usize + x as usize]
    }
}
