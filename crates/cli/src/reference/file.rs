//! What a reference's EXR holds: the picture, how sure it is, the sums to go on from, and what all this is of.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use chiaro::{FirstHit, Gpu, Pixels, Reference, Settings, View};
use chiaro_image::{Layers, Precision, read_layers, write_exr, write_layers};

use crate::args::ReferenceArgs;
use crate::render::mean;
use crate::session::Session;

/// The settings that say what is there.
const SETTINGS: [&str; 3] = ["surface.lighting", "surface.normal_maps", "environment."];
/// Samples a pixel so far.
const SAMPLES: &str = "samples";
/// Written for people; what counts is the fingerprint.
const SCENE: &str = "scene";
/// Longer values are not spelled out in messages.
const SHORT: usize = 40;

/// What is traced: the sums of two files can go on in each other only if all of this is equal, but for the samples and
/// the scene's name.
pub fn about(args: &ReferenceArgs, session: &Session) -> BTreeMap<String, String> {
    let entries = [
        ("chiaro", env!("CARGO_PKG_VERSION").to_owned()),
        ("integrator", "path".to_owned()),
        (SCENE, session.scene_name.clone()),
        ("scene fingerprint", format!("{:016x}", session.source.fingerprint())),
        ("camera", camera(&session.view)),
        ("settings", settings(session.renderer.settings())),
        ("seed", args.seed.to_string()),
        ("max depth", args.max_depth.to_string()),
        ("aovs", sorted(&args.aovs).join(" ")),
    ];
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn camera(view: &View) -> String {
    let View { world_from_camera, projection, near_m, far_m } = view;
    format!("{projection:?}, near {near_m} m, far {far_m} m, world_from_camera {world_from_camera}")
}

fn settings(settings: &Settings) -> String {
    let fields = Settings::fields();
    let keys = fields.iter().map(|f| &f.key).filter(|key| SETTINGS.iter().any(|s| key.starts_with(s)));
    let values = keys.map(|key| format!("{key}={}", settings.get(key).unwrap_or_default()));
    values.collect::<Vec<_>>().join(" ")
}

fn sorted(names: &[String]) -> Vec<&str> {
    let mut names: Vec<_> = names.iter().map(String::as_str).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// Quantities of the surface seen first by the names of `--aov`. A name is that of the layer `sum.NAME`.
pub fn first_hits(names: &[String]) -> anyhow::Result<Vec<FirstHit>> {
    let name = |what: FirstHit| what.layer().trim_start_matches("sum.");
    let known = |wanted: &str| FirstHit::ALL.into_iter().find(|&what| name(what) == wanted);
    sorted(names)
        .into_iter()
        .map(|wanted| {
            known(wanted).with_context(|| {
                let names = FirstHit::ALL.map(name).join(", ");
                format!("--aov {wanted}: there is none of that name; there are {names}")
            })
        })
        .collect()
}

/// Goes on from a file, after making sure that it is of the same reference.
pub fn resume(
    path: &Path,
    about: &BTreeMap<String, String>,
    size: [u32; 2],
    reference: &mut Reference,
) -> anyhow::Result<()> {
    let file = read_layers(path)
        .context("--resume cannot go on from the output file; without it the render starts anew")?;
    let Some(samples) = file.about.get(SAMPLES).and_then(|text| text.parse().ok()) else {
        bail!("--resume: {} was not written by `chiaro reference`; name another output", path.display());
    };
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
        reference.layers().filter_map(|(name, _)| Some((name, file.texels(name)?))).collect();
    reference.restore(samples, &layers).with_context(|| format!("--resume {}", path.display()))
}

/// All sums of a reference.
pub struct Sums {
    samples: u32,
    layers: Vec<(&'static str, Pixels)>,
}

impl Sums {
    /// Waits for everything that was recorded.
    pub fn read(gpu: &Gpu, reference: &Reference) -> anyhow::Result<Self> {
        // All copies are on their way before the first is waited for.
        let layers = reference.read_layers()?;
        let layers = layers.into_iter().map(|(name, layer)| Ok((name, layer.wait(gpu)?)));
        Ok(Self { samples: reference.samples(), layers: layers.collect::<anyhow::Result<_>>()? })
    }

    fn layer(&self, name: &str) -> anyhow::Result<&Pixels> {
        let layer = self.layers.iter().find(|(found, _)| *found == name);
        Ok(&layer.with_context(|| format!("the reference has no layer {name}"))?.1)
    }

    /// [`noise`] of the picture.
    pub fn noise(&self) -> anyhow::Result<f64> {
        Ok(noise(self.layer("sum")?, self.layer("squares")?, self.samples))
    }

    /// Writes the file, whole or not at all.
    pub fn write(&self, path: &Path, about: &BTreeMap<String, String>) -> anyhow::Result<()> {
        let (sum, squares) = (self.layer("sum")?, self.layer("squares")?);
        let mut file = Layers::new(sum.width, sum.height);
        file.insert_image("", &mean(sum, self.samples)?)?;
        let variance = variance(&sum.floats(), &squares.floats(), self.samples);
        for (channel, values) in ["R", "G", "B"].into_iter().zip(variance) {
            file.insert(format!("variance.{channel}"), values)?;
        }
        let pixels = sum.width as usize * sum.height as usize;
        file.insert(SAMPLES, vec![self.samples as f32; pixels])?;
        for (name, texels) in &self.layers {
            file.insert_texels(name, &texels.floats())?;
        }
        file.about.clone_from(about);
        file.about.insert(SAMPLES.to_owned(), self.samples.to_string());
        Ok(write_layers(path, &file)?)
    }

    /// Writes an AOV beside the picture.
    pub fn write_aov(&self, path: &Path, name: &str) -> anyhow::Result<()> {
        let image = mean(self.layer(&format!("sum.{name}"))?, self.samples)?;
        Ok(write_exr(path.with_extension(format!("{name}.exr")), &image, Precision::Float)?)
    }
}

/// The estimated variance of each pixel's mean, (E[x²] − E[x]²) / n by colour, as if samples were independent.
fn variance(sum: &[f32], squares: &[f32], samples: u32) -> [Vec<f32>; 3] {
    let n = f64::from(samples.max(1));
    [0, 1, 2].map(|channel| {
        let values = |texels: &[f32]| texels.iter().skip(channel).step_by(4).copied().collect::<Vec<_>>();
        let of = |(sum, square): (f32, f32)| {
            let mean = f64::from(sum) / n;
            ((f64::from(square) / n - mean * mean).max(0.0) / n) as f32
        };
        values(sum).into_iter().zip(values(squares)).map(of).collect()
    })
}

/// A pixel's mean standard error, relative to the image's mean, as if samples were independent: stratified ones are better
/// than that.
pub fn noise(sum: &Pixels, squares: &Pixels, samples: u32) -> f64 {
    let n = f64::from(samples);
    let (mut errors, mut means) = (0.0, 0.0);
    for (sum, squares) in sum.floats().chunks_exact(4).zip(squares.floats().chunks_exact(4)) {
        for (sum, square) in sum[..3].iter().zip(&squares[..3]) {
            let mean = f64::from(*sum) / n;
            let variance = (f64::from(*square) / n - mean * mean).max(0.0);
            errors += (variance / n).sqrt();
            means += mean;
        }
    }
    if means > 0.0 { errors / means } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variance_of_a_mean_is_what_algebra_gives() {
        // Samples 1, 2, 3, 6 have mean 3 and variance 3.5, their mean a quarter of that.
        let [r, g, b] = variance(&[12.0, 4.0, 0.0, 4.0], &[50.0, 4.0, 0.0, 4.0], 4);
        assert_eq!((r[0], g[0], b[0]), (0.875, 0.0, 0.0));
    }

    #[test]
    fn an_unknown_aov_is_told_the_known_ones() {
        assert_eq!(
            first_hits(&["depth".into(), "albedo".into()]).unwrap(),
            [FirstHit::Albedo, FirstHit::Depth]
        );
        let error = first_hits(&["colour".into()]).unwrap_err().to_string();
        assert!(error.contains("colour") && error.contains("albedo, normal, depth"), "{error}");
    }
}
