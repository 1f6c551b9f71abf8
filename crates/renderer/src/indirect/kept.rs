//! What frames leave for the next: lights that rest, and means of what arrives.

use chiaro_gpu::{Frame, Texture, wgpu};
use chiaro_techniques::indirect::accumulate::{Accumulate, AccumulateInputs, AccumulateRoom, Allowed};
use chiaro_techniques::indirect::gather::Gathered;
use chiaro_techniques::indirect::sources::Surroundings;
use chiaro_techniques::indirect::{IndirectSettings, Slots};
use chiaro_techniques::view::MotionOutputs;

/// What virtual lights of what shines itself, those where they shine, and the maps of both are made from, and lie in.
#[derive(Debug, PartialEq)]
pub(super) struct Rested {
    // What compiled their passes.
    pub made_by: u64,
    pub settings: IndirectSettings,
    pub slots: Slots,
    pub seed: u32,
    pub scene: u64,
    pub points: u64,
    pub around: Surroundings,
    pub rooms: [wgpu::Buffer; 2],
}

/// Means over frames of light of both kinds.
#[derive(Debug, Default)]
pub(super) struct Means {
    pub bounced: Option<AccumulateRoom>,
    pub sourced: Option<AccumulateRoom>,
}

impl Means {
    /// This frame's light as the mean of frames.
    pub fn record(
        &mut self,
        frame: &mut Frame<'_>,
        accumulate: &Accumulate,
        (surface, motion, allowed): (&Texture, &MotionOutputs, Allowed),
        light: Gathered,
    ) -> Gathered {
        let mut mean = |irradiance: Texture, room: &mut Option<AccumulateRoom>| match room {
            Some(room) => {
                let inputs = AccumulateInputs { irradiance: &irradiance, surface, motion, allowed };
                accumulate.record(frame, &inputs, room)
            }
            None => irradiance,
        };
        Gathered {
            bounced: mean(light.bounced, &mut self.bounced),
            sourced: light.sourced.map(|light| mean(light, &mut self.sourced)),
        }
    }
}
