//! Stills: jittered frames averaged, with single quantities beside the picture.

use chiaro_gpu::{Readback, Recorder};
use chiaro_techniques::post::{Aov, Display, Sum};
use glam::Vec2;

use crate::left::Wanted;
use crate::renderer::check_size;
use crate::still_passes::StillPasses;
use crate::{Error, LeftOver, LoadedScene, Renderer, View, ViewState};

/// What to make.
#[derive(Clone, Debug)]
pub struct StillOptions {
    /// Pixels.
    pub size: [u32; 2],
    /// Jittered frames to average.
    pub samples: u32,
    /// Quantities beside the picture.
    pub aovs: Vec<Aov>,
    /// Textures and buffers that frames leave behind, by `technique/name` ([`Renderer::leaves`] tells them).
    pub left: Vec<String>,
}

impl Default for StillOptions {
    fn default() -> Self {
        Self { size: [1280, 720], samples: 16, aovs: Vec::new(), left: Vec::new() }
    }
}

/// A still on its way to the CPU.
#[derive(Debug)]
pub struct Still {
    /// Rgba32Float: nits summed over `samples` frames; unlit materials are black.
    pub radiance: Readback,
    /// Rgba32Float: the colour of unlit materials summed alike, 1 for the display's white; for scenes that have any.
    pub unlit: Option<Readback>,
    /// Rgba8Unorm sRGB.
    pub picture: Readback,
    /// Rgba32Float sums, as asked for.
    pub aovs: Vec<(Aov, Readback)>,
    /// What else was asked for, in that order.
    pub left: Vec<LeftOver>,
    /// Frames summed.
    pub samples: u32,
}

/// Sub-pixel offsets of a box filter, stratified: a (0,2)-sequence, so that any power of two of them falls one into
/// each of as many equal boxes of any shape (Sobol' 1967).
#[derive(Clone, Copy, Debug)]
pub struct Jitter {
    samples: u32,
}

impl Jitter {
    /// Offsets for so many frames.
    pub fn new(samples: u32) -> Self {
        Self { samples }
    }

    /// Offset of frame `index`, pixels in −½..½.
    pub fn offset_px(&self, index: u32) -> Vec2 {
        if self.samples <= 1 {
            return Vec2::ZERO;
        }
        let unit = |bits: u32| (bits as f32) * 2f32.powi(-32);
        // The second dimension's direction numbers are Pascal's triangle modulo 2.
        let mut second = 0u32;
        let mut direction = 1u32 << 31;
        let mut rest = index;
        while rest != 0 {
            if rest & 1 != 0 {
                second ^= direction;
            }
            direction ^= direction >> 1;
            rest >>= 1;
        }
        // Half a box further, each sample stands in the middle of its box.
        let half = 0.5 / self.samples.next_power_of_two() as f32;
        Vec2::new(unit(index.reverse_bits()), unit(second)) + half - 0.5
    }

    /// How much smaller a texture's footprint is than a pixel.
    pub fn footprint_scale(&self) -> f32 {
        1.0 / (self.samples.max(1) as f32).sqrt()
    }
}

impl Renderer {
    /// Renders a still; `progress` hears how many frames are done. Submits as it goes and never waits for the GPU;
    /// the result is read with [`Readback::poll`] or [`Readback::wait`].
    ///
    /// # Errors
    /// As [`Renderer::prepare`], when the device reports an error, or frames leave nothing of a name.
    pub fn still(
        &mut self,
        scene: &LoadedScene,
        view: &View,
        options: &StillOptions,
    ) -> Result<Still, Error> {
        self.still_in(&mut Recorder::new(self.gpu(), false), scene, view, options, |_| {})
    }

    /// The same with a recorder of one's own, which then has the frames' timings.
    ///
    /// # Errors
    /// As [`Renderer::still`].
    pub fn still_in(
        &mut self,
        recorder: &mut Recorder,
        scene: &LoadedScene,
        view: &View,
        options: &StillOptions,
        mut progress: impl FnMut(u32),
    ) -> Result<Still, Error> {
        let gpu = self.gpu().clone();
        let size = options.size;
        check_size(&gpu, size)?;
        let samples = options.samples.max(1);
        let jitter = Jitter::new(samples);
        let wanted = (self.permutations(), options.aovs.len());
        let passes = StillPasses::new(self.still_passes.take(), self.kit(), wanted)?;
        let StillPasses { aovs: aov_pass, accumulator, display, .. } = &passes;
        let aov_pass = aov_pass.as_ref().map(|(_, pass)| pass).filter(|_| !options.aovs.is_empty());
        let mut sum = Sum::new(&gpu, &self.pool, size);
        let mut unlit = scene.gpu.unlit.then(|| Sum::new(&gpu, &self.pool, size));
        let mut aov_sums: Vec<_> = options.aovs.iter().map(|_| Sum::new(&gpu, &self.pool, size)).collect();
        let picture = Display::picture(&gpu, &self.pool, size);
        // Maps that rest are kept from still to still, unless what they are made with is asked for.
        let kept = self.still_view.take().filter(|_| options.left.is_empty());
        let mut state = kept.unwrap_or_else(|| ViewState::new(self));
        let mut left = Wanted::new(&options.left);
        for index in 0..samples {
            let sampling = (jitter.offset_px(index), jitter.footprint_scale());
            let prepared = self.prepare(&mut state, scene, view, size, sampling)?;
            let mut frame = recorder.begin();
            let wants_surface = aov_pass.is_some() || !options.left.is_empty();
            let outputs = prepared.record(&mut frame, wants_surface);
            if let Err(error) = left.record(&mut frame, self, size) {
                // What it recorded counts as done.
                frame.submit();
                return Err(error);
            }
            accumulator.record(&mut frame, &outputs.radiance, 1.0 / scene.radiance_scale, &mut sum);
            if let (Some(color), Some(unlit)) = (&outputs.unlit, &mut unlit) {
                accumulator.record(&mut frame, color, 1.0, unlit);
            }
            if let (Some(pass), Some(surface)) = (aov_pass, &outputs.surface) {
                for (number, (aov, aov_sum)) in options.aovs.iter().zip(&mut aov_sums).enumerate() {
                    let inputs = (surface, &outputs.shadows, &outputs.light_grid);
                    let groups = (state.frame_group(), &scene.gpu);
                    pass.record(&mut frame, groups, inputs, (number, *aov), aov_sum);
                }
            }
            if index + 1 == samples {
                display.record(&mut frame, &self.settings().camera, (&sum, unlit.as_ref()), &picture);
            }
            frame.submit();
            gpu.check()?;
            progress(index + 1);
        }
        self.still_view = Some(state);
        self.still_passes = Some(passes);
        let aovs = options.aovs.iter().zip(&aov_sums);
        let aovs = aovs.map(|(aov, sum)| Ok((*aov, Readback::start(&gpu, sum.texture())?)));
        Ok(Still {
            radiance: Readback::start(&gpu, sum.texture())?,
            unlit: unlit.map(|unlit| Readback::start(&gpu, unlit.texture())).transpose()?,
            picture: Readback::start(&gpu, &picture)?,
            aovs: aovs.collect::<Result<_, Error>>()?,
            left: left.read(&gpu)?,
            samples,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_offsets_fall_one_into_each_of_sixteen_boxes_of_any_shape() {
        let jitter = Jitter::new(16);
        for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
            let mut boxes: Vec<_> = (0..16)
                .map(|i| {
                    let p = jitter.offset_px(i) + 0.5;
                    ((p.x * columns as f32) as u32, (p.y * rows as f32) as u32)
                })
                .collect();
            boxes.sort_unstable();
            boxes.dedup();
            assert_eq!(boxes.len(), 16, "{columns}×{rows}");
        }
        let mean = (0..16).map(|i| jitter.offset_px(i)).sum::<Vec2>() / 16.0;
        assert!(mean.length() < 1e-6, "{mean}");
    }
}
