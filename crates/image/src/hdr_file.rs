//! Radiance HDR in: the orientation and the units that the header states.
//!
//! The `image` crate decodes; it knows one of the eight orders of pixels, so that the line which states it is replaced
//! and the pixels are put in their places here (Ward, "Real Pixels", Graphics Gems II; Radiance's file formats).

use std::io::Read;
use std::path::Path;

use image::codecs::hdr::{HdrDecoder, HdrMetadata};
use image::{DynamicImage, ImageDecoder};

use crate::linear::MAX_PIXELS;
use crate::{Image, ImageError};

/// The order of the pixels.
#[derive(Debug, Clone, Copy)]
struct Order {
    /// Scan lines are rows, not columns.
    by_rows: bool,
    /// They go up, or leftwards.
    lines_reversed: bool,
    /// In each the pixels go leftwards, or up.
    pixels_reversed: bool,
    lines: u32,
    pixels: u32,
}

impl Order {
    /// From `-Y 32 +X 64`: scan lines from the top down, in each pixels from the left. Y points up.
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split_whitespace();
        let [first, lines, second, pixels] = [words.next()?, words.next()?, words.next()?, words.next()?];
        let reversed = |axis: &str| match axis {
            "-Y" | "+X" => Some(false),
            "+Y" | "-X" => Some(true),
            _ => None,
        };
        let by_rows = first.ends_with('Y');
        let order = Self {
            by_rows,
            lines_reversed: reversed(first)?,
            pixels_reversed: reversed(second)?,
            lines: lines.parse().ok()?,
            pixels: pixels.parse().ok()?,
        };
        (by_rows != second.ends_with('Y')).then_some(order)
    }

    /// The pixels, one scan line after the other, as an image.
    fn arrange(self, pixels: Vec<[f32; 3]>) -> Result<Image, ImageError> {
        let Self { by_rows, lines_reversed, pixels_reversed, lines, pixels: length } = self;
        let (width, height) = if by_rows { (length, lines) } else { (lines, length) };
        if by_rows && !lines_reversed && !pixels_reversed {
            return Image::from_pixels(width, height, pixels);
        }
        let turned = |at: u32, of: u32, is_reversed: bool| if is_reversed { of - 1 - at } else { at };
        Ok(Image::from_fn(width, height, |x, y| {
            let (line, pixel) = if by_rows { (y, x) } else { (x, y) };
            let line = turned(line, lines, lines_reversed) as usize;
            pixels[line * length as usize + turned(pixel, length, pixels_reversed) as usize]
        }))
    }
}

/// Decodes the bytes of a Radiance HDR file; `path` is for messages. Values are radiances: what the header says that
/// they were multiplied by is taken back.
pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Image, ImageError> {
    let invalid = |problem: String, advice: &str| ImageError::Invalid {
        path: path.to_owned(),
        problem,
        advice: advice.to_owned(),
    };
    // An empty line ends the header; the next states size and order.
    let start = bytes.windows(2).position(|pair| pair == b"\n\n").map(|at| at + 2);
    let end = start.and_then(|start| Some(start + bytes[start..].iter().position(|&byte| byte == b'\n')?));
    let Some((start, end)) = start.zip(end) else {
        return Err(invalid("its header does not end".to_owned(), "the file is damaged: write it again"));
    };
    let line = String::from_utf8_lossy(&bytes[start..end]);
    let order = Order::parse(&line).ok_or_else(|| {
        let short: String = line.chars().take(40).collect();
        invalid(
            format!("`{short}` is no size and order of pixels such as `-Y 512 +X 1024`"),
            "the file is damaged: write it again",
        )
    })?;
    let Order { lines, pixels, .. } = order;
    if u64::from(lines) * u64::from(pixels) > MAX_PIXELS {
        let problem =
            format!("{lines} lines of {pixels} pixels, more than the {MAX_PIXELS} that chiaro reads");
        return Err(invalid(problem, "crop it, or check whether the file is damaged"));
    }
    let usual = format!("-Y {lines} +X {pixels}");
    let (header, rest) = (&bytes[..start], &bytes[end..]);
    let file = header.chain(usual.as_bytes()).chain(rest);
    let damaged = |error: image::ImageError| {
        invalid(
            error.to_string(),
            "the file is damaged or of another kind: write it again as 32-bit_rle_rgbe",
        )
    };
    let decoder = HdrDecoder::new_nonstrict(file).map_err(damaged)?;
    let factor = factor(&decoder.metadata()).ok_or_else(|| {
        invalid(
            "its EXPOSURE and COLORCORR do not multiply to numbers above 0".to_owned(),
            "correct them in the header, which is text",
        )
    })?;
    debug_assert_eq!(decoder.dimensions(), (pixels, lines));
    let rgb = DynamicImage::from_decoder(decoder).map_err(damaged)?.into_rgb32f();
    let (triples, _) = rgb.as_raw().as_chunks::<3>();
    let radiance = triples.iter().map(|&[r, g, b]| [r / factor[0], g / factor[1], b / factor[2]]);
    order.arrange(radiance.collect())
}

/// What every channel was multiplied by.
fn factor(metadata: &HdrMetadata) -> Option<[f32; 3]> {
    let exposure = metadata.exposure.unwrap_or(1.0);
    let (r, g, b) = metadata.color_correction.unwrap_or((1.0, 1.0, 1.0));
    let factor = [r, g, b].map(|correction| exposure * correction);
    factor.iter().all(|factor| factor.is_normal() && *factor > 0.0).then_some(factor)
}
