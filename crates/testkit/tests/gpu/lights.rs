//! Analytic lighting through the whole renderer: scenes whose radiance is a formula.

use std::f32::consts::PI;

use chiaro::scene::LightKind;
use chiaro::{Pipeline, Settings};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, camera_above, device, direct, place_below};
use glam::Vec3;

/// A base colour that the surface buffer's 10 bits of √ keep exactly.
const ALBEDO: f32 = 614.0 * 614.0 / (1023.0 * 1023.0);
const SIDE: u32 = 64;
/// Half a picture, metres.
const HALF: f32 = 2.0;
/// Radiance passes through half floats (2⁻¹¹) and drivers' square roots: 0.2 %.
const TOLERANCE: f32 = 2e-3;

/// Where a pixel's middle lies on the floor.
fn place(x: u32, y: u32) -> Vec3 {
    place_below([x, y], SIDE, HALF)
}

/// Every pipeline, compiled once a test.
struct Studios([(&'static str, Studio); 2]);

impl Studios {
    fn new() -> Self {
        let gpu = device();
        Self([("deferred", Pipeline::Deferred), ("forward", Pipeline::Forward)].map(|(name, pipeline)| {
            let settings = Settings { pipeline, ..direct(&[("surface.msaa", "1")]) };
            (name, Studio::new(&gpu, settings))
        }))
    }

    /// The floor from above.
    fn pictures(&mut self, stage: &Stage) -> impl Iterator<Item = (&'static str, Image)> {
        self.0.iter_mut().map(|(name, studio)| {
            let scene = studio.load(&stage.scene);
            (*name, studio.radiance(&scene, &camera_above(HALF), [SIDE; 2], 1))
        })
    }

    /// Holds every pixel against the illuminance that its place should have; `None` leaves a place out.
    fn assert_lit(&mut self, stage: &Stage, lux: impl Fn(Vec3) -> Option<f32>) {
        for (pipeline, image) in self.pictures(stage) {
            let mut brightest = 0.0f32;
            for (x, y) in (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE)) {
                let Some(lux) = lux(place(x, y)) else { continue };
                let (found, expected) = (image.pixel(x, y)[1], lux * ALBEDO / PI);
                brightest = brightest.max(expected);
                // Where a light fades out there is no relative error to speak of: a millionth of the brightest counts.
                let allowed = TOLERANCE * expected + 1e-6 * brightest;
                let off = (found - expected).abs();
                assert!(off <= allowed, "{pipeline} at {}: {found} is not {expected}", place(x, y));
            }
            assert!(brightest > 0.0, "{pipeline}: nothing was compared");
        }
    }
}

#[test]
fn a_lambertian_floor_under_a_sun_of_e_lux_shows_e_rho_over_pi_nits() {
    let mut studios = Studios::new();
    for direction in [Vec3::NEG_Y, Vec3::new(0.6, -1.0, 0.3).normalize()] {
        for lux in [0.05, 1000.0, 120_000.0] {
            let mut stage = Stage::floor(ALBEDO);
            stage.sun(lux, direction);
            studios.assert_lit(&stage, |_| Some(lux * -direction.y));
        }
    }
}

#[test]
fn a_point_lights_by_the_inverse_square_of_its_distance() {
    let mut stage = Stage::floor(ALBEDO);
    let (at, candela) = (Vec3::new(0.3, 0.8, -0.5), 40.0);
    stage.light(LightKind::Point, candela, None, at, Vec3::NEG_Y);
    Studios::new().assert_lit(&stage, |p| Some(candela * at.y / at.distance(p).powi(3)));
}

#[test]
fn many_points_add_up() {
    // More lights than one word of the froxel's bits.
    let mut stage = Stage::floor(ALBEDO);
    let lights: Vec<_> =
        (0..40).map(|i| Vec3::new((i % 8) as f32 * 0.5 - 1.75, 0.6, (i / 8) as f32 * 0.8 - 1.6)).collect();
    for at in &lights {
        stage.light(LightKind::Point, 2.0, None, *at, Vec3::NEG_Y);
    }
    Studios::new()
        .assert_lit(&stage, |p| Some(lights.iter().map(|at| 2.0 * at.y / at.distance(p).powi(3)).sum()));
}

#[test]
fn a_range_windows_the_inverse_square_as_gltf_recommends() {
    let mut stage = Stage::floor(ALBEDO);
    let (at, range) = (Vec3::new(0.0, 0.9, 0.0), 1.8f32);
    stage.light(LightKind::Point, 10.0, Some(range), at, Vec3::NEG_Y);
    Studios::new().assert_lit(&stage, |p| {
        let d = at.distance(p);
        // KHR_lights_punctual, "Range Property".
        let window = (1.0 - (d / range).powi(4)).clamp(0.0, 1.0);
        Some(10.0 * at.y / d.powi(3) * window)
    });
}

#[test]
fn a_spot_falls_off_between_its_cones_as_gltf_says_and_by_the_inverse_square() {
    let mut studios = Studios::new();
    for (inner, outer, tilt) in [(0.2f32, 0.6f32, 0.0f32), (0.0, 0.9, 0.4), (0.5, 0.52, 0.2)] {
        let mut stage = Stage::floor(ALBEDO);
        let at = Vec3::new(-0.2, 1.5, 0.1);
        let axis = Vec3::new(tilt, -1.0, 0.0).normalize();
        stage.light(LightKind::Spot { inner_rad: inner, outer_rad: outer }, 100.0, None, at, axis);
        // KHR_lights_punctual, "Inner and Outer Cone Angles".
        let scale = 1.0 / (inner.cos() - outer.cos()).max(0.001);
        studios.assert_lit(&stage, |p| {
            let way = (p - at).normalize();
            let share = ((way.dot(axis) - outer.cos()) * scale).clamp(0.0, 1.0).powi(2);
            // Half a percent of the cone's edge is left out: there rounding of the cosine is magnified by `scale`.
            let edge = share > 0.0 && share < 0.005 * scale;
            (!edge).then(|| 100.0 * at.y / at.distance(p).powi(3) * share)
        });
    }
}

#[test]
fn a_spot_wider_than_its_map_is_lit_to_its_cone() {
    let mut stage = Stage::floor(ALBEDO);
    let at = Vec3::new(0.0, 0.15, 0.0);
    stage.light(LightKind::Spot { inner_rad: 1.5, outer_rad: 1.52 }, 1.0, None, at, Vec3::NEG_Y);
    // Up to 85.5° from the axis: a map reaches 80°.
    Studios::new().assert_lit(&stage, |p| (p.length() < 1.9).then(|| at.y / at.distance(p).powi(3)));
}

#[test]
fn a_light_behind_a_surface_does_not_reach_it() {
    let mut stage = Stage::floor(ALBEDO);
    stage.light(LightKind::Point, 100.0, None, Vec3::new(0.0, -0.5, 0.0), Vec3::NEG_Y);
    stage.sun(100.0, Vec3::new(0.1, 1.0, 0.0));
    for (pipeline, image) in Studios::new().pictures(&stage) {
        assert!(image.pixels().iter().flatten().all(|&v| v == 0.0), "{pipeline}");
    }
}
