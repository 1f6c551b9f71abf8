//! What passes cost, over the last frames.

use std::collections::VecDeque;

use chiaro::FrameTimings;

/// Frames that are remembered.
pub const HISTORY: usize = 240;
/// Frames that the table's numbers are the mean of.
const MEAN_OVER: usize = 30;

/// One row of the table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// `technique/step`, or what else is timed.
    pub name: String,
    /// Whether it is plotted.
    pub plotted: bool,
    // Milliseconds, newest last; 0 in frames that did without.
    values_ms: VecDeque<f64>,
}

impl Row {
    fn new(name: &str, plotted: bool, length: usize) -> Self {
        Self { name: name.to_owned(), plotted, values_ms: VecDeque::from(vec![0.0; length]) }
    }

    fn push(&mut self, ms: f64) {
        if self.values_ms.len() == HISTORY {
            self.values_ms.pop_front();
        }
        self.values_ms.push_back(ms);
    }

    /// Mean of the newest frames, milliseconds.
    pub fn mean_ms(&self) -> f64 {
        let newest = self.values_ms.iter().rev().take(MEAN_OVER);
        let count = newest.len().max(1);
        newest.sum::<f64>() / count as f64
    }

    /// All remembered frames, oldest first.
    pub fn history_ms(&self) -> impl Iterator<Item = f64> + '_ {
        self.values_ms.iter().copied()
    }
}

/// GPU time of passes, and time between frames.
#[derive(Clone, Debug, PartialEq)]
pub struct TimingHistory {
    /// Wall time from frame to frame.
    pub frame: Row,
    /// GPU time from the first pass' begin to the last one's end; passes may overlap, so it is not their sum.
    pub span: Row,
    /// Passes, in the order in which they first appeared.
    pub passes: Vec<Row>,
}

impl Default for TimingHistory {
    fn default() -> Self {
        Self { frame: Row::new("frame", true, 0), span: Row::new("GPU", true, 0), passes: Vec::new() }
    }
}

impl TimingHistory {
    /// Notes the time since the frame before.
    pub fn frame_took(&mut self, ms: f64) {
        self.frame.push(ms);
    }

    /// Notes what the GPU said about a frame.
    pub fn gpu_took(&mut self, timings: &FrameTimings) {
        let known = self.span.values_ms.len();
        self.span.push(timings.span_ms);
        for pass in &timings.passes {
            if !self.passes.iter().any(|row| row.name == pass.name) {
                self.passes.push(Row::new(&pass.name, false, known));
            }
        }
        for row in &mut self.passes {
            let of_row = timings.passes.iter().filter(|pass| pass.name == row.name);
            // A plain sum of nothing is −0.
            row.push(of_row.fold(0.0, |sum, pass| sum + pass.ms));
        }
        // A pass that has not run for as long as is remembered is of another technique.
        self.passes.retain(|row| row.values_ms.iter().any(|ms| *ms > 0.0));
    }

    /// Sum of all passes' means, milliseconds.
    pub fn sum_ms(&self) -> f64 {
        self.passes.iter().map(Row::mean_ms).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chiaro::PassTiming;

    fn frame(passes: &[(&str, f64)]) -> FrameTimings {
        let passes = passes.iter().map(|(name, ms)| PassTiming { name: (*name).into(), ms: *ms }).collect();
        FrameTimings { passes, span_ms: 3.0 }
    }

    #[test]
    fn a_pass_recorded_twice_counts_as_one_and_an_absent_one_as_zero() {
        let mut history = TimingHistory::default();
        history.gpu_took(&frame(&[("a", 1.0), ("a", 2.0)]));
        history.gpu_took(&frame(&[("b", 4.0)]));
        let names: Vec<_> = history.passes.iter().map(|row| row.name.as_str()).collect();
        assert_eq!(names, ["a", "b"]);
        assert_eq!(history.passes[0].history_ms().collect::<Vec<_>>(), [3.0, 0.0]);
        assert_eq!(history.passes[1].history_ms().collect::<Vec<_>>(), [0.0, 4.0]);
        assert_eq!(history.sum_ms(), 3.5);
        assert_eq!(history.span.mean_ms(), 3.0);
    }

    #[test]
    fn passes_of_techniques_no_longer_used_are_forgotten() {
        let mut history = TimingHistory::default();
        history.gpu_took(&frame(&[("old", 1.0)]));
        (0..HISTORY).for_each(|_| history.gpu_took(&frame(&[("new", 1.0)])));
        assert_eq!(history.passes.len(), 1);
        assert_eq!(history.span.history_ms().count(), HISTORY);
    }
}
