//! SSIM: how alike the structure of two pictures is.
//!
//! Wang, Bovik, Sheikh, Simoncelli: "Image Quality Assessment: From Error Visibility to Structural Similarity", IEEE
//! Transactions on Image Processing 13(4), 2004: means, variances and covariance under a Gaussian window around every
//! pixel. Why this is not a library: `docs/decisions/0003-flip-in-rust.md`.

use rayon::prelude::*;

use crate::filter::{Plane, convolve, gaussian};

/// The window's standard deviation and radius in pixels: 11×11 (§III-B).
const SIGMA_PX: f64 = 1.5;
const RADIUS_PX: usize = 5;
/// (K·L)² with K = 0.01 and 0.03 and a range L of 1: what keeps dark and plain places stable (§III-B).
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// The similarity of every pixel, −1 to 1 (same), of two planes in 0–1.
pub(crate) fn ssim(a: &Plane, b: &Plane, width: usize) -> Plane {
    let window = gaussian(SIGMA_PX, RADIUS_PX);
    let mean = |plane: &[f64]| convolve(plane, width, &window, &window);
    let pairs = || a.par_iter().zip(b);
    let products: Plane = pairs().map(|(a, b)| a * b).collect();
    let squares: Plane = pairs().map(|(a, b)| a * a + b * b).collect();
    let [mean_a, mean_b, products, squares] = [a, b, &products, &squares].map(|plane| mean(plane));
    (0..a.len())
        .into_par_iter()
        .map(|i| {
            let (mu_a, mu_b) = (mean_a[i], mean_b[i]);
            let variances = squares[i] - (mu_a * mu_a + mu_b * mu_b);
            let covariance = products[i] - mu_a * mu_b;
            (2.0 * mu_a * mu_b + C1) * (2.0 * covariance + C2)
                / ((mu_a * mu_a + mu_b * mu_b + C1) * (variances + C2))
        })
        .collect()
}
