//! A tiled pool in the sun: one wavy interface that bundles light on the floor.

use glam::{Vec2, Vec3, ivec2, vec2, vec3};

use super::{
    curve::tube,
    flora::{Tree, bark_material, leaf_material},
    grid::Grid,
    shape::{CREASE_DEG, Joins, arc, bevelled, cuboid, lathe, polygon, rectangle_ring, skin},
    sky::ClearSky,
    solid::Solid,
    stage::{Stage, metal, plain},
    texture::{Masonry, Noise, Surface, dressed_stone, hash, wood},
};
use crate::{Id, Material, Primitive, Scene};

/// Half the basin's length and width, metres.
const BASIN: Vec2 = vec2(4.0, 2.0);
/// Half the deck's.
const DECK: Vec2 = vec2(9.0, 5.5);
/// The floor at the shallow end (−X) and at the deep one.
const FLOOR: [f32; 2] = [-1.25, -1.75];
/// The water's level at rest; the deck is at 0.
const LEVEL: f32 = -0.13;

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("pool");
    let mosaic = {
        let [base_color_texture, normal_texture] = stage.surface("mosaic", &mosaic(1024), 0.8);
        stage.material(Material { base_color_texture, normal_texture, ..plain("mosaic", Vec3::ONE, 0.25) })
    };
    let travertine =
        masonry(&mut stage, "travertine", vec3(0.46, 0.405, 0.33), vec3(0.29, 0.255, 0.205), 4, 21);
    let [base_color_texture, normal_texture] =
        stage.surface("coping", &dressed_stone(512, 2, 1.6, vec3(0.56, 0.52, 0.45), 23), 1.6);
    let coping =
        stage.material(Material { base_color_texture, normal_texture, ..plain("coping", Vec3::ONE, 0.55) });
    let wall = {
        let paint = dressed_stone(512, 1, 3.0, vec3(0.66, 0.635, 0.59), 29);
        let [base_color_texture, normal_texture] = stage.surface("plaster", &paint, 3.0);
        stage.material(Material { base_color_texture, normal_texture, ..plain("plaster", Vec3::ONE, 0.9) })
    };

    stage.body("basin", basin([travertine, mosaic]));
    stage.body("coping", rim(coping));
    let mut steps = Solid::default();
    for i in 0..3 {
        let (x, y) = (-BASIN.x + 0.34 * (i + 1) as f32, LEVEL - 0.16 - 0.27 * i as f32);
        steps.append(cuboid(vec3(-BASIN.x - 0.1, -1.5, -0.9), vec3(x, y, 0.9), mosaic));
    }
    stage.body("steps", steps);
    let water = stage.material(Material {
        transmission: 1.0,
        ior: 1.33,
        thickness: LEVEL - FLOOR[1],
        attenuation_color: vec3(0.62, 0.92, 0.96),
        attenuation_distance: 5.0,
        double_sided: true,
        ..plain("water", Vec3::ONE, 0.0)
    });
    let surface = stage.add("water", vec![water_surface(water)]);
    stage.place(surface, Vec3::ZERO, false);
    let chrome = stage.material(metal("chrome", vec3(0.55, 0.556, 0.554), 0.08));
    stage.body("ladder", ladder(chrome));
    surroundings(&mut stage, wall, coping);

    let sky = ClearSky {
        towards_sun: vec3(-0.52, 0.80, 0.30).normalize(),
        turbidity: 2.8,
        sun_lux: 95_000.0,
        sky_lux: 18_000.0,
        ground: vec3(0.30, 0.27, 0.22),
    };
    stage.sun(sky.towards_sun, vec3(1.0, 0.955, 0.89), sky.sun_lux);
    stage.scene.environment = Some(sky.environment("clear noon"));
    stage.camera("pool", vec3(-5.9, 2.05, 4.1), vec3(0.6, -0.25, -0.8), 48.0);
    stage.camera("surface", vec3(-3.3, 0.30, 1.35), vec3(2.4, -0.45, -0.9), 52.0);
    stage.camera("diver", vec3(-2.3, -0.72, 0.9), vec3(3.0, -1.25, -0.9), 62.0);
    stage.scene
}

fn masonry(stage: &mut Stage, name: &str, stone: Vec3, mortar: Vec3, courses: i32, seed: u32) -> Id {
    let side_m = 0.6 * courses as f32;
    let paint = Masonry {
        side_m,
        courses,
        stones: courses / 2,
        joint_m: 0.006,
        stone,
        mortar,
        variation: 0.08,
        seed,
    };
    let [base_color_texture, normal_texture] = stage.surface(name, &paint.paint(1024), side_m);
    stage.material(Material { base_color_texture, normal_texture, ..plain(name, Vec3::ONE, 0.75) })
}

/// Glass tiles of 25 mm in blues and greens.
fn mosaic(size: u32) -> Surface {
    let clouds = Noise::new(size, ivec2(5, 5), 3, 11);
    let grains = Noise::new(size, ivec2(70, 70), 2, 12);
    Surface::paint(size, |uv| {
        let at = uv * 32.0;
        let cell = at.as_ivec2();
        let f = at - cell.as_vec2();
        let edge = f.min(1.0 - f).min_element();
        let face = ((edge - 0.04) / 0.04).clamp(0.0, 1.0);
        let pick = hash(cell.x, cell.y, 13) + 0.5 * clouds.at(uv);
        let tile = match (pick * 6.0) as i32 {
            0 => vec3(0.10, 0.42, 0.50),
            1 => vec3(0.16, 0.52, 0.58),
            2 => vec3(0.28, 0.62, 0.64),
            3 => vec3(0.40, 0.70, 0.70),
            4 => vec3(0.55, 0.78, 0.76),
            _ => vec3(0.72, 0.84, 0.80),
        };
        let tone = 1.0 + 0.10 * grains.at(uv);
        let tilt =
            (f.x - 0.5) * (hash(cell.x, cell.y, 14) - 0.5) + (f.y - 0.5) * (hash(cell.x, cell.y, 15) - 0.5);
        ((tile * tone).lerp(vec3(0.60, 0.62, 0.60), 1.0 - face), face * (0.0011 + 0.0012 * tilt))
    })
}

/// Deck and basin in one body, as a bowl.
fn basin([deck, tiles]: [Id; 2]) -> Solid {
    let ring = |half: Vec2, y: [f32; 2]| {
        [
            vec3(-half.x, y[0], half.y),
            vec3(half.x, y[1], half.y),
            vec3(half.x, y[1], -half.y),
            vec3(-half.x, y[0], -half.y),
        ]
        .to_vec()
    };
    let rings = [ring(DECK, [-2.3; 2]), ring(DECK, [0.0; 2]), ring(BASIN, [0.0; 2]), ring(BASIN, FLOOR)];
    let mut out = skin(&rings, Joins { ring: true, path: false }, |i| if i == 2 { tiles } else { deck });
    let mut bottom = rings[0].clone();
    bottom.reverse();
    out.append(polygon(&bottom, deck));
    out.append(polygon(&rings[3], tiles));
    out.smooth(1.0).outward().planar_uv()
}

/// Four lines of stones round the basin, a little proud of deck and wall.
fn rim(material: Id) -> Solid {
    let (wide, proud, over) = (0.36, 0.025, 0.03);
    let (x, z) = (BASIN.x - over, BASIN.y - over);
    let mut out = Solid::default();
    let mut stone = |lo: Vec2, hi: Vec2| {
        let (lo, hi) = (lo + 0.002, hi - 0.002);
        out.append(bevelled(vec3(lo.x, -0.045, lo.y), vec3(hi.x, proud, hi.y), 0.008, material));
    };
    let count = 10;
    let length = 2.0 * (x + wide) / count as f32;
    for i in 0..count {
        let from = -x - wide + length * i as f32;
        for side in [-1.0f32, 1.0] {
            let (a, b) = (side * z, side * (z + wide));
            stone(vec2(from, a.min(b)), vec2(from + length, a.max(b)));
        }
    }
    let count = 5;
    let length = 2.0 * z / count as f32;
    for i in 0..count {
        let from = -z + length * i as f32;
        for side in [-1.0f32, 1.0] {
            let (a, b) = (side * x, side * (x + wide));
            stone(vec2(a.min(b), from), vec2(a.max(b), from + length));
        }
    }
    out
}

/// Ripples crossing each other. The sheet ends inside the walls, so that no gap shows between crests and stone.
fn water_surface(material: Id) -> Primitive {
    // Direction in degrees, wavelength and amplitude in metres, phase in turns.
    const WAVES: [(f32, f32, f32, f32); 9] = [
        (17.0, 1.70, 0.0075, 0.00),
        (74.0, 1.25, 0.0055, 0.31),
        (-38.0, 0.97, 0.0042, 0.72),
        (122.0, 0.71, 0.0026, 0.17),
        (-81.0, 0.58, 0.0019, 0.58),
        (43.0, 0.46, 0.0013, 0.93),
        (151.0, 0.37, 0.0009, 0.44),
        (-12.0, 0.30, 0.0006, 0.66),
        (98.0, 0.24, 0.0004, 0.05),
    ];
    let grid = Grid { columns: 193, rows: 385, closes: [false; 2] };
    // Columns run along +Z and rows along +X, so that the surface looks up.
    grid.primitive(material, false, |column, row| {
        let t = vec2(row as f32 / 384.0, column as f32 / 192.0) * 2.0 - 1.0;
        let p = t * (BASIN + 0.01);
        let height = WAVES.iter().map(|(angle, length, amplitude, phase)| {
            let along = p.dot(Vec2::from_angle(angle.to_radians())) / length + phase;
            amplitude * (along * std::f32::consts::TAU).sin()
        });
        (vec3(p.x, LEVEL + height.sum::<f32>(), p.y), p)
    })
}

/// Two bent rails with three rungs at the deep end's long side.
fn ladder(material: Id) -> Solid {
    let mut out = Solid::default();
    let at = vec3(2.9, 0.0, -BASIN.y);
    for x in [-0.26, 0.26] {
        // In (z, y): up from the water, over the rim in an arc, down to the deck.
        let mut line = vec![vec2(0.14, -1.15), vec2(0.14, 0.45)];
        line.extend(arc(vec2(-0.16, 0.55), 0.30, 0.0, 180.0, 20));
        line.push(vec2(-0.46, -0.02));
        let points: Vec<Vec3> = line.iter().map(|p| at + vec3(x, p.y, p.x)).collect();
        out.append(tube(&points, |_| 0.021, 20, material));
    }
    for y in [-0.45, -0.72, -0.99] {
        let tread = bevelled(vec3(-0.25, y - 0.012, 0.115), vec3(0.25, y + 0.012, 0.175), 0.006, material);
        out.append(tread.moved(at));
    }
    out
}

/// A wall with a doorway behind, loungers, a parasol, a ball on the water.
fn surroundings(stage: &mut Stage, wall: Id, stone: Id) {
    let (x, z) = (DECK.x, -DECK.y);
    for (from, to) in [(-x, -5.6), (-4.4, x)] {
        stage.body("wall", cuboid(vec3(from, -0.2, z - 0.05), vec3(to, 3.1, z + 0.35), wall));
    }
    stage.body("lintel", cuboid(vec3(-5.6, 2.2, z - 0.05), vec3(-4.4, 3.1, z + 0.35), wall));
    stage.body("coping of the wall", bevelled(vec3(-x, 3.1, z - 0.1), vec3(x, 3.18, z + 0.42), 0.01, stone));
    // A low wall at the deep end, trees behind both.
    stage.body("low wall", cuboid(vec3(x - 0.35, -0.2, z + 0.3), vec3(x + 0.05, 1.15, -z), wall));
    let top = bevelled(vec3(x - 0.42, 1.15, z + 0.37), vec3(x + 0.12, 1.22, -z + 0.05), 0.01, stone);
    stage.body("coping of the low wall", top);
    let bark = bark_material(stage, "bark", vec3(0.22, 0.18, 0.13), 41);
    let leaves = leaf_material(stage, "leaves", vec3(0.075, 0.15, 0.035), 0.1);
    let tree = Tree {
        trunk_m: 3.4,
        radius_m: 0.13,
        spread_deg: 44.0,
        leaf_m: 0.34,
        leaves: 9,
        materials: [bark, leaves],
        seed: 43,
    };
    let tree = stage.mesh("tree", tree.grow());
    let garden = stage.material(plain("garden", vec3(0.10, 0.12, 0.04), 1.0));
    stage.body("garden", rectangle_ring([DECK - 0.2, Vec2::splat(30.0)], [-0.9, -0.35], garden));
    for (i, (tx, tz)) in
        [(x + 2.0, -4.2), (x + 2.6, -0.6), (x + 2.1, 2.9), (x - 3.2, z - 2.0), (-1.6, z - 2.6)]
            .into_iter()
            .enumerate()
    {
        stage.place_turned(tree, vec3(tx, -0.35, tz), 101.0 * i as f32, 0.85 + 0.1 * (i % 3) as f32);
    }

    let [base_color_texture, normal_texture] =
        stage.surface("teak", &wood(512, vec3(0.30, 0.17, 0.085), 31), 0.7);
    let teak =
        stage.material(Material { base_color_texture, normal_texture, ..plain("teak", Vec3::ONE, 0.6) });
    let cloth = stage.material(plain("canvas", vec3(0.80, 0.77, 0.70), 0.95));
    let lounger = stage.mesh("lounger", lounger(teak));
    for (x, turn) in [(-0.6, 4.0), (1.0, -3.0)] {
        stage.place_turned(lounger, vec3(x, 0.0, -3.75), turn, 1.0);
    }
    let mut parasol = lathe(&[vec2(0.24, 0.0), vec2(0.24, 0.05), vec2(0.03, 0.08)], 32, stone);
    parasol.append(lathe(&[vec2(0.022, 0.05), vec2(0.022, 2.45)], 16, teak));
    let canopy = [(1.45, 2.06), (1.46, 2.045), (0.75, 2.31), (0.03, 2.47), (0.03, 2.50), (0.75, 2.335)];
    parasol.append(super::shape::lathe_ring(&canopy.map(|(r, y)| vec2(r, y)), 8, cloth));
    stage.body("parasol", parasol.moved(vec3(0.2, 0.0, -4.55)));

    let panels =
        [vec3(0.78, 0.07, 0.05), vec3(0.85, 0.83, 0.78), vec3(0.90, 0.55, 0.05), vec3(0.04, 0.22, 0.55)]
            .map(|color| stage.material(plain("vinyl", color, 0.3)));
    let radius = 0.20;
    let profile: Vec<Vec2> = arc(Vec2::ZERO, radius, -88.5, 88.5, 30).into_iter().collect();
    let mut ball = lathe(&profile, 48, panels[0]);
    for t in &mut ball.triangles {
        let middle = (t.p[0] + t.p[1] + t.p[2]) / 3.0;
        let turn = (middle.z.atan2(middle.x) / std::f32::consts::TAU).rem_euclid(1.0);
        let polar = middle.y.abs() > 0.97 * radius;
        t.material = if polar { panels[1] } else { panels[[0, 1, 2, 1, 3, 1][(turn * 6.0) as usize % 6]] };
    }
    let tilted = ball.transformed(glam::Affine3A::from_rotation_z(0.6)).smooth(CREASE_DEG);
    stage.body("ball", tilted.moved(vec3(1.35, LEVEL + 0.135, -0.55)));
}

/// A slatted couch with its back raised, head towards −Z, about the middle of its foot end.
fn lounger(material: Id) -> Solid {
    let mut out = Solid::default();
    let slat = |z: f32| bevelled(vec3(-0.30, 0.30, z), vec3(0.30, 0.325, z + 0.065), 0.005, material);
    for i in 0..15 {
        out.append(slat(0.55 - 0.08 * i as f32));
    }
    let mut back = Solid::default();
    for i in 0..9 {
        back.append(slat(-0.075 - 0.08 * i as f32).moved(vec3(0.0, -0.3, 0.0)));
    }
    let raised =
        glam::Affine3A::from_translation(vec3(0.0, 0.30, -0.60)) * glam::Affine3A::from_rotation_x(0.75);
    out.append(back.transformed(raised));
    for side in [-1.0, 1.0] {
        let x = side * 0.325;
        out.append(bevelled(vec3(x - 0.02, 0.25, -1.15), vec3(x + 0.02, 0.315, 0.64), 0.006, material));
        for z in [-1.05, 0.52] {
            out.append(bevelled(vec3(x - 0.022, 0.0, z), vec3(x + 0.022, 0.26, z + 0.06), 0.006, material));
        }
    }
    out
}
