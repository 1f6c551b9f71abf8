//! The frame functions: one straight line each.

use chiaro_gpu::{Buffer, Frame, Texture, wgpu};
use chiaro_techniques::shadow::{ShadowOutputs, ShadowSettings, ShadowViews};
use chiaro_techniques::shared::frame::FrameData;
use chiaro_techniques::surface::{SurfaceBuffer, SurfaceView};

use crate::renderer::Passes;
use crate::{LoadedScene, Pipeline, Settings};

/// What a frame leaves behind, valid until the next.
#[derive(Clone, Debug)]
pub struct FrameOutputs {
    /// Rgba16Float, nits · radiance scale; unlit materials are black.
    pub radiance: Texture,
    /// Rgba16Float, what unlit materials add to the picture once it is exposed: 1 is the display's white. Only for scenes
    /// that have such materials.
    pub unlit: Option<Texture>,
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
    pub camera: SurfaceView,
    pub shadow_views: &'a ShadowViews,
    /// Stored units; `None` = the environment.
    pub sky: Option<wgpu::Color>,
    pub wants_surface: bool,
    /// The frame, and the same without light.
    pub data: [FrameData; 2],
}

/// Records what `shade` does to one target under the frame's light, and to another for the colour of unlit materials.
fn shade_both(
    passes: &Passes,
    frame: &mut Frame<'_>,
    [light, dark]: &[FrameData; 2],
    mut shade: impl FnMut(&mut Frame<'_>, &Texture, bool),
) -> (Texture, Option<Texture>) {
    let (radiance, unlit) = (passes.direct.radiance(), passes.direct.unlit());
    shade(frame, radiance, false);
    if let Some(unlit) = unlit {
        frame.upload(&passes.frame_group.frame, &[*dark]);
        shade(frame, unlit, true);
        frame.upload(&passes.frame_group.frame, &[*light]);
    }
    (radiance.clone(), unlit.cloned())
}

pub(crate) fn record(
    settings: &Settings,
    passes: &mut Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
) -> FrameOutputs {
    match settings.pipeline {
        Pipeline::Deferred => deferred(&settings.shadow, passes, frame, inputs),
        Pipeline::Forward => forward(&settings.shadow, passes, frame, inputs),
    }
}

fn deferred(
    settings: &ShadowSettings,
    passes: &mut Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
) -> FrameOutputs {
    let group = passes.frame_group.group();
    let scene = &inputs.scene.gpu;
    passes.motion.record(frame, scene);
    let lists = passes.surfaces.cull(frame, scene, &inputs.camera.cull);
    let depth = passes.surfaces.record_visibility(frame, group, scene, &lists, &inputs.camera);
    let views = &passes.frame_group.lighting;
    let shadows =
        passes.shadows.record(frame, (group, views), scene, inputs.shadow_views, Some(&depth), settings);
    let surface = passes.surfaces.record_resolve(frame, group, scene, &lists);
    let light_grid = passes.direct.record_grid(frame, group);
    let light = (&shadows, &light_grid);
    let (radiance, unlit) = shade_both(passes, frame, &inputs.data, |frame, radiance, _| {
        passes.direct.record_deferred(frame, group, &surface, light, radiance);
        if let Some(transparency) = passes.transparency.as_ref().filter(|_| scene.see_through()) {
            transparency.record(frame, (group, scene), &lists, light, &surface.depth, radiance);
        }
    });
    FrameOutputs { radiance, unlit, shadows, light_grid, surface: Some(surface) }
}

fn forward(
    settings: &ShadowSettings,
    passes: &mut Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
) -> FrameOutputs {
    let group = passes.frame_group.group();
    let scene = &inputs.scene.gpu;
    passes.motion.record(frame, scene);
    let lists = passes.surfaces.cull(frame, scene, &inputs.camera.cull);
    let blends = passes.transparency.is_some() && scene.see_through();
    let needs_depth = inputs.wants_surface || blends || !inputs.shadow_views.fitted.is_empty();
    let depth =
        needs_depth.then(|| passes.surfaces.record_visibility(frame, group, scene, &lists, &inputs.camera));
    let views = &passes.frame_group.lighting;
    let shadows =
        passes.shadows.record(frame, (group, views), scene, inputs.shadow_views, depth.as_ref(), settings);
    let surface = inputs.wants_surface.then(|| passes.surfaces.record_resolve(frame, group, scene, &lists));
    let light_grid = passes.direct.record_grid(frame, group);
    let light = (&shadows, &light_grid);
    let transparency = passes.transparency.as_ref().filter(|_| scene.see_through());
    let (radiance, unlit) = shade_both(passes, frame, &inputs.data, |frame, radiance, dark| {
        let sky = if dark { Some(wgpu::Color::TRANSPARENT) } else { inputs.sky };
        passes.direct.record_forward(frame, (group, scene), &lists, light, sky, radiance);
        if let (Some(transparency), Some(depth)) = (transparency, &depth) {
            transparency.record(frame, (group, scene), &lists, light, depth, radiance);
        }
    });
    FrameOutputs { radiance, unlit, shadows, light_grid, surface }
}
