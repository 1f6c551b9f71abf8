//! The sky that stands where a scene has suns and no environment map: uniform, all around.

use glam::{Mat4, Vec3, Vec4};

use super::{EnvironmentSettings, Sky};
use crate::frame::LightData;

/// A clear sky's mean luminance per lux of sun, tinted as Rayleigh scattering does (about 8,000 nits at 100,000 lx).
const SKY_PER_LUX: Vec3 = Vec3::new(0.058, 0.080, 0.115);

/// Radiance of the sky, nits; black without suns, or where an environment map takes its place.
pub fn sky(settings: &EnvironmentSettings, lights: &[LightData], has_map: bool) -> Vec3 {
    if has_map || settings.sky == Sky::None {
        return Vec3::ZERO;
    }
    let suns = lights.iter().filter(|light| light.kind == LightData::DIRECTIONAL);
    let lux = suns.map(|sun| Vec3::from(sun.intensity)).sum::<Vec3>();
    lux.max(Vec3::ZERO).element_sum() / 3.0 * SKY_PER_LUX
}

/// Irradiance / π, as [`super::Harmonics`] have it, of what a place sees of a sky: of the upper half of all directions the
/// share `seen`, whose mean over that half is `direction`.
///
/// The linear fit: exact under an open sky, where a face upwards sees just the sky and one downwards none of it. Behind a
/// narrow window it would dip below zero, and is flattened.
pub fn sky_light(sky: Vec3, seen: f32, direction: Vec3) -> [Mat4; 3] {
    let mean = 0.5 * seen;
    let half = 0.5 * direction.clamp_length_max(mean);
    sky.to_array().map(|nits| {
        let [x, y, z] = (nits * half).to_array();
        let last = Vec4::new(x, y, z, nits * mean);
        Mat4::from_cols(x * Vec4::W, y * Vec4::W, z * Vec4::W, last)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Vec3 = Vec3::splat(100.0);

    fn towards(light: &[Mat4; 3], normal: Vec3) -> f32 {
        let n = normal.extend(1.0);
        n.dot(light[1] * n)
    }

    #[test]
    fn a_sky_is_of_all_suns_and_gives_way_to_a_map() {
        let sun = LightData {
            kind: LightData::DIRECTIONAL,
            intensity: [40_000.0, 50_000.0, 60_000.0],
            ..bytemuck::Zeroable::zeroed()
        };
        let lamp = LightData { kind: LightData::POINT, ..sun };
        let auto = EnvironmentSettings::default();
        let none = EnvironmentSettings { sky: Sky::None, ..auto.clone() };
        assert!((sky(&auto, &[sun, lamp, sun], false).y - 8000.0).abs() < 1.0);
        for black in [sky(&none, &[sun], false), sky(&auto, &[sun], true), sky(&auto, &[lamp], false)] {
            assert_eq!(black, Vec3::ZERO);
        }
    }

    #[test]
    fn under_an_open_sky_a_face_upwards_sees_just_the_sky_and_one_downwards_nothing() {
        let light = sky_light(WHITE, 1.0, 0.5 * Vec3::Y);
        for (normal, expected) in [(Vec3::Y, 100.0), (Vec3::X, 50.0), (Vec3::NEG_Y, 0.0)] {
            assert!((towards(&light, normal) - expected).abs() < 1e-3, "{normal}");
        }
    }

    #[test]
    fn no_direction_is_darker_than_black() {
        let direction = Vec3::new(0.0095, 0.003, 0.0);
        let light = sky_light(WHITE, 0.01, direction);
        assert!(towards(&light, -direction.normalize()) >= -1e-4);
        assert!(towards(&light, direction.normalize()) > 0.9);
    }
}
