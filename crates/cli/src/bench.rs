//! `chiaro bench`: GPU time of every pass, median and spread over frames.

use std::collections::BTreeMap;

use anyhow::bail;
use chiaro_lab::Machine;
use chiaro_lab::files::write_json;
use chiaro_lab::measure::{Measured, STEADY_FROM, at_sixty, measure};
use chiaro_lab::session::by_key;
use chiaro_lab::timings::{NO_TIMESTAMPS, Summary, summarise, table};
use serde::Serialize;

use crate::args::{BenchArgs, Suite};
use crate::asked::{open, settings, tell_notes, warn_of_idle};
use crate::output::{WrongUsage, print};
use crate::{camera_path, suite};

#[derive(Serialize)]
struct Report<'a> {
    machine: &'a Machine,
    scene: &'a str,
    triangles: u32,
    scene_bytes: u64,
    size: [u32; 2],
    settings: BTreeMap<String, String>,
    pipeline: String,
    wall_ms_per_frame: f64,
    objects_created_after_frame_3: u64,
    memory_growth_bytes: i64,
    timings: &'a Option<Summary>,
}

pub fn run(args: &BenchArgs) -> anyhow::Result<()> {
    match args.suite {
        None if args.camera_path => return camera_path::run(args),
        None => {}
        Some(Suite::Shadows) => return suite::shadows(args),
        Some(Suite::Indirect) => return suite::indirect(args),
        Some(Suite::Reference) => return suite::reference(args),
    }
    if let Some(path) = &args.output {
        let path = path.display();
        bail!(WrongUsage(format!(
            "-o {path}: needs --suite or --camera-path; --json writes the measurements"
        )));
    }
    warn_of_idle(&args.settings)?;
    let mut session = open(&args.scene, settings(&args.settings)?)?;
    let measured = measure(&mut session, args.frames, at_sixty, || ())?;
    tell_notes(&session);
    let Measured { wall_ms_per_frame, objects_created_after_frame_3, memory_growth_bytes, timings } =
        measured;
    let summary = summarise(&timings);
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
            settings: by_key(settings),
            pipeline: format!("{:?}", settings.pipeline).to_lowercase(),
            wall_ms_per_frame,
            objects_created_after_frame_3,
            memory_growth_bytes,
            timings: &summary,
        };
        write_json(path, &report)?;
    }
    Ok(())
}
