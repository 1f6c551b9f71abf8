//! Choices among what shines against their densities, by chi-square.

use std::f32::consts::{PI, TAU};

use bytemuck::{Pod, Zeroable};
use chiaro::scene::{Environment, LightKind, Material, Scene};
use chiaro_gpu::Dispatch;
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::reference::path::EmitterData;
use chiaro_techniques::scene::SceneGpu;
use chiaro_testkit::{Bench, Stage, device_guaranteed};
use glam::{Vec2, Vec3};

use crate::chi_square::assert_drawn_as_expected;

const DRAWS: usize = 262_144;
/// Of `emitter_sample.cs.wesl`.
const CHOICES: u32 = 0;
const PLACES: u32 = 1;
const SKY: u32 = 2;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    from_ws: [f32; 3],
    what: u32,
    draws: u32,
    rows: u32,
    columns: u32,
    points: u32,
}

impl Case {
    fn new(what: u32, from_ws: Vec3) -> Self {
        Self { from_ws: from_ws.to_array(), what, draws: DRAWS as u32, rows: 0, columns: 0, points: 0 }
    }

    fn count(&self) -> usize {
        DRAWS + (self.rows * self.columns * self.points.pow(2)) as usize
    }
}

fn draw(scene: &Scene, turn_rad: f32, case: Case) -> Vec<[f32; 4]> {
    draw_under(Vec3::ZERO, scene, turn_rad, case)
}

/// Under a uniform sky, nits.
fn draw_under(sky: Vec3, scene: &Scene, turn_rad: f32, case: Case) -> Vec<[f32; 4]> {
    let gpu = device_guaranteed();
    let bench = Bench::new(&gpu);
    bench.set_frame(&FrameData { environment_turn: [turn_rad.cos(), turn_rad.sin()], ..FrameData::zeroed() });
    let loaded = SceneGpu::upload(&gpu, &bench.kit.scene_layout, scene).unwrap();
    let emitters = EmitterData::build(scene, &scene.pose(0.0)).under(sky).upload(&gpu).unwrap();
    let shader = ("tests/emitter_sample.cs.wesl", include_str!("wesl/emitter_sample.cs.wesl"));
    let buffer = bench.buffer("case_", &[case]);
    let binds = [("case_", (&buffer).into()), ("emitters", (&emitters.words).into())];
    let work = (Dispatch::Threads([65_536, case.count().div_ceil(65_536) as u32, 1]), case.count());
    bench.run(shader, &[], Some(&loaded), &binds, work)
}

fn shining(stage: &mut Stage, nits: f32) -> usize {
    stage.material(Material { emissive: Vec3::splat(nits), ..Material::default() })
}

/// A map whose texels differ by three orders of magnitude.
fn sky(columns: u32, rows: u32) -> Environment {
    let nits = |i: u32| if i == 5 * columns + 3 { 300.0 } else { 0.1 + (i * 7 % 13) as f32 };
    let radiance = (0..columns * rows).map(|i| Vec3::splat(nits(i))).collect();
    Environment { name: "test".into(), width: columns, height: rows, radiance }
}

/// Three lights, six triangles, the sky.
const EMITTERS: usize = 10;

#[test]
fn emitters_are_chosen_as_often_as_their_share_says() {
    let mut stage = Stage::new();
    stage.sun(3.0, Vec3::NEG_Y);
    stage.light(LightKind::Spot { inner_rad: 0.2, outer_rad: 0.4 }, 20.0, None, Vec3::Y, Vec3::NEG_Y);
    stage.light(LightKind::Point, 2.0, None, Vec3::Y, Vec3::NEG_Y);
    for (size, nits) in [(0.1, 5.0), (1.0, 2.0), (0.5, 0.5)] {
        let lamp = shining(&mut stage, nits);
        stage.quad(Vec3::Y * size, Vec3::X * size, Vec3::Z * size, lamp);
    }
    stage.scene.environment = Some(sky(8, 4));
    let drawn = draw(&stage.scene, 0.0, Case::new(CHOICES, Vec3::ZERO));
    let mut shares = [0.0; EMITTERS];
    // What is left of the random number is even in each.
    let mut cells = vec![(0.0, 0.0); 4 * EMITTERS];
    for [index, share, rest, _] in drawn {
        let index = index as usize;
        shares[index] = f64::from(share);
        cells[4 * index + ((4.0 * rest) as usize).min(3)].0 += 1.0;
    }
    let sum = shares.iter().sum::<f64>();
    assert!((sum - 1.0).abs() < 1e-5, "{shares:?}");
    for (index, cell) in cells.iter_mut().enumerate() {
        cell.1 = shares[index / 4] * DRAWS as f64 / 4.0;
    }
    assert_drawn_as_expected(cells, &shares);
}

#[test]
fn places_on_lamps_are_drawn_evenly_over_their_area() {
    const CELLS: usize = 12;
    // Slanted and straight, of different light, and one that does not shine where they are seen from.
    let lamps = [
        (Vec3::new(0.0, 2.0, 0.0), Vec3::X, Vec3::new(0.6, 0.2, 0.7), 3.0),
        (Vec3::new(1.0, 1.0, -2.0), Vec3::X * 0.3, Vec3::Y * 0.2, 20.0),
        (Vec3::new(-2.0, 1.0, 0.0), Vec3::Y * 0.5, Vec3::Z * 0.5, 1.0),
    ];
    let mut stage = Stage::new();
    for (center, u, v, nits) in lamps {
        let lamp = shining(&mut stage, nits);
        stage.quad(center, u, v, lamp);
    }
    stage.light(LightKind::Point, 2.0, None, Vec3::Y, Vec3::NEG_Y);
    let from = Vec3::new(0.2, 0.1, 0.3);
    let mut cells = vec![(0.0, 0.0); lamps.len() * CELLS * CELLS + 1];
    let mut densities = [None; 3];
    for [x, y, z, pdf] in draw(&stage.scene, 0.0, Case::new(PLACES, from)) {
        let to = Vec3::new(x, y, z);
        // Where on which lamp, −1 to 1 along its sides.
        let place = lamps.iter().enumerate().find_map(|(index, &(center, u, v, _))| {
            let normal = u.cross(v);
            let at = from + to - center;
            let on = Vec2::new(at.cross(v).dot(normal), u.cross(at).dot(normal)) / normal.length_squared();
            let inside = on.abs().max_element() < 1.0001 && at.dot(normal).abs() < 1e-5;
            (pdf > 0.0 && inside).then_some((index, on, normal.normalize()))
        });
        let Some((index, on, normal)) = place else {
            assert!(pdf == 0.0, "{from} + {to} is on no lamp");
            cells[lamps.len() * CELLS * CELLS].0 += 1.0;
            continue;
        };
        let cell = (0.5 * on + 0.5) * CELLS as f32;
        let [column, row] = [cell.x, cell.y].map(|i| (i.max(0.0) as usize).min(CELLS - 1));
        cells[(index * CELLS + row) * CELLS + column].0 += 1.0;
        // Over the area, which must be the same everywhere.
        let density = pdf * normal.dot(to).abs() / to.length().powi(3);
        let first = *densities[index].get_or_insert(density);
        assert!((density / first - 1.0).abs() < 1e-3, "lamp {index}: {density} is not {first}");
    }
    for (index, (_, u, v, _)) in lamps.into_iter().enumerate() {
        let area = 4.0 * u.cross(v).length();
        let expected = f64::from(densities[index].unwrap() * area) * DRAWS as f64 / (CELLS * CELLS) as f64;
        cells[index * CELLS * CELLS..][..CELLS * CELLS].iter_mut().for_each(|cell| cell.1 = expected);
    }
    let on_lamps: f64 = cells.iter().map(|cell| cell.1).sum();
    cells.last_mut().unwrap().1 = DRAWS as f64 - on_lamps;
    assert_drawn_as_expected(cells, &densities);
}

#[test]
fn directions_of_the_sky_are_drawn_as_densely_as_they_say_however_it_is_turned() {
    let mut stage = Stage::floor(0.5);
    assert_sky_is_drawn_as_it_says(&stage.scene, Vec3::new(0.5, 2.0, 1.0));
    stage.scene.environment = Some(sky(TEXELS[0], TEXELS[1]));
    assert_sky_is_drawn_as_it_says(&stage.scene, Vec3::ZERO);
}

const TEXELS: [u32; 2] = [24, 12];

fn assert_sky_is_drawn_as_it_says(scene: &Scene, uniform: Vec3) {
    // Two cells a texel, whose edges stay such when the map is turned by an odd number of cells.
    let [columns, rows] = TEXELS.map(|n| 2 * n as usize);
    for turned in [0.0, 1.0, 17.0] {
        let turn_rad = turned * TAU / columns as f32;
        let grid =
            Case { rows: rows as u32, columns: columns as u32, points: 2, ..Case::new(SKY, Vec3::ZERO) };
        let answers = draw_under(uniform, scene, turn_rad, grid);
        let (drawn, grid) = answers.split_at(DRAWS);
        let mut cells = vec![(0.0, 0.0); rows * columns];
        for &[x, y, z, _] in drawn {
            let cell = |share: f32, count: usize| ((share * count as f32) as usize).min(count - 1);
            let around = cell((x.atan2(-z) / TAU).rem_euclid(1.0), columns);
            cells[cell(y.clamp(-1.0, 1.0).acos() / PI, rows) + rows * around].0 += 1.0;
        }
        let edge = |row: usize| f64::cos(row as f64 / rows as f64 * std::f64::consts::PI);
        for (index, points) in grid.chunks(4).enumerate() {
            let angle = (edge(index % rows) - edge(index % rows + 1)) * f64::from(TAU) / columns as f64;
            let density = points.iter().map(|p| f64::from(p[3])).sum::<f64>() / 4.0;
            cells[index].1 = density * angle * DRAWS as f64;
        }
        let whole: f64 = cells.iter().map(|cell| cell.1).sum();
        assert!((whole / DRAWS as f64 - 1.0).abs() < 1e-3, "{whole}");
        assert_drawn_as_expected(cells, &turned);
    }
}
