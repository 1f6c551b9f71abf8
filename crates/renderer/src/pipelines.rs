//! The frame functions: one straight line each.

use chiaro_gpu::{Buffer, Frame, Texture, wgpu};
use chiaro_techniques::shadow::{ShadowOutputs, ShadowView};
use chiaro_techniques::surface::SurfaceBuffer;
use chiaro_techniques::surface::culling::CullView;

use crate::renderer::Passes;
use crate::{LoadedScene, Pipeline};

/// What a frame leaves behind, valid until the next.
#[derive(Clone, Debug)]
pub struct FrameOutputs {
    /// Rgba16Float, nits · radiance scale.
    pub radiance: Texture,
    /// Shadow maps.
    pub shadows: ShadowOutputs,
    /// Lights per froxel.
    pub light_grid: Buffer,
    /// Depth, normals, materials of opaque surfaces; the forward pipeline makes it only where something asks for it.
    pub surface: Option<SurfaceBuffer>,
}

/// What a frame function needs to know.
pub(crate) struct FrameInputs<'a> {
    pub scene: &'a LoadedScene,
    pub camera: CullView,
    pub shadow_views: &'a [ShadowView],
    /// Stored units; `None` = the environment.
    pub sky: Option<wgpu::Color>,
    pub wants_surface: bool,
}

pub(crate) fn record(
    pipeline: Pipeline,
    passes: &mut Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
) -> FrameOutputs {
    match pipeline {
        Pipeline::Deferred => deferred(passes, frame, inputs),
        Pipeline::Forward => forward(passes, frame, inputs),
    }
}

fn deferred(passes: &mut Passes, frame: &mut Frame<'_>, inputs: &FrameInputs<'_>) -> FrameOutputs {
    let group = passes.frame_group.group();
    let scene = &inputs.scene.gpu;
    passes.motion.record(frame, scene);
    let shadows = passes.shadows.record(frame, group, scene, inputs.shadow_views);
    let lists = passes.surfaces.cull(frame, scene, &inputs.camera);
    let surface = passes.surfaces.record(frame, group, scene, &lists);
    let light_grid = passes.direct.record_grid(frame, group);
    let radiance = passes.direct.record_deferred(frame, group, &surface, &shadows, &light_grid);
    if let Some(transparency) = passes.transparency.as_ref().filter(|_| scene.see_through()) {
        let light = (&shadows, &light_grid);
        transparency.record(frame, (group, scene), &lists, light, &surface.depth, &radiance);
    }
    FrameOutputs { radiance, shadows, light_grid, surface: Some(surface) }
}

fn forward(passes: &mut Passes, frame: &mut Frame<'_>, inputs: &FrameInputs<'_>) -> FrameOutputs {
    let group = passes.frame_group.group();
    let scene = &inputs.scene.gpu;
    passes.motion.record(frame, scene);
    let shadows = passes.shadows.record(frame, group, scene, inputs.shadow_views);
    let lists = passes.surfaces.cull(frame, scene, &inputs.camera);
    let surface = inputs.wants_surface.then(|| passes.surfaces.record(frame, group, scene, &lists));
    let light_grid = passes.direct.record_grid(frame, group);
    let radiance =
        passes.direct.record_forward(frame, (group, scene), &lists, &shadows, &light_grid, inputs.sky);
    if let Some(transparency) = passes.transparency.as_ref().filter(|_| scene.see_through()) {
        let depth = match &surface {
            Some(surface) => surface.depth.clone(),
            None => passes.surfaces.record_visibility(frame, group, scene, &lists),
        };
        let light = (&shadows, &light_grid);
        transparency.record(frame, (group, scene), &lists, light, &depth, &radiance);
    }
    FrameOutputs { radiance, shadows, light_grid, surface }
}
