//! Weights of the blur.

use bytemuck::{Pod, Zeroable};

use crate::shadow::settings::{Representation, ShadowSettings, Sigma};

/// Texels that a blur reaches to each side, at most; as in `blur.wesl`.
pub(crate) const MAX_RADIUS: u32 = 32;

/// Twin of `Blur` in `blur.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Blur {
    pub(crate) radius: u32,
    pub(crate) prefilter: u32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
    pub(crate) weights: [f32; 36],
}

impl Blur {
    pub(crate) fn new(settings: &ShadowSettings) -> Self {
        let wanted = if settings.filter.blurs() { settings.filter_radius.ceil() as u32 } else { 0 };
        let radius = wanted.min(MAX_RADIUS);
        let mut weights = [0.0; 36];
        for (weight, exact) in weights.iter_mut().zip(half_kernel(radius, settings.sigma)) {
            *weight = exact as f32;
        }
        let prefilter = settings.representation == Representation::Exponential && settings.prefilter;
        Self { radius, prefilter: prefilter.into(), weights, ..Self::zeroed() }
    }

    /// Standard deviation of what a texel averages, texels.
    pub(crate) fn deviation(&self) -> f32 {
        let squares = (0u16..).zip(self.weights).map(|(k, weight)| 2.0 * f32::from(k).powi(2) * weight);
        // Quarters of both neighbours and half of the middle.
        let prefilter = if self.prefilter == 0 { 0.0 } else { 0.5 };
        (squares.sum::<f32>() + prefilter).sqrt()
    }
}

/// The weights from the middle outwards; all `2 · radius + 1` together are 1. Binomial ones are row `2 · radius` of
/// Pascal's triangle.
fn half_kernel(radius: u32, sigma: Sigma) -> Vec<f64> {
    let relative: Vec<f64> = match sigma.0 {
        Some(sigma) => {
            let scale = -0.5 / f64::from(sigma).powi(2);
            (0..=radius).map(|k| (f64::from(k * k) * scale).exp()).collect()
        }
        // C(2r, r + k + 1) = C(2r, r + k) · (r − k) / (r + k + 1)
        None => std::iter::successors(Some((0, 1.0)), |&(k, weight)| {
            (k < radius).then(|| (k + 1, weight * f64::from(radius - k) / f64::from(radius + k + 1)))
        })
        .map(|(_, weight)| weight)
        .collect(),
    };
    let sum = 2.0 * relative.iter().sum::<f64>() - relative[0];
    relative.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(kernel: &[f64]) -> f64 {
        2.0 * kernel.iter().sum::<f64>() - kernel[0]
    }

    #[test]
    fn all_weights_together_are_one() {
        for radius in 0..=MAX_RADIUS {
            for sigma in [None, Some(0.1), Some(1.5), Some(32.0)] {
                let kernel = half_kernel(radius, Sigma(sigma));
                assert_eq!(kernel.len(), radius as usize + 1);
                assert!((sum(&kernel) - 1.0).abs() < 1e-14, "radius {radius}, sigma {sigma:?}");
            }
        }
    }

    #[test]
    fn five_binomial_taps_are_the_fourth_row_of_pascals_triangle() {
        assert_eq!(half_kernel(2, Sigma(None)), [6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0]);
    }

    #[test]
    fn a_binomial_blur_of_radius_r_has_the_variance_r_over_2() {
        for radius in [1, 5, 32] {
            let kernel = half_kernel(radius, Sigma(None));
            let variance: f64 = (0..).zip(&kernel).map(|(k, weight)| 2.0 * f64::from(k * k) * weight).sum();
            assert!((variance - f64::from(radius) / 2.0).abs() < 1e-12, "radius {radius}: {variance}");
        }
    }

    #[test]
    fn the_middle_of_pascals_twelfth_row_is_a_gaussian_of_1_79() {
        let kernel = half_kernel(2, Sigma(Some(1.79)));
        for (weight, binomial) in kernel.iter().zip([924.0, 792.0, 495.0]) {
            assert!((weight - binomial / 3498.0).abs() < 3e-4, "{kernel:?}");
        }
    }

    #[test]
    fn gaussian_weights_fall_by_sigma() {
        let kernel = half_kernel(6, Sigma(Some(2.0)));
        assert!((kernel[2] / kernel[0] - (-0.5f64).exp()).abs() < 1e-12);
        assert!((kernel[6] / kernel[0] - (-4.5f64).exp()).abs() < 1e-12);
    }

    #[test]
    fn parts_of_texels_of_the_radius_count_as_whole_and_depth_is_not_blurred() {
        let mut settings = ShadowSettings { filter_radius: 2.1, ..ShadowSettings::default() };
        assert_eq!(Blur::new(&settings).radius, 0);
        settings.filter = crate::shadow::Filter::Gaussian;
        let blur = Blur::new(&settings);
        assert_eq!(blur.radius, 3);
        assert!((blur.deviation() - 1.5f32.sqrt()).abs() < 1e-6);
    }
}
