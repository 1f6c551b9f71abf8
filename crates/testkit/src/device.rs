//! One headless device for all tests of a process.

use std::ops::Deref;
use std::sync::OnceLock;

use chiaro_gpu::{AdapterChoice, Gpu, GpuOptions, LimitChoice};

/// A device in a test's hands. When the test is over it asks the device for errors and fails if there were any.
///
/// Tests that run at the same time share the device, so an error may be told by a neighbour of the test that caused
/// it; its text names the pass.
#[derive(Debug)]
pub struct TestGpu(Gpu);

impl Deref for TestGpu {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        &self.0
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        // A second panic while unwinding would abort without the first one's message.
        if !std::thread::panicking()
            && let Err(error) = self.0.check()
        {
            panic!("{error}");
        }
    }
}

/// The best adapter with all it offers, opened once per process.
///
/// # Panics
/// Without an adapter: a test that cannot run has not passed.
pub fn device() -> TestGpu {
    static SHARED: OnceLock<Gpu> = OnceLock::new();
    TestGpu(SHARED.get_or_init(|| open(LimitChoice::Adapter)).clone())
}

/// The same adapter with nothing but what every WebGPU implementation guarantees.
///
/// # Panics
/// As [`device`].
pub fn device_guaranteed() -> TestGpu {
    static SHARED: OnceLock<Gpu> = OnceLock::new();
    TestGpu(SHARED.get_or_init(|| open(LimitChoice::Guaranteed)).clone())
}

/// A device that no other test uses, for tests that count what it holds.
///
/// # Panics
/// As [`device`].
pub fn device_of_its_own() -> TestGpu {
    TestGpu(open(LimitChoice::Adapter))
}

fn open(limits: LimitChoice) -> Gpu {
    match pollster::block_on(Gpu::new(GpuOptions { adapter: AdapterChoice::Best, limits })) {
        Ok(gpu) => gpu,
        Err(error) => panic!("the GPU tests need a device: {error}"),
    }
}
