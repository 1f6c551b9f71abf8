//! `chiaro bench --suite shadows`: every combination of shadow techniques, its picture and what it costs.
//!
//! The first twelve are those of the shadow thesis: {one map, cascades} × {depth, PCF 4×4, variance, blurred variance,
//! prefiltered exponential, blurred exponential}.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use chiaro::{Settings, StillOptions};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::args::BenchArgs;
use crate::bench::{Measured, measure};
use crate::output::print;
use crate::render;
use crate::session::{self, Session};
use crate::timings::{Machine, NO_TIMESTAMPS, Summary};
use crate::values::Size;

const SIZE: Size = Size { width: 800, height: 600 };
const SCENE: &str = "builtin:terrain";

type Changes = Vec<(&'static str, &'static str)>;

/// A combination.
struct Row {
    name: String,
    changes: Changes,
}

#[derive(Serialize)]
struct Cost {
    name: String,
    settings: Vec<String>,
    /// All passes that make maps.
    maps_ms: f64,
    /// Making moments and blurring them, of that.
    moments_ms: f64,
    /// Shading with the lookups.
    shade_ms: f64,
    frame_ms: f64,
    timings: Option<Summary>,
}

const LAYOUTS: [(&str, &str); 2] = [("single", "one map"), ("cascaded", "cascades")];

/// The thesis' twelve.
fn thesis() -> Vec<Row> {
    let ways: [(&str, &[(&str, &str)]); 6] = [
        ("depth", &[("shadow.filter", "none")]),
        ("pcf 4x4", &[("shadow.filter", "pcf"), ("shadow.pcf_kernel", "4")]),
        ("variance", &[("shadow.representation", "variance"), ("shadow.filter", "none")]),
        ("variance blurred", &[("shadow.representation", "variance"), ("shadow.filter", "gaussian")]),
        (
            "exponential prefiltered",
            &[
                ("shadow.representation", "exponential"),
                ("shadow.filter", "none"),
                ("shadow.prefilter", "true"),
            ],
        ),
        ("exponential blurred", &[("shadow.representation", "exponential"), ("shadow.filter", "gaussian")]),
    ];
    let row = |(layout, layout_name), (name, changes): &(&str, &[(&'static str, &'static str)])| {
        let mut all = vec![("shadow.layout", layout)];
        all.extend_from_slice(changes);
        Row { name: format!("{layout_name}, {name}"), changes: all }
    };
    LAYOUTS.into_iter().flat_map(|layout| ways.iter().map(move |way| row(layout, way))).collect()
}

/// All other combinations that the settings take.
fn others() -> Vec<Row> {
    let representations = ["depth", "variance", "exponential", "evsm2", "evsm4", "moments"];
    let filters = ["none", "pcf", "pcss", "gaussian", "mip", "gaussian-mip"];
    let mut rows = Vec::new();
    for (layout, layout_name) in LAYOUTS {
        for representation in representations {
            for filter in filters {
                let changes = vec![
                    ("shadow.layout", layout),
                    ("shadow.representation", representation),
                    ("shadow.filter", filter),
                ];
                rows.push(Row { name: format!("{layout_name}, {representation}, {filter}"), changes });
            }
        }
    }
    for kernel in ["2", "3", "5", "7", "disc"] {
        let changes = vec![("shadow.layout", "cascaded"), ("shadow.pcf_kernel", kernel)];
        rows.push(Row { name: format!("cascades, pcf {kernel}"), changes });
    }
    let fitted = vec![("shadow.layout", "cascaded"), ("shadow.fit", "depth")];
    rows.push(Row { name: "cascades fitted to the picture, pcf 3".into(), changes: fitted });
    rows
}

pub fn run(args: &BenchArgs) -> anyhow::Result<()> {
    let mut scene_args = args.scene.clone();
    scene_args.size.get_or_insert(SIZE);
    scene_args.scene.get_or_insert_with(|| SCENE.into());
    let mut base = session::settings(&args.settings)?;
    base.set("shadow.cache", "false")?;
    let settings_of = |row: &Row| -> anyhow::Result<Settings> {
        let mut settings = base.clone();
        row.changes.iter().try_for_each(|(key, value)| settings.set(key, value))?;
        Ok(settings)
    };
    let mut rows = thesis();
    let images = rows.len();
    for row in others() {
        let known = rows.iter().any(|known| known.changes == row.changes);
        if !known && settings_of(&row)?.shadow.refused().is_none() {
            rows.push(row);
        }
    }
    let mut session = Session::open(&scene_args, &args.settings)?;
    let bar = ProgressBar::new(rows.len() as u64);
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}, {eta} left") {
        bar.set_style(style);
    }
    let mut costs = Vec::new();
    for row in &rows {
        bar.set_message(row.name.clone());
        session.renderer.set(settings_of(row)?)?;
        picture(&mut session, &args.output.join(file_name(&row.name)))?;
        let measured = measure(&mut session, args.frames, || bar.tick())?;
        costs.push(cost(row, measured));
        bar.inc(1);
    }
    bar.finish_and_clear();
    session.tell_notes();
    let machine = Machine::of(&session.gpu);
    let text = table(&machine, &session, args.frames, (&costs, images));
    let path = args.output.join("table.md");
    std::fs::write(&path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    print(&text)?;
    if costs.iter().all(|cost| cost.timings.is_none()) {
        eprintln!("note: {NO_TIMESTAMPS}");
    }
    super::write_json(args, &machine, &session, &costs)?;
    print(&format!("\n{} pictures and table.md in {}\n", rows.len(), args.output.display()))
}

fn picture(session: &mut Session, path: &Path) -> anyhow::Result<()> {
    let Session { renderer, scene, view, size, .. } = &mut *session;
    let still = renderer.still(scene, view, &StillOptions { size: *size, samples: 1, aovs: Vec::new() })?;
    render::write(session, still, path)
}

fn file_name(name: &str) -> String {
    let words: Vec<_> = name.split([' ', ',']).filter(|word| !word.is_empty()).collect();
    words.join("_") + ".png"
}

fn cost(row: &Row, measured: Measured) -> Cost {
    let timings = measured.timings;
    let sum = |prefix: &str| {
        let passes = timings.iter().flat_map(|summary| &summary.passes);
        passes.filter(|pass| pass.name.starts_with(prefix)).fold(0.0, |sum, pass| sum + pass.time.median_ms)
    };
    Cost {
        name: row.name.clone(),
        settings: row.changes.iter().map(|(key, value)| format!("{key}={value}")).collect(),
        maps_ms: sum("shadow/"),
        moments_ms: sum("shadow/moments"),
        shade_ms: sum("direct/shade"),
        frame_ms: timings.as_ref().map_or(measured.wall_ms_per_frame, |t| t.frame_span.median_ms),
        timings,
    }
}

fn table(machine: &Machine, session: &Session, frames: u32, (costs, thesis): (&[Cost], usize)) -> String {
    let [width, height] = session.size;
    let mut text = format!(
        "# Shadow techniques on {}\n\n{}, {} triangles, {width}x{height}, {frames} frames, median GPU time in ms. Maps \
         are rendered every frame.\n",
        machine.adapter, session.scene_name, session.scene.gpu.triangle_count
    );
    for (title, rows) in
        [("The thesis' twelve", &costs[..thesis]), ("All other combinations", &costs[thesis..])]
    {
        let _ = write!(
            text,
            "\n## {title}\n\n| technique | maps | of it moments | shade | frame |\n| --- | --- | --- | --- | --- |\n"
        );
        for cost in rows {
            let Cost { name, maps_ms, moments_ms, shade_ms, frame_ms, .. } = cost;
            let _ =
                writeln!(text, "| {name} | {maps_ms:.3} | {moments_ms:.3} | {shade_ms:.3} | {frame_ms:.3} |");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_thesis_has_twelve_images_and_every_row_is_taken() {
        assert_eq!(thesis().len(), 12);
        for row in thesis() {
            let mut settings = Settings::default();
            row.changes.iter().for_each(|(key, value)| settings.set(key, value).unwrap());
            assert_eq!(settings.shadow.refused(), None, "{}", row.name);
        }
        let names: std::collections::BTreeSet<_> =
            thesis().iter().chain(&others()).map(|row| file_name(&row.name)).collect();
        assert_eq!(names.len(), thesis().len() + others().len());
    }
}
