//! What pictures are held against, and what is known of its own noise.

use std::path::Path;

use chiaro_image::{CompareOptions, Comparison, Image, Layers, read, read_layers};
use serde::Serialize;

use crate::Error;

/// An image that others are held against, and what is known of its own noise.
#[derive(Clone, Debug)]
pub struct Truth {
    /// What is right.
    pub image: Image,
    /// Its own noise.
    pub noise: Noise,
    /// Of each pixel, where it was traced.
    pub samples: Option<u32>,
}

/// What is known of a truth's noise.
#[derive(Clone, Debug)]
pub enum Noise {
    /// Nothing.
    Unknown,
    /// A draw of it: half of the difference of two halves that know nothing of each other has the very distribution of their
    /// mean's error, stratification and all.
    Drawn(Image),
    /// The variance of each value, as if samples were independent.
    Variance(Image),
}

/// How far a truth is from itself: what no technique can be told to be better than.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Floor {
    /// Mean absolute error over the mean.
    pub nmae: f64,
    /// Root of the mean square error, over the mean.
    pub rmse: f64,
    /// As the metric of the same name, where the noise was drawn.
    pub relmse: Option<f64>,
}

impl Truth {
    /// A file that some renderer wrote, less another. Of the noise is known what `chiaro reference` wrote of it.
    ///
    /// # Errors
    /// When a file cannot be read, or the two differ in size.
    pub fn read(path: &Path, minus: Option<&Path>) -> Result<Self, Error> {
        let mut image = read(path)?;
        if let Some(minus) = minus {
            let other = read(minus)?;
            if other.size() != image.size() {
                let ((w, h), (width, height)) = (other.size(), image.size());
                return Err(Error::Usage(format!(
                    "{} is {w}x{h}, but {} is {width}x{height}",
                    minus.display(),
                    path.display()
                )));
            }
            if let Some((path, _)) = [(path, &image), (minus, &other)].into_iter().find(|(_, i)| is_crop(i)) {
                let path = path.display();
                return Err(Error::Usage(format!(
                    "{path} is a crop; --minus takes whole images from whole ones"
                )));
            }
            for (value, other) in image.pixels_mut().iter_mut().flatten().zip(other.pixels().iter().flatten())
            {
                *value -= other;
            }
        }
        let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
        let layers = if is_exr && minus.is_none() { read_layers(path).ok() } else { None };
        let noise =
            layers.and_then(|layers| image_of(&layers, "variance")).map_or(Noise::Unknown, Noise::Variance);
        Ok(Self { image, noise, samples: None })
    }

    /// The mean of two halves of so many samples each.
    pub(crate) fn of_halves(halves: &[Image; 2], samples: u32) -> Self {
        let [a, b] = halves;
        let mixed = |mix: fn(f32, f32) -> f32| {
            let (width, height) = a.size();
            let mut at = a.pixels().iter().zip(b.pixels());
            let pixel = |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|c| mix(a[c], b[c]));
            Image::from_fn(width, height, |_, _| at.next().map_or([0.0; 3], pixel))
        };
        let image = mixed(|a, b| 0.5 * (a + b));
        Self { image, noise: Noise::Drawn(mixed(|a, b| 0.5 * (a - b))), samples: Some(2 * samples) }
    }

    /// The mean of all values that the mask leaves, nits.
    pub fn mean(&self, keep: &[bool]) -> f64 {
        mean(kept(self.image.pixels(), keep).map(f64::from))
    }

    /// Makes sure that there is light to compare.
    ///
    /// # Errors
    /// [`Error::Black`] when there is none.
    pub fn lit(&self, mask: Option<&Image>) -> Result<(), Error> {
        let keep = keep(&self.image, mask);
        if !keep.contains(&true) {
            return Err(Error::Usage(
                "the mask leaves no pixel: it must be 0 where pictures are compared".to_owned(),
            ));
        }
        let mean = self.mean(&keep);
        if mean > 0.0 {
            return Ok(());
        }
        let is = if mean < 0.0 { "darker than black: is the right image subtracted?" } else { "black" };
        Err(Error::Black(format!(
            "there is nothing to hold techniques against: where it is compared, this part of the light is {is}"
        )))
    }

    /// The mean square of its own error.
    pub(crate) fn square_error(&self, keep: &[bool]) -> Option<f64> {
        match &self.noise {
            Noise::Unknown => None,
            Noise::Drawn(error) => Some(mean(kept(error.pixels(), keep).map(|e| f64::from(e).powi(2)))),
            Noise::Variance(variance) => Some(mean(kept(variance.pixels(), keep).map(f64::from))),
        }
    }

    /// How far it is from itself, where the mask leaves something that is not black.
    pub fn floor(&self, mask: Option<&Image>) -> Option<Floor> {
        let keep = keep(&self.image, mask);
        let mean_nits = self.mean(&keep);
        let rmse = self.square_error(&keep)?.sqrt() / mean_nits;
        let (absolute, relmse) = match &self.noise {
            Noise::Unknown => return None,
            Noise::Drawn(error) => {
                let mut other = self.image.clone();
                let values = other.pixels_mut().iter_mut().flatten();
                values.zip(error.pixels().iter().flatten()).for_each(|(value, error)| *value += error);
                let options = CompareOptions { mask, ..CompareOptions::default() };
                let relmse = Comparison::new(&other, &self.image, &options).ok()?.relmse();
                (mean(kept(error.pixels(), &keep).map(|e| f64::from(e.abs()))), Some(relmse))
            }
            // Of a normal distribution.
            Noise::Variance(variance) => {
                let deviation = |v: f32| (f64::from(v).max(0.0) * 2.0 / std::f64::consts::PI).sqrt();
                (mean(kept(variance.pixels(), &keep).map(deviation)), None)
            }
        };
        (mean_nits > 0.0).then_some(Floor { nmae: absolute / mean_nits, rmse, relmse })
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    sum / count.max(1) as f64
}

fn kept<'a>(pixels: &'a [[f32; 3]], keep: &'a [bool]) -> impl Iterator<Item = f32> + 'a {
    pixels.iter().zip(keep).filter(|(_, keep)| **keep).flat_map(|(pixel, _)| *pixel)
}

/// Pixels that count: those that a crop holds, where the mask is 0.
pub(crate) fn keep(image: &Image, mask: Option<&Image>) -> Vec<bool> {
    let (held, width) = (image.held(), image.width());
    let is_held = |index: usize| {
        let at = [index as u32 % width, index as u32 / width];
        (0..2).all(|axis| at[axis].checked_sub(held.start[axis]).is_some_and(|x| x < held.size[axis]))
    };
    let mut keep: Vec<bool> = (0..image.pixels().len()).map(is_held).collect();
    if let Some(mask) = mask {
        for (keep, pixel) in keep.iter_mut().zip(mask.pixels()) {
            *keep &= pixel.iter().all(|value| *value <= 0.0);
        }
    }
    keep
}

fn is_crop(image: &Image) -> bool {
    (image.held().size[0], image.held().size[1]) != image.size()
}

pub(crate) fn image_of(layers: &Layers, name: &str) -> Option<Image> {
    let channel =
        |c: &str| layers.channel(&if name.is_empty() { c.to_owned() } else { format!("{name}.{c}") });
    let [r, g, b] = ["R", "G", "B"].map(channel);
    let pixels = r?.iter().zip(g?).zip(b?).map(|((r, g), b)| [*r, *g, *b]).collect();
    let (width, height) = layers.size();
    Image::from_pixels(width, height, pixels).ok()
}
