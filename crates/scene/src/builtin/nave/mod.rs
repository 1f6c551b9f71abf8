//! A Gothic nave of seven bays with aisles, clerestory and ribbed vaults.
//!
//! Axes: the nave runs along Z, the altar at −Z (east), so south is +X. The floor is at y = 0. Every bay uses the
//! same few meshes; the north side is the south side turned by half a turn, not mirrored.

mod furniture;
mod light;
mod materials;
mod piers;
mod shell;
#[cfg(test)]
mod tests;
mod tracery;
mod vaults;
mod walls;

use glam::{Vec3, vec3};

use super::stage::Stage;
use crate::{Id, Scene};

/// Length of a bay, metres. A half is exact in binary, so that neighbouring bays meet exactly.
const BAY: f32 = 5.5;
/// Number of bays.
const BAYS: usize = 7;
/// The end walls' inner faces are at ±this.
const HALF_LENGTH: f32 = BAY * BAYS as f32 / 2.0;
/// Thickness of the end walls.
const END_WALL: f32 = 1.2;
/// Arcade and clerestory wall: inner and outer face, metres from the axis.
const NAVE_WALL: [f32; 2] = [4.05, 4.95];
/// Line of the piers.
const PIER: f32 = 4.5;
/// Aisle wall: inner and outer face.
const AISLE_WALL: [f32; 2] = [9.0, 9.9];
/// The middle of the aisle.
const AISLE_AXIS: f32 = f32::midpoint(NAVE_WALL[1], AISLE_WALL[0]);
/// The arcade's and the aisle vaults' springing.
const ARCADE_SPRINGING: f32 = 5.2;
/// Where the arcade wall ends and the clerestory begins.
const CLERESTORY: f32 = 9.5;
/// The nave vault's springing and crown.
const VAULT: [f32; 2] = [9.5, 15.8];
/// Crown of the aisle vaults.
const AISLE_CROWN: f32 = 8.6;
/// Aisle walls end inside the roof at this height.
const AISLE_WALL_TOP: f32 = 9.2;
/// Nave walls end inside the roof at this height.
const NAVE_WALL_TOP: f32 = 16.6;
/// Walls reach this far below the floor.
const FOOTING: f32 = -0.25;

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("nave");
    place(&mut stage);
    stage.scene
}

/// Puts the nave with its lights and cameras on a stage.
pub fn place(stage: &mut Stage) {
    let m = materials::Palette::new(stage);

    shell::place(stage, &m);
    furniture::place(stage, &m);

    let piers = piers::meshes(stage, &m);
    for line in 0..=BAYS {
        for mesh in piers {
            on_both_sides(stage, mesh, -HALF_LENGTH + BAY * line as f32);
        }
    }
    let sides = [
        stage.mesh("arcade bay", walls::arcade(&m)),
        stage.mesh("clerestory bay", walls::clerestory(&m)),
        stage.mesh("aisle wall bay", walls::aisle(&m)),
        stage.mesh("aisle vault", vaults::aisle(&m)),
    ];
    let vault = stage.mesh("nave vault", vaults::nave(&m));
    for bay in 0..BAYS {
        let z = -HALF_LENGTH + BAY * (bay as f32 + 0.5);
        for mesh in sides {
            on_both_sides(stage, mesh, z);
        }
        stage.place(vault, vec3(0.0, 0.0, z), false);
    }
    let transverse = [
        stage.mesh("nave transverse rib", vaults::nave_transverse(&m)),
        stage.mesh("aisle transverse rib", vaults::aisle_transverse(&m)),
    ];
    for line in 0..=BAYS {
        let z = -HALF_LENGTH + BAY * line as f32;
        stage.place(transverse[0], vec3(0.0, 0.0, z), false);
        on_both_sides(stage, transverse[1], z);
    }
    light::place(stage);
}

/// Places a mesh made for the south side there and, turned, on the north side.
fn on_both_sides(stage: &mut Stage, mesh: Id, z: f32) {
    stage.place(mesh, Vec3::new(0.0, 0.0, z), false);
    stage.place(mesh, Vec3::new(0.0, 0.0, z), true);
}
