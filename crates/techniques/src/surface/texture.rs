//! Material textures in six 2D arrays: three size classes, each as sRGB and as linear.
//!
//! WebGPU has neither binding arrays nor more than 16 sampled textures a stage, so pixels share arrays. The three
//! sides are chosen per scene, from the sizes its images have, so that the fewest texels are added; an image that is
//! no square of one of these sides is resampled to it. Mips are box-filtered in linear light.

use chiaro_gpu::wgpu;
use chiaro_gpu::{Gpu, GpuError, Life, Texture, TextureOptions};
use chiaro_scene as cs;
use image::imageops::{FilterType, resize};
use rayon::prelude::*;

/// Largest side of a size class, texels.
const MAX_SIDE: u32 = 4096;
/// WebGPU guarantees this many array layers.
const MAX_LAYERS: usize = 256;

/// Where each texture's pixels ended up, for packing into materials.
#[derive(Debug, Default)]
pub struct TextureSlots {
    // [srgb, linear] per scene texture.
    slots: Vec<[Option<u32>; 2]>,
}

impl TextureSlots {
    /// The packed word of a texture (see `texture.wesl`), without the bits that depend on the use.
    pub fn slot(&self, texture: cs::Id, linear: bool) -> Option<u32> {
        self.slots.get(texture).and_then(|slots| slots[usize::from(linear)])
    }
}

/// The six arrays in binding order, the slots of the scene's textures, and how many size classes they use.
///
/// # Errors
/// When the scene has more images of a kind than an array has layers.
pub fn upload(gpu: &Gpu, scene: &cs::Scene) -> Result<(Vec<Texture>, TextureSlots, u32), GpuError> {
    let uses = uses(scene);
    let sides = size_classes(scene, &uses, gpu.limits.max_texture_dimension_2d.min(MAX_SIDE));
    let mut slots = TextureSlots { slots: vec![[None; 2]; scene.textures.len()] };
    // Images of each array; an image used by several textures is stored once.
    let mut members: [Vec<cs::Id>; 6] = Default::default();
    for (texture, used) in scene.textures.iter().zip(&uses).enumerate().map(|(i, (t, u))| ((i, t), u)) {
        let (index, texture) = texture;
        for linear in [false, true] {
            if !used[usize::from(linear)] {
                continue;
            }
            let class = class_of(&scene.images[texture.image], &sides);
            let array = class + if linear { 3 } else { 0 };
            let layer =
                members[array].iter().position(|&image| image == texture.image).unwrap_or_else(|| {
                    members[array].push(texture.image);
                    members[array].len() - 1
                });
            let wrap = texture.wrap.map(|wrap| match wrap {
                cs::Wrap::Repeat => 0,
                cs::Wrap::Mirror => 1,
                cs::Wrap::Clamp => 2,
            });
            slots.slots[index][usize::from(linear)] = Some(
                class as u32
                    | u32::from(linear) << 2
                    | (layer as u32) << 3
                    | wrap[0] << 11
                    | wrap[1] << 13
                    | u32::from(texture.filter == cs::Filter::Nearest) << 15,
            );
        }
    }
    if let Some(too_many) = members.iter().map(Vec::len).find(|&count| count > MAX_LAYERS) {
        return Err(GpuError::TooLarge {
            what: "the scene's textures of one size class".into(),
            needed: too_many as u64,
            limit: MAX_LAYERS as u64,
            unit: "layers",
            advice: "merge textures into fewer images",
        });
    }
    let arrays = members.iter().enumerate().map(|(array, images)| {
        let side = if images.is_empty() { 1 } else { sides[array % 3] };
        array_of(gpu, scene, images, side, array < 3)
    });
    let classes = (0..3).rev().find(|&class| !members[class].is_empty() || !members[class + 3].is_empty());
    Ok((arrays.collect(), slots, classes.map_or(0, |class| class as u32 + 1)))
}

/// Whether each texture is used as sRGB, as linear.
fn uses(scene: &cs::Scene) -> Vec<[bool; 2]> {
    let mut uses = vec![[false; 2]; scene.textures.len()];
    for m in &scene.materials {
        let color = [&m.base_color_texture, &m.emissive_texture, &m.specular_color_texture];
        let linear = [
            &m.metallic_roughness_texture,
            &m.normal_texture,
            &m.occlusion_texture,
            &m.specular_texture,
            &m.transmission_texture,
            &m.thickness_texture,
        ];
        for reference in color.into_iter().flatten() {
            uses[reference.texture][0] = true;
        }
        for reference in linear.into_iter().flatten() {
            uses[reference.texture][1] = true;
        }
    }
    uses
}

/// The power of two that holds an image's longer side.
fn side(image: &cs::ImageData, max: u32) -> u32 {
    image.width.max(image.height).next_power_of_two().min(max)
}

/// Three ascending sides for the images in use: each image goes to the smallest that holds it, the largest holds all,
/// and the choice adds the fewest texels.
fn size_classes(scene: &cs::Scene, uses: &[[bool; 2]], max: u32) -> [u32; 3] {
    let max = 1 << max.ilog2();
    let mut images: Vec<cs::Id> = scene
        .textures
        .iter()
        .zip(uses)
        .filter(|(_, used)| used.contains(&true))
        .map(|(texture, _)| texture.image)
        .collect();
    images.sort_unstable();
    images.dedup();
    let sides: Vec<u32> = images.iter().map(|&image| side(&scene.images[image], max)).collect();
    let mut distinct = sides.clone();
    distinct.sort_unstable();
    distinct.dedup();
    let largest = distinct.last().copied().unwrap_or(1);
    let cost = |classes: [u32; 3]| -> u64 {
        let fit = |side: u32| classes.into_iter().find(|&class| class >= side).unwrap_or(largest);
        sides.iter().map(|&side| u64::from(fit(side)).pow(2)).sum()
    };
    // Fewer classes are as good where they add no texels: an image goes to the first that holds it.
    let mut best = [largest; 3];
    for (i, &small) in distinct.iter().enumerate() {
        for &medium in &distinct[i..] {
            if cost([small, medium, largest]) < cost(best) {
                best = [small, medium, largest];
            }
        }
    }
    best
}

fn class_of(image: &cs::ImageData, sides: &[u32; 3]) -> usize {
    let wanted = side(image, sides[2]);
    sides.iter().position(|&side| side >= wanted).unwrap_or(2)
}

fn array_of(gpu: &Gpu, scene: &cs::Scene, images: &[cs::Id], side: u32, srgb: bool) -> Texture {
    let format = if srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let mips = side.ilog2() + 1;
    let options = TextureOptions { mips, ..TextureOptions::new(side, side, format, usage) };
    let texture =
        Texture::new(gpu, "material textures", Life::Kept, options.array(images.len().max(1) as u32));
    // All cores make mips; as many images at once lie in memory.
    for (batch, images) in images.chunks(rayon::current_num_threads()).enumerate() {
        let pyramid = |&image: &cs::Id| {
            let first = squared(&scene.images[image], side, srgb);
            let coarser = |finer: &Vec<u8>| {
                let side = (finer.len() as u32 / 4).isqrt();
                (side > 1).then(|| halved(finer, side, srgb))
            };
            std::iter::successors(Some(first), coarser).collect::<Vec<_>>()
        };
        let pyramids: Vec<_> = images.par_iter().map(pyramid).collect();
        let first_layer = batch * rayon::current_num_threads();
        let pictures = (first_layer..).zip(&pyramids);
        let all =
            pictures.flat_map(|(layer, pyramid)| (0..).zip(pyramid).map(move |(mip, p)| (layer, mip, p)));
        for (layer, mip, pixels) in all {
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

static DECODE: std::sync::LazyLock<[f32; 256]> = std::sync::LazyLock::new(|| {
    std::array::from_fn(|code| {
        let c = code as f32 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
});

/// The nearest sRGB code of a linear value in 0..1.
fn encode(linear: f32) -> u8 {
    let encoder = &*ENCODE;
    let mut code = encoder.first[(linear * (STEPS - 1) as f32) as usize];
    while linear >= encoder.starts[usize::from(code) + 1] {
        code += 1;
    }
    code
}

/// Steps of linear values, short enough to hold few codes each.
const STEPS: usize = 1 << 12;

/// The power function by table, which would else be most of the time that mips take.
struct Encoder {
    /// The code of the least value of each step.
    first: Vec<u8>,
    /// The least value of each code; infinity after the last.
    starts: [f32; 257],
}

static ENCODE: std::sync::LazyLock<Encoder> = std::sync::LazyLock::new(|| {
    let mut starts = [f32::INFINITY; 257];
    starts[0] = 0.0;
    for code in 1..=255u8 {
        // Positive floats are in the order of their bits.
        let (mut below, mut from) = (0, 1.0f32.to_bits());
        while from - below > 1 {
            let middle = u32::midpoint(below, from);
            if encode_exactly(f32::from_bits(middle)) < code { below = middle } else { from = middle }
        }
        starts[usize::from(code)] = f32::from_bits(from);
    }
    let first = (0..STEPS).map(|step| encode_exactly(step as f32 / (STEPS - 1) as f32)).collect();
    Encoder { first, starts }
});

fn encode_exactly(linear: f32) -> u8 {
    let code = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (code * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(sides: &[(u32, u32)]) -> cs::Scene {
        let mut scene = cs::Scene::default();
        for (i, &(width, height)) in sides.iter().enumerate() {
            let rgba = vec![128; (4 * width * height) as usize];
            scene.images.push(cs::ImageData { name: i.to_string(), width, height, rgba });
            scene.textures.push(cs::Texture {
                image: i,
                wrap: [cs::Wrap::Repeat; 2],
                filter: cs::Filter::Linear,
            });
        }
        scene
    }

    #[test]
    fn size_classes_hold_every_image_and_waste_least() {
        let scene = scene(&[(16, 16), (64, 20), (64, 64), (256, 256), (200, 100)]);
        let uses = vec![[true, false]; 5];
        assert_eq!(size_classes(&scene, &uses, 4096), [16, 64, 256]);
        assert_eq!(size_classes(&scene, &uses, 128), [16, 64, 128]);
    }

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
    fn the_table_of_codes_is_the_power_function() {
        let around = |x: f32| [x.next_down().max(0.0), x, x.next_up().min(1.0)];
        let steps = (0..=1 << 18).map(|i| i as f32 / (1 << 18) as f32);
        for x in steps.chain(ENCODE.starts[1..256].iter().copied()).flat_map(around) {
            assert_eq!(encode(x), encode_exactly(x), "{x}");
        }
    }

    #[test]
    fn mips_average_light_not_codes() {
        // Black and white texels: half the light is sRGB code 188, not 128.
        let pixels = [[0, 0, 0, 255], [255; 4], [255; 4], [0, 0, 0, 255]].concat();
        assert_eq!(halved(&pixels, 2, true), [188, 188, 188, 255]);
        assert_eq!(halved(&pixels, 2, false), [128, 128, 128, 255]);
    }
}
