//! The program's own path tracer on a budget of GPU time: what techniques have to be better than.

use chiaro::{FirstHit, Integrator, Recorder, Reference, ReferenceOptions, Settings};
use chiaro_image::Image;

use crate::cache::Cache;
use crate::filter::{Features, filter};
use crate::part::Part;
use crate::session::{camera_text, truth_settings};
use crate::trace::{layers, part_of};
use crate::{Error, Machine, Session};

/// What tells edges.
const FEATURES: [FirstHit; 3] = [FirstHit::Albedo, FirstHit::Normal, FirstHit::Depth];
/// Samples of what the camera sees first.
const FEATURE_SAMPLES: u32 = 16;
/// Samples before any is timed.
const WARM_UP: u32 = 3;

/// A path-traced picture, and what it took.
#[derive(Clone, Debug)]
pub struct Traced {
    /// The part of the light that was asked for, nits.
    pub image: Image,
    /// Samples of each pixel.
    pub samples: u32,
    /// GPU time of tracing, milliseconds; on the clock where the adapter has no timestamps.
    pub ms: f64,
}

/// Tracers of one scene.
#[derive(Debug)]
pub struct Paths {
    part: Part,
    reference: Reference,
    // What the camera sees first, where noise is filtered.
    observer: Option<Reference>,
    recorder: Recorder,
}

impl Paths {
    /// Builds trees for the scene as it stands.
    ///
    /// # Errors
    /// When they do not fit the device, or a shader does not compile.
    pub fn new(
        session: &Session,
        settings: &Settings,
        part: Part,
        bounces: Option<u32>,
    ) -> Result<Self, Error> {
        let Session { gpu, renderer, scene, source, view, size, .. } = session;
        let options = ReferenceOptions {
            integrator: Integrator::Full,
            diffuse_bounces: part.bounces(bounces),
            ..ReferenceOptions::default()
        };
        let reference = Reference::new(renderer.kit(), (source, scene), settings, (view, *size), options)?;
        Ok(Self { part, reference, observer: None, recorder: Recorder::new(gpu, true) })
    }

    /// Samples that fit into so many milliseconds on this device, at least one. As times vary from run to run and pictures
    /// must not, a number once found is kept in the cache.
    ///
    /// # Errors
    /// When the device fails, or the cache cannot be written.
    pub fn samples_in(
        &mut self,
        (session, settings): (&Session, &Settings),
        budget_ms: f64,
        cache: Option<&Cache>,
    ) -> Result<u32, Error> {
        let [width, height] = session.size;
        let machine = Machine::of(&session.gpu);
        let key = format!(
            "chiaro {} {:016x} {} {} {width}x{height} {} {} bounces {} {budget_ms} ms, {} {}",
            env!("CARGO_PKG_VERSION"),
            session.source.fingerprint(),
            session.source.origin,
            camera_text(&session.view),
            truth_settings(settings),
            self.part.name(),
            self.reference.options().diffuse_bounces,
            machine.adapter,
            machine.driver,
        );
        let entry = cache.map(|cache| cache.entry(&key, "samples")).transpose()?;
        let known =
            entry.as_ref().and_then(|entry| entry.text(&key)).and_then(|text| text.trim().parse().ok());
        if let Some(known) = known {
            return Ok(known);
        }
        self.restart(session, settings, 0)?;
        self.add(session, WARM_UP)?;
        let mut spent = 0.0;
        let mut samples = 0;
        while samples == 0 || spent < budget_ms {
            let before = self.reference.samples();
            let took = self.add(session, 1)?;
            // The one that goes beyond the budget does not count.
            if samples > 0 && spent + took > budget_ms {
                break;
            }
            spent += took;
            samples += self.reference.samples() - before;
        }
        if let Some(entry) = &entry {
            entry.keep_text(&key, &samples.to_string())?;
        }
        Ok(samples)
    }

    /// Traces so many samples.
    ///
    /// # Errors
    /// When the device fails.
    pub fn trace(
        &mut self,
        (session, settings): (&Session, &Settings),
        samples: u32,
        seed: u32,
    ) -> Result<Traced, Error> {
        self.restart(session, settings, seed)?;
        let mut ms = 0.0;
        while self.reference.samples() < samples {
            ms += self.add(session, 1)?;
        }
        let samples = self.reference.samples();
        let image = part_of(&layers(&self.reference)?, samples, self.part, session.size)?;
        Ok(Traced { image, samples, ms })
    }

    /// The same picture filtered along edges.
    ///
    /// # Errors
    /// When the device fails.
    pub fn filtered(
        &mut self,
        (session, settings): (&Session, &Settings),
        traced: &Traced,
    ) -> Result<Image, Error> {
        let features = self.features(session, settings)?;
        Ok(filter(&traced.image, &features, &session.view, traced.samples))
    }

    /// What the camera sees first.
    fn features(&mut self, session: &Session, settings: &Settings) -> Result<Features, Error> {
        let Session { gpu, renderer, scene, source, view, size, .. } = session;
        let observer = match &mut self.observer {
            Some(observer) => {
                observer.follow((source, scene), settings, (view, *size))?;
                observer
            }
            none => {
                let options = ReferenceOptions { max_depth: 1, ..ReferenceOptions::default() };
                let mut observer =
                    Reference::new(renderer.kit(), (source, scene), settings, (view, *size), options)?;
                observer.observe(scene.gpu.facts, &FEATURES)?;
                none.insert(observer)
            }
        };
        let mut recorder = Recorder::new(gpu, false);
        let mut frame = recorder.begin();
        observer.add(&mut frame, scene, FEATURE_SAMPLES);
        frame.submit();
        recorder.wait()?;
        let layers = layers(observer)?;
        let samples = observer.samples() as f32;
        let image = |what: FirstHit| -> Result<Image, Error> {
            let found = layers.iter().find(|(name, _)| *name == what.layer());
            let texels = found.map_or(&[][..], |(_, texels)| texels.as_slice());
            let pixels = texels.chunks_exact(4).map(|t| [t[0], t[1], t[2]].map(|v| v / samples)).collect();
            Ok(Image::from_pixels(size[0], size[1], pixels)?)
        };
        let [albedo, normal, depth] = FEATURES.map(image);
        // Paths of one edge bring just that.
        let glow = match self.part {
            Part::Picture | Part::Direct => part_of(&layers, observer.samples(), Part::Picture, *size)?,
            Part::Indirect | Part::Caustics => Image::filled(size[0], size[1], [0.0; 3]),
        };
        Ok(Features { albedo: albedo?, normal: normal?, depth: depth?, glow })
    }

    fn restart(&mut self, session: &Session, settings: &Settings, seed: u32) -> Result<(), Error> {
        let Session { scene, source, view, size, .. } = session;
        self.reference.reseed(seed);
        if session.duration_s().is_none() {
            return Ok(self.reference.restart(scene, settings, (view, *size))?);
        }
        // Trees follow before anything is timed.
        self.reference.follow((source, scene), settings, (view, *size))?;
        self.reference.renew(&mut self.recorder, (source, scene))?;
        self.recorder.take_timings();
        Ok(())
    }

    /// Adds samples; milliseconds that they took.
    fn add(&mut self, session: &Session, count: u32) -> Result<f64, Error> {
        let begun = std::time::Instant::now();
        let mut frame = self.recorder.begin();
        self.reference.add(&mut frame, &session.scene, count);
        frame.submit();
        self.recorder.wait()?;
        let timings = self.recorder.take_timings();
        let spans: f64 = timings.iter().map(|frame| frame.span_ms).sum();
        Ok(if timings.is_empty() { begun.elapsed().as_secs_f64() * 1e3 } else { spans })
    }
}
