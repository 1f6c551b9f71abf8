//! The frame's data as the tracers read it.

use bytemuck::Zeroable;
use chiaro_gpu::Gpu;
use chiaro_techniques::environment;
use chiaro_techniques::frame::{FIRST_LIGHT_BYTES, FrameData, FrameGroup, LightData};
use glam::{Vec2, Vec3};

use crate::{LoadedScene, Settings, View};

/// Fills group 0 with the camera without jitter, and with lights that no map shadows.
pub(super) fn write_frame(
    gpu: &Gpu,
    group: &FrameGroup,
    (loaded, settings): (&LoadedScene, &Settings),
    (view, size_px): (&View, [u32; 2]),
) {
    let data = frame_data(loaded, settings, view, size_px);
    let lights: Vec<_> =
        loaded.lights().iter().map(|l| LightData { first_view: LightData::NO_VIEW, ..*l }).collect();
    gpu.queue.write_buffer(group.frame.raw(), 0, bytemuck::bytes_of(&data));
    gpu.queue.write_buffer(group.lighting.raw(), FIRST_LIGHT_BYTES, bytemuck::cast_slice(&lights));
}

/// Radiance of the sky where there is no environment map, nits.
pub(super) fn sky(loaded: &LoadedScene, settings: &Settings) -> Vec3 {
    environment::sky(&settings.environment, loaded.lights(), loaded.environment.is_some())
}

fn frame_data(loaded: &LoadedScene, settings: &Settings, view: &View, size_px: [u32; 2]) -> FrameData {
    let turn = settings.environment.rotation.to_radians();
    let clip_from_ws = view.clip_from_ws(size_px, Vec2::ZERO).to_cols_array_2d();
    let nits = loaded.environment.as_ref().map_or(0.0, |map| map.nits * settings.environment.intensity);
    FrameData {
        clip_from_ws,
        relative_from_clip: view.relative_from_clip(size_px, Vec2::ZERO).to_cols_array_2d(),
        eye_ws: view.eye_ws().to_array(),
        orthographic: u32::from(view.is_orthographic()),
        forward_ws: view.forward_ws().to_array(),
        footprint_scale: 1.0,
        size_px,
        directional_lights: loaded.directional() as u32,
        local_lights: (loaded.lights().len() - loaded.directional()) as u32,
        lighting_model: settings.surface.lighting as u32,
        normal_maps: u32::from(settings.surface.normal_maps),
        sky: sky(loaded, settings).to_array(),
        radiance_scale: 1.0,
        anisotropy: 1,
        environment_nits: nits,
        environment_share: 1.0,
        environment_turn: [turn.cos(), turn.sin()],
        show_direct: 1.0,
        show_indirect: 1.0,
        show_caustics: 1.0,
        ..FrameData::zeroed()
    }
}
