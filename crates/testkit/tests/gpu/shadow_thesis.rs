//! The shadow thesis' shading: what its shadows darken, and by how much.

use chiaro::{Aov, LoadedScene, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, device};
use glam::Vec3;

const SIZE: [u32; 2] = [96, 72];

/// A box above a floor with a shining skin, under one sun.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let skin = stage.material(chiaro::scene::Material {
        base_color: glam::Vec4::new(0.6, 0.4, 0.2, 1.0),
        roughness: 0.15,
        ..chiaro::scene::Material::default()
    });
    stage.cuboid(Vec3::new(0.0, -0.5, 0.0), Vec3::new(4.0, 0.5, 4.0), skin);
    stage.cuboid(Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.8, 0.4, 0.8), skin);
    stage.sun(50_000.0, Vec3::new(0.5, -1.0, -0.3));
    stage
}

fn view() -> View {
    View::look_at(Vec3::new(1.0, 5.0, 5.0), Vec3::new(0.3, 0.0, -0.3), 0.9, 0.05)
}

fn thesis(changes: &[(&str, &str)]) -> Settings {
    let mut settings = Settings::default();
    settings.apply_preset("thesis-shadows", None).unwrap();
    // Texels of a decimetre: wide penumbrae.
    settings.set("shadow.resolution", "128").unwrap();
    changes.iter().for_each(|(key, value)| settings.set(key, value).unwrap());
    settings
}

struct Lit {
    /// The picture.
    color: Image,
    /// Without shadows.
    bright: Image,
    /// Ambient light alone.
    ambient: Image,
    /// Visibility of the sun, without a floor.
    visible: Image,
}

fn lit(studio: &mut Studio, scene: &LoadedScene, changes: &[(&str, &str)]) -> Lit {
    let with = |more: &[(&str, &str)]| thesis(&[changes, more].concat());
    let mut take = |settings: Settings, aov: Option<Aov>| {
        studio.set(settings);
        match aov {
            Some(aov) => studio.aov(scene, &view(), SIZE, 1, aov),
            None => studio.radiance(scene, &view(), SIZE, 1),
        }
    };
    let color = take(with(&[]), None);
    let plain = with(&[("shadow.darkens", "direct"), ("shadow.floor", "0")]);
    let visible = take(plain.clone(), Some(Aov::Shadow));
    let ambient = take(plain, Some(Aov::Indirect));
    let bright = take(with(&[("shadow.layout", "none")]), None);
    Lit { color, bright, ambient, visible }
}

/// Relative error of the picture against `expected(bright, ambient, visibility)` where the sun shines on what is seen.
fn worst(lit: &Lit, expected: impl Fn(f32, f32, f32) -> f32) -> f32 {
    let mut worst = 0.0f32;
    let mut partly = 0;
    let pixels = lit.color.pixels().iter().zip(lit.bright.pixels()).zip(lit.ambient.pixels());
    for (((color, bright), ambient), visible) in pixels.zip(lit.visible.pixels()) {
        if bright[0] <= 1.01 * ambient[0] {
            continue;
        }
        partly += usize::from((0.05..0.95).contains(&visible[0]));
        for i in 0..3 {
            worst = worst.max((color[i] / expected(bright[i], ambient[i], visible[0]) - 1.0).abs());
        }
    }
    assert!(partly > 20, "only {partly} pixels in penumbra");
    worst
}

#[test]
fn variance_is_rescaled_exponential_clamped_on_the_whole_colour_and_depth_takes_direct_light_alone() {
    let stage = stage();
    let gpu = device();
    let mut studio = Studio::new(&gpu, thesis(&[]));
    let scene = studio.load(&stage.scene);
    // Stored as half floats.
    let rounding = 4e-3;
    let variance = lit(&mut studio, &scene, &[]);
    let off = worst(&variance, |bright, _, v| bright * (0.3 + 0.7 * v));
    assert!(off < rounding, "variance: {off}");
    let dark = |lit: &Lit| {
        let ratios = lit.color.pixels().iter().zip(lit.bright.pixels()).map(|(a, b)| a[1] / b[1]);
        ratios.filter(|ratio| ratio.is_finite()).fold(1.0f32, f32::min)
    };
    assert!((dark(&variance) - 0.3).abs() < rounding, "{}", dark(&variance));

    let exponential = lit(
        &mut studio,
        &scene,
        &[("shadow.representation", "exponential"), ("shadow.bleed_reduction", "0")],
    );
    let off = worst(&exponential, |bright, _, v| bright * v.max(0.3));
    assert!(off < rounding, "exponential: {off}");

    let depth = lit(&mut studio, &scene, &[("shadow.representation", "depth"), ("shadow.filter", "pcf")]);
    let off = worst(&depth, |bright, ambient, v| ambient + (bright - ambient) * v);
    assert!(off < rounding, "depth: {off}");
}

#[test]
fn what_is_seen_has_no_highlights() {
    let stage = stage();
    let gpu = device();
    let mut studio = Studio::new(&gpu, thesis(&[("shadow.layout", "none")]));
    let scene = studio.load(&stage.scene);
    // The floor as the mirrored sun would shine on it, and from aside: Lambert looks the same from everywhere.
    let along = Vec3::new(0.5, 1.0, -0.3) * 4.0;
    let [a, b] = [along, Vec3::new(-3.0, 3.0, 2.0)].map(|eye| {
        let target = Vec3::new(2.0, 0.0, -2.0);
        let view = View::look_at(target + eye, target, 0.01, 0.05);
        studio.radiance(&scene, &view, [1, 1], 1).pixels()[0]
    });
    for i in 0..3 {
        assert!((a[i] / b[i] - 1.0).abs() < 4e-3, "{a:?} {b:?}");
    }
}

#[test]
fn a_least_variance_lights_what_lies_close_behind_its_caster_and_no_more() {
    // Slabs 0.2 m and 3 m above a floor.
    let mut stage = Stage::new();
    let skin = stage.lambert(0.8);
    stage.cuboid(Vec3::new(0.0, -0.5, 0.0), Vec3::new(5.0, 0.5, 5.0), skin);
    stage.cuboid(Vec3::new(-2.0, 0.25, 0.0), Vec3::new(1.0, 0.05, 1.0), skin);
    stage.cuboid(Vec3::new(2.0, 3.05, 0.0), Vec3::new(1.0, 0.05, 1.0), skin);
    stage.sun(1000.0, Vec3::new(0.0, -1.0, -0.01));
    let gpu = device();
    let mut studio = Studio::new(&gpu, thesis(&[]));
    let scene = studio.load(&stage.scene);
    let mut under = |least: &str, x: f32| {
        studio.set(thesis(&[
            ("shadow.layout", "single"),
            ("shadow.min_variance", least),
            ("shadow.bleed_reduction", "0"),
            ("shadow.bias.cull_front", "false"),
            ("shadow.darkens", "direct"),
            ("shadow.floor", "0"),
        ]));
        let view = View::look_at(Vec3::new(x, 0.1, 4.0), Vec3::new(x, 0.0, 0.0), 0.01, 0.05);
        studio.aov(&scene, &view, [1, 1], 1, Aov::Shadow).pixels()[0][0]
    };
    assert!(under("0", -2.0) < 0.05 && under("0", 2.0) < 0.05);
    // The map reaches about 4 m along the light, so the variance is 0.17 m² at least: for 0.3 m that leaves two thirds of the
    // light, for 3.1 m a fiftieth.
    let (near, far) = (under("0.01", -2.0), under("0.01", 2.0));
    assert!((0.5..0.8).contains(&near), "{near}");
    assert!(far < 0.04, "{far}");
}
