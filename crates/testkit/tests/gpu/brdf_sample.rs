//! Sampling of the BRDF against its own density, by chi-square.

use std::f32::consts::TAU;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::Dispatch;
use chiaro_testkit::{Bench, device};

use crate::chi_square::assert_drawn_as_expected;

const DRAWS: usize = 65_536;
/// Along the cosine and the angle, and points along each side of a cell.
const CELLS: [usize; 3] = [8, 16, 96];
const POINTS: usize = CELLS[2] * CELLS[2];

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    kind: u32,
    metallic: f32,
    roughness: f32,
    specular: f32,
    base: [f32; 3],
    cosine: f32,
    specular_color: [f32; 3],
    draws: u32,
    cells: [u32; 3],
    pad: u32,
}

fn case(kind: u32, metallic: f32, roughness: f32, cosine: f32) -> Case {
    Case {
        kind,
        metallic,
        roughness,
        specular: 1.0,
        base: [0.5, 0.3, 0.2],
        cosine,
        specular_color: if kind == 0 { [1.0; 3] } else { [0.4; 3] },
        draws: DRAWS as u32,
        cells: CELLS.map(|n| n as u32),
        pad: 0,
    }
}

/// Counted and expected draws per cell, the last those below the surface.
fn counts(bench: &Bench, case: Case) -> Vec<(f64, f64)> {
    let shader = ("tests/brdf_sample.cs.wesl", include_str!("wesl/brdf_sample.cs.wesl"));
    let buffer = bench.buffer("case_", &[case]);
    let [rows, columns, _] = CELLS;
    let count = DRAWS + rows * columns * POINTS;
    let work = (Dispatch::Threads([65_536, count.div_ceil(65_536) as u32, 1]), count);
    let answers: Vec<[f32; 4]> = bench.run(shader, &[], None, &[("case_", (&buffer).into())], work);
    let mut cells = vec![(0.0, 0.0); rows * columns + 1];
    for [x, y, z, _] in &answers[..DRAWS] {
        let cell = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
        let angle = (y.atan2(*x) / TAU).rem_euclid(1.0);
        let index = if *z <= 0.0 { rows * columns } else { cell(*z, rows) + rows * cell(angle, columns) };
        cells[index].0 += 1.0;
    }
    let angle = f64::from(TAU) / (rows * columns * POINTS) as f64;
    for (index, points) in answers[DRAWS..].chunks(POINTS).enumerate() {
        cells[index].1 = points.iter().map(|p| f64::from(p[3])).sum::<f64>() * angle * DRAWS as f64;
    }
    let above: f64 = cells.iter().map(|cell| cell.1).sum();
    cells[rows * columns].1 = DRAWS as f64 - above;
    cells
}

#[test]
fn directions_are_drawn_as_densely_as_they_say() {
    let gpu = device();
    let bench = Bench::new(&gpu);
    for (kind, metallic, roughness, specular) in [
        (0, 1.0, 0.25, 1.0),
        (0, 1.0, 0.6, 1.0),
        (0, 1.0, 1.0, 1.0),
        (0, 0.0, 0.4, 1.0),
        (0, 0.5, 0.8, 1.0),
        // Lambert.
        (0, 0.0, 0.5, 0.0),
        (1, 0.0, 0.5, 1.0),
        (1, 0.0, 0.9, 1.0),
        // Unlit: drawn from for nothing, but soundly.
        (2, 0.0, 0.5, 1.0),
    ] {
        for cosine in [0.15, 0.5, 0.95] {
            let case = Case { specular, ..case(kind, metallic, roughness, cosine) };
            assert_drawn_as_expected(counts(&bench, case), &case);
        }
    }
}
