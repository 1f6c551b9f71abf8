//! The uniform sky in the reference, against formulas and between its integrators.

use std::f32::consts::PI;

use chiaro::scene::{Material, Scene};
use chiaro::techniques::shaders;
use chiaro::{Integrator, Kit, LoadedScene, Recorder, Reference, ReferenceOptions, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Truth, camera_above, device_guaranteed, direct};
use glam::Vec3;

use crate::parts::SKY;
use crate::truth::mean;

const SIZE: [u32; 2] = [16, 16];
const LUX: f32 = 1000.0;
const ALBEDO: f32 = 0.6;

fn settings(sky: &str) -> Settings {
    direct(&[("environment.sky", sky)])
}

fn options(integrator: Integrator) -> ReferenceOptions {
    ReferenceOptions { integrator, seed: 3, ..ReferenceOptions::default() }
}

/// The mean of a picture's middle.
fn middle(image: &Image) -> Vec3 {
    let inner = |i: u32| (4..12).contains(&i);
    let all = (0..256).map(|i| (i % 16, i / 16)).filter(|&(x, y)| inner(x) && inner(y));
    all.map(|(x, y)| Vec3::from(image.pixel(x, y))).sum::<Vec3>() / 64.0
}

#[track_caller]
fn assert_is(found: Vec3, expected: Vec3, tolerance: f32, what: &str) {
    let off = (found - expected).abs().max_element();
    assert!(off <= tolerance * expected.max_element().max(1e-6), "{what}: {found} is not {expected}");
}

fn plane(sun: Vec3) -> Scene {
    let mut stage = Stage::floor(ALBEDO);
    stage.sun(LUX, sun);
    stage.scene
}

#[test]
fn an_open_plane_shows_sun_and_sky_by_every_integrator_and_follows_the_setting() {
    let sun = Vec3::new(0.6, -1.0, 0.3).normalize();
    let of_sun = Vec3::splat(LUX * -sun.y * ALBEDO / PI);
    let of_sky = LUX * ALBEDO * SKY;
    let gpu = device_guaranteed();
    let scene = plane(sun);
    let view = camera_above(2.0);
    for (integrator, samples, tolerance) in
        [(Integrator::Path, 48, 0.01), (Integrator::Photon, 64, 0.04), (Integrator::Full, 16, 0.03)]
    {
        let what = format!("{integrator:?}");
        let mut truth = Truth::new(&gpu, settings("auto"), &scene, (&view, SIZE), options(integrator));
        assert_is(middle(&truth.add(&[samples])), of_sun + of_sky, tolerance, &what);
        truth.settings = settings("none");
        truth.look(&view);
        assert_is(middle(&truth.add(&[samples / 4])), of_sun, tolerance, &what);
    }
}

#[test]
fn choosing_the_sky_and_meeting_it_agree_in_a_furnace() {
    // The sun shines at the other side, and the sky is all around.
    let gpu = device_guaranteed();
    for (metallic, roughness, least) in
        [(0.0, 1.0, 0.97), (1.0, 1.0, 0.97), (1.0, 0.3, 0.97), (1.0, 0.0, 0.999)]
    {
        let mut stage = Stage::new();
        let material = stage.material(Material { metallic, roughness, ..Material::default() });
        stage.quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Z * 4.0, material);
        stage.sun(LUX, Vec3::Y);
        let view = camera_above(2.0);
        let path = options(Integrator::Path);
        let mut truth = Truth::new(&gpu, settings("auto"), &stage.scene, (&view, SIZE), path);
        let found = middle(&truth.add(&[128])) / (LUX * SKY);
        let what = format!("metallic {metallic} roughness {roughness}: {found}");
        assert!(found.min_element() > least && found.max_element() < 1.015, "{what}");
    }
}

#[test]
fn the_sky_is_seen_behind_and_follows_the_suns() {
    let gpu = device_guaranteed();
    let kit = Kit::new(&gpu, shaders::library());
    let mut scene = plane(Vec3::NEG_Y);
    scene.lights[0].intensity = 1.0;
    let mut loaded = LoadedScene::upload(&kit, &scene).unwrap();
    // Half of the picture is sky.
    let view = View::look_at(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 1.0, -1.0), 1.0, 0.1);
    let options = options(Integrator::Photon);
    let image = (&view, SIZE);
    let mut reference = Reference::new(&kit, (&scene, &loaded), &settings("auto"), image, options).unwrap();
    let mut recorder = Recorder::new(&gpu, false);
    let mut look = |reference: &mut Reference, loaded: &LoadedScene| {
        let mut frame = recorder.begin();
        reference.add(&mut frame, loaded, 24);
        frame.submit();
        let sum = reference.sum().unwrap().wait(&gpu).unwrap();
        let share = 1.0 / reference.samples() as f32;
        let texels: Vec<_> =
            sum.floats().chunks(4).map(|t| [t[0] * share, t[1] * share, t[2] * share]).collect();
        Image::from_pixels(SIZE[0], SIZE[1], texels).unwrap()
    };
    let halves = |image: &Image| [mean(image, |_, y| y < 7), mean(image, |_, y| y > 11)];
    for (lux, sky) in [(1.0, "none"), (LUX, "auto"), (0.1 * LUX, "auto"), (LUX, "none")] {
        scene.lights[0].intensity = lux;
        loaded.set_lights(&scene);
        reference.restart(&loaded, &settings(sky), image).unwrap();
        let [behind, ground] = halves(&look(&mut reference, &loaded));
        let nits = if sky == "auto" { lux * SKY.y } else { 0.0 };
        let floor = ALBEDO * (lux / PI + nits);
        assert!((behind - nits).abs() <= 1e-3 * nits, "{lux} lx, {sky}: {behind} is not {nits}");
        assert!((ground / floor - 1.0).abs() < 0.06, "{lux} lx, {sky}: {ground} is not {floor}");
    }
}
