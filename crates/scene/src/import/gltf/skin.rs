//! Skins, and the nodes that act as their joints.

use std::collections::HashMap;

use glam::{Affine3A, Mat4};

use super::super::limits::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::accessor::Format;
use super::node::Nodes;
use super::primitive::Meshes;
use crate::{Id, Mesh, Scene, SceneError, Skin};

/// Gives every node with a mesh the skin that the file says, and counts what all nodes draw.
pub(super) fn convert(
    meshes: &mut Meshes<'_, '_>,
    nodes: &mut Nodes,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let file = meshes.file;
    let mut parents = vec![None; file.document.nodes().len()];
    for node in file.document.nodes() {
        node.children().for_each(|child| parents[child.index()] = Some(node.index()));
    }
    let mut skins: HashMap<usize, Id> = HashMap::new();
    let mut used: HashMap<Id, Option<u16>> = HashMap::new();
    for source in file.document.nodes() {
        let (Some(skin), Some(id)) = (source.skin(), nodes.ids[source.index()]) else { continue };
        // A skin without a mesh bends nothing.
        let Some(mesh) = scene.nodes[id].mesh else { continue };
        let place = format!("nodes[{}]", source.index());
        let Some(largest) = *used.entry(mesh).or_insert_with(|| largest_joint(&scene.meshes[mesh])) else {
            warnings.add(format!("{place}: its skin was left out: the mesh has no JOINTS_0 and WEIGHTS_0"));
            continue;
        };
        let joints = skin.joints().count();
        if usize::from(largest) >= joints {
            let problem = format!("its mesh names joint {largest}, but skins[{}] has {joints}", skin.index());
            return Err(file.invalid(format!("{place}.skin"), problem));
        }
        let known = skins.get(&skin.index()).copied();
        let skin_id = if let Some(known) = known {
            known
        } else {
            let converted = convert_one(&skin, &parents, meshes, nodes, scene)?;
            scene.skins.push(converted);
            skins.insert(skin.index(), scene.skins.len() - 1);
            scene.skins.len() - 1
        };
        scene.nodes[id].skin = Some(skin_id);
    }
    spend_drawn(meshes, scene)
}

/// The largest joint that a mesh's vertices name; `None` where some have none.
fn largest_joint(mesh: &Mesh) -> Option<u16> {
    let bent = mesh.primitives.iter().all(|primitive| !primitive.joints.is_empty());
    bent.then(|| mesh.primitives.iter().flat_map(|p| p.joints.iter().flatten()).copied().max()).flatten()
}

fn convert_one(
    skin: &::gltf::Skin<'_>,
    parents: &[Option<usize>],
    meshes: &mut Meshes<'_, '_>,
    nodes: &mut Nodes,
    scene: &mut Scene,
) -> Result<Skin, SceneError> {
    let file = meshes.file;
    let mut joints = Vec::new();
    for joint in skin.joints() {
        joints.push(nodes.include(joint.index(), parents, meshes, scene)?);
    }
    let mut joint_from_object = vec![Affine3A::IDENTITY; joints.len()];
    // By the index: the crate's iterators of both borrow the document for as long as it lives.
    let accessor = file.document.as_json().skins[skin.index()].inverse_bind_matrices;
    let accessor = accessor.and_then(|accessor| file.document.accessors().nth(accessor.value()));
    if let Some(accessor) = accessor {
        let place = format!("skins[{}].inverseBindMatrices", skin.index());
        if accessor.count() < joints.len() {
            let problem = format!("it has {} matrices for {} joints", accessor.count(), joints.len());
            return Err(file.invalid(place, problem));
        }
        let matrices = meshes.accessors.vectors::<16>(&accessor, Format::FLOAT, &place)?;
        for (i, (bind, matrix)) in joint_from_object.iter_mut().zip(matrices).enumerate() {
            let matrix = Mat4::from_cols_array(&matrix);
            if !matrix.to_cols_array().iter().all(|x| x.abs() <= MAX_COORDINATE) {
                return Err(file.invalid(place, format!("matrix {i} exceeds {MAX_COORDINATE:e}")));
            }
            if !matrix.row(3).abs_diff_eq(glam::Vec4::W, 1e-3) {
                return Err(file.invalid(place, format!("the last row of matrix {i} must be 0 0 0 1")));
            }
            *bind = Affine3A::from_mat4(matrix);
        }
    }
    Ok(Skin { name: skin.name().unwrap_or_default().to_owned(), joints, joint_from_object })
}

/// Counts every vertex as often as it is drawn: few bytes can draw a large mesh often.
fn spend_drawn(meshes: &mut Meshes<'_, '_>, scene: &Scene) -> Result<(), SceneError> {
    let vertices = |mesh: &Mesh| {
        let targets = mesh.morph_targets();
        let of_one: usize = mesh.primitives.iter().map(|p| p.positions.len() * (1 + targets)).sum();
        // Weights take room too.
        of_one + 8 * targets
    };
    let vertices: Vec<usize> = scene.meshes.iter().map(vertices).collect();
    for (i, node) in scene.nodes.iter().enumerate() {
        let Some(mesh) = node.mesh else { continue };
        let joints = node.skin.map_or(0, |skin| scene.skins[skin].joints.len());
        let amount = vertices[mesh].saturating_add(joints * scene.meshes[mesh].primitives.len());
        meshes
            .budget
            .spend(|l| &mut l.drawn_vertices, amount, "vertices to draw, instances and morph targets counted")
            .map_err(|problem| meshes.file.invalid(format!("node {i}"), problem))?;
    }
    Ok(())
}
