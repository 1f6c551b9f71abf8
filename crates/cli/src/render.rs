//! `chiaro render`

use std::path::{Path, PathBuf};

use anyhow::Context;
use chiaro::{Pixels, Recorder, Still, StillOptions};
use chiaro_image::{Image, Picture, Precision, write_exr, write_png};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::args::RenderArgs;
use crate::left;
use crate::output::print;
use crate::session::{Session, settings, warn_of_idle};
use crate::timings::{Machine, NO_TIMESTAMPS, Summary, summarise, table};

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
        return left::list(&mut Session::open(&args.scene, &args.settings)?);
    }
    let (aovs, left) = left::names(&args.aovs)?;
    warn_of_idle(&args.settings)?;
    left::warn_of_black(&aovs, &settings(&args.settings)?);
    let mut session = Session::open(&args.scene, &args.settings)?;
    let options = StillOptions { size: session.size, samples: args.samples, aovs, left };
    let mut recorder = Recorder::new(&session.gpu, true);
    let frames: Vec<_> =
        args.frames.as_ref().map_or(vec![None], |range| (range.start..range.end).map(Some).collect());
    if session.duration_s().is_none() && (args.frames.is_some() || args.time != 0.0) {
        eprintln!("note: nothing in this scene moves; every moment looks the same");
    }
    let bar = progress(frames.len() as u64 * u64::from(args.samples));
    for number in &frames {
        session.go_to(number.map_or(args.time, |number| f64::from(number) / args.fps))?;
        session.renderer.equip(&session.source, &mut session.scene)?;
        let still = {
            let Session { renderer, scene, view, .. } = &mut session;
            renderer.still_in(&mut recorder, scene, view, &options, |_| bar.inc(1))?
        };
        let path = number.map_or(args.output.clone(), |number| numbered(&args.output, number));
        let beside = write(&session, still, &path)?;
        if number.is_none() || *number == frames[frames.len() - 1] {
            bar.finish_and_clear();
            for path in [path].iter().chain(&beside) {
                print(&format!("{}\n", path.display()))?;
            }
        }
    }
    recorder.wait()?;
    session.tell_notes();
    report(args, &session, &mut recorder)
}

fn report(args: &RenderArgs, session: &Session, recorder: &mut Recorder) -> anyhow::Result<()> {
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
            samples: args.samples,
            timings: &timings,
        };
        create_parent(path)?;
        std::fs::write(path, serde_json::to_string_pretty(&file)? + "\n")
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

fn progress(steps: u64) -> ProgressBar {
    // Hidden by itself where there is no terminal, and for work that is done before anyone could read it.
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template("rendering {bar:40} {pos}/{len} samples, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// `frames/a.png` → `frames/a.0007.png`
fn numbered(path: &Path, number: u32) -> PathBuf {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    path.with_extension(format!("{number:04}.{extension}"))
}

pub fn create_parent(path: &Path) -> anyhow::Result<()> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.map_or(Ok(()), |parent| {
        std::fs::create_dir_all(parent)
            .with_context(|| format!("cannot create the folder {}", parent.display()))
    })
}

/// Writes a still, and returns the files beside it that hold what its frames left behind.
pub fn write(session: &Session, still: Still, path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    create_parent(path)?;
    let gpu = &session.gpu;
    let samples = still.samples;
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    if is_exr {
        let mut radiance = still.radiance.wait(gpu)?;
        // An EXR shows the colour of unlit materials, too, as 1 nit for white, as the reference does.
        if let Some(unlit) = still.unlit {
            radiance.add_floats(&unlit.wait(gpu)?);
        }
        write_exr(path, &mean(&radiance, samples)?, Precision::Float)?;
    } else {
        let picture = still.picture.wait(gpu)?;
        let rgb = picture.bytes.chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
        write_png(path, &Picture::from_bytes(picture.width, picture.height, rgb)?)?;
    }
    for (aov, readback) in still.aovs {
        let name = aov.name();
        let image = mean(&readback.wait(gpu)?, samples)?;
        write_exr(path.with_extension(format!("{name}.exr")), &image, Precision::Float)?;
    }
    let mut beside = Vec::new();
    for left in still.left {
        beside.extend(left::write(gpu, path, left, samples)?);
    }
    Ok(beside)
}

pub fn mean(sum: &Pixels, samples: u32) -> anyhow::Result<Image> {
    let share = 1.0 / samples.max(1) as f32;
    let pixels = sum
        .floats()
        .chunks_exact(4)
        .map(|rgba| [rgba[0] * share, rgba[1] * share, rgba[2] * share])
        .collect();
    Ok(Image::from_pixels(sum.width, sum.height, pixels)?)
}
