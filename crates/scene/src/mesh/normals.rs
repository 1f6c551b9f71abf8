//! Vertex normals where a file gives none, or none that are of use.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::{Key, area_normal, bits, corners, split, unit};
use crate::Primitive;

/// What a triangle without an area gets where nothing better is known.
pub(crate) const FALLBACK: Vec3 = Vec3::Y;

/// Corners that may meet at a point before [`crease`] gives up comparing each with each: a star of more triangles is
/// a defect or an attack, and the comparison is quadratic.
const MAX_MEETING: usize = 512;

fn key(normal: Vec3) -> Key {
    let [x, y, z] = bits(normal);
    [x, y, z, 0]
}

/// Sets each corner's normal, splitting vertices where they differ.
fn set_corner_normals(primitive: &mut Primitive, normals: &[Vec3]) {
    primitive.normals.clear();
    let keys: Vec<Key> = normals.iter().map(|&n| key(n)).collect();
    primitive.normals = split(primitive, &keys).into_iter().map(|corner| normals[corner]).collect();
}

/// Flat normals: each triangle's own, in every shape that it may be bent to.
pub(crate) fn flat(primitive: &mut Primitive) {
    let triangles = 0..primitive.indices.len() / 3;
    let of = |triangle| unit(area_normal(corners(primitive, triangle))).unwrap_or(FALLBACK);
    let normals: Vec<Vec3> = triangles.flat_map(|triangle| [of(triangle); 3]).collect();
    primitive.flat = !primitive.joints.is_empty() || !primitive.morph_targets.is_empty();
    if primitive.flat {
        // Triangles that lie in one plane may leave it.
        let keys: Vec<Key> = (0..normals.len() as u32).map(|corner| [corner / 3, 0, 0, 0]).collect();
        primitive.normals = split(primitive, &keys).into_iter().map(|corner| normals[corner]).collect();
    } else {
        set_corner_normals(primitive, &normals);
    }
}

/// Makes every normal a unit vector; those without a direction become the mean of the adjacent triangles'. Returns
/// how many had none.
pub(crate) fn repair(primitive: &mut Primitive) -> usize {
    let mut broken = Vec::new();
    for (vertex, normal) in primitive.normals.iter_mut().enumerate() {
        match unit(normal.as_dvec3()) {
            Some(n) => *normal = n,
            None => broken.push(vertex),
        }
    }
    if broken.is_empty() {
        return 0;
    }
    let mut sums = vec![DVec3::ZERO; primitive.positions.len()];
    for triangle in 0..primitive.indices.len() / 3 {
        let normal = area_normal(corners(primitive, triangle));
        for index in &primitive.indices[3 * triangle..3 * triangle + 3] {
            sums[*index as usize] += normal;
        }
    }
    for &vertex in &broken {
        primitive.normals[vertex] = unit(sums[vertex]).unwrap_or(FALLBACK);
    }
    broken.len()
}

/// With which of its neighbours a triangle is shaded smoothly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Smoothing {
    /// Those at a small angle.
    ByAngle,
    /// None.
    Off,
    /// Those of the same group.
    Group(u32),
}

/// A triangle's corner where it meets others.
struct Corner {
    /// The primitive and its corner.
    at: (usize, usize),
    face_normal: Vec3,
    smoothing: Smoothing,
    /// The triangle's area times its angle here.
    weight: f64,
}

/// Smooth normals up to a crease: a corner's normal is the mean, weighted by area and angle, of those triangles around
/// its point whose own normals differ from its triangle's by at most `crease_rad`.
///
/// The primitives are smoothed across their seams: `points` has an entry for each vertex of each primitive, equal where
/// surfaces are joined. Normals that are there and finite stay. `smoothing` has an entry for each triangle of each
/// primitive; one that is missing stands for the angle.
pub(crate) fn crease(
    primitives: &mut [Primitive],
    points: &[Vec<u32>],
    smoothing: &[Vec<Smoothing>],
    crease_rad: f32,
) {
    let mut meeting: HashMap<u32, Vec<Corner>> = HashMap::new();
    for (p, primitive) in primitives.iter().enumerate() {
        for triangle in 0..primitive.indices.len() / 3 {
            let ends = corners(primitive, triangle);
            let area_normal = area_normal(ends);
            let smoothing = smoothing.get(p).and_then(|triangles| triangles.get(triangle)).copied();
            for k in 0..3 {
                let at = (p, 3 * triangle + k);
                let point = points[p][primitive.indices[at.1] as usize];
                let (to_next, to_last) = (ends[(k + 1) % 3] - ends[k], ends[(k + 2) % 3] - ends[k]);
                let angle = unit(to_next).zip(unit(to_last)).map_or(0.0, |(a, b)| a.angle_between(b));
                meeting.entry(point).or_default().push(Corner {
                    at,
                    face_normal: unit(area_normal).unwrap_or(Vec3::ZERO),
                    smoothing: smoothing.unwrap_or(Smoothing::ByAngle),
                    weight: area_normal.length() * f64::from(angle),
                });
            }
        }
    }
    let min_cos = crease_rad.cos();
    let given = |p: &Primitive, vertex: u32| p.normals.get(vertex as usize).copied().unwrap_or(Vec3::NAN);
    let corner_normals = |p: &Primitive| p.indices.iter().map(|&vertex| given(p, vertex)).collect();
    let mut normals: Vec<Vec<Vec3>> = primitives.iter().map(corner_normals).collect();
    for corners in meeting.values() {
        let mean = |include: &dyn Fn(&Corner) -> bool| {
            let included = corners.iter().filter(|c| include(c));
            unit(included.map(|c| c.weight * c.face_normal.as_dvec3()).sum())
        };
        for corner in corners {
            let normal = &mut normals[corner.at.0][corner.at.1];
            if normal.is_finite() {
                continue;
            }
            let flat = (corner.face_normal != Vec3::ZERO).then_some(corner.face_normal);
            let smooth = match corner.smoothing {
                _ if corners.len() > MAX_MEETING => None,
                Smoothing::Off if flat.is_some() => None,
                group @ Smoothing::Group(_) => mean(&|other| other.smoothing == group),
                _ if flat.is_none() => mean(&|_| true),
                _ => mean(&|other| corner.face_normal.dot(other.face_normal) >= min_cos),
            };
            *normal = smooth.or(flat).unwrap_or(FALLBACK);
        }
    }
    for (primitive, normals) in primitives.iter_mut().zip(&normals) {
        set_corner_normals(primitive, normals);
    }
}
