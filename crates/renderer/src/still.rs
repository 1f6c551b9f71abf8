//! Stills: jittered frames averaged, with single quantities beside the picture.

use chiaro_gpu::{Frame, Readback, Recorder};
use chiaro_techniques::post::{Aov, AovPass, Display, Sum};

use crate::checks::check_size;
use crate::jitter::Jitter;
use crate::left::Wanted;
use crate::still_passes::StillPasses;
use crate::{Error, FrameOutputs, LeftOver, LoadedScene, Renderer, Sampling, View, ViewState};

/// What to make.
#[derive(Clone, Debug)]
pub struct StillOptions {
    /// Pixels.
    pub size: [u32; 2],
    /// Jittered frames to average.
    pub samples: u32,
    /// Quantities beside the picture.
    pub aovs: Vec<Aov>,
    /// Whether this is a frame of a moving picture that goes on from the renderer's last still of the same scene: of one sample,
    /// it is averaged over time as `post.antialias` says.
    pub moving: bool,
    /// Textures and buffers that frames leave behind, by `technique/name` ([`Renderer::leaves`] tells them).
    pub left: Vec<String>,
}

impl Default for StillOptions {
    fn default() -> Self {
        Self { size: [1280, 720], samples: 16, aovs: Vec::new(), moving: false, left: Vec::new() }
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

impl Renderer {
    /// Lets the next still of a moving picture ([`StillOptions::moving`]) begin anew, as the first one did.
    pub fn cut(&mut self) {
        if let Some(state) = &mut self.still_view {
            state.history.seen.cut();
        }
    }

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
        let looked_up = options.aovs.iter().filter(|aov| !aov.is_part());
        let takes_apart = options.aovs.iter().any(|aov| aov.is_part());
        let wanted = (self.permutations(), looked_up.count());
        let passes = StillPasses::new(self.still_passes.take(), self.kit(), wanted)?;
        let StillPasses { aovs: aov_pass, accumulator, display, .. } = &passes;
        let aov_pass = aov_pass.as_ref().map(|(_, pass)| pass).filter(|_| wanted.1 > 0);
        let mut sum = Sum::new(&gpu, &self.pool, size);
        let mut unlit = scene.gpu.unlit.then(|| Sum::new(&gpu, &self.pool, size));
        let mut aov_sums: Vec<_> = options.aovs.iter().map(|_| Sum::new(&gpu, &self.pool, size)).collect();
        let picture = Display::picture(&gpu, &self.pool, size);
        let mut state = self.still_view.take().unwrap_or_else(|| ViewState::new(self));
        if !options.left.is_empty() {
            // Maps that rest are kept from still to still, unless what they are made with is asked for.
            state.rooms.shadow = None;
        }
        if !options.moving {
            state.history.seen.cut();
        }
        state.take_apart(false);
        let mut left = Wanted::new(&options.left);
        let goes_on = options.moving && samples == 1;
        if options.aovs.contains(&Aov::Motion) && !goes_on {
            // Of several samples all but the first would rest.
            let prepared = self.prepare(&mut state, scene, view, size, Sampling::Steady)?;
            let mut frame = recorder.begin();
            let outputs = prepared.record(&mut frame, true);
            record_motion(&mut frame, (&options.aovs, aov_pass), &outputs, samples, &mut aov_sums);
            frame.submit();
        }
        state.take_apart(takes_apart);
        state.show_maps(!options.left.is_empty());
        for index in 0..samples {
            let sampling = if goes_on { Sampling::Moving } else { Sampling::nth(&jitter, index) };
            let prepared = self.prepare(&mut state, scene, view, size, sampling)?;
            let mut frame = recorder.begin();
            let wants_surface = aov_pass.is_some() || !options.left.is_empty();
            let outputs = prepared.record(&mut frame, wants_surface);
            if let Err(error) = left.record(&mut frame, self, size) {
                // What it recorded counts as done.
                frame.submit();
                return Err(error);
            }
            let nits = 1.0 / scene.radiance_scale;
            accumulator.record(&mut frame, &outputs.radiance, nits, &mut sum);
            if let (Some(color), Some(unlit)) = (&outputs.unlit, &mut unlit) {
                accumulator.record(&mut frame, color, 1.0, unlit);
            }
            let (parts, looked_up): (Vec<_>, Vec<_>) =
                options.aovs.iter().zip(&mut aov_sums).partition(|(aov, _)| aov.is_part());
            for (part, aov_sum) in parts {
                if let Some(light) = &outputs.parts {
                    light.add(&mut frame, accumulator, (*part, nits), aov_sum);
                }
            }
            if let (Some(pass), Some(surface)) = (aov_pass, &outputs.surface) {
                let summed = looked_up.into_iter().enumerate();
                for (number, (aov, aov_sum)) in summed.filter(|(_, (aov, _))| **aov != Aov::Motion) {
                    let inputs = (surface, &outputs.shadows, &outputs.light_grid);
                    let groups = (state.frame_group(), &scene.gpu);
                    pass.record(&mut frame, groups, inputs, (number, *aov), aov_sum);
                }
            }
            if goes_on {
                record_motion(&mut frame, (&options.aovs, aov_pass), &outputs, 1, &mut aov_sums);
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

/// Takes motion where it is asked for, as often as other quantities are summed.
fn record_motion(
    frame: &mut Frame<'_>,
    (aovs, pass): (&[Aov], Option<&AovPass>),
    outputs: &FrameOutputs,
    samples: u32,
    sums: &mut [Sum],
) {
    let (Some(pass), Some(found)) = (pass, &outputs.motion) else { return };
    for (_, sum) in aovs.iter().zip(sums).filter(|(aov, _)| **aov == Aov::Motion) {
        pass.record_motion(frame, &found.motion, samples, sum);
    }
}
