//! Indirect light: what was scattered before it reaches the surface that is seen. What the environment, the sky or a glowing mesh
//! gives the first surface is direct light, in [`sources`] with shadows, else in [`crate::environment`]; the technique says
//! whether they are taken for sources.
//!
//! [`Technique::Ambient`] is an estimate for the whole scene ([`ambient`]). The others put virtual lights where lamps
//! shine:
//!
//! | step | module | once |
//! | --- | --- | --- |
//! | places of the scene, for its shadows | [`points`] | a scene; found again where things move |
//! | what each lamp shines at | [`rsm`] | a change |
//! | virtual lights there | [`vpls`] | a frame |
//! | many of them as fewer, where that is asked for | [`clusters`] | a frame |
//! | virtual lights on what shines itself | [`sources`] | a frame |
//! | a coarse shadow map of each | [`ism`] | a frame |
//! | virtual lights where those shine, by their maps | [`bounces`] | a frame, and a further bounce |
//! | what bounding their nearness takes, where it is given back | [`compensate`] | a frame |
//! | their light where the camera looks | [`gather`] | a frame, and a layer of see-through surfaces |
//! | its mean over the frames of a moving picture | [`accumulate`] | a frame |
//! | the same on what another program has drawn | [`foreign`] | a frame |
//! | what all this looks like | [`pictures`] | where asked for |

pub mod accumulate;
pub mod bounces;
pub mod clusters;
pub mod compensate;
pub mod foreign;
pub mod gather;
pub mod ism;
mod openness;
pub mod pictures;
pub mod points;
pub mod rsm;
mod settings;
mod slots;
pub mod sources;
mod vpl;
pub mod vpls;

pub use openness::{Openness, SkyView};
pub use settings::{IndirectSettings, IrradianceFilter, IsmResolution, Technique, VplSampling};
pub use slots::{LitBy, SCATTERED, SETS, SOURCES, Slots};
pub use vpl::Vpl;

use std::f32::consts::PI;

use glam::{Vec3, Vec4};

use crate::frame::LightData;

/// Mean albedo that the ambient estimate assumes.
const MEAN_ALBEDO: f32 = 0.5;
/// Least share of a sun's light that gets into a building: openings may be smaller than voxels.
const LEAST_OPEN: f32 = 0.08;
/// A lamp stands within the room, so half of its light's first bounce comes from beside and behind it.
const LAMP_AHEAD: f32 = 0.5;

/// Irradiance over π that stands in for indirect light, at the eye and taken for the whole scene: for red, green and blue
/// the gradient along the normal, then the mean; nits. Nowhere negative.
///
/// In a sphere of area A and albedo ρ, of which a share V is open, a flux Φ makes a first bounce of mean radiance
/// Φρ / (πA), and all further ones ρ(1 − V) / (1 − ρ(1 − V)) times as much (integrating sphere; Goebel 1967). The
/// first comes from the half that light shines at, the rest from everywhere; the irradiance of a uniform half sphere
/// is exactly linear in the cosine between its axis and the normal. A bias by design: no occlusion, no colour
/// bleeding, and the air is equally bright everywhere.
///
/// `open` is the share of the sky that the eye sees; `environment` the mean radiance of an environment map in nits, and the
/// share of it that arrives. Of the sky's own light only what arrives straight is taken, not what bounces.
pub fn ambient(
    settings: &IndirectSettings,
    lights: &[LightData],
    bounds_ws: (Vec3, Vec3),
    open: f32,
    environment: Option<(Vec3, f32)>,
) -> [Vec4; 3] {
    let mut radiance = [Vec4::ZERO; 3];
    if settings.technique == Technique::None {
        return radiance;
    }
    // What lamps give the first surface, and what that scatters, virtual lights bring.
    let lights = if settings.technique.makes_vpls() { &[] } else { lights };
    let environment = environment.filter(|_| !settings.scatters());
    let size = bounds_ws.1 - bounds_ws.0;
    // Even a point or a line has a surface here.
    let size = if size == Vec3::ZERO { Vec3::ONE } else { size.max(Vec3::splat(1e-3 * size.max_element())) };
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let mut add = |color: Vec3, mean: f32, gradient: Vec3| {
        for (sum, nits) in radiance.iter_mut().zip(color.to_array()) {
            *sum += nits * gradient.extend(mean);
        }
    };
    let again = |closed: f32| MEAN_ALBEDO * closed / (1.0 - MEAN_ALBEDO * closed);
    for light in lights {
        let intensity = Vec3::from(light.intensity);
        let (flux, ahead, closed) = if light.kind == LightData::DIRECTIONAL {
            (0.25 * area * open.max(LEAST_OPEN), 1.0, 1.0 - open)
        } else {
            // A cone's mean direction is shorter the wider it is; a point's is none.
            let cosine = light.cone_rad.cos();
            (2.0 * PI * (1.0 - cosine), LAMP_AHEAD * 0.5 * (1.0 + cosine), 1.0)
        };
        let first = flux * MEAN_ALBEDO / (PI * area);
        // A surface that faces the way light travels sees the half that is lit.
        add(intensity, first * (1.0 + again(closed)), first * ahead * Vec3::from(light.direction_ws));
    }
    if let Some((mean, arriving)) = environment {
        add(mean, arriving * again(1.0 - arriving), Vec3::ZERO);
    }
    radiance
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: (Vec3, Vec3) = (Vec3::ZERO, Vec3::splat(10.0));

    fn settings() -> IndirectSettings {
        IndirectSettings { technique: Technique::Ambient, ..IndirectSettings::default() }
    }

    fn sun() -> LightData {
        LightData {
            kind: LightData::DIRECTIONAL,
            direction_ws: [0.0, -1.0, 0.0],
            intensity: [100_000.0; 3],
            ..bytemuck::Zeroable::zeroed()
        }
    }

    fn towards(radiance: &[Vec4; 3], normal: Vec3) -> f32 {
        radiance[1].dot(normal.extend(1.0))
    }

    #[test]
    fn under_an_open_sky_a_face_downwards_sees_the_lit_ground_and_one_upwards_nothing_of_it() {
        let bounced = ambient(&settings(), &[sun()], BOUNDS, 1.0, None);
        assert!(towards(&bounced, Vec3::Y).abs() < 1e-2, "{bounced:?}");
        assert!(towards(&bounced, Vec3::NEG_Y) > 1000.0, "{bounced:?}");
    }

    #[test]
    fn an_environment_bounces_only_inside() {
        let with = |share| ambient(&settings(), &[], BOUNDS, share, Some((Vec3::ONE, share)));
        assert_eq!(with(1.0), [Vec4::ZERO; 3]);
        let inside = towards(&with(0.1), Vec3::Y);
        assert!(inside > 0.0 && inside < 0.1, "{inside}");
    }

    #[test]
    fn no_direction_is_darker_than_black() {
        let bounced = ambient(&settings(), &[sun()], (Vec3::ZERO, Vec3::ONE), 0.01, None);
        for channel in bounced {
            assert!(channel.truncate().length() <= channel.w * 1.0001, "{bounced:?}");
        }
    }
}
