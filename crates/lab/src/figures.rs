//! How far pictures are from the truth: as one looks, and bias and noise apart.

use chiaro_image::{CompareOptions, Comparison, Image, Metrics};
use serde::Serialize;

use crate::Error;
use crate::truth::{Truth, keep};

/// What is measured of a technique, means over seeds. Errors are shares of the truth's mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Figures {
    /// Energy: ΣA / ΣB.
    pub mean_ratio: f64,
    /// mean |A − B| / mean B.
    pub nmae: f64,
    /// mean of (A − B)² / (B² + (0.05 · mean B)²), without the worst 0.1 % of the pixels.
    pub relmse: f64,
    /// Mean LDR-FLIP.
    pub flip: f64,
    /// Mean HDR-FLIP; of pictures that rest.
    pub hdr_flip: Option<f64>,
    /// √MSE: all of the error.
    pub rmse: f64,
    /// √(MSE − variance): the part that stays however many seeds are averaged. The truth's own noise is none of it, where it
    /// is known. From two seeds on.
    pub bias: Option<f64>,
    /// √variance: the part that another seed has another of. From two seeds on.
    pub noise: Option<f64>,
    /// mean |ΔA − ΔB| / mean B from frame to frame, where there are frames.
    pub flicker: Option<f64>,
    /// Channel values that were NaN or infinite; they are taken as 0.
    pub not_finite: usize,
}

/// What pictures of several seeds have in common, and what they have not (Welford 1962). Of what is to be judged against one
/// truth.
#[derive(Clone, Debug, Default)]
pub struct Spread {
    count: u32,
    // Of each value: the mean of A − B, and the sum of squares around it.
    mean: Vec<f32>,
    squares: Vec<f32>,
}

impl Spread {
    /// Takes a seed's picture.
    pub fn add(&mut self, image: &Image, truth: &Truth) {
        let differences = image.pixels().iter().flatten().zip(truth.image.pixels().iter().flatten());
        self.count += 1;
        if self.count == 1 {
            self.mean = differences.map(|(a, b)| finite(*a) - b).collect();
            self.squares = vec![0.0; self.mean.len()];
            return;
        }
        let share = 1.0 / self.count as f32;
        let known = self.mean.iter_mut().zip(&mut self.squares);
        for ((mean, squares), (a, b)) in known.zip(differences) {
            let difference = finite(*a) - b;
            let before = difference - *mean;
            *mean += before * share;
            *squares += before * (difference - *mean);
        }
    }

    /// Mean square error, variance, and the square of the bias; those two from two seeds on. nits².
    pub fn squares(&self, truth: &Truth, mask: Option<&Image>) -> Squares {
        let keep = keep(&truth.image, mask);
        let count = f64::from(self.count.max(1));
        let values = self.mean.chunks_exact(3).zip(self.squares.chunks_exact(3)).zip(&keep);
        let kept =
            values.filter(|(_, keep)| **keep).flat_map(|((mean, squares), _)| mean.iter().zip(squares));
        let (mut number, mut error, mut around) = (0usize, 0.0, 0.0);
        for (mean, squares) in kept {
            number += 1;
            error += f64::from(*mean).powi(2) + f64::from(*squares) / count;
            around += f64::from(*squares);
        }
        let number = number.max(1) as f64;
        let all = error / number;
        let variance = (self.count > 1).then(|| around / number / (count - 1.0));
        let own = truth.square_error(&keep).unwrap_or(0.0);
        Squares {
            all,
            variance,
            bias: variance.map(|variance| (all - variance - own).max(0.0)),
            mean: truth.mean(&keep),
        }
    }
}

/// Parts of the mean square error, nits², and the truth's mean, nits.
#[derive(Clone, Copy, Debug, Default)]
pub struct Squares {
    all: f64,
    variance: Option<f64>,
    bias: Option<f64>,
    mean: f64,
}

impl Squares {
    /// Means over frames.
    pub fn mean_of(all: &[Self]) -> Self {
        let mean = |of: &dyn Fn(&Self) -> Option<f64>| {
            let values: Option<Vec<_>> = all.iter().map(of).collect();
            values.map(|values| values.iter().sum::<f64>() / values.len().max(1) as f64)
        };
        Self {
            all: mean(&|s| Some(s.all)).unwrap_or_default(),
            variance: mean(&|s| s.variance),
            bias: mean(&|s| s.bias),
            mean: mean(&|s| Some(s.mean)).unwrap_or_default(),
        }
    }

    /// Writes the roots, as shares of the truth's mean.
    pub fn tell(&self, figures: &mut Figures) {
        figures.rmse = self.all.sqrt() / self.mean;
        figures.bias = self.bias.map(|bias| bias.sqrt() / self.mean);
        figures.noise = self.variance.map(|variance| variance.sqrt() / self.mean);
    }
}

fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// Holds a picture against the truth.
///
/// # Errors
/// When sizes differ, or the truth is black, or darker than that, where the mask leaves something.
pub fn against(image: &Image, truth: &Truth, mask: Option<&Image>) -> Result<Comparison, Error> {
    if truth.image.size() == image.size() {
        truth.lit(mask)?;
    }
    let options = CompareOptions { mask, ..CompareOptions::default() };
    Ok(Comparison::new(image, &truth.image, &options)?)
}

/// Means over seeds.
pub fn mean_of(all: &[Metrics]) -> Figures {
    let count = all.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Metrics) -> f64| all.iter().map(of).sum::<f64>() / count;
    Figures {
        mean_ratio: mean(&|m| m.mean_ratio),
        nmae: mean(&|m| m.nmae),
        relmse: mean(&|m| m.relmse),
        flip: mean(&|m| m.flip),
        hdr_flip: Some(mean(&|m| m.hdr_flip)),
        not_finite: all.iter().map(|m| m.not_finite).sum(),
        ..Figures::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::truth::Noise;

    /// Even in ±1, the same in every run.
    struct Lot(u64);

    impl Lot {
        fn draw(&mut self) -> f32 {
            // Knuth's MMIX.
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        }

        fn image(&mut self, base: &Image, bias: f32, noise: f32) -> Image {
            let (width, height) = base.size();
            Image::from_fn(width, height, |x, y| {
                // Half of the picture too bright, the other as much too dark; deviation of an even draw is 1/√3.
                let side = if x < width / 2 { bias } else { -bias };
                base.pixel(x, y).map(|v| v * (1.0 + side) + noise * 3.0_f32.sqrt() * self.draw())
            })
        }
    }

    #[test]
    fn planted_bias_and_noise_come_back_apart_whatever_the_truths_own_noise() {
        let right = Image::from_fn(96, 64, |x, y| [0.5 + x as f32 / 96.0, 1.0, 0.5 + y as f32 / 64.0]);
        let mut lot = Lot(1);
        let halves = [0, 1].map(|_| lot.image(&right, 0.0, 0.1));
        let truth = Truth::of_halves(&halves, 1);
        let square = |image: &Image| {
            let all = image.pixels().iter().flatten();
            all.clone().map(|v| f64::from(*v).powi(2)).sum::<f64>() / all.count() as f64
        };
        let mean = truth.mean(&keep(&truth.image, None));
        for (bias, noise) in [(0.1, 0.2), (0.2, 0.05), (0.1, 0.0)] {
            let mut spread = Spread::default();
            for _ in 0..8 {
                spread.add(&lot.image(&right, bias, noise), &truth);
            }
            let mut figures = Figures::default();
            spread.squares(&truth, None).tell(&mut figures);
            let planted = (f64::from(bias) * square(&right).sqrt() / mean, f64::from(noise) / mean);
            let found = (figures.bias.unwrap(), figures.noise.unwrap());
            assert!((found.0 / planted.0 - 1.0).abs() < 0.05, "bias {found:?} of {planted:?}");
            assert!((found.1 - planted.1).abs() <= 0.05 * planted.1 + 1e-4, "noise {found:?} of {planted:?}");
            let floor = truth.floor(None).unwrap();
            let expected = (found.0.powi(2) + found.1.powi(2) + floor.rmse.powi(2)).sqrt();
            assert!((figures.rmse / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn one_seed_tells_no_bias_from_noise() {
        let truth = Truth { image: Image::filled(4, 4, [1.0; 3]), noise: Noise::Unknown, samples: None };
        let mut spread = Spread::default();
        spread.add(&Image::filled(4, 4, [1.5; 3]), &truth);
        let mut figures = Figures::default();
        spread.squares(&truth, None).tell(&mut figures);
        assert_eq!((figures.rmse, figures.bias, figures.noise), (0.5, None, None));
    }

    #[test]
    fn masked_pixels_do_not_count() {
        let truth = Truth { image: Image::filled(4, 4, [1.0; 3]), noise: Noise::Unknown, samples: None };
        let image = Image::from_fn(4, 4, |x, _| [if x == 0 { 9.0 } else { 1.25 }; 3]);
        let mask = Image::from_fn(4, 4, |x, _| [if x == 0 { 1.0 } else { 0.0 }; 3]);
        let mut spread = Spread::default();
        for _ in 0..2 {
            spread.add(&image, &truth);
        }
        let mut figures = Figures::default();
        spread.squares(&truth, Some(&mask)).tell(&mut figures);
        assert_eq!((figures.rmse, figures.bias, figures.noise), (0.25, Some(0.25), Some(0.0)));
    }
}
