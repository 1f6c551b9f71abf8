//! What smooths interleaved light.

use super::*;
use chiaro_gpu::Dispatch;
use chiaro_testkit::device;

/// VPLs far before a wall at z = 0, in blocks of very different colours and brightness, so that all its places get nearly
/// the same light of each.
fn far_away(count: usize) -> Vec<Vpl> {
    let mut random = Random::new(5);
    (0..count)
        .map(|_| {
            let at = Vec3::new(random.within(-9.0, 9.0), random.within(-9.0, 9.0), 60.0);
            let mut flux = || random.within(0.0, 10.0).powi(3);
            Vpl::new(at, Vec3::NEG_Z, Vec3::new(flux(), flux(), flux()), 0)
        })
        .collect()
}

fn wall_of_four_metres() -> [Vec3; 3] {
    [Vec3::ZERO, 4.0 * Vec3::X, 4.0 * Vec3::Y]
}

fn most_off(found: &[[f32; 4]], expected: &[[f32; 4]]) -> f32 {
    let off = |(a, b): (&[f32; 4], &[f32; 4])| (0..3).map(|i| (a[i] / b[i] - 1.0).abs()).fold(0.0, f32::max);
    found.iter().zip(expected).map(off).fold(0.0, f32::max)
}

/// For up to 4 × 4 pixels, and for more.
fn narrow_and_wide(gpu: &Gpu, filter: IrradianceFilter) -> [Rig<'_>; 2] {
    [false, true].map(|wide| Rig::new(gpu, GatherKey { wide, ..key(Sight::All, filter, false) }))
}

#[test]
fn no_pattern_is_left_on_a_flat_wall() {
    let gpu = device();
    let vpls = far_away(200);
    // Straight, and seen slanted.
    let cameras = [(Vec3::new(0.1, 0.0, 2.0), Vec3::ZERO), (Vec3::new(-0.2, 0.03, 0.22), Vec3::ZERO)];
    let mut plain = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, false));
    let mut edges = narrow_and_wide(&gpu, IrradianceFilter::Edges);
    for camera in cameras {
        let wall = [Vec3::ZERO, 400.0 * Vec3::X, 400.0 * Vec3::Y];
        let picture = Picture::new([41, 34], camera, &[wall]);
        let all = plain.light(&picture, &settings(1), &vpls);
        for n in 2..=8 {
            let before = most_off(&plain.light(&picture, &settings(n), &vpls), &all);
            let after = most_off(&edges[usize::from(n > 4)].light(&picture, &settings(n), &vpls), &all);
            assert!(before > 0.2, "{n}: {before}");
            // At the picture's borders, too.
            assert!(after < 0.01, "{n}: pixels differ by {after}");
        }
    }
}

/// Two walls that face the camera, the left one a metre nearer, and a light between the two.
fn step() -> (Picture, Vec<Vpl>) {
    let far = wall_of_four_metres();
    let near = [Vec3::new(-4.0, 0.0, 1.0), 4.0 * Vec3::X, 4.0 * Vec3::Y];
    let picture = Picture::new([40, 30], (Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO), &[far, near]);
    let light = |i: usize| {
        let at = Vec3::new(1.5 + 0.01 * i as f32, 0.2, 0.8);
        Vpl::new(at, Vec3::NEG_Z, Vec3::splat(if i.is_multiple_of(3) { 900.0 } else { 30.0 }), 0)
    };
    (picture, (0..64).map(light).collect())
}

/// A floor and a wall, and lights that are under the floor.
fn corner() -> (Picture, Vec<Vpl>) {
    let floor = [Vec3::ZERO, 4.0 * Vec3::Z, 4.0 * Vec3::X];
    let picture =
        Picture::new([40, 30], (Vec3::new(0.2, 1.0, 3.0), Vec3::ZERO), &[wall_of_four_metres(), floor]);
    let light = |i: usize| {
        let at = Vec3::new(0.01 * i as f32, -0.05, 2.0);
        Vpl::new(at, Vec3::NEG_Z, Vec3::splat(if i.is_multiple_of(3) { 900.0 } else { 30.0 }), 0)
    };
    (picture, (0..64).map(light).collect())
}

#[test]
fn no_light_crosses_an_edge_of_depth_or_normals() {
    let gpu = device();
    for filter in [IrradianceFilter::Edges, IrradianceFilter::Discontinuity] {
        let mut rigs = narrow_and_wide(&gpu, filter);
        for (name, (picture, vpls)) in [("depth", step()), ("normals", corner())] {
            for n in [2, 3, 4, 5, 8] {
                let settings = IndirectSettings { filter_width: n + 1, ..settings(n) };
                let found = rigs[usize::from(n > 4)].light(&picture, &settings, &vpls);
                let is_lit = |i: usize| twin(&picture.pixels[i], &vpls, 1.0, |_, _| true).0.x > 0.0;
                let lit = (0..found.len()).filter(|i| is_lit(*i)).count();
                assert!(lit > 100 && lit < found.len() - 100);
                for (i, texel) in found.iter().enumerate() {
                    let dark = texel[0] == 0.0;
                    assert!(is_lit(i) || dark, "{filter:?}, {name}, {n}: pixel {i} has {}", texel[0]);
                    assert!(filter != IrradianceFilter::Edges || dark != is_lit(i), "{name}, {n}: pixel {i}");
                }
            }
        }
    }
}

#[test]
fn along_edges_no_sub_image_is_missing() {
    let gpu = device();
    let mut plain = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, false));
    let mut edges = narrow_and_wide(&gpu, IrradianceFilter::Edges);
    // Two walls, of which the nearer ends along a slanted line, seen from afar, so that light is even over pixels.
    let side = Vec3::new(4.0, 1.3, 0.0);
    let near = [Vec3::new(-1.3, 4.0, 1.0), side, Vec3::new(-1.3, 4.0, 0.0)];
    let picture =
        Picture::new([40, 30], (Vec3::new(0.0, 0.0, 4.0), Vec3::ZERO), &[wall_of_four_metres(), near]);
    let vpls = far_away(200);
    let all = plain.light(&picture, &settings(1), &vpls);
    for n in [2, 3, 4, 6] {
        let before = most_off(&plain.light(&picture, &settings(n), &vpls), &all);
        let after = most_off(&edges[usize::from(n > 4)].light(&picture, &settings(n), &vpls), &all);
        assert!(after < 0.1 * before, "{n}: pixels differ by {after}, {before} before");
    }
}

#[test]
fn discontinuities_are_where_depth_or_normals_jump_and_what_is_on_one_stays() {
    let gpu = device();
    for (name, (picture, vpls)) in [("depth", step()), ("normals", corner())] {
        let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::Discontinuity, false));
        let found = rig.light(&picture, &settings(4), &vpls);
        let mask = texels::<1>(&gpu, rig.room.as_ref().unwrap().discontinuities().unwrap());
        let mut plain = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, false));
        let before = plain.light(&picture, &settings(4), &vpls);
        let at = |x: usize, y: usize| picture.pixels[y.min(29) * 40 + x.min(39)];
        let jumps = |a: Shown, b: Shown| {
            (a.view_depth - b.view_depth).abs() / a.view_depth.min(b.view_depth) > 0.02
                || 1.0 - a.normal.dot(b.normal) > 0.2
        };
        let mut marked = 0;
        for (i, ([mark], (found, before))) in mask.iter().zip(found.iter().zip(&before)).enumerate() {
            let (x, y) = (i % 40, i / 40);
            let expected = jumps(at(x, y), at(x + 1, y + 1)) || jumps(at(x + 1, y), at(x, y + 1));
            assert_eq!(*mark > 0.0, expected, "{name}: pixel {x} {y}");
            assert!(!expected || found == before, "{name}: pixel {x} {y}");
            marked += usize::from(expected);
        }
        assert!((25..700).contains(&marked), "{name}: {marked}");
    }
}

#[test]
fn the_gaussian_is_what_its_weights_say() {
    let gpu = device();
    let picture = Picture::new([30, 20], (Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO), &[wall_of_four_metres()]);
    let vpls = far_away(200);
    let mut plain = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, false));
    let before = plain.light(&picture, &settings(4), &vpls);
    let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::Discontinuity, false));
    for width in [3i32, 5, 6, 9] {
        let found =
            rig.light(&picture, &IndirectSettings { filter_width: width as u32, ..settings(4) }, &vpls);
        let weight = |i: i32| {
            let x = i as f32 / (0.3 * width as f32);
            (-0.5 * x * x).exp() * if 2 * i.abs() == width { 0.5 } else { 1.0 }
        };
        for (i, found) in (0..).zip(&found) {
            let (x, y) = (i % 30, i / 30);
            let (mut sum, mut weights) = (0.0, 0.0);
            for v in -(width / 2)..=width / 2 {
                for u in -(width / 2)..=width / 2 {
                    if (0..30).contains(&(x + u)) && (0..20).contains(&(y + v)) {
                        sum += weight(u) * weight(v) * before[((y + v) * 30 + x + u) as usize][0];
                        weights += weight(u) * weight(v);
                    }
                }
            }
            assert!((found[0] / (sum / weights) - 1.0).abs() < 2e-3, "{width}: pixel {x} {y}");
        }
    }
}

#[test]
fn a_place_takes_the_light_of_the_pixel_or_neighbour_that_is_as_deep() {
    let gpu = device();
    let (picture, vpls) = step();
    let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::Edges, false));
    let light = rig.light(&picture, &settings(4), &vpls);
    // The last pixel of the near wall and the first of the far one, each asked for both walls' depths.
    let last = (0..40).rposition(|x| picture.pixels[15 * 40 + x].view_depth < 2.5).unwrap();
    let places: Vec<[f32; 4]> = [(last, 2.0), (last, 3.0), (last + 1, 2.0), (last + 1, 3.0)]
        .map(|(x, depth)| [x as f32 + 0.5, 15.5, depth, 0.0])
        .to_vec();
    let buffer = rig.bench.buffer("places", &places);
    let kept = texture(&gpu, "irradiance", picture.size, TextureFormat::Rgba32Float, &light);
    let shader = ("tests/bounced.cs.wesl", include_str!("../wesl/bounced.cs.wesl"));
    let inputs = [("places", (&buffer).into()), ("irradiance", (&kept).into())];
    let work = (Dispatch::Threads([4, 1, 1]), 4);
    let found: Vec<[f32; 4]> = rig.bench.run(shader, &[], None, &inputs, work);
    let nits = |x: usize| light[15 * 40 + x][0] / RADIANCE_SCALE;
    assert_eq!([0, 2].map(|i: usize| found[i][0]), [0.0; 2]);
    assert_eq!(found[3][0], nits(last + 1));
    // Of the neighbours on the far wall the one whose depth is nearest; they are all as bright.
    assert!((found[1][0] / nits(last + 1) - 1.0).abs() < 0.1, "{} {}", found[1][0], nits(last + 1));
}
