//! Polygons to triangles.

use glam::{DVec2, DVec3};

/// Corners of the largest polygon that is checked for concavity; the clipping of ears is quadratic and worse.
const MAX_CORNERS: usize = 256;

/// Cuts a polygon of n ≥ 3 corners into n − 2 triangles with its own orientation: a fan from the first corner where
/// that is right, else by clipping ears (Meisters 1975).
pub(super) fn triangulate(corners: &[DVec3]) -> Vec<[usize; 3]> {
    let fan = || (1..corners.len() - 1).map(|i| [0, i, i + 1]).collect();
    if corners.len() == 3 || corners.len() > MAX_CORNERS {
        return fan();
    }
    let points = project(corners);
    if (1..points.len() - 1).all(|i| area(points[0], points[i], points[i + 1]) >= 0.0) {
        return fan();
    }
    let mut left: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|&i| {
            let [a, b, c] = [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let is_inside = |&p: &usize| {
                ![a, b, c].contains(&p) && contains([points[a], points[b], points[c]], points[p])
            };
            area(points[a], points[b], points[c]) > 0.0 && !left.iter().any(is_inside)
        });
        // Without an ear the polygon crosses itself or has no area: any triangle will do.
        let i = ear.unwrap_or(0);
        triangles.push([left[(i + n - 1) % n], left[i], left[(i + 1) % n]]);
        left.remove(i);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
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
fn area(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Whether a counter-clockwise triangle contains a point, its border included.
fn contains([a, b, c]: [DVec2; 3], p: DVec2) -> bool {
    area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(corners: &[DVec3]) -> Vec<f64> {
        let normal = |t: [usize; 3]| (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]);
        triangulate(corners).into_iter().map(|t| normal(t).z / 2.0).collect()
    }

    #[test]
    fn a_convex_polygon_becomes_a_fan() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| DVec3::new(x, y, 0.0));
        assert_eq!(triangulate(&square), [[0, 1, 2], [0, 2, 3]]);
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

    #[test]
    fn a_polygon_without_area_still_becomes_triangles() {
        assert_eq!(triangulate(&[DVec3::ONE; 6]).len(), 4);
    }
}
