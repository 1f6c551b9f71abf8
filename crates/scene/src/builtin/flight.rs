//! The nave at dusk: a flight through it after a searching spot light.

use glam::{Mat3, Quat, Vec3, vec3};

use super::{
    nave,
    sky::studio,
    stage::{Stage, spot},
};
use crate::{Animation, Channel, Id, Interpolation, Keys, LightKind, Scene};

/// The flight's length, seconds; it ends where it began.
const FLIGHT_S: f32 = 24.0;
/// Keys a second.
const RATE: f32 = 8.0;

/// Along the middle to the choir, back under the vault, through the arcade into the south aisle and back to the west
/// end. Metres; passed at even times.
const WAY: [Vec3; 15] = [
    vec3(-0.2, 1.9, 15.6),
    vec3(-0.5, 2.1, 10.8),
    vec3(-0.8, 2.9, 5.4),
    vec3(-1.0, 4.4, 0.2),
    vec3(-1.3, 6.4, -4.6),
    vec3(-1.2, 8.2, -9.0),
    vec3(0.2, 8.9, -11.6),
    vec3(1.7, 8.3, -9.6),
    vec3(2.1, 6.4, -5.6),
    vec3(2.9, 4.2, -2.2),
    vec3(4.9, 3.1, 0.3),
    vec3(6.9, 2.6, 3.6),
    vec3(6.9, 2.3, 8.2),
    vec3(4.7, 2.1, 11.0),
    vec3(1.8, 1.9, 14.6),
];

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("flight");
    stage.camera("flight", WAY[0], WAY[2], 56.0);
    let flying = stage.scene.nodes.len() - 1;
    // From under the vault's crown at the west end, over the whole length.
    let from = vec3(0.0, 12.6, 13.5);
    let color = vec3(1.0, 0.93, 0.82);
    stage.light("searching spot", spot(6.5, 9.5), color, 300_000.0, from, searched(0.0));
    let searching = stage.scene.nodes.len() - 1;
    nave::place(&mut stage);
    for light in &mut stage.scene.lights {
        match light.kind {
            // The sun is down; the sky's last light still comes from its side.
            LightKind::Directional => {
                light.color = vec3(0.42, 0.60, 1.0);
                light.intensity = 60.0;
            }
            _ if light.name == "vault spot" => light.intensity *= 0.35,
            _ if light.name == "choir spot" => light.intensity *= 0.35,
            _ => {}
        }
    }
    let sky = [vec3(10.0, 17.0, 42.0), vec3(46.0, 44.0, 52.0), vec3(1.5, 1.5, 1.5)];
    stage.scene.environment = Some(studio("dusk", sky, &[]));
    let keys = (FLIGHT_S * RATE) as usize;
    let times_s: Vec<f32> = (0..=keys).map(|k| k as f32 / RATE).collect();
    let channel = |node: Id, keys: Keys| Channel {
        node,
        times_s: times_s.clone(),
        interpolation: Interpolation::Linear,
        keys,
    };
    let towards_light = |t: &f32| looking(searched(*t) - from);
    let channels = vec![
        channel(flying, Keys::Translation(times_s.iter().map(|t| place(*t)).collect())),
        channel(flying, Keys::Rotation(times_s.iter().map(|t| looking(gaze(*t))).collect())),
        channel(searching, Keys::Rotation(times_s.iter().map(towards_light).collect())),
    ];
    stage.scene.animations.push(Animation { name: "flight".to_owned(), channels });
    stage.scene
}

/// Where the eye is: a uniform cubic B-spline, which rounds the corners of [`WAY`] and has an even acceleration.
fn place(time_s: f32) -> Vec3 {
    let n = WAY.len();
    let at = (time_s / FLIGHT_S).rem_euclid(1.0) * n as f32;
    let (i, t) = (at as usize % n, at.fract());
    let mark = |k: usize| WAY[(i + n - 1 + k) % n];
    let weights = [
        (1.0 - t).powi(3),
        3.0 * t.powi(3) - 6.0 * t * t + 4.0,
        -3.0 * t.powi(3) + 3.0 * t * t + 3.0 * t + 1.0,
        t.powi(3),
    ];
    weights.iter().enumerate().map(|(k, weight)| mark(k) * *weight).sum::<Vec3>() / 6.0
}

/// Where the eye looks: ahead, the mean over the next seconds, less steep than the way itself.
fn gaze(time_s: f32) -> Vec3 {
    let here = place(time_s);
    let ahead: Vec3 = (1..=8).map(|k| (place(time_s + 0.35 * k as f32) - here).normalize_or_zero()).sum();
    ahead * vec3(1.0, 0.55, 1.0)
}

/// The spot's target: to and fro over both arcades and the floor, along the whole length.
fn searched(time_s: f32) -> Vec3 {
    let turn = std::f32::consts::TAU * time_s / FLIGHT_S;
    vec3(3.6 * (3.0 * turn).sin(), 2.4 + 2.2 * (2.0 * turn).cos(), -6.0 - 8.0 * turn.cos())
}

/// Rotation of a camera or light that looks along `forward`, which is not vertical.
fn looking(forward: Vec3) -> Quat {
    let back = -forward.normalize_or(Vec3::NEG_Z);
    let right = Vec3::Y.cross(back).normalize_or(Vec3::X);
    Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_closed_and_smooth() {
        let step = 1.0 / RATE;
        let keys = (FLIGHT_S * RATE) as usize;
        assert!(place(0.0).abs_diff_eq(place(FLIGHT_S), 1e-4));
        for k in 0..keys {
            let t = k as f32 * step;
            let speed = place(t).distance(place(t + step)) / step;
            assert!((0.5..6.0).contains(&speed), "{speed} m/s at {t} s");
            let turn = gaze(t).angle_between(gaze(t + step)).to_degrees() / step;
            assert!(turn < 120.0, "{turn} °/s at {t} s");
        }
    }

    #[test]
    fn the_eye_stays_half_a_metre_off_the_stones() {
        let scene = build();
        let mut points = Vec::new();
        for (node, world) in scene.nodes.iter().zip(scene.world_from_node()) {
            for p in node.mesh.iter().flat_map(|m| &scene.meshes[*m].primitives) {
                points.extend(p.positions.iter().map(|v| world.transform_point3(*v)));
            }
        }
        for k in 0..(FLIGHT_S * 4.0) as usize {
            let eye = place(k as f32 / 4.0);
            let nearest = points.iter().map(|p| p.distance_squared(eye)).fold(f32::INFINITY, f32::min).sqrt();
            assert!(nearest > 0.5, "{nearest} m at {} s", k as f32 / 4.0);
        }
    }
}
