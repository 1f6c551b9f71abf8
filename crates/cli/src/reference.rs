//! `chiaro reference`

mod file;
mod merge;
mod progress;
mod shards;
mod sums;

use std::time::{Duration, Instant};

use anyhow::bail;
use chiaro::{FirstHit, Integrator, Recorder, Reference, ReferenceOptions};
use chiaro_lab::session::counts_in_truth;
use chiaro_lab::{Pace, Session, Tracing};

use crate::args::{self, ReferenceArgs, SettingsArgs};
use crate::asked;
use crate::frames::{self, Moment};
use crate::interrupt::Interrupt;
use crate::output::{WrongUsage, print};
use crate::values::Setting;
use progress::Progress;
use sums::Sums;

pub use merge::run as merge;

/// Between two writings of what there is so far.
const CHECKPOINT: Duration = Duration::from_mins(1);
/// Where writing takes long, it takes no more than this share of the time.
const WRITING: u32 = 20;

pub fn run(args: &ReferenceArgs) -> anyhow::Result<()> {
    let first_hits = file::first_hits(args)?;
    let settings = SettingsArgs { preset: None, set: args.set.clone(), seed: args.seed, pipeline: None };
    for Setting { key, .. } in args.set.iter().filter(|change| !counts_in_truth(&change.key)) {
        eprintln!("warning: --set {key} does nothing in a reference, which has no techniques");
    }
    let mut session = asked::open_to_trace(&args.scene, asked::settings(&settings)?)?;
    if session.duration_s().is_none() && (args.time.frames.is_some() || args.time.time != 0.0) {
        eprintln!("note: nothing in this scene moves; every moment looks the same");
    }
    let mut tracer: Option<Tracer> = None;
    for (done, moment) in (0..).zip(frames::moments(&args.time)) {
        session.go_to(moment.time_s)?;
        let tracer = match &mut tracer {
            Some(tracer) => {
                tracer.follow(args, (done, moment), &session)?;
                tracer
            }
            none => none.insert(Tracer::new(args, &session, &first_hits)?),
        };
        trace(args, (done, moment), &session, tracer)?;
    }
    Ok(())
}

/// What one image leaves to the next.
struct Tracer {
    reference: Reference,
    recorder: Recorder,
    pace: Pace,
    interrupt: Interrupt,
}

impl Tracer {
    fn new(
        args: &ReferenceArgs,
        session: &Session<Tracing>,
        first_hits: &[FirstHit],
    ) -> anyhow::Result<Self> {
        let Session { gpu, renderer, scene, view, size, source, .. } = session;
        let image = (view, *size);
        let mut reference =
            Reference::new(renderer.kit(), (source, scene), renderer.settings(), image, options(args))?;
        if !first_hits.is_empty() {
            reference.observe(scene.gpu.facts, first_hits)?;
        }
        let recorder = Recorder::new(gpu, false);
        let interrupt = Interrupt::listen("writing what there is".to_owned())?;
        Ok(Self { reference, recorder, pace: Pace::new(gpu), interrupt })
    }

    /// Goes on to the next image, with trees that follow.
    fn follow(
        &mut self,
        args: &ReferenceArgs,
        (done, moment): (u64, Moment),
        session: &Session<Tracing>,
    ) -> anyhow::Result<()> {
        if self.interrupt.heard() {
            let (all, next) = (frames::count(&args.time), moment.path(&args.output));
            let next = next.display();
            bail!(
                "interrupted: {done} of {all} images are done; the same command with --resume goes on with {next}"
            );
        }
        let Session { renderer, scene, view, size, source, .. } = session;
        let scenes = (source, scene);
        self.reference.follow(scenes, renderer.settings(), (view, *size))?;
        self.reference.renew(&mut self.recorder, scenes)?;
        Ok(())
    }
}

fn options(args: &ReferenceArgs) -> ReferenceOptions {
    ReferenceOptions {
        integrator: match args.integrator {
            args::Integrator::Path => Integrator::Path,
            args::Integrator::Photon => Integrator::Photon,
            args::Integrator::Full => Integrator::Full,
        },
        max_depth: args.max_depth,
        diffuse_bounces: args.diffuse_bounces.unwrap_or(u32::MAX),
        seed: args.seed,
        shard: args.shard.unwrap_or_default(),
    }
}

/// Samples to trace, of a shard its own; `None`: something else ends the render.
fn samples_of(args: &ReferenceArgs, round: u32) -> anyhow::Result<Option<u32>> {
    let Some(whole) = progress::samples(args) else { return Ok(None) };
    let Some(shard) = args.shard else { return Ok(Some(whole)) };
    let own = shard.samples_of(whole, round);
    if own == 0 {
        let (rounds, least) = (whole.div_ceil(round), u64::from(round) * u64::from(shard.number));
        bail!(WrongUsage(format!(
            "--shard {}/{}: nothing is left for it of --spp {whole}, which is {rounds} rounds of {round}; trace {least} \
             samples or more, or fewer shards",
            shard.number, shard.of
        )));
    }
    Ok(Some(own))
}

/// Traces one image to its end and writes it.
fn trace(
    args: &ReferenceArgs,
    (done, moment): (u64, Moment),
    session: &Session<Tracing>,
    tracer: &mut Tracer,
) -> anyhow::Result<()> {
    let Tracer { reference, recorder, pace, interrupt } = tracer;
    let Session { gpu, scene, size, .. } = session;
    let output = moment.path(&args.output);
    let mut about = file::about(args, moment.time_s, session, reference);
    let resumed = args.resume && output.exists();
    let timed_out = if resumed { file::resume(&output, &about, *size, reference)? } else { None };
    let first = reference.samples();
    let shard = args.shard.map_or(String::new(), |shard| format!("shard {} of {}, ", shard.number, shard.of));
    let frame = moment.number.map_or(String::new(), |number| {
        format!("frame {number} ({} of {}), ", done + 1, frames::count(&args.time))
    });
    // An image of many has had its time; one alone is given more whenever it is asked for.
    let timed_out = timed_out.filter(|_| moment.number.is_some());
    let most = samples_of(args, reference.round())?;
    let mut progress = Progress::new(args, most, format!("{frame}{shard}"), (first, timed_out));
    let (mut saved, mut pause) = (Instant::now(), CHECKPOINT);
    let mut tracing = Duration::ZERO;
    loop {
        let samples = reference.samples();
        if progress.wants_noise(samples) {
            progress.set_noise(samples, Sums::read(gpu, reference)?.noise()?);
        }
        progress.show(samples);
        if progress.is_done(samples) || (samples > 0 && interrupt.heard()) {
            break;
        }
        if saved.elapsed() >= pause {
            let begun = Instant::now();
            Sums::read(gpu, reference)?.write(&output, &about)?;
            (saved, pause) = (Instant::now(), CHECKPOINT.max(WRITING * begun.elapsed()));
        }
        let most = samples + progress.room(samples);
        tracing += pace.refine(recorder, (&mut *reference, scene), most)?;
    }
    progress.finish();
    let samples = reference.samples();
    let sums = Sums::read(gpu, reference)?;
    if let Some(limit) = progress.time_was_up(samples) {
        file::set_timed_out(&mut about, limit);
    }
    // Of a sequence gone on with, images that are done stay as they are.
    let is_kept = resumed && samples == first && file::has_aovs(&output, &args.aovs);
    if !is_kept {
        sums.write(&output, &about)?;
        for name in &args.aovs {
            sums.write_aov(&output, name)?;
        }
    }
    let path = output.display();
    if interrupt.heard() && !progress.is_done(samples) {
        bail!(
            "interrupted: {path} holds {shard}{samples} samples a pixel; the same command with --resume goes on"
        );
    }
    let took = tracing.as_secs_f64();
    let each = match args.integrator {
        args::Integrator::Photon => reference.light_paths(),
        _ => size[0] * size[1],
    };
    let paths = f64::from(each) * f64::from(samples - first);
    let speed = if samples > first {
        format!("{took:.1} s, {:.2} million paths/s, ", paths / took * 1e-6)
    } else {
        "nothing to add, ".to_owned()
    };
    print(&format!("{path}  {shard}{samples} spp, {speed}noise {:.2} %\n", 100.0 * sums.noise()?))
}
