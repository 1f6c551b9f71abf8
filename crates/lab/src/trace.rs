//! Tracing, a dispatch at a time: as long as a desktop can bear, but no shorter than it must be.

use std::time::{Duration, Instant};

use chiaro::{Gpu, LoadedScene, Recorder, Reference};

use crate::Error;

/// How long the GPU may be busy with one dispatch, about: no watchdog or desktop notices.
const BUSY: Duration = Duration::from_millis(50);
/// Samples of single pixels that the first dispatch takes, with a GPU and without.
const FIRST_WORK: [u64; 2] = [1 << 18, 1 << 14];
const LEAST_WORK: u64 = 1 << 10;

/// How much work a dispatch takes.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    work: u64,
}

impl Pace {
    /// Of a device that nothing is known of yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self { work: FIRST_WORK[usize::from(gpu.is_software())] }
    }

    /// Adds samples, up to `most` of each pixel, and waits for them; some of a pass only where that takes long. Returns how
    /// long it took.
    ///
    /// # Errors
    /// When the device fails.
    pub fn refine(
        &mut self,
        recorder: &mut Recorder,
        (reference, loaded): (&mut Reference, &LoadedScene),
        most: u32,
    ) -> Result<Duration, Error> {
        let begun = Instant::now();
        let mut frame = recorder.begin();
        let recorded = reference.refine(&mut frame, loaded, self.work, most);
        frame.submit();
        recorder.wait()?;
        let took = begun.elapsed();
        if took < BUSY / 2 && recorded >= self.work / 2 {
            self.work = self.work.saturating_mul(2);
        } else if took > 2 * BUSY {
            self.work = (self.work / 2).max(LEAST_WORK);
        }
        Ok(took)
    }
}
