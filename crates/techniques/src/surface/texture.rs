//! Material textures in six 2D arrays: three size classes, each as sRGB and as linear.
//!
//! WebGPU has neither binding arrays nor more than 16 sampled textures a stage, so pixels share arrays. The three
//! sides are chosen per scene, from the sizes its images have, so that the fewest texels are added; a large image that is
//! no square of one of these sides is resampled to it. Sharp images, and small ones that no class fits, keep their texels
//! ([`super::exact`]). Mips are box-filtered in linear light.

use chiaro_gpu::wgpu;
use chiaro_gpu::{Gpu, GpuError, Life, Texture, TextureOptions};
use chiaro_scene as cs;
use image::imageops::{FilterType, resize};
use rayon::prelude::*;

use super::exact::{Run, SMALL};

/// Largest side of a size class, texels.
const MAX_SIDE: u32 = 4096;
/// Layers that the word in `texture.wesl` can name.
const MAX_LAYERS: u32 = 1 << 12;

/// Where a texture's pixels ended up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The packed word (see `texture.wesl`), without the bits that depend on the use.
    pub word: u32,
    /// Of textures that keep their texels: number of the first, width, height.
    pub exact: Option<[u32; 3]>,
}

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

/// What shaders may leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextureFacts {
    /// Size classes in use.
    pub size_classes: u32,
    /// Whether any texture keeps its texels.
    pub exact: bool,
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

/// Which image goes where.
struct Shares {
    uses: Vec<[bool; 2]>,
    // Ascending.
    sides: [u32; 3],
    // Images of each array; one used by several textures is stored once.
    members: [Vec<cs::Id>; 6],
    // Of sRGB and of linear images, after the images of the first class.
    runs: [Run; 2],
    // By texture and use: an array with the image's place in it, or the run with its first texel.
    places: Vec<[Option<Place>; 2]>,
}

#[derive(Clone, Copy)]
enum Place {
    Layer(usize, u32),
    Run(u64),
}

impl Shares {
    fn new(scene: &cs::Scene, largest: u32, most_layers: u32) -> Self {
        let max = 1 << largest.min(MAX_SIDE).ilog2();
        let uses = uses(scene);
        let smooth = scene.textures.iter().zip(&uses);
        let smooth = smooth.filter(|(t, used)| used.contains(&true) && t.filter == cs::Filter::Linear);
        let mut images: Vec<_> = smooth.map(|(texture, _)| texture.image).collect();
        images.sort_unstable();
        images.dedup();
        images.retain(|&image| fits(&scene.images[image], max) || !is_small(&scene.images[image]));
        let sides: Vec<u32> = images.iter().map(|&image| side(&scene.images[image], max)).collect();
        let mut shares = Self {
            uses,
            sides: size_classes(&sides),
            members: Default::default(),
            runs: Default::default(),
            places: Vec::new(),
        };
        shares.place(scene, most_layers);
        // Runs lie in the first class: a class of their own where one is free, and one that is not far too small.
        if shares.run_side(max) > 0 && (images.is_empty() || shares.sides[0] == shares.sides[1]) {
            shares.sides[0] = shares.run_side(max).min(if images.is_empty() { max } else { shares.sides[0] });
            shares.sides = shares.sides.map(|side| side.max(shares.sides[0]));
            shares.place(scene, most_layers);
        }
        while shares.run_side(max) > 4 * shares.sides[0] {
            let least = shares.run_side(max) / 4;
            shares.sides = shares.sides.map(|side| side.max(least));
            shares.place(scene, most_layers);
        }
        shares
    }

    /// Side of the layer that would hold the longer run, 0 where both are empty.
    fn run_side(&self, max: u32) -> u32 {
        self.runs.iter().filter(|run| run.len() > 0).map(|run| run.side(max)).max().unwrap_or(0)
    }

    fn place(&mut self, scene: &cs::Scene, most_layers: u32) {
        self.members = Default::default();
        self.runs = Default::default();
        self.places = vec![[None; 2]; scene.textures.len()];
        for (index, texture) in scene.textures.iter().enumerate() {
            for linear in [0, 1] {
                if self.uses[index][linear] {
                    self.places[index][linear] = Some(self.place_of(scene, texture, linear, most_layers));
                }
            }
        }
    }

    fn place_of(
        &mut self,
        scene: &cs::Scene,
        texture: &cs::Texture,
        linear: usize,
        most_layers: u32,
    ) -> Place {
        let image = &scene.images[texture.image];
        let sharp = texture.filter == cs::Filter::Nearest;
        let fitting = self.sides.contains(&image.width) && image.width == image.height;
        if sharp || (is_small(image) && !fitting) {
            return Place::Run(self.runs[linear].add(scene, texture.image, sharp));
        }
        let wanted = side(image, self.sides[2]);
        let first = self.sides.iter().position(|&side| side >= wanted).unwrap_or(2);
        let equal = (first..3).filter(|&class| self.sides[class] == self.sides[first]);
        let arrays: Vec<_> = equal.map(|class| class + 3 * linear).collect();
        let known = arrays.iter().find_map(|&array| {
            let layer = self.members[array].iter().position(|&member| member == texture.image)?;
            Some(Place::Layer(array, layer as u32))
        });
        known.unwrap_or_else(|| {
            let room = |array: &&usize| self.members[**array].len() < most_layers as usize;
            let array = arrays.iter().find(room).or(arrays.last()).copied().unwrap_or(2 + 3 * linear);
            self.members[array].push(texture.image);
            Place::Layer(array, self.members[array].len() as u32 - 1)
        })
    }

    fn layers(&self, array: usize) -> u64 {
        let run = if array % 3 == 0 { self.runs[array / 3].layers(self.sides[0]) } else { 0 };
        self.members[array].len() as u64 + run
    }

    fn check(&self, most_layers: u32) -> Result<(), GpuError> {
        let too_large = |what: String, needed: u64, limit: u64, unit| {
            let advice = "merge textures into fewer images";
            Err(GpuError::TooLarge { what, needed, limit, unit, advice })
        };
        for array in 0..6 {
            if self.layers(array) > u64::from(most_layers) {
                let side = self.sides[array % 3];
                let what = format!("the scene's textures of {side}×{side} texels");
                // All arrays of that side are full.
                let same =
                    (0..3).filter(|&class| self.sides[class] == side).map(|class| class + array / 3 * 3);
                let (needed, arrays) = same.fold((0, 0), |(n, a), array| (n + self.layers(array), a + 1));
                return too_large(what, needed, arrays * u64::from(most_layers), "layers");
            }
        }
        let longest = self.runs.iter().map(Run::len).max().unwrap_or(0);
        if longest > u64::from(u32::MAX) {
            return too_large("the scene's sharp textures".into(), longest, u64::from(u32::MAX), "texels");
        }
        Ok(())
    }

    fn facts(&self) -> TextureFacts {
        let used = (0..3).rev().find(|&class| self.layers(class) + self.layers(class + 3) > 0);
        TextureFacts {
            size_classes: used.map_or(0, |class| class as u32 + 1),
            exact: self.runs.iter().any(|run| run.len() > 0),
        }
    }

    /// The words of `texture.wesl`.
    fn slots(&self, scene: &cs::Scene) -> Vec<[Option<Slot>; 2]> {
        let slot = |texture: &cs::Texture, linear: usize, place: Place| {
            let image = &scene.images[texture.image];
            let (class, layer, exact) = match place {
                Place::Layer(array, layer) => (array % 3, layer, None),
                Place::Run(first) => {
                    let layer = self.members[3 * linear].len() as u32;
                    (0, layer, Some([first as u32, image.width, image.height]))
                }
            };
            let wrap = texture.wrap.map(|wrap| match wrap {
                cs::Wrap::Repeat => 0,
                cs::Wrap::Mirror => 1,
                cs::Wrap::Clamp => 2,
            });
            let word = class as u32
                | (linear as u32) << 2
                | layer << 3
                | wrap[0] << 15
                | wrap[1] << 17
                | u32::from(texture.filter == cs::Filter::Nearest) << 19
                | u32::from(exact.is_some()) << 22;
            Slot { word, exact }
        };
        let textures = scene.textures.iter().zip(&self.places);
        let slots = |(texture, places): (&cs::Texture, &[Option<Place>; 2])| {
            [0, 1].map(|linear| places[linear].map(|place| slot(texture, linear, place)))
        };
        textures.map(slots).collect()
    }
}

fn is_small(image: &cs::ImageData) -> bool {
    u64::from(image.width) * u64::from(image.height) <= SMALL
}

/// Whether an image can be a layer as it is.
fn fits(image: &cs::ImageData, max: u32) -> bool {
    image.width == image.height && image.width.is_power_of_two() && image.width <= max
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

/// Three ascending sides for images of these sides: each image goes to the smallest that holds it, the largest holds all,
/// and the choice adds the fewest texels.
fn size_classes(sides: &[u32]) -> [u32; 3] {
    let mut distinct = sides.to_vec();
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

fn array_of(gpu: &Gpu, scene: &cs::Scene, shares: &Shares, array: usize, side: u32) -> Texture {
    let srgb = array < 3;
    let images = &shares.members[array];
    let format = if srgb { wgpu::TextureFormat::Rgba8UnormSrgb } else { wgpu::TextureFormat::Rgba8Unorm };
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let mips = side.ilog2() + 1;
    let options = TextureOptions { mips, ..TextureOptions::new(side, side, format, usage) };
    let layers = shares.layers(array).max(1) as u32;
    let texture = Texture::new(gpu, "material textures", Life::Kept, options.array(layers));
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
    if array % 3 == 0 {
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

pub(super) static DECODE: std::sync::LazyLock<[f32; 256]> = std::sync::LazyLock::new(|| {
    std::array::from_fn(|code| {
        let c = code as f32 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
});

/// The nearest sRGB code of a linear value in 0..1.
pub(super) fn encode(linear: f32) -> u8 {
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

    fn shares(mut scene: cs::Scene, max: u32) -> Shares {
        for texture in 0..scene.textures.len() {
            let base_color_texture = Some(cs::TextureRef::new(texture));
            scene.materials.push(cs::Material { base_color_texture, ..cs::Material::default() });
        }
        Shares::new(&scene, max, 256)
    }

    #[test]
    fn size_classes_hold_every_image_and_waste_least() {
        assert_eq!(size_classes(&[16, 64, 64, 256, 256]), [16, 64, 256]);
        assert_eq!(size_classes(&[]), [1; 3]);
        let large = [(512, 512), (2048, 600), (2048, 2048), (4096, 4096), (4000, 3000)];
        assert_eq!(shares(scene(&large), 8192).sides, [512, 2048, 4096]);
        assert_eq!(shares(scene(&large), 2048).sides, [512, 2048, 2048]);
    }

    #[test]
    fn small_and_sharp_images_have_a_class_of_their_own_where_one_is_free() {
        let sizes = [(3, 1), (64, 64), (1024, 1024), (1024, 1024)];
        let mut scene = scene(&sizes);
        assert_eq!(shares(scene.clone(), 8192).sides, [64, 1024, 1024]);
        scene.textures[3].filter = cs::Filter::Nearest;
        scene.textures[1].image = 2;
        let shares = shares(scene, 8192);
        assert_eq!(shares.sides, [1024; 3]);
        assert_eq!((shares.layers(0), shares.layers(1), shares.runs[0].len()), (3, 0, (1 << 20) + 4));
    }

    #[test]
    fn more_images_of_a_size_than_layers_share_the_arrays_of_that_size() {
        let sides = vec![(64, 64); 700];
        let full = shares(scene(&sides), 8192);
        assert_eq!([0, 1, 2].map(|array| full.layers(array)), [256, 256, 188]);
        full.check(256).unwrap();
        let sides = vec![(64, 64); 1000];
        let message = shares(scene(&sides), 8192).check(256).unwrap_err().to_string();
        assert!(
            message.contains("64×64") && message.contains("1000 layers") && message.contains("768"),
            "{message}"
        );
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
