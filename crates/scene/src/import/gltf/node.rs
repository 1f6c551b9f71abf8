//! The node hierarchy.

use std::collections::HashMap;

use ::gltf::scene::Transform as GltfTransform;
use glam::{Affine3A, Mat4, Quat, Vec3};

use super::super::limits::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::file::File;
use super::instancing;
use super::placed::Tables;
use super::primitive::{Meshes, morph_weights};
use crate::{Id, Node, Scene, SceneError, Transform};

/// Where the file's nodes are among the scene's.
pub(super) struct Nodes {
    /// `None` for a node of another scene.
    pub(super) ids: Vec<Option<Id>>,
    /// The nodes that draw an instanced node's mesh.
    pub(super) instances: HashMap<usize, Vec<Id>>,
}

/// Converts a scene's nodes, depth first, and the meshes, cameras and lights that they refer to.
pub(super) fn convert<'a>(
    meshes: &mut Meshes<'_, 'a>,
    wanted: Option<&str>,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<Nodes, SceneError> {
    let file = meshes.file;
    let mut tables = Tables::default();
    let mut nodes = Nodes { ids: vec![None; file.document.nodes().len()], instances: HashMap::new() };
    // To visit, last first, with the parent among our nodes.
    let mut stack: Vec<(::gltf::Node<'a>, Option<Id>)> =
        roots(file, wanted, &scene.scene_names, warnings)?.into_iter().rev().map(|n| (n, None)).collect();
    while let Some((source, parent)) = stack.pop() {
        let place = format!("nodes[{}]", source.index());
        if nodes.ids[source.index()].is_some() {
            return Err(
                file.invalid(place, "the node is part of a cycle or has two parents; nodes form a tree")
            );
        }
        let name = source.name().unwrap_or_default().to_owned();
        let mesh = match source.mesh() {
            Some(mesh) => tables.mesh(&mesh, meshes, scene, warnings)?,
            None => None,
        };
        let targets = mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets());
        let morph_weights = match source.weights() {
            Some(weights) if targets > 0 => {
                morph_weights(file, weights, targets, &format!("{place}.weights"), warnings)?
            }
            _ => Vec::new(),
        };
        let mut node = Node {
            parent,
            parent_from_node: transform(file, &source, &place)?,
            mesh,
            morph_weights,
            camera: source.camera().map(|camera| tables.camera(file, &camera, &name, scene)).transpose()?,
            light: source.light().map(|light| tables.light(file, &light, &name, scene)).transpose()?,
            name,
            ..Node::default()
        };
        let places = instancing::places(meshes, &source, &place, warnings)?.filter(|_| mesh.is_some());
        let instance = Node { name: String::new(), camera: None, light: None, ..node.clone() };
        if places.is_some() {
            node.mesh = None;
            node.morph_weights = Vec::new();
        }
        let id = push(meshes, scene, node, &place)?;
        nodes.ids[source.index()] = Some(id);
        for parent_from_node in places.into_iter().flatten() {
            let instance = Node { parent: Some(id), parent_from_node, ..instance.clone() };
            let instance = push(meshes, scene, instance, &place)?;
            nodes.instances.entry(source.index()).or_default().push(instance);
        }
        let children: Vec<_> = source.children().collect();
        stack.extend(children.into_iter().rev().map(|child| (child, Some(id))));
    }
    Ok(nodes)
}

fn push(meshes: &mut Meshes<'_, '_>, scene: &mut Scene, node: Node, place: &str) -> Result<Id, SceneError> {
    let spent = meshes.budget.spend(|l| &mut l.nodes, 1, "nodes, instances included");
    spent.map_err(|problem| meshes.file.invalid(place, problem))?;
    scene.nodes.push(node);
    Ok(scene.nodes.len() - 1)
}

impl Nodes {
    /// The scene's node for the file's `index`, which may belong to another scene: its pose alone is taken in then,
    /// and its parents'. `parents` are the file's.
    pub(super) fn include(
        &mut self,
        index: usize,
        parents: &[Option<usize>],
        meshes: &mut Meshes<'_, '_>,
        scene: &mut Scene,
    ) -> Result<Id, SceneError> {
        let file = meshes.file;
        let mut missing = Vec::new();
        let mut above = Some(index);
        while let Some(index) = above.filter(|&index| self.ids[index].is_none()) {
            if missing.len() == parents.len() {
                return Err(file.invalid(format!("nodes[{index}]"), "the node is part of a cycle"));
            }
            missing.push(index);
            above = parents[index];
        }
        let mut id = above.and_then(|index| self.ids[index]);
        for source in missing.into_iter().rev().filter_map(|index| file.document.nodes().nth(index)) {
            let place = format!("nodes[{}]", source.index());
            let node = Node {
                name: source.name().unwrap_or_default().to_owned(),
                parent: id,
                parent_from_node: transform(file, &source, &place)?,
                ..Node::default()
            };
            id = Some(push(meshes, scene, node, &place)?);
            self.ids[source.index()] = id;
        }
        id.ok_or_else(|| file.invalid(format!("nodes[{index}]"), "there is no such node"))
    }
}

/// The roots of the wanted scene or, when none is, of the default scene; the first scene's where none is the default;
/// every root of a file without scenes.
fn roots<'a>(
    file: File<'a>,
    wanted: Option<&str>,
    names: &[String],
    warnings: &mut Warnings,
) -> Result<Vec<::gltf::Node<'a>>, SceneError> {
    let document = file.document;
    if let Some(wanted) = wanted {
        let named = names.iter().position(|name| name == wanted);
        let chosen = named.or_else(|| wanted.parse().ok());
        return match chosen.and_then(|index| document.scenes().nth(index)) {
            Some(scene) => Ok(scene.nodes().collect()),
            None => Err(SceneError::UnknownScene {
                path: file.path.to_owned(),
                name: wanted.to_owned(),
                known: if names.is_empty() {
                    "none".to_owned()
                } else {
                    let list = names.iter().take(64).enumerate();
                    list.map(|(i, name)| format!("{i} “{name}”")).collect::<Vec<_>>().join(", ")
                },
            }),
        };
    }
    if let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) {
        if names.len() > 1 {
            warnings.add(format!(
                "the file holds {} scenes; scene {} was loaded",
                names.len(),
                scene.index()
            ));
        }
        return Ok(scene.nodes().collect());
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    Ok(document.nodes().filter(|node| !is_child[node.index()]).collect())
}

fn transform(file: File<'_>, node: &::gltf::Node<'_>, place: &str) -> Result<Transform, SceneError> {
    let in_range = |values: &[f32]| values.iter().all(|x| x.abs() <= MAX_COORDINATE);
    match node.transform() {
        GltfTransform::Matrix { matrix } => {
            let matrix = Mat4::from_cols_array_2d(&matrix);
            if !in_range(&matrix.to_cols_array()) {
                return Err(
                    file.invalid(format!("{place}.matrix"), format!("a number exceeds {MAX_COORDINATE:e}"))
                );
            }
            if !matrix.row(3).abs_diff_eq(glam::Vec4::W, 1e-5) {
                return Err(file.invalid(format!("{place}.matrix"), "its last row must be 0 0 0 1"));
            }
            Ok(Transform::Matrix(Affine3A::from_mat4(matrix)))
        }
        GltfTransform::Decomposed { translation, rotation, scale } => {
            let rotation = Quat::from_array(rotation);
            if !in_range(&translation) || !in_range(&scale) || !in_range(&rotation.to_array()) {
                return Err(
                    file.invalid(place, format!("a number of its transform exceeds {MAX_COORDINATE:e}"))
                );
            }
            if rotation.length() < 1e-6 {
                return Err(file.invalid(format!("{place}.rotation"), "it must be a unit quaternion"));
            }
            Ok(Transform::Trs {
                translation: Vec3::from(translation),
                rotation: rotation.normalize(),
                scale: Vec3::from(scale),
            })
        }
    }
}
