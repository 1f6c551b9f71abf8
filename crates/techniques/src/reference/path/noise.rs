//! How noisy a path-traced image still is.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life};

use super::sum::PathSum;
use crate::shaders;

/// Pixels that count, about: their mean is within a percent of that of all.
const PIXELS: f64 = 65_536.0;

/// Twin of `NoiseInput` in `noise.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct NoiseInput {
    pub size_px: [u32; 2],
    pub samples: f32,
    pub step_px: u32,
    pub round: f32,
    pub reserved: u32,
}

/// Estimates the mean standard error of a [`PathSum`]'s pixels relative to the image's mean, as if samples were independent:
/// stratified ones are better than that.
#[derive(Debug)]
pub struct PathNoise {
    pipeline: ComputePipeline,
    uniform: Buffer,
    noise: Buffer,
}

impl PathNoise {
    /// Compiles the pass.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(gpu: &Gpu, library: &Library) -> Result<Self, GpuError> {
        let entry = shaders::plain("reference/path/noise.cs.wesl");
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let result = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, library, &entry, &[], &[])?,
            uniform: Buffer::new(gpu, "noise_input", Life::Frame, size_of::<NoiseInput>() as u64, usage),
            noise: Buffer::new(gpu, "noise", Life::Kept, 4, result),
        })
    }

    /// Writes the number; it is the first of [`PathNoise::buffer`]. `round`: samples that were squared together.
    pub fn record(&self, frame: &mut Frame<'_>, sum: &PathSum, round: u32) {
        let size_px = sum.size_px();
        let pixels = f64::from(size_px[0]) * f64::from(size_px[1]);
        let step_px = ((pixels / PIXELS).sqrt().ceil() as u32).max(1);
        let samples = sum.samples().max(1) as f32;
        frame.upload(
            &self.uniform,
            &[NoiseInput { size_px, samples, step_px, round: round as f32, reserved: 0 }],
        );
        let binds = [
            ("noise_input", (&self.uniform).into()),
            ("sums", sum.sums().into()),
            ("noise", (&self.noise).into()),
        ];
        frame.compute("reference/noise", &self.pipeline, &[], &binds, Dispatch::Groups([1; 3]));
    }

    /// Where the number is.
    pub fn buffer(&self) -> &Buffer {
        &self.noise
    }
}
