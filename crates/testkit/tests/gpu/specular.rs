//! What mirrors and smooth glass show by rays, against the formulas of slabs, balls and mirrors.

use std::f32::consts::PI;

use chiaro::View;
use chiaro::scene::Material;
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, device_guaranteed, direct};
use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::light_paths::{ALBEDO, CANDELA, LAMP, ball, before_a_mirror, glass, mirrored, reflectance};
use crate::truth::{environment, fresnel};

const SIZE: [u32; 2] = [16, 16];

fn studio(changes: &[(&str, &str)]) -> Studio {
    let rays = [("specular.technique", "rays"), ("surface.layers", "1")];
    Studio::new(&device_guaranteed(), direct(&[&rays, changes].concat()))
}

fn picture(studio: &mut Studio, stage: &Stage, view: &View) -> Image {
    let scene = studio.load(&stage.scene);
    studio.radiance(&scene, view, SIZE, 1)
}

/// Where a pixel's ray goes.
fn direction(view: &View, x: u32, y: u32) -> Vec3 {
    let at = (Vec2::new(x as f32, y as f32) + 0.5) / SIZE[0] as f32;
    let ndc = at * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
    view.relative_from_clip(SIZE, Vec2::ZERO).project_point3(ndc.extend(0.5)).normalize()
}

fn pixels() -> impl Iterator<Item = (u32, u32)> {
    (0..SIZE[0] * SIZE[1]).map(|i| (i % SIZE[0], i / SIZE[0]))
}

#[test]
fn glass_shows_what_is_behind_and_around_it_as_its_two_faces_bend_it() {
    let mut studio = studio(&[]);
    look_through_a_slab(&mut studio);
    look_into_a_ball(&mut studio);
}

/// Fresnel's and Beer's laws.
fn look_through_a_slab(studio: &mut Studio) {
    let (ior, thick, colour, distance) = (1.5, 0.5, 0.3f32, 0.8);
    let mut stage = Stage::new();
    let slab =
        Material { attenuation_color: Vec3::splat(colour), attenuation_distance: distance, ..glass(ior) };
    let slab = stage.material(slab);
    stage.cuboid(Vec3::ZERO, Vec3::new(50.0, 0.5 * thick, 50.0), slab);
    let shining =
        Material { emissive: Vec3::splat(7.0), base_color: Vec4::W, specular: 0.0, ..Default::default() };
    let shining = stage.material(shining);
    stage.quad(Vec3::NEG_Y, Vec3::X * 60.0, Vec3::NEG_Z * 60.0, shining);
    for angle in [0.0f32, 1.2] {
        let eye = Vec3::new(angle.sin(), angle.cos(), 0.0) * 5.0;
        let image = picture(studio, &stage, &View::look_at(eye, Vec3::ZERO, 0.002, 0.1));
        // What is reflected at the second face goes with what passes: a named bias of r at most.
        let inside = (1.0 - (angle.sin() / ior).powi(2)).sqrt();
        let passes = colour.powf(thick / inside / distance);
        let expected = 7.0 * (1.0 - fresnel(angle.cos(), ior)) * passes;
        let found = image.pixel(8, 8)[1];
        assert!((found / expected - 1.0).abs() < 0.005, "{angle}: {found} is not {expected}");
    }
}

/// Radiance by direction that turns what is seen through a ball about.
fn around(direction: Vec3) -> f32 {
    1.0 + 0.5 * direction.x - 0.3 * direction.y
}

/// What a ball at the origin shows along a ray that meets it.
fn in_a_ball(eye: Vec3, direction: Vec3, radius: f32, ior: f32) -> Option<f32> {
    let along = -eye.dot(direction);
    let off2 = eye.length_squared() - along * along;
    // Facets of the ball's mesh stand off it at the rim.
    if off2 > (0.8 * radius).powi(2) {
        return None;
    }
    let normal = (eye + direction * (along - (radius * radius - off2).sqrt())) / radius;
    let cosine = -direction.dot(normal);
    let reflected = fresnel(cosine, ior);
    let refracted = direction.refract(normal, 1.0 / ior);
    // It leaves as it entered, at the same angle.
    let far_normal = normal + refracted * (-2.0 * refracted.dot(normal));
    let leaves = refracted.refract(-far_normal, ior);
    Some(reflected * around(direction.reflect(normal)) + (1.0 - reflected) * around(leaves))
}

/// Snell's law at both faces.
fn look_into_a_ball(studio: &mut Studio) {
    let (radius, ior) = (0.5, 1.5);
    let mut stage = Stage::new();
    stage.scene.environment = Some(environment(|x, y| {
        let [turn, tilt] =
            [(x, 2.0 * PI / 128.0), (y, PI / 64.0)].map(|(at, texel)| (at as f32 + 0.5) * texel);
        around(Vec3::new(tilt.sin() * turn.sin(), tilt.cos(), -tilt.sin() * turn.cos()))
    }));
    let material = stage.material(glass(ior));
    stage.place(ball(radius, material), Affine3A::IDENTITY);
    let eye = Vec3::new(0.4, 0.6, 2.0);
    let view = View::look_at(eye, Vec3::ZERO, 0.4, 0.1);
    let image = picture(studio, &stage, &view);
    let mut compared = 0;
    for (x, y) in pixels() {
        let Some(expected) = in_a_ball(eye, direction(&view, x, y), radius, ior) else { continue };
        let found = image.pixel(x, y)[1];
        assert!((found / expected - 1.0).abs() < 0.03, "{x} {y}: {found} is not {expected}");
        compared += 1;
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn a_mirror_shows_a_lit_floor_that_the_picture_does_not_show() {
    let stage = before_a_mirror();
    let (eye, target) = (Vec3::new(-1.0, 0.9, 0.0), Vec3::new(1.0, 0.3, 0.0));
    let view = View::look_at(eye, target, 0.15, 0.05);
    let image = picture(&mut studio(&[("pipeline", "forward"), ("surface.msaa", "1")]), &stage, &view);
    for (x, y) in pixels() {
        let towards = direction(&view, x, y);
        // The image of the floor behind the mirror.
        let at = eye - towards * (eye.y / towards.y);
        let floor = mirrored(at);
        let lit = CANDELA * LAMP.y / (LAMP - floor).length().powi(3) * ALBEDO / PI;
        let expected = reflectance(eye, at) * lit;
        let found = image.pixel(x, y)[1];
        assert!((found / expected - 1.0).abs() < 0.01, "{x} {y}: {found} is not {expected}");
    }
}

#[test]
fn where_nothing_mirrors_rays_change_no_bit() {
    let mut stage = Stage::floor(ALBEDO);
    stage.sun(10.0, Vec3::new(0.3, -1.0, 0.1));
    let view = View::look_at(Vec3::new(0.0, 1.0, 1.0), Vec3::ZERO, 0.8, 0.1);
    let mut studio = studio(&[]);
    let rays = picture(&mut studio, &stage, &view);
    studio.set(direct(&[("surface.layers", "1")]));
    let plain = picture(&mut studio, &stage, &view);
    assert!(pixels().all(|(x, y)| rays.pixel(x, y) == plain.pixel(x, y)));
}
