//! An image of paths, sample by sample.

use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{Gpu, Life, Texture, TextureOptions};

/// Names of an image's sums, in the order of their layers in `trace.cs.wesl`: that of the picture is a pair of floats.
const SUMS: [&str; 5] = ["sum", "squares", "direct", "caustics", "sum.low"];

/// Samples of an image so far.
#[derive(Clone, Debug)]
pub struct PathSum {
    // Two arrays that take turns, and the first layer of each.
    pub(super) textures: [Texture; 2],
    first: [Texture; 2],
    pub(super) newest: usize,
    pub(super) samples: u32,
    // Of the pass under way: rows that have its samples, and how many those are.
    pub(super) rows_done: u32,
    pub(super) under_way: u32,
}

impl PathSum {
    /// No samples.
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2]) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING
            | TextureUsages::STORAGE_BINDING
            | TextureUsages::COPY_SRC
            | TextureUsages::COPY_DST;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba32Float, usage);
        let options = options.array(SUMS.len() as u32);
        let textures = [0, 1].map(|_| Texture::new(gpu, "sums", Life::Kept, options));
        let first = textures.each_ref().map(|sums| sums.first_layer("sum"));
        Self { textures, first, newest: 0, samples: 0, rows_done: 0, under_way: 0 }
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

    /// Nits summed over samples, and coverage by surfaces in alpha: the first of [`PathSum::layers`] alone.
    pub fn sum(&self) -> &Texture {
        &self.first[self.newest]
    }

    /// All layers.
    pub(super) fn sums(&self) -> &Texture {
        &self.textures[self.newest]
    }

    /// Everything that more samples are added to, by names that stay, as layers of a texture: Rgba32Float all. What
    /// `sum.low` holds is to be added to `sum`, which is their sum rounded. Squares are those of the samples' nits; with
    /// photons those of whole rounds, over the samples of a round.
    pub fn layers(&self) -> impl Iterator<Item = (&'static str, &Texture, u32)> {
        SUMS.into_iter().zip(0..).map(|(name, layer)| (name, self.sums(), layer))
    }

    /// Says that [`PathSum::layers`] were filled with what so many samples left there.
    pub fn resume(&mut self, samples: u32) {
        (self.samples, self.rows_done) = (samples, 0);
    }
}
