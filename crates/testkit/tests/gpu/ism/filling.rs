//! Holes between points, filled.

use super::*;
use crate::culling::Random;
use chiaro_testkit::{device, device_guaranteed};

const FAR: f32 = 4.0;
const SIDE: u32 = 32;

/// The tile of a pattern, before and after.
fn filled(levels: u32, texels: &[(u32, u32, f32)]) -> [Vec<u32>; 2] {
    filled_with(texels, &settings(IsmResolution::Side32, levels))
}

fn filled_with(texels: &[(u32, u32, f32)], settings: &IndirectSettings) -> [Vec<u32>; 2] {
    let gpu = device();
    let points = pattern(SIDE, texels);
    let settings = IndirectSettings { points_per_vpl: points.len() as u32, ..settings.clone() };
    let vpls = [vpl(Vec3::ZERO, Vec3::Z, 0)];
    let none = IndirectSettings { levels: 0, ..settings.clone() };
    let mut rig = Rig::new(&gpu, none, (&points, SPECK_M2, FAR), &vpls);
    let before = rig.words();
    assert_eq!(before.iter().filter(|word| **word != EMPTY).count(), texels.len());
    rig.set(settings, 1);
    [before, rig.words()]
}

/// All texels of a square that a rule keeps.
fn square(from: u32, to: u32, keep: impl Fn(u32, u32) -> bool) -> Vec<(u32, u32, f32)> {
    let all = (from..to).flat_map(|y| (from..to).map(move |x| (x, y)));
    all.filter(|(x, y)| keep(*x, *y)).map(|(x, y)| (x, y, 2.0)).collect()
}

fn at(words: &[u32], x: u32, y: u32) -> Option<f32> {
    depth_of(words[(y * SIDE + x) as usize]).map(|depth| FAR * depth)
}

fn assert_near(found: Option<f32>, expected: f32) {
    assert!(
        found.is_some_and(|found| (found / expected - 1.0).abs() < 2.0 * STEP),
        "{found:?}, not {expected}"
    );
}

#[test]
fn a_hole_is_closed_and_what_is_there_stays() {
    let [before, after] = filled(1, &square(10, 22, |x, y| (x, y) != (15, 15)));
    assert_near(at(&after, 15, 15), 2.0);
    assert_eq!(after[(15 * SIDE + 15) as usize] & NO_INDEX, NO_INDEX);
    for (before, after) in before.iter().zip(&after) {
        assert!(*before == EMPTY || before == after);
    }
}

#[test]
fn a_checkerboard_is_closed() {
    let [_, after] = filled(1, &square(10, 22, |x, y| (x + y) % 2 == 0));
    for y in 10..22 {
        for x in 10..22 {
            assert_near(at(&after, x, y), 2.0);
        }
    }
}

#[test]
fn each_level_closes_holes_twice_as_large() {
    // A hole of 8², whose middle is 4 texels from what is there.
    let texels = square(5, 27, |x, y| !(12..20).contains(&x) || !(12..20).contains(&y));
    let closed = |levels| {
        (12..20).flat_map(|y| (12..20).map(move |x| (x, y))).all({
            let [_, after] = filled(levels, &texels);
            move |(x, y)| at(&after, x, y).is_some()
        })
    };
    assert_eq!([1, 2, 3, 4].map(closed), [false, false, true, true]);
}

#[test]
fn weights_are_those_of_biquadratic_splines() {
    // Quads at different distances, near enough to each other to be averaged as they are.
    let quad = |x: u32, y: u32| 1.0 + 0.02 * (x / 2 % 4) as f32 + 0.08 * (y / 2 % 4) as f32;
    let texels: Vec<_> =
        square(8, 24, |x, y| (x, y) != (14, 15)).iter().map(|&(x, y, _)| (x, y, quad(x, y))).collect();
    let [_, after] = filled(1, &texels);
    // 14 is even, so the quad to the left counts, and 15 odd, so the one below.
    let expected = (9.0 * quad(14, 14) + 3.0 * quad(12, 14) + 3.0 * quad(14, 16) + quad(12, 16)) / 16.0;
    assert_near(at(&after, 14, 15), expected);
}

#[test]
fn an_empty_tile_stays_empty_and_none_fills_another() {
    let gpu = device();
    // The right edge of the first tile, all of the last; between them nothing.
    let mut points = pattern(SIDE, &(12..20).map(|y| (31, y, 2.0)).collect::<Vec<_>>());
    points.extend(pattern(SIDE, &[(16, 16, -2.0); 8]));
    points.extend(pattern(SIDE, &(12..20).map(|y| (0, y, 2.0)).collect::<Vec<_>>()));
    let vpls: Vec<_> = (0..3).map(|subset| vpl(Vec3::ZERO, Vec3::Z, subset)).collect();
    for levels in 0..6 {
        let settings = IndirectSettings { points_per_vpl: 8, ..settings(IsmResolution::Side32, levels) };
        let rig = Rig::new(&gpu, settings, (&points, SPECK_M2, FAR), &vpls);
        let words = rig.words();
        let tiles: Vec<_> = words.chunks(1024).map(|tile| tile.iter().any(|word| *word != EMPTY)).collect();
        assert_eq!(tiles, [true, false, true]);
        // Nothing comes round from the other side of a tile or a row; all levels fill everything.
        let reach = (2 << levels) - 2;
        for y in 0..SIDE {
            for x in 0..SIDE.saturating_sub(1 + reach) {
                assert_eq!(at(&words[..1024], x, y), None, "{levels} levels: {x} {y}");
                assert_eq!(at(&words[2048..], SIDE - 1 - x, y), None, "{levels} levels: {x} {y}");
            }
        }
        assert_eq!(words[..1024].iter().all(|word| *word != EMPTY), levels == 5);
    }
}

#[test]
fn what_is_far_behind_counts_not_and_is_closed_where_it_shows_through() {
    // A wall at 1 m with every fifth texel missing, through which one at 3 m shows.
    let through = |x: u32, y: u32| (x + 2 * y).is_multiple_of(5);
    let texels: Vec<_> = square(8, 24, |_, _| true)
        .into_iter()
        .map(|(x, y, _)| (x, y, if through(x, y) { 3.0 } else { 1.0 }))
        .collect();
    let with = |pull_threshold, push_threshold| {
        let settings =
            IndirectSettings { pull_threshold, push_threshold, ..settings(IsmResolution::Side32, 2) };
        filled_with(&texels, &settings)
    };
    let [before, after] = with(0.1, 0.2);
    for y in 8..24 {
        for x in 8..24 {
            assert_near(at(&after, x, y), 1.0);
            let index = (y * SIDE + x) as usize;
            assert_eq!(after[index] & NO_INDEX == NO_INDEX, through(x, y));
            assert!(through(x, y) || before[index] == after[index]);
        }
    }
    // Without the second threshold nothing that is there changes.
    let [before, after] = with(0.1, 0.0);
    assert!(before.iter().zip(&after).all(|(before, after)| *before == EMPTY || before == after));
    // Without the first the coarser level is a blend, which fills what is empty around the wall.
    let [_, blended] = with(10.0, 0.0);
    let around = |words: &[u32]| at(words, 7, 15).unwrap();
    assert!(around(&blended) > 1.2 && (around(&after) - 1.0).abs() < 0.01, "{}", around(&blended));
}

#[test]
fn what_is_in_front_gets_no_rim_and_keeps_wide_gaps() {
    // A square at 1 m wherever its edges are, with a slit of four texels, before a wall at 3 m.
    for from in 10..14 {
        let is_front = |x: u32, y: u32| {
            (from..from + 10).contains(&x)
                && (from..from + 10).contains(&y)
                && !(from + 3..from + 7).contains(&x)
        };
        let all = square(5, 27, |_, _| true).into_iter();
        let texels: Vec<_> = all.map(|(x, y, _)| (x, y, if is_front(x, y) { 1.0 } else { 3.0 })).collect();
        let [before, after] = filled(1, &texels);
        assert!(before.iter().zip(&after).all(|(before, after)| *before == EMPTY || before == after));
        let [before, after] = filled(2, &texels);
        for &(x, y, _) in &texels {
            let index = (y * SIDE + x) as usize;
            let in_slit = (from..from + 10).contains(&y) && (from + 3..from + 7).contains(&x);
            assert!(in_slit || before[index] == after[index], "{from}: {x} {y}");
        }
    }
}

/// Pull-push of one tile on the CPU: depths of 0..1, 2 where there is nothing.
fn twin(side: u32, depths: &[f32], settings: &IndirectSettings) -> Vec<f32> {
    let levels = settings.levels.min(side.ilog2());
    let limit = |base: f32, level: u32| 1.0 + base * (1 << level) as f32;
    let mut all = vec![depths.to_vec()];
    for level in 1..=levels {
        let (side, finer) = (side >> level, &all[level as usize - 1]);
        let texel = |i: u32| {
            let first = (2 * (i / side) * 2 * side + 2 * (i % side)) as usize;
            let below = first + 2 * side as usize;
            let four = [finer[first], finer[first + 1], finer[below], finer[below + 1]];
            let nearest = four.into_iter().fold(2.0, f32::min);
            let kept = |d: &f32| *d < 2.0 && *d <= nearest * limit(settings.pull_threshold, level - 1);
            let kept: Vec<_> = four.into_iter().filter(kept).collect();
            if kept.is_empty() { 2.0 } else { kept.iter().sum::<f32>() / kept.len() as f32 }
        };
        all.push((0..side * side).map(texel).collect());
    }
    for level in (0..levels).rev() {
        let coarser = all[level as usize + 1].clone();
        let (side, half) = ((side >> level) as i32, (side >> (level + 1)) as i32);
        for (i, depth) in (0..).zip(&mut all[level as usize]) {
            let near = [(i % side) / 2, i / side / 2];
            let far = [near[0] + (i % side % 2) * 2 - 1, near[1] + (i / side % 2) * 2 - 1];
            let places = [
                (near[0], near[1], 9.0),
                (far[0], near[1], 3.0),
                (near[0], far[1], 3.0),
                (far[0], far[1], 1.0),
            ];
            let there = |(x, y, weight): (i32, i32, f32)| {
                let inside = (0..half).contains(&x) && (0..half).contains(&y);
                let depth = if inside { coarser[(y * half + x) as usize] } else { 2.0 };
                (depth < 2.0).then_some((weight, depth))
            };
            let there: Vec<_> = places.into_iter().filter_map(there).collect();
            let sum: f32 = there.iter().map(|(weight, _)| weight).sum();
            let mean = there.iter().map(|(weight, depth)| weight * depth).sum::<f32>() / sum.max(1.0);
            let push = settings.push_threshold;
            let farthest = there.iter().fold(0.0f32, |most, (_, depth)| most.max(*depth));
            let behind = push > 0.0 && *depth > farthest * limit(push, level);
            if sum > 0.0 && (*depth >= 2.0 || behind) {
                *depth = mean;
            }
        }
    }
    all.swap_remove(0)
}

#[test]
fn every_size_and_number_of_levels_is_what_the_cpu_fills() {
    let gpu = device_guaranteed();
    let mut random = Random::new(11);
    // A room with sparse points and two more things in it, seen twice.
    let mut points = Vec::new();
    for _ in 0..2 * 600 {
        let mut axis = || random.within(-1.0, 1.0);
        let to = Vec3::new(axis(), axis(), axis().abs() + 0.02).normalize();
        let distance = if to.x > 0.3 {
            0.9
        } else if to.y > 0.2 {
            1.5
        } else {
            3.0 + to.x
        };
        points.push(Point { position: distance * to, normal: to, exponent: 0 });
    }
    let vpls = [vpl(Vec3::ZERO, Vec3::Z, 0), vpl(Vec3::ZERO, Vec3::Z, 1)];
    for (resolution, all) in [
        (IsmResolution::Side32, 5),
        (IsmResolution::Side64, 6),
        (IsmResolution::Side128, 7),
        (IsmResolution::Side256, 8),
    ] {
        let side = resolution.texels();
        let with = |levels| IndirectSettings { points_per_vpl: 600, ..settings(resolution, levels) };
        let mut rig = Rig::new(&gpu, with(0), (&points, SPECK_M2, FAR), &vpls);
        let before = rig.words();
        let depths: Vec<_> = before.iter().map(|word| depth_of(*word).unwrap_or(2.0)).collect();
        for levels in [0, 1, 2, all - 1, all] {
            rig.set(with(levels), 2);
            let after = rig.words();
            let tile = side.pow(2) as usize;
            let expected = depths.chunks(tile).flat_map(|tile| twin(side, tile, &with(levels)));
            let mut wrong = 0;
            for ((before, after), expected) in before.iter().zip(&after).zip(expected) {
                let found = depth_of(*after).unwrap_or(2.0);
                let same = (found / expected - 1.0).abs() < 2.0 * STEP;
                // What was replaced has no point any more, what was not is as it was.
                let named = before == after || after & NO_INDEX == NO_INDEX;
                wrong += usize::from(!same || !named);
            }
            // A depth at a threshold may go either way by rounding.
            assert!(wrong * 1000 <= after.len(), "{side}², {levels} levels: {wrong} of {}", after.len());
            if levels == 0 {
                assert!(after == before);
            }
        }
    }
}

#[test]
fn pictures_show_tiles_before_and_after() {
    let gpu = device();
    let points = pattern(SIDE, &square(10, 22, |x, y| (x, y) != (15, 15)));
    let settings =
        IndirectSettings { points_per_vpl: points.len() as u32, ..settings(IsmResolution::Side32, 2) };
    let rig = Rig::new(&gpu, settings, (&points, SPECK_M2, FAR), &[vpl(Vec3::ZERO, Vec3::Z, 0)]);
    let [before, after] = [0, 1].map(|which| rig.picture(which));
    assert_eq!(before.len(), 1024);
    assert_eq!(before[15 * 32 + 15], 0.0);
    assert!((after[15 * 32 + 15] - 2.0).abs() < 2e-3 && (before[15 * 32 + 14] - 2.0).abs() < 2e-3);
}
