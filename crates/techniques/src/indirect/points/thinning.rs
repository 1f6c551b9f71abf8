//! Where points may be fewer: far from a view.

use std::ops::Add;

use glam::{DVec3, Vec3};

/// Exponents of areas, in powers of four, stay below this.
const EXPONENTS: u32 = 16;
/// Radii of discs grow with this power of the distance: areas with its cube, so that of a ground however wide all rings
/// beyond the first together have no more points than the first.
const GROWTH: f32 = 1.5;
/// All points are there within so many times the distance that half of what surrounds the view is nearer than.
const EXTENT: f32 = 2.0;
/// Views from within this share of that distance have the same points.
const SAME_VIEW: f64 = 0.25;
/// A triangle is halved along its sides no more often: places have 16 bits along one.
const MOST_HALVINGS: u32 = 14;
/// Bins of distances, an octave each has so many of, and the first one's octave.
const BINS: usize = 1024;
const BINS_AN_OCTAVE: f32 = 8.0;
const FIRST_OCTAVE: f32 = -64.0;
/// Of whole numbers that solid angles are added up as, one steradian: specks far away count.
const STERADIAN: f64 = (1u128 << 80) as f64;
/// What is seen from its edge counts as if it were turned by this cosine.
const EDGE_ON: f64 = 1e-3;

/// Points far from a place are fewer, and stand for as much more area: by the cube of the distance, in steps of four.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// The place, metres, from the world's own origin wherever coordinates count from.
    pub eye_m: DVec3,
    /// Up to this distance all are there, metres.
    pub from_m: f32,
}

impl Thinning {
    /// Of the area that points at a distance stand for, in powers of four.
    fn exponent(&self, distance_m: f32) -> u32 {
        let octaves = (distance_m / self.from_m).max(1.0).log2();
        ((GROWTH * octaves) as u32).min(EXPONENTS - 1)
    }

    /// Of the area that points of a part of a triangle stand for: that of its middle.
    pub(super) fn exponent_of(&self, sphere: Sphere, origin: DVec3) -> u32 {
        self.exponent(sphere.distance_m(self.eye_m, origin))
    }

    /// The same of its nearest place, for what is not divided.
    pub(super) fn least_exponent_of(&self, sphere: Sphere, origin: DVec3) -> u32 {
        self.exponent(sphere.distance_m(self.eye_m, origin) - sphere.radius_m)
    }

    /// Whether a triangle's farthest points stand for more than one step more than its nearest.
    pub(super) fn divides(&self, sphere: Sphere, origin: DVec3) -> bool {
        let distance = sphere.distance_m(self.eye_m, origin);
        let [near, far] = [distance - sphere.radius_m, distance + sphere.radius_m].map(|d| self.exponent(d));
        far > near + 1
    }

    /// Whether views from a place may have the points that this one has.
    pub(super) fn is_near(&self, eye_m: DVec3) -> bool {
        eye_m.distance(self.eye_m) <= SAME_VIEW * f64::from(self.from_m)
    }
}

/// Around a triangle, world space, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sphere {
    center: Vec3,
    radius_m: f32,
}

impl Sphere {
    fn around(corners: [Vec3; 3]) -> Self {
        let center = corners.iter().sum::<Vec3>() / 3.0;
        let radius_m = corners.iter().map(|corner| corner.distance(center)).fold(0.0, f32::max);
        Self { center, radius_m }
    }

    fn distance_m(&self, eye_m: DVec3, origin: DVec3) -> f32 {
        (self.center.as_dvec3() + origin).distance(eye_m) as f32
    }
}

/// A part of a triangle: corners by its second and third corner's weights, and how often it was halved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Part {
    corners: [[f32; 2]; 3],
    pub halvings: u32,
}

impl Part {
    /// All of it.
    pub const WHOLE: Self = Self { corners: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], halvings: 0 };

    /// Share of the triangle's area.
    pub fn share(&self) -> f64 {
        0.25f64.powi(self.halvings as i32)
    }

    pub fn sphere(&self, [a, b, c]: [Vec3; 3]) -> Sphere {
        Sphere::around(self.corners.map(|[second, third]| a + second * (b - a) + third * (c - a)))
    }

    /// Weights of the triangle's second and third corner, as 16 bits, at a place of the part by the weights of its own.
    pub fn place(&self, own: [u16; 3]) -> [u16; 2] {
        let along = |axis: usize| {
            let sum = self.corners.iter().zip(own).map(|(corner, weight)| corner[axis] * f32::from(weight));
            sum.sum::<f32>().round() as u16
        };
        let second = along(0);
        [second, along(1).min(65_535 - second)]
    }

    /// Its quarters.
    fn quarters(self) -> [Self; 4] {
        let [a, b, c] = self.corners;
        let middle = |a: [f32; 2], b: [f32; 2]| [0, 1].map(|axis| 0.5 * (a[axis] + b[axis]));
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]]
            .map(|corners| Self { corners, halvings: self.halvings + 1 })
    }
}

/// A triangle in parts, halved while that is asked for, always in the same order.
pub(super) fn parts(
    corners: [Vec3; 3],
    divides: impl Fn(Sphere) -> bool,
    mut take: impl FnMut(Part, Sphere),
) {
    let mut waiting = vec![Part::WHOLE];
    while let Some(part) = waiting.pop() {
        let sphere = part.sphere(corners);
        if part.halvings < MOST_HALVINGS && divides(sphere) {
            waiting.extend(part.quarters());
        } else {
            take(part, sphere);
        }
    }
}

/// What surrounds a view by distance: the solid angle that all has there, whatever stands before it.
#[derive(Clone, Debug)]
pub(super) struct Surround {
    // Whole numbers, so that their sum is the same in any order.
    solid_angles: Vec<u128>,
}

impl Default for Surround {
    fn default() -> Self {
        Self { solid_angles: vec![0; BINS] }
    }
}

impl Surround {
    /// Counts a triangle of some area, metres.
    pub fn add(&mut self, corners: [Vec3; 3], area_m2: f64, eye_m: DVec3, origin: DVec3) {
        let [a, b, c] = corners;
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or_zero();
        let is_near = |sphere: Sphere| 2.0 * sphere.radius_m > sphere.distance_m(eye_m, origin);
        parts(corners, is_near, |part, sphere| {
            let to = sphere.center.as_dvec3() + origin - eye_m;
            let distance = to.length().max(f64::MIN_POSITIVE);
            let cosine = (normal.dot(to).abs() / distance).max(EDGE_ON);
            let angle = area_m2 * part.share() * cosine / (distance * distance);
            let bin = (BINS_AN_OCTAVE * ((distance as f32).log2() - FIRST_OCTAVE)) as usize;
            // No more than a plane around the place.
            let angle = angle.min(std::f64::consts::TAU);
            let sum = &mut self.solid_angles[bin.min(BINS - 1)];
            *sum = sum.saturating_add((STERADIAN * angle) as u128);
        });
    }

    /// How far around a view all points are to be there, metres; `None` where it sees nothing.
    pub fn extent_m(&self) -> Option<f32> {
        let mut left = self.solid_angles.iter().sum::<u128>() / 2;
        let bin = self.solid_angles.iter().position(|&here| {
            let is_last = here > 0 && here >= left;
            left = left.saturating_sub(here);
            is_last
        })?;
        Some(EXTENT * ((bin as f32 + 0.5) / BINS_AN_OCTAVE + FIRST_OCTAVE).exp2())
    }
}

impl Add for Surround {
    type Output = Self;

    fn add(mut self, other: Self) -> Self {
        for (sum, more) in self.solid_angles.iter_mut().zip(other.solid_angles) {
            *sum = sum.saturating_add(more);
        }
        self
    }
}
