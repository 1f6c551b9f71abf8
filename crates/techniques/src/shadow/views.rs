//! Fitting shadow views to lights.

use glam::{Mat4, Quat, Vec2, Vec3, Vec4};

use super::{Filter, Layout, ShadowSettings};
use crate::shared::frame::{LightData, ShadowViewData};

/// A spot's map covers at most this angle from side to side.
const MAX_SPOT_ANGLE_RAD: f32 = 160.0 * std::f32::consts::PI / 180.0;
/// Texels of a spot's map beyond its cone, so that the filter has something to read at the edge.
const MARGIN_TEXELS: f32 = 4.0;
/// A WebGPU texture array has at most so many layers.
const MAX_VIEWS: usize = 256;
/// A spot's near plane as a share of the scene's extent. Reversed float depth keeps its precision whatever it is.
const NEAR_SHARE: f32 = 1e-4;

/// What the camera sees, for fitting suns' maps to it.
#[derive(Clone, Copy, Debug)]
pub struct CameraView {
    /// World position.
    pub eye_ws: Vec3,
    /// From unjittered reversed clip space to world space.
    pub ws_from_clip: Mat4,
}

/// A shadow view on the CPU.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Reversed depth.
    pub clip_from_ws: Mat4,
    /// The light's position with w = 1, or its direction with w = 0.
    pub eye_ws: Vec4,
    /// Texels a side.
    pub resolution: u32,
    /// What shaders read.
    pub data: ShadowViewData,
}

/// Gives every light its shadow view, and writes into the lights which. Sentences say what was given up.
pub fn fit(
    lights: &mut [LightData],
    bounds_ws: (Vec3, Vec3),
    camera: &CameraView,
    settings: &ShadowSettings,
) -> (Vec<ShadowView>, Vec<String>) {
    for light in lights.iter_mut() {
        (light.first_view, light.view_count) = (LightData::NO_VIEW, 0);
    }
    let mut notes = Vec::new();
    if settings.layout == Layout::None {
        return (Vec::new(), notes);
    }
    let casts = |light: &LightData| light.kind != LightData::POINT && light.intensity != [0.0; 3];
    let wanted = lights.iter().filter(|light| casts(light)).count();
    if wanted > MAX_VIEWS {
        notes.push(format!("{wanted} lights cast shadows, but only the first {MAX_VIEWS} have a map"));
    }
    let resolution = within_budget(settings, wanted.min(MAX_VIEWS), &mut notes);
    let mut views = Vec::new();
    for light in lights.iter_mut().filter(|light| casts(light)).take(MAX_VIEWS) {
        (light.first_view, light.view_count) = (views.len() as u32, 1);
        let layer = views.len() as u32;
        views.push(if light.kind == LightData::SPOT {
            spot(light, bounds_ws, resolution, layer, settings)
        } else {
            sun(light, bounds_ws, camera, resolution, layer, settings)
        });
    }
    (views, notes)
}

fn within_budget(settings: &ShadowSettings, views: usize, notes: &mut Vec<String>) -> u32 {
    let budget = u64::from(settings.memory_budget) << 20;
    let bytes = |side: u32| 4 * u64::from(side) * u64::from(side) * views as u64;
    let mut side = settings.resolution;
    while bytes(side) > budget && side > 16 {
        side /= 2;
    }
    if side != settings.resolution {
        notes.push(format!(
            "{views} shadow maps of {}² texels exceed shadow.memory_budget = {} MiB: they have {side}²",
            settings.resolution, settings.memory_budget
        ));
    }
    side
}

fn data(clip_from_ws: &Mat4, settings: &ShadowSettings, resolution: u32, layer: u32) -> ShadowViewData {
    ShadowViewData {
        clip_from_ws: clip_from_ws.to_cols_array_2d(),
        rect: [1.0, 1.0, 0.0, 0.0],
        layer,
        perspective: 0,
        texel_m: 0.0,
        // One unfiltered test is off by up to half a texel, as much as the bilinear kernel's half reach.
        normal_offset: settings.bias_normal_offset * if settings.filter == Filter::None { 1.5 } else { 1.0 },
        constant_bias: settings.bias_constant,
        slope_bias: settings.bias_slope,
        near_m: 0.0,
        far_m: 0.0,
        eye_ws: [0.0; 3],
        resolution: resolution as f32,
    }
}

fn corners((lo, hi): (Vec3, Vec3)) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
        Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
    })
}

/// World axes → the light's, which looks along −Z.
fn light_axes(direction: Vec3) -> Quat {
    let x = direction.any_orthonormal_vector();
    let y = (-direction).cross(x);
    Quat::from_mat3(&glam::Mat3::from_cols(x, y, -direction)).conjugate()
}

fn spot(
    light: &LightData,
    bounds: (Vec3, Vec3),
    resolution: u32,
    layer: u32,
    settings: &ShadowSettings,
) -> ShadowView {
    let eye = Vec3::from(light.position_ws);
    let angle = (2.0 * light.cone_rad).min(MAX_SPOT_ANGLE_RAD);
    let half = (0.5 * angle).tan() * (1.0 + 2.0 * MARGIN_TEXELS / resolution as f32);
    let reach = corners(bounds).into_iter().map(|corner| corner.distance(eye)).fold(0.0, f32::max);
    let near = (NEAR_SHARE * (bounds.1 - bounds.0).length()).max(1e-6);
    let far = (1.01 * reach).max(2.0 * near);
    let ls_from_ws = Mat4::from_quat(light_axes(light.direction_ws.into())) * Mat4::from_translation(-eye);
    let clip_from_ws = reversed_perspective(Vec2::splat(half), near, far) * ls_from_ws;
    let view = ShadowViewData {
        perspective: 1,
        texel_m: 2.0 * half / resolution as f32,
        near_m: near,
        far_m: far,
        eye_ws: light.position_ws,
        ..data(&clip_from_ws, settings, resolution, layer)
    };
    ShadowView { clip_from_ws, eye_ws: eye.extend(1.0), resolution, data: view }
}

fn sun(
    light: &LightData,
    bounds: (Vec3, Vec3),
    camera: &CameraView,
    resolution: u32,
    layer: u32,
    settings: &ShadowSettings,
) -> ShadowView {
    let direction = Vec3::from(light.direction_ws);
    let axes = light_axes(direction);
    let box_of = |points: &[Vec3]| {
        points.iter().map(|&p| axes * p).fold((Vec3::MAX, Vec3::MIN), |(lo, hi), p| (lo.min(p), hi.max(p)))
    };
    let scene = box_of(&corners(bounds));
    let seen = box_of(&seen_by(camera, bounds));
    // A camera that looks past the scene sees no receiver: any rectangle will do.
    let (mut lo, mut hi) = (seen.0.truncate(), seen.1.truncate());
    if lo.cmpge(hi).any() {
        (lo, hi) = (scene.0.truncate(), scene.1.truncate());
    }
    let (lo, size) = snapped(lo, hi, resolution);
    let center = lo + 0.5 * size;
    // All casters between the sun and the receivers: the whole scene along the light.
    let (near, far) = (-scene.1.z, -scene.0.z);
    let slack = 1e-3 * (far - near).max(1e-3);
    let (near, far) = (near - slack, far + slack);
    let clip_from_ls =
        reversed_orthographic(0.5 * size, near, far) * Mat4::from_translation((-center).extend(0.0));
    let clip_from_ws = clip_from_ls * Mat4::from_quat(axes);
    let view = ShadowViewData {
        texel_m: size.max_element() / resolution as f32,
        near_m: near,
        far_m: far,
        ..data(&clip_from_ws, settings, resolution, layer)
    };
    ShadowView { clip_from_ws, eye_ws: direction.extend(0.0), resolution, data: view }
}

/// Vertices of the part of the scene's box that the camera sees; empty when it looks past it.
///
/// Every vertex of the intersection of two convex bodies lies on a face of one of them: each body's faces are clipped
/// by the other's planes (Sutherland & Hodgman 1974).
fn seen_by(camera: &CameraView, bounds: (Vec3, Vec3)) -> Vec<Vec3> {
    let reach = corners(bounds).into_iter().map(|c| c.distance(camera.eye_ws)).fold(0.0, f32::max);
    let ends = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
        // Two points of the pixel's ray, whatever the projection.
        let near = camera.ws_from_clip.project_point3(Vec3::new(x, y, 1.0));
        let further = camera.ws_from_clip.project_point3(Vec3::new(x, y, 0.5));
        // A ray slanted from the axis must reach as deep as the axis itself.
        (near, near + (further - near).normalize_or_zero() * (2.0 * reach))
    });
    let view: Vec<Vec<Vec3>> = (0..4)
        .map(|i| (ends[i], ends[(i + 1) % 4]))
        .map(|((near, far), (next_near, next_far))| vec![near, next_near, next_far, far])
        .chain([ends.map(|(near, _)| near).to_vec()])
        .collect();
    let c = corners(bounds);
    let faces = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];
    let scene: Vec<Vec<Vec3>> = faces.map(|face| face.map(|i| c[i]).to_vec()).to_vec();
    let view_middle = ends.iter().map(|(near, far)| near + far).sum::<Vec3>() / 8.0;
    let scene_planes = planes(&scene, 0.5 * (bounds.0 + bounds.1));
    let view_planes = planes(&view, view_middle);
    let clipped = |faces: &[Vec<Vec3>], planes: &[Vec4]| -> Vec<Vec3> {
        faces
            .iter()
            .flat_map(|face| planes.iter().fold(face.clone(), |face, plane| clip(&face, *plane)))
            .collect()
    };
    [clipped(&scene, &view_planes), clipped(&view, &scene_planes)].concat()
}

/// Planes of convex faces, positive towards `inside`. A face without area bounds nothing.
fn planes(faces: &[Vec<Vec3>], inside: Vec3) -> Vec<Vec4> {
    let plane = |face: &Vec<Vec3>| {
        let normal = (face[1] - face[0]).cross(face[2] - face[1]).try_normalize();
        // A pyramid's near side may be a point, whose neighbours still span the plane.
        let normal = normal.or_else(|| (face[2] - face[1]).cross(face[3] - face[2]).try_normalize())?;
        let plane = normal.extend(-normal.dot(face[2]));
        Some(if plane.dot(inside.extend(1.0)) < 0.0 { -plane } else { plane })
    };
    faces.iter().filter_map(plane).collect()
}

/// The part of a convex polygon on a plane's positive side.
fn clip(polygon: &[Vec3], plane: Vec4) -> Vec<Vec3> {
    let height = |p: Vec3| plane.dot(p.extend(1.0));
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &p) in polygon.iter().enumerate() {
        let q = polygon[(i + 1) % polygon.len()];
        let (hp, hq) = (height(p), height(q));
        if hp >= 0.0 {
            kept.push(p);
        }
        if (hp >= 0.0) != (hq >= 0.0) {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}

/// The rectangle on a grid of its own texels and in steps of its size, so that a small move of the camera moves the
/// map by whole texels and edges do not swim.
fn snapped(lo: Vec2, hi: Vec2, resolution: u32) -> (Vec2, Vec2) {
    let step = |length: f32| {
        // Sizes in quarter octaves, with two texels to spare for the snap.
        let wanted = length.max(1e-4) * (1.0 + 2.0 / resolution as f32);
        (0.25 * (4.0 * wanted.log2()).ceil()).exp2()
    };
    let size = Vec2::new(step(hi.x - lo.x), step(hi.y - lo.y));
    let texel = size / resolution as f32;
    let center = 0.5 * (lo + hi);
    let corner = ((center - 0.5 * size) / texel).round() * texel;
    (corner, size)
}

/// Looks along −Z; half extents at one metre; near = 1, far = 0.
fn reversed_perspective(half: Vec2, near: f32, far: f32) -> Mat4 {
    let a = near / (far - near);
    Mat4::from_cols(
        Vec4::new(1.0 / half.x, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 1.0 / half.y, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, -1.0),
        Vec4::new(0.0, 0.0, a * far, 0.0),
    )
}

/// Looks along −Z; half extents in metres; near = 1, far = 0.
fn reversed_orthographic(half: Vec2, near: f32, far: f32) -> Mat4 {
    let a = 1.0 / (far - near);
    Mat4::from_cols(
        Vec4::new(1.0 / half.x, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 1.0 / half.y, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, 0.0),
        Vec4::new(0.0, 0.0, a * far, 1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(kind: u32, direction: Vec3) -> LightData {
        LightData {
            position_ws: [0.0, 5.0, 0.0],
            kind,
            direction_ws: direction.normalize().to_array(),
            inverse_range_squared: 0.0,
            intensity: [1.0; 3],
            first_view: 0,
            cone_scale: 1.0,
            cone_offset: 0.0,
            view_count: 0,
            cone_rad: 0.5,
        }
    }

    fn camera() -> CameraView {
        let view = Mat4::from_translation(Vec3::new(0.0, -1.0, -10.0));
        let projection = reversed_perspective(Vec2::splat(0.6), 0.1, 1000.0);
        CameraView { eye_ws: Vec3::new(0.0, 1.0, 10.0), ws_from_clip: (projection * view).inverse() }
    }

    const BOUNDS: (Vec3, Vec3) = (Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 4.0, 3.0));

    #[test]
    fn a_suns_map_holds_every_visible_corner_with_reversed_depth() {
        let mut lights = [light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2))];
        let (views, notes) = fit(&mut lights, BOUNDS, &camera(), &ShadowSettings::default());
        assert!(notes.is_empty());
        assert_eq!(lights[0].first_view, 0);
        for corner in corners(BOUNDS) {
            let p = views[0].clip_from_ws.project_point3(corner);
            assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0 && (0.0..=1.0).contains(&p.z), "{corner} at {p}");
        }
        let toward_sun = views[0].clip_from_ws.project_point3(Vec3::new(0.0, 4.0, 0.0)).z;
        assert!(toward_sun > views[0].clip_from_ws.project_point3(Vec3::ZERO).z);
    }

    #[test]
    fn a_suns_map_is_no_larger_than_what_the_camera_sees_of_the_scene() {
        // From 20 m above, 0.2 rad to each side, a floor of 200 m shows 8 m; the map may round that up by a quarter octave.
        let floor = (Vec3::new(-100.0, -0.1, -100.0), Vec3::new(100.0, 0.0, 100.0));
        let projection = reversed_perspective(Vec2::splat(0.2), 0.1, 1000.0);
        let eye = Vec3::new(0.0, 20.0, 0.0);
        let down = Mat4::from_rotation_x(std::f32::consts::FRAC_PI_2) * Mat4::from_translation(-eye);
        let camera = CameraView { eye_ws: eye, ws_from_clip: (projection * down).inverse() };
        let sun = light(LightData::DIRECTIONAL, Vec3::new(0.8, -0.6, 0.0));
        let settings = ShadowSettings::default();
        let (views, _) = fit(&mut [sun], floor, &camera, &settings);
        let side_m = views[0].data.texel_m * settings.resolution as f32;
        assert!((8.0..10.0).contains(&side_m), "{side_m}");
    }

    #[test]
    fn a_spots_map_covers_its_cone_and_no_more_than_a_margin() {
        let mut lights = [light(LightData::SPOT, Vec3::NEG_Y)];
        let (views, _) = fit(&mut lights, BOUNDS, &camera(), &ShadowSettings::default());
        let rim = Vec3::new(5.0 * 0.5f32.tan(), 0.0, 0.0);
        let p = views[0].clip_from_ws.project_point3(rim);
        let radius = p.truncate().length();
        assert!(radius < 1.0 && radius > 0.99, "{radius}");
    }

    #[test]
    fn a_sun_fitted_to_a_moving_camera_moves_by_whole_texels() {
        let sun = light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2));
        let settings = ShadowSettings::default();
        let wide = (Vec3::new(-500.0, 0.0, -500.0), Vec3::new(500.0, 10.0, 500.0));
        let texel_of = |shift: f32| {
            let projection = reversed_perspective(Vec2::splat(0.6), 0.1, 1000.0);
            let view = Mat4::from_translation(Vec3::new(-shift, -1.0, -10.0));
            let camera = CameraView {
                eye_ws: Vec3::new(shift, 1.0, 10.0),
                ws_from_clip: (projection * view).inverse(),
            };
            let (views, _) = fit(&mut [sun], wide, &camera, &settings);
            let p = views[0].clip_from_ws.project_point3(Vec3::new(1.0, 0.0, -7.0)).truncate();
            (views[0].data.texel_m, p * 0.5 * settings.resolution as f32)
        };
        let (size, at) = texel_of(0.0);
        for shift in [0.013, 0.21, 0.4] {
            let (same, moved) = texel_of(shift);
            assert_eq!(size, same);
            let off = (moved - at - (moved - at).round()).abs().max_element();
            assert!(off < 0.02, "moved by {} texels", moved - at);
        }
    }

    #[test]
    fn too_many_maps_are_made_smaller_and_said() {
        let mut lights = [light(LightData::SPOT, Vec3::NEG_Y); 40];
        let (views, notes) = fit(&mut lights, BOUNDS, &camera(), &ShadowSettings::default());
        assert_eq!(views[39].resolution, 1024);
        assert_eq!(notes.len(), 1);
    }
}
