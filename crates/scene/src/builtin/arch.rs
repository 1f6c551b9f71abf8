//! Pointed arches and openings in walls.
//!
//! A wall's own plane is (u, y): u to the right as seen from inside, y up. Its depth w grows outwards.

use glam::{Vec2, Vec3, vec2};

use super::shape::Frame;

/// A pointed arch of two circular arcs over a span, springing at y = 0 and symmetric in u.
#[derive(Clone, Copy, Debug)]
pub struct PointedArch {
    /// Half the clear span, metres.
    pub half_span: f32,
    /// Radius of both arcs, metres; equal to `half_span` for a round arch, larger for a steeper one.
    pub radius: f32,
}

impl PointedArch {
    /// `sharpness` is the radius in half spans: 1 round, 2 equilateral.
    pub const fn new(half_span: f32, sharpness: f32) -> Self {
        Self { half_span, radius: half_span * sharpness }
    }

    /// The arch over this one at a distance: same centres.
    pub fn offset(self, by: f32) -> Self {
        Self { half_span: self.half_span + by, radius: self.radius + by }
    }

    /// Height of the point above the springing.
    pub fn rise(self) -> f32 {
        (self.radius * self.radius - (self.radius - self.half_span).powi(2)).sqrt()
    }

    /// Height above the springing at `u` from the axis; none past the span.
    pub fn height(self, u: f32) -> f32 {
        (self.radius.powi(2) - (u.abs() + self.radius - self.half_span).powi(2)).max(0.0).sqrt()
    }

    /// Points from the right springing over the apex to the left one: 2 · `segments` + 1.
    pub fn points(self, segments: usize) -> Vec<Vec2> {
        let centre = self.half_span - self.radius;
        let apex = (-centre / self.radius).acos();
        let right = |i: usize| {
            let p = Vec2::from_angle(apex * i as f32 / segments as f32) * self.radius + vec2(centre, 0.0);
            // The apex of either half must be the same point to the last bit.
            if i == segments { vec2(0.0, self.rise()) } else { p }
        };
        let half: Vec<Vec2> = (0..=segments).map(right).collect();
        let left = half.iter().rev().skip(1).map(|p| vec2(-p.x, p.y));
        half.iter().copied().chain(left).collect()
    }
}

/// An opening: a pointed arch on jambs over a sill.
#[derive(Clone, Copy, Debug)]
pub struct Opening {
    /// Its head.
    pub arch: PointedArch,
    /// Where jambs end and the arch starts, metres above the floor.
    pub springing: f32,
    /// Lower edge, metres above the floor.
    pub sill: f32,
    /// Segments of each half of the head.
    pub segments: usize,
}

impl Opening {
    /// The opening with jambs and head set back by `by` and another sill.
    pub fn widened(self, by: f32, sill: f32) -> Self {
        Self { arch: self.arch.offset(by), sill, ..self }
    }

    /// From the right end of the sill over the apex to its left end.
    pub fn outline(self) -> Vec<Vec2> {
        let a = self.arch.half_span;
        let head = self.arch.points(self.segments).into_iter().map(|p| p + vec2(0.0, self.springing));
        std::iter::once(vec2(a, self.sill)).chain(head).chain([vec2(-a, self.sill)]).collect()
    }

    /// The wall panel's edge, one point for each of [`Self::outline`]'s, so that the wall between them is a strip
    /// of quads: from the lower right corner round the top to the lower left.
    pub fn panel_edge(self, half_width: f32, bottom: f32, top: f32) -> Vec<Vec2> {
        let (n, k) = (self.segments, self.segments.div_ceil(2));
        let right = |i: usize| {
            if i <= k {
                vec2(half_width, self.springing + (top - self.springing) * i as f32 / k as f32)
            } else {
                vec2(half_width * (n - i) as f32 / (n - k) as f32, top)
            }
        };
        let half: Vec<Vec2> = std::iter::once(vec2(half_width, bottom)).chain((0..=n).map(right)).collect();
        let left = half.iter().rev().skip(1).map(|p| vec2(-p.x, p.y));
        half.iter().copied().chain(left).collect()
    }
}

/// Frames along a polyline in a plane with unit normal `binormal`: a profile's x goes along `binormal`, its y to
/// the left of the path as seen against `binormal`; mitred at every corner. The ends are cut square.
pub fn planar_frames(points: &[Vec3], binormal: Vec3, closed: bool) -> Vec<Frame> {
    let n = points.len();
    let edge = |i: usize| (points[(i + 1) % n] - points[i]).normalize_or_zero();
    let frame = |i: usize| {
        let (before, after) = match (closed, i) {
            (true, _) => (edge((i + n - 1) % n), edge(i)),
            (false, 0) => (edge(0), edge(0)),
            (false, _) if i == n - 1 => (edge(n - 2), edge(n - 2)),
            (false, _) => (edge(i - 1), edge(i)),
        };
        let side = binormal.cross(before);
        let mean = (side + binormal.cross(after)).normalize_or(side);
        Frame { origin: points[i], x: binormal, y: mean / mean.dot(side).max(0.2) }
    };
    (0..n).map(frame).collect()
}
