//! A view for scenes that come without one.

use glam::{Affine3A, Quat, Vec3};

use crate::{Camera, Light, LightKind, Node, Projection, Scene, Transform};

/// Vertical field of view of the default camera.
const YFOV_RAD: f32 = std::f32::consts::FRAC_PI_4;

/// Illuminance of the default sun on a surface that faces it, in lux. A file without lights states no level of light;
/// with this one, a white surface is as bright as one that emits 1 nit, which is how such files mean their emission and
/// their unlit colours.
const SUN_LUX: f32 = std::f32::consts::PI;

/// From the scene towards the default sun: high, to the viewer's left and a little to the front, so that shadows fall
/// across what is seen.
const TOWARDS_SUN: Vec3 = Vec3::new(-0.35, 0.8, 0.5);

/// From the scene towards the default camera: three quarters from the front, somewhat above.
const TOWARDS_CAMERA: Vec3 = Vec3::new(0.6, 0.4, 1.0);

impl Scene {
    /// Gives a scene what it lacks to be seen: a camera from outside that frames all geometry, and a sun. A scene
    /// that has a camera placed keeps its own, and so with lights; an environment is light enough, emissive surfaces
    /// are not, as they do not light others. The outcome depends on the scene alone.
    pub fn add_default_view(&mut self) {
        if !self.nodes.iter().any(|node| node.camera.is_some()) {
            self.add_default_camera();
        }
        if self.is_unlit() {
            self.add_default_sun();
        }
    }

    /// The same for path tracing, where emissive surfaces are lights.
    pub fn add_default_view_to_trace(&mut self) {
        let drawn = self.nodes.iter().filter_map(|node| node.mesh);
        let mut primitives = drawn.flat_map(|mesh| &self.meshes[mesh].primitives);
        let glows = primitives.any(|primitive| self.materials[primitive.material].emissive != Vec3::ZERO);
        if !self.nodes.iter().any(|node| node.camera.is_some()) {
            self.add_default_camera();
        }
        if !glows && self.is_unlit() {
            self.add_default_sun();
        }
    }

    fn is_unlit(&self) -> bool {
        self.environment.is_none() && !self.nodes.iter().any(|node| node.light.is_some())
    }

    fn add_default_camera(&mut self) {
        let (lo, hi) = self.bounds_at(&self.pose(0.0)).unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let center = (lo + hi) / 2.0;
        let radius = ((hi - lo) / 2.0).length();
        // A point has no extent, but a camera must stand somewhere.
        let radius = if radius > 0.0 { radius } else { 1e-4 * center.length().max(1.0) };
        let towards = TOWARDS_CAMERA.normalize();
        let distance = framing_distance(lo - center, hi - center, towards).max(radius * 1e-2);
        let eye = center + distance * towards;
        let camera = Camera {
            name: "default camera".to_owned(),
            projection: Projection::Perspective { yfov_rad: YFOV_RAD },
            // Well before the nearest point of the bounding sphere when outside, and small enough when the box is
            // entered.
            near_m: distance.min(radius) * 1e-2,
            far_m: None,
        };
        self.cameras.push(camera);
        let node = Node { offset: self.origin, ..node("default camera", eye, -towards) };
        self.nodes.push(Node { camera: Some(self.cameras.len() - 1), ..node });
    }

    fn add_default_sun(&mut self) {
        let (lo, hi) = self.bounds().unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let towards = TOWARDS_SUN.normalize();
        self.lights.push(Light {
            name: "default sun".to_owned(),
            kind: LightKind::Directional,
            color: Vec3::ONE,
            intensity: SUN_LUX,
            range_m: None,
        });
        let above = (lo + hi) / 2.0 + towards * (hi - lo).length();
        let node = Node { offset: self.origin, ..node("default sun", above, -towards) };
        self.nodes.push(Node { light: Some(self.lights.len() - 1), ..node });
    }
}

/// Distance from the box's centre at which a camera, looking along −`towards`, sees all eight corners with a margin of
/// a tenth, in a square picture or any wider one.
fn framing_distance(lo: Vec3, hi: Vec3, towards: Vec3) -> f32 {
    let view_from_world = look_along(-towards).inverse();
    let corners = (0..8).map(|i| Vec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), lo, hi));
    let slope = (YFOV_RAD / 2.0).tan() / 1.1;
    let distances = corners.map(|corner| {
        let p = view_from_world * corner;
        p.x.abs().max(p.y.abs()) / slope + p.z
    });
    distances.fold(0.0, f32::max)
}

/// World from the space of a camera or light that looks along `forward`, which is not vertical.
fn look_along(forward: Vec3) -> Quat {
    let right = forward.cross(Vec3::Y).normalize();
    Quat::from_mat3(&glam::Mat3::from_cols(right, right.cross(forward), -forward))
}

/// A root node at `at` that looks along `forward`.
fn node(name: &str, at: Vec3, forward: Vec3) -> Node {
    Node {
        name: name.to_owned(),
        parent_from_node: Transform::Matrix(Affine3A::from_rotation_translation(look_along(forward), at)),
        ..Node::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::invariants::assert_sound;
    use crate::{Material, Mesh, Primitive};

    /// A scene of one triangle with these corners.
    fn triangle(positions: [Vec3; 3]) -> Scene {
        let primitive = Primitive {
            positions: positions.to_vec(),
            normals: vec![Vec3::Y; 3],
            indices: vec![0, 1, 2],
            ..Primitive::default()
        };
        let node = Node { mesh: Some(0), ..node("triangle", Vec3::ZERO, Vec3::NEG_Z) };
        Scene {
            meshes: vec![Mesh { primitives: vec![primitive], ..Mesh::default() }],
            materials: vec![Material::default()],
            nodes: vec![node],
            ..Scene::default()
        }
    }

    /// Where `p` is in the default camera's picture of aspect 1, ±1 being its border; `None` before the near plane.
    fn in_picture(scene: &Scene, p: Vec3) -> Option<Vec3> {
        let (camera, world_from_camera) = scene.placed_cameras()[0];
        let camera = &scene.cameras[camera];
        let p = world_from_camera.inverse().transform_point3(p);
        (-p.z > camera.near_m).then(|| p / (-p.z * (YFOV_RAD / 2.0).tan()))
    }

    #[test]
    fn the_default_camera_sees_the_whole_of_any_box() {
        for (at, size) in [(0.0, 1e-3), (1e3, 1.0), (-50.0, 2e4)] {
            for flat in
                [Vec3::ONE, Vec3::new(1.0, 0.01, 1.0), Vec3::new(0.01, 1.0, 0.01), Vec3::new(0.0, 0.0, 1.0)]
            {
                let (lo, hi) = (Vec3::splat(at), Vec3::splat(at) + size * flat);
                let mut scene = triangle([lo, hi, lo]);
                scene.add_default_view();
                assert_sound(&scene);
                let corners = [lo, hi, Vec3::new(lo.x, hi.y, lo.z), Vec3::new(hi.x, lo.y, hi.z)];
                for p in corners.map(|corner| in_picture(&scene, corner).expect("before the near plane")) {
                    assert!(p.x.abs() < 1.0 && p.y.abs() < 1.0, "{size} × {flat} at {at}: {p}");
                }
            }
        }
    }

    #[test]
    fn the_default_sun_shines_down_and_not_from_behind_the_scene() {
        let mut scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
        scene.add_default_view();
        let (light, world_from_light) = scene.placed_lights()[0];
        let shines = world_from_light.transform_vector3(Vec3::NEG_Z);
        assert_eq!(scene.lights[light].kind, LightKind::Directional);
        assert!(shines.y < -0.5 && shines.dot(TOWARDS_CAMERA) < 0.0, "{shines}");
    }

    #[test]
    fn only_where_rays_are_traced_do_emissive_surfaces_light() {
        let mut scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        scene.add_default_view_to_trace();
        assert_eq!((scene.cameras.len(), scene.lights.len()), (1, 1));
        let mut scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        scene.materials[0].emissive = Vec3::ONE;
        scene.add_default_view_to_trace();
        assert_eq!((scene.cameras.len(), scene.lights.len()), (1, 0));
    }

    #[test]
    fn what_a_scene_has_is_kept_and_emissive_surfaces_are_no_lights() {
        let mut scene = triangle([Vec3::ZERO, Vec3::X, Vec3::Z]);
        scene.materials[0].emissive = Vec3::ONE;
        scene.add_default_view();
        assert_eq!((scene.cameras.len(), scene.lights.len()), (1, 1));
        scene.add_default_view();
        assert_eq!((scene.cameras.len(), scene.lights.len(), scene.nodes.len()), (1, 1, 3));
    }

    #[test]
    fn an_empty_scene_and_a_single_point_get_a_view_too() {
        for mut scene in [Scene::default(), triangle([Vec3::splat(7.0); 3])] {
            scene.add_default_view();
            assert_sound(&scene);
            assert!(scene.cameras[0].near_m > 0.0);
        }
    }
}
