//! `chiaro bench`: GPU time of every pass, median and spread over frames.

use anyhow::Context;
use chiaro::{Recorder, Settings};
use serde::Serialize;

use crate::args::{BenchArgs, Suite};
use crate::output::print;
use crate::session::{Session, warn_of_idle};
use crate::suite;
use crate::timings::{Machine, NO_TIMESTAMPS, Summary, summarise, table};

/// Frames before measuring: shaders warm, clocks up, pools filled.
const WARM_UP: u32 = 20;
/// From this frame on nothing may be created.
const STEADY_FROM: u32 = 3;

#[derive(Serialize)]
struct Report<'a> {
    machine: &'a Machine,
    scene: &'a str,
    triangles: u32,
    scene_bytes: u64,
    size: [u32; 2],
    settings: std::collections::BTreeMap<String, String>,
    pipeline: String,
    wall_ms_per_frame: f64,
    objects_created_after_frame_3: u64,
    memory_growth_bytes: i64,
    timings: &'a Option<Summary>,
}

/// What so many frames took.
pub struct Measured {
    pub wall_ms_per_frame: f64,
    pub objects_created_after_frame_3: u64,
    pub memory_growth_bytes: i64,
    pub timings: Option<Summary>,
}

/// Renders and times frames, one at a time. `tick` is called after each.
pub fn measure(session: &mut Session, frames: u32, tick: impl Fn()) -> anyhow::Result<Measured> {
    let mut recorder = Recorder::new(&session.gpu, true);
    let gpu = session.gpu.clone();
    let mut state = chiaro::ViewState::new(&session.renderer);
    let mut timings = Vec::new();
    let mut steady = None;
    let mut start = std::time::Instant::now();
    for index in 0..WARM_UP + frames {
        if index == WARM_UP {
            recorder.wait()?;
            recorder.take_timings();
            start = std::time::Instant::now();
        }
        // What moves, moves: at sixty frames a second.
        if session.duration_s().is_some() {
            session.go_to(f64::from(index) / 60.0)?;
        }
        let Session { renderer, scene, view, size, .. } = &mut *session;
        let sampling = (chiaro::Jitter::new(1).offset_px(index), 1.0);
        let prepared = renderer.prepare(&mut state, scene, view, *size, sampling)?;
        let mut frame = recorder.begin();
        prepared.record(&mut frame, false);
        frame.submit();
        // One frame in flight: the timings then belong to frames that ran alone, and nothing piles up.
        recorder.wait()?;
        timings.append(&mut recorder.take_timings());
        if index == STEADY_FROM {
            steady = Some((gpu.created.total(), memory(&gpu)));
        }
        if index + 1 == WARM_UP {
            timings.clear();
        }
        tick();
    }
    let wall_ms_per_frame = start.elapsed().as_secs_f64() * 1e3 / f64::from(frames);
    let (created, bytes) = steady.unwrap_or((gpu.created.total(), memory(&gpu)));
    Ok(Measured {
        wall_ms_per_frame,
        objects_created_after_frame_3: gpu.created.total() - created,
        memory_growth_bytes: memory(&gpu) - bytes,
        timings: summarise(&timings),
    })
}

pub fn run(args: &BenchArgs) -> anyhow::Result<()> {
    match args.suite {
        None => {}
        Some(Suite::Shadows) => return suite::shadows::run(args),
        Some(Suite::Reference) => return suite::reference::run(args),
    }
    warn_of_idle(&args.settings)?;
    let mut session = Session::open(&args.scene, &args.settings)?;
    let measured = measure(&mut session, args.frames, || ())?;
    session.tell_notes();
    let Measured { wall_ms_per_frame, objects_created_after_frame_3, memory_growth_bytes, timings: summary } =
        measured;
    let gpu = session.gpu.clone();
    let machine = Machine::of(&gpu);
    match &summary {
        Some(summary) => print(&table(&machine, summary))?,
        None => eprintln!("note: {NO_TIMESTAMPS}"),
    }
    print(&format!(
        "  wall time {wall_ms_per_frame:.3} ms a frame; {objects_created_after_frame_3} GPU objects created after frame \
         {STEADY_FROM}, memory grew by {memory_growth_bytes} bytes\n"
    ))?;
    if let Some(path) = &args.json {
        let settings = session.renderer.settings();
        let report = Report {
            machine: &machine,
            scene: &session.scene_name,
            triangles: session.scene.gpu.triangle_count,
            scene_bytes: session.scene.gpu.bytes,
            size: session.size,
            settings: Settings::fields()
                .iter()
                .filter_map(|f| Some((f.key.clone(), settings.get(&f.key)?)))
                .collect(),
            pipeline: format!("{:?}", settings.pipeline).to_lowercase(),
            wall_ms_per_frame,
            objects_created_after_frame_3,
            memory_growth_bytes,
            timings: &summary,
        };
        std::fs::write(path, serde_json::to_string_pretty(&report)? + "\n")
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Bytes of GPU memory that the driver layer holds for buffers and textures.
fn memory(gpu: &chiaro::Gpu) -> i64 {
    let counters = gpu.device.get_internal_counters().hal;
    (counters.buffer_memory.read() + counters.texture_memory.read()) as i64
}
