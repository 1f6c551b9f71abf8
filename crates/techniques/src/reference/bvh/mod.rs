//! Rays through the scene without ray-tracing hardware: a two-level BVH that compute shaders walk.
//!
//! A binary tree (obvhs: PLOC, Meister & Bittner 2018, with reinsertion) whose nodes hold their two children's boxes
//! (Aila & Laine 2009, "Understanding the Efficiency of Ray Traversal on GPUs"). All that neither moves nor is drawn
//! many times lies in one tree in world space; meshes that move, bend or are drawn often have a tree each, in object
//! space, under an upper tree of instances. Binary rather than wide and quantised because the tree of a bending mesh
//! can then be refitted in place, children before parents, without being quantised anew.
//!
//! Triangles are tested where the pictures draw them: corners come from the geometry heap and are carried to world
//! space by their instance, so nothing is stored twice, and a ray meets what the rasteriser shows.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | scene | `tracer` (group 2, binding 15 of shaders that import `traverse.wesl`) | vec4u | – |
//! | scene group (geometry, clusters, instances, materials, textures) | closest or any hit | `Hit` | m |
//!
//! Limits: trees are built for the pose at time 0; masked triangles are cut out at the finest mip; blended ones count as
//! masked at half coverage, as in shadow maps. 128 MiB, which every adapter binds, hold about 2.5 million triangles.
//!
//! Cost: about 50 bytes a triangle; the build about 2 µs a triangle on one core.

mod tree;

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, GpuError};
use chiaro_scene as cs;
use glam::{Vec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;

use super::path::emitters::Emitters;
use crate::surface::material;
use crate::surface::scene::{Cut, InstanceData};
use tree::{EMPTY, LOWER_DEPTH, Tree, UPPER_DEPTH};

/// A word of `tracer`.
pub(crate) type Word = [u32; 4];

/// Of a triangle whose instance is the one that the ray is in.
const NO_INSTANCE: u32 = u32::MAX;
/// Of a triangle reference, beside three corners of eight bits.
const MASKED: u32 = 1 << 24;
/// The header's words.
pub(crate) const HEADER: usize = 3;
/// Meshes drawn more than once get a tree of their own from so many triangles on.
const SHARED_TRIANGLES: u32 = 512;
/// What boxes are widened by, relative to the largest coordinate: rounding of transforms that the GPU does its own way.
const PAD: f32 = 1e-6;
/// Beyond this coordinates are no scene but an accident; triangles there are left out.
const FARTHEST: f32 = 1e15;

/// A triangle as `tracer` names it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleRef {
    pub word: Word,
    /// World space for what has an instance, else object space.
    pub corners: [Vec3; 3],
    pub material: u32,
}

/// Trees and lights of a scene as shaders read them, made on the CPU by any thread.
#[derive(Clone, Debug)]
pub struct TraceData {
    words: Vec<Word>,
}

/// [`TraceData`] on the GPU.
#[derive(Clone, Debug)]
pub struct TraceScene {
    /// What `traverse.wesl` calls `tracer`.
    pub words: Buffer,
}

impl TraceData {
    /// Builds the trees of a scene as it stands at time 0.
    pub fn build(scene: &cs::Scene) -> Self {
        let pose = scene.pose(0.0);
        let cut = Cut::new(scene, &pose);
        let mut uses = vec![0u32; scene.meshes.len()];
        for drawn in &cut.drawn {
            uses[drawn.mesh] += 1;
        }
        let triangles = |clusters: &std::ops::Range<usize>| -> u32 {
            cut.heap.clusters[clusters.clone()].iter().map(|c| c.triangle_count).sum()
        };
        let mut words = vec![[0; 4]; HEADER];
        let mut fixed = Vec::new();
        let mut upper = Vec::new();
        let mut instances = Vec::new();
        let mut known = vec![None; scene.meshes.len()];
        let mut emitters = Emitters::new(scene, &pose);
        for drawn in &cut.drawn {
            let instance = &cut.instances[drawn.instance as usize];
            let references: Vec<_> = drawn
                .clusters
                .clone()
                .flat_map(|cluster| cluster_triangles(scene, &cut, cluster, drawn.instance))
                .collect();
            for reference in &references {
                emitters.add_triangle(reference);
            }
            let shared = uses[drawn.mesh] > 1 && triangles(&drawn.clusters) >= SHARED_TRIANGLES;
            if drawn.fixed && !shared {
                fixed.extend(references);
                continue;
            }
            let bends = scene.deforms(&scene.nodes[instance.node as usize]);
            let tree = known[drawn.mesh].filter(|_| !bends).unwrap_or_else(|| {
                let own: Vec<_> = drawn
                    .clusters
                    .clone()
                    .flat_map(|cluster| cluster_triangles(scene, &cut, cluster, NO_INSTANCE))
                    .collect();
                lower_tree(&own, &mut words)
            });
            if !bends {
                known[drawn.mesh] = Some(tree);
            }
            if tree.root != EMPTY {
                upper.push(moved(&tree.bounds, instance));
                instances.push([drawn.instance, tree.root, 0, 0]);
            }
        }
        let still = lower_tree(&fixed, &mut words);
        if still.root != EMPTY {
            upper.push(still.bounds);
            instances.push([NO_INSTANCE, still.root, 0, 0]);
        }
        words[0][0] = tree::write(&upper, &instances, (1, UPPER_DEPTH), &mut words).root;
        emitters.write(&mut words);
        Self { words }
    }

    /// Uploads.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the adapter cannot bind so much.
    pub fn upload(&self, gpu: &Gpu) -> Result<TraceScene, GpuError> {
        let needed = size_of_val(self.words.as_slice()) as u64;
        let limit = gpu.limits.max_storage_buffer_binding_size;
        // References to nodes have 28 bits.
        if needed > limit || self.words.len() >= 1 << 28 {
            return Err(GpuError::TooLarge {
                what: "the scene's ray-tracing trees".into(),
                needed,
                limit: limit.min(16 << 28),
                unit: "bytes",
                advice: "simplify or split the scene",
            });
        }
        Ok(TraceScene { words: Buffer::with_data(gpu, "tracer", &self.words, BufferUsages::STORAGE) })
    }
}

fn lower_tree(triangles: &[TriangleRef], words: &mut Vec<Word>) -> Tree {
    let boxes: Vec<_> = triangles.iter().map(|t| bounds(&t.corners)).collect();
    let references: Vec<_> = triangles.iter().map(|t| t.word).collect();
    tree::write(&boxes, &references, (4, LOWER_DEPTH), words)
}

/// What is to be hit of a cluster drawn at an instance, or at none.
fn cluster_triangles<'a>(
    scene: &'a cs::Scene,
    cut: &'a Cut,
    cluster: usize,
    instance: u32,
) -> impl Iterator<Item = TriangleRef> + 'a {
    let data = &cut.heap.clusters[cluster];
    let material = data.material;
    let masked = material::alpha_cutoff(&scene.materials[material as usize]) > 0.0;
    (0..data.triangle_count).filter_map(move |triangle| {
        let corners = cut.heap.words[(data.triangles + triangle) as usize] & 0xff_ffff;
        let at = [0, 8, 16].map(|shift| {
            let at = (data.positions + 3 * (corners >> shift & 0xff)) as usize;
            let own = Vec3::from_array(std::array::from_fn(|i| f32::from_bits(cut.heap.words[at + i])));
            if instance == NO_INSTANCE { own } else { to_world(&cut.instances[instance as usize], own) }
        });
        // Comparisons with NaN are false.
        let sane = at.iter().all(|p| p.abs().max_element() < FARTHEST && !p.is_nan());
        let word = [
            (cluster as u32) << 8 | triangle,
            instance,
            data.positions,
            corners | if masked { MASKED } else { 0 },
        ];
        sane.then_some(TriangleRef { word, corners: at, material })
    })
}

fn to_world(instance: &InstanceData, p: Vec3) -> Vec3 {
    Vec3::from_array(instance.world_from_object.map(|row| Vec4::from(row).dot(p.extend(1.0))))
}

fn padded(points: impl Iterator<Item = Vec3A>) -> Aabb {
    let (lo, hi) = points.fold((Vec3A::INFINITY, Vec3A::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let pad = Vec3A::splat(PAD * lo.abs().max(hi.abs()).max_element() + f32::MIN_POSITIVE);
    Aabb::new(lo - pad, hi + pad)
}

fn bounds(corners: &[Vec3; 3]) -> Aabb {
    padded(corners.iter().map(|&p| p.into()))
}

/// A box in object space as a box in world space.
fn moved(object: &Aabb, instance: &InstanceData) -> Aabb {
    let corners = (0..8).map(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { object.min[axis] } else { object.max[axis] };
        to_world(instance, Vec3::from_array(std::array::from_fn(pick))).into()
    });
    padded(corners)
}
