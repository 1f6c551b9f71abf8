//! What reflective shadow maps look at.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3};

use crate::frame::LightData;
use crate::view::ViewData;
use crate::view::project::{corners, light_axes, reversed_orthographic, reversed_perspective, slack};

/// A local light's near plane as a share of the scene's extent: what is before it gets no light to scatter on, and reversed
/// depths are as exact however near it is. So lamps light the rooms of a scene of kilometres.
const NEAR_SHARE: f32 = 1e-7;
/// A spot with a wider half angle is looked at like a point, radians.
const WIDEST: f32 = 1.3;
/// From a cube face's axis to its corner, radians.
const FACE: f32 = 0.955_32;
/// Texels of a tile's side; twin of `TILE` in `rsm.wesl`.
pub(super) const TILE: u32 = 8;

/// See `rsm.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct RsmViewData {
    pub relative_from_clip: [[f32; 4]; 4],
    pub eye_ws: [f32; 3],
    pub light: u32,
    pub axis_ws: [f32; 3],
    pub texel: f32,
    pub first_tile: u32,
    pub tiles: u32,
    pub side: u32,
    pub is_parallel: u32,
    pub first: u32,
    pub count: u32,
    pub reserved0: u32,
    pub reserved1: u32,
}

/// A map to be drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RsmView {
    /// What is drawn; its layer is its number among all.
    pub draw: ViewData,
    /// What shaders read.
    pub data: RsmViewData,
    /// What of its light the map may show: lumens on what faces it, mean of the colours; as its share of virtual lights.
    pub power: f32,
    light: LightData,
}

impl RsmView {
    /// Whether a map that was drawn for `other` shows the same.
    pub(super) fn shows_as(&self, other: &Self) -> bool {
        let without = |light: &LightData| LightData { first_view: 0, view_count: 0, ..*light };
        let place = |view: &Self| RsmViewData { first: 0, count: 0, ..view.data };
        self.draw == other.draw
            && without(&self.light) == without(&other.light)
            && place(self) == place(other)
    }
}

/// Tiles that a map of a side has in the buffer: on a square whose side is a power of two.
fn tiles(side: u32) -> u32 {
    side.div_ceil(TILE).next_power_of_two().pow(2)
}

/// The views of all lights, in their order: of a sun one around the scene, of a spot one around its cone, of a point, and of
/// a spot wider than 75°, the faces of a cube that it shines at, with half as many texels a side.
///
/// `candidates`: dealt out to views by power where they are placed evenly.
pub fn fit(lights: &[LightData], bounds_ws: (Vec3, Vec3), resolution: u32, candidates: u32) -> Vec<RsmView> {
    let mut views = Vec::new();
    for (number, light) in (0..).zip(lights) {
        if light.kind == LightData::DIRECTIONAL {
            views.push(sun(light, number, bounds_ws, resolution));
            continue;
        }
        let outer = light.cone_rad;
        if outer < WIDEST {
            let axis = Vec3::from(light.direction_ws);
            views.push(local(light, number, (axis, 1.001 * outer.tan()), bounds_ws, resolution));
            continue;
        }
        let side = resolution / 2;
        for axis in [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z] {
            let off = axis.dot(light.direction_ws.into()).clamp(-1.0, 1.0).acos();
            if off < outer + FACE {
                views.push(local(light, number, (axis, 1.0), bounds_ws, side));
            }
        }
    }
    let mut first_tile = 0;
    for (layer, view) in (0..).zip(&mut views) {
        view.draw.layer = layer;
        view.data.first_tile = first_tile;
        first_tile += tiles(view.data.side);
    }
    for view in &mut views {
        view.data.tiles = first_tile;
    }
    deal(&mut views, candidates);
    views
}

/// Gives every view a run of candidates as long as its share of all power, but none that has any goes without while there
/// are enough.
fn deal(views: &mut [RsmView], candidates: u32) {
    let all: f64 = views.iter().map(|view| f64::from(view.power)).sum();
    let lit = views.iter().filter(|view| view.power > 0.0).count() as u32;
    let least = u32::from(lit <= candidates);
    let dealt = f64::from(candidates - least * lit);
    let (mut before, mut first, mut given) = (0.0, 0, 0);
    for view in views.iter_mut() {
        before += f64::from(view.power);
        given += least * u32::from(view.power > 0.0);
        // A sum of everything leaves no rest.
        let end = given + (dealt * if all > 0.0 { before / all } else { 0.0 }).round() as u32;
        (view.data.first, view.data.count) = (first, end - first);
        first = end;
    }
}

fn mean(light: &LightData) -> f32 {
    let mean = light.intensity.iter().sum::<f32>() / 3.0;
    if mean.is_finite() { mean.max(0.0) } else { 0.0 }
}

fn sun(light: &LightData, number: u32, bounds_ws: (Vec3, Vec3), side: u32) -> RsmView {
    let direction = Vec3::from(light.direction_ws);
    let axes = light_axes(direction);
    let center = 0.5 * (bounds_ws.0 + bounds_ws.1);
    let around = corners(bounds_ws).map(|corner| axes * (corner - center));
    let half = around.into_iter().fold(Vec3::ZERO, |half, corner| half.max(corner.abs()));
    let slack = slack(-half.z, half.z, bounds_ws);
    // A scene without extent has a map all the same.
    let least = 1e-3 * half.max_element().max(1e-6);
    let across = 1.001 * half.truncate().max(Vec2::splat(least));
    let clip_from_relative =
        reversed_orthographic(across, -half.z - slack, half.z + slack) * Mat4::from_quat(axes);
    let texel = 4.0 * across.x * across.y / (side * side) as f32;
    let data = RsmViewData {
        relative_from_clip: clip_from_relative.inverse().to_cols_array_2d(),
        eye_ws: center.to_array(),
        light: number,
        axis_ws: direction.to_array(),
        texel,
        side,
        is_parallel: 1,
        ..Zeroable::zeroed()
    };
    let clip_from_ws = clip_from_relative * Mat4::from_translation(-center);
    let draw = ViewData::new(&clip_from_ws, direction.extend(0.0), [side; 2]);
    let power = mean(light) * 4.0 * across.x * across.y;
    RsmView { draw: draw.dropping_back_faces(), data, power, light: *light }
}

fn local(
    light: &LightData,
    number: u32,
    (axis, half): (Vec3, f32),
    bounds_ws: (Vec3, Vec3),
    side: u32,
) -> RsmView {
    let eye = Vec3::from(light.position_ws);
    let reach = corners(bounds_ws).into_iter().map(|corner| corner.distance(eye)).fold(0.0, f32::max);
    let near = (NEAR_SHARE * (bounds_ws.1 - bounds_ws.0).length()).max(NEAR_SHARE * 1e-3 * reach).max(1e-30);
    let far = (1.01 * reach).max(2.0 * near);
    let clip_from_relative =
        reversed_perspective(Vec2::splat(half), near, far) * Mat4::from_quat(light_axes(axis));
    let data = RsmViewData {
        relative_from_clip: clip_from_relative.inverse().to_cols_array_2d(),
        eye_ws: eye.to_array(),
        light: number,
        axis_ws: axis.to_array(),
        texel: 4.0 * half * half / (side * side) as f32,
        side,
        is_parallel: 0,
        ..Zeroable::zeroed()
    };
    let draw =
        ViewData::new(&(clip_from_relative * Mat4::from_translation(-eye)), eye.extend(1.0), [side; 2]);
    // Of a cube's face a sixth of all directions.
    let solid_angle = if half == 1.0 {
        4.0 * std::f32::consts::PI / 6.0
    } else {
        2.0 * std::f32::consts::PI * (1.0 - light.cone_rad.cos())
    };
    let power = mean(light) * solid_angle;
    RsmView { draw: draw.dropping_back_faces(), data, power, light: *light }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: u32, cone_rad: f32) -> LightData {
        LightData {
            kind,
            direction_ws: [0.0, -1.0, 0.0],
            intensity: [1.0; 3],
            cone_rad,
            ..Zeroable::zeroed()
        }
    }

    const BOUNDS: (Vec3, Vec3) = (Vec3::NEG_ONE, Vec3::ONE);

    #[test]
    fn a_sun_has_one_map_a_spot_one_and_a_point_six() {
        let lights = [
            light(LightData::DIRECTIONAL, 0.0),
            light(LightData::SPOT, 0.5),
            light(LightData::POINT, std::f32::consts::PI),
            light(LightData::SPOT, 1.5),
        ];
        let of = |kind| fit(&lights[kind..=kind], BOUNDS, 512, 100).len();
        // Downwards within 86°: all but the face upwards.
        assert_eq!([of(0), of(1), of(2), of(3)], [1, 1, 6, 5]);
        let views = fit(&lights, BOUNDS, 512, 100);
        let ends: Vec<_> = views.iter().map(|view| view.data.first + view.data.count).collect();
        assert_eq!(ends.last(), Some(&100));
        assert!(
            views.iter().zip(&ends).skip(1).all(|(view, _)| view.data.tiles == 2 * 64 * 64 + 11 * 32 * 32)
        );
    }

    #[test]
    fn a_dim_light_has_a_candidate_beside_a_bright_one() {
        let dim = LightData { intensity: [1e-9; 3], ..light(LightData::SPOT, 0.5) };
        let dark = LightData { intensity: [0.0; 3], ..dim };
        let lights = [dim, light(LightData::DIRECTIONAL, 0.0), dark, dim];
        for (candidates, expected) in
            [(100, [1, 98, 0, 1]), (3, [1, 1, 0, 1]), (2, [0, 2, 0, 0]), (0, [0; 4])]
        {
            let views = fit(&lights, BOUNDS, 64, candidates);
            assert_eq!(views.iter().map(|view| view.data.count).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn texels_of_a_cube_make_a_whole_sphere() {
        let views = fit(&[light(LightData::POINT, std::f32::consts::PI)], BOUNDS, 128, 0);
        let side = views[0].data.side;
        let mut sphere = 0.0;
        for y in 0..side {
            for x in 0..side {
                let at = |i: u32| (i as f32 + 0.5) / side as f32 * 2.0 - 1.0;
                let cosine = (1.0 + at(x).powi(2) + at(y).powi(2)).sqrt().recip();
                sphere += 6.0 * views[0].data.texel * cosine.powi(3);
            }
        }
        assert!((sphere / (4.0 * std::f32::consts::PI) - 1.0).abs() < 1e-3, "{sphere}");
    }
}
