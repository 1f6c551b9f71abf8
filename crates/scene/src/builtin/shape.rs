//! Shapes that bodies are made of: skins over rings, prisms, boxes, surfaces of revolution, mouldings along paths.
//!
//! Every function returns a closed [`Solid`] that looks outwards, with normals and texture coordinates, unless its
//! documentation says otherwise.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3, vec2, vec3};

use super::solid::Solid;
use crate::Id;

/// Edges sharper than this stay hard on shapes with round parts.
pub const CREASE_DEG: f32 = 50.0;

/// How [`skin`] joins its rings.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Joins {
    /// Each ring's last point is joined to its first.
    pub ring: bool,
    /// The last ring is joined to the first.
    pub path: bool,
}

/// Quads between successive rings of equally many points. Open: nothing closes the ends, and the side that the
/// skin looks to follows the rings' sense.
///
/// Texture coordinates are metres: u along the rings, v along the path.
pub fn skin(rings: &[Vec<Vec3>], joins: Joins, material: impl Fn(usize) -> Id) -> Solid {
    let points = rings[0].len();
    let across =
        |ring: &[Vec3]| (1..=points).map(|j| ring[j % points].distance(ring[j - 1])).collect::<Vec<_>>();
    // One common measure around keeps the picture straight where the body swells.
    let widths = rings.iter().map(|r| across(r));
    let widths = widths.max_by(|a, b| a.iter().sum::<f32>().total_cmp(&b.iter().sum())).unwrap_or_default();
    let u: Vec<f32> = std::iter::once(0.0).chain(running_sum(&widths)).collect();
    let steps: Vec<f32> = (1..=rings.len())
        .map(|i| {
            let (a, b) = (&rings[i - 1], &rings[i % rings.len()]);
            a.iter().zip(b).map(|(p, q)| p.distance(*q)).fold(0.0, f32::max)
        })
        .collect();
    let v: Vec<f32> = std::iter::once(0.0).chain(running_sum(&steps)).collect();
    let mut out = Solid::default();
    for i in 1..rings.len() + usize::from(joins.path) {
        let (a, b) = (&rings[i - 1], &rings[i % rings.len()]);
        for j in 1..points + usize::from(joins.ring) {
            let (k, l) = (j - 1, j % points);
            let uv = [vec2(u[k], v[i - 1]), vec2(u[j], v[i - 1]), vec2(u[j], v[i]), vec2(u[k], v[i])];
            out.quad([a[k], a[l], b[l], b[k]], uv, material(i - 1));
        }
    }
    out
}

fn running_sum(values: &[f32]) -> impl Iterator<Item = f32> + '_ {
    values.iter().scan(0.0, |sum, v| {
        *sum += v;
        Some(*sum)
    })
}

/// The surface of a flat polygon, counter-clockwise from the front, any simple outline.
pub fn polygon(corners: &[Vec3], material: Id) -> Solid {
    // Newell's normal is right for outlines that are not convex, too.
    let next = |i: usize| corners[(i + 1) % corners.len()];
    let normal: Vec3 = (0..corners.len()).map(|i| corners[i].cross(next(i))).sum();
    let normal = normal.normalize_or(Vec3::Y);
    let (x, y) = normal.any_orthonormal_pair();
    let flat: Vec<Vec2> = corners.iter().map(|p| vec2(p.dot(x), p.dot(y))).collect();
    let mut out = Solid::default();
    for t in triangulate(&flat) {
        let p = t.map(|i| corners[i]);
        out.triangle(p, t.map(|i| flat[i]), material);
    }
    out.planar_uv()
}

/// Cuts a simple counter-clockwise polygon into triangles by clipping ears.
pub fn triangulate(polygon: &[Vec2]) -> Vec<[usize; 3]> {
    let mut left: Vec<usize> = (0..polygon.len()).collect();
    let mut out = Vec::with_capacity(polygon.len().saturating_sub(2));
    let side = |a: usize, b: usize, c: usize| (polygon[b] - polygon[a]).perp_dot(polygon[c] - polygon[a]);
    while left.len() > 3 {
        let n = left.len();
        let corner = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
        let is_ear = |i: usize| {
            let [a, b, c] = corner(i);
            let inside = |p: &usize| side(a, b, *p) >= 0.0 && side(b, c, *p) >= 0.0 && side(c, a, *p) >= 0.0;
            side(a, b, c) > 1e-9 && !left.iter().filter(|p| ![a, b, c].contains(p)).any(inside)
        };
        // Of the possible ears the one nearest to equilateral, so that no needles arise. Without any ear the rest
        // is flat, and any cut will do.
        let quality = |i: usize| {
            let [a, b, c] = corner(i).map(|k| polygon[k]);
            side(corner(i)[0], corner(i)[1], corner(i)[2])
                / (a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a))
        };
        let best =
            (0..n).filter(|i| is_ear(*i)).max_by(|i, j| quality(*i).total_cmp(&quality(*j))).unwrap_or(0);
        out.push(corner(best));
        left.remove(best);
    }
    if left.len() == 3 {
        out.push([left[0], left[1], left[2]]);
    }
    out
}

/// A body over rings of equally many points with flat ends.
pub fn loft(rings: &[Vec<Vec3>], crease_deg: f32, material: Id) -> Solid {
    let mut out = skin(rings, Joins { ring: true, path: false }, |_| material);
    let mut first = rings[0].clone();
    first.reverse();
    out.append(polygon(&first, material));
    out.append(polygon(&rings[rings.len() - 1], material));
    out.smooth(crease_deg).outward()
}

/// A flat outline in x and y pushed from z0 to z1, all edges hard, with planar texture coordinates.
pub fn prism(outline: &[Vec2], z0: f32, z1: f32, material: Id) -> Solid {
    let at = |z: f32| outline.iter().map(|p| p.extend(z)).collect::<Vec<_>>();
    loft(&[at(z0), at(z1)], 1.0, material).planar_uv()
}

/// A block of this size standing at `at`, turned about the vertical.
pub fn block(size: Vec3, turn_deg: f32, at: Vec3, material: Id) -> Solid {
    let (lo, hi) = (vec3(-size.x / 2.0, 0.0, -size.z / 2.0), vec3(size.x / 2.0, size.y, size.z / 2.0));
    cuboid(lo, hi, material).turned(turn_deg.to_radians()).moved(at)
}

/// An axis-aligned box with planar texture coordinates.
pub fn cuboid(lo: Vec3, hi: Vec3, material: Id) -> Solid {
    let outline = [vec2(lo.x, lo.y), vec2(hi.x, lo.y), vec2(hi.x, hi.y), vec2(lo.x, hi.y)];
    prism(&outline, lo.z, hi.z, material)
}

/// An axis-aligned box whose edges are cut off by `bevel` metres: edges that catch light.
pub fn bevelled(lo: Vec3, hi: Vec3, bevel: f32, material: Id) -> Solid {
    let ring = |y: f32, inset: f32| {
        let (a, b) = (vec2(lo.x + inset, lo.z + inset), vec2(hi.x - inset, hi.z - inset));
        let c = bevel;
        [
            (a.x + c, a.y),
            (b.x - c, a.y),
            (b.x, a.y + c),
            (b.x, b.y - c),
            (b.x - c, b.y),
            (a.x + c, b.y),
            (a.x, b.y - c),
            (a.x, a.y + c),
        ]
        .map(|(x, z)| vec3(x, y, z))
        .to_vec()
    };
    let rings = [ring(lo.y, bevel), ring(lo.y + bevel, 0.0), ring(hi.y - bevel, 0.0), ring(hi.y, bevel)];
    loft(&rings, 20.0, material).planar_uv()
}

/// A body between two upright rectangular tubes about the vertical axis: their half widths, its lower and upper end.
pub fn rectangle_ring(half: [Vec2; 2], y: [f32; 2], material: Id) -> Solid {
    let ring = |half: Vec2, y: f32| {
        [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)]
            .map(|(x, z)| vec3(half.x * x, y, half.y * z))
            .to_vec()
    };
    let rings = [ring(half[0], y[0]), ring(half[1], y[0]), ring(half[1], y[1]), ring(half[0], y[1])];
    skin(&rings, Joins { ring: true, path: true }, |_| material).smooth(1.0).outward().planar_uv()
}

/// A surface of revolution about the vertical: `profile` is (radius, height) from bottom to top.
pub fn lathe(profile: &[Vec2], sides: usize, material: Id) -> Solid {
    let ring = |p: &Vec2| circle(sides, p.x).into_iter().map(|c| vec3(c.x, p.y, c.y)).collect::<Vec<_>>();
    loft(&profile.iter().map(ring).collect::<Vec<_>>(), CREASE_DEG, material)
}

/// A surface of revolution about the vertical whose closed profile, (radius, height), does not touch the axis.
pub fn lathe_ring(profile: &[Vec2], sides: usize, material: Id) -> Solid {
    let ring = |p: &Vec2| circle(sides, p.x).into_iter().map(|c| vec3(c.x, p.y, c.y)).collect::<Vec<_>>();
    let rings: Vec<_> = profile.iter().map(ring).collect();
    skin(&rings, Joins { ring: true, path: true }, |_| material).smooth(CREASE_DEG).outward()
}

/// A ball about the origin: an icosahedron cut `levels` times, 20 · 4^levels triangles with the sphere's own normals.
/// Texture coordinates are planar.
pub fn ball(radius_m: f32, levels: u32, material: Id) -> Solid {
    let golden = f32::midpoint(1.0, 5f32.sqrt());
    let rectangle = |x: Vec3, y: Vec3| [x + y * golden, x - y * golden, -x + y * golden, -x - y * golden];
    let points: Vec<Vec3> =
        [rectangle(Vec3::X, Vec3::Y), rectangle(Vec3::Y, Vec3::Z), rectangle(Vec3::Z, Vec3::X)]
            .concat()
            .iter()
            .map(|p| p.normalize())
            .collect();
    // A face of the icosahedron is three corners that are all neighbours.
    let near = |i: usize, j: usize| points[i].dot(points[j]) > 0.4;
    let mut faces = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                if near(i, j) && near(j, k) && near(k, i) {
                    let [a, b, c] = [i, j, k].map(|corner| points[corner]);
                    faces.push(if a.dot(b.cross(c)) > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    for _ in 0..levels {
        let cut = |[a, b, c]: &[Vec3; 3]| {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| (*p + *q).normalize());
            [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]]
        };
        faces = faces.iter().flat_map(cut).collect();
    }
    let mut out = Solid::default();
    for face in faces {
        out.triangle(face.map(|p| p * radius_m), [Vec2::ZERO; 3], material);
        if let Some(last) = out.triangles.last_mut() {
            last.n = face;
        }
    }
    out.planar_uv()
}

/// Points on a circle about the origin, the first at angle 0.
pub fn circle(sides: usize, radius: f32) -> Vec<Vec2> {
    (0..sides).map(|i| Vec2::from_angle(TAU * i as f32 / sides as f32) * radius).collect()
}

/// Points on an arc, both ends included.
pub fn arc(centre: Vec2, radius: f32, from_deg: f32, to_deg: f32, segments: usize) -> Vec<Vec2> {
    let angle = |i: usize| (from_deg + (to_deg - from_deg) * i as f32 / segments as f32) * PI / 180.0;
    (0..=segments).map(|i| centre + Vec2::from_angle(angle(i)) * radius).collect()
}

/// A place on a path with the two directions that a profile's x and y follow there. The directions need not be
/// unit length: at a mitre the profile is stretched.
#[derive(Clone, Copy)]
pub struct Frame {
    /// Where the profile's origin goes.
    pub origin: Vec3,
    /// Where its x goes.
    pub x: Vec3,
    /// Where its y goes.
    pub y: Vec3,
}

/// A closed profile carried along a path, with flat ends: ribs, tracery bars, string courses.
pub fn sweep(profile: &[Vec2], path: &[Frame], material: Id) -> Solid {
    let ring = |f: &Frame| profile.iter().map(|p| f.origin + f.x * p.x + f.y * p.y).collect::<Vec<_>>();
    loft(&path.iter().map(ring).collect::<Vec<_>>(), CREASE_DEG, material)
}

/// A closed profile carried round a closed path.
pub fn sweep_round(profile: &[Vec2], path: &[Frame], material: Id) -> Solid {
    let ring = |f: &Frame| profile.iter().map(|p| f.origin + f.x * p.x + f.y * p.y).collect::<Vec<_>>();
    let rings: Vec<_> = path.iter().map(ring).collect();
    skin(&rings, Joins { ring: true, path: true }, |_| material).smooth(CREASE_DEG).outward()
}
