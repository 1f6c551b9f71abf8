//! Indirect light of pictures that move: it follows at once what changes much.

use chiaro::scene::{Animation, Channel, Interpolation, Keys, LightKind, Scene, Transform};
use chiaro::{Aov, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, device, direct, nmae};
use glam::{Quat, Vec3};

use crate::moving::frames;

const SIZE: [u32; 2] = [48, 36];

/// A hall of white walls whose lamp points at the left one, and from 1 s on at the right one.
fn searched() -> (Scene, View) {
    let mut stage = Stage::floor(0.7);
    let white = stage.lambert(0.7);
    for x in [-2.0f32, 2.0] {
        stage.quad(Vec3::new(x, 1.5, 0.0), Vec3::Z * -x.signum() * 3.0, Vec3::Y * 1.5, white);
    }
    stage.quad(Vec3::new(0.0, 1.5, -3.0), Vec3::X * 2.0, Vec3::Y * 1.5, white);
    let at = Vec3::new(0.0, 2.0, 0.0);
    let kind = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.5 };
    stage.light(kind, 100.0, None, at, Vec3::new(-1.0, -0.3, -0.4));
    let mut scene = stage.scene;
    let node = scene.nodes.len() - 1;
    let to = |direction: Vec3| Quat::from_rotation_arc(Vec3::NEG_Z, direction.normalize());
    let [left, right] = [-1.0, 1.0].map(|x| to(Vec3::new(x, -0.3, -0.4)));
    scene.nodes[node].parent_from_node = Transform::Trs { translation: at, rotation: left, scale: Vec3::ONE };
    let keys = Keys::Rotation(vec![left, right, right]);
    let channel = Channel { node, times_s: vec![0.0, 1.0, 2.0], interpolation: Interpolation::Step, keys };
    scene.animations.push(Animation { name: "jump".to_owned(), channels: vec![channel] });
    (scene, View::look_at(Vec3::new(0.0, 1.5, 4.5), Vec3::new(0.0, 1.2, 0.0), 0.9, 0.01))
}

/// Indirect light of frames at so many a second.
fn film(scene: &Scene, view: &View, changes: &[(&str, &str)], times_s: &[f64]) -> Vec<Image> {
    let few = [("indirect.vpls", "256"), ("indirect.rsm_resolution", "128"), ("post.antialias", "none")];
    let mut studio = Studio::new(&device(), direct(&[&few, changes].concat()));
    let mut loaded = studio.load(scene);
    let seen = times_s.iter().map(|time_s| (*time_s, view, SIZE));
    let found = frames(&mut studio, (scene, &mut loaded), seen, &[Aov::Indirect]);
    found.into_iter().map(|(_, mut aovs)| aovs.remove(0)).collect()
}

/// The mean over seeds of what a single frame shows.
fn truth(scene: &Scene, view: &View, technique: &str, time_s: f64) -> Image {
    const SEEDS: u32 = 24;
    let changes = [
        ("indirect.technique", technique),
        ("indirect.vpls", "256"),
        ("indirect.rsm_resolution", "128"),
        ("post.antialias", "none"),
    ];
    let mut studio = Studio::new(&device(), direct(&changes));
    let mut loaded = studio.load(scene);
    loaded.set_pose(scene, &scene.pose(time_s)).unwrap();
    let mut sum = vec![[0.0; 3]; (SIZE[0] * SIZE[1]) as usize];
    for seed in 1..=SEEDS {
        studio.set(chiaro::Settings { seed, ..direct(&changes) });
        let one = studio.aov(&loaded, view, SIZE, 1, Aov::Indirect);
        for (sum, pixel) in sum.iter_mut().zip(one.pixels()) {
            for c in 0..3 {
                sum[c] += pixel[c] / SEEDS as f32;
            }
        }
    }
    Image::from_pixels(SIZE[0], SIZE[1], sum).unwrap()
}

#[test]
fn after_a_light_jumps_the_error_is_back_within_three_frames() {
    let (scene, view) = searched();
    let times_s: Vec<f64> = (0..16).map(|frame| 0.5 + f64::from(frame) * 0.05).collect();
    // The tenth frame is at 1 s.
    let found = film(&scene, &view, &[("indirect.technique", "rsm")], &times_s);
    let [before, after] = [0.5, 1.1].map(|time_s| truth(&scene, &view, "rsm", time_s));
    let far = nmae(&before, &after);
    let [calm, jumped, back] = [(9, &before), (10, &after), (13, &after)].map(|(i, t)| nmae(&found[i], t));
    assert!(far > 0.5, "it makes a difference: {far}");
    assert!(jumped < 0.3 * far, "{jumped} at once, {far} without following");
    let single = nmae(&film(&scene, &view, &[("indirect.technique", "rsm")], &[1.1])[0], &after);
    assert!(back < 1.1 * single && calm < 0.1, "{back} then, {single} of a single frame, {calm} before");
}

#[test]
fn a_door_that_opens_lights_the_next_room_without_lag() {
    let scene = chiaro::scene::load("builtin:door").unwrap();
    let view = View::from_scene(&scene, 0).unwrap();
    let times_s: Vec<f64> = (0..14).map(|frame| 0.95 + f64::from(frame) / 12.0).collect();
    let [averaged, single] = ["32", "0"].map(|history| {
        let changes = [("indirect.technique", "traced"), ("indirect.history", history)];
        film(&scene, &view, &changes, &times_s)
    });
    let mean = |image: &Image| image.pixels().iter().flatten().sum::<f32>() / image.pixels().len() as f32;
    let grown = mean(&single[13]) / mean(&single[0]);
    assert!(grown > 3.0, "the room gets brighter: {grown}");
    for (frame, (a, b)) in averaged.iter().zip(&single).enumerate() {
        let ratio = mean(a) / mean(b);
        assert!((ratio - 1.0).abs() < 0.1, "frame {frame}: {ratio} of the light");
    }
}
