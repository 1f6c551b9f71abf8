//! `chiaro reference`

use std::time::{Duration, Instant};

use chiaro::scene::Scene;
use chiaro::{Integrator, Pixels, Recorder, Reference, ReferenceOptions};
use chiaro_image::{Precision, write_exr};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::{self, ReferenceArgs, SettingsArgs};
use crate::output::print;
use crate::render::{create_parent, mean};
use crate::session::Session;

/// How long the GPU may be busy with one dispatch, about: no watchdog or desktop notices.
const BUSY: Duration = Duration::from_millis(50);
/// Samples a pixel in one dispatch at most.
const MOST: u32 = 64;

pub fn run(args: &ReferenceArgs) -> anyhow::Result<()> {
    let settings = SettingsArgs { preset: None, set: args.set.clone(), seed: args.seed, pipeline: None };
    let mut session = Session::open_with(&args.scene, &settings, Scene::add_default_view_to_trace)?;
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
    let mut recorder = Recorder::new(gpu, false);
    let bar = progress(u64::from(args.spp));
    let start = Instant::now();
    let mut count = 1;
    while reference.samples() < args.spp {
        let now = count.min(args.spp - reference.samples());
        let begun = Instant::now();
        let mut frame = recorder.begin();
        reference.add(&mut frame, scene, now);
        frame.submit();
        recorder.wait()?;
        bar.inc(u64::from(now));
        if begun.elapsed() < BUSY / 2 {
            count = (2 * count).min(MOST);
        } else if begun.elapsed() > 2 * BUSY {
            count = (count / 2).max(1);
        }
    }
    bar.finish_and_clear();
    let took = start.elapsed().as_secs_f64();
    let (sum, squares) = (reference.sum()?.wait(gpu)?, reference.squares()?.wait(gpu)?);
    create_parent(&args.output)?;
    write_exr(&args.output, &mean(&sum, args.spp)?, Precision::Float)?;
    let paths = f64::from(size[0]) * f64::from(size[1]) * f64::from(args.spp);
    print(&format!(
        "{}  {} spp, {:.1} s, {:.2} million paths/s, noise {:.2} %\n",
        args.output.display(),
        args.spp,
        took,
        paths / took * 1e-6,
        100.0 * noise(&sum, &squares, args.spp)
    ))
}

fn progress(samples: u64) -> ProgressBar {
    let bar = ProgressBar::new(samples);
    if let Ok(style) = ProgressStyle::with_template("path tracing {bar:40} {pos}/{len} samples, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// A pixel's mean standard error, relative to the image's mean, as if samples were independent: stratified ones are better
/// than that.
fn noise(sum: &Pixels, squares: &Pixels, samples: u32) -> f64 {
    let n = f64::from(samples);
    let (mut errors, mut means) = (0.0, 0.0);
    for (sum, squares) in sum.floats().chunks_exact(4).zip(squares.floats().chunks_exact(4)) {
        for (sum, square) in sum[..3].iter().zip(&squares[..3]) {
            let mean = f64::from(*sum) / n;
            let variance = (f64::from(*square) / n - mean * mean).max(0.0);
            errors += (variance / n).sqrt();
            means += mean;
        }
    }
    if means > 0.0 { errors / means } else { 0.0 }
}
