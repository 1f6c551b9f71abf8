//! The table of the specular lobe's directional albedo, made once per device by the BRDF's own sampling.

use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{ComputePipeline, Dispatch, Gpu, GpuError, Life, Recorder, Texture, TextureOptions};

use crate::{Kit, Pass, shaders};

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

/// The filled table, which group 0 holds.
#[derive(Clone, Debug)]
pub struct AlbedoTable {
    /// Rgba32Float; see `albedo_lookup` in `brdf.wesl`.
    pub texture: Texture,
}

impl Pass for AlbedoTable {
    type Key = ();

    /// Compiles the pipeline, and fills the table with it in a frame of its own.
    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let entry = shaders::plain("shared/albedo_table.cs.wesl");
        let pipeline = ComputePipeline::new(&kit.gpu, &kit.library, &entry, &[], &[])?;
        let texture = texture(&kit.gpu);
        let mut recorder = Recorder::new(&kit.gpu, false);
        let mut frame = recorder.begin();
        let groups = Dispatch::Groups([HEIGHT, 1, 1]);
        frame.compute("shared/albedo_table", &pipeline, &[], &[("table", (&texture).into())], groups);
        frame.submit();
        Ok(Self { texture })
    }
}
