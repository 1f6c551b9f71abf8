//! Pass timings as a table and as JSON.

use std::fmt::Write;

use chiaro::{FrameTimings, Gpu};
use serde::Serialize;

/// Median and spread of a time over frames.
#[derive(Debug, Clone, Serialize)]
pub struct Spread {
    /// Milliseconds.
    pub median_ms: f64,
    /// Interquartile range, milliseconds.
    pub iqr_ms: f64,
}

/// A time along a path: what is usual, and how bad it gets.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Tail {
    /// Milliseconds.
    pub median_ms: f64,
    /// 99 of 100 frames take no longer, milliseconds.
    pub p99_ms: f64,
    /// Milliseconds.
    pub max_ms: f64,
}

/// One pass over all frames; recorded several times a frame, its times are added.
#[derive(Debug, Clone, Serialize)]
pub struct PassSpread<T = Spread> {
    /// `technique/pass`.
    pub name: String,
    /// Times recorded in a frame.
    pub count: usize,
    /// Frames that recorded it: fewer than all where its result was kept.
    pub frames: usize,
    /// Of all its recordings in a frame.
    #[serde(flatten)]
    pub time: T,
}

/// GPU times of a run.
#[derive(Debug, Clone, Serialize)]
pub struct Summary<T = Spread> {
    /// Frames measured.
    pub frames: usize,
    /// In recording order.
    pub passes: Vec<PassSpread<T>>,
    /// From the first pass' begin to the last one's end.
    pub frame_span: T,
    /// Sum of the passes; passes may overlap, so it may exceed the span.
    pub pass_sum: T,
}

/// Who measured.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// What the adapter calls itself.
    pub adapter: String,
    /// Name and version.
    pub driver: String,
    /// The graphics interface.
    pub backend: String,
    /// Discrete, integrated, software.
    pub kind: String,
}

impl Machine {
    /// The one that a device is part of.
    pub fn of(gpu: &Gpu) -> Self {
        Self {
            adapter: gpu.info.name.clone(),
            driver: format!("{} {}", gpu.info.driver, gpu.info.driver_info),
            backend: format!("{:?}", gpu.info.backend),
            kind: format!("{:?}", gpu.info.device_type),
        }
    }
}

/// The time that a share of the times does not exceed, between neighbours by a straight line.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len().max(1) - 1) as f64;
    let (low, high) = (place.floor() as usize, place.ceil() as usize);
    sorted.get(low).zip(sorted.get(high)).map_or(0.0, |(a, b)| a + (b - a) * place.fract())
}

fn spread(sorted: &[f64]) -> Spread {
    let at = |share| quantile(sorted, share);
    Spread { median_ms: at(0.5), iqr_ms: at(0.75) - at(0.25) }
}

fn tail(sorted: &[f64]) -> Tail {
    let at = |share| quantile(sorted, share);
    Tail { median_ms: at(0.5), p99_ms: at(0.99), max_ms: at(1.0) }
}

/// Medians over frames, passes in recording order; `None` without timings.
pub fn summarise(frames: &[FrameTimings]) -> Option<Summary> {
    summary(frames, spread)
}

/// The same with the slowest frames.
pub fn summarise_tails(frames: &[FrameTimings]) -> Option<Summary<Tail>> {
    summary(frames, tail)
}

/// `of` takes times in their order.
fn summary<T>(frames: &[FrameTimings], of: fn(&[f64]) -> T) -> Option<Summary<T>> {
    let over = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        of(&times)
    };
    let mut names: Vec<&str> = Vec::new();
    for pass in frames.iter().flat_map(|frame| &frame.passes) {
        if !names.contains(&pass.name.as_str()) {
            names.push(&pass.name);
        }
    }
    if names.is_empty() {
        return None;
    }
    let passes = names
        .into_iter()
        .map(|name| {
            let of = |frame: &FrameTimings| {
                frame.passes.iter().filter(|pass| pass.name == name).map(|pass| pass.ms).collect::<Vec<_>>()
            };
            let per_frame: Vec<_> = frames.iter().map(of).filter(|times| !times.is_empty()).collect();
            let count = per_frame.last().map_or(0, Vec::len);
            let recorded = per_frame.len();
            let time = over(per_frame.iter().map(|times| times.iter().sum()).collect());
            PassSpread { name: name.to_owned(), count, frames: recorded, time }
        })
        .collect();
    let sums = frames.iter().map(|frame| frame.passes.iter().map(|pass| pass.ms).sum()).collect();
    Some(Summary {
        frames: frames.len(),
        passes,
        frame_span: over(frames.iter().map(|frame| frame.span_ms).collect()),
        pass_sum: over(sums),
    })
}

/// The table for people.
pub fn table(machine: &Machine, summary: &Summary) -> String {
    let mut text = format!("GPU time on {}, {} frames\n", machine.adapter, summary.frames);
    for (name, time) in rows(summary) {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {name:<36}{:>10.3} ms   ± {:.3}", time.median_ms, time.iqr_ms);
    }
    text + "  (median and interquartile range; passes may overlap)\n"
}

/// Passes, their sum and the frame, by what people call them.
pub fn rows<T>(summary: &Summary<T>) -> impl Iterator<Item = (String, &T)> {
    let passes = summary.passes.iter().map(|pass| {
        let times = if pass.count > 1 { format!(" ×{}", pass.count) } else { String::new() };
        let frames = if pass.frames < summary.frames {
            format!(", {} of the frames", pass.frames)
        } else {
            String::new()
        };
        (format!("{}{times}{frames}", pass.name), &pass.time)
    });
    let whole = [("sum of passes", &summary.pass_sum), ("frame, first to last", &summary.frame_span)];
    passes.chain(whole.map(|(name, time)| (name.to_owned(), time)))
}

/// What the device says when it has no timestamps.
pub const NO_TIMESTAMPS: &str = "this adapter has no timestamp queries, so there are no GPU timings";

#[cfg(test)]
mod tests {
    use super::*;
    use chiaro::PassTiming;

    #[test]
    fn passes_of_one_name_are_added_within_a_frame_and_medians_taken_over_frames() {
        let frame = |a: f64, b: f64| FrameTimings {
            passes: vec![
                PassTiming { name: "shadow/depth".into(), ms: a },
                PassTiming { name: "shadow/depth".into(), ms: b },
            ],
            span_ms: a + b,
        };
        let summary = summarise(&[frame(1.0, 2.0), frame(2.0, 2.0), frame(1.0, 100.0)]).unwrap();
        assert_eq!(summary.passes.len(), 1);
        assert_eq!(summary.passes[0].count, 2);
        assert_eq!(summary.passes[0].time.median_ms, 4.0);
        assert!(summarise(&[]).is_none());
    }

    #[test]
    fn the_slowest_frames_are_told_apart_from_the_usual_ones() {
        let frame = |ms: f64| FrameTimings {
            passes: vec![PassTiming { name: "direct/shade".into(), ms }],
            span_ms: 2.0 * ms,
        };
        // 200 frames of 1 ms but for three.
        let mut frames = vec![frame(1.0); 197];
        frames.extend([5.0, 40.0, 6.0].map(frame));
        let summary = summarise_tails(&frames).unwrap();
        let shade = &summary.passes[0].time;
        assert_eq!((shade.median_ms, shade.max_ms), (1.0, 40.0));
        // The 199 steps between them: 197.01 is just past the third last.
        assert!((shade.p99_ms - 5.01).abs() < 1e-9, "{}", shade.p99_ms);
        assert_eq!(summary.frame_span.max_ms, 80.0);
    }
}
