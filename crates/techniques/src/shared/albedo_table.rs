//! The table of the specular lobe's directional albedo, made once per device by the BRDF's own sampling.

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Texture, TextureOptions};

use crate::shaders;

/// Cosines, as many as the shader's workgroup has lanes.
const WIDTH: u32 = 64;
/// Roughnesses.
const HEIGHT: u32 = 32;

/// The table's texture, still empty.
pub fn texture(gpu: &Gpu) -> Texture {
    let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
    let options = TextureOptions::new(WIDTH, HEIGHT, TextureFormat::Rgba32Float, usage);
    Texture::new(gpu, "albedo_table", Life::Kept, options)
}

/// Fills the table.
///
/// # Errors
/// When the shader does not compile.
pub fn record(frame: &mut Frame<'_>, library: &Library, table: &Texture) -> Result<(), GpuError> {
    let entry = shaders::plain("shared/albedo_table.cs.wesl");
    let pipeline = ComputePipeline::new(frame.gpu(), library, &entry, &[], &[])?;
    let groups = Dispatch::Groups([HEIGHT, 1, 1]);
    frame.compute("shared/albedo_table", &pipeline, &[], &[("table", table.into())], groups);
    Ok(())
}
