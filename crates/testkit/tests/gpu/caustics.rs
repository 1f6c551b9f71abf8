//! Caustics by photons, in frames: against formulas, the reference, and their own accounts.

use std::f32::consts::PI;

use chiaro::scene::{LightKind, Material, Scene};
use chiaro::{Aov, Integrator, Left, Recorder, ReferenceOptions, Settings, StillOptions, View};
use chiaro_image::{CompareOptions, Comparison, Image};
use chiaro_testkit::{
    Stage, Studio, Truth, assets, camera_above, device, device_guaranteed, direct, nmae, place_below,
    reference,
};
use glam::{Affine3A, Vec3, Vec4};

use crate::light_paths::{
    ALBEDO, CANDELA, FOCUS_SIZE, Focus, HALF, LAMP, SIDE, assert_blocks, ball, before_a_mirror, glass,
    mirrored, reflectance,
};

fn photons(count: &str, changes: &[(&str, &str)]) -> Settings {
    let all = [("caustics.technique", "photon_trace"), ("caustics.photons", count)];
    direct(&[&all, changes].concat())
}

fn caustics(settings: Settings, scene: &Scene, view: (&View, [u32; 2]), samples: u32) -> Image {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(scene);
    studio.aov(&loaded, view.0, view.1, samples, Aov::Caustics)
}

/// Totals of `photon_sums`, in the order of `photons.wesl`.
const EMITTED: usize = 0;
const LANDED: usize = 1;
const DIRECT: usize = 2;
const ABSORBED: usize = 3;
const LOST: usize = 4;
const ENDED: usize = 5;
const PHOTONS_LANDED: usize = 7;
const PHOTONS_SEEN: usize = 8;

/// What became of a frame's light.
fn totals(settings: Settings, scene: &Scene, view: (&View, [u32; 2])) -> Vec<i32> {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(scene);
    let left = vec!["caustics/photon_sums".into()];
    let options = StillOptions { size: view.1, samples: 1, left, ..StillOptions::default() };
    let mut still = studio.renderer().still(&loaded, view.0, &options).unwrap();
    let Some(Left::Buffer(words)) = still.left.pop().map(|left| left.content) else { panic!("no buffer") };
    let bytes = words.wait(&gpu).unwrap();
    bytes.as_chunks::<4>().0.iter().take(16).map(|word| i32::from_le_bytes(*word)).collect()
}

#[test]
fn a_mirror_lights_the_floor_of_a_frame_like_the_lamps_image_behind_it() {
    let stage = before_a_mirror();
    let view = (&camera_above(HALF), [SIDE; 2]);
    for changes in [&[][..], &[("pipeline", "forward"), ("surface.msaa", "1")]] {
        let image = caustics(photons("131072", changes), &stage.scene, view, 2);
        assert_blocks(&image, 0.03, |at| {
            let lamp = mirrored(LAMP);
            CANDELA * lamp.y / (lamp - at).length().powi(3) * reflectance(at, lamp) * ALBEDO / PI
        });
    }
}

#[test]
fn a_glass_ball_focuses_a_frames_sunlight_as_snell_says() {
    let focus = Focus::new();
    let image = caustics(photons("131072", &[]), &focus.stage.scene, (&focus.view, FOCUS_SIZE), 2);
    let found = focus.found(&image);
    assert!((found - 1.0).abs() < 0.03, "{found} times what is expected");
}

/// A green ball of dispersing glass, one of clear glass and a mirror on a floor under a sun, a spot and a point.
fn cabinet() -> Stage {
    let mut stage = Stage::floor(ALBEDO);
    let green = Material {
        attenuation_color: Vec3::new(0.4, 0.9, 0.5),
        attenuation_distance: 0.4,
        dispersion: 2.0,
        ..glass(1.6)
    };
    let [green, clear] = [green, glass(1.33)].map(|material| stage.material(material));
    stage.place(ball(0.3, green), Affine3A::from_translation(Vec3::new(-0.6, 0.5, 0.3)));
    stage.place(ball(0.2, clear), Affine3A::from_translation(Vec3::new(0.4, 0.3, -0.5)));
    let base_color = Vec4::new(0.9, 0.7, 0.4, 1.0);
    let mirror =
        stage.material(Material { base_color, metallic: 1.0, roughness: 0.0, ..Material::default() });
    stage.quad(Vec3::new(1.2, 0.5, 0.0), Vec3::Z * 0.8, Vec3::Y * 0.5, mirror);
    stage.sun(100.0, Vec3::new(0.3, -1.0, 0.1));
    let spot = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 };
    stage.light(spot, 200.0, Some(6.0), Vec3::new(-0.6, 2.0, 1.5), Vec3::new(0.0, -0.6, -0.5));
    stage.light(LightKind::Point, 100.0, None, Vec3::new(0.0, 1.5, -0.8), Vec3::NEG_Y);
    stage
}

#[test]
fn frames_have_the_caustics_that_light_paths_find() {
    let stage = cabinet();
    let (view, size) = (camera_above(1.0), [32, 32]);
    let found = caustics(photons("262144", &[]), &stage.scene, (&view, size), 4);
    let options = ReferenceOptions { integrator: Integrator::Full, seed: 1, ..ReferenceOptions::default() };
    let options = ReferenceOptions { diffuse_bounces: 0, ..options };
    let gpu = device_guaranteed();
    let mut truth = Truth::new(&gpu, direct(&[]), &stage.scene, (&view, size), options);
    truth.add(&[128, 128]);
    let (total, samples) = (truth.total("caustics"), f64::from(truth.samples()));
    let expected = Image::from_fn(size[0], size[1], |x, y| {
        let at = 4 * (x + y * size[0]) as usize;
        [0, 1, 2].map(|channel| (total[at + channel] / samples) as f32)
    });
    // The reference shows what mirrors and smooth glass hide as black, frames what is behind the glass.
    let mask = Image::from_fn(size[0], size[1], |x, y| {
        let at = place_below([x, y], size[0], 1.0);
        let hidden =
            at.distance(Vec3::new(-0.6, 0.0, 0.3)) < 0.4 || at.distance(Vec3::new(0.4, 0.0, -0.5)) < 0.3;
        [f32::from(u8::from(hidden)); 3]
    });
    let options = CompareOptions { mask: Some(&mask), blur_px: 1.0, ..CompareOptions::default() };
    let metrics = Comparison::new(&found, &expected, &options).unwrap().metrics();
    assert_eq!(metrics.not_finite, 0);
    assert!((metrics.mean_ratio - 1.0).abs() < 0.03 && metrics.nmae < 0.08, "{metrics:?}");
}

#[test]
fn all_light_that_was_emitted_landed_was_direct_absorbed_lost_or_ended() {
    let stage = cabinet();
    let view = (&camera_above(1.0), [32, 32]);
    let found = totals(photons("16384", &[]), &stage.scene, view);
    let ends = [LANDED, DIRECT, ABSORBED, LOST, ENDED];
    assert_eq!(ends.iter().map(|&end| found[end]).sum::<i32>(), found[EMITTED], "{found:?}");
    assert!([EMITTED, LANDED, DIRECT, ABSORBED, LOST].iter().all(|&total| found[total] > 0), "{found:?}");
    assert!(found[PHOTONS_SEEN] > 0 && found[PHOTONS_LANDED] >= found[PHOTONS_SEEN], "{found:?}");
    let cut = totals(photons("16384", &[("caustics.interfaces", "1")]), &stage.scene, view);
    assert!(cut[ENDED] > 0 && cut[LANDED] < found[LANDED], "{cut:?} {found:?}");
    // Of a sun over a ball a box' worth of white light, a circle of which meets it; the rest is direct.
    let found = totals(photons("16384", &[]), &Focus::new().stage.scene, view);
    let share = |total: usize| f64::from(found[total]) / f64::from(1 << 30);
    assert!((share(EMITTED) - 1.0).abs() < 1e-3, "{found:?}");
    assert!((share(DIRECT) - (1.0 - std::f64::consts::FRAC_PI_4)).abs() < 0.01, "{found:?}");
}

#[test]
fn all_photons_in_one_pixel_are_no_more_than_its_sums_hold() {
    // A spot shines into a mirror, and from there onto the floor: all of it within one large pixel.
    let (candela, half_angle, half) = (1000.0f32, 0.2f32, 4.0f32);
    let mut stage = Stage::floor(ALBEDO);
    let mirror = stage.material(Material { metallic: 1.0, roughness: 0.0, ..Material::default() });
    stage.quad(Vec3::new(3.0, 1.5, 0.0), Vec3::NEG_Z * 2.0, Vec3::NEG_Y * 1.5, mirror);
    let spot = LightKind::Spot { inner_rad: 0.999 * half_angle, outer_rad: half_angle };
    stage.light(spot, candela, None, Vec3::new(1.5, 3.0, 0.0), Vec3::new(1.0, -1.0, 0.0));
    let lumens = candela * 2.0 * PI * (1.0 - half_angle.cos());
    let expected = lumens / (4.0 * half * half) * ALBEDO / PI;
    for count in ["4096", "262144"] {
        let image = caustics(photons(count, &[]), &stage.scene, (&camera_above(half), [1, 1]), 1);
        let found = image.pixel(0, 0)[0];
        assert!((found / expected - 1.0).abs() < 0.01, "{count}: {found} is not {expected}");
    }
}

#[test]
fn the_same_seed_has_the_same_photons_and_frames_of_a_still_others_each() {
    let stage = cabinet();
    let (view, size) = (camera_above(1.0), [24, 24]);
    let gpu = device();
    let mut studio = Studio::new(&gpu, photons("8192", &[("caustics.filter", "none")]));
    let loaded = studio.load(&stage.scene);
    let take = |studio: &mut Studio, samples| studio.aov(&loaded, &view, size, samples, Aov::Caustics);
    let [once, again, four] = [1, 1, 4].map(|samples| take(&mut studio, samples));
    assert_eq!(once.pixels(), again.pixels());
    let truth = take(&mut studio, 32);
    let off = |image: &Image| nmae(image, &truth);
    assert!(off(&four) < 0.65 * off(&once), "{} is not half of {}", off(&four), off(&once));
    let mut settings = studio.settings().clone();
    settings.seed = 7;
    studio.set(settings);
    assert_ne!(once.pixels(), studio.aov(&loaded, &view, size, 1, Aov::Caustics).pixels());
}

#[test]
fn spreading_neither_loses_light_nor_wins_any() {
    let stage = before_a_mirror();
    let (view, size) = (camera_above(HALF), [48, 48]);
    let of = |filter: &str| {
        let changes = [("caustics.filter", filter), ("caustics.filter_photons", "64")];
        let image = caustics(photons("4096", &changes), &stage.scene, (&view, size), 1);
        image.pixels().iter().flatten().map(|v| f64::from(*v)).sum::<f64>()
    };
    let (plain, spread) = (of("none"), of("adaptive"));
    // Half floats.
    assert!((spread / plain - 1.0).abs() < 0.001, "{spread} is not {plain}");
}

#[test]
fn caustics_follow_what_casts_them() {
    let focus = Focus::new();
    let mut scene = focus.stage.scene;
    scene.add_default_view();
    let gpu = device();
    let mut studio = Studio::new(&gpu, photons("16384", &[]));
    let mut loaded = studio.load(&scene);
    let (view, size) = (camera_above(1.6), [32, 32]);
    let middle = |studio: &mut Studio, loaded: &_| {
        let image = studio.aov(loaded, &view, size, 1, Aov::Caustics);
        let (mut sum, mut at) = (0.0, Vec3::ZERO);
        for (x, y) in (0..32 * 32).map(|i| (i % 32, i / 32)) {
            sum += image.pixel(x, y)[1];
            at += image.pixel(x, y)[1] * place_below([x, y], 32, 1.6);
        }
        at / sum
    };
    let before = middle(&mut studio, &loaded);
    let mut pose = loaded.pose().clone();
    let by = Vec3::new(0.6, 0.0, -0.3);
    let ball = scene.nodes.iter().rposition(|node| node.mesh.is_some()).unwrap();
    pose.set_world(&scene, ball, Affine3A::from_translation(by) * pose.world_from_node[ball]);
    loaded.set_pose(&scene, &pose).unwrap();
    studio.renderer().equip(&scene, &mut loaded).unwrap();
    let after = middle(&mut studio, &loaded);
    assert!(before.length() < 0.05 && (after - before - by).length() < 0.05, "{before} {after}");
}

#[test]
fn where_nothing_mirrors_or_shines_there_are_no_passes() {
    let mut lambert = Stage::floor(ALBEDO);
    lambert.sun(100.0, Vec3::NEG_Y);
    let mut dark = Stage::floor(ALBEDO);
    let clear = dark.material(glass(1.5));
    dark.place(ball(0.3, clear), Affine3A::from_translation(Vec3::Y));
    let gpu = device();
    let view = camera_above(1.0);
    for scene in [&lambert.scene, &dark.scene] {
        let mut studio = Studio::new(&gpu, photons("4096", &[]));
        let loaded = studio.load(scene);
        let mut recorder = Recorder::new(&gpu, false);
        let left = studio.renderer().leaves(&mut recorder, &loaded, &view, [8, 8]).unwrap();
        let names: Vec<_> = left.iter().map(|resource| resource.name.to_string()).collect();
        assert!(!names.iter().any(|name| name.starts_with("caustics/")), "{names:?}");
        let image = studio.aov(&loaded, &view, [8, 8], 1, Aov::Caustics);
        assert!(image.pixels().iter().flatten().all(|v| *v == 0.0));
    }
}

#[test]
fn a_rings_caustic_matches_its_reference() {
    let Some(assets) = assets() else { return };
    let quarter = |name: &str| {
        let image = reference(&assets, &format!("ring.{name}"));
        Image::from_fn(image.width() / 4, image.height() / 4, |x, y| {
            let all = (0..16).map(|i| image.pixel(4 * x + i % 4, 4 * y + i / 4));
            all.fold([0.0; 3], |sum, pixel| [0, 1, 2].map(|channel| sum[channel] + pixel[channel] / 16.0))
        })
    };
    let [light1, straight, mask] = ["light1", "direct", "mask"].map(quarter);
    let scene = chiaro::scene::load(&assets.join("scenes/ring.glb").to_string_lossy()).unwrap();
    let view = View::from_scene(&scene, 0).unwrap();
    let found = caustics(photons("65536", &[]), &scene, (&view, [mask.width(), mask.height()]), 4);
    let options =
        CompareOptions { mask: Some(&mask), minus_b: Some(&straight), blur_px: 2.0, ..Default::default() };
    let metrics = Comparison::new(&found, &light1, &options).unwrap().metrics();
    assert!((metrics.mean_ratio - 1.0).abs() < 0.03 && metrics.nmae < 0.1, "{metrics:?}");
}
