//! Maps are drawn when what they show changes, and else rest.

use super::*;
use chiaro::scene::{LightKind, Scene};
use chiaro::{Handle, Recorder, View, ViewState};
use chiaro_gpu::BufferReadback;
use chiaro_testkit::{Stage, device};
use glam::Vec3;

const SIZE: [u32; 2] = [48, 32];

/// Two spots, each above a floor of its own.
fn two() -> Scene {
    let mut stage = Stage::new();
    let grey = stage.lambert(0.5);
    for x in [-2.0, 2.0] {
        stage.quad(Vec3::X * x, Vec3::X, Vec3::NEG_Z, grey);
        let kind = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.4 };
        stage.light(kind, 10.0, None, Vec3::new(x, 1.0, 0.0), Vec3::NEG_Y);
    }
    stage.scene
}

struct Film {
    studio: Studio,
    loaded: LoadedScene,
    state: ViewState,
    recorder: Recorder,
}

impl Film {
    fn new(scene: &Scene, changes: &[(&str, &str)]) -> Self {
        let gpu = device();
        let changes = [&[("indirect.rsm_resolution", "64"), ("indirect.vpls", "64")], changes].concat();
        let mut studio = Studio::new(&gpu, settings(&changes));
        let loaded = studio.load(scene);
        let state = ViewState::new(studio.renderer());
        Self { studio, loaded, state, recorder: Recorder::new(&gpu, false) }
    }

    /// Flux of each map, and how many of them a frame drew.
    fn frame(&mut self) -> ([f64; 2], usize) {
        let (words, drawn) = self.words("indirect/rsm", Vec3::new(0.0, 3.0, 4.0));
        let tile = |i: usize| f64::from(f32::from_bits(words[i]));
        ([0, 64].map(|first| (first..first + 64).map(tile).sum()), drawn)
    }

    /// What a frame seen from a place leaves in a buffer, and how many maps it drew.
    fn words(&mut self, name: &str, eye: Vec3) -> (Vec<u32>, usize) {
        let view = View::look_at(eye, Vec3::ZERO, 0.9, 0.05);
        let Self { studio, loaded, state, recorder } = self;
        let prepared =
            studio.renderer().prepare(state, loaded, &view, SIZE, chiaro::Sampling::Moving).unwrap();
        let mut frame = recorder.begin();
        prepared.record(&mut frame, true);
        let found = frame.resources().find(|resource| resource.name.to_string() == name).unwrap();
        frame.submit();
        let Handle::Buffer(buffer) = &found.handle else { panic!("a buffer") };
        let gpu = studio.renderer().gpu();
        let bytes = BufferReadback::start(gpu, buffer).wait(gpu).unwrap();
        (
            bytemuck::pod_collect_to_vec(&bytes),
            recorder.log().iter().filter(|pass| pass.name == "indirect/rsm").count(),
        )
    }

    fn dim(&mut self, scene: &mut Scene, candelas: [f32; 2]) {
        for (light, candelas) in scene.lights.iter_mut().zip(candelas) {
            light.intensity = candelas;
        }
        self.loaded.set_lights(scene);
    }
}

fn near(found: [f64; 2], expected: [f64; 2]) -> bool {
    found.iter().zip(&expected).all(|(found, expected)| (found / expected - 1.0).abs() < 1e-3)
}

#[test]
fn resting_maps_are_drawn_once_and_a_light_that_changes_draws_its_own() {
    let mut scene = two();
    let mut film = Film::new(&scene, &[]);
    let (flux, drawn) = film.frame();
    assert!(drawn == 2 && flux.iter().all(|lumens| *lumens > 0.0), "{drawn}: {flux:?}");
    for _ in 0..2 {
        assert_eq!(film.frame(), (flux, 0));
    }
    film.dim(&mut scene, [20.0, 10.0]);
    let (after, drawn) = film.frame();
    assert!(drawn == 1 && near(after, [2.0 * flux[0], flux[1]]), "{drawn}: {after:?}");
    assert_eq!(film.frame(), (after, 0));
    film.dim(&mut scene, [20.0, 40.0]);
    let (after, drawn) = film.frame();
    assert!(drawn == 1 && near(after, [2.0 * flux[0], 4.0 * flux[1]]), "{drawn}: {after:?}");
    // Kept are none that are not to be kept.
    film.studio.set(settings(&[
        ("indirect.rsm_resolution", "64"),
        ("indirect.vpls", "64"),
        ("indirect.rsm_cache", "false"),
    ]));
    assert_eq!([film.frame().1, film.frame().1], [2, 2]);
}

#[test]
fn a_light_that_goes_elsewhere_draws_its_map_there() {
    let mut scene = two();
    let mut film = Film::new(&scene, &[]);
    let (flux, _) = film.frame();
    let node = scene.nodes.iter().position(|node| node.light == Some(1)).unwrap();
    let turn = glam::Quat::from_rotation_arc(Vec3::NEG_Z, Vec3::NEG_Y);
    // Beside its floor.
    let pose = glam::Affine3A::from_rotation_translation(turn, Vec3::new(9.0, 1.0, 0.0));
    scene.nodes[node].parent_from_node = chiaro::scene::Transform::Matrix(pose);
    film.loaded.set_pose(&scene, &scene.pose(0.0)).unwrap();
    let (after, drawn) = film.frame();
    assert!(drawn == 1 && after == [flux[0], 0.0], "{drawn}: {after:?}");
    assert_eq!(film.frame(), (after, 0));
}

#[test]
fn of_two_lights_that_change_one_is_drawn_a_frame_in_turn() {
    let mut scene = two();
    let mut film = Film::new(&scene, &[("indirect.rsm_maps", "1")]);
    let (first, drawn) = film.frame();
    assert_eq!(drawn, 2, "what has not been drawn is");
    let mut shown = [10.0; 2];
    let mut before = None;
    for step in 1..7 {
        let candelas = 10.0 + f64::from(step);
        film.dim(&mut scene, [candelas as f32; 2]);
        let (flux, drawn) = film.frame();
        assert_eq!(drawn, 1, "step {step}");
        let now = [0, 1].map(|map| flux[map] / first[map] * 10.0);
        let changed: Vec<_> = [0, 1].into_iter().filter(|&map| (now[map] - shown[map]).abs() > 0.1).collect();
        assert_eq!(changed.len(), 1, "step {step}: {now:?} after {shown:?}");
        assert!((now[changed[0]] - candelas).abs() < 0.05);
        assert!(before != Some(changed[0]), "step {step}: the same again");
        (before, shown) = (Some(changed[0]), now);
    }
    // At rest what waited is drawn, then nothing.
    assert_eq!([film.frame().1, film.frame().1], [1, 0]);
}

#[test]
fn most_virtual_lights_stay_where_they_are_while_the_camera_goes() {
    let changes = [("indirect.vpls", "256"), ("indirect.rsm_resolution", "256"), ("indirect.history", "0")];
    let mut stage = Stage { scene: two() };
    let grey = stage.lambert(0.5);
    stage.quad(Vec3::new(0.0, 1.0, -1.0), Vec3::X * 3.0, Vec3::Y, grey);
    let mut film = Film::new(&stage.scene, &changes);
    let mut places = |step: u16| {
        let eye = Vec3::new(0.4 * f32::from(step), 3.0, 4.0);
        let count = film.words("indirect/vpl_count", eye).0[0] as usize;
        let (words, _) = film.words("indirect/vpls", eye);
        let all = words.chunks(8).take(count).map(|vpl| [vpl[0], vpl[1], vpl[2], vpl[7] & 0xffff]);
        all.collect::<std::collections::HashSet<_>>()
    };
    let all: Vec<_> = (0..12).map(&mut places).collect();
    let (mut stayed, mut of) = (0, 0);
    for pair in all.windows(2) {
        stayed += pair[1].intersection(&pair[0]).count();
        of += pair[1].len();
    }
    // With their blocks of points.
    assert!(stayed as f64 > 0.9 * of as f64, "{stayed} of {of} stay");
    assert!(all[11].intersection(&all[0]).count() < all[0].len(), "{stayed} of {of} stay");
}
