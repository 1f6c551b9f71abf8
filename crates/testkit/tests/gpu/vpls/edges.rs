//! Scenes with little or nothing in them, very small and very large ones; both pipelines.

use super::*;
use chiaro::scene::{LightKind, Mesh, Node, Primitive, Scene, Transform};
use chiaro::{Aov, Pipeline, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, device, nmae};
use glam::{Affine3A, Vec3};

const SIZE: [u32; 2] = [64, 48];
const TECHNIQUES: [&str; 3] = ["rsm", "ism", "traced"];

fn with(technique: &str, changes: &[(&str, &str)]) -> Settings {
    let few = [
        ("indirect.technique", technique),
        ("indirect.vpls", "64"),
        ("indirect.points", "4096"),
        ("indirect.points_per_vpl", "256"),
        ("indirect.ism_resolution", "32"),
        ("indirect.rsm_resolution", "64"),
    ];
    settings(&[&few, changes].concat())
}

/// A corner that a lamp shines into.
fn corner(light: Option<LightKind>) -> Stage {
    let mut stage = Stage::floor(0.7);
    let wall = stage.lambert(0.6);
    stage.quad(Vec3::new(0.0, 2.0, -1.5), Vec3::X * 4.0, Vec3::Y * 2.0, wall);
    stage.cuboid(Vec3::new(0.4, 0.4, 0.0), Vec3::splat(0.4), wall);
    if let Some(kind) = light {
        stage.light(kind, 10.0, None, Vec3::new(-0.5, 1.8, 0.6), Vec3::new(0.1, -1.0, -0.7));
    }
    stage
}

fn view(scale: f32) -> View {
    View::look_at(scale * Vec3::new(1.5, 1.5, 3.0), scale * Vec3::new(0.0, 0.5, 0.0), 0.9, 0.05 * scale)
}

fn indirect(studio: &mut Studio, scene: &Scene, view: &View) -> Image {
    let loaded = studio.load(scene);
    let [indirect] = studio.aovs(&loaded, view, SIZE, 2, [Aov::Indirect]);
    assert!(indirect.pixels().iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
    indirect
}

fn mean(image: &Image) -> f32 {
    image.pixels().iter().flatten().sum::<f32>() / (3 * image.pixels().len()) as f32
}

const SPOT: LightKind = LightKind::Spot { inner_rad: 0.4, outer_rad: 0.7 };

#[test]
fn without_light_there_is_none_and_nothing_breaks() {
    let gpu = device();
    let mut into_space = corner(None);
    into_space.light(SPOT, 10.0, None, Vec3::Y * 5.0, Vec3::Y);
    let mut point_alone = Stage::new();
    let material = point_alone.lambert(0.5);
    let flat = Primitive {
        positions: vec![Vec3::ZERO; 3],
        normals: vec![Vec3::Y; 3],
        uvs: [vec![glam::Vec2::ZERO; 3], Vec::new()],
        indices: vec![0, 1, 2],
        material,
        ..Primitive::default()
    };
    let mut line = point_alone.clone();
    let stretched = Primitive { positions: vec![Vec3::ZERO, Vec3::X, Vec3::X * 2.0], ..flat.clone() };
    point_alone.place(Mesh { primitives: vec![flat], ..Mesh::default() }, Affine3A::IDENTITY);
    line.place(Mesh { primitives: vec![stretched], ..Mesh::default() }, Affine3A::IDENTITY);
    for stage in [&mut point_alone, &mut line] {
        stage.light(SPOT, 10.0, None, Vec3::Y, Vec3::NEG_Y);
        stage.light(LightKind::Point, 10.0, None, Vec3::ZERO, Vec3::NEG_Y);
        stage.sun(10.0, Vec3::NEG_Y);
    }
    let cases = [
        ("no light", corner(None)),
        ("a light that meets nothing", into_space),
        ("a point", point_alone),
        ("a line", line),
    ];
    for technique in TECHNIQUES {
        let mut studio = Studio::new(&gpu, with(technique, &[]));
        for (name, stage) in &cases {
            let found = mean(&indirect(&mut studio, &stage.scene, &view(1.0)));
            assert_eq!(found, 0.0, "{technique}, {name}");
        }
    }
}

#[test]
fn one_virtual_light_and_odd_maps_give_light() {
    let gpu = device();
    for technique in TECHNIQUES {
        let mut studio = Studio::new(&gpu, with(technique, &[]));
        let right = mean(&indirect(&mut studio, &corner(Some(SPOT)).scene, &view(1.0)));
        assert!(right > 0.0);
        for (vpls, resolution) in [("1", "64"), ("2", "100"), ("64", "100"), ("64", "2048")] {
            // A large map is one of a scene that is seen once.
            if resolution == "2048" && technique != "rsm" {
                continue;
            }
            studio.set(with(technique, &[("indirect.vpls", vpls), ("indirect.rsm_resolution", resolution)]));
            let found = mean(&indirect(&mut studio, &corner(Some(SPOT)).scene, &view(1.0)));
            assert!(found > 0.0, "{technique}, {vpls} lights, {resolution}²");
            assert!(
                vpls != "64" || (found / right - 1.0).abs() < 0.15,
                "{technique}, {resolution}²: {found}, {right}"
            );
        }
    }
}

/// Everything under a node that scales it, and lights so that illuminance stays.
fn scaled(stage: Stage, scale: f32) -> Scene {
    let mut scene = stage.scene;
    for node in &mut scene.nodes {
        node.parent = Some(node.parent.map_or(0, |parent| parent + 1));
    }
    let parent_from_node = Transform::Matrix(Affine3A::from_scale(Vec3::splat(scale)));
    scene.nodes.insert(0, Node { parent_from_node, ..Node::default() });
    for light in scene.lights.iter_mut().filter(|light| light.kind != LightKind::Directional) {
        light.intensity *= scale * scale;
    }
    scene
}

#[test]
fn scenes_of_a_millimetre_and_of_ten_thousand_kilometres_get_the_same_light() {
    let gpu = device();
    for technique in TECHNIQUES {
        let mut studio = Studio::new(&gpu, with(technique, &[("indirect.vpls", "256")]));
        for light in [SPOT, LightKind::Directional, LightKind::Point] {
            let right = indirect(&mut studio, &corner(Some(light)).scene, &view(1.0));
            assert!(mean(&right) > 0.0);
            for scale in [1e-3, 1e7] {
                let found = indirect(&mut studio, &scaled(corner(Some(light)), scale), &view(scale));
                let off = nmae(&found, &right);
                let share = mean(&found) / mean(&right);
                // The sun's shadows end a little elsewhere, which moves the places of what comes after by as much.
                let (most_share, most) =
                    if light == LightKind::Directional { (0.05, 0.2) } else { (0.02, 0.03) };
                assert!(
                    (share - 1.0).abs() < most_share,
                    "{technique}, {light:?}, ×{scale}: {share} of the light"
                );
                assert!(off < most, "{technique}, {light:?}, ×{scale}: {off}");
            }
        }
    }
}

/// A closed room of two halves under one ceiling, of which a lamp shines into one, on ground of so many metres or none.
fn room_on(ground_m: f32) -> Stage {
    let mut stage = Stage::new();
    let wall = stage.lambert(0.6);
    for (at, half) in [
        (Vec3::NEG_Y * 0.05, Vec3::new(2.1, 0.05, 2.1)),
        (Vec3::Y * 2.05, Vec3::new(2.1, 0.05, 2.1)),
        (Vec3::new(-2.05, 1.0, 0.0), Vec3::new(0.05, 1.0, 2.1)),
        (Vec3::new(2.05, 1.0, 0.0), Vec3::new(0.05, 1.0, 2.1)),
        (Vec3::new(0.0, 1.0, -2.05), Vec3::new(2.1, 1.0, 0.05)),
        (Vec3::new(0.0, 1.0, 2.05), Vec3::new(2.1, 1.0, 0.05)),
        (Vec3::new(0.0, 0.75, 0.0), Vec3::new(0.05, 0.75, 2.0)),
    ] {
        stage.cuboid(at, half, wall);
    }
    if ground_m > 0.0 {
        stage.quad(Vec3::NEG_Y * 0.2, Vec3::X * 0.5 * ground_m, Vec3::NEG_Z * 0.5 * ground_m, wall);
    }
    stage.light(SPOT, 100.0, None, Vec3::new(-0.5, 1.6, 0.0), Vec3::new(-0.7, -1.0, 0.0));
    stage
}

#[test]
fn a_small_room_on_ground_of_kilometres_has_the_shadows_that_it_has_without() {
    let gpu = device();
    let denser = [
        ("indirect.points", "65536"),
        ("indirect.points_per_vpl", "4096"),
        ("indirect.ism_resolution", "64"),
    ];
    let mut studio = Studio::new(&gpu, with("ism", &denser));
    let eye = Vec3::new(1.8, 1.0, 1.5);
    let view = View::look_at(eye, Vec3::new(0.0, 0.6, -0.6), 1.2, 0.01);
    let mut seen = |ground_m: f32, eye: Vec3| {
        let scene = room_on(ground_m).scene;
        let mut loaded = studio.load(&scene);
        loaded.look_from(eye);
        studio.renderer().equip(&scene, &mut loaded).unwrap();
        studio.aov(&loaded, &view, SIZE, 4, Aov::Indirect)
    };
    let right = seen(0.0, eye);
    for ground_m in [1e3, 1e4] {
        let found = seen(ground_m, eye);
        let (share, off) = (mean(&found) / mean(&right), nmae(&found, &right));
        assert!(
            (share - 1.0).abs() < 0.03 && off < 0.05,
            "{ground_m} m: {share} of the light, {off} elsewhere"
        );
    }
    // As it was when the camera was far above: light comes through everything.
    let leaks = mean(&seen(1e4, Vec3::Y * 9e3)) / mean(&right);
    assert!(leaks > 1.3, "{leaks}");
}

#[test]
fn both_pipelines_get_the_same_light() {
    let gpu = device();
    let [forward, deferred] = [Pipeline::Forward, Pipeline::Deferred].map(|pipeline| {
        let mut studio = Studio::new(&gpu, Settings { pipeline, ..with("rsm", &[]) });
        mean(&indirect(&mut studio, &corner(Some(SPOT)).scene, &view(1.0)))
    });
    assert!(forward > 0.0 && (forward / deferred - 1.0).abs() < 0.01, "{forward} {deferred}");
}

#[test]
fn maps_of_many_lights_are_made_smaller_until_they_fit_and_it_is_told() {
    let gpu = device();
    let mut stage = corner(None);
    let few = 3;
    for i in 0..few {
        stage.light(LightKind::Point, 10.0, None, Vec3::new(-0.5, 1.8, 0.3 * i as f32), Vec3::NEG_Y);
    }
    let light = |resolution| {
        let mut studio = Studio::new(&gpu, with("rsm", &[("indirect.rsm_resolution", resolution)]));
        let found = mean(&indirect(&mut studio, &stage.scene, &view(1.0)));
        (found, studio.renderer().notes().to_vec())
    };
    // As a binding of any adapter may hold 128 MiB, and one of this may hold more: 18 maps of 1024² are more than either.
    let (small, told) = light("128");
    assert_eq!(told, [""; 0]);
    let (large, told) = light("2048");
    assert!(told.len() == 1 && told[0].contains("18 views"), "{told:?}");
    assert!((large / small - 1.0).abs() < 0.05, "{large} {small}");
}
