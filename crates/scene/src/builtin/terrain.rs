//! Eroded hills with a monument: the benchmark of shadow techniques. Few large triangles receive the shadow that very
//! many small ones cast.

use std::f32::consts::TAU;

use glam::{Vec3, vec2, vec3};

use super::{
    curve::{frames, torus_knot},
    grid::Grid,
    land::Land,
    relief::{HeightMap, fractal3, noise3},
    shape::{CREASE_DEG, ball, bevelled},
    sky::ClearSky,
    stage::{Stage, plain},
    texture::{Noise, Surface, dressed_stone, hash},
};
use crate::{Id, Material, Primitive, Scene};

/// Vertices along each side of the terrain.
pub const SIDE: usize = 135;
/// Metres between neighbouring vertices.
const SPACING_M: f32 = 0.75;
/// Half the terrain's width, metres.
const HALF_M: f32 = (SIDE - 1) as f32 * SPACING_M / 2.0;
/// The sculpture's vertices around its strand and along it: 1.3 million.
const SCULPTURE: [usize; 2] = [321, 4097];
/// Where the monument stands, and the height of the level place around it, metres.
const PLACE: Vec3 = vec3(4.0, 3.0, -2.0);
/// Height of the plinth's top over [`PLACE`].
const PLINTH_M: f32 = 1.1;

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("terrain");
    let land = Land { map: heights(), spacing_m: SPACING_M };
    let ground = ground_material(&mut stage, &land);
    let rock = stage.surface("rock", &rock_surface(512), 2.0);
    let [base_color_texture, normal_texture] = rock;
    let rock =
        stage.material(Material { base_color_texture, normal_texture, ..plain("rock", Vec3::ONE, 0.9) });
    let [base_color_texture, normal_texture] =
        stage.surface("plinth stone", &dressed_stone(512, 2, 1.6, vec3(0.42, 0.40, 0.37), 31), 1.6);
    let plinth = stage.material(Material {
        base_color_texture,
        normal_texture,
        ..plain("plinth stone", Vec3::ONE, 0.7)
    });
    let marble = stage.material(plain("marble", vec3(0.78, 0.75, 0.70), 0.42));

    land.place(&mut stage, "terrain", ground, rock, 4.0);

    let mut steps = bevelled(vec3(-3.4, -0.8, -2.4), vec3(3.4, 0.28, 2.4), 0.03, plinth);
    steps.append(bevelled(vec3(-2.9, 0.2, -1.9), vec3(2.9, 0.56, 1.9), 0.03, plinth));
    steps.append(bevelled(vec3(-2.3, 0.5, -1.3), vec3(2.3, PLINTH_M, 1.3), 0.03, plinth));
    stage.body("plinth", steps.moved(PLACE));
    let knot = stage.add("sculpture", vec![sculpture(marble)]);
    stage.place_turned(knot, PLACE + Vec3::Y * PLINTH_M, 24.0, 1.0);
    boulders(&mut stage, &land, rock);

    let sky = ClearSky::afternoon();
    stage.sun(sky.towards_sun, vec3(1.0, 0.92, 0.80), sky.sun_lux);
    stage.scene.environment = Some(sky.environment("clear afternoon"));

    let middle = PLACE + Vec3::Y * 4.5;
    stage.camera("hill", vec3(-13.0, 12.5, 25.0), middle + vec3(1.5, -2.6, 0.0), 38.0);
    stage.camera("foot", PLACE + vec3(-4.5, 1.7, 10.5), middle + vec3(1.0, 1.0, 0.0), 58.0);
    stage.camera("relief", PLACE + vec3(-2.6, 4.8, 6.4), middle + vec3(-0.6, 0.2, 0.0), 40.0);
    stage.camera("above", vec3(-62.0, 52.0, 70.0), vec3(0.0, -1.0, 2.0), 36.0);
    stage.scene
}

/// Hills around a valley, ridged and rained on, with a level place for the monument.
fn heights() -> HeightMap {
    let level = |column: usize, row: usize| {
        (vec3(column as f32, 0.0, row as f32) * SPACING_M) - vec3(HALF_M, 0.0, HALF_M)
    };
    let mut map = HeightMap::new(SIDE, |column, row| {
        let p = level(column, row);
        let bent = p + 7.0 * vec3(noise3(p / 22.0, 5), 0.0, noise3(p / 22.0 + 31.0, 6));
        let ridge = |scale: f32, seed: u32| 1.0 - 2.0 * noise3(bent / scale, seed).abs();
        let from_place = vec2(p.x - PLACE.x, p.z - PLACE.z).length();
        let hills =
            11.5 * ridge(38.0, 1).powi(2) + 5.0 * ridge(15.0, 2).powi(2) * (from_place / 30.0).min(1.0);
        let rim = 6.0 * (from_place / 45.0).powi(2).min(1.6);
        let detail = 1.6 * fractal3(bent / 5.0, 3, 9);
        // Towards the viewer the land falls, so that hills stand behind the monument and not before it.
        let open = 0.25 + 0.75 / (1.0 + ((p.z - 2.0) / 8.0).exp());
        ((hills + rim) * open * (0.25 + (from_place / 40.0).min(1.0)) + detail) / SPACING_M
    });
    map.erode(9_000, 77);
    map.slump(1.1, 60);
    for strength in [0.5, 0.3] {
        map.smooth(strength);
    }
    map.shape(|column, row, height| {
        let p = level(column, row);
        let from_place = vec2(p.x - PLACE.x, p.z - PLACE.z).length();
        let t = ((from_place - 6.0) / 12.0).clamp(0.0, 1.0);
        let t = t * t * (3.0 - 2.0 * t);
        let floor = PLACE.y / SPACING_M + 0.1 * noise3(p / 2.0, 12);
        floor + (height - floor) * t
    });
    map
}

/// Grass where it is level, earth where it is steep, rock where it is steeper.
fn ground_material(stage: &mut Stage, land: &Land) -> Id {
    const SIZE: u32 = 1024;
    let clouds = Noise::new(SIZE, glam::IVec2::splat(12), 6, 41);
    let grains = Noise::new(SIZE, glam::IVec2::splat(220), 2, 55);
    let patches = Noise::new(SIZE, glam::IVec2::splat(40), 4, 61);
    let picture = Surface::paint(SIZE, |uv| {
        let p = uv * (SIDE - 1) as f32;
        let slope = land.map.gradient(p).length();
        let (cloud, grain, patch) = (clouds.at(uv), grains.at(uv), patches.at(uv));
        let step = |from: f32, to: f32, x: f32| {
            let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let at = land.level(p);
        let near = vec2(at.x - PLACE.x, at.z - PLACE.z).length();
        let trodden = 1.0 - step(4.5, 9.0, near + 6.0 * patch);
        let grass = vec3(0.125, 0.150, 0.045).lerp(vec3(0.26, 0.235, 0.085), step(-0.12, 0.2, cloud));
        let earth = vec3(0.27, 0.20, 0.125) * (1.0 + 0.5 * patch);
        let rock = vec3(0.34, 0.32, 0.29) * (1.0 + 0.8 * cloud);
        let bare = step(0.35, 0.6, slope + 0.9 * patch).max(0.85 * trodden);
        let color = grass.lerp(earth, bare).lerp(rock, step(0.62, 0.95, slope + 0.5 * patch));
        (color * (1.0 + 0.7 * grain), 0.0)
    });
    let color = stage.image(picture.base_color("land colour"), land.width_m());
    let clods = Noise::new(512, glam::IVec2::splat(24), 4, 71);
    let relief = Surface::paint(512, |uv| (Vec3::ZERO, 0.10 * clods.at(uv)));
    let normal = stage.image(relief.normal("land normals", 4.0), 4.0);
    stage.material(Material {
        base_color_texture: Some(color),
        normal_texture: Some(normal),
        ..plain("land", Vec3::ONE, 0.95)
    })
}

/// Weathered grey-brown rock in layers.
fn rock_surface(size: u32) -> Surface {
    let layers = Noise::new(size, glam::ivec2(3, 14), 4, 81);
    let clouds = Noise::new(size, glam::IVec2::splat(6), 5, 83);
    let grains = Noise::new(size, glam::IVec2::splat(80), 2, 85);
    Surface::paint(size, |uv| {
        let (layer, cloud, grain) = (layers.at(uv), clouds.at(uv), grains.at(uv));
        let color = vec3(0.33, 0.30, 0.265) * (1.0 + 0.5 * layer + 0.5 * cloud + 0.3 * grain);
        (color, 0.02 * layer + 0.02 * cloud + 0.004 * grain)
    })
}

/// A twisted strand in a trefoil knot, standing on its edge, with a rope's grooves and a hammered skin.
fn sculpture(material: Id) -> Primitive {
    let [columns, rows] = SCULPTURE;
    let path: Vec<Vec3> = (0..rows - 1)
        .map(|i| {
            // Up on its edge, and turned so that a lobe stands at the bottom.
            let p = torus_knot(2.0, 3.0, 2.55, 1.25, i as f32 / (rows - 1) as f32);
            vec3(p.z, p.x, p.y)
        })
        .collect();
    let rings = frames(&path, true);
    let lowest = path.iter().map(|p| p.y).fold(f32::INFINITY, f32::min);
    let lift = Vec3::Y * (0.80 - lowest);
    let grid = Grid { columns, rows, closes: [true; 2] };
    grid.primitive(material, false, |column, row| {
        let (around, along) = (column as f32 / (columns - 1) as f32, row as f32 / (rows - 1) as f32);
        let frame = &rings[row % (rows - 1)];
        let angle = TAU * around;
        // Three strands laid seven times round each other, each of them ribbed.
        let strand = angle * 3.0 + TAU * 21.0 * along;
        let rib = TAU * 330.0 * along + 4.0 * strand.cos();
        let swell = 1.0 + 0.14 * (TAU * 6.0 * along).cos();
        let r = 0.62 * swell * (1.0 + 0.16 * strand.cos() - 0.035 * (2.0 * strand).cos())
            + 0.008 * rib.sin() * (0.5 + 0.5 * strand.cos());
        let out = frame.x * angle.cos() + frame.y * angle.sin();
        (frame.origin + lift + out * r, vec2(around * 4.0, along * 40.0))
    })
}

/// Boulders of three shapes, more of them where it is steep.
fn boulders(stage: &mut Stage, land: &Land, material: Id) {
    let meshes = [0, 1, 2].map(|kind| {
        let mut solid = ball(1.0, 3, material);
        for t in &mut solid.triangles {
            t.p = t.p.map(|p| {
                let lumps = 1.0 + 0.9 * fractal3(p * 1.1 + 9.0 * kind as f32, 4, 90 + kind);
                p * lumps * vec3(1.0, 0.72, 0.85)
            });
        }
        stage.mesh("boulder", solid.planar_uv().smooth(CREASE_DEG))
    });
    let mut standing = 0;
    for i in 0..900 {
        let place = vec2(hash(i, 1, 95), hash(i, 2, 95)) * (SIDE - 9) as f32 + 4.0;
        let steep = land.map.gradient(place).length();
        let at = land.ground(place);
        let clear = vec2(at.x - PLACE.x, at.z - PLACE.z).length() > 8.0;
        if !clear || hash(i, 3, 95) > 0.10 + 0.35 * steep || standing == 130 {
            continue;
        }
        let size = 0.18 + 0.85 * hash(i, 4, 95).powi(4) + 0.25 * hash(i, 6, 95);
        let sunk = at - Vec3::Y * 0.25 * size;
        stage.place_turned(meshes[i as usize % 3], sunk, 360.0 * hash(i, 5, 95), size);
        standing += 1;
    }
}
