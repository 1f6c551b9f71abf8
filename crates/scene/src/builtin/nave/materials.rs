//! What the nave is made of.

use glam::{Affine2, Vec2, Vec3, Vec4, vec2, vec3};

use super::super::{
    stage::Stage,
    texture::{Masonry, Noise, Surface, diagonal_tiles, dressed_stone, hash, wood},
};
use crate::{Id, Material, TextureRef};

/// Indices of the nave's materials.
pub struct Palette {
    /// Limestone blocks.
    pub wall: Id,
    /// Dressed limestone: mouldings, window frames, tracery, piers.
    pub trim: Id,
    /// Darker polished stone: shafts.
    pub shaft: Id,
    /// The vaults' small blocks.
    pub web: Id,
    /// Diagonal tiles of two stones.
    pub tiles: Id,
    /// Large grey flags.
    pub flags: Id,
    /// Oak.
    pub oak: Id,
    /// Polished brass.
    pub brass: Id,
    /// Altar and steps.
    pub marble: Id,
    /// Candles.
    pub wax: Id,
    /// Candle flames.
    pub flame: Id,
    /// Altar cloth.
    pub linen: Id,
    /// Roof covering.
    pub lead: Id,
    /// The rose window.
    pub rose_glass: Id,
    /// The lancets below it.
    pub lancet_glass: Id,
}

const LIMESTONE: Vec3 = vec3(0.60, 0.545, 0.46);

impl Palette {
    /// Paints the textures and adds the materials.
    pub fn new(stage: &mut Stage) -> Self {
        let blocks = Masonry {
            side_m: 2.75,
            courses: 8,
            stones: 4,
            joint_m: 0.007,
            stone: LIMESTONE,
            mortar: vec3(0.34, 0.305, 0.255),
            variation: 0.11,
            seed: 1,
        };
        let small_blocks = Masonry {
            side_m: 2.0,
            courses: 9,
            stones: 5,
            joint_m: 0.006,
            stone: vec3(0.64, 0.60, 0.53),
            mortar: vec3(0.42, 0.39, 0.34),
            variation: 0.07,
            seed: 2,
        };
        let paving = Masonry {
            side_m: 3.0,
            courses: 5,
            stones: 3,
            joint_m: 0.006,
            stone: vec3(0.33, 0.30, 0.26),
            mortar: vec3(0.15, 0.14, 0.12),
            variation: 0.14,
            seed: 3,
        };
        let masonry = |stage: &mut Stage, name: &str, m: &Masonry, size: u32, roughness: f32| {
            let [base_color_texture, normal_texture] = stage.surface(name, &m.paint(size), m.side_m);
            stage.material(Material { base_color_texture, normal_texture, ..named(name, roughness) })
        };
        let wall = masonry(stage, "limestone blocks", &blocks, 1024, 0.85);
        let web = masonry(stage, "vault blocks", &small_blocks, 512, 0.9);
        let flags = masonry(stage, "flags", &paving, 512, 0.6);

        let [dressed, dressed_normal] =
            stage.surface("dressed stone", &dressed_stone(512, 3, 1.5, LIMESTONE * 1.06, 4), 1.5);
        let dressed =
            Material { base_color_texture: dressed, normal_texture: dressed_normal, ..named("", 0.75) };
        let trim = stage.material(Material { name: "dressed limestone".to_owned(), ..dressed.clone() });
        let tint = Vec4::new(0.62, 0.64, 0.68, 1.0);
        let shaft = stage.material(Material {
            name: "dark shaft".to_owned(),
            base_color: tint,
            roughness: 0.45,
            ..dressed.clone()
        });
        let tint = Vec4::new(1.22, 1.27, 1.38, 1.0).min(Vec4::ONE / LIMESTONE.max_element());
        let marble = stage.material(Material {
            name: "marble".to_owned(),
            base_color: tint,
            roughness: 0.3,
            ..dressed
        });

        let stones = [vec3(0.56, 0.51, 0.43), vec3(0.12, 0.10, 0.095)];
        let floor = diagonal_tiles(1024, 6, 4.0, stones, 5);
        let [base_color_texture, normal_texture] = stage.surface("tiles", &floor, 4.0);
        let tiles = stage.material(Material { base_color_texture, normal_texture, ..named("tiles", 0.38) });

        let [base_color_texture, normal_texture] =
            stage.surface("oak", &wood(512, vec3(0.20, 0.105, 0.05), 6), 1.2);
        let oak = stage.material(Material { base_color_texture, normal_texture, ..named("oak", 0.5) });

        let plain = |stage: &mut Stage, name: &str, color: Vec3, roughness: f32| {
            stage.material(Material { base_color: color.extend(1.0), ..named(name, roughness) })
        };
        let wax = plain(stage, "wax", vec3(0.85, 0.79, 0.64), 0.5);
        let linen = plain(stage, "linen", vec3(0.80, 0.78, 0.73), 0.95);
        let lead = plain(stage, "lead", vec3(0.22, 0.24, 0.26), 0.6);
        let brass =
            Material { base_color: Vec4::new(0.91, 0.70, 0.34, 1.0), metallic: 1.0, ..named("brass", 0.28) };
        let brass = stage.material(brass);
        let flame = Material { emissive: vec3(9000.0, 4600.0, 1300.0), ..named("flame", 1.0) };
        let flame = stage.material(flame);

        let streaks = Noise::new(512, glam::IVec2::splat(40), 2, 77);
        let rose = stage
            .image(Surface::paint(512, |uv| rose_pane(uv, streaks.at(uv))).base_color("rose glass"), 1.0);
        let lancet = stage
            .image(Surface::paint(512, |uv| lancet_pane(uv, streaks.at(uv))).base_color("lancet glass"), 1.0);
        let [rose_glass, lancet_glass] = [
            ("rose glass", rose, vec2(6.1, 6.1), vec2(0.0, 11.65)),
            ("lancet glass", lancet, vec2(1.4, 4.2), vec2(0.0, 5.1)),
        ]
        .map(|(name, texture, size, centre)| glass(stage, name, texture, size, centre));

        Self {
            wall,
            trim,
            shaft,
            web,
            tiles,
            flags,
            oak,
            brass,
            marble,
            wax,
            flame,
            linen,
            lead,
            rose_glass,
            lancet_glass,
        }
    }
}

impl Palette {
    /// What a pierced wall is made of.
    pub fn wall_and_trim(&self) -> [Id; 2] {
        [self.wall, self.trim]
    }
}

fn named(name: &str, roughness: f32) -> Material {
    Material { name: name.to_owned(), roughness, ..Material::default() }
}

/// Stained glass against the sky, as a surface that glows: it lights the eye, hardly the room. `size` and `centre`
/// say which rectangle of the end wall the picture covers, metres.
fn glass(stage: &mut Stage, name: &str, texture: TextureRef, size: Vec2, centre: Vec2) -> Id {
    // Planar coordinates measure v downwards from the floor, so the centre is at v = −y.
    let to_unit = Affine2::from_scale_angle_translation(1.0 / size, 0.0, vec2(0.5, 0.5 + centre.y / size.y));
    let picture = Some(TextureRef { uv_transform: to_unit, ..texture });
    stage.material(Material {
        base_color: Vec4::new(0.25, 0.25, 0.25, 1.0),
        base_color_texture: picture,
        emissive: Vec3::splat(2600.0),
        emissive_texture: picture,
        ..named(name, 0.25)
    })
}

/// Ruby, cobalt, gold, emerald, violet, pale.
const PANES: [Vec3; 6] = [
    vec3(0.75, 0.035, 0.03),
    vec3(0.03, 0.10, 0.75),
    vec3(0.95, 0.58, 0.08),
    vec3(0.04, 0.42, 0.16),
    vec3(0.32, 0.06, 0.50),
    vec3(0.80, 0.78, 0.62),
];

/// One pane of glass: uneven like blown glass, dark where the lead is.
fn pane(color: usize, edge: f32, streak: f32, id: f32) -> (Vec3, f32) {
    let lead = if edge < 1.0 { 0.02 } else { 1.0 };
    (PANES[color] * (0.8 + 0.5 * streak + 0.35 * id) * lead, 0.0)
}

/// Rings of panes about the middle; twelve petals.
fn rose_pane(uv: Vec2, streak: f32) -> (Vec3, f32) {
    let p = (uv - 0.5) * 2.0;
    let rings = [0.0, 0.10, 0.22, 0.38, 0.54, 0.70, 0.86, 1.5];
    let counts = [6, 12, 12, 24, 24, 24, 48];
    let r = p.length();
    let ring = (rings.iter().filter(|limit| **limit <= r).count() - 1).min(counts.len() - 1);
    let turn = (p.to_angle() / std::f32::consts::TAU + 1.0) * counts[ring] as f32 + 0.5;
    let (k, f) = (turn as i32 % counts[ring], turn.fract());
    let across = f.min(1.0 - f) * r * std::f32::consts::TAU / counts[ring] as f32;
    let edge = across.min(r - rings[ring]).min(rings[ring + 1] - r) / 0.007;
    let id = hash(k, ring as i32, 21);
    let color = match ring {
        0 => 2,
        1 => 0,
        2 => [1, 1, 0][k as usize % 3],
        3 => [1, 0, 1, 2][k as usize % 4],
        4 => [0, 1][k as usize % 2],
        5 => [1, 3, 1, 4][k as usize % 4],
        _ => [1, 0, 2, 0][k as usize % 4],
    };
    pane(color, edge, streak, id)
}

/// Medallions on a lattice, within a border.
fn lancet_pane(uv: Vec2, streak: f32) -> (Vec3, f32) {
    let p = vec2((uv.x - 0.5) * 1.4, uv.y * 4.2);
    let border = 0.5 - p.x.abs();
    if border < 0.10 {
        let f = (p.y / 0.14).fract();
        let k = (p.y / 0.14) as i32;
        let edge = (f.min(1.0 - f) * 0.14).min((0.10 - border).abs()) / 0.010;
        return pane([0, 2, 3][k as usize % 3], edge, streak, hash(k, 1, 22));
    }
    let q = vec2(p.x, (p.y / 0.84).fract() * 0.84 - 0.42);
    let r = q.length();
    let k = (p.y / 0.84) as i32;
    if r < 0.34 {
        let turn = (q.to_angle() / std::f32::consts::TAU + 1.0) * 8.0;
        let inner = r < 0.17;
        let f = turn.fract();
        let across = f.min(1.0 - f) * r * 0.785;
        let edge = across.min((r - 0.17).abs()).min(0.34 - r) / 0.010;
        let id = hash(turn as i32 % 8, k * 2 + i32::from(inner), 23);
        return pane(
            [[0, 4, 0, 2], [1, 5, 1, 3]][usize::from(inner)][(turn as usize + k as usize) % 4],
            edge,
            streak,
            id,
        );
    }
    let d = vec2(p.x + p.y, p.x - p.y) / 0.13;
    let f = (d - d.floor()).min(1.0 - (d - d.floor())).min_element() * 0.13;
    let edge = f.min(r - 0.34).min(border - 0.10) / 0.009;
    let id = hash(d.x.floor() as i32, d.y.floor() as i32, 24);
    pane([1, 1, 4, 1][(id * 4.0) as usize % 4], edge, streak, id)
}
