//! What the camera sees first: albedo, normals and depth averaged over the very places of a pixel that a path-traced
//! image samples, as denoisers and comparisons want them.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | frame, scene groups, `tracer` | sum | Rgba32Float | as [`FirstHit`] says, summed over samples; alpha sums coverage |
//!
//! Definitions and units are those of the pictures' [`crate::post::Aov`]; textures are at their finest mip, and nothing
//! is quantised. Limits: see-through surfaces count as those seen first, where pictures look through them.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life, Texture,
    TextureOptions,
};

use crate::rays::{TraceFacts, TraceScene};
use crate::scene::{SceneFacts, SceneGpu};
use crate::shaders;

/// Twin of `FirstHitPass` in `first_hit.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct FirstHitPass {
    pub size_px: [u32; 2],
    pub first_sample: u32,
    pub sample_count: u32,
    pub what: u32,
    pub seed: u32,
    pub step: u32,
    pub before: u32,
}

/// A quantity of the surface seen first, in the order of `first_hit.cs.wesl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FirstHit {
    /// Base colour, linear.
    Albedo,
    /// World-space shading normal, −1..1.
    Normal,
    /// Metres along the camera's axis.
    Depth,
    /// The colour of unlit materials, which the picture's radiance holds as nits; black elsewhere.
    Unlit,
}

impl FirstHit {
    /// All.
    pub const ALL: [Self; 4] = [Self::Albedo, Self::Normal, Self::Depth, Self::Unlit];

    /// The name of its sum, which is that of `--aov`.
    pub fn layer(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::Unlit => "unlit",
        }
    }
}

/// One quantity, summed over samples.
#[derive(Clone, Debug)]
pub struct FirstHitSum {
    /// Which.
    pub what: FirstHit,
    // Two that take turns.
    textures: [Texture; 2],
    newest: usize,
}

impl FirstHitSum {
    /// No samples.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2], what: FirstHit) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING
            | TextureUsages::STORAGE_BINDING
            | TextureUsages::COPY_SRC
            | TextureUsages::COPY_DST;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba32Float, usage);
        let textures = [0, 1].map(|_| Texture::new(gpu, what.layer(), Life::Kept, options));
        Self { what, textures, newest: 0 }
    }

    /// The sum so far.
    pub fn texture(&self) -> &Texture {
        &self.textures[self.newest]
    }
}

/// The pass.
#[derive(Debug)]
pub struct FirstHitTracer {
    pipeline: ComputePipeline,
    uniform: Buffer,
}

impl FirstHitTracer {
    /// Compiles the pass for scenes of these facts; `frame_layout` is one without shadow views.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        (frame_layout, scene_layout): (&GroupLayout, &GroupLayout),
        (facts, trees): (SceneFacts, TraceFacts),
    ) -> Result<Self, GpuError> {
        let shared = &[frame_layout, scene_layout];
        let constants = [&facts.constants()[..], &trees.constants()].concat();
        let pipeline = ComputePipeline::new(gpu, library, &shaders::first_hit(), shared, &constants)?;
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform =
            Buffer::new(gpu, "first_hit_pass", Life::Frame, size_of::<FirstHitPass>() as u64, usage);
        Ok(Self { pipeline, uniform })
    }

    /// Adds `count` samples to the `before` that every pixel has, those of the numbers `first`, `first + step`, …. The
    /// frame's uniform must hold the camera without jitter.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene, traced): (&Group, &SceneGpu, &TraceScene),
        seed: u32,
        (first, step): (u32, u32),
        (before, count): (u32, u32),
        sum: &mut FirstHitSum,
    ) {
        let size = sum.texture().options();
        let size_px = [size.width, size.height];
        let pass = FirstHitPass {
            size_px,
            first_sample: first,
            sample_count: count,
            what: sum.what as u32,
            seed,
            step,
            before,
        };
        frame.upload(&self.uniform, &[pass]);
        let [old, new] = [sum.newest, 1 - sum.newest].map(|i| &sum.textures[i]);
        let binds = [
            ("first_hit_pass", (&self.uniform).into()),
            ("sum_before", old.into()),
            ("tracer", (&traced.words).into()),
            ("sum", new.into()),
        ];
        let pixels = Dispatch::Threads([size_px[0], size_px[1], 1]);
        let groups = [frame_group, scene.group()];
        frame.compute("reference/first_hit", &self.pipeline, &groups, &binds, pixels);
        sum.newest = 1 - sum.newest;
    }
}
