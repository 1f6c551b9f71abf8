//! Textures that keep their texels: sharp ones and small ones, one after the other in a run of texels.
//!
//! A run fills whole layers of the smallest size class, row by row, whatever the images' own sizes, so that nothing is
//! resampled and nothing lies beside anything; shaders find a texel by its number (`texture.wesl`). Smooth images bring
//! their mips along: each half as wide and high, rounded down, and the means of what lies under its texels.

use chiaro_scene as cs;

use super::srgb::{DECODE, encode};

/// Images of no more texels than this keep them even where they are smooth; larger ones are resampled where no size class
/// has their size, because filtering in shaders costs eight loads where a sampler takes one.
pub const SMALL: u64 = 1 << 16;

/// Images in a row, as light (sRGB) or as numbers.
#[derive(Debug, Default)]
pub struct Run {
    // Image, whether it has no mips, first texel.
    places: Vec<(cs::Id, bool, u64)>,
    texels: u64,
}

impl Run {
    /// The number of an image's first texel; appends it where it is new. `sharp` images have no mips.
    pub fn add(&mut self, scene: &cs::Scene, image: cs::Id, sharp: bool) -> u64 {
        let known = self.places.iter().find(|place| (place.0, place.1) == (image, sharp));
        if let Some((_, _, first)) = known {
            return *first;
        }
        let first = self.texels;
        self.places.push((image, sharp, first));
        self.texels +=
            sizes(&scene.images[image], sharp).map(|[w, h]| u64::from(w) * u64::from(h)).sum::<u64>();
        first
    }

    /// Texels in all.
    pub fn len(&self) -> u64 {
        self.texels
    }

    /// Layers of `side`² texels that it fills.
    pub fn layers(&self, side: u32) -> u64 {
        self.texels.div_ceil(u64::from(side).pow(2))
    }

    /// The power of two whose square holds it, but not more than `max`.
    pub fn side(&self, max: u32) -> u32 {
        let mut side = 1;
        while side < max && self.layers(side) > 1 {
            side *= 2;
        }
        side
    }

    /// Its texels, RGBA, with as many zeros after them as fill whole layers.
    pub fn rgba(&self, scene: &cs::Scene, srgb: bool, side: u32) -> Vec<u8> {
        let bytes = 4 * self.layers(side) * u64::from(side).pow(2);
        let mut all = Vec::with_capacity(bytes as usize);
        for &(image, sharp, _) in &self.places {
            let image = &scene.images[image];
            let mut before: Option<([u32; 2], Vec<u8>)> = None;
            for size in sizes(image, sharp) {
                let level = match before {
                    None => image.rgba.clone(),
                    Some((larger, pixels)) => shrunk(&pixels, larger, size, srgb),
                };
                all.extend_from_slice(&level);
                before = Some((size, level));
            }
        }
        all.resize(bytes as usize, 0);
        all
    }
}

/// Width and height of an image's levels.
fn sizes(image: &cs::ImageData, sharp: bool) -> impl Iterator<Item = [u32; 2]> {
    let levels = if sharp { 1 } else { image.width.max(image.height).ilog2() + 1 };
    let size = [image.width, image.height];
    (0..levels).map(move |level| size.map(|side| (side >> level).max(1)))
}

/// Means of what lies under each texel of a smaller image, of light and not of code values.
fn shrunk(pixels: &[u8], [width, height]: [u32; 2], size: [u32; 2], srgb: bool) -> Vec<u8> {
    // Texels under number `i` of `to`, with the share of each that lies there.
    let under = |i: u32, from: u32, to: u32| {
        let scale = from as f32 / to as f32;
        let (begin, end) = (i as f32 * scale, (i + 1) as f32 * scale);
        (begin as u32..(end.ceil() as u32).min(from)).map(move |texel| {
            let share = end.min((texel + 1) as f32) - begin.max(texel as f32);
            (texel, share / scale)
        })
    };
    let mut out = Vec::with_capacity(4 * (size[0] * size[1]) as usize);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let mut mean = [0.0f32; 4];
            for (row, high) in under(y, height, size[1]) {
                for (column, wide) in under(x, width, size[0]) {
                    let at = 4 * (row * width + column) as usize;
                    for (channel, (mean, &code)) in mean.iter_mut().zip(&pixels[at..at + 4]).enumerate() {
                        let value = if srgb && channel < 3 { DECODE[code as usize] } else { f32::from(code) };
                        *mean += value * wide * high;
                    }
                }
            }
            let code = |(channel, &mean): (usize, &f32)| {
                if srgb && channel < 3 { encode(mean.min(1.0)) } else { (mean + 0.5) as u8 }
            };
            out.extend(mean.iter().enumerate().map(code));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, texel: impl Fn(u32) -> [u8; 4]) -> cs::ImageData {
        let rgba = (0..width * height).flat_map(texel).collect();
        cs::ImageData { name: String::new(), width, height, rgba }
    }

    #[test]
    fn runs_hold_every_image_once_with_its_texels_and_mips() {
        let number = |i: u32| [i as u8, 0, 0, 255];
        let images = vec![image(3, 3, number), image(5, 2, number)];
        let scene = cs::Scene { images, ..cs::Scene::default() };
        let mut run = Run::default();
        let firsts =
            [(0, true), (1, false), (0, true), (0, false)].map(|(i, sharp)| run.add(&scene, i, sharp));
        // 3×3; 5×2, 2×1, 1×1; then 3×3, 1×1.
        assert_eq!(firsts, [0, 9, 0, 22]);
        assert_eq!((run.len(), run.side(64), run.layers(4)), (32, 8, 2));
        let texels = run.rgba(&scene, false, 8);
        assert_eq!(texels.len(), 4 * 64);
        let reds: Vec<_> = texels.chunks(4).map(|texel| texel[0]).collect();
        assert_eq!(reds[..9], [0, 1, 2, 3, 4, 5, 6, 7, 8]);
        // Two and a half texels of each of both rows, all ten, all nine.
        let means = [(0.0 + 1.0 + 1.0 + 5.0 + 6.0 + 3.5) / 5.0, (1.0 + 3.0 + 4.0 + 3.5 + 8.0 + 9.0) / 5.0];
        assert_eq!(reds[19..22], [(means[0] + 0.5f32) as u8, (means[1] + 0.5f32) as u8, 5]);
        assert_eq!(reds[31], 4);
    }

    #[test]
    fn mips_of_any_size_keep_the_light() {
        let source = image(7, 5, |i| if i % 3 == 0 { [255, 99, 20, 255] } else { [20, 99, 255, 180] });
        let light = |pixels: &[u8]| {
            pixels.chunks(4).map(|p| DECODE[p[0] as usize]).sum::<f32>() / (pixels.len() / 4) as f32
        };
        let smaller = shrunk(&source.rgba, [7, 5], [3, 2], true);
        assert!((light(&smaller) / light(&source.rgba) - 1.0).abs() < 0.01, "{}", light(&smaller));
        assert!(smaller.chunks(4).all(|p| p[1] == 99));
    }
}
