//! Materials of every kind: forward, deferred and traced alike.

use std::f32::consts::{PI, TAU};

use chiaro::scene::{Material, Mesh, Primitive, Reflection};
use chiaro::{Pipeline, ReferenceOptions};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, camera_above, device, direct, nmae};
use glam::{Affine3A, Vec3};

use crate::culling::Random;
use crate::truth::{mean, trace};

const COLUMNS: usize = 8;
const ROWS: usize = 6;
const SIDE_PX: usize = 12;
const SIZE: [u32; 2] = [(COLUMNS * SIDE_PX) as u32, (ROWS * SIDE_PX) as u32];

/// A ball of radius 1 around the origin.
fn ball(material: usize) -> Mesh {
    const RINGS: u32 = 24;
    const SECTORS: u32 = 48;
    let place = |ring: u32, sector: u32| {
        let (polar, around) = (PI * ring as f32 / RINGS as f32, TAU * sector as f32 / SECTORS as f32);
        Vec3::new(polar.sin() * around.cos(), polar.cos(), -polar.sin() * around.sin())
    };
    let positions: Vec<_> =
        (0..=RINGS).flat_map(|ring| (0..=SECTORS).map(move |sector| place(ring, sector))).collect();
    let quads = (0..RINGS).flat_map(|ring| (0..SECTORS).map(move |sector| ring * (SECTORS + 1) + sector));
    let indices = quads.flat_map(|a| {
        let b = a + SECTORS + 1;
        [a, b, b + 1, a, b + 1, a + 1]
    });
    let primitive = Primitive {
        normals: positions.clone(),
        positions,
        indices: indices.collect(),
        material,
        ..Primitive::default()
    };
    Mesh { primitives: vec![primitive], ..Mesh::default() }
}

/// One of every kind that hides what is behind it, by turns.
fn opaque(number: usize, random: &mut Random) -> Material {
    let mut color = |most: f32| Vec3::from([0; 3].map(|_| random.within(0.0, most)));
    let (base_color, tint) = (color(1.0).extend(1.0), color(4.0));
    let plain = Material { base_color, roughness: random.within(0.3, 1.0), ..Material::default() };
    match number % 9 {
        0 => Material { metallic: 1.0, ..plain },
        1 => Material { metallic: random.within(0.0, 1.0), ior: random.within(1.0, 3.0), ..plain },
        2 => Material { ior: random.within(1.0, 3.0), ..plain },
        3 => Material { ior: 2.417, specular: random.within(0.0, 1.0), ..plain },
        4 => Material { ior: 0.0, specular_color: tint * 0.25, ..plain },
        5 => Material { specular_color: tint, ..plain },
        6 => Material { specular_color: tint, ior: 2.0, specular: random.within(0.0, 1.0), ..plain },
        7 => {
            let base_color = (0.5 * base_color.truncate()).extend(1.0);
            let reflection = Reflection::Phong { exponent: random.within(0.0, 200.0) };
            Material { reflection, base_color, specular_color: tint * 0.125, ..plain }
        }
        _ => plain,
    }
}

/// Black things that shine: so that their light, which the reference knows and maps do not, falls on nothing.
fn glowing(_: usize, random: &mut Random) -> Material {
    let emissive = Vec3::from([0; 3].map(|_| random.within(0.0, 0.5)));
    Material { emissive, base_color: glam::Vec4::W, specular: 0.0, ..Material::default() }
}

/// Sheets and bodies of glass, by turns.
fn glass(number: usize, random: &mut Random) -> Material {
    let base_color = Vec3::from([0; 3].map(|_| random.within(0.0, 1.0))).extend(1.0);
    let (roughness, ior) = (random.within(0.3, 1.0), random.within(1.0, 2.5));
    let plain = Material { base_color, roughness, ior, ..Material::default() };
    match number % 2 {
        0 => Material { transmission: random.within(0.0, 1.0), ..plain },
        _ => Material { transmission: 1.0, thickness: 0.5, ..plain },
    }
}

fn balls_of(material: fn(usize, &mut Random) -> Material, seed: u64) -> Stage {
    let mut stage = Stage::new();
    let mut random = Random::new(seed);
    for number in 0..COLUMNS * ROWS {
        let material = material(number, &mut random);
        let material = stage.material(material);
        let x = 2.0 * (number % COLUMNS) as f32 + 1.0 - COLUMNS as f32;
        let z = 2.0 * (number / COLUMNS) as f32 + 1.0 - ROWS as f32;
        let at = Affine3A::from_scale_rotation_translation(
            Vec3::splat(0.9),
            glam::Quat::IDENTITY,
            Vec3::new(x, 0.0, z),
        );
        stage.place(ball(material), at);
    }
    // So high that no ball shadows what is seen of another.
    stage.sun(PI, Vec3::new(0.15, -1.0, -0.2));
    stage
}

fn assert_alike(what: &str, a: &Image, b: &Image, most: f64) {
    let mean = |image: &Image| mean(image, |_, _| true);
    let (ratio, distance) = (mean(a) / mean(b), nmae(a, b));
    assert!((ratio - 1.0).abs() < 0.003, "{what}: the means differ by {ratio}");
    assert!(distance <= most, "{what}: {distance}");
}

fn assert_shown_alike(material: fn(usize, &mut Random) -> Material, seeds: &[u64], most: f64) {
    let gpu = device();
    let view = camera_above(ROWS as f32);
    // Samples of a pixel are shaded at its middle, off the edge of a ball: what is compared is materials.
    let unshadowed = [("shadow.layout", "none"), ("surface.msaa", "1")];
    let mut studio = Studio::new(&gpu, direct(&unshadowed));
    for &seed in seeds {
        let stage = balls_of(material, seed);
        let loaded = studio.load(&stage.scene);
        let mut picture = |pipeline| {
            studio.set(chiaro::Settings { pipeline, ..direct(&unshadowed) });
            studio.radiance(&loaded, &view, SIZE, 64)
        };
        let (deferred, forward) = (picture(Pipeline::Deferred), picture(Pipeline::Forward));
        let options = ReferenceOptions { max_depth: 2, ..ReferenceOptions::default() };
        let truth = trace(&stage.scene, (&view, SIZE), options, &[256]);
        assert_alike("deferred and forward", &deferred, &forward, 0.006);
        // Pixel by pixel a path tracer's samples at edges and on highlights are others.
        assert_alike("deferred and reference", &deferred, &truth, most);
    }
}

#[test]
fn forward_deferred_and_reference_show_opaque_materials_of_every_kind_alike() {
    assert_shown_alike(opaque, &[1, 2], 0.05);
}

// Before black, so that nothing passes: the reference follows no light through glass when it is direct alone.
#[test]
fn forward_deferred_and_reference_show_what_glass_reflects_alike() {
    assert_shown_alike(glass, &[3], 0.006);
}

#[test]
fn forward_deferred_and_reference_show_what_glows_alike() {
    assert_shown_alike(glowing, &[4], 0.05);
}
