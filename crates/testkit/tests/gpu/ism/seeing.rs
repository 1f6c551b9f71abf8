//! What VPLs see, by their maps.

use super::*;
use chiaro_testkit::device;

const POINTS: usize = 8000;
/// No two places of the room are farther from each other.
const LARGEST_M: f32 = 3.5;
/// Half a side of the plate in the middle of the room, and of its shadow on the wall behind it.
const PLATE_M: f32 = 0.3;
const SHADOW_M: f32 = 0.6;

/// Places of the wall that a VPL in the middle of the opposite one looks at.
fn places() -> Vec<Place> {
    let axis = |i: u32| 2.0 * (i as f32 + 0.5) / 100.0 - 1.0;
    let at = |i: u32| Vec3::new(axis(i % 100), axis(i / 100), 1.0);
    (0..10_000).map(|i| Place::new(at(i), Vec3::NEG_Z, 0)).collect()
}

/// How far from the middle of the wall.
fn off(place: &Place) -> f32 {
    place.position_ws.truncate().abs().max_element()
}

fn room<'a>(gpu: &'a Gpu, levels: u32, with_plate: bool, vpls: &[Vpl]) -> Rig<'a> {
    let plate = with_plate.then_some([Vec3::ZERO, PLATE_M * Vec3::X, PLATE_M * Vec3::Y]);
    let rectangles: Vec<_> = walls().into_iter().chain(plate).collect();
    let (points, area) = scatter(&rectangles, POINTS, vpls.len());
    let settings =
        IndirectSettings { points_per_vpl: POINTS as u32, ..settings(IsmResolution::Side128, levels) };
    Rig::new(gpu, settings, (&points, area, LARGEST_M), vpls)
}

fn opposite() -> [Vpl; 1] {
    [vpl(Vec3::NEG_Z, Vec3::Z, 0)]
}

#[test]
fn an_empty_room_is_seen_everywhere() {
    let gpu = device();
    let vpls = [
        vpl(Vec3::NEG_Z, Vec3::Z, 0),
        vpl(Vec3::new(0.7, -0.8, -1.0), Vec3::Z, 1),
        vpl(Vec3::new(-1.0, 0.95, -0.5), Vec3::X, 2),
    ];
    // The nearer a wall, the more it is slanted.
    let most = [1e-3, 0.007, 0.012];
    let mut all = Vec::new();
    let mut weights = Vec::new();
    for [centre, a, b] in walls() {
        for (number, vpl) in (0..).zip(&vpls) {
            for i in 0..900 {
                let axis = |i: u32| 2.0 * (i as f32 + 0.5) / 30.0 - 1.0;
                let position_ws = centre + axis(i % 30) * a + axis(i / 30) * b;
                let from = Vec3::from(vpl.position_ws) - position_ws;
                let cosines = -from.dot(vpl.normal_ws()) * -from.dot(centre) / from.length_squared();
                all.push(Place::new(position_ws, -centre, number));
                weights.push(cosines.max(0.0) / from.length_squared().max(1e-2));
            }
        }
    }
    for levels in [0, 2, 7] {
        let rig = room(&gpu, levels, false, &vpls);
        let seen = rig.visibility(&all, false);
        for number in 0..3 {
            let here = || all.iter().zip(seen.iter().zip(&weights)).filter(|(place, _)| place.vpl == number);
            let light: f32 = here().map(|(_, (_, weight))| weight).sum();
            let arrives: f32 = here().map(|(_, (seen, weight))| seen * weight).sum();
            let lost = 1.0 - arrives / light;
            assert!(
                lost < most[number as usize],
                "{levels} levels, VPL {number}: {lost} of the light is lost"
            );
        }
    }
}

#[test]
fn nothing_is_seen_behind_its_plane() {
    let gpu = device();
    let rig = room(&gpu, 2, false, &[vpl(Vec3::ZERO, Vec3::Y, 0)]);
    let seen = |y: f32| Place::new(Vec3::new(0.4, y, -0.3), Vec3::NEG_Y, 0);
    for closer in [false, true] {
        assert_eq!(
            rig.visibility(&[seen(-0.5), seen(-1e-3), seen(0.0), seen(0.5)], closer),
            [0.0, 0.0, 0.0, 1.0]
        );
    }
}

#[test]
fn a_plate_shadows_what_is_behind_it_and_nothing_else() {
    let gpu = device();
    let places = places();
    // On the wall: a disc's radius, and a texel from its centre to its corner; both are seen slanted and twice as large.
    let radius = (24.36f32 / POINTS as f32 / PI).sqrt();
    let reach = 2.0 * (radius + 0.7072 * 4.0 / 128.0) / 0.9;
    for levels in [0, 2] {
        let rig = room(&gpu, levels, true, &opposite());
        let seen = rig.visibility(&places, false);
        let dark = |within: &dyn Fn(f32) -> bool| {
            let here: Vec<_> = places.iter().zip(&seen).filter(|(place, _)| within(off(place))).collect();
            here.iter().filter(|(_, seen)| **seen < 0.5).count() as f32 / here.len() as f32
        };
        let (inside, outside) = (dark(&|off| off < SHADOW_M - reach), dark(&|off| off > SHADOW_M + reach));
        // Gaps between discs let light through unless they are filled.
        let least = if levels == 0 { 0.6 } else { 0.93 };
        assert!(inside > least, "{levels} levels: {inside} of the shadow is dark");
        assert_eq!(outside, 0.0, "{levels} levels");
        let area = dark(&|_| true) / SHADOW_M.powi(2);
        assert!(levels == 0 || (area - 1.0).abs() < 0.12, "the shadow is {area} times as large as it is");
    }
}

#[test]
fn four_taps_soften_edges_and_change_no_mean() {
    let gpu = device();
    let rig = room(&gpu, 2, true, &opposite());
    let places = places();
    let (one, four) = (rig.visibility(&places, false), rig.visibility(&places, true));
    let mean = |seen: &[f32]| seen.iter().sum::<f32>() / seen.len() as f32;
    assert!((mean(&one) - mean(&four)).abs() < 0.005, "{} {}", mean(&one), mean(&four));
    assert!(one.iter().all(|seen| *seen == 0.0 || *seen == 1.0));
    let partly: Vec<_> = places.iter().zip(&four).filter(|(_, seen)| (0.01..0.99).contains(*seen)).collect();
    assert!(partly.len() > 100);
    assert!(places.iter().zip(&four).all(|(place, seen)| off(place) < 0.8 || *seen == 1.0));
}
