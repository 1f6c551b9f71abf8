//! Where candidates are placed.

use super::*;
use crate::chi_square::assert_drawn_as_expected;
use crate::culling::Random;
use chiaro::scene::LightKind;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, BufferReadback, ComputePipeline, Dispatch, Life, Recorder};
use chiaro_techniques::frame::LightData;
use chiaro_techniques::indirect::rsm::fit;
use chiaro_techniques::shaders;
use chiaro_testkit::{Bench, Stage, device, device_guaranteed};
use glam::Vec3;

/// A set of candidates: its number, and steps it has drifted.
type Set = (u32, u32);

/// How often each texel of some weights is chosen, of so many candidates, in some sets; by what a lumen of tiles brings the
/// picture, where that is told.
fn counted(
    views: &[RsmViewData],
    weights: &[f32],
    worths: Option<&[f32]>,
    (count, sets): (u32, &[Set]),
) -> Vec<u32> {
    let gpu = device_guaranteed();
    let bench = Bench::new(&gpu);
    let tiles = views[0].tiles;
    let mut words: Vec<u32> =
        weights.chunks(TILE_TEXELS).map(|tile| tile.iter().sum::<f32>().to_bits()).collect();
    assert_eq!(words.len(), tiles as usize);
    // What goes through as it is, the normal's word, is the texel's number.
    words
        .extend((0..).zip(weights).flat_map(|(i, weight)| [0.5f32.to_bits(), i, u32::MAX, weight.to_bits()]));
    let rsm = bench.buffer("rsm", &words);
    let of_views = bench.buffer("rsm_views", views);
    let make = |name, bytes| Buffer::new(&gpu, name, Life::Kept, bytes, BufferUsages::STORAGE);
    let sums = make("rsm_sums", 16 * u64::from(tiles.next_power_of_two()));
    let tile_worths = bench.buffer("tile_worths", worths.unwrap_or(&[0.0]));
    let of_candidates = make("worths", 8 * u64::from(count));
    let candidates = make("candidates", u64::from(count) * size_of::<Vpl>() as u64);
    let frame_layout = &bench.kit.frame_layout;
    let pipeline = |entry, layouts: &[_], constants: &[_]| {
        ComputePipeline::new(&gpu, &bench.kit.library, &shaders::plain(entry), layouts, constants).unwrap()
    };
    let scan = [0.0, 1.0].map(|top| pipeline("indirect/vpls/scan.cs.wesl", &[], &[("TOP", top)]));
    let place = pipeline("indirect/vpls/place.cs.wesl", &[frame_layout], &[]);
    let mut found = vec![0; weights.len()];
    let mut recorder = Recorder::new(&gpu, false);
    for &(round, drift) in sets {
        let data = Sampling {
            tiles,
            views: views.len() as u32,
            candidates: count,
            round,
            drift,
            stride: 1,
            by_view: u32::from(worths.is_some()),
            ..Sampling::default()
        };
        let uniform = bench.buffer("sampling", &[data]);
        let sampling = ("sampling", (&uniform).into());
        let mut frame = recorder.begin();
        let lit = LightData { intensity: [1.0; 3], direction_ws: [0.0, -1.0, 0.0], ..Zeroable::zeroed() };
        bench.frame.upload(&mut frame, &Zeroable::zeroed(), &[lit], &[]);
        let tile_worths = ("tile_worths", (&tile_worths).into());
        let binds = [sampling, ("rsm", (&rsm).into()), ("rsm_sums", (&sums).into()), tile_worths];
        let below = Dispatch::Groups([tiles.next_power_of_two().div_ceil(512), 1, 1]);
        frame.compute("test/scan", &scan[0], &[], &binds, below);
        frame.compute("test/scan", &scan[1], &[], &binds, Dispatch::Groups([1, 1, 1]));
        let binds = [
            sampling,
            ("rsm", (&rsm).into()),
            ("rsm_sums", (&sums).into()),
            ("rsm_views", (&of_views).into()),
            ("candidates", (&candidates).into()),
            ("worths", (&of_candidates).into()),
        ];
        let work = Dispatch::Threads([count, 1, 1]);
        frame.compute("test/place", &place, &[bench.frame.group()], &binds, work);
        frame.submit();
        let bytes = BufferReadback::start(&gpu, &candidates).wait(&gpu).unwrap();
        let all: Vec<Vpl> = bytemuck::pod_collect_to_vec(&bytes);
        assert!(all.iter().all(|vpl| vpl.flux[0] > 0.0), "some found nothing");
        for vpl in all {
            found[vpl.normal as usize] += 1;
        }
    }
    found
}

#[test]
fn texels_are_chosen_as_often_as_their_weights_say() {
    const MANY: u32 = 65_536;
    // Three suns, of which one has no power of two texels a side.
    let suns = [LightData { direction_ws: [0.0, -1.0, 0.0], intensity: [1.0; 3], ..Zeroable::zeroed() }; 3];
    let bounds = (Vec3::NEG_ONE, Vec3::ONE);
    let views: Vec<_> = fit(&suns, (bounds, &[]), 72, 0)
        .into_iter()
        .map(|view| RsmViewData { light: 0, ..view.data })
        .collect();
    let texels = views[0].tiles as usize * TILE_TEXELS;
    let mut random = Random::new(9);
    let weights: Vec<_> = (0..texels)
        .map(|i| {
            let whole_tile = i / TILE_TEXELS % 5 != 1;
            let lit = whole_tile && random.within(0.0, 1.0) < 0.3;
            if lit { random.within(0.0, 1.0).powi(8) * 40.0 } else { 0.0 }
        })
        .collect();
    let sets = [(0, 0), (1, 0), (7, 300)];
    // Worths have nothing to do with weights, but for being 0 where there is no light.
    let worth_of = |i: usize| if i.is_multiple_of(7) || i % 5 == 1 { 0.0 } else { (i % 11) as f32 };
    let worths: Vec<_> = (0..texels / TILE_TEXELS).map(worth_of).collect();
    let fluxes: Vec<f64> =
        weights.chunks(TILE_TEXELS).map(|tile| tile.iter().map(|weight| f64::from(*weight)).sum()).collect();
    let (total, worth) = (fluxes.iter().sum::<f64>(), worths.iter().copied().map(f64::from).sum::<f64>());
    for by in [None, Some(&worths[..])] {
        let of_a_lumen: Option<Vec<f32>> = by.map(|worths| {
            let each = worths.iter().zip(&fluxes);
            each.map(|(worth, flux)| if *flux > 0.0 { worth / *flux as f32 } else { -1.0 }).collect()
        });
        let found = counted(&views, &weights, of_a_lumen.as_deref(), (MANY, &sets));
        let expected = |i: usize| {
            let (tile, weight) = (i / TILE_TEXELS, f64::from(weights[i]));
            let by_worth = by.map(|worths| {
                let chance = 0.8 * f64::from(worths[tile]) / worth + 0.2 * fluxes[tile] / total;
                chance * weight / fluxes[tile].max(f64::MIN_POSITIVE)
            });
            sets.len() as f64 * f64::from(MANY) * by_worth.unwrap_or(weight / total)
        };
        let expected: Vec<_> = (0..texels).map(expected).collect();
        for (i, (&found, &weight)) in found.iter().zip(&weights).enumerate() {
            assert!(weight > 0.0 || found == 0, "{i} has no light");
            // Of each of two halves of the candidates a tile has its share to within two, and a texel of those to within two.
            let off = (f64::from(found) - expected[i]).abs();
            assert!(off <= 6.0 * sets.len() as f64, "{i}: {found}, not {}", expected[i]);
        }
        let cells = found.iter().zip(&expected).map(|(&found, &expected)| (f64::from(found), expected));
        assert_drawn_as_expected(cells, &format!("texels by {by:?}"));
    }
}

#[test]
fn a_single_lit_texel_is_always_found() {
    let sun = LightData { direction_ws: [0.0, -1.0, 0.0], intensity: [1.0; 3], ..Zeroable::zeroed() };
    let views: Vec<_> =
        fit(&[sun], ((Vec3::NEG_ONE, Vec3::ONE), &[]), 64, 0).iter().map(|view| view.data).collect();
    for at in [0, 63, 64, 2000, 4095] {
        let mut weights = vec![0.0; 4096];
        weights[at] = 3e-7;
        assert_eq!(counted(&views, &weights, None, (65_536, &[(0, 0), (3, 5)]))[at], 2 * 65_536);
    }
}

#[test]
fn few_candidates_are_where_they_are_expected_over_many_sets_and_few_move_from_step_to_step() {
    const FEW: u32 = 32;
    const SETS: u32 = 2048;
    let sun = LightData { direction_ws: [0.0, -1.0, 0.0], intensity: [1.0; 3], ..Zeroable::zeroed() };
    let views: Vec<_> =
        fit(&[sun], ((Vec3::NEG_ONE, Vec3::ONE), &[]), 64, 0).iter().map(|view| view.data).collect();
    let mut random = Random::new(4);
    // One lit texel a tile, so that texels are tiles.
    let of_tile: Vec<_> = (0..64).map(|_| random.within(0.0, 1.0).powi(3)).collect();
    let weights: Vec<_> = (0..4096).map(|i| if i % 64 == 5 { of_tile[i / 64] } else { 0.0 }).collect();
    let sets: Vec<_> = (0..SETS).map(|round| (round, 0)).collect();
    let found = counted(&views, &weights, None, (FEW, &sets));
    let total: f32 = of_tile.iter().sum();
    let expected = |tile: usize| f64::from(SETS * FEW) * f64::from(of_tile[tile] / total);
    for tile in 0..64 {
        let (found, expected) = (f64::from(found[tile * 64 + 5]), expected(tile));
        // A set has its share to within one; three deviations if sets had nothing in common, and they have.
        let off = 3.0 * (f64::from(SETS) * 0.25).sqrt() + 0.02 * expected;
        assert!((found - expected).abs() < off, "tile {tile}: {found}, not {expected}");
    }
    // From one step to the next most stay; after many, few have.
    let at = |drift| counted(&views, &weights, None, (FEW, &[(0, drift)]));
    let moved = |a: &[u32], b: &[u32]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).sum::<u32>() / 2;
    let steps: Vec<_> = (0..8).map(at).collect();
    let mean = steps.windows(2).map(|pair| moved(&pair[0], &pair[1])).sum::<u32>() / 7;
    let far = moved(&steps[0], &at(64));
    assert!(mean <= FEW / 8 && far >= FEW / 4, "{mean} move a step, {far} in 64");
}

#[test]
fn when_weights_change_a_little_few_candidates_move() {
    const MANY: u32 = 1024;
    let sun = LightData { direction_ws: [0.0, -1.0, 0.0], intensity: [1.0; 3], ..Zeroable::zeroed() };
    let views: Vec<_> =
        fit(&[sun], ((Vec3::NEG_ONE, Vec3::ONE), &[]), 256, 0).iter().map(|view| view.data).collect();
    // More tiles than one workgroup sums up.
    assert_eq!(views[0].tiles, 1024);
    let mut random = Random::new(5);
    let weights: Vec<_> = (0..65_536).map(|_| random.within(0.5, 1.0)).collect();
    // The first half of the map gets 2 % brighter: 1 % of all candidates are to be elsewhere.
    let mut brighter = weights.clone();
    brighter[..32_768].iter_mut().for_each(|weight| *weight *= 1.02);
    let tiles = |weights: &[f32]| -> Vec<u32> {
        counted(&views, weights, None, (MANY, &[(0, 0)])).chunks(64).map(|tile| tile.iter().sum()).collect()
    };
    let (before, after) = (tiles(&weights), tiles(&brighter));
    let moved = before.iter().zip(&after).map(|(a, b)| a.abs_diff(*b)).sum::<u32>() / 2;
    assert!(moved <= MANY / 40, "{moved} of {MANY} went elsewhere");
}

/// A floor with a box on it, in a hall, and lights of different colours.
fn hall(lights: &[LightKind]) -> Stage {
    let mut stage = Stage::floor(0.7);
    let grey = stage.lambert(0.3);
    stage.cuboid(Vec3::new(0.5, 0.5, 0.0), Vec3::splat(0.5), grey);
    stage.quad(Vec3::new(0.0, 2.0, -3.0), Vec3::X * 4.0, Vec3::Y * 2.0, grey);
    for (i, kind) in lights.iter().enumerate() {
        let at = Vec3::new(-1.0 + 0.7 * i as f32, 2.0, 1.0);
        stage.light(*kind, 5.0, None, at, Vec3::new(0.2, -1.0, -0.3));
        stage.scene.lights[i].color = [Vec3::new(1.0, 0.5, 0.25), Vec3::new(0.2, 1.0, 0.4), Vec3::ONE][i % 3];
    }
    stage
}

const SPOT: LightKind = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 };

#[test]
fn candidates_carry_the_flux_of_the_maps() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    let all = [LightKind::Directional, SPOT, LightKind::Point];
    for lights in [&all[..1], &all[1..2], &all[2..], &all, &[SPOT, SPOT, LightKind::Point]] {
        let scene = studio.load(&hall(lights).scene);
        for sampling in ["view", "importance", "halton"] {
            studio.set(settings(&[("indirect.sampling", sampling), ("indirect.vpls", "1000")]));
            let placed = Placed::new(&mut studio, &scene);
            let name = format!("{sampling}, {lights:?}");
            let (total, sum) = (placed.total(), placed.candidates.iter().map(luminance).sum::<f64>());
            let tiles: f64 =
                placed.rsm[..placed.tiles()].iter().map(|bits| f64::from(f32::from_bits(*bits))).sum();
            assert!((tiles / total - 1.0).abs() < 1e-4, "{name}: tiles have {tiles} of {total}");
            // By view light from where it matters less is carried by few.
            let most = match sampling {
                "importance" => 0.01,
                "halton" => 0.05,
                _ => 0.3,
            };
            assert!((sum / total - 1.0).abs() < most, "{name}: {sum} of {total} lm");
            if sampling == "importance" {
                let each = total / placed.candidates.len() as f64;
                for vpl in &placed.candidates {
                    assert!((luminance(vpl) / each - 1.0).abs() < 2e-3, "{name}: {vpl:?}, not {each} lm");
                }
            }
            if let [_] = lights {
                let [r, g, b] = placed.vpls[0].flux;
                assert!((g / r - 0.5).abs() < 2e-3 && (b / r - 0.25).abs() < 2e-3, "{name}: {r} {g} {b}");
            }
            let kept: f64 = placed.vpls.iter().map(luminance).sum();
            let most = if sampling == "view" { 0.3 } else { 1e-5 };
            assert!((kept / sum - 1.0).abs() < most, "{name}: {kept} of {sum} lm are kept");
        }
    }
}

#[test]
fn over_many_seeds_the_kept_flux_is_that_of_the_maps() {
    const MANY: u32 = 64;
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings(&[]));
    let scene = studio.load(&hall(&[LightKind::Directional, SPOT, LightKind::Point]).scene);
    let shares: Vec<_> = (0..MANY)
        .map(|seed| {
            let few = [("indirect.vpls", "256"), ("indirect.rsm_resolution", "64")];
            studio.set(Settings { seed, ..settings(&few) });
            let placed = Placed::new(&mut studio, &scene);
            placed.vpls.iter().map(luminance).sum::<f64>() / placed.total()
        })
        .collect();
    let mean = shares.iter().sum::<f64>() / f64::from(MANY);
    let variance = shares.iter().map(|share| (share - mean).powi(2)).sum::<f64>() / f64::from(MANY - 1);
    let error = (variance / f64::from(MANY)).sqrt();
    assert!(error > 0.0 && (mean - 1.0).abs() < 4.0 * error + 1e-3 && error < 0.05, "{mean} ± {error}");
}
