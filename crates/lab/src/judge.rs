//! A technique's pictures, held against the truth.

use chiaro::techniques::post::Smoothing;
use chiaro::{Recorder, Settings, StillOptions};
use chiaro_image::{Comparison, Image, Sequence, SequenceMetrics};

use crate::cache::Cache;
use crate::cost::{Cost, cost};
use crate::figures::{Figures, Spread, Squares, against, mean_of};
use crate::part::Part;
use crate::paths::Paths;
use crate::pictures::mean;
use crate::technique::{Method, Technique};
use crate::truth::Truth;
use crate::{Error, Session};

/// Samples of a still where nobody says how many.
const SAMPLES: u32 = 16;
/// Between the seeds of neighbouring frames, so that noise does not rest where the scene does.
const NEXT_FRAME: u32 = 0x9e37_79b9;

/// A moment of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// The frame's number; none of a moment by itself.
    pub number: Option<u32>,
    /// Seconds from the animation's beginning.
    pub time_s: f64,
}

/// How techniques are judged.
#[derive(Clone, Debug)]
pub struct JudgeOptions {
    /// What of the light.
    pub part: Part,
    /// Jittered frames to average; `None` is 16, and 1 for frames of moving pictures that are smoothed over time.
    pub samples: Option<u32>,
    /// How many seeds.
    pub seeds: u32,
    /// One, or all frames of a moving picture.
    pub moments: Vec<Moment>,
    /// Pixels where this is above 0 do not count.
    pub mask: Option<Image>,
    /// Most times that light is scattered from one surface to another, for paths.
    pub diffuse_bounces: Option<u32>,
    /// Where paths' numbers of samples are kept.
    pub cache: Option<Cache>,
    /// Frames to time.
    pub timed_frames: u32,
}

impl JudgeOptions {
    /// Whether pictures are frames of a moving one.
    pub fn moves(&self) -> bool {
        self.moments.iter().any(|moment| moment.number.is_some())
    }

    fn samples_of(&self, settings: &Settings) -> u32 {
        self.samples.unwrap_or(if self.moves() && settings.smooths() { 1 } else { SAMPLES })
    }
}

/// What came of it.
#[derive(Clone, Debug)]
pub struct Judged {
    /// How far from the truth.
    pub figures: Figures,
    /// How dear.
    pub cost: Cost,
    /// Of each pixel.
    pub samples: u32,
}

/// Makes pictures by a technique, one after the other.
enum Maker {
    Frames { samples: u32, moving: bool },
    Paths { paths: Box<Paths>, samples: u32, filtered: bool, ms: f64, made: u32 },
}

/// Judges a technique: renders every moment by every seed, compares, and times it. `base` are the settings that say what is
/// there, `truths` one for each moment; `keep` gets the first seed's pictures.
///
/// # Errors
/// When settings do not go together, the device fails, sizes differ, or a truth is black.
pub fn judge(
    session: &mut Session,
    (technique, base): (&Technique, &Settings),
    truths: &[Truth],
    options: &JudgeOptions,
    keep: &mut dyn FnMut(usize, &Image, &Comparison) -> Result<(), Error>,
) -> Result<Judged, Error> {
    let mut maker = Maker::new(session, (technique, base), options)?;
    let mask = options.mask.as_ref();
    let mut spreads = vec![Spread::default(); truths.len()];
    let mut stills = Vec::new();
    let mut sequences = Vec::new();
    let mut first: Vec<Image> = Vec::new();
    for number in 0..options.seeds.max(1) {
        let seed = base.seed.wrapping_add(number);
        maker.begin(session, technique, seed)?;
        let mut sequence = Sequence::default();
        let mut differs = false;
        for (index, (moment, truth)) in options.moments.iter().zip(truths).enumerate() {
            session.go_to(moment.time_s)?;
            let image = maker.make(
                session,
                base,
                options.part,
                seed.wrapping_add(NEXT_FRAME.wrapping_mul(index as u32)),
            )?;
            let comparison = against(&image, truth, mask)?;
            spreads[index].add(&image, truth);
            if number == 0 {
                keep(index, &image, &comparison)?;
            }
            if options.moves() {
                sequence.add(comparison.into(), true)?;
            } else {
                stills.push(comparison.metrics());
            }
            match number {
                0 if options.seeds > 1 => first.push(image),
                1 => differs |= first.get(index).is_some_and(|first| *first != image),
                _ => {}
            }
        }
        sequences.extend(sequence.metrics());
        if number == 1 && !differs {
            // It draws no lots: all further seeds are the same.
            break;
        }
        if number == 1 {
            first = Vec::new();
        }
    }
    let mut figures = if options.moves() { mean_of_sequences(&sequences) } else { mean_of(&stills) };
    let squares: Vec<_> =
        spreads.iter().zip(truths).map(|(spread, truth)| spread.squares(truth, mask)).collect();
    Squares::mean_of(&squares).tell(&mut figures);
    let time_s = options.moments.first().map_or(0.0, |moment| moment.time_s);
    session.go_to(time_s)?;
    let (samples, cost) = match maker {
        Maker::Frames { samples, .. } => (samples, cost(session, options.timed_frames, time_s)?),
        Maker::Paths { samples, ms, made, .. } => {
            let paths_ms = Some(ms / f64::from(made.max(1)));
            (samples, Cost { paths_ms, scene_bytes: session.scene.gpu.bytes, ..Cost::default() })
        }
    };
    Ok(Judged { figures, cost, samples })
}

impl Maker {
    fn new(
        session: &mut Session,
        (technique, base): (&Technique, &Settings),
        options: &JudgeOptions,
    ) -> Result<Self, Error> {
        match &technique.method {
            Method::Frames(settings) => {
                let samples = options.samples_of(settings);
                Ok(Self::Frames { samples, moving: options.moves() && samples == 1 })
            }
            &Method::Paths { budget_ms, filtered } => {
                if let Some(moment) = options.moments.first() {
                    session.go_to(moment.time_s)?;
                }
                let mut paths = Box::new(Paths::new(session, base, options.part, options.diffuse_bounces)?);
                let samples = paths.samples_in((session, base), budget_ms, options.cache.as_ref())?;
                Ok(Self::Paths { paths, samples, filtered, ms: 0.0, made: 0 })
            }
        }
    }

    /// Before the first picture of a seed.
    fn begin(&mut self, session: &mut Session, technique: &Technique, seed: u32) -> Result<(), Error> {
        if let (Self::Frames { moving, .. }, Some(settings)) = (self, technique.settings()) {
            let mut settings = Settings { seed, ..settings.clone() };
            if !*moving {
                // Samples are averaged, not frames.
                settings.post.antialias = Smoothing::None;
            }
            session.renderer.set(settings)?;
            session.renderer.cut();
        }
        Ok(())
    }

    fn make(
        &mut self,
        session: &mut Session,
        base: &Settings,
        part: Part,
        seed: u32,
    ) -> Result<Image, Error> {
        match self {
            Self::Frames { samples, moving } => frame(session, part, *samples, *moving),
            Self::Paths { paths, samples, filtered, ms, made } => {
                let traced = paths.trace((session, base), *samples, seed)?;
                *ms += traced.ms;
                *made += 1;
                if *filtered { paths.filtered((session, base), &traced) } else { Ok(traced.image) }
            }
        }
    }
}

/// A part of the picture as it stands, nits.
fn frame(session: &mut Session, part: Part, samples: u32, moving: bool) -> Result<Image, Error> {
    session.renderer.equip(&session.source, &mut session.scene)?;
    let Session { gpu, renderer, scene, view, size, .. } = &mut *session;
    let aovs = part.aov().into_iter().collect();
    let options = StillOptions { size: *size, samples, aovs, moving, left: Vec::new() };
    let mut recorder = Recorder::new(gpu, false);
    let mut still = renderer.still_in(&mut recorder, scene, view, &options, |_| {})?;
    if let Some((_, aov)) = still.aovs.pop() {
        return mean(&aov.wait(gpu)?, samples);
    }
    let mut radiance = still.radiance.wait(gpu)?;
    // The colour of unlit materials, 1 nit for white, as in an EXR.
    if let Some(unlit) = still.unlit {
        radiance.add_floats(&unlit.wait(gpu)?);
    }
    mean(&radiance, samples)
}

fn mean_of_sequences(all: &[SequenceMetrics]) -> Figures {
    let count = all.len().max(1) as f64;
    let mean = |of: &dyn Fn(&SequenceMetrics) -> f64| all.iter().map(of).sum::<f64>() / count;
    let flickers: Option<Vec<f64>> = all.iter().map(|m| m.flicker).collect();
    Figures {
        mean_ratio: mean(&|m| m.mean_ratio),
        nmae: mean(&|m| m.nmae),
        relmse: mean(&|m| m.relmse),
        flip: mean(&|m| m.flip),
        flicker: flickers.map(|all| all.iter().sum::<f64>() / count),
        not_finite: all.iter().map(|m| m.not_finite).sum(),
        ..Figures::default()
    }
}
