//! Completing meshes: normals, tangents, splitting and dropping vertices.
//!
//! Everything works on positions of up to 10¹² m: lengths and areas are computed in `f64`, as their squares would
//! overflow `f32`.

mod normals;
mod tangents;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use crate::Primitive;

pub(crate) use normals::{FALLBACK, Smoothing, crease, flat, repair};
pub(crate) use tangents::{generate as generate_tangents, repair as repair_tangents};

/// Bits that say whether two corners may share a vertex.
type Key = [u32; 4];

/// Keeps the vertices `old_of_new`, in this order; indices are left alone.
fn gather(primitive: &mut Primitive, old_of_new: &[u32]) {
    fn pick<T: Copy>(stream: &mut Vec<T>, old_of_new: &[u32]) {
        if !stream.is_empty() {
            *stream = old_of_new.iter().map(|&old| stream[old as usize]).collect();
        }
    }
    pick(&mut primitive.positions, old_of_new);
    pick(&mut primitive.normals, old_of_new);
    pick(&mut primitive.tangents, old_of_new);
    pick(&mut primitive.uvs[0], old_of_new);
    pick(&mut primitive.uvs[1], old_of_new);
    pick(&mut primitive.colors, old_of_new);
    pick(&mut primitive.joints, old_of_new);
    pick(&mut primitive.joint_weights, old_of_new);
    for target in &mut primitive.morph_targets {
        pick(&mut target.positions, old_of_new);
        pick(&mut target.normals, old_of_new);
        pick(&mut target.tangents, old_of_new);
    }
}

/// Drops vertices that no triangle uses: files share one vertex buffer among many primitives, and the rest would count
/// into the scene's bounds.
pub(crate) fn drop_unused_vertices(primitive: &mut Primitive) {
    const UNUSED: u32 = u32::MAX;
    let mut new_of_old = vec![UNUSED; primitive.positions.len()];
    let mut old_of_new = Vec::new();
    for index in &primitive.indices {
        let new = &mut new_of_old[*index as usize];
        if *new == UNUSED {
            *new = old_of_new.len() as u32;
            old_of_new.push(*index);
        }
    }
    if old_of_new.len() < primitive.positions.len() {
        for index in &mut primitive.indices {
            *index = new_of_old[*index as usize];
        }
        gather(primitive, &old_of_new);
    }
}

/// Splits vertices whose corners have different keys (`keys` has one for each index) and drops those without a corner.
/// Returns, for every new vertex, one of its corners.
fn split(primitive: &mut Primitive, keys: &[Key]) -> Vec<usize> {
    let mut known: HashMap<(u32, Key), u32> = HashMap::with_capacity(primitive.positions.len());
    let mut old_of_new = Vec::with_capacity(primitive.positions.len());
    let mut corner_of_new = Vec::with_capacity(primitive.positions.len());
    for (corner, (index, key)) in primitive.indices.iter_mut().zip(keys).enumerate() {
        let old = *index;
        *index = *known.entry((old, *key)).or_insert_with(|| {
            old_of_new.push(old);
            corner_of_new.push(corner);
            old_of_new.len() as u32 - 1
        });
    }
    gather(primitive, &old_of_new);
    corner_of_new
}

/// The three positions of a triangle.
fn corners(primitive: &Primitive, triangle: usize) -> [DVec3; 3] {
    [0, 1, 2].map(|k| primitive.positions[primitive.indices[3 * triangle + k] as usize].as_dvec3())
}

/// The normal of a triangle times twice its area.
pub(crate) fn area_normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// A unit vector from one whose length may be anything; `None` from zero.
pub(crate) fn unit(v: DVec3) -> Option<Vec3> {
    // Scaled first: the squares of triangle areas can underflow even f64.
    let scale = v.abs().max_element();
    if scale == 0.0 || !scale.is_finite() {
        return None;
    }
    Some((v / scale).normalize().as_vec3().normalize())
}

/// Bits of a vector for comparison; −0 equals 0.
fn bits(v: Vec3) -> [u32; 3] {
    (v + Vec3::ZERO).to_array().map(f32::to_bits)
}
