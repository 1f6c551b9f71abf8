//! The flags of `chiaro reference` and `chiaro merge`.

use std::path::PathBuf;

use chiaro::Shard;
use clap::{Args, ValueEnum};

use super::scene::{SceneArgs, TimeArgs};
use crate::values::{Setting, positive, radiance_output, shard, share, some_seconds};

/// What `chiaro reference --help` ends with.
pub const HELP: &str = "\
Examples:
  chiaro reference builtin:cornell --spp 256 -o cornell.exr
  chiaro reference room.glb --camera 1 --max-depth 3 --spp 64 -o room.bounce1.exr
  chiaro reference room.glb --target-error 0.5% --time-limit 3600 --resume -o room.exr
  chiaro reference builtin:pool --integrator full --spp 256 -o pool.exr
  chiaro reference builtin:dancer --frames 0..192 --fps 24 --spp 256 -o truth/dancer.exr
  chiaro reference builtin:pool --integrator full --spp 4096 --shard 2/8 -o pool.2.exr

The goal that comes first ends the render. Ctrl-C stops it, too, and nothing is lost: the file holds
all samples so far (and is written about every minute), and --resume goes on from it. Beside the
picture (R, G, B in nits) the EXR has the layers variance (of each pixel's mean, nits^2), samples,
and the sums to go on from.

Paths from the camera alone find no light of lamps without extent that mirrors or smooth glass send
on to a surface (caustics): --integrator full adds them by paths from the lights, four samples at a
time on a GPU, so that N is rounded up. What moves stands still while it is traced.

--frames traces moments of an animation to numbered images, truth/dancer.0000.exr and so on, each the
same as one of its --time: --spp, --time-limit and --target-error are each image's. --resume keeps
those that are done and goes on with the one that was begun.

--shard I/N is for many machines: it traces every N-th round of samples, from the I-th on, of the --spp
that the whole picture is to have. `chiaro merge` adds the parts up to what one machine would have traced.";

/// What `chiaro merge --help` ends with.
pub const MERGE_HELP: &str = "\
Examples:
  chiaro merge pool.1.exr pool.2.exr pool.3.exr -o pool.exr
  chiaro merge parts/pool.*.exr -o pool.exr

Sums are added without any rounding: the result is the same, bit for bit, in whatever order and grouping
parts are merged, those merged before among them. Parts must be of one scene, camera, size, seed,
integrator, depth, setting and version, cut into as many shards, and no shard may come twice. Where
shards are missing the result says so, and they can be merged into it later. The AOVs that all parts
have are written beside it, as `chiaro reference` does.";

/// `chiaro reference`
#[derive(Debug, Args)]
pub struct ReferenceArgs {
    /// The scene
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The image to write: scene radiance in nits
    #[arg(short, long, value_name = "FILE", value_parser = radiance_output)]
    pub output: PathBuf,
    /// Samples per pixel, those resumed from included: four times as many halve the noise [default: 64; without limit where --time-limit or --target-error is given]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub spp: Option<u32>,
    /// Stop after so many seconds of tracing, each image of --frames by itself
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = some_seconds)]
    pub time_limit: Option<f64>,
    /// Stop once a pixel's estimated standard error, averaged over the image, is this share of the image's mean: 0.01 or 1%
    #[arg(long, value_name = "E", allow_negative_numbers = true, value_parser = share)]
    pub target_error: Option<f64>,
    /// Go on from the output file where there is one, or from the numbered images of --frames; the image is, bit for bit,
    /// that of a render without a break
    #[arg(long)]
    pub resume: bool,
    /// Which paths of light are traced
    #[arg(long, value_enum, default_value_t = Integrator::Path)]
    pub integrator: Integrator,
    /// Most edges of a path: 1 shows what glows, 2 direct light, 3 one bounce; 0 is no limit
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub max_depth: u32,
    /// Most times that light goes from one scattering surface to another, mirrors and smooth glass not counted: 0 leaves
    /// direct light and caustics [default: no limit]
    #[arg(long, value_name = "N")]
    pub diffuse_bounces: Option<u32>,
    /// The moments
    #[command(flatten)]
    pub time: TimeArgs,
    /// What all random choices start from; the same seed gives the same image
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// Trace only the I-th of N parts of the samples, I from 1 to N, which `chiaro merge` adds up; --spp is that of the whole
    #[arg(long, value_name = "I/N", allow_hyphen_values = true, value_parser = shard)]
    pub shard: Option<Shard>,
    /// Also write a part of the light (direct, indirect, caustics) or what the camera sees first (albedo, normal, depth) to STEM.NAME.exr; may be given many times
    #[arg(long = "aov", value_name = "NAME")]
    pub aovs: Vec<String>,
    /// Change a setting that says what is there (surface.lighting, surface.normal_maps, environment.*)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<Setting>,
}

/// Which paths of light `chiaro reference` traces.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Integrator {
    /// From the camera: all light but that of lamps without extent over mirrors or through smooth glass
    Path,
    /// From the lights to surfaces that scatter, seen directly; mirrors and smooth glass are black
    Photon,
    /// Both, nothing twice: everything
    Full,
}

/// `chiaro merge`
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// What `chiaro reference --shard` wrote, or `chiaro merge`
    #[arg(value_name = "PART", required = true)]
    pub parts: Vec<PathBuf>,
    /// The image to write: scene radiance in nits
    #[arg(short, long, value_name = "FILE", value_parser = radiance_output)]
    pub output: PathBuf,
}
