//! Choosing the points: on the CPU, once for a scene.

use std::sync::atomic::{AtomicU64, Ordering};

use chiaro_scene as cs;
use glam::Vec3;
use rayon::prelude::*;

use super::coverage::{Cover, Cutout};
use super::sequence::{Sequence, combined, corner_weights, unit};
use crate::rays::{TriangleRef, cluster_triangles};
use crate::scene::{Cut, InstanceData};

/// What names a point to shaders: cluster << 8 | triangle; instance | exponent of the area << 24; shares of the second and
/// third corner in 16 bits.
pub(crate) type Source = [u32; 3];

/// Exponents of areas stay below this.
const EXPONENTS: u32 = 16;
/// A place with a hole is drawn anew so often at most, then is one that is known to have none.
const TRIES: u32 = 64;
/// Points that a thread places in a row.
const RUN: usize = 2048;
/// No point.
const NONE: u32 = u32::MAX;
/// Where points are whose triangle is not finite, metres; twin of `NOWHERE` in `point.wesl`.
pub(super) const NOWHERE: Vec3 = Vec3::splat(1e15);

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// Which points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointOptions {
    /// How many.
    pub points: u32,
    /// What random numbers start from.
    pub seed: u32,
    /// Fewer far away.
    pub thinning: Option<Thinning>,
}

impl Default for PointOptions {
    fn default() -> Self {
        Self { points: 1 << 21, seed: 0, thinning: None }
    }
}

/// Points far from a place are fewer, by the square of the distance, and stand for as much more area: for scenes so large
/// that most of their area is far from the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// The place, world space.
    pub eye_ws: Vec3,
    /// Up to this distance all are there, metres.
    pub from_m: f32,
}

impl Thinning {
    /// Of the area that a triangle's points stand for, by its nearest place, in powers of two.
    fn exponent(&self, corners: &[Vec3; 3]) -> u32 {
        let middle = corners.iter().sum::<Vec3>() / 3.0;
        let around = corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f32::max);
        let distance = (middle.distance(self.eye_ws) - around) / self.from_m;
        ((2.0 * distance.max(1.0).log2()) as u32).min(EXPONENTS - 1)
    }
}

/// Points of a scene, chosen on the CPU by any thread.
#[derive(Clone, Debug)]
pub struct PointData {
    pub(super) id: u64,
    pub(crate) sources: Vec<Source>,
    /// Area that carries points, m².
    pub area_m2: f64,
    /// Area that a point stands for where all are there, m²; 0 without points.
    pub point_m2: f64,
    options: PointOptions,
    fingerprint: u64,
}

impl PointData {
    /// Chooses points on all that a scene draws, evenly by area as it stands in a pose.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose, options: PointOptions) -> Self {
        let (cut, fingerprint) = rayon::join(|| Cut::new(scene, pose), || scene.fingerprint());
        let chosen = Surfaces::new(scene, &cut, options).and_then(|surfaces| surfaces.choose());
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        let Chosen { sources, area_m2, point_m2 } = chosen.unwrap_or_default();
        Self { id, sources, area_m2, point_m2, options, fingerprint }
    }

    /// How many there are: as many as were asked for, or none where nothing has area.
    pub fn len(&self) -> u32 {
        self.sources.len() as u32
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// How they were chosen.
    pub fn options(&self) -> &PointOptions {
        &self.options
    }

    /// Whether these are the points of a scene of this fingerprint, in whatever pose. Thinned ones serve views from up to a
    /// quarter of [`Thinning::from_m`] away.
    pub fn serves(&self, fingerprint: u64, options: &PointOptions) -> bool {
        let near = match (&self.options.thinning, &options.thinning) {
            (None, None) => true,
            (Some(has), Some(wanted)) => {
                has.from_m == wanted.from_m
                    && has.eye_ws.distance(wanted.eye_ws) <= 0.25 * wanted.from_m.max(0.0)
            }
            _ => false,
        };
        let Self { options: PointOptions { points, seed, thinning: _ }, .. } = *self;
        near && self.fingerprint == fingerprint && (points, seed) == (options.points, options.seed)
    }

    /// Position and normal of each point in a pose of its scene, world space, as `update.cs.wesl` finds them.
    pub fn places(&self, scene: &cs::Scene, pose: &cs::Pose) -> Vec<(Vec3, Vec3)> {
        let cut = Cut::new(scene, pose);
        self.sources.par_iter().map(|source| place(scene, &cut, source)).collect()
    }
}

fn place(scene: &cs::Scene, cut: &Cut, &[name, instance, shares]: &Source) -> (Vec3, Vec3) {
    let instance = instance & 0xff_ffff;
    let mut triangles = cluster_triangles(scene, cut, (name >> 8) as usize, instance);
    let Some(triangle) = triangles.find(|triangle| triangle.word[0] == name) else {
        return (NOWHERE, Vec3::Z);
    };
    let [a, b, c] = triangle.corners;
    let [second, third] = [shares & 0xffff, shares >> 16].map(|share| share as f32 / 65_535.0);
    let mirrored = cut.instances[instance as usize].flags & InstanceData::MIRRORED != 0;
    let facing = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or(glam::DVec3::Z).as_vec3();
    (a + second * (b - a) + third * (c - a), if mirrored { -facing } else { facing })
}

/// A cluster at an instance.
#[derive(Clone, Copy)]
struct Item {
    cluster: usize,
    instance: u32,
}

/// A triangle that may carry points.
struct Piece<'a> {
    triangle: TriangleRef,
    cutout: Option<Cutout<'a>>,
    /// How much of it is there.
    share: f32,
    area: f64,
    exponent: u32,
}

impl Piece<'_> {
    fn weight(&self) -> f64 {
        self.area / f64::from(1u32 << self.exponent)
    }
}

/// All triangles of an item together.
#[derive(Default)]
struct Sum {
    weight: f64,
    area: f64,
    /// Of each that alpha cuts out.
    shares: Vec<f32>,
}

#[derive(Default)]
struct Chosen {
    sources: Vec<Source>,
    area_m2: f64,
    point_m2: f64,
}

/// All that may carry points.
struct Surfaces<'a> {
    scene: &'a cs::Scene,
    cut: &'a Cut,
    covers: Vec<Cover<'a>>,
    items: Vec<Item>,
    options: PointOptions,
}

impl<'a> Surfaces<'a> {
    /// `None` where nothing is asked for.
    fn new(scene: &'a cs::Scene, cut: &'a Cut, options: PointOptions) -> Option<Self> {
        let covers = scene.materials.iter().map(|material| Cover::new(scene, material)).collect();
        let items = cut.drawn.iter().flat_map(|drawn| {
            drawn.clusters.clone().map(|cluster| Item { cluster, instance: drawn.instance })
        });
        let items = items.collect();
        (options.points > 0).then_some(Self { scene, cut, covers, items, options })
    }

    /// An item's triangles, always in the same order; how much of them is there is found out unless it is known.
    fn pieces<'s>(&'s self, item: Item, shares: &'s [f32]) -> impl Iterator<Item = Piece<'s>> {
        let material = self.cut.heap.clusters[item.cluster].material as usize;
        let cover = &self.covers[material];
        let carries = !matches!(cover, Cover::None);
        let triangles = carries.then(|| cluster_triangles(self.scene, self.cut, item.cluster, item.instance));
        triangles.into_iter().flatten().enumerate().map(move |(number, triangle)| {
            let [a, b, c] = triangle.corners;
            let area = 0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length();
            let cutout = match cover {
                Cover::Alpha(alpha) => Some(alpha.of(self.cut, &triangle)),
                _ => None,
            };
            let found = || cutout.as_ref().map_or(1.0, Cutout::share);
            let share = shares.get(number).copied().unwrap_or_else(found);
            let exponent = self.options.thinning.map_or(0, |thinning| thinning.exponent(&triangle.corners));
            Piece { triangle, cutout, share, area: area * f64::from(share), exponent }
        })
    }

    fn sum(&self, item: Item) -> Sum {
        let mut sum = Sum::default();
        for piece in self.pieces(item, &[]) {
            sum.weight += piece.weight();
            sum.area += piece.area;
            sum.shares.extend(piece.cutout.map(|_| piece.share));
        }
        sum
    }

    /// `None` where nothing has area.
    fn choose(&self) -> Option<Chosen> {
        let sums: Vec<Sum> = self.items.par_iter().map(|&item| self.sum(item)).collect();
        let area_m2 = sums.iter().map(|sum| sum.area).sum::<f64>();
        let ends: Vec<f64> = sums
            .iter()
            .scan(0.0, |end, sum| {
                *end += sum.weight;
                Some(*end)
            })
            .collect();
        let total = *ends.last().filter(|total| **total > 0.0 && total.is_finite())?;

        // The sequence leaves no two of a power of two in one slot: slot by slot, points are sorted.
        let points = self.options.points;
        let bits = points.next_power_of_two().trailing_zeros();
        let sequence = Sequence::new(self.options.seed);
        let slot = |index: u32| (u64::from(sequence.first(index)) << bits >> 32) as usize;
        let mut order = vec![NONE; 1 << bits];
        for index in 0..points {
            order[slot(index)] = index;
        }
        let sorted: Vec<Source> =
            order.par_chunks(RUN).flat_map_iter(|run| self.place_run(run, &sums, &ends)).collect();
        let sources = (0..points).into_par_iter().map(|index| sorted[slot(index)]).collect();
        Some(Chosen { sources, area_m2, point_m2: total / f64::from(points) })
    }

    /// Points in the order of where they lie; `ends` are the items' weights, summed up.
    fn place_run(&self, run: &[u32], sums: &[Sum], ends: &[f64]) -> Vec<Source> {
        let sequence = Sequence::new(self.options.seed);
        let mut open = usize::MAX;
        let mut pieces: Vec<(f64, Piece<'_>)> = Vec::new();
        let place = |&index: &u32| {
            if index == NONE {
                return Source::default();
            }
            // The slot has 32 bits; there may be more triangles than that tells apart well.
            let finer = unit(combined(index, self.options.seed));
            let at = (f64::from(sequence.first(index)) + finer) / 4_294_967_296.0;
            let at = at * ends.last().copied().unwrap_or_default();
            let item = found(ends, at, |&end| end);
            if item != open {
                open = item;
                pieces.clear();
                let mut end = item.checked_sub(1).map_or(0.0, |before| ends[before]);
                pieces.extend(self.pieces(self.items[item], &sums[item].shares).map(|piece| {
                    end += piece.weight();
                    (end, piece)
                }));
            }
            let Some((end, piece)) = pieces.get(found(&pieces, at, |(end, _)| *end)) else {
                return Source::default();
            };
            // What is left of the number is even within the triangle.
            let rest = (1.0 - (end - at) / piece.weight()).clamp(0.0, 1.0);
            let [_, second, third] = self.corners(piece, index, [rest, unit(sequence.second(index))]);
            let [name, instance, ..] = piece.triangle.word;
            [name, instance | piece.exponent << 24, u32::from(second) | u32::from(third) << 16]
        };
        run.iter().map(place).collect()
    }

    /// A place of a triangle that is there: the one drawn, or others in its stead.
    fn corners(&self, piece: &Piece<'_>, index: u32, drawn: [f64; 2]) -> [u16; 3] {
        let first = corner_weights(drawn);
        let Some(cutout) = &piece.cutout else { return first };
        let key = combined(self.options.seed, index);
        let again = |attempt: u32| {
            corner_weights([1, 2].map(|dimension| unit(combined(key, 3 * attempt + dimension))))
        };
        let is_there =
            |(attempt, at): &(u32, [u16; 3])| unit(combined(key, 3 * attempt)) < cutout.share_at(*at);
        let mut tries = std::iter::once((0, first)).chain((1..TRIES).map(|i| (i, again(i))));
        let known = || cutout.places().find(|&at| cutout.share_at(at) > 0.0);
        tries.find(is_there).map(|(_, at)| at).or_else(known).unwrap_or(first)
    }
}

/// Among things one after the other, each up to its end, the one that holds a place; none without length, and the last one
/// for a place beyond.
fn found<T>(things: &[T], at: f64, end: impl Fn(&T) -> f64) -> usize {
    let whole = things.last().map_or(0.0, &end);
    let last = things.partition_point(|thing| end(thing) < whole);
    things.partition_point(|thing| end(thing) <= at).min(last)
}
