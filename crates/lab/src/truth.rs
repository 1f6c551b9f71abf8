//! What pictures are held against: the program's own tracers to a stated error, kept from one run to the next, or a file.

use std::path::Path;

use chiaro::scene::text_hash;
use chiaro::techniques::shaders::MODULES;
use chiaro::{Integrator, LoadedScene, Recorder, Reference, ReferenceOptions, Settings};
use chiaro_image::{CompareOptions, Comparison, Image, Layers, read, read_layers, write_layers};
use indicatif::ProgressBar;
use serde::Serialize;

use crate::cache::{Cache, Entry, VARIABLE};
use crate::files::bar;
use crate::part::Part;
use crate::session::{Tell, camera_text, truth_settings};
use crate::trace::Pace;
use crate::{Error, Session};

/// Seeds of the two halves of a truth, which no technique has by default.
const SEEDS: [u32; 2] = [0x7275_7468, 0x7275_7469];
/// Samples of each half before its error is looked at first.
const FIRST_LOOK: u32 = 16;
/// A reference's sums of the picture, of direct light and of caustics: pairs of floats.
const SUMS: [[&str; 2]; 3] = [["sum", "sum.low"], ["direct", "direct.low"], ["caustics", "caustics.low"]];
/// Less of the picture is no part of it.
const LEAST_PART: f64 = 1e-6;
/// Layers of a file in the cache.
const HALVES: [&str; 2] = ["", "other"];
const SAMPLES: &str = "samples";

/// How good a truth is to be.
#[derive(Clone, Debug)]
pub struct TruthOptions {
    /// What of the light.
    pub part: Part,
    /// Most times that light is scattered from one surface to another; `None` = no limit.
    pub diffuse_bounces: Option<u32>,
    /// Its mean error may be this share of its mean.
    pub target_error: f64,
    /// Of each pixel, whatever the error is then.
    pub most_samples: u32,
    /// Where it is kept.
    pub cache: Option<Cache>,
}

/// An image that others are held against, and what is known of its own noise.
#[derive(Clone, Debug)]
pub struct Truth {
    /// What is right.
    pub image: Image,
    /// Its own noise.
    pub noise: Noise,
    /// Of each pixel, where it was traced.
    pub samples: Option<u32>,
}

/// What is known of a truth's noise.
#[derive(Clone, Debug)]
pub enum Noise {
    /// Nothing.
    Unknown,
    /// A draw of it: half of the difference of two halves that know nothing of each other has the very distribution of their
    /// mean's error, stratification and all.
    Drawn(Image),
    /// The variance of each value, as if samples were independent.
    Variance(Image),
}

/// How far a truth is from itself: what no technique can be told to be better than.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Floor {
    /// Mean absolute error over the mean.
    pub nmae: f64,
    /// Root of the mean square error, over the mean.
    pub rmse: f64,
    /// As the metric of the same name, where the noise was drawn.
    pub relmse: Option<f64>,
}

impl Truth {
    /// A file that some renderer wrote, less another. Of the noise is known what `chiaro reference` wrote of it.
    ///
    /// # Errors
    /// When a file cannot be read, or the two differ in size.
    pub fn read(path: &Path, minus: Option<&Path>) -> Result<Self, Error> {
        let mut image = read(path)?;
        if let Some(minus) = minus {
            let other = read(minus)?;
            if other.size() != image.size() {
                let ((w, h), (width, height)) = (other.size(), image.size());
                return Err(Error::Usage(format!(
                    "{} is {w}x{h}, but {} is {width}x{height}",
                    minus.display(),
                    path.display()
                )));
            }
            if let Some((path, _)) = [(path, &image), (minus, &other)].into_iter().find(|(_, i)| is_crop(i)) {
                let path = path.display();
                return Err(Error::Usage(format!(
                    "{path} is a crop; --minus takes whole images from whole ones"
                )));
            }
            for (value, other) in image.pixels_mut().iter_mut().flatten().zip(other.pixels().iter().flatten())
            {
                *value -= other;
            }
        }
        let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
        let layers = if is_exr && minus.is_none() { read_layers(path).ok() } else { None };
        let noise =
            layers.and_then(|layers| image_of(&layers, "variance")).map_or(Noise::Unknown, Noise::Variance);
        Ok(Self { image, noise, samples: None })
    }

    /// The mean of two halves of so many samples each.
    fn of_halves(halves: &[Image; 2], samples: u32) -> Self {
        let [a, b] = halves;
        let mixed = |mix: fn(f32, f32) -> f32| {
            let (width, height) = a.size();
            let mut at = a.pixels().iter().zip(b.pixels());
            let pixel = |(a, b): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|c| mix(a[c], b[c]));
            Image::from_fn(width, height, |_, _| at.next().map_or([0.0; 3], pixel))
        };
        let image = mixed(|a, b| 0.5 * (a + b));
        Self { image, noise: Noise::Drawn(mixed(|a, b| 0.5 * (a - b))), samples: Some(2 * samples) }
    }

    /// The mean of all values that the mask leaves, nits.
    pub fn mean(&self, keep: &[bool]) -> f64 {
        mean(kept(self.image.pixels(), keep).map(f64::from))
    }

    /// Makes sure that there is light to compare.
    ///
    /// # Errors
    /// [`Error::Black`] when there is none.
    pub fn lit(&self, mask: Option<&Image>) -> Result<(), Error> {
        let keep = keep(&self.image, mask);
        if !keep.contains(&true) {
            return Err(Error::Usage(
                "the mask leaves no pixel: it must be 0 where pictures are compared".to_owned(),
            ));
        }
        let mean = self.mean(&keep);
        if mean > 0.0 {
            return Ok(());
        }
        let is = if mean < 0.0 { "darker than black: is the right image subtracted?" } else { "black" };
        Err(Error::Black(format!(
            "there is nothing to hold techniques against: where it is compared, this part of the light is {is}"
        )))
    }

    /// The mean square of its own error.
    pub(crate) fn square_error(&self, keep: &[bool]) -> Option<f64> {
        match &self.noise {
            Noise::Unknown => None,
            Noise::Drawn(error) => Some(mean(kept(error.pixels(), keep).map(|e| f64::from(e).powi(2)))),
            Noise::Variance(variance) => Some(mean(kept(variance.pixels(), keep).map(f64::from))),
        }
    }

    /// How far it is from itself, where the mask leaves something that is not black.
    pub fn floor(&self, mask: Option<&Image>) -> Option<Floor> {
        let keep = keep(&self.image, mask);
        let mean_nits = self.mean(&keep);
        let rmse = self.square_error(&keep)?.sqrt() / mean_nits;
        let (absolute, relmse) = match &self.noise {
            Noise::Unknown => return None,
            Noise::Drawn(error) => {
                let mut other = self.image.clone();
                let values = other.pixels_mut().iter_mut().flatten();
                values.zip(error.pixels().iter().flatten()).for_each(|(value, error)| *value += error);
                let options = CompareOptions { mask, ..CompareOptions::default() };
                let relmse = Comparison::new(&other, &self.image, &options).ok()?.relmse();
                (mean(kept(error.pixels(), &keep).map(|e| f64::from(e.abs()))), Some(relmse))
            }
            // Of a normal distribution.
            Noise::Variance(variance) => {
                let deviation = |v: f32| (f64::from(v).max(0.0) * 2.0 / std::f64::consts::PI).sqrt();
                (mean(kept(variance.pixels(), &keep).map(deviation)), None)
            }
        };
        (mean_nits > 0.0).then_some(Floor { nmae: absolute / mean_nits, rmse, relmse })
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    sum / count.max(1) as f64
}

fn kept<'a>(pixels: &'a [[f32; 3]], keep: &'a [bool]) -> impl Iterator<Item = f32> + 'a {
    pixels.iter().zip(keep).filter(|(_, keep)| **keep).flat_map(|(pixel, _)| *pixel)
}

/// Pixels that count: those that a crop holds, where the mask is 0.
pub(crate) fn keep(image: &Image, mask: Option<&Image>) -> Vec<bool> {
    let (held, width) = (image.held(), image.width());
    let is_held = |index: usize| {
        let at = [index as u32 % width, index as u32 / width];
        (0..2).all(|axis| at[axis].checked_sub(held.start[axis]).is_some_and(|x| x < held.size[axis]))
    };
    let mut keep: Vec<bool> = (0..image.pixels().len()).map(is_held).collect();
    if let Some(mask) = mask {
        for (keep, pixel) in keep.iter_mut().zip(mask.pixels()) {
            *keep &= pixel.iter().all(|value| *value <= 0.0);
        }
    }
    keep
}

fn is_crop(image: &Image) -> bool {
    (image.held().size[0], image.held().size[1]) != image.size()
}

fn image_of(layers: &Layers, name: &str) -> Option<Image> {
    let channel =
        |c: &str| layers.channel(&if name.is_empty() { c.to_owned() } else { format!("{name}.{c}") });
    let [r, g, b] = ["R", "G", "B"].map(channel);
    let pixels = r?.iter().zip(g?).zip(b?).map(|((r, g), b)| [*r, *g, *b]).collect();
    let (width, height) = layers.size();
    Image::from_pixels(width, height, pixels).ok()
}

/// Sums of half of a truth.
#[derive(Debug, Default)]
struct Half {
    samples: u32,
    layers: Vec<(&'static str, Vec<f32>)>,
}

/// What traces truths, one moment of a scene after the other.
#[derive(Debug)]
pub struct Truths {
    options: TruthOptions,
    reference: Option<Reference>,
    recorder: Recorder,
    pace: Pace,
}

impl Truths {
    /// None traced yet.
    pub fn new(session: &Session, options: TruthOptions) -> Self {
        let (recorder, pace) = (Recorder::new(&session.gpu, false), Pace::new(&session.gpu));
        Self { options, reference: None, recorder, pace }
    }

    /// The truth of the scene as it stands at `time_s`, where the session is: from the cache, or traced and kept there. Of
    /// the settings those count that say what is there.
    ///
    /// # Errors
    /// When the scene's trees do not fit the device, it fails, or the cache cannot be written.
    pub fn of(
        &mut self,
        (session, settings): (&Session, &Settings),
        time_s: f64,
        tell: Tell<'_>,
    ) -> Result<Truth, Error> {
        let key = self.key(session, settings, time_s);
        let entry = match self.options.cache.as_ref().map(|cache| cache.entry(&key, "exr")).transpose() {
            Ok(entry) => entry,
            Err(error) => {
                tell(&format!("warning: {error}; truths are not kept: name another folder by {VARIABLE}"));
                self.options.cache = None;
                None
            }
        };
        if let Some(entry) = &entry
            && entry.path.exists()
        {
            match load(entry, &key) {
                Some(truth) => return Ok(truth),
                None => tell(&format!("note: {} is broken, and is made anew", entry.path.display())),
            }
        }
        let (halves, samples) = self.trace(session, settings)?;
        if let Some(entry) = &entry {
            let mut layers = Layers::new(session.size[0], session.size[1]);
            for (name, half) in HALVES.into_iter().zip(&halves) {
                layers.insert_image(name, half)?;
            }
            layers.about = key.lines().filter_map(|line| line.split_once(": ")).map(owned).collect();
            layers.about.insert(SAMPLES.to_owned(), samples.to_string());
            if let Err(error) = write_layers(&entry.path, &layers) {
                tell(&format!("warning: {error}; the truth is not kept"));
            }
        }
        let truth = Truth::of_halves(&halves, samples);
        let error = error_of(&halves);
        if error > self.options.target_error {
            tell(&format!(
                "warning: the truth's own error is {:.2} % after {} samples, the most that it may have; {:.2} % was \
                 asked for",
                100.0 * error,
                2 * samples,
                100.0 * self.options.target_error
            ));
        }
        Ok(truth)
    }

    /// All that the truth depends on, a line each.
    fn key(&self, session: &Session, settings: &Settings, time_s: f64) -> String {
        let TruthOptions { part, diffuse_bounces, target_error, most_samples, .. } = &self.options;
        let [width, height] = session.size;
        let round = if session.gpu.is_software() { 1 } else { 4 };
        format!(
            "chiaro: {}\nshaders: {:016x}\npart: {}\nbounces: {}\nerror: {target_error} within {most_samples} samples in rounds of {round}\n\
             scene fingerprint: {:016x}\norigin: {}\ncamera: {}\nsize: {width}x{height}\ntime: {time_s} s\nsettings: {}",
            env!("CARGO_PKG_VERSION"),
            shaders(),
            part.name(),
            part.bounces(*diffuse_bounces),
            session.source.fingerprint(),
            session.source.origin,
            camera_text(&session.view),
            truth_settings(settings),
        )
    }

    fn trace(&mut self, session: &Session, settings: &Settings) -> Result<([Image; 2], u32), Error> {
        let Session { renderer, scene, source, view, size, .. } = session;
        let part = self.options.part;
        let image = (view, *size);
        match &mut self.reference {
            Some(reference) => {
                reference.follow((source, scene), settings, image)?;
                reference.renew(&mut self.recorder, (source, scene))?;
            }
            none => {
                let options = ReferenceOptions {
                    integrator: Integrator::Full,
                    diffuse_bounces: part.bounces(self.options.diffuse_bounces),
                    ..ReferenceOptions::default()
                };
                let reference = Reference::new(renderer.kit(), (source, scene), settings, image, options)?;
                *none = Some(reference);
            }
        }
        let Some(reference) = &mut self.reference else { unreachable!("it was just made") };
        let bar = bar(1000, "tracing the truth {bar:40} {msg}");
        let most = (self.options.most_samples / 2).max(1);
        let mut halves = [Half::default(), Half::default()];
        let mut goal = FIRST_LOOK.min(most);
        loop {
            for (half, seed) in halves.iter_mut().zip(SEEDS) {
                reference.reseed(seed);
                reference.restart(scene, settings, image)?;
                let tracer = (&mut *reference, &mut self.recorder, &mut self.pace);
                half.extend(tracer, scene, goal, &bar)?;
            }
            let samples = halves[0].samples;
            let images = [halves[0].part(part, *size)?, halves[1].part(part, *size)?];
            let error = error_of(&images);
            let target = self.options.target_error;
            if error <= target || samples >= most {
                bar.finish_and_clear();
                return Ok((images, samples));
            }
            let needed = f64::from(samples) * (error / target).powi(2);
            bar.set_position((1000.0 * f64::from(samples) / needed) as u64);
            bar.set_message(format!("{} samples, error {:.2} %", 2 * samples, 100.0 * error));
            // The estimate moves; nobody looks farther ahead than twice the samples.
            let [soonest, latest] = [samples + samples / 16 + 1, samples.saturating_mul(2)];
            goal = (needed.ceil() as u32).clamp(soonest, latest.max(soonest)).min(most.max(samples + 1));
        }
    }
}

impl Half {
    /// Adds samples up to so many.
    fn extend(
        &mut self,
        (reference, recorder, pace): (&mut Reference, &mut Recorder, &mut Pace),
        scene: &LoadedScene,
        goal: u32,
        bar: &ProgressBar,
    ) -> Result<(), Error> {
        if self.samples > 0 {
            reference.restore(self.samples, &self.layers)?;
        }
        while reference.samples() < goal {
            pace.refine(recorder, (&mut *reference, scene), goal)?;
            bar.tick();
        }
        self.samples = reference.samples();
        self.layers = layers(reference)?;
        Ok(())
    }

    fn part(&self, part: Part, size: [u32; 2]) -> Result<Image, Error> {
        part_of(&self.layers, self.samples, part, size)
    }
}

/// All sums of a reference.
///
/// # Errors
/// When they cannot be read back.
pub(crate) fn layers(reference: &Reference) -> Result<Vec<(&'static str, Vec<f32>)>, Error> {
    let gpu = reference.gpu();
    // All copies are on their way before the first is waited for.
    let layers = reference.read_layers()?;
    layers.into_iter().map(|(name, layer)| Ok((name, layer.wait(gpu)?.floats()))).collect()
}

/// The mean of a part of the light, from sums over so many samples.
pub(crate) fn part_of(
    layers: &[(&'static str, Vec<f32>)],
    samples: u32,
    part: Part,
    [width, height]: [u32; 2],
) -> Result<Image, Error> {
    let layer = |name: &str| {
        layers.iter().find(|(found, _)| *found == name).map_or(&[][..], |(_, texels)| texels.as_slice())
    };
    let [sum, direct, caustics] = SUMS.map(|[high, low]| (layer(high), layer(low)));
    let count = f64::from(samples.max(1));
    let at = |texels: &[f32], index: usize| texels.get(index).map_or(0.0, |value| f64::from(*value));
    let mean = |(high, low): (&[f32], &[f32]), index: usize| (at(high, index) + at(low, index)) / count;
    let value = |index: usize| match part {
        Part::Picture => mean(sum, index),
        Part::Direct => mean(direct, index),
        Part::Caustics => mean(caustics, index),
        Part::Indirect => mean(sum, index) - mean(direct, index) - mean(caustics, index),
    };
    // Where all light is of other parts, what rounding leaves is no light.
    let all = 4 * width as usize * height as usize;
    let colours = || (0..all).filter(|index| index % 4 < 3);
    let light: f64 = colours().map(|index| mean(sum, index)).sum();
    if part != Part::Picture && colours().map(value).sum::<f64>() <= LEAST_PART * light {
        return Ok(Image::filled(width, height, [0.0; 3]));
    }
    let pixels =
        (0..width as usize * height as usize).map(|pixel| [0, 1, 2].map(|c| value(4 * pixel + c) as f32));
    Ok(Image::from_pixels(width, height, pixels.collect())?)
}

/// The mean absolute error of the mean of two halves, over its mean; 0 where all is black.
fn error_of([a, b]: &[Image; 2]) -> f64 {
    let pairs = || a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
    let error: f64 = pairs().map(|(a, b)| 0.5 * f64::from((a - b).abs())).sum();
    let sum: f64 = pairs().map(|(a, b)| 0.5 * f64::from(a + b)).sum();
    if sum > 0.0 { error / sum } else { 0.0 }
}

/// A hash of all shaders: others may trace otherwise.
fn shaders() -> u64 {
    let texts: Vec<_> = MODULES.iter().map(|(_, text)| *text).collect();
    text_hash(&texts.concat())
}

fn owned((key, value): (&str, &str)) -> (String, String) {
    (key.to_owned(), value.to_owned())
}

/// What the cache holds, if it is whole and of this key.
fn load(entry: &Entry, key: &str) -> Option<Truth> {
    let layers = read_layers(&entry.path).ok()?;
    let same = key
        .lines()
        .filter_map(|line| line.split_once(": "))
        .all(|(key, value)| layers.about.get(key).is_some_and(|found| found == value));
    let samples = layers.about.get(SAMPLES)?.parse().ok()?;
    let [a, b] = HALVES.map(|name| image_of(&layers, name));
    (same && !layers.is_part()).then_some(Truth::of_halves(&[a?, b?], samples))
}

#[cfg(test)]
impl Truth {
    pub(crate) fn of_halves_for_tests(halves: &[Image; 2]) -> Self {
        Self::of_halves(halves, 1)
    }
}
