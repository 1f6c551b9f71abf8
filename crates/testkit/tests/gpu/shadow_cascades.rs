//! Cascades: shadows rest while the camera moves, and no border shows.

use std::f32::consts::PI;

use chiaro::{Aov, View};
use chiaro_testkit::{Exact, Stage, Studio, device, direct};
use glam::Vec3;

/// A long floor with posts and a bar over them.
fn stage(posts: bool) -> Stage {
    let mut stage = Stage::new();
    let material = stage.lambert(0.8);
    stage.quad(Vec3::ZERO, Vec3::X * 40.0, Vec3::NEG_Z * 40.0, material);
    for i in 0..if posts { 24 } else { 0 } {
        let at = Vec3::new((i % 5) as f32 * 1.7 - 3.0, 0.7, 18.0 - i as f32 * 1.6);
        stage.cuboid(at, Vec3::new(0.12, 0.7, 0.12), material);
    }
    stage.sun(PI, Vec3::new(0.6, -1.0, 0.25));
    stage
}

#[test]
fn shadows_of_fixed_points_rest_while_the_camera_moves_and_turns() {
    let stage = stage(true);
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.filter", "none"), ("shadow.resolution", "256")]));
    let scene = studio.load(&stage.scene);
    let exact = Exact::new(&stage.scene);
    let points =
        (0..24).map(|i| Vec3::new((i * 37 % 61) as f32 * 0.1 - 3.0, 0.0, (i * 17 % 53) as f32 * 0.3 - 8.0));
    let mut compared = 0;
    for point in points {
        let mut seen: Vec<([f32; 3], f32)> = Vec::new();
        for step in 0..5 {
            let t = step as f32;
            let eye = Vec3::new(0.4 * t - 1.0, 2.0 + 0.13 * t, 16.0 - 0.37 * t);
            let hit = exact.nearest(eye, (point - eye).normalize());
            if hit.is_some_and(|hit| hit.position.distance(point) < 1e-2) {
                // The point is the only pixel's middle: from every place the very same one is shaded.
                let view = View::look_at(eye, point, 0.01, 0.05);
                let aovs = [Aov::ShadowCascade, Aov::Shadow];
                let [cascade, shadow] = studio.aovs(&scene, &view, [1, 1], 1, aovs);
                seen.push((cascade.pixels()[0], shadow.pixels()[0][0]));
            }
        }
        for pair in seen.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
            compared += 1;
            assert!((pair[0].1 - pair[1].1).abs() <= 1.0 / 255.0, "{point}: {seen:?}");
        }
    }
    assert!(compared > 50, "{compared}");
}

#[test]
fn no_border_between_cascades_shows_on_a_flat_floor_in_light_or_shadow() {
    let mut stage = stage(false);
    let material = stage.lambert(0.8);
    // A roof over the left half.
    stage.quad(Vec3::new(-20.0, 4.0, 0.0), Vec3::X * 20.0, Vec3::NEG_Z * 40.0, material);
    let gpu = device();
    let exact = Exact::new(&stage.scene);
    let view = View::look_at(Vec3::new(2.4, 3.0, 30.0), Vec3::new(2.4, 0.0, 20.0), 0.8, 0.05);
    let size = [160, 120];
    let hits = exact.pixels(&view, size);
    // The roof's shadow ends 2.4 m to the right of it; filters reach a part of a metre.
    let side = |i: usize| {
        let p = hits[i].map(|hit| hit.position).filter(|p| p.y.abs() < 1e-3 && p.z > 5.0)?;
        ((p.x - 2.4).abs() > 1.5).then_some(p.x > 2.4)
    };
    let mut studio = Studio::new(&gpu, direct(&[]));
    let scene = studio.load(&stage.scene);
    for (representation, filter) in
        [("depth", "pcf"), ("depth", "pcss"), ("evsm4", "gaussian"), ("moments", "gaussian-mip")]
    {
        for select in ["projection", "depth"] {
            studio.set(direct(&[
                ("shadow.resolution", "512"),
                ("shadow.representation", representation),
                ("shadow.filter", filter),
                ("shadow.cascade_select", select),
            ]));
            let [colors, shadows] = studio.aovs(&scene, &view, size, 1, [Aov::ShadowCascade, Aov::Shadow]);
            let cascades: std::collections::BTreeSet<_> =
                colors.pixels().iter().map(|pixel| pixel.map(|channel| (channel * 100.0) as u32)).collect();
            assert!(cascades.len() > 4, "three cascades and their blends: {}", cascades.len());
            let found: Vec<f32> = shadows.pixels().iter().map(|p| p[0]).collect();
            let width = size[0] as usize;
            let neighbours = (0..found.len() - width).flat_map(|i| [(i, i + 1), (i, i + width)]);
            let mut pairs = 0;
            for (a, b) in neighbours.filter(|&(a, b)| side(a).is_some() && side(a) == side(b)) {
                pairs += 1;
                let step = (found[a] - found[b]).abs();
                assert!(
                    step <= 2.0 / 255.0,
                    "{representation}, {filter}, by {select}: a step of {step} at pixel {}, {}",
                    a % width,
                    a / width
                );
            }
            assert!(pairs > 10_000, "{pairs}");
        }
    }
}
