//! Surroundings by code: a clear sky and a photographer's studio.

use std::f32::consts::{PI, TAU};

use glam::{Mat3, Vec2, Vec3, vec2, vec3};

use crate::Environment;

/// Cosine of the angle to the zenith below which colour stays the same.
const COLOR_HORIZON: f32 = 0.17;
/// Pixels around and from top to bottom.
const SIZE: [u32; 2] = [256, 128];

/// A cloudless sky without its sun, which is a light of its own, over flat ground.
///
/// Luminance is spread as in the CIE standard clear sky (ISO 15469:2004, type 12). Colour is that of Preetham, Shirley,
/// Smits 1999, "A Practical Analytic Model for Daylight", appendix A.2; near the horizon, where their fit turns pink,
/// it is the colour at [`COLOR_HORIZON`].
#[derive(Clone, Copy, Debug)]
pub struct ClearSky {
    /// Unit vector, above the horizon.
    pub towards_sun: Vec3,
    /// Haze, which takes blue away: 2 after rain, 3 clear, 6 hazy.
    pub turbidity: f32,
    /// Illuminance by the sun alone on a surface that faces it, lux. It lights the ground.
    pub sun_lux: f32,
    /// Illuminance by the sky alone on level ground, lux.
    pub sky_lux: f32,
    /// Linear albedo of the ground.
    pub ground: Vec3,
}

impl ClearSky {
    /// A clear afternoon over open land.
    pub fn afternoon() -> Self {
        Self {
            towards_sun: Vec3::new(-0.80, 0.50, -0.28).normalize(),
            turbidity: 3.0,
            sun_lux: 82_000.0,
            sky_lux: 13_500.0,
            ground: Vec3::new(0.16, 0.15, 0.09),
        }
    }

    /// The sky and the sunlit ground as seen from the middle.
    pub fn environment(&self, name: &str) -> Environment {
        let mut out = paint(name, |d| if d.y > 0.0 { self.radiance(d) } else { Vec3::ZERO });
        let level = self.sky_lux / horizontal_lux(&out).max(f32::MIN_POSITIVE);
        let ground = self.ground * (self.sky_lux + self.sun_lux * self.towards_sun.y.max(0.0)) / PI;
        for (i, radiance) in out.radiance.iter_mut().enumerate() {
            let d = direction(i as u32 % SIZE[0], i as u32 / SIZE[0]);
            // Far ground lies in the haze: it takes on the colour of the sky above it.
            if d.y > 0.0 {
                *radiance *= level;
            } else {
                let horizon = self.radiance(vec3(d.x, 0.01, d.z).normalize()) * level;
                *radiance = ground.lerp(horizon, (d.y * 14.0).exp());
            }
        }
        out
    }

    /// Radiance from `d`, a unit vector above the horizon, relative to others.
    fn radiance(&self, d: Vec3) -> Vec3 {
        let t = self.turbidity;
        let x = [
            -0.0193 * t - 0.2592,
            -0.0665 * t + 0.0008,
            -0.0004 * t + 0.2125,
            -0.0641 * t - 0.8989,
            -0.0033 * t + 0.0452,
        ];
        let y = [
            -0.0167 * t - 0.2608,
            -0.0950 * t + 0.0092,
            -0.0079 * t + 0.2102,
            -0.0441 * t - 1.6537,
            -0.0109 * t + 0.0529,
        ];
        let sun = self.towards_sun.y.clamp(0.0, 1.0).acos();
        let powers = |a: f32, b: f32, c: f32, d: f32| ((a * sun + b) * sun + c) * sun + d;
        let zenith_x = t * t * powers(0.00166, -0.00375, 0.00209, 0.0)
            + t * powers(-0.02903, 0.06377, -0.03202, 0.00394)
            + powers(0.11693, -0.21196, 0.06052, 0.25886);
        let zenith_y = t * t * powers(0.00275, -0.00610, 0.00317, 0.0)
            + t * powers(-0.04214, 0.08970, -0.04153, 0.00516)
            + powers(0.15346, -0.26756, 0.06670, 0.26688);
        let gamma = d.dot(self.towards_sun).clamp(-1.0, 1.0).acos();
        let relative = |c: &[f32; 5]| perez(c, d.y.max(COLOR_HORIZON), gamma) / perez(c, 1.0, sun);
        // The standard's gradation and indicatrix. It divides by the cosine of the angle to the zenith.
        let gradation = 1.0 - (-0.32 / d.y.max(0.01)).exp();
        let indicatrix = 1.0 + 10.0 * ((-3.0 * gamma).exp() - (-1.5 * PI).exp()) + 0.45 * gamma.cos().powi(2);
        from_xyy(zenith_x * relative(&x), zenith_y * relative(&y), gradation * indicatrix)
    }
}

/// Perez, Seals, Michalsky 1993, equation 1, by the angles' cosine to the zenith and the angle to the sun.
fn perez([a, b, c, d, e]: &[f32; 5], cos: f32, gamma: f32) -> f32 {
    (1.0 + a * (b / cos).exp()) * (1.0 + c * (d * gamma).exp() + e * gamma.cos().powi(2))
}

/// CIE xyY to linear Rec. 709, colours outside its gamut brought to its border.
fn from_xyy(x: f32, y: f32, luminance: f32) -> Vec3 {
    let xyz = vec3(x / y, 1.0, (1.0 - x - y) / y) * luminance;
    let rec709_from_xyz = Mat3::from_cols(
        vec3(3.240_97, -0.969_244, 0.055_63),
        vec3(-1.537_383, 1.875_968, -0.203_977),
        vec3(-0.498_611, 0.041_555, 1.056_972),
    );
    (rec709_from_xyz * xyz).max(Vec3::ZERO)
}

/// A rectangular lamp, far enough to be the same for the whole scene.
#[derive(Clone, Copy, Debug)]
pub struct SoftBox {
    /// Direction of its middle, any length.
    pub towards: Vec3,
    /// Half its width and height as tangents: 1 is 45°.
    pub half: Vec2,
    /// Linear Rec. 709 radiance, nits.
    pub nits: Vec3,
}

/// A room with soft boxes: `ceiling` straight above, `walls` at eye height, `floor` straight below, nits.
pub fn studio(name: &str, [ceiling, walls, floor]: [Vec3; 3], boxes: &[SoftBox]) -> Environment {
    paint(name, |d| {
        let room = walls.lerp(if d.y > 0.0 { ceiling } else { floor }, d.y.abs());
        boxes.iter().fold(room, |radiance, lamp| radiance.lerp(lamp.nits, lamp.coverage(d)))
    })
}

impl SoftBox {
    /// 1 inside, 0 outside, with an edge about two pixels wide.
    fn coverage(&self, d: Vec3) -> f32 {
        let middle = self.towards.normalize_or(Vec3::Y);
        let right = Vec3::Y.cross(middle).normalize_or(Vec3::X);
        let depth = d.dot(middle);
        if depth <= 0.0 {
            return 0.0;
        }
        let at = vec2(d.dot(right), d.dot(middle.cross(right))) / depth;
        let inside = (self.half - at.abs()) / (2.0 * TAU / SIZE[0] as f32) + 0.5;
        inside.clamp(Vec2::ZERO, Vec2::ONE).element_product()
    }
}

/// The unit direction of a pixel's middle, as [`Environment::radiance`] says.
fn direction(x: u32, y: u32) -> Vec3 {
    let (u, v) = ((x as f32 + 0.5) / SIZE[0] as f32, (y as f32 + 0.5) / SIZE[1] as f32);
    let (around, down) = (TAU * u, PI * v);
    vec3(down.sin() * around.sin(), down.cos(), -down.sin() * around.cos())
}

fn paint(name: &str, radiance: impl Fn(Vec3) -> Vec3) -> Environment {
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| direction(x, y)));
    Environment {
        name: name.to_owned(),
        width: SIZE[0],
        height: SIZE[1],
        radiance: pixels.map(radiance).collect(),
    }
}

/// Illuminance by what is above the horizon on level ground, lux (Rec. 709 luminance).
pub fn horizontal_lux(environment: &Environment) -> f32 {
    let (width, height) = (environment.width, environment.height);
    let pixel = |i: usize| {
        let d = direction(i as u32 % width, i as u32 / width);
        let solid_angle = (1.0 - d.y * d.y).max(0.0).sqrt() * (TAU / width as f32) * (PI / height as f32);
        environment.radiance[i].dot(vec3(0.2126, 0.7152, 0.0722)) * d.y.max(0.0) * solid_angle
    };
    (0..environment.radiance.len()).map(pixel).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sky(elevation_deg: f32) -> Environment {
        let e = elevation_deg.to_radians();
        let towards_sun = vec3(e.cos(), e.sin(), 0.0);
        let ground = Vec3::splat(0.2);
        ClearSky { towards_sun, turbidity: 3.0, sun_lux: 90_000.0, sky_lux: 14_000.0, ground }
            .environment("sky")
    }

    #[test]
    fn the_sky_lights_the_ground_as_told_and_the_ground_sends_a_fifth_back() {
        for elevation_deg in [10.0f32, 40.0, 70.0] {
            let environment = sky(elevation_deg);
            let lux = horizontal_lux(&environment);
            assert!((lux / 14_000.0 - 1.0).abs() < 0.01, "{lux} lx at {elevation_deg}°");
            let below = environment.radiance.last().expect("pixels").y;
            let expected = 0.2 * (14_000.0 + 90_000.0 * elevation_deg.to_radians().sin()) / PI;
            assert!(
                (below / expected - 1.0).abs() < 0.01,
                "{below} nits at {elevation_deg}°, not {expected}"
            );
        }
    }

    #[test]
    fn the_sky_is_blue_away_from_the_sun_and_brightest_beside_it() {
        let environment = sky(40.0);
        let at = |d: Vec3| {
            let d = d.normalize();
            let (u, v) = ((d.x.atan2(-d.z) / TAU).rem_euclid(1.0), d.y.acos() / PI);
            let (x, y) = ((u * SIZE[0] as f32) as u32, (v * SIZE[1] as f32) as u32);
            environment.radiance[(y * SIZE[0] + x) as usize]
        };
        let away = at(vec3(-0.6, 1.0, 0.0));
        assert!(away.z > 1.8 * away.x, "{away}");
        let horizon = at(vec3(-1.0, 0.03, 0.0));
        assert!(horizon.x < horizon.y && horizon.y < horizon.z, "{horizon}");
        let beside = at(vec3(40f32.to_radians().cos(), 40f32.to_radians().sin(), 0.0));
        let brightest = environment.radiance.iter().map(|r| r.y).fold(0.0, f32::max);
        assert!(
            beside.y > 0.8 * brightest && beside.y > 3.0 * away.y,
            "{beside} of {brightest}, away {away}"
        );
    }

    #[test]
    fn a_soft_box_is_where_it_was_put() {
        let lamp = SoftBox { towards: vec3(1.0, 1.0, 1.0), half: vec2(0.2, 0.4), nits: Vec3::splat(500.0) };
        let environment = studio("studio", [Vec3::ZERO; 3], &[lamp]);
        let mean: Vec3 = (0..environment.radiance.len())
            .map(|i| direction(i as u32 % SIZE[0], i as u32 / SIZE[0]) * environment.radiance[i].y)
            .sum();
        assert!(mean.normalize().dot(Vec3::ONE.normalize()) > 0.99, "{mean}");
    }
}
