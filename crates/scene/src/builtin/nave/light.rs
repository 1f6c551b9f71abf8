//! Sun, spots and cameras.

use glam::{Vec3, vec3};

use super::super::stage::{Stage, spot};
use super::plan::{BAY, HALF_LENGTH};
use crate::LightKind;

/// Places lights and cameras.
pub fn place(stage: &mut Stage) {
    // Late on a hazy afternoon, from the south-west: beams fall through the southern clerestory onto the north piers
    // and the floor before them, and light the sides that the main camera sees.
    let sun = vec3(1.0, 1.3, 0.9);
    stage.light("sun", LightKind::Directional, vec3(1.0, 0.88, 0.72), 25_000.0, sun * 40.0, Vec3::ZERO);

    let warm = vec3(1.0, 0.66, 0.36);
    let altar = vec3(0.0, 1.6, -16.4);
    for side in [-1.0, 1.0] {
        let from = vec3(side * 3.6, 9.3, -10.4);
        stage.light("altar spot", spot(9.0, 17.0), warm, 60_000.0, from, altar);
        let from = vec3(side * 3.4, 1.2, -14.2);
        stage.light("choir spot", spot(20.0, 50.0), warm, 15_000.0, from, vec3(side * 0.8, 14.0, -18.6));
    }

    // Hidden on the string course, as in many a church: they show the vaults.
    let white = vec3(1.0, 0.78, 0.54);
    for side in [-1.0, 1.0] {
        for line in 2..=5 {
            let z = BAY * line as f32 - HALF_LENGTH;
            let from = vec3(side * 3.3, 9.4, z);
            stage.light("vault spot", spot(25.0, 70.0), white, 22_000.0, from, vec3(side * 1.2, 15.0, z));
        }
    }

    let end = HALF_LENGTH;
    stage.camera("nave", vec3(0.7, 1.75, end - 2.2), vec3(-0.5, 6.0, -end), 48.0);
    stage.camera("high", vec3(1.5, 9.0, end - 1.5), vec3(-0.9, 4.6, -6.0), 56.0);
    stage.camera("aisle", vec3(-7.9, 1.7, 6.5), vec3(-2.0, 3.6, -7.0), 50.0);
}
