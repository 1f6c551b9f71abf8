//! What lies in the maps, against the CPU.

use chiaro_techniques::frame::ShadowViewData;
use chiaro_techniques::shadow::moments::Moments;
use chiaro_techniques::shadow::{Filter, Representation, ShadowSettings, Sigma};
use chiaro_testkit::device;
use glam::Vec2;

use super::{ALL, Depths, Point, Rig, settings, view};

/// Shaders' exp(x) may be off by 3 + 2·|x·log₂e| last places (WGSL, "Floating point accuracy"): 1.5e-5 for x = 85. A
/// warp's square doubles that.
const EXP_ERROR: f64 = 3e-5;

/// A layer of linear depths, 0..1.
struct Layer<'a> {
    side: u32,
    linear: &'a [f64],
}

impl Layer<'_> {
    fn at(&self, x: i64, y: i64) -> f64 {
        let axis = |i: i64| i.clamp(0, i64::from(self.side) - 1) as usize;
        self.linear[axis(y) * self.side as usize + axis(x)]
    }

    /// The smaller of two one-sided differences; the only one at the edge.
    fn slope(&self, (x, y): (i64, i64), (dx, dy): (i64, i64)) -> f64 {
        let last = i64::from(self.side) - 1;
        let low = self.at(x, y) - self.at(x - dx, y - dy);
        let high = self.at(x + dx, y + dy) - self.at(x, y);
        let along = x * dx + y * dy;
        if along == 0 || along < last && high.abs() <= low.abs() { high } else { low }
    }

    fn represented(&self, settings: &ShadowSettings, (x, y): (i64, i64)) -> [f64; 4] {
        let d = self.at(x, y);
        let warp = |c: f32, d: f64| (f64::from(c) * d).exp();
        let (p, n) =
            (warp(settings.evsm_positive, 2.0 * d - 1.0), warp(settings.evsm_negative, 1.0 - 2.0 * d));
        let z = 2.0 * d - 1.0;
        match settings.representation {
            Representation::Depth => [0.0; 4],
            Representation::Variance => {
                let (dx, dy) = (self.slope((x, y), (1, 0)), self.slope((x, y), (0, 1)));
                [d, d * d + 0.25 * (dx * dx + dy * dy), 0.0, 0.0]
            }
            Representation::Exponential if settings.prefilter => {
                let around = (-1..=1).flat_map(|v| (-1..=1).map(move |u| (u, v)));
                let sum = around.map(|(u, v): (i64, i64)| {
                    let weight = (2 - u.abs()) * (2 - v.abs());
                    weight as f64 / 16.0 * warp(settings.exponent, self.at(x + u, y + v))
                });
                [sum.sum(), 0.0, 0.0, 0.0]
            }
            Representation::Exponential => [warp(settings.exponent, d), 0.0, 0.0, 0.0],
            Representation::Evsm2 => [p, p * p, 0.0, 0.0],
            Representation::Evsm4 => [p, p * p, -n, n * n],
            Representation::Moments => [z, z * z, z.powi(3), z.powi(4)],
        }
    }
}

/// All weights of a blur.
fn kernel(settings: &ShadowSettings) -> Vec<f64> {
    if !settings.filter.blurs() {
        return vec![1.0];
    }
    let radius = settings.filter_radius.ceil() as i32;
    let weights: Vec<f64> = match settings.sigma.0 {
        Some(sigma) => {
            (-radius..=radius).map(|k| (-0.5 * (f64::from(k) / f64::from(sigma)).powi(2)).exp()).collect()
        }
        // Row 2r of Pascal's triangle, row by row.
        None => (0..2 * radius).fold(vec![1.0], |row, _| {
            let pairs = row.windows(2).map(|pair| pair[0] + pair[1]);
            std::iter::once(1.0).chain(pairs).chain([1.0]).collect()
        }),
    };
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

/// The map that settings ask for.
fn twin(settings: &ShadowSettings, layer: &Layer<'_>) -> Vec<[f64; 4]> {
    let (side, weights) = (i64::from(layer.side), kernel(settings));
    let radius = weights.len() as i64 / 2;
    let places = move || (0..side).flat_map(move |y| (0..side).map(move |x| (x, y)));
    let plain: Vec<_> = places().map(|at| layer.represented(settings, at)).collect();
    let blur = |from: &[[f64; 4]], (dx, dy): (i64, i64)| -> Vec<[f64; 4]> {
        let blurred = |(x, y): (i64, i64)| {
            (-radius..=radius).zip(&weights).fold([0.0; 4], |sum, (k, weight)| {
                let at = ((y + k * dy).clamp(0, side - 1) * side + (x + k * dx).clamp(0, side - 1)) as usize;
                std::array::from_fn(|i| sum[i] + weight * from[at][i])
            })
        };
        places().map(blurred).collect()
    };
    blur(&blur(&plain, (1, 0)), (0, 1))
}

/// The largest difference of any number, as a share of the twin's or of `least`.
fn difference(texels: &[[f32; 4]], twin: &[[f64; 4]], least: f64) -> f64 {
    assert_eq!(texels.len(), twin.len());
    let numbers = texels.iter().flatten().zip(twin.iter().flatten());
    let differences = numbers.map(|(&a, &b)| (f64::from(a) - b).abs() / b.abs().max(least));
    differences.fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { most.max(d) })
}

fn linear_of(view: &ShadowViewData, depth: f32) -> f64 {
    let (near, far, depth) = (f64::from(view.near_m), f64::from(view.far_m), f64::from(depth));
    let distance = match view.projection {
        ShadowViewData::PARALLEL => far - depth * (far - near),
        ShadowViewData::PARABOLOID => (near / depth).min(far),
        _ => near * far / (depth * (far - near) + near),
    };
    ((distance - near) / (far - near)).clamp(0.0, 1.0)
}

/// How much settings' maps of random depths differ from the twin's, with all kinds of views.
fn from_twin(settings: &ShadowSettings, side: u32, as_depth: bool) -> f64 {
    let gpu = device();
    let depths = Depths::random(side, 3);
    let kinds = [ShadowViewData::PARALLEL, ShadowViewData::PERSPECTIVE, ShadowViewData::PARABOLOID];
    let views: Vec<_> = (0..)
        .zip(kinds)
        .map(|(layer, projection)| ShadowViewData { projection, ..view(layer, side) })
        .collect();
    let rig = Rig::with_views(&gpu, settings.clone(), &depths, &views, as_depth);
    let twins = depths.layers.iter().zip(&views).flat_map(|(layer, view)| {
        let linear: Vec<_> = layer.iter().map(|&depth| linear_of(view, depth)).collect();
        twin(settings, &Layer { side, linear: &linear })
    });
    difference(&rig.texels(0), &twins.collect::<Vec<_>>(), 1e-2)
}

#[test]
fn every_representation_is_what_the_cpu_makes_of_depth() {
    for representation in ALL {
        for prefilter in [false, true] {
            let settings = ShadowSettings { prefilter, ..settings(representation, Filter::None) };
            let difference = from_twin(&settings, 20, false);
            assert!(difference < EXP_ERROR, "{representation:?}: {difference}");
        }
    }
}

#[test]
fn blurred_maps_are_what_the_cpu_makes_of_depth_up_to_the_edges() {
    // Larger than a workgroup's segments of rows and columns.
    let side = 72;
    for representation in ALL {
        for (radius, sigma) in [(2.0, None), (32.0, None), (4.3, Some(2.0))] {
            let sigma = Sigma(sigma);
            let settings =
                ShadowSettings { filter_radius: radius, sigma, ..settings(representation, Filter::Gaussian) };
            let difference = from_twin(&settings, side, false);
            assert!(difference < EXP_ERROR, "{representation:?}, radius {radius}: {difference}");
        }
    }
}

#[test]
fn depth_maps_serve_as_well_as_maps_of_floats() {
    for filter in [Filter::None, Filter::Gaussian] {
        let difference = from_twin(&settings(Representation::Variance, filter), 20, true);
        assert!(difference < 5e-6, "{filter:?}: {difference}");
    }
}

#[test]
fn a_blur_keeps_a_constant_and_spreads_an_impulse_by_pascals_triangle() {
    let gpu = device();
    let side = 24;
    let mut settings = settings(Representation::Variance, Filter::Gaussian);
    for radius in [0.0, 1.0, 2.0, 7.0, 32.0] {
        settings.filter_radius = radius;
        let constant = Rig::new(&gpu, settings.clone(), &Depths::new(side, 1, |_, _, _| 0.75));
        for [d, d2, ..] in constant.texels(0) {
            assert!((d - 0.75).abs() < 2e-7 && (d2 - 0.5625).abs() < 2e-7, "radius {radius}: {d} {d2}");
        }
    }
    // Nothing, but for one texel at the near plane; its neighbours' differences vanish to the other side.
    settings.filter_radius = 2.0;
    let impulse = Depths::new(side, 1, |_, x, y| if (x, y) == (12, 9) { 0.0 } else { 1.0 });
    let texels = Rig::new(&gpu, settings, &impulse).texels(0);
    let weights = [1.0, 4.0, 6.0, 4.0, 1.0].map(|weight| weight / 16.0);
    for (i, [d, ..]) in texels.into_iter().enumerate() {
        let (x, y) = (i as i32 % side as i32 - 10, i as i32 / side as i32 - 7);
        let weight = |i: i32| weights.get(usize::try_from(i).unwrap_or(9)).copied().unwrap_or(0.0);
        let expected: f32 = 1.0 - weight(x) * weight(y);
        assert!((d - expected).abs() < 2e-7, "{x} {y}: {d} should be {expected}");
    }
}

#[test]
fn mips_are_means_of_the_texels_they_cover() {
    let gpu = device();
    for (side, mips) in [(32, 4), (50, 4), (27, 3)] {
        for representation in [Representation::Exponential, Representation::Variance, Representation::Moments]
        {
            let settings = ShadowSettings { exponent: 5.0, ..settings(representation, Filter::GaussianMip) };
            let rig = Rig::new(&gpu, settings, &Depths::random(side, 2));
            assert_eq!(rig.outputs().moments.options().mips, mips);
            for mip in 1..mips {
                let (finer, coarser) = (rig.texels(mip - 1), rig.texels(mip));
                let twin = halved(&finer, side >> (mip - 1));
                let difference = difference(&coarser, &twin, 1e-2);
                assert!(difference < 1e-6, "{representation:?} {side}, mip {mip}: {difference}");
            }
        }
    }
}

/// Means over the places that each texel of the next mip covers, layer after layer.
fn halved(finer: &[[f32; 4]], side: u32) -> Vec<[f64; 4]> {
    let half = side / 2;
    let covered = |i: u32| {
        let (from, to) = (
            f64::from(i) * f64::from(side) / f64::from(half),
            f64::from(i + 1) * f64::from(side) / f64::from(half),
        );
        (0..side)
            .map(move |j| (j, (to.min(f64::from(j + 1)) - from.max(f64::from(j))).max(0.0) / (to - from)))
    };
    let layers = finer.chunks((side * side) as usize);
    let texel = |layer: &[[f32; 4]], i: u32| {
        covered(i / half).fold([0.0; 4], |sum, (y, wy)| {
            covered(i % half).fold(sum, |sum, (x, wx)| {
                std::array::from_fn(|c| sum[c] + wx * wy * f64::from(layer[(y * side + x) as usize][c]))
            })
        })
    };
    layers.flat_map(|layer| (0..half * half).map(move |i| texel(layer, i))).collect()
}

#[test]
fn only_maps_rendered_again_are_made_again_unless_settings_change() {
    let gpu = device();
    let side = 16;
    for filter in [Filter::None, Filter::GaussianMip] {
        let mut rig = Rig::new(
            &gpu,
            settings(Representation::Exponential, filter),
            &Depths::new(side, 3, |_, _, _| 0.25),
        );
        let first = |rig: &Rig, mip: u32| -> Vec<f32> {
            let texels = rig.texels(mip);
            texels.chunks(texels.len() / 3).map(|layer| layer[0][0].ln()).collect()
        };
        rig.maps = Depths::new(side, 3, |_, _, _| 0.5).upload(&gpu, true);
        rig.make(&[2]);
        let last = rig.outputs().moments.options().mips - 1;
        for mip in [0, last] {
            let found = first(&rig, mip);
            for (found, expected) in found.iter().zip([20.0, 20.0, 40.0]) {
                assert!((found - expected).abs() < 1e-4, "{filter:?}: {found} should be {expected}");
            }
        }
        rig.settings.exponent = 10.0;
        rig.make(&[]);
        let found = first(&rig, last);
        assert!(found.iter().all(|found| (found - 5.0).abs() < 1e-4), "{filter:?}: {found:?}");
    }
}

#[test]
fn layers_that_do_not_fit_at_once_are_blurred_one_after_the_other() {
    let gpu = device();
    // A layer of rows takes 33 of the 64 MiB.
    let settings =
        ShadowSettings { filter_radius: 1.0, ..settings(Representation::Moments, Filter::Gaussian) };
    let side = 1472;
    let rig = Rig::new(&gpu, settings, &Depths::new(side, 3, |layer, _, _| 0.25 * (layer + 1) as f32));
    let points: Vec<_> = (0..3)
        .flat_map(|view| [0.2, 0.3, 0.45, 0.55, 0.7, 0.8].map(|linear| (view, linear)))
        .map(|(view, linear)| Point { view, ..Point::new(Vec2::new(0.7, 0.9), linear) })
        .collect();
    for (point, lit) in points.iter().zip(rig.visibility(&points)) {
        let expected = if point.linear < 0.25 * (point.view + 1) as f32 { 1.0 } else { 0.0 };
        assert!((lit - expected).abs() < 1e-2, "{point:?}: {lit}");
    }
}

#[test]
fn the_memory_of_a_plan_is_that_of_the_textures() {
    let gpu = device();
    for representation in ALL {
        for filter in [Filter::None, Filter::Mip] {
            let settings = settings(representation, filter);
            let planned = Moments::bytes(&settings, 40, 3);
            let rig = Rig::new(&gpu, settings, &Depths::random(40, 3));
            assert_eq!(rig.outputs().moments.bytes(), planned, "{representation:?} {filter:?}");
        }
    }
    let blurred = settings(Representation::Evsm4, Filter::Gaussian);
    // Four layers of 64 MiB, and one of rows.
    assert_eq!(Moments::bytes(&blurred, 2048, 4), 5 << 26);
    assert_eq!(Moments::bytes(&settings(Representation::Depth, Filter::Pcf), 2048, 4), 0);
}
