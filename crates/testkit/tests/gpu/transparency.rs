//! See-through surfaces against the formulas they stand for.

use chiaro::scene::{AlphaMode, Filter, Material, Reflection, Wrap};
use chiaro::{Gpu, LoadedScene, Pipeline, Recorder, Settings};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, camera_above, device, device_guaranteed, device_of_its_own, direct};
use glam::{Quat, Vec2, Vec3};

const SIZE: [u32; 2] = [64, 64];
/// One code value of an 8-bit picture.
const CODE: f32 = 1.0 / 255.0;

fn pipelines() -> [Settings; 3] {
    [(Pipeline::Deferred, "1"), (Pipeline::Forward, "1"), (Pipeline::Forward, "4")]
        .map(|(pipeline, msaa)| Settings { pipeline, ..direct(&[("surface.msaa", msaa)]) })
}

fn studios(gpu: &Gpu) -> impl Iterator<Item = Studio> {
    pipelines().into_iter().map(|settings| Studio::new(gpu, settings))
}

/// Shows its colour in nits whatever the light.
fn unlit(color: Vec3) -> Material {
    Material {
        reflection: Reflection::Unlit,
        base_color: color.extend(1.0),
        double_sided: true,
        ..Material::default()
    }
}

fn blend(color: Vec3, alpha: f32) -> Material {
    Material { base_color: color.extend(alpha), alpha: AlphaMode::Blend, ..unlit(color) }
}

/// Reflects nothing, passes all.
fn clear() -> Material {
    Material {
        specular: 0.0,
        roughness: 0.0,
        transmission: 1.0,
        ior: 1.0,
        double_sided: true,
        ..Material::default()
    }
}

/// A level quad of half a side `half` at a height.
fn level(stage: &mut Stage, height: f32, half: f32, material: Material) {
    let material = stage.material(material);
    stage.quad(Vec3::Y * height, Vec3::X * half, Vec3::NEG_Z * half, material);
}

fn picture(studio: &mut Studio, stage: &Stage) -> Image {
    let scene = studio.load(&stage.scene);
    studio.radiance(&scene, &camera_above(1.0), SIZE, 1)
}

#[track_caller]
fn assert_is(found: [f32; 3], expected: Vec3, tolerance: f32) {
    let off = (Vec3::from(found) - expected).abs().max_element();
    assert!(off <= tolerance, "{found:?} instead of {expected}");
}

#[test]
fn two_blended_quads_are_one_over_the_other_whatever_their_order_in_the_scene() {
    let gpu = device();
    let ground = Vec3::new(0.2, 0.9, 0.4);
    let (low, high) = (Vec3::new(1.0, 0.1, 0.0), Vec3::new(0.0, 0.3, 1.0));
    let over_ground = low * 0.25 + ground * 0.75;
    for mut studio in studios(&gpu) {
        for swapped in [false, true] {
            let mut stage = Stage::new();
            level(&mut stage, 0.0, 2.0, unlit(ground));
            let mut quads = [(1.0, blend(low, 0.25)), (2.0, blend(high, 0.6))];
            if swapped {
                quads.reverse();
            }
            for (height, material) in quads {
                level(&mut stage, height, 0.5, material);
            }
            let image = picture(&mut studio, &stage);
            assert_is(image.pixel(32, 32), high * 0.6 + over_ground * 0.4, CODE);
            assert_is(image.pixel(2, 2), ground, CODE);
        }
    }
}

#[test]
fn too_few_layers_drop_the_farthest_surfaces() {
    let gpu = device();
    let mut stage = Stage::new();
    level(&mut stage, 0.0, 2.0, unlit(Vec3::ZERO));
    for height in [1.0, 2.0, 3.0] {
        level(&mut stage, height, 1.0, blend(Vec3::ONE, 0.5));
    }
    let mut studio = Studio::new(&gpu, direct(&[]));
    for (layers, expected) in [("1", 0.5), ("2", 0.75), ("3", 0.875), ("8", 0.875)] {
        studio.set(direct(&[("surface.layers", layers)]));
        assert_is(picture(&mut studio, &stage).pixel(20, 40), Vec3::splat(expected), CODE);
    }
}

#[test]
fn a_blended_surface_behind_an_opaque_one_is_not_seen() {
    let gpu = device();
    for mut studio in studios(&gpu) {
        let mut stage = Stage::new();
        level(&mut stage, 1.0, 2.0, unlit(Vec3::splat(0.5)));
        level(&mut stage, 0.0, 2.0, blend(Vec3::X, 0.5));
        assert_is(picture(&mut studio, &stage).pixel(32, 32), Vec3::splat(0.5), CODE);
    }
}

/// A checkerboard to be looked at through something.
fn checkerboard() -> Stage {
    let mut stage = Stage::new();
    let rgba =
        (0..64u8).flat_map(|i| [if (i / 8 + i) % 2 == 0 { 255 } else { 40 }, 180, i * 4, 255]).collect();
    let texture = stage.texture(8, [Wrap::Clamp; 2], Filter::Nearest, rgba);
    level(&mut stage, 0.0, 1.0, Material { base_color_texture: Some(texture), ..unlit(Vec3::ONE) });
    stage
}

#[test]
fn what_neither_reflects_nor_bends_nor_absorbs_is_not_seen() {
    let gpu = device();
    for mut studio in studios(&gpu) {
        let alone = picture(&mut studio, &checkerboard());
        // A slab of the air's own index, and a sheet, which has no inside to bend light in.
        let slab = Material { thickness: 0.5, ..clear() };
        let sheet = Material { ior: 1.5, ..clear() };
        for material in [slab, sheet] {
            let mut stage = checkerboard();
            level(&mut stage, 1.0, 0.6, material);
            let image = picture(&mut studio, &stage);
            for (found, expected) in image.pixels().iter().zip(alone.pixels()) {
                assert_is(*found, Vec3::from(*expected), CODE);
            }
        }
    }
}

#[test]
fn absorption_grows_with_thickness_as_beer_and_lambert_say() {
    let gpu = device();
    let (left, distance_m) = (Vec3::new(0.9, 0.5, 0.1), 0.2f32);
    for mut studio in studios(&gpu) {
        for thickness in [0.05f32, 0.2, 0.5] {
            let mut stage = Stage::new();
            level(&mut stage, 0.0, 2.0, unlit(Vec3::ONE));
            let attenuation =
                Material { attenuation_color: left, attenuation_distance: distance_m, ..clear() };
            level(&mut stage, 1.0, 0.5, Material { thickness, ..attenuation });
            let expected = left.powf(thickness / distance_m);
            assert_is(picture(&mut studio, &stage).pixel(32, 32), expected, CODE);
        }
    }
}

/// A slab above an edge along x = 0, white to the right, and by how many pixels the edge moves to the left.
fn tilted_slab(dispersion: f32) -> (Stage, f32) {
    let mut stage = Stage::new();
    let white = stage.material(unlit(Vec3::ONE));
    stage.quad(Vec3::new(1.0, 0.1, 0.0), Vec3::X, Vec3::NEG_Z * 2.0, white);
    let (ior, thickness, tilt) = (1.5f32, 0.4, 0.6f32);
    let glass = stage.material(Material { ior, thickness, dispersion, ..clear() });
    let turn = Quat::from_rotation_z(tilt);
    stage.quad(Vec3::Y * 2.0, turn * Vec3::X * 2.0, Vec3::NEG_Z * 2.0, glass);
    // The slab leans to −X, and a ray straight down is bent towards its inverted normal, to +X.
    let bent = (tilt.sin() / ior).asin();
    (stage, 32.0 * thickness * (tilt - bent).sin())
}

#[test]
fn a_tilted_slab_moves_what_is_behind_it_as_snell_says() {
    let gpu = device();
    let (mut stage, shift_px) = tilted_slab(0.0);
    level(&mut stage, 0.0, 3.0, unlit(Vec3::splat(0.1)));
    for mut studio in studios(&gpu) {
        let image = picture(&mut studio, &stage);
        let row: Vec<f32> = (0..64).map(|x| image.pixel(x, 32)[0]).collect();
        // Where the edge is: each pixel counts by how much of it is dark.
        let edge = row.iter().map(|v| (1.0 - v) / 0.9).sum::<f32>();
        assert!((edge - (32.0 - shift_px)).abs() < 0.3, "edge at {edge}, shifted by {shift_px}: {row:?}");
    }
}

#[test]
fn dispersion_bends_blue_more_than_red() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut edges = |dispersion| {
        let (mut stage, _) = tilted_slab(dispersion);
        level(&mut stage, 0.0, 3.0, unlit(Vec3::ZERO));
        let image = picture(&mut studio, &stage);
        [0, 1, 2].map(|channel| 64.0 - (0..64).map(|x| image.pixel(x, 32)[channel]).sum::<f32>())
    };
    let [red, green, blue] = edges(10.0);
    // Indices 1.375, 1.5 and 1.625.
    let shift = |ior: f32| 32.0 * 0.4 * (0.6 - (0.6f32.sin() / ior).asin()).sin();
    for (edge, ior) in [(red, 1.375), (green, 1.5), (blue, 1.625)] {
        assert!((edge - (32.0 - shift(ior))).abs() < 0.3, "{red} {green} {blue}");
    }
    assert!(red - blue > 0.5 && edges(0.0).windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn frosted_glass_blurs_what_is_far_behind_it_and_not_what_touches_it() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let rows = [3.0, 0.11].map(|height| {
        let mut stage = Stage::new();
        level(&mut stage, 0.0, 3.0, unlit(Vec3::ZERO));
        let white = stage.material(unlit(Vec3::ONE));
        stage.quad(Vec3::new(1.0, 0.1, 0.0), Vec3::X, Vec3::NEG_Z * 2.0, white);
        level(&mut stage, height, 2.0, Material { roughness: 0.2, ..clear() });
        let image = picture(&mut studio, &stage);
        (0..64).map(|x| image.pixel(x, 32)[0]).collect::<Vec<_>>()
    });
    let soft = |row: &[f32]| row.iter().filter(|v| (0.1..0.9).contains(*v)).count();
    assert!(soft(&rows[0]) >= 6 && soft(&rows[1]) <= 2, "{rows:?}");
    // Symmetric about the edge, and whole on both sides of it.
    let [left, right] = [rows[0][..32].iter().sum::<f32>(), rows[0][32..].iter().map(|v| 1.0 - v).sum()];
    assert!((left / right - 1.0).abs() < 0.1, "{left} {right}");
    // A GGX lobe has long tails.
    assert!(rows[0][0] < 0.06 && rows[0][63] > 0.94, "{rows:?}");
}

#[test]
fn textures_say_where_and_how_thick() {
    let gpu = device();
    // Red passes light, green is thickness: left opaque, middle clear, right thick.
    let rgba = [[0, 0], [255, 0], [255, 255], [255, 255]].iter().flat_map(|&[r, g]| [r, g, 0, 255]);
    let rgba: Vec<u8> = std::iter::repeat_n(rgba, 4).flatten().collect();
    for mut studio in studios(&gpu) {
        let mut stage = Stage::new();
        level(&mut stage, 0.0, 2.0, unlit(Vec3::ONE));
        let texture = Some(stage.texture(4, [Wrap::Clamp; 2], Filter::Nearest, rgba.clone()));
        let attenuation =
            Material { attenuation_color: Vec3::splat(0.3), attenuation_distance: 1.0, ..clear() };
        let textured = Material { transmission_texture: texture, thickness_texture: texture, ..attenuation };
        level(&mut stage, 1.0, 1.0, Material { thickness: 1.0, ..textured });
        let image = picture(&mut studio, &stage);
        for (x, expected) in [(8, 0.0), (24, 1.0), (40, 0.3), (56, 0.3)] {
            assert_is(image.pixel(x, 32), Vec3::splat(expected), CODE);
        }
    }
}

#[test]
fn half_transmission_halves_what_is_reflected_diffusely() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut lit = |transmission| {
        let mut stage = Stage::new();
        stage.sun(100.0, Vec3::NEG_Y);
        level(&mut stage, 1.0, 2.0, Material { transmission, ..clear() });
        picture(&mut studio, &stage).pixel(32, 32)[0]
    };
    let whole = lit(0.0);
    assert!((whole - 100.0 / std::f32::consts::PI).abs() < 0.1, "{whole}");
    assert!((lit(0.5) / whole - 0.5).abs() < 2e-3 && lit(1.0) == 0.0);
}

fn passes_of(studio: &mut Studio, gpu: &Gpu, scene: &LoadedScene) -> Vec<&'static str> {
    let mut state = chiaro::ViewState::new(studio.renderer());
    let mut recorder = Recorder::new(gpu, false);
    let prepared =
        studio.renderer().prepare(&mut state, scene, &camera_above(1.0), SIZE, (Vec2::ZERO, 1.0)).unwrap();
    let mut frame = recorder.begin();
    let _ = prepared.record(&mut frame, false);
    frame.submit();
    recorder.log().iter().map(|pass| pass.name).collect()
}

#[test]
fn opaque_scenes_cost_and_show_the_same_before_and_after_a_see_through_one() {
    let gpu = device();
    for mut studio in studios(&gpu) {
        let mut glass = checkerboard();
        level(&mut glass, 1.0, 0.5, clear());
        let mut seen = Vec::new();
        for stage in [&checkerboard(), &glass, &checkerboard()] {
            let scene = studio.load(&stage.scene);
            let image = studio.radiance(&scene, &camera_above(1.0), SIZE, 1);
            seen.push((passes_of(&mut studio, &gpu, &scene), image));
        }
        let transparent =
            |seen: &(Vec<&str>, Image)| seen.0.iter().any(|name| name.starts_with("transparency/"));
        assert!(!transparent(&seen[0]) && transparent(&seen[1]));
        assert!(seen[0] == seen[2]);
    }
}

#[test]
fn guaranteed_webgpu_is_enough_for_glass() {
    let (full, guaranteed) = (device(), device_guaranteed());
    let mut stage = checkerboard();
    level(&mut stage, 1.0, 0.8, Material { roughness: 0.3, ..clear() });
    level(&mut stage, 2.0, 0.6, blend(Vec3::X, 0.5));
    for settings in pipelines() {
        let [a, b]: [Image; 2] =
            [&*full, &*guaranteed].map(|gpu| picture(&mut Studio::new(gpu, settings.clone()), &stage));
        for (a, b) in a.pixels().iter().zip(b.pixels()) {
            assert_is(*a, Vec3::from(*b), CODE);
        }
    }
}

#[test]
fn a_steady_frame_with_glass_allocates_nothing() {
    let gpu = device_of_its_own();
    let mut stage = checkerboard();
    level(&mut stage, 1.0, 0.5, clear());
    let mut studio = Studio::new(&gpu, direct(&[]));
    let scene = studio.load(&stage.scene);
    let mut state = chiaro::ViewState::new(studio.renderer());
    let mut recorder = Recorder::new(&gpu, false);
    let created = [(); 6].map(|()| {
        let prepared = studio
            .renderer()
            .prepare(&mut state, &scene, &camera_above(1.0), SIZE, (Vec2::ZERO, 1.0))
            .unwrap();
        let mut frame = recorder.begin();
        let _ = prepared.record(&mut frame, false);
        frame.submit();
        recorder.wait().unwrap();
        gpu.created.total()
    });
    assert_eq!(created[2], created[5]);
}
