//! Tangents for normal maps.

use std::collections::HashMap;

use bevy_mikktspace::{Geometry, TangentSpace};
use glam::{DVec3, Vec2, Vec3, Vec4};

use super::{Key, bits, corners, split, unit};
use crate::{Primitive, TextureRef};

/// Triangles that may share a vertex: MikkTSpace recurses around it, once for each, and compares each with each. Past
/// this the stack and the time are at risk.
const MAX_VALENCE: usize = 512;

/// Generates MikkTSpace tangents (Mikkelsen 2008) for the normal map `texture`, splitting vertices where they differ.
/// The primitive has normals and the texture's set of coordinates.
///
/// The texture's transform is applied first, so that a rotated normal map gets tangents along its own axes.
pub(crate) fn generate(primitive: &mut Primitive, texture: &TextureRef) {
    let uvs: Vec<Vec2> = primitive.uvs[texture.uv_set]
        .iter()
        .map(|&uv| {
            let uv = texture.uv_transform.transform_point2(uv);
            // glTF's v points down and its bitangent up; MikkTSpace's bitangent follows v. Only differences count, and
            // 1 − v would lose digits.
            Vec2::new(uv.x, -uv.y)
        })
        .collect();
    let mut geometry = Corners { primitive, uvs: &uvs, tangents: vec![None; primitive.indices.len()] };
    if geometry.valence() <= MAX_VALENCE {
        // Its error type has no value.
        let _ = bevy_mikktspace::generate_tangents(&mut geometry);
    } else {
        geometry.per_triangle();
    }
    let tangents: Vec<Vec4> = geometry
        .tangents
        .iter()
        .zip(&primitive.indices)
        .map(|(tangent, &index)| sound(tangent.unwrap_or(Vec4::ZERO), primitive.normals[index as usize]))
        .collect();
    primitive.tangents.clear();
    let keys: Vec<Key> = tangents.iter().map(|t| (t + Vec4::ZERO).to_array().map(f32::to_bits)).collect();
    primitive.tangents = split(primitive, &keys).into_iter().map(|corner| tangents[corner]).collect();
}

/// Makes every tangent a unit vector and its w ±1.
pub(crate) fn repair(primitive: &mut Primitive) {
    for (tangent, &normal) in primitive.tangents.iter_mut().zip(&primitive.normals) {
        *tangent = sound(*tangent, normal);
    }
}

/// `tangent` with unit length and w = ±1, or any tangent to `normal` where it has no direction.
fn sound(tangent: Vec4, normal: Vec3) -> Vec4 {
    let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
    unit(tangent.truncate().as_dvec3()).unwrap_or_else(|| normal.any_orthonormal_vector()).extend(sign)
}

/// A primitive's triangles as MikkTSpace sees them.
struct Corners<'a> {
    primitive: &'a Primitive,
    uvs: &'a [Vec2],
    tangents: Vec<Option<Vec4>>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, vert: usize) -> usize {
        self.primitive.indices[3 * face + vert] as usize
    }

    /// Most corners that share what MikkTSpace welds: position, normal and texture coordinate.
    fn valence(&self) -> usize {
        let mut corners_of: HashMap<[u32; 8], usize> = HashMap::with_capacity(self.uvs.len());
        let mut most = 0;
        for &index in &self.primitive.indices {
            let vertex = index as usize;
            let [px, py, pz] = bits(self.primitive.positions[vertex]);
            let [nx, ny, nz] = bits(self.primitive.normals[vertex]);
            let [u, v, _] = bits(self.uvs[vertex].extend(0.0));
            let count = corners_of.entry([px, py, pz, nx, ny, nz, u, v]).or_default();
            *count += 1;
            most = most.max(*count);
        }
        most
    }

    /// Each triangle's own tangent, perpendicular to the normals (Lengyel 2001 without the averaging).
    fn per_triangle(&mut self) {
        for face in 0..self.num_faces() {
            let [a, b, c] = corners(self.primitive, face);
            let [u, v, w] = [0, 1, 2].map(|k| self.uvs[self.vertex(face, k)].as_dvec2());
            let ((e1, e2), (d1, d2)) = ((b - a, c - a), (v - u, w - u));
            let area = d1.perp_dot(d2);
            let tangent: DVec3 = (e1 * d2.y - e2 * d1.y) * area.signum();
            for vert in 0..3 {
                let normal = self.primitive.normals[self.vertex(face, vert)].as_dvec3();
                let tangent = unit(tangent - normal * normal.dot(tangent));
                self.tangents[3 * face + vert] =
                    tangent.map(|t| t.extend(if area < 0.0 { -1.0 } else { 1.0 }));
            }
        }
    }
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.primitive.indices.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.primitive.positions[self.vertex(face, vert)].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.primitive.normals[self.vertex(face, vert)].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, vert)].to_array()
    }

    fn set_tangent(&mut self, tangent_space: Option<TangentSpace>, face: usize, vert: usize) {
        self.tangents[3 * face + vert] = tangent_space.map(|space| Vec4::from(space.tangent_encoded()));
    }
}
