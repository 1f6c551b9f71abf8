//! A courtyard with arcades on all four sides: hard sun, deep shade, and light that comes from sunlit walls.
//!
//! Axes: the court's middle is the origin. A side is built once, as the one at +Z looking to −Z, and turned.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Quat, Vec2, Vec3, vec2, vec3};

use super::{
    arch::{Opening, PointedArch},
    flora::{Tree, bark_material, leaf_material},
    shape::{Joins, arc, bevelled, circle, cuboid, lathe, lathe_ring, polygon, rectangle_ring, skin},
    sky::ClearSky,
    solid::Solid,
    stage::{Stage, plain},
    texture::{Masonry, Noise, Surface, diagonal_tiles, dressed_stone, wood},
    wall::{Panel, Reveal, pierced},
};
use crate::{Id, Material, Scene, Transform};

/// Bays of a side and the width of one, metres.
const BAYS: usize = 5;
const BAY: f32 = 2.75;
/// The arcade's face on the court, and its thickness.
const COURT: f32 = BAY * BAYS as f32 / 2.0;
const ARCADE_M: f32 = 0.5;
/// The walk's outer wall: its inner and its outer face.
const WALK: [f32; 2] = [COURT + ARCADE_M + 3.1, COURT + ARCADE_M + 3.6];
/// The walk's floor over the court's.
const STEP_M: f32 = 0.16;
/// Where arches spring, where the upper storey begins, where walls end.
const SPRINGING: f32 = 2.95;
const STOREY: f32 = 4.75;
const TOP: f32 = 8.6;

/// The arches between columns.
const ARCH: Opening =
    Opening { arch: PointedArch::new(1.03, 1.0), springing: SPRINGING + 0.02, sill: 0.0, segments: 12 };
/// The upper storey's windows.
const WINDOW: Opening =
    Opening { arch: PointedArch::new(0.52, 1.0), springing: 7.0, sill: 5.65, segments: 10 };

/// Materials.
struct Palette {
    plaster: Id,
    stone: Id,
    paving: Id,
    tiles: Id,
    oak: Id,
    shutters: Id,
    roof: Id,
    terracotta: Id,
    soil: Id,
    water: Id,
}

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("courtyard");
    let m = palette(&mut stage);
    sides(&mut stage, &m);
    rings(&mut stage, &m);
    fountain(&mut stage, &m);
    pots(&mut stage, &m);

    let sky = ClearSky {
        towards_sun: vec3(-0.52, 0.92, 0.36).normalize(),
        turbidity: 2.8,
        sun_lux: 92_000.0,
        sky_lux: 14_500.0,
        ground: vec3(0.28, 0.24, 0.19),
    };
    stage.sun(sky.towards_sun, vec3(1.0, 0.945, 0.86), sky.sun_lux);
    stage.scene.environment = Some(sky.environment("clear morning"));
    stage.camera("court", vec3(-5.9, 1.72, 5.9), vec3(2.6, 2.75, -4.0), 62.0);
    stage.camera("walk", vec3(9.2, 1.72, 6.1), vec3(8.1, 1.75, -3.0), 58.0);
    stage.camera("through", vec3(-9.3, 1.70, 3.1), vec3(2.5, 2.05, 0.9), 50.0);
    stage.camera("window", vec3(-6.3, 7.1, 6.3), vec3(1.3, 0.4, -1.6), 60.0);
    stage.scene
}

fn palette(stage: &mut Stage) -> Palette {
    let mapped = |stage: &mut Stage, name: &str, paint: &Surface, side_m: f32, roughness: f32| {
        let [base_color_texture, normal_texture] = stage.surface(name, paint, side_m);
        stage.material(Material { base_color_texture, normal_texture, ..plain(name, Vec3::ONE, roughness) })
    };
    let plaster = dressed_stone(1024, 1, 3.0, vec3(0.66, 0.46, 0.27), 3);
    let plaster = mapped(stage, "ochre plaster", &plaster, 3.0, 0.92);
    let stone = dressed_stone(512, 3, 1.5, vec3(0.62, 0.575, 0.50), 4);
    let stone = mapped(stage, "pale stone", &stone, 1.5, 0.7);
    let paving = diagonal_tiles(1024, 5, 4.2, [vec3(0.47, 0.42, 0.35), vec3(0.33, 0.19, 0.125)], 5);
    let paving = mapped(stage, "paving", &paving, 4.2, 0.75);
    let bricks = Masonry {
        side_m: 1.6,
        courses: 14,
        stones: 6,
        joint_m: 0.007,
        stone: vec3(0.40, 0.185, 0.105),
        mortar: vec3(0.30, 0.25, 0.20),
        variation: 0.18,
        seed: 7,
    };
    let tiles = mapped(stage, "brick floor", &bricks.paint(1024), 1.6, 0.6);
    let oak = mapped(stage, "dark oak", &wood(512, vec3(0.115, 0.062, 0.032), 6), 1.1, 0.6);
    let slats = Noise::new(512, glam::ivec2(8, 60), 3, 9);
    let louvres = Surface::paint(512, |uv| {
        let at = (uv.y * 10.0).fract();
        let gap = if at > 0.88 { 0.30 } else { 1.0 };
        (vec3(0.085, 0.17, 0.13) * gap * (1.0 + 0.7 * slats.at(uv)), 0.022 * at.min(0.88))
    });
    let shutters = mapped(stage, "green shutters", &louvres, 0.55, 0.6);
    let clay = Noise::new(512, glam::IVec2::splat(7), 4, 11);
    let fired = Surface::paint(512, |uv| {
        let c = clay.at(uv);
        (vec3(0.46, 0.215, 0.125) * (1.0 + 0.6 * c), 0.004 * c)
    });
    let terracotta = mapped(stage, "terracotta", &fired, 0.8, 0.85);
    let barrels = Surface::paint(512, |uv| {
        let (across, down) = ((uv.x * 6.0).fract() - 0.5, (uv.y * 3.0).fract());
        let round = (1.0 - 4.0 * across * across).max(0.0).sqrt();
        let c = clay.at(uv);
        (vec3(0.42, 0.20, 0.12) * (0.45 + 0.6 * round) * (1.0 + 0.7 * c), 0.05 * round + 0.015 * down)
    });
    let roof = mapped(stage, "roof tiles", &barrels, 1.2, 0.85);
    let soil = stage.material(plain("soil", vec3(0.06, 0.045, 0.03), 1.0));
    let water = stage.material(Material {
        transmission: 1.0,
        ior: 1.33,
        thickness: 0.4,
        attenuation_color: vec3(0.70, 0.90, 0.86),
        attenuation_distance: 2.0,
        ..plain("water", Vec3::ONE, 0.0)
    });
    Palette { plaster, stone, paving, tiles, oak, shutters, roof, terracotta, soil, water }
}

/// Stone moulding round an opening through a wall of this thickness, a little proud of its face; `below` of it reaches
/// under the sill.
fn surround(wide: f32, thick: f32, sill: f32, below: f32) -> Vec<Reveal> {
    let line = |back: f32, depth: f32| Reveal { back, depth, sill: sill - below * back };
    vec![
        line(wide, 0.0),
        line(wide, -0.035),
        line(wide * 0.62, -0.05),
        line(wide * 0.55, -0.03),
        line(0.03, -0.03),
        line(0.0, 0.0),
        line(0.0, thick),
    ]
}

/// Meshes of one bay, placed along all four sides.
fn sides(stage: &mut Stage, m: &Palette) {
    let walls = [m.plaster, m.stone];
    let lower = Panel { half_width: BAY / 2.0, bottom: SPRINGING, top: STOREY, thickness: ARCADE_M };
    let mut bay = pierced(lower, ARCH, &surround(0.20, ARCADE_M, SPRINGING, 0.0), true, walls);
    let upper = Panel { bottom: STOREY, top: TOP, ..lower };
    bay.append(pierced(upper, WINDOW, &surround(0.15, ARCADE_M, WINDOW.sill, 1.0), false, walls));
    // A sill that throws a shadow, and closed shutters deep in the opening.
    bay.append(bevelled(vec3(-0.74, 5.45, -0.1), vec3(0.74, 5.53, 0.12), 0.012, m.stone));
    for (a, b) in [(-0.56, -0.004), (0.004, 0.56)] {
        bay.append(cuboid(vec3(a, 5.4, -0.34), vec3(b, 7.7, -0.28), m.shutters));
    }
    let bay = stage.mesh("bay", bay);

    let column = stage.mesh("column", column(m.stone));
    let mut beams = Solid::default();
    for i in 0..3 {
        let x = BAY * (i as f32 - 1.0) / 3.0;
        let (a, b) = (ARCADE_M - 0.1, WALK[0] - COURT + 0.1);
        beams.append(bevelled(
            vec3(x - 0.09, STOREY - 0.22, -b),
            vec3(x + 0.09, STOREY + 0.02, -a),
            0.012,
            m.oak,
        ));
    }
    let beams = stage.mesh("beams", beams);
    let door = stage.mesh("door", door(m));
    let bench = stage.mesh("bench", bench(m.stone));

    for side in 0..4 {
        // From a panel's space, its face at z = 0 looking to +z, to the side at −Z, then round.
        let turn = Quat::from_rotation_y(FRAC_PI_2 * side as f32);
        let place = |stage: &mut Stage, mesh: Id, along: f32, depth: f32| {
            stage.place(mesh, Vec3::ZERO, false);
            if let Some(node) = stage.scene.nodes.last_mut() {
                let translation = turn * vec3(along, 0.0, -COURT - depth);
                node.parent_from_node = Transform::Trs { translation, rotation: turn, scale: Vec3::ONE };
            }
        };
        for i in 0..BAYS {
            let along = BAY * (i as f32 - (BAYS - 1) as f32 / 2.0);
            place(stage, bay, along, 0.0);
            place(stage, beams, along, 0.0);
            if i > 0 {
                place(stage, column, along - BAY / 2.0, ARCADE_M / 2.0);
            }
        }
        for along in [-3.4, 3.4] {
            place(stage, bench, along * BAY / 2.75, WALK[0] - COURT);
        }
        place(stage, door, 0.0, WALK[0] - COURT);
    }
}

/// A Tuscan column with a slightly swelling shaft, from the walk's floor to the springing.
fn column(material: Id) -> Solid {
    let foot = STEP_M - 0.02;
    let mut out = bevelled(vec3(-0.31, foot, -0.31), vec3(0.31, foot + 0.14, 0.31), 0.012, material);
    let (y0, y1) = (foot + 0.13, SPRINGING - 0.14);
    let mut line = vec![vec2(0.27, y0)];
    line.extend(arc(vec2(0.245, y0 + 0.055), 0.055, -80.0, 80.0, 8));
    line.extend([vec2(0.225, y0 + 0.115), vec2(0.225, y0 + 0.14), vec2(0.200, y0 + 0.17)]);
    let shaft = (y0 + 0.19, y1 - 0.34);
    line.extend((0..=10).map(|i| {
        let t = i as f32 / 10.0;
        // Entasis: widest at a third, a sixth thinner at the top.
        vec2(0.195 + 0.006 * (t * 4.2).sin().max(0.0) - 0.030 * t * t, shaft.0 + (shaft.1 - shaft.0) * t)
    }));
    line.extend(arc(vec2(0.168, y1 - 0.31), 0.024, -80.0, 80.0, 6));
    line.extend([vec2(0.168, y1 - 0.27), vec2(0.168, y1 - 0.17), vec2(0.185, y1 - 0.155)]);
    line.extend(arc(vec2(0.185, y1), 0.135, -82.0, -8.0, 8));
    out.append(lathe(&line, 40, material));
    out.append(bevelled(vec3(-0.33, y1 - 0.01, -0.33), vec3(0.33, SPRINGING + 0.01, 0.33), 0.012, material));
    out
}

/// A body between two squares about the vertical axis: half widths and heights.
fn square_ring(half: [f32; 2], y: [f32; 2], material: Id) -> Solid {
    rectangle_ring(half.map(Vec2::splat), y, material)
}

/// What runs round the whole court.
fn rings(stage: &mut Stage, m: &Palette) {
    let court = COURT - 0.15;
    stage.body(
        "court",
        cuboid(vec3(-court - 0.1, -0.3, -court - 0.1), vec3(court + 0.1, 0.0, court + 0.1), m.paving),
    );
    stage.body("walk", square_ring([court + 0.22, WALK[1] - 0.05], [-0.3, STEP_M - 0.002], m.tiles));
    stage.body("kerb", square_ring([court, COURT + ARCADE_M + 0.12], [-0.25, STEP_M], m.stone));
    stage.body("drain", square_ring([court - 0.62, court - 0.34], [-0.2, 0.006], m.stone));
    stage.body("outer wall", square_ring(WALK, [-0.3, TOP], m.plaster));
    stage.body("skirting", square_ring([WALK[0] - 0.025, WALK[0] + 0.1], [0.0, STEP_M + 0.28], m.stone));
    stage.body(
        "upper floor",
        square_ring([COURT + ARCADE_M - 0.2, WALK[0] + 0.2], [STOREY, STOREY + 0.25], m.oak),
    );
    stage.body(
        "string course",
        square_ring([COURT - 0.07, COURT + 0.1], [STOREY - 0.02, STOREY + 0.13], m.stone),
    );
    let mut cornice = square_ring([COURT - 0.08, COURT + 0.2], [TOP - 0.28, TOP - 0.12], m.stone);
    cornice.append(square_ring([COURT - 0.18, COURT + 0.2], [TOP - 0.14, TOP - 0.02], m.stone));
    cornice.append(square_ring([COURT - 0.30, WALK[1] + 0.1], [TOP - 0.04, TOP + 0.10], m.stone));
    stage.body("cornice", cornice);
    roof(stage, m);
    // Corner piers take the arches' ends.
    let pier = bevelled(vec3(-0.40, 0.1, -0.40), vec3(0.40, SPRINGING - 0.10, 0.40), 0.02, m.stone);
    let mut pier = pier;
    pier.append(bevelled(vec3(-0.46, 0.1, -0.46), vec3(0.46, STEP_M + 0.22, 0.46), 0.02, m.stone));
    pier.append(bevelled(
        vec3(-0.46, SPRINGING - 0.13, -0.46),
        vec3(0.46, SPRINGING + 0.01, 0.46),
        0.02,
        m.stone,
    ));
    pier.append(bevelled(
        vec3(-0.27, SPRINGING - 0.02, -0.27),
        vec3(0.27, TOP - 0.05, 0.27),
        0.01,
        m.plaster,
    ));
    let pier = stage.mesh("corner pier", pier);
    let at = COURT + 0.25;
    for (x, z) in [(at, at), (at, -at), (-at, at), (-at, -at)] {
        stage.place(pier, vec3(x, 0.0, z), false);
    }
}

/// Four slopes that rise away from the court, with barrel tiles along the eaves.
fn roof(stage: &mut Stage, m: &Palette) {
    let square = |half: f32, y: f32| {
        [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
            .map(|(x, z)| vec3(half * x, y, half * z))
            .to_vec()
    };
    let (eaves, back) = (COURT - 0.50, WALK[1] + 0.2);
    let rings = [
        square(eaves, TOP + 0.10),
        square(back, TOP + 0.08),
        square(back, TOP + 1.9),
        square(eaves, TOP + 0.16),
    ];
    let slopes = skin(&rings, Joins { ring: true, path: true }, |_| m.roof).smooth(1.0).outward().planar_uv();
    stage.body("roof", slopes);
    let count = 68;
    let step = 2.0 * eaves / count as f32;
    let tile =
        super::curve::tube(&[vec3(0.0, 0.0, -0.9), vec3(0.0, 0.0, 0.0)], |_| step * 0.36, 12, m.terracotta);
    let mut row = Solid::default();
    let slope = Affine3A::from_rotation_x((1.74 / (back - eaves)).atan());
    for i in 0..count {
        let at = vec3(step * (i as f32 + 0.5) - eaves, TOP + 0.175, 0.05 - eaves);
        row.append(tile.clone().transformed(Affine3A::from_translation(at) * slope));
    }
    let row = stage.mesh("eaves", row);
    for side in 0..4 {
        stage.place_turned(row, Vec3::ZERO, 90.0 * side as f32, 1.0);
    }
}

/// A double door in a stone frame, in a panel's space.
fn door(m: &Palette) -> Solid {
    let mut out = Solid::default();
    let jamb = |lo: Vec3, hi: Vec3| bevelled(lo, hi, 0.015, m.stone);
    out.append(jamb(vec3(-0.98, STEP_M - 0.05, -0.1), vec3(-0.74, 2.72, 0.09)));
    out.append(jamb(vec3(0.74, STEP_M - 0.05, -0.1), vec3(0.98, 2.72, 0.09)));
    out.append(jamb(vec3(-1.04, 2.70, -0.1), vec3(1.04, 2.96, 0.12)));
    out.append(jamb(vec3(-1.14, 2.95, -0.1), vec3(1.14, 3.05, 0.20)));
    for side in [-1.0f32, 1.0] {
        let (a, b) = (side * 0.004, side * 0.76);
        out.append(cuboid(vec3(a.min(b), STEP_M - 0.05, -0.1), vec3(a.max(b), 2.71, 0.02), m.oak));
        for (y0, y1) in [(0.36, 1.06), (1.20, 1.78), (1.92, 2.56)] {
            let (a, b) = (side * 0.11, side * 0.64);
            out.append(bevelled(vec3(a.min(b), y0, 0.0), vec3(a.max(b), y1, 0.045), 0.02, m.oak));
        }
    }
    out
}

/// A stone seat before the walk's wall, in a panel's space.
fn bench(material: Id) -> Solid {
    let mut out = bevelled(vec3(-1.0, STEP_M + 0.38, 0.02), vec3(1.0, STEP_M + 0.46, 0.46), 0.015, material);
    for x in [-0.78, 0.78] {
        out.append(bevelled(
            vec3(x - 0.11, STEP_M - 0.05, 0.06),
            vec3(x + 0.11, STEP_M + 0.39, 0.40),
            0.02,
            material,
        ));
    }
    out
}

/// A round basin with a bowl on a foot; water in both.
fn fountain(stage: &mut Stage, m: &Palette) {
    let lip = |r: f32, y: f32| arc(vec2(r, y), 0.055, -60.0, 240.0, 10);
    let mut basin =
        vec![vec2(1.62, -0.05), vec2(1.62, 0.10), vec2(1.50, 0.14), vec2(1.46, 0.20), vec2(1.47, 0.44)];
    basin.extend(lip(1.46, 0.52));
    basin.extend([vec2(1.34, 0.46), vec2(1.32, 0.20), vec2(1.20, 0.10), vec2(1.20, -0.05)]);
    let mut stone = lathe_ring(&basin, 72, m.stone);
    stone.append(lathe(&[vec2(1.4, -0.04), vec2(1.4, 0.105)], 72, m.stone));
    stone.append(lathe(&[vec2(1.95, -0.05), vec2(1.95, 0.05), vec2(1.93, 0.07)], 72, m.stone));
    let mut foot = vec![vec2(0.34, 0.08), vec2(0.34, 0.16), vec2(0.22, 0.24), vec2(0.13, 0.42)];
    foot.extend(arc(vec2(0.11, 0.70), 0.10, -70.0, 70.0, 10));
    foot.extend([vec2(0.10, 0.86), vec2(0.12, 1.10), vec2(0.20, 1.16)]);
    stone.append(lathe(&foot, 40, m.stone));
    let mut bowl = vec![vec2(0.06, 1.12), vec2(0.22, 1.14), vec2(0.44, 1.20), vec2(0.62, 1.31)];
    bowl.extend(arc(vec2(0.655, 1.36), 0.035, -40.0, 220.0, 8));
    bowl.extend([vec2(0.58, 1.30), vec2(0.40, 1.225), vec2(0.06, 1.19)]);
    stone.append(lathe(&bowl, 56, m.stone));
    let mut knob = vec![vec2(0.05, 1.15), vec2(0.05, 1.42), vec2(0.10, 1.46)];
    knob.extend(arc(vec2(0.0, 1.60), 0.12, -50.0, 80.0, 12));
    stone.append(lathe(&knob, 32, m.stone));
    stage.body("fountain", stone);
    let disc = |radius: f32, y: f32| {
        let corners: Vec<Vec3> = circle(72, radius).iter().map(|p: &Vec2| vec3(p.x, y, -p.y)).collect();
        polygon(&corners, m.water)
    };
    let mut water = disc(1.39, 0.44);
    water.append(disc(0.635, 1.335));
    stage.body("water", water);
}

/// Small lemon trees in pots about the court.
fn pots(stage: &mut Stage, m: &Palette) {
    let mut line = vec![vec2(0.24, 0.0), vec2(0.25, 0.03), vec2(0.345, 0.46), vec2(0.35, 0.48)];
    line.extend(arc(vec2(0.365, 0.53), 0.045, -80.0, 170.0, 8));
    line.extend([vec2(0.30, 0.52), vec2(0.29, 0.46), vec2(0.06, 0.44)]);
    let mut pot = lathe(&line, 48, m.terracotta);
    pot.append(lathe(&[vec2(0.28, 0.44), vec2(0.292, 0.485), vec2(0.15, 0.50)], 32, m.soil));
    let pot = stage.mesh("pot", pot);
    let bark = bark_material(stage, "lemon bark", vec3(0.24, 0.20, 0.15), 13);
    let leaf = leaf_material(stage, "lemon leaves", vec3(0.055, 0.15, 0.025), 0.1);
    let trees = [3u32, 11].map(|seed| {
        let tree = Tree {
            trunk_m: 1.0,
            radius_m: 0.04,
            spread_deg: 50.0,
            leaf_m: 0.22,
            leaves: 6,
            materials: [bark, leaf],
            seed,
        };
        stage.mesh("lemon tree", tree.grow())
    });
    let at = 4.35;
    for (i, (x, z)) in [(at, at), (at, -at), (-at, -at), (0.0, -5.75), (5.75, 0.0)].into_iter().enumerate() {
        stage.place(pot, vec3(x, 0.0, z), false);
        stage.place_turned(trees[i % 2], vec3(x, 0.52, z), 77.0 * i as f32, 1.0);
    }
}
