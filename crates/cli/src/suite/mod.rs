//! `chiaro bench --suite`: a group of techniques side by side.

pub mod reference;
pub mod shadows;

use serde::Serialize;

use crate::args::BenchArgs;
use crate::output;
use crate::session::Session;
use crate::timings::Machine;

/// What `--json` says of a suite.
#[derive(Serialize)]
struct Report<'a, R> {
    machine: &'a Machine,
    scene: &'a str,
    triangles: u32,
    size: [u32; 2],
    frames: u32,
    rows: &'a [R],
}

fn write_json<R: Serialize, S>(
    args: &BenchArgs,
    machine: &Machine,
    session: &Session<S>,
    rows: &[R],
) -> anyhow::Result<()> {
    let Some(path) = &args.json else { return Ok(()) };
    let report = Report {
        machine,
        scene: &session.scene_name,
        triangles: session.scene.gpu.triangle_count,
        size: session.size,
        frames: args.frames,
        rows,
    };
    output::write_json(path, &report)
}
