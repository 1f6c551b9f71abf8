//! What is told of a technique, the same columns wherever it is told.

use serde::Serialize;

use crate::judge::{JudgeOptions, Judged};
use crate::truth::Floor;
use crate::{Machine, Session};

/// The columns of `results.csv` and of a sweep's rows. Errors are shares of the truth's mean, times are milliseconds of GPU
/// time but for `wall_ms`: those alone differ from run to run of the same command.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "as in Figures, Cost and Floor")]
pub struct Columns {
    pub technique: String,
    pub scene: String,
    pub fingerprint: String,
    pub camera: String,
    pub width: u32,
    pub height: u32,
    pub part: &'static str,
    pub frames: usize,
    pub samples: u32,
    pub seeds: u32,
    pub mean_ratio: f64,
    pub nmae: f64,
    pub relmse: f64,
    pub flip: f64,
    pub hdr_flip: Option<f64>,
    pub rmse: f64,
    pub bias: Option<f64>,
    pub noise: Option<f64>,
    pub flicker: Option<f64>,
    pub not_finite: usize,
    pub floor_nmae: Option<f64>,
    pub floor_rmse: Option<f64>,
    pub span_ms: Option<f64>,
    pub span_iqr_ms: Option<f64>,
    pub sum_ms: Option<f64>,
    pub sum_iqr_ms: Option<f64>,
    pub wall_ms: Option<f64>,
    pub paths_ms: Option<f64>,
    pub room_bytes: u64,
    pub scene_bytes: u64,
    pub adapter: String,
    pub chiaro: &'static str,
}

impl Columns {
    /// Of a technique by this name.
    pub fn new(
        technique: &str,
        session: &Session,
        options: &JudgeOptions,
        judged: &Judged,
        floor: Option<Floor>,
    ) -> Self {
        let Judged { figures, cost, samples } = judged;
        let camera = session
            .camera()
            .map(|(index, name)| if name.is_empty() { index.to_string() } else { name.to_owned() });
        let span = cost.gpu.as_ref().map(|gpu| &gpu.frame_span);
        let sum = cost.gpu.as_ref().map(|gpu| &gpu.pass_sum);
        Self {
            technique: technique.to_owned(),
            scene: session.scene_name.clone(),
            fingerprint: format!("{:016x}", session.source.fingerprint()),
            camera: camera.unwrap_or_else(|| "own".to_owned()),
            width: session.size[0],
            height: session.size[1],
            part: options.part.name(),
            frames: options.moments.len(),
            samples: *samples,
            seeds: options.seeds,
            mean_ratio: figures.mean_ratio,
            nmae: figures.nmae,
            relmse: figures.relmse,
            flip: figures.flip,
            hdr_flip: figures.hdr_flip,
            rmse: figures.rmse,
            bias: figures.bias,
            noise: figures.noise,
            flicker: figures.flicker,
            not_finite: figures.not_finite,
            floor_nmae: floor.map(|floor| floor.nmae),
            floor_rmse: floor.map(|floor| floor.rmse),
            span_ms: span.map(|time| time.median_ms),
            span_iqr_ms: span.map(|time| time.iqr_ms),
            sum_ms: sum.map(|time| time.median_ms),
            sum_iqr_ms: sum.map(|time| time.iqr_ms),
            wall_ms: cost.wall_ms,
            paths_ms: cost.paths_ms,
            room_bytes: cost.room_bytes(),
            scene_bytes: cost.scene_bytes,
            adapter: Machine::of(&session.gpu).adapter,
            chiaro: env!("CARGO_PKG_VERSION"),
        }
    }
}
