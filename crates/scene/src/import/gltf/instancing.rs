//! EXT_mesh_gpu_instancing: one mesh at many places.

use ::gltf::json::Value;
use glam::{Quat, Vec3};

use super::super::limits::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::accessor::Format;
use super::primitive::Meshes;
use crate::{SceneError, Transform};

const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Where a node's mesh stands, relative to the node; `None` where it stands once, at the node.
pub(super) fn places(
    meshes: &mut Meshes<'_, '_>,
    node: &::gltf::Node<'_>,
    place: &str,
    warnings: &mut Warnings,
) -> Result<Option<Vec<Transform>>, SceneError> {
    let Some(extension) = node.extension_value(EXTENSION).filter(|_| node.mesh().is_some()) else {
        return Ok(None);
    };
    if node.skin().is_some() {
        warnings.add(format!("{place}: instances of a skinned mesh coincide; one is drawn"));
        return Ok(None);
    }
    let place = format!("{place}.extensions.{EXTENSION}.attributes");
    let translations = attribute::<3>(meshes, extension, "TRANSLATION", Format::FLOAT, &place)?;
    let rotations = attribute::<4>(meshes, extension, "ROTATION", Format::SIGNED, &place)?;
    let scales = attribute::<3>(meshes, extension, "SCALE", Format::FLOAT, &place)?;
    let counts = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let mut given = counts.into_iter().flatten();
    let Some(count) = given.next() else {
        warnings.add(format!("{place} has no pose of any instance; the mesh is drawn once"));
        return Ok(None);
    };
    if given.any(|other| other != count) {
        return Err(meshes.file.invalid(place, "its attributes differ in length"));
    }
    let pose = |i: usize| {
        let at =
            |stream: &Option<Vec<[f32; 3]>>, default| stream.as_ref().map_or(default, |s| Vec3::from(s[i]));
        let rotation = rotations.as_ref().map_or(Quat::IDENTITY, |r| Quat::from_array(r[i]));
        Transform::Trs {
            translation: at(&translations, Vec3::ZERO),
            rotation: if rotation.length() > 1e-6 { rotation.normalize() } else { Quat::IDENTITY },
            scale: at(&scales, Vec3::ONE),
        }
    };
    Ok(Some((0..count).map(pose).collect()))
}

fn attribute<const N: usize>(
    meshes: &Meshes<'_, '_>,
    extension: &Value,
    name: &str,
    format: Format,
    place: &str,
) -> Result<Option<Vec<[f32; N]>>, SceneError> {
    let Some(index) = extension.get("attributes").and_then(|attributes| attributes.get(name)) else {
        return Ok(None);
    };
    let place = format!("{place}.{name}");
    let accessor = index.as_u64().and_then(|index| meshes.file.document.accessors().nth(index as usize));
    let Some(accessor) = accessor else {
        return Err(meshes.file.invalid(place, "there is no accessor of this index"));
    };
    if accessor.count() > meshes.file.limits.nodes {
        let problem =
            format!("{} instances are more than {} nodes", accessor.count(), meshes.file.limits.nodes);
        return Err(meshes.file.invalid(place, problem));
    }
    let values = meshes.accessors.vectors::<N>(&accessor, format, &place)?;
    if let Some(at) = values.iter().position(|v| v.iter().any(|x| x.abs() > MAX_COORDINATE)) {
        return Err(meshes.file.invalid(place, format!("element {at} exceeds {MAX_COORDINATE:e}")));
    }
    Ok(Some(values))
}
