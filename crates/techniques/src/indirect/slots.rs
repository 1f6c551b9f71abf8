//! Which virtual lights there may be.

use std::ops::Range;

use super::settings::IndirectSettings;

/// Number of the set of VPLs on what shines itself; those of bounces have lower ones.
pub const SOURCES: u32 = IndirectSettings::MOST_BOUNCES;
/// Of those where they shine.
pub const SCATTERED: u32 = SOURCES + 1;
/// How many sets there are.
pub const SETS: u32 = SCATTERED + 1;

/// Virtual lights of a further bounce, unless the first has fewer.
const LEAST: u32 = 64;

/// What a scene has light from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LitBy {
    /// Whether there are lamps.
    pub lamps: bool,
    /// Whether anything glows, or surrounds the scene with light.
    pub sources: bool,
}

/// Numbers of the virtual lights that each set may have, one set after the other. The first bounce has as many as are asked for,
/// the second a quarter of that, and each further one half as many. Then there are those on what shines itself, and where they
/// shine: as many as are asked for where there are no lamps, else a quarter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slots {
    ends: [u32; SETS as usize],
}

impl Slots {
    /// Those of a scene.
    pub fn new(settings: &IndirectSettings, lit_by: LitBy) -> Self {
        let most = |set: u32| match set {
            // One at least, so that buffers are not empty.
            0 => {
                if lit_by.lamps || !lit_by.sources {
                    settings.lights()
                } else {
                    1
                }
            }
            SOURCES if lit_by.sources && settings.shines() => settings.sources,
            SCATTERED if lit_by.sources && settings.scatters() => {
                if lit_by.lamps {
                    fewer(settings, 2)
                } else {
                    settings.vpls
                }
            }
            _ if set < settings.made_bounces() => fewer(settings, set + 1),
            _ => 0,
        };
        let mut end = 0;
        let ends = std::array::from_fn(|set| {
            end += most(set as u32);
            end
        });
        Self { ends }
    }

    /// Those of a set.
    pub fn of(&self, set: u32) -> Range<u32> {
        let first = (set as usize).checked_sub(1).map_or(0, |before| self.ends[before]);
        first..self.ends[set as usize]
    }

    /// How many there are.
    pub fn all(&self) -> u32 {
        self.ends[SETS as usize - 1]
    }

    /// Whether any are on what shines itself.
    pub fn shine(&self) -> bool {
        !self.of(SOURCES).is_empty()
    }
}

fn fewer(settings: &IndirectSettings, halvings: u32) -> u32 {
    (settings.vpls >> halvings).max(LEAST.min(settings.vpls))
}
