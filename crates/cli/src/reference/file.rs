//! What a reference's EXR says that it is of, and going on from one.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use chiaro::{FirstHit, Reference};
use chiaro_image::read_layers;
use chiaro_lab::session::{camera_text, truth_settings};
use chiaro_lab::{Session, Tracing};
use clap::ValueEnum;

use super::shards::Shards;
use crate::args::ReferenceArgs;
use crate::output::WrongUsage;

/// Samples a pixel so far.
pub const SAMPLES: &str = "samples";
/// Which layers hold sums, and how.
pub const LAYOUT: &str = "layout";
/// Pairs of floats.
pub const PAIRS: &str = "2";
/// Samples that share light paths, and are squared together.
pub const ROUND: &str = "samples in a round";
/// Which of many machines' parts.
pub const SHARDS: &str = "shards";
/// Only where parts were merged.
pub const MERGED: &str = "merged";
/// Names of `--aov`.
pub const AOVS: &str = "aovs";
/// Seconds of `--time-limit` that ended the render; only where they did.
pub const TIMED_OUT: &str = "stopped after seconds";
/// Written for people; what counts is the fingerprint.
pub const SCENE: &str = "scene";
/// Longer values are not spelled out in messages.
const SHORT: usize = 40;

/// What is traced: the sums of two files can go on in each other only if all of this is equal, but for the samples and
/// the scene's name.
pub fn about(
    args: &ReferenceArgs,
    time_s: f64,
    session: &Session<Tracing>,
    reference: &Reference,
) -> BTreeMap<String, String> {
    let integrator = args.integrator.to_possible_value();
    let entries = [
        ("chiaro", env!("CARGO_PKG_VERSION").to_owned()),
        (LAYOUT, PAIRS.to_owned()),
        ("integrator", integrator.map_or(String::new(), |value| value.get_name().to_owned())),
        // Light paths of another number of samples together have other radii.
        (ROUND, reference.round().to_string()),
        (SHARDS, args.shard.map_or(Shards::WHOLE.to_owned(), |shard| Shards::from(shard).to_string())),
        ("time", format!("{time_s} s")),
        (SCENE, session.scene_name.clone()),
        ("scene fingerprint", format!("{:016x}", session.source.fingerprint())),
        ("camera", camera_text(&session.view)),
        ("origin", format!("{} m", session.source.origin)),
        ("settings", truth_settings(session.renderer.settings())),
        ("seed", args.seed.to_string()),
        ("max depth", args.max_depth.to_string()),
        ("diffuse bounces", args.diffuse_bounces.map_or("no limit".to_owned(), |most| most.to_string())),
        (AOVS, sorted(&args.aovs).join(" ")),
    ];
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Remembers that the time limit ended the render.
pub fn set_timed_out(about: &mut BTreeMap<String, String>, limit_s: f64) {
    about.insert(TIMED_OUT.to_owned(), limit_s.to_string());
}

fn sorted(names: &[String]) -> Vec<&str> {
    let mut names: Vec<_> = names.iter().map(String::as_str).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Parts of the light that the tracers tell apart, by the names of `--aov`.
const LIGHT: [&str; 3] = ["caustics", "direct", "indirect"];

/// Which quantities of the surface seen first are among the names of `--aov`.
pub fn first_hits(args: &ReferenceArgs) -> anyhow::Result<Vec<FirstHit>> {
    let mut wanted = Vec::new();
    for name in sorted(&args.aovs) {
        let first_hit = FirstHit::ALL.into_iter().find(|what| what.layer() == name);
        if first_hit.is_none() && !LIGHT.contains(&name) {
            let mut names: Vec<_> = LIGHT.into_iter().chain(FirstHit::ALL.map(FirstHit::layer)).collect();
            names.sort_unstable();
            let known = names.join(", ");
            bail!(WrongUsage(format!("--aov {name}: there is none of that name; there are {known}")));
        }
        wanted.extend(first_hit);
    }
    Ok(wanted)
}

/// A layer of sums by its name in the file: `sum.NAME` is a part, or a quantity, that is summed up like the picture.
pub fn in_file(layer: &str) -> String {
    let whole = ["sum", "squares"].contains(&layer.split('.').next().unwrap_or_default());
    if whole { layer.to_owned() } else { format!("sum.{layer}") }
}

/// What differs between two files, or what one says and what is asked for, by the keys of the latter.
pub fn differences<'a>(
    then: &BTreeMap<String, String>,
    now: &BTreeMap<String, String>,
    (but, word): (impl Fn(&str) -> bool + 'a, &str),
) -> Vec<String> {
    let mut differences = Vec::new();
    for (key, now) in now.iter().filter(|(key, _)| !but(key)) {
        let then = then.get(key).map_or("", String::as_str);
        if then != now && then.len().max(now.len()) > SHORT {
            differences.push(key.clone());
        } else if then != now {
            differences.push(format!("{key} ({then}, {word} {now})"));
        }
    }
    differences
}

/// Goes on from a file, after making sure that it is of the same reference. Returns the time limit that ended it.
pub fn resume(
    path: &Path,
    about: &BTreeMap<String, String>,
    size: [u32; 2],
    reference: &mut Reference,
) -> anyhow::Result<Option<f64>> {
    let file = read_layers(path)
        .context("--resume cannot go on from the output file; without it the render starts anew")?;
    let Some(samples) = file.about.get(SAMPLES).and_then(|text| text.parse().ok()) else {
        bail!("--resume: {} was not written by `chiaro reference`; name another output", path.display());
    };
    if file.is_part() {
        bail!(
            "--resume: {} holds a part of its picture only (its data window is not its display window); without \
             --resume the render starts anew and replaces the file",
            path.display()
        );
    }
    if file.about.get(LAYOUT).is_none_or(|layout| layout != PAIRS) {
        bail!(
            "--resume: {} is of another version of chiaro, which kept its sums otherwise; without --resume the render \
             starts anew and replaces the file",
            path.display()
        );
    }
    if file.about.contains_key(MERGED) {
        bail!(
            "--resume: {} was merged from parts; go on with each part by its own --shard and --resume, and merge them \
             again",
            path.display()
        );
    }
    let mut differences = differences(&file.about, about, (|key: &str| key == SCENE, "now"));
    let (width, height) = file.size();
    if [width, height] != size {
        differences.insert(0, format!("size ({width}x{height}, now {}x{})", size[0], size[1]));
    }
    if !differences.is_empty() {
        bail!(
            "--resume: {} is of another reference; these differ: {}. Without --resume the render starts anew and \
             replaces the file",
            path.display(),
            differences.join(", ")
        );
    }
    let layers: Vec<_> =
        reference.layers().filter_map(|(name, ..)| Some((name, file.texels(&in_file(name))?))).collect();
    reference.restore(samples, &layers).with_context(|| format!("--resume {}", path.display()))?;
    Ok(file.about.get(TIMED_OUT).and_then(|text| text.parse().ok()))
}

/// Whether the AOVs beside a picture were written.
pub fn has_aovs(path: &Path, names: &[String]) -> bool {
    names.iter().all(|name| beside(path, name).exists())
}

pub fn beside(path: &Path, name: &str) -> PathBuf {
    path.with_extension(format!("{name}.exr"))
}
