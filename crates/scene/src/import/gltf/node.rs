//! Nodes, cameras and lights.

use std::collections::HashMap;

use ::gltf::json::camera::Type;
use ::gltf::json::validation::Checked;
use ::gltf::khr_lights_punctual::Kind;
use ::gltf::scene::Transform as GltfTransform;
use glam::{Affine3A, Mat4, Quat, Vec3};

use super::super::MAX_COORDINATE;
use super::super::warnings::Warnings;
use super::File;
use super::primitive::Meshes;
use crate::{Camera, Id, Light, LightKind, Node, Projection, Scene, SceneError, Transform};

/// Converts the default scene's nodes, depth first, and the meshes, cameras and lights that they refer to.
pub(super) fn convert<'a>(
    meshes: &mut Meshes<'_, 'a>,
    scene: &mut Scene,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let file = meshes.file;
    let document = file.document;
    if document.scenes().len() > 1 {
        let shown = document.default_scene().map_or(0, |scene| scene.index());
        warnings.add(format!("the file holds {} scenes; scene {shown} was loaded", document.scenes().len()));
    }
    let mut tables = Tables::default();
    let mut visited = vec![false; document.nodes().len()];
    // To visit, last first, with the parent among our nodes.
    let mut stack: Vec<(::gltf::Node<'a>, Option<Id>)> =
        roots(file).into_iter().rev().map(|n| (n, None)).collect();
    let mut animated = document.animations().len() > 0;
    while let Some((source, parent)) = stack.pop() {
        let place = format!("nodes[{}]", source.index());
        if std::mem::replace(&mut visited[source.index()], true) {
            return Err(
                file.invalid(place, "the node is part of a cycle or has two parents; nodes form a tree")
            );
        }
        let name = source.name().unwrap_or_default().to_owned();
        animated |= source.skin().is_some();
        let mesh = match source.mesh() {
            Some(mesh) => {
                animated |= mesh.primitives().any(|p| p.morph_targets().len() > 0);
                tables.mesh(&mesh, meshes, scene, warnings)?
            }
            None => None,
        };
        let id = scene.nodes.len();
        let node = Node {
            parent,
            parent_from_node: transform(file, &source, &place)?,
            mesh,
            camera: source.camera().map(|camera| tables.camera(file, &camera, &name, scene)).transpose()?,
            light: source.light().map(|light| tables.light(file, &light, &name, scene)).transpose()?,
            name,
            ..Node::default()
        };
        scene.nodes.push(node);
        let children: Vec<_> = source.children().collect();
        stack.extend(children.into_iter().rev().map(|child| (child, Some(id))));
    }
    if animated {
        warnings
            .add("skins, morph targets and animations are not supported yet; the pose as stored is shown");
    }
    Ok(())
}

/// The default scene's roots; the first scene's where none is the default; every root of a file without scenes.
fn roots(file: File<'_>) -> Vec<::gltf::Node<'_>> {
    let document = file.document;
    if let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) {
        return scene.nodes().collect();
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    document.nodes().filter(|node| !is_child[node.index()]).collect()
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

/// Our tables' indices by the file's.
#[derive(Default)]
struct Tables {
    meshes: HashMap<usize, Option<Id>>,
    cameras: HashMap<usize, Id>,
    lights: HashMap<usize, Id>,
}

impl Tables {
    /// `None` for a mesh without a triangle.
    fn mesh<'a>(
        &mut self,
        mesh: &::gltf::Mesh<'a>,
        meshes: &mut Meshes<'_, 'a>,
        scene: &mut Scene,
        warnings: &mut Warnings,
    ) -> Result<Option<Id>, SceneError> {
        if let Some(&known) = self.meshes.get(&mesh.index()) {
            return Ok(known);
        }
        let converted = meshes.convert(mesh, warnings)?;
        let id = (!converted.primitives.is_empty()).then(|| {
            scene.meshes.push(converted);
            scene.meshes.len() - 1
        });
        self.meshes.insert(mesh.index(), id);
        Ok(id)
    }

    fn camera(
        &mut self,
        file: File<'_>,
        camera: &::gltf::Camera<'_>,
        node_name: &str,
        scene: &mut Scene,
    ) -> Result<Id, SceneError> {
        if let Some(&known) = self.cameras.get(&camera.index()) {
            return Ok(known);
        }
        let place = format!("cameras[{}]", camera.index());
        // The JSON itself: the crate's accessor takes for granted that the member named by the type is there.
        let json = &file.document.as_json().cameras[camera.index()];
        let (projection, near_m, far_m) = match (json.type_, &json.perspective, &json.orthographic) {
            (Checked::Valid(Type::Perspective), Some(lens), _) => {
                if !(lens.yfov > 0.0 && lens.yfov < std::f32::consts::PI) {
                    return Err(
                        file.invalid(format!("{place}.perspective.yfov"), "it must be above 0 and below π")
                    );
                }
                if lens.znear <= 0.0 {
                    return Err(file.invalid(format!("{place}.perspective.znear"), "it must be above 0"));
                }
                (Projection::Perspective { yfov_rad: lens.yfov }, lens.znear, lens.zfar)
            }
            (Checked::Valid(Type::Orthographic), _, Some(lens)) => {
                if !(lens.ymag != 0.0 && lens.ymag.is_finite()) {
                    return Err(
                        file.invalid(format!("{place}.orthographic.ymag"), "it must be finite and not 0")
                    );
                }
                // The sign would mirror the picture; the specification advises against it.
                let half_height_m = lens.ymag.abs();
                (Projection::Orthographic { half_height_m }, lens.znear, Some(lens.zfar))
            }
            _ => return Err(file.invalid(place, "its type and its projection do not agree")),
        };
        let far_is_valid = far_m.is_none_or(|far| far.is_finite() && far > near_m);
        if !(near_m >= 0.0 && near_m.is_finite() && far_is_valid) {
            return Err(file.invalid(place, "its planes must be 0 ≤ znear < zfar"));
        }
        let name = json.name.clone().unwrap_or_else(|| node_name.to_owned());
        scene.cameras.push(Camera { name, projection, near_m, far_m });
        self.cameras.insert(camera.index(), scene.cameras.len() - 1);
        Ok(scene.cameras.len() - 1)
    }

    fn light(
        &mut self,
        file: File<'_>,
        light: &::gltf::khr_lights_punctual::Light<'_>,
        node_name: &str,
        scene: &mut Scene,
    ) -> Result<Id, SceneError> {
        if let Some(&known) = self.lights.get(&light.index()) {
            return Ok(known);
        }
        let place = format!("extensions.KHR_lights_punctual.lights[{}]", light.index());
        let kind = match light.kind() {
            Kind::Directional => LightKind::Directional,
            Kind::Point => LightKind::Point,
            Kind::Spot { inner_cone_angle: inner_rad, outer_cone_angle: outer_rad } => {
                let legal = 0.0 <= inner_rad && inner_rad <= outer_rad && outer_rad > 0.0;
                if !(legal && outer_rad <= std::f32::consts::FRAC_PI_2 + 1e-5) {
                    let problem = "its angles must be 0 ≤ innerConeAngle < outerConeAngle ≤ π/2";
                    return Err(file.invalid(format!("{place}.spot"), problem));
                }
                LightKind::Spot { inner_rad, outer_rad: outer_rad.min(std::f32::consts::FRAC_PI_2) }
            }
        };
        let is_amount = |x: f32| x >= 0.0 && x.is_finite();
        if !light.color().into_iter().all(is_amount) || !is_amount(light.intensity()) {
            return Err(file.invalid(place, "its colour and intensity must be finite and not negative"));
        }
        if light.range().is_some_and(|range| !(range > 0.0 && range.is_finite())) {
            return Err(file.invalid(format!("{place}.range"), "it must be above 0 and finite"));
        }
        scene.lights.push(Light {
            name: light.name().unwrap_or(node_name).to_owned(),
            kind,
            color: Vec3::from(light.color()),
            intensity: light.intensity(),
            range_m: light.range(),
        });
        self.lights.insert(light.index(), scene.lights.len() - 1);
        Ok(scene.lights.len() - 1)
    }
}
