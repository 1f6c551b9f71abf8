//! Which moment of the animation is shown.

/// Time, and whether it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Whether time runs.
    pub playing: bool,
    /// The moment shown, seconds.
    pub time_s: f64,
    /// Seconds of animation per second.
    pub speed: f64,
}

impl Default for Playback {
    fn default() -> Self {
        Self { playing: true, time_s: 0.0, speed: 1.0 }
    }
}

impl Playback {
    /// Lets `dt_s` pass, and starts again at the end.
    pub fn advance(&mut self, dt_s: f64, duration_s: f64) {
        if self.playing {
            self.time_s += dt_s * self.speed;
        }
        if self.time_s > duration_s {
            self.time_s = if duration_s > 0.0 { self.time_s % duration_s } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_starts_again_at_the_end_and_rests_when_paused() {
        let mut playback = Playback { time_s: 1.9, speed: 2.0, ..Playback::default() };
        playback.advance(0.1, 2.0);
        assert!((playback.time_s - 0.1).abs() < 1e-9);
        playback.playing = false;
        playback.advance(0.1, 2.0);
        assert!((playback.time_s - 0.1).abs() < 1e-9);
    }
}
