//! Any buffer of a frame as a picture, for eyes that look for mistakes.

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::TextureSampleType;
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Texture, TextureOptions,
};

use super::{Display, uniform};
use crate::shaders::{self, Viewed};

/// How a buffer's values become colours, in the order of `debug_view.cs.wesl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Nits after the scale, exposed like the picture.
    Exposed,
    /// Linear colours, 0..1 after the scale.
    Color,
    /// −1..1 around grey, such as normals.
    Signed,
    /// Metres: white is near, half as bright at 1/scale.
    Distance,
    /// Reversed depth: white is near.
    Depth,
    /// A colour for each whole number.
    Number,
}

/// Shows a texture's layer, or how many lights each froxel has.
#[derive(Debug)]
pub struct DebugView {
    // Numbers (depth, too), whole numbers; each plain and as an array.
    textures: [[ComputePipeline; 2]; 2],
    grid: ComputePipeline,
    input: Buffer,
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
        Ok(Self {
            textures: [pair(Viewed::Float)?, pair(Viewed::Integer)?],
            grid: make(Viewed::Grid, false)?,
            input: uniform::<[u32; 4]>(gpu, "debug_input"),
        })
    }

    /// Shows a layer of a texture (of a depth array: of shadow maps, how near to the light), stretched over `picture` (as [`Display::picture`] makes it). `display` has made this
    /// frame's picture, whose exposure it shares.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        (texture, layer): (&Texture, u32),
        (mapping, scale): (Mapping, f32),
        display: &Display,
        picture: &Texture,
    ) {
        let options = texture.options();
        let layer = layer.min(options.layers.unwrap_or(1) - 1);
        frame.upload(&self.input, &[[layer, mapping as u32, scale.to_bits(), 0]]);
        let kind = match options.format.sample_type(None, None) {
            Some(TextureSampleType::Uint | TextureSampleType::Sint) => 1,
            _ => 0,
        };
        let pipeline = &self.textures[kind][usize::from(options.layers.is_some())];
        let binds = [
            ("debug_input", (&self.input).into()),
            ("source", texture.into()),
            ("exposure", display.exposure().into()),
            ("picture", picture.into()),
        ];
        frame.compute("post/debug_view", pipeline, &[frame_group], &binds, over(picture.options()));
    }

    /// Shows how many lights may reach what each pixel shows: black none, then blue, red, yellow, and white from 16 on.
    pub fn record_grid(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        (depth, light_grid): (&Texture, &Buffer),
        picture: &Texture,
    ) {
        let binds = [("depth", depth.into()), ("light_grid", light_grid.into()), ("picture", picture.into())];
        frame.compute("post/debug_view", &self.grid, &[frame_group], &binds, over(picture.options()));
    }
}

fn over(options: &TextureOptions) -> Dispatch<'static> {
    Dispatch::Threads([options.width, options.height, 1])
}
