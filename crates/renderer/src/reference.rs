//! Path-traced truth, sample by sample.

use bytemuck::Zeroable;
use chiaro_gpu::{Buffer, Frame, Readback, Texture};
use chiaro_scene::Scene;
use chiaro_techniques::reference::bvh::{TraceData, TraceScene};
use chiaro_techniques::reference::path::{PathNoise, PathSum, PathTracer};
use chiaro_techniques::shared::frame::{FrameData, FrameGroup, LightData};
use chiaro_techniques::surface::SceneFacts;
use glam::Vec2;

pub use chiaro_techniques::reference::path::PathOptions;

use crate::{Error, Kit, LoadedScene, Settings, View};

/// Dispatches that [`Reference::refine`] records at most.
const DISPATCHES: u32 = 16;
/// Rows that workgroups cover.
const BAND: u64 = 8;
/// Samples of a pixel in one dispatch at most: a driver's watchdog should not notice.
const SAMPLES_AT_ONCE: u32 = 64;

/// An image being path traced: the mean of samples that [`Reference::add`] adds.
///
/// Of the settings those count that say what is there, not how it is drawn: `surface.lighting`, `surface.normal_maps`
/// and `environment.*`. Where a scene has no environment, the surroundings are black.
#[derive(Debug)]
pub struct Reference {
    kit: Kit,
    frame_group: FrameGroup,
    traced: TraceScene,
    tracer: PathTracer,
    noise: PathNoise,
    sum: PathSum,
    options: PathOptions,
}

impl Reference {
    /// Builds the scene's trees, and compiles the path tracer. `loaded` is `scene` uploaded by the same kit, as it stands at
    /// time 0.
    ///
    /// # Errors
    /// When the scene's trees do not fit the adapter, or a shader does not compile.
    pub fn new(
        kit: &Kit,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        image: (&View, [u32; 2]),
        options: PathOptions,
    ) -> Result<Self, Error> {
        let mut reference = Self::build(kit, scene, loaded.gpu.facts)?;
        reference.restart(loaded, settings, image, options);
        kit.gpu.check()?;
        Ok(reference)
    }

    /// The part of [`Reference::new`] that takes up to seconds and that any thread may do: trees and pipeline, for an image
    /// of one pixel until [`Reference::restart`] says which. `facts` are those of the scene as uploaded.
    ///
    /// # Errors
    /// As [`Reference::new`].
    pub fn build(kit: &Kit, scene: &Scene, facts: SceneFacts) -> Result<Self, Error> {
        let gpu = &kit.gpu;
        let traced = TraceData::build(scene).upload(gpu)?;
        let tracer = PathTracer::new(gpu, &kit.library, &kit.frame_layout, &kit.scene_layout, facts)?;
        let noise = PathNoise::new(gpu, &kit.library)?;
        let (frame_group, sum) = (kit.frame_group()?, PathSum::new(gpu, [1; 2]));
        let options = PathOptions::default();
        Ok(Self { kit: kit.clone(), frame_group, traced, tracer, noise, sum, options })
    }

    /// Starts a new image with the same trees: from another view, of another size, with other settings. Makes textures only
    /// where the size is another than before.
    pub fn restart(
        &mut self,
        loaded: &LoadedScene,
        settings: &Settings,
        (view, size_px): (&View, [u32; 2]),
        options: PathOptions,
    ) {
        let gpu = &self.kit.gpu;
        let environment = loaded.environment.as_ref().map(|map| &map.texture);
        self.frame_group.reserve(gpu, loaded.lights.len(), 0, environment);
        let data = frame_data(loaded, settings, view, size_px);
        let lights: Vec<_> =
            loaded.lights.iter().map(|l| LightData { first_view: LightData::NO_VIEW, ..*l }).collect();
        gpu.queue.write_buffer(self.frame_group.frame.raw(), 0, bytemuck::bytes_of(&data));
        gpu.queue.write_buffer(self.frame_group.lights.raw(), 0, bytemuck::cast_slice(&lights));
        if self.sum.size_px() == size_px {
            self.sum.restart();
        } else {
            self.sum = PathSum::new(gpu, size_px);
        }
        self.options = options;
    }

    /// Records `count` more samples of every pixel, beside those that [`Reference::refine`] has under way. However they are
    /// grouped, the image is the same.
    pub fn add(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32) {
        let all = self.sum.samples().saturating_add(self.sum.rows_ahead().1).saturating_add(count);
        while self.sum.samples() < all {
            let now = self.most_at_once().min(all - self.sum.samples());
            self.record(frame, loaded, (now, u32::MAX));
        }
    }

    /// Records about `work` samples of single pixels, but not more than `most` of each: some rows of the image or the whole
    /// image several times, so that a dispatch takes as long as a window can bear. Returns how many it recorded. The image
    /// is the same as [`Reference::add`] makes, and [`Reference::samples`] counts what all rows have.
    pub fn refine(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, work: u64, most: u32) -> u64 {
        let [width, height] = self.sum.size_px().map(u64::from);
        let mut recorded = 0;
        for _ in 0..DISPATCHES {
            let left = work.saturating_sub(recorded);
            let (rows_done, under_way) = self.sum.rows_ahead();
            let count = match under_way {
                0 => {
                    let wanted = most.saturating_sub(self.sum.samples()).min(self.most_at_once());
                    wanted.min((left / (width * height)).clamp(1, u64::from(u32::MAX)) as u32)
                }
                count => count,
            };
            let band = width * u64::from(count) * BAND;
            if count == 0 || (recorded > 0 && left < band) {
                break;
            }
            let rows = ((left / band).max(1) * BAND).min(height - u64::from(rows_done));
            self.record(frame, loaded, (count, rows as u32));
            recorded += rows * width * u64::from(count);
        }
        recorded
    }

    /// Samples that one dispatch may take of a pixel.
    fn most_at_once(&self) -> u32 {
        // llvmpipe silently ends all loops of an invocation after 65,535 iterations together: a sample is well below that.
        if self.kit.gpu.is_software() { 1 } else { SAMPLES_AT_ONCE }
    }

    fn record(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, samples: (u32, u32)) {
        let scene = (self.frame_group.group(), &loaded.gpu, &self.traced);
        self.tracer.record(frame, scene, self.options, samples, &mut self.sum);
    }

    /// Records a measurement of the noise, to be read from [`Reference::noise`] once the frame is submitted.
    pub fn measure_noise(&self, frame: &mut Frame<'_>) {
        self.noise.record(frame, &self.sum);
    }

    /// One `f32`: pixels' mean standard error relative to the mean of the image, when that was last measured.
    pub fn noise(&self) -> &Buffer {
        self.noise.buffer()
    }

    /// Nits summed over [`Reference::samples`], and how much of the pixel surfaces cover.
    pub fn sum_texture(&self) -> &Texture {
        self.sum.sum()
    }

    /// Share of the rows that have more samples than [`Reference::samples`] says, 0..1.
    pub fn under_way(&self) -> f32 {
        self.sum.rows_ahead().0 as f32 / self.sum.size_px()[1] as f32
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.sum.samples()
    }

    /// Rgba32Float: nits summed over samples, and how much of the pixel surfaces cover.
    ///
    /// # Errors
    /// When the image is larger than the device can read back.
    pub fn sum(&self) -> Result<Readback, Error> {
        Ok(Readback::start(&self.kit.gpu, self.sum.sum())?)
    }

    /// Rgba32Float: squares of the samples' nits, summed.
    ///
    /// # Errors
    /// As [`Reference::sum`].
    pub fn squares(&self) -> Result<Readback, Error> {
        Ok(Readback::start(&self.kit.gpu, self.sum.squares())?)
    }
}

fn frame_data(loaded: &LoadedScene, settings: &Settings, view: &View, size_px: [u32; 2]) -> FrameData {
    let turn = settings.environment.rotation.to_radians();
    let clip_from_ws = view.clip_from_ws(size_px, Vec2::ZERO).to_cols_array_2d();
    let nits = loaded.environment.as_ref().map_or(0.0, |map| map.nits * settings.environment.intensity);
    FrameData {
        clip_from_ws,
        relative_from_clip: view.relative_from_clip(size_px, Vec2::ZERO).to_cols_array_2d(),
        previous_clip_from_ws: clip_from_ws,
        eye_ws: view.eye_ws().to_array(),
        orthographic: u32::from(view.is_orthographic()),
        forward_ws: view.forward_ws().to_array(),
        footprint_scale: 1.0,
        size_px,
        directional_lights: loaded.directional as u32,
        local_lights: (loaded.lights.len() - loaded.directional) as u32,
        lighting_model: settings.surface.lighting as u32,
        seed: settings.seed,
        radiance_scale: 1.0,
        normal_maps: u32::from(settings.surface.normal_maps),
        anisotropy: 1,
        environment_nits: nits,
        environment_share: 1.0,
        environment_turn: [turn.cos(), turn.sin()],
        show_direct: 1.0,
        show_indirect: 1.0,
        ..FrameData::zeroed()
    }
}
