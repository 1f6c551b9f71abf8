//! A scene's lights as shaders read them.

use chiaro_scene::{Light, LightKind, Pose, Scene};
use glam::{Affine3A, Vec3};

use crate::frame::LightData;

/// Pixels a side of a froxel.
const TILE_PX: u32 = 64;
/// Depth slices of the froxel grid.
const SLICES: u32 = 24;

/// A light as it stands in the world. Shadow views are not set.
pub fn placed(light: &Light, world_from_light: &Affine3A) -> LightData {
    let (kind, inner, outer) = match light.kind {
        LightKind::Directional => (LightData::DIRECTIONAL, 0.0, 0.0),
        LightKind::Point => (LightData::POINT, 0.0, std::f32::consts::PI),
        LightKind::Spot { inner_rad, outer_rad } => (LightData::SPOT, inner_rad, outer_rad),
    };
    // KHR_lights_punctual's reference attenuation, whose floor of 1e-3 would soften hard cones: here a millionth.
    let scale = 1.0 / (f32::cos(inner) - f32::cos(outer)).max(1e-6);
    let direction = world_from_light.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z);
    LightData {
        position_ws: world_from_light.translation.into(),
        kind,
        direction_ws: direction.to_array(),
        inverse_range_squared: light.range_m.map_or(0.0, |range| 1.0 / (range * range)),
        intensity: (light.color * light.intensity).to_array(),
        first_view: LightData::NO_VIEW,
        cone_scale: scale,
        cone_offset: -outer.cos() * scale,
        view_count: 0,
        cone_rad: outer,
    }
}

/// All placed lights that shine, as they stand in a pose, directional ones first, and how many of those there are.
/// Shadow views are not set.
pub fn light_data(scene: &Scene, pose: &Pose) -> (Vec<LightData>, usize) {
    let all = scene.placed_lights_at(pose).into_iter();
    let mut lights: Vec<_> = all
        .map(|(light, world_from_light)| placed(&scene.lights[light], &world_from_light))
        .filter(|light| light.intensity != [0.0; 3])
        .collect();
    lights.sort_by_key(|light| light.kind != LightData::DIRECTIONAL);
    let directional = lights.iter().filter(|light| light.kind == LightData::DIRECTIONAL).count();
    (lights, directional)
}

/// The froxel grid of a picture: columns, rows, slices, words of light bits.
pub fn grid_size([width, height]: [u32; 2], local_lights: usize) -> [u32; 4] {
    let words = (local_lights as u32).div_ceil(32).max(1);
    [width.div_ceil(TILE_PX), height.div_ceil(TILE_PX), SLICES, words]
}

/// The largest illuminance that lights give at a typical distance, lux: what radiance is scaled by.
pub fn illuminance_scale(lights: &[LightData], bounds_ws: (Vec3, Vec3)) -> f32 {
    let extent = (bounds_ws.1 - bounds_ws.0).length();
    let extent = if extent > 0.0 { extent } else { 1.0 };
    // A lamp lights what stands a tenth of the scene away from it.
    let distance = 0.1 * extent;
    let of = |light: &LightData| {
        let peak = Vec3::from(light.intensity).max_element();
        if light.kind == LightData::DIRECTIONAL { peak } else { peak / (distance * distance) }
    };
    lights.iter().map(of).fold(0.0, f32::max)
}
