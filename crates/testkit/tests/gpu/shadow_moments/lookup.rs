//! What the maps say of receivers.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::Dispatch;
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::shadow::{Filter, Representation, ShadowSettings, Sigma};
use chiaro_testkit::{Bench, device, device_guaranteed};
use glam::Vec2;

use super::{ALL, Depths, Point, Rig, settings};
use crate::culling::Random;

const BLURRED: Filter = Filter::Gaussian;

/// The most light behind a uniform blocker 0.2 of the range away, and the most that a receiver on it loses.
fn tolerance(representation: Representation) -> (f32, f32) {
    match representation {
        // e^(−80 · 0.2)
        Representation::Exponential => (2e-7, 1e-6),
        // Least variance over 0.2².
        Representation::Variance => (2e-5, 1e-6),
        Representation::Moments => (5e-5, 1e-5),
        _ => (1e-5, 1e-6),
    }
}

#[test]
fn light_reaches_what_lies_before_a_blocker_and_on_it_and_nothing_behind() {
    let gpu = device();
    for representation in ALL {
        for filter in [Filter::None, BLURRED] {
            let blocker = Depths::new(16, 4, |layer, _, _| [0.0, 0.37, 0.8, 1.0][layer as usize]);
            let rig = Rig::new(&gpu, settings(representation, filter), &blocker);
            let mut points = Vec::new();
            for view in 0..4 {
                for step in 0..=100 {
                    let linear = step as f32 / 100.0;
                    points.push(Point { view, ..Point::new(Vec2::new(0.4, 0.7), linear) });
                }
            }
            let (dark, lost) = tolerance(representation);
            let (mut most_dark, mut most_lost) = (0f32, 0f32);
            for (point, lit) in points.iter().zip(rig.visibility(&points)) {
                let depth = [0.0, 0.37, 0.8, 1.0][point.view as usize];
                if point.linear <= depth {
                    most_lost = most_lost.max(1.0 - lit);
                } else if point.linear >= depth + 0.2 {
                    most_dark = most_dark.max(lit);
                }
            }
            assert!(most_dark <= dark, "{representation:?} {filter:?}: {most_dark} behind");
            assert!(most_lost <= lost, "{representation:?} {filter:?}: {most_lost} lost before");
        }
    }
}

/// Share of a binomial blur's weight at offsets of at least `from`.
fn share_from(radius: i32, from: i32) -> f32 {
    let row = (0..2 * radius).fold(vec![1.0f64], |row, _| {
        let pairs = row.windows(2).map(|pair| pair[0] + pair[1]);
        std::iter::once(1.0).chain(pairs).chain([1.0]).collect()
    });
    let sum: f64 = row.iter().sum();
    ((-radius..=radius).zip(row).filter(|(k, _)| *k >= from).map(|(_, w)| w).sum::<f64>() / sum) as f32
}

#[test]
fn of_two_depths_the_farther_receives_exactly_its_share() {
    let gpu = device();
    let (side, radius, near, far) = (32, 6, 0.3, 0.7);
    let depths = Depths::new(side, 1, |_, x, _| if x < 16 { near } else { far });
    for representation in ALL {
        let settings = ShadowSettings { filter_radius: radius as f32, ..settings(representation, BLURRED) };
        let rig = Rig::new(&gpu, settings, &depths);
        let columns = 16 - radius..16 + radius;
        let uv = |x: i32| Vec2::new((x as f32 + 0.5) / side as f32, 0.5);
        let on_far: Vec<_> = columns.clone().map(|x| Point::new(uv(x), far)).collect();
        let between: Vec<_> = columns.clone().map(|x| Point::new(uv(x), 0.5)).collect();
        let shares: Vec<_> = columns.map(|x| share_from(radius, 16 - x)).collect();
        let off = |lit: &[f32]| {
            lit.iter()
                .zip(&shares)
                .map(|(lit, share)| lit - share)
                .fold((0f32, 0f32), |(low, high), d| (low.min(d), high.max(d)))
        };
        let (low, high) = off(&rig.visibility(&on_far));
        // Rounding, and the four moments' bias.
        let exact = match representation {
            Representation::Moments => 1e-4,
            _ => 1e-6,
        };
        assert!(low > -exact && high < exact, "{representation:?}: off by {low} to {high}");
        // Between the two depths the bounds are upper bounds; the exponential map's is its fallback, five taps.
        let least = if representation == Representation::Exponential { -0.1 } else { -exact };
        let (low, _) = off(&rig.visibility(&between));
        assert!(low > least, "{representation:?}: {low} too little between");
    }
}

#[test]
fn a_slanted_plane_does_not_shadow_itself() {
    let gpu = device();
    let side = 32;
    // A hundredth of the range a texel: steep for a map of many texels.
    let plane = |x: f32, y: f32| 0.2 + 0.01 * x + 0.004 * y;
    let depths = Depths::new(side, 1, |_, x, y| plane(x as f32, y as f32));
    let mut random = Random::new(7);
    let points: Vec<_> = (0..500)
        .map(|_| {
            let at = Vec2::new(random.within(6.0, 26.0), random.within(6.0, 26.0));
            let slope = Vec2::new(0.01, 0.004) * side as f32;
            Point { slope, ..Point::new(at / side as f32, plane(at.x - 0.5, at.y - 0.5)) }
        })
        .collect();
    for representation in ALL {
        let rig = Rig::new(&gpu, settings(representation, BLURRED), &depths);
        let least = rig.visibility(&points).into_iter().fold(1.0, f32::min);
        // The allowances for a plane are those of a Gaussian filter.
        assert!(least >= 0.98, "{representation:?}: {least}");
    }
}

#[test]
fn bleed_reduction_cuts_what_is_dark_and_keeps_what_is_lit() {
    let gpu = device();
    let depths = Depths::new(32, 1, |_, x, _| if x < 16 { 0.3 } else { 0.7 });
    let points: Vec<_> = (8..24).map(|x| Point::new(Vec2::new((x as f32 + 0.5) / 32.0, 0.5), 0.7)).collect();
    let mut settings = ShadowSettings { filter_radius: 6.0, ..settings(Representation::Variance, BLURRED) };
    let plain = Rig::new(&gpu, settings.clone(), &depths).visibility(&points);
    settings.bleed_reduction = 0.3;
    let cut = Rig::new(&gpu, settings, &depths).visibility(&points);
    for (plain, cut) in plain.into_iter().zip(cut) {
        let expected = ((plain - 0.3) / 0.7).max(0.0);
        assert!((cut - expected).abs() < 1e-5, "{cut} should be {expected}");
    }
}

#[test]
fn a_least_variance_lights_what_lies_close_behind_a_caster_as_chebyshev_says() {
    let gpu = device();
    let depths = Depths::new(16, 1, |_, _, _| 0.3);
    let behind = [0.0, 0.005, 0.02, 0.1, 0.5];
    let points = behind.map(|distance| Point::new(Vec2::splat(0.5), 0.3 + distance));
    for least in [0.0, 2e-5, 0.01] {
        let settings =
            ShadowSettings { min_variance: least, ..settings(Representation::Variance, Filter::None) };
        let found = Rig::new(&gpu, settings, &depths).visibility(&points);
        for (found, behind) in found.into_iter().zip(behind) {
            let expected = if behind == 0.0 { 1.0 } else { least / (least + behind * behind) };
            assert!((found - expected).abs() < 3e-3, "{least}, {behind} behind: {found}, not {expected}");
        }
    }
}

fn points_anywhere(count: usize) -> Vec<Point> {
    let mut random = Random::new(21);
    let mut pair = |scale: f32| Vec2::new(random.within(-scale, scale), random.within(-scale, scale));
    let places: Vec<_> = (0..count).map(|_| (pair(0.6) + 0.5, pair(0.05), pair(0.3))).collect();
    let points = places.into_iter().map(|(uv, x, y)| Point {
        footprint_x: x,
        footprint_y: y,
        ..Point::new(uv, random.within(0.0, 1.0))
    });
    points.collect()
}

#[test]
fn filtering_in_the_shader_equals_the_samplers() {
    let gpu = device();
    assert!(gpu.optional.float32_filterable, "nothing to compare with");
    let points = points_anywhere(1000);
    for representation in ALL {
        let settings = ShadowSettings {
            evsm_positive: 5.0,
            exponent: 5.0,
            ..settings(representation, Filter::GaussianMip)
        };
        let rig = Rig::new(&gpu, settings, &Depths::random(64, 1));
        let pairs =
            rig.visibility_filtered(&points, true).into_iter().zip(rig.visibility_filtered(&points, false));
        let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // GPUs blend in steps of 1/256 of the difference between two texels.
        let steps = if gpu.is_software() { 1e-5 } else { 2e-2 };
        assert!(most < steps, "{representation:?}: {most}");
    }
}

#[test]
fn guaranteed_webgpu_is_enough_for_maps_of_moments() {
    let (full, guaranteed) = (device(), device_guaranteed());
    assert!(!guaranteed.optional.float32_filterable);
    let points = points_anywhere(300);
    for representation in ALL {
        let settings = settings(representation, Filter::GaussianMip);
        let depths = Depths::new(48, 1, |_, x, y| if (x / 8 + y / 12) % 2 == 0 { 0.4 } else { 0.6 });
        let [a, b] = [&full, &guaranteed]
            .map(|gpu| Rig::new(gpu, settings.clone(), &depths).visibility_filtered(&points, false));
        assert_eq!(a, b, "{representation:?}");
    }
}

#[test]
fn a_footprint_along_one_side_averages_along_that_side() {
    let gpu = device();
    // Stripes of two texels along y, and nothing behind: the mean over x is a half.
    let depths = Depths::new(64, 1, |_, x, _| if x / 2 % 2 == 0 { 0.2 } else { 0.8 });
    let rig = Rig::new(&gpu, settings(Representation::Variance, Filter::Mip), &depths);
    // In the middle of a far stripe, 16 texels wide either way.
    let uv = Vec2::new(31.0, 32.0) / 64.0;
    let long = Vec2::splat(16.0 / 64.0);
    let thin = Vec2::splat(1.0 / 64.0);
    let point = |x: Vec2, y: Vec2| Point { footprint_x: x, footprint_y: y, ..Point::new(uv, 0.8) };
    let points = [
        point(long * Vec2::X, thin * Vec2::Y),
        point(thin * Vec2::X, long * Vec2::Y),
        point(Vec2::ZERO, Vec2::ZERO),
    ];
    let lit = rig.visibility(&points);
    assert!((lit[0] - 0.5).abs() < 0.07, "across the stripes: {}", lit[0]);
    assert!(lit[1] > 0.99, "along a stripe: {}", lit[1]);
    assert!(lit[2] > 0.99, "no footprint: {}", lit[2]);
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    moments: [f32; 4],
    linear: f32,
    pad: [f32; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    warped: [f32; 4],
    bound: f32,
    pad: [f32; 3],
}

fn bounds(settings: &ShadowSettings, cases: &[Case]) -> Vec<Answer> {
    let gpu = device();
    let bench = Bench::new(&gpu);
    bench.set_frame(&FrameData { shadow: settings.parameters(), ..FrameData::zeroed() });
    let shader = ("tests/moment_bounds.cs.wesl", include_str!("../wesl/moment_bounds.cs.wesl"));
    let constants = [("REPRESENTATION", f64::from(settings.representation as u32))];
    let buffer = bench.buffer("cases", cases);
    let work = (Dispatch::Threads([cases.len() as u32, 1, 1]), cases.len());
    bench.run(shader, &constants, None, &[("cases", (&buffer).into())], work)
}

/// Moments of every kind of nonsense: of any numbers, of any mixture, and of single depths with noise.
fn nonsense(settings: &ShadowSettings) -> Vec<Case> {
    let mut random = Random::new(3);
    let linear = |random: &mut Random| match random.within(0.0, 8.0) as u32 {
        0 => 0.0,
        1 => 1.0,
        _ => random.within(0.0, 1.0),
    };
    let depths: Vec<_> = (0..20_000).map(|_| linear(&mut random)).collect();
    let cases: Vec<_> = depths.iter().map(|&linear| Case { linear, ..Case::zeroed() }).collect();
    let warped: Vec<_> = bounds(settings, &cases).into_iter().map(|answer| answer.warped).collect();
    let mut all = Vec::new();
    for pair in warped.chunks(2) {
        let share = linear(&mut random);
        let noise = 10f32.powf(random.within(-8.0, 0.0));
        let mixed = std::array::from_fn(|i| {
            (share * pair[0][i] + (1.0 - share) * pair[1][i]) * (1.0 + noise * random.within(-1.0, 1.0))
        });
        all.push(Case { moments: mixed, linear: linear(&mut random), ..Case::zeroed() });
        let any = std::array::from_fn(|_| random.within(-1.0, 1.0) * 10f32.powf(random.within(-37.0, 38.0)));
        all.push(Case { moments: any, linear: linear(&mut random), ..Case::zeroed() });
        let small = std::array::from_fn(|_| random.within(-1.5, 1.5).round());
        all.push(Case { moments: small, linear: linear(&mut random), ..Case::zeroed() });
    }
    all
}

#[test]
fn every_bound_is_a_share_whatever_the_moments() {
    for representation in ALL {
        let exponents: &[[f32; 3]] = &[[80.0, 40.0, 20.0], [85.0, 42.0, 42.0], [1.0, 1.0, 1.0]];
        for &[exponent, evsm_positive, evsm_negative] in exponents {
            let settings = ShadowSettings {
                exponent,
                evsm_positive,
                evsm_negative,
                ..settings(representation, Filter::None)
            };
            let cases = nonsense(&settings);
            for (case, answer) in cases.iter().zip(bounds(&settings, &cases)) {
                assert!(
                    (0.0..=1.0).contains(&answer.bound),
                    "{representation:?}: {} of {case:?}",
                    answer.bound
                );
            }
        }
    }
}

#[test]
fn bounds_are_never_below_the_share_of_what_lies_behind() {
    let mut random = Random::new(9);
    for representation in ALL.into_iter().filter(|&kind| kind != Representation::Exponential) {
        let settings = settings(representation, Filter::None);
        // Mixtures of up to five depths.
        let mixtures: Vec<Vec<(f32, f32)>> = (0..2000)
            .map(|i| {
                let parts: Vec<_> =
                    (0..=i % 5).map(|_| (random.within(0.0, 1.0), random.within(0.01, 1.0))).collect();
                let sum: f32 = parts.iter().map(|(_, share)| share).sum();
                parts.into_iter().map(|(depth, share)| (depth, share / sum)).collect()
            })
            .collect();
        let depths: Vec<_> = mixtures.iter().flatten().collect();
        let cases: Vec<_> = depths.iter().map(|part| Case { linear: part.0, ..Case::zeroed() }).collect();
        let mut warped = bounds(&settings, &cases).into_iter().map(|answer| answer.warped);
        let receivers: Vec<_> = mixtures.iter().map(|_| random.within(0.0, 1.0)).collect();
        let cases: Vec<_> = mixtures
            .iter()
            .zip(&receivers)
            .map(|(parts, &linear)| {
                let moments = parts.iter().fold([0f64; 4], |sum, (_, share)| {
                    let one = warped.next().unwrap();
                    std::array::from_fn(|i| sum[i] + f64::from(*share) * f64::from(one[i]))
                });
                Case { moments: moments.map(|sum| sum as f32), linear, ..Case::zeroed() }
            })
            .collect();
        let lacking = mixtures.iter().zip(&receivers).zip(bounds(&settings, &cases)).map(
            |((parts, &receiver), answer)| {
                let lit: f32 =
                    parts.iter().filter(|(depth, _)| *depth >= receiver).map(|(_, share)| share).sum();
                lit - answer.bound
            },
        );
        let most = lacking.fold(0.0, f32::max);
        // Rounding, and for four moments the bias.
        assert!(most < 1e-5, "{representation:?}: {most} too little");
    }
}

#[test]
fn rounding_in_wide_blurs_darkens_nothing() {
    let gpu = device();
    for representation in ALL {
        let settings = ShadowSettings {
            filter_radius: 32.0,
            sigma: Sigma(Some(20.0)),
            ..settings(representation, BLURRED)
        };
        let depths = Depths::new(80, 40, |layer, _, _| 0.0123 + layer as f32 / 41.0);
        let rig = Rig::new(&gpu, settings, &depths);
        let points: Vec<_> = (0..40)
            .flat_map(|view| {
                (0..8).map(move |i| Point {
                    view,
                    ..Point::new(Vec2::splat((i as f32 + 0.4) / 8.0), 0.0123 + view as f32 / 41.0)
                })
            })
            .collect();
        let least = rig.visibility(&points).into_iter().fold(1.0, f32::min);
        assert!(least > 0.9999, "{representation:?}: {least}");
    }
}
