//! Pictures and radiance on textures of a host program.

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::TextureFormat;
use chiaro_gpu::{
    Attachment, Buffer, Draw, Frame, Gpu, GpuError, RenderPipeline, RenderPipelineOptions, Targets, Texture,
};

use super::{Summed, no_unlit, uniform};
use crate::shaders;

/// What a target of some format takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presented {
    /// The picture's sRGB code values as they are.
    Codes,
    /// The picture's colours, which the target turns into the same code values.
    Colors,
    /// Radiance in nits, with 1 nit for the white of unlit materials, up to the largest half float.
    Radiance,
}

impl Presented {
    /// By the target's format; `None` where it takes neither pictures nor radiance.
    pub fn by_format(format: TextureFormat) -> Option<Self> {
        match format {
            TextureFormat::Rgba8Unorm | TextureFormat::Bgra8Unorm => Some(Self::Codes),
            TextureFormat::Rgba8UnormSrgb | TextureFormat::Bgra8UnormSrgb => Some(Self::Colors),
            TextureFormat::Rgba16Float => Some(Self::Radiance),
            _ => None,
        }
    }
}

/// Draws pictures, or their radiance, onto render targets of one format.
#[derive(Debug)]
pub struct Present {
    pipeline: RenderPipeline,
    what: Presented,
    input: Buffer,
    no_unlit: Texture,
}

impl Present {
    /// Compiles the pass.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        format: TextureFormat,
        what: Presented,
    ) -> Result<Self, GpuError> {
        let targets = [format.into()];
        let constants = [("WHAT", f64::from(what as u32))];
        let options =
            RenderPipelineOptions { targets: &targets, constants: &constants, ..Default::default() };
        let pipeline =
            RenderPipeline::new(gpu, library, &shaders::plain("post/present.vs.wesl"), &[], &options)?;
        Ok(Self { pipeline, what, input: uniform::<[u32; 4]>(gpu, "present"), no_unlit: no_unlit(gpu) })
    }

    /// What its targets take.
    pub fn what(&self) -> Presented {
        self.what
    }

    /// Covers a target with the picture of a sum, or with the sum's mean.
    pub fn record(&self, frame: &mut Frame<'_>, picture: &Texture, sum: &Summed<'_>, target: &Texture) {
        frame.upload(&self.input, &[[(sum.frames.max(1) as f32).to_bits(), 0, 0, 0]]);
        let source = if self.what == Presented::Radiance { sum.nits } else { picture };
        let binds = [
            ("present", (&self.input).into()),
            ("picture", source.into()),
            ("unlit", sum.unlit.unwrap_or(&self.no_unlit).into()),
        ];
        let color =
            [Attachment { texture: target, layer: 0, clear: Some(Default::default()), resolve: None }];
        frame.render("post/present", Targets { color: &color, depth: None }, |pass| {
            pass.draw(&self.pipeline, &[], &binds, Draw::FullScreen);
        });
    }
}
