//! Truths that the program traces itself, to a stated error, and keeps from one run to the next.

use chiaro::scene::text_hash;
use chiaro::techniques::shaders::MODULES;
use chiaro::{Integrator, LoadedScene, Recorder, Reference, ReferenceOptions, Settings};
use chiaro_image::{Image, Layers, read_layers, write_layers};
use indicatif::ProgressBar;

use crate::cache::{Cache, Entry, VARIABLE};
use crate::files::bar;
use crate::part::Part;
use crate::session::{Tell, camera_text, truth_settings};
use crate::trace::{Pace, layers, part_of};
use crate::truth::{Truth, image_of};
use crate::{Error, Session};

/// Seeds of the two halves of a truth, which no technique has by default.
const SEEDS: [u32; 2] = [0x7275_7468, 0x7275_7469];
/// Samples of each half before its error is looked at first.
const FIRST_LOOK: u32 = 16;
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
