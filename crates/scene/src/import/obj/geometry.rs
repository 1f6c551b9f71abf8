//! From faces to meshes.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::super::limits::{Budget, Limits};
use super::super::warnings::Warnings;
use super::material::Materials;
use super::parse::{Corner, Face, NONE, Parsed};
use super::polygon::Triangulator;
use crate::mesh::Smoothing;
use crate::{Id, Mesh, Primitive, SceneError, mesh};

/// Where an OBJ gives neither normals nor smoothing groups, faces that meet at a smaller angle are shaded smoothly: 40°
/// keeps a column of nine and more sides round and a box's edges sharp.
const CREASE_RAD: f32 = 40.0_f32.to_radians();

/// One mesh for each object or group, with one primitive for each of its materials.
pub(super) fn meshes(
    path: &Path,
    limits: &Limits,
    parsed: &Parsed,
    materials: &mut Materials<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<Mesh>, SceneError> {
    let mut budget = Budget::new(limits);
    let mut triangulator = Triangulator::default();
    let mut names = Vec::new();
    let (mut primitives, mut smoothing, mut vertices) = (Vec::new(), Vec::new(), Vec::new());
    for faces in parsed.faces.chunk_by(|a, b| a.group == b.group) {
        let name = faces.first().map_or("", |face| &parsed.groups[face.group]);
        let mut parts: Vec<Part> = Vec::new();
        let mut part_of: HashMap<Id, usize> = HashMap::new();
        for face in faces {
            let material = materials.id(face.material.map(|id| parsed.materials[id].as_str()), warnings)?;
            let part = *part_of.entry(material).or_insert_with(|| {
                parts.push(Part::new(material));
                parts.len() - 1
            });
            parts[part].add(parsed, face, &mut triangulator);
        }
        names.push((name, parts.len()));
        for part in parts {
            let spent = budget.spend_primitive(part.primitive.positions.len(), part.primitive.indices.len());
            spent.map_err(|problem| invalid_group(path, name, problem))?;
            primitives.push(part.primitive);
            smoothing.push(part.smoothing);
            vertices.push(part.v);
        }
    }
    if triangulator.is_exhausted() {
        warnings.add("it has so many large concave polygons that some were cut as if they were convex");
    }
    if primitives.iter().flat_map(|p: &Primitive| &p.normals).any(|n| !n.is_finite()) {
        let counts = names.iter().map(|(_, parts)| *parts);
        let points = points(parsed, &vertices, counts);
        mesh::crease(&mut primitives, &points, &smoothing, CREASE_RAD);
    }
    let mut primitives = primitives.into_iter();
    let meshes = names.into_iter().map(|(name, parts)| {
        let mut primitives: Vec<Primitive> = primitives.by_ref().take(parts).collect();
        complete(&mut primitives, materials, name, warnings);
        Mesh { name: name.to_owned(), primitives, ..Mesh::default() }
    });
    Ok(meshes.collect())
}

/// For each vertex of the primitives a number that is equal where vertices are one point of a surface: the same `v` in
/// whichever groups, or the same position in one group. The same position in two groups may be where two objects touch.
fn points(parsed: &Parsed, vertices: &[Vec<u32>], groups: impl Iterator<Item = usize>) -> Vec<Vec<u32>> {
    fn root(of: &mut [u32], mut v: u32) -> u32 {
        while of[v as usize] != v {
            of[v as usize] = of[of[v as usize] as usize];
            v = of[v as usize];
        }
        v
    }
    let mut of: Vec<u32> = (0..parsed.positions.len() as u32).collect();
    let mut rest = vertices;
    for parts in groups {
        let (group, others) = rest.split_at(parts);
        rest = others;
        let mut first: HashMap<[u64; 3], u32> = HashMap::new();
        for &v in group.iter().flatten() {
            // −0 is 0.
            let position = (parsed.positions[v as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
            let (a, b) = (root(&mut of, *first.entry(position).or_insert(v)), root(&mut of, v));
            of[a.max(b) as usize] = a.min(b);
        }
    }
    vertices.iter().map(|part| part.iter().map(|&v| root(&mut of, v)).collect()).collect()
}

/// A primitive in the making; what the file left out is NaN.
struct Part {
    primitive: Primitive,
    /// One per triangle.
    smoothing: Vec<Smoothing>,
    vertices: HashMap<Corner, u32>,
    /// The `v` of each vertex.
    v: Vec<u32>,
}

impl Part {
    fn new(material: Id) -> Self {
        let primitive = Primitive { material, ..Primitive::default() };
        Self { primitive, smoothing: Vec::new(), vertices: HashMap::new(), v: Vec::new() }
    }

    fn add(&mut self, parsed: &Parsed, face: &Face, triangulator: &mut Triangulator) {
        let corners = &parsed.corners[face.corners.clone()];
        let points: Vec<DVec3> = corners.iter().map(|c| parsed.positions[c[0] as usize]).collect();
        for triangle in triangulator.triangulate(&points) {
            for corner in triangle.map(|i| corners[i]) {
                let index = self.vertex(parsed, corner);
                self.primitive.indices.push(index);
            }
            self.smoothing.push(match face.smoothing {
                None => Smoothing::ByAngle,
                Some(0) => Smoothing::Off,
                Some(group) => Smoothing::Group(group),
            });
        }
    }

    fn vertex(&mut self, parsed: &Parsed, corner: Corner) -> u32 {
        let primitive = &mut self.primitive;
        *self.vertices.entry(corner).or_insert_with(|| {
            let [v, vt, vn] = corner;
            self.v.push(v);
            primitive.positions.push(parsed.positions[v as usize].as_vec3());
            let uv = if vt == NONE { Vec2::NAN } else { parsed.uvs[vt as usize] };
            primitive.uvs[0].push(Vec2::new(uv.x, 1.0 - uv.y));
            primitive.normals.push(if vn == NONE { Vec3::NAN } else { parsed.normals[vn as usize] });
            primitive.colors.push(parsed.colors[v as usize].map_or(Vec4::ONE, linear));
            primitive.positions.len() as u32 - 1
        })
    }
}

/// A vertex colour as programs write it, in sRGB.
fn linear(srgb: Vec3) -> Vec4 {
    let channel = |c: f32| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    Vec3::from(srgb.clamp(Vec3::ZERO, Vec3::ONE).to_array().map(channel)).extend(1.0)
}

/// Fills in what the file leaves out and the renderer needs.
fn complete(primitives: &mut [Primitive], materials: &Materials<'_>, name: &str, warnings: &mut Warnings) {
    for primitive in primitives {
        mesh::repair(primitive);
        if primitive.colors.iter().all(|color| *color == Vec4::ONE) {
            primitive.colors.clear();
        }
        let material = materials.get(primitive.material);
        let uvs = &mut primitive.uvs[0];
        let missing = uvs.iter().filter(|uv| !uv.is_finite()).count();
        if missing > 0 && material.texture_refs().next().is_some() {
            warnings.add(format!(
                "group `{name}`: {missing} vertices of a textured material have no coordinates"
            ));
        } else if missing == uvs.len() {
            uvs.clear();
        }
        uvs.iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
        if let Some(texture) = &material.normal_texture {
            mesh::generate_tangents(primitive, texture);
        }
    }
}

fn invalid_group(path: &Path, name: &str, problem: String) -> SceneError {
    SceneError::Invalid { path: path.to_owned(), place: format!("group `{name}`"), problem }
}
