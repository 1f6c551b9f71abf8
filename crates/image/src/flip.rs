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
use std::iter;

use rayon::prelude::*;

use crate::colour::{cube_root_from, rough_cube_root};
use crate::filter::{Plane, gaussian, offsets};

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

/// Columns and rows that are compared at once: what they need stays in a core's cache.
const TILE: [usize; 2] = [128, 64];
/// Neighbours that are summed up together, in registers. Tiles are as many columns wide, or a multiple.
const LANES: usize = 32;

/// The largest FLIP difference of every pixel over all `curves`, each of which maps values of both images to the 0–1 of a
/// screen. The images are planes R, G, B of linear values, `width` pixels wide.
pub(crate) fn flip<C: Fn(f64) -> f64 + Sync>(
    reference: &[Plane; 3],
    test: &[Plane; 3],
    width: usize,
    curves: &[C],
) -> Plane {
    let eye = Eye::new();
    let height = reference[0].len() / width;
    let mut out = vec![0.0; width * height];
    let corners: Vec<[usize; 2]> =
        (0..height).step_by(TILE[1]).flat_map(|y| (0..width).step_by(TILE[0]).map(move |x| [x, y])).collect();
    let tiles: Vec<_> = corners
        .par_iter()
        .map(|&[x, y]| {
            let tile = Tile {
                x,
                y,
                width: TILE[0].min(width - x).next_multiple_of(LANES),
                height: TILE[1].min(height - y),
            };
            let [reference, test] = [reference, test]
                .map(|image| image.each_ref().map(|plane| tile.cut(plane, width, eye.radius)));
            (tile, eye.largest(&tile, &reference, &test, curves))
        })
        .collect();
    for (tile, values) in tiles {
        let rows = out[tile.y * width..].chunks_mut(width).zip(values.chunks_exact(tile.width));
        for (out, values) in rows {
            let out = &mut out[tile.x..];
            let columns = out.len().min(tile.width);
            out[..columns].copy_from_slice(&values[..columns]);
        }
    }
    out
}

/// A part of an image. It may reach beyond the right border.
#[derive(Clone, Copy)]
struct Tile {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

impl Tile {
    /// What a plane holds here and `margin` pixels around. Pixels beyond the border take the border's value.
    fn cut(&self, plane: &[f64], width: usize, margin: usize) -> Vec<f64> {
        let last = plane.len() / width - 1;
        let mut out = Vec::with_capacity((self.width + 2 * margin) * (self.height + 2 * margin));
        for y in self.y..self.y + self.height + 2 * margin {
            let row = &plane[y.saturating_sub(margin).min(last) * width..][..width];
            let (start, end) = (self.x.saturating_sub(margin), (self.x + self.width + margin).min(width));
            let [left, right] = [start + margin - self.x, self.x + self.width + margin - end];
            out.extend(iter::repeat_n(row[0], left));
            out.extend_from_slice(&row[start..end]);
            out.extend(iter::repeat_n(row[width - 1], right));
        }
        out
    }
}

/// What an eye does with an image, as far as it is linear. Thus the test image can go through it as its difference from
/// the reference: then `f32` is exact enough even where the two are almost equal.
struct Eye {
    space: ColourSpace,
    /// The widest kernel's.
    radius: usize,
    /// Contrast sensitivity to Y, Cx and Cz: sums of kernels along rows and along columns.
    sensitivity: [Vec<[Kernel; 2]>; 3],
    smooth: Kernel,
    /// Detectors of edges and of points.
    slope: Kernel,
    bend: Kernel,
}

/// What an eye keeps of a tile.
struct Seen {
    /// Y, Cx and Cz after the contrast sensitivity filters, from `base` on: filters leave what is plain as it is, which thus
    /// keeps all its digits.
    opponent: [Vec<f32>; 3],
    base: [f64; 3],
    /// Along x and along y.
    edges: [Vec<f32>; 2],
    points: [Vec<f32>; 2],
}

impl Eye {
    fn new() -> Self {
        let sensitivity = contrast_sensitivity();
        let sigma = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE;
        let radius = (3.0 * sigma).ceil() as usize;
        let smooth = gaussian(sigma, radius);
        let detector = |derivative: fn(f64) -> f64| {
            balanced(offsets(radius).zip(&smooth).map(|(x, weight)| derivative(x / sigma) * weight).collect())
        };
        // Edge and point strength: lengths of the first and of the second derivatives of a Gaussian (§4.2.1).
        let (slope, bend) = (detector(|x| -x), detector(|x| x * x - 1.0));
        let (smooth, slope, bend) =
            (Kernel::even(&smooth), Kernel::odd(&slope), Kernel::even(&bend).without_mean());
        let widest = sensitivity.iter().flatten().flatten().chain([&smooth]).map(Kernel::radius).max();
        Self { space: ColourSpace::new(), radius: widest.unwrap_or(0), sensitivity, smooth, slope, bend }
    }

    /// The largest difference of every pixel of a tile over all curves.
    fn largest(
        &self,
        tile: &Tile,
        reference: &[Vec<f64>; 3],
        test: &[Vec<f64>; 3],
        curves: &[impl Fn(f64) -> f64],
    ) -> Vec<f64> {
        // Of the logarithm, which is cheaper.
        let mut largest = vec![f64::NEG_INFINITY; tile.width * tile.height];
        if reference == test {
            return vec![0.0; largest.len()];
        }
        for curve in curves {
            let shown = reference.each_ref().map(|plane| plane.iter().map(|value| curve(*value)).collect());
            let change: [Vec<f64>; 3] = [0, 1, 2].map(|channel| {
                let pairs = test[channel].iter().zip::<&Vec<f64>>(&shown[channel]);
                pairs.map(|(test, shown)| curve(*test) - shown).collect()
            });
            if change.iter().flatten().all(|change| *change == 0.0) {
                continue;
            }
            let [shown, change] = [shown, change].map(|rgb| self.see(tile, &rgb));
            self.raise(&mut largest, &shown, &change);
        }
        largest.into_iter().map(f64::exp).collect()
    }

    fn see(&self, tile: &Tile, rgb: &[Vec<f64>; 3]) -> Seen {
        let rows = self.space.opponent_from_rgb;
        let corner = rgb.each_ref().map(|plane| plane[..1].to_vec());
        let base = rows.map(|row| mixed(row, &corner, |value| value)[0]);
        let opponent: [Vec<f32>; 3] =
            [0, 1, 2].map(|channel| mixed(rows[channel], rgb, |value| (value - base[channel]) as f32));
        let margin = self.radius;
        let along_rows = |plane: &[f32], kernel: &Kernel| {
            let mut out = vec![0.0; tile.width * (tile.height + 2 * margin)];
            let rows = plane.chunks_exact(tile.width + 2 * margin).zip(out.chunks_exact_mut(tile.width));
            for (row, out) in rows {
                kernel.apply(out, |offset| &row[margin.wrapping_add_signed(offset)..][..tile.width]);
            }
            out
        };
        let along_columns = |plane: &[f32], kernel: &Kernel| {
            let mut out = vec![0.0; tile.width * tile.height];
            for (y, out) in out.chunks_exact_mut(tile.width).enumerate() {
                kernel.apply(out, |offset| {
                    &plane[(y + margin).wrapping_add_signed(offset) * tile.width..][..tile.width]
                });
            }
            out
        };
        let luminance = &opponent[0];
        let smooth = along_rows(luminance, &self.smooth);
        let [edges, points] = [&self.slope, &self.bend].map(|kernel| {
            [along_columns(&along_rows(luminance, kernel), &self.smooth), along_columns(&smooth, kernel)]
        });
        let opponent = [0, 1, 2].map(|channel| {
            let parts = self.sensitivity[channel].iter().map(|[horizontal, vertical]| {
                along_columns(&along_rows(&opponent[channel], horizontal), vertical)
            });
            let sum = |mut sum: Vec<f32>, part: Vec<f32>| {
                sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
                sum
            };
            parts.reduce(sum).unwrap_or_default()
        });
        Seen { opponent, base, edges, points }
    }

    /// Raises logarithms of differences to those between what is seen of the reference and what is seen with a change.
    fn raise(&self, largest: &mut [f64], reference: &Seen, change: &Seen) {
        let whole = |seen: &Seen, channel: usize| {
            let base = seen.base[channel];
            seen.opponent[channel].iter().map(|value| base + f64::from(*value)).collect::<Vec<_>>()
        };
        let shown = [0, 1, 2].map(|channel| whole(reference, channel));
        let test = [0, 1, 2].map(|channel| {
            let pairs = shown[channel].iter().zip(whole(change, channel));
            pairs.map(|(value, change)| value + change).collect()
        });
        let colours = hyab(&self.space.roots(&shown), &self.space.roots(&test));
        let edges = difference_of_lengths(&reference.edges, &change.edges);
        let points = difference_of_lengths(&reference.points, &change.points);
        let features = edges.iter().zip(&points);
        for ((largest, colour), (edge, point)) in largest.iter_mut().zip(&colours).zip(features) {
            // The exponent on feature differences is ½ (§4.2.2).
            let feature = (edge.max(*point) / SQRT_2).sqrt();
            *largest = largest.max(self.space.ln_colour(*colour) * (1.0 - feature));
        }
    }
}

/// The weighted sum of three planes.
fn mixed<U>([u, v, w]: [f64; 3], [a, b, c]: &[Vec<f64>; 3], then: impl Fn(f64) -> U) -> Vec<U> {
    let values = a.iter().zip(b).zip(c);
    values.map(|((&a, &b), &c)| then(u * a + v * b + w * c)).collect()
}

/// Of vectors, and of the same with a change.
fn difference_of_lengths([x, y]: &[Vec<f32>; 2], [dx, dy]: &[Vec<f32>; 2]) -> Vec<f64> {
    let vectors = x.iter().zip(y).zip(dx.iter().zip(dy));
    let difference = |((x, y), (dx, dy)): ((&f32, &f32), (&f32, &f32))| {
        let [x, y, dx, dy] = [*x, *y, *dx, *dy].map(f64::from);
        (length(x + dx, y + dy) - length(x, y)).abs()
    };
    vectors.map(difference).collect()
}

/// A kernel that is symmetric about its middle, up to the sign.
struct Kernel {
    /// Of the middle.
    middle: f32,
    /// Of the neighbours, from the nearest on.
    weights: Vec<f32>,
    symmetry: Symmetry,
}

#[derive(Clone, Copy)]
enum Symmetry {
    Even,
    Odd,
    /// Even, and 0 on what is plain.
    Bend,
}

impl Kernel {
    fn even(kernel: &[f64]) -> Self {
        Self::new(kernel, Symmetry::Even)
    }

    fn odd(kernel: &[f64]) -> Self {
        Self::new(kernel, Symmetry::Odd)
    }

    fn new(kernel: &[f64], symmetry: Symmetry) -> Self {
        /// What is left out of a sum that is about 1.
        const NOTHING: f64 = 1e-12;
        let radius = kernel.len() / 2;
        let mut weights = kernel[radius + 1..].to_vec();
        while weights.last().is_some_and(|weight| weight.abs() < NOTHING) {
            weights.pop();
        }
        Self {
            middle: kernel[radius] as f32,
            weights: weights.into_iter().map(|weight| weight as f32).collect(),
            symmetry,
        }
    }

    fn without_mean(self) -> Self {
        Self { middle: 0.0, symmetry: Symmetry::Bend, ..self }
    }

    fn radius(&self) -> usize {
        self.weights.len()
    }

    /// The sum of rows at offsets from the one of the middle.
    fn apply<'a>(&self, out: &mut [f32], row: impl Fn(isize) -> &'a [f32]) {
        match self.symmetry {
            Symmetry::Even => self.folded(out, row, |before, _, after| before + after),
            Symmetry::Odd => self.folded(out, row, |before, _, after| after - before),
            Symmetry::Bend => self.folded(out, row, |before, here, after| (before - here) + (after - here)),
        }
    }

    fn folded<'a>(
        &self,
        out: &mut [f32],
        row: impl Fn(isize) -> &'a [f32],
        fold: impl Fn(f32, f32, f32) -> f32,
    ) {
        for (index, group) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let lanes = |offset| row(offset)[index * LANES..].first_chunk::<LANES>().unwrap_or(&[0.0; LANES]);
            let here = lanes(0);
            let mut sum = here.map(|value| self.middle * value);
            for (offset, weight) in (1..).zip(&self.weights) {
                let (before, after) = (lanes(-offset), lanes(offset));
                for lane in 0..LANES {
                    sum[lane] += weight * fold(before[lane], here[lane], after[lane]);
                }
            }
            *group = sum;
        }
    }
}

/// The contrast sensitivity of the achromatic, red-green and blue-yellow channels (§4.1.1): each a sum of Gaussians
/// a·√(π/b)·exp(−π²x²/b), x in degrees. Such a sum is not separable, but each Gaussian is.
fn contrast_sensitivity() -> [Vec<[Kernel; 2]>; 3] {
    const TERMS: [&[(f64, f64)]; 3] = [&[(1.0, 0.0047)], &[(1.0, 0.0053)], &[(34.1, 0.04), (13.5, 0.025)]];
    const WIDEST: f64 = 0.04;
    // exp(−π²x²/b) is a Gaussian with σ = √(b/2π²).
    let sigma_px = |b: f64| (b / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE;
    let radius = (3.0 * sigma_px(WIDEST)).ceil() as usize;
    TERMS.map(|terms| {
        // Filter by each, normalised, and weigh by its 2D sum.
        let sums = terms.iter().map(|&(a, b)| {
            let line: f64 = offsets(radius).map(|x| (-0.5 * (x / sigma_px(b)).powi(2)).exp()).sum();
            a * (PI / b).sqrt() * line * line
        });
        let total: f64 = sums.clone().sum();
        let kernels = terms.iter().zip(sums).map(|(&(_, b), sum)| {
            let kernel = gaussian(sigma_px(b), radius);
            let weighed: Vec<f64> = kernel.iter().map(|weight| weight * sum / total).collect();
            [Kernel::even(&weighed), Kernel::even(&kernel)]
        });
        kernels.collect()
    })
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

/// The conversions between linear sRGB, the linear opponent space YCxCz (but for scale and offset: Y, X − Y and Y − Z
/// relative to white), and Hunt-adjusted CIE L*a*b*; and how colour differences are weighed.
struct ColourSpace {
    opponent_from_rgb: [[f64; 3]; 3],
    rgb_from_opponent: [[f64; 3]; 3],
    /// Relative to the white point.
    xyz_from_rgb: [[f64; 3]; 3],
    /// The largest difference that sRGB has, between its green and its blue (§4.1.3).
    largest: f64,
    /// The one that [`COLOUR_TARGET`] is for, and how smaller ones are scaled.
    ln_knee: f64,
    ln_scale: f64,
}

impl ColourSpace {
    fn new() -> Self {
        let xyz_from_rgb = XYZ_FROM_RGB.map(|row| row.map(|value| value / row.iter().sum::<f64>()));
        let [x, y, z] = xyz_from_rgb;
        let minus = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|channel| p[channel] - q[channel]);
        let opponent_from_rgb = [y, minus(x, y), minus(y, z)];
        let space = Self {
            opponent_from_rgb,
            rgb_from_opponent: inverse(&opponent_from_rgb),
            xyz_from_rgb,
            largest: 0.0,
            ln_knee: 0.0,
            ln_scale: 0.0,
        };
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|rgb| space.roots(&opponent_from_rgb.map(|row| mixed(row, &rgb.map(|v| vec![v]), |v| v))));
        let largest = hyab(&green, &blue)[0].powf(COLOUR_EXPONENT);
        let ln_knee = (COLOUR_KNEE * largest).ln();
        Self { largest, ln_knee, ln_scale: COLOUR_TARGET.ln() - ln_knee, ..space }
    }

    /// What CIE L*a*b* is made of: cube roots of relative XYZ, but for dark colours.
    fn roots(&self, opponent: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        const DELTA: f64 = 6.0 / 29.0;
        // The filters ring beyond what a screen can show.
        let rgb = self.rgb_from_opponent.map(|row| mixed(row, opponent, |value| value.clamp(0.0, 1.0)));
        self.xyz_from_rgb.map(|row| {
            // In two loops, of which the first takes twice as many at once.
            let mut xyz = mixed(row, &rgb, |t| t);
            let rough: Vec<f32> = xyz.iter().map(|t| rough_cube_root(t.max(DELTA.powi(3)) as f32)).collect();
            for (t, rough) in xyz.iter_mut().zip(rough) {
                let (root, line) = (cube_root_from(rough, *t), *t / (3.0 * DELTA * DELTA) + 4.0 / 29.0);
                *t = if *t > DELTA.powi(3) { root } else { line };
            }
            xyz
        })
    }

    /// The logarithm of a colour difference scaled to 0–1 (§4.1.3).
    fn ln_colour(&self, hyab: f64) -> f64 {
        let ln = COLOUR_EXPONENT * hyab.ln();
        if ln < self.ln_knee {
            return ln + self.ln_scale;
        }
        let knee = COLOUR_KNEE * self.largest;
        (COLOUR_TARGET + (ln.exp() - knee) / (self.largest - knee) * (1.0 - COLOUR_TARGET)).ln()
    }
}

/// Distances of large colour differences: city-block in lightness, Euclidean in hue and chroma (§4.1.2).
fn hyab(p: &[Vec<f64>; 3], q: &[Vec<f64>; 3]) -> Vec<f64> {
    // CIE L*a*b* with a* and b* scaled by L*/100: colours look less saturated where it is dark (Hunt effect).
    let hunt_lab = |[x, y, z]: [f64; 3]| {
        let lightness = 116.0 * y - 16.0;
        [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
    };
    let count = p[0].len();
    let (p, q) = (p.each_ref().map(|plane| &plane[..count]), q.each_ref().map(|plane| &plane[..count]));
    let difference = |i: usize| {
        let (p, q) = (hunt_lab(p.map(|plane| plane[i])), hunt_lab(q.map(|plane| plane[i])));
        (p[0] - q[0]).abs() + length(p[1] - q[1], p[2] - q[2])
    };
    (0..count).map(difference).collect()
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

    fn flip(reference: &[Plane; 3], test: &[Plane; 3], width: usize) -> Plane {
        super::flip(reference, test, width, &[|value| value])
    }

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
        let times =
            |m: [[f64; 3]; 3], v: [f64; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
        for rgb in [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.1, 0.7, 0.3]] {
            let back = times(space.rgb_from_opponent, times(space.opponent_from_rgb, rgb));
            assert!(
                rgb.iter().zip(back).all(|(value, back)| (value - back).abs() < 1e-12),
                "{rgb:?} → {back:?}"
            );
        }
    }
}
