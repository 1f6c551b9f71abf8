//! Parts of the light: they add up to the picture, and all integrators mean the same by them.

use std::f32::consts::PI;

use chiaro::scene::{LightKind, Material};
use chiaro::{Integrator, ReferenceOptions, View};
use chiaro_testkit::{Stage, Truth, camera_above, device_guaranteed, direct};
use glam::{Affine3A, Vec3, Vec4};

use crate::light_paths::{ball, glass};

const SIDE: u32 = 24;
const HALF: f32 = 1.2;
const BALL: Vec3 = Vec3::new(0.0, 0.45, 0.0);
const RADIUS: f32 = 0.3;

/// A floor with a glass ball that a lamp of a tenth of a metre shines through from the left, a mirror on the right, and a
/// wall that scatters light at the upper edge of the picture.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let [floor, wall] = [0.6, 0.7].map(|albedo| stage.lambert(albedo));
    stage.quad(Vec3::ZERO, Vec3::X * HALF, Vec3::NEG_Z * HALF, floor);
    stage.quad(Vec3::new(0.0, 0.4, -HALF), Vec3::X * HALF, Vec3::Y * 0.4, wall);
    let mirror = stage.material(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    stage.quad(Vec3::new(HALF, 0.4, 0.0), Vec3::Z * HALF, Vec3::Y * 0.4, mirror);
    let clear = stage.material(glass(1.5));
    stage.place(ball(RADIUS, clear), Affine3A::from_translation(BALL));
    let shining =
        Material { emissive: Vec3::splat(500.0), base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    // Looks along (1, −0.6, 0): u × v.
    let across = Vec3::new(0.6, 1.0, 0.0).normalize();
    stage.quad(BALL + Vec3::new(-1.0, 0.6, 0.0), across * 0.08, Vec3::Z * 0.08, shining);
    stage
}

fn options(integrator: Integrator) -> ReferenceOptions {
    ReferenceOptions { integrator, seed: 3, ..ReferenceOptions::default() }
}

fn trace(stage: &Stage, view: &View, integrator: Integrator, samples: u32) -> Truth {
    let gpu = device_guaranteed();
    let mut truth = Truth::new(&gpu, direct(&[]), &stage.scene, (view, [SIDE; 2]), options(integrator));
    truth.add(&[samples]);
    truth
}

/// Means of direct light, caustics and indirect light over the pixels that count, nits.
fn parts(truth: &Truth, counts: impl Fn(u32, u32) -> bool) -> [f64; 3] {
    let [sum, direct, caustics] = ["sum", "direct", "caustics"].map(|name| truth.total(name));
    let mut means = [0.0; 3];
    let mut pixels = 0.0;
    for index in (0..(SIDE * SIDE) as usize).filter(|i| counts(*i as u32 % SIDE, *i as u32 / SIDE)) {
        let at = |layer: &[f64]| layer[4 * index + 1];
        let rest = at(&sum) - at(&direct) - at(&caustics);
        let all = [at(&direct), at(&caustics), rest];
        assert!(all.iter().all(|part| *part >= -1e-6 * at(&sum)), "{index}: {all:?}");
        means.iter_mut().zip(all).for_each(|(mean, part)| *mean += part / f64::from(truth.samples()));
        pixels += 1.0;
    }
    means.map(|mean| mean / pixels)
}

/// Where nothing mirrors or bends what the camera sees, and the wall is not seen edge-on.
fn plain(x: u32, y: u32) -> bool {
    let at = |i: u32| (i as f32 + 0.5) / SIDE as f32 * 2.0 * HALF - HALF;
    let (x, z) = (at(x), at(y));
    // The ball as the camera sees it from 10 m above; the lamp hides what is beneath.
    x.hypot(z) > RADIUS + 0.1 && x > -0.6 && x < HALF - 0.1 && z > 0.15 - HALF
}

#[test]
fn all_integrators_mean_the_same_by_the_parts_of_light() {
    let (stage, view) = (stage(), camera_above(HALF));
    let [path, full, photon] = [(Integrator::Path, 768), (Integrator::Full, 128), (Integrator::Photon, 128)]
        .map(|(integrator, samples)| parts(&trace(&stage, &view, integrator, samples), plain));
    // Light paths lose some where the ball's bent normals graze, and few of the camera's paths end in so small a lamp.
    for (name, [found, expected], most) in
        [("full", [full, path], [0.02, 0.08, 0.3]), ("photon", [photon, full], [0.02, 0.03, 0.05])]
    {
        for part in 0..3 {
            let off = (found[part] / expected[part] - 1.0).abs();
            assert!(off < most[part], "{name}, part {part}: {found:?} is not {expected:?}");
        }
    }
    // The ball's focus is no small part of it.
    let lit = |x: u32, y: u32| plain(x, y) && x > SIDE / 2 && y.abs_diff(SIDE / 2) < 4;
    let [direct, caustics, indirect] = parts(&trace(&stage, &view, Integrator::Full, 64), lit);
    assert!(caustics > 0.5 * direct && indirect > 0.0, "{direct} {caustics} {indirect}");
}

#[test]
fn a_lamp_without_extent_has_the_same_parts_by_light_paths_alone_and_beside_others() {
    let mut stage = stage();
    let lamp = Vec3::new(0.6, 0.9, 0.6);
    stage.light(LightKind::Point, 20.0, None, lamp, Vec3::NEG_Y);
    let view = camera_above(HALF);
    let [full, photon] = [Integrator::Full, Integrator::Photon]
        .map(|integrator| parts(&trace(&stage, &view, integrator, 96), plain));
    for (part, most) in [0.03, 0.04, 0.06].into_iter().enumerate() {
        let off = (photon[part] / full[part] - 1.0).abs();
        assert!(off < most, "part {part}: {photon:?} is not {full:?}");
    }
}

#[test]
fn a_mirror_that_shows_a_lit_wall_shows_direct_light() {
    let (albedo, lux) = (0.5f32, 1000.0f32);
    let mut stage = Stage::new();
    let wall = stage.lambert(albedo);
    let mirror = stage.material(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    // The sun comes over the mirror's back, and lights the wall straight.
    stage.quad(Vec3::ZERO, Vec3::X * 0.5, Vec3::Y * 0.5, mirror);
    stage.quad(Vec3::Z * 4.0, Vec3::NEG_X * 8.0, Vec3::Y * 8.0, wall);
    let direction = Vec3::new(0.0, -0.8, 1.0).normalize();
    stage.sun(lux, direction);
    let view = View::look_at(Vec3::new(0.6, 0.0, 2.0), Vec3::new(0.0, 0.0, 0.0), 0.02, 0.1);
    for integrator in [Integrator::Path, Integrator::Full] {
        let [direct, caustics, indirect] = parts(&trace(&stage, &view, integrator, 64), |_, _| true);
        let expected = f64::from(lux * direction.z * albedo / PI);
        assert!((direct / expected - 1.0).abs() < 0.01, "{integrator:?}: {direct} is not {expected}");
        assert!(caustics == 0.0 && (0.0..0.05 * expected).contains(&indirect), "{caustics} {indirect}");
    }
}
