//! What bounding the nearness of virtual lights takes and the picture gives back: a lit wall on a floor, whose light is known.

use std::f32::consts::{FRAC_1_SQRT_2, PI};

use chiaro::scene::Projection;
use chiaro::{Aov, Left, Renderer, Samples, Settings, StillOptions, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, device};
use glam::{Mat3, Mat4, Vec2, Vec3};

const SIDE: u32 = 96;
const HALF_M: f32 = 2.2;
const ALBEDO: f32 = 0.5;
const LUX: f32 = 1000.0;
/// The camera looks at this far before the middle of the floor, towards the wall.
const AHEAD_M: f32 = 1.0;
const SAMPLES: u32 = 16;

/// A floor of 4 × 4 m, and behind it a wall of 4 × 2 m that alone the sun shines at.
fn corner() -> Stage {
    let mut stage = Stage::new();
    let grey = stage.lambert(ALBEDO);
    stage.quad(Vec3::ZERO, 2.0 * Vec3::X, -2.0 * Vec3::Z, grey);
    stage.quad(Vec3::new(0.0, 1.0, -2.0), 2.0 * Vec3::X, Vec3::Y, grey);
    stage.sun(LUX, Vec3::NEG_Z);
    stage
}

/// Half from above.
fn view() -> View {
    let forward = Vec3::new(0.0, -FRAC_1_SQRT_2, -FRAC_1_SQRT_2);
    let axes = Mat3::from_cols(Vec3::X, Vec3::X.cross(forward), -forward);
    let eye = Vec3::new(0.0, 0.0, -AHEAD_M) - 10.0 * forward;
    View {
        world_from_camera: Mat4::from_translation(eye) * Mat4::from_mat3(axes),
        projection: Projection::Orthographic { half_height_m: HALF_M },
        near_m: 0.1,
        far_m: 30.0,
        aspect: None,
        axis_ndc: Vec2::ZERO,
    }
}

/// Where on the plane of the floor a pixel lies: to the right, and from the wall.
fn on_floor(x: u32, y: u32) -> [f32; 2] {
    let [right, up] = [(x as f32 + 0.5) / SIDE as f32, 1.0 - (y as f32 + 0.5) / SIDE as f32]
        .map(|at| (2.0 * at - 1.0) * HALF_M);
    [right, 2.0 - AHEAD_M - up / FRAC_1_SQRT_2]
}

/// What the wall gives the floor, as the floor shows it, nits: the form factor of a rectangle that stands on the plane of a
/// place (Howell, a catalog of radiation heat transfer configuration factors, B-4).
fn expected([right, away]: [f32; 2]) -> f32 {
    let top = away.hypot(2.0);
    let part = |x: f32| 0.5 / PI * ((x / away).atan() - away / top * (x / top).atan());
    ALBEDO * (part(2.0 - right) - part(-2.0 - right)) * ALBEDO * LUX / PI
}

/// Found over expected, row by row from the wall on: the middle half of them.
fn rows(found: &Image) -> Vec<(f32, f32)> {
    let middle = SIDE / 4..SIDE - SIDE / 4;
    let row = |y| {
        let away = on_floor(0, y)[1];
        let [found, expected] = middle
            .clone()
            .fold([0.0; 2], |[a, b], x| [a + found.pixel(x, y)[1], b + expected(on_floor(x, y))]);
        (away, found / expected)
    };
    (0..SIDE).rev().map(row).filter(|(away, _)| (0.1..3.5).contains(away)).collect()
}

fn mean(rows: &[(f32, f32)], from: f32, to: f32) -> f32 {
    let near: Vec<_> = rows.iter().filter(|(away, _)| (from..to).contains(away)).collect();
    near.iter().map(|(_, ratio)| ratio).sum::<f32>() / near.len() as f32
}

/// Frames that are averaged share one bound, which this makes that of each frame: of discs of 0.4 m.
fn bounded() -> Settings {
    let mut settings = Settings::default();
    for (key, value) in [
        ("environment.sky", "none"),
        ("shadow.layout", "none"),
        ("indirect.technique", "rsm"),
        ("indirect.vpls", "16"),
        ("indirect.rsm_resolution", "128"),
        ("indirect.clamp", "4"),
    ] {
        settings.set(key, value).unwrap();
    }
    settings
}

#[test]
fn a_floor_gets_back_most_of_what_bounds_take_at_a_lit_wall_and_nothing_more() {
    let gpu = device();
    let stage = corner();
    let mut settings = bounded();
    let mut studio = Studio::new(&gpu, settings.clone());
    let loaded = studio.load(&stage.scene);
    for sampling in ["view", "importance", "halton"] {
        settings.set("indirect.sampling", sampling).unwrap();
        let [off, on] = ["false", "true"].map(|compensate| {
            settings.set("indirect.compensate", compensate).unwrap();
            studio.set(settings.clone());
            rows(&studio.aov(&loaded, &view(), [SIDE; 2], SAMPLES, Aov::Indirect))
        });
        let [near_off, near_on] = [&off, &on].map(|rows| mean(rows, 0.1, 0.5));
        assert!(near_off < 0.8, "{sampling}: nothing to give back: {near_off}");
        assert!((1.0 - near_on).abs() < 0.5 * (1.0 - near_off), "{sampling}: {near_off} became {near_on}");
        let most = on.iter().fold(0.0f32, |most, (_, ratio)| most.max(*ratio));
        assert!(most < 1.05, "{sampling}: too much: {most}");
        let [far_off, far_on] = [&off, &on].map(|rows| mean(rows, 2.0, 3.5));
        assert!((far_on / far_off - 1.0).abs() < 0.02, "{sampling}: {far_off} became {far_on}");
    }
}

#[test]
fn the_share_that_bounds_take_can_be_looked_at() {
    let gpu = device();
    let mut settings = bounded();
    settings.set("indirect.clamp_loss", "true").unwrap();
    settings.set("indirect.interleave", "1").unwrap();
    let mut renderer = Renderer::new(&gpu, settings).unwrap();
    let loaded = renderer.load(&corner().scene).unwrap();
    let left = vec!["indirect/clamp_loss".to_owned()];
    let options = StillOptions { size: [SIDE; 2], samples: SAMPLES, left, ..StillOptions::default() };
    let mut still = renderer.still(&loaded, &view(), &options).unwrap();
    let Left::Sum(sum) = still.left.remove(0).content else { panic!("frames are averaged") };
    let Samples::Float(shares) = sum.wait(&gpu).unwrap().channels().swap_remove(0) else { panic!("numbers") };
    let row = |y: u32| {
        let row = &shares[(y * SIDE) as usize..][..SIDE as usize];
        row.iter().sum::<f32>() / (SIDE * SAMPLES) as f32
    };
    let of = |from: f32, to: f32| {
        let rows: Vec<_> = (0..SIDE).filter(|&y| (from..to).contains(&on_floor(0, y)[1])).map(row).collect();
        rows.iter().sum::<f32>() / rows.len() as f32
    };
    let [near, far] = [of(0.1, 0.4), of(2.5, 3.0)];
    assert!(
        (0.2..0.9).contains(&near) && (0.0..0.1).contains(&far),
        "{near} near the wall, {far} far from it"
    );
}
