//! Two rooms and a door between them that opens: the light of the one reaches the other all at once.

use glam::{Quat, Vec3, vec3};

use super::{
    shape::{block, cuboid},
    stage::{Stage, plain, spot},
};
use crate::{Animation, Channel, Interpolation, Keys, LightKind, Scene};

/// Inside of each room, metres: from the wall between them outwards, up, and to both sides of the doorway.
const DEPTH: f32 = 4.0;
const HEIGHT: f32 = 2.6;
const SIDE: f32 = 2.0;
/// Thick enough that no shadow bias leaks through.
const WALL: f32 = 0.2;
/// Half of the doorway's width, and its height.
const DOORWAY: [f32; 2] = [0.5, 2.1];
/// The door is wider than the doorway by so much on each side, and so thick.
const REBATE: f32 = 0.08;
const THICK: f32 = 0.05;

/// When the door begins to open, is open, begins to close and is closed, and when all begins anew, seconds.
const TIMES_S: [f32; 5] = [1.0, 2.0, 4.0, 5.0, 6.0];
const OPEN_DEG: f32 = 105.0;
/// Keys a second.
const RATE: f32 = 16.0;

/// Builds the scene: the lit room at −X, the other, with the camera, at +X.
pub fn build() -> Scene {
    let mut stage = Stage::new("door");
    let white = stage.material(plain("plaster", vec3(0.74, 0.72, 0.68), 0.9));
    let warm = stage.material(plain("ochre", vec3(0.70, 0.42, 0.14), 0.9));
    let blue = stage.material(plain("blue", vec3(0.16, 0.28, 0.52), 0.9));
    let wood = stage.material(plain("wood", vec3(0.42, 0.27, 0.15), 0.7));

    let (x, out) = (DEPTH + WALL / 2.0, WALL + SIDE);
    let end = x + WALL;
    // Floor and ceiling reach over the walls' ends, so that corners are closed from outside too.
    stage.body("floor", cuboid(vec3(-end, -WALL, -out), vec3(end, 0.0, out), white));
    stage.body("ceiling", cuboid(vec3(-end, HEIGHT, -out), vec3(end, HEIGHT + WALL, out), white));
    stage.body("lit end", cuboid(vec3(-end, 0.0, -out), vec3(-x, HEIGHT, out), warm));
    stage.body("dark end", cuboid(vec3(x, 0.0, -out), vec3(end, HEIGHT, out), white));
    stage.body("left", cuboid(vec3(-x, 0.0, -out), vec3(x, HEIGHT, -SIDE), white));
    stage.body("right", cuboid(vec3(-x, 0.0, SIDE), vec3(x, HEIGHT, out), blue));
    let [half, top] = DOORWAY;
    let between = |lo: Vec3, hi: Vec3| cuboid(lo.with_x(-WALL / 2.0), hi.with_x(WALL / 2.0), white);
    stage.body("wall left of the door", between(vec3(0.0, 0.0, -SIDE), vec3(0.0, HEIGHT, -half)));
    stage.body("wall right of the door", between(vec3(0.0, 0.0, half), vec3(0.0, HEIGHT, SIDE)));
    stage.body("wall over the door", between(vec3(0.0, top, -half), vec3(0.0, HEIGHT, half)));
    stage.body("plinth", block(vec3(0.6, 0.8, 0.6), 25.0, vec3(1.5, 0.0, -1.2), white));
    stage.body("chest", block(vec3(0.9, 0.5, 0.5), -12.0, vec3(2.2, 0.0, 1.3), wood));

    // The door, about its hinge.
    let leaf = cuboid(vec3(0.0, 0.0, 0.0), vec3(THICK, top + REBATE, 2.0 * (half + REBATE)), wood);
    let leaf = stage.mesh("door", leaf);
    let hinge = vec3(WALL / 2.0 + 0.005, 0.005, -half - REBATE);
    let door = stage.place_turned(leaf, hinge, 0.0, 1.0);

    // At the lit room's far end, so that all that comes through the doorway has bounced.
    let lamp = vec3(-1.6, HEIGHT - 0.1, 0.0);
    stage.light("lamp", spot(30.0, 42.0), vec3(1.0, 0.9, 0.76), 1500.0, lamp, vec3(-4.1, 0.7, 0.0));
    let night = vec3(0.6, 0.75, 1.0);
    let corner = vec3(3.7, HEIGHT - 0.2, 1.7);
    stage.light("night light", LightKind::Point, night, 1.5, corner, corner - Vec3::Y);
    stage.camera("door", vec3(3.8, 1.5, 0.9), vec3(0.0, 1.1, -0.3), 62.0);
    stage.camera("lit room", vec3(-0.4, 1.6, 1.6), vec3(-3.6, 0.9, -0.6), 62.0);

    let times_s: Vec<f32> = (0..=(TIMES_S[4] * RATE) as usize).map(|k| k as f32 / RATE).collect();
    let turn = |t: &f32| Quat::from_rotation_y((OPEN_DEG * opened(*t)).to_radians());
    let keys = Keys::Rotation(times_s.iter().map(turn).collect());
    let channel = Channel { node: door, times_s, interpolation: Interpolation::Linear, keys };
    stage.scene.animations.push(Animation { name: "door".to_owned(), channels: vec![channel] });
    stage.scene
}

/// How far the door is open, 0..1: from rest to rest.
fn opened(time_s: f32) -> f32 {
    let [opens, open, closes, closed, _] = TIMES_S;
    let share =
        ((time_s - opens) / (open - opens)).min((closed - time_s) / (closed - closes)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}
