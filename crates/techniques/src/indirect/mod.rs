//! Indirect light. So far a constant: [`Technique::Ambient`] stands in for what bounces, until imperfect shadow maps do
//! it right.

use glam::Vec3;

use crate::shared::frame::LightData;
use crate::{choice, settings};

choice! {
    /// Where indirect light comes from.
    pub enum Technique {
        /// A uniform environment as bright as the scene's lights would make a closed grey room of its size.
        Ambient = "ambient",
        /// None: direct light only.
        None = "none",
    }
}

settings! {
    /// Indirect light.
    pub struct IndirectSettings: "indirect" {
        /// Where indirect light comes from.
        technique: Technique = Technique::Ambient, "", (), Uniform;
    }
}

/// Mean albedo that the ambient estimate assumes.
const MEAN_ALBEDO: f32 = 0.5;
/// Share of a sun's light that gets past the edges of a building's openings, or bounces off open ground.
const SUN_SHARE: f32 = 0.05;
/// A clear sky's mean luminance per lux of sun, tinted as Rayleigh scattering does (about 6,000 nits at 100,000 lx).
const SKY_PER_LUX: Vec3 = Vec3::new(0.042, 0.062, 0.095);

/// Radiance of the uniform environment, and of the sky behind everything, nits.
///
/// In a closed sphere of area A and albedo ρ a flux Φ settles at a uniform radiance Φρ / (π A (1 − ρ)) (integrating
/// sphere; Goebel 1967). A bias by design: no occlusion, no colour bleeding, one value for the whole scene.
pub fn ambient(settings: &IndirectSettings, lights: &[LightData], bounds_ws: (Vec3, Vec3)) -> (Vec3, Vec3) {
    if settings.technique == Technique::None {
        return (Vec3::ZERO, Vec3::ZERO);
    }
    let size = (bounds_ws.1 - bounds_ws.0).max(Vec3::splat(1e-3));
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let mut flux = Vec3::ZERO;
    let mut sun = Vec3::ZERO;
    for light in lights {
        let intensity = Vec3::from(light.intensity);
        if light.kind == LightData::DIRECTIONAL {
            sun += intensity;
            flux += intensity * (0.25 * area * SUN_SHARE);
        } else {
            let solid_angle = 2.0 * std::f32::consts::PI * (1.0 - light.cone_rad.cos());
            flux += intensity * solid_angle;
        }
    }
    let ambient = flux * (MEAN_ALBEDO / (std::f32::consts::PI * area * (1.0 - MEAN_ALBEDO)));
    (ambient, sun.max(Vec3::ZERO).element_sum() / 3.0 * SKY_PER_LUX)
}
