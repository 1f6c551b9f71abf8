//! Sampling of rough interfaces against their own density, by chi-square, and their value against its mean.

use std::f32::consts::TAU;

use bytemuck::{Pod, Zeroable};
use chiaro::scene::Material;
use chiaro_gpu::Dispatch;
use chiaro_techniques::scene::SceneGpu;
use chiaro_testkit::{Bench, Stage, device};
use glam::{DVec3, Vec3};

use crate::chi_square::assert_drawn_as_expected;

const DRAWS: usize = 65_536;
/// Along the cosine, −1 to 1, and the angle.
const ROWS: usize = 16;
const COLUMNS: usize = 16;
/// Points along each side of a cell.
const SIDE: usize = 48;
const POINTS: usize = SIDE * SIDE;

/// Materials of the scene.
const VOLUME: u32 = 0;
const SHEET: u32 = 1;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    base: [f32; 3],
    roughness: f32,
    cosine: f32,
    transmission: f32,
    metallic: f32,
    material: u32,
    draws: u32,
    back: u32,
    rows: u32,
    columns: u32,
    points: u32,
    pad: [u32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    direction: [f32; 3],
    pdf: f32,
    value: [f32; 3],
    pad: f32,
}

fn scene(bench: &Bench, gpu: &chiaro::Gpu) -> SceneGpu {
    let mut stage = Stage::new();
    for thickness in [1.0, 0.0] {
        let material = Material { transmission: 1.0, ior: 1.5, thickness, ..Material::default() };
        let material = stage.material(material);
        stage.quad(Vec3::ZERO, Vec3::X, Vec3::Z, material);
    }
    SceneGpu::upload(gpu, &bench.kit.scene_layout, &stage.scene).unwrap()
}

fn assert_sampled_as_said(bench: &Bench, scene: &SceneGpu, case: &Case) {
    let shader = ("tests/bsdf_sample.cs.wesl", include_str!("wesl/bsdf_sample.cs.wesl"));
    let buffer = bench.buffer("case_", &[*case]);
    let count = DRAWS + ROWS * COLUMNS * POINTS;
    let work = (Dispatch::Threads([65_536, count.div_ceil(65_536) as u32, 1]), count);
    let binds = [("case_", (&buffer).into())];
    let answers: Vec<Answer> = bench.run(shader, &[], Some(scene), &binds, work);
    let (drawn, grid) = answers.split_at(DRAWS);

    // The last cell is that of draws that are lost: into the surface, or out of what they were to pass.
    let mut cells = vec![(0.0, 0.0); ROWS * COLUMNS + 1];
    for Answer { direction: [x, y, z], .. } in drawn {
        let cell = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
        let angle = (y.atan2(*x) / TAU).rem_euclid(1.0);
        let lost = [x, y, z] == [&0.0; 3];
        let index =
            if lost { ROWS * COLUMNS } else { cell(0.5 * z + 0.5, ROWS) + ROWS * cell(angle, COLUMNS) };
        cells[index].0 += 1.0;
    }
    let angle = 2.0 * f64::from(TAU) / grid.len() as f64;
    for (cell, points) in cells.iter_mut().zip(grid.chunks(POINTS)) {
        cell.1 = points.iter().map(|p| f64::from(p.pdf)).sum::<f64>() * angle * DRAWS as f64;
    }
    let found: f64 = cells.iter().map(|cell| cell.1).sum();
    cells[ROWS * COLUMNS].1 = DRAWS as f64 - found;
    assert_drawn_as_expected(cells, case);

    let sum = |all: &[Answer]| all.iter().map(|a| Vec3::from(a.value).as_dvec3()).sum::<DVec3>();
    let (sampled, quadrature) = (sum(drawn) / DRAWS as f64, sum(grid) * angle);
    let off = (sampled / quadrature - 1.0).abs().max_element();
    // Of power, nothing is gained.
    assert!(quadrature.max_element() < 1.002, "{quadrature}: {case:?}");
    // Noise of the draws: a quarter of that.
    assert!(off < 0.01, "{sampled} is not {quadrature}: {case:?}");
}

#[test]
fn rough_interfaces_scatter_as_densely_and_as_much_as_they_say() {
    let gpu = device();
    let bench = Bench::new(&gpu);
    let scene = scene(&bench, &gpu);
    for (material, back) in [(VOLUME, 0), (VOLUME, 1), (SHEET, 0)] {
        // From inside, 0.2 and 0.6 are beyond the critical angle of smooth glass.
        for (roughness, transmission, metallic) in [(0.3, 1.0, 0.0), (0.6, 1.0, 0.0), (0.8, 0.5, 0.2)] {
            for cosine in [0.2, 0.6, 0.95] {
                let case = Case {
                    base: [1.0, 0.5, 0.2],
                    roughness,
                    cosine,
                    transmission,
                    metallic,
                    material,
                    draws: DRAWS as u32,
                    back,
                    rows: ROWS as u32,
                    columns: COLUMNS as u32,
                    points: SIDE as u32,
                    pad: [0; 3],
                };
                assert_sampled_as_said(&bench, &scene, &case);
            }
        }
    }
}
