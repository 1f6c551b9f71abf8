//! What reflective shadow maps look at.

use bytemuck::{Pod, Zeroable};
use glam::{Mat3, Mat4, Vec2, Vec3};

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
/// A sun has a finer map where that is at most this share of the last across.
const MUCH_FINER: f32 = 0.25;
/// Maps that a sun has at most.
const MOST_NESTED: usize = 4;
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
    /// Texels that another map shows finer: x in the lower 16 bits, y in the upper ones, from these up to but without those.
    pub finer_from: u32,
    pub finer_to: u32,
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
/// `near`: where what casts a sun's shadows is only a small part of the scene, a box around that. The sun then has a finer map
/// there, and the one around the scene leaves it out; where texels of that are larger than the box, one or two between them.
///
/// `candidates`: dealt out to views by power where they are placed evenly.
pub fn fit(
    lights: &[LightData],
    (bounds_ws, near): ((Vec3, Vec3), &[Option<(Vec3, Vec3)>]),
    resolution: u32,
    candidates: u32,
) -> Vec<RsmView> {
    let mut views = Vec::new();
    for (number, light) in (0..).zip(lights) {
        if light.kind == LightData::DIRECTIONAL {
            let wide = Sun::around(light, bounds_ws, resolution);
            let near = near.get(number as usize).copied().flatten();
            views.extend(wide.nested(light, near, bounds_ws).into_iter().map(|sun| sun.view(light, number)));
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

/// Where a sun's map is, along the axes of [`light_axes`] about the scene's middle, metres.
#[derive(Clone, Copy, Debug)]
struct Sun {
    center: Vec3,
    half: Vec2,
    near: f32,
    far: f32,
    side: u32,
    // See `RsmViewData`.
    finer: [u32; 2],
}

impl Sun {
    fn around(light: &LightData, bounds_ws: (Vec3, Vec3), side: u32) -> Self {
        let axes = light_axes(light.direction_ws.into());
        let center = 0.5 * (bounds_ws.0 + bounds_ws.1);
        let around = corners(bounds_ws).map(|corner| axes * (corner - center));
        let half = around.into_iter().fold(Vec3::ZERO, |half, corner| half.max(corner.abs()));
        let slack = slack(-half.z, half.z, bounds_ws);
        // A scene without extent has a map all the same.
        let least = 1e-3 * half.max_element().max(1e-6);
        let across = 1.001 * half.truncate().max(Vec2::splat(least));
        Self { center, half: across, near: -half.z - slack, far: half.z + slack, side, finer: [0; 2] }
    }

    /// This and, where there is a box that is much smaller, finer ones around that: of a scene of kilometres a map of whole texels
    /// of the first is still wide.
    fn nested(self, light: &LightData, near: Option<(Vec3, Vec3)>, bounds_ws: (Vec3, Vec3)) -> Vec<Self> {
        let mut suns = vec![self];
        let Some(near) = near else { return suns };
        while let Some(finer) = suns.last_mut().and_then(|last| last.leave_out(light, near)) {
            suns.push(finer.shortened(light, bounds_ws));
            if suns.len() == MOST_NESTED {
                break;
            }
        }
        suns
    }

    /// The map of what is within its own extent of a box, in whole texels of this one, which leaves it out; none where that is
    /// not much finer.
    fn leave_out(&mut self, light: &LightData, near: (Vec3, Vec3)) -> Option<Self> {
        let axes = light_axes(light.direction_ws.into());
        let [mut low, mut high] = [Vec2::INFINITY, Vec2::NEG_INFINITY];
        for corner in corners(near) {
            let at = (axes * (corner - self.center)).truncate();
            (low, high) = (low.min(at), high.max(at));
        }
        let around = Vec2::splat((near.1 - near.0).length());
        let texels = self.side as f32;
        // Rows go down.
        let to_texel = |at: Vec2| (at / self.half * Vec2::new(0.5, -0.5) + 0.5) * texels;
        let [a, b] = [to_texel(low - around), to_texel(high + around)];
        let from = a.min(b).floor().clamp(Vec2::ZERO, Vec2::splat(texels));
        let to = a.max(b).ceil().clamp(Vec2::ZERO, Vec2::splat(texels));
        let wide = to - from;
        if !(wide.min_element() >= 1.0 && wide.max_element() <= MUCH_FINER * texels) {
            return None;
        }
        let packed = |at: Vec2| at.x as u32 | (at.y as u32) << 16;
        self.finer = [packed(from), packed(to)];
        let middle = (0.5 * (from + to) / texels - 0.5) * Vec2::new(2.0, -2.0) * self.half;
        let center = self.center + axes.inverse() * middle.extend(0.0);
        Some(Self { center, half: wide / texels * self.half, finer: [0; 2], ..*self })
    }

    /// The same with depths of no more than is in its way through a scene, which are as exact as that is short.
    fn shortened(self, light: &LightData, bounds_ws: (Vec3, Vec3)) -> Self {
        let direction = Vec3::from(light.direction_ws);
        let world_from_light = Mat3::from_quat(light_axes(direction).inverse());
        let mut range = (self.near, self.far);
        for axis in 0..3 {
            let along = direction[axis];
            // The map is as wide along each axis.
            let [x, y] = [world_from_light.x_axis[axis], world_from_light.y_axis[axis]];
            let reach = x.abs() * self.half.x + y.abs() * self.half.y;
            if along.abs() > 1e-6 {
                let ends = [bounds_ws.0[axis] - reach, bounds_ws.1[axis] + reach];
                let [a, b] = ends.map(|end| (end - self.center[axis]) / along);
                range = (range.0.max(a.min(b)), range.1.min(a.max(b)));
            }
        }
        if range.0 > range.1 {
            return self;
        }
        let slack = slack(range.0, range.1, bounds_ws);
        Self { near: self.near.max(range.0 - slack), far: self.far.min(range.1 + slack), ..self }
    }

    fn view(self, light: &LightData, number: u32) -> RsmView {
        let Self { center, half, near, far, side, finer: [finer_from, finer_to] } = self;
        let direction = Vec3::from(light.direction_ws);
        let clip_from_relative =
            reversed_orthographic(half, near, far) * Mat4::from_quat(light_axes(direction));
        let data = RsmViewData {
            relative_from_clip: clip_from_relative.inverse().to_cols_array_2d(),
            eye_ws: center.to_array(),
            light: number,
            axis_ws: direction.to_array(),
            texel: 4.0 * half.x * half.y / (side * side) as f32,
            side,
            is_parallel: 1,
            finer_from,
            finer_to,
            ..Zeroable::zeroed()
        };
        let clip_from_ws = clip_from_relative * Mat4::from_translation(-center);
        let draw = ViewData::new(&clip_from_ws, direction.extend(0.0), [side; 2]);
        let power = mean(light) * 4.0 * half.x * half.y;
        RsmView { draw: draw.dropping_back_faces(), data, power, light: *light }
    }
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
        let of = |kind| fit(&lights[kind..=kind], (BOUNDS, &[]), 512, 100).len();
        // Downwards within 86°: all but the face upwards.
        assert_eq!([of(0), of(1), of(2), of(3)], [1, 1, 6, 5]);
        let views = fit(&lights, (BOUNDS, &[]), 512, 100);
        let ends: Vec<_> = views.iter().map(|view| view.data.first + view.data.count).collect();
        assert_eq!(ends.last(), Some(&100));
        assert!(
            views.iter().zip(&ends).skip(1).all(|(view, _)| view.data.tiles == 2 * 64 * 64 + 11 * 32 * 32)
        );
    }

    #[test]
    fn what_casts_in_a_small_part_of_a_scene_has_a_map_that_the_other_leaves_out() {
        let sun = light(LightData::DIRECTIONAL, 0.0);
        let slanted = LightData { direction_ws: Vec3::new(0.3, -0.8, 0.2).normalize().to_array(), ..sun };
        let wide = (Vec3::new(-100.0, 0.0, -100.0), Vec3::new(100.0, 2.0, 100.0));
        let room = (Vec3::new(40.0, 0.0, -31.0), Vec3::new(42.0, 2.0, -29.0));
        for light in [sun, slanted] {
            let views = fit(&[light], (wide, &[Some(room)]), 512, 0);
            assert_eq!(views.len(), 2);
            let [outer, inner] = [views[0].data, views[1].data];
            let [from, to] = [outer.finer_from, outer.finer_to].map(|at| [at & 0xffff, at >> 16]);
            let texels = (to[0] - from[0]) * (to[1] - from[1]);
            let share = inner.texel * (inner.side * inner.side) as f32 / (outer.texel * texels as f32);
            assert!((share - 1.0).abs() < 1e-3, "the second map is {share} of what the first leaves out");
            // A place of the room is in the second, and in the first where that leaves it out.
            let seen = |data: &RsmViewData, at: Vec3| {
                let clip = Mat4::from_cols_array_2d(&data.relative_from_clip).inverse();
                let ndc = clip.project_point3(at - Vec3::from(data.eye_ws)).truncate();
                (ndc * Vec2::new(0.5, -0.5) + 0.5) * data.side as f32
            };
            let at = Vec3::new(41.5, 1.0, -30.4);
            let (first, second) = (seen(&outer, at), seen(&inner, at));
            assert!(second.min_element() > 100.0 && second.max_element() < 412.0, "{second}");
            let within = |i: usize| (from[i] as f32..to[i] as f32).contains(&first[i]);
            assert!(within(0) && within(1), "{first} of {from:?} to {to:?}");
        }
        assert_eq!(fit(&[sun], (room, &[Some(room)]), 512, 0).len(), 1);
    }

    #[test]
    fn on_ground_of_any_size_maps_end_at_what_stands_there_and_their_depths_are_as_exact() {
        let sun = light(LightData::DIRECTIONAL, 0.0);
        let slanted = LightData { direction_ws: Vec3::new(0.5, -0.6, 0.2).normalize().to_array(), ..sun };
        let room = (Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 3.0, 2.0));
        for light in [sun, slanted] {
            for (half, maps) in [(100.0, 2), (5e3, 3), (5e4, 3), (1e6, 4)] {
                let ground = (Vec3::new(-half, -0.1, -half), Vec3::new(half, 3.0, half));
                let views = fit(&[light], (ground, &[Some(room)]), 512, 0);
                assert!((2..=maps).contains(&views.len()), "{half} m: {} maps", views.len());
                let last = views[views.len() - 1].data;
                let clip_from_relative = Mat4::from_cols_array_2d(&last.relative_from_clip).inverse();
                for corner in corners(room) {
                    let ndc = clip_from_relative.project_point3(corner - Vec3::from(last.eye_ws));
                    assert!(ndc.truncate().abs().max_element() < 0.99, "{half} m: {ndc}");
                    assert!(ndc.z > 0.0 && ndc.z < 1.0, "{half} m: {ndc}");
                }
                // 24 bits of what is between its planes.
                let [texel, depths] = [
                    last.texel.sqrt(),
                    last.relative_from_clip[2][..3].iter().map(|x| x * x).sum::<f32>().sqrt(),
                ];
                assert!(texel < 0.2 && depths < 300.0, "{half} m: texels of {texel} m, {depths} m deep");
            }
        }
    }

    #[test]
    fn a_dim_light_has_a_candidate_beside_a_bright_one() {
        let dim = LightData { intensity: [1e-9; 3], ..light(LightData::SPOT, 0.5) };
        let dark = LightData { intensity: [0.0; 3], ..dim };
        let lights = [dim, light(LightData::DIRECTIONAL, 0.0), dark, dim];
        for (candidates, expected) in
            [(100, [1, 98, 0, 1]), (3, [1, 1, 0, 1]), (2, [0, 2, 0, 0]), (0, [0; 4])]
        {
            let views = fit(&lights, (BOUNDS, &[]), 64, candidates);
            assert_eq!(views.iter().map(|view| view.data.count).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn texels_of_a_cube_make_a_whole_sphere() {
        let views = fit(&[light(LightData::POINT, std::f32::consts::PI)], (BOUNDS, &[]), 128, 0);
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
