//! An image of paths, sample by sample.

use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{Gpu, Life, Texture, TextureOptions};

/// Names of an image's sums, in the order of their textures; the last is there with photons alone.
pub(super) const LAYERS: [&str; 4] = ["sum", "squares", "direct", "caustics"];

/// Samples of an image so far.
#[derive(Clone, Debug)]
pub struct PathSum {
    // Two of each layer that take turns.
    pub(super) textures: [Vec<Texture>; 2],
    pub(super) newest: usize,
    pub(super) samples: u32,
    // Of the pass under way: rows that have its samples, and how many those are.
    pub(super) rows_done: u32,
    pub(super) under_way: u32,
}

impl PathSum {
    /// No samples; `photons`: with a layer for what light paths bring.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2], photons: bool) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING
            | TextureUsages::STORAGE_BINDING
            | TextureUsages::COPY_SRC
            | TextureUsages::COPY_DST;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba32Float, usage);
        let names = &LAYERS[..if photons { 4 } else { 3 }];
        let make = || names.iter().map(|name| Texture::new(gpu, name, Life::Kept, options)).collect();
        Self { textures: [make(), make()], newest: 0, samples: 0, rows_done: 0, under_way: 0 }
    }

    /// Width and height.
    pub fn size_px(&self) -> [u32; 2] {
        let options = self.sum().options();
        [options.width, options.height]
    }

    /// Samples that every pixel has.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Rows from the top that have more samples already, and how many; what can be read is without them.
    pub fn rows_ahead(&self) -> (u32, u32) {
        (self.rows_done, if self.rows_done > 0 { self.under_way } else { 0 })
    }

    /// Nits summed over samples, and coverage by surfaces in alpha.
    pub fn sum(&self) -> &Texture {
        &self.textures[self.newest][0]
    }

    /// Squares of the samples' nits, summed; with photons those of whole rounds, over the samples of a round.
    pub fn squares(&self) -> &Texture {
        &self.textures[self.newest][1]
    }

    /// Everything that more samples are added to, by names that stay: Rgba32Float all.
    pub fn layers(&self) -> impl Iterator<Item = (&'static str, &Texture)> {
        LAYERS.into_iter().zip(&self.textures[self.newest])
    }

    /// Says that the textures of [`PathSum::layers`] were filled with what so many samples left there.
    pub fn resume(&mut self, samples: u32) {
        (self.samples, self.rows_done) = (samples, 0);
    }
}
