//! `chiaro bench --suite`: a group of techniques side by side.

use std::path::Path;

use chiaro_lab::files::write_json;
use chiaro_lab::suite::{Report, indirect, reference, shadows};
use chiaro_lab::timings::NO_TIMESTAMPS;
use chiaro_lab::{Machine, Session};
use serde::Serialize;

use crate::args::BenchArgs;
use crate::asked;
use crate::output::print;
use crate::values::Size;

const SIZE: Size = Size { width: 800, height: 600 };
const SCENE: &str = "builtin:terrain";
/// Of the suite of indirect light: camera and spot move.
const MOVING_SCENE: &str = "builtin:flight";
const FOLDER: &str = "bench";

/// How many rays, paths and light paths a second the tracers do.
pub fn reference(args: &BenchArgs) -> anyhow::Result<()> {
    let session = asked::open_to_trace(&args.scene, asked::settings(&args.settings)?)?;
    let rates = reference::rates(&session, args.frames)?;
    let machine = Machine::of(&session.gpu);
    if rates.is_empty() {
        eprintln!("note: {NO_TIMESTAMPS}");
    }
    print(&reference::table(&machine, &session, args.frames, &rates))?;
    report(args, &machine, &session, &rates)
}

/// Every combination of shadow techniques, its picture and what it costs.
pub fn shadows(args: &BenchArgs) -> anyhow::Result<()> {
    let folder = args.output.as_deref().unwrap_or(Path::new(FOLDER));
    let mut scene = args.scene.clone();
    scene.look.size.get_or_insert(SIZE);
    scene.scene.get_or_insert_with(|| SCENE.into());
    let settings = asked::settings(&args.settings)?;
    let mut session = asked::open(&scene, settings.clone())?;
    let (costs, table) = shadows::run(&mut session, &shadows::base(settings)?, (args.frames, folder))?;
    asked::tell_notes(&session);
    print(&table)?;
    if costs.iter().all(|cost| cost.timings.is_none()) {
        eprintln!("note: {NO_TIMESTAMPS}");
    }
    report(args, &Machine::of(&session.gpu), &session, &costs)?;
    print(&format!("\n{} pictures and table.md in {}\n", costs.len(), folder.display()))
}

/// The thesis' tables of imperfect shadow maps, its filters, and how time grows.
pub fn indirect(args: &BenchArgs) -> anyhow::Result<()> {
    let folder = args.output.as_deref().unwrap_or(Path::new(FOLDER));
    let mut scene = args.scene.clone();
    scene.look.size.get_or_insert(SIZE);
    if scene.terrain.height_map.is_none() && scene.caster.is_none() {
        scene.scene.get_or_insert_with(|| MOVING_SCENE.into());
    }
    let base = indirect::base(asked::settings(&args.settings)?)?;
    let mut session = asked::open(&scene, base.clone())?;
    let extent = indirect::Extent::default();
    let (costs, table) = indirect::run(&mut session, (&base, &extent), (args.frames, folder))?;
    asked::tell_notes(&session);
    print(&table)?;
    if costs.iter().all(|cost| cost.timings.is_none()) {
        eprintln!("note: {NO_TIMESTAMPS}");
    }
    report(args, &Machine::of(&session.gpu), &session, &costs)?;
    print(&format!("\ntable.md, scaling.svg and pictures of the filters in {}\n", folder.display()))
}

fn report<S>(
    args: &BenchArgs,
    machine: &Machine,
    session: &Session<S>,
    rows: &[impl Serialize],
) -> anyhow::Result<()> {
    let Some(path) = &args.json else { return Ok(()) };
    Ok(write_json(path, &Report::new(machine, session, args.frames, rows))?)
}
