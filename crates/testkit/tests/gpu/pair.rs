//! Sums as pairs of floats keep what a single one loses, whatever a driver's compiler thinks of their algebra.

use chiaro_gpu::Dispatch;
use chiaro_testkit::{Bench, Stage, Truth, camera_above, device, direct};
use glam::{Vec3, Vec4};

use chiaro::ReferenceOptions;
use chiaro::scene::Material;

fn sum(bench: &Bench, first: f32, x: f32, count: u32) -> [[f32; 4]; 2] {
    let words = [first.to_bits(), x.to_bits(), count, 0];
    let input = bench.buffer("input", &words);
    let shader = ("tests/pair.cs.wesl", include_str!("wesl/pair.cs.wesl"));
    let work = (Dispatch::Groups([1; 3]), 2);
    let found: Vec<[f32; 4]> = bench.run(shader, &[], None, &[("input", (&input).into())], work);
    [found[0], found[1]]
}

#[test]
fn a_pair_of_floats_keeps_what_one_loses() {
    let bench = Bench::new(&device());
    for (first, x, count) in [(1e8f32, 1.0f32, 1000u32), (0.0, 0.1, 10_000), (-3e5, 0.007, 1000)] {
        let [high, low] = sum(&bench, first, x, count);
        let addends: [&dyn Fn(u32) -> f32; 3] = [&|_| x, &|_| x * x, &|i| x * i as f32];
        for (lane, addend) in addends.into_iter().enumerate() {
            let exact = f64::from(first) + (0..count).map(|i| f64::from(addend(i))).sum::<f64>();
            let single = (0..count).fold(first, |sum, i| sum + addend(i));
            let found = f64::from(high[lane]) + f64::from(low[lane]);
            let scale = f64::from(first).abs().max(exact.abs());
            assert!((found - exact).abs() <= 1e-12 * scale, "{first} {x} {lane}: {found} is not {exact}");
            assert!((f64::from(single) - exact).abs() > 1e-10 * scale, "{first} {x} {lane} loses nothing");
            assert_eq!(
                high[lane], found as f32,
                "{first} {x} {lane}: the first float is not the rounded sum"
            );
        }
    }
    // What is too large for a float is infinite, not broken.
    let [high, low] = sum(&bench, 3e38, 1e38, 3);
    assert_eq!((high[0], low[0]), (f32::INFINITY, 0.0));
}

#[test]
fn a_thousand_samples_are_summed_without_loss() {
    let mut stage = Stage::new();
    let glowing =
        Material { emissive: Vec3::splat(0.1), base_color: Vec4::W, specular: 0.0, ..Material::default() };
    let glowing = stage.material(glowing);
    stage.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, glowing);
    let view = (&camera_above(1.0), [8; 2]);
    let options = ReferenceOptions { max_depth: 1, ..ReferenceOptions::default() };
    let mut truth = Truth::new(&device(), direct(&[]), &stage.scene, view, options);
    let image = truth.add(&[600, 400]);
    let samples = f64::from(truth.samples());
    let single = (0..truth.samples()).fold(0.0f32, |sum, _| sum + 0.1);
    let exact = samples * f64::from(0.1f32);
    assert!((f64::from(single) - exact).abs() > 1e-6, "a single float would do");
    let total = truth.total("sum");
    assert!((total[0] - exact).abs() < 1e-9, "{} is not {exact}", total[0]);
    assert_eq!(image.pixel(3, 3)[0], exact as f32 / samples as f32);
}
