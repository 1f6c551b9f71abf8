//! Indirect light. So far an estimate: [`Technique::Ambient`] stands in for what bounces, until imperfect shadow maps do
//! it right. An environment map's own light is in [`crate::environment`]; here is how much of it arrives.

mod openness;

pub use openness::{Openness, SkyView};

use std::f32::consts::PI;

use glam::{Vec3, Vec4};

use crate::frame::LightData;
use crate::{choice, settings};

choice! {
    /// Where indirect light comes from.
    pub enum Technique {
        /// A far environment as bright as the scene's lights would make a grey room of its size, brighter on the side
        /// that they shine at, and under a sun the sky as the eye sees it.
        Ambient = "ambient",
        /// None: direct light only.
        None = "none",
    }
}

settings! {
    /// Indirect light.
    pub struct IndirectSettings: "indirect" {
        /// Where indirect light comes from. none takes an environment map's light away too, and leaves it as background.
        technique: Technique = Technique::Ambient, "", (), Uniform;
    }
}

/// Mean albedo that the ambient estimate assumes.
const MEAN_ALBEDO: f32 = 0.5;
/// A clear sky's mean luminance per lux of sun, tinted as Rayleigh scattering does (about 8,000 nits at 100,000 lx).
const SKY_PER_LUX: Vec3 = Vec3::new(0.058, 0.080, 0.115);
/// Least share of a sun's light that gets into a building: openings may be smaller than voxels.
const LEAST_OPEN: f32 = 0.08;
/// A lamp stands within the room, so half of its light's first bounce comes from beside and behind it.
const LAMP_AHEAD: f32 = 0.5;

/// Irradiance over π that stands in for indirect light, and what is behind everything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// For red, green and blue: gradient along the normal, then the mean; nits. Nowhere negative.
    pub radiance: [Vec4; 3],
    /// Radiance of the sky where nothing is in front of it, nits; black with an environment map.
    pub sky: Vec3,
    /// Share of an environment map's light that arrives.
    pub environment: f32,
}

/// The environment that stands in for indirect light, at the eye and taken for the whole scene.
///
/// In a sphere of area A and albedo ρ, of which a share V is open, a flux Φ makes a first bounce of mean radiance
/// Φρ / (πA), and all further ones ρ(1 − V) / (1 − ρ(1 − V)) times as much (integrating sphere; Goebel 1967). The
/// first comes from the half that light shines at, the rest from everywhere; the irradiance of a uniform half sphere
/// is exactly linear in the cosine between its axis and the normal. A bias by design: no occlusion, no colour
/// bleeding, and the air is equally bright everywhere.
///
/// `environment` is the mean radiance of an environment map in nits; it takes the analytic sky's place. Of its light
/// arrives twice the share of the sky that the eye sees, at most all: a wall or the ground before the eye hides half
/// of the sky from it, but none from what faces away from the wall. What bounces within the scene is added.
pub fn ambient(
    settings: &IndirectSettings,
    lights: &[LightData],
    bounds_ws: (Vec3, Vec3),
    view: SkyView,
    environment: Option<Vec3>,
) -> Ambient {
    if settings.technique == Technique::None {
        return Ambient { radiance: [Vec4::ZERO; 3], sky: Vec3::ZERO, environment: 0.0 };
    }
    let size = bounds_ws.1 - bounds_ws.0;
    // Even a point or a line has a surface here.
    let size = if size == Vec3::ZERO { Vec3::ONE } else { size.max(Vec3::splat(1e-3 * size.max_element())) };
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let mut sun = Vec3::ZERO;
    let mut radiance = [Vec4::ZERO; 3];
    let mut add = |color: Vec3, mean: f32, gradient: Vec3| {
        for (sum, nits) in radiance.iter_mut().zip(color.to_array()) {
            *sum += nits * gradient.extend(mean);
        }
    };
    for light in lights {
        let intensity = Vec3::from(light.intensity);
        let (flux, ahead, closed) = if light.kind == LightData::DIRECTIONAL {
            sun += intensity;
            (0.25 * area * view.share.max(LEAST_OPEN), 1.0, 1.0 - view.share)
        } else {
            // A cone's mean direction is shorter the wider it is; a point's is none.
            let cosine = light.cone_rad.cos();
            (2.0 * PI * (1.0 - cosine), LAMP_AHEAD * 0.5 * (1.0 + cosine), 1.0)
        };
        let first = flux * MEAN_ALBEDO / (PI * area);
        let again = MEAN_ALBEDO * closed / (1.0 - MEAN_ALBEDO * closed);
        // A surface that faces the way light travels sees the half that is lit.
        add(intensity, first * (1.0 + again), first * ahead * Vec3::from(light.direction_ws));
    }
    if let Some(mean) = environment {
        let open = (2.0 * view.share).min(1.0);
        let again = MEAN_ALBEDO * (1.0 - open) / (1.0 - MEAN_ALBEDO * (1.0 - open));
        add(mean, open * again, Vec3::ZERO);
        return Ambient { radiance, sky: Vec3::ZERO, environment: open };
    }
    let sky = sun.max(Vec3::ZERO).element_sum() / 3.0 * SKY_PER_LUX;
    // The linear fit to what is seen of it; behind a narrow window it would dip below zero.
    let mean = 0.5 * view.share;
    add(sky, mean, view.direction.clamp_length_max(mean));
    Ambient { radiance, sky, environment: 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun() -> LightData {
        LightData {
            kind: LightData::DIRECTIONAL,
            direction_ws: [0.0, -1.0, 0.0],
            intensity: [100_000.0; 3],
            ..bytemuck::Zeroable::zeroed()
        }
    }

    fn towards(ambient: &Ambient, normal: Vec3) -> f32 {
        ambient.radiance[1].dot(normal.extend(1.0))
    }

    #[test]
    fn under_an_open_sky_a_face_upwards_sees_just_the_sky_and_one_downwards_the_ground() {
        let bounds = (Vec3::ZERO, Vec3::splat(10.0));
        let a = ambient(&IndirectSettings::default(), &[sun()], bounds, SkyView::OPEN, None);
        assert!((towards(&a, Vec3::Y) / a.sky.y - 1.0).abs() < 1e-3, "{a:?}");
        assert!(towards(&a, Vec3::NEG_Y) > 0.0);
        assert!((a.sky.y - 8000.0).abs() < 1.0);
    }

    #[test]
    fn an_environment_replaces_the_sky_and_is_dimmed_only_inside() {
        let bounds = (Vec3::ZERO, Vec3::splat(10.0));
        let settings = IndirectSettings::default();
        let with =
            |share| ambient(&settings, &[], bounds, SkyView { share, ..SkyView::OPEN }, Some(Vec3::ONE));
        for share in [1.0, 0.5] {
            let a = with(share);
            assert_eq!((a.environment, a.sky, towards(&a, Vec3::Y)), (1.0, Vec3::ZERO, 0.0));
        }
        let inside = with(0.05);
        assert!((inside.environment - 0.1).abs() < 1e-6);
        assert!(towards(&inside, Vec3::Y) > 0.0 && towards(&inside, Vec3::Y) < 0.1);
    }

    #[test]
    fn no_direction_is_darker_than_black() {
        let narrow = SkyView { share: 0.01, direction: Vec3::new(0.0095, 0.003, 0.0) };
        let a = ambient(&IndirectSettings::default(), &[sun()], (Vec3::ZERO, Vec3::ONE), narrow, None);
        for channel in a.radiance {
            assert!(channel.truncate().length() <= channel.w * 1.0001, "{a:?}");
        }
    }
}
