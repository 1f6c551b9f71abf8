//! Unlit materials: their colour is the display's, whatever the light.

use chiaro::scene::{AlphaMode, Material, Reflection, Scene};
use chiaro::{Gpu, Pipeline, ReferenceOptions, Settings};
use chiaro_testkit::{Stage, Studio, camera_above, device, direct};
use glam::Vec3;

use crate::truth::trace;

const SIZE: [u32; 2] = [32, 32];
/// sRGB codes of linear 0.5 and of white; the dither adds up to one.
const HALF_CODE: [u8; 2] = [187, 188];

fn unlit(value: f32, alpha: f32) -> Material {
    Material {
        reflection: Reflection::Unlit,
        base_color: Vec3::splat(value).extend(alpha),
        alpha: if alpha < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        ..Material::default()
    }
}

/// A floor 4 m wide under a sun, with a quad on its left half (x < 0) and a small one on its right: at x = 1, z = −1.
fn stage(lux: f32, [left, right]: [Material; 2]) -> Scene {
    let mut stage = Stage::floor(0.5);
    let [left, right] = [left, right].map(|material| stage.material(material));
    stage.quad(Vec3::new(-1.0, 0.1, 0.0), Vec3::X, Vec3::NEG_Z * 2.0, left);
    stage.quad(Vec3::new(1.0, 0.1, -1.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, right);
    stage.sun(lux, Vec3::NEG_Y);
    stage.scene
}

fn pipelines(gpu: &Gpu) -> [Studio; 2] {
    [("deferred", "1"), ("forward", "4")].map(|(pipeline, msaa)| {
        let pipeline = if pipeline == "forward" { Pipeline::Forward } else { Pipeline::Deferred };
        let settings = direct(&[("surface.msaa", msaa), ("shadow.layout", "none")]);
        Studio::new(gpu, Settings { pipeline, ..settings })
    })
}

/// Codes in the middle of the left half, of the small quad and of the bare floor.
fn codes(studio: &mut Studio, scene: &Scene, changes: &[(&str, &str)]) -> [u8; 3] {
    let mut settings = studio.settings().clone();
    for (key, value) in changes {
        settings.set(key, value).unwrap();
    }
    studio.set(settings);
    let loaded = studio.load(scene);
    let picture = studio.picture(&loaded, &camera_above(2.0), SIZE, 2);
    [(8, 16), (24, 8), (24, 24)].map(|(x, y)| picture.pixel(x, y)[1])
}

#[test]
fn unlit_white_is_the_displays_white_whatever_light_exposure_and_curve() {
    let gpu = device();
    for mut studio in pipelines(&gpu) {
        for (lux, exposure, curve) in [
            (1000.0, "auto", "aces"),
            (1e5, "auto", "agx"),
            (0.01, "-5", "aces"),
            (0.01, "-16", "none"),
            (1e5, "20", "none"),
        ] {
            let scene = stage(lux, [unlit(1.0, 1.0), unlit(0.5, 1.0)]);
            let changes = [("camera.exposure_ev100", exposure), ("camera.tone_map", curve)];
            let [white, half, _] = codes(&mut studio, &scene, &changes);
            assert_eq!(white, 255, "{lux} lx, {exposure}, {curve}");
            assert!(HALF_CODE.contains(&half), "{lux} lx, {exposure}, {curve}: {half}");
        }
    }
}

#[test]
fn automatic_exposure_does_not_see_unlit_materials() {
    let gpu = device();
    for mut studio in pipelines(&gpu) {
        let floors = [0.001, 0.2, 1.0].map(|value| {
            let scene = stage(1000.0, [unlit(value, 1.0), unlit(value, 1.0)]);
            codes(&mut studio, &scene, &[])[2]
        });
        assert_eq!(floors, [floors[0]; 3]);
        assert!(floors[0] > 60 && floors[0] < 220, "{floors:?}");
    }
}

#[test]
fn unlit_colours_blend_and_are_seen_through_glass_as_they_are() {
    let gpu = device();
    // What neither reflects nor bends.
    let pane = Material { transmission: 1.0, specular: 0.0, roughness: 0.0, ..Material::default() };
    for mut studio in pipelines(&gpu) {
        let mut scene = stage(1000.0, [unlit(0.5, 1.0), unlit(1.0, 0.5)]);
        let mut cover = Stage { scene };
        let pane = cover.material(pane.clone());
        cover.quad(Vec3::new(-1.0, 1.0, 0.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, pane);
        let black = cover.material(unlit(0.0, 1.0));
        cover.quad(Vec3::new(1.0, 0.05, -1.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, black);
        scene = cover.scene;
        let [through, blended, _] = codes(&mut studio, &scene, &[]);
        assert!(HALF_CODE.contains(&through), "through glass: {through}");
        assert!(HALF_CODE.contains(&blended), "blended over black: {blended}");
    }
}

#[test]
fn radiance_holds_unlit_white_as_one_nit_in_pictures_and_in_the_reference_and_it_lights_nothing() {
    let gpu = device();
    let scene = stage(0.0, [unlit(1.0, 1.0), unlit(0.25, 1.0)]);
    let view = camera_above(2.0);
    let traced = trace(&scene, (&view, SIZE), ReferenceOptions::default(), &[16]);
    let places = [(8, 16), (24, 8), (24, 24)];
    let expected = [1.0, 0.25, 0.0];
    let check = |what: &str, image: &chiaro_image::Image| {
        for ((x, y), expected) in places.into_iter().zip(expected) {
            let found = image.pixel(x, y)[1];
            assert!((found - expected).abs() < 1e-3, "{what} {x} {y}: {found} is not {expected}");
        }
    };
    check("reference", &traced);
    for mut studio in pipelines(&gpu) {
        let loaded = studio.load(&scene);
        check("picture", &studio.radiance(&loaded, &view, SIZE, 2));
    }
}
