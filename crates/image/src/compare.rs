//! How far one linear image is from another.

use rayon::prelude::*;
use serde::Serialize;

use crate::filter::{Plane, convolve, gaussian};
use crate::{Image, ImageError, colour, flip, hdr_flip, ssim};

/// What to measure: parts of the light, parts of the image, at which scale.
#[derive(Debug, Clone, Copy, Default)]
pub struct CompareOptions<'a> {
    /// Pixels where any channel of this image is above 0 are left out.
    pub mask: Option<&'a Image>,
    /// Subtracted from A first, to isolate one part of the light (`full − direct`, say).
    pub minus_a: Option<&'a Image>,
    /// Subtracted from B first.
    pub minus_b: Option<&'a Image>,
    /// Standard deviation in pixels of a Gaussian applied to both images, so that noise or sub-pixel detail does not
    /// count; 0 is none. Masked pixels take no part in it.
    pub blur_px: f64,
}

/// The distance of image A from the reference B, over all channels of the pixels that are not masked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Metrics {
    /// Energy: ΣA / ΣB. 1 is equal.
    pub mean_ratio: f64,
    /// Normalised mean absolute error: mean |A−B| / mean B.
    pub nmae: f64,
    /// Relative mean square error: mean of (A−B)² / (B² + (0.05 · mean B)²), without the worst 0.1 % of the pixels.
    pub relmse: f64,
    /// Pixels that were compared.
    pub pixels: usize,
    /// Channel values of A that were NaN or infinite, in the whole image; they are taken as 0.
    pub not_finite: usize,
    /// Peak signal-to-noise ratio in decibels, −10 log₁₀ of the mean square error of what a screen shows: both images
    /// exposed so that B's 99th percentile becomes 0.9, clamped to 0–1 and sRGB-encoded. Infinite for equal pictures,
    /// which JSON calls null.
    pub psnr: f64,
    /// Mean SSIM, −1 to 1 (same), of the luma of the same pictures.
    pub ssim: f64,
    /// Mean LDR-FLIP, 0 (same) to 1, at the same exposure.
    pub flip: f64,
    /// Mean HDR-FLIP, 0 (same) to 1: in each pixel the largest FLIP over the exposures that show what B holds.
    pub hdr_flip: f64,
}

/// Drops the pixels that one of the images does not hold.
fn leave_to_all(keep: &mut [bool], images: &[Option<&Image>]) -> Result<(), ImageError> {
    let mut any = true;
    for image in images.iter().flatten() {
        let ((width, _), held) = (image.size(), image.held());
        if (held.size[0], held.size[1]) == image.size() {
            continue;
        }
        any = false;
        for (index, keep) in keep.iter_mut().enumerate() {
            *keep &= held.contains([index as u32 % width, index as u32 / width]);
            any |= *keep;
        }
    }
    if any {
        return Ok(());
    }
    let held: Vec<String> = images.iter().flatten().map(|image| image.held().to_string()).collect();
    Err(ImageError::NoReference {
        problem: format!("the images are crops that have no pixel in common: {}", held.join("; ")),
        advice: "compare crops of the same place, and mask less of it".to_owned(),
    })
}

/// Two images made ready to be compared.
#[derive(Debug, Clone)]
pub struct Comparison {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) a: [Plane; 3],
    pub(crate) b: [Plane; 3],
    /// Pixels that take part.
    pub(crate) keep: Vec<bool>,
    /// Pixels where A had a value that is not finite.
    pub(crate) bad: Vec<bool>,
    /// Mean of B over the kept pixels and channels: the yardstick of the relative errors. Not 0.
    pub(crate) reference_mean: f64,
    pub(crate) not_finite: usize,
}

/// Sums over the channel values of the kept pixels, and the error that is none.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Light {
    pub(crate) a: f64,
    pub(crate) b: f64,
    /// Of |A − B|.
    pub(crate) absolute: f64,
    pub(crate) relmse: f64,
    pub(crate) pixels: usize,
}

impl Light {
    pub(crate) fn mean_ratio(&self) -> f64 {
        self.a / self.b
    }

    pub(crate) fn nmae(&self) -> f64 {
        self.absolute / self.b
    }
}

impl Comparison {
    /// Subtracts, masks and blurs as `options` say. `b` is the reference. Of crops ([`Image::held`]) the pixels count that
    /// all of what is compared and subtracted hold; a mask is 0 where it holds none.
    ///
    /// # Errors
    /// [`ImageError::SizesDiffer`] and [`ImageError::OriginsDiffer`]; [`ImageError::NotFinite`] when B or what is subtracted has NaN or infinity
    /// outside the mask (in A they are counted instead); [`ImageError::NoReference`] when the mask leaves nothing, crops
    /// have no pixel in common or B is black.
    pub fn new(a: &Image, b: &Image, options: &CompareOptions<'_>) -> Result<Self, ImageError> {
        let others = [
            ("A", Some(a)),
            ("the mask", options.mask),
            ("minus-a", options.minus_a),
            ("minus-b", options.minus_b),
        ];
        for (what, image) in others {
            if let Some(image) = image
                && image.size() != b.size()
            {
                return Err(ImageError::SizesDiffer { what, size: image.size(), reference: b.size() });
            }
        }
        for (what, image) in others {
            if let Some(image) = image
                && image.origin() != b.origin()
            {
                return Err(ImageError::OriginsDiffer {
                    what,
                    origin: image.origin(),
                    reference: b.origin(),
                });
            }
        }
        let mut keep: Vec<bool> = match options.mask {
            // NaN in a mask masks: what cannot be told to be outside is not measured.
            Some(mask) => mask.pixels().iter().map(|pixel| pixel.iter().all(|value| *value <= 0.0)).collect(),
            None => vec![true; b.pixels().len()],
        };
        leave_to_all(&mut keep, &[Some(a), Some(b), options.minus_a, options.minus_b])?;
        let trusted = [("B", Some(b)), ("minus-a", options.minus_a), ("minus-b", options.minus_b)];
        for (what, image) in trusted {
            image.map_or(Ok(()), |image| require_finite(what, image, &keep))?;
        }

        let width = b.width() as usize;
        let bad: Vec<bool> =
            a.pixels().iter().map(|pixel| pixel.iter().any(|value| !value.is_finite())).collect();
        let not_finite = a.pixels().iter().flatten().filter(|value| !value.is_finite()).count();
        let (mut a, mut b_planes) =
            rayon::join(|| difference(a, options.minus_a), || difference(b, options.minus_b));
        if options.blur_px > 0.0 {
            [a, b_planes] = blurred([a, b_planes], &keep, width, options.blur_px);
        }

        let pixels = keep.iter().filter(|keep| **keep).count();
        if pixels == 0 {
            return Err(ImageError::NoReference {
                problem: "no pixel is left".to_owned(),
                advice: "the mask must be 0 where the images are to be compared".to_owned(),
            });
        }
        let reference_mean = kept(&b_planes, &keep).sum::<f64>() / (3 * pixels) as f64;
        if reference_mean == 0.0 {
            return Err(ImageError::NoReference {
                problem: "the reference (B) is black where it is compared".to_owned(),
                advice: "check which images are compared, and what is subtracted or masked".to_owned(),
            });
        }
        let height = b.height() as usize;
        Ok(Self { width, height, a, b: b_planes, keep, bad, reference_mean, not_finite })
    }

    /// The figures.
    pub fn metrics(&self) -> Metrics {
        let hdr_flip = || self.mean(&self.hdr_flip_map());
        let ((light, (psnr, ssim, flip)), hdr_flip) =
            rayon::join(|| rayon::join(|| self.light(), || self.as_shown()), hdr_flip);
        Metrics {
            mean_ratio: light.mean_ratio(),
            nmae: light.nmae(),
            relmse: light.relmse,
            pixels: light.pixels,
            not_finite: self.not_finite,
            psnr,
            ssim,
            flip,
            hdr_flip,
        }
    }

    /// [`Metrics::relmse`] alone.
    pub fn relmse(&self) -> f64 {
        self.light().relmse
    }

    /// The factor that makes B's 99th percentile 0.9: what pictures of both are shown at.
    pub fn exposure(&self) -> f64 {
        0.9 / percentile(kept(&self.b, &self.keep), 0.99).max(1e-12)
    }

    /// What errors of radiance are made of.
    pub(crate) fn light(&self) -> Light {
        let floor = (0.05 * self.reference_mean).powi(2);
        let mut absolute = 0.0;
        let mut relative_squares = Vec::with_capacity(self.keep.len());
        for index in (0..self.keep.len()).filter(|index| self.keep[*index]) {
            let mut square = 0.0;
            for (a, b) in self.a.iter().zip(&self.b) {
                let (difference, b) = (a[index] - b[index], b[index]);
                absolute += difference.abs();
                square += difference * difference / (b * b + floor);
            }
            relative_squares.push(square / 3.0);
        }
        let pixels = relative_squares.len();
        let trusted = ((pixels as f64 * 0.999) as usize).max(1);
        let (best, worst, _) = relative_squares.select_nth_unstable_by(trusted - 1, f64::total_cmp);
        Light {
            a: kept(&self.a, &self.keep).sum(),
            b: kept(&self.b, &self.keep).sum(),
            absolute,
            relmse: (best.iter().sum::<f64>() + *worst) / trusted as f64,
            pixels,
        }
    }

    /// Mean LDR-FLIP.
    pub(crate) fn flip(&self) -> f64 {
        self.mean(&self.flip_map())
    }

    /// PSNR, mean SSIM and mean FLIP of what a screen shows.
    fn as_shown(&self) -> (f64, f64, f64) {
        let shown = self.shown();
        let (flip, (psnr, ssim)) = rayon::join(|| self.mean(&self.flip_of(shown)), || self.structure(shown));
        (psnr, ssim, flip)
    }

    /// PSNR and mean SSIM of sRGB values.
    fn structure(&self, shown: impl Fn(f64) -> f64 + Sync) -> (f64, f64) {
        let pixel = |index: usize| {
            let [a, b] = [&self.a, &self.b].map(|image| {
                image.each_ref().map(|plane| colour::srgb_from_linear_unit(shown(plane[index])))
            });
            let square: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
            // The weighted sum of encoded values, Rec. 709.
            ((colour::luminance_f64(a), colour::luminance_f64(b)), square)
        };
        let pixels = (0..self.keep.len()).into_par_iter();
        let ((luma_a, luma_b), squares): ((Plane, Plane), Plane) = pixels.map(pixel).unzip();
        let psnr = -10.0 * (self.mean(&squares) / 3.0).log10();
        (psnr, self.mean(&ssim::ssim(&luma_a, &luma_b, self.width)))
    }

    /// LDR-FLIP of every pixel.
    pub(crate) fn flip_map(&self) -> Plane {
        self.flip_of(self.shown())
    }

    /// HDR-FLIP of every pixel.
    pub(crate) fn hdr_flip_map(&self) -> Plane {
        hdr_flip::hdr_flip(&self.b, &self.a, &self.keep, self.width)
    }

    /// Maps values to 0–1, linear, exposed so that B's 99th percentile becomes 0.9.
    fn shown(&self) -> impl Fn(f64) -> f64 + Copy + Sync + use<> {
        let exposure = self.exposure();
        move |value| (value * exposure).clamp(0.0, 1.0)
    }

    fn flip_of(&self, shown: impl Fn(f64) -> f64 + Sync) -> Plane {
        flip::flip(&self.b, &self.a, self.width, &[shown])
    }

    /// Over the kept pixels.
    fn mean(&self, map: &Plane) -> f64 {
        let sum: f64 = map.iter().zip(&self.keep).filter(|(_, keep)| **keep).map(|(value, _)| value).sum();
        sum / self.keep.iter().filter(|keep| **keep).count() as f64
    }
}

/// All channel values of the kept pixels.
fn kept<'a>(planes: &'a [Plane; 3], keep: &'a [bool]) -> impl Iterator<Item = f64> + Clone + 'a {
    planes
        .iter()
        .flat_map(move |plane| plane.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value))
}

fn require_finite(what: &'static str, image: &Image, keep: &[bool]) -> Result<(), ImageError> {
    let mut count = 0;
    let mut first = None;
    for (index, (pixel, _)) in image.pixels().iter().zip(keep).enumerate().filter(|(_, (_, keep))| **keep) {
        let here = pixel.iter().filter(|value| !value.is_finite()).count();
        if here > 0 {
            count += here;
            first.get_or_insert((index as u32 % image.width(), index as u32 / image.width()));
        }
    }
    first.map_or(Ok(()), |first| Err(ImageError::NotFinite { what, count, first }))
}

/// The planes of `image − minus`; values that are not finite count as 0.
fn difference(image: &Image, minus: Option<&Image>) -> [Plane; 3] {
    let finite = |value: f32| if value.is_finite() { value as f64 } else { 0.0 };
    [0, 1, 2].map(|channel| {
        let whole = image.pixels().iter().map(|pixel| finite(pixel[channel]));
        match minus {
            Some(minus) => {
                whole.zip(minus.pixels()).map(|(value, part)| value - finite(part[channel])).collect()
            }
            None => whole.collect(),
        }
    })
}

/// Blurs the kept pixels of all images with weights that sum to 1 over the kept pixels.
fn blurred(images: [[Plane; 3]; 2], keep: &[bool], width: usize, sigma_px: f64) -> [[Plane; 3]; 2] {
    /// Far inside the mask no kept pixel is in reach; any value will do there, for it is not measured.
    const LEAST_WEIGHT: f64 = 1e-6;
    let kernel = gaussian(sigma_px, (3.0 * sigma_px).ceil() as usize);
    let weights: Plane = keep.iter().map(|keep| f64::from(u8::from(*keep))).collect();
    let reach = convolve(&weights, width, &kernel, &kernel);
    images.map(|planes| {
        planes.map(|mut plane| {
            for (value, weight) in plane.iter_mut().zip(&weights) {
                *value *= weight;
            }
            let mut plane = convolve(&plane, width, &kernel, &kernel);
            for (value, reach) in plane.iter_mut().zip(&reach) {
                *value /= reach.max(LEAST_WEIGHT);
            }
            plane
        })
    })
}

/// The value below which a share `rank` of `values` lies, interpolated linearly between neighbours. `values` has at
/// least one element.
fn percentile(values: impl Iterator<Item = f64> + Clone, rank: f64) -> f64 {
    /// One value of so many is looked at to leave out most that lie below, but for a share.
    const SAMPLE: usize = 61;
    const MARGIN: f64 = 0.02;
    let mut sample: Vec<f64> = values.clone().step_by(SAMPLE).collect();
    let low = ((rank - MARGIN).max(0.0) * (sample.len() - 1) as f64) as usize;
    let least = *sample.select_nth_unstable_by(low, f64::total_cmp).1;
    let (mut left_out, mut rest) = (0, Vec::new());
    values.clone().for_each(|value| if value < least { left_out += 1 } else { rest.push(value) });
    let position = rank * (left_out + rest.len() - 1) as f64;
    if (position as usize) < left_out {
        (left_out, rest) = (0, values.collect());
    }
    let below = position as usize;
    let (_, &mut low, above) = rest.select_nth_unstable_by(below - left_out, f64::total_cmp);
    let high = above.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    low + (high - low) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_percentile_interpolates_between_neighbours() {
        let of = |values: &[f64], rank| percentile(values.iter().copied(), rank);
        assert!((of(&[4.0, 1.0, 3.0, 2.0], 0.5) - 2.5).abs() < 1e-12);
        assert!((percentile((0..=100).rev().map(f64::from), 0.99) - 99.0).abs() < 1e-9);
        assert_eq!(of(&[7.0], 0.99), 7.0);
        assert_eq!(of(&[7.0, 8.0], 1.0), 8.0);
        // Where the sample misleads: it sees none but the largest.
        let misleading = (0..6100).map(|i| if i % 61 == 0 { 9000.0 } else { f64::from(i) });
        let mut sorted: Vec<f64> = misleading.clone().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        assert_eq!(percentile(misleading, 0.5), f64::midpoint(sorted[3049], sorted[3050]));
    }
}
