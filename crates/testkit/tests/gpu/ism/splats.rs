//! The paraboloid map, words of the atlas, and points drawn into it.

use super::*;
use crate::culling::Random;
use chiaro_testkit::{device, device_guaranteed};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    back: Vec3,
    word: u32,
    at: Vec2,
    depth: f32,
    radius: f32,
    normal: Vec3,
    packed: u32,
    centre: Vec2,
    reserved: Vec2,
}

/// Of directions of the upper half, and numbers 0..1.
fn answers(gpu: &Gpu, input: &[[f32; 4]]) -> Vec<Answer> {
    let bench = Bench::new(gpu);
    let buffer = bench.buffer("input", input);
    let shader = ("tests/ism_functions.cs.wesl", include_str!("../wesl/ism_functions.cs.wesl"));
    let work = (Dispatch::Threads([input.len() as u32, 1, 1]), input.len());
    bench.run(shader, &[], None, &[("input", (&buffer).into())], work)
}

fn random_directions(count: usize) -> Vec<[f32; 4]> {
    let mut random = Random::new(3);
    let mut direction = || {
        let (z, turn) = (random.within(0.0, 1.0), random.within(0.0, 2.0 * PI));
        let r = (1.0 - z * z).sqrt();
        // Numbers of all magnitudes.
        [r * turn.cos(), r * turn.sin(), z, random.within(-12.0, 0.0).exp2()]
    };
    (0..count).map(|_| direction()).collect()
}

#[test]
fn the_paraboloid_map_and_its_inverse_caps_words_and_normals_are_what_they_are_called() {
    let gpu = device();
    let input = random_directions(8192);
    let answers = answers(&gpu, &input);
    for (given, answer) in input.iter().zip(&answers) {
        let (w, number) = (Vec3::from_slice(given), given[3]);
        let at = w.truncate() / (1.0 + w.z);
        assert!(at.distance(answer.at) < 1e-6 && answer.at.length() <= 1.0 + 1e-6, "{w}: {}", answer.at);
        assert!(w.distance(answer.back) < 1e-6, "{w} became {}", answer.back);
        // Every direction on the cap's rim is on the circle.
        let [side, other, _] = frame(w).to_cols_array_2d().map(Vec3::from);
        for turn in 0..6 {
            let turn = turn as f32;
            let rim = (w + number * (turn.cos() * side + turn.sin() * other)).normalize();
            let off = (rim.truncate() / (1.0 + rim.z)).distance(answer.centre) - answer.radius;
            assert!(off.abs() < 3e-6, "{w}, {number}: {off}");
        }
        assert!((answer.depth / number - 1.0).abs() <= 0.5 * STEP, "{number} became {}", answer.depth);
        assert_eq!(Some(answer.depth), depth_of(answer.word));
        let record = Vpl::new(Vec3::ZERO, w, Vec3::ONE, 0);
        assert!(record.normal_ws().distance(answer.normal) < 7e-5, "{w}: {}", answer.normal);
        // Drivers round halves either way.
        let same = |shift: u32| (record.normal >> shift) as i16 - (answer.packed >> shift) as i16;
        assert!(same(0).abs() <= 1 && same(16).abs() <= 1, "{w}");
    }
}

#[test]
fn smaller_words_are_nearer_and_then_of_the_lower_number() {
    let gpu = device();
    let mut input = random_directions(2048);
    input.extend([[0.0, 0.0, 1.0, 0.5]; 64]);
    input.extend([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 1.0, 2.0]]);
    let answers = answers(&gpu, &input);
    let mut words: Vec<_> = answers.iter().map(|answer| answer.word).zip(0..).collect();
    words.sort_unstable();
    assert!(words.iter().all(|(word, _)| *word < EMPTY));
    for pair in words.windows(2) {
        let ([(a, i), (b, j)], number) = ([pair[0], pair[1]], |i: u32| input[i as usize][3]);
        assert_eq!((a & NO_INDEX, b & NO_INDEX), (i, j));
        if a >> 13 == b >> 13 {
            assert!(i < j && number(i).min(1.0) <= number(j).min(1.0) * (1.0 + STEP));
        } else {
            assert!(number(i) < number(j), "{} {}", number(i), number(j));
        }
    }
}

/// A tile drawn on the CPU.
fn drawn(resolution: u32, points: &[Point], vpl: &Vpl, (point_area, largest): (f32, f32)) -> Vec<u32> {
    let mut tile = vec![EMPTY; resolution.pow(2) as usize];
    let local = frame(vpl.normal_ws()).transpose();
    for (index, point) in (0u32..).zip(points) {
        let point_area = point_area * 4f32.powi(point.exponent as i32);
        let to = local * (point.position - Vec3::from(vpl.position_ws));
        if to.z <= 0.1 * (point_area / PI).sqrt() {
            continue;
        }
        let (d, w) = (to.length(), to.normalize());
        let normal = local * point.normal;
        let cosine = normal.dot(w).abs();
        let alpha = half_angle_tan(point_area, cosine, d).min(0.5 * (1.0 + w.z)).atan();
        let half = 0.5 * resolution as f32;
        let centre = (w.truncate() / (w.z + alpha.cos()) + 1.0) * half;
        let radius = alpha.sin() / (w.z + alpha.cos()) * half;
        let reach = (point_area / PI).sqrt().min(0.5 * d);
        for (i, texel) in (0..).zip(&mut tile) {
            let at = Vec2::new((i % resolution) as f32, (i / resolution) as f32);
            if (at + 0.5).distance(centre) <= radius || at == centre.floor() {
                let along = normal.dot(direction(resolution, at + 0.5));
                let plane = normal.dot(to);
                let met = if plane * along > 0.0 { (plane / along).max(d - reach) } else { largest };
                let depth = if along.abs() > 1e-3 { met } else { d };
                let word = (depth / largest).min(1.0).to_bits() >> 12 << 13 | index;
                *texel = word.min(*texel);
            }
        }
    }
    tile
}

#[test]
fn tiles_are_what_the_cpu_draws_wherever_their_blocks_of_points_begin() {
    let gpu = device_guaranteed();
    let (mut points, area) = scatter(&walls(), 100, 5);
    for (point, exponent) in points.iter_mut().zip((0..4).cycle()) {
        point.exponent = exponent;
    }
    // Three blocks of 150 points, and a fourth that goes on with the first.
    let axis = |x: f32, y: f32, z: f32| Vec3::new(x, y, z).normalize();
    let vpls = [
        vpl(Vec3::new(0.1, -0.2, -1.0), Vec3::Z, 0),
        vpl(Vec3::new(0.3, 0.1, 0.2), axis(0.3, -0.8, -0.4), 3),
        vpl(Vec3::new(-0.9, 0.2, 0.2), axis(1.0, 0.1, 0.0), 2),
    ];
    for resolution in
        [IsmResolution::Side32, IsmResolution::Side64, IsmResolution::Side128, IsmResolution::Side256]
    {
        let settings = IndirectSettings { points_per_vpl: 150, ..settings(resolution, 0) };
        let rig = Rig::new(&gpu, settings, (&points, area, 4.0), &vpls);
        let side = resolution.texels();
        let words = rig.words();
        let mut wrong = 0;
        for (vpl, tile) in vpls.iter().zip(words.chunks(side.pow(2) as usize)) {
            let block: Vec<_> =
                (0..150).map(|i| points[(vpl.block() as usize * 150 + i) % points.len()]).collect();
            let twin = drawn(side, &block, vpl, (area / 150.0, 4.0));
            assert!(tile.iter().any(|word| *word != EMPTY));
            // Rims go either way by rounding; depth by a step.
            wrong += tile.iter().zip(twin).filter(|(a, b)| a.abs_diff(*b) > 1 << 13).count();
        }
        assert!(wrong * 200 <= words.len(), "{wrong} of {} texels at {side}²", words.len());
    }
}

/// Axes of the map of what is infinitely far, of a box whose sides are equal.
fn far_axes(goes: Vec3) -> Mat3 {
    // Of sides that are as long the second counts as the longest.
    let along = if goes.y.abs() > 0.9 { Vec3::X } else { Vec3::Y };
    let x = (along - along.dot(goes) * goes).normalize();
    Mat3::from_cols(x, goes.cross(x), goes)
}

#[test]
fn tiles_of_what_is_infinitely_far_show_the_box_as_the_cpu_draws_it() {
    let gpu = device();
    let largest = 4.0;
    // The box is that of the rig, and the points' room lies around its middle.
    let middle = Vec3::splat(0.5 * largest / 3f32.sqrt());
    let (mut points, area) = scatter(&walls(), 100, 5);
    for (point, exponent) in points.iter_mut().zip((0..4).cycle()) {
        point.position += middle;
        point.exponent = exponent;
    }
    let resolution = IsmResolution::Side64;
    let ways = [Vec3::NEG_Y, Vec3::new(0.3, -0.8, -0.4).normalize(), Vec3::new(-1.0, 0.1, 0.2).normalize()];
    let vpls = ways.map(|goes| Vpl::far(middle - 0.5 * largest * goes, goes, Vec3::ONE, 0));
    let settings = IndirectSettings { points_per_vpl: 300, ..settings(resolution, 0) };
    let rig = Rig::far(&gpu, settings, (&points, area, largest), &vpls);
    let (side, words) = (resolution.texels(), rig.words());
    let point_area = area / 300.0;
    let mut wrong = 0;
    for (vpl, tile) in vpls.iter().zip(words.chunks(side.pow(2) as usize)) {
        let axes = far_axes(vpl.normal_ws());
        let half = Vec2::new(middle.dot(axes.x_axis.abs()), middle.dot(axes.y_axis.abs()));
        let mut twin = vec![EMPTY; side.pow(2) as usize];
        for (index, point) in (0u32..).zip((0..300).map(|i| &points[i % points.len()])) {
            let to = axes.transpose() * (point.position - Vec3::from(vpl.position_ws));
            let normal = axes.transpose() * point.normal;
            let disc = (point_area * 4f32.powi(point.exponent as i32) / PI).sqrt();
            let per_texel = 2.0 * half / side as f32;
            let centre = to.truncate() / per_texel + 0.5 * side as f32;
            for (i, texel) in (0u32..).zip(&mut twin) {
                let at = Vec2::new((i % side) as f32, (i / side) as f32);
                let off = (at + 0.5 - centre) * per_texel;
                if off.length() > disc * normal.z.abs().sqrt() && at != centre.floor() {
                    continue;
                }
                // Where the texel's line meets the disc's plane.
                let met = to.z - normal.truncate().dot(off) / normal.z;
                let met = if normal.z.abs() > 1e-3 { met.max(to.z - disc.min(0.5 * to.z)) } else { to.z };
                let depth = (22.0 * ((met / largest).clamp(0.0, 1.0) - 1.0)).exp2();
                *texel = (*texel).min(depth.to_bits() >> 12 << 13 | index);
            }
        }
        let holds = tile.iter().filter(|word| **word != EMPTY).count();
        assert!(holds * 2 > tile.len(), "{holds} texels of {}", tile.len());
        // Rims go either way by rounding; depth by a step.
        wrong += tile.iter().zip(twin).filter(|(a, b)| a.abs_diff(*b) > 1 << 14).count();
    }
    assert!(wrong * 100 <= words.len(), "{wrong} of {} texels", words.len());
}

#[test]
fn a_point_covers_the_solid_angle_of_its_disc() {
    let gpu = device();
    let side = 256;
    let (area, d) = (0.03, 1.0);
    for (w, normal) in [
        (Vec3::Z, Vec3::NEG_Z),
        (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, 0.8)),
        (Vec3::new(0.0, -0.8, 0.6), Vec3::NEG_X),
        (Vec3::new(-0.48, 0.6, 0.64), Vec3::Z),
    ] {
        let point = Point { position: d * w, normal, exponent: 1 };
        let settings = IndirectSettings { points_per_vpl: 1, ..settings(IsmResolution::Side256, 0) };
        let rig = Rig::new(&gpu, settings, (&[point], area / 4.0, 4.0), &[vpl(Vec3::ZERO, Vec3::Z, 0)]);
        let cosine = normal.dot(w).abs();
        let alpha = half_angle_tan(area, cosine, d).atan();
        // Seen edge-on it is a texel, which makes no difference here.
        let expected = 2.0 * PI * (1.0 - alpha.cos());
        let found = solid_angle(side, &rig.words());
        assert!((found - expected).abs() < 0.02 * expected + 3e-4, "{w}: {found} should be {expected}");
    }
}

#[test]
fn a_plane_of_points_covers_its_share_of_the_hemisphere() {
    let gpu = device();
    let side = 128;
    for d in [0.5, 1.0, 2.0] {
        let plane = [Vec3::new(0.0, 0.0, d), Vec3::X, Vec3::Y];
        let (points, area) = scatter(&[plane], 4000, 1);
        let mut rig = Rig::new(
            &gpu,
            IndirectSettings { points_per_vpl: 4000, ..settings(IsmResolution::Side128, 0) },
            (&points, area, 4.0),
            &[vpl(Vec3::ZERO, Vec3::Z, 0)],
        );
        // A rectangle seen from its axis.
        let expected = 4.0 * (1.0 / (d * (2.0 + d * d).sqrt())).atan();
        let words = rig.words();
        let share = solid_angle(side, &words) / expected;
        assert!((0.7..1.04).contains(&share), "from {d} m: {share}");
        // Where a texel's centre meets the plane, so far from its middle.
        let off = |i: usize| {
            let at = Vec2::new((i as u32 % side) as f32, (i as u32 / side) as f32) + 0.5;
            let w = direction(side, at);
            (if w.z > 0.0 { (w * d / w.z).truncate().abs().max_element() } else { 1e9 }, w.z)
        };
        let radius = (area / 4000.0 / PI).sqrt();
        for (i, word) in words.iter().enumerate() {
            let (off, z) = off(i);
            // Half a texel's diagonal, and both as they grow on a slanted plane.
            let texel = 0.7072 * 2.0 * (1.0 + z) / side as f32 * d / z;
            let reach = (texel.max(radius) + texel) / z;
            assert!(*word == EMPTY || off < 1.0 + reach, "from {d} m: {off} is not on the plane");
        }
        rig.set(settings_of(&rig.settings, 2), 1);
        let holes =
            rig.words().iter().enumerate().filter(|(i, word)| **word == EMPTY && off(*i).0 < 1.0).count();
        assert_eq!(holes, 0);
    }
}

fn settings_of(settings: &IndirectSettings, levels: u32) -> IndirectSettings {
    IndirectSettings { levels, ..settings.clone() }
}

#[test]
fn points_of_its_own_plane_and_behind_it_are_not_drawn_and_no_light_needs_no_shadow() {
    let gpu = device();
    let radius = (1e-2 / PI).sqrt();
    let heights = [-1.0, 0.0, 0.05 * radius, f32::NAN];
    let points: Vec<_> = heights
        .iter()
        .map(|z| Point { position: Vec3::new(0.3, 0.2, *z), normal: Vec3::Z, exponent: 0 })
        .collect();
    let vpls = [vpl(Vec3::ZERO, Vec3::Z, 0), Vpl::new(Vec3::NEG_Z, Vec3::Z, Vec3::ZERO, 0)];
    let settings = IndirectSettings { points_per_vpl: 4, ..settings(IsmResolution::Side32, 5) };
    let rig = Rig::new(&gpu, settings, (&points, 4e-2, 4.0), &vpls);
    assert!(rig.words().iter().all(|word| *word == EMPTY));
}

#[test]
fn the_same_points_in_any_order_and_any_number_of_atlases_give_the_same_bits() {
    let gpu = device();
    let (mut points, area) = scatter(&walls(), 1000, 1);
    let vpls: Vec<_> = (0..5).map(|i| vpl(Vec3::splat(-0.2 * i as f32), Vec3::X, 0)).collect();
    let settings = IndirectSettings { points_per_vpl: 1000, ..settings(IsmResolution::Side64, 3) };
    let rig = Rig::new(&gpu, settings.clone(), (&points, area, 4.0), &vpls);
    let first = rig.words();
    let mut rig = rig;
    rig.make();
    assert!(rig.words() == first);
    let two = IsmPlan::within(2 << 14, &settings, 5).unwrap();
    assert_eq!(two.tiles, 2);
    let rig = Rig::with_plan(&gpu, settings.clone(), (&points, area, 4.0), &vpls, (two, 0));
    assert_eq!(rig.room.atlases().len(), 3);
    assert!(rig.words() == first);
    points.reverse();
    let turned = Rig::new(&gpu, settings, (&points, area, 4.0), &vpls).words();
    assert!(turned.iter().zip(&first).all(|(a, b)| a >> 13 == b >> 13));
}

#[test]
fn tiles_of_vpls_that_there_are_not_are_left_alone() {
    let gpu = device();
    let (points, area) = scatter(&walls(), 100, 1);
    let vpls: Vec<_> = (0..4).map(|_| vpl(Vec3::ZERO, Vec3::X, 0)).collect();
    let settings = IndirectSettings { points_per_vpl: 100, ..settings(IsmResolution::Side32, 2) };
    let mut rig = Rig::new(&gpu, settings.clone(), (&points, area, 4.0), &vpls);
    rig.vpl_count = rig.bench.buffer("vpl_count", &counted(3, 0));
    rig.room = rig.ism.room(&gpu, IsmPlan::new(&gpu, &settings, 4).unwrap(), true);
    rig.make();
    let words = rig.words();
    let is_drawn: Vec<_> = words.chunks(1024).map(|tile| tile.iter().any(|word| *word != 0)).collect();
    assert_eq!(is_drawn, [true, true, true, false]);
    // Two by two tiles, the last of them empty.
    let picture = rig.picture(1);
    assert!(picture[..32].iter().any(|metres| *metres > 0.5));
    let last = |y: usize| &picture[64 * (32 + y) + 32..64 * (33 + y)];
    assert!((0..32).all(|y| last(y).iter().all(|metres| *metres == 0.0)));
}
