//! What pictures and references show: one rule for both (docs/reference.md, "What is seen").

use chiaro::scene::{Material, Projection};
use chiaro::{Integrator, ReferenceOptions, View};
use chiaro_testkit::{Stage, Studio, Truth, camera_above, device, device_guaranteed, direct, nmae};
use glam::Vec3;

use crate::truth::{mean, trace, trace_views};

const SIZE: [u32; 2] = [96, 64];

/// A floor with single-sided things over it: a wall that looks away from [`through_the_wall`], a card that looks down,
/// one that looks up, a pillar.
fn stage() -> Stage {
    let mut stage = Stage::floor(0.6);
    let material = Material { specular: 0.0, ..Material::default() };
    let single = stage.material(material);
    stage.quad(Vec3::new(0.0, 1.0, 2.0), Vec3::NEG_X, Vec3::Y, single);
    stage.quad(Vec3::new(-1.5, 1.0, 0.0), Vec3::X * 0.5, Vec3::Z * 0.5, single);
    stage.quad(Vec3::new(-2.5, 2.5, 2.5), Vec3::X * 0.3, Vec3::NEG_Z * 0.3, single);
    stage.cuboid(Vec3::new(1.5, 0.8, 4.0), Vec3::new(0.3, 0.8, 0.3), single);
    stage.sun(10.0, Vec3::new(0.3, -1.0, -0.4));
    stage
}

/// Its near plane cuts the pillar open.
fn through_the_wall() -> View {
    View::look_at(Vec3::new(0.0, 2.0, 6.0), Vec3::ZERO, 0.9, 2.3)
}

/// Planes that cut the pillar open and end the floor.
fn parallel() -> View {
    let view = View::look_at(Vec3::new(3.0, 4.0, 8.0), Vec3::ZERO, 1.0, 0.1);
    View { projection: Projection::Orthographic { half_height_m: 3.0 }, near_m: 5.0, far_m: 9.5, ..view }
}

#[test]
fn pictures_and_references_show_the_same_surfaces() {
    let stage = stage();
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "4096"), ("shadow.layout", "single")]));
    let loaded = studio.load(&stage.scene);
    let options = ReferenceOptions { max_depth: 2, seed: 1, ..ReferenceOptions::default() };
    let traced = device_guaranteed();
    let mut truth = Truth::new(&traced, direct(&[]), &stage.scene, (&parallel(), SIZE), options);
    for view in [through_the_wall(), parallel(), camera_above(3.0)] {
        let picture = studio.radiance(&loaded, &view, SIZE, 16);
        truth.look(&view);
        let reference = truth.add(&[16]);
        let distance = nmae(&picture, &reference);
        // Edges of shadows and surfaces in sixteen places of a pixel each.
        assert!(distance < 0.012, "{view:?}: {distance}");
    }
}

#[test]
fn backs_stop_light() {
    // From above the card that looks down is not there, but its shadow is; and of the other rays to the sun meet the back.
    let stage = stage();
    let view = camera_above(3.0);
    let mut studio = Studio::new(&device(), direct(&[]));
    let loaded = studio.load(&stage.scene);
    let picture = studio.radiance(&loaded, &view, SIZE, 1);
    let reference = trace(
        &stage.scene,
        (&view, SIZE),
        ReferenceOptions { max_depth: 2, ..ReferenceOptions::default() },
        &[4],
    );
    // In the middle of shadows, and beside them.
    for image in [picture, reference] {
        let at = |x: f32, z: f32| [(x / 9.0 + 0.5) * 96.0, (z / 6.0 + 0.5) * 64.0];
        let near = |[px, py]: [f32; 2]| {
            mean(&image, move |x, y| (x as f32 + 0.5 - px).abs() < 2.0 && (y as f32 + 0.5 - py).abs() < 2.0)
        };
        let [down, up, sun] = [(-1.2, -0.4), (-1.75, 1.5), (-1.2, 1.0)].map(|(x, z)| near(at(x, z)));
        assert!(down == 0.0 && up == 0.0 && sun > 1.0, "{down} and {up} in the shade, {sun} in the sun");
    }
}

#[test]
fn light_paths_are_seen_like_paths_from_the_camera() {
    let stage = stage();
    let views = [through_the_wall(), parallel()];
    let [paths, photons] = [(Integrator::Path, 16), (Integrator::Photon, 64)].map(|(integrator, samples)| {
        let options = ReferenceOptions { integrator, max_depth: 2, seed: 1, ..ReferenceOptions::default() };
        trace_views(&stage.scene, (&views, [24, 16]), options, &[samples])
    });
    for (view, (path, photon)) in views.iter().zip(paths.iter().zip(&photons)) {
        let distance = nmae(photon, path);
        assert!(distance < 0.05, "{view:?}: {distance}");
    }
}
