//! The path-traced truth of what the picture shows, refined while everything rests.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use chiaro::techniques::environment::EnvironmentSettings;
use chiaro::techniques::post::Summed;
use chiaro::techniques::view::Lighting;
use chiaro::{BufferReadback, FirstHit, Frame, Gpu, Integrator, Reference, ReferenceOptions, Settings, View};
use web_time::Instant;

use crate::engine::{Engine, caught};
use crate::jobs::Jobs;
use crate::stage::Stage;

/// What of the truth is on show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compare {
    /// Nothing: the real-time picture alone.
    #[default]
    Off,
    /// Right of a divider.
    Split,
    /// Instead of the real-time picture.
    Truth,
}

impl Compare {
    /// All, with the names that the panel shows.
    pub const ALL: [(Self, &'static str); 3] =
        [(Self::Off, "off"), (Self::Split, "split"), (Self::Truth, "path traced")];

    /// What follows when one key steps through them.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Off => Self::Split,
            Self::Split => Self::Truth,
            Self::Truth => Self::Off,
        }
    }

    /// First column of a picture of this width that shows the truth; `None` = no column does.
    pub fn first_column(self, divider: f32, width_px: u32) -> Option<u32> {
        match self {
            Self::Off => None,
            Self::Split => Some((divider.clamp(0.0, 1.0) * width_px as f32).round() as u32),
            Self::Truth => Some(0),
        }
    }
}

/// What trees and a pipeline were made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Made {
    scene: u64,
    // Counts other shaders.
    shaders: u64,
}

/// A tracer, and what it stands in.
#[derive(Debug)]
struct Tracer {
    made: Made,
    reference: Reference,
}

/// What samples depend on. Equal keys may be averaged.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    made: Made,
    // Counts the scene's poses.
    pose: u64,
    view: View,
    size_px: [u32; 2],
    lighting: Lighting,
    normal_maps: bool,
    environment: EnvironmentSettings,
}

/// How far the truth is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress<'a> {
    /// Trees and pipeline are being made.
    Building,
    /// They could not be made.
    Failed(&'a str),
    /// So much of the first sample of every pixel is there, 0..1.
    First(f32),
    /// Samples a pixel, and the mean standard error relative to the mean once that is known.
    Samples(u32, Option<f32>),
}

/// The truth, and what is known of it.
#[derive(Debug)]
pub struct Truth {
    gpu: Gpu,
    jobs: Jobs<(Made, Result<Box<Tracer>, String>)>,
    tracer: Option<Box<Tracer>>,
    building: Option<Made>,
    failed: Option<(Made, String)>,
    shaders: u64,
    key: Option<Key>,
    most_samples: u32,
    pace: Pace,
    noise: Noise,
}

/// The noise of the image, measured each time its samples have doubled.
#[derive(Debug, Default)]
struct Noise {
    // Of the newest measurement.
    value: Option<f32>,
    // Samples from which on the next is due.
    due: u32,
    on_its_way: OnItsWay,
    // Made once.
    readback: Option<BufferReadback>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum OnItsWay {
    #[default]
    Nothing,
    Recorded,
    // The copy is to be read; or thrown away, for the image is another now.
    Sent {
        counts: bool,
    },
}

/// Fewer samples say little of their own spread.
const FIRST_NOISE: u32 = 4;

impl Noise {
    fn restart(&mut self) {
        self.value = None;
        self.due = FIRST_NOISE;
        if let OnItsWay::Sent { counts } = &mut self.on_its_way {
            *counts = false;
        }
    }

    fn record(&mut self, frame: &mut Frame<'_>, reference: &Reference, most: u32) {
        let samples = reference.samples();
        if samples == 0 || samples < self.due.min(most) || self.on_its_way != OnItsWay::Nothing {
            return;
        }
        self.due = samples.saturating_mul(2);
        reference.measure_noise(frame);
        self.on_its_way = OnItsWay::Recorded;
    }

    fn submitted(&mut self, gpu: &Gpu, reference: &Reference) {
        if self.on_its_way == OnItsWay::Recorded {
            let number = reference.noise();
            match &self.readback {
                Some(readback) => readback.again(gpu, number),
                None => self.readback = Some(BufferReadback::start(gpu, number)),
            }
            self.on_its_way = OnItsWay::Sent { counts: true };
        }
    }

    fn poll(&mut self, gpu: &Gpu) {
        let (OnItsWay::Sent { counts }, Some(readback)) = (self.on_its_way, &self.readback) else { return };
        match readback.poll(gpu) {
            Ok(None) => return,
            Ok(Some(bytes)) if counts => {
                self.value = bytes.first_chunk().map(|bytes| f32::from_le_bytes(*bytes));
            }
            // A lost device shows elsewhere.
            Ok(Some(_)) | Err(_) => {}
        }
        self.on_its_way = OnItsWay::Nothing;
    }
}

impl Truth {
    /// Nothing yet, to be refined up to so many samples of each pixel; `wake` is called when something has been made.
    pub fn new(gpu: &Gpu, most_samples: u32, wake: impl Fn() + Send + 'static) -> Self {
        Self {
            gpu: gpu.clone(),
            jobs: Jobs::new(wake),
            tracer: None,
            building: None,
            failed: None,
            shaders: 0,
            key: None,
            most_samples: most_samples.max(1),
            pace: Pace::new(gpu.is_software()),
            noise: Noise::default(),
        }
    }

    /// The shaders are others now: what is there stays until it is made anew.
    pub fn shaders_changed(&mut self) {
        self.shaders += 1;
    }

    /// Takes over what has been made and measured.
    pub fn take_reports(&mut self) {
        self.noise.poll(&self.gpu);
        while let Some((made, result)) = self.jobs.poll() {
            self.building = self.building.filter(|building| *building != made);
            match result {
                Ok(tracer) => (self.tracer, self.key) = (Some(tracer), None),
                Err(problem) => self.failed = Some((made, problem)),
            }
        }
    }

    /// Has made beside the frame what this scene needs where it is `wanted`, and forgets what another scene needed.
    pub fn settle(&mut self, engine: &Engine, stage: &Stage, wanted: bool) {
        let made = self.made_for(stage);
        if self.tracer.as_ref().is_some_and(|tracer| tracer.made.scene != made.scene) {
            (self.tracer, self.key) = (None, None);
        }
        let known = self.tracer.as_ref().map(|tracer| tracer.made);
        let failed = self.failed.as_ref().map(|(made, _)| *made);
        if !wanted || known == Some(made) || failed == Some(made) || self.building.is_some() {
            return;
        }
        self.building = Some(made);
        let (kit, scene) = (engine.renderer.kit().clone(), stage.scene.clone());
        let facts = stage.loaded.gpu.facts;
        let (pose, unlit) = (stage.loaded.pose().clone(), stage.loaded.gpu.unlit);
        self.jobs.start(move || {
            let tracer = caught(&kit.gpu, || {
                let options =
                    ReferenceOptions { integrator: Integrator::Full, ..ReferenceOptions::default() };
                let mut reference = Reference::build(&kit, &scene, (&pose, facts), options)?;
                if unlit {
                    // Which part of the radiance no exposure changes.
                    reference.observe(facts, &[FirstHit::Unlit])?;
                }
                Ok(Box::new(Tracer { made, reference }))
            });
            (made, tracer.map_err(|e| e.to_string()))
        });
    }

    fn made_for(&self, stage: &Stage) -> Made {
        Made { scene: stage.loaded.gpu.id(), shaders: self.shaders }
    }

    /// Starts anew where samples of the view, the settings or the size would not go with those that are there.
    pub fn aim(&mut self, settings: &Settings, stage: &Stage, (view, size_px): (&View, [u32; 2])) {
        let Some(tracer) = &mut self.tracer else { return };
        let key = Key {
            made: tracer.made,
            pose: stage.loaded.gpu.motion.generation(),
            view: *view,
            size_px,
            lighting: settings.surface.lighting,
            normal_maps: settings.surface.normal_maps,
            environment: settings.environment.clone(),
        };
        if self.key.as_ref() == Some(&key) {
            return;
        }
        // Trees that were just made may be of a pose that has gone by.
        let moved =
            stage.duration_s.is_some() && self.key.as_ref().is_none_or(|known| known.pose != key.pose);
        self.key = Some(key);
        self.noise.restart();
        let image = (view, size_px);
        let started = if moved {
            tracer.reference.follow((&stage.scene, &stage.loaded), settings, image)
        } else {
            tracer.reference.restart(&stage.loaded, settings, image)
        };
        if let Err(problem) = started {
            self.failed = Some((tracer.made, problem.to_string()));
            (self.tracer, self.key) = (None, None);
        }
    }

    /// Samples of each pixel that it ends with.
    pub fn most_samples(&self) -> u32 {
        self.most_samples
    }

    /// Whether more samples are wanted.
    pub fn wants_samples(&self) -> bool {
        self.key.is_some() && self.samples() < self.most_samples
    }

    /// Whether the GPU has done what it was last given. `moving`: only as much is wanted as one frame can hold, which must
    /// be a whole sample.
    pub fn is_ready(&mut self, moving: bool) -> bool {
        let pixels = self.key.as_ref().map_or(0, |key| key.size_px.map(u64::from).iter().product());
        self.pace.is_ready() && (!moving || self.pace.work >= pixels)
    }

    /// Records as many samples as the GPU does in the time that a window can do without it.
    pub fn record(&mut self, frame: &mut Frame<'_>, stage: &Stage) {
        let Some(tracer) = &mut self.tracer else { return };
        let recorded = tracer.reference.refine(frame, &stage.loaded, self.pace.work, self.most_samples);
        self.pace.recorded(recorded);
        self.noise.record(frame, &tracer.reference, self.most_samples);
    }

    /// To be called after the frame with [`Truth::record`] was submitted. `alone`: there was nothing else in it.
    pub fn submitted(&mut self, alone: bool) {
        self.pace.submitted(&self.gpu, alone);
        if let Some(tracer) = &self.tracer {
            self.noise.submitted(&self.gpu, &tracer.reference);
        }
    }

    /// Nits summed over samples; `None` before every pixel has one.
    pub fn sum(&self) -> Option<Summed<'_>> {
        let tracer = self.tracer.as_ref().filter(|_| self.key.is_some())?;
        let (nits, frames) = (tracer.reference.sum_texture(), tracer.reference.samples());
        let unlit = tracer.reference.observed(FirstHit::Unlit);
        (frames > 0).then_some(Summed { nits, frames, unlit, holds_unlit: unlit.is_some() })
    }

    /// Samples of every pixel.
    pub fn samples(&self) -> u32 {
        self.sum().map_or(0, |sum| sum.frames)
    }

    /// Mean standard error relative to the mean, when that was last measured.
    pub fn noise(&self) -> Option<f32> {
        self.noise.value
    }

    /// How far it is.
    pub fn progress(&self) -> Progress<'_> {
        match (&self.tracer, &self.failed) {
            (None, Some((_, problem))) if self.building.is_none() => Progress::Failed(problem),
            (None, _) => Progress::Building,
            (Some(tracer), _) if self.samples() == 0 => Progress::First(tracer.reference.under_way()),
            (Some(_), _) => Progress::Samples(self.samples(), self.noise.value),
        }
    }
}

/// How much work the GPU is given at once, so that frames go on.
#[derive(Debug)]
struct Pace {
    // Samples of single pixels.
    work: u64,
    recorded: u64,
    budget: Duration,
    in_flight: bool,
    // What else is in flight says nothing of this work's speed.
    alone: bool,
    // Nanoseconds that the work in flight took; 0 = it is not done.
    took: Arc<AtomicU64>,
}

/// What a frame may take besides, about; where there is no GPU, painting the window takes so much that less would be waste.
const BUDGET: [Duration; 2] = [Duration::from_millis(25), Duration::from_millis(80)];
/// Where work starts from, samples of single pixels.
const FIRST_WORK: [u64; 2] = [1 << 18, 1 << 14];
const WORK: std::ops::RangeInclusive<u64> = 1 << 10..=1 << 32;

impl Pace {
    fn new(is_software: bool) -> Self {
        let kind = usize::from(is_software);
        let (work, budget) = (FIRST_WORK[kind], BUDGET[kind]);
        Self { work, recorded: 0, budget, in_flight: false, alone: false, took: Arc::default() }
    }

    fn is_ready(&mut self) -> bool {
        if self.in_flight {
            let took = self.took.swap(0, Ordering::Acquire);
            if took == 0 {
                return false;
            }
            self.in_flight = false;
            if self.alone {
                self.learn(Duration::from_nanos(took));
            }
        }
        true
    }

    /// More or less next time, by what the last time took.
    fn learn(&mut self, took: Duration) {
        let wanted = self.recorded as f64 * self.budget.as_secs_f64() / took.as_secs_f64();
        let wanted = (wanted as u64).clamp(self.work / 2, self.work.saturating_mul(2));
        // A pass that ended before its time says nothing of how much more there could be.
        if wanted < self.work || self.recorded >= self.work / 2 {
            self.work = wanted.clamp(*WORK.start(), *WORK.end());
        }
    }

    fn recorded(&mut self, work: u64) {
        self.recorded = work;
    }

    fn submitted(&mut self, gpu: &Gpu, alone: bool) {
        let (begun, took) = (Instant::now(), self.took.clone());
        (self.in_flight, self.alone) = (true, alone);
        gpu.queue.on_submitted_work_done(move || {
            took.store((begun.elapsed().as_nanos() as u64).max(1), Ordering::Release);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_settles_at_what_the_budget_holds() {
        for nanoseconds_each in [2.0, 40.0, 3000.0] {
            let mut pace = Pace::new(false);
            for _ in 0..40 {
                pace.recorded(pace.work);
                pace.learn(Duration::from_secs_f64(pace.work as f64 * nanoseconds_each * 1e-9));
            }
            let took_ms = pace.work as f64 * nanoseconds_each * 1e-6;
            assert!((24.0..=26.0).contains(&took_ms), "{took_ms} ms");
        }
    }

    #[test]
    fn the_end_of_a_pass_does_not_make_work_grow() {
        let mut pace = Pace::new(false);
        let before = pace.work;
        pace.recorded(before / 100);
        pace.learn(Duration::from_micros(10));
        assert_eq!(pace.work, before);
    }

    #[test]
    fn one_key_steps_through_all_ways_of_comparing() {
        let mut compare = Compare::Off;
        for _ in Compare::ALL {
            compare = compare.next();
        }
        assert_eq!(compare, Compare::Off);
        let column = |compare: Compare, divider| compare.first_column(divider, 101);
        assert_eq!(column(Compare::Off, 0.5), None);
        assert_eq!(column(Compare::Truth, 0.5), Some(0));
        assert_eq!([0.0, 0.25, 2.0].map(|d| column(Compare::Split, d)), [Some(0), Some(25), Some(101)]);
    }
}
