//! The path tracer against formulas, on a device with nothing but what WebGPU guarantees.

use std::f32::consts::PI;

use chiaro::scene::{self, Environment, LightKind, Material, Scene};
use chiaro::{FirstHit, Integrator, Kit, LoadedScene, Recorder, Reference, ReferenceOptions, View};
use chiaro_image::Image;
use chiaro_techniques::shaders;
use chiaro_testkit::{
    Stage, Studio, Truth, assets, camera_above, device, device_guaranteed, direct, nmae, place_below,
    reference,
};
use glam::{Vec2, Vec3, Vec4};

const ALBEDO: f32 = 0.6;
const SIDE: u32 = 32;
const HALF: f32 = 2.0;

fn depth(max_depth: u32) -> ReferenceOptions {
    ReferenceOptions { max_depth, seed: 1, ..ReferenceOptions::default() }
}

pub(crate) fn trace(
    scene: &Scene,
    (view, size): (&View, [u32; 2]),
    options: ReferenceOptions,
    groups: &[u32],
) -> Image {
    Truth::new(&device_guaranteed(), direct(&[]), scene, (view, size), options).add(groups)
}

/// The same scene from many places.
pub(crate) fn trace_views(
    scene: &Scene,
    (views, size): (&[View], [u32; 2]),
    options: ReferenceOptions,
    groups: &[u32],
) -> Vec<Image> {
    let gpu = device_guaranteed();
    let mut truth = Truth::new(&gpu, direct(&[]), scene, (&views[0], size), options);
    let mut picture = |view| {
        truth.look(view);
        truth.add(groups)
    };
    views.iter().map(&mut picture).collect()
}

/// From 10 m above, 4 m a side.
fn from_above(stage: &Stage, max_depth: u32, samples: u32) -> Image {
    trace(&stage.scene, (&camera_above(HALF), [SIDE; 2]), depth(max_depth), &[samples])
}

/// Where a pixel's middle lies on the floor.
fn place(x: u32, y: u32) -> Vec3 {
    place_below([x, y], SIDE, HALF)
}

fn assert_floor(image: &Image, tolerance: f32, nits: impl Fn(Vec3) -> f32) {
    for (x, y) in (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE)) {
        let (found, expected) = (image.pixel(x, y)[1], nits(place(x, y)));
        let off = (found - expected).abs();
        assert!(off <= tolerance * expected.max(1e-6), "{}: {found} is not {expected}", place(x, y));
    }
}

pub(crate) fn mean(image: &Image, of: impl Fn(u32, u32) -> bool) -> f32 {
    let (width, height) = image.size();
    let pixels = (0..width * height).map(|i| (i % width, i / width)).filter(|&(x, y)| of(x, y));
    let values: Vec<_> = pixels.map(|(x, y)| f64::from(image.pixel(x, y)[1])).collect();
    (values.iter().sum::<f64>() / values.len() as f64) as f32
}

#[test]
fn a_lambertian_floor_under_a_sun_shows_e_rho_over_pi() {
    let mut stage = Stage::floor(ALBEDO);
    let direction = Vec3::new(0.6, -1.0, 0.3).normalize();
    stage.sun(1000.0, direction);
    assert_floor(&from_above(&stage, 0, 1), 1e-5, |_| 1000.0 * -direction.y * ALBEDO / PI);
}

#[test]
fn a_point_light_falls_off_with_the_square_of_its_distance() {
    let mut stage = Stage::floor(ALBEDO);
    stage.light(LightKind::Point, 100.0, None, Vec3::Y * 1.5, Vec3::NEG_Y);
    // Sixteen places of each pixel.
    let image = from_above(&stage, 0, 16);
    assert_floor(&image, 0.005, |at| 100.0 * 1.5 / (at - Vec3::Y * 1.5).length().powi(3) * ALBEDO / PI);
}

#[test]
fn a_spot_light_ends_at_its_cone() {
    let mut stage = Stage::floor(ALBEDO);
    let spot = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.5 };
    stage.light(spot, 100.0, None, Vec3::Y * 2.0, Vec3::NEG_Y);
    let image = from_above(&stage, 0, 16);
    let pixel = 2.0 * HALF / SIDE as f32;
    for (x, y) in (0..SIDE * SIDE).map(|i| (i % SIDE, i / SIDE)) {
        let at = place(x, y);
        let angle = (Vec2::new(at.x, at.z).length() / 2.0).atan();
        let full = 100.0 * 2.0 / (at - Vec3::Y * 2.0).length().powi(3) * ALBEDO / PI;
        let found = image.pixel(x, y)[1];
        if angle > 0.5 + pixel {
            assert!(found == 0.0, "{at}: {found}");
        } else if angle < 0.3 - pixel {
            assert!((found / full - 1.0).abs() < 0.01, "{at}: {found} is not {full}");
        }
    }
}

/// A lamp of `half`² · 4 m² at a height, shining down with one nit.
pub fn lamp(stage: &mut Stage, height: f32, half: f32) {
    let shining = Material { emissive: Vec3::ONE, base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::Y * height, Vec3::X * half, Vec3::Z * half, shining);
}

/// Form factor from a place on the floor to a lamp straight above the origin, by quadrature.
pub fn form_factor(at: Vec3, height: f32, half: f32) -> f32 {
    const STEPS: u32 = 64;
    let step = 2.0 * half / STEPS as f32;
    let on = |i: u32| (i as f32 + 0.5) * step - half;
    let cells = (0..STEPS * STEPS).map(|i| Vec3::new(on(i % STEPS), height, on(i / STEPS)) - at);
    cells.map(|to| (height / to.length()).powi(2) / (PI * to.length_squared())).sum::<f32>() * step * step
}

#[test]
fn a_patch_receives_what_the_form_factor_of_a_lamp_says() {
    let mut stage = Stage::floor(ALBEDO);
    lamp(&mut stage, 1.0, 0.4);
    let tilted = View::look_at(Vec3::new(0.0, 0.5, 4.0), Vec3::ZERO, 0.5, 0.1);
    // Seen from below the lamp shines, from above it does not.
    let images = trace_views(&stage.scene, (&[tilted, camera_above(HALF)], [SIDE; 2]), depth(1), &[4]);
    let [seen, above] = [0, 1].map(|i| mean(&images[i], |_, _| true));
    assert!(seen > 0.005 && above == 0.0, "{seen} {above}");
    let image = from_above(&stage, 2, 256);
    // Corners of the picture; its middle is under the lamp.
    for (x, y) in [(0, 0), (24, 0), (0, 24), (24, 24), (12, 0), (24, 12)] {
        let found = mean(&image, |px, py| (x..x + 8).contains(&px) && (y..y + 8).contains(&py));
        let cells = (0..64).map(|i| form_factor(place(x + i % 8, y + i / 8), 1.0, 0.4));
        let expected = cells.sum::<f32>() / 64.0 * ALBEDO;
        assert!((found / expected - 1.0).abs() < 0.01, "{x} {y}: {found} is not {expected}");
    }
}

#[test]
fn light_bounces_once_between_two_patches_as_their_form_factor_says() {
    const STEPS: u32 = 256;
    // A sunlit floor of 2 × 2 m, and a wall over its edge that the sun, straight above, does not light.
    let mut stage = Stage::new();
    let material = stage.lambert(ALBEDO);
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, material);
    stage.quad(Vec3::new(0.0, 1.0, -1.0), Vec3::X, Vec3::Y, material);
    stage.sun(1000.0, Vec3::NEG_Y);
    let view = View::look_at(Vec3::new(0.0, 1.0, 6.0), Vec3::new(0.0, 1.0, -1.0), 0.02, 0.1);
    let image = trace(&stage.scene, (&view, [16, 16]), depth(3), &[256, 256]);
    // The camera sees a spot of the wall 0.14 m wide around its middle.
    let step = 2.0 / STEPS as f32;
    let on = |i: u32| (i as f32 + 0.5) * step - 1.0;
    let factor = (0..STEPS * STEPS)
        .map(|i| {
            let to = Vec3::new(on(i % STEPS), 0.0, on(i / STEPS)) - Vec3::new(0.0, 1.0, -1.0);
            to.z * -to.y / (PI * to.length_squared().powi(2)) * step * step
        })
        .sum::<f32>();
    let expected = 1000.0 * ALBEDO / PI * factor * ALBEDO;
    let found = mean(&image, |_, _| true);
    assert!((found / expected - 1.0).abs() < 0.01, "{found} is not {expected}");
}

pub(crate) fn environment(nits: impl Fn(u32, u32) -> f32) -> Environment {
    let (width, height) = (128, 64);
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let radiance = texels.map(|(x, y)| Vec3::splat(nits(x, y))).collect();
    Environment { name: "test".into(), width, height, radiance }
}

#[test]
fn a_white_furnace_stays_white() {
    const ROUGHNESSES: [f32; 6] = [0.0, 0.1, 0.3, 0.5, 0.7, 1.0];
    const METALLIC: [f32; 4] = [1.0, 0.5, 0.25, 0.0];
    let at = |row: usize, column: usize| Vec3::new(2.0 * column as f32 - 5.0, 0.0, 2.0 * row as f32 - 3.0);
    let mut stage = Stage::new();
    // Black below, where the camera would look past a patch.
    stage.scene.environment = Some(environment(|_, y| if y <= 33 { 1.0 } else { 0.0 }));
    for (row, metallic) in METALLIC.into_iter().enumerate() {
        for (column, roughness) in ROUGHNESSES.into_iter().enumerate() {
            let white = stage.material(Material { metallic, roughness, ..Material::default() });
            stage.quad(at(row, column), Vec3::X, Vec3::NEG_Z, white);
        }
    }
    let size = [96, 64];
    // From 11 and from 60 degrees, far away.
    let directions = [Vec3::new(0.0, 1.0, 0.2), Vec3::new(0.0, 1.0, 1.73)];
    let views = directions.map(|to| View::look_at(to.normalize() * 100.0, Vec3::ZERO, 0.075, 0.1));
    let images = trace_views(&stage.scene, (&views, size), depth(0), &[128]);
    for ((towards, view), image) in directions.into_iter().zip(views).zip(images) {
        for (row, metallic) in METALLIC.into_iter().enumerate() {
            for (column, roughness) in ROUGHNESSES.into_iter().enumerate() {
                let ndc = view.clip_from_ws(size, Vec2::ZERO).project_point3(at(row, column));
                let middle = (Vec2::new(ndc.x, -ndc.y) * 0.5 + 0.5) * Vec2::new(96.0, 64.0);
                let near = |x: u32, y: u32| {
                    let away = (Vec2::new(x as f32, y as f32) + 0.5 - middle).abs();
                    away.x < 7.0 && away.y < 3.0
                };
                let found = mean(&image, near);
                let range = if metallic == 1.0 { 0.99..1.01 } else { 0.95..1.01 };
                assert!(
                    range.contains(&found),
                    "metallic {metallic} roughness {roughness} {towards}: {found}"
                );
            }
        }
    }
}

#[test]
fn a_bright_texel_of_the_environment_lights_like_its_solid_angle() {
    let mut stage = Stage::floor(ALBEDO);
    let (row, column) = (16, 40);
    stage.scene.environment = Some(environment(|x, y| if (x, y) == (column, row) { 1000.0 } else { 0.0 }));
    let edge = |row: f32| (row / 64.0 * PI).cos();
    // The cube that holds the map has texels of its own: a few percent for a single one.
    let angle = 2.0 * PI / 128.0 * (edge(row as f32) - edge(row as f32 + 1.0));
    let expected = 1000.0 * angle * edge(row as f32 + 0.5) * ALBEDO / PI;
    let found = mean(&from_above(&stage, 0, 64), |_, _| true);
    assert!((found / expected - 1.0).abs() < 0.03, "{found} is not {expected}");
    // And a screen over the floor shades just where that texel says it does, however the map is turned.
    let blocker = stage.lambert(0.0);
    let phi = (column as f32 + 0.5) / 128.0 * 2.0 * PI;
    let polar = (row as f32 + 0.5) / 64.0 * PI;
    let to = Vec3::new(polar.sin() * phi.sin(), polar.cos(), -polar.sin() * phi.cos());
    stage.quad(to * 20.0, Vec3::X * 6.0, Vec3::NEG_Z * 6.0, blocker);
    let (gpu, view) = (device_guaranteed(), camera_above(HALF));
    let mut truth = Truth::new(&gpu, direct(&[]), &stage.scene, (&view, [SIDE; 2]), depth(0));
    assert!(mean(&truth.add(&[16]), |_, _| true) < 0.02 * expected);
    truth.settings.set("environment.rotation", "90").unwrap();
    truth.look(&view);
    let found = mean(&truth.add(&[64]), |_, _| true);
    assert!((found / expected - 1.0).abs() < 0.03, "{found} is not {expected}");
}

/// Share of unpolarised light that an interface reflects.
pub(crate) fn fresnel(cosine: f32, ior: f32) -> f32 {
    let t = (1.0 - (1.0 - cosine * cosine) / (ior * ior)).sqrt();
    let s = (cosine - ior * t) / (cosine + ior * t);
    let p = (ior * cosine - t) / (ior * cosine + t);
    0.5 * (s * s + p * p)
}

#[test]
fn a_glass_slab_reflects_refracts_and_absorbs() {
    let (ior, thick, colour, distance) = (1.5, 0.5, 0.3f32, 0.8);
    let mut stage = Stage::new();
    let glass = Material {
        transmission: 1.0,
        roughness: 0.0,
        ior,
        thickness: 1.0,
        attenuation_color: Vec3::splat(colour),
        attenuation_distance: distance,
        ..Material::default()
    };
    let glass = stage.material(glass);
    stage.cuboid(Vec3::ZERO, Vec3::new(50.0, 0.5 * thick, 50.0), glass);
    let shining =
        Material { emissive: Vec3::splat(7.0), base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::NEG_Y, Vec3::X * 60.0, Vec3::NEG_Z * 60.0, shining);
    let angles = [0.0f32, 0.6, 1.2];
    let views = angles
        .map(|angle| View::look_at(Vec3::new(angle.sin(), angle.cos(), 0.0) * 5.0, Vec3::ZERO, 0.002, 0.1));
    let images = trace_views(&stage.scene, (&views, [8, 8]), depth(0), &[256]);
    for (angle, image) in angles.into_iter().zip(images) {
        // Light that went back and forth inside arrives too; the black lamp returns nothing.
        let inside = (1.0 - (angle.sin() / ior).powi(2)).sqrt();
        let passes = colour.powf(thick / inside / distance);
        let r = fresnel(angle.cos(), ior);
        let expected = 7.0 * (1.0 - r).powi(2) * passes / (1.0 - (r * passes).powi(2));
        let found = mean(&image, |_, _| true);
        assert!((found / expected - 1.0).abs() < 0.005, "{angle}: {found} is not {expected}");
    }
}

#[test]
fn light_under_water_is_as_bright_above_it() {
    // A uniform sky through a rough and a smooth surface of a medium with a white floor: all that enters comes back.
    for roughness in [0.0, 0.2] {
        let mut stage = Stage::new();
        stage.scene.environment = Some(environment(|_, _| 1.0));
        let white = stage.lambert(1.0);
        stage.quad(Vec3::NEG_Y * 0.01, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, white);
        let water =
            Material { transmission: 1.0, roughness, ior: 1.33, thickness: 1.0, ..Material::default() };
        let water = stage.material(water);
        stage.quad(Vec3::ZERO, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, water);
        let view = View::look_at(Vec3::new(0.0, 2.0, 1.0), Vec3::ZERO, 0.02, 0.1);
        let found = mean(&trace(&stage.scene, (&view, [8, 8]), depth(0), &[512]), |_, _| true);
        // Rough interfaces lose what facets scatter to each other.
        let least = if roughness > 0.0 { 0.93 } else { 0.99 };
        assert!(found > least && found < 1.01, "{roughness}: {found}");
    }
}

#[test]
fn direct_light_equals_that_of_the_deferred_pipeline() {
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let size = [96, 64];
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "4096")]));
    let loaded = studio.load(&scene);
    let deferred = studio.radiance(&loaded, &view, size, 64);
    let traced = trace(&scene, (&view, size), depth(2), &[64]);
    let distance = nmae(&deferred, &traced);
    // Shadow edges of a map, the surface buffer's bits, and edges of the box in 64 places of a pixel each.
    assert!(distance < 0.01, "{distance}");
}

#[test]
fn grouping_changes_no_bit_and_another_seed_changes_many() {
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let gpu = device_guaranteed();
    let seeded = |seed| {
        let options = ReferenceOptions { seed, ..ReferenceOptions::default() };
        Truth::new(&gpu, direct(&[]), &scene, (&view, [48, 32]), options)
    };
    let mut truth = seeded(5);
    let once = truth.add(&[8]);
    truth.look(&view);
    assert_eq!(once.pixels(), truth.add(&[1, 3, 4]).pixels());
    assert!(nmae(&seeded(6).add(&[8]), &once) > 0.01);
}

#[test]
fn stopped_and_resumed_is_bit_for_bit_the_same_as_run_through() {
    let gpu = device_guaranteed();
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), direct(&[]));
    let loaded = LoadedScene::upload(&kit, &scene).unwrap();
    let begin = || Reference::new(&kit, (&scene, &loaded), &settings, (&view, [48, 32]), depth(0)).unwrap();
    let add = |reference: &mut Reference, count| {
        let mut recorder = Recorder::new(&gpu, false);
        let mut frame = recorder.begin();
        reference.add(&mut frame, &loaded, count);
        frame.submit();
    };
    let read = |reference: &Reference| -> Vec<(&'static str, Vec<f32>)> {
        let layers = reference.read_layers().unwrap();
        layers.into_iter().map(|(name, layer)| (name, layer.wait(&gpu).unwrap().floats())).collect()
    };
    let bits = |layers: &[(&'static str, Vec<f32>)]| -> Vec<(&'static str, Vec<u32>)> {
        layers.iter().map(|(name, texels)| (*name, texels.iter().map(|t| t.to_bits()).collect())).collect()
    };

    let mut stopped = begin();
    add(&mut stopped, 3);
    let mut layers = read(&stopped);
    add(&mut stopped, 5);
    let through = read(&stopped);
    assert!(through[0].1.iter().any(|sum| *sum > 0.0), "black");

    let mut resumed = begin();
    resumed.restore(3, &layers).unwrap();
    assert_eq!(bits(&read(&resumed)), bits(&layers));
    add(&mut resumed, 5);
    assert_eq!(resumed.samples(), 8);
    assert_eq!(bits(&read(&resumed)), bits(&through));

    layers[1].1.pop();
    let error = begin().restore(3, &layers).unwrap_err().to_string();
    assert!(error.contains("squares") && error.contains("6144"), "{error}");
    let error = begin().restore(3, &layers[1..]).unwrap_err().to_string();
    assert!(error.contains("`sum` is missing"), "{error}");
}

#[test]
fn rows_traced_one_band_at_a_time_and_a_restart_change_no_bit() {
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let elsewhere = View::look_at(Vec3::new(0.3, 1.2, 2.0), Vec3::Y, 0.9, 0.01);
    let (gpu, size, options) =
        (device_guaranteed(), [48, 37], ReferenceOptions { seed: 5, ..ReferenceOptions::default() });
    let once = trace(&scene, (&view, size), options, &[6]);
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), direct(&[]));
    let loaded = LoadedScene::upload(&kit, &scene).unwrap();
    let mut reference =
        Reference::new(&kit, (&scene, &loaded), &settings, (&elsewhere, size), options).unwrap();
    let mut recorder = Recorder::new(&gpu, false);
    let mut refine = |reference: &mut Reference, work: u64, most: u32| {
        let mut frame = recorder.begin();
        let recorded = reference.refine(&mut frame, &loaded, work, most);
        frame.submit();
        recorded
    };
    // Left in the middle of a pass.
    refine(&mut reference, 1, 9);
    assert!(reference.samples() == 0 && reference.under_way() > 0.0);
    reference.restart(&loaded, &settings, (&view, size)).unwrap();
    assert!(reference.under_way() == 0.0);
    let all = u64::from(6 * size[0] * size[1]);
    let mut traced = 0;
    for work in [1, 500, 700, 5000, 1, u64::MAX, 7, 7] {
        traced += refine(&mut reference, work, 6);
    }
    assert_eq!((traced, reference.samples()), (all, 6), "more or less was traced than was asked for");
    let pixels = reference.sum().unwrap().wait(&gpu).unwrap();
    let means = pixels.floats().chunks_exact(4).map(|p| [0, 1, 2].map(|i| p[i] / 6.0)).collect::<Vec<_>>();
    assert!(means == once.pixels(), "the image is another");
}

#[test]
fn a_restart_leaves_nothing_of_the_image_before() {
    let mut scene = scene::load("builtin:ring").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let elsewhere = View::look_at(Vec3::new(0.3, 1.2, 2.0), Vec3::Y, 0.9, 0.01);
    let gpu = device_guaranteed();
    let (kit, settings) = (Kit::new(&gpu, shaders::library()), direct(&[]));
    let loaded = LoadedScene::upload(&kit, &scene).unwrap();
    let options = ReferenceOptions { integrator: Integrator::Photon, seed: 5, ..ReferenceOptions::default() };
    let mut recorder = Recorder::new(&gpu, false);
    let mut refine = |reference: &mut Reference, work: u64, most: u32| {
        let mut frame = recorder.begin();
        reference.refine(&mut frame, &loaded, work, most);
        frame.submit();
    };
    let begin = |view, size| {
        let mut reference =
            Reference::new(&kit, (&scene, &loaded), &settings, (view, size), options).unwrap();
        reference.observe(loaded.gpu.facts, &[FirstHit::Depth]).unwrap();
        reference
    };
    let read = |reference: &Reference| -> Vec<Vec<f32>> {
        let layers = reference.read_layers().unwrap();
        layers.into_iter().map(|(_, layer)| layer.wait(&gpu).unwrap().floats()).collect()
    };
    let dark = settings.clone();
    let mut bright = settings.clone();
    bright.set("environment.intensity", "3").unwrap();
    // The same size, and another.
    for before in [[24, 16], [16, 24]] {
        let mut reference = begin(&elsewhere, before);
        reference.restart(&loaded, &bright, (&elsewhere, before)).unwrap();
        refine(&mut reference, u64::MAX, 1);
        // And the next sample under way, in the middle of its light paths.
        refine(&mut reference, 1, 2);
        reference.restart(&loaded, &dark, (&view, [24, 16])).unwrap();
        assert!(read(&reference).iter().flatten().all(|sum| *sum == 0.0), "something is left");
        refine(&mut reference, u64::MAX, 1);
        let mut fresh = begin(&view, [24, 16]);
        refine(&mut fresh, u64::MAX, 1);
        assert_eq!((reference.samples(), reference.light_paths()), (fresh.samples(), fresh.light_paths()));
        assert!(fresh.light_paths() > 0);
        assert!(read(&reference) == read(&fresh), "another image");
    }
}

fn assert_matches(name: &str, options: ReferenceOptions, samples: usize, most: f64) {
    let Some(assets) = assets() else { return };
    let part = if options.max_depth == 2 { "direct" } else { "full" };
    let expected = reference(&assets, &format!("{name}.{part}"));
    let scene = scene::load(&assets.join(format!("scenes/{name}.glb")).to_string_lossy()).unwrap();
    let view = View::from_scene(&scene, 0).unwrap();
    let size = [expected.width(), expected.height()];
    let found = trace(&scene, (&view, size), options, &vec![1; samples]);
    let options = chiaro_image::CompareOptions { blur_px: 4.0, ..Default::default() };
    let metrics = chiaro_image::Comparison::new(&found, &expected, &options).unwrap().metrics();
    assert!(metrics.nmae <= most && (metrics.mean_ratio - 1.0).abs() <= 0.01, "{name}: {metrics:?}");
}

// The noise of so few samples decides the bounds: a quarter of them doubles it.
#[test]
fn a_cornell_box_under_a_point_light_matches_its_reference() {
    assert_matches("cornell_point", depth(2), 4, 0.001);
}

#[test]
fn a_cornell_box_under_a_spot_matches_its_reference() {
    assert_matches("cornell_spot", depth(0), 4, 0.03);
}

#[test]
fn a_cornell_box_under_a_lamp_matches_its_reference() {
    assert_matches("cornell_area", depth(0), 4, 0.03);
}
