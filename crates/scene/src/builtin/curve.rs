//! Tubes along curves in space.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::{
    shape::{CREASE_DEG, Frame, circle, loft},
    solid::Solid,
};
use crate::Id;

/// Frames along a polyline whose x and y are perpendicular to it and do not twist about it (parallel transport). Along
/// a closed curve what twist is left at the end is spread evenly.
pub fn frames(points: &[Vec3], closed: bool) -> Vec<Frame> {
    let start = points[1] - points[if closed { points.len() - 1 } else { 0 }];
    frames_from(points, closed, start.normalize_or(Vec3::Y).any_orthonormal_vector())
}

/// [`frames`] whose first x is as near as possible to `first`.
pub fn frames_from(points: &[Vec3], closed: bool, first: Vec3) -> Vec<Frame> {
    let n = points.len();
    let tangent = |i: usize| {
        let (before, after) =
            if closed { ((i + n - 1) % n, (i + 1) % n) } else { (i.saturating_sub(1), (i + 1).min(n - 1)) };
        (points[after] - points[before]).normalize_or(Vec3::Y)
    };
    let mut along = tangent(0);
    let first = (first - along * along.dot(first)).normalize_or(along.any_orthonormal_vector());
    let mut x = first;
    let mut out = Vec::with_capacity(n);
    for (i, &origin) in points.iter().enumerate() {
        let next = tangent(i);
        x = Quat::from_rotation_arc(along, next) * x;
        x = (x - next * next.dot(x)).normalize_or(next.any_orthonormal_vector());
        along = next;
        out.push(Frame { origin, x, y: along.cross(x) });
    }
    if closed {
        let start = tangent(0);
        let last = Quat::from_rotation_arc(along, start) * x;
        let twist = start.dot(last.cross(first)).atan2(last.dot(first));
        for (i, frame) in out.iter_mut().enumerate() {
            let turn = Quat::from_axis_angle(frame.x.cross(frame.y), twist * i as f32 / n as f32);
            (frame.x, frame.y) = (turn * frame.x, turn * frame.y);
        }
    }
    out
}

/// A round tube with flat ends along a polyline; `radius_m` says how thick it is at each point.
pub fn tube(points: &[Vec3], radius_m: impl Fn(usize) -> f32, sides: usize, material: Id) -> Solid {
    let ring = |(i, f): (usize, &Frame)| -> Vec<Vec3> {
        circle(sides, radius_m(i)).iter().map(|p| f.origin + f.x * p.x + f.y * p.y).collect()
    };
    let rings: Vec<_> = frames(points, false).iter().enumerate().map(ring).collect();
    loft(&rings, CREASE_DEG, material)
}

/// A point of the (p, q) torus knot about the vertical at `t` in 0..1: p turns about the axis, q through the hole.
pub fn torus_knot(p: f32, q: f32, radius_m: f32, tube_m: f32, t: f32) -> Vec3 {
    let (about, through) = (TAU * p * t, TAU * q * t);
    let r = radius_m + tube_m * through.cos();
    Vec3::new(r * about.cos(), tube_m * through.sin(), r * about.sin())
}
