//! Any texture or buffer of a frame as a picture, for eyes that look for mistakes.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{BufferUsages, TextureSampleType};
use chiaro_gpu::{
    Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Handle, Life,
    Mapping, Texture,
};

use super::{Display, uniform};
use crate::shaders::{self, Viewed};

/// Bytes of a buffer that are shown.
const SHOWN_BYTES: u64 = 1 << 20;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct DebugInput {
    pub layer: u32,
    pub mapping: u32,
    pub scale: f32,
    pub words: u32,
    pub columns: u32,
    pub reserved0: u32,
    pub reserved1: u32,
    pub reserved2: u32,
}

/// Shows a texture's layer, or a buffer's words.
#[derive(Debug)]
pub struct DebugView {
    // Numbers (depth, too), whole numbers; each plain and as an array.
    textures: [[ComputePipeline; 2]; 2],
    multisampled: ComputePipeline,
    words: ComputePipeline,
    input: Buffer,
    copy: Buffer,
}

impl DebugView {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(gpu: &Gpu, library: &Library, frame_layout: &GroupLayout) -> Result<Self, GpuError> {
        let make = |what, array| {
            ComputePipeline::new(gpu, library, &shaders::debug_view(what, array), &[frame_layout], &[])
        };
        let pair = |what| -> Result<_, GpuError> { Ok([make(what, false)?, make(what, true)?]) };
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        Ok(Self {
            textures: [pair(Viewed::Float)?, pair(Viewed::Integer)?],
            multisampled: make(Viewed::Multisampled, false)?,
            words: make(Viewed::Words, false)?,
            input: uniform::<DebugInput>(gpu, "debug_input"),
            copy: Buffer::new(gpu, "debug_words", Life::Frame, SHOWN_BYTES, usage),
        })
    }

    /// Shows a layer of a texture (the first sample of a multisampled one) or the first words of a buffer, stretched over
    /// `picture` (as [`Display::picture`] makes it). `display` has made this frame's picture, whose exposure it shares.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        (what, layer): (&Handle, u32),
        (mapping, scale): (Mapping, f32),
        display: &Display,
        picture: &Texture,
    ) {
        let into = *picture.options();
        let mut input =
            DebugInput { layer: 0, mapping: mapping as u32, scale, columns: 1, ..DebugInput::zeroed() };
        let (pipeline, source): (_, Binding<'_>) = match what {
            Handle::Texture(texture) => {
                let options = texture.options();
                input.layer = layer.min(options.layers.unwrap_or(1) - 1);
                let whole = options.format.sample_type(None, None) == Some(TextureSampleType::Uint);
                let pipeline = if options.samples > 1 {
                    &self.multisampled
                } else {
                    &self.textures[usize::from(whole)][usize::from(options.layers.is_some())]
                };
                // A cube's faces are layers here.
                (pipeline, if options.cube { Binding::Mip(texture, 0) } else { texture.into() })
            }
            Handle::Buffer(buffer) => {
                let bytes = buffer.raw().size().min(SHOWN_BYTES);
                frame.copy((buffer, 0), (&self.copy, 0), bytes);
                input.words = (bytes / 4) as u32;
                let aspect = into.width as f32 / into.height as f32;
                input.columns = ((input.words as f32 * aspect).sqrt().ceil() as u32).clamp(1, input.words);
                (&self.words, (&self.copy).into())
            }
        };
        frame.upload(&self.input, &[input]);
        let binds = [
            ("debug_input", (&self.input).into()),
            ("source", source),
            ("exposure", display.exposure().into()),
            ("picture", picture.into()),
        ];
        let pixels = Dispatch::Threads([into.width, into.height, 1]);
        frame.compute("post/debug_view", pipeline, &[frame_group], &binds, pixels);
    }
}
