//! From faces to meshes.

use std::collections::HashMap;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3, Vec4};

use super::super::limits::{Budget, Limits};
use super::super::warnings::Warnings;
use super::invalid_group;
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
    let mut meshes = Vec::new();
    for faces in parsed.faces.chunk_by(|a, b| a.group == b.group) {
        let name = faces.first().map_or("", |face| &parsed.groups[face.group]);
        let mut parts: Vec<Part> = Vec::new();
        let mut part_of: HashMap<Id, usize> = HashMap::new();
        for face in faces {
            let material = materials.id(face.material.map(|id| parsed.materials[id].as_str()), warnings);
            let part = *part_of.entry(material).or_insert_with(|| {
                parts.push(Part::new(material));
                parts.len() - 1
            });
            parts[part].add(parsed, face, &mut triangulator);
        }
        let (mut primitives, smoothing): (Vec<Primitive>, Vec<Vec<Smoothing>>) =
            parts.into_iter().map(|part| (part.primitive, part.smoothing)).unzip();
        for primitive in &primitives {
            let spent = budget.spend_primitive(primitive.positions.len(), primitive.indices.len());
            spent.map_err(|problem| invalid_group(path, name, problem))?;
        }
        complete(&mut primitives, &smoothing, materials, name, warnings);
        meshes.push(Mesh { name: name.to_owned(), primitives, ..Mesh::default() });
    }
    if triangulator.is_exhausted() {
        warnings.add("it has so many large concave polygons that some were cut as if they were convex");
    }
    Ok(meshes)
}

/// A primitive in the making; what the file left out is NaN.
struct Part {
    primitive: Primitive,
    /// One per triangle.
    smoothing: Vec<Smoothing>,
    vertices: HashMap<Corner, u32>,
}

impl Part {
    fn new(material: Id) -> Self {
        let primitive = Primitive { material, ..Primitive::default() };
        Self { primitive, smoothing: Vec::new(), vertices: HashMap::new() }
    }

    fn add(&mut self, parsed: &Parsed, face: &Face, triangulator: &mut Triangulator) {
        let corners = &parsed.corners[face.corners.clone()];
        let points: Vec<DVec3> = corners.iter().map(|c| parsed.positions[c[0] as usize].as_dvec3()).collect();
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
            primitive.positions.push(parsed.positions[v as usize]);
            let uv = if vt == NONE { Vec2::NAN } else { parsed.uvs[vt as usize] };
            primitive.uvs[0].push(Vec2::new(uv.x, 1.0 - uv.y));
            primitive.normals.push(if vn == NONE { Vec3::NAN } else { parsed.normals[vn as usize] });
            let color = parsed.colors[v as usize].unwrap_or(Vec3::ONE).extend(1.0);
            primitive.colors.push(color.clamp(Vec4::ZERO, Vec4::ONE));
            primitive.positions.len() as u32 - 1
        })
    }
}

/// Fills in what the file leaves out and the renderer needs.
fn complete(
    primitives: &mut [Primitive],
    smoothing: &[Vec<Smoothing>],
    materials: &Materials<'_>,
    name: &str,
    warnings: &mut Warnings,
) {
    if primitives.iter().flat_map(|p| &p.normals).any(|n| !n.is_finite()) {
        mesh::crease(primitives, smoothing, CREASE_RAD);
    }
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
