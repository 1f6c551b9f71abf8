//! Which array, and where in it, each image of a scene goes to.

use chiaro_gpu::GpuError;
use chiaro_scene as cs;

use super::exact::{Run, SMALL};

/// Largest side of a size class, texels.
const MAX_SIDE: u32 = 4096;

/// Where a texture's pixels ended up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The packed word (see `texture.wesl`), without the bits that depend on the use.
    pub word: u32,
    /// Of textures that keep their texels: number of the first, width, height.
    pub exact: Option<[u32; 3]>,
}

/// What shaders may leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TextureFacts {
    /// Size classes in use.
    pub size_classes: u32,
    /// Whether any texture keeps its texels.
    pub exact: bool,
}

/// Which image goes where.
pub struct Shares {
    uses: Vec<[bool; 2]>,
    /// Of the size classes, ascending.
    pub sides: [u32; 3],
    /// Images of each array; one used by several textures is stored once.
    pub members: [Vec<cs::Id>; 6],
    /// Of sRGB and of linear images, in the first class' arrays after the images.
    pub runs: [Run; 2],
    // By texture and use: an array with the image's place in it, or the run with its first texel.
    places: Vec<[Option<Place>; 2]>,
}

#[derive(Clone, Copy)]
enum Place {
    Layer(usize, u32),
    Run(u64),
}

impl Shares {
    /// Shares out the images of a scene among arrays of at most `most_layers`, of sides up to `largest`.
    pub fn new(scene: &cs::Scene, largest: u32, most_layers: u32) -> Self {
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

    /// Layers of an array: sRGB small, medium, large, then linear.
    pub fn layers(&self, array: usize) -> u64 {
        let run = if array.is_multiple_of(3) { self.runs[array / 3].layers(self.sides[0]) } else { 0 };
        self.members[array].len() as u64 + run
    }

    /// That everything fits the arrays.
    pub fn check(&self, most_layers: u32) -> Result<(), GpuError> {
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

    /// What is in use.
    pub fn facts(&self) -> TextureFacts {
        let used = (0..3).rev().find(|&class| self.layers(class) + self.layers(class + 3) > 0);
        TextureFacts {
            size_classes: used.map_or(0, |class| class as u32 + 1),
            exact: self.runs.iter().any(|run| run.len() > 0),
        }
    }

    /// The words of `texture.wesl`.
    pub fn slots(&self, scene: &cs::Scene) -> Vec<[Option<Slot>; 2]> {
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
        assert_eq!(shares(scene(&large), 2048).sides, [512, 512, 2048]);
    }

    #[test]
    fn small_and_sharp_images_have_a_class_of_their_own_where_one_is_free() {
        let sizes = [(3, 1), (64, 64), (1024, 1024), (1024, 1024)];
        let mut scene = scene(&sizes);
        // Three texels and a mip of one.
        assert_eq!(shares(scene.clone(), 8192).sides, [2, 64, 1024]);
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
}
