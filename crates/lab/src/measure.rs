//! What frames take: time, objects made, memory.

use chiaro::{FrameTimings, Recorder};

use crate::{Error, Session};

/// Frames before measuring: shaders warm, clocks up, pools filled.
pub const WARM_UP: u32 = 20;
/// From this frame on nothing may be created.
pub const STEADY_FROM: u32 = 3;

/// What so many frames took.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Of a frame on the clock, milliseconds.
    pub wall_ms_per_frame: f64,
    /// Pipelines, textures, buffers and bind groups: none are made in steady frames.
    pub objects_created_after_frame_3: u64,
    /// Of what the driver holds, from that frame to the last.
    pub memory_growth_bytes: i64,
    /// GPU times of each frame; of none where the adapter has no timestamps.
    pub timings: Vec<FrameTimings>,
}

/// Where what moves is, at sixty frames a second.
pub fn at_sixty(index: u32) -> f64 {
    f64::from(index) / 60.0
}

/// Renders and times frames, one at a time, after a warm-up: `time_s` tells the moment of each, those of the warm-up
/// counted. `tick` is called after each.
///
/// # Errors
/// When a frame cannot be prepared, or the device fails.
pub fn measure(
    session: &mut Session,
    frames: u32,
    time_s: impl Fn(u32) -> f64,
    tick: impl Fn(),
) -> Result<Measured, Error> {
    let mut recorder = Recorder::new(&session.gpu, true);
    let gpu = session.gpu.clone();
    let mut state = chiaro::ViewState::new(&session.renderer);
    let mut timings = Vec::new();
    let mut steady = None;
    let mut start = std::time::Instant::now();
    for index in 0..WARM_UP + frames {
        if index == WARM_UP {
            recorder.wait()?;
            recorder.take_timings();
            start = std::time::Instant::now();
        }
        if session.duration_s().is_some() {
            session.go_to(time_s(index))?;
        }
        let Session { renderer, scene, view, size, .. } = &mut *session;
        let prepared = renderer.prepare(&mut state, scene, view, *size, chiaro::Sampling::Moving)?;
        let mut frame = recorder.begin();
        prepared.record(&mut frame, false);
        frame.submit();
        // One frame in flight: the timings then belong to frames that ran alone, and nothing piles up.
        recorder.wait()?;
        timings.append(&mut recorder.take_timings());
        if index == STEADY_FROM {
            steady = Some((gpu.created.total(), memory(&gpu)));
        }
        if index + 1 == WARM_UP {
            timings.clear();
        }
        tick();
    }
    let wall_ms_per_frame = start.elapsed().as_secs_f64() * 1e3 / f64::from(frames);
    let (created, bytes) = steady.unwrap_or((gpu.created.total(), memory(&gpu)));
    Ok(Measured {
        wall_ms_per_frame,
        objects_created_after_frame_3: gpu.created.total() - created,
        memory_growth_bytes: memory(&gpu) - bytes,
        timings,
    })
}

/// Bytes of GPU memory that the driver layer holds for buffers and textures.
fn memory(gpu: &chiaro::Gpu) -> i64 {
    let counters = gpu.device.get_internal_counters().hal;
    (counters.buffer_memory.read() + counters.texture_memory.read()) as i64
}
