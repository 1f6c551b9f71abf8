//! Every combination of layout, representation and filter against exact shadows.

use chiaro::scene::LightKind;
use chiaro::{Aov, LoadedScene, Renderer, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Exact, Stage, Studio, device, direct};
use glam::Vec3;

const SIZE: [u32; 2] = [160, 120];

/// A floor and a wall, boxes near and far, a thin slab and a post, under a sun, a spot and a point light.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    stage.quad(Vec3::new(0.0, 0.0, -6.0), Vec3::X * 10.0, Vec3::NEG_Z * 10.0, material);
    stage.quad(Vec3::new(0.0, 3.0, -12.0), Vec3::X * 10.0, Vec3::Y * 3.0, material);
    stage.cuboid(Vec3::new(-1.2, 0.5, -1.0), Vec3::new(0.4, 0.5, 0.4), material);
    stage.cuboid(Vec3::new(1.5, 1.0, -4.0), Vec3::new(0.6, 1.0, 0.3), material);
    stage.cuboid(Vec3::new(-2.5, 1.5, -7.0), Vec3::new(0.15, 1.5, 0.15), material);
    stage.cuboid(Vec3::new(0.2, 1.2, -2.5), Vec3::new(0.5, 0.03, 0.5), material);
    stage.sun(2.0, Vec3::new(0.5, -1.0, -0.35));
    stage.light(
        LightKind::Spot { inner_rad: 0.5, outer_rad: 0.7 },
        20.0,
        None,
        Vec3::new(-3.0, 4.0, 0.0),
        Vec3::new(0.7, -1.0, -0.9),
    );
    stage.light(LightKind::Point, 12.0, None, Vec3::new(0.5, 2.6, -5.5), Vec3::NEG_Y);
    stage
}

fn view() -> View {
    View::look_at(Vec3::new(0.0, 1.8, 3.5), Vec3::new(0.0, 0.7, -3.0), 0.9, 0.05)
}

fn changed(changes: &[(&str, &str)]) -> Settings {
    let mut settings = direct(changes);
    settings.set("shadow.memory_budget", "4096").unwrap();
    settings.set("shadow.resolution", "512").unwrap();
    settings
}

/// Share of the light that arrives at each pixel that any reaches, exactly.
fn truth(exact: &Exact, light_size: f32, rays: u32) -> Vec<Option<f32>> {
    let pixels = exact.pixels(&view(), SIZE);
    let share = |hit| {
        let [lit, all] = exact.irradiance(hit, light_size, rays);
        (all > 0.02).then(|| lit / all)
    };
    pixels.into_iter().map(|hit| hit.and_then(share)).collect()
}

/// What the picture shows of the light, as a share of what it shows without shadows: nothing is compiled but what makes
/// pictures, which is most of the time that many settings take.
fn shares(picture: &Image, unshadowed: &Image) -> Image {
    let all = picture.pixels().iter().zip(unshadowed.pixels());
    let share = |lit: f32, all: f32| match lit / all {
        // Half floats round by a two-thousandth.
        share if share <= 1.001 => share.min(1.0),
        share if all > 0.0 => share,
        _ => 0.0,
    };
    let pixels = all.map(|(lit, all)| [share(lit[0], all[0]); 3]).collect();
    Image::from_pixels(picture.width(), picture.height(), pixels).unwrap()
}

/// The picture without shadows.
fn unshadowed(studio: &mut Studio, scene: &LoadedScene) -> Image {
    studio.set(changed(&[("shadow.layout", "none")]));
    studio.radiance(scene, &view(), SIZE, 1)
}

/// Mean error of visibility, and that every value is one.
fn error(found: &Image, truth: &[Option<f32>], name: &str) -> f32 {
    let mut sum = 0.0;
    let mut count = 0;
    for (pixel, truth) in found.pixels().iter().zip(truth) {
        let v = pixel[0];
        assert!((0.0..=1.0001).contains(&v), "{name}: a visibility of {v}");
        if let Some(truth) = truth {
            sum += (v - truth).abs();
            count += 1;
        }
    }
    assert!(count > 10_000);
    sum / count as f32
}

const LAYOUTS: [&[(&str, &str)]; 3] = [
    &[("shadow.layout", "cascaded"), ("shadow.point_layout", "cube")],
    &[("shadow.layout", "single"), ("shadow.point_layout", "paraboloid")],
    &[("shadow.layout", "cascaded"), ("shadow.fit", "depth"), ("shadow.cascade_select", "depth")],
];

#[test]
fn every_combination_is_near_exact_shadows_or_refused_by_name() {
    let stage = stage();
    let gpu = device();
    let exact = Exact::new(&stage.scene);
    let hard = truth(&exact, 0.0, 1);
    let mut studio = Studio::new(&gpu, changed(&[]));
    let scene = studio.load(&stage.scene);
    let unshadowed = unshadowed(&mut studio, &scene);
    let mut worst = Vec::new();
    for representation in ["depth", "variance", "exponential", "evsm2", "evsm4", "moments"] {
        for filter in ["none", "pcf", "pcss", "gaussian", "mip", "gaussian-mip"] {
            // Without any shadow the error is 0.037; what is left is texels of half a decimetre.
            let bound = if representation == "depth" { 0.004 } else { 0.005 };
            // All layouts for two representations; the others take turns.
            let all = matches!(representation, "depth" | "evsm4");
            let turn = (representation.len() + filter.len()) % LAYOUTS.len();
            for layout in if all { &LAYOUTS[..] } else { &LAYOUTS[turn..=turn] } {
                let mut changes = vec![("shadow.representation", representation), ("shadow.filter", filter)];
                changes.extend(*layout);
                let name = format!("{changes:?}");
                let settings = changed(&changes);
                if let Some(reason) = settings.shadow.refused() {
                    let refusal = Renderer::new(&gpu, settings).unwrap_err().to_string();
                    assert!(refusal.contains(&reason), "{refusal}");
                    assert!(reason.contains(representation) && reason.contains(filter), "{reason}");
                    continue;
                }
                let soft = filter == "pcss";
                studio.set(settings);
                let found = shares(&studio.radiance(&scene, &view(), SIZE, 1), &unshadowed);
                let truth = if soft { truth(&exact, 0.02, 16) } else { hard.clone() };
                let error = error(&found, &truth, &name);
                if error > bound {
                    worst.push(format!("{name}: {error:.4} is more than {bound}"));
                }
            }
        }
    }
    assert!(worst.is_empty(), "{}", worst.join("\n"));
}

#[test]
fn every_kernel_and_bias_is_near_exact_shadows() {
    let stage = stage();
    let gpu = device();
    let truth = truth(&Exact::new(&stage.scene), 0.0, 1);
    let mut studio = Studio::new(&gpu, changed(&[]));
    let scene = studio.load(&stage.scene);
    let unshadowed = unshadowed(&mut studio, &scene);
    for kernel in ["2", "3", "4", "5", "7", "disc"] {
        for plane in ["true", "false"] {
            for cull in ["false", "true"] {
                let changes = [
                    ("shadow.pcf_kernel", kernel),
                    ("shadow.bias.receiver_plane", plane),
                    ("shadow.bias.cull_front", cull),
                ];
                // Front faces that do not cast let the floor light up under open pieces: here the slab's thickness.
                studio.set(changed(&changes));
                let found = shares(&studio.radiance(&scene, &view(), SIZE, 1), &unshadowed);
                let error = error(&found, &truth, kernel);
                assert!(error < 0.02, "{changes:?}: {error}");
            }
        }
    }
}

#[test]
fn a_larger_light_has_softer_shadows_as_rays_say() {
    let stage = stage();
    let gpu = device();
    let exact = Exact::new(&stage.scene);
    let mut studio = Studio::new(&gpu, changed(&[]));
    let scene = studio.load(&stage.scene);
    for (size, bound) in [("0.02", 0.015), ("0.1", 0.03), ("0.2", 0.04)] {
        let truth = truth(&exact, size.parse().unwrap(), 32);
        let mut errors = [("pcss", 0.0), ("pcf", 0.0)];
        for (filter, error_) in &mut errors {
            studio.set(changed(&[
                ("shadow.filter", filter),
                ("shadow.light_size", size),
                ("shadow.resolution", "1024"),
            ]));
            let found = studio.aov(&scene, &view(), SIZE, 1, Aov::Shadow);
            *error_ = error(&found, &truth, filter);
        }
        let [(_, soft), (_, hard)] = errors;
        assert!(soft < bound, "{size}: {soft}");
        assert!(size == "0.02" || soft < hard, "{size}: pcss {soft} is no better than pcf {hard}");
    }
}
