//! How far the frames of an animation are from those of a reference, and how they change otherwise than it does: flicker.

use serde::Serialize;

use crate::ImageError;
use crate::compare::{Comparison, Light};
use crate::filter::Plane;

/// The distance of a frame from the reference's, as [`Metrics`](crate::Metrics) has it, and of its change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FrameMetrics {
    /// Energy: ΣA / ΣB. 1 is equal.
    pub mean_ratio: f64,
    /// Normalised mean absolute error: mean |A−B| / mean B.
    pub nmae: f64,
    /// Relative mean square error, without the worst 0.1 % of the pixels.
    pub relmse: f64,
    /// Mean LDR-FLIP, 0 (same) to 1.
    pub flip: f64,
    /// mean |ΔA − ΔB| / mean B over all channels of the pixels that count in this frame and in the one before, Δ being a
    /// value's change since then; 0 changes as the reference does. `None` where there is no frame before, or no such pixel.
    pub flicker: Option<f64>,
    /// Pixels that were compared.
    pub pixels: usize,
    /// Channel values of A that were NaN or infinite; they are taken as 0.
    pub not_finite: usize,
}

/// The same over all frames that count. Energy, nmae and flicker are those of all frames' values together: their means and
/// sums run over frames, too. relmse and FLIP are means over frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SequenceMetrics {
    /// Frames that count.
    pub frames: usize,
    /// Changes from one of them to the next.
    pub changes: usize,
    /// Energy: ΣA / ΣB. 1 is equal.
    pub mean_ratio: f64,
    /// mean |A−B| / mean B.
    pub nmae: f64,
    /// Mean of the frames'.
    pub relmse: f64,
    /// Mean of the frames'.
    pub flip: f64,
    /// mean |ΔA − ΔB| over all changes / mean B over all frames; `None` without a change.
    pub flicker: Option<f64>,
    /// Pixels that were compared.
    pub pixels: usize,
    /// Channel values of A that were NaN or infinite.
    pub not_finite: usize,
}

/// A frame that was measured by itself, which any thread may do, and what its neighbours need to know of it: 25 bytes a
/// pixel.
#[derive(Debug, Clone)]
pub struct ComparedFrame {
    light: Light,
    flip: f64,
    not_finite: usize,
    size: (u32, u32),
    /// A − B: its change is ΔA − ΔB.
    difference: [Plane; 3],
    keep: Vec<bool>,
}

impl From<Comparison> for ComparedFrame {
    fn from(frame: Comparison) -> Self {
        let (light, flip) = (frame.light(), frame.flip());
        let Comparison { mut a, b, keep, not_finite, width, height, .. } = frame;
        for (a, b) in a.iter_mut().flatten().zip(b.iter().flatten()) {
            *a -= b;
        }
        Self { light, flip, not_finite, size: (width as u32, height as u32), difference: a, keep }
    }
}

/// Frames held against those of a reference, added in their order.
///
/// ```
/// use chiaro_image::{CompareOptions, Comparison, Image, Sequence};
///
/// let mut sequence = Sequence::default();
/// for off in [0.1, -0.1, 0.1] {
///     let (a, b) = (Image::filled(8, 8, [1.0 + off; 3]), Image::filled(8, 8, [1.0; 3]));
///     sequence.add(Comparison::new(&a, &b, &CompareOptions::default())?.into(), true)?;
/// }
/// let metrics = sequence.metrics().expect("frames were added");
/// assert!((metrics.nmae - 0.1).abs() < 1e-6);
/// assert!((metrics.flicker.expect("frames change") - 0.2).abs() < 1e-6);
/// # Ok::<(), chiaro_image::ImageError>(())
/// ```
#[derive(Debug, Default)]
pub struct Sequence {
    /// The last frame, and whether it counts.
    before: Option<(ComparedFrame, bool)>,
    frames: usize,
    /// Over the frames that count.
    light: Light,
    relmse: f64,
    flip: f64,
    not_finite: usize,
    changes: usize,
    change: Change,
}

/// Σ|ΔA − ΔB| over so many channel values.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    sum: f64,
    values: usize,
}

impl Change {
    /// Relative to a mean.
    fn flicker(self, mean_b: f64) -> Option<f64> {
        (self.values > 0).then(|| self.sum / self.values as f64 / mean_b)
    }
}

impl Sequence {
    /// Adds the frame that comes next. Those that do not count are measured, but take no part in
    /// [`Sequence::metrics`], nor do changes from or to them.
    ///
    /// # Errors
    /// [`ImageError::SizesDiffer`] where the frame before has another size.
    pub fn add(&mut self, frame: ComparedFrame, counts: bool) -> Result<FrameMetrics, ImageError> {
        let before = self.before.as_ref().map(|(before, counted)| (change(before, &frame), *counted));
        let change = match before {
            Some((change, counted)) => Some((change?, counted)),
            None => None,
        };
        let ComparedFrame { light, flip, not_finite, .. } = frame;
        if counts {
            self.frames += 1;
            self.light.a += light.a;
            self.light.b += light.b;
            self.light.absolute += light.absolute;
            self.light.pixels += light.pixels;
            self.relmse += light.relmse;
            self.flip += flip;
            self.not_finite += not_finite;
            if let Some((change, true)) = change
                && change.values > 0
            {
                self.changes += 1;
                self.change.sum += change.sum;
                self.change.values += change.values;
            }
        }
        self.before = Some((frame, counts));
        Ok(FrameMetrics {
            mean_ratio: light.mean_ratio(),
            nmae: light.nmae(),
            relmse: light.relmse,
            flip,
            flicker: change.and_then(|(change, _)| change.flicker(mean_b(light))),
            pixels: light.pixels,
            not_finite,
        })
    }

    /// Says that there is no frame where one was due: what follows is no change to what came before.
    pub fn skip(&mut self) {
        self.before = None;
    }

    /// Over all frames that count; `None` where there are none.
    pub fn metrics(&self) -> Option<SequenceMetrics> {
        let frames = self.frames as f64;
        (self.frames > 0).then(|| SequenceMetrics {
            frames: self.frames,
            changes: self.changes,
            mean_ratio: self.light.mean_ratio(),
            nmae: self.light.nmae(),
            relmse: self.relmse / frames,
            flip: self.flip / frames,
            flicker: self.change.flicker(mean_b(self.light)),
            pixels: self.light.pixels,
            not_finite: self.not_finite,
        })
    }
}

fn mean_b(light: Light) -> f64 {
    light.b / (3 * light.pixels) as f64
}

fn change(before: &ComparedFrame, frame: &ComparedFrame) -> Result<Change, ImageError> {
    if before.size != frame.size {
        return Err(ImageError::SizesDiffer {
            what: "the frame before",
            size: before.size,
            reference: frame.size,
        });
    }
    let kept = before.keep.iter().zip(&frame.keep).map(|(before, now)| *before && *now);
    let mut change = Change::default();
    for index in kept.enumerate().filter_map(|(index, kept)| kept.then_some(index)) {
        for (before, now) in before.difference.iter().zip(&frame.difference) {
            change.sum += (now[index] - before[index]).abs();
        }
        change.values += 3;
    }
    Ok(change)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CompareOptions, Image};

    /// Frames whose pixels all have the values that `a` and `b` list.
    fn flat(a: &[f32], b: &[f32]) -> (Vec<FrameMetrics>, Sequence) {
        let image = |value: &f32| Image::filled(6, 4, [*value, 2.0 * value, 0.5 * value]);
        measured(a.iter().map(image).zip(b.iter().map(image)).map(|(a, b)| (a, b, None)), 0)
    }

    fn measured(
        frames: impl IntoIterator<Item = (Image, Image, Option<Image>)>,
        from: usize,
    ) -> (Vec<FrameMetrics>, Sequence) {
        let mut sequence = Sequence::default();
        let add = |(index, (a, b, mask)): (usize, (Image, Image, Option<Image>))| {
            let options = CompareOptions { mask: mask.as_ref(), ..CompareOptions::default() };
            sequence.add(Comparison::new(&a, &b, &options).unwrap().into(), index >= from).unwrap()
        };
        let frames = frames.into_iter().enumerate().map(add).collect();
        (frames, sequence)
    }

    fn near(found: Option<f64>, expected: f64) {
        let found = found.expect("there is a value");
        assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
    }

    #[test]
    fn planted_flicker_is_found_to_its_height() {
        // 5 % up and down around a reference that rests: every change is 10 % of it.
        let (frames, sequence) = flat(&[2.1, 1.9, 2.1, 1.9], &[2.0; 4]);
        assert_eq!(frames[0].flicker, None);
        frames[1..].iter().for_each(|frame| near(frame.flicker, 0.1));
        let all = sequence.metrics().unwrap();
        near(all.flicker, 0.1);
        near(Some(all.nmae), 0.05);
        assert_eq!((all.frames, all.changes, all.pixels), (4, 3, 4 * 24));
    }

    #[test]
    fn a_difference_that_stays_does_not_flicker_and_a_change_that_is_missed_does() {
        let (frames, sequence) = flat(&[2.0, 3.0, 5.0], &[1.0, 2.0, 4.0]);
        assert!(frames[0].nmae > 0.9);
        near(sequence.metrics().unwrap().flicker, 0.0);
        // What does not move with the reference is off by the reference's own change, here 1 of 2 and 2 of 4.
        let (frames, sequence) = flat(&[1.0, 1.0, 1.0], &[1.0, 2.0, 4.0]);
        near(frames[1].flicker, 0.5);
        near(frames[2].flicker, 0.5);
        // (1 + 2) / 2 changes, of (1 + 2 + 4) / 3.
        near(sequence.metrics().unwrap().flicker, 1.5 / (7.0 / 3.0));
    }

    #[test]
    fn changes_of_one_pixel_are_not_made_up_for_by_another() {
        // Two halves that swap: the mean of each frame is exact.
        let half = |swap: bool| Image::from_fn(4, 2, |x, _| [if (x < 2) == swap { 1.5 } else { 0.5 }; 3]);
        let b = || Image::filled(4, 2, [1.0; 3]);
        let (_, sequence) = measured([(half(true), b(), None), (half(false), b(), None)], 0);
        let all = sequence.metrics().unwrap();
        near(Some(all.mean_ratio), 1.0);
        near(all.flicker, 1.0);
    }

    #[test]
    fn frames_that_do_not_count_leave_the_means_alone() {
        let image = |value: f32| Image::filled(6, 4, [value; 3]);
        let frames = [9.0, 1.0, 1.1, 1.0].map(|a| (image(a), image(1.0), None));
        let (frames, sequence) = measured(frames, 1);
        // Told of each frame all the same.
        near(frames[1].flicker, 8.0);
        let all = sequence.metrics().unwrap();
        assert_eq!((all.frames, all.changes), (3, 2));
        near(all.flicker, 0.1);
        near(Some(all.mean_ratio), 3.1 / 3.0);
        near(Some(all.relmse), frames[1..].iter().map(|frame| frame.relmse).sum::<f64>() / 3.0);
    }

    #[test]
    fn a_frame_alone_does_not_flicker_and_no_frame_is_nothing() {
        let (frames, sequence) = flat(&[1.0], &[2.0]);
        assert_eq!((frames[0].flicker, sequence.metrics().unwrap().flicker), (None, None));
        assert!(Sequence::default().metrics().is_none());
    }

    #[test]
    fn pixels_masked_in_either_frame_are_no_change() {
        let left = |value: f32| Image::from_fn(4, 2, |x, _| [if x < 2 { value } else { 1.0 }; 3]);
        let mask = |x0: u32| Some(Image::from_fn(4, 2, move |x, _| [f32::from(u8::from(x == x0)); 3]));
        let b = || Image::filled(4, 2, [1.0; 3]);
        let frames = [(left(1.0), b(), mask(0)), (left(2.0), b(), mask(1))];
        let (frames, _) = measured(frames, 0);
        // Of the four columns the two on the right are left, which rest.
        near(frames[1].flicker, 0.0);
        let frames = [(left(1.0), b(), mask(0)), (left(2.0), b(), mask(3))];
        let (frames, _) = measured(frames, 0);
        // One of two changes by 1.
        near(frames[1].flicker, 0.5);
    }

    #[test]
    fn frames_are_measured_as_images_are() {
        let a = Image::from_fn(16, 12, |x, y| [x as f32 / 16.0, y as f32 / 12.0, 0.3]);
        let b = Image::from_fn(16, 12, |x, y| [x as f32 / 17.0, y as f32 / 12.0, 0.4]);
        let comparison = Comparison::new(&a, &b, &CompareOptions::default()).unwrap();
        let metrics = comparison.metrics();
        let frame = Sequence::default().add(comparison.into(), true).unwrap();
        assert_eq!(
            (frame.mean_ratio, frame.nmae, frame.relmse, frame.flip),
            (metrics.mean_ratio, metrics.nmae, metrics.relmse, metrics.flip)
        );
    }

    #[test]
    fn frames_of_another_size_are_refused() {
        let image = |width| Image::filled(width, 4, [1.0; 3]);
        let of = |width| Comparison::new(&image(width), &image(width), &CompareOptions::default()).unwrap();
        let mut sequence = Sequence::default();
        sequence.add(of(6).into(), true).unwrap();
        let error = sequence.add(of(8).into(), true).unwrap_err().to_string();
        assert!(error.contains("the frame before is 6×4") && error.contains("8×4"), "{error}");
    }
}
