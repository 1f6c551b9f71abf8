//! A camera at a place: matrices that shaders need.

use chiaro_scene::{Pose, Projection, Scene};
use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};

/// A place to look from, in the coordinates of a scene's file, whatever its origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lookout {
    /// Where the eye is, metres.
    pub eye_m: DVec3,
    /// What it looks at, metres.
    pub target_m: DVec3,
    /// Angle from bottom to top.
    pub yfov_rad: f32,
}

/// Near planes as shares of what is looked at. Reversed float depth keeps its precision whatever they are.
const NEAR_SHARE: f32 = 1e-5;

impl Lookout {
    /// The view from here. Its near plane follows from the size of what is looked at: of the scene or, where that is less,
    /// how far away the target is.
    pub fn view(&self, scene: &Scene) -> View {
        let (lo, hi) = scene.bounds_at(&scene.pose(0.0)).unwrap_or((Vec3::NEG_ONE, Vec3::ONE));
        let (away, size) = (self.eye_m.distance(self.target_m) as f32, (hi - lo).length());
        let near_m = NEAR_SHARE * if size > 0.0 { away.min(size) } else { away };
        let eye = (self.eye_m - scene.origin).as_vec3();
        // By its direction: a target close by may round to the eye's own place.
        let forward = (self.target_m - self.eye_m).normalize_or(DVec3::NEG_Z).as_vec3();
        View::looking(eye, forward, self.yfov_rad, near_m)
    }
}

/// Where the picture is taken from, and through which lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Pose in world space, which counts from [`Scene::origin`]; looks along −Z, +Y up.
    pub world_from_camera: Mat4,
    /// Lens.
    pub projection: Projection,
    /// Near plane, metres.
    pub near_m: f32,
    /// Far plane of orthographic cameras, metres. Perspective ones see to infinity.
    pub far_m: f32,
}

const DEFAULT_FAR_M: f32 = 1000.0;
/// Far below anything's size, but above zero.
const LEAST_NEAR_M: f32 = 1e-20;

impl View {
    /// The scene's camera number `index`, in the order its nodes place them, as it stands at time 0.
    pub fn from_scene(scene: &Scene, index: usize) -> Option<Self> {
        Self::from_pose(scene, &scene.pose(0.0), index)
    }

    /// The scene's camera number `index`, in the order its nodes place them, as it stands in a pose.
    pub fn from_pose(scene: &Scene, pose: &Pose, index: usize) -> Option<Self> {
        let (camera, world_from_camera) = *scene.placed_cameras_at(pose).get(index)?;
        let camera = &scene.cameras[camera];
        // A camera's scale is none of its lens' business.
        let (_, rotation, translation) = world_from_camera.to_scale_rotation_translation();
        Some(Self {
            world_from_camera: Mat4::from_rotation_translation(rotation, translation),
            projection: camera.projection,
            near_m: camera.near_m.max(LEAST_NEAR_M),
            far_m: camera.far_m.unwrap_or(DEFAULT_FAR_M),
        })
    }

    /// A perspective camera at `eye` looking at `target`; `yfov_rad` from bottom to top.
    pub fn look_at(eye: Vec3, target: Vec3, yfov_rad: f32, near_m: f32) -> Self {
        Self::looking(eye, (target - eye).normalize_or(Vec3::NEG_Z), yfov_rad, near_m)
    }

    fn looking(eye: Vec3, forward: Vec3, yfov_rad: f32, near_m: f32) -> Self {
        // Straight up or down has no horizon: any right vector will do.
        let right = forward.cross(Vec3::Y).try_normalize().unwrap_or(Vec3::X);
        let up = right.cross(forward);
        let world_from_camera =
            Mat4::from_cols(right.extend(0.0), up.extend(0.0), (-forward).extend(0.0), eye.extend(1.0));
        Self {
            world_from_camera,
            projection: Projection::Perspective { yfov_rad },
            near_m,
            far_m: DEFAULT_FAR_M,
        }
    }

    /// World position.
    pub fn eye_ws(&self) -> Vec3 {
        self.world_from_camera.w_axis.truncate()
    }

    /// Unit viewing direction.
    pub fn forward_ws(&self) -> Vec3 {
        -self.world_from_camera.z_axis.truncate()
    }

    /// Whether all rays are parallel.
    pub fn is_orthographic(&self) -> bool {
        matches!(self.projection, Projection::Orthographic { .. })
    }

    /// Area of a pixel one metre ahead on the camera's axis, m²; of an orthographic camera's pixel.
    pub fn pixel_m2(&self, size_px: [u32; 2]) -> f32 {
        let half_height_m = match self.projection {
            Projection::Perspective { yfov_rad } => (0.5 * yfov_rad).tan(),
            Projection::Orthographic { half_height_m } => half_height_m,
        };
        (2.0 * half_height_m / size_px[1] as f32).powi(2)
    }

    /// Reversed-depth clip space from the camera's axes, moved by `jitter_px` pixels right and down.
    fn clip_from_camera(&self, size_px: [u32; 2], jitter_px: Vec2) -> Mat4 {
        let [width, height] = size_px.map(|n| n as f32);
        let aspect = width / height;
        let shift = jitter_px * Vec2::new(2.0 / width, -2.0 / height);
        match self.projection {
            Projection::Perspective { yfov_rad } => {
                let f = 1.0 / (0.5 * yfov_rad).tan();
                // z' = near and w' = −z: depth near/distance, 1 at the near plane, 0 at infinity.
                Mat4::from_cols(
                    Vec4::new(f / aspect, 0.0, 0.0, 0.0),
                    Vec4::new(0.0, f, 0.0, 0.0),
                    Vec4::new(-shift.x, -shift.y, 0.0, -1.0),
                    Vec4::new(0.0, 0.0, self.near_m, 0.0),
                )
            }
            Projection::Orthographic { half_height_m } => {
                let a = 1.0 / (self.far_m - self.near_m).max(LEAST_NEAR_M);
                Mat4::from_cols(
                    Vec4::new(1.0 / (half_height_m * aspect), 0.0, 0.0, 0.0),
                    Vec4::new(0.0, 1.0 / half_height_m, 0.0, 0.0),
                    Vec4::new(0.0, 0.0, a, 0.0),
                    Vec4::new(shift.x, shift.y, self.far_m * a, 1.0),
                )
            }
        }
    }

    /// Reversed clip space from world space.
    pub fn clip_from_ws(&self, size_px: [u32; 2], jitter_px: Vec2) -> Mat4 {
        self.clip_from_camera(size_px, jitter_px) * self.world_from_camera.inverse()
    }

    /// From clip space to the vector eye → point in world axes.
    pub fn relative_from_clip(&self, size_px: [u32; 2], jitter_px: Vec2) -> Mat4 {
        let mut rotation = self.world_from_camera;
        rotation.w_axis = Vec4::W;
        rotation * self.clip_from_camera(size_px, jitter_px).inverse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [640, 480];

    #[test]
    fn depth_is_one_at_the_near_plane_and_falls_to_zero() {
        let view = View::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, 1.0, 0.1);
        let at = |d: f32| {
            view.clip_from_ws(SIZE, Vec2::ZERO).project_point3(view.eye_ws() + d * view.forward_ws()).z
        };
        assert!((at(0.1) - 1.0).abs() < 1e-4);
        assert!((at(1.0) - 0.1).abs() < 1e-5);
        assert!(at(1e6) > 0.0 && at(1e6) < 1e-6);
    }

    #[test]
    fn jitter_moves_the_picture_right_and_down() {
        let mut view = View::look_at(Vec3::Z, Vec3::ZERO, 1.0, 0.1);
        for projection in [view.projection, Projection::Orthographic { half_height_m: 1.0 }] {
            view.projection = projection;
            let p = view.clip_from_ws(SIZE, Vec2::new(1.0, 1.0)).project_point3(Vec3::ZERO);
            assert!((p.x - 2.0 / 640.0).abs() < 1e-6 && (p.y + 2.0 / 480.0).abs() < 1e-6, "{p}");
        }
    }

    #[test]
    fn a_point_far_from_the_origin_comes_back_from_its_pixel() {
        let view = View::look_at(Vec3::new(5000.0, 2.0, -7000.0), Vec3::new(5001.0, 2.2, -7003.0), 1.0, 0.1);
        let relative = 3.0 * view.forward_ws() + Vec3::new(0.1, 0.2, 0.05);
        let clip = view.clip_from_camera(SIZE, Vec2::ZERO)
            * (view.world_from_camera.inverse() * relative.extend(0.0)).truncate().extend(1.0);
        let back = view.relative_from_clip(SIZE, Vec2::ZERO).project_point3(clip.truncate() / clip.w);
        assert!(back.distance(relative) < 1e-5, "{back} is not {relative}");
    }
}
