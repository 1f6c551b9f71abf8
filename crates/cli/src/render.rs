//! `chiaro render`

mod video;

use std::path::{Path, PathBuf};

use chiaro::techniques::post::Smoothing;
use chiaro::{Aov, Gpu, LeftOver, Readback, Recorder, Still, StillOptions};
use chiaro_image::{Precision, write_exr, write_png};
use chiaro_lab::files::{bar, create_parent, write_json};
use chiaro_lab::pictures::{mean, screen};
use chiaro_lab::timings::{NO_TIMESTAMPS, Summary, summarise, table};
use chiaro_lab::{Machine, Session};
use serde::Serialize;

use crate::args::RenderArgs;
use crate::asked::{open, settings, tell_notes, warn_of_idle};
use crate::output::print;
use crate::values::extension;
use crate::{frames, left};
use video::{Format, Video};

#[derive(Serialize)]
struct TimingsFile<'a> {
    machine: &'a Machine,
    scene: &'a str,
    size: [u32; 2],
    samples: u32,
    timings: &'a Option<Summary>,
}

pub fn run(args: &RenderArgs) -> anyhow::Result<()> {
    if args.aovs.iter().any(|name| name == "list") {
        return left::list(&mut open(&args.scene, settings(&args.settings)?)?);
    }
    let (aovs, left) = left::names(&args.aovs)?;
    let format = Format::of(args)?;
    warn_of_idle(&args.settings)?;
    let mut settings = settings(&args.settings)?;
    left::warn_of_black(&aovs, &settings);
    let moving = args.time.frames.is_some();
    let samples = args.samples.unwrap_or(if moving && settings.smooths() { 1 } else { 16 });
    if !moving || samples > 1 {
        // Samples are averaged, not frames.
        settings.post.antialias = Smoothing::None;
    }
    let mut session = open(&args.scene, settings)?;
    let options = StillOptions { size: session.size, samples, aovs, moving, left };
    let mut recorder = Recorder::new(&session.gpu, true);
    if session.duration_s().is_none() && (args.time.frames.is_some() || args.time.time != 0.0) {
        eprintln!("note: nothing in this scene moves; every moment looks the same");
    }
    let template = "rendering {bar:40} {pos}/{len} samples, {eta} left";
    let bar = bar(frames::count(&args.time) * u64::from(samples), template);
    let begin = |format| Video::begin(format, &args.output, session.size, args.time.fps);
    let mut video = format.map(begin).transpose()?;
    let mut written = Vec::new();
    for moment in frames::moments(&args.time) {
        session.go_to(moment.time_s)?;
        session.renderer.equip(&session.source, &mut session.scene)?;
        let still = {
            let Session { renderer, scene, view, .. } = &mut session;
            renderer.still_in(&mut recorder, scene, view, &options, |_| bar.inc(1))?
        };
        let path = moment.path(&args.output);
        written = match &mut video {
            None => write(&session.gpu, still, &path)?,
            Some(video) => {
                let gpu = &session.gpu;
                let beside = write_beside(gpu, (still.aovs, still.left), still.samples, &path)?;
                video.add(&screen(&still.picture.wait(gpu)?)?)?;
                [vec![args.output.clone()], beside].concat()
            }
        };
        if video.as_ref().is_some_and(Video::interrupted) {
            break;
        }
    }
    bar.finish_and_clear();
    if let Some(video) = video {
        video.finish(frames::count(&args.time))?;
    }
    for path in &written {
        print(&format!("{}\n", path.display()))?;
    }
    recorder.wait()?;
    tell_notes(&session);
    report((args, samples), &session, &mut recorder)
}

fn report(
    (args, samples): (&RenderArgs, u32),
    session: &Session,
    recorder: &mut Recorder,
) -> anyhow::Result<()> {
    let machine = Machine::of(&session.gpu);
    let timings = summarise(&recorder.take_timings());
    match &timings {
        Some(summary) => print(&table(&machine, summary))?,
        None => eprintln!("note: {NO_TIMESTAMPS}"),
    }
    if let Some(path) = &args.timings {
        let file = TimingsFile {
            machine: &machine,
            scene: &session.scene_name,
            size: session.size,
            samples,
            timings: &timings,
        };
        write_json(path, &file)?;
    }
    Ok(())
}

/// Writes a still, and returns its file and those beside it that hold what its frames left behind.
fn write(gpu: &Gpu, still: Still, path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    create_parent(path)?;
    if extension(path) == "exr" {
        let mut radiance = still.radiance.wait(gpu)?;
        // An EXR shows the colour of unlit materials, too, as 1 nit for white, as the reference does.
        if let Some(unlit) = still.unlit {
            radiance.add_floats(&unlit.wait(gpu)?);
        }
        write_exr(path, &mean(&radiance, still.samples)?, Precision::Float)?;
    } else {
        write_png(path, &screen(&still.picture.wait(gpu)?)?)?;
    }
    let beside = write_beside(gpu, (still.aovs, still.left), still.samples, path)?;
    Ok([vec![path.to_owned()], beside].concat())
}

/// Writes what was asked for beside a picture, and returns the files that hold what its frames left behind.
fn write_beside(
    gpu: &Gpu,
    (aovs, left): (Vec<(Aov, Readback)>, Vec<LeftOver>),
    samples: u32,
    path: &Path,
) -> anyhow::Result<Vec<PathBuf>> {
    for (aov, readback) in aovs {
        let name = aov.name();
        let image = mean(&readback.wait(gpu)?, samples)?;
        write_exr(path.with_extension(format!("{name}.exr")), &image, Precision::Float)?;
    }
    let mut beside = Vec::new();
    for left in left {
        beside.extend(left::write(gpu, path, left, samples)?);
    }
    Ok(beside)
}
