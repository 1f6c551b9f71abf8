//! GPU time of passes.

use wgpu_profiler::{GpuProfiler, GpuProfilerSettings, GpuTimerQueryResult};

use crate::Gpu;

/// GPU time of one pass.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTiming {
    /// The pass' name, `technique/step`.
    pub name: String,
    /// Milliseconds from its first to its last timestamp.
    pub ms: f64,
}

/// GPU times of one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameTimings {
    /// In recording order. A pass recorded twice stands here twice.
    pub passes: Vec<PassTiming>,
    /// Milliseconds from the first pass' begin to the last pass' end. Passes may overlap, so this is not their sum.
    pub span_ms: f64,
}

impl FrameTimings {
    pub(crate) fn from_results(results: &[GpuTimerQueryResult]) -> Self {
        let timed = results.iter().filter_map(|r| r.time.clone().map(|time| (&r.label, time)));
        let mut span: Option<(f64, f64)> = None;
        let passes = timed
            .map(|(label, time)| {
                span =
                    Some(span.map_or((time.start, time.end), |(a, b)| (a.min(time.start), b.max(time.end))));
                PassTiming { name: label.clone(), ms: (time.end - time.start) * 1e3 }
            })
            .collect();
        Self { passes, span_ms: span.map_or(0.0, |(a, b)| (b - a) * 1e3) }
    }
}

pub(crate) fn profiler(gpu: &Gpu, enabled: bool) -> Option<GpuProfiler> {
    let settings = GpuProfilerSettings {
        enable_timer_queries: enabled && gpu.optional.timestamps,
        enable_debug_groups: false,
        max_num_pending_frames: 4,
    };
    GpuProfiler::new(&gpu.device, settings).inspect_err(|e| tracing::warn!("no GPU timings: {e}")).ok()
}
