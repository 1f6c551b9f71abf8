//! What the program has drawn.

use chiaro_gpu::{Gpu, Life, Texture, TextureOptions, wgpu};
use glam::Mat4;
use wgpu::{TextureFormat, TextureSampleType, TextureUsages};

use crate::{Depth, Error};

/// Surfaces as a program has drawn them: its camera, and textures of one size that its shaders could read.
#[derive(Clone, Copy, Debug)]
pub struct DrawnSurfaces<'a> {
    /// World → the camera's axes, metres: as [`View::from_matrices`](crate::View::from_matrices) takes it.
    pub view_from_world: Mat4,
    /// The camera's axes → clip space, alike.
    pub clip_from_view: Mat4,
    /// Which way depth runs. What is at the far plane is sky, and gets no light.
    pub depth_runs: Depth,
    /// Of any depth format, seen in its depth alone, or R32Float.
    pub depth: &'a wgpu::TextureView,
    /// World-space normals in xyz, towards where surfaces are seen from; in 8 or 10 unsigned bits as (n + 1) / 2, else as they are.
    pub normals: &'a wgpu::TextureView,
    /// Linear Rec. 709 as shaders read it, 0..1. Without it the light is that of white surfaces: irradiance / π.
    pub albedo: Option<&'a wgpu::TextureView>,
}

impl DrawnSurfaces<'_> {
    pub(super) fn size_px(&self) -> [u32; 2] {
        size(self.depth)
    }

    pub(super) fn has_biased_normals(&self) -> bool {
        is_biased(self.normals.texture().format())
    }

    /// Refuses what shaders cannot read as what it stands for.
    pub(super) fn check(&self) -> Result<(), Error> {
        let is_depth = |format: TextureFormat| format.has_depth_aspect() || format == TextureFormat::R32Float;
        let is_normal = |format| is_biased(format) || is_signed(format);
        let is_color = |format: TextureFormat| {
            let is_float = matches!(format.sample_type(None, None), Some(TextureSampleType::Float { .. }));
            is_float && format.components() >= 3
        };
        let wanted = self.size_px();
        check(("depth", "a depth format or R32Float"), (self.depth, wanted), is_depth)?;
        let formats = "Rgba8Snorm, Rgba16Float, Rgba32Float, Rgba8Unorm or Rgb10a2Unorm";
        check(("normals", formats), (self.normals, wanted), is_normal)?;
        self.albedo.map_or(Ok(()), |albedo| {
            check(("albedo", "a format of three or four floats"), (albedo, wanted), is_color)
        })
    }
}

fn is_biased(format: TextureFormat) -> bool {
    matches!(format, TextureFormat::Rgba8Unorm | TextureFormat::Bgra8Unorm | TextureFormat::Rgb10a2Unorm)
}

fn is_signed(format: TextureFormat) -> bool {
    use TextureFormat::{Rgba8Snorm, Rgba16Float, Rgba16Snorm, Rgba32Float};
    matches!(format, Rgba8Snorm | Rgba16Snorm | Rgba16Float | Rgba32Float)
}

fn size(view: &wgpu::TextureView) -> [u32; 2] {
    [view.texture().width(), view.texture().height()]
}

fn check(
    (name, formats): (&'static str, &str),
    (view, wanted): (&wgpu::TextureView, [u32; 2]),
    serves: impl Fn(TextureFormat) -> bool,
) -> Result<(), Error> {
    let texture = view.texture();
    let (format, [width, height]) = (texture.format(), size(view));
    let problem = if !serves(format) {
        format!("its format is {format:?}; it takes {formats}")
    } else if !texture.usage().contains(TextureUsages::TEXTURE_BINDING) {
        format!("its usage lacks TEXTURE_BINDING; it has {:?}", texture.usage())
    } else if texture.sample_count() != 1 {
        format!("it has {} samples a pixel instead of 1", texture.sample_count())
    } else if texture.dimension() != wgpu::TextureDimension::D2 {
        format!("it is {:?} instead of D2", texture.dimension())
    } else if [width, height] != wanted {
        format!("it has {width}×{height} pixels, and the depth {}×{}", wanted[0], wanted[1])
    } else {
        return Ok(());
    };
    Err(Error::Unread { texture: name, problem })
}

/// Handles of the program's textures, kept so that what binds them is found again.
#[derive(Debug)]
pub(super) struct HeldTextures {
    held: [Option<Texture>; 3],
    white: wgpu::TextureView,
}

impl HeldTextures {
    pub fn new(gpu: &Gpu) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
        let options = TextureOptions::new(1, 1, TextureFormat::Rgba8Unorm, usage);
        let white = Texture::new(gpu, "white", Life::Kept, options);
        let extent = wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 };
        let layout = wgpu::TexelCopyBufferLayout::default();
        gpu.queue.write_texture(white.raw().as_image_copy(), &[255; 4], layout, extent);
        Self { held: [None, None, None], white: white.view().clone() }
    }

    /// Depth, normals, albedo.
    pub fn hold(&mut self, drawn: &DrawnSurfaces<'_>) -> [&Texture; 3] {
        let albedo = drawn.albedo.unwrap_or(&self.white);
        let named =
            [("their_depth", drawn.depth), ("their_normals", drawn.normals), ("their_albedo", albedo)];
        let mut slots = self.held.iter_mut().zip(named);
        std::array::from_fn(|_| {
            let Some((slot, (name, view))) = slots.next() else { unreachable!("there are three of each") };
            let serves = |has: &Texture| has.view() == view;
            &*chiaro_gpu::keep(slot, serves, || Texture::read_of_host(name, view))
        })
    }
}
