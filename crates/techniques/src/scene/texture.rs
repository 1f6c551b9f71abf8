//! Material textures in six 2D arrays: three size classes, each as sRGB and as linear.
//!
//! WebGPU has neither binding arrays nor more than 16 sampled textures a stage, so pixels share arrays. The three
//! sides are chosen per scene, from the sizes its images have, so that the fewest texels are added; a large image that is
//! no square of one of these sides is resampled to it. Sharp images, and small ones that no class fits, keep their texels
//! (`exact.rs`). Mips are box-filtered in linear light.

use chiaro_gpu::wgpu;
use chiaro_gpu::{Gpu, GpuError, Life, Texture, TextureOptions};
use chiaro_scene as cs;
use image::imageops::{FilterType, resize};
use rayon::prelude::*;

use super::shares::Shares;
pub use super::shares::{Slot, TextureFacts};
use super::srgb::{DECODE, encode};

/// Layers that the word in `texture.wesl` can name.
const MAX_LAYERS: u32 = 1 << 12;

/// Where each texture's pixels ended up, for packing into materials.
#[derive(Debug, Default)]
pub struct TextureSlots {
    // [srgb, linear] per scene texture.
    slots: Vec<[Option<Slot>; 2]>,
}

impl TextureSlots {
    /// Where a texture is found as sRGB or as linear numbers.
    pub fn slot(&self, texture: cs::Id, linear: bool) -> Option<Slot> {
        self.slots.get(texture).and_then(|slots| slots[usize::from(linear)])
    }
}

/// The six arrays in binding order, the slots of the scene's textures, and what is in use.
///
/// # Errors
/// When the scene has more images of a kind than an array has layers.
pub fn upload(gpu: &Gpu, scene: &cs::Scene) -> Result<(Vec<Texture>, TextureSlots, TextureFacts), GpuError> {
    let limits = &gpu.limits;
    let most_layers = limits.max_texture_array_layers.min(MAX_LAYERS);
    let share = Shares::new(scene, limits.max_texture_dimension_2d, most_layers);
    share.check(most_layers)?;
    let arrays = (0..6).map(|array| {
        let side = if share.layers(array) == 0 { 1 } else { share.sides[array % 3] };
        array_of(gpu, scene, &share, array, side)
    });
    let arrays = arrays.collect();
    let facts = share.facts();
    let slots = TextureSlots { slots: share.slots(scene) };
    Ok((arrays, slots, facts))
}

fn array_of(gpu: &Gpu, scene: &cs::Scene, shares: &Shares, array: usize, side: u32) -> Texture {
    let srgb = array < 3;
    let images = &shares.members[array];
    let format = if srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let mips = side.ilog2() + 1;
    let options = TextureOptions { mips, ..TextureOptions::new(side, side, format, usage) };
    let layers = shares.layers(array).max(1) as u32;
    let texture = Texture::new(gpu, "material_textures", Life::Kept, options.array(layers));
    let write = |mip: u32, layer: usize, pixels: &[u8]| {
        let side = side >> mip;
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: texture.raw(),
                mip_level: mip,
                origin: wgpu::Origin3d { x: 0, y: 0, z: layer as u32 },
                aspect: wgpu::TextureAspect::All,
            },
            pixels,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * side),
                rows_per_image: Some(side),
            },
            wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
        );
    };
    // All cores make mips; as many images at once lie in memory.
    let at_once = rayon::current_num_threads();
    for (batch, members) in images.chunks(at_once).enumerate() {
        let pyramid = |&image: &cs::Id| {
            let first = squared(&scene.images[image], side, srgb);
            let coarser = |finer: &Vec<u8>| {
                let side = (finer.len() as u32 / 4).isqrt();
                (side > 1).then(|| halved(finer, side, srgb))
            };
            std::iter::successors(Some(first), coarser).collect::<Vec<_>>()
        };
        let pyramids: Vec<_> = members.par_iter().map(pyramid).collect();
        for (layer, pyramid) in (batch * at_once..).zip(&pyramids) {
            for (mip, pixels) in (0..).zip(pyramid) {
                write(mip, layer, pixels);
            }
        }
    }
    if array.is_multiple_of(3) {
        let texels = shares.runs[array / 3].rgba(scene, srgb, side);
        for (layer, texels) in texels.chunks(4 * (side as usize).pow(2)).enumerate() {
            write(0, images.len() + layer, texels);
        }
    }
    texture
}

/// An image's pixels at `side` × `side`: of light, and not of code values.
fn squared(image: &cs::ImageData, side: u32, srgb: bool) -> Vec<u8> {
    if image.width == side && image.height == side {
        return image.rgba.clone();
    }
    let value = |(i, &code): (usize, &u8)| {
        if srgb && i % 4 < 3 { DECODE[code as usize] } else { f32::from(code) / 255.0 }
    };
    let values = image.rgba.par_iter().enumerate().map(value).collect();
    let source: Option<image::Rgba32FImage> = image::ImageBuffer::from_raw(image.width, image.height, values);
    // The scene guarantees 4 bytes a pixel, so white is never shown.
    let Some(source) = source else { return vec![255; 4 * (side * side) as usize] };
    let code = |(i, &value): (usize, &f32)| {
        let value = value.clamp(0.0, 1.0);
        if srgb && i % 4 < 3 { encode(value) } else { (value * 255.0 + 0.5) as u8 }
    };
    resize(&source, side, side, FilterType::CatmullRom).par_iter().enumerate().map(code).collect()
}

/// The next mip: means of 2×2 texels, of light and not of code values.
fn halved(pixels: &[u8], side: u32, srgb: bool) -> Vec<u8> {
    let half = (side / 2) as usize;
    let row = 4 * side as usize;
    let mut out = vec![0; 4 * half * half];
    let rows = out.par_chunks_exact_mut(4 * half).zip(pixels.par_chunks_exact(2 * row));
    rows.with_min_len(16).for_each(|(out, rows)| {
        for (i, out) in out.iter_mut().enumerate() {
            let (at, channel) = (8 * (i / 4), i % 4);
            let texels = [at, at + 4, at + row, at + row + 4].map(|at| rows[at + channel]);
            *out = if srgb && channel < 3 {
                let mean = texels.map(|t| DECODE[t as usize]).iter().sum::<f32>() / 4.0;
                encode(mean)
            } else {
                ((texels.iter().map(|&t| u32::from(t)).sum::<u32>() + 2) / 4) as u8
            };
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resampling_keeps_the_light() {
        let rgba = (0..48 * 20).flat_map(|i| [if i / 3 % 2 == 0 { 255 } else { 20 }, 99, 0, 180]).collect();
        let image = cs::ImageData { name: String::new(), width: 48, height: 20, rgba };
        let light = |pixels: &[u8]| {
            pixels.chunks(4).map(|p| DECODE[p[0] as usize]).sum::<f32>() / (pixels.len() / 4) as f32
        };
        let pixels = squared(&image, 64, true);
        // Overshoot beyond white and black is cut off; resampled codes would lose a tenth.
        assert!((light(&pixels) / light(&image.rgba) - 1.0).abs() < 0.01, "{}", light(&pixels));
        assert!(pixels.chunks(4).all(|p| p[1..] == [99, 0, 180]));
        assert!(squared(&image, 64, false).chunks(4).all(|p| p[1..] == [99, 0, 180]));
    }

    #[test]
    fn mips_average_light_not_codes() {
        // Black and white texels: half the light is sRGB code 188, not 128.
        let pixels = [[0, 0, 0, 255], [255; 4], [255; 4], [0, 0, 0, 255]].concat();
        assert_eq!(halved(&pixels, 2, true), [188, 188, 188, 255]);
        assert_eq!(halved(&pixels, 2, false), [128, 128, 128, 255]);
    }
}
