//! Trees, leaves and grass: branches are closed tubes, leaves are cut out of cards by alpha.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3, vec2, vec3};

use super::{
    curve::tube,
    solid::Solid,
    stage::{Stage, plain},
    texture::{Noise, Surface, hash},
};
use crate::{AlphaMode, Id, Material, TextureRef};

/// Alpha from which on a leaf is there.
pub const CUTOFF: f32 = 0.5;

/// A sequence of pseudo-random numbers.
pub struct Dice {
    seed: u32,
    thrown: i32,
}

impl Dice {
    /// The same seed gives the same sequence.
    pub fn new(seed: u32) -> Self {
        Self { seed, thrown: 0 }
    }

    /// The next number, in −1..1.
    pub fn signed(&mut self) -> f32 {
        self.thrown += 1;
        2.0 * hash(self.thrown, 3, self.seed) - 1.0
    }

    /// The next number between two.
    pub fn between(&mut self, lo: f32, hi: f32) -> f32 {
        lo + (hi - lo) * (0.5 + 0.5 * self.signed())
    }
}

/// Paints a square with holes: `paint` gives linear colour, relief in metres and alpha at (u, v), v downwards.
fn cutout(
    stage: &mut Stage,
    name: &str,
    size: u32,
    paint: impl Fn(Vec2) -> (Vec3, f32) + Sync,
) -> TextureRef {
    stage.image(Surface::paint(size, paint).cutout(name), 1.0)
}

fn masked(stage: &mut Stage, name: &str, picture: TextureRef, roughness: f32) -> Id {
    stage.material(Material {
        base_color_texture: Some(picture),
        alpha: AlphaMode::Mask { cutoff: CUTOFF },
        double_sided: true,
        ..plain(name, Vec3::ONE, roughness)
    })
}

/// A sharp edge where `inside_px` pixels inside.
fn coverage(inside_px: f32) -> f32 {
    inside_px + 0.5
}

/// A twig with pointed leaves on both sides, growing from the picture's lower middle to its top.
pub fn leaf_material(stage: &mut Stage, name: &str, green: Vec3, autumn: f32) -> Id {
    const SIZE: u32 = 512;
    let veins = Noise::new(SIZE, glam::ivec2(24, 24), 3, 5);
    let picture = cutout(stage, name, SIZE, |uv| {
        let p = vec2(uv.x - 0.5, 1.0 - uv.y);
        let mut best = (-1.0f32, 0.0f32, 0.0f32);
        for k in 0..11 {
            let (side, at) = (if k % 2 == 0 { 1.0 } else { -1.0 }, 0.10 + 0.072 * k as f32);
            let last = k == 10;
            let angle = if last { 90.0f32 } else { 90.0 - side * (62.0 - 2.5 * k as f32) };
            let along = Vec2::from_angle(angle.to_radians());
            let from = vec2(0.012 * side, if last { 0.78 } else { at });
            let length = if last { 0.21 } else { 0.36 - 0.013 * k as f32 };
            let q = p - from;
            let (s, t) = (q.dot(along) / length, q.perp_dot(along) / length);
            // A lens, widest at two fifths of its length.
            let wide = if (0.0..1.0).contains(&s) { 0.29 * (s.powf(0.62) * (1.0 - s)) * 2.05 } else { -1.0 };
            let inside = (wide - t.abs()) * length;
            if inside > best.0 {
                let rib = 1.0 - (t.abs() * length / 0.0035).min(1.0);
                best = (inside, k as f32, rib);
            }
        }
        let stem = 0.006 - p.x.abs();
        let on_stem = stem > best.0 && p.y < 0.8;
        let inside = if p.y < 0.8 { best.0.max(stem) } else { best.0 };
        let tone = 1.0 + 0.45 * (hash(best.1 as i32, 2, 7) - 0.5) + 0.5 * veins.at(uv) + 0.30 * best.2;
        let gold = green.lerp(vec3(0.42, 0.26, 0.03), autumn * hash(best.1 as i32, 5, 8));
        let color = if on_stem { vec3(0.16, 0.11, 0.05) } else { gold * tone };
        (color, coverage(inside * SIZE as f32))
    });
    masked(stage, name, picture, 0.7)
}

/// A tuft of grass blades, rooted at the picture's lower edge.
pub fn grass_material(stage: &mut Stage, name: &str, color: Vec3) -> Id {
    const SIZE: u32 = 512;
    let picture = cutout(stage, name, SIZE, |uv| {
        let (x, y) = (uv.x, 1.0 - uv.y);
        let mut best = (-1.0f32, 0.0f32);
        for k in 0..26 {
            let root = 0.22 + 0.56 * hash(k, 1, 31);
            let height = 0.45 + 0.5 * hash(k, 2, 31);
            let lean = (hash(k, 3, 31) - 0.5) * 0.9 + 0.5 * (root - 0.5);
            let s = y / height;
            if s >= 1.0 {
                continue;
            }
            let middle = root + lean * s * s * height;
            let inside = 0.012 * (1.0 - s).powf(0.7) - (x - middle).abs() * 0.8;
            if inside > best.0 {
                best = (inside, k as f32);
            }
        }
        let tone = 0.55 + 0.6 * y + 0.5 * (hash(best.1 as i32, 4, 31) - 0.5);
        let dry = vec3(0.40, 0.33, 0.13);
        (color.lerp(dry, 0.8 * hash(best.1 as i32, 6, 31) * y) * tone, coverage(best.0 * SIZE as f32))
    });
    masked(stage, name, picture, 0.75)
}

/// A card that shows the whole picture: from `root` along `up` (its height) with `right` its whole width.
pub fn card(root: Vec3, up: Vec3, right: Vec3, material: Id) -> Solid {
    let (a, b) = (root - right / 2.0, root + right / 2.0);
    let uv = [vec2(0.0, 1.0), vec2(1.0, 1.0), vec2(1.0, 0.0), vec2(0.0, 0.0)];
    let mut out = Solid::default();
    out.quad([a, b, b + up, a + up], uv, material);
    out
}

/// How a kind of tree grows.
#[derive(Clone, Copy)]
pub struct Tree {
    /// Length of the trunk, metres.
    pub trunk_m: f32,
    /// Its radius at the ground, metres.
    pub radius_m: f32,
    /// Angle between a branch and its parent, degrees.
    pub spread_deg: f32,
    /// Side of a leaf card, metres.
    pub leaf_m: f32,
    /// Cards on each outermost branch.
    pub leaves: usize,
    /// Bark and leaf materials.
    pub materials: [Id; 2],
    /// Picks the individual.
    pub seed: u32,
}

/// How often branches divide.
const LEVELS: usize = 4;
/// Children of a branch by its level, and how long they are relative to it.
const CHILDREN: [(usize, f32); LEVELS - 1] = [(6, 0.62), (5, 0.55), (4, 0.55)];

impl Tree {
    /// The tree, its foot a little below y = 0.
    pub fn grow(&self) -> Solid {
        let mut out = Solid::default();
        let mut dice = Dice::new(self.seed);
        let lean = vec3(0.12 * dice.signed(), 1.0, 0.12 * dice.signed()).normalize();
        self.branch(vec3(0.0, -0.12, 0.0), lean, self.trunk_m, self.radius_m, 0, &mut dice, &mut out);
        out
    }

    #[allow(clippy::too_many_arguments)]
    fn branch(
        &self,
        from: Vec3,
        direction: Vec3,
        length_m: f32,
        radius_m: f32,
        level: usize,
        dice: &mut Dice,
        out: &mut Solid,
    ) {
        let steps = [9, 6, 4, 3][level];
        let mut points = vec![from];
        let mut way = direction;
        for _ in 0..steps {
            let bend = vec3(dice.signed(), dice.signed(), dice.signed()) * [0.13, 0.22, 0.25, 0.2][level];
            // Branches turn to the light.
            way = (way + bend + Vec3::Y * [0.0, 0.10, 0.08, 0.02][level]).normalize();
            points.push(points[points.len() - 1] + way * length_m / steps as f32);
        }
        let taper = |t: f32| {
            let flare = if level == 0 { 0.7 * (-9.0 * t).exp() } else { 0.0 };
            radius_m * (1.0 - 0.62 * t + flare)
        };
        let at = |t: f32| {
            let s = (t * steps as f32).min(steps as f32 - 1e-3);
            points[s as usize].lerp(points[s as usize + 1], s.fract())
        };
        let sides = [14, 9, 6, 4][level];
        out.append(tube(&points, |i| taper(i as f32 / steps as f32), sides, self.materials[0]));
        if level + 1 == LEVELS {
            for i in 0..self.leaves {
                let t = (i as f32 + 0.6) / self.leaves as f32;
                let spin = Quat::from_axis_angle(way, 2.4 * i as f32 + dice.signed());
                let up = (way * 0.5 + spin * way.any_orthonormal_vector() + Vec3::Y * 0.15).normalize();
                let size = self.leaf_m * dice.between(0.75, 1.15);
                let right =
                    up.cross(vec3(dice.signed(), dice.signed() + 0.8, dice.signed())).normalize_or(Vec3::X);
                out.append(card(at(t), up * size, right * size, self.materials[1]));
            }
            return;
        }
        let (children, shorter) = CHILDREN[level];
        let turn = dice.between(0.0, TAU);
        for i in 0..children {
            let t = [0.42, 0.30, 0.25][level]
                + (1.0 - [0.42, 0.30, 0.25][level]) * (i as f32 + 0.7) / children as f32;
            let spin = Quat::from_axis_angle(way, turn + 2.399_963 * i as f32);
            let aside = spin * way.any_orthonormal_vector();
            let spread = (self.spread_deg + 14.0 * dice.signed()).to_radians() * (1.15 - 0.5 * t);
            let child = (way * spread.cos() + aside * spread.sin()).normalize();
            let length = length_m * shorter * dice.between(0.8, 1.15);
            self.branch(at(t.min(1.0)), child, length, taper(t) * 0.62, level + 1, dice, out);
        }
    }
}

/// Upright crossed cards of grass, `height_m` tall, rooted at a place.
pub fn tuft(at: Vec3, height_m: f32, material: Id, dice: &mut Dice) -> Solid {
    let turn = dice.between(0.0, TAU);
    let mut out = Solid::default();
    for k in 0..2 {
        let around = Vec2::from_angle(turn + k as f32 * 1.7);
        let right = vec3(around.x, 0.0, around.y) * height_m * 1.3;
        let lean = vec3(0.18 * dice.signed(), 1.0, 0.18 * dice.signed());
        out.append(card(at - Vec3::Y * 0.02, lean * height_m, right, material));
    }
    out
}

/// Bark with long furrows along v.
pub fn bark_material(stage: &mut Stage, name: &str, color: Vec3, seed: u32) -> Id {
    let furrows = Noise::new(512, glam::ivec2(22, 5), 4, seed);
    let clouds = Noise::new(512, glam::ivec2(4, 4), 4, seed + 9);
    let paint = Surface::paint(512, |uv| {
        let ridge = 1.0 - 2.2 * furrows.at(uv).abs();
        let cloud = clouds.at(uv);
        (color * (0.55 + 0.55 * ridge + 0.6 * cloud), 0.012 * ridge + 0.004 * cloud)
    });
    let [base_color_texture, normal_texture] = stage.surface(name, &paint, 0.8);
    stage.material(Material { base_color_texture, normal_texture, ..plain(name, Vec3::ONE, 0.9) })
}
