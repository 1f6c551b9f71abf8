//! How much light goes on from what lamps shine at, against formulas.

use super::*;
use std::f64::consts::PI;

use chiaro::View;
use chiaro::scene::{AlphaMode, LightKind, Material};
use chiaro_testkit::{Stage, device};
use glam::{Vec3, Vec4};

const DOWN: Vec3 = Vec3::NEG_Y;

fn floor(material: Material) -> Stage {
    let mut stage = Stage::new();
    let id = stage.material(Material { specular: 0.0, double_sided: true, ..material });
    stage.quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Z * 4.0, id);
    stage
}

fn grey(albedo: f32) -> Material {
    Material { base_color: Vec3::splat(albedo).extend(1.0), ..Material::default() }
}

fn spot(stage: &mut Stage) {
    let kind = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 };
    stage.light(kind, 10.0, None, Vec3::Y * 2.0, DOWN);
}

fn total(studio: &mut Studio, stage: &Stage) -> f64 {
    let scene = studio.load(&stage.scene);
    Placed::new(studio, &scene).total()
}

fn assert_near(found: f64, expected: f64, name: &str) {
    assert!((found / expected - 1.0).abs() < 0.01, "{name}: {found} lm should be {expected}");
}

#[test]
fn lamps_over_a_floor_have_the_flux_of_their_formulas() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[("indirect.rsm_resolution", "256")]));
    for (inner, outer) in [(0.5f32, 0.501f32), (0.2, 0.7), (0.0, 0.1), (0.9, 1.0)] {
        let mut stage = floor(grey(0.6));
        let kind = LightKind::Spot { inner_rad: inner, outer_rad: outer };
        stage.light(kind, 10.0, None, Vec3::Y * 2.0, DOWN);
        // The fall-off is a square of what is linear in the cosine.
        let [inner_cos, outer_cos] = [inner, outer].map(|angle| f64::from(angle).cos());
        let solid_angle = 2.0 * PI * (1.0 - inner_cos + (inner_cos - outer_cos) / 3.0);
        assert_near(total(&mut studio, &stage), 10.0 * solid_angle * 0.6, &format!("spot of {outer}"));
    }
    for slant in [0.0f32, 0.5, 1.2] {
        let mut stage = floor(grey(0.6));
        stage.sun(3.0, Vec3::new(slant.sin(), -slant.cos(), 0.0));
        let expected = 3.0 * 64.0 * f64::from(slant).cos() * 0.6;
        assert_near(total(&mut studio, &stage), expected, &format!("sun at {slant}"));
    }
    // A point in a closed room lights all around.
    let mut stage = Stage::new();
    let white = stage.lambert(0.5);
    stage.cuboid(Vec3::ZERO, Vec3::new(2.0, 1.0, 1.5), white);
    stage.light(LightKind::Point, 2.0, None, Vec3::new(0.7, 0.1, -0.4), DOWN);
    assert_near(total(&mut studio, &stage), 2.0 * 4.0 * PI * 0.5, "point");
}

#[test]
fn what_is_far_away_takes_nothing_from_what_a_lamp_is_near_to() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    for kind in [LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 }, LightKind::Point] {
        let mut stage = floor(grey(0.6));
        stage.light(kind, 10.0, None, Vec3::Y * 0.5, DOWN);
        let alone = total(&mut studio, &stage);
        let white = stage.lambert(0.6);
        stage.quad(Vec3::X * 1e6, Vec3::X, Vec3::NEG_Z, white);
        assert_near(total(&mut studio, &stage), alone, &format!("{kind:?}"));
    }
}

#[test]
fn metals_and_holes_carry_nothing() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    let mut metal = floor(Material { metallic: 1.0, ..grey(0.9) });
    spot(&mut metal);
    assert_eq!(total(&mut studio, &metal), 0.0);
    let hole = Material {
        base_color: Vec4::new(0.9, 0.9, 0.9, 0.1),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        double_sided: true,
        ..Material::default()
    };
    let mut holes = floor(hole.clone());
    spot(&mut holes);
    assert_eq!(total(&mut studio, &holes), 0.0);
    // Nor does one stop anything.
    let mut stage = floor(grey(0.6));
    spot(&mut stage);
    let open = total(&mut studio, &stage);
    let hole = stage.material(hole);
    stage.quad(Vec3::Y, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, hole);
    assert!((total(&mut studio, &stage) / open - 1.0).abs() < 1e-3);
}

#[test]
fn a_pane_stops_as_much_of_the_flux_as_of_direct_light() {
    let gpu = device();
    for tint in ["false", "true"] {
        let mut studio = Studio::new(&gpu, settings(&[("shadow.transmission_tint", tint)]));
        for alpha in [0.3, 0.8] {
            let mut stage = floor(grey(0.6));
            spot(&mut stage);
            let clear = stage.scene.clone();
            let base_color = Vec4::new(0.9, 0.5, 0.2, alpha);
            let material = Material { base_color, alpha: AlphaMode::Blend, ..Material::default() };
            let pane = stage.material(Material { double_sided: true, ..material });
            stage.quad(Vec3::Y, Vec3::X * 3.0, Vec3::NEG_Z * 3.0, pane);
            // Under the pane.
            let view = View::look_at(Vec3::new(1.6, 0.5, 0.0), Vec3::ZERO, 0.5, 0.01);
            let [before, after] = [&clear, &stage.scene].map(|scene| {
                let loaded = studio.load(scene);
                let flux = Placed::new(&mut studio, &loaded).total();
                let direct = studio.aov(&loaded, &view, [24, 16], 1, chiaro::Aov::Direct);
                let mean = |p: &[f32; 3]| {
                    0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2])
                };
                (flux, direct.pixels().iter().map(mean).sum::<f64>())
            });
            let [flux, direct] = [after.0 / before.0, after.1 / before.1];
            assert!(before.0 > 1.0 && before.1 > 1.0);
            assert!((flux - direct).abs() < 0.01, "tint {tint}, {alpha}: {flux} of {direct}");
        }
    }
}

#[test]
fn a_light_in_a_closed_box_lights_its_inside_alone() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    for double_sided in [true, false] {
        let mut stage = floor(grey(0.6));
        let wall = stage.material(Material { double_sided, specular: 0.0, ..grey(0.5) });
        let centre = Vec3::new(0.5, 1.0, 0.2);
        stage.cuboid(centre, Vec3::splat(0.3), wall);
        stage.light(LightKind::Point, 2.0, None, centre, DOWN);
        let scene = studio.load(&stage.scene);
        let placed = Placed::new(&mut studio, &scene);
        if !double_sided {
            // Backs carry nothing and stop all.
            let total = placed.total();
            assert!(total < 1e-3, "{total} lm pass backs");
            continue;
        }
        assert_near(placed.total(), 2.0 * 4.0 * PI * 0.5, "inside");
        for vpl in &placed.vpls {
            let off = Vec3::from(vpl.position_ws) - centre;
            assert!(
                (off.abs().max_element() - 0.3).abs() < 1e-3 && vpl.normal_ws().dot(off) < 0.0,
                "{vpl:?}"
            );
        }
    }
}

#[test]
fn a_sun_over_a_wide_ground_has_a_finer_map_of_what_stands_on_it_and_counts_nothing_twice() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    let mut stage = Stage::new();
    let id = stage.material(Material { specular: 0.0, double_sided: true, ..grey(0.6) });
    stage.quad(Vec3::ZERO, Vec3::X * 200.0, Vec3::NEG_Z * 200.0, id);
    stage.cuboid(Vec3::new(3.0, 0.5, -2.0), Vec3::splat(0.5), id);
    stage.sun(3.0, Vec3::new(0.3, -1.0, 0.2).normalize());
    let scene = studio.load(&stage.scene);
    let placed = Placed::new(&mut studio, &scene);
    assert_eq!(placed.views.len(), 2);
    let cosine = f64::from(Vec3::new(0.3, -1.0, 0.2).normalize().y.abs());
    // The map reaches a little beyond the ground, where it has no texels to lose.
    assert_near(placed.total(), 3.0 * 160_000.0 * cosine * 0.6, "ground and box");
    let [from, to] = [placed.views[0].finer_from, placed.views[0].finer_to];
    assert!(from < to, "{from:x} to {to:x}");
}
