//! The flags of every subcommand, and their help.

mod compare;
mod reference;
mod scene;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub use compare::{CompareArgs, JudgeArgs, SweepArgs};
pub use reference::{Integrator, MergeArgs, ReferenceArgs};
pub use scene::{LookArgs, SceneArgs, SettingsArgs, TimeArgs};

use crate::values::{blur_px, chart_output, frames_per_second, positive, render_output};

/// Real-time shadows, indirect light and caustics, measured against path-traced truth
#[derive(Debug, Parser)]
#[command(
    name = "chiaro",
    version,
    arg_required_else_help = true,
    disable_help_subcommand = true,
    after_help = "Example:\n  chiaro render builtin:nave -o nave.png\n\
                  `chiaro COMMAND --help` has examples. Exit status: 0 done, 1 the work failed, 2 wrong usage."
)]
pub struct Cli {
    /// What to do
    #[command(subcommand)]
    pub command: Command,
}

/// What `chiaro` can do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an image, or an animation to numbered images or a video
    #[command(after_help = "\
Examples:
  chiaro render builtin:nave --size 1280x720 --samples 16 -o nave.png
  chiaro render room.glb --camera 1 --set shadow.filter=pcss -o room.exr --aov direct --aov normal
  chiaro render room.glb --aov list
  chiaro render fountain.glb --frames 0..240 --fps 24 -o frames/fountain.png
  chiaro render builtin:flight --frames 0..576 --fps 24 -o flight.mp4
  chiaro render --height-map canyon.png --size-m 400,300 --height-m 60 -o canyon.png

Frames are written to numbered images: frames/fountain.0000.png, frames/fountain.0001.png, … They
become a video (.mp4: H.264, .webp: an animated WebP that repeats) where the program ffmpeg is on the
PATH, which gets them through a pipe. Ctrl-C ends a video with the frames that it has. AOVs of a video
are numbered EXR files beside it.

An EXR holds scene radiance in nits. Unlit materials (KHR_materials_unlit) have none: a PNG shows base
colour 1 as white whatever the light and the exposure, and an EXR holds it as 1 nit.")]
    Render(RenderArgs),
    /// Open a window on a scene: fly through it, turn every setting, see buffers and costs
    #[command(after_help = "\
Examples:
  chiaro view
  chiaro view room.glb --camera 1 --set shadow.filter=none

H shows the keys. Scene files can be dropped onto the window.")]
    View(ViewArgs),
    /// Trace a scene's light: the truth that real-time pictures are measured against
    #[command(after_help = reference::HELP)]
    Reference(ReferenceArgs),
    /// Add up the parts of a reference that many machines traced
    #[command(after_help = reference::MERGE_HELP)]
    Merge(MergeArgs),
    /// Measure how long each pass of a frame takes on this machine
    #[command(after_help = "\
Examples:
  chiaro bench builtin:nave --frames 200
  chiaro bench --suite shadows --frames 1000 -o shadows/ --json shadows.json
  chiaro bench --suite indirect --frames 300 -o indirect/ --json indirect.json
  chiaro bench room.glb --suite reference --size 1920x1080
  chiaro bench builtin:flight --camera-path -o flight.svg --json flight.json

The suite reference tells rays, paths and light paths a second. The suite shadows renders
builtin:terrain unless a scene is named, writes a picture of every combination and table.md to the
folder of -o, and measures with 2048x2048 maps rendered every frame.

The suite indirect measures virtual point lights with imperfect shadow maps in builtin:flight, whose
camera and spot move, unless a scene is named: frames a second with and without interleaving, shares
of a frame's steps, filters with picture, time and error, and how time grows with VPLs, points, map and
picture size. It writes table.md, scaling.svg and the filters' pictures to the folder of -o.

--camera-path follows a camera that moves through the whole animation once, 60 frames a second, and
tells the median, the 99th percentile and the maximum of each pass and of the whole frame; -o draws
every frame's time.")]
    Bench(BenchArgs),
    /// Hold techniques against the truth side by side: errors, noise, GPU time, memory
    #[command(after_help = "\
Examples:
  chiaro compare builtin:nave -o report/
  chiaro compare room.glb --technique default --technique soft:shadow.filter=pcss --part direct -o report/
  chiaro compare room.glb --technique mine.ron --technique paths:2 --seeds 8 --size 1920x1080 -o report/
  chiaro compare builtin:flight --frames 0..48 --fps 24 --size 640x360 -o flight/
  chiaro compare room.glb --reference bounce1.exr --minus direct.exr --part indirect -o report/

A technique T is a preset or a .ron file, over the defaults; label:key=value,key=value over --preset and
--set (preset=NAME among the keys); or paths:MS, the program's own path tracer given so many milliseconds of GPU time, at least one sample a
pixel, its irradiance filtered along edges (paths:MS:raw: not filtered). Light that paths bring to the
part alone is traced: caustics by paths from the lights.

Parts of the light: direct reaches its first surface unhindered, from lamps, glowing meshes, environment
or sky, or is seen itself; caustics came through mirrors and smooth glass alone, then met one surface
that scatters; indirect was scattered before. Together they are the picture.

The truth is traced by the program itself to --target-error, a picture's mean absolute error over its
mean, and kept in the folder $CHIARO_CACHE, else in the user's folder for caches (on Linux
~/.cache/chiaro), by all that it depends on; delete what you like of it. How good it is was measured on
two halves that know nothing of each other.

The folder gets results.json, results.csv, and for the truth and each technique a picture in nits (.exr),
the same as seen at one exposure (.png), and where it is too dark (blue) and too bright (red)
(.error.png). Figures are means over seeds, pictures those of the first. bias = sqrt(MSE - variance) and
noise = sqrt(variance) are shares of the truth's mean, from two seeds on; the truth's own noise counts
in neither. Two runs give the same figures; only times differ.")]
    Compare(CompareArgs),
    /// Measure every combination of settings, a row each, in a file that may be gone on with
    #[command(after_help = "\
Examples:
  chiaro sweep builtin:nave --vary shadow.filter=pcf,pcss --vary shadow.resolution=1024,2048 -o rows.jsonl
  chiaro sweep builtin:nave room.glb --vary preset=default,fast --vary size=640x360,1280x720 -o rows.jsonl
  parallel chiaro sweep room.glb --vary shadow.cascades=1,2,3,4 --shard {}/2 -o rows.{}.jsonl ::: 1 2

Keys are those of `chiaro settings`, and preset, size and samples. A row of JSON has the columns of
`chiaro compare`'s results.csv, the varied values and an id; it is written whole. Rows that stand in the
file are skipped, so that a sweep may be killed and started again. Settings that do not go together make
a row that says so (`refused`). What says what is there (surface.lighting, surface.normal_maps,
environment.*) is varied in the truth, too. Sweeps side by side on one device disturb each other's times.")]
    Sweep(SweepArgs),
    /// Measure how far image A is from the reference image B
    #[command(after_help = "\
Examples:
  chiaro diff render.exr reference.exr -o heat.png
  chiaro diff full.exr ref.exr --minus-a direct.exr --minus-b ref.direct.exr --blur 2
  chiaro diff caustic.exr reference.exr --mask glass.mask.exr --json
  chiaro diff --sequence frames/ truth/ --from 4 -o plot.svg

mean ratio  sum A / sum B; 1 is the same energy
nmae        mean |A-B| / mean B
relmse      mean of (A-B)^2 / (B^2 + (0.05 mean B)^2), without the worst 0.1 % of the pixels
psnr        peak signal-to-noise ratio in dB, both exposed so that B's 99th percentile is 0.9,
            clamped and sRGB-encoded, not rounded to bytes; inf (JSON: null) is the same
ssim        mean structural similarity of the luma of these pictures; 1 is the same
flip        mean LDR-FLIP at that exposure; 0 looks the same
hdr flip    mean HDR-FLIP: in each pixel the largest FLIP of the exposures that B needs, in ACES tones

Of EXR crops (a data window smaller than the display window) the pixels count that all files hold.

The picture of -o has its own scale: of |A-B| from 1 % (black) to 1000 % (white) of B's mean, of FLIP
from 0 to 1; masked pixels are grey, pixels where A is not finite green.

--sequence takes folders of numbered EXR (a.0007.exr; AOVs beside them are left alone), matches them by
their numbers, and tells mean ratio, nmae, relmse and flip of every frame and over all, and

flicker     mean |dA-dB| / mean B, where d is a value's change from one frame to the next; 0 changes
            as the reference does, however far off it is")]
    Diff(DiffArgs),
    /// List the built-in scenes
    #[command(after_help = "Example:\n  chiaro scenes")]
    Scenes(ListArgs),
    /// List every setting with its unit, range, value, meaning, and when it matters
    #[command(after_help = "\
Examples:
  chiaro settings
  chiaro settings --preset thesis-shadows --set shadow.representation=evsm4
  chiaro settings --json

Values are the defaults, or what --preset, --set and --pipeline make of them. What does nothing beside
them is marked.")]
    Settings(ListSettingsArgs),
    /// Show the graphics adapter and which of its features chiaro uses
    #[command(after_help = "Example:\n  chiaro info")]
    Info(ListArgs),
}

/// `chiaro render`
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// The scene
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The settings
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// The image to write: .png as seen on a screen, .exr as scene radiance in nits; of --frames also .mp4 or .webp, a video
    #[arg(short, long, value_name = "FILE", default_value = "out.png", value_parser = render_output)]
    pub output: PathBuf,
    /// Frames to average, each with its own sub-pixel offset: edges become smooth, nothing else changes [default: 16; with
    /// --frames 1, smoothed over time as post.antialias says, where it says taa]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub samples: Option<u32>,
    /// The moments
    #[command(flatten)]
    pub time: TimeArgs,
    /// Also write a part of the light (direct, indirect, caustics; of frames smoothed over time the newest one's) or another
    /// quantity of the frame (normal, depth, …) to STEM.NAME.exr, or any texture or buffer of it
    /// (shadow/shadow_maps, …) to STEM.shadow.shadow_maps.exr, a file for each layer, in its own size and as the last sample
    /// left it; may be given many times. `list` prints all names that these settings have
    #[arg(long = "aov", value_name = "NAME")]
    pub aovs: Vec<String>,
    /// Write how long each pass took on the GPU
    #[arg(long, value_name = "FILE")]
    pub timings: Option<PathBuf>,
}

/// `chiaro view`
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// The scene; `--size` is that of the window
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The settings
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Shaders (.wesl) that take the place of the built-in ones and are read again whenever they change [default: crates/techniques/src, where there is one]
    #[arg(long, value_name = "FOLDER")]
    pub shaders: Option<PathBuf>,
}

/// `chiaro bench`
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// The scene
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The settings
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Frames to measure, after the warm-up
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = positive, conflicts_with = "camera_path")]
    pub frames: u32,
    /// Write the measurements, with the adapter and driver, to this file
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Measure a group of techniques side by side instead of one frame
    #[arg(long)]
    pub suite: Option<Suite>,
    /// Measure every frame of the animation as its camera sees it, from its beginning to its end; the camera has to move
    #[arg(long, conflicts_with_all = ["suite", "view"])]
    pub camera_path: bool,
    /// Frames per second along the camera's path
    #[arg(long, value_name = "F", default_value_t = 60.0, allow_negative_numbers = true, value_parser = frames_per_second, requires = "camera_path", conflicts_with_all = ["suite", "view"])]
    pub fps: f64,
    /// The folder for a suite's pictures and table [default: bench], or a plot (.svg) of the times along the camera's path
    #[arg(short, long, value_name = "FOLDER|FILE")]
    pub output: Option<PathBuf>,
}

/// A group of techniques that `chiaro bench` holds side by side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Suite {
    /// Shadow map layouts, representations and filters
    Shadows,
    /// Imperfect shadow maps: tables and figure of a thesis, curves over VPLs, points, map and picture sizes
    Indirect,
    /// The tracers of the reference
    Reference,
}

/// `chiaro diff`
#[derive(Debug, Args)]
pub struct DiffArgs {
    /// The image to judge (EXR, Radiance HDR or PNG), or the folder of a sequence
    #[arg(value_name = "A")]
    pub a: PathBuf,
    /// The reference to hold it against
    #[arg(value_name = "B")]
    pub b: PathBuf,
    /// Compare two folders of numbered EXR images frame by frame, and how they change from one frame to the next
    #[arg(long, conflicts_with_all = ["minus_a", "minus_b", "heat"])]
    pub sequence: bool,
    /// Leave the frames before the one of this number out of what is told over all frames
    #[arg(long, value_name = "N", requires = "sequence", conflicts_with_all = ["minus_a", "minus_b", "heat"])]
    pub from: Option<u64>,
    /// Leave out the pixels where this image is above 0; of a sequence, this image or the one of the frame's number in
    /// this folder
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    /// Subtract this image from A first, to compare one part of the light
    #[arg(long, value_name = "FILE")]
    pub minus_a: Option<PathBuf>,
    /// Subtract this image from B first
    #[arg(long, value_name = "FILE")]
    pub minus_b: Option<PathBuf>,
    /// Blur both images by a Gaussian of this standard deviation in pixels first; 0 is none
    #[arg(long, value_name = "PX", default_value_t = 0.0, allow_negative_numbers = true, value_parser = blur_px)]
    pub blur: f64,
    /// Print one line of JSON instead of a table
    #[arg(long)]
    pub json: bool,
    /// Write a picture of the difference in false colours (.png), or of a sequence a plot over its frames (.svg)
    #[arg(short, long, value_name = "FILE", value_parser = chart_output)]
    pub output: Option<PathBuf>,
    /// What that picture shows
    #[arg(long, default_value = "error", requires = "output")]
    pub heat: Heat,
}

/// What the picture of `chiaro diff` shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Heat {
    /// |A-B| relative to the mean of B
    Error,
    /// LDR-FLIP
    Flip,
    /// HDR-FLIP
    HdrFlip,
    /// A-B relative to the mean of B: blue where A is too dark, red where it is too bright
    Signed,
}

impl From<Heat> for chiaro_image::Heat {
    fn from(heat: Heat) -> Self {
        match heat {
            Heat::Error => Self::Error,
            Heat::Flip => Self::Flip,
            Heat::HdrFlip => Self::HdrFlip,
            Heat::Signed => Self::Signed,
        }
    }
}

/// `chiaro settings`
#[derive(Debug, Args)]
pub struct ListSettingsArgs {
    /// The settings
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

/// `chiaro scenes` and `chiaro info`
#[derive(Debug, Args)]
pub struct ListArgs {
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}
