//! What a reference's EXR holds: the picture, how sure it is, and the sums to go on from.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use chiaro::{Gpu, Reference};
use chiaro_image::{ExactSums, Image, Layers, Precision, write_exr, write_layers};

use super::file::{SAMPLES, beside, in_file};

/// All sums of a reference.
pub struct Sums {
    pub size: [u32; 2],
    pub samples: u32,
    /// Samples that share light paths, and are squared together.
    pub round: u32,
    /// Four floats a pixel, by their names in the file.
    pub layers: Vec<(String, Vec<f32>)>,
}

/// The name of a layer that holds what those before it leave of a sum: `sum.low`, `sum.low2`, …
pub fn low(name: &str, index: usize) -> String {
    match index {
        0 => name.to_owned(),
        1 => format!("{name}.low"),
        _ => format!("{name}.low{index}"),
    }
}

impl Sums {
    /// Waits for everything that was recorded.
    pub fn read(gpu: &Gpu, reference: &Reference) -> anyhow::Result<Self> {
        // All copies are on their way before the first is waited for.
        let layers = reference.read_layers()?;
        let mut size = [0; 2];
        let mut read = Vec::with_capacity(layers.len());
        for (name, layer) in layers {
            let pixels = layer.wait(gpu)?;
            size = [pixels.width, pixels.height];
            read.push((in_file(name), pixels.floats()));
        }
        Ok(Self { size, samples: reference.samples(), round: reference.round(), layers: read })
    }

    /// Takes over sums under their name.
    pub fn insert(&mut self, name: &str, sums: ExactSums) {
        let layers = sums.into_layers().into_iter().enumerate();
        self.layers.extend(layers.map(|(index, layer)| (low(name, index), layer)));
    }

    fn layer(&self, name: &str) -> Option<&[f32]> {
        Some(&self.layers.iter().find(|(found, _)| found == name)?.1)
    }

    /// A sum with all that its first float has lost.
    fn total(&self, name: &str) -> anyhow::Result<Vec<f64>> {
        let first = self.layer(name).with_context(|| format!("the reference has no layer {name}"))?;
        let mut total: Vec<f64> = first.iter().copied().map(f64::from).collect();
        for rest in (1..).map_while(|index| self.layer(&low(name, index))) {
            total.iter_mut().zip(rest).for_each(|(total, rest)| *total += f64::from(*rest));
        }
        Ok(total)
    }

    /// A pixel's mean standard error, relative to the image's mean, as if samples were independent: stratified ones are
    /// better than that.
    pub fn noise(&self) -> anyhow::Result<f64> {
        let (sum, squares) = (self.total("sum")?, self.total("squares")?);
        let means = (0..sum.len()).filter(|index| index % 4 < 3).map(|index| sum[index]);
        let mean = means.sum::<f64>() / f64::from(self.samples.max(1));
        let variance = variance(&sum, &squares, (self.samples, self.round));
        let errors = variance.iter().flatten().map(|variance| f64::from(*variance).sqrt()).sum::<f64>();
        Ok(if mean > 0.0 { errors / mean } else { 0.0 })
    }

    /// Writes the file, whole or not at all.
    pub fn write(&self, path: &Path, about: &BTreeMap<String, String>) -> anyhow::Result<()> {
        let [width, height] = self.size;
        let mut file = Layers::new(width, height);
        let (sum, squares) = (self.total("sum")?, self.total("squares")?);
        file.insert_image("", &self.mean(&sum)?)?;
        let variance = variance(&sum, &squares, (self.samples, self.round));
        for (channel, values) in ["R", "G", "B"].into_iter().zip(variance) {
            file.insert(format!("variance.{channel}"), values)?;
        }
        let pixels = width as usize * height as usize;
        file.insert(SAMPLES, vec![self.samples as f32; pixels])?;
        for (name, texels) in &self.layers {
            file.insert_texels(name, texels)?;
        }
        file.about.clone_from(about);
        file.about.insert(SAMPLES.to_owned(), self.samples.to_string());
        Ok(write_layers(path, &file)?)
    }

    /// Writes an AOV beside the picture.
    pub fn write_aov(&self, path: &Path, name: &str) -> anyhow::Result<()> {
        let sum = if name == "indirect" { self.indirect()? } else { self.total(&in_file(name))? };
        Ok(write_exr(beside(path, name), &self.mean(&sum)?, Precision::Float)?)
    }

    /// What the other parts leave of the picture, but not less than nothing: each sample of the picture is rounded where
    /// its parts are added.
    fn indirect(&self) -> anyhow::Result<Vec<f64>> {
        let mut rest = self.total("sum")?;
        for part in ["direct", "caustics"] {
            let part = self.total(&in_file(part))?;
            rest.iter_mut().zip(part).for_each(|(rest, part)| *rest -= part);
        }
        Ok(rest.into_iter().map(|rest| rest.max(0.0)).collect())
    }

    fn mean(&self, sum: &[f64]) -> anyhow::Result<Image> {
        let n = self.samples.max(1) as f32;
        let texels = sum.chunks_exact(4);
        let pixels = texels.map(|rgba| [0, 1, 2].map(|channel| rgba[channel] as f32 / n)).collect();
        Ok(Image::from_pixels(self.size[0], self.size[1], pixels)?)
    }
}

/// The estimated variance of each pixel's mean by colour, as if samples were independent: (mean x² − (mean x)²) / rounds,
/// x being the mean of a round of samples that share light paths, or one sample.
fn variance(sum: &[f64], squares: &[f64], (samples, round): (u32, u32)) -> [Vec<f32>; 3] {
    let n = f64::from(samples.max(1));
    let rounds = n / f64::from(round);
    [0, 1, 2].map(|channel| {
        let values = |texels: &'_ [f64]| texels.iter().skip(channel).step_by(4).copied().collect::<Vec<_>>();
        let of = |(sum, square): (f64, f64)| {
            let mean = sum / n;
            ((square / n - mean * mean).max(0.0) / rounds) as f32
        };
        values(sum).into_iter().zip(values(squares)).map(of).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_of_a_mean_is_what_algebra_gives() {
        // Samples 1, 2, 3, 6 have mean 3 and variance 3.5, their mean a quarter of that.
        let [r, g, b] = variance(&[12.0, 4.0, 0.0, 4.0], &[50.0, 4.0, 0.0, 4.0], (4, 1));
        assert_eq!((r[0], g[0], b[0]), (0.875, 0.0, 0.0));
        // In rounds of two with the means 1.5 and 4.5: (3² + 9²) / 2 is summed up, and the variance is 2.25.
        assert_eq!(variance(&[12.0, 0.0, 0.0, 4.0], &[45.0, 0.0, 0.0, 4.0], (4, 2))[0][0], 1.125);
    }

    #[test]
    fn parts_are_what_pairs_hold_and_never_negative() {
        let layers = [
            ("sum", [3.0, 1e8, 2.0, 0.0]),
            ("sum.low", [0.0, 1.5, 0.0, 0.0]),
            ("sum.direct", [1.0, 1e8, 2.0, 0.0]),
            ("sum.direct.low", [0.0, 0.25, 1e-8, 0.0]),
            ("sum.caustics", [0.5, 0.0, 0.0, 0.0]),
        ];
        let layers = layers.map(|(name, texel)| (name.to_owned(), texel.to_vec())).to_vec();
        let sums = Sums { size: [1, 1], samples: 2, round: 1, layers };
        assert_eq!(sums.indirect().unwrap()[..3], [1.5, 1.25, 0.0]);
        assert_eq!(sums.mean(&sums.total("sum").unwrap()).unwrap().pixel(0, 0), [1.5, 5e7, 1.0]);
    }
}
