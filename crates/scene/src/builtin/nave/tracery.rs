//! Stone bars in windows, in a wall panel's space (see `Panel` in `wall`).

use std::f32::consts::TAU;

use glam::{Vec2, Vec3, vec2};

use super::super::{
    arch::{Opening, PointedArch, planar_frames},
    shape::{sweep, sweep_round},
    solid::Solid,
};
use super::materials::Palette;

/// A bar's profile: x through the wall, y in its plane; a rhombus, so that it shows an edge and two faces.
fn bar_profile(half_depth: f32, half_width: f32) -> Vec<Vec2> {
    let (d, w) = (half_depth, half_width);
    vec![vec2(d, 0.0), vec2(0.0, w), vec2(-d, 0.0), vec2(0.0, -w)]
}

/// A bar along a line in the window's plane.
fn bar(points: &[Vec2], depth: f32, profile: &[Vec2], m: &Palette) -> Solid {
    let points: Vec<Vec3> = points.iter().map(|p| p.extend(-depth)).collect();
    sweep(profile, &planar_frames(&points, Vec3::Z, false), m.trim)
}

/// A bar round a circle.
fn ring(centre: Vec2, radius: f32, sides: usize, depth: f32, profile: &[Vec2], m: &Palette) -> Solid {
    let angle = |i: usize| Vec2::from_angle(TAU * i as f32 / sides as f32) * radius;
    let points: Vec<Vec3> = (0..sides).map(|i| (centre + angle(i)).extend(-depth)).collect();
    sweep_round(profile, &planar_frames(&points, Vec3::Z, true), m.trim)
}

/// Two lancets under a ring.
pub fn two_lights(opening: Opening, depth: f32, m: &Palette) -> Solid {
    let a = opening.arch.half_span;
    let profile = bar_profile(0.09, 0.055);
    let light = PointedArch::new(a / 2.0, 1.5);
    let springing = opening.springing - 0.1 * a;
    // Bars start inside the sill, so that no gap shows.
    let mut out = bar(&[vec2(0.0, opening.sill - 0.05), vec2(0.0, springing)], depth, &profile, m);
    for side in [-0.5, 0.5] {
        let line: Vec<Vec2> = light.points(4).iter().map(|p| *p + vec2(side * a, springing)).collect();
        out.append(bar(&line, depth, &profile, m));
    }
    let centre = vec2(0.0, opening.springing + 0.82 * a);
    out.append(ring(centre, 0.36 * a, 12, depth, &profile, m));
    out
}

/// A single mullion that forks into the head.
pub fn mullion(opening: Opening, depth: f32, m: &Palette) -> Solid {
    let a = opening.arch.half_span;
    let profile = bar_profile(0.08, 0.05);
    let mut out = bar(&[vec2(0.0, opening.sill - 0.05), vec2(0.0, opening.springing)], depth, &profile, m);
    for side in [-1.0, 1.0] {
        // Each branch repeats the head's own arc, started from the middle, until it meets the head.
        let half = opening.arch.points(opening.segments);
        let line = half[..=opening.segments].iter().map(|p| vec2((p.x - a) * side, p.y + opening.springing));
        let inside = line.filter(|p| opening.arch.height(p.x) + opening.springing > p.y - 0.12);
        out.append(bar(&inside.collect::<Vec<_>>(), depth, &profile, m));
    }
    out
}

/// A rose: hub, twelve spokes, two rows of arches, a ring of eyes.
pub fn rose(centre: Vec2, radius: f32, depth: f32, m: &Palette) -> Solid {
    let petals = 12;
    let strong = bar_profile(0.15, 0.075);
    let slender = bar_profile(0.10, 0.05);
    let r = radius;
    let polar = |distance: f32, turns: f32| centre + Vec2::from_angle(TAU * turns) * distance;
    let mut out = ring(centre, 0.20 * r, 24, depth, &strong, m);
    out.append(ring(centre, r, 48, depth, &strong, m));
    out.append(ring(centre, 0.09 * r, 12, depth, &slender, m));
    for i in 0..petals {
        let turn = (i as f32 + 0.5) / petals as f32;
        out.append(bar(&[polar(0.20 * r, turn), polar(0.62 * r, turn)], depth, &slender, m));
        // A pointed head over each petal, from spoke to spoke.
        let middle = i as f32 / petals as f32;
        let head = (0..=6).map(|k| {
            let t = k as f32 / 3.0 - 1.0;
            polar((0.62 + 0.16 * (1.0 - t.abs().powf(1.7))) * r, middle + t * 0.5 / petals as f32)
        });
        out.append(bar(&head.collect::<Vec<_>>(), depth, &slender, m));
        out.append(ring(polar(0.865 * r, turn), 0.115 * r, 10, depth, &slender, m));
        // A cusp across the middle of each petal.
        let cusp = (0..=4).map(|k| {
            let t = k as f32 / 2.0 - 1.0;
            polar((0.40 + 0.07 * (1.0 - t * t)) * r, middle + t * 0.5 / petals as f32)
        });
        out.append(bar(&cusp.collect::<Vec<_>>(), depth, &slender, m));
    }
    out
}

/// A pane behind tracery: thin, closed, so that it is seen from both sides.
pub fn pane(outline: &[Vec2], depth: f32, material: crate::Id) -> Solid {
    super::super::shape::prism(outline, -depth - 0.03, -depth, material)
}

/// A lancet's outline as a polygon.
pub fn lancet_outline(opening: Opening) -> Vec<Vec2> {
    opening.widened(0.06, opening.sill - 0.06).outline()
}

/// Thin bars across a lancet that carry its glass.
pub fn saddle_bars(opening: Opening, depth: f32, m: &Palette) -> Solid {
    let profile = bar_profile(0.03, 0.018);
    let a = opening.arch.half_span + 0.05;
    let mut out = Solid::default();
    let count = 4;
    for i in 1..=count {
        let y = opening.sill + (opening.springing - opening.sill) * i as f32 / count as f32;
        out.append(bar(&[vec2(-a, y), vec2(a, y)], depth, &profile, m));
    }
    out
}
