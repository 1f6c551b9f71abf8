//! Polygons to triangles.

use glam::{DVec2, DVec3};

/// Corners that a file's concave polygons may be tested against each other, a second or two of work: clipping ears is
/// quadratic in a polygon's corners, and cubic for one made on purpose.
const MAX_TESTS: u64 = 1 << 29;

/// Cuts a file's polygons into triangles.
pub(super) struct Triangulator {
    tests_left: u64,
}

impl Default for Triangulator {
    fn default() -> Self {
        Self { tests_left: MAX_TESTS }
    }
}

impl Triangulator {
    /// Cuts a polygon of n ≥ 3 corners into n − 2 triangles with its own orientation: a fan from the first corner where
    /// that is right, else by clipping ears (Meisters 1975).
    pub fn triangulate(&mut self, corners: &[DVec3]) -> Vec<[usize; 3]> {
        let fan = || (1..corners.len() - 1).map(|i| [0, i, i + 1]).collect();
        if corners.len() == 3 || self.is_exhausted() {
            return fan();
        }
        let points = project(corners);
        if (1..points.len() - 1).all(|i| area([points[0], points[i], points[i + 1]]) >= 0.0) {
            return fan();
        }
        clip_ears(&points, &mut self.tests_left).unwrap_or_else(fan)
    }

    /// Whether there were too many large concave polygons, of which the last ones became fans.
    pub fn is_exhausted(&self) -> bool {
        self.tests_left == 0
    }
}

/// Triangles of a counter-clockwise polygon; none when the tests are used up.
///
/// The polygon may touch itself, as one does that is cut open to a hole and back along the same line.
fn clip_ears(points: &[DVec2], tests_left: &mut u64) -> Option<Vec<[usize; 3]>> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while left.len() > 3 {
        let n = left.len();
        if *tests_left == 0 {
            return None;
        }
        let point = |i: usize| points[left[i % n]];
        let corner = |i: usize| [point(i + n - 1), point(i), point(i + 1)];
        let ear = (0..n).find(|&i| {
            *tests_left = tests_left.saturating_sub(n as u64);
            let triangle = corner(i);
            let cuts = |other: usize| {
                let is_corner = (other + n + 1 - i) % n < 3;
                !is_corner && reaches_into(triangle, corner(other))
            };
            let is_ear = area(triangle) > 0.0 && !(0..n).any(cuts);
            is_ear || *tests_left == 0
        });
        // Without an ear: a spike or a point of a straight line first. Else the polygon crosses itself or has no area,
        // and any triangle will do.
        let i = ear.or_else(|| (0..n).find(|&i| area(corner(i)) == 0.0)).unwrap_or(0);
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    triangles.push([left[0], left[1], left[2]]);
    Some(triangles)
}

/// Whether a polygon's boundary gets into a counter-clockwise triangle at its vertex `p`, between the edges from `last`
/// and to `next`. A vertex on the triangle's border counts; where one stands at a corner, its edges decide: they may
/// run along the triangle's, or outside.
fn reaches_into(triangle: [DVec2; 3], [last, p, next]: [DVec2; 3]) -> bool {
    if !contains(triangle, p) {
        return false;
    }
    let Some(k) = triangle.iter().position(|&corner| corner == p) else { return true };
    let (to_next, to_last) = (triangle[(k + 1) % 3] - p, triangle[(k + 2) % 3] - p);
    let is_between = |end: DVec2| to_next.perp_dot(end - p) > 0.0 && (end - p).perp_dot(to_last) > 0.0;
    is_between(last) || is_between(next)
}

/// The polygon in the coordinate plane that it faces most, counter-clockwise.
fn project(corners: &[DVec3]) -> Vec<DVec2> {
    // Newell's normal: right for polygons that are concave or not quite flat.
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    let normal: DVec3 = edges.map(|(a, b)| (*a - corners[0]).cross(*b - corners[0])).sum();
    let axis = normal.abs().max_position();
    let sign = normal[axis].signum();
    let of = |p: &DVec3| {
        let (u, v) = (p[(axis + 1) % 3], p[(axis + 2) % 3]);
        if sign < 0.0 { DVec2::new(v, u) } else { DVec2::new(u, v) }
    };
    corners.iter().map(of).collect()
}

/// Twice the signed area of a triangle.
fn area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a counter-clockwise triangle contains a point, its border included.
fn contains([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    area([a, b, p]) >= 0.0 && area([b, c, p]) >= 0.0 && area([c, a, p]) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(corners: &[DVec3]) -> Vec<f64> {
        let normal = |t: [usize; 3]| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]);
        Triangulator::default().triangulate(corners).into_iter().map(|t| normal(t).z / 2.0).collect()
    }

    #[test]
    fn a_convex_polygon_becomes_a_fan() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        assert_eq!(Triangulator::default().triangulate(&square), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_concave_polygon_is_covered_once_in_either_orientation() {
        // An arrow head whose notch the fan from its first corner would cover.
        let arrow = [[0.0, 0.0], [4.0, 3.0], [0.0, 6.0], [2.0, 3.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        for turns in 0..4 {
            let mut corners = arrow;
            corners.rotate_left(turns);
            assert!(areas(&corners).iter().all(|&a| a > 0.0), "turned by {turns}");
            assert!((areas(&corners).iter().sum::<f64>() - 6.0).abs() < 1e-12);
            corners.reverse();
            assert!(areas(&corners).iter().all(|&a| a < 0.0), "reversed, turned by {turns}");
        }
    }

    /// A rectangle; clockwise where `is_hole`.
    fn ring([x, y]: [f64; 2], [w, h]: [f64; 2], is_hole: bool) -> Vec<DVec3> {
        let mut ring = [[x, y], [x + w, y], [x + w, y + h], [x, y + h]].map(|[x, y]| DVec3::new(x, y, 0.0));
        if is_hole {
            ring.reverse();
        }
        ring.to_vec()
    }

    /// Cuts `outer` open at its corner `at` to a hole and back.
    fn keyholed(outer: &[DVec3], at: usize, hole: &[DVec3]) -> Vec<DVec3> {
        let there_and_back = hole.iter().chain(&hole[..1]).chain(&outer[at..=at]);
        outer[..=at].iter().chain(there_and_back).chain(&outer[at + 1..]).copied().collect()
    }

    #[test]
    fn a_polygon_cut_open_to_its_holes_is_covered_once() {
        let square = ring([0.0, 0.0], [9.0, 9.0], false);
        let mut right = ring([5.0, 1.0], [2.0, 3.0], true);
        right.rotate_left(3);
        let holes = [right, ring([1.0, 1.0], [2.0, 2.0], true), ring([1.0, 5.0], [1.0, 3.0], true)];
        // One hole; three from one corner; two, the second cut open to the first.
        let one = (keyholed(&square, 0, &holes[1]), 81.0 - 4.0);
        let star = (holes.iter().fold(square, |outer, hole| keyholed(&outer, 0, hole)), 81.0 - 13.0);
        let chain = (keyholed(&one.0, 2, &holes[0]), 81.0 - 10.0);
        for (polygon, area) in [one, star, chain] {
            for turns in 0..polygon.len() {
                for mirrored in [false, true] {
                    let mut corners = polygon.clone();
                    corners.rotate_left(turns);
                    if mirrored {
                        for corner in &mut corners {
                            corner.x = -corner.x;
                        }
                    }
                    let sign = if mirrored { -1.0 } else { 1.0 };
                    let areas = areas(&corners);
                    let what = format!("area {area}, turned by {turns}, mirrored {mirrored}: {areas:?}");
                    assert!(areas.iter().all(|a| a * sign >= 0.0), "{what}");
                    assert!((areas.iter().sum::<f64>() * sign - area).abs() < 1e-9, "{what}");
                }
            }
        }
    }

    #[test]
    fn polygons_made_to_take_forever_become_fans() {
        let comb = |n: usize| -> Vec<DVec3> {
            (0..n)
                .map(|i| DVec3::new(i as f64, if i % 2 == 0 { 0.0 } else { -1.0 - i as f64 }, 0.0))
                .collect()
        };
        let mut few = Triangulator { tests_left: 1000 };
        let corners = comb(400);
        assert_eq!(few.triangulate(&corners).len(), 398);
        assert!(few.is_exhausted());
        assert_eq!(few.triangulate(&corners)[..2], [[0, 1, 2], [0, 2, 3]]);
        let mut enough = Triangulator::default();
        assert_eq!(enough.triangulate(&corners).len(), 398);
        assert!(!enough.is_exhausted());
    }

    #[test]
    fn a_polygon_without_area_still_becomes_triangles() {
        assert_eq!(Triangulator::default().triangulate(&[DVec3::ONE; 6]).len(), 4);
    }
}
