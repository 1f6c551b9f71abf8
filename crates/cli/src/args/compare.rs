//! The flags of `chiaro compare` and `chiaro sweep`.

use std::path::PathBuf;
use std::str::FromStr as _;

use chiaro::Shard;
use chiaro_lab::Part;
use clap::Args;

use super::scene::{LookArgs, SceneArgs, SettingsArgs, TimeArgs};
use crate::values::{Vary, positive, shard, share};

/// What techniques are held against, and how often.
#[derive(Debug, Args)]
pub struct JudgeArgs {
    /// The part of the light
    #[arg(long, value_name = "PART", default_value = "picture", value_parser = Part::from_str)]
    pub part: Part,
    /// Frames to average for each picture [default: 16; with --frames 1, smoothed over time as post.antialias says, where it
    /// says taa]
    #[arg(long, value_name = "N", value_parser = positive)]
    pub samples: Option<u32>,
    /// Seeds of each technique, which tell bias from noise; those that draw no lots are rendered twice at most
    #[arg(long, value_name = "K", default_value_t = 4, value_parser = positive)]
    pub seeds: u32,
    /// Leave out the pixels where this image is above 0
    #[arg(long, value_name = "FILE")]
    pub mask: Option<PathBuf>,
    /// Frames that are timed, after a warm-up; 0 times none [default: 100; 5 where there is no GPU]
    #[arg(long, value_name = "N")]
    pub timed_frames: Option<u32>,
    /// The truth's own mean absolute error at most, over its mean
    #[arg(long, value_name = "E", default_value = "2%", allow_negative_numbers = true, value_parser = share)]
    pub target_error: f64,
    /// Samples of the truth at most, whatever its error is then
    #[arg(long, value_name = "N", default_value_t = 1 << 20, value_parser = positive)]
    pub most_samples: u32,
    /// In the truth, most times that light goes from one scattering surface to another, mirrors and smooth glass not counted
    /// [default: no limit]
    #[arg(long, value_name = "N")]
    pub diffuse_bounces: Option<u32>,
    /// Neither look for the truth in the cache nor keep it there
    #[arg(long)]
    pub no_cache: bool,
    /// The moments
    #[command(flatten)]
    pub time: TimeArgs,
}

/// `chiaro compare`
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// The scene
    #[command(flatten)]
    pub scene: SceneArgs,
    /// What all techniques begin with
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// A technique; may be given many times [default: the presets default and fast]
    #[arg(long = "technique", value_name = "T")]
    pub techniques: Vec<String>,
    /// How they are judged
    #[command(flatten)]
    pub judge: JudgeArgs,
    /// The truth: full traces it, or an image of the size that is rendered
    #[arg(long, value_name = "full|FILE", default_value = "full")]
    pub reference: String,
    /// Subtract this image from that of --reference first
    #[arg(long, value_name = "FILE")]
    pub minus: Option<PathBuf>,
    /// The folder for the report
    #[arg(short, long, value_name = "FOLDER")]
    pub output: PathBuf,
}

/// `chiaro sweep`
#[derive(Debug, Args)]
pub struct SweepArgs {
    /// Scenes: files, or builtin:NAME
    #[arg(value_name = "SCENE", required = true)]
    pub scenes: Vec<String>,
    /// A key and the values that it is to have, parted by semicolons where they have commas; may be given many times, the last
    /// one varies fastest
    #[arg(long, value_name = "KEY=V1,V2,…", required = true)]
    pub vary: Vec<Vary>,
    /// This run's rows: every N-th from the I-th on, I from 1 to N
    #[arg(long, value_name = "I/N", allow_hyphen_values = true, value_parser = shard)]
    pub shard: Option<Shard>,
    /// What all rows begin with
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// How they are judged
    #[command(flatten)]
    pub judge: JudgeArgs,
    /// The camera of all scenes
    #[command(flatten)]
    pub look: LookArgs,
    /// The file of rows, each a line of JSON
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
}
