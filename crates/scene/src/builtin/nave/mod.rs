//! A Gothic nave of seven bays with aisles, clerestory and ribbed vaults.
//!
//! Axes: the nave runs along Z, the altar at −Z (east), so south is +X. The floor is at y = 0. Every bay uses the
//! same few meshes; the north side is the south side turned by half a turn, not mirrored.

mod furniture;
mod light;
mod materials;
mod piers;
mod plan;
mod shell;
#[cfg(test)]
mod tests;
mod tracery;
mod vaults;
mod walls;

use glam::vec3;

use super::stage::Stage;
use crate::Scene;
use plan::{BAY, BAYS, HALF_LENGTH, on_both_sides};

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
