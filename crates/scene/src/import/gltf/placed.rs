//! What stands at nodes: meshes, cameras and lights, each converted when the first node refers to it.

use std::collections::HashMap;

use ::gltf::json::camera::Type;
use ::gltf::json::validation::Checked;
use ::gltf::khr_lights_punctual::Kind;
use glam::Vec3;

use super::super::warnings::Warnings;
use super::file::File;
use super::primitive::Meshes;
use crate::{Camera, Id, Light, LightKind, Projection, Scene, SceneError};

/// Our tables' indices by the file's.
#[derive(Default)]
pub(super) struct Tables {
    meshes: HashMap<usize, Option<Id>>,
    cameras: HashMap<usize, Id>,
    lights: HashMap<usize, Id>,
}

impl Tables {
    /// `None` for a mesh without a triangle.
    pub(super) fn mesh<'a>(
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

    pub(super) fn camera(
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

    pub(super) fn light(
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
