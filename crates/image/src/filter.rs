//! Separable convolution of one channel, the ground of the blur and of FLIP.

use rayon::prelude::*;

/// One channel of an image: values row after row from the top left.
pub(crate) type Plane = Vec<f64>;

/// Convolves with `horizontal` along the rows, then with `vertical` along the columns (both of odd length, centred).
/// Pixels beyond the border take the border's value.
pub(crate) fn convolve(plane: &[f64], width: usize, horizontal: &[f64], vertical: &[f64]) -> Plane {
    along_columns(&along_rows(plane, width, horizontal), width, vertical)
}

/// Neighbours that are summed up together, in registers.
const LANES: usize = 8;
/// Rows that a thread takes at least.
const ROWS: usize = 16;

fn along_rows(plane: &[f64], width: usize, kernel: &[f64]) -> Plane {
    let radius = kernel.len() / 2;
    let mut out = vec![0.0; plane.len()];
    let rows = plane.par_chunks_exact(width).zip(out.par_chunks_exact_mut(width));
    rows.with_min_len(ROWS).for_each_init(
        || vec![0.0; width + 2 * radius],
        |padded, (row, out_row)| {
            padded[..radius].fill(row[0]);
            padded[radius..radius + width].copy_from_slice(row);
            padded[radius + width..].fill(row[width - 1]);
            weighted_sum(out_row, kernel, |tap| &padded[tap..tap + width]);
        },
    );
    out
}

fn along_columns(plane: &[f64], width: usize, kernel: &[f64]) -> Plane {
    let radius = kernel.len() / 2;
    let height = plane.len() / width;
    let mut out = vec![0.0; plane.len()];
    out.par_chunks_exact_mut(width).with_min_len(ROWS).enumerate().for_each(|(y, out_row)| {
        weighted_sum(out_row, kernel, |tap| {
            let source = (y + tap).saturating_sub(radius).min(height - 1);
            &plane[source * width..(source + 1) * width]
        });
    });
    out
}

/// The sum of as many rows as there are weights, each as long as `out`.
fn weighted_sum<'a>(out: &mut [f64], weights: &[f64], row: impl Fn(usize) -> &'a [f64]) {
    let (groups, rest) = out.as_chunks_mut::<LANES>();
    for (index, group) in groups.iter_mut().enumerate() {
        let mut sum = [0.0; LANES];
        for (tap, weight) in weights.iter().enumerate() {
            let values = &row(tap)[index * LANES..][..LANES];
            for (sum, value) in sum.iter_mut().zip(values) {
                *sum += weight * value;
            }
        }
        *group = sum;
    }
    let first = groups.len() * LANES;
    for (index, value) in rest.iter_mut().enumerate() {
        *value = weights.iter().enumerate().map(|(tap, weight)| weight * row(tap)[first + index]).sum();
    }
}

/// exp(−x²/2σ²) for x = −radius…radius, summing to 1.
pub(crate) fn gaussian(sigma: f64, radius: usize) -> Vec<f64> {
    let raw: Vec<f64> = offsets(radius).map(|x| (-0.5 * (x / sigma).powi(2)).exp()).collect();
    let sum: f64 = raw.iter().sum();
    raw.into_iter().map(|weight| weight / sum).collect()
}

/// −radius…radius.
pub(crate) fn offsets(radius: usize) -> impl Iterator<Item = f64> {
    let radius = radius as i64;
    (-radius..=radius).map(|x| x as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_the_kernel_and_keeps_its_sum() {
        let mut plane = vec![0.0; 11 * 9];
        plane[4 * 11 + 5] = 2.0;
        let kernel = gaussian(1.0, 3);
        let blurred = convolve(&plane, 11, &kernel, &kernel);
        assert!((blurred.iter().sum::<f64>() - 2.0).abs() < 1e-12);
        assert!((blurred[4 * 11 + 5] - 2.0 * kernel[3] * kernel[3]).abs() < 1e-12);
        assert!((blurred[2 * 11 + 6] - 2.0 * kernel[1] * kernel[4]).abs() < 1e-12);
    }

    #[test]
    fn the_border_value_goes_on_outside() {
        let plane = vec![3.0; 2 * 2];
        let kernel = gaussian(2.0, 6);
        assert!(convolve(&plane, 2, &kernel, &kernel).iter().all(|value| (value - 3.0).abs() < 1e-12));
    }
}
