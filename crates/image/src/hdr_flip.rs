//! HDR-FLIP: how different two images look at the exposures that show what they hold.
//!
//! Andersson, Nilsson, Shirley, Akenine-Möller: "Visualizing Errors in Rendered High Dynamic Range Images",
//! Eurographics 2021 short papers. Both images are exposed from where the reference's brightest place is well shown to
//! where its median is, tone-mapped, and compared by LDR-FLIP; each pixel's largest difference counts.

use crate::colour::luminance_f64;
use crate::filter::Plane;
use crate::flip::flip;

/// The tone curve (k₀x² + k₁x + k₂) / (k₃x² + k₄x + k₅) of the authors' tools: Narkowicz' fit of ACES, with its
/// pre-exposure of 0.6.
const ACES: [f64; 6] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];
/// What the brightest place and the median are mapped to at the two ends.
const SHOWN: f64 = 0.85;
/// A darker median would need exposures at which nothing but noise is seen; the authors' tools stop here, too.
const LEAST_LUMINANCE: f64 = f32::EPSILON as f64;
/// The largest FLIP difference of every pixel. Both images are planes R, G, B of linear values, `width` pixels wide; the
/// pixels of `keep` decide the exposures.
pub(crate) fn hdr_flip(reference: &[Plane; 3], test: &[Plane; 3], keep: &[bool], width: usize) -> Plane {
    let factors = exposures(reference, keep).into_iter().map(f64::exp2);
    let curves: Vec<_> = factors.map(|factor| move |value: f64| tone_mapped(value * factor)).collect();
    flip(reference, test, width, &curves)
}

fn tone_mapped(value: f64) -> f64 {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let x = value.max(0.0);
    ((k0 * x * x + k1 * x + k2) / (k3 * x * x + k4 * x + k5)).clamp(0.0, 1.0)
}

/// The value that the tone curve maps to [`SHOWN`].
fn shown_at() -> f64 {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let [a, b, c] = [k0 - SHOWN * k3, k1 - SHOWN * k4, k2 - SHOWN * k5];
    (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a)
}

/// Exposures in stops, §3: from start to stop about one apart.
fn exposures(reference: &[Plane; 3], keep: &[bool]) -> Vec<f64> {
    let [r, g, b] = reference;
    let kept = (0..keep.len()).filter(|index| keep[*index]);
    let mut luminances: Vec<f64> = kept.map(|i| luminance_f64([r[i], g[i], b[i]]).max(0.0)).collect();
    let brightest = luminances.iter().copied().fold(0.0, f64::max);
    // Of an even number the upper one, as in the authors' tools; without any pixel nothing is measured.
    let middle = luminances.len() / 2;
    let median = if luminances.is_empty() {
        0.0
    } else {
        *luminances.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let stops = |value: f64| (shown_at() / value.max(LEAST_LUMINANCE)).log2();
    let (start, stop) = (stops(brightest), stops(median));
    let count = ((stop - start).ceil() as usize).max(2);
    (0..count).map(|i| start + (stop - start) * i as f64 / (count - 1) as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exposures_of(luminances: &[f64]) -> Vec<f64> {
        exposures(&[(); 3].map(|()| luminances.to_vec()), &vec![true; luminances.len()])
    }

    #[test]
    fn exposures_lead_from_the_brightest_place_to_the_median() {
        let found = exposures_of(&[64.0, 1.0, 8.0]);
        assert_eq!(found.len(), 3);
        for (exposure, luminance) in [(found[0], 64.0), (found[2], 8.0)] {
            assert!((tone_mapped(luminance * exposure.exp2()) - SHOWN).abs() < 1e-12);
        }
        assert!((found[1] - found[0] - 1.5).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn plain_and_black_images_have_finite_exposures() {
        assert_eq!(exposures_of(&[2.0; 4]).len(), 2);
        let dark = exposures_of(&[0.0, 0.0, 0.0, 1.0]);
        assert!(dark.len() == 23 && dark.iter().all(|exposure| exposure.is_finite()), "{dark:?}");
    }
}
