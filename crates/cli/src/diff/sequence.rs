//! `chiaro diff --sequence`: the frames of one folder against those of another.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};
use chiaro_image::{
    CompareOptions, ComparedFrame, Comparison, FrameMetrics, Image, ImageError, Sequence, SequenceMetrics,
    read,
};
use chiaro_lab::files::bar;
use chiaro_lab::plot::{self, Curve, Panel};
use rayon::prelude::*;
use serde::Serialize;

use super::folder::Numbered;
use crate::args::DiffArgs;
use crate::output::{WrongUsage, print, print_json};

/// Frames measured at once: each takes about 150 bytes a pixel.
const AT_ONCE: usize = 8;
/// Numbers that a message names.
const NAMED: usize = 5;

/// A frame's row.
#[derive(Debug, Serialize)]
struct Row {
    frame: u64,
    #[serde(flatten)]
    metrics: FrameMetrics,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    a: &'a Path,
    b: &'a Path,
    /// Frames from this one on count in `all`.
    from: u64,
    frames: &'a [Row],
    all: SequenceMetrics,
}

/// Masks of all frames, or of each.
enum Mask {
    None,
    Of(Image),
    Each(Numbered),
}

pub fn run(args: &DiffArgs) -> anyhow::Result<()> {
    let (a, b) = (Numbered::find(&args.a)?, Numbered::find(&args.b)?);
    for (one, other) in [(&a, &b), (&b, &a)] {
        let alone: Vec<_> = one.without(other).collect();
        if !alone.is_empty() {
            let (one, other) = (one.folder.display(), other.folder.display());
            bail!("frame {} is in {one} but not in {other}; both must hold the same numbers", list(&alone));
        }
    }
    let numbers: Vec<_> = b.files.keys().copied().collect();
    let last = numbers[numbers.len() - 1];
    let from = args.from.unwrap_or(numbers[0]);
    if from > last {
        bail!(WrongUsage(format!("--from {from}: the last frame is {last}")));
    }
    let mask = mask(args.mask.as_deref())?;
    let gaps: Vec<_> = numbers.windows(2).filter(|pair| pair[1] - pair[0] > 1).map(|pair| pair[0]).collect();
    if !gaps.is_empty() {
        let gaps = list(&gaps);
        eprintln!(
            "note: numbers are left out after {gaps}; changes there are to the next frame that there is"
        );
    }
    let (rows, all) = measure(args, &numbers, (&a, &b, &mask), from)?;
    if all.changes == 0 {
        eprintln!("note: there is no change between {} frame(s), so there is no flicker", all.frames);
    }
    if let Some(path) = &args.output {
        plot::write(path, &panels(&rows, &all))?;
    }
    if args.json {
        return print_json(&Report { a: &args.a, b: &args.b, from, frames: &rows, all });
    }
    print(&table(args, &rows, (from, &all)))
}

fn mask(path: Option<&Path>) -> anyhow::Result<Mask> {
    Ok(match path {
        None => Mask::None,
        Some(path) if path.is_dir() => Mask::Each(Numbered::find(path).context("--mask")?),
        Some(path) => Mask::Of(read(path)?),
    })
}

fn measure(
    args: &DiffArgs,
    numbers: &[u64],
    (a, b, mask): (&Numbered, &Numbered, &Mask),
    from: u64,
) -> anyhow::Result<(Vec<Row>, SequenceMetrics)> {
    let progress = bar(numbers.len() as u64, "comparing {bar:40} {pos}/{len} frames, {eta} left");
    let frame = |number: u64| -> anyhow::Result<ComparedFrame> {
        let (a, b) = (read(a.file(number)?)?, read(b.file(number)?)?);
        let own = if let Mask::Each(masks) = mask { Some(read(masks.file(number)?)?) } else { None };
        let mask = if let Mask::Of(mask) = mask { Some(mask) } else { own.as_ref() };
        let options = CompareOptions { mask, blur_px: args.blur, ..CompareOptions::default() };
        let compared = Comparison::new(&a, &b, &options)?.into();
        progress.inc(1);
        Ok(compared)
    };
    let mut sequence = Sequence::default();
    let mut rows = Vec::new();
    for some in numbers.chunks(AT_ONCE.min(rayon::current_num_threads())) {
        let frames: Vec<_> = some.par_iter().map(|&number| (number, frame(number))).collect();
        for (number, frame) in frames {
            if let Err(error) = &frame
                && number < from
                && error.downcast_ref().is_some_and(|e| matches!(e, ImageError::NoReference { .. }))
            {
                eprintln!("note: frame {number} does not count, and is not measured: {error}");
                sequence.skip();
                continue;
            }
            let metrics = frame.and_then(|frame| Ok(sequence.add(frame, number >= from)?));
            let metrics = metrics.with_context(|| format!("frame {number}"))?;
            rows.push(Row { frame: number, metrics });
        }
    }
    progress.finish_and_clear();
    Ok((rows, sequence.metrics().context("no frame counts")?))
}

/// The first of them.
fn list(numbers: &[u64]) -> String {
    let named: Vec<_> = numbers.iter().take(NAMED).map(u64::to_string).collect();
    let more = numbers.len().saturating_sub(NAMED);
    named.join(", ") + &if more > 0 { format!(" (and {more} more)") } else { String::new() }
}

fn table(args: &DiffArgs, rows: &[Row], (from, all): (u64, &SequenceMetrics)) -> String {
    let mut text = format!("A           {}\nB           {}\n", args.a.display(), args.b.display());
    // Writing to a string does not fail.
    let [first, last] = [&rows[0], &rows[rows.len() - 1]].map(|row| row.frame);
    let _ = writeln!(text, "frames      {}, from {first} to {last}", rows.len());
    let _ = writeln!(text, "pixels      {}, of the frames from {from} on", all.pixels);
    if args.blur > 0.0 {
        let _ = writeln!(text, "blur        {} px  standard deviation", args.blur);
    }
    if all.not_finite > 0 {
        let count = all.not_finite;
        let _ = writeln!(text, "not finite  {count}  values of A that are NaN or infinite, taken as 0");
    }
    let [frame, ratio, nmae, relmse, flip, flicker] =
        ["frame", "mean ratio", "nmae", "relmse", "flip", "flicker"];
    let _ = writeln!(text, "\n{frame:>8}{ratio:>13}{nmae:>13}{relmse:>13}{flip:>13}{flicker:>13}");
    let mut line = |name: &str, [ratio, nmae, relmse, flip]: [f64; 4], flicker: Option<f64>| {
        let flicker = flicker.map_or("-".to_owned(), |value| format!("{value:.6}"));
        let _ = writeln!(text, "{name:>8}{ratio:>13.6}{nmae:>13.6}{relmse:>13.6}{flip:>13.6}{flicker:>13}");
    };
    for Row { frame, metrics: m } in rows {
        line(&frame.to_string(), [m.mean_ratio, m.nmae, m.relmse, m.flip], m.flicker);
    }
    line(&format!("{from} on"), [all.mean_ratio, all.nmae, all.relmse, all.flip], all.flicker);
    text
}

fn panels(rows: &[Row], all: &SequenceMetrics) -> [Panel; 3] {
    let curve = |name: &str, mean: Option<f64>, of: &dyn Fn(&FrameMetrics) -> Option<f64>| {
        let points = rows.iter().filter_map(|row| Some((row.frame as f64, of(&row.metrics)?)));
        let mean = mean.map_or("-".to_owned(), |mean| format!("{mean:.4}"));
        Curve { name: format!("{name}: {mean}"), points: points.collect() }
    };
    let errors = vec![
        curve("nmae", Some(all.nmae), &|m| Some(m.nmae)),
        curve("flicker", all.flicker, &|m| m.flicker),
        curve("flip", Some(all.flip), &|m| Some(m.flip)),
    ];
    let squares = vec![curve("relmse", Some(all.relmse), &|m| Some(m.relmse))];
    let energy = vec![curve("mean ratio", Some(all.mean_ratio), &|m| Some(m.mean_ratio))];
    let panel = |title: &str, low, curves| Panel {
        title: title.to_owned(),
        x: "frame",
        low,
        curves,
        notes: Vec::new(),
    };
    [
        panel("Error and flicker", Some(0.0), errors),
        panel("Squared error", Some(0.0), squares),
        panel("Energy", None, energy),
    ]
}
