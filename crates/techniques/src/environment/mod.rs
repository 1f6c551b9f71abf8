//! Radiance from infinitely far as background and as light: environment maps, and the uniform [`sky()`] of scenes that have
//! suns and no map.
//!
//! The diffuse part is the irradiance by second-order spherical harmonics (Ramamoorthi & Hanrahan 2001), summed over
//! the map on the CPU. The specular part is the split sum (Karis 2013, "Real Shading in Unreal Engine 4"): a cube map
//! whose mips are prefiltered by GGX lobes of growing roughness, times the directional albedo that `brdf.wesl` keeps.
//! A cube, because its filtering has no seam. The first mip is the map itself and the background.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | latitude-longitude radiance | environment (group 0) | Rgba16Float cube with mips | nits / [`EnvironmentMap::nits`] |
//! | the same | irradiance / π | 4×4 matrix per colour | nits |
//!
//! Stated biases: lobes are prefiltered for a viewer along the normal, so grazing reflections are not stretched; the
//! map casts no shadows, it is only dimmed as a whole where the eye sees little of the sky; harmonics of second order
//! are within 3 % on average and ring around a small bright sun. Half floats hold 30 octaves below the brightest texel.
//!
//! Cost: up to 2048² texels a face (400 MiB while it is made, half of that afterwards) for maps 4,096 pixels wide; a
//! few milliseconds of compute once per map; then one cube look-up per pixel.

mod harmonics;
mod settings;
mod sky;

pub use harmonics::{Harmonics, harmonics};
pub use settings::{EnvironmentSettings, Sky};
pub use sky::{sky, sky_light};

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Texture, TextureOptions, parallel,
};
use chiaro_scene as cs;
use glam::Vec3;

use crate::frame::environment_sampler;
use crate::shaders;

/// Sides of faces; the least still has enough mips to tell roughnesses apart.
const SIDES: std::ops::RangeInclusive<u32> = 128..=2048;
/// Side of the last mip's faces: the widest lobe needs no more.
const LAST_SIDE: u32 = 8;
/// What the brightest texel is stored as: half floats reach 65,504.
const PEAK_STORED: f32 = 32_768.0;

/// How much of an environment map's light arrives where the share `seen` of the upper half of all directions is sky: twice
/// that, at most all. A wall or the ground before the eye hides half of the sky from it, but none from what faces away from
/// the wall.
pub fn arriving(seen: f32) -> f32 {
    (2.0 * seen).min(1.0)
}

/// An environment on the GPU.
#[derive(Clone, Debug)]
pub struct EnvironmentMap {
    /// Rgba16Float cube; mip m holds roughness (m / last)^1.5.
    pub texture: Texture,
    /// Nits per stored unit, a power of two.
    pub nits: f32,
    /// Brightest channel of any texel, nits.
    pub peak: f32,
    /// Its light.
    pub harmonics: Harmonics,
}

impl EnvironmentMap {
    /// Uploads and prefilters a map; records the passes into `frame`.
    ///
    /// # Errors
    /// When the map is larger than the adapter's textures, or a shader does not compile.
    pub fn new(
        frame: &mut Frame<'_>,
        library: &Library,
        environment: &cs::Environment,
    ) -> Result<Self, GpuError> {
        let gpu = &frame.gpu().clone();
        let limit = gpu.limits.max_texture_dimension_2d;
        let needed = environment.width.max(environment.height);
        if needed > limit {
            return Err(GpuError::TooLarge {
                what: format!("the environment {}", environment.name),
                needed: needed.into(),
                limit: limit.into(),
                unit: "pixels a side",
                advice: "make the picture smaller",
            });
        }
        let peak = environment.radiance.iter().map(|nits| nits.max_element()).fold(0.0, f32::max);
        let nits =
            if peak > 0.0 { (peak / PEAK_STORED).log2().ceil().clamp(-100.0, 100.0).exp2() } else { 1.0 };
        let source = upload(gpu, environment, 1.0 / nits);
        // In the middle of a face a texel spans 2 / side rad, at the map's equator 2π / width.
        let wanted = (environment.width as f32 / std::f32::consts::PI) as u32;
        let side = wanted.next_power_of_two().clamp(*SIDES.start(), *SIDES.end());
        let mips = side.ilog2() - LAST_SIDE.ilog2() + 1;
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_DST;
        let cube = |name, mips, usage| {
            let options = TextureOptions::cube(side, mips, TextureFormat::Rgba16Float, usage);
            Texture::new(gpu, name, Life::Kept, options)
        };
        let plain = cube("environment_plain", side.ilog2() + 1, usage | TextureUsages::COPY_SRC);
        let texture = cube("environment", mips, usage);
        record(frame, library, (&source, &plain, &texture))?;
        Ok(Self { texture, nits, peak, harmonics: harmonics(environment) })
    }
}

fn upload(gpu: &Gpu, environment: &cs::Environment, scale: f32) -> Texture {
    let (width, height) = (environment.width, environment.height);
    let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
    let options = TextureOptions::new(width, height, TextureFormat::Rgba32Float, usage);
    let texture = Texture::new(gpu, "environment_source", Life::Kept, options);
    let texels: Vec<_> = environment.radiance.iter().map(|nits: &Vec3| (*nits * scale).extend(1.0)).collect();
    gpu.queue.write_texture(
        texture.raw().as_image_copy(),
        bytemuck::cast_slice(&texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(16 * width),
            rows_per_image: Some(height),
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    texture
}

/// Projects the map to `plain`, halves that mip by mip, and filters it into the mips of `texture`.
fn record(
    frame: &mut Frame<'_>,
    library: &Library,
    (source, plain, texture): (&Texture, &Texture, &Texture),
) -> Result<(), GpuError> {
    let gpu = frame.gpu().clone();
    let pipeline = |entry| ComputePipeline::new(&gpu, library, &shaders::plain(entry), &[], &[]);
    let (prefilter, (project, halve)) = parallel::join(
        || pipeline("environment/prefilter.cs.wesl"),
        || {
            parallel::join(
                || pipeline("environment/project.cs.wesl"),
                || pipeline("environment/halve.cs.wesl"),
            )
        },
    );
    let (prefilter, project, halve) = (prefilter?, project?, halve?);
    let sampler = environment_sampler(&gpu);
    let side = plain.options().width;
    let over = |mip: u32| Dispatch::Threads([(side >> mip).max(1), (side >> mip).max(1), 6]);
    for target in [plain, texture] {
        let binds = [("source", source.into()), ("cube", Binding::Mip(target, 0))];
        frame.compute("environment/project", &project, &[], &binds, over(0));
    }
    for mip in 1..plain.options().mips {
        let binds = [("finer", Binding::Mip(plain, mip - 1)), ("cube", Binding::Mip(plain, mip))];
        frame.compute("environment/halve", &halve, &[], &binds, over(mip));
    }
    let last = texture.options().mips - 1;
    for mip in 1..=last {
        // Wider lobes need more samples, and have fewer texels.
        let roughness = (mip as f32 / last as f32).powf(1.5);
        let lobe = Lobe { roughness, samples: (32 << mip).min(1024), ..Lobe::default() };
        let lobe = Buffer::with_data(&gpu, "lobe", &[lobe], BufferUsages::UNIFORM);
        let binds = [
            ("lobe", (&lobe).into()),
            ("plain", plain.into()),
            ("plain_sampler", (&sampler).into()),
            ("cube", Binding::Mip(texture, mip)),
        ];
        frame.compute("environment/prefilter", &prefilter, &[], &binds, over(mip));
    }
    Ok(())
}

/// Twin of `Lobe` in `prefilter.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Lobe {
    pub(crate) roughness: f32,
    pub(crate) samples: u32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
}
