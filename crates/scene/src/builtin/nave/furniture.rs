//! Steps, altar, candles, benches.

use glam::{Vec3, vec2, vec3};

use super::super::{
    shape::{bevelled, cuboid, lathe, prism},
    solid::Solid,
    stage::Stage,
};
use super::{
    materials::Palette,
    plan::{HALF_LENGTH, NAVE_WALL},
};
use crate::Id;

/// The lowest step of the choir.
const STEPS: f32 = -10.6;
/// The altar's middle.
const ALTAR_Z: f32 = -16.4;
const STEP: f32 = 0.16;

/// Places everything that stands on the floor.
pub fn place(stage: &mut Stage, m: &Palette) {
    let mut steps = Solid::default();
    let side = NAVE_WALL[0] - 0.02;
    for i in 0..3 {
        // Each step is a slab over the one below, so that none is hollow and no two tops share a plane.
        let (low, front) = (STEP * i as f32, STEPS - 0.38 * i as f32);
        let lo = vec3(-side, low - 0.1, -HALF_LENGTH - 0.1);
        steps.append(bevelled(lo, vec3(side, low + STEP, front), 0.015, m.marble));
    }
    let choir = 3.0 * STEP;
    for i in 0..2 {
        let (low, grow) = (choir + STEP * i as f32, 0.45 * (1 - i) as f32);
        let lo = vec3(-2.3 - grow, low - 0.1, ALTAR_Z - 1.0 - grow);
        let hi = vec3(2.3 + grow, low + STEP, ALTAR_Z + 1.35 + grow);
        steps.append(bevelled(lo, hi, 0.015, m.marble));
    }
    stage.body("steps", steps);

    let top = choir + 2.0 * STEP;
    let altar = altar(m).moved(vec3(0.0, top, ALTAR_Z));
    stage.body("altar", altar);
    let candle = stage.mesh("altar candle", candlestick(0.42, 0.30, m));
    for x in [-1.05, -0.7, 0.7, 1.05] {
        stage.place(candle, vec3(x, top + 1.04, ALTAR_Z - 0.22), false);
    }
    let stand = stage.mesh("candle stand", candlestick(1.45, 0.55, m));
    for (x, z) in [(1.9, ALTAR_Z + 0.9), (2.9, STEPS - 1.3)] {
        let y = if z > ALTAR_Z + 1.0 { choir } else { top };
        stage.place(stand, vec3(x, y, z), false);
        stage.place(stand, vec3(-x, y, z), false);
    }
    let bench = stage.mesh("bench", bench(m));
    for row in 0..8 {
        for x in [-2.05, 2.05] {
            stage.place(bench, vec3(x, 0.0, -8.8 + 1.0 * row as f32), false);
        }
    }
}

/// A block under a moulded slab, with a cloth, panels in front, and a cross behind.
fn altar(m: &Palette) -> Solid {
    let mut out = bevelled(vec3(-1.45, -0.05, -0.55), vec3(1.45, 0.14, 0.55), 0.03, m.marble);
    out.append(cuboid(vec3(-1.32, 0.1, -0.44), vec3(1.32, 0.90, 0.44), m.marble));
    out.append(bevelled(vec3(-1.40, 0.84, -0.50), vec3(1.40, 0.92, 0.50), 0.03, m.marble));
    out.append(bevelled(vec3(-1.50, 0.90, -0.56), vec3(1.50, 1.02, 0.56), 0.02, m.marble));
    // A runner over the slab that hangs down at both ends.
    out.append(bevelled(vec3(-1.53, 1.00, -0.40), vec3(1.53, 1.035, 0.40), 0.008, m.linen));
    for side in [-1.0f32, 1.0] {
        let (a, b) = (side * 1.505, side * 1.53);
        out.append(bevelled(vec3(a.min(b), 0.45, -0.40), vec3(a.max(b), 1.02, 0.40), 0.006, m.linen));
    }
    for i in -2..=2 {
        let x = 0.52 * i as f32;
        let arch = super::super::arch::PointedArch::new(0.19, 1.5).points(5);
        let mut outline = vec![vec2(x - 0.19, 0.22), vec2(x + 0.19, 0.22)];
        outline.extend(arch.iter().map(|p| vec2(x + p.x, 0.52 + p.y)));
        out.append(prism(&outline, 0.40, 0.475, m.shaft));
    }
    let foot =
        [(0.17, 0.0), (0.17, 0.03), (0.06, 0.08), (0.03, 0.14), (0.05, 0.20), (0.025, 0.26), (0.02, 0.30)];
    let at = vec3(0.0, 1.03, -0.22);
    out.append(lathe(&foot.map(|(r, y)| vec2(r, y)), 12, m.brass).moved(at));
    let beam = |lo: Vec3, hi: Vec3| bevelled(at + lo, at + hi, 0.01, m.brass);
    out.append(beam(vec3(-0.025, 0.27, -0.015), vec3(0.025, 1.05, 0.015)));
    out.append(beam(vec3(-0.24, 0.74, -0.014), vec3(0.24, 0.79, 0.014)));
    out
}

/// A turned brass stand of this height with a candle and its flame.
fn candlestick(height: f32, candle: f32, m: &Palette) -> Solid {
    let h = height;
    let thick = 0.5 + 0.35 * h;
    let profile = [
        (0.150, 0.0),
        (0.150, 0.025),
        (0.105, 0.05),
        (0.040, 0.10),
        (0.028, 0.16 * h + 0.06),
        (0.055, 0.18 * h + 0.08),
        (0.024, 0.22 * h + 0.09),
        (0.018, 0.52 * h),
        (0.045, 0.55 * h),
        (0.018, 0.58 * h),
        (0.022, h - 0.08),
        (0.085, h - 0.03),
        (0.090, h),
    ];
    let mut out = lathe(&profile.map(|(r, y)| vec2(r * thick, y)), 10, m.brass);
    let wax = [(0.028, h - 0.01), (0.028, h + candle - 0.01), (0.020, h + candle)];
    out.append(lathe(&wax.map(|(r, y)| vec2(r, y)), 8, m.wax));
    let flame = [(0.002, 0.008), (0.010, 0.022), (0.008, 0.040), (0.001, 0.065)];
    out.append(lathe(&flame.map(|(r, y)| vec2(r, h + candle + y)), 6, m.flame));
    out
}

/// An oak bench that looks to the altar (−z), about the middle of its seat.
fn bench(m: &Palette) -> Solid {
    let half = 1.25;
    let board = |lo: Vec3, hi: Vec3| bevelled(lo, hi, 0.008, m.oak);
    let mut out = cuboid(vec3(-half, 0.42, -0.22), vec3(half, 0.46, 0.20), m.oak);
    out.append(cuboid(vec3(-half, 0.50, 0.19), vec3(half, 0.90, 0.225), m.oak));
    out.append(board(vec3(-half, 0.88, 0.16), vec3(half, 0.925, 0.33)));
    out.append(cuboid(vec3(-half, 0.10, 0.22), vec3(half, 0.44, 0.245), m.oak));
    out.append(cuboid(vec3(-half, 0.08, -0.02), vec3(half, 0.43, 0.01), m.oak));
    for side in [-1.0, 1.0] {
        out.append(bench_end(m.oak).moved(vec3(side * half, 0.0, 0.0)));
    }
    out
}

/// A bench's carved end: a shaped board across x.
fn bench_end(material: Id) -> Solid {
    // (distance towards the back, height)
    let outline = [
        (-0.27, 0.0),
        (0.36, 0.0),
        (0.36, 0.92),
        (0.34, 1.00),
        (0.28, 1.06),
        (0.21, 1.06),
        (0.15, 1.01),
        (0.12, 0.90),
        (0.10, 0.72),
        (0.04, 0.62),
        (-0.08, 0.58),
        (-0.22, 0.57),
        (-0.27, 0.53),
    ];
    let flat = prism(&outline.map(|(z, y)| vec2(-z, y)), -0.035, 0.035, material);
    flat.turned(std::f32::consts::FRAC_PI_2)
}
