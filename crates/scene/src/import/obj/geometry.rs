//! From `tobj`'s models to meshes.

use std::path::Path;

use glam::{Vec2, Vec3, Vec4};

use super::super::limits::{Budget, Limits};
use super::super::warnings::Warnings;
use super::material::Materials;
use crate::{Mesh, Primitive, SceneError, mesh};

/// Where an OBJ gives no normals, faces that meet at a smaller angle are shaded smoothly. `tobj` does not pass the
/// file's smoothing groups on; 40° keeps a column of nine and more sides round and a box's edges sharp.
const CREASE_RAD: f32 = 40.0_f32.to_radians();

/// One mesh for each object or group, with one primitive for each of its materials.
pub(super) fn meshes(
    path: &Path,
    limits: &Limits,
    models: Vec<tobj::Model>,
    materials: &mut Materials<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<Mesh>, SceneError> {
    let mut budget = Budget::new(limits);
    let mut meshes: Vec<Mesh> = Vec::new();
    let mut models = models.into_iter().filter(|model| !model.mesh.indices.is_empty()).peekable();
    while let Some(model) = models.next() {
        let name = model.name;
        let mut primitives: Vec<Primitive> = Vec::new();
        let mut parts = vec![model.mesh];
        // Within a group `tobj` starts a model wherever the material changes.
        while let Some(next) = models.next_if(|next| next.name == name) {
            parts.push(next.mesh);
        }
        for part in parts {
            let part = primitive(&part, materials.id(part.material_id, warnings));
            budget.spend_primitive(part.positions.len(), part.indices.len()).map_err(|problem| {
                SceneError::Invalid { path: path.to_owned(), place: format!("group `{name}`"), problem }
            })?;
            match primitives.iter_mut().find(|p| p.material == part.material) {
                Some(primitive) => append(primitive, part),
                None => primitives.push(part),
            }
        }
        complete(&mut primitives, materials, &name, warnings);
        meshes.push(Mesh { name, primitives, ..Mesh::default() });
    }
    Ok(meshes)
}

/// A model's streams, one entry for each vertex as of the rewritten text; what the file left out is NaN.
fn primitive(mesh: &tobj::Mesh, material: usize) -> Primitive {
    let triples = |values: &[f32]| values.chunks_exact(3).map(Vec3::from_slice).collect::<Vec<_>>();
    Primitive {
        positions: triples(&mesh.positions),
        normals: triples(&mesh.normals),
        // OBJ's origin is at the bottom left.
        uvs: [mesh.texcoords.chunks_exact(2).map(|uv| Vec2::new(uv[0], 1.0 - uv[1])).collect(), Vec::new()],
        colors: triples(&mesh.vertex_color)
            .into_iter()
            .map(|rgb| rgb.extend(1.0).clamp(Vec4::ZERO, Vec4::ONE))
            .collect(),
        indices: mesh.indices.clone(),
        material,
        ..Primitive::default()
    }
}

fn append(primitive: &mut Primitive, other: Primitive) {
    let offset = primitive.positions.len() as u32;
    primitive.indices.extend(other.indices.iter().map(|index| index + offset));
    primitive.positions.extend(other.positions);
    primitive.normals.extend(other.normals);
    primitive.colors.extend(other.colors);
    let [uvs, _] = other.uvs;
    primitive.uvs[0].extend(uvs);
}

/// Fills in what the file leaves out and the renderer needs.
fn complete(primitives: &mut [Primitive], materials: &Materials<'_>, name: &str, warnings: &mut Warnings) {
    if primitives.iter().flat_map(|p| &p.normals).any(|n| !n.is_finite()) {
        mesh::crease(primitives, CREASE_RAD);
    }
    for primitive in primitives {
        mesh::repair(primitive);
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
