//! When a reference is done, and how far it is.

use std::time::{Duration, Instant};

use chiaro_lab::files::bar;
use indicatif::ProgressBar;

use crate::args::ReferenceArgs;

/// Samples a pixel where nothing says when to stop.
const DEFAULT_SAMPLES: u32 = 64;
/// An error estimated from fewer samples says little.
const LEAST_SAMPLES: u32 = 16;
/// Between two looks at the noise that only the progress bar asks for: each costs a read-back.
const LOOK: Duration = Duration::from_secs(2);
/// Steps of the bar.
const STEPS: u64 = 1000;

/// Whichever of these comes first.
#[derive(Clone, Copy, Debug)]
struct Limits {
    samples: Option<u32>,
    seconds: Option<f64>,
    error: Option<f64>,
}

/// Samples a pixel that end a render, of all shards together.
pub fn samples(args: &ReferenceArgs) -> Option<u32> {
    let endless = args.time_limit.is_some() || args.target_error.is_some();
    args.spp.or((!endless).then_some(DEFAULT_SAMPLES))
}

/// A render on its way.
pub struct Progress {
    limits: Limits,
    bar: ProgressBar,
    // What the image is called.
    label: String,
    start: Instant,
    // Samples that were there before.
    first: u32,
    // The image has had its time before.
    timed_out: bool,
    // Estimated error at so many samples: the newest, and the newest of those that decide.
    noise: Option<(u32, f64)>,
    decisive: Option<(u32, f64)>,
    looked: Instant,
}

impl Progress {
    /// Of a render to so many samples that has `first` already, and has been ended by a time limit, where there is one, that
    /// is to be kept.
    pub fn new(
        args: &ReferenceArgs,
        samples: Option<u32>,
        label: String,
        (first, timed_out): (u32, Option<f64>),
    ) -> Self {
        let limits = Limits { samples, seconds: args.time_limit, error: args.target_error };
        let bar = bar(STEPS, "path tracing {bar:40} {msg}");
        let start = Instant::now();
        let timed_out = limits.seconds.zip(timed_out).is_some_and(|(most, had)| had >= most);
        Self { limits, bar, label, start, first, timed_out, noise: None, decisive: None, looked: start }
    }

    /// Whether the noise is to be told now: for the bar, or because it decides. It does so at numbers of samples that
    /// depend on nothing but the image, so that the same command always stops at the same one.
    pub fn wants_noise(&self, samples: u32) -> bool {
        let aims = self.decides(samples);
        let shows = !self.bar.is_hidden() && self.looked.elapsed() >= LOOK && samples >= LEAST_SAMPLES;
        let known = self.noise.is_some_and(|(at, _)| at == samples);
        (aims || shows) && !known
    }

    /// Tells the estimated error.
    pub fn set_noise(&mut self, samples: u32, noise: f64) {
        self.noise = Some((samples, noise));
        if self.decides(samples) {
            self.decisive = self.noise;
        }
        self.looked = Instant::now();
    }

    /// Whether the first goal is reached.
    pub fn is_done(&self, samples: u32) -> bool {
        self.is_good(samples) || self.time_was_up(samples).is_some()
    }

    /// The time limit, where nothing else ends the render, or ended it before.
    pub fn time_was_up(&self, samples: u32) -> Option<f64> {
        let timed = |most: &f64| self.start.elapsed().as_secs_f64() >= *most;
        // A render that is stopped and resumed in too short a time would never end.
        let up = |most: &f64| self.timed_out || (timed(most) && samples > self.first);
        self.limits.seconds.filter(up).filter(|_| !self.is_good(samples))
    }

    /// Whether the image is as good as was asked for.
    fn is_good(&self, samples: u32) -> bool {
        let counted = self.limits.samples.is_some_and(|most| samples >= most);
        counted || self.limits.error.zip(self.decisive).is_some_and(|(most, (_, noise))| noise <= most)
    }

    /// Samples that may be added before the next decision; at least 1 while the render is not done.
    pub fn room(&self, samples: u32) -> u32 {
        let most = self.limits.samples.unwrap_or(u32::MAX);
        let look = self.limits.error.map_or(u32::MAX, |_| self.next_look());
        most.min(look.max(samples + 1)) - samples
    }

    /// Shows how far it is.
    pub fn show(&self, samples: u32) {
        let took = self.start.elapsed().as_secs_f64();
        let left = self.seconds_left(samples, took);
        let noise = self.noise.map_or(String::new(), |(_, noise)| format!(", noise {:.2} %", 100.0 * noise));
        let of = self.limits.samples.map_or(String::new(), |most| format!("/{most}"));
        let time = if left.is_finite() { format!(", {} left", clock(left)) } else { String::new() };
        self.bar.set_message(format!("{}{samples}{of} samples{noise}{time}", self.label));
        self.bar.set_position((STEPS as f64 * took / (took + left)) as u64);
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn decides(&self, samples: u32) -> bool {
        self.limits.error.is_some() && samples >= self.next_look()
    }

    /// The next number of samples at which the error may be small enough, by the square root of samples.
    fn next_look(&self) -> u32 {
        match self.decisive.zip(self.limits.error) {
            Some(((samples, noise), error)) => {
                let needed = f64::from(samples) * (noise / error).powi(2);
                // The estimate moves; an expected end is not worth a look after every sample.
                let [soonest, latest] = [samples.saturating_add(samples / 16 + 1), samples.saturating_mul(2)];
                (needed.ceil() as u32).clamp(soonest, latest.max(soonest))
            }
            None => LEAST_SAMPLES,
        }
    }

    /// Seconds to the first goal; infinite when that cannot be told yet.
    fn seconds_left(&self, samples: u32, took: f64) -> f64 {
        let a_sample = took / f64::from(samples.saturating_sub(self.first).max(1));
        let more = |goal: f64| (goal - f64::from(samples)).max(0.0) * a_sample;
        let counted = self.limits.samples.map(|most| more(f64::from(most)));
        let timed = self.limits.seconds.map(|most| (most - took).max(0.0));
        let exact = self.limits.error.zip(self.noise);
        let exact = exact.map(|(most, (at, noise))| more(f64::from(at) * (noise / most).powi(2)));
        [counted, timed, exact].into_iter().flatten().fold(f64::INFINITY, f64::min)
    }
}

/// `42 s`, `3:05 min`, `2:07 h`
fn clock(seconds: f64) -> String {
    let whole = seconds.ceil() as u64;
    match whole {
        0..=99 => format!("{whole} s"),
        100..=5999 => format!("{}:{:02} min", whole / 60, whole % 60),
        _ => format!("{}:{:02} h", whole / 3600, whole / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress(samples: Option<u32>, seconds: Option<f64>, error: Option<f64>, first: u32) -> Progress {
        let start = Instant::now();
        let limits = Limits { samples, seconds, error };
        Progress {
            limits,
            bar: ProgressBar::hidden(),
            label: String::new(),
            start,
            first,
            timed_out: false,
            noise: None,
            decisive: None,
            looked: start,
        }
    }

    #[test]
    fn samples_are_counted_to_the_last() {
        let progress = progress(Some(100), None, None, 0);
        assert_eq!((progress.room(0), progress.room(99)), (100, 1));
        assert!(!progress.is_done(99) && progress.is_done(100));
    }

    #[test]
    fn an_error_is_looked_at_where_the_square_root_of_samples_expects_it_to_be_reached() {
        let mut progress = progress(None, None, Some(0.01), 0);
        assert!(!progress.wants_noise(15) && progress.wants_noise(16));
        assert_eq!(progress.room(0), 16);
        progress.set_noise(16, 0.04);
        // Needs 256, but nobody looks farther ahead than twice the samples.
        assert_eq!(progress.room(16), 16);
        // What the bar shows in between decides nothing.
        progress.set_noise(20, 0.009);
        assert!(!progress.is_done(20) && progress.room(20) == 12);
        progress.set_noise(200, 0.0105);
        assert_eq!(progress.room(200), 21);
        assert!(!progress.is_done(200) && !progress.wants_noise(200) && progress.wants_noise(221));
        progress.set_noise(221, 0.01);
        assert!(progress.is_done(221));
    }

    #[test]
    fn a_resumed_render_out_of_time_adds_something() {
        let mut progress = progress(None, Some(0.0), None, 40);
        assert!(!progress.is_done(40) && progress.is_done(41));
        assert_eq!(progress.time_was_up(41), Some(0.0));
        // But not where it is to be kept as it is.
        progress.timed_out = true;
        assert!(progress.is_done(40));
    }

    #[test]
    fn the_first_goal_decides_the_time_left() {
        let mut progress = progress(Some(400), Some(100.0), Some(0.01), 0);
        // 10 samples a second: 30 s for the samples, 90 s of the time.
        assert!((progress.seconds_left(100, 10.0) - 30.0).abs() < 1e-9);
        progress.set_noise(100, 0.011);
        // 121 samples will do.
        assert!((progress.seconds_left(100, 10.0) - 2.1).abs() < 1e-9);
    }

    #[test]
    fn times_are_short_to_read() {
        assert_eq!([0.2, 99.0, 185.0, 7620.0].map(clock), ["1 s", "99 s", "3:05 min", "2:07 h"]);
    }
}
