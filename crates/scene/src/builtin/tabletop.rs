//! What the three table-top pictures share: a table before a wall, boards, a studio around.

use glam::{Vec2, Vec3, vec2, vec3};

use super::{
    shape::{arc, bevelled, cuboid, loft},
    sky::{SoftBox, studio},
    stage::{Stage, plain},
    texture::{dressed_stone, wood},
};
use crate::{Id, Material};

/// Height of the table's top over the floor, metres.
pub const TOP: f32 = 0.75;

/// Oiled wood of this colour, boards' grain along X.
pub fn wooden(stage: &mut Stage, name: &str, color: Vec3, roughness: f32, seed: u32) -> Id {
    let [base_color_texture, normal_texture] = stage.surface(name, &wood(1024, color, seed), 0.42);
    stage.material(Material { base_color_texture, normal_texture, ..plain(name, Vec3::ONE, roughness) })
}

/// A table of boards on four legs, its top at [`TOP`], on a floor before a wall.
pub fn table(stage: &mut Stage, material: Id, wall: Vec3) {
    const HALF: Vec2 = vec2(0.62, 0.42);
    let boards = 5;
    for i in 0..boards {
        let (z0, z1) = (i as f32, i as f32 + 1.0);
        let at = |z: f32| HALF.y * (2.0 * z / boards as f32 - 1.0);
        // Each board shows another stretch of the same log.
        let shift = vec3(1.37 * i as f32, 0.0, 0.0);
        let lo = vec3(-HALF.x, TOP - 0.032, at(z0) + 0.0004);
        let hi = vec3(HALF.x, TOP, at(z1) - 0.0004);
        let board = bevelled(lo + shift, hi + shift, 0.0018, material).moved(-shift);
        stage.body("board", board);
    }
    let (x, z) = (HALF.x - 0.06, HALF.y - 0.06);
    let rail = |a: Vec2, b: Vec2| cuboid(vec3(a.x, TOP - 0.13, a.y), vec3(b.x, TOP - 0.033, b.y), material);
    stage.body("rail", rail(vec2(-x, z - 0.025), vec2(x, z)));
    stage.body("rail", rail(vec2(-x, -z), vec2(x, 0.025 - z)));
    for (a, b) in [(-x, 0.025 - x), (x - 0.025, x)] {
        stage.body("rail", rail(vec2(a, 0.03 - z), vec2(b, z - 0.03)));
    }
    let leg = bevelled(vec3(-0.03, 0.0, -0.03), vec3(0.03, TOP - 0.034, 0.03), 0.005, material);
    let leg = stage.mesh("leg", leg);
    for (sx, sz) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        stage.place(leg, vec3(sx * (x + 0.031), 0.0, sz * (z + 0.031)), false);
    }

    let [base_color_texture, normal_texture] =
        stage.surface("plaster", &dressed_stone(512, 1, 1.4, wall, 51), 1.4);
    let plaster = stage.material(Material {
        base_color_texture,
        normal_texture,
        normal_scale: 0.5,
        ..plain("plaster", Vec3::ONE, 0.9)
    });
    stage.body("wall", cuboid(vec3(-3.0, 0.0, -1.35), vec3(3.0, 3.0, -1.1), plaster));
    stage.body("floor", cuboid(vec3(-3.0, -0.2, -1.35), vec3(3.0, 0.0, 3.0), plaster));
}

/// A paper sweep: a sheet that lies on the table, bends up behind and rises; its top at y = 0, `depth` metres deep to
/// the bend behind z = 0.
pub fn sweep_backdrop(stage: &mut Stage, color: Vec3, depth: f32) {
    let material = stage.material(plain("backdrop", color, 0.95));
    let (radius, thick) = (0.45, 0.02);
    let mut line = vec![vec2(1.6, 0.0)];
    line.extend(arc(vec2(-depth, radius), radius, -90.0, -180.0, 24));
    line.push(vec2(-depth - radius, 2.2));
    let mut back: Vec<Vec2> = arc(vec2(-depth, radius), radius + thick, -90.0, -180.0, 24);
    back.insert(0, vec2(1.6, -thick));
    back.push(vec2(-depth - radius - thick, 2.2));
    line.extend(back.into_iter().rev());
    let at = |x: f32| line.iter().map(|p| vec3(x, p.y, p.x)).collect::<Vec<_>>();
    stage.body("backdrop", loft(&[at(-4.0), at(4.0)], 30.0, material).planar_uv());
}

/// A dim room with a large soft box on the left, a strip on the right, a small one behind and, for metal and glass to
/// mirror, a faint screen before the table. From below comes what the lit table sends up, `table` in nits: without
/// reflections of things nearby, metal would otherwise mirror a dark floor where it sees the table.
pub fn surround(stage: &mut Stage, brightness: f32, table: Vec3) {
    let lamp = |towards: Vec3, half: Vec2, nits: Vec3| SoftBox { towards, half, nits: nits * brightness };
    let boxes = [
        lamp(vec3(0.15, 0.45, 1.0), vec2(0.95, 0.40), vec3(95.0, 92.0, 88.0)),
        lamp(vec3(-1.0, 0.75, 0.5), vec2(0.48, 0.42), vec3(900.0, 870.0, 800.0)),
        lamp(vec3(1.0, 0.35, 0.25), vec2(0.12, 0.55), vec3(620.0, 680.0, 760.0)),
        lamp(vec3(0.25, 0.8, -1.0), vec2(0.30, 0.10), vec3(700.0, 700.0, 700.0)),
    ];
    let room = [vec3(9.0, 9.0, 9.5) * brightness, vec3(14.0, 13.0, 12.0) * brightness, table];
    stage.scene.environment = Some(studio("studio", room, &boxes));
}
