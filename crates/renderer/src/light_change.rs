//! How much lamps have changed from frame to frame.

use chiaro_techniques::frame::LightData;
use glam::Vec3;

/// A sun that turns so far lights other places, radians.
const SUN_TURN_RAD: f32 = 0.2;
/// Lamps of this share of all power count fully: what they shine at may be all that is seen.
const COUNTS_FULLY: f32 = 0.1;
/// A lamp that goes so far lights other places, of the scene's size.
const LAMP_STEP: f32 = 0.1;

/// How much of the light of two frames' lamps may be other light, 0..1: of each lamp by how far its intensity changed, it turned, by
/// its cone's size, and it went, by the scene's; less of those that have next to no power among all. Of lamps that come or go all is.
pub(crate) fn light_change(before: &[LightData], now: &[LightData], scene_m: f32) -> f32 {
    if before.len() != now.len() {
        return 1.0;
    }
    let pairs = || before.iter().zip(now);
    let strength = |(before, now): (&LightData, &LightData)| power(before, scene_m).max(power(now, scene_m));
    let all: f32 = pairs().map(strength).sum();
    let counts = |pair| (strength(pair) / (COUNTS_FULLY * all)).min(1.0);
    let changed: f32 = pairs().map(|pair| counts(pair) * change(pair, scene_m)).sum();
    if all > 0.0 { changed.min(1.0) } else { 0.0 }
}

/// Lumens, roughly.
fn power(light: &LightData, scene_m: f32) -> f32 {
    let intensity = Vec3::from(light.intensity).max_element().max(0.0);
    let cosine = light.cone_rad.cos();
    match light.kind {
        LightData::DIRECTIONAL => intensity * scene_m * scene_m,
        LightData::SPOT => intensity * std::f32::consts::TAU * (1.0 - cosine),
        _ => intensity * 2.0 * std::f32::consts::TAU,
    }
}

fn change((before, now): (&LightData, &LightData), scene_m: f32) -> f32 {
    if before.kind != now.kind {
        return 1.0;
    }
    let [was, is] = [before, now].map(|light| Vec3::from(light.intensity));
    let brightness = (is - was).abs().max_element() / is.max(was).max_element().max(f32::MIN_POSITIVE);
    let angle = Vec3::from(before.direction_ws).angle_between(Vec3::from(now.direction_ws));
    let turn = match now.kind {
        LightData::DIRECTIONAL => angle / SUN_TURN_RAD,
        LightData::SPOT => angle / now.cone_rad.max(1e-3) + (now.cone_rad - before.cone_rad).abs(),
        _ => 0.0,
    };
    let went = Vec3::from(before.position_ws).distance(Vec3::from(now.position_ws));
    let step = if now.kind == LightData::DIRECTIONAL { 0.0 } else { went / (LAMP_STEP * scene_m) };
    let sum = brightness + turn + step;
    // What is no number is another light.
    if sum < 1.0 { sum } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spot(candela: f32, towards: Vec3) -> LightData {
        LightData {
            kind: LightData::SPOT,
            direction_ws: towards.normalize().to_array(),
            intensity: [candela; 3],
            cone_rad: 0.5,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    fn near(found: f32, expected: f32) {
        assert!((found - expected).abs() < 2e-3, "{found}, not {expected}");
    }

    #[test]
    fn what_rests_changes_nothing_and_what_turns_goes_or_dims_does_by_how_much() {
        let lamp = spot(10.0, Vec3::NEG_Y);
        let turned = spot(10.0, Vec3::new(0.1, -1.0, 0.0));
        near(light_change(&[lamp], &[lamp], 10.0), 0.0);
        near(light_change(&[], &[], 10.0), 0.0);
        near(light_change(&[lamp], &[turned], 10.0), 0.1 / 0.5);
        near(light_change(&[lamp], &[spot(5.0, Vec3::NEG_Y)], 10.0), 0.5);
        near(light_change(&[lamp], &[LightData { position_ws: [0.0, 0.1, 0.0], ..lamp }], 10.0), 0.1);
        // Among others it may be all that is seen, unless it is a candle.
        near(light_change(&[lamp, lamp], &[turned, lamp], 10.0), 0.2);
        let sun = spot(990.0, Vec3::NEG_Y);
        near(light_change(&[lamp, sun], &[turned, sun], 10.0), 0.02);
    }

    #[test]
    fn what_jumps_comes_or_goes_is_other_light() {
        let lamp = spot(10.0, Vec3::NEG_Y);
        near(light_change(&[lamp], &[spot(10.0, Vec3::Y)], 10.0), 1.0);
        near(light_change(&[lamp], &[], 10.0), 1.0);
        near(light_change(&[lamp], &[LightData { kind: LightData::POINT, ..lamp }], 10.0), 1.0);
        near(light_change(&[lamp], &[LightData { intensity: [f32::NAN; 3], ..lamp }], 10.0), 1.0);
    }
}
