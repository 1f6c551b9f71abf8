//! Path-traced pictures of moments that trees and lamps have followed to.

use chiaro::scene::{Animation, Channel, Interpolation, Keys, Scene};
use chiaro::{Kit, LoadedScene, Recorder, Reference, ReferenceOptions, View};
use chiaro_techniques::shaders;
use chiaro_testkit::{Stage, camera_above, device_guaranteed, direct, place_below};
use glam::Vec3;

use crate::truth::{form_factor, lamp};

const SIZE: [u32; 2] = [48, 32];

/// The green of each pixel at a time, after a sample of every pixel at each of the times `before`, where trees follow. The
/// first time is that for which they are built.
fn traced(
    scene: &Scene,
    (view, size): (&View, [u32; 2]),
    (before, time_s): (&[f64], f64),
    (max_depth, samples): (u32, u32),
) -> Vec<f32> {
    let gpu = device_guaranteed();
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), &direct(&[]));
    let mut loaded = LoadedScene::upload(&kit, scene).unwrap();
    let options = ReferenceOptions { max_depth, seed: 1, ..ReferenceOptions::default() };
    let mut recorder = Recorder::new(&gpu, false);
    let stops: Vec<_> = before.iter().map(|&t| (t, 1)).chain([(time_s, samples)]).collect();
    loaded.set_pose(scene, &scene.pose(stops[0].0)).unwrap();
    let mut reference = Reference::new(&kit, (scene, &loaded), settings, (view, size), options).unwrap();
    for (index, (time_s, samples)) in stops.into_iter().enumerate() {
        if index > 0 {
            loaded.set_pose(scene, &scene.pose(time_s)).unwrap();
            reference.follow((scene, &loaded), settings, (view, size)).unwrap();
        }
        let mut frame = recorder.begin();
        reference.add(&mut frame, &loaded, samples);
        frame.submit();
    }
    let sum = reference.sum().unwrap().wait(&gpu).unwrap().floats();
    sum.as_chunks::<4>().0.iter().map(|texel| texel[1] / samples as f32).collect()
}

/// Mean of the differences, relative to the mean of `b`.
fn off(a: &[f32], b: &[f32]) -> f32 {
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>();
    differences / b.iter().sum::<f32>()
}

#[test]
fn a_traced_moment_is_that_of_the_scene_frozen_then() {
    let scene = crate::motion::moving();
    let frozen = crate::motion::frozen(&scene, 0.7);
    let of = |scene, times| traced(scene, (&crate::motion::view(), SIZE), times, (3, 4));
    let expected = of(&frozen, (&[], 0.0));
    let followed = of(&scene, (&[0.0, 1.0], 0.7));
    let built = of(&scene, (&[], 0.7));
    let at_rest = of(&scene, (&[], 0.0));
    assert!(off(&followed, &expected) < 0.01, "followed: {}", off(&followed, &expected));
    assert!(off(&built, &expected) < 0.01, "built: {}", off(&built, &expected));
    assert!(off(&at_rest, &expected) > 0.05, "nothing moved: {}", off(&at_rest, &expected));
}

#[test]
fn what_bends_without_an_animation_is_traced_with_the_normals_of_its_shape() {
    let scene = crate::motion::moving();
    for scene in [crate::motion::facetted(scene.clone()), scene] {
        let of = |scene: &Scene| traced(scene, (&crate::motion::view(), SIZE), (&[], 0.0), (2, 4));
        let expected = of(&crate::motion::frozen(&scene, 0.7));
        let found = of(&crate::motion::resting(&scene, 0.7));
        assert!(off(&found, &expected) < 0.002, "{}", off(&found, &expected));
    }
}

#[test]
fn a_lamp_that_grows_lights_as_its_form_factor_says() {
    const SIDE: u32 = 32;
    const HALF: f32 = 2.0;
    const ALBEDO: f32 = 0.6;
    // Twice as wide at the end as at the beginning.
    let mut stage = Stage::floor(ALBEDO);
    lamp(&mut stage, 1.0, 0.4);
    let node = stage.scene.nodes.len() - 1;
    let channel = Channel {
        node,
        times_s: vec![0.0, 1.0],
        interpolation: Interpolation::Linear,
        keys: Keys::Scale(vec![Vec3::new(0.5, 1.0, 0.5), Vec3::ONE]),
    };
    stage.scene.animations.push(Animation { name: String::new(), channels: vec![channel] });
    let view = camera_above(HALF);
    let image = traced(&stage.scene, (&view, [SIDE; 2]), (&[0.0], 1.0), (2, 256));
    for (x, y) in [(0, 0), (28, 0), (0, 28), (14, 0), (28, 14)] {
        let cells = || (0..16).map(|i| [x + i % 4, y + i / 4]);
        let found: f32 = cells().map(|[x, y]| image[(y * SIDE + x) as usize]).sum::<f32>() / 16.0;
        let seen = cells().map(|at| form_factor(place_below(at, SIDE, HALF), 1.0, 0.4));
        let expected = seen.sum::<f32>() / 16.0 * ALBEDO;
        assert!((found / expected - 1.0).abs() < 0.01, "{x} {y}: {found} is not {expected}");
    }
}

#[test]
fn what_is_moved_by_hand_is_traced_where_it_is() {
    let gpu = device_guaranteed();
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), &direct(&[]));
    let (scene, [_, pose]) = crate::motion::moved_by_hand();
    let image = (&crate::motion::view(), SIZE);
    let options = ReferenceOptions { max_depth: 2, seed: 1, ..ReferenceOptions::default() };
    let mut recorder = Recorder::new(&gpu, false);
    let mut take = |reference: &mut Reference, loaded: &chiaro::LoadedScene| {
        let mut frame = recorder.begin();
        reference.add(&mut frame, loaded, 4);
        frame.submit();
        let sum = reference.sum().unwrap().wait(&gpu).unwrap().floats();
        sum.as_chunks::<4>().0.iter().map(|texel| texel[1] / 4.0).collect::<Vec<_>>()
    };
    let standing = crate::motion::standing(&scene, &pose);
    let loaded = LoadedScene::upload(&kit, &standing).unwrap();
    let mut reference = Reference::new(&kit, (&standing, &loaded), settings, image, options).unwrap();
    let expected = take(&mut reference, &loaded);
    let mut loaded = LoadedScene::upload(&kit, &scene).unwrap();
    let mut reference = Reference::new(&kit, (&scene, &loaded), settings, image, options).unwrap();
    let at_rest = take(&mut reference, &loaded);
    loaded.set_pose(&scene, &pose).unwrap();
    reference.follow((&scene, &loaded), settings, image).unwrap();
    let followed = take(&mut reference, &loaded);
    let mut reference = Reference::new(&kit, (&scene, &loaded), settings, image, options).unwrap();
    let built = take(&mut reference, &loaded);
    assert!(off(&followed, &expected) < 1e-4, "followed: {}", off(&followed, &expected));
    assert!(off(&built, &expected) < 1e-4, "built: {}", off(&built, &expected));
    assert!(off(&at_rest, &expected) > 0.05, "nothing moved");
}

#[test]
fn trees_that_have_worn_are_built_anew_and_show_the_same() {
    let gpu = device_guaranteed();
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), &direct(&[]));
    let mut stage = Stage::new();
    stage.scene = crate::trace::ball();
    lamp(&mut stage, 3.0, 1.0);
    let scene = stage.scene;
    let image = (&crate::motion::view(), SIZE);
    let options = ReferenceOptions { max_depth: 2, seed: 1, ..ReferenceOptions::default() };
    let mut recorder = Recorder::new(&gpu, false);
    let mut loaded = LoadedScene::upload(&kit, &scene).unwrap();
    let mut reference = Reference::new(&kit, (&scene, &loaded), settings, image, options).unwrap();
    assert!(!reference.renew(&mut recorder, (&scene, &loaded)).unwrap(), "they were new");
    loaded.set_pose(&scene, &scene.pose(1.0)).unwrap();
    let mut pictures = Vec::new();
    for worn in [true, false] {
        reference.follow((&scene, &loaded), settings, image).unwrap();
        // What is recorded with trees that have worn, before any are built.
        let mut frame = recorder.begin();
        reference.add(&mut frame, &loaded, 4);
        frame.submit();
        pictures.push(reference.sum().unwrap().wait(&gpu).unwrap().floats());
        assert_eq!(reference.renew(&mut recorder, (&scene, &loaded)).unwrap(), worn);
    }
    assert!(pictures[0].iter().any(|value| *value > 0.0), "nothing is seen");
    assert_eq!(pictures[0], pictures[1]);
}
