//! The parts of light: that they add up, and what each of them is.

use std::f32::consts::PI;

use chiaro::scene::{AlphaMode, Environment, LightKind, Material, Reflection};
use chiaro::{Pipeline, ReferenceOptions, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, ambient, camera_above, device, direct, nmae};
use glam::Vec3;

use crate::truth::trace;

const SIZE: [u32; 2] = [48, 36];
/// Nits a lux, red, green and blue.
pub const SKY: Vec3 = Vec3::new(0.058, 0.080, 0.115);

fn pipelines(changes: &[(&str, &str)]) -> [Settings; 2] {
    [("deferred", "1"), ("forward", "4")].map(|(pipeline, msaa)| {
        let mut settings = ambient();
        for (key, value) in [("pipeline", pipeline), ("surface.msaa", msaa)].iter().chain(changes) {
            settings.set(key, value).unwrap();
        }
        settings
    })
}

fn preset_direct(mut settings: Settings) -> Settings {
    settings.apply_preset("direct", None).unwrap();
    settings
}

/// A floor and on it what glows, mirrors, is unlit, and is seen through, of both kinds, under a sun or a map and a lamp.
fn everything(map: bool) -> (Stage, View) {
    let mut stage = Stage::floor(0.6);
    let mut stand = |x: f32, material: Material| {
        let material = stage.material(Material { double_sided: true, ..material });
        stage.quad(Vec3::new(x, 0.5, 0.0), Vec3::X * 0.4, Vec3::Y * 0.5, material);
    };
    let pane = Vec3::splat(0.5).extend(0.5);
    stand(-2.0, Material { emissive: Vec3::new(900.0, 300.0, 20.0), ..Material::default() });
    stand(-1.0, Material { metallic: 1.0, roughness: 0.3, ..Material::default() });
    stand(0.0, Material { reflection: Reflection::Unlit, ..Material::default() });
    stand(1.0, Material { alpha: AlphaMode::Blend, base_color: pane, ..Material::default() });
    stand(2.0, Material { transmission: 1.0, roughness: 0.2, ..Material::default() });
    stage.light(LightKind::Point, 300.0, None, Vec3::new(0.0, 2.0, 1.0), Vec3::NEG_Y);
    if map {
        let radiance = (0..8).map(|i| Vec3::new(50.0 * i as f32, 100.0, 200.0)).collect();
        stage.scene.environment = Some(Environment { name: "test".into(), width: 4, height: 2, radiance });
    } else {
        stage.sun(1000.0, Vec3::new(0.4, -1.0, -0.3));
    }
    (stage, View::look_at(Vec3::new(0.5, 1.6, 4.5), Vec3::new(0.0, 0.6, 0.0), 0.8, 0.05))
}

fn added(parts: &[Image; 3]) -> Image {
    Image::from_fn(SIZE[0], SIZE[1], |x, y| {
        [0, 1, 2].map(|c| parts.iter().map(|part| part.pixel(x, y)[c]).sum::<f32>())
    })
}

fn is_black(image: &Image) -> bool {
    image.pixels().iter().all(|pixel| *pixel == [0.0; 3])
}

#[test]
fn parts_add_up_to_the_picture_whatever_is_seen_and_shown() {
    let gpu = device();
    for settings in pipelines(&[]) {
        let mut studio = Studio::new(&gpu, settings.clone());
        for map in [false, true] {
            let what = format!("{:?}, map {map}", settings.pipeline);
            let (stage, view) = everything(map);
            let scene = studio.load(&stage.scene);
            let (picture, parts) = studio.parts(&scene, &view, SIZE, (3, false));
            let off = nmae(&added(&parts), &picture);
            assert!(off <= 1e-5, "{what}: {off}");
            assert!(!is_black(&parts[0]) && !is_black(&parts[1]) && is_black(&parts[2]), "{what}");

            // What is shown alone is what is seen of it beside the rest, and all of the picture.
            for (show, part) in [("direct", 0), ("indirect", 1)] {
                let mut alone = settings.clone();
                alone.set("camera.show", show).unwrap();
                studio.set(alone);
                let (picture, shown) = studio.parts(&scene, &view, SIZE, (3, false));
                let off = [nmae(&picture, &parts[part]), nmae(&added(&shown), &picture)];
                // Half floats hold the picture that indirect light is what is left of.
                assert!(
                    off[0] <= if part == 0 { 1e-6 } else { 0.01 } && off[1] <= 1e-5,
                    "{what}, {show}: {off:?}"
                );
                assert!(is_black(&shown[1 - part]), "{what}, {show}");
            }

            studio.set(preset_direct(settings.clone()));
            let (picture, parts) = studio.parts(&scene, &view, SIZE, (3, false));
            assert!(nmae(&parts[0], &picture) <= 1e-6 && is_black(&parts[1]), "{what}, preset direct");
            studio.set(settings.clone());
        }
    }
}

#[test]
fn parts_of_a_moving_picture_are_those_of_its_newest_frame() {
    let (stage, view) = everything(false);
    let mut studio = Studio::new(&device(), ambient());
    let scene = studio.load(&stage.scene);
    for _ in 0..3 {
        let (picture, parts) = studio.parts(&scene, &view, SIZE, (1, true));
        let off = nmae(&added(&parts), &picture);
        // Edges alone are elsewhere.
        assert!(off < 0.1 && !is_black(&parts[1]), "{off}");
    }
    // A still after it has none left.
    let still = studio.radiance(&scene, &view, SIZE, 1);
    assert_eq!(still.pixels(), studio.parts(&scene, &view, SIZE, (1, false)).0.pixels());
}

#[test]
fn direct_light_is_that_of_paths_of_two_edges() {
    let mut stage = Stage::new();
    let wall = stage.lambert(0.7);
    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
        for side in [1.0, -1.0] {
            let (u, v) = axis.any_orthonormal_pair();
            stage.quad(2.0 * side * axis, 2.0 * u, 2.0 * v, wall);
        }
    }
    stage.cuboid(Vec3::new(0.4, -1.5, -0.5), Vec3::splat(0.5), wall);
    stage.light(LightKind::Point, 100.0, None, Vec3::new(0.0, 1.5, 0.3), Vec3::NEG_Y);
    let view = View::look_at(Vec3::new(0.0, 0.2, 1.9), Vec3::new(0.0, -0.3, 0.0), 1.1, 0.05);
    let options = ReferenceOptions { max_depth: 2, ..ReferenceOptions::default() };
    let truth = trace(&stage.scene, (&view, SIZE), options, &[16]);
    let mut studio = Studio::new(&device(), ambient());
    let scene = studio.load(&stage.scene);
    let (_, [direct, indirect, _]) = studio.parts(&scene, &view, SIZE, (16, false));
    let off = nmae(&direct, &truth);
    assert!(off < 0.01, "{off}");
    assert!(nmae(&indirect, &truth) > 0.3);
}

#[test]
fn on_an_open_plane_direct_light_is_that_of_sun_and_sky() {
    const LUX: f32 = 1000.0;
    const ALBEDO: f32 = 0.6;
    let mut stage = Stage::floor(ALBEDO);
    let sun = Vec3::new(0.6, -1.0, 0.3).normalize();
    stage.sun(LUX, sun);
    let gpu = device();
    let of_sun = Vec3::splat(LUX * -sun.y * ALBEDO / PI);
    let of_sky = LUX * ALBEDO * SKY;
    for settings in pipelines(&[]) {
        let mut studio = Studio::new(&gpu, settings.clone());
        let scene = studio.load(&stage.scene);
        let mut middle = |settings: Settings| {
            studio.set(settings);
            let (_, [direct, ..]) = studio.parts(&scene, &camera_above(2.0), SIZE, (1, false));
            Vec3::from(direct.pixel(24, 18))
        };
        let without = |mut settings: Settings| {
            settings.set("environment.sky", "none").unwrap();
            settings
        };
        // Under the preset neither lights a surface that has no gloss.
        let all = [
            (settings.clone(), of_sun + of_sky),
            (without(settings.clone()), of_sun),
            (preset_direct(settings.clone()), of_sun),
            (preset_direct(without(settings)), of_sun),
        ];
        for (settings, expected) in all {
            let found = middle(settings.clone());
            let off = ((found - expected) / expected).abs().max_element();
            assert!(off < 3e-3, "{found} is not {expected} with {:?}", settings.environment.sky);
        }
    }
}

#[test]
fn under_the_preset_direct_the_sky_is_seen_straight_and_in_metals_and_none_is_black() {
    // The sun lights the metal's other side.
    let mut stage = Stage::new();
    let metal = stage.material(Material { metallic: 1.0, roughness: 0.4, ..Material::default() });
    stage.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, metal);
    stage.sun(1000.0, Vec3::Y);
    let view = View::look_at(Vec3::new(0.0, 1.0, 3.0), Vec3::ZERO, 1.0, 0.1);
    let gpu = device();
    for pipeline in [Pipeline::Deferred, Pipeline::Forward] {
        for (sky, nits) in [("auto", 1000.0 * SKY), ("none", Vec3::ZERO)] {
            let settings = Settings { pipeline, ..direct(&[("environment.sky", sky)]) };
            let mut studio = Studio::new(&gpu, settings);
            let scene = studio.load(&stage.scene);
            let image = studio.radiance(&scene, &view, SIZE, 1);
            let [behind, metal] = [(24, 1), (24, 20)].map(|(x, y)| Vec3::from(image.pixel(x, y)));
            assert!((behind - nits).abs().max_element() <= 2e-3 * nits.x, "{pipeline:?} {sky}: {behind}");
            // The table of albedo, and a little of the ground that the linear fit sees of an open sky.
            assert!((metal - nits).abs().max_element() <= 0.05 * nits.z, "{pipeline:?} {sky}: {metal}");
        }
    }
}
