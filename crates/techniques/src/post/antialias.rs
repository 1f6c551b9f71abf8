//! Temporal anti-aliasing of pictures that move: see `antialias.cs.wesl`.
//!
//! | input | output | format |
//! | --- | --- | --- |
//! | radiance of a jittered frame, motion, what was seen | radiance | Rgba16Float, as the input |
//!
//! What is seen for the first time shows one frame. Limits: what a mirror or glass shows, shadows and highlights do not move
//! with surfaces, and follow within the box of colours; detail finer than a pixel keeps some of its flicker. Cost: 8 bytes of
//! radiance, 16 of motion, 8 of what is seen and 12 of the frames before read a pixel, 12 written.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Texture, TextureOptions,
    TexturePool,
};

use crate::view::MotionOutputs;
use crate::{Kit, Pass, shaders};

/// Brightness that is half as bright as can be: of radiance, a quarter of white under the brightest light as it is stored; of
/// unlit colours a quarter of the display's white.
const KEY: f32 = 64.0;
const UNLIT_KEY: f32 = 0.25;

/// See `antialias.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct AntialiasData {
    pub(crate) size_px: [u32; 2],
    pub(crate) jitter_px: [f32; 2],
    pub(crate) rests: u32,
    pub(crate) history_scale: f32,
    pub(crate) key: f32,
    pub(crate) reserved: u32,
}

/// What a frame's anti-aliasing goes by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntialiasInputs {
    /// Whether nothing has changed since the frame before.
    pub rests: bool,
    /// How far the frame is moved right and down within its pixels.
    pub jitter_px: [f32; 2],
    /// Stored units of radiance now over those before.
    pub history_scale: f32,
}

/// Means, and of how many frames each pixel's is, with what half floats leave of it: of the frame now and of the one before.
#[derive(Debug)]
struct Mean([(Texture, Texture); 2]);

/// Means of one size, of the frame now and of the one before.
#[derive(Debug)]
pub struct AntialiasRoom {
    radiance: Mean,
    unlit: Option<Mean>,
    turn: usize,
    uniforms: [Buffer; 2],
}

/// The pass.
#[derive(Debug)]
pub struct Antialias {
    pipeline: ComputePipeline,
    sampler: wgpu::Sampler,
}

impl Pass for Antialias {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let Kit { gpu, library, .. } = kit;
        let entry = shaders::plain("post/antialias.cs.wesl");
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("history"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        Ok(Self { pipeline: ComputePipeline::new(gpu, library, &entry, &[], &[])?, sampler })
    }
}

impl Antialias {
    /// Room for a picture size, and where materials are unlit for their colour: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        (size, unlit): ([u32; 2], bool),
        room: &'r mut Option<AntialiasRoom>,
    ) -> &'r AntialiasRoom {
        let serves = |room: &AntialiasRoom| {
            let has = room.radiance.0[0].0.options();
            [has.width, has.height] == size && room.unlit.is_some() == unlit
        };
        chiaro_gpu::keep(room, serves, || {
            let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
            let lend = |name, format| {
                pool.lend(gpu, name, Life::Kept, TextureOptions::new(size[0], size[1], format, usage))
            };
            let two = |name| {
                let counted =
                    |_| (lend(name, TextureFormat::Rgba16Float), lend("remainders", TextureFormat::R32Uint));
                Mean([0, 1].map(counted))
            };
            let uniform = |_| {
                let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
                Buffer::new(gpu, "antialias", Life::Frame, size_of::<AntialiasData>() as u64, usage)
            };
            AntialiasRoom {
                radiance: two("antialiased"),
                unlit: unlit.then(|| two("antialiased_unlit")),
                turn: 0,
                uniforms: [0, 1].map(uniform),
            }
        })
    }

    /// Radiance, and the colour of unlit materials where there are any, as the mean of frames.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (radiance, unlit): (&Texture, Option<&Texture>),
        motion: &MotionOutputs,
        inputs: &AntialiasInputs,
        room: &mut AntialiasRoom,
    ) -> (Texture, Option<Texture>) {
        room.turn ^= 1;
        let means = [Some(&room.radiance), room.unlit.as_ref()];
        let mut results = [None, None];
        let layers = [Some(radiance), unlit].into_iter().zip(means).zip(&room.uniforms);
        for (number, ((layer, means), uniform)) in layers.enumerate() {
            let (Some(layer), Some(means)) = (layer, means) else { continue };
            let options = *layer.options();
            // The colour of unlit materials is stored as it is.
            let history_scale = if number == 0 { inputs.history_scale } else { 1.0 };
            let data = AntialiasData {
                size_px: [options.width, options.height],
                rests: u32::from(inputs.rests),
                history_scale,
                jitter_px: inputs.jitter_px,
                key: if number == 0 { KEY } else { UNLIT_KEY },
                reserved: 0,
            };
            frame.upload(uniform, &[data]);
            let [(now, remainders), (before, remainders_before)] =
                [room.turn, room.turn ^ 1].map(|turn| &means.0[turn]);
            let binds = [
                ("antialias", uniform.into()),
                ("radiance", layer.into()),
                ("motion", (&motion.motion).into()),
                ("seen", (&motion.seen).into()),
                ("history", before.into()),
                ("history_sampler", Binding::from(&self.sampler)),
                ("remainders_before", remainders_before.into()),
                ("result", now.into()),
                ("remainders", remainders.into()),
            ];
            let pixels = Dispatch::Threads([options.width, options.height, 1]);
            frame.compute("post/antialias", &self.pipeline, &[], &binds, pixels);
            results[number] = Some(now.clone());
        }
        let [mean, unlit] = results;
        (mean.unwrap_or_else(|| radiance.clone()), unlit)
    }
}
