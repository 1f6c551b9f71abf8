//! Morphing and skinning on the CPU: the twin that the GPU's results are checked with, and bounds of what bends.
//!
//! Source: glTF 2.0, sections 3.7.2.2 (morph targets) and 3.7.3 (skins): world = Σ wᵢ · world_from_jointᵢ ·
//! jointᵢ_from_object · (position + Σ weight · difference).

use glam::{Affine3A, Mat3A, Vec3};

use crate::{Id, Node, Pose, Primitive, Scene, mesh};

impl Scene {
    /// Whether a node's mesh changes its shape, not just its place.
    pub fn deforms(&self, node: &Node) -> bool {
        node.mesh.is_some_and(|mesh| node.skin.is_some() || self.meshes[mesh].morph_targets() > 0)
    }

    /// Position (metres) and unit normal in world space of a primitive's vertices, drawn at node `node`.
    pub fn posed_vertices<'a>(
        &'a self,
        pose: &'a Pose,
        node: Id,
        primitive: &'a Primitive,
    ) -> impl Iterator<Item = (Vec3, Vec3)> + 'a {
        let weights = &pose.morph_weights[node];
        let joints = self.joint_matrices(pose, node);
        let own = pose.world_from_node[node];
        let world_of = move |vertex| if joints.is_empty() { own } else { blend(&joints, primitive, vertex) };
        let place = move |vertex: usize, world: &Affine3A| {
            let mut position = primitive.positions[vertex];
            for (target, &weight) in primitive.morph_targets.iter().zip(weights) {
                position += weight * target.positions.get(vertex).copied().unwrap_or_default();
            }
            world.transform_point3(position)
        };
        let vertices = 0..primitive.positions.len();
        let mut flat = Vec::new();
        if primitive.flat {
            let positions: Vec<_> = vertices.clone().map(|vertex| place(vertex, &world_of(vertex))).collect();
            flat = triangle_normals(&primitive.indices, &positions);
        }
        vertices.map(move |vertex| {
            let world = world_of(vertex);
            let position = place(vertex, &world);
            if let Some(&normal) = flat.get(vertex) {
                return (position, if world.matrix3.determinant() < 0.0 { -normal } else { normal });
            }
            let mut normal = primitive.normals.get(vertex).copied().unwrap_or(Vec3::Y);
            for (target, &weight) in primitive.morph_targets.iter().zip(weights) {
                normal += weight * target.normals.get(vertex).copied().unwrap_or_default();
            }
            (position, transform_normal(&world, normal))
        })
    }

    /// World from object space by way of each joint of the node's skin; empty without one.
    pub fn joint_matrices(&self, pose: &Pose, node: Id) -> Vec<Affine3A> {
        let Some(skin) = self.nodes[node].skin.map(|skin| &self.skins[skin]) else { return Vec::new() };
        let joints = skin.joints.iter().zip(&skin.joint_from_object);
        joints.map(|(&joint, from_object)| pose.world_from_node[joint] * *from_object).collect()
    }

    /// Smallest and largest corner of all drawn geometry in world space in a pose; `None` without geometry.
    pub fn bounds_at(&self, pose: &Pose) -> Option<(Vec3, Vec3)> {
        self.bounds_of(pose, |_| true)
    }

    /// The same of what is made of certain materials, told by their index.
    pub fn bounds_of(&self, pose: &Pose, material: impl Fn(usize) -> bool) -> Option<(Vec3, Vec3)> {
        let mut bounds: Option<(Vec3, Vec3)> = None;
        let mut include = |p: Vec3| bounds = Some(bounds.map_or((p, p), |(lo, hi)| (lo.min(p), hi.max(p))));
        for (index, node) in self.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh else { continue };
            for primitive in self.meshes[mesh].primitives.iter().filter(|p| material(p.material)) {
                if self.deforms(node) {
                    self.posed_vertices(pose, index, primitive).for_each(|(p, _)| include(p));
                } else {
                    let world = pose.world_from_node[index];
                    primitive.positions.iter().for_each(|p| include(world.transform_point3(*p)));
                }
            }
        }
        bounds
    }
}

/// For each vertex the normal of its triangle, of which each has its own.
fn triangle_normals(indices: &[u32], positions: &[Vec3]) -> Vec<Vec3> {
    let mut normals = vec![mesh::FALLBACK; positions.len()];
    for corners in indices.as_chunks::<3>().0 {
        let at = corners.map(|vertex| positions[vertex as usize].as_dvec3());
        let normal = mesh::unit(mesh::area_normal(at)).unwrap_or(mesh::FALLBACK);
        for &vertex in corners {
            normals[vertex as usize] = normal;
        }
    }
    normals
}

/// The mean of a vertex' joints by their weights.
fn blend(joints: &[Affine3A], primitive: &Primitive, vertex: usize) -> Affine3A {
    let weights = primitive.joint_weights[vertex].to_array();
    let mut sum = Affine3A { matrix3: Mat3A::ZERO, translation: glam::Vec3A::ZERO };
    for (joint, weight) in primitive.joints[vertex].into_iter().zip(weights) {
        sum.matrix3 += joints[usize::from(joint)].matrix3 * weight;
        sum.translation += joints[usize::from(joint)].translation * weight;
    }
    sum
}

/// Normals transform by the cofactor matrix, which keeps them perpendicular under any scale.
fn transform_normal(world: &Affine3A, normal: Vec3) -> Vec3 {
    let m = world.matrix3;
    let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(Vec3::from);
    let turned = y.cross(z) * normal.x + z.cross(x) * normal.y + x.cross(y) * normal.z;
    let turned = turned * m.determinant().signum();
    // Scaled first: the squares of what small scales leave underflow.
    (turned / turned.abs().max_element()).normalize_or(Vec3::Y)
}
