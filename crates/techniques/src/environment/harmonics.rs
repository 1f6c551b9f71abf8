//! An environment's irradiance as a quadratic form of the normal.

use std::f64::consts::PI;

use chiaro_scene::Environment;
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3};

/// Irradiance / π of a far environment: for each colour nᵀ M n with n = (normal, 1), nits.
///
/// This is the expansion to second order of Ramamoorthi & Hanrahan 2001 ("An Efficient Representation for Irradiance
/// Environment Maps", eq. 12): nine numbers a colour, written as the matrix that they make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonics {
    /// Red, green, blue; symmetric.
    pub matrices: [Mat4; 3],
    /// Mean radiance over all directions, nits.
    pub mean: Vec3,
}

impl Harmonics {
    /// The same environment, turned about the vertical (counter-clockwise from above) and scaled.
    #[must_use]
    pub fn turned(&self, angle_rad: f32, factor: f32) -> [Mat4; 3] {
        let map_from_world = Mat4::from_rotation_y(-angle_rad);
        self.matrices.map(|m| map_from_world.transpose() * m * map_from_world * factor)
    }
}

/// Least rows of directions, so that tiny maps are integrated as well as large ones.
const ROWS: u32 = 128;

/// Sums an environment up. With the clamped cosine ≈ 1/4 + c/2 + 5/32 (3c² − 1), c = direction · normal, the form's
/// coefficients are moments of the radiance.
pub fn harmonics(environment: &Environment) -> Harmonics {
    let parts = ROWS.div_ceil(environment.height);
    let (columns, rows) = (environment.width * parts, environment.height * parts);
    let around: Vec<_> =
        (0..columns).map(|x| ((f64::from(x) + 0.5) / f64::from(columns) * 2.0 * PI).sin_cos()).collect();
    let mut moments = [DMat4::ZERO; 3];
    for row in 0..rows {
        let edge = |row: u32| (f64::from(row) / f64::from(rows) * PI).cos();
        // Exact solid angles, so that a uniform environment sums up to itself.
        let weight = (edge(row) - edge(row + 1)) * 2.0 * PI / f64::from(columns);
        let (radius, y) = ((f64::from(row) + 0.5) / f64::from(rows) * PI).sin_cos();
        let line = (row / parts * environment.width) as usize;
        for (column, (sin, cos)) in around.iter().enumerate() {
            let nits = environment.radiance[line + column / parts as usize];
            let d = DVec3::new(radius * sin, y, -radius * cos).extend(1.0);
            let outer = DMat4::from_cols(d * d.x, d * d.y, d * d.z, d) * weight;
            for (sum, nits) in moments.iter_mut().zip(nits.to_array()) {
                *sum += outer * f64::from(nits);
            }
        }
    }
    let mean = Vec3::from(moments.map(|m| (m.w_axis.w / (4.0 * PI)) as f32));
    let (quadratic, linear, constant) = (15.0 / 32.0, 1.0 / 4.0, 3.0 / 32.0);
    let upper = DVec4::new(quadratic, quadratic, quadratic, linear);
    let lower = DVec4::new(linear, linear, linear, constant);
    let matrices = moments.map(|m| {
        let m = DMat4::from_cols(m.x_axis * upper, m.y_axis * upper, m.z_axis * upper, m.w_axis * lower);
        (m * (1.0 / PI)).as_mat4()
    });
    Harmonics { matrices, mean }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(width: u32, height: u32, nits: impl Fn(u32, u32) -> f32) -> Environment {
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let radiance = texels.map(|(x, y)| Vec3::splat(nits(x, y))).collect();
        Environment { name: "test".into(), width, height, radiance }
    }

    fn irradiance_over_pi(m: &Mat4, normal: Vec3) -> f32 {
        let n = normal.extend(1.0);
        n.dot(*m * n)
    }

    #[test]
    fn a_uniform_environment_lights_every_side_with_its_own_radiance() {
        for (width, height) in [(1, 1), (7, 3), (256, 128)] {
            let h = harmonics(&map(width, height, |_, _| 3.0));
            assert!((h.mean - 3.0).abs().max_element() < 1e-5);
            for n in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
                let found = irradiance_over_pi(&h.matrices[1], n);
                assert!((found - 3.0).abs() < 1e-3, "{width}×{height} {n}: {found}");
            }
        }
    }

    #[test]
    fn a_bright_upper_half_lights_faces_upwards_in_full_sideways_by_half_and_downwards_not() {
        let h = harmonics(&map(64, 32, |_, y| if y < 16 { 1.0 } else { 0.0 }));
        // A half sphere has no even harmonics beyond the mean: second order is exact.
        for (n, expected) in [(Vec3::Y, 1.0), (Vec3::X, 0.5), (Vec3::NEG_Y, 0.0)] {
            let found = irradiance_over_pi(&h.matrices[0], n);
            assert!((found - expected).abs() < 2e-3, "{n}: {found}");
        }
    }

    #[test]
    fn turned_counter_clockwise_what_was_behind_the_right_is_ahead() {
        // A quarter of the way round: +X.
        let h = harmonics(&map(64, 32, |x, _| if (12..20).contains(&x) { 1.0 } else { 0.0 }));
        let brightest = |m: &Mat4| {
            let sides = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
            sides.into_iter().max_by(|a, b| irradiance_over_pi(m, *a).total_cmp(&irradiance_over_pi(m, *b)))
        };
        assert_eq!(brightest(&h.matrices[0]), Some(Vec3::X));
        let turned = h.turned(std::f32::consts::FRAC_PI_2, 2.0);
        assert_eq!(brightest(&turned[0]), Some(Vec3::NEG_Z));
        let (a, b) =
            (irradiance_over_pi(&h.matrices[0], Vec3::X), irradiance_over_pi(&turned[0], Vec3::NEG_Z));
        assert!((b / a - 2.0).abs() < 1e-4);
    }
}
