//! The BRDF against quadrature, a white furnace and reciprocity.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::Dispatch;
use chiaro_testkit::{Bench, device};
use glam::Vec3;

const METALLIC_ROUGHNESS: u32 = 0;
const PHONG: u32 = 1;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    base: [f32; 3],
    kind: u32,
    specular_color: [f32; 3],
    metallic: f32,
    roughness: f32,
    specular: f32,
    cosine: f32,
    pad: f32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    quadrature: [f32; 3],
    pad0: f32,
    formula: [f32; 3],
    pad1: f32,
}

/// As in `brdf.wesl`.
const MIN_ROUGHNESS: f32 = 0.045;
const WHITE: [f32; 3] = [1.0; 3];
const GOLD: [f32; 3] = [1.0, 0.71, 0.29];
const ROUGHNESSES: [f32; 9] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0];
const COSINES: [f32; 7] = [0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0];

fn pbr(base: [f32; 3], metallic: f32, specular: f32, specular_color: [f32; 3]) -> Case {
    Case {
        base,
        kind: METALLIC_ROUGHNESS,
        specular_color,
        metallic,
        roughness: 0.0,
        specular,
        cosine: 0.0,
        pad: 0.0,
    }
}

/// Every material at every roughness and angle, integrated.
fn furnace(materials: &[Case]) -> Vec<(Case, Answer)> {
    let mut cases = Vec::new();
    for material in materials {
        for roughness in ROUGHNESSES {
            cases.extend(COSINES.map(|cosine| Case { roughness, cosine, ..*material }));
        }
    }
    let gpu = device();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("cases", &cases);
    let shader = ("tests/furnace.cs.wesl", include_str!("wesl/furnace.cs.wesl"));
    let work = (Dispatch::Groups([cases.len() as u32, 1, 1]), cases.len());
    let answers = bench.run(shader, &[], None, &[("cases", (&buffer).into())], work);
    cases.into_iter().zip(answers).collect()
}

/// The worst relative distance, with its case.
fn worst(answers: &[(Case, Answer)], distance: impl Fn(&Case, f32, f32) -> f32) -> (f32, String) {
    let mut worst = (0.0, String::new());
    for (case, answer) in answers {
        for (quadrature, formula) in answer.quadrature.into_iter().zip(answer.formula) {
            let found = distance(case, quadrature, formula);
            if found.is_nan() || found > worst.0 {
                worst = (found, format!("{found}: quadrature {quadrature}, formula {formula}, {case:?}"));
            }
        }
    }
    worst
}

#[test]
fn pbr_reflects_as_much_as_its_directional_albedo_says() {
    let materials = [
        pbr(WHITE, 1.0, 1.0, WHITE),
        pbr(GOLD, 1.0, 1.0, WHITE),
        pbr(WHITE, 0.0, 1.0, WHITE),
        pbr([0.05; 3], 0.0, 1.0, WHITE),
        pbr([0.8, 0.4, 0.1], 0.5, 1.0, WHITE),
        pbr([0.5; 3], 0.0, 0.0, WHITE),
        pbr([0.3; 3], 0.0, 0.7, [1.0, 0.2, 0.05]),
    ];
    let answers = furnace(&materials);
    // Half a percent: the table's 64 × 32 cells and 1,024 samples; the quadrature's own error is a tenth of it.
    let (distance, what) = worst(&answers, |_, quadrature, formula| (quadrature / formula - 1.0).abs());
    assert!(distance < 0.005, "{what}");
}

#[test]
fn a_white_furnace_stays_white() {
    let materials = [0.0, 0.25, 0.5, 1.0].map(|metallic| pbr(WHITE, metallic, 1.0, WHITE));
    let answers = furnace(&materials);
    // One percent for metals: what the table and its interpolation may lose.
    let (metal, what) =
        worst(&answers, |case, white, _| if case.metallic == 1.0 { (white - 1.0).abs() } else { 0.0 });
    assert!(metal < 0.01, "{what}");
    // With a diffuse lobe the interpolation of two albedos multiplies; nothing may be gained but its error.
    let (mixed, what) =
        worst(
            &answers,
            |case, white, _| {
                if case.metallic == 1.0 { 0.0 } else { (0.95 - white).max(white - 1.005) }
            },
        );
    assert!(mixed <= 0.0, "{what}");
}

#[test]
fn phong_reflects_at_most_its_diffuse_and_specular_colours() {
    let materials = [[0.0; 3], [0.2, 0.5, 0.0]].map(|base| Case {
        base,
        kind: PHONG,
        ..pbr(WHITE, 0.0, 1.0, [0.5, 0.25, 1.0])
    });
    let answers = furnace(&materials);
    // The quadrature's error, and at the least roughness the rounding of cosines.
    let (over, what) = worst(&answers, |case, quadrature, ks| {
        quadrature / ks - if case.roughness > MIN_ROUGHNESS { 1.002 } else { 1.05 }
    });
    assert!(over <= 0.0, "{what}");
    // At normal incidence nothing falls below the horizon.
    let (off, what) = worst(&answers, |case, quadrature, ks| {
        // A lobe of exponent 5·10⁵ is as narrow as f32 can tell cosines apart.
        if case.cosine == 1.0 && case.roughness > MIN_ROUGHNESS { (quadrature / ks - 1.0).abs() } else { 0.0 }
    });
    assert!(off < 0.005, "{what}");
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Pair {
    base: [f32; 3],
    kind: u32,
    specular_color: [f32; 3],
    metallic: f32,
    v: [f32; 3],
    roughness: f32,
    l: [f32; 3],
    specular: f32,
}

#[test]
fn light_and_eye_can_change_places() {
    let mut random = crate::culling::Random::new(7);
    let mut direction = || {
        let (z, phi) = (random.within(0.03, 1.0), random.within(0.0, std::f32::consts::TAU));
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize().to_array()
    };
    let mut pairs = Vec::new();
    for kind in [METALLIC_ROUGHNESS, PHONG] {
        for roughness in ROUGHNESSES {
            for metallic in [0.0, 0.5, 1.0] {
                let (base, specular_color) = ([0.9, 0.5, 0.1], [1.0, 0.8, 0.3]);
                let mut pair = || {
                    let (v, l) = (direction(), direction());
                    Pair { base, kind, specular_color, metallic, v, roughness, l, specular: 0.8 }
                };
                pairs.extend(std::iter::repeat_with(&mut pair).take(32));
            }
        }
    }
    let gpu = device();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("pairs", &pairs);
    let shader = ("tests/reciprocity.cs.wesl", include_str!("wesl/reciprocity.cs.wesl"));
    let work = (Dispatch::Threads([pairs.len() as u32, 1, 1]), pairs.len());
    let answers: Vec<[[f32; 4]; 2]> = bench.run(shader, &[], None, &[("pairs", (&buffer).into())], work);
    for (pair, [there, back]) in pairs.iter().zip(answers) {
        for (there, back) in there.into_iter().zip(back) {
            // A narrow lobe's exponent, 2/r⁴, magnifies the rounding of the cosine that is raised to it.
            let exponent = 2.0 / pair.roughness.max(MIN_ROUGHNESS).powi(4);
            let tolerance = if pair.kind == PHONG { (3e-7 * exponent).max(1e-4) } else { 1e-4 };
            // Relative, but not to less than a thousandth per steradian: tails nobody sees.
            let off = (there - back).abs() / there.max(back).max(1e-3);
            assert!(off < tolerance, "{there} there and {back} back: {off}, {pair:?}");
        }
    }
}
