//! Techniques side by side against one truth: figures, costs, pictures.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use chiaro::Settings;
use chiaro_image::{Comparison, Heat, Image, Picture, Precision, write_exr, write_png};
use serde::Serialize;

use crate::cost::Cost;
use crate::figures::{Figures, against};
use crate::files::{bar, create_folder, write_json, write_text};
use crate::judge::{JudgeOptions, Judged, Moment, judge};
use crate::part::Part;
use crate::row::Columns;
use crate::session::{Tell, by_key, camera_text};
use crate::technique::{Method, Technique};
use crate::truth::{Floor, Truth};
use crate::truths::{TruthOptions, Truths};
use crate::{Error, Machine, Session};

/// Where the truth comes from.
#[derive(Clone, Debug)]
pub enum Source {
    /// It is traced, or found in the cache.
    Full(TruthOptions),
    /// It is a file, less another.
    File {
        /// The file.
        path: PathBuf,
        /// What is subtracted from it.
        minus: Option<PathBuf>,
    },
}

/// What is told of a technique.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What it is called.
    pub technique: String,
    /// What it was asked for by.
    pub asked: String,
    /// All its settings, where it has any.
    pub settings: Option<BTreeMap<String, String>>,
    /// Samples of each pixel.
    pub samples: u32,
    /// What the renderer gave up.
    pub notes: Vec<String>,
    /// How far it is from the truth.
    #[serde(flatten)]
    pub figures: Figures,
    /// What it takes.
    pub cost: Cost,
}

/// All that is told.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The version.
    pub chiaro: &'static str,
    /// Who measured.
    pub machine: Machine,
    /// What was seen.
    pub scene: String,
    /// A hash of it.
    pub fingerprint: String,
    /// Who looks.
    pub camera: String,
    /// Pixels.
    pub size: [u32; 2],
    /// The moments, seconds.
    pub times_s: Vec<f64>,
    /// Whether a mask leaves pixels out.
    pub masked: bool,
    /// What of the light.
    pub part: Part,
    /// Seeds of each technique.
    pub seeds: u32,
    /// Pictures of each seed.
    pub frames: usize,
    /// Where the truth comes from.
    pub truth: String,
    /// Its samples of each pixel, where it was traced; the least of all frames.
    pub truth_samples: Option<u32>,
    /// How far the truth is from itself, where that is known; of frames the first.
    pub floor: Option<Floor>,
    /// The techniques, in the order asked.
    pub rows: Vec<Row>,
    #[serde(skip)]
    columns: Vec<Columns>,
}

/// Holds techniques against a truth and writes a report of it: `results.json`, `results.csv`, and of the truth and the first
/// seed of every technique the pictures as EXR (nits), PNG (all at one exposure) and signed error map. Of the base settings
/// those count that say what is there: one truth for all.
///
/// # Errors
/// When the truth cannot be had, settings do not go together, the device fails, or a file cannot be written.
pub fn compare(
    session: &mut Session,
    (techniques, base): (&[Technique], &Settings),
    (source, options): (&Source, &JudgeOptions),
    folder: &Path,
    tell: Tell<'_>,
) -> Result<Report, Error> {
    create_folder(folder)?;
    // What cannot be rendered is told before anything is traced.
    for (technique, settings) in techniques.iter().filter_map(|t| Some((t, t.settings()?))) {
        let plan = session.renderer.plan(settings.clone(), session.scene.gpu.facts);
        plan.map_err(|error| Error::from(error).of(format!("technique {}", technique.label)))?;
    }
    let truths = truths(session, base, source, &options.moments, tell)?;
    let mask = options.mask.as_ref();
    let Some(first) = truths.first() else {
        return Err(Error::Usage("there is no frame to compare".to_owned()));
    };
    let size = (session.size[0], session.size[1]);
    if let Some(mask) = mask.filter(|mask| mask.size() != size) {
        let (width, height) = mask.size();
        let [w, h] = session.size;
        return Err(Error::Usage(format!("the mask is {width}x{height}, but pictures are {w}x{h}")));
    }
    let lit = |truth: &Truth| truth.lit(mask).map_err(|error| error.of(options.part.name()));
    truths.iter().try_for_each(lit)?;
    // One exposure for all pictures, so that they can be told apart by eye.
    let exposure = against(&first.image, first, mask)
        .map_err(|error| error.of(format!("the truth of {}", options.part.name())))?
        .exposure();
    let floor = first.floor(mask);
    for (moment, truth) in options.moments.iter().zip(&truths) {
        write_picture(&picture_path(folder, "truth", *moment), &truth.image, exposure)?;
    }
    let progress = bar(techniques.len() as u64, "comparing {bar:40} {pos}/{len} {msg}");
    let mut report = Report {
        chiaro: env!("CARGO_PKG_VERSION"),
        machine: Machine::of(&session.gpu),
        scene: session.scene_name.clone(),
        fingerprint: format!("{:016x}", session.source.fingerprint()),
        camera: camera_text(&session.view),
        size: session.size,
        times_s: options.moments.iter().map(|moment| moment.time_s).collect(),
        masked: options.mask.is_some(),
        part: options.part,
        seeds: options.seeds,
        frames: options.moments.len(),
        truth: source.words(),
        truth_samples: truths.iter().filter_map(|truth| truth.samples).min(),
        floor,
        rows: Vec::new(),
        columns: Vec::new(),
    };
    for technique in techniques {
        progress.set_message(technique.label.clone());
        let name = technique.file_name();
        let mut keep = |index: usize, image: &Image, comparison: &Comparison| {
            let path = picture_path(folder, &name, options.moments[index]);
            write_picture(&path, image, exposure)?;
            Ok(write_png(path.with_extension("error.png"), &comparison.heat_map(Heat::Signed))?)
        };
        let judged = judge(session, (technique, base), &truths, options, &mut keep)
            .map_err(|error| error.of(format!("technique {}", technique.label)))?;
        let notes = if technique.settings().is_some() { session.notes().to_vec() } else { Vec::new() };
        for note in &notes {
            tell(&format!("warning: {}: {note}", technique.label));
        }
        if let (Method::Paths { budget_ms, .. }, Some(ms)) = (&technique.method, judged.cost.paths_ms)
            && !(0.5 * budget_ms..2.0 * budget_ms).contains(&ms)
        {
            tell(&format!(
                "warning: {}: {} samples took {ms:.2} ms, not {budget_ms}; at least one is traced, and how many fit was \
                 found once: --no-cache finds it anew",
                technique.label, judged.samples
            ));
        }
        report.columns.push(Columns::new(&technique.label, session, options, &judged, floor));
        let Judged { figures, cost, samples } = judged;
        report.rows.push(Row {
            technique: technique.label.clone(),
            asked: technique.asked.clone(),
            settings: technique.settings().map(by_key),
            samples,
            notes,
            figures,
            cost,
        });
        // Whoever stops it keeps what was measured.
        report.write(folder)?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    Ok(report)
}

impl Source {
    fn words(&self) -> String {
        match self {
            Self::Full(_) => "full".to_owned(),
            Self::File { path, minus: None } => path.display().to_string(),
            Self::File { path, minus: Some(minus) } => format!("{} - {}", path.display(), minus.display()),
        }
    }
}

/// The truth of every moment.
fn truths(
    session: &mut Session,
    base: &Settings,
    source: &Source,
    moments: &[Moment],
    tell: Tell<'_>,
) -> Result<Vec<Truth>, Error> {
    match source {
        Source::Full(options) => {
            let mut truths = Truths::new(session, options.clone());
            let bar = bar(moments.len() as u64, "truths {bar:40} {pos}/{len}, {eta} left");
            let mut all: Vec<Truth> = Vec::new();
            for moment in moments {
                bar.inc(1);
                // Where nothing moves one is for all.
                let truth = if let Some(first) = all.first().filter(|_| session.duration_s().is_none()) {
                    first.clone()
                } else {
                    session.go_to(moment.time_s)?;
                    truths.of((session, base), moment.time_s, tell)?
                };
                all.push(truth);
            }
            bar.finish_and_clear();
            Ok(all)
        }
        Source::File { path, minus } => {
            if moments.len() > 1 {
                return Err(Error::Usage(format!(
                    "{} is one image; moving pictures are held against a truth that is traced: --reference full",
                    path.display()
                )));
            }
            let truth = Truth::read(path, minus.as_deref())?;
            if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
                let path = path.display();
                tell(&format!(
                    "warning: {path} holds colours of a display, white being 1, and pictures are nits"
                ));
            }
            let (width, height) = truth.image.size();
            if [width, height] != session.size {
                let [w, h] = session.size;
                return Err(Error::Usage(format!(
                    "{} is {width}x{height}, but pictures are {w}x{h}; --size {width}x{height} makes them so",
                    path.display()
                )));
            }
            Ok(vec![truth])
        }
    }
}

/// `report/label.exr`, and `report/label/frame.0007.exr` of frames.
fn picture_path(folder: &Path, name: &str, moment: Moment) -> PathBuf {
    match moment.number {
        None => folder.join(format!("{name}.exr")),
        Some(number) => folder.join(name).join(format!("frame.{number:04}.exr")),
    }
}

fn write_picture(path: &Path, image: &Image, exposure: f64) -> Result<(), Error> {
    crate::files::create_parent(path)?;
    write_exr(path, image, Precision::Float)?;
    Ok(write_png(path.with_extension("png"), &Picture::from_linear(image, exposure as f32))?)
}

impl Report {
    fn write(&self, folder: &Path) -> Result<(), Error> {
        write_json(&folder.join("results.json"), self)?;
        write_text(&folder.join("results.csv"), &self.csv()?)
    }

    /// A line for each technique.
    ///
    /// # Errors
    /// When memory is short.
    pub fn csv(&self) -> Result<String, Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in &self.columns {
            writer.serialize(row)?;
        }
        let bytes =
            writer.into_inner().map_err(|error| Error::Work(format!("cannot write a table: {error}")))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// The table for people.
    pub fn table(&self) -> String {
        let [width, height] = self.size;
        let mut text = format!(
            "{} of {}, {width}x{height}, against {}, on {}\n",
            self.part.name(),
            self.scene,
            self.truth,
            self.machine.adapter
        );
        if let Some(floor) = self.floor {
            let samples = self.truth_samples.map_or(String::new(), |samples| format!(" ({samples} samples)"));
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "the truth's own noise{samples}: nmae {:.4}, rmse {:.4}",
                floor.nmae, floor.rmse
            );
        }
        let moves = self.rows.iter().any(|row| row.figures.flicker.is_some());
        let widest = self.rows.iter().map(|row| row.technique.chars().count()).max().unwrap_or(0).max(9);
        let last = if moves { "flicker" } else { "hdr flip" };
        let _ = writeln!(
            text,
            "\n{:<widest$} {:>8} {:>8} {:>8} {:>8} {last:>8} {:>8} {:>8} {:>18} {:>9} {:>8}",
            "technique", "ratio", "nmae", "relmse", "flip", "bias", "noise", "GPU ms (span)", "sum", "MB"
        );
        for Row { technique, figures, cost, .. } in &self.rows {
            let number = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.4}"));
            let last = if moves { figures.flicker } else { figures.hdr_flip };
            let span = match (&cost.gpu, cost.paths_ms) {
                (Some(gpu), _) => format!("{:.3} ± {:.3}", gpu.frame_span.median_ms, gpu.frame_span.iqr_ms),
                (None, Some(paths_ms)) => format!("{paths_ms:.3}"),
                (None, None) => "-".to_owned(),
            };
            let sum =
                cost.gpu.as_ref().map_or("-".to_owned(), |gpu| format!("{:.3}", gpu.pass_sum.median_ms));
            let megabytes = match cost.room_bytes() {
                0 => "-".to_owned(),
                bytes => format!("{:.1}", bytes as f64 * 1e-6),
            };
            let _ = writeln!(
                text,
                "{technique:<widest$} {:>8.4} {:>8.4} {:>8.4} {:>8.4} {:>8} {:>8} {:>8} {span:>18} {sum:>9} {megabytes:>8}",
                figures.mean_ratio,
                figures.nmae,
                figures.relmse,
                figures.flip,
                number(last),
                number(figures.bias),
                number(figures.noise),
            );
        }
        text
    }
}
