//! `chiaro bench --camera-path`: what frames take along the way of a camera.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::{Context, bail};
use chiaro::FrameTimings;
use chiaro::scene::Scene;
use chiaro_lab::files::{bar, write_json};
use chiaro_lab::measure::{Measured, WARM_UP, measure};
use chiaro_lab::plot::{self, Curve, Panel};
use chiaro_lab::session::by_key;
use chiaro_lab::timings::{NO_TIMESTAMPS, Summary, Tail, rows, summarise_tails};
use chiaro_lab::{Machine, Session};
use serde::Serialize;

use crate::args::BenchArgs;
use crate::asked::{open, settings, tell_notes, warn_of_idle};
use crate::output::{WrongUsage, print};
use crate::values::extension;

/// Frames of a path: timings are kept of all.
const FRAMES: std::ops::RangeInclusive<f64> = 2.0..=100_000.0;
/// Moments at which cameras are looked for elsewhere.
const LOOKS: u32 = 100;
/// Passes that the plot shows beside the whole frame: those that take longest.
const DRAWN: usize = 5;

/// A frame of the path.
#[derive(Debug, Serialize)]
struct Moment {
    time_s: f64,
    gpu_ms: f64,
}

#[derive(Serialize)]
struct Report<'a> {
    machine: &'a Machine,
    scene: &'a str,
    triangles: u32,
    size: [u32; 2],
    settings: BTreeMap<String, String>,
    camera: &'a str,
    fps: f64,
    wall_ms_per_frame: f64,
    timings: Option<&'a Summary<Tail>>,
    frames: &'a [Moment],
}

pub fn run(args: &BenchArgs) -> anyhow::Result<()> {
    if let Some(path) = args.output.as_ref().filter(|path| extension(path) != "svg") {
        bail!(WrongUsage(format!("-o {}: the plot of a path is an .svg", path.display())));
    }
    warn_of_idle(&args.settings)?;
    let mut session = open(&args.scene, settings(&args.settings)?)?;
    let frames = frames(&session, args.fps)?;
    let progress = bar(u64::from(WARM_UP + frames), "along the path {bar:40} {pos}/{len} frames, {eta} left");
    // The warm-up comes from the path's end: what is kept from frame to frame is as old in the first one as in all others.
    let frame = |index: u32| (i64::from(index) - i64::from(WARM_UP)).rem_euclid(i64::from(frames));
    let time_s = |index: u32| frame(index) as f64 / args.fps;
    let measured = measure(&mut session, frames, time_s, || progress.inc(1))?;
    progress.finish_and_clear();
    tell_notes(&session);
    let Measured { wall_ms_per_frame, timings, .. } = measured;
    let summary = summarise_tails(&timings);
    let moments = moments(&timings, args.fps);
    let machine = Machine::of(&session.gpu);
    let camera = session.camera().map_or(String::new(), |(index, name)| shown(index, name));
    match &summary {
        Some(summary) => print(&table(&machine, (&camera, args.fps), summary, &moments))?,
        None => eprintln!("note: {NO_TIMESTAMPS}"),
    }
    print(&format!("  wall time {wall_ms_per_frame:.3} ms a frame\n"))?;
    if let Some(path) = &args.json {
        let report = Report {
            machine: &machine,
            scene: &session.scene_name,
            triangles: session.scene.gpu.triangle_count,
            size: session.size,
            settings: by_key(session.renderer.settings()),
            camera: &camera,
            fps: args.fps,
            wall_ms_per_frame,
            timings: summary.as_ref(),
            frames: &moments,
        };
        write_json(path, &report)?;
    }
    if let Some(path) = &args.output {
        let summary = summary.with_context(|| format!("{} is not drawn: {NO_TIMESTAMPS}", path.display()))?;
        let title = format!("GPU time, ms: {}, camera {camera}", session.scene_name);
        plot::write(path, &[panel((title, machine.adapter), &summary, (&timings, args.fps))])?;
        print(&format!("{}\n", path.display()))?;
    }
    Ok(())
}

/// How many frames the path has, of a camera that moves.
fn frames(session: &Session, fps: f64) -> anyhow::Result<u32> {
    let scene = &session.source;
    let moving = moving(scene);
    let (index, name) = session.camera().context("the scene has no camera")?;
    if !moving.contains(&index) {
        let cameras = scene.placed_cameras();
        let name_of = |index: usize| shown(index, &scene.cameras[cameras[index].0].name);
        let others = match moving.iter().map(|&index| name_of(index)).collect::<Vec<_>>() {
            none if none.is_empty() => "as do all cameras of this scene".to_owned(),
            some => format!("these move: {}", some.join(", ")),
        };
        bail!(WrongUsage(format!("--camera-path: camera {} rests; {others}", shown(index, name))));
    }
    let duration_s = scene.duration_s().map_or(0.0, f64::from);
    let frames = (duration_s * fps).round();
    if FRAMES.contains(&frames) {
        return Ok(frames as u32);
    }
    let (least, most) = FRAMES.into_inner();
    bail!(WrongUsage(format!(
        "--fps {fps}: the path of {duration_s} s has {frames} frames, not {least} to {most}"
    )))
}

/// A camera as it may be named by --camera.
fn shown(index: usize, name: &str) -> String {
    if name.is_empty() { index.to_string() } else { format!("“{name}”") }
}

/// The scene's cameras that move: files may hold animations that leave a camera where it is.
fn moving(scene: &Scene) -> Vec<usize> {
    let duration_s = scene.duration_s().map_or(0.0, f64::from);
    let at =
        |moment: u32| scene.placed_cameras_at(&scene.pose(duration_s * f64::from(moment) / f64::from(LOOKS)));
    let first = at(0);
    let mut moves = vec![false; first.len()];
    for (index, (now, then)) in (1..LOOKS).flat_map(|moment| at(moment).into_iter().zip(&first).enumerate()) {
        moves[index] |= now != *then;
    }
    (0..moves.len()).filter(|&index| moves[index]).collect()
}

fn moments(timings: &[FrameTimings], fps: f64) -> Vec<Moment> {
    let moment =
        |(index, frame): (usize, &FrameTimings)| Moment { time_s: index as f64 / fps, gpu_ms: frame.span_ms };
    timings.iter().enumerate().map(moment).collect()
}

fn table(
    machine: &Machine,
    (camera, fps): (&str, f64),
    summary: &Summary<Tail>,
    moments: &[Moment],
) -> String {
    let mut text = format!(
        "GPU time on {}, along the path of camera {camera}, {} frames at {fps} a second, ms\n  {:<36}{:>10}{:>10}{:>10}\n",
        machine.adapter, summary.frames, "", "median", "99 %", "maximum"
    );
    for (name, Tail { median_ms, p99_ms, max_ms }) in rows(summary) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {name:<36}{median_ms:>10.3}{p99_ms:>10.3}{max_ms:>10.3}");
    }
    if let Some(slowest) = moments.iter().max_by(|a, b| a.gpu_ms.total_cmp(&b.gpu_ms)) {
        let _ = writeln!(text, "  slowest at {:.3} s (passes may overlap)", slowest.time_s);
    }
    text
}

/// The frame and the passes that take longest, over time.
fn panel(
    (title, adapter): (String, String),
    summary: &Summary<Tail>,
    (timings, fps): (&[FrameTimings], f64),
) -> Panel {
    let mut passes: Vec<_> = summary.passes.iter().collect();
    passes.sort_by(|a, b| b.time.median_ms.total_cmp(&a.time.median_ms));
    let curve = |name: &str, of: &dyn Fn(&FrameTimings) -> f64| Curve {
        name: name.to_owned(),
        points: timings.iter().enumerate().map(|(index, frame)| (index as f64 / fps, of(frame))).collect(),
    };
    let Tail { median_ms, p99_ms, max_ms } = summary.frame_span;
    let notes = vec![
        format!("median {median_ms:.3}"),
        format!("99 % {p99_ms:.3}"),
        format!("maximum {max_ms:.3}"),
        adapter,
    ];
    let mut curves = vec![curve("frame", &|frame| frame.span_ms)];
    for pass in passes.into_iter().take(DRAWN) {
        let of = |frame: &FrameTimings| {
            frame.passes.iter().filter(|timed| timed.name == pass.name).map(|timed| timed.ms).sum()
        };
        curves.push(curve(&pass.name, &of));
    }
    Panel { title, x: "s", low: Some(0.0), curves, notes }
}

#[cfg(test)]
mod tests {
    use chiaro::scene::{Animation, Channel, Interpolation, Keys};

    use super::*;

    #[test]
    fn an_animation_that_leaves_a_camera_where_it_is_does_not_move_it() {
        let mut scene = Scene::default();
        scene.add_default_view();
        let node = scene.nodes.iter().position(|node| node.camera.is_some()).unwrap();
        assert!(moving(&scene).is_empty());
        for (to, expected) in [([0.0; 3], &[][..]), ([1.0, 0.0, 0.0], &[0])] {
            let keys = Keys::Translation(vec![[0.0; 3].into(), to.into()]);
            let channel =
                Channel { node, times_s: vec![0.0, 2.0], interpolation: Interpolation::Linear, keys };
            scene.animations = vec![Animation { name: String::new(), channels: vec![channel] }];
            assert_eq!(moving(&scene), expected);
        }
    }
}
