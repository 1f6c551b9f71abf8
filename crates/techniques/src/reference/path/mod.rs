//! A path tracer: unbiased light transport but for the paths that no camera tracer finds (lights without extent seen in
//! mirrors or through smooth glass), which [`photon`](super::photon) adds.
//!
//! Paths start at the camera; at every surface one emitter is chosen by flux and combined with the surface's own sampling
//! by multiple importance (Veach & Guibas 1995). Materials are evaluated by the same WESL modules as in the real-time
//! pipelines, textures at their finest mip; interfaces bend light by Snell's and Fresnel's laws, rough ones through facets
//! (Walter et al. 2007), dispersing ones by a band of the spectrum that is drawn where a path first meets them. Blended
//! surfaces are met as often as their alpha says, each instance for itself. Until a path is scattered it looks, and passes
//! through backs of single-sided surfaces; all else carries light, which backs stop (`docs/reference.md`, "What is seen"). A light behind the triangle gives nothing, whatever the bent normal says,
//! as in the pipelines. Russian roulette ends paths from the third edge on, by the root of the light that they carry.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | frame, scene groups, `tracer`, `emitters`, photons | sum | Rgba32Float, a pair of them | nits summed over samples; alpha sums coverage |
//! | | squares | Rgba32Float | their squares, nits² |
//! | | direct | Rgba32Float | the part of light that is met, or that falls straight on the first surface that scatters, nits |
//! | | caustics | Rgba32Float | the part that comes to that surface through mirrors and smooth interfaces alone, nits |
//!
//! All are layers of one array ([`PathSum`]). What is left of the sum, light that was scattered before, is indirect.
//!
//! Limits: one medium around a path at a time. Samples are independent of how they are grouped and of which rows are traced
//! together: the same seed gives the same image, bit for bit.
//!
//! Cost: on an H100 2.2 ms for a primary ray and a bounce of each pixel of 1920×1080 in sponza, 19 ms for whole paths.

pub(crate) mod emitters;
mod lamps;
pub(crate) mod noise;
mod sum;

pub use emitters::{EmitterData, Emitters};
pub use noise::PathNoise;
pub use sum::PathSum;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Bind, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life};

use crate::paths::Interfaces;
use crate::rays::{TraceFacts, TraceScene};
use crate::reference::photon::PhotonMap;
use crate::scene::{SceneFacts, SceneGpu};
use crate::shaders;

/// Twin of `PathPass` in `trace.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct PathPass {
    pub size_px: [u32; 2],
    pub before: u32,
    pub sample_count: u32,
    pub max_depth: u32,
    pub diffuse_bounces: u32,
    pub seed: u32,
    pub first_row: u32,
    pub rows: u32,
    pub first_seen: u32,
    pub seen_count: u32,
    pub step: u32,
    pub zero: u32,
    pub reserved: u32,
}

/// Which paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathOptions {
    /// Most edges of a path: 1 shows what glows, 2 direct light, 3 one bounce; 0 = no limit.
    pub max_depth: u32,
    /// Most times that light is scattered from one surface to another; mirrors and smooth interfaces do not count.
    pub diffuse_bounces: u32,
    /// What random numbers start from.
    pub seed: u32,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { max_depth: 0, diffuse_bounces: u32::MAX, seed: 0 }
    }
}

/// Samples that one path from the camera stands for where it only shows what shines itself.
const SAMPLES_A_PATH: u32 = 4;

/// The pass.
#[derive(Debug)]
pub struct PathTracer {
    pipeline: ComputePipeline,
    uniform: Buffer,
}

impl PathTracer {
    /// Compiles the pass for scenes of these facts; `frame_layout` is one without shadow views, `photons` says whether
    /// light paths bring caustics.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        (frame_layout, scene_layout): (&GroupLayout, &GroupLayout),
        (facts, trees, interfaces): (SceneFacts, TraceFacts, Interfaces),
        photons: bool,
    ) -> Result<Self, GpuError> {
        let shared = &[frame_layout, scene_layout];
        let mut constants = [&facts.constants()[..], &trees.constants()].concat();
        constants.push(interfaces.constant());
        let pipeline = ComputePipeline::new(gpu, library, &shaders::path_trace(photons), shared, &constants)?;
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = Buffer::new(gpu, "path_pass", Life::Frame, size_of::<PathPass>() as u64, usage);
        Ok(Self { pipeline, uniform })
    }

    /// Adds `count` samples to the pixels of the next `rows` rows, from the top on; a pass over the image that is under way
    /// goes on with the count that it began with. They are those of the numbers `first`, `first + step`, …, with photons one
    /// after the other. The frame's uniform must hold the camera without jitter. `photons` are those of the same samples, for
    /// a tracer with photons.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (traced, emitters): (&TraceScene, &Emitters),
        options: PathOptions,
        ((first, step), (count, rows)): ((u32, u32), (u32, u32)),
        (sum, photons): (&mut PathSum, Option<&PhotonMap>),
    ) {
        let size_px = sum.size_px();
        let first_row = sum.rows_done;
        let rows = rows.clamp(1, size_px[1] - first_row);
        if first_row == 0 {
            sum.under_way = count;
        }
        // Beside light paths that bring all else, few paths do for what shines itself.
        let seen_count = if options.max_depth == 1 && photons.is_some() {
            sum.under_way.div_ceil(SAMPLES_A_PATH)
        } else {
            sum.under_way
        };
        let first_seen = (u64::from(first) * u64::from(seen_count) / u64::from(sum.under_way.max(1))) as u32;
        let pass = PathPass {
            size_px,
            before: sum.samples,
            sample_count: sum.under_way,
            max_depth: options.max_depth,
            diffuse_bounces: options.diffuse_bounces,
            seed: options.seed,
            first_row,
            rows,
            first_seen,
            seen_count,
            step,
            zero: 0,
            reserved: 0,
        };
        frame.upload(&self.uniform, &[pass]);
        let [before, after] = [sum.newest, 1 - sum.newest].map(|i| &sum.textures[i]);
        let mut binds: Vec<Bind<'_>> = vec![
            ("path_pass", (&self.uniform).into()),
            ("tracer", (&traced.words).into()),
            ("emitters", (&emitters.words).into()),
            ("sums_before", before.into()),
            ("sums", after.into()),
        ];
        if let Some(map) = photons {
            binds.extend([("photon_pass", (&map.uniform).into()), ("photon_map", (&map.words).into())]);
        }
        let pixels = Dispatch::Threads([size_px[0], rows, 1]);
        frame.compute("reference/path", &self.pipeline, &[frame_group, scene.group()], &binds, pixels);
        sum.rows_done += rows;
        if sum.rows_done == size_px[1] {
            sum.newest = 1 - sum.newest;
            sum.samples += sum.under_way;
            sum.rows_done = 0;
        }
    }
}
