//! Choosing the points: on the CPU, once for a scene.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use chiaro_scene as cs;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::coverage::{Cover, Cutout};
use super::sequence::{Sequence, combined, corner_weights, unit};
use super::thinning::{Part, Surround, Thinning, parts};
use crate::rays::{TriangleRef, cluster_triangles};
use crate::scene::{Cut, InstanceData};

/// What names a point to shaders: cluster << 8 | triangle; instance | exponent of the area << 24; shares of the second and
/// third corner in 16 bits.
pub(crate) type Source = [u32; 3];

/// Points are thinned where those that are near become as many times denser.
const WORTHWHILE: f64 = 2.0;
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
}

impl Default for PointOptions {
    fn default() -> Self {
        Self { points: 1 << 21, seed: 0 }
    }
}

/// Points of a scene, chosen on the CPU by any thread.
#[derive(Clone, Debug)]
pub struct PointData {
    pub(super) id: u64,
    pub(crate) sources: Arc<[Source]>,
    /// Area that carries points, m².
    pub area_m2: f64,
    /// Area that a point stands for where all are there, m²; 0 without points.
    pub point_m2: f64,
    options: PointOptions,
    // The view that they are for, and from where on there would be fewer.
    view: Option<Thinning>,
    thinning: Option<Thinning>,
}

impl PointData {
    /// Tells sets of points apart.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Chooses points on all that a scene draws, evenly by area as it stands in a pose.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose, options: PointOptions) -> Self {
        let cut = Cut::new(scene, pose);
        let surfaces = Surfaces::new(scene, &cut, options, None);
        Self::new(options, None, surfaces.choose(&surfaces.sums()))
    }

    /// The same with points that are fewer from a distance on.
    pub fn build_thinned(
        scene: &cs::Scene,
        pose: &cs::Pose,
        options: PointOptions,
        thinning: Thinning,
    ) -> Self {
        let cut = Cut::new(scene, pose);
        let surfaces = Surfaces::new(scene, &cut, options, Some(thinning));
        Self::new(options, Some(thinning), surfaces.choose(&surfaces.sums()))
    }

    /// The same for views from near a place, metres from the world's own origin: fewer far from it where most of what there is
    /// is far from it, else evenly. `before`: points of the same scene, which stay where nothing would change.
    pub fn build_for(
        scene: &cs::Scene,
        pose: &cs::Pose,
        options: PointOptions,
        eye_m: DVec3,
        before: Option<&Self>,
    ) -> Self {
        let cut = Cut::new(scene, pose);
        let mut surfaces = Surfaces::new(scene, &cut, options, None);
        // Of nothing all is near.
        let view = Some(Thinning { eye_m, from_m: surfaces.extent_m(eye_m).unwrap_or(f32::INFINITY) });
        surfaces.thinning = view;
        let mut sums = surfaces.sums();
        let (weight, area) = sums.iter().fold((0.0, 0.0), |(w, a), sum| (w + sum.weight, a + sum.area));
        if WORTHWHILE * weight > area {
            if let Some(before) = before.filter(|before| !before.is_thinned() && before.options == options) {
                return Self { view, ..before.clone() };
            }
            surfaces.thinning = None;
            for sum in &mut sums {
                sum.weight = sum.area;
            }
        }
        Self { view, ..Self::new(options, surfaces.thinning, surfaces.choose(&sums)) }
    }

    fn new(options: PointOptions, thinning: Option<Thinning>, chosen: Option<Chosen>) -> Self {
        let id = NEXT_ID.fetch_add(1, Ordering::Relaxed);
        let Chosen { sources, area_m2, point_m2 } = chosen.unwrap_or_default();
        Self { id, sources: sources.into(), area_m2, point_m2, options, view: thinning, thinning }
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

    /// Where there are fewer, if there are anywhere.
    pub fn thinning(&self) -> Option<&Thinning> {
        self.thinning.as_ref()
    }

    fn is_thinned(&self) -> bool {
        self.thinning.is_some()
    }

    /// Whether they serve views from a place as others would that were chosen for it, metres from the world's own origin.
    pub fn serves_from(&self, eye_m: DVec3) -> bool {
        self.is_empty() || self.view.is_some_and(|view| view.is_near(eye_m))
    }

    /// Area of the scene as points count it: in units of what a near one stands for, m².
    pub fn counted_m2(&self) -> f64 {
        self.point_m2 * f64::from(self.len())
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

/// A triangle that may carry points, or a part of one.
struct Piece<'a> {
    triangle: TriangleRef,
    part: Part,
    cutout: Option<Cutout<'a>>,
    /// How much of it is there.
    share: f32,
    area: f64,
    exponent: u32,
}

impl Piece<'_> {
    fn weight(&self) -> f64 {
        self.area / f64::from(1u32 << (2 * self.exponent))
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
    thinning: Option<Thinning>,
}

impl<'a> Surfaces<'a> {
    fn new(scene: &'a cs::Scene, cut: &'a Cut, options: PointOptions, thinning: Option<Thinning>) -> Self {
        let covers = scene.materials.iter().map(|material| Cover::new(scene, material)).collect();
        let items = cut.drawn.iter().flat_map(|drawn| {
            drawn.clusters.clone().map(|cluster| Item { cluster, instance: drawn.instance })
        });
        Self { scene, cut, covers, items: items.collect(), options, thinning }
    }

    /// Triangles of an item that may carry points, with what covers them and their area.
    fn triangles(&self, item: Item) -> impl Iterator<Item = (TriangleRef, &Cover<'a>, f64)> {
        let material = self.cut.heap.clusters[item.cluster].material as usize;
        let cover = &self.covers[material];
        let carries = !matches!(cover, Cover::None);
        let triangles = carries.then(|| cluster_triangles(self.scene, self.cut, item.cluster, item.instance));
        triangles.into_iter().flatten().map(move |triangle| {
            let [a, b, c] = triangle.corners;
            let area = 0.5 * (b - a).as_dvec3().cross((c - a).as_dvec3()).length();
            (triangle, cover, area)
        })
    }

    /// How far around a view all points are to be there, metres.
    fn extent_m(&self, eye_m: DVec3) -> Option<f32> {
        let add = |mut surround: Surround, &item: &Item| {
            for (triangle, _, area) in self.triangles(item) {
                surround.add(triangle.corners, area, eye_m, self.scene.origin);
            }
            surround
        };
        let all = self.items.par_iter().fold(Surround::default, add);
        all.reduce(Surround::default, std::ops::Add::add).extent_m()
    }

    /// An item's triangles, always in the same order; how much of them is there is found out unless it is known.
    fn pieces<'s>(&'s self, item: Item, shares: &'s [f32]) -> impl Iterator<Item = Piece<'s>> {
        self.triangles(item).enumerate().flat_map(move |(number, (triangle, cover, area))| {
            let cutout = match cover {
                Cover::Alpha(alpha) => Some(alpha.of(self.cut, &triangle)),
                _ => None,
            };
            let found = || cutout.as_ref().map_or(1.0, Cutout::share);
            let share = shares.get(number).copied().unwrap_or_else(found);
            let area = area * f64::from(share);
            let whole = Piece { triangle, part: Part::WHOLE, cutout, share, area, exponent: 0 };
            let (one, many) = self.thinned(whole);
            one.into_iter().chain(many)
        })
    }

    /// A triangle whose points are all alike, or its parts.
    fn thinned<'s>(&self, whole: Piece<'s>) -> (Option<Piece<'s>>, Vec<Piece<'s>>) {
        let Some(thinning) = self.thinning else { return (Some(whole), Vec::new()) };
        let (origin, corners) = (self.scene.origin, whole.triangle.corners);
        let sphere = whole.part.sphere(corners);
        // Of what is cut out a part may be all hole.
        if whole.cutout.is_some() {
            return (
                Some(Piece { exponent: thinning.least_exponent_of(sphere, origin), ..whole }),
                Vec::new(),
            );
        }
        if !thinning.divides(sphere, origin) {
            return (Some(Piece { exponent: thinning.exponent_of(sphere, origin), ..whole }), Vec::new());
        }
        let mut pieces = Vec::new();
        let divides = |sphere| thinning.divides(sphere, origin);
        parts(corners, divides, |part, sphere| {
            let exponent = thinning.exponent_of(sphere, origin);
            let area = whole.area * part.share();
            pieces.push(Piece {
                triangle: whole.triangle,
                part,
                cutout: None,
                share: whole.share,
                area,
                exponent,
            });
        });
        (None, pieces)
    }

    fn sums(&self) -> Vec<Sum> {
        self.items.par_iter().map(|&item| self.sum(item)).collect()
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
    fn choose(&self, sums: &[Sum]) -> Option<Chosen> {
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
        let points = Some(self.options.points).filter(|points| *points > 0)?;
        let bits = points.next_power_of_two().trailing_zeros();
        let sequence = Sequence::new(self.options.seed);
        let slot = |index: u32| (u64::from(sequence.first(index)) << bits >> 32) as usize;
        let mut order = vec![NONE; 1 << bits];
        for index in 0..points {
            order[slot(index)] = index;
        }
        let sorted: Vec<Source> =
            order.par_chunks(RUN).flat_map_iter(|run| self.place_run(run, sums, &ends)).collect();
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
            let own = self.corners(piece, index, [rest, unit(sequence.second(index))]);
            let [second, third] = piece.part.place(own);
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
