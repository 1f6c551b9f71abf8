//! Environment maps as background and as light, against what is known without rendering.

use chiaro::scene::{Environment, Material};
use chiaro::{Pipeline, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, ambient, device};
use glam::{Vec3, Vec4};

const SIZE: [u32; 2] = [64, 64];

fn map(width: u32, height: u32, nits: impl Fn(u32, u32) -> Vec3) -> Environment {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    Environment { name: "test".into(), width, height, radiance: texels.map(|(x, y)| nits(x, y)).collect() }
}

fn uniform(nits: f32) -> Environment {
    map(64, 32, |_, _| Vec3::splat(nits))
}

fn pipelines() -> impl Iterator<Item = Settings> {
    [(Pipeline::Deferred, "1"), (Pipeline::Forward, "1"), (Pipeline::Forward, "4")].into_iter().map(
        |(pipeline, msaa)| {
            let mut settings = Settings { pipeline, ..ambient() };
            settings.set("surface.msaa", msaa).unwrap();
            settings
        },
    )
}

fn with(mut settings: Settings, changes: &[(&str, &str)]) -> Settings {
    for (key, value) in changes {
        settings.set(key, value).unwrap();
    }
    settings
}

fn studio(settings: Settings) -> Studio {
    Studio::new(&device(), settings)
}

fn picture(studio: &mut Studio, stage: &Stage, view: &View) -> Image {
    let scene = studio.load(&stage.scene);
    studio.radiance(&scene, view, SIZE, 1)
}

#[track_caller]
fn assert_is(found: [f32; 3], expected: Vec3, tolerance: f32, what: &str) {
    let off = ((Vec3::from(found) - expected) / expected).abs().max_element();
    assert!(off < tolerance, "{what}: {found:?} instead of {expected}");
}

/// A slab before a camera that looks down at an angle, so that the upper half of the picture is background.
fn slab(material: Material, environment: Environment) -> (Stage, View) {
    let mut stage = Stage::new();
    let material = stage.material(material);
    stage.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, material);
    stage.scene.environment = Some(environment);
    (stage, View::look_at(Vec3::new(0.0, 1.0, 3.0), Vec3::ZERO, 1.0, 0.1))
}

#[test]
fn in_a_white_furnace_white_lambert_vanishes_and_smooth_metal_shows_its_albedo() {
    let gold = Vec3::new(1.0, 0.766, 0.336);
    let white = Material { specular: 0.0, ..Material::default() };
    let metal =
        Material { base_color: gold.extend(1.0), metallic: 1.0, roughness: 0.0, ..Material::default() };
    for mut studio in pipelines().map(studio) {
        for (material, albedo) in [(white.clone(), Vec3::ONE), (metal.clone(), gold)] {
            let (stage, view) = slab(material, uniform(1.0));
            let image = picture(&mut studio, &stage, &view);
            // 10 bits of √ colour, the table of directional albedo, and for the metal Schlick's rise at this angle.
            // The pixel's middle is half a pixel below the camera's axis.
            let down = (1.0f32 / 3.0).atan() + (0.5 / 32.0 * 0.5f32.tan()).atan();
            let rise = (1.0 - down.sin()).powi(5);
            let expected = if albedo == gold { gold + (1.0 - gold) * rise } else { albedo };
            assert_is(image.pixel(32, 32), expected, 0.01, "surface");
            assert_is(image.pixel(32, 1), Vec3::ONE, 0.001, "background");
        }
    }
}

#[test]
fn rough_metal_and_dielectric_lose_nothing_in_a_white_furnace() {
    let mut studio = studio(ambient());
    for (metallic, roughness) in [(1.0, 0.3), (1.0, 1.0), (0.0, 0.2), (0.0, 1.0)] {
        let (stage, view) = slab(Material { metallic, roughness, ..Material::default() }, uniform(1.0));
        let image = picture(&mut studio, &stage, &view);
        assert_is(
            image.pixel(32, 32),
            Vec3::ONE,
            0.03,
            &format!("metallic {metallic} roughness {roughness}"),
        );
    }
}

/// A map of one bright texel, and the direction of its middle by the documented convention.
fn one_bright_texel(x: u32, y: u32, nits: f32) -> (Environment, Vec3) {
    let around = (x as f32 + 0.5) / 64.0 * std::f32::consts::TAU;
    let down = (y as f32 + 0.5) / 32.0 * std::f32::consts::PI;
    let direction = Vec3::new(down.sin() * around.sin(), down.cos(), -down.sin() * around.cos());
    (
        map(64, 32, |column, row| if (column, row) == (x, y) { Vec3::splat(nits) } else { Vec3::ZERO }),
        direction,
    )
}

/// The middle of what is bright in a picture, pixels from its own middle to the right and up; none if black.
fn middle(image: &Image) -> Option<(f32, f32)> {
    let mut sum = Vec3::ZERO;
    for y in 0..SIZE[1] {
        for x in 0..SIZE[0] {
            let nits = image.pixel(x, y)[0];
            sum += nits * Vec3::new(x as f32 + 0.5 - 32.0, 32.0 - (y as f32 + 0.5), 1.0);
        }
    }
    (sum.z > 0.0).then(|| (sum.x / sum.z, sum.y / sum.z))
}

#[test]
fn a_bright_texel_is_seen_where_its_direction_says() {
    let texels = [&[(32, 16), (0, 16), (50, 22)][..], &[(16, 10)], &[(63, 5)]];
    for (mut studio, texels) in pipelines().map(studio).zip(texels) {
        for &(x, y) in texels {
            let (environment, direction) = one_bright_texel(x, y, 100.0);
            let mut stage = Stage::new();
            stage.scene.environment = Some(environment);
            let view = View::look_at(Vec3::ZERO, direction, 0.8, 0.1);
            let found = middle(&picture(&mut studio, &stage, &view)).expect("nothing is seen");
            // Half a degree.
            assert!(found.0.abs() < 0.7 && found.1.abs() < 0.7, "texel {x} {y}: {found:?}");
        }
    }
    // The middle column is ahead along +Z, and a larger u lies to the right.
    let (environment, _) = one_bright_texel(34, 15, 100.0);
    let mut stage = Stage::new();
    stage.scene.environment = Some(environment);
    let view = View::look_at(Vec3::ZERO, Vec3::Z, 1.0, 0.1);
    let (right, up) = middle(&picture(&mut studio(ambient()), &stage, &view)).unwrap();
    assert!(right > 3.0 && up > 0.5, "{right} {up}");
}

#[test]
fn turning_the_surroundings_counter_clockwise_moves_them_left() {
    let (environment, direction) = one_bright_texel(32, 16, 100.0);
    let mut stage = Stage::new();
    stage.scene.environment = Some(environment);
    let view = View::look_at(Vec3::ZERO, direction, 1.0, 0.1);
    let mut studio = studio(with(ambient(), &[("environment.rotation", "10")]));
    let (right, _) = middle(&picture(&mut studio, &stage, &view)).unwrap();
    // 10° of a picture 1 rad high.
    let expected = -32.0 * 10f32.to_radians().tan() / 0.5f32.tan();
    assert!((right - expected).abs() < 1.0, "{right} instead of {expected}");
}

#[test]
fn a_mirror_shows_the_background_that_it_faces() {
    // A mirror on the floor shows the texel above at the height that it has.
    let (environment, direction) = one_bright_texel(32, 12, 100.0);
    let mirror = Material { metallic: 1.0, roughness: 0.0, double_sided: true, ..Material::default() };
    let (mut stage, _) = slab(mirror, environment);
    stage.scene.nodes[0].parent_from_node =
        chiaro::scene::Transform::Matrix(glam::Affine3A::from_scale(Vec3::splat(50.0)));
    let mirrored = direction * Vec3::new(1.0, -1.0, 1.0);
    let view = View::look_at(Vec3::Y, Vec3::Y + mirrored, 0.6, 0.1);
    for mut studio in pipelines().map(studio) {
        let found = middle(&picture(&mut studio, &stage, &view)).expect("nothing is seen");
        assert!(found.0.abs() < 1.5 && found.1.abs() < 1.5, "{found:?}");
    }
}

#[test]
fn a_million_nits_stay_finite_and_a_thousandth_beside_them_stays_visible() {
    let mut stage = Stage::new();
    stage.scene.environment =
        Some(map(256, 128, |x, y| Vec3::splat(if (x, y) == (128, 60) { 1e6 } else { 1e-3 })));
    for (number, (metallic, roughness)) in [(1.0, 0.0), (1.0, 0.5), (0.0, 1.0)].into_iter().enumerate() {
        let material = stage.material(Material { metallic, roughness, ..Material::default() });
        stage.quad(Vec3::X * (number as f32 - 1.0), Vec3::X * 0.5, Vec3::NEG_Z, material);
    }
    for mut studio in pipelines().map(studio) {
        let scene = studio.load(&stage.scene);
        for (eye, target) in [(Vec3::new(0.0, 1.0, -3.0), Vec3::ZERO), (Vec3::Y, Vec3::new(0.0, 1.05, 1.0))] {
            let view = View::look_at(eye, target, 1.0, 0.1);
            let image = studio.radiance(&scene, &view, SIZE, 1);
            let strange = image.pixels().iter().flatten().filter(|v| !v.is_finite() || **v < 0.0).count();
            assert_eq!(strange, 0);
            assert!(image.pixels().iter().all(|pixel| pixel[0] > 5e-4), "black pixels");
        }
    }
}

#[test]
fn without_indirect_light_an_environment_is_seen_straight_and_in_metals_and_lights_nothing() {
    let matte = Material { specular: 0.0, ..Material::default() };
    let metal = |roughness| Material { metallic: 1.0, roughness, ..Material::default() };
    for settings in pipelines() {
        let mut studio = studio(with(settings, &[("indirect.technique", "none")]));
        for (material, nits) in [(matte.clone(), 0.0), (metal(0.0), 2.0), (metal(0.5), 2.0)] {
            let (stage, view) = slab(material, uniform(2.0));
            let image = picture(&mut studio, &stage, &view);
            let found = image.pixel(32, 32);
            assert!(found.iter().all(|v| (v - nits).abs() <= 0.02 * nits), "{found:?} is not {nits}");
            assert_is(image.pixel(32, 1), Vec3::splat(2.0), 0.001, "background");
        }
    }
}

#[test]
fn intensity_scales_background_and_light_alike() {
    let white = Material { specular: 0.0, base_color: Vec4::ONE, ..Material::default() };
    let (stage, view) = slab(white, uniform(2.0));
    let mut studio = studio(with(ambient(), &[("environment.intensity", "3")]));
    let image = picture(&mut studio, &stage, &view);
    assert_is(image.pixel(32, 32), Vec3::splat(6.0), 0.01, "surface");
    assert_is(image.pixel(32, 1), Vec3::splat(6.0), 0.001, "background");
}
