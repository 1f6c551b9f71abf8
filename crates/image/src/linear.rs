//! An image of linear colours in memory.

use crate::ImageError;

/// Pixels that an image file may hold at most (16,384²), so that a damaged header cannot ask for all memory.
pub const MAX_PIXELS: u64 = 1 << 28;

/// A rectangle of an image's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Region {
    /// First column and row.
    pub start: [u32; 2],
    /// Columns and rows.
    pub size: [u32; 2],
}

impl Region {
    pub(crate) fn contains(self, [x, y]: [u32; 2]) -> bool {
        let inside = |at: u32, start: u32, size: u32| at >= start && at - start < size;
        inside(x, self.start[0], self.size[0]) && inside(y, self.start[1], self.size[1])
    }
}

impl std::fmt::Display for Region {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { start: [x, y], size: [width, height] } = self;
        write!(f, "{width}×{height} pixels from ({x}, {y})")
    }
}

/// Linear Rec. 709 colours, three `f32` a pixel, row after row from the top left.
///
/// The unit is the image's own: scene radiance in nits for a picture, metres for a depth image, and so on. There is
/// no alpha: chiaro's images are opaque, and files' alpha is ignored.
///
/// An EXR may hold a part of its picture only (its data window), and show a picture that begins elsewhere than at the
/// origin (its display window): [`Image::held`] and [`Image::origin`] tell. What is not held is black.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    width: u32,
    height: u32,
    pixels: Vec<[f32; 3]>,
    held: Region,
    origin: [i32; 2],
}

impl Image {
    fn whole(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Self {
        let held = Region { start: [0, 0], size: [width, height] };
        Self { width, height, pixels, held, origin: [0, 0] }
    }

    /// The part of a picture of this size, beginning at `origin`, that `held` names; `pixels` are that part's.
    pub(crate) fn part(
        (width, height): (u32, u32),
        origin: [i32; 2],
        held: Region,
        pixels: Vec<[f32; 3]>,
    ) -> Self {
        let whole = Self::whole(width, height, Vec::new());
        if held == whole.held {
            return Self { pixels, origin, ..whole };
        }
        let mut image = Self::filled(width, height, [0.0; 3]);
        let row = held.size[0] as usize;
        let first = held.start[1] as usize * width as usize + held.start[0] as usize;
        let rows = image.pixels[first..].chunks_mut(width as usize);
        for (target, source) in rows.zip(pixels.chunks_exact(row.max(1))) {
            target[..row].copy_from_slice(source);
        }
        Self { held, origin, ..image }
    }

    /// The rectangle of pixels that the file held: all but for crops.
    pub fn held(&self) -> Region {
        self.held
    }

    /// Where the picture's top left pixel is among those of the frames around it: (0, 0) but for some EXR files.
    pub fn origin(&self) -> [i32; 2] {
        self.origin
    }

    /// An image of one colour.
    pub fn filled(width: u32, height: u32, colour: [f32; 3]) -> Self {
        Self::whole(width, height, vec![colour; width as usize * height as usize])
    }

    /// An image whose pixel at column `x` and row `y` is `colour(x, y)`.
    pub fn from_fn(width: u32, height: u32, mut colour: impl FnMut(u32, u32) -> [f32; 3]) -> Self {
        let mut pixels = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                pixels.push(colour(x, y));
            }
        }
        Self::whole(width, height, pixels)
    }

    /// An image of the given pixels, row after row from the top left.
    ///
    /// # Errors
    /// [`ImageError::BufferLength`] unless there are exactly `width · height` pixels.
    pub fn from_pixels(width: u32, height: u32, pixels: Vec<[f32; 3]>) -> Result<Self, ImageError> {
        let expected = width as usize * height as usize;
        if pixels.len() == expected {
            Ok(Self::whole(width, height, pixels))
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
