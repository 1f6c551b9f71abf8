//! A camera at a place: matrices that shaders need.

use chiaro_scene::{Pose, Projection, Scene};
use glam::{DVec3, Mat3, Mat4, Vec2, Vec3, Vec4};

use crate::Error;

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
    /// Width of what is seen over its height; `None`: that of the picture's pixels.
    pub aspect: Option<f32>,
    /// Where the camera's axis meets the picture, in normalised device coordinates (−1..1, y up): zero unless the lens is
    /// shifted, for a part of a larger picture, say.
    pub axis_ndc: Vec2,
}

/// Which way depth runs in a projection matrix. Either runs from 0 to 1, as wgpu's does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 0 at the near plane, 1 at the far one or at infinity.
    Standard,
    /// 1 at the near plane, 0 at the far one or at infinity.
    Reversed,
}

const DEFAULT_FAR_M: f32 = 1000.0;
/// How far a host's axes may be from perpendicular and from unit length.
const RIGID: f32 = 1e-3;
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
            aspect: None,
            axis_ndc: Vec2::ZERO,
        })
    }

    /// A host program's camera by its matrices: world → its axes, in metres, and its axes → clip space. Perspective, with
    /// the far plane anywhere or at infinity, or orthographic; looking along −Z or along +Z; shifted lenses and jitter are
    /// kept. Chiaro's perspective sees to infinity all the same. World space counts from [`Scene::origin`].
    ///
    /// # Errors
    /// [`Error::Matrix`] when a number is not finite, the first matrix is more than a rotation and a translation, or the
    /// second is singular or none of a camera.
    pub fn from_matrices(view_from_world: Mat4, clip_from_view: Mat4, depth: Depth) -> Result<Self, Error> {
        Self::of_host(view_from_world, clip_from_view, depth).map(|(view, _)| view)
    }

    /// The same, and the depth that the host's far plane has in chiaro's clip space.
    pub(crate) fn of_host(
        view_from_world: Mat4,
        clip_from_view: Mat4,
        depth: Depth,
    ) -> Result<(Self, f32), Error> {
        let bad = |matrix, problem| Err(Error::Matrix { matrix, problem });
        let (view, clip) = ("view_from_world", "clip_from_view");
        for (name, matrix) in [(view, view_from_world), (clip, clip_from_view)] {
            if !matrix.is_finite() {
                return bad(name, "has a number that is not finite");
            }
            if matrix.determinant() == 0.0 {
                return bad(name, "is singular");
            }
        }
        // Chiaro's cameras look along −Z. One that looks along +Z is the same seen in a mirror, twice.
        let rows = clip_from_view.transpose();
        let orthographic = rows.w_axis.truncate() == Vec3::ZERO;
        let along = if orthographic {
            rows.z_axis.z * if depth == Depth::Standard { 1.0 } else { -1.0 }
        } else {
            rows.w_axis.z
        };
        let turn = Mat4::from_scale(Vec3::new(1.0, 1.0, if along > 0.0 { -1.0 } else { 1.0 }));
        let (view_from_world, rows) = (turn * view_from_world, (clip_from_view * turn).transpose());

        let axes = Mat3::from_mat4(view_from_world);
        let gram = axes * axes.transpose();
        if view_from_world.row(3) != Vec4::W || !gram.abs_diff_eq(Mat3::IDENTITY, RIGID) {
            return bad(view, "is more than a rotation and a translation");
        }
        if axes.determinant() < 0.0 {
            return bad(view, "mirrors");
        }
        // x' = a·x + …, y' = b·y + …, z' = c·z + d, w' = −z or 1, up to a common factor.
        let w = if orthographic { rows.w_axis.w } else { -rows.w_axis.z };
        let [x, y, z, last] = [rows.x_axis, rows.y_axis, rows.z_axis, rows.w_axis].map(|row| row / w);
        let (a, b) = (x.x, y.y);
        let is_camera = [x.y, y.x, z.x, z.y, last.x, last.y] == [0.0; 6]
            && if orthographic { [x.z, y.z] == [0.0; 2] } else { [x.w, y.w, last.w] == [0.0; 3] };
        if !is_camera || a <= 0.0 || b <= 0.0 {
            return bad(clip, "is no upright perspective or orthographic projection");
        }
        // The distances at which depth is 0 and 1: c·z + d = 0 or w'.
        let at = if orthographic { [z.w / z.z, (z.w - 1.0) / z.z] } else { [z.w / z.z, z.w / (1.0 + z.z)] };
        let [near_m, far_m] = if depth == Depth::Standard { at } else { [at[1], at[0]] };
        // At infinity it may come out on the other side of it.
        let perspective_ends = near_m > 0.0 && (far_m > near_m || far_m < -1e3 * near_m);
        if !near_m.is_finite() || if orthographic { far_m <= near_m } else { !perspective_ends } {
            return bad(
                clip,
                "has its near plane behind the eye or beyond its far plane: is its depth of the other convention?",
            );
        }
        let (projection, axis_ndc) = if orthographic {
            (Projection::Orthographic { half_height_m: 1.0 / b }, Vec2::new(x.w, y.w))
        } else {
            (Projection::Perspective { yfov_rad: 2.0 * (1.0 / b).atan() }, -Vec2::new(x.z, y.z))
        };
        let world_from_camera = view_from_world.inverse();
        // A plane that rounding has put beyond infinity is there.
        let far_depth = if orthographic { 0.0 } else { (near_m / far_m).max(0.0) };
        let far_m = if orthographic { far_m } else { DEFAULT_FAR_M };
        Ok((Self { world_from_camera, projection, near_m, far_m, aspect: Some(b / a), axis_ndc }, far_depth))
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
            aspect: None,
            axis_ndc: Vec2::ZERO,
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
        let [width, height] = size_px.map(|n| n as f32);
        let pixel_m = 2.0 * half_height_m / height;
        pixel_m * pixel_m * self.aspect.map_or(1.0, |aspect| aspect * height / width)
    }

    /// Reversed-depth clip space from the camera's axes, moved by `jitter_px` pixels right and down.
    fn clip_from_camera(&self, size_px: [u32; 2], jitter_px: Vec2) -> Mat4 {
        let [width, height] = size_px.map(|n| n as f32);
        let aspect = self.aspect.unwrap_or(width / height);
        let shift = self.axis_ndc + jitter_px * Vec2::new(2.0 / width, -2.0 / height);
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
    fn a_host_s_matrices_become_the_camera_that_they_are_of() {
        use glam::camera::rh::proj::directx;
        let own = View::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 1.0, 0.0), 0.7, 0.05);
        let world = own.world_from_camera.inverse();
        let shift = Mat4::from_translation(Vec3::new(0.2, -0.1, 0.0));
        for (clip, depth) in [
            (directx::perspective(0.7, 1.5, 0.05, 80.0), Depth::Standard),
            (directx::perspective_infinite(0.7, 1.5, 0.05), Depth::Standard),
            (directx::perspective_infinite_reverse(0.7, 1.5, 0.05), Depth::Reversed),
        ] {
            let view = View::from_matrices(world, shift * clip, depth).unwrap();
            let expected = View { aspect: Some(1.5), axis_ndc: Vec2::new(0.2, -0.1), ..own };
            let (found, wanted) =
                (view.clip_from_ws(SIZE, Vec2::ZERO), expected.clip_from_ws(SIZE, Vec2::ZERO));
            assert!(found.abs_diff_eq(wanted, 1e-4), "{found} is not {wanted}");
            assert!((view.near_m / 0.05 - 1.0).abs() < 1e-3, "{}", view.near_m);
        }
    }

    #[test]
    fn matrices_that_are_of_no_camera_are_refused_by_name() {
        use glam::camera::rh::proj::directx;
        let clip = directx::perspective_infinite_reverse(0.7, 1.5, 0.05);
        let flip = |x, y| Mat4::from_scale(Vec3::new(x, y, 1.0));
        for (world, clip, depth, told) in [
            (Mat4::NAN, clip, Depth::Reversed, "view_from_world has a number that is not finite"),
            (
                Mat4::IDENTITY,
                f32::INFINITY * Mat4::IDENTITY,
                Depth::Reversed,
                "clip_from_view has a number that is not finite",
            ),
            (Mat4::ZERO, clip, Depth::Reversed, "view_from_world is singular"),
            (Mat4::IDENTITY, flip(0.0, 1.0), Depth::Reversed, "clip_from_view is singular"),
            (2.0 * Mat4::IDENTITY, clip, Depth::Reversed, "view_from_world is more than a rotation"),
            (flip(-1.0, 1.0), clip, Depth::Reversed, "view_from_world mirrors"),
            (Mat4::IDENTITY, flip(1.0, -1.0) * clip, Depth::Reversed, "clip_from_view is no upright"),
            (Mat4::IDENTITY, clip, Depth::Standard, "other convention"),
            (
                Mat4::IDENTITY,
                directx::perspective_infinite(0.7, 1.5, 0.05),
                Depth::Reversed,
                "other convention",
            ),
            (Mat4::IDENTITY, directx::perspective(0.7, 1.5, 0.05, 9.0), Depth::Reversed, "other convention"),
        ] {
            let error = View::from_matrices(world, clip, depth).unwrap_err().to_string();
            assert!(error.contains(told), "{error} does not tell {told}");
        }
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
