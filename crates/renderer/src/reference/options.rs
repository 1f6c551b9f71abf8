//! What is traced.

/// Which paths make an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Paths from the camera: all light but that of lamps without extent over mirrors or through smooth glass.
    #[default]
    Path,
    /// Paths from the lights to surfaces that scatter and are seen directly; mirrors and smooth glass are black.
    Photon,
    /// Both, nothing twice: everything. Where nothing mirrors or refracts, the same as [`Integrator::Path`].
    Full,
}

/// Which of an image's samples are traced, where many machines share it: every N-th round of [`crate::Reference::round`]
/// samples. All shards together are the samples of one machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1 to `of`.
    pub number: u32,
    /// How many there are.
    pub of: u32,
}

impl Default for Shard {
    /// The whole.
    fn default() -> Self {
        Self { number: 1, of: 1 }
    }
}

impl Shard {
    /// The first of the shard's rounds, by its number in the whole.
    fn first_round(self) -> u32 {
        self.number.clamp(1, self.of.max(1)) - 1
    }

    /// How many of the first `samples` of the whole are the shard's, in rounds of `round`, of which the last may hold more
    /// than there are to be.
    pub fn samples_of(self, samples: u32, round: u32) -> u32 {
        let rounds = samples.div_ceil(round.max(1)).saturating_sub(self.first_round());
        rounds.div_ceil(self.of.max(1)).saturating_mul(round.max(1))
    }

    /// The number in the whole of the first sample of a round that begins after so many of the shard's, and the step from
    /// one sample of a dispatch to the next where rounds are of one.
    pub(super) fn numbers(self, samples: u32, round: u32) -> (u32, u32) {
        let rounds = (samples / round).wrapping_mul(self.of.max(1)).wrapping_add(self.first_round());
        (rounds.wrapping_mul(round), if round == 1 { self.of.max(1) } else { 1 })
    }
}

/// What is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Which paths.
    pub integrator: Integrator,
    /// Most edges of a path: 1 shows what glows, 2 direct light, 3 one bounce; 0 = no limit.
    pub max_depth: u32,
    /// Most times that light is scattered from one surface to another; mirrors and smooth interfaces do not count.
    pub diffuse_bounces: u32,
    /// What random numbers start from.
    pub seed: u32,
    /// Which of the samples.
    pub shard: Shard,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self {
            integrator: Integrator::Path,
            max_depth: 0,
            diffuse_bounces: u32::MAX,
            seed: 0,
            shard: Shard::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_together_have_each_sample_once() {
        for (round, of, samples) in [(1, 1, 7), (1, 3, 7), (4, 3, 40), (4, 5, 11), (16, 2, 16)] {
            let mut numbers: Vec<u32> = (1..=of)
                .flat_map(|number| {
                    let shard = Shard { number, of };
                    let rounds = shard.samples_of(samples, round) / round;
                    (0..rounds).flat_map(move |k| {
                        let (first, step) = shard.numbers(k * round, round);
                        // Where rounds are of one, a dispatch may go on to the shard's next.
                        assert_eq!(step, if round == 1 { of } else { 1 });
                        first..first + round
                    })
                })
                .collect();
            numbers.sort_unstable();
            let all = samples.next_multiple_of(round);
            assert_eq!(numbers, (0..all).collect::<Vec<_>>(), "{round} {of} {samples}");
        }
        assert_eq!(Shard { number: 5, of: 8 }.samples_of(16, 4), 0);
    }
}
