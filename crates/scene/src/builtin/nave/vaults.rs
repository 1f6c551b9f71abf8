//! Quadripartite rib vaults.
//!
//! Two pointed barrels cross over a bay; the web is whichever is higher. With the same curve scaled to either
//! span, height depends only on `s = min(|x|/a, |z|/b)`, and the groins stand exactly over the bay's diagonals.
//! In each of the four cells one coordinate does not matter: cells are ruled, and few triangles are exact.

use glam::{Vec2, Vec3, vec2, vec3};

use super::super::{
    arch::{PointedArch, planar_frames},
    shape::{CREASE_DEG, Joins, lathe, skin, sweep},
    solid::Solid,
};
use super::{
    materials::Palette,
    plan::{AISLE_AXIS, AISLE_CROWN, AISLE_WALL, ARCADE_SPRINGING, BAY, NAVE_WALL, VAULT},
};
use crate::Id;

/// A vault over a rectangle about the origin.
struct Vault {
    /// Half spans along x and z.
    half: Vec2,
    /// The webs run on into the walls past `half.x` by this.
    embed: f32,
    /// Springing and crown.
    heights: [f32; 2],
    /// Of the curve over a half span of 1.
    sharpness: f32,
    /// Of half an arch.
    segments: usize,
}

/// Thickness of the webs, metres, measured upwards.
const WEB: f32 = 0.25;

impl Vault {
    /// Points (s, height) from the springing at s = 1 to the crown at s = 0.
    fn curve(&self) -> Vec<Vec2> {
        let unit = PointedArch::new(1.0, self.sharpness);
        let [low, high] = self.heights;
        let scale = (high - low) / unit.rise();
        unit.points(self.segments)[..=self.segments].iter().map(|p| vec2(p.x, low + p.y * scale)).collect()
    }

    /// Both faces of the four cells and the edge between them: a closed shell.
    fn web(&self, material: Id) -> Solid {
        let curve = self.curve();
        let edge = self.half + vec2(self.embed, 0.0);
        let mut lower = Solid::default();
        let mut rim = Vec::new();
        for cell in 0..4 {
            // Quarter turns of "along x": the lateral cells follow z, the others x.
            let point = |s: f32, sign: f32, y: f32, outer: bool| {
                let (a, b) =
                    if cell % 2 == 0 { (self.half.x, self.half.y) } else { (self.half.y, self.half.x) };
                let reach = if cell % 2 == 0 { edge.x } else { edge.y };
                let (p, q) = (if outer { reach } else { a * s }, sign * b * s);
                match cell {
                    0 => vec3(p, y, q),
                    1 => vec3(-q, y, p),
                    2 => vec3(-p, y, -q),
                    _ => vec3(q, y, -p),
                }
            };
            for sign in [-1.0, 1.0] {
                let line = |outer| curve.iter().map(|c| point(c.x, sign, c.y, outer)).collect::<Vec<_>>();
                let (groin, wall) = (line(false), line(true));
                let cell = skin(&[groin, wall], Joins { ring: false, path: false }, |_| material);
                // From below, the half cell on one side runs the other way round.
                lower.append(if sign < 0.0 { cell.flipped() } else { cell });
            }
            // Around the rim: from the groin to the wall, up and over the crown, and back.
            let outer = |sign: f32| curve.iter().map(move |c| (c.x, sign, c.y));
            rim.push(point(1.0, -1.0, curve[0].y, false));
            rim.extend(outer(-1.0).map(|(s, sign, y)| point(s, sign, y, true)));
            rim.extend(outer(1.0).rev().skip(1).map(|(s, sign, y)| point(s, sign, y, true)));
        }
        let mut out = Solid::default();
        out.append(lower.clone().flipped().moved(vec3(0.0, WEB, 0.0)));
        out.append(lower);
        let top: Vec<Vec3> = rim.iter().map(|p| *p + vec3(0.0, WEB, 0.0)).collect();
        out.append(skin(&[top, rim], Joins { ring: true, path: false }, |_| material));
        out.smooth(CREASE_DEG).outward()
    }

    /// A rib under the curve in the vertical plane along `along` (horizontal, its length the half span).
    fn rib(&self, along: Vec3, origin: Vec3, profile: &[Vec2], segments: usize, material: Id) -> Solid {
        let curve = Self { segments, ..*self }.curve();
        let left = curve.iter().rev().skip(1).map(|c| vec2(-c.x, c.y));
        let line = curve.iter().copied().chain(left);
        let points: Vec<Vec3> = line.map(|c| origin + along * c.x + Vec3::Y * c.y).collect();
        let binormal = Vec3::Y.cross(along).normalize();
        sweep(profile, &planar_frames(&points, binormal, false), material)
    }
}

/// A rib's profile, hanging below the web: flanks, hollows and a fillet, `width` wide and `depth` deep.
fn rib_profile(width: f32, depth: f32) -> Vec<Vec2> {
    let half = [(0.5, 0.25), (0.5, -0.30), (0.30, -0.62), (0.17, -1.0)];
    let right = half.iter().map(|(x, y)| vec2(x * width, y * depth));
    let left = half.iter().rev().map(|(x, y)| vec2(-x * width, y * depth));
    right.chain(left).collect()
}

/// A flatter profile for the wide ribs between bays: two rolls with a fillet between.
fn transverse_profile(width: f32, depth: f32) -> Vec<Vec2> {
    let half = [(0.5, 0.25), (0.5, -0.42), (0.27, -0.62), (0.24, -0.90), (0.12, -1.0)];
    let right = half.iter().map(|(x, y)| vec2(x * width, y * depth));
    let left = half.iter().rev().map(|(x, y)| vec2(-x * width, y * depth));
    right.chain(left).collect()
}

/// A plain bevelled profile for the aisles.
fn slender_profile(width: f32, depth: f32) -> Vec<Vec2> {
    let half = [(0.5, 0.25), (0.5, -0.5), (0.2, -1.0)];
    let right = half.iter().map(|(x, y)| vec2(x * width, y * depth));
    let left = half.iter().rev().map(|(x, y)| vec2(-x * width, y * depth));
    right.chain(left).collect()
}

/// A keystone at the crown.
fn boss(radius: f32, crown: f32, m: &Palette) -> Solid {
    let profile = [(0.30, -0.43), (0.75, -0.40), (1.0, -0.32), (1.0, 0.1)];
    lathe(&profile.map(|(r, y)| vec2(r * radius, crown + y)), 10, m.trim)
}

fn nave_vault() -> Vault {
    Vault { half: vec2(3.95, BAY / 2.0), embed: 0.4, heights: VAULT, sharpness: 1.67, segments: 10 }
}

fn aisle_vault() -> Vault {
    let half = vec2((AISLE_WALL[0] - NAVE_WALL[1]) / 2.0 - 0.05, BAY / 2.0);
    Vault { half, embed: 0.3, heights: [ARCADE_SPRINGING, AISLE_CROWN], sharpness: 1.3, segments: 6 }
}

/// The middle of the aisle.
fn aisle_axis() -> Vec3 {
    vec3(AISLE_AXIS, 0.0, 0.0)
}

/// A bay of the nave's vault: webs, diagonal ribs, boss, ribs along the walls.
pub fn nave(m: &Palette) -> Solid {
    let vault = nave_vault();
    let mut out = vault.web(m.web);
    let profile = rib_profile(0.24, 0.27);
    let wall_profile = [vec2(0.12, 0.06), vec2(0.0, -0.15), vec2(-0.12, 0.06)];
    for side in [-1.0, 1.0] {
        let along = vec3(vault.half.x, 0.0, side * vault.half.y);
        out.append(vault.rib(along, Vec3::ZERO, &profile, 10, m.trim));
        let wall = vec3(side * (NAVE_WALL[0] - 0.02), -0.03, 0.0);
        let along = vec3(0.0, 0.0, vault.half.y);
        out.append(vault.rib(along, wall, &wall_profile, 8, m.trim));
    }
    out.append(boss(0.36, VAULT[1], m));
    out
}

/// A bay of the south aisle's vault.
pub fn aisle(m: &Palette) -> Solid {
    let vault = aisle_vault();
    let mut out = vault.web(m.web);
    let profile = slender_profile(0.18, 0.20);
    for side in [-1.0, 1.0] {
        let along = vec3(vault.half.x, 0.0, side * vault.half.y);
        out.append(vault.rib(along, Vec3::ZERO, &profile, 6, m.trim));
    }
    out.append(boss(0.24, AISLE_CROWN + 0.1, m));
    out.moved(aisle_axis())
}

/// The rib across the nave between two bays.
pub fn nave_transverse(m: &Palette) -> Solid {
    let vault = nave_vault();
    vault.rib(vec3(vault.half.x, 0.0, 0.0), Vec3::ZERO, &transverse_profile(0.46, 0.34), 10, m.trim)
}

/// The rib across the south aisle between two bays.
pub fn aisle_transverse(m: &Palette) -> Solid {
    let vault = aisle_vault();
    let profile = slender_profile(0.36, 0.26);
    vault.rib(vec3(vault.half.x, 0.0, 0.0), aisle_axis(), &profile, 6, m.trim)
}
