//! A gold bangle on an open book under a lamp: the heart-shaped caustic of a reflecting ring.

use glam::{Affine2, Vec2, Vec3, vec2, vec3};

use super::{
    arch::planar_frames,
    shape::{bevelled, circle, lathe, loft, sweep_round},
    solid::Solid,
    stage::{Stage, metal, plain, spot},
    tabletop::{TOP, surround, table, wooden},
    texture::{Noise, Surface, hash},
};
use crate::{Id, Material, Scene, TextureRef};

/// Width and height of a page, metres.
const PAGE: Vec2 = vec2(0.150, 0.216);
/// Where the book's spine lies on the table.
const BOOK: Vec3 = vec3(-0.04, TOP, 0.02);
/// How high the pages' flat part lies over the table.
const PAGES_M: f32 = 0.0215;

/// Builds the scene.
pub fn build() -> Scene {
    let mut stage = Stage::new("ring");
    let oak = wooden(&mut stage, "walnut", vec3(0.155, 0.082, 0.040), 0.42, 6);
    table(&mut stage, oak, vec3(0.30, 0.33, 0.33));
    book(&mut stage);

    // Polished: what is rougher throws no caustic.
    let gold = stage.material(metal("gold", vec3(1.0, 0.766, 0.336), 0.0));
    let silver = stage.material(metal("silver", vec3(0.972, 0.960, 0.915), 0.0));
    let page = BOOK + Vec3::Y * PAGES_M;
    let bangle = stage.mesh("bangle", band(0.0320, 0.0030, 0.022, 256, gold));
    stage.place(bangle, page + vec3(0.082, 0.011, 0.012), false);
    let ring = stage.mesh("finger ring", band(0.0091, 0.0016, 0.0052, 128, silver));
    stage.place(ring, page + vec3(-0.055, 0.0026, 0.052), false);
    pencil(&mut stage);

    surround(&mut stage, 0.55, vec3(150.0, 130.0, 95.0));
    // A desk lamp: behind the ring to the left, so that the light it throws back falls towards the viewer.
    let from = BOOK + vec3(-0.30, 0.42, -0.34);
    let target = page + vec3(0.070, 0.0, 0.01);
    stage.light("lamp", spot(16.0, 42.0), vec3(1.0, 0.82, 0.60), 420.0, from, target);

    let look = page + vec3(0.068, 0.004, 0.016);
    stage.camera("ring", look + vec3(0.09, 0.17, 0.21), look, 34.0);
    stage.camera("book", BOOK + vec3(0.10, 0.46, 0.52), BOOK + vec3(0.015, 0.0, -0.01), 36.0);
    stage.camera("above", look + vec3(0.0, 0.30, 0.06), look, 30.0);
    stage.scene
}

/// A band of this inner radius, thickness and height about the vertical, its edges rounded.
fn band(radius_m: f32, thick_m: f32, height_m: f32, sides: usize, material: Id) -> Solid {
    let path: Vec<Vec3> =
        circle(sides, radius_m + thick_m / 2.0).iter().map(|p| vec3(p.x, 0.0, -p.y)).collect();
    // A superellipse: nearly upright walls and soft edges.
    let round = |x: f32| x.signum() * x.abs().powf(0.42);
    let profile: Vec<Vec2> =
        circle(56, 1.0).iter().map(|p| vec2(round(p.x) * height_m, round(p.y) * thick_m) / 2.0).collect();
    sweep_round(&profile, &planar_frames(&path, Vec3::Y, true), material)
}

/// An open book: a cover and two blocks of pages.
fn book(stage: &mut Stage) {
    let cloth = stage.material(plain("cover cloth", vec3(0.16, 0.022, 0.020), 0.8));
    let edge = stage.material(plain("page edges", vec3(0.70, 0.64, 0.52), 0.95));
    let image = printed(1024).base_color("page");
    let print = stage.image(image, 1.0);
    let scale = Affine2::from_scale(1.0 / PAGE);
    // Both pages take one repeat of the picture each; the right one starts at u = 0.
    let shift = Affine2::from_translation(vec2(0.0, 0.5));
    let texture = TextureRef { uv_transform: shift * scale, ..print };
    let paper =
        stage.material(Material { base_color_texture: Some(texture), ..plain("paper", Vec3::ONE, 0.92) });

    let half = PAGE.y / 2.0;
    let cover = |side: f32| {
        let (a, b) = (side * 0.0015, side * (PAGE.x + 0.006));
        bevelled(vec3(a.min(b), 0.0, -half - 0.005), vec3(a.max(b), 0.0028, half + 0.005), 0.0008, cloth)
    };
    for side in [-1.0, 1.0] {
        stage.body("cover", cover(side).moved(BOOK));
        // From the gutter over the bulge to the fore edge.
        let height = |x: f32| {
            let rise = 1.0 - (-x / 0.011).exp();
            0.009 + (PAGES_M - 0.009) * rise
        };
        let steps = 48;
        let top = (0..=steps).map(|i| {
            let x = PAGE.x * (i as f32 / steps as f32).powf(1.6);
            vec2(side * x, height(x))
        });
        let mut outline: Vec<Vec2> = top.collect();
        outline.push(vec2(side * (PAGE.x + 0.002), 0.003));
        outline.push(vec2(0.0, 0.003));
        if side > 0.0 {
            outline.reverse();
        }
        let at = |z: f32| outline.iter().map(|p| p.extend(z)).collect::<Vec<_>>();
        let mut block = loft(&[at(-half), at(half)], 30.0, paper).planar_uv();
        for t in &mut block.triangles {
            let up = (t.p[1] - t.p[0]).cross(t.p[2] - t.p[0]).normalize_or_zero().y;
            if up < 0.3 {
                t.material = edge;
            }
        }
        stage.body("pages", block.moved(Vec3::ZERO));
        let node = stage.scene.nodes.len() - 1;
        stage.scene.nodes[node].parent_from_node =
            crate::Transform::Trs { translation: BOOK, rotation: glam::Quat::IDENTITY, scale: Vec3::ONE };
    }
}

/// A page of what looks like print: lines of words between margins, with an initial.
fn printed(size: u32) -> Surface {
    const LINES: f32 = 30.0;
    let fibres = Noise::new(size, glam::IVec2::splat(90), 3, 3);
    let stains = Noise::new(size, glam::IVec2::splat(4), 4, 8);
    Surface::paint(size, |uv| {
        let paper = vec3(0.80, 0.755, 0.65) * (1.0 + 0.05 * fibres.at(uv) + 0.10 * stains.at(uv));
        let (lo, hi) = (vec2(0.13, 0.10), vec2(0.87, 0.90));
        let at = (uv - lo) / (hi - lo);
        if at.min_element() < 0.0 || at.max_element() > 1.0 {
            return (paper, 0.0);
        }
        let line = (at.y * LINES) as i32;
        let y = (at.y * LINES).fract();
        // Letters are a fiftieth of the line wide; a paragraph's last line ends early.
        let letter = at.x * 62.0;
        let (cell, x) = (letter as i32, letter.fract());
        let last = hash(line, 5, 4) < 0.14;
        let space = hash(cell, line, 17) < 0.17 || (last && at.x > 0.25 + 0.5 * hash(line, 6, 4));
        let ink = !space && glyph(hash(cell, line, 23), x, y);
        (if ink { vec3(0.05, 0.045, 0.04) } else { paper }, 0.0)
    })
}

/// Whether ink is at (x, y) of a letter's cell, y downwards; `kind` in 0..1 picks the letter.
fn glyph(kind: f32, x: f32, y: f32) -> bool {
    let (top, base) = (0.42, 0.80);
    let stem = |at: f32, from: f32, to: f32| (x - at).abs() < 0.085 && (from..to).contains(&y);
    let bar = |at: f32| (y - at).abs() < 0.045 && (0.18..0.82).contains(&x);
    let bowl = || {
        let r = vec2((x - 0.5) / 0.36, (y - 0.61) / 0.19).length();
        (0.72..1.12).contains(&r)
    };
    match (kind * 9.0) as i32 {
        0 => bowl(),
        1 => bowl() || stem(0.16, 0.16, base),
        2 => bowl() || stem(0.84, 0.16, base),
        3 => stem(0.2, top, base) || (bar(0.45) && x > 0.2) || stem(0.8, top, base),
        4 => stem(0.5, top, base) || stem(0.5, 0.22, 0.30),
        5 => stem(0.5, 0.16, base),
        6 => bowl() && y < 0.7 || bar(0.62),
        7 => stem(0.45, 0.24, base) || bar(0.44),
        _ => stem(0.2, top, base) || bar(0.77) || stem(0.8, top, base),
    }
}

/// A pencil on the table beside the book.
fn pencil(stage: &mut Stage) {
    let paint = stage.material(plain("pencil paint", vec3(0.015, 0.06, 0.16), 0.35));
    let cedar = stage.material(plain("cedar", vec3(0.55, 0.33, 0.18), 0.8));
    let lead = stage.material(plain("graphite", vec3(0.05, 0.05, 0.055), 0.45));
    let profile = [(0.0037, 0.0), (0.0037, 0.150), (0.0012, 0.168), (0.0004, 0.173)];
    let mut solid = lathe(&profile.map(|(r, y)| vec2(r, y)), 6, paint);
    for t in &mut solid.triangles {
        let y = t.p.iter().map(|p| p.y).fold(0.0, f32::max);
        t.material = if y > 0.1685 {
            lead
        } else if y > 0.151 {
            cedar
        } else {
            paint
        };
    }
    let lying = glam::Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let at = vec3(0.245, TOP + 0.0037 * 0.866, 0.20);
    stage.body("pencil", solid.transformed(lying).turned(0.45).moved(at));
}
