//! `chiaro reference`

mod file;
mod progress;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use chiaro::{Integrator, Recorder, Reference, ReferenceOptions};

use crate::args::{self, ReferenceArgs, SettingsArgs};
use crate::output::print;
use crate::session::Session;
use crate::values::Setting;
use file::Sums;
use progress::Progress;

/// How long the GPU may be busy with one dispatch, about: no watchdog or desktop notices.
const BUSY: Duration = Duration::from_millis(50);
/// Samples of single pixels that the first dispatch takes, with a GPU and without.
const FIRST_WORK: [u64; 2] = [1 << 18, 1 << 14];
const LEAST_WORK: u64 = 1 << 10;
/// Between two writings of what there is so far.
const CHECKPOINT: Duration = Duration::from_mins(1);
/// Where writing takes long, it takes no more than this share of the time.
const WRITING: u32 = 20;

pub fn run(args: &ReferenceArgs) -> anyhow::Result<()> {
    let first_hits = file::first_hits(args)?;
    let settings = SettingsArgs { preset: None, set: args.set.clone(), seed: args.seed, pipeline: None };
    for Setting { key, .. } in args.set.iter().filter(|change| !file::counts(&change.key)) {
        eprintln!("warning: --set {key} does nothing in a reference, which has no techniques");
    }
    let mut session = Session::open_to_trace(&args.scene, &settings)?;
    if session.duration_s().is_none() && args.time != 0.0 {
        eprintln!("note: nothing moves in this scene");
    }
    session.go_to(args.time)?;
    let Session { gpu, renderer, scene, view, size, source, .. } = &session;
    let options = ReferenceOptions {
        integrator: match args.integrator {
            args::Integrator::Path => Integrator::Path,
            args::Integrator::Photon => Integrator::Photon,
            args::Integrator::Full => Integrator::Full,
        },
        max_depth: args.max_depth,
        diffuse_bounces: args.diffuse_bounces.unwrap_or(u32::MAX),
        seed: args.seed,
    };
    let scenes = (source, scene);
    let mut reference = Reference::new(renderer.kit(), scenes, renderer.settings(), (view, *size), options)?;
    if !first_hits.is_empty() {
        reference.observe(scene.gpu.facts, &first_hits)?;
    }
    let about = file::about(args, &session, &reference);
    if args.resume && args.output.exists() {
        file::resume(&args.output, &about, *size, &mut reference)?;
    }
    let interrupted = on_interrupt()?;
    let first = reference.samples();
    let mut recorder = Recorder::new(gpu, false);
    let mut progress = Progress::new(args, first);
    let (mut saved, mut pause) = (Instant::now(), CHECKPOINT);
    let mut tracing = Duration::ZERO;
    let mut work = FIRST_WORK[usize::from(gpu.is_software())];
    loop {
        let samples = reference.samples();
        if progress.wants_noise(samples) {
            progress.set_noise(samples, Sums::read(gpu, &reference)?.noise()?);
        }
        progress.show(samples);
        if progress.is_done(samples) || (samples > 0 && interrupted.load(Ordering::Relaxed)) {
            break;
        }
        if saved.elapsed() >= pause {
            let begun = Instant::now();
            Sums::read(gpu, &reference)?.write(&args.output, &about)?;
            (saved, pause) = (Instant::now(), CHECKPOINT.max(WRITING * begun.elapsed()));
        }
        let begun = Instant::now();
        let mut frame = recorder.begin();
        let recorded = reference.refine(&mut frame, scene, work, samples + progress.room(samples));
        frame.submit();
        recorder.wait()?;
        tracing += begun.elapsed();
        if begun.elapsed() < BUSY / 2 && recorded >= work / 2 {
            work = work.saturating_mul(2);
        } else if begun.elapsed() > 2 * BUSY {
            work = (work / 2).max(LEAST_WORK);
        }
    }
    progress.finish();
    let sums = Sums::read(gpu, &reference)?;
    sums.write(&args.output, &about)?;
    for name in &args.aovs {
        sums.write_aov(&args.output, name)?;
    }
    let samples = reference.samples();
    let path = args.output.display();
    if interrupted.load(Ordering::Relaxed) && !progress.is_done(samples) {
        bail!("interrupted: {path} holds {samples} samples a pixel; the same command with --resume goes on");
    }
    let took = tracing.as_secs_f64();
    let each =
        if options.integrator == Integrator::Photon { reference.light_paths() } else { size[0] * size[1] };
    let paths = f64::from(each) * f64::from(samples - first);
    let speed = if samples > first {
        format!("{took:.1} s, {:.2} million paths/s, ", paths / took * 1e-6)
    } else {
        "nothing to add, ".to_owned()
    };
    print(&format!("{path}  {samples} spp, {speed}noise {:.2} %\n", 100.0 * sums.noise()?))
}

/// Hears Ctrl-C from now on: the first time to finish what is being done, the second to leave at once.
fn on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let heard = Arc::new(AtomicBool::new(false));
    let flag = heard.clone();
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            // 128 and the signal's number, as shells have it.
            std::process::exit(130);
        }
        eprintln!("\nwriting what there is; once more leaves at once");
    })
    .context("cannot listen for Ctrl-C")?;
    Ok(heard)
}
