//! Places on what glows, chosen on the CPU once for a scene.

use chiaro_scene as cs;
use glam::{Vec2, Vec3};
use rayon::prelude::*;

use crate::indirect::points::coverage::{Alpha, Cutout, Map, coordinates};
use crate::indirect::points::sequence::{Sequence, corner_weights, unit};
use crate::rays::{TriangleRef, cluster_triangles};
use crate::scene::srgb::DECODE;
use crate::scene::{Cut, material};

/// Places of a pool: those of sixteen frames of a still with 256 lights are all others.
const PLACES: u32 = 4096;
/// Places at which a textured triangle is looked at: four a texel, within these.
const FEWEST: u32 = 16;
const MOST: u32 = 1 << 16;
/// Luminance of linear Rec. 709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// What names a place to shaders: cluster << 8 | triangle; instance; shares of the second and third corner in 16 bits.
type Place = [u32; 3];

/// Places on glowing triangles, chosen by luminance × area as they stand in a pose: of any 2ᵏ in a row, wherever they begin,
/// each lies in another of 2ᵏ parts of it.
#[derive(Clone, Debug, Default)]
pub struct GlowData {
    pub(super) places: Vec<Place>,
    /// Luminance × area of all, from both sides where it has two, nits · m².
    pub glow: f64,
}

/// How a material glows.
struct Glow<'a> {
    nits: f32,
    sides: f32,
    map: Option<Map<'a>>,
    alpha: Option<Alpha<'a>>,
}

/// How a triangle glows, in shares of its material.
struct Shines<'g> {
    of: &'g Glow<'g>,
    uv: [Vec2; 3],
    cutout: Option<Cutout<'g>>,
}

/// A triangle that glows.
struct Piece {
    triangle: TriangleRef,
    weight: f64,
}

impl GlowData {
    /// Chooses places on all that glows in a pose.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        if !scene.materials.iter().any(material::glows) {
            return Self::default();
        }
        let cut = Cut::new(scene, pose);
        let glows: Vec<_> = scene.materials.iter().map(|material| Glow::new(scene, material)).collect();
        let of = |triangle: &TriangleRef| &glows[triangle.material as usize];
        let drawn = cut.drawn.iter().flat_map(|drawn| {
            let instance = drawn.instance;
            drawn.clusters.clone().map(move |cluster| (cluster, instance))
        });
        let drawn: Vec<_> = drawn
            .filter(|(cluster, _)| glows[cut.heap.clusters[*cluster].material as usize].nits > 0.0)
            .collect();
        let pieces: Vec<Piece> = drawn
            .par_iter()
            .flat_map_iter(|&(cluster, instance)| cluster_triangles(scene, &cut, cluster, instance))
            .map(|triangle| {
                let [a, b, c] = triangle.corners;
                let area = 0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length();
                let share = of(&triangle).on(&cut, &triangle).mean();
                let weight = area * share * f64::from(of(&triangle).nits * of(&triangle).sides);
                Piece { triangle, weight: if weight.is_finite() { weight } else { 0.0 } }
            })
            .collect();
        let ends: Vec<f64> = pieces
            .iter()
            .scan(0.0, |end, piece| {
                *end += piece.weight;
                Some(*end)
            })
            .collect();
        let Some(&glow) = ends.last().filter(|glow| **glow > 0.0 && glow.is_finite()) else {
            return Self::default();
        };
        let sequence = Sequence::new(0);
        let mut wanted: Vec<(usize, u32, f64)> = (0..PLACES)
            .map(|index| {
                let at = glow * unit(sequence.first(index));
                let number = ends.partition_point(|end| *end <= at).min(ends.len() - 1);
                let left = (1.0 - (ends[number] - at) / pieces[number].weight).clamp(0.0, 1.0);
                (number, index, left)
            })
            .collect();
        wanted.sort_unstable_by_key(|&(number, index, _)| (number, index));
        let placed = wanted.par_chunk_by(|a, b| a.0 == b.0).flat_map_iter(|own| {
            let triangle = &pieces[own[0].0].triangle;
            let [name, instance, ..] = triangle.word;
            let shines = of(triangle).on(&cut, triangle);
            let spots = shines.spots();
            own.iter().map(move |&(_, index, left)| {
                let [_, second, third] = match spots.last() {
                    None => corner_weights([left, unit(sequence.second(index))]),
                    Some((all, _)) => {
                        spots[spots.partition_point(|(end, _)| *end <= left * all).min(spots.len() - 1)].1
                    }
                };
                (index, [name, instance, u32::from(second) | u32::from(third) << 16])
            })
        });
        let mut placed: Vec<(u32, Place)> = placed.collect();
        placed.sort_unstable_by_key(|&(index, _)| index);
        Self { places: placed.into_iter().map(|(_, place)| place).collect(), glow }
    }
}

impl<'a> Glow<'a> {
    fn new(scene: &'a cs::Scene, made_of: &cs::Material) -> Self {
        Self {
            nits: made_of.emissive.max(Vec3::ZERO).dot(LUMINANCE),
            sides: if made_of.double_sided { 2.0 } else { 1.0 },
            map: made_of.emissive_texture.as_ref().map(|used| Map::new(scene, used)),
            alpha: Alpha::new(scene, made_of),
        }
    }

    fn on(&'a self, cut: &Cut, triangle: &TriangleRef) -> Shines<'a> {
        let uv = self.map.as_ref().map_or([Vec2::ZERO; 3], |map| coordinates(cut, triangle, map.uv_set()));
        Shines { of: self, uv, cutout: self.alpha.as_ref().map(|alpha| alpha.of(cut, triangle)) }
    }
}

impl Shines<'_> {
    /// How much of the material's glow there is at a place: what is there, by the texture's luminance.
    fn share_at(&self, weights: [u16; 3]) -> f64 {
        let there = self.cutout.as_ref().map_or(1.0, |cutout| cutout.share_at(weights));
        let Some(map) = &self.of.map else { return there };
        let at = self.uv.iter().zip(weights).map(|(uv, weight)| *uv * (f32::from(weight) / 65_535.0)).sum();
        let luminance = |[red, green, blue, _]: [u8; 4]| {
            Vec3::new(DECODE[red as usize], DECODE[green as usize], DECODE[blue as usize]).dot(LUMINANCE)
        };
        there * f64::from(map.sampled(at, luminance))
    }

    /// Places all over the triangle, always the same; none where all of it glows alike.
    fn places(&self) -> impl Iterator<Item = [u16; 3]> + use<> {
        let texels = self.of.map.as_ref().map(|map| map.texels(self.uv));
        let own = texels.map_or(0, |texels| ((4.0 * texels) as u32).clamp(FEWEST, MOST));
        let holes = self.cutout.as_ref().map_or(0, |cutout| cutout.places().count() as u32);
        let sequence = Sequence::new(0);
        (0..own.max(holes)).map(move |index| corner_weights(sequence.point(index)))
    }

    /// The mean over the triangle.
    fn mean(&self) -> f64 {
        let (sum, count) =
            self.places().fold((0.0, 0.0), |(sum, count), at| (sum + self.share_at(at), count + 1.0));
        if count > 0.0 { sum / count } else { 1.0 }
    }

    /// Places that glow, each with the sum of shares up to and with it.
    fn spots(&self) -> Vec<(f64, [u16; 3])> {
        let lit = self.places().scan(0.0, |end, at| {
            *end += self.share_at(at);
            Some((*end, at))
        });
        lit.collect()
    }
}
