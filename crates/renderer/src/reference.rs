//! Path-traced truth, sample by sample.

use bytemuck::Zeroable;
use chiaro_gpu::{Frame, Gpu, Readback};
use chiaro_scene::Scene;
use chiaro_techniques::motion::Motion;
use chiaro_techniques::reference::bvh::{Refit, TraceData, TraceScene};
use chiaro_techniques::reference::path::{PathSum, PathTracer};
use chiaro_techniques::shared::frame::{FrameData, FrameGroup, LightData};
use glam::Vec2;

pub use chiaro_techniques::reference::path::PathOptions;

use crate::{Error, Kit, LoadedScene, Settings, View};

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
    following: Option<Following>,
    sum: PathSum,
    options: PathOptions,
}

/// Passes for scenes that move.
#[derive(Debug)]
struct Following {
    motion: Motion,
    refit: Refit,
}

impl Reference {
    /// Builds the scene's trees for the pose that `loaded`, which is `scene` uploaded by the same kit, has now, and compiles
    /// the path tracer.
    ///
    /// # Errors
    /// When the scene's trees do not fit the adapter, or a shader does not compile.
    pub fn new(
        kit: &Kit,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        (view, size_px): (&View, [u32; 2]),
        options: PathOptions,
    ) -> Result<Self, Error> {
        let gpu = &kit.gpu;
        let traced = TraceData::build(scene, &loaded.pose).upload(gpu)?;
        let facts = (loaded.gpu.facts, traced.facts);
        let moves = loaded.gpu.motion.moves();
        let following = moves.then(|| -> Result<_, Error> {
            let (motion, refit) = (Motion::new(gpu, &kit.library)?, Refit::new(gpu, &kit.library)?);
            Ok(Following { motion, refit })
        });
        let following = following.transpose()?;
        let tracer = PathTracer::new(gpu, &kit.library, &kit.frame_layout, &kit.scene_layout, facts)?;
        let mut frame_group = kit.frame_group()?;
        let environment = loaded.environment.as_ref().map(|map| &map.texture);
        frame_group.reserve(gpu, loaded.lights.len(), 0, environment);
        write_frame(gpu, &frame_group, loaded, &frame_data(loaded, settings, view, size_px));
        let sum = PathSum::new(gpu, size_px);
        gpu.check()?;
        Ok(Self { kit: kit.clone(), frame_group, traced, tracer, following, sum, options })
    }

    /// Starts the image again where the scene and the camera are now: `loaded` has taken another pose since. The trees
    /// follow, which is quicker than building them anew but leaves those of bending meshes as good as they fit.
    ///
    /// # Errors
    /// When trees had to be built anew and do not fit the adapter.
    pub fn follow(
        &mut self,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        view: &View,
    ) -> Result<(), Error> {
        let gpu = &self.kit.gpu;
        if !self.traced.update(gpu, scene, &loaded.pose) {
            self.traced = TraceData::build(scene, &loaded.pose).upload(gpu)?;
        }
        let size = self.sum.sum().options();
        let size_px = [size.width, size.height];
        write_frame(gpu, &self.frame_group, loaded, &frame_data(loaded, settings, view, size_px));
        self.sum = PathSum::new(gpu, size_px);
        Ok(())
    }

    /// Records `count` more samples of every pixel. However they are grouped, the image is the same.
    pub fn add(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32) {
        if let Some(Following { motion, refit }) = &mut self.following {
            motion.record(frame, &loaded.gpu);
            refit.record(frame, &loaded.gpu, &mut self.traced);
        }
        let scene = (self.frame_group.group(), &loaded.gpu, &self.traced);
        // llvmpipe silently ends all loops of an invocation after 65,535 iterations together: a sample is well below that.
        let each = if self.kit.gpu.is_software() { 1 } else { count.max(1) };
        for first in (0..count).step_by(each as usize) {
            let now = each.min(count - first);
            self.tracer.record(frame, scene, self.options, now, &mut self.sum);
        }
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

fn write_frame(gpu: &Gpu, group: &FrameGroup, loaded: &LoadedScene, data: &FrameData) {
    let lights: Vec<_> =
        loaded.lights.iter().map(|l| LightData { first_view: LightData::NO_VIEW, ..*l }).collect();
    gpu.queue.write_buffer(group.frame.raw(), 0, bytemuck::bytes_of(data));
    gpu.queue.write_buffer(group.lights.raw(), 0, bytemuck::cast_slice(&lights));
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
