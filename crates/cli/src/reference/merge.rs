//! `chiaro merge`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use chiaro::FirstHit;
use chiaro_image::{ExactSums, Layers, read_about, read_layers};

use super::file::{
    AOVS, LAYOUT, MERGED, PAIRS, ROUND, SAMPLES, SCENE, SHARDS, TIMED_OUT, differences, in_file,
};
use super::shards::Shards;
use super::sums::{Sums, low};
use crate::args::MergeArgs;
use crate::output::{WrongUsage, print};

/// Sums that every reference has.
const ALWAYS: [&str; 4] = ["sum", "squares", "direct", "caustics"];

pub fn run(args: &MergeArgs) -> anyhow::Result<()> {
    let (parts, beside): (Vec<_>, Vec<_>) = args.parts.iter().partition(|path| !is_beside(path, &args.parts));
    if let Some(one) = beside.first() {
        let count = beside.len();
        eprintln!("note: {} and what else lies beside parts ({count} in all) is left alone", one.display());
    }
    let canonical = |path: &Path| std::fs::canonicalize(path).ok();
    let output = canonical(&args.output);
    if let Some(part) = parts.iter().find(|part| output.is_some() && canonical(part) == output) {
        let part = part.display();
        bail!(WrongUsage(format!(
            "-o {part}: it is one of the parts, which could not be gone on with any more"
        )));
    }
    let mut parts = parts.into_iter().map(Part::open).collect::<anyhow::Result<Vec<_>>>()?;
    let shards = together(&parts)?;
    parts.sort_by(|a, b| a.shards.numbers.cmp(&b.shards.numbers));
    let Some(first) = parts.first() else { bail!("there are no parts to merge") };
    let aovs = aovs_of_all(&parts);
    if parts.iter().any(|part| part.aovs() != aovs) {
        eprintln!("note: AOVs that not all parts have are left out");
    }
    let round = first.about.get(ROUND).and_then(|text| text.parse().ok());
    let round =
        round.with_context(|| format!("{} does not say its rounds' samples", first.path.display()))?;
    let mut sums = Sums { size: first.size, samples: 0, round, layers: Vec::new() };
    let mut exact: Vec<_> = summed(&aovs).map(|name| (name, None)).collect();
    // One after the other, so that only one is in memory beside the sums.
    for part in &parts {
        let file = read_layers(&part.path)?;
        for (name, sums) in &mut exact {
            part.add(&file, name, sums)?;
        }
        sums.samples = sums.samples.saturating_add(part.samples);
    }
    for (name, exact) in exact {
        if let Some(exact) = exact {
            sums.insert(&name, exact);
        }
    }
    let mut about = first.about.clone();
    about.remove(TIMED_OUT);
    about.insert(SHARDS.to_owned(), shards.to_string());
    about.insert(MERGED.to_owned(), "yes".to_owned());
    about.insert(AOVS.to_owned(), aovs.join(" "));
    sums.write(&args.output, &about)?;
    for name in &aovs {
        sums.write_aov(&args.output, name)?;
    }
    let held = match (shards.are_all(), &shards.numbers[..]) {
        (true, [_]) => "the only shard".to_owned(),
        (true, _) => format!("all {} shards", shards.of),
        (false, [_]) => format!("shard {shards}"),
        (false, _) => format!("shards {shards}"),
    };
    let (path, noise) = (args.output.display(), 100.0 * sums.noise()?);
    print(&format!("{path}  {} spp, holds {held}, noise {noise:.2} %\n", sums.samples))
}

/// Whether a file lies beside another of them as an AOV does: `p.1.direct.exr` beside `p.1.exr`.
fn is_beside(path: &Path, all: &[PathBuf]) -> bool {
    let name = |path: &Path| path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
    let own = name(path);
    all.iter().any(|other| {
        let stem = other.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        other.parent() == path.parent() && own != name(other) && own.starts_with(&format!("{stem}."))
    })
}

/// A file to merge, by what it says of itself.
struct Part {
    path: PathBuf,
    size: [u32; 2],
    samples: u32,
    shards: Shards,
    about: BTreeMap<String, String>,
}

impl Part {
    fn open(path: &PathBuf) -> anyhow::Result<Self> {
        let head = read_about(path)?;
        let shown = path.display();
        let samples = head.about.get(SAMPLES).and_then(|text| text.parse().ok());
        let (Some(samples), Some(layout)) = (samples, head.about.get(LAYOUT)) else {
            bail!(
                "{shown} is no part of a reference: it was not written by `chiaro reference --shard` of this version"
            );
        };
        if layout != PAIRS || head.is_part() {
            let problem = if head.is_part() { "it was cropped" } else { "its sums are of another layout" };
            bail!("{shown} cannot be merged: {problem}; trace it again with `chiaro reference --shard`");
        }
        let Some(shards) = head.about.get(SHARDS).and_then(|text| text.parse().ok()) else {
            bail!(
                "{shown} is a whole reference and no part of one; parts are written by `chiaro reference --shard`"
            );
        };
        let (width, height) = head.size();
        Ok(Self { path: path.clone(), size: [width, height], samples, shards, about: head.about })
    }

    fn aovs(&self) -> Vec<String> {
        let names = self.about.get(AOVS).map_or("", String::as_str);
        names.split_whitespace().map(str::to_owned).collect()
    }

    /// Adds a sum of the file with all its layers.
    fn add(&self, file: &Layers, name: &str, sums: &mut Option<ExactSums>) -> anyhow::Result<()> {
        let layers: Vec<_> = (0..).map_while(|index| file.texels(&low(name, index))).collect();
        let Some(first) = layers.first() else {
            bail!("{} is damaged: its layer {name} is missing; trace it again", self.path.display());
        };
        let sums = sums.get_or_insert_with(|| ExactSums::new(first.len()));
        for layer in &layers {
            sums.add(layer);
        }
        Ok(())
    }
}

/// Names in the file of all sums.
fn summed(aovs: &[String]) -> impl Iterator<Item = String> {
    let first_hits = FirstHit::ALL.map(FirstHit::layer).into_iter();
    ALWAYS.into_iter().chain(first_hits.filter(|name| aovs.iter().any(|aov| aov == name))).map(in_file)
}

fn aovs_of_all(parts: &[Part]) -> Vec<String> {
    let mut aovs = parts.first().map_or(Vec::new(), Part::aovs);
    aovs.retain(|name| parts.iter().all(|part| part.aovs().contains(name)));
    aovs
}

/// Makes sure that parts are of the same reference and none comes twice; the shards that they are together.
fn together(parts: &[Part]) -> anyhow::Result<Shards> {
    let Some((first, others)) = parts.split_first() else { bail!("there are no parts to merge") };
    let mut shards = first.shards.clone();
    let mut holders: BTreeMap<u32, &Path> = first.shards.numbers.iter().map(|n| (*n, &*first.path)).collect();
    for part in others {
        let (a, b) = (first.path.display(), part.path.display());
        let free = |key: &str| [SCENE, SAMPLES, SHARDS, MERGED, AOVS, TIMED_OUT].contains(&key);
        let mut differing = differences(&first.about, &part.about, (free, "here"));
        let ([w0, h0], [w, h]) = (first.size, part.size);
        if (w0, h0) != (w, h) {
            differing.insert(0, format!("size ({w0}x{h0}, here {w}x{h})"));
        }
        if part.shards.of != shards.of {
            differing.push(format!("number of shards ({}, here {})", shards.of, part.shards.of));
        }
        if !differing.is_empty() {
            bail!("{b} is of another reference than {a}; these differ: {}", differing.join(", "));
        }
        for &number in &part.shards.numbers {
            if let Some(other) = holders.insert(number, &part.path) {
                let of = shards.of;
                bail!("shard {number} of {of} is in both {} and {b}; merge it once", other.display());
            }
        }
        shards.add(&part.shards);
    }
    Ok(shards)
}
