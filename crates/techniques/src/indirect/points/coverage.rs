//! How much of a triangle is there: alpha on the CPU, at the finest mip, as rays see it.

use chiaro_scene as cs;
use glam::{Affine2, IVec2, Vec2};

use super::sequence::{Sequence, combined, corner_weights};
use crate::rays::TriangleRef;
use crate::scene::clusters::NO_EXTRAS;
use crate::scene::{Cut, material};

/// Places at which a triangle's alpha is looked at: two for each texel along a side, within these.
const FEWEST: u32 = 4;
const MOST: u32 = 64;

/// How materials cover their triangles.
pub(in crate::indirect) enum Cover<'a> {
    /// All of it carries points.
    All,
    /// None: light passes.
    None,
    /// Alpha says.
    Alpha(Alpha<'a>),
}

/// Alpha of a material.
pub(in crate::indirect) struct Alpha<'a> {
    factor: f32,
    /// Below this there is nothing; `None`: as much as alpha says.
    cutoff: Option<f32>,
    map: Option<Map<'a>>,
}

/// A texture on the CPU.
pub(in crate::indirect) struct Map<'a> {
    image: &'a cs::ImageData,
    texture: &'a cs::Texture,
    uv_set: usize,
    transform: Affine2,
}

impl<'a> Cover<'a> {
    pub fn new(scene: &'a cs::Scene, made_of: &cs::Material) -> Self {
        if material::transmission(made_of) > 0.0 {
            return Self::None;
        }
        Alpha::new(scene, made_of).map_or(Self::All, Self::Alpha)
    }
}

impl<'a> Alpha<'a> {
    /// `None` where a material covers all of its triangles.
    pub fn new(scene: &'a cs::Scene, made_of: &cs::Material) -> Option<Self> {
        let cutoff = match made_of.alpha {
            cs::AlphaMode::Opaque => return None,
            cs::AlphaMode::Mask { cutoff } if cutoff <= 0.0 => return None,
            cs::AlphaMode::Mask { cutoff } => Some(cutoff),
            cs::AlphaMode::Blend => None,
        };
        let map = made_of.base_color_texture.as_ref().map(|used| Map::new(scene, used));
        Some(Self { factor: made_of.base_color.w, cutoff, map })
    }

    /// What is known of a triangle's alpha.
    pub fn of(&'a self, cut: &Cut, triangle: &TriangleRef) -> Cutout<'a> {
        let [name, instance, _, packed] = triangle.word;
        let cluster = &cut.heap.clusters[(name >> 8) as usize];
        let word = |at: u32| cut.heap.words[at as usize];
        let corners = [0, 8, 16].map(|shift| packed >> shift & 0xff);
        let extras = cluster.extras != NO_EXTRAS;
        let uv = coordinates(cut, triangle, self.map.as_ref().map_or(0, |map| map.uv_set));
        let alpha = |corner: u32| {
            if extras { (word(cluster.extras + 3 * corner + 2) >> 24) as f32 / 255.0 } else { 1.0 }
        };
        Cutout { alpha: self, uv, factors: corners.map(alpha), key: combined(name, instance) }
    }
}

/// A triangle's texture coordinates of a set, corner by corner.
pub(in crate::indirect) fn coordinates(cut: &Cut, triangle: &TriangleRef, set: usize) -> [Vec2; 3] {
    let [name, _, _, packed] = triangle.word;
    let cluster = &cut.heap.clusters[(name >> 8) as usize];
    let word = |at: u32| f32::from_bits(cut.heap.words[at as usize]);
    let pair = |at: u32| Vec2::new(word(at), word(at + 1));
    [0, 8, 16].map(|shift| {
        let corner = packed >> shift & 0xff;
        if cluster.extras != NO_EXTRAS && set != 0 {
            pair(cluster.extras + 3 * corner)
        } else {
            pair(cluster.attributes + 4 * corner + 2)
        }
    })
}

/// Alpha over a triangle.
pub(in crate::indirect) struct Cutout<'a> {
    alpha: &'a Alpha<'a>,
    uv: [Vec2; 3],
    factors: [f32; 3],
    key: u32,
}

impl Cutout<'_> {
    /// How likely there is something at a place.
    pub fn share_at(&self, weights: [u16; 3]) -> f64 {
        let weights = weights.map(|weight| f32::from(weight) / 65_535.0);
        let mixed = |of: [f32; 3]| weights.iter().zip(of).map(|(weight, value)| weight * value).sum::<f32>();
        let mut alpha = self.alpha.factor * mixed(self.factors);
        if let Some(map) = &self.alpha.map {
            alpha *= map.alpha(Vec2::new(mixed(self.uv.map(|uv| uv.x)), mixed(self.uv.map(|uv| uv.y))));
        }
        match self.alpha.cutoff {
            Some(cutoff) => f64::from(u8::from(alpha >= cutoff)),
            None => f64::from(alpha.clamp(0.0, 1.0)),
        }
    }

    /// Places all over the triangle, always the same.
    pub fn places(&self) -> impl Iterator<Item = [u16; 3]> + Clone {
        let count = match &self.alpha.map {
            Some(map) => ((2.0 * map.texels(self.uv).sqrt()) as u32).clamp(FEWEST, MOST),
            None if self.factors == [self.factors[0]; 3] => 1,
            None => FEWEST,
        };
        let sequence = Sequence::new(self.key);
        (0..count).map(move |index| corner_weights(sequence.point(index)))
    }

    /// How much of the triangle is there.
    pub fn share(&self) -> f32 {
        let (sum, count) =
            self.places().fold((0.0, 0.0), |(sum, count), at| (sum + self.share_at(at), count + 1.0));
        if count > 0.0 { (sum / count) as f32 } else { 0.0 }
    }
}

impl<'a> Map<'a> {
    pub fn new(scene: &'a cs::Scene, used: &cs::TextureRef) -> Self {
        let texture = &scene.textures[used.texture];
        let image = &scene.images[texture.image];
        Self { image, texture, uv_set: used.uv_set, transform: used.uv_transform }
    }

    /// Which set of coordinates it goes by.
    pub fn uv_set(&self) -> usize {
        self.uv_set
    }

    /// Texels under a triangle.
    pub fn texels(&self, uv: [Vec2; 3]) -> f32 {
        let [a, b, c] = uv.map(|uv| {
            self.transform.transform_point2(uv) * Vec2::new(self.image.width as f32, self.image.height as f32)
        });
        0.5 * (b - a).perp_dot(c - a).abs()
    }

    fn alpha(&self, uv: Vec2) -> f32 {
        self.sampled(uv, |[.., alpha]| f32::from(alpha) / 255.0)
    }

    /// What of the finest texels' codes is asked for, filtered as the texture says.
    pub fn sampled(&self, uv: Vec2, of: impl Fn([u8; 4]) -> f32) -> f32 {
        let texel = |at: IVec2| of(self.texel(at));
        let size = Vec2::new(self.image.width as f32, self.image.height as f32);
        let at = self.transform.transform_point2(uv) * size;
        if self.texture.filter == cs::Filter::Nearest {
            return texel(floor(at));
        }
        let low = floor(at - 0.5);
        let f = at - 0.5 - low.as_vec2();
        let row = |y: i32| {
            let left = texel(low.wrapping_add(IVec2::new(0, y)));
            left + f.x * (texel(low.wrapping_add(IVec2::new(1, y))) - left)
        };
        let top = row(0);
        top + f.y * (row(1) - top)
    }

    fn texel(&self, at: IVec2) -> [u8; 4] {
        let [x, y] = [
            wrapped(at.x, self.image.width as i32, self.texture.wrap[0]),
            wrapped(at.y, self.image.height as i32, self.texture.wrap[1]),
        ];
        let first = 4 * (y * self.image.width as usize + x);
        let codes = self.image.rgba.get(first..first + 4);
        codes.map_or([255; 4], |codes| std::array::from_fn(|channel| codes[channel]))
    }
}

/// What processors without an instruction for it call a function for.
fn floor(v: Vec2) -> IVec2 {
    let towards_zero = v.as_ivec2();
    let above = towards_zero.as_vec2().cmpgt(v);
    towards_zero.wrapping_sub(IVec2::new(i32::from(above.x), i32::from(above.y)))
}

/// Of a texel that may lie outside.
fn wrapped(at: i32, count: i32, wrap: cs::Wrap) -> usize {
    let inside = match wrap {
        _ if (0..count).contains(&at) => at,
        cs::Wrap::Repeat => at.rem_euclid(count),
        cs::Wrap::Clamp => at.clamp(0, count - 1),
        cs::Wrap::Mirror => {
            let within = at.rem_euclid(2 * count);
            within.min(2 * count - 1 - within)
        }
    };
    inside as usize
}
