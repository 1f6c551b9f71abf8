//! Triangle soup on its way to a [`Mesh`]: smoothing, texture mapping, welding.
//!
//! Generators only place corners. Which way a face looks follows from the solid being closed
//! ([`Solid::outward`]), and which edges are hard from the angle between faces ([`Solid::smooth`]); so neither has
//! to be spelled out for every shape.

use std::collections::HashMap;

use glam::{Affine3A, Vec2, Vec3, Vec4};

use crate::{Id, Mesh, Primitive};

/// One triangle with everything its three vertices carry. Counter-clockwise from the front.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Metres.
    pub p: [Vec3; 3],
    /// Unit vectors; the face's own until [`Solid::smooth`].
    pub n: [Vec3; 3],
    /// Metres along the surface; a material's texture transform turns them into repeats.
    pub uv: [Vec2; 3],
    /// Index into the scene's materials.
    pub material: Id,
}

impl Triangle {
    /// The face's unit normal by its winding.
    fn face_normal(&self) -> Vec3 {
        (self.p[1] - self.p[0]).cross(self.p[2] - self.p[0]).normalize_or_zero()
    }
}

/// A set of triangles, usually the closed surface of one body.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// In no particular order.
    pub triangles: Vec<Triangle>,
}

/// Positions closer than 1/16 mm count as the same point when normals are shared and edges are matched.
pub fn position_key(p: Vec3) -> [i32; 3] {
    (p * 16_000.0).round().as_ivec3().to_array()
}

impl Solid {
    /// Adds a triangle; one with two equal corners has no surface and is left out.
    pub fn triangle(&mut self, p: [Vec3; 3], uv: [Vec2; 3], material: Id) {
        let key = p.map(position_key);
        if key[0] == key[1] || key[1] == key[2] || key[2] == key[0] {
            return;
        }
        let mut triangle = Triangle { p, n: [Vec3::Y; 3], uv, material };
        triangle.n = [triangle.face_normal(); 3];
        self.triangles.push(triangle);
    }

    /// Adds a quadrilateral given in order around it.
    pub fn quad(&mut self, p: [Vec3; 4], uv: [Vec2; 4], material: Id) {
        self.triangle([p[0], p[1], p[2]], [uv[0], uv[1], uv[2]], material);
        self.triangle([p[0], p[2], p[3]], [uv[0], uv[2], uv[3]], material);
    }

    /// Adds all of `other`.
    pub fn append(&mut self, other: Self) {
        self.triangles.extend(other.triangles);
    }

    /// Signed volume in m³: positive where a closed surface looks outwards.
    pub fn volume(&self) -> f32 {
        self.triangles.iter().map(|t| t.p[0].dot(t.p[1].cross(t.p[2])) / 6.0).sum()
    }

    /// Turns every face round.
    pub fn flipped(mut self) -> Self {
        for t in &mut self.triangles {
            t.p.swap(1, 2);
            t.uv.swap(1, 2);
            t.n.swap(1, 2);
            t.n = t.n.map(|n| -n);
        }
        self
    }

    /// Makes a closed surface look outwards.
    pub fn outward(self) -> Self {
        if self.volume() < 0.0 { self.flipped() } else { self }
    }

    /// Blends the normals of faces that meet in a point at less than `crease_deg`; sharper edges stay hard.
    ///
    /// Each face counts by its angle at the point, so the result does not depend on how quads were cut.
    pub fn smooth(mut self, crease_deg: f32) -> Self {
        let limit = crease_deg.to_radians().cos();
        let faces: Vec<Vec3> = self.triangles.iter().map(Triangle::face_normal).collect();
        let mut around: HashMap<[i32; 3], Vec<(usize, f32)>> = HashMap::new();
        for (i, t) in self.triangles.iter().enumerate() {
            for c in 0..3 {
                let (a, b) = (t.p[(c + 1) % 3] - t.p[c], t.p[(c + 2) % 3] - t.p[c]);
                around.entry(position_key(t.p[c])).or_default().push((i, a.angle_between(b)));
            }
        }
        for (i, t) in self.triangles.iter_mut().enumerate() {
            for c in 0..3 {
                let near =
                    around[&position_key(t.p[c])].iter().filter(|(j, _)| faces[*j].dot(faces[i]) > limit);
                t.n[c] = near.map(|(j, angle)| faces[*j] * *angle).sum::<Vec3>().normalize_or(faces[i]);
            }
        }
        self
    }

    /// Maps the texture by projection along the axis nearest to each face's normal, never mirrored, in metres.
    ///
    /// Masonry courses then run on from one body to the next.
    pub fn planar_uv(mut self) -> Self {
        for t in &mut self.triangles {
            let n = t.face_normal();
            let a = n.abs();
            t.uv = t.p.map(|p| {
                if a.y > a.x.max(a.z) {
                    Vec2::new(p.x, p.z * n.y.signum())
                } else if a.x > a.z {
                    Vec2::new(-p.z * n.x.signum(), -p.y)
                } else {
                    Vec2::new(p.x * n.z.signum(), -p.y)
                }
            });
        }
        self
    }

    /// The same body elsewhere; `map` must not mirror.
    pub fn transformed(mut self, map: Affine3A) -> Self {
        for t in &mut self.triangles {
            t.p = t.p.map(|p| map.transform_point3(p));
            t.n = t.n.map(|n| map.transform_vector3(n).normalize_or(n));
        }
        self
    }

    /// The same body moved.
    pub fn moved(self, by: Vec3) -> Self {
        self.transformed(Affine3A::from_translation(by))
    }

    /// The same body turned about the vertical.
    pub fn turned(self, angle_rad: f32) -> Self {
        self.transformed(Affine3A::from_rotation_y(angle_rad))
    }

    /// Welds equal vertices into one primitive per material. `with_tangents` says which materials need them.
    pub fn into_mesh(self, name: &str, with_tangents: impl Fn(Id) -> bool) -> Mesh {
        let mut materials: Vec<Id> = self.triangles.iter().map(|t| t.material).collect();
        materials.sort_unstable();
        materials.dedup();
        let primitive =
            |m: Id| primitive(self.triangles.iter().filter(|t| t.material == m), m, with_tangents(m));
        Mesh {
            name: name.to_owned(),
            primitives: materials.into_iter().map(primitive).collect(),
            ..Mesh::default()
        }
    }
}

/// Tangent and handedness of a triangle: along growing u, w = +1 where the picture is not mirrored.
///
/// glTF measures v downwards but normal maps upwards, so the bitangent is where v *falls*.
fn triangle_tangent(t: &Triangle) -> (Vec3, f32) {
    let (e1, e2) = (t.p[1] - t.p[0], t.p[2] - t.p[0]);
    let (d1, d2) = (t.uv[1] - t.uv[0], t.uv[2] - t.uv[0]);
    let det = d1.perp_dot(d2);
    // On a front face with v downwards the corners run clockwise in uv, hence the sign.
    let sign = if det > 0.0 { -1.0 } else { 1.0 };
    (((e1 * d2.y - e2 * d1.y) * det.signum()).normalize_or_zero(), sign)
}

fn primitive<'a>(triangles: impl Iterator<Item = &'a Triangle>, material: Id, tangents: bool) -> Primitive {
    let mut out = Primitive { material, ..Primitive::default() };
    let mut known: HashMap<([i32; 3], [i32; 3], [i32; 2], bool), u32> = HashMap::new();
    let mut sums: Vec<(Vec3, f32)> = Vec::new();
    for t in triangles {
        let (tangent, sign) = triangle_tangent(t);
        for c in 0..3 {
            let normal_key = (t.n[c] * 4096.0).round().as_ivec3().to_array();
            let uv_key = (t.uv[c] * 16_000.0).round().as_ivec2().to_array();
            let key = (position_key(t.p[c]), normal_key, uv_key, tangents && sign < 0.0);
            let index = *known.entry(key).or_insert_with(|| {
                out.positions.push(t.p[c]);
                out.normals.push(t.n[c]);
                out.uvs[0].push(t.uv[c]);
                sums.push((Vec3::ZERO, sign));
                out.positions.len() as u32 - 1
            });
            let (a, b) = (t.p[(c + 1) % 3] - t.p[c], t.p[(c + 2) % 3] - t.p[c]);
            sums[index as usize].0 += tangent * a.angle_between(b);
            out.indices.push(index);
        }
    }
    if tangents {
        let tangent = |(n, (sum, sign)): (&Vec3, &(Vec3, f32))| -> Vec4 {
            // Twice, because the first remainder may be small and then is not quite perpendicular.
            let once = (*sum - *n * n.dot(*sum)).normalize_or(n.any_orthonormal_vector());
            (once - *n * n.dot(once)).normalize().extend(*sign)
        };
        out.tangents = out.normals.iter().zip(&sums).map(tangent).collect();
    }
    out
}
