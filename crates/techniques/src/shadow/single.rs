//! One map per sun, around what the camera can see of where its shadows are.

use glam::{Mat4, Vec2, Vec3, Vec4};

use super::CameraView;
use super::maker::Maker;
use super::views::ShadowView;
use crate::frame::{LightData, ShadowViewData};
use crate::view::project::{corners, light_axes, reversed_orthographic, slack};

pub(super) fn fit(light: &LightData, make: &Maker<'_>, layer: u32) -> ShadowView {
    let bounds = make.shadowed(light.direction_ws.into()).region;
    let resolution = make.resolution;
    let direction = Vec3::from(light.direction_ws);
    let axes = light_axes(direction);
    let box_of = |points: &[Vec3]| {
        points.iter().map(|&p| axes * p).fold((Vec3::MAX, Vec3::MIN), |(lo, hi), p| (lo.min(p), hi.max(p)))
    };
    let scene = box_of(&corners(bounds));
    let seen = box_of(&seen_by(&make.inputs.camera, bounds));
    // A camera that looks past the scene sees no receiver: any rectangle will do.
    let (mut lo, mut hi) = (seen.0.truncate(), seen.1.truncate());
    if lo.cmpge(hi).any() {
        (lo, hi) = (scene.0.truncate(), scene.1.truncate());
    }
    let (lo, size) = snapped(lo, hi, resolution, make.border);
    let center = lo + 0.5 * size;
    // All casters between the sun and the receivers: the whole scene along the light.
    let (near, far) = (-scene.1.z, -scene.0.z);
    let slack = slack(near, far, bounds);
    let (near, far) = (near - slack, far + slack);
    let clip_from_ls =
        reversed_orthographic(0.5 * size, near, far) * Mat4::from_translation((-center).extend(0.0));
    let clip_from_ws = clip_from_ls * Mat4::from_quat(axes);
    let data = ShadowViewData {
        texel_m: size.max_element() / resolution as f32,
        near_m: near,
        far_m: far,
        ..make.data(&clip_from_ws, layer)
    };
    ShadowView { clip_from_ws, eye_ws: direction.extend(0.0), resolution, data, hole: None }
}

/// The rectangle on a grid of its own texels and in steps of its size, so that a small move of the camera moves the
/// map by whole texels and edges do not swim.
fn snapped(lo: Vec2, hi: Vec2, resolution: u32, border: f32) -> (Vec2, Vec2) {
    let step = |length: f32| {
        // Sizes in quarter octaves, with room for filters.
        let wanted = length.max(1e-30) / (1.0 - 2.0 * border / resolution as f32);
        (0.25 * (4.0 * wanted.log2()).ceil()).exp2()
    };
    let size = Vec2::new(step(hi.x - lo.x), step(hi.y - lo.y));
    let texel = size / resolution as f32;
    let center = 0.5 * (lo + hi);
    let corner = ((center - 0.5 * size) / texel).round() * texel;
    (corner, size)
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
