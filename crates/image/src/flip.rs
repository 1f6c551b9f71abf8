//! LDR-FLIP: how different two pictures look when a viewer flips between them.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: "FLIP: A Difference Evaluator for Alternating
//! Images", HPG 2020. Section numbers below are the paper's. Colours are filtered by the eye's contrast sensitivity
//! and compared in a perceptually uniform space; edges and points that appear or vanish raise the difference.
//!
//! Input: linear Rec. 709 in 0–1 (what sRGB bytes decode to, but not quantised: with 8-bit input, small
//! differences come out up to twice as large). Output: 0 (same) to 1 per pixel. Why this is not a library:
//! `docs/decisions/0003-flip-in-rust.md`.

use std::f64::consts::{PI, SQRT_2};

use crate::filter::{Plane, convolve, gaussian, offsets};

/// Pixels in a degree of visual angle: 3,840 pixels on 0.7 m, seen from 0.7 m, as in the authors' tools.
const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Exponent on colour differences (§4.1.3).
const COLOUR_EXPONENT: f64 = 0.7;
/// Share of the largest colour difference that is mapped to [`COLOUR_TARGET`] (§4.1.3).
const COLOUR_KNEE: f64 = 0.4;
/// What that share is mapped to; the rest is squeezed into 0.95–1.
const COLOUR_TARGET: f64 = 0.95;
/// Width of the feature detectors in degrees (§4.2.1).
const FEATURE_WIDTH_DEG: f64 = 0.082;

/// CIE XYZ from linear sRGB under D65, to the precision of the standard's chromaticities.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [0.412_386_563_252_99, 0.357_591_490_920_63, 0.180_450_491_203_56],
    [0.212_636_821_677_32, 0.715_182_981_841_25, 0.072_180_196_481_42],
    [0.019_330_620_152_48, 0.119_197_163_640_21, 0.950_372_587_005_43],
];

/// The FLIP difference of every pixel. Both images are planes R, G, B of linear values in 0–1, `width` pixels wide.
pub(crate) fn flip(reference: &[Plane; 3], test: &[Plane; 3], width: usize) -> Plane {
    let space = ColourSpace::new();
    let [seen_reference, seen_test] = [reference, test].map(|image| Seen::new(&space, image, width));
    let largest = space.largest_difference();
    let knee = COLOUR_KNEE * largest;
    (0..reference[0].len())
        .map(|index| {
            let difference = hyab(seen_reference.lab[index], seen_test.lab[index]).powf(COLOUR_EXPONENT);
            let colour = if difference < knee {
                COLOUR_TARGET * difference / knee
            } else {
                COLOUR_TARGET + (difference - knee) / (largest - knee) * (1.0 - COLOUR_TARGET)
            };
            let edges = (seen_reference.edges[index] - seen_test.edges[index]).abs();
            let points = (seen_reference.points[index] - seen_test.points[index]).abs();
            // The exponent on feature differences is ½ (§4.2.2).
            let feature = (edges.max(points) / SQRT_2).sqrt();
            colour.powf(1.0 - feature)
        })
        .collect()
}

/// What an eye keeps of an image.
struct Seen {
    /// Hunt-adjusted L*a*b* after the contrast sensitivity filters.
    lab: Vec<[f64; 3]>,
    /// Strength of edges, 0–1.
    edges: Plane,
    /// Strength of points and thin lines, 0–1.
    points: Plane,
}

impl Seen {
    fn new(space: &ColourSpace, rgb: &[Plane; 3], width: usize) -> Self {
        let mut opponent: [Plane; 3] = [(); 3].map(|()| Vec::with_capacity(rgb[0].len()));
        for ((&r, &g), &b) in rgb[0].iter().zip(&rgb[1]).zip(&rgb[2]) {
            for (plane, value) in opponent.iter_mut().zip(space.opponent_from_rgb([r, g, b])) {
                plane.push(value);
            }
        }
        let filtered = contrast_sensitivity(&opponent, width);
        let lab = (0..rgb[0].len())
            .map(|index| {
                let seen =
                    space.rgb_from_opponent([filtered[0][index], filtered[1][index], filtered[2][index]]);
                // The filters ring beyond what a screen can show.
                space.hunt_lab_from_rgb(seen.map(|value| value.clamp(0.0, 1.0)))
            })
            .collect();
        let luminance: Plane = opponent[0].iter().map(|y| (y + 16.0) / 116.0).collect();
        let (edges, points) = features(&luminance, width);
        Self { lab, edges, points }
    }
}

/// Filters Y, Cx and Cz by the contrast sensitivity of the achromatic, red-green and blue-yellow channels (§4.1.1):
/// each a sum of Gaussians a·√(π/b)·exp(−π²x²/b), x in degrees.
fn contrast_sensitivity(opponent: &[Plane; 3], width: usize) -> [Plane; 3] {
    const TERMS: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
    const WIDEST: f64 = 0.04;
    // exp(−π²x²/b) is a Gaussian with σ = √(b/2π²).
    let sigma_px = |b: f64| (b / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma_px(WIDEST)).ceil() as usize;
    let filter = |plane: &Plane, terms: &[(f64, f64)]| {
        // A sum of Gaussians is not separable, but each is: filter by each, normalised, and weigh by its 2D sum.
        let sums: Vec<f64> = terms
            .iter()
            .map(|&(a, b)| {
                let line: f64 = offsets(radius).map(|x| (-0.5 * (x / sigma_px(b)).powi(2)).exp()).sum();
                a * (PI / b).sqrt() * line * line
            })
            .collect();
        let total: f64 = sums.iter().sum();
        let mut out = vec![0.0; plane.len()];
        for (&(_, b), sum) in terms.iter().zip(&sums) {
            let kernel = gaussian(sigma_px(b), radius);
            for (out, value) in out.iter_mut().zip(convolve(plane, width, &kernel, &kernel)) {
                *out += sum / total * value;
            }
        }
        out
    };
    [0, 1, 2].map(|channel| filter(&opponent[channel], TERMS[channel]))
}

/// Edge and point strength: lengths of the first and of the second derivatives of a Gaussian along x and y (§4.2.1).
fn features(luminance: &Plane, width: usize) -> (Plane, Plane) {
    let sigma = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma).ceil() as usize;
    let smooth = gaussian(sigma, radius);
    let along = |derivative: fn(f64) -> f64| {
        let raw = offsets(radius).zip(&smooth).map(|(x, weight)| derivative(x / sigma) * weight).collect();
        let kernel = balanced(raw);
        let x = convolve(luminance, width, &kernel, &smooth);
        let y = convolve(luminance, width, &smooth, &kernel);
        x.iter().zip(&y).map(|(x, y)| length(*x, *y)).collect()
    };
    (along(|x| -x), along(|x| x * x - 1.0))
}

/// Scales positive weights to sum to 1 and negative ones to −1.
fn balanced(mut kernel: Vec<f64>) -> Vec<f64> {
    let positive: f64 = kernel.iter().filter(|weight| **weight > 0.0).sum();
    let negative: f64 = -kernel.iter().filter(|weight| **weight < 0.0).sum::<f64>();
    for weight in &mut kernel {
        *weight /= if *weight > 0.0 { positive } else { negative };
    }
    kernel
}

/// Values here are far from overflow, which `hypot` guards against at five times the cost.
fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Distance of large colour differences: city-block in lightness, Euclidean in hue and chroma (§4.1.2).
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + length(p[1] - q[1], p[2] - q[2])
}

/// The conversions between linear sRGB, the linear opponent space YCxCz, and Hunt-adjusted CIE L*a*b*.
struct ColourSpace {
    rgb_from_xyz: [[f64; 3]; 3],
    white: [f64; 3],
}

impl ColourSpace {
    fn new() -> Self {
        let white = XYZ_FROM_RGB.map(|row| row.iter().sum());
        Self { rgb_from_xyz: inverse(&XYZ_FROM_RGB), white }
    }

    /// XYZ relative to the white point.
    fn relative_xyz(&self, rgb: [f64; 3]) -> [f64; 3] {
        let xyz = transform(&XYZ_FROM_RGB, rgb);
        [xyz[0] / self.white[0], xyz[1] / self.white[1], xyz[2] / self.white[2]]
    }

    fn opponent_from_rgb(&self, rgb: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = self.relative_xyz(rgb);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    fn rgb_from_opponent(&self, [luma, cx, cz]: [f64; 3]) -> [f64; 3] {
        let y = (luma + 16.0) / 116.0;
        let xyz = [(y + cx / 500.0) * self.white[0], y * self.white[1], (y - cz / 200.0) * self.white[2]];
        transform(&self.rgb_from_xyz, xyz)
    }

    /// CIE L*a*b* with a* and b* scaled by L*/100: colours look less saturated where it is dark (Hunt effect).
    fn hunt_lab_from_rgb(&self, rgb: [f64; 3]) -> [f64; 3] {
        const DELTA: f64 = 6.0 / 29.0;
        let [x, y, z] = self
            .relative_xyz(rgb)
            .map(|t| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 });
        let lightness = 116.0 * y - 16.0;
        [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
    }

    /// The largest difference that sRGB has, between its green and its blue (§4.1.3).
    fn largest_difference(&self) -> f64 {
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|rgb| self.hunt_lab_from_rgb(rgb));
        hyab(green, blue).powf(COLOUR_EXPONENT)
    }
}

fn transform(matrix: &[[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// The inverse by cofactors; the primaries are independent, so the determinant is not zero.
fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let determinant: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    std::array::from_fn(|r| std::array::from_fn(|c| minor(c, r) / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plain(rgb: [f64; 3]) -> [Plane; 3] {
        rgb.map(|value| vec![value; 24 * 24])
    }

    #[test]
    fn equal_images_differ_by_nothing() {
        let image = plain([0.2, 0.4, 0.1]);
        assert!(flip(&image, &image, 24).iter().all(|value| *value == 0.0));
    }

    #[test]
    fn plain_green_and_plain_blue_are_as_different_as_colours_can_be() {
        let map = flip(&plain([0.0, 1.0, 0.0]), &plain([0.0, 0.0, 1.0]), 24);
        assert!(map.iter().all(|value| (value - 1.0).abs() < 1e-9), "{}", map[0]);
    }

    #[test]
    fn a_lost_point_weighs_more_than_its_colour_alone() {
        let without = plain([0.2; 3]);
        let mut with = without.clone();
        for plane in &mut with {
            plane[12 * 24 + 12] = 1.0;
        }
        let map = flip(&without, &with, 24);
        let far = map[0];
        let here = map[12 * 24 + 12];
        assert!(far < 1e-6 && here > 0.3, "far {far}, here {here}");
    }

    #[test]
    fn the_colour_conversion_is_inverted_exactly() {
        let space = ColourSpace::new();
        for rgb in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.1, 0.7, 0.3]] {
            let back = space.rgb_from_opponent(space.opponent_from_rgb(rgb));
            assert!(
                rgb.iter().zip(back).all(|(value, back)| (value - back).abs() < 1e-12),
                "{rgb:?} → {back:?}"
            );
        }
    }
}
