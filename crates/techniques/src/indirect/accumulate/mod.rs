//! Indirect light that is calm while things move: a mean over the frames that saw the same place (Hedman et al. 2016,
//! "Sequential Monte Carlo Instant Radiosity", section 5; Yang, Liu & Salvi 2020, "A Survey of Temporal Antialiasing
//! Techniques").
//!
//! What arrives at a place does not depend on the eye. So the mean is looked up where the place was ([`crate::view::MotionOutputs`])
//! and this frame is added as one of n + 1, of n that the mean is of.
//!
//! | input | format | space, unit |
//! | --- | --- | --- |
//! | irradiance | Rgba16Float: irradiance / π; log2 of the view depth, below −50 where there is none | nits · radiance scale; m |
//! | motion | Rgba32Float, of opaque surfaces: [`MotionOutputs`] | pixels, m |
//! | surface | of the surface buffer: the normal alone is read | |
//! | output: irradiance | as the input | |
//! | `history_age` | R32Float: how many frames each pixel is the mean of, this one counted | |
//!
//! It is a function of these alone: light of any kind that arrives and does not depend on the eye has a [`AccumulateRoom`] of its
//! own.
//!
//! # What is trusted
//! - A texel of the frame before where depth is the same, to 1.4 % and two pixels' slope, weighted by max(n · n', 0)⁶⁴. Between four
//!   texels; where all of those are of other surfaces, as beside silhouettes, the mean of nine.
//! - What is new in sight has no past ([`MotionOutputs::motion`]'s last component).
//! - Not what this frame has nowhere around: the past is drawn to within a quarter of what 3 × 3 neighbours on the same surface
//!   have now, and loses frames by how far it was outside. So a room that a door opens to is bright at once.
//! - As many frames as the caller allows: fewer where lamps and things move, none after a cut.
//!
//! # Limits
//! A change of less than a quarter lags by as many frames as are allowed. Layers of see-through surfaces have no past. Light
//! that normal maps bend is as sharp as one frame, less 2 × 2 texels where the picture moves.
//!
//! # Cost
//! A pixel reads 8 bytes of irradiance, 16 of motion, 4 of surface and, from caches, four times 24 of the frame before; it writes
//! 32. 84 bytes of memory a pixel: 174 MB at 1920 × 1080, at 3.3 TB/s 0.05 ms. Room: 56 bytes a pixel, 116 MB.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Mapping, Scale, Texture, TextureOptions,
    TexturePool, ViewHint,
};

use crate::view::MotionOutputs;
use crate::{Kit, Pass, shaders};

const STEADY: ViewHint =
    ViewHint::scaled("Indirect light that arrives, as the mean of frames", Mapping::Exposed, Scale::Nits);
const AGE: ViewHint = ViewHint::scaled(
    "How many frames indirect light is the mean of: black is none, white 32",
    Mapping::Heat,
    Scale::By(1.0 / 32.0),
);

/// See `accumulate.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct AccumulateData {
    pub(crate) size_px: [u32; 2],
    pub(crate) frames: f32,
    pub(crate) history_scale: f32,
}

/// What of the past a frame may count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Allowed {
    /// Frames at most; 0: there is no past.
    pub frames: f32,
    /// Stored units of radiance now over those of the frame before.
    pub history_scale: f32,
}

/// What light a frame averages, and by what it is followed.
#[derive(Clone, Copy, Debug)]
pub struct AccumulateInputs<'a> {
    /// Rgba16Float: irradiance / π, log2 of the view depth.
    pub irradiance: &'a Texture,
    /// The surface buffer.
    pub surface: &'a Texture,
    /// How opaque surfaces have moved.
    pub motion: &'a MotionOutputs,
    /// How much of the past counts.
    pub allowed: Allowed,
}

/// What the next frame looks up.
#[derive(Debug)]
struct Kept {
    mean: Texture,
    normal: Texture,
    age: Texture,
}

/// The mean of one kind of light, of one size.
#[derive(Debug)]
pub struct AccumulateRoom {
    steady: Texture,
    // They take turns.
    kept: [Kept; 2],
    turn: usize,
    // Whether a frame has left anything.
    has_past: bool,
    uniform: Buffer,
}

impl AccumulateRoom {
    /// R32Float: how many frames each pixel of the last frame is the mean of.
    pub fn age(&self) -> &Texture {
        &self.kept[self.turn].age
    }
}

/// The pass.
#[derive(Debug)]
pub struct Accumulate {
    pipeline: ComputePipeline,
}

impl Pass for Accumulate {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let entry = shaders::plain("indirect/accumulate/accumulate.cs.wesl");
        Ok(Self { pipeline: ComputePipeline::new(&kit.gpu, &kit.library, &entry, &[], &[])? })
    }
}

impl Accumulate {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        room: &'r mut Option<AccumulateRoom>,
    ) -> &'r AccumulateRoom {
        let serves = |room: &AccumulateRoom| {
            let has = room.steady.options();
            [has.width, has.height] == size
        };
        chiaro_gpu::keep(room, serves, || {
            let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
            let lend = |name, life, format| {
                pool.lend(gpu, name, life, TextureOptions::new(size[0], size[1], format, usage))
            };
            let kept = |_| Kept {
                mean: lend("irradiance_mean", Life::Kept, TextureFormat::Rgba32Float),
                normal: lend("irradiance_normal", Life::Kept, TextureFormat::R32Uint),
                age: lend("history_age", Life::Kept, TextureFormat::R32Float).described(AGE),
            };
            let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            AccumulateRoom {
                steady: lend("irradiance_steady", Life::Frame, TextureFormat::Rgba16Float).described(STEADY),
                kept: [0, 1].map(kept),
                turn: 0,
                has_past: false,
                uniform: Buffer::new(
                    gpu,
                    "accumulate",
                    Life::Frame,
                    size_of::<AccumulateData>() as u64,
                    uniform,
                ),
            }
        })
    }

    /// This frame's light as the mean of frames.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        inputs: &AccumulateInputs<'_>,
        room: &mut AccumulateRoom,
    ) -> Texture {
        room.turn ^= 1;
        let options = *room.steady.options();
        let size_px = [options.width, options.height];
        let Allowed { frames, history_scale } = inputs.allowed;
        let frames = if std::mem::replace(&mut room.has_past, true) { frames } else { 0.0 };
        frame.upload(&room.uniform, &[AccumulateData { size_px, frames, history_scale }]);
        let (now, before) = (&room.kept[room.turn], &room.kept[room.turn ^ 1]);
        let binds = [
            ("accumulate", (&room.uniform).into()),
            ("irradiance", inputs.irradiance.into()),
            ("surface", inputs.surface.into()),
            ("motion", (&inputs.motion.motion).into()),
            ("mean_before", (&before.mean).into()),
            ("normal_before", (&before.normal).into()),
            ("age_before", (&before.age).into()),
            ("steady", (&room.steady).into()),
            ("mean", (&now.mean).into()),
            ("normal", (&now.normal).into()),
            ("history_age", (&now.age).into()),
        ];
        let pixels = Dispatch::Threads([size_px[0], size_px[1], 1]);
        frame.compute("indirect/accumulate", &self.pipeline, &[], &binds, pixels);
        room.steady.clone()
    }
}
