//! What a technique takes: GPU time by pass, memory by room.

use std::collections::BTreeMap;

use chiaro::{Handle, Recorder, Resource};
use serde::Serialize;

use crate::measure::{WARM_UP, measure};
use crate::timings::{Summary, summarise};
use crate::{Error, Session};

/// Time and memory.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Cost {
    /// GPU time by pass; of frames where the adapter has timestamps.
    pub gpu: Option<Summary>,
    /// Of a frame on the clock, milliseconds.
    pub wall_ms: Option<f64>,
    /// GPU time of path tracing, milliseconds, with its filter on the CPU left out.
    pub paths_ms: Option<f64>,
    /// Bytes of GPU memory by the technique that writes them.
    pub bytes: BTreeMap<String, u64>,
    /// Bytes of the scene itself.
    pub scene_bytes: u64,
}

impl Cost {
    /// Bytes of all rooms, the scene's own left out.
    pub fn room_bytes(&self) -> u64 {
        self.bytes.values().sum()
    }
}

/// Measures so many frames, one after the other from `time_s` on; the scene is where it was afterwards. Of none only the
/// memory.
///
/// # Errors
/// When a frame cannot be prepared, or the device fails.
pub fn cost(session: &mut Session, frames: u32, time_s: f64) -> Result<Cost, Error> {
    let mut cost = Cost { scene_bytes: session.scene.gpu.bytes, ..Cost::default() };
    {
        let Session { gpu, renderer, scene, view, size, .. } = &*session;
        let mut recorder = Recorder::new(gpu, false);
        for resource in renderer.leaves(&mut recorder, scene, view, *size)? {
            *cost.bytes.entry(resource.name.technique.to_owned()).or_default() += bytes(&resource);
        }
        recorder.wait()?;
    }
    if frames > 0 {
        // The warm-up is before.
        let moment = |index: u32| (time_s + (f64::from(index) - f64::from(WARM_UP)) / 60.0).max(0.0);
        let measured = measure(session, frames, moment, || ())?;
        cost.gpu = summarise(&measured.timings);
        cost.wall_ms = Some(measured.wall_ms_per_frame);
        session.go_to(time_s)?;
    }
    Ok(cost)
}

fn bytes(resource: &Resource) -> u64 {
    match &resource.handle {
        Handle::Buffer(buffer) => buffer.raw().size(),
        Handle::Texture(texture) => {
            let options = texture.options();
            let texel = options.format.block_copy_size(None).or(options.format.target_pixel_byte_cost());
            let texels = |mip: u32| {
                let side = |side: u32| u64::from((side >> mip).max(1));
                side(options.width) * side(options.height)
            };
            let mips: u64 = (0..options.mips).map(texels).sum();
            mips * u64::from(options.layers.unwrap_or(1))
                * u64::from(options.samples)
                * u64::from(texel.unwrap_or(4))
        }
    }
}
