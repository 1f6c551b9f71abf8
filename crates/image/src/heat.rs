//! The picture of a comparison: where, and how much, two images differ.

use crate::filter::Plane;
use crate::{Comparison, Picture};

/// What a heat map shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Heat {
    /// |A−B| relative to the mean of B, logarithmic from 1 % (black) to 1000 % (white).
    #[default]
    Error,
    /// LDR-FLIP, from 0 (black) to 1 (white).
    Flip,
    /// HDR-FLIP, from 0 (black) to 1 (white).
    HdrFlip,
    /// A − B relative to the mean of B: blue where A is too dark, red where it is too bright, logarithmic from 1 % (black) to
    /// 100 % on either side.
    Signed,
}

/// Relative error at the dark end of the scale; smaller ones are as dark.
const LEAST: f64 = 0.01;
/// Decades from [`LEAST`] to the bright end.
const DECADES: u32 = 3;
/// Of a signed error, to either end.
const SIGNED_DECADES: u32 = 2;

impl Heat {
    /// Labels of the scale, at equal distances.
    fn labels(self) -> &'static [&'static str] {
        match self {
            Self::Error => &["1%", "10%", "100%", "1000%"],
            Self::Flip | Self::HdrFlip => &["0", "0.5", "1"],
            Self::Signed => &["-100%", "-10%", "0", "10%", "100%"],
        }
    }

    /// Where each pixel is on the scale, 0–1.
    fn positions(self, comparison: &Comparison) -> Plane {
        match self {
            Self::Error => errors(comparison).map(position_of).collect(),
            Self::Flip => comparison.flip_map(),
            Self::HdrFlip => comparison.hdr_flip_map(),
            Self::Signed => signed_errors(comparison).map(signed_position_of).collect(),
        }
    }

    /// The colour of a place on the scale.
    fn colour(self, position: f64) -> [u8; 3] {
        ramp(if self == Self::Signed { &SIGNED_RAMP } else { &RAMP }, position)
    }
}

/// A − B relative to the mean of B, on average over the colours.
fn signed_errors(comparison: &Comparison) -> impl Iterator<Item = f64> {
    let Comparison { a, b, reference_mean, .. } = comparison;
    (0..comparison.keep.len()).map(move |index| {
        let difference: f64 = a.iter().zip(b).map(|(a, b)| a[index] - b[index]).sum();
        difference / 3.0 / reference_mean.abs()
    })
}

/// |A−B| relative to the mean of B.
fn errors(comparison: &Comparison) -> impl Iterator<Item = f64> {
    let Comparison { a, b, reference_mean, .. } = comparison;
    (0..comparison.keep.len()).map(move |index| {
        let absolute: f64 = a.iter().zip(b).map(|(a, b)| (a[index] - b[index]).abs()).sum();
        absolute / 3.0 / reference_mean.abs()
    })
}

const MASKED: [u8; 3] = [96, 96, 96];
const NOT_FINITE: [u8; 3] = [0, 255, 0];
const INK: [u8; 3] = [255, 255, 255];

/// Pixels from the map to the scale, around it, and the scale's height.
const MARGIN: u32 = 6;
const BAR_HEIGHT: u32 = 12;
const TICK: u32 = 3;
/// The scale needs this width for its labels; narrower maps get a wider picture.
const LEAST_WIDTH: u32 = 180;

/// Colours from no error to the largest, brighter all the way so that the map reads in grey, too: black, blue,
/// violet, red, orange, yellow, white.
const RAMP: [[u8; 3]; 7] = [
    [0, 0, 0],
    [28, 16, 110],
    [118, 26, 138],
    [205, 50, 80],
    [243, 122, 32],
    [250, 208, 70],
    [255, 255, 255],
];

/// From far too dark over right to far too bright, as bright on either side.
const SIGNED_RAMP: [[u8; 3]; 5] = [[110, 225, 255], [20, 90, 230], [0, 0, 0], [205, 40, 30], [255, 200, 60]];

/// Width and height of a glyph, and from one to the next.
const GLYPH: (u32, u32) = (5, 7);
const ADVANCE: u32 = 6;

impl Comparison {
    /// One figure of every pixel in false colours over a labelled scale that is the same for all comparisons. Masked
    /// pixels are grey, pixels where A is not finite green.
    pub fn heat_map(&self, heat: Heat) -> Picture {
        let (width, height) = (self.width as u32, self.height as u32);
        let full_width = width.max(LEAST_WIDTH);
        let bar_top = height + MARGIN;
        let label_top = bar_top + BAR_HEIGHT + TICK + 2;
        let mut picture = Picture::black(full_width, label_top + GLYPH.1 + MARGIN);
        for (index, position) in heat.positions(self).into_iter().enumerate() {
            let colour = if !self.keep[index] {
                MASKED
            } else if self.bad[index] {
                NOT_FINITE
            } else {
                heat.colour(position)
            };
            picture.set(index as u32 % width, index as u32 / width, colour);
        }

        let bar = full_width - 2 * MARGIN;
        for x in 0..bar {
            let colour = heat.colour(x as f64 / (bar - 1) as f64);
            for y in 0..BAR_HEIGHT {
                picture.set(MARGIN + x, bar_top + y, colour);
            }
            // A frame, for the dark end would otherwise vanish in the background.
            picture.set(MARGIN + x, bar_top - 1, INK);
            picture.set(MARGIN + x, bar_top + BAR_HEIGHT, INK);
        }
        let labels = heat.labels();
        for (index, label) in labels.iter().enumerate() {
            let x = MARGIN + (bar - 1) * index as u32 / (labels.len() as u32 - 1);
            for y in bar_top..bar_top + BAR_HEIGHT + TICK {
                picture.set(x, y, INK);
            }
            let length = ADVANCE * label.len() as u32 - 1;
            let start = (x.saturating_sub(length / 2)).clamp(MARGIN, full_width - MARGIN - length);
            write(&mut picture, start, label_top, label);
        }
        picture
    }
}

/// Where a relative error is on the scale.
fn position_of(error: f64) -> f64 {
    (error.max(LEAST) / LEAST).log10() / DECADES as f64
}

/// Where a signed relative error is on the scale.
fn signed_position_of(error: f64) -> f64 {
    0.5 + 0.5 * (error.abs().max(LEAST) / LEAST).log10() / SIGNED_DECADES as f64 * error.signum()
}

/// A ramp's colour at 0–1, clamped.
fn ramp(colours: &[[u8; 3]], position: f64) -> [u8; 3] {
    let scaled = position.clamp(0.0, 1.0) * (colours.len() - 1) as f64;
    let below = (scaled as usize).min(colours.len() - 2);
    let share = scaled - below as f64;
    let mix = |channel: usize| {
        let (low, high) = (colours[below][channel] as f64, colours[below + 1][channel] as f64);
        (low + (high - low) * share).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

fn write(picture: &mut Picture, left: u32, top: u32, text: &str) {
    for (index, letter) in text.chars().enumerate() {
        for (y, row) in (0..).zip(glyph(letter)) {
            for x in (0..GLYPH.0).filter(|x| row >> (GLYPH.0 - 1 - x) & 1 == 1) {
                picture.set(left + ADVANCE * index as u32 + x, top + y, INK);
            }
        }
    }
}

/// The few letters that the scale's labels need.
fn glyph(letter: char) -> [u8; GLYPH.1 as usize] {
    match letter {
        '0' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        '1' => [0b00100, 0b01100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        '5' => [0b11111, 0b10000, 0b11110, 0b00001, 0b00001, 0b10001, 0b01110],
        '.' => [0, 0, 0, 0, 0, 0b00100, 0b00100],
        '-' => [0, 0, 0, 0b01110, 0, 0, 0],
        _ => [0b11001, 0b11010, 0b00010, 0b00100, 0b01000, 0b01011, 0b10011],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CompareOptions, Image, colour};

    fn draw(a: &Image, b: &Image, mask: Option<&Image>) -> Picture {
        let options = CompareOptions { mask, ..CompareOptions::default() };
        Comparison::new(a, b, &options).unwrap().heat_map(Heat::Error)
    }

    fn colour_of(error: f64) -> [u8; 3] {
        ramp(&RAMP, position_of(error))
    }

    #[test]
    fn brighter_means_a_larger_error() {
        let luminance = |error: f64| {
            colour::luminance(
                colour_of(error).map(|byte| colour::linear_from_srgb(byte as f64 / 255.0) as f32),
            )
        };
        let steps: Vec<f32> =
            (0..=60).map(|step| luminance(LEAST * 10_f64.powf(step as f64 / 20.0))).collect();
        assert!(steps.is_sorted_by(|low, high| low < high), "{steps:?}");
    }

    #[test]
    fn the_scale_ends_in_black_and_white() {
        assert_eq!(colour_of(0.0), RAMP[0]);
        assert_eq!(colour_of(0.01), RAMP[0]);
        assert_eq!(colour_of(10.0), RAMP[6]);
        assert_eq!(colour_of(f64::INFINITY), RAMP[6]);
    }

    #[test]
    fn masked_broken_equal_and_wrong_pixels_look_different() {
        let reference = Image::filled(4, 1, [1.0; 3]);
        let mut image = reference.clone();
        image.pixels_mut()[1] = [f32::NAN; 3];
        image.pixels_mut()[2] = [12.0; 3];
        let mask = Image::from_fn(4, 1, |x, _| if x == 3 { [1.0; 3] } else { [0.0; 3] });
        let picture = draw(&image, &reference, Some(&mask));
        assert_eq!([0, 1, 2, 3].map(|x| picture.pixel(x, 0)), [RAMP[0], NOT_FINITE, RAMP[6], MASKED]);
    }

    #[test]
    fn even_a_single_pixel_gets_a_whole_scale() {
        let picture = draw(&Image::filled(1, 1, [1.0; 3]), &Image::filled(1, 1, [2.0; 3]), None);
        assert_eq!(picture.width(), LEAST_WIDTH);
        assert_eq!(picture.pixel(LEAST_WIDTH - MARGIN - 2, 1 + MARGIN + 1)[0], 255);
    }

    #[test]
    fn a_signed_error_is_blue_where_too_dark_and_red_where_too_bright() {
        let reference = Image::filled(3, 1, [1.0; 3]);
        let image = Image::from_fn(3, 1, |x, _| [0.9 + 0.1 * x as f32; 3]);
        let comparison = Comparison::new(&image, &reference, &CompareOptions::default()).unwrap();
        let picture = comparison.heat_map(Heat::Signed);
        let [dark, right, bright] = [0, 1, 2].map(|x| picture.pixel(x, 0));
        // 10 % is halfway on either side.
        assert_eq!((dark, right, bright), (SIGNED_RAMP[1], SIGNED_RAMP[2], SIGNED_RAMP[3]));
    }

    #[test]
    fn flip_has_a_scale_of_its_own() {
        let [black, white] = [0.0, 1.0].map(|value| Image::filled(4, 4, [value; 3]));
        let comparison = Comparison::new(&black, &white, &CompareOptions::default()).unwrap();
        let [error, flip, hdr] =
            [Heat::Error, Heat::Flip, Heat::HdrFlip].map(|heat| comparison.heat_map(heat).pixel(1, 1));
        // 100 % is two thirds up the logarithmic scale; black for white is as bad as FLIP gets but for its white of 0.9.
        assert_eq!(error, ramp(&RAMP, 2.0 / 3.0));
        assert!(flip[2] > 200 && hdr[2] > 200, "{flip:?} {hdr:?}");
    }
}
