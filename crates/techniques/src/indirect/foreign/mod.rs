//! Indirect light on surfaces that another program has drawn: what gathering reads is made of its textures, and what it adds to
//! its picture of what was gathered.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | surface | their depth, normals, albedo | `depth`, `surface`: see [`crate::view`] | a lane a pixel |
//! | radiance | `surface`, `irradiance` | `indirect_light` | the same |
//!
//! | texture | format | space, unit |
//! | --- | --- | --- |
//! | their depth | any that has depth, or R32Float | 0..1 either way; what is at the far plane is sky |
//! | their normals | xyz of floats, or (n + 1) / 2 | world; of any length |
//! | their albedo | rgb | linear Rec. 709, 0..1; one texel for all, or one a pixel |
//! | output: `indirect_light` | Rgba16Float: albedo · irradiance / π, at most 65,000; 0 | nits |
//!
//! # Depth
//! Of a perspective with the near plane at n and the far one at f, depth that is 1 near and 0 far is
//! t = (n / D − n / f) / (1 − n / f) at the distance D, and chiaro's, whose far plane is at infinity, n / D = t + (1 − t) n / f.
//! Of an orthographic camera both are the same.
//!
//! # Limits
//! Shading normals stand for those of the triangles, which nothing tells: where maps bend them, light from behind the
//! triangle may arrive, and what is in front of it may be missed. Albedo is held in 10 bits of its root.
//!
//! # Cost
//! 12 to 20 bytes a pixel read and 20 written, then 24 read and 8 written; at 1920 × 1080 and 3.3 TB/s 0.05 ms. Room: 28 bytes a
//! pixel.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Scale, Texture,
    TextureOptions, TexturePool, ViewHint,
};

use crate::{Kit, Pass, shaders};

const LIGHT: ViewHint =
    ViewHint::scaled("Indirect light that surfaces scatter", Mapping::Exposed, Scale::By(1.0));

/// See `surface.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct ForeignData {
    pub(crate) far_depth: f32,
    pub(crate) is_standard: u32,
    pub(crate) is_biased: u32,
    pub(crate) reserved: u32,
}

/// What another program has drawn.
#[derive(Clone, Copy, Debug)]
pub struct ForeignInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// Depth of any format.
    pub depth: &'a Texture,
    /// Whether that is 1 at the near plane.
    pub is_reversed: bool,
    /// Chiaro's depth of its far plane.
    pub far_depth: f32,
    /// World-space normals.
    pub normals: &'a Texture,
    /// Whether they are held as (n + 1) / 2.
    pub is_biased: bool,
    /// Linear albedo; one texel is that of everything.
    pub albedo: &'a Texture,
}

/// A surface buffer of one size, and light on it.
#[derive(Debug)]
pub struct ForeignRoom {
    /// R32Float, reversed.
    pub depth: Texture,
    /// Rgba32Uint; see `surface.wesl`.
    pub surface: Texture,
    /// Rgba16Float: albedo · irradiance / π, nits.
    pub light: Texture,
    uniform: Buffer,
}

/// The passes.
#[derive(Debug)]
pub struct Foreign {
    surface: ComputePipeline,
    radiance: ComputePipeline,
}

impl Pass for Foreign {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, .. } = kit;
        let make = |entry| ComputePipeline::new(gpu, library, &shaders::plain(entry), &[frame_layout], &[]);
        Ok(Self {
            surface: make("indirect/foreign/surface.cs.wesl")?,
            radiance: make("indirect/foreign/radiance.cs.wesl")?,
        })
    }
}

impl Foreign {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        [width, height]: [u32; 2],
        room: &'r mut Option<ForeignRoom>,
    ) -> &'r ForeignRoom {
        let serves = |room: &ForeignRoom| {
            let has = room.light.options();
            [has.width, has.height] == [width, height]
        };
        chiaro_gpu::keep(room, serves, || {
            let lend = |name, format| {
                let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
                pool.lend(gpu, name, Life::Frame, TextureOptions::new(width, height, format, usage))
            };
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            ForeignRoom {
                depth: lend("depth", TextureFormat::R32Float),
                surface: lend("surface", TextureFormat::Rgba32Uint),
                light: lend("indirect_light", TextureFormat::Rgba16Float).described(LIGHT),
                uniform: Buffer::new(gpu, "foreign", Life::Frame, size_of::<ForeignData>() as u64, usage),
            }
        })
    }

    /// Makes depth and surface of the room, all of which the textures cover.
    pub fn record_surface(&self, frame: &mut Frame<'_>, inputs: &ForeignInputs<'_>, room: &ForeignRoom) {
        let data = ForeignData {
            far_depth: inputs.far_depth,
            is_standard: u32::from(!inputs.is_reversed),
            is_biased: u32::from(inputs.is_biased),
            reserved: 0,
        };
        frame.upload(&room.uniform, &[data]);
        let binds = [
            ("foreign", (&room.uniform).into()),
            ("their_depth", inputs.depth.into()),
            ("their_normals", inputs.normals.into()),
            ("their_albedo", inputs.albedo.into()),
            ("depth", (&room.depth).into()),
            ("surface", (&room.surface).into()),
        ];
        frame.compute("indirect/foreign_surface", &self.surface, &[inputs.group], &binds, over(room));
    }

    /// Makes the room's light of gathered irradiance.
    pub fn record_radiance(
        &self,
        frame: &mut Frame<'_>,
        (group, irradiance): (&Group, &Texture),
        room: &ForeignRoom,
    ) {
        let binds = [
            ("surface", (&room.surface).into()),
            ("irradiance", irradiance.into()),
            ("indirect_light", (&room.light).into()),
        ];
        frame.compute("indirect/foreign_radiance", &self.radiance, &[group], &binds, over(room));
    }
}

fn over(room: &ForeignRoom) -> Dispatch<'static> {
    let options = room.light.options();
    Dispatch::Threads([options.width, options.height, 1])
}
