//! Matrices and boxes that views are made of.

use glam::{Mat3, Mat4, Quat, Vec2, Vec3, Vec4};

/// The corners of a box.
pub fn corners((lo, hi): (Vec3, Vec3)) -> [Vec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
        Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
    })
}

/// What a range of depths along the light through a box is widened by, so that nothing lies on its ends.
pub fn slack(near: f32, far: f32, (lo, hi): (Vec3, Vec3)) -> f32 {
    let least = (1e-6 * (hi - lo).length()).max(1e-6 * near.abs().max(far.abs()));
    (1e-3 * (far - near)).max(least).max(f32::MIN_POSITIVE)
}

/// World axes → the light's, which looks along −Z.
pub fn light_axes(direction: Vec3) -> Quat {
    let x = direction.any_orthonormal_vector();
    let y = (-direction).cross(x);
    Quat::from_mat3(&Mat3::from_cols(x, y, -direction)).conjugate()
}

/// Looks along −Z; half extents at one metre; near = 1, far = 0.
pub fn reversed_perspective(half: Vec2, near: f32, far: f32) -> Mat4 {
    let a = near / (far - near);
    Mat4::from_cols(
        Vec4::new(1.0 / half.x, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 1.0 / half.y, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, -1.0),
        Vec4::new(0.0, 0.0, a * far, 0.0),
    )
}

/// Looks along −Z; half extents in metres; near = 1, far = 0.
pub fn reversed_orthographic(half: Vec2, near: f32, far: f32) -> Mat4 {
    let a = 1.0 / (far - near);
    Mat4::from_cols(
        Vec4::new(1.0 / half.x, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 1.0 / half.y, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, 0.0),
        Vec4::new(0.0, 0.0, a * far, 1.0),
    )
}
