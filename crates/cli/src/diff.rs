//! `chiaro diff`: image A against the reference B.

mod folder;
mod sequence;

use std::fmt::Write;
use std::path::Path;

use anyhow::bail;
use chiaro_image::{CompareOptions, Comparison, Image, Metrics, read, write_png};

use crate::args::DiffArgs;
use crate::output::{WrongUsage, print, print_json};
use crate::values::extension;

pub fn run(args: &DiffArgs) -> anyhow::Result<()> {
    if let Some(path) = &args.output {
        let (of, wanted) = if args.sequence { ("a sequence", "svg") } else { ("one image", "png") };
        if extension(path) != wanted {
            bail!(WrongUsage(format!("-o {}: what is drawn of {of} is a .{wanted}", path.display())));
        }
    }
    if args.sequence {
        return sequence::run(args);
    }
    if let Some(folder) = [&args.a, &args.b].into_iter().find(|path| path.is_dir()) {
        let folder = folder.display();
        bail!(WrongUsage(format!("{folder} is a folder; --sequence compares folders of numbered images")));
    }
    let optional =
        |path: &Option<_>| -> anyhow::Result<Option<Image>> { Ok(path.as_ref().map(read).transpose()?) };
    let (a, b) = rayon::join(|| read(&args.a), || read(&args.b));
    let (a, b) = (a?, b?);
    let (mask, minus_a, minus_b) =
        (optional(&args.mask)?, optional(&args.minus_a)?, optional(&args.minus_b)?);
    let options = CompareOptions {
        mask: mask.as_ref(),
        minus_a: minus_a.as_ref(),
        minus_b: minus_b.as_ref(),
        blur_px: args.blur,
    };
    let comparison = Comparison::new(&a, &b, &options)?;
    let metrics = comparison.metrics();
    if let Some(path) = &args.output {
        write_png(path, &comparison.heat_map(args.heat.into()))?;
    }
    if args.json { print_json(&metrics) } else { print(&table(args, &b, &metrics)) }
}

fn table(args: &DiffArgs, b: &Image, metrics: &Metrics) -> String {
    let mut text = String::new();
    let mut row = |name: &str, value: &dyn std::fmt::Display, note: &str| {
        // Writing to a string does not fail.
        let _ = if note.is_empty() {
            writeln!(text, "{name:<12}{value}")
        } else {
            writeln!(text, "{name:<12}{value:<12}{note}")
        };
    };
    let file = |path: &Path, minus: Option<&Path>| {
        minus.map_or(path.display().to_string(), |minus| format!("{} - {}", path.display(), minus.display()))
    };
    row("A", &file(&args.a, args.minus_a.as_deref()), "");
    row("B", &file(&args.b, args.minus_b.as_deref()), "");
    let all = b.pixels().len();
    let share = 100.0 * metrics.pixels as f64 / all as f64;
    row("pixels", &metrics.pixels.to_string(), &format!("{share:.1} % of {} x {}", b.width(), b.height()));
    if metrics.not_finite > 0 {
        row(
            "not finite",
            &metrics.not_finite.to_string(),
            "values of A that are NaN or infinite, taken as 0",
        );
    }
    if args.blur > 0.0 {
        row("blur", &format!("{} px", args.blur), "standard deviation");
    }
    row("mean ratio", &format!("{:.6}", metrics.mean_ratio), "sum A / sum B; 1 is the same energy");
    row("nmae", &format!("{:.6}", metrics.nmae), "mean |A-B| / mean B");
    row(
        "relmse",
        &format!("{:.6}", metrics.relmse),
        "relative squared error without the worst 0.1 % of pixels",
    );
    row("psnr", &format!("{:.3} dB", metrics.psnr), "of the exposed pictures; inf is the same");
    row("ssim", &format!("{:.6}", metrics.ssim), "of the exposed pictures; 1 is the same");
    row("flip", &format!("{:.6}", metrics.flip), "0 looks the same, 1 is as different as can be");
    row("hdr flip", &format!("{:.6}", metrics.hdr_flip), "the same over all exposures that B needs");
    if let Some(path) = &args.output {
        row("heat map", &path.display(), "");
    }
    text
}
