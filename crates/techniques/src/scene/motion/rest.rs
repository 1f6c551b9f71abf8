//! Shapes at rest, as words that `deform.cs.wesl` reads.

use std::collections::HashMap;

use chiaro_scene as cs;
use glam::{Vec3, Vec4};

use crate::scene::words::{normal_word, tangent_word};

/// Where a cluster's rest shape lies, in words.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub rest: u32,
    pub morph: u32,
    pub morph_stride: u32,
    pub flat: bool,
}

/// Rest shapes of all meshes that bend, each stored once however many nodes draw it.
#[derive(Default)]
pub(crate) struct Rest {
    pub words: Vec<u32>,
    /// By mesh, in the order in which its clusters are cut.
    pub places: HashMap<cs::Id, Vec<Place>>,
}

impl Rest {
    /// Adds a cluster's vertices: position, normal, tangent, joints and their weights, then per morph target and vertex
    /// the differences of position and, where the primitive has any, of normal and tangent. A flat primitive has in place of
    /// normals the other two corners of a vertex' triangle, numbers in the cluster of 8 bits each. `triangles`: corners in
    /// `vertices`.
    pub fn add_cluster(&mut self, primitive: &cs::Primitive, vertices: &[u32], triangles: &[u8]) -> Place {
        let rest = self.words.len() as u32;
        let of = |vertex: &u32| *vertex as usize;
        let mut others = vec![0; vertices.len()];
        for &[a, b, c] in triangles.as_chunks::<3>().0 {
            for [own, next, last] in [[a, b, c], [b, c, a], [c, a, b]] {
                others[usize::from(own)] = u32::from(next) | u32::from(last) << 8;
            }
        }
        for (vertex, others) in vertices.iter().map(of).zip(others) {
            self.words.extend(primitive.positions[vertex].to_array().map(f32::to_bits));
            let normal = || normal_word(primitive.normals.get(vertex).copied().unwrap_or(Vec3::Y));
            self.words.push(if primitive.flat { others } else { normal() });
            self.words.push(primitive.tangents.get(vertex).map_or(u32::MAX, |&t| tangent_word(t)));
            let joints = primitive.joints.get(vertex).copied().unwrap_or_default();
            self.words.extend(pairs(joints));
            let weights = primitive.joint_weights.get(vertex).copied().unwrap_or(Vec4::X);
            self.words.extend(pairs(weights.to_array().map(|w| (w * 65535.0).round() as u16)));
        }
        let morph = self.words.len() as u32;
        let targets = &primitive.morph_targets;
        let streams = if targets.iter().any(|target| !target.tangents.is_empty()) {
            3
        } else if targets.iter().any(|target| !target.normals.is_empty()) {
            2
        } else {
            1
        };
        for target in targets {
            for vertex in vertices.iter().map(of) {
                for stream in [&target.positions, &target.normals, &target.tangents].into_iter().take(streams)
                {
                    let difference: Vec3 = stream.get(vertex).copied().unwrap_or_default();
                    self.words.extend(difference.to_array().map(f32::to_bits));
                }
            }
        }
        Place { rest, morph, morph_stride: 3 * streams as u32, flat: primitive.flat }
    }
}

fn pairs(v: [u16; 4]) -> [u32; 2] {
    [u32::from(v[0]) | u32::from(v[1]) << 16, u32::from(v[2]) | u32::from(v[3]) << 16]
}
