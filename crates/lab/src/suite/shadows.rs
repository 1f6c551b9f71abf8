//! Every combination of shadow techniques, its picture and what it costs.
//!
//! The first twelve are those of the shadow thesis: {one map, cascades} × {depth, PCF 4×4, variance, blurred variance,
//! prefiltered exponential, blurred exponential}.

use std::fmt::Write as _;
use std::path::Path;

use chiaro::{Settings, StillOptions};
use serde::Serialize;

use crate::files::{bar, create_folder, write_text};
use crate::measure::{Measured, at_sixty, measure};
use crate::pictures::screen;
use crate::timings::{Machine, Summary, summarise};
use crate::{Error, Session};

/// A combination: what its name says, all of it set, so that no base changes what a row is.
struct Row {
    name: String,
    changes: [(&'static str, &'static str); 6],
}

impl Row {
    fn new(name: String, layout: &'static str, representation: &'static str, filter: &'static str) -> Self {
        let changes = [
            ("shadow.layout", layout),
            ("shadow.representation", representation),
            ("shadow.filter", filter),
            ("shadow.pcf_kernel", "3"),
            ("shadow.prefilter", "false"),
            ("shadow.fit", "frustum"),
        ];
        Self { name, changes }
    }

    /// Another value for one of the keys that rows set.
    fn with(mut self, key: &str, value: &'static str) -> Self {
        self.changes.iter_mut().filter(|(known, _)| *known == key).for_each(|change| change.1 = value);
        self
    }

    fn settings(&self, base: &Settings) -> Result<Settings, chiaro::Error> {
        let mut settings = base.clone();
        self.changes.iter().try_for_each(|(key, value)| settings.set(key, value))?;
        Ok(settings)
    }
}

/// What a combination costs.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// The combination.
    pub name: String,
    /// Its settings, `key=value`.
    pub settings: Vec<String>,
    /// All passes that make maps.
    pub maps_ms: f64,
    /// Making moments and blurring them, of that.
    pub moments_ms: f64,
    /// Shading with the lookups.
    pub shade_ms: f64,
    /// From the first pass to the last; on the clock where the adapter has no timestamps.
    pub frame_ms: f64,
    /// By pass, where it has.
    pub timings: Option<Summary>,
}

const LAYOUTS: [(&str, &str); 2] = [("single", "one map"), ("cascaded", "cascades")];

/// The thesis' twelve.
fn thesis() -> Vec<Row> {
    let rows = |(layout, layout_name): (&'static str, &str)| {
        let row = |name: &str, representation, filter| {
            Row::new(format!("{layout_name}, {name}"), layout, representation, filter)
        };
        [
            row("depth", "depth", "none"),
            row("pcf 4x4", "depth", "pcf").with("shadow.pcf_kernel", "4"),
            row("variance", "variance", "none"),
            row("variance blurred", "variance", "gaussian"),
            row("exponential prefiltered", "exponential", "none").with("shadow.prefilter", "true"),
            row("exponential blurred", "exponential", "gaussian"),
        ]
    };
    LAYOUTS.into_iter().flat_map(rows).collect()
}

/// All other combinations, those that the settings refuse included.
fn others() -> Vec<Row> {
    let representations = ["depth", "variance", "exponential", "evsm2", "evsm4", "moments"];
    let filters = ["none", "pcf", "pcss", "gaussian", "mip", "gaussian-mip"];
    let mut rows = Vec::new();
    for (layout, layout_name) in LAYOUTS {
        for representation in representations {
            for filter in filters {
                let name = format!("{layout_name}, {representation}, {filter}");
                rows.push(Row::new(name, layout, representation, filter));
            }
        }
    }
    for kernel in ["2", "5", "7", "disc"] {
        let row = Row::new(format!("cascades, pcf {kernel}"), "cascaded", "depth", "pcf");
        rows.push(row.with("shadow.pcf_kernel", kernel));
    }
    let fitted = Row::new("cascades fitted to the picture, pcf 3".into(), "cascaded", "depth", "pcf");
    rows.push(fitted.with("shadow.fit", "depth"));
    rows
}

/// All rows over a base, the thesis' first, each combination once.
fn rows(base: &Settings) -> Result<Vec<Row>, chiaro::Error> {
    let mut rows = thesis();
    for row in others() {
        let known = rows.iter().any(|known| known.changes == row.changes);
        if !known && row.settings(base)?.shadow.refused().is_none() {
            rows.push(row);
        }
    }
    Ok(rows)
}

/// The base that the suite measures over: maps are rendered every frame, and only shadows are compared.
///
/// # Errors
/// None that a caller could make.
pub fn base(mut settings: Settings) -> Result<Settings, Error> {
    settings.set("shadow.cache", "false")?;
    settings.set("post.antialias", "none")?;
    Ok(settings)
}

/// Measures every combination over [`base`], so many frames each, and writes a picture of each and `table.md` to `folder`.
/// Returns what they cost, and the table.
///
/// # Errors
/// When the device fails, or a file cannot be written.
pub fn run(
    session: &mut Session,
    base: &Settings,
    (frames, folder): (u32, &Path),
) -> Result<(Vec<Cost>, String), Error> {
    let rows = rows(base)?;
    let images = thesis().len();
    create_folder(folder)?;
    let bar = bar(rows.len() as u64, "{bar:40} {pos}/{len} {msg}, {eta} left");
    let mut costs = Vec::new();
    for row in &rows {
        bar.set_message(row.name.clone());
        session.renderer.set(row.settings(base)?)?;
        session.renderer.equip(&session.source, &mut session.scene)?;
        picture(session, &folder.join(file_name(&row.name)))?;
        let measured = measure(session, frames, at_sixty, || bar.tick())?;
        costs.push(cost(row, &measured));
        bar.inc(1);
    }
    bar.finish_and_clear();
    let text = table(&Machine::of(&session.gpu), session, frames, (&costs, images));
    write_text(&folder.join("table.md"), &text)?;
    Ok((costs, text))
}

fn picture(session: &mut Session, path: &Path) -> Result<(), Error> {
    let Session { renderer, scene, view, size, .. } = &mut *session;
    let options = StillOptions { size: *size, samples: 1, ..StillOptions::default() };
    let still = renderer.still(scene, view, &options)?;
    Ok(chiaro_image::write_png(path, &screen(&still.picture.wait(&session.gpu)?)?)?)
}

fn file_name(name: &str) -> String {
    let words: Vec<_> = name.split([' ', ',']).filter(|word| !word.is_empty()).collect();
    words.join("_") + ".png"
}

fn cost(row: &Row, measured: &Measured) -> Cost {
    let timings = summarise(&measured.timings);
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
    use chiaro::techniques::shadow::{Filter, Representation};

    #[test]
    fn the_thesis_has_twelve_images_and_every_row_its_own_name() {
        assert_eq!(thesis().len(), 12);
        let names: std::collections::BTreeSet<_> =
            thesis().iter().chain(&others()).map(|row| file_name(&row.name)).collect();
        assert_eq!(names.len(), thesis().len() + others().len());
    }

    #[test]
    fn a_row_is_what_its_name_says_whatever_the_base() {
        let preset = |name: &str| {
            let mut base = Settings::default();
            base.apply_preset(name, None).unwrap();
            base
        };
        let changed = |key: &str, value: &str| {
            let mut base = Settings::default();
            base.set(key, value).unwrap();
            base
        };
        let mut bases: Vec<_> = Settings::presets().map(|(name, _)| preset(name)).collect();
        bases.push(changed("shadow.prefilter", "true"));
        bases.push(changed("shadow.fit", "depth"));
        bases.push(changed("shadow.pcf_kernel", "disc"));
        bases.push(changed("shadow.layout", "none"));
        let plain = Settings::default();
        for base in &bases {
            let rows = rows(base).unwrap();
            assert_eq!(rows.len(), super::rows(&plain).unwrap().len());
            for row in &rows {
                let (mine, expected) =
                    (row.settings(base).unwrap().shadow, row.settings(&plain).unwrap().shadow);
                assert_eq!(mine.refused(), None, "{}", row.name);
                let is = |s: &chiaro::techniques::shadow::ShadowSettings| {
                    (s.layout, s.representation, s.filter, s.pcf_kernel, s.prefilter, s.fit)
                };
                assert_eq!(is(&mine), is(&expected), "{}", row.name);
            }
        }
        let shadow = thesis()[0].settings(&preset("thesis-shadows")).unwrap().shadow;
        assert_eq!((shadow.representation, shadow.filter), (Representation::Depth, Filter::None));
    }
}
