//! The mean over frames, against its formula.

use super::*;
use chiaro_techniques::indirect::accumulate::{Accumulate, AccumulateInputs, AccumulateRoom, Allowed};
use chiaro_techniques::view::MotionOutputs;

const SIZE: [u32; 2] = [20, 18];

/// What a frame has, for every pixel the same.
#[derive(Clone, Copy)]
struct Now {
    light: f32,
    depth: f32,
    normal: Vec3,
    // Pixels right and down, metres away, 1 where it was seen.
    moved: [f32; 4],
    allowed: f32,
}

const RESTS: Now =
    Now { light: 1.0, depth: 2.0, normal: Vec3::Z, moved: [0.0, 0.0, 0.0, 1.0], allowed: 32.0 };

struct Film<'a> {
    gpu: &'a Gpu,
    pass: Compiled<Accumulate>,
    pool: TexturePool,
    room: Option<AccumulateRoom>,
}

impl<'a> Film<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let pass = Compiled::new(&Bench::new(gpu).kit, ()).unwrap();
        Self { gpu, pass, pool: TexturePool::default(), room: None }
    }

    /// Light and age of all pixels after a frame, whose light may differ from pixel to pixel.
    fn frame(&mut self, now: Now, light: impl Fn(u32, u32) -> f32) -> Vec<[f32; 2]> {
        let gpu = self.gpu;
        let all = |texel: [f32; 4]| vec![texel; (SIZE[0] * SIZE[1]) as usize];
        let lit: Vec<[f32; 4]> = (0..SIZE[0] * SIZE[1])
            .map(|i| [light(i % SIZE[0], i / SIZE[0]), now.light, 0.5 * now.light, now.depth.log2()])
            .collect();
        let irradiance = texture(gpu, "irradiance", SIZE, TextureFormat::Rgba32Float, &lit);
        let normal = Vpl::new(Vec3::ZERO, now.normal, Vec3::ZERO, 0).normal;
        let words = vec![[normal, 0, 0, 0u32]; (SIZE[0] * SIZE[1]) as usize];
        let surface = texture(gpu, "surface", SIZE, TextureFormat::Rgba32Uint, &words);
        let motion = texture(gpu, "motion", SIZE, TextureFormat::Rgba32Float, &all(now.moved));
        let motion = MotionOutputs { motion, seen: surface.clone() };
        let room = self.pass.room(gpu, &self.pool, SIZE, &mut self.room);
        assert_eq!(room.age().options().width, SIZE[0]);
        let Some(room) = &mut self.room else { unreachable!("just made") };
        let allowed = Allowed { frames: now.allowed, history_scale: 1.0 };
        let inputs =
            AccumulateInputs { irradiance: &irradiance, surface: &surface, motion: &motion, allowed };
        let mut recorder = Recorder::new(gpu, false);
        let mut frame = recorder.begin();
        let steady = self.pass.record(&mut frame, &inputs, room);
        frame.submit();
        let age = texels::<1>(gpu, room.age());
        texels::<4>(gpu, &steady).iter().zip(age).map(|(light, [age])| [light[0], age]).collect()
    }

    /// The same, of one pixel for all.
    fn flat(&mut self, now: Now) -> [f32; 2] {
        let all = self.frame(now, |_, _| now.light);
        assert!(all.iter().all(|texel| *texel == all[0]), "all pixels are alike");
        all[0]
    }
}

/// What a pixel has after a frame, of what it had before.
fn twin([past, age]: [f32; 2], light: f32, allowed: f32) -> [f32; 2] {
    let drawn = past.clamp(0.75 * light, 1.25 * light);
    let age = age.min(allowed) / (1.0 + 12.0 * (past - drawn).abs() / drawn);
    [drawn + (light - drawn) / (age + 1.0), age + 1.0]
}

fn near([light, age]: [f32; 2], [expected, frames]: [f32; 2]) -> bool {
    (light / expected - 1.0).abs() < 2.0 * HALF_STEP && (age - frames).abs() < 1e-3 * frames
}

#[test]
fn frames_are_averaged_as_long_as_so_many_are_allowed_and_nothing_changes_much() {
    let gpu = chiaro_testkit::device_guaranteed();
    let mut film = Film::new(&gpu);
    // The last ones are other light: what is further outside than a quarter is drawn there, and is soon forgotten.
    let lights = [1.0, 1.1, 0.9, 1.05, 1.2, 1.0, 0.95, 1.1, 1.0, 3.0, 3.0, 3.2, 0.1, 0.1, 0.1];
    let mut expected = [lights[0], 1.0];
    for (number, light) in lights.into_iter().enumerate() {
        let allowed = if number < 6 { 32.0 } else { 4.0 };
        let found = film.flat(Now { light, allowed, ..RESTS });
        if number > 0 {
            expected = twin(expected, light, allowed);
        }
        assert!(near(found, expected), "frame {number}: {found:?}, not {expected:?}");
    }
    assert!((expected[0] / 0.1 - 1.0).abs() < 0.2, "{expected:?}: three frames after it went dark");
    assert_eq!(film.flat(Now { light: 2.0, allowed: 0.0, ..RESTS }), [2.0, 1.0], "without a past");
}

#[test]
fn other_depths_other_normals_and_what_was_not_seen_have_no_past() {
    let gpu = chiaro_testkit::device_guaranteed();
    let mut film = Film::new(&gpu);
    let now = Now { light: 1.2, ..RESTS };
    for (name, other, kept) in [
        ("the same", now, true),
        ("depth", Now { depth: 2.1, ..now }, false),
        // It came nearer by as much.
        ("depth and motion", Now { depth: 1.9, moved: [0.0, 0.0, -0.1, 1.0], ..now }, true),
        ("normal", Now { normal: Vec3::new(0.6, 0.0, 0.8), ..now }, false),
        ("out of sight", Now { moved: [0.0; 4], ..now }, false),
        ("out of the picture", Now { moved: [40.0, 0.0, 0.0, 1.0], ..now }, false),
        ("sky", Now { depth: 1e-18, ..now }, false),
    ] {
        film.flat(Now { allowed: 0.0, ..RESTS });
        let [light, age] = film.flat(other);
        let expected = if kept { [1.1, 2.0] } else { [1.2, if other.depth < 1e-9 { 0.0 } else { 1.0 }] };
        assert!((light - expected[0]).abs() < 2e-3 && age == expected[1], "{name}: {light} of {age} frames");
    }
}

#[test]
fn light_goes_along_with_what_moves() {
    let gpu = chiaro_testkit::device_guaranteed();
    let mut film = Film::new(&gpu);
    let wave = |x: f32| 1.0 + 0.1 * (x * 0.9).sin();
    film.frame(Now { allowed: 0.0, ..RESTS }, |x, _| wave(x as f32));
    // Two and a half pixels to the right, and this frame has it 5 % brighter.
    let moved = Now { moved: [2.5, 0.0, 0.0, 1.0], ..RESTS };
    let found = film.frame(moved, |x, _| 1.05 * wave(x as f32 - 2.5));
    for (i, [light, age]) in found.into_iter().enumerate() {
        let x = (i as u32 % SIZE[0]) as f32;
        let expected = if x < 1.0 { [1.05 * wave(x - 2.5), 1.0] } else { [1.025 * wave(x - 2.5), 2.0] };
        // At the border little is known.
        if !(1.0..3.0).contains(&x) {
            assert!((light - expected[0]).abs() < 0.012 && age == expected[1], "column {x}: {light}, {age}");
        }
    }
}
