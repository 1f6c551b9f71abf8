//! Tracing, a dispatch at a time as long as a desktop can bear, and parts of the light from what was summed up.

use std::time::{Duration, Instant};

use chiaro::{Gpu, LoadedScene, Recorder, Reference};
use chiaro_image::Image;

use crate::Error;
use crate::part::Part;

/// How long the GPU may be busy with one dispatch, about: no watchdog or desktop notices.
const BUSY: Duration = Duration::from_millis(50);
/// Samples of single pixels that the first dispatch takes, with a GPU and without.
const FIRST_WORK: [u64; 2] = [1 << 18, 1 << 14];
const LEAST_WORK: u64 = 1 << 10;
/// Less of the picture is no part of it.
const LEAST_PART: f64 = 1e-6;

/// How much work a dispatch takes.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    work: u64,
}

impl Pace {
    /// Of a device that nothing is known of yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { work: FIRST_WORK[usize::from(gpu.is_software())] }
    }

    /// Adds samples, up to `most` of each pixel, and waits for them; some of a pass only where that takes long. Returns how
    /// long it took.
    ///
    /// # Errors
    /// When the device fails.
    pub fn refine(
        &mut self,
        recorder: &mut Recorder,
        (reference, loaded): (&mut Reference, &LoadedScene),
        most: u32,
    ) -> Result<Duration, Error> {
        let begun = Instant::now();
        let mut frame = recorder.begin();
        let recorded = reference.refine(&mut frame, loaded, self.work, most);
        frame.submit();
        recorder.wait()?;
        let took = begun.elapsed();
        if took < BUSY / 2 && recorded >= self.work / 2 {
            self.work = self.work.saturating_mul(2);
        } else if took > 2 * BUSY {
            self.work = (self.work / 2).max(LEAST_WORK);
        }
        Ok(took)
    }
}

/// All sums of a reference.
///
/// # Errors
/// When they cannot be read back.
pub(crate) fn layers(reference: &Reference) -> Result<Vec<(&'static str, Vec<f32>)>, Error> {
    let gpu = reference.gpu();
    // All copies are on their way before the first is waited for.
    let layers = reference.read_layers()?;
    layers.into_iter().map(|(name, layer)| Ok((name, layer.wait(gpu)?.floats()))).collect()
}

/// The mean of a part of the light, from sums over so many samples.
pub(crate) fn part_of(
    layers: &[(&'static str, Vec<f32>)],
    samples: u32,
    part: Part,
    [width, height]: [u32; 2],
) -> Result<Image, Error> {
    let layer = |name: &str| {
        layers.iter().find(|(found, _)| *found == name).map_or(&[][..], |(_, texels)| texels.as_slice())
    };
    // The picture's is a pair of floats.
    let [sum, low, direct, caustics] = ["sum", "sum.low", "direct", "caustics"].map(layer);
    let count = f64::from(samples.max(1));
    let mean =
        |texels: &[f32], index: usize| texels.get(index).map_or(0.0, |value| f64::from(*value) / count);
    let all = |index: usize| mean(sum, index) + mean(low, index);
    let value = |index: usize| match part {
        Part::Picture => all(index),
        Part::Direct => mean(direct, index),
        Part::Caustics => mean(caustics, index),
        Part::Indirect => all(index) - mean(direct, index) - mean(caustics, index),
    };
    // Where all light is of other parts, what rounding leaves is no light.
    let texels = 4 * width as usize * height as usize;
    let colours = || (0..texels).filter(|index| index % 4 < 3);
    let light: f64 = colours().map(all).sum();
    if part != Part::Picture && colours().map(value).sum::<f64>() <= LEAST_PART * light {
        return Ok(Image::filled(width, height, [0.0; 3]));
    }
    let pixels =
        (0..width as usize * height as usize).map(|pixel| [0, 1, 2].map(|c| value(4 * pixel + c) as f32));
    Ok(Image::from_pixels(width, height, pixels.collect())?)
}
