//! Caustics: light that came through mirrors and smooth glass alone, then is scattered by one surface.
//!
//! A technique of this family leaves a [`CausticLight`]: what arrives at each pixel, and from where on average. Shading gives it
//! to the surface's own BRDF in `direct/lighting.wesl`, as the part of the light `caustics` (`docs/glossary.md`). The light that
//! mirrors and glass keep from what stands behind them is shadow; caustics return it elsewhere.
//!
//! - [`photon_trace`]: photons by rays through the scene's trees, the exact twin of what is to come.
//! - [`Casters`]: what causes them, and where it stands.
//!
//! | output | format | unit |
//! | --- | --- | --- |
//! | `caustics`, layer 0 | Rgba16Float: irradiance / π; alpha: log2 of the view depth | nits · radiance scale; m |
//! | `caustics`, layer 1 | Rgba16Float: the mean of unit vectors towards the light, by brightness; alpha: photons | – |
//!
//! Limits of all: light from one direction for each pixel, so that gloss shows one highlight where there are several. What is
//! see-through receives none; what stands behind it and is seen through it does.

mod casters;
pub mod photon_trace;
mod settings;

use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{Bind, Gpu, Life, Texture, TextureOptions, TexturePool, ViewHint};

pub use casters::Casters;
pub use settings::{CausticFilter, CausticsSettings, Technique};

/// What caustics bring each pixel, as `lookup.wesl` reads it: the layers of the page above.
#[derive(Clone, Debug)]
pub struct CausticLight(pub Texture);

impl CausticLight {
    /// For a picture size.
    pub fn new(gpu: &Gpu, pool: &TexturePool, [width, height]: [u32; 2], hint: ViewHint) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba16Float, usage).array(2);
        Self(pool.lend(gpu, "caustics", Life::Frame, options).described(hint))
    }

    /// One texel, for frames that have none (`FrameData::CAUSTICS` is not set): it is not read.
    pub fn none(gpu: &Gpu) -> Self {
        let options = TextureOptions::new(1, 1, TextureFormat::Rgba16Float, TextureUsages::TEXTURE_BINDING);
        Self(Texture::new(gpu, "no_caustics", Life::Kept, options.array(2)))
    }

    /// What `lookup.wesl` binds.
    pub fn bind(&self) -> Bind<'_> {
        ("caustics", (&self.0).into())
    }
}
