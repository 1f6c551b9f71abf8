//! Light paths against formulas: what mirrors, lenses and prisms do with the light of lamps without extent.

use std::f32::consts::PI;

use chiaro::scene::{self, AlphaMode, Filter, LightKind, Material, Mesh, Node, Primitive, Transform, Wrap};
use chiaro::{Integrator, ReferenceOptions, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Truth, camera_above, device_guaranteed, direct, nmae, place_below};
use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::truth::{environment, fresnel, mean, trace, trace_views};

pub(crate) const ALBEDO: f32 = 0.6;
pub(crate) const SIDE: u32 = 32;
pub(crate) const HALF: f32 = 1.0;

fn options(integrator: Integrator) -> ReferenceOptions {
    ReferenceOptions { integrator, seed: 1, ..ReferenceOptions::default() }
}

pub(crate) fn glass(ior: f32) -> Material {
    Material { transmission: 1.0, roughness: 0.0, ior, thickness: 1.0, ..Material::default() }
}

/// A vertical mirror that faces −x, a metre from the origin, and a lamp over the floor before it.
pub(crate) const LAMP: Vec3 = Vec3::new(0.3, 0.8, 0.1);
pub(crate) const CANDELA: f32 = 100.0;
const MIRROR: f32 = 0.9;

pub(crate) fn before_a_mirror() -> Stage {
    let mut stage = Stage::floor(ALBEDO);
    let base_color = Vec4::new(MIRROR, MIRROR, MIRROR, 1.0);
    let mirror = Material { base_color, metallic: 1.0, roughness: 0.0, ..Material::default() };
    let mirror = stage.material(mirror);
    stage.quad(Vec3::new(1.0, 2.0, 0.0), Vec3::NEG_Z * 4.0, Vec3::NEG_Y * 2.0, mirror);
    stage.light(LightKind::Point, CANDELA, None, LAMP, Vec3::NEG_Y);
    stage
}

pub(crate) fn mirrored(p: Vec3) -> Vec3 {
    Vec3::new(2.0 - p.x, p.y, p.z)
}

/// What the mirror reflects of light between a place and its image's side (Schlick).
pub(crate) fn reflectance(from: Vec3, to: Vec3) -> f32 {
    let cosine = (to - from).normalize().x.abs();
    MIRROR + (1.0 - MIRROR) * (1.0 - cosine).powi(5)
}

/// Nits of the floor: the lamp's light, and that of its image behind the mirror.
fn before_a_mirror_nits(at: Vec3) -> f32 {
    let lit = |lamp: Vec3| CANDELA * lamp.y / (lamp - at).length().powi(3);
    (lit(LAMP) + reflectance(at, mirrored(LAMP)) * lit(mirrored(LAMP))) * ALBEDO / PI
}

/// Means over blocks of 8 × 8 pixels of the picture from above that lie before the mirror.
pub(crate) fn assert_blocks(image: &Image, tolerance: f32, nits: impl Fn(Vec3) -> f32) {
    for (bx, by) in [(0, 0), (8, 0), (0, 8), (16, 8), (8, 16), (0, 24), (16, 24)] {
        let pixels: Vec<_> = (0..64).map(|i| (bx + i % 8, by + i / 8)).collect();
        let sum = |of: &dyn Fn(u32, u32) -> f32| pixels.iter().map(|&(x, y)| of(x, y)).sum::<f32>();
        let found = sum(&|x, y| image.pixel(x, y)[1]);
        let expected = sum(&|x, y| nits(place_below([x, y], SIDE, HALF)));
        assert!((found / expected - 1.0).abs() < tolerance, "{bx} {by}: {found} is not {expected}");
    }
}

#[test]
fn a_mirror_lights_the_floor_like_the_lamps_image_behind_it() {
    let stage = before_a_mirror();
    let view = (&camera_above(HALF), [SIDE; 2]);
    for (integrator, samples) in [(Integrator::Photon, 128), (Integrator::Full, 32)] {
        let options = ReferenceOptions { diffuse_bounces: 0, ..options(integrator) };
        let image = trace(&stage.scene, view, options, &[samples]);
        assert_blocks(&image, 0.03, before_a_mirror_nits);
    }
    // Paths from the camera alone find none of it.
    let path =
        trace(&stage.scene, view, ReferenceOptions { max_depth: 3, ..ReferenceOptions::default() }, &[16]);
    let lit = |at: Vec3| CANDELA * LAMP.y / (LAMP - at).length().powi(3) * ALBEDO / PI;
    assert_blocks(&path, 0.02, lit);
}

#[test]
fn light_from_a_mirror_is_seen_in_the_mirror_too() {
    let stage = before_a_mirror();
    let (eye, target) = (Vec3::new(-1.0, 0.9, 0.0), Vec3::new(1.0, 0.3, 0.0));
    let view = View::look_at(eye, target, 0.15, 0.05);
    let options = ReferenceOptions { diffuse_bounces: 0, ..options(Integrator::Full) };
    let size = [24, 24];
    let image = trace(&stage.scene, (&view, size), options, &[64, 64]);
    let from_clip = view.relative_from_clip(size, Vec2::ZERO);
    let expected = |x: u32, y: u32| {
        let ndc = (Vec2::new(x as f32, y as f32) + 0.5) / 24.0 * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
        let towards = from_clip.project_point3(ndc.extend(0.5));
        // The image of the floor behind the mirror.
        let at = eye - towards * (eye.y / towards.y);
        reflectance(eye, at) * before_a_mirror_nits(mirrored(at))
    };
    let all = || (0..24 * 24).map(|i| (i % 24, i / 24));
    let found: f32 = all().map(|(x, y)| image.pixel(x, y)[1]).sum();
    let expected: f32 = all().map(|(x, y)| expected(x, y)).sum();
    assert!((found / expected - 1.0).abs() < 0.03, "{found} is not {expected}");
}

/// A ball whose poles lie above and below.
pub(crate) fn ball(radius: f32, material: usize) -> Mesh {
    const RINGS: u32 = 96;
    let angle = |i: u32, of: u32| i as f32 / of as f32;
    let normals: Vec<_> = (0..=RINGS)
        .flat_map(|ring| (0..RINGS).map(move |turn| (angle(ring, RINGS) * PI, angle(turn, RINGS) * 2.0 * PI)))
        .map(|(polar, turn)| Vec3::new(polar.sin() * turn.cos(), polar.cos(), polar.sin() * turn.sin()))
        .collect();
    let corner = |ring: u32, turn: u32| ring * RINGS + turn % RINGS;
    let quads = (0..RINGS).flat_map(|ring| (0..RINGS).map(move |turn| (ring, turn)));
    let indices = quads.flat_map(|(ring, turn)| {
        let [a, b] = [corner(ring, turn), corner(ring, turn + 1)];
        let [c, d] = [corner(ring + 1, turn), corner(ring + 1, turn + 1)];
        [a, b, d, a, d, c]
    });
    let indices = indices.collect();
    let positions = normals.iter().map(|normal| *normal * radius).collect();
    let primitive = Primitive { positions, normals, indices, material, ..Primitive::default() };
    Mesh { primitives: vec![primitive], ..Mesh::default() }
}

/// A glass ball over the floor under the sun, and what its focus shows: within `SPOT` of the axis so many nits.
pub(crate) struct Focus {
    pub stage: Stage,
    pub view: View,
    pub nits: f32,
}

const SPOT: f32 = 0.04;
pub(crate) const FOCUS_SIZE: [u32; 2] = [96, 32];

impl Focus {
    pub fn new() -> Self {
        let (ior, radius, height, lux) = (1.5f32, 0.5f32, 0.6f32, 1000.0f32);
        let mut stage = Stage::floor(ALBEDO);
        let material = stage.material(glass(ior));
        stage.place(ball(radius, material), Affine3A::from_translation(Vec3::Y * height));
        stage.sun(lux, Vec3::NEG_Y);
        // Rays by their distance from the axis, in a plane through it.
        let steps = 20_000;
        let lands = |h: f32| {
            let (i, r) = ((h / radius).asin(), (h / radius / ior).asin());
            let exit = i + PI - 2.0 * r;
            let (x, y) = (radius * exit.sin(), radius * exit.cos() + height);
            (x - (2.0 * (i - r)).tan() * y, (1.0 - fresnel(i.cos(), ior)).powi(2))
        };
        let rays = (0..steps).map(|k| (k as f32 + 0.5) / steps as f32 * radius);
        let power: f32 = rays
            .map(|h| (h, lands(h)))
            .filter(|(_, (x, _))| x.abs() < SPOT)
            .map(|(h, (_, passes))| 2.0 * PI * h * passes * radius / steps as f32)
            .sum();
        let gain = power / (PI * SPOT * SPOT);
        assert!(gain > 15.0, "{gain}");
        // From aside, below the ball.
        let eye = Vec3::new(0.0, 0.35, 1.0).normalize() * 4.0;
        let view = View::look_at(eye, Vec3::ZERO, 0.0083, 0.1);
        Self { stage, view, nits: lux * gain * ALBEDO / PI }
    }

    /// The mean of the focus in a picture of [`FOCUS_SIZE`], over what is expected.
    pub fn found(&self, image: &Image) -> f32 {
        let from_clip = self.view.relative_from_clip(FOCUS_SIZE, Vec2::ZERO);
        let eye = self.view.eye_ws();
        let inside = |x: u32, y: u32| {
            let ndc = (Vec2::new(x as f32, y as f32) + 0.5) / Vec2::new(96.0, 32.0) * Vec2::new(2.0, -2.0);
            let towards = from_clip.project_point3((ndc + Vec2::new(-1.0, 1.0)).extend(0.5));
            (eye - towards * (eye.y / towards.y)).length() < SPOT
        };
        mean(image, inside) / self.nits
    }
}

#[test]
fn a_glass_ball_focuses_sunlight_as_snell_says() {
    let focus = Focus::new();
    let options = ReferenceOptions { diffuse_bounces: 0, ..options(Integrator::Full) };
    let image = trace(&focus.stage.scene, (&focus.view, FOCUS_SIZE), options, &[32]);
    let found = focus.found(&image);
    // A few thousandths more went back and forth inside the ball.
    assert!((found - 1.0).abs() < 0.02, "{found} times what is expected");
}

#[test]
fn light_paths_alone_show_what_paths_from_the_camera_show_where_nothing_mirrors() {
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.materials.iter_mut().for_each(|m| (m.roughness, m.transmission) = (m.roughness.max(0.3), 0.0));
    scene.add_default_view_to_trace();
    let view = View::from_scene(&scene, 0).unwrap();
    let at = (&view, [48, 32]);
    let path = trace(&scene, at, options(Integrator::Path), &[256]);
    let photon = trace(&scene, at, options(Integrator::Photon), &[128]);
    let (of_path, of_photon) = (mean(&path, |_, _| true), mean(&photon, |_, _| true));
    assert!((of_photon / of_path - 1.0).abs() < 0.01, "{of_photon} is not {of_path}");
    assert!(nmae(&photon, &path) < 0.05, "{}", nmae(&photon, &path));
    // And together they are the former, bit for bit: there is nothing for light paths to do.
    let [path, full] = [Integrator::Path, Integrator::Full].map(|i| trace(&scene, at, options(i), &[4]));
    assert_eq!(path.pixels(), full.pixels());
}

#[test]
fn all_lamps_reach_the_floor_by_light_paths_as_by_paths_from_the_camera() {
    let mut stage = Stage::new();
    let floor = stage.lambert(ALBEDO);
    stage.quad(Vec3::ZERO, Vec3::X * 1.1, Vec3::NEG_Z * 1.1, floor);
    stage.scene.environment = Some(environment(|x, y| if y < 32 && x < 40 { 30.0 } else { 2.0 }));
    stage.sun(20.0, Vec3::new(0.4, -1.0, 0.2));
    let spot = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 };
    stage.light(spot, 60.0, Some(5.0), Vec3::new(0.5, 1.5, 0.0), Vec3::NEG_Y);
    stage.light(LightKind::Point, 8.0, Some(2.0), Vec3::new(-0.5, 1.0, 0.5), Vec3::NEG_Y);
    let shining =
        Material { emissive: Vec3::ONE * 50.0, base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::new(-0.6, 0.8, -0.5), Vec3::X * 0.2, Vec3::Z * 0.3, shining);
    let view = (&camera_above(HALF), [SIDE; 2]);
    let path = trace(&stage.scene, view, options(Integrator::Path), &[256]);
    let photon = trace(&stage.scene, view, options(Integrator::Photon), &[256]);
    for (x, y) in [(0, 0), (16, 0), (0, 16), (16, 16)] {
        let block = |px: u32, py: u32| (x..x + 16).contains(&px) && (y..y + 16).contains(&py);
        let (found, expected) = (mean(&photon, block), mean(&path, block));
        // Four standard deviations.
        assert!((found / expected - 1.0).abs() < 0.02, "{x} {y}: {found} is not {expected}");
    }
}

#[test]
fn light_paths_keep_to_depth_and_bounces_as_paths_from_the_camera_do() {
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.materials.iter_mut().for_each(|m| (m.roughness, m.transmission) = (m.roughness.max(0.3), 0.0));
    scene.add_default_view_to_trace();
    let view = View::from_scene(&scene, 0).unwrap();
    for (max_depth, diffuse_bounces) in [(2, u32::MAX), (3, u32::MAX), (0, 0), (0, 1)] {
        let mut found = [Integrator::Path, Integrator::Photon].map(|integrator| {
            let options = ReferenceOptions { max_depth, diffuse_bounces, ..options(integrator) };
            mean(&trace(&scene, (&view, [48, 32]), options, &[32]), |_, _| true)
        });
        found[1] /= found[0];
        assert!((found[1] - 1.0).abs() < 0.02, "{max_depth} {diffuse_bounces}: {}", found[1]);
    }
}

#[test]
fn rounds_are_the_same_however_they_are_grouped_and_begun() {
    let stage = before_a_mirror();
    let view = (&camera_above(HALF), [SIDE; 2]);
    let gpu = device_guaranteed();
    let mut truth = Truth::new(&gpu, direct(&[]), &stage.scene, view, options(Integrator::Full));
    let once = truth.add(&[8]);
    truth.look(view.0);
    assert_eq!(once.pixels(), truth.add(&[4, 4]).pixels());
}

#[test]
fn under_water_the_sky_fills_a_cone_and_the_floor_is_mirrored_around_it() {
    let (ior, floor, sky) = (1.33f32, 3.0, 1.0);
    let mut stage = Stage::new();
    stage.scene.environment = Some(environment(|_, _| sky));
    let water = stage.material(glass(ior));
    stage.quad(Vec3::ZERO, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, water);
    let shining =
        Material { emissive: Vec3::splat(floor), base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::NEG_Y * 2.0, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, shining);
    // The critical angle is 48.8 degrees.
    let angles = [0.0f32, 0.5, 0.8, 0.9, 1.2];
    let eye = Vec3::NEG_Y;
    let views =
        angles.map(|angle| View::look_at(eye, eye + Vec3::new(angle.sin(), angle.cos(), 0.0), 0.002, 0.05));
    let images = trace_views(&stage.scene, (&views, [8, 8]), options(Integrator::Path), &[256]);
    for (angle, image) in angles.into_iter().zip(images) {
        let found = mean(&image, |_, _| true);
        let sine = ior * angle.sin();
        let reflected = if sine >= 1.0 { 1.0 } else { fresnel((1.0 - sine * sine).sqrt(), ior) };
        let expected = (1.0 - reflected) * sky * ior * ior + reflected * floor;
        assert!((found / expected - 1.0).abs() < 0.01, "{angle}: {found} is not {expected}");
    }
}

#[test]
fn what_lies_in_a_medium_is_dimmed_by_it() {
    let (ior, depth, colour, distance) = (1.33f32, 0.7f32, 0.2f32, 1.1f32);
    let mut stage = Stage::new();
    let attenuation_color = Vec3::splat(colour);
    let water = Material { attenuation_color, attenuation_distance: distance, ..glass(ior) };
    let water = stage.material(water);
    stage.quad(Vec3::ZERO, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, water);
    let shining =
        Material { emissive: Vec3::ONE * 5.0, base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::NEG_Y * depth, Vec3::X * 500.0, Vec3::NEG_Z * 500.0, shining);
    let angles = [0.0f32, 0.9];
    let views = angles
        .map(|angle| View::look_at(Vec3::new(angle.sin(), angle.cos(), 0.0) * 3.0, Vec3::ZERO, 0.002, 0.1));
    let images = trace_views(&stage.scene, (&views, [8, 8]), options(Integrator::Path), &[256]);
    for (angle, image) in angles.into_iter().zip(images) {
        let found = mean(&image, |_, _| true);
        let inside = (1.0 - (angle.sin() / ior).powi(2)).sqrt();
        let passes = colour.powf(depth / inside / distance);
        // The floor reflects nothing back.
        let expected = 5.0 * (1.0 - fresnel(angle.cos(), ior)) * passes / (ior * ior);
        assert!((found / expected - 1.0).abs() < 0.01, "{angle}: {found} is not {expected}");
    }
}

#[test]
fn dispersion_gives_each_band_its_own_index_of_refraction() {
    // Seen head-on through a slab, bands differ by Fresnel's term alone.
    let mut stage = Stage::new();
    let crystal = stage.material(Material { dispersion: 20.0, ..glass(1.5) });
    stage.cuboid(Vec3::ZERO, Vec3::new(50.0, 0.25, 50.0), crystal);
    let shining =
        Material { emissive: Vec3::ONE * 7.0, base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::NEG_Y, Vec3::X * 60.0, Vec3::NEG_Z * 60.0, shining);
    let view = View::look_at(Vec3::Y * 5.0, Vec3::ZERO, 0.002, 0.1);
    let image = trace(&stage.scene, (&view, [16, 16]), options(Integrator::Path), &[256]);
    // KHR_materials_dispersion: (ior − 1) · 0.025 · dispersion between bands.
    for (band, ior) in [1.25f32, 1.5, 1.75].into_iter().enumerate() {
        let r = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let expected = 7.0 * (1.0 - r) / (1.0 + r);
        let found = image.pixels().iter().map(|pixel| pixel[band]).sum::<f32>() / 256.0;
        assert!((found / expected - 1.0).abs() < 0.01, "{band}: {found} is not {expected}");
    }
}

#[test]
fn a_blended_sheet_lets_its_share_of_light_and_sight_through() {
    let (alpha, lux) = (0.3f32, 1000.0f32);
    // No larger than the picture, so that most light paths are in it.
    let mut stage = Stage::new();
    let floor = stage.lambert(ALBEDO);
    stage.quad(Vec3::ZERO, Vec3::X * 1.1, Vec3::NEG_Z * 1.1, floor);
    let base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
    let sheet = Material {
        base_color,
        specular: 0.0,
        alpha: AlphaMode::Blend,
        double_sided: true,
        ..Material::default()
    };
    let sheet = stage.material(sheet);
    stage.quad(Vec3::new(0.0, 1.0, 0.0), Vec3::X * 1.1, Vec3::NEG_Z * 1.1, sheet);
    stage.sun(lux, Vec3::NEG_Y);
    let view = (&camera_above(HALF), [SIDE; 2]);
    for integrator in [Integrator::Path, Integrator::Photon] {
        let found = mean(&trace(&stage.scene, view, options(integrator), &[128]), |_, _| true);
        let expected = lux * ALBEDO / PI * (1.0 - alpha).powi(2);
        assert!((found / expected - 1.0).abs() < 0.01, "{integrator:?}: {found} is not {expected}");
    }
}

#[test]
fn blended_panes_placed_several_times_are_each_met_by_chance_of_their_own() {
    // Four of one mesh before what glows: on the left of two triangles, on the right of so many that they share a tree.
    let (alpha, nits) = (0.3f32, 5.0);
    let mut stage = Stage::new();
    let base_color = Vec4::new(0.0, 0.0, 0.0, alpha);
    let pane = Material { base_color, specular: 0.0, alpha: AlphaMode::Blend, ..Material::default() };
    let pane = stage.material(pane);
    for (x, rows) in [(-0.5, 1u32), (0.5, 24)] {
        let mut cells = Stage::new();
        let half = 0.5 / rows as f32;
        for i in 0..rows * rows {
            let at = |i: u32| (2 * i + 1) as f32 * half - 0.5;
            let center = Vec3::new(x + at(i % rows), 0.0, at(i / rows));
            cells.quad(center, Vec3::X * half, Vec3::NEG_Z * half, pane);
        }
        let primitives = cells.scene.meshes.into_iter().flat_map(|mesh| mesh.primitives).collect();
        stage.place(Mesh { primitives, ..Mesh::default() }, Affine3A::IDENTITY);
        let node = stage.scene.nodes.len() - 1;
        for height in 1..4 {
            let up = Affine3A::from_translation(Vec3::Y * 0.3 * height as f32);
            let again = Node { parent_from_node: Transform::Matrix(up), ..stage.scene.nodes[node].clone() };
            stage.scene.nodes.push(again);
        }
    }
    let glowing = Material { emissive: Vec3::splat(nits), base_color: Vec4::W, ..Material::default() };
    let glowing = stage.material(glowing);
    stage.quad(Vec3::NEG_Y, Vec3::X, Vec3::NEG_Z, glowing);
    let options = ReferenceOptions { max_depth: 1, ..options(Integrator::Path) };
    let image = trace(&stage.scene, (&camera_above(HALF), [SIDE; 2]), options, &[128]);
    for left in [true, false] {
        // The panes are half as high as the picture.
        let found = mean(&image, |x, y| (x < SIDE / 2) == left && (8..24).contains(&y));
        let expected = nits * (1.0 - alpha).powi(4);
        assert!((found / expected - 1.0).abs() < 0.03, "left {left}: {found} is not {expected}");
    }
}

#[test]
fn lamps_shine_as_much_as_alpha_leaves_of_them() {
    const WIDE: u32 = 8;
    // Five floors with walls between, each under a lamp: whole though its alpha is 0, half cut out by a texture, cut out by
    // its factor, half there by its vertices' colour, and half by its factor.
    let mut stage = Stage::new();
    let rgba = (0..16).flat_map(|i| [255, 255, 255, if i % 4 < 2 { 255 } else { 0 }]).collect();
    let texture = stage.texture(4, [Wrap::Clamp; 2], Filter::Nearest, rgba);
    let [white, wall] = [ALBEDO, 0.0].map(|albedo| stage.lambert(albedo));
    let lamp = |alpha: AlphaMode, a: f32| Material {
        emissive: Vec3::splat(100.0),
        base_color: Vec4::new(0.0, 0.0, 0.0, a),
        specular: 0.0,
        alpha,
        ..Material::default()
    };
    let mask = AlphaMode::Mask { cutoff: 0.5 };
    let lamps = [
        (lamp(AlphaMode::Opaque, 0.0), 1.0, 1.0),
        (Material { base_color_texture: Some(texture), ..lamp(mask, 1.0) }, 1.0, 0.5),
        (lamp(mask, 0.4), 1.0, 0.0),
        (lamp(AlphaMode::Blend, 1.0), 0.5, 0.5),
        (lamp(AlphaMode::Blend, 0.5), 1.0, 0.5),
    ];
    for (index, (material, alpha, _)) in lamps.iter().enumerate() {
        let x = index as f32 - 2.0;
        let material = stage.material(material.clone());
        stage.quad(Vec3::new(x, 0.0, 0.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, white);
        stage.quad(Vec3::new(x, 0.4, 0.0), Vec3::X * 0.2, Vec3::Z * 0.2, material);
        let Some(mesh) = stage.scene.meshes.last_mut() else { unreachable!() };
        mesh.primitives[0].colors = vec![Vec4::new(1.0, 1.0, 1.0, *alpha); 4];
        for side in [-0.499, 0.499] {
            stage.quad(Vec3::new(x + side, 0.5, 0.0), Vec3::Z * 0.5, Vec3::Y * 0.5, wall);
        }
    }
    let view = (&camera_above(0.5), [5 * WIDE, WIDE]);
    for (integrator, samples) in [(Integrator::Path, 128), (Integrator::Photon, 64)] {
        let options = ReferenceOptions { max_depth: 2, ..options(integrator) };
        let image = trace(&stage.scene, view, options, &[samples]);
        let under = |lamp: u32| mean(&image, |x, _| x / WIDE == lamp);
        let whole = under(0);
        assert!(whole > 1.0, "{whole}");
        for (index, (_, _, share)) in lamps.iter().enumerate() {
            let found = under(index as u32) / whole;
            assert!((found - share).abs() < 0.04, "{integrator:?}, lamp {index}: {found} is not {share}");
        }
    }
}

#[test]
fn a_mirror_shows_what_lies_behind_backs_of_single_sided_surfaces() {
    // A mirror on the floor shows what glows above the camera, through the back of a card but not through its front.
    let mut stage = Stage::new();
    let mirror = Material { metallic: 1.0, roughness: 0.0, ..Material::default() };
    let mirror = stage.material(mirror);
    stage.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, mirror);
    let black = Material { base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let glowing = Material { emissive: Vec3::splat(3.0), ..black.clone() };
    let [black, glowing] = [black, glowing].map(|material| stage.material(material));
    // Fronts are those towards u × v: a card that looks up on the left, and down on the right.
    stage.quad(Vec3::new(-0.5, 11.0, 0.0), Vec3::X * 0.5, Vec3::NEG_Z, black);
    stage.quad(Vec3::new(0.5, 11.0, 0.0), Vec3::X * 0.5, Vec3::Z, black);
    stage.quad(Vec3::Y * 12.0, Vec3::X * 2.0, Vec3::Z * 2.0, glowing);
    let image = trace(&stage.scene, (&camera_above(HALF), [8; 2]), options(Integrator::Path), &[4]);
    let [left, right] = [true, false].map(|left| mean(&image, |x, _| (x < 4) == left));
    assert!((left - 3.0).abs() < 0.01 && right == 0.0, "{left} and {right}");
}

#[test]
fn a_rough_pane_passes_as_much_sunlight_by_chosen_lights_as_by_light_paths() {
    // Frosted glass over a floor: lights are found through its facets from the floor's paths, and from the other side.
    let mut stage = Stage::new();
    let floor = stage.lambert(ALBEDO);
    stage.quad(Vec3::ZERO, Vec3::X * 1.6, Vec3::NEG_Z * 1.6, floor);
    let pane = stage.material(Material { roughness: 0.4, thickness: 0.0, ..glass(1.5) });
    stage.quad(Vec3::new(0.0, 0.5, 0.0), Vec3::X * 1.6, Vec3::NEG_Z * 1.6, pane);
    stage.sun(1000.0, Vec3::new(0.3, -1.0, 0.1));
    let view = View::look_at(Vec3::new(0.0, 0.25, 1.5), Vec3::ZERO, 0.3, 0.05);
    let at = (&view, [24, 16]);
    let [path, photon] = [(Integrator::Path, 512), (Integrator::Photon, 256)].map(|(integrator, samples)| {
        let options = ReferenceOptions { diffuse_bounces: 1, ..options(integrator) };
        mean(&trace(&stage.scene, at, options, &[samples]), |_, y| y > 8)
    });
    assert!((photon / path - 1.0).abs() < 0.04, "{photon} is not {path}");
}

#[test]
fn a_scene_without_light_is_black_by_light_paths() {
    let mut stage = Stage::floor(ALBEDO);
    let material = stage.material(glass(1.5));
    stage.quad(Vec3::Y, Vec3::X, Vec3::NEG_Z, material);
    for integrator in [Integrator::Photon, Integrator::Full] {
        let view = (&camera_above(HALF), [SIDE; 2]);
        let image = trace(&stage.scene, view, options(integrator), &[4]);
        assert!(image.pixels().iter().flatten().all(|value| *value == 0.0));
    }
}
