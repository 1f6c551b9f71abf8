//! A path along a fence under trees in the evening: leaves and grass are cut out by alpha.

use glam::{Vec3, vec3};

use super::{
    curve::tube,
    flora::{Dice, Tree, bark_material, card, grass_material, leaf_material, tuft},
    land::Land,
    relief::{HeightMap, fractal3, noise3},
    shape::{CREASE_DEG, ball},
    sky::ClearSky,
    solid::Solid,
    stage::{Stage, plain},
    texture::{Noise, Surface},
};
use crate::{Id, Material, Scene};

/// Points along each side of the ground and the metres between them.
const GROUND: (usize, f32) = (97, 0.5);

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("grove");
    let bark = bark_material(&mut stage, "bark", vec3(0.20, 0.155, 0.115), 3);
    let rail = bark_material(&mut stage, "weathered rail", vec3(0.33, 0.30, 0.26), 13);
    let leaf = leaf_material(&mut stage, "beech leaves", vec3(0.10, 0.20, 0.028), 0.25);
    let ivy = leaf_material(&mut stage, "climber leaves", vec3(0.07, 0.155, 0.035), 0.0);
    let grass = grass_material(&mut stage, "grass", vec3(0.15, 0.215, 0.05));

    let (side, spacing_m) = GROUND;
    let half = (side - 1) as f32 * spacing_m / 2.0;
    let map = HeightMap::new(side, |x, z| {
        let p = vec3(x as f32, 0.0, z as f32) * spacing_m - vec3(half, 0.0, half);
        let off_path = ((p.x - path_x(p.z)).abs() / 3.0).min(1.0);
        (2.6 * noise3(p / 13.0, 4) * off_path + 0.35 * fractal3(p / 2.4, 3, 6) * (0.25 + 0.75 * off_path))
            / spacing_m
    });
    let land = Land { map, spacing_m };
    let ground = meadow(&mut stage, &land);
    let earth = earth(&mut stage);
    land.place(&mut stage, "ground", ground, earth, 2.0);

    trees(&mut stage, &land, [bark, leaf]);
    fence(&mut stage, &land, [rail, ivy]);
    grasses(&mut stage, &land, grass);
    stones(&mut stage, &land, earth);

    let sky = ClearSky {
        towards_sun: vec3(-0.62, 0.46, -0.64).normalize(),
        turbidity: 3.4,
        sun_lux: 68_000.0,
        sky_lux: 12_000.0,
        ground: vec3(0.14, 0.15, 0.06),
    };
    stage.sun(sky.towards_sun, vec3(1.0, 0.86, 0.66), sky.sun_lux);
    stage.scene.environment = Some(sky.environment("late afternoon"));
    let eye = |x: f32, z: f32, up: f32| land.ground_at(x, z) + Vec3::Y * up;
    stage.camera("path", eye(0.9, 10.5, 1.55), eye(-1.0, -4.0, 1.75), 48.0);
    stage.camera("fence", eye(3.9, 5.2, 1.15), eye(1.1, -0.6, 0.9), 46.0);
    stage.camera("crown", eye(0.5, 3.5, 1.5), eye(-2.6, -2.0, 5.0), 60.0);
    stage.scene
}

/// Where the path is at depth z.
fn path_x(z: f32) -> f32 {
    0.9 * (z * 0.22 + 0.4).sin() - 0.2
}

/// Meadow with a trodden path.
fn meadow(stage: &mut Stage, land: &Land) -> Id {
    const SIZE: u32 = 2048;
    let width = land.width_m();
    let clouds = Noise::new(SIZE, glam::IVec2::splat(16), 6, 41);
    let grains = Noise::new(SIZE, glam::IVec2::splat(420), 2, 55);
    let leaves = Noise::new(SIZE, glam::IVec2::splat(300), 1, 61);
    let picture = Surface::paint(SIZE, |uv| {
        let p = (uv - 0.5) * width;
        let (cloud, grain, litter) = (clouds.at(uv), grains.at(uv), leaves.at(uv));
        let from_path = (p.x - path_x(p.y)).abs() + 0.9 * cloud;
        let t = ((from_path - 0.55) / 0.75).clamp(0.0, 1.0);
        let grass =
            vec3(0.060, 0.088, 0.022).lerp(vec3(0.115, 0.125, 0.040), (0.5 + 2.0 * cloud).clamp(0.0, 1.0));
        let earth = vec3(0.23, 0.175, 0.115) * (1.0 + 0.6 * cloud);
        let fallen = if litter > 0.27 { vec3(0.26, 0.15, 0.045) } else { Vec3::ZERO };
        let color = earth.lerp(grass, t * t * (3.0 - 2.0 * t)) * (1.0 + 0.8 * grain);
        (if fallen == Vec3::ZERO { color } else { fallen * (1.0 + grain) }, 0.0)
    });
    let color = stage.image(picture.base_color("meadow colour"), width);
    let clods = Noise::new(512, glam::IVec2::splat(20), 5, 71);
    let relief = Surface::paint(512, |uv| (Vec3::ZERO, 0.05 * clods.at(uv)));
    let normal = stage.image(relief.normal("meadow normals", 2.0), 2.0);
    stage.material(Material {
        base_color_texture: Some(color),
        normal_texture: Some(normal),
        ..plain("meadow", Vec3::ONE, 0.95)
    })
}

fn earth(stage: &mut Stage) -> Id {
    let clouds = Noise::new(512, glam::IVec2::splat(6), 5, 83);
    let paint = Surface::paint(512, |uv| {
        let cloud = clouds.at(uv);
        (vec3(0.27, 0.25, 0.22) * (1.0 + 0.9 * cloud), 0.03 * cloud)
    });
    let [base_color_texture, normal_texture] = stage.surface("stone", &paint, 1.2);
    stage.material(Material { base_color_texture, normal_texture, ..plain("stone", Vec3::ONE, 0.9) })
}

/// Three individuals, planted in two loose rows.
fn trees(stage: &mut Stage, land: &Land, materials: [Id; 2]) {
    let kinds = [(5.4, 0.20, 7), (6.0, 0.23, 19), (4.6, 0.17, 37)].map(|(trunk_m, radius_m, seed)| {
        let tree = Tree { trunk_m, radius_m, spread_deg: 52.0, leaf_m: 0.48, leaves: 9, materials, seed };
        stage.mesh("tree", tree.grow())
    });
    let places = [
        (-3.4, 3.2),
        (-2.9, -2.0),
        (-3.9, -7.4),
        (3.6, -1.2),
        (4.1, -6.6),
        (-4.2, -13.0),
        (3.8, -12.2),
        (7.4, 2.6),
        (-8.3, 0.2),
        (8.4, -9.0),
        (-9.0, -9.4),
        (0.6, -18.0),
        (-7.6, -17.5),
        (8.6, -17.0),
        (-8.8, 8.4),
    ];
    for (i, (x, z)) in places.into_iter().enumerate() {
        let scale = [1.0, 0.9, 1.1, 0.96, 1.05][i % 5];
        stage.place_turned(kinds[i % 3], land.ground_at(x, z), 137.5 * i as f32, scale);
    }
}

/// Split rails between posts on the path's right, with a climber.
fn fence(stage: &mut Stage, land: &Land, [wood, leaves]: [Id; 2]) {
    let mut dice = Dice::new(23);
    let place = |i: i32| {
        let z = 8.0 - 2.1 * i as f32;
        land.ground_at(path_x(z) + 2.05, z)
    };
    let mut posts = Solid::default();
    let mut climber = Solid::default();
    for i in 0..13 {
        let at = place(i);
        let lean = vec3(0.04 * dice.signed(), 1.0, 0.04 * dice.signed());
        let top = at + lean * 1.22;
        let line = [at - Vec3::Y * 0.3, at + lean * 0.6, top - lean * 0.03, top];
        posts.append(tube(&line, |k| [0.075, 0.072, 0.068, 0.05][k], 10, wood));
        if i == 12 {
            break;
        }
        for height in [0.42, 0.78, 1.10] {
            // Rails stand a little past the posts, each on its own side of them.
            let side = vec3(0.05, 0.0, 0.0) * if height == 0.78 { -1.0 } else { 1.0 };
            let ends = [place(i), place(i + 1)].map(|p| p + side + Vec3::Y * (height + 0.05 * dice.signed()));
            let over = (ends[1] - ends[0]) * 0.07;
            let sag = vec3(0.02 * dice.signed(), -0.02 - 0.015 * dice.signed(), 0.0);
            let (a, b) = (ends[0] - over, ends[1] + over);
            let line = [a, a.lerp(b, 0.25) + sag * 0.7, a.lerp(b, 0.5) + sag, a.lerp(b, 0.8) + sag * 0.6, b];
            let thick = dice.between(0.036, 0.048);
            posts.append(tube(&line, |k| thick * (1.0 - 0.04 * k as f32), 9, wood));
            let vines = if i < 5 { 22 } else { 6 };
            for _ in 0..vines {
                let on = a.lerp(b, dice.between(0.0, 1.0))
                    + vec3(0.06 * dice.signed(), -0.06 + 0.08 * dice.signed(), 0.0);
                let up = vec3(0.9 * dice.signed(), -0.35 + 0.8 * dice.signed(), 0.7 * dice.signed())
                    .normalize_or(Vec3::Y);
                let right =
                    up.cross(vec3(1.0, 0.3 * dice.signed(), 0.5 * dice.signed())).normalize_or(Vec3::Z);
                let size = dice.between(0.16, 0.26);
                climber.append(card(on, up * size, right * size, leaves));
            }
        }
    }
    stage.body("fence", posts);
    stage.body("climber", climber);
}

/// Grass beside the path, denser near the viewer's way.
fn grasses(stage: &mut Stage, land: &Land, material: Id) {
    let mut dice = Dice::new(57);
    let mut out = Solid::default();
    for _ in 0..9000 {
        let z = dice.between(-18.0, 11.5);
        let spread = dice.signed();
        let x = path_x(z) + spread.signum() * (0.75 + 8.0 * spread.abs().powf(1.6));
        let at = land.ground_at(x, z);
        // Bare under the densest trees.
        if noise3(at / 1.7, 3) > 0.33 {
            continue;
        }
        let height = dice.between(0.10, 0.26) * (0.7 + 0.6 * spread.abs().sqrt());
        out.append(tuft(at, height, material, &mut dice));
    }
    stage.body("grass", out);
}

/// Field stones along the path.
fn stones(stage: &mut Stage, land: &Land, material: Id) {
    let mut solid = ball(1.0, 4, material);
    for t in &mut solid.triangles {
        t.p = t.p.map(|p| p * (1.0 + 0.8 * fractal3(p * 1.2, 4, 90)) * vec3(1.0, 0.65, 0.8));
    }
    let stone = stage.mesh("field stone", solid.planar_uv().smooth(CREASE_DEG));
    let mut dice = Dice::new(71);
    for _ in 0..60 {
        let z = dice.between(-17.0, 9.5);
        let x = path_x(z) + dice.signed().signum() * dice.between(0.9, 2.0);
        let size = 0.05 + 0.22 * dice.between(0.0, 1.0).powi(3);
        let at = land.ground_at(x, z) - Vec3::Y * 0.2 * size;
        stage.place_turned(stone, at, dice.between(0.0, 360.0), size);
    }
}
