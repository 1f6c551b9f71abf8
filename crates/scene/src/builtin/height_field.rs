//! Any height field as a block of land under a clear sky.

use glam::{Vec3, vec2, vec3};

use super::{
    grid::Grid,
    land::cut,
    sky::ClearSky,
    stage::{Stage, plain},
};
use crate::Scene;

/// Thickness of the block below height 0, as a share of its longer side.
const BASE: f32 = 0.02;
/// Near plane of the cameras, as a share of the block's longer side.
const NEAR: f32 = 1e-3;

/// Heights over a rectangle around the vertical axis.
#[derive(Clone, Copy)]
pub struct HeightField<'a> {
    /// The scene's name.
    pub name: &'a str,
    /// Vertices along each side, at least 2.
    pub side: usize,
    /// Extent along X and Z, metres.
    pub size_m: [f32; 2],
    /// Height in metres, not negative, of a vertex by its numbers along +X and +Z.
    pub height: &'a (dyn Fn(usize, usize) -> f32 + Sync),
}

/// A closed block with the field on top, a sun, a sky, and cameras that see all of it, and across it.
pub fn height_field(field: &HeightField<'_>) -> Scene {
    let HeightField { name, side, size_m: [width, length], .. } = *field;
    let mut stage = Stage::new(name);
    let earth = stage.material(plain("earth", vec3(0.36, 0.31, 0.24), 0.95));
    let last = side - 1;
    let top = |x: usize, z: usize| {
        let [u, v] = [x, z].map(|i| i as f32 / last as f32 - 0.5);
        vec3(u * width, (field.height)(x, z), v * length)
    };
    // The first parameter runs along +Z and the second along +X, so that the surface looks up.
    let grid = Grid { columns: side, rows: side, closes: [false; 2] };
    let surface = grid.primitive(earth, false, |z, x| {
        let p = top(x, z);
        (p, vec2(p.x + 0.5 * width, p.z + 0.5 * length))
    });
    let mesh = stage.add(name, vec![surface]);
    let sides = cut(last, top, -BASE * width.max(length), earth).into_mesh(name, |_| false);
    stage.scene.meshes[mesh].primitives.extend(sides.primitives);
    stage.place(mesh, Vec3::ZERO, false);

    let sky = ClearSky::afternoon();
    stage.sun(sky.towards_sun, vec3(1.0, 0.92, 0.80), sky.sun_lux);
    stage.scene.environment = Some(sky.environment("clear afternoon"));
    let size = width.max(length);
    let highest = (0..side).flat_map(|x| (0..side).map(move |z| (field.height)(x, z))).fold(0.0, f32::max);
    let target = Vec3::Y * 0.5 * highest;
    stage.camera("overview", target + vec3(0.60, 0.70, 1.10) * (size + highest), target, 42.0);
    // From the middle of the near edge, a little above the ground, across the land.
    let near = top(side / 2, last);
    let eye = near + vec3(0.0, 0.08 * size, 0.0);
    stage.camera("edge", eye, vec3(0.0, near.y.min(target.y), -0.2 * length), 50.0);
    stage.scene.cameras.iter_mut().for_each(|camera| camera.near_m = NEAR * size);
    stage.scene
}
