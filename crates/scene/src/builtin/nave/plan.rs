//! The nave's measures, and its symmetry.

use glam::Vec3;

use super::super::stage::Stage;
use crate::Id;

/// Length of a bay, metres. A half is exact in binary, so that neighbouring bays meet exactly.
pub const BAY: f32 = 5.5;
/// Number of bays.
pub const BAYS: usize = 7;
/// The end walls' inner faces are at ±this.
pub const HALF_LENGTH: f32 = BAY * BAYS as f32 / 2.0;
/// Thickness of the end walls.
pub const END_WALL: f32 = 1.2;
/// Arcade and clerestory wall: inner and outer face, metres from the axis.
pub const NAVE_WALL: [f32; 2] = [4.05, 4.95];
/// Line of the piers.
pub const PIER: f32 = 4.5;
/// Aisle wall: inner and outer face.
pub const AISLE_WALL: [f32; 2] = [9.0, 9.9];
/// The middle of the aisle.
pub const AISLE_AXIS: f32 = f32::midpoint(NAVE_WALL[1], AISLE_WALL[0]);
/// The arcade's and the aisle vaults' springing.
pub const ARCADE_SPRINGING: f32 = 5.2;
/// Where the arcade wall ends and the clerestory begins.
pub const CLERESTORY: f32 = 9.5;
/// The nave vault's springing and crown.
pub const VAULT: [f32; 2] = [9.5, 15.8];
/// Crown of the aisle vaults.
pub const AISLE_CROWN: f32 = 8.6;
/// Aisle walls end inside the roof at this height.
pub const AISLE_WALL_TOP: f32 = 9.2;
/// Nave walls end inside the roof at this height.
pub const NAVE_WALL_TOP: f32 = 16.6;
/// Walls reach this far below the floor.
pub const FOOTING: f32 = -0.25;

/// Places a mesh made for the south side there and, turned, on the north side.
pub fn on_both_sides(stage: &mut Stage, mesh: Id, z: f32) {
    stage.place(mesh, Vec3::new(0.0, 0.0, z), false);
    stage.place(mesh, Vec3::new(0.0, 0.0, z), true);
}
