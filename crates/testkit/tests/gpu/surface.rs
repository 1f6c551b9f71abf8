//! The surface buffer's packing, octahedral vectors, sRGB.

use chiaro_gpu::Dispatch;
use chiaro_testkit::{Bench, device};
use glam::Vec3;

use crate::culling::Random;

const FLOATS: usize = 20;
/// As in `brdf.wesl`.
const MIN_ROUGHNESS: f32 = 0.045;

/// Random unit vectors after those where octahedra fold: axes, diagonals, edges.
fn unit_vectors(count: usize, random: &mut Random) -> Vec<Vec3> {
    let mut all = Vec::new();
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                all.extend(Vec3::new(x, y, z).try_normalize());
            }
        }
    }
    while all.len() < count {
        let mut axis = || random.within(-1.0, 1.0);
        let v = Vec3::new(axis(), axis(), axis());
        if v.length() > 0.1 && v.length() <= 1.0 {
            all.push(v.normalize());
        }
    }
    all
}

/// Precise for small angles, where the dot product is not.
fn angle(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b))
}

/// The angle that half a step of both octahedral coordinates spans at most: where the octahedron is nearest the centre
/// (1/√3) a move by (d, d) there is one by (d, d, −2d), √6 d long. 0.004° for 16 bits, 1.9° for 7.
fn half_step_angle(steps: f32) -> f32 {
    0.5 / steps * 6f32.sqrt() * 3f32.sqrt() + 2e-6
}

/// Some number in 0..1 for each index, 0 for every eighth.
fn random_share(i: usize) -> f32 {
    (i * 5 % 8) as f32 / 8.0 + if i.is_multiple_of(8) { 0.0 } else { (i * 37 % 128) as f32 / 1024.0 }
}

#[test]
fn a_packed_surface_comes_back_within_its_bits() {
    let mut random = Random::new(1);
    let normals = unit_vectors(2048, &mut random);
    let mut input = Vec::new();
    for (i, normal) in normals.iter().enumerate() {
        let mut unit = || match i % 3 {
            // Ends of the range must come back exactly.
            0 => random.within(0.0, 2.0).floor(),
            _ => random.within(0.0, 1.0),
        };
        // Two in three are next to the shading normal, from the very same to 17° apart.
        let other = normals[(i * 7 + 3) % normals.len()];
        let apart = 0.3 * random_share(i).powi(4);
        let geometric = if i % 3 == 0 { other } else { (normal + other * apart).normalize() };
        input.extend(normal.to_array());
        input.extend(geometric.to_array());
        input.extend(std::iter::repeat_with(&mut unit).take(10));
        input.extend([(i % 3) as f32, 0.0, 0.0, 0.0]);
    }
    let gpu = device();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("surfaces", &input);
    let shader = ("tests/surface.cs.wesl", include_str!("wesl/surface.cs.wesl"));
    let work = (Dispatch::Threads([normals.len() as u32, 1, 1]), input.len());
    let output: Vec<f32> = bench.run(shader, &[], None, &[("input", (&buffer).into())], work);
    let vector = |of: &[f32], at: usize| Vec3::from_slice(&of[at..]);
    // Half a step of each quantity, plus rounding of f32.
    let half = |steps: f32| 0.5 / steps + 1e-5;
    for (i, (a, b)) in input.chunks(FLOATS).zip(output.chunks(FLOATS)).enumerate() {
        assert!(
            angle(vector(a, 0), vector(b, 0)) < half_step_angle(32767.0),
            "normal {i}: {:?} {:?}",
            &a[..3],
            &b[..3]
        );
        assert!(
            angle(vector(a, 3), vector(b, 3)) < half_step_angle(63.0),
            "geometric normal {i}: {:?} {:?}",
            &a[3..6],
            &b[3..6]
        );
        let (off, apart) = (angle(vector(a, 3), vector(b, 3)), angle(vector(a, 0), vector(a, 3)));
        assert!(off <= b[17], "geometric normal {i} is off by {off}, not {}", b[17]);
        // Low light needs flat surfaces exactly, and coarse globes well.
        let bound = if apart < 1e-6 { 1.4e-4 } else { 1.2e-3 + 0.06 * apart };
        assert!(apart > 0.15 || b[17] <= bound, "geometric normal {i}, {apart} apart, is off by {}", b[17]);
        for channel in 0..3 {
            let at = 6 + channel;
            assert!((a[at].sqrt() - b[at].sqrt()).abs() < half(1023.0), "colour {i}: {} {}", a[at], b[at]);
        }
        // The strongest channel by its root, the others by their shares of it.
        let (f0, found) = (vector(a, 9), vector(b, 9));
        let (most, found_most) = (f0.max_element(), found.max_element());
        assert!((most.sqrt() - found_most.sqrt()).abs() < half(510.0), "F0 {i}: {f0} {found}");
        let shares = f0 / most.max(1e-9) - found / found_most.max(1e-9);
        assert!(most == 0.0 || shares.abs().max_element() < half(31.0), "F0 {i}: {f0} {found}");
        // By the same share at every roughness, for that is what a highlight's brightness goes by.
        let (roughness, found) = (a[12].max(MIN_ROUGHNESS), b[12].max(MIN_ROUGHNESS));
        assert!((found / roughness).ln().abs() < half(254.0 / -MIN_ROUGHNESS.ln()), "{roughness}: {found}");
        for (at, steps) in [(13, 255.0), (14, 31.0), (15, 127.0)] {
            assert!((a[at] - b[at]).abs() < half(steps), "quantity {at} of {i}: {} {}", a[at], b[at]);
        }
        assert_eq!(a[16], b[16], "kind of {i}");
        if i % 3 == 0 {
            assert_eq!(a[6..16], b[6..16], "0 and 1 of {i} are exact");
        }
    }
}

#[test]
fn the_f0_of_usual_materials_is_packed_as_exactly_as_it_shows() {
    // Glass, no reflection, a diamond, a mirror (ior 0), and a coloured lobe: (F0, the error allowed).
    let diamond = ((2.417f32 - 1.0) / 3.417).powi(2);
    let cases = [
        (Vec3::splat(0.04), 1e-6),
        (Vec3::ZERO, 0.0),
        (Vec3::splat(diamond), 0.005 * diamond),
        (Vec3::ONE, 0.0),
        (Vec3::new(0.02, 0.04, 0.0), 0.04 * 0.51 / 31.0),
        (Vec3::new(0.0, 0.0, 0.16), 1e-6),
    ];
    let mut input = vec![0.0; FLOATS * cases.len()];
    for (surface, (f0, _)) in input.chunks_mut(FLOATS).zip(cases) {
        surface[2] = 1.0;
        surface[5] = 1.0;
        surface[9..12].copy_from_slice(&f0.to_array());
    }
    let gpu = device();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("surfaces", &input);
    let shader = ("tests/surface.cs.wesl", include_str!("wesl/surface.cs.wesl"));
    let work = (Dispatch::Threads([cases.len() as u32, 1, 1]), input.len());
    let output: Vec<f32> = bench.run(shader, &[], None, &[("input", (&buffer).into())], work);
    for (surface, (f0, allowed)) in output.chunks(FLOATS).zip(cases) {
        let found = Vec3::from_slice(&surface[9..]);
        assert!((found - f0).abs().max_element() <= allowed, "{f0} became {found}");
    }
}

#[test]
fn octahedral_vectors_frames_and_srgb_are_what_they_are_called() {
    let mut random = Random::new(2);
    let vectors = unit_vectors(4096, &mut random);
    let input: Vec<[f32; 4]> =
        vectors.iter().enumerate().map(|(i, v)| v.extend(i as f32 / 4095.0).to_array()).collect();
    let gpu = device();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("input", &input);
    let shader = ("tests/small_functions.cs.wesl", include_str!("wesl/small_functions.cs.wesl"));
    let work = (Dispatch::Threads([input.len() as u32, 1, 1]), input.len());
    let output: Vec<[[f32; 4]; 5]> = bench.run(shader, &[], None, &[("input", (&buffer).into())], work);
    for (given, [exact, snorm16, x, y, srgb]) in input.iter().zip(output) {
        let of = |v: [f32; 4]| Vec3::from_slice(&v);
        let n = Vec3::from_slice(given);
        assert!(angle(n, of(exact)) < 1e-6, "{n} became {exact:?}");
        assert!(angle(n, of(snorm16)) < half_step_angle(32767.0), "{n} became {snorm16:?}");
        let (x, y) = (of(x), of(y));
        let square = x.dot(y).abs() + x.dot(n).abs() + y.dot(n).abs();
        assert!(
            square < 1e-5 && (x.length() - 1.0).abs() < 1e-5 && x.cross(y).dot(n) > 0.999,
            "{n}: {x} {y}"
        );
        let c = given[3];
        let expected = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
        // Drivers' pow is exact to a few units in the last place of its logarithm.
        assert!((srgb[0] - expected).abs() < 2e-5, "{c}: {} is not {expected}", srgb[0]);
    }
}
