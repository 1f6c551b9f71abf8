//! What a reference's EXR holds: the picture, how sure it is, the sums to go on from, and what all this is of.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use chiaro::{FirstHit, Gpu, Pixels, Reference};
use chiaro_image::{Image, Layers, Precision, read_layers, write_exr, write_layers};
use chiaro_lab::pictures::mean;
use chiaro_lab::session::{camera_text, truth_settings};
use chiaro_lab::{Session, Tracing};
use clap::ValueEnum;

use crate::args::{Integrator, ReferenceArgs};
use crate::output::WrongUsage;

/// Samples a pixel so far.
const SAMPLES: &str = "samples";
/// Seconds of `--time-limit` that ended the render; only where they did.
const TIMED_OUT: &str = "stopped after seconds";
/// Written for people; what counts is the fingerprint.
const SCENE: &str = "scene";
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
        ("integrator", integrator.map_or(String::new(), |value| value.get_name().to_owned())),
        // Light paths of another number of samples together have other radii.
        ("samples in a round", reference.round().to_string()),
        ("time", format!("{time_s} s")),
        (SCENE, session.scene_name.clone()),
        ("scene fingerprint", format!("{:016x}", session.source.fingerprint())),
        ("camera", camera_text(&session.view)),
        ("origin", format!("{} m", session.source.origin)),
        ("settings", truth_settings(session.renderer.settings())),
        ("seed", args.seed.to_string()),
        ("max depth", args.max_depth.to_string()),
        ("diffuse bounces", args.diffuse_bounces.map_or("no limit".to_owned(), |most| most.to_string())),
        ("aovs", sorted(&args.aovs).join(" ")),
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
        if name == "caustics" && args.integrator == Integrator::Path {
            let reason = "paths from the camera do not tell them apart; add --integrator full";
            bail!(WrongUsage(format!("--aov caustics: {reason}")));
        }
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
fn in_file(layer: &str) -> String {
    if ["sum", "squares"].contains(&layer) { layer.to_owned() } else { format!("sum.{layer}") }
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
    let mut differences = Vec::new();
    let (width, height) = file.size();
    if [width, height] != size {
        differences.push(format!("size ({width}x{height}, now {}x{})", size[0], size[1]));
    }
    for (key, now) in about.iter().filter(|(key, _)| *key != SCENE) {
        let then = file.about.get(key).map_or("", String::as_str);
        if then != now && then.len().max(now.len()) > SHORT {
            differences.push(key.clone());
        } else if then != now {
            differences.push(format!("{key} ({then}, now {now})"));
        }
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
        reference.layers().filter_map(|(name, _)| Some((name, file.texels(&in_file(name))?))).collect();
    reference.restore(samples, &layers).with_context(|| format!("--resume {}", path.display()))?;
    Ok(file.about.get(TIMED_OUT).and_then(|text| text.parse().ok()))
}

/// Whether the AOVs beside a picture were written.
pub fn has_aovs(path: &Path, names: &[String]) -> bool {
    names.iter().all(|name| beside(path, name).exists())
}

fn beside(path: &Path, name: &str) -> PathBuf {
    path.with_extension(format!("{name}.exr"))
}

/// All sums of a reference.
pub struct Sums {
    samples: u32,
    // Samples that share light paths, and are squared together.
    round: u32,
    layers: Vec<(&'static str, Pixels)>,
}

impl Sums {
    /// Waits for everything that was recorded.
    pub fn read(gpu: &Gpu, reference: &Reference) -> anyhow::Result<Self> {
        // All copies are on their way before the first is waited for.
        let layers = reference.read_layers()?;
        let layers = layers.into_iter().map(|(name, layer)| Ok((name, layer.wait(gpu)?)));
        let layers = layers.collect::<anyhow::Result<_>>()?;
        Ok(Self { samples: reference.samples(), round: reference.round(), layers })
    }

    fn layer(&self, name: &str) -> anyhow::Result<&Pixels> {
        let layer = self.layers.iter().find(|(found, _)| *found == name);
        Ok(&layer.with_context(|| format!("the reference has no layer {name}"))?.1)
    }

    /// A pixel's mean standard error, relative to the image's mean, as if samples were independent: stratified ones are
    /// better than that.
    pub fn noise(&self) -> anyhow::Result<f64> {
        let (sum, squares) = (self.layer("sum")?.floats(), self.layer("squares")?.floats());
        let means = (0..sum.len()).filter(|index| index % 4 < 3).map(|index| f64::from(sum[index]));
        let mean = means.sum::<f64>() / f64::from(self.samples.max(1));
        let variance = variance(&sum, &squares, (self.samples, self.round));
        let errors = variance.iter().flatten().map(|variance| f64::from(*variance).sqrt()).sum::<f64>();
        Ok(if mean > 0.0 { errors / mean } else { 0.0 })
    }

    /// Writes the file, whole or not at all.
    pub fn write(&self, path: &Path, about: &BTreeMap<String, String>) -> anyhow::Result<()> {
        let (sum, squares) = (self.layer("sum")?, self.layer("squares")?);
        let mut file = Layers::new(sum.width, sum.height);
        file.insert_image("", &mean(sum, self.samples)?)?;
        let variance = variance(&sum.floats(), &squares.floats(), (self.samples, self.round));
        for (channel, values) in ["R", "G", "B"].into_iter().zip(variance) {
            file.insert(format!("variance.{channel}"), values)?;
        }
        let pixels = sum.width as usize * sum.height as usize;
        file.insert(SAMPLES, vec![self.samples as f32; pixels])?;
        for (name, texels) in &self.layers {
            file.insert_texels(&in_file(name), &texels.floats())?;
        }
        file.about.clone_from(about);
        file.about.insert(SAMPLES.to_owned(), self.samples.to_string());
        Ok(write_layers(path, &file)?)
    }

    /// Writes an AOV beside the picture.
    pub fn write_aov(&self, path: &Path, name: &str) -> anyhow::Result<()> {
        let image = match name {
            "indirect" => {
                let parts = [self.mean_of("direct")?, self.caustics()?];
                let mut rest = self.mean_of("sum")?;
                for part in &parts {
                    let values = rest.pixels_mut().iter_mut().flatten().zip(part.pixels().iter().flatten());
                    values.for_each(|(rest, part)| *rest -= part);
                }
                rest
            }
            "caustics" => self.caustics()?,
            _ => self.mean_of(name)?,
        };
        Ok(write_exr(beside(path, name), &image, Precision::Float)?)
    }

    fn mean_of(&self, name: &str) -> anyhow::Result<Image> {
        Ok(mean(self.layer(name)?, self.samples)?)
    }

    /// What light paths brought: nothing where there are none.
    fn caustics(&self) -> anyhow::Result<Image> {
        let sum = self.layer("sum")?;
        let black = Image::filled(sum.width, sum.height, [0.0; 3]);
        self.layer("caustics").map_or(Ok(black), |caustics| Ok(mean(caustics, self.samples)?))
    }
}

/// The estimated variance of each pixel's mean by colour, as if samples were independent: (mean x² − (mean x)²) / rounds,
/// x being the mean of a round of samples that share light paths, or one sample.
fn variance(sum: &[f32], squares: &[f32], (samples, round): (u32, u32)) -> [Vec<f32>; 3] {
    let n = f64::from(samples.max(1));
    let rounds = n / f64::from(round);
    [0, 1, 2].map(|channel| {
        let values = |texels: &[f32]| texels.iter().skip(channel).step_by(4).copied().collect::<Vec<_>>();
        let of = |(sum, square): (f32, f32)| {
            let mean = f64::from(sum) / n;
            ((f64::from(square) / n - mean * mean).max(0.0) / rounds) as f32
        };
        values(sum).into_iter().zip(values(squares)).map(of).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_of_a_mean_is_what_algebra_gives() {
        // Samples 1, 2, 3, 6 have mean 3 and variance 3.5, their mean a quarter of that.
        let [r, g, b] = variance(&[12.0, 4.0, 0.0, 4.0], &[50.0, 4.0, 0.0, 4.0], (4, 1));
        assert_eq!((r[0], g[0], b[0]), (0.875, 0.0, 0.0));
        // In rounds of two with the means 1.5 and 4.5: (3² + 9²) / 2 is summed up, and the variance is 2.25.
        assert_eq!(variance(&[12.0, 0.0, 0.0, 4.0], &[45.0, 0.0, 0.0, 4.0], (4, 2))[0][0], 1.125);
    }
}
