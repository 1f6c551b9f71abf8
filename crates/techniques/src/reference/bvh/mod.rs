//! Rays through the scene without ray-tracing hardware: two levels of trees that compute shaders walk.
//!
//! TODO
mod tree;

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, GpuError};
use chiaro_scene as cs;
use glam::{DMat4, DVec4, Vec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;

use super::path::emitters::Emitters;
use crate::surface::material;
use crate::surface::scene::{Cut, InstanceData};
use tree::{EMPTY, LOWER_DEPTH, UPPER_DEPTH};

/// A word of `tracer`.
pub(crate) type Word = [u32; 4];

/// Of a triangle whose instance is the one that the ray is in.
const NO_INSTANCE: u32 = u32::MAX;
/// Of a triangle.
const MASKED: u32 = 1;
/// Of the root: its tree's leaves hold triangles.
const TRIANGLES: u32 = 1 << 31;
/// The header's words.
pub(crate) const HEADER: usize = 3;
/// Meshes drawn more than once get a tree of their own from so many triangles on.
const SHARED_TRIANGLES: u32 = 512;
/// What boxes are widened by, relative to their tree's largest coordinate: rounding of transforms that the GPU does its
/// own way, and of planes that are found from a node's grid.
const PAD: f32 = 2e-6;
/// What counts as a tree's largest coordinate at least, metres.
const LEAST_EXTENT: f32 = 1e-6;
/// Beyond this coordinates are no scene but an accident; triangles there are left out.
const FARTHEST: f32 = 1e15;

/// A triangle that is drawn somewhere, or somewhere in its mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleRef {
    /// What names it to `path/emitters.wesl`: cluster << 8 | triangle, instance, first position in `geometry`, corners of
    /// 8 bits.
    pub word: Word,
    /// World space for what has an instance, else object space.
    pub corners: [Vec3; 3],
    pub material: u32,
    masked: bool,
}

impl TriangleRef {
    /// What `traverse.wesl` reads.
    fn words(&self) -> [Word; 3] {
        let last = [self.word[0], self.word[1], if self.masked { MASKED } else { 0 }];
        std::array::from_fn(|i| {
            let [x, y, z] = self.corners[i].to_array().map(f32::to_bits);
            [x, y, z, last[i]]
        })
    }
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
        let mut still = Vec::new();
        let mut upper = Vec::new();
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
            let inverse = inverse_rows(instance);
            // What is squeezed flat has no inverse.
            if drawn.fixed && (!shared || inverse.is_none()) {
                still.extend(references);
                continue;
            }
            let bends = scene.deforms(&scene.nodes[instance.node as usize]);
            if bends {
                let tree = lower_tree(&references, &mut words);
                upper.push(Placed { tree, instance: NO_INSTANCE, rows: [[0; 4]; 3], bounds: tree.bounds });
                continue;
            }
            let tree = *known[drawn.mesh].get_or_insert_with(|| {
                let own: Vec<_> = drawn
                    .clusters
                    .clone()
                    .flat_map(|cluster| cluster_triangles(scene, &cut, cluster, NO_INSTANCE))
                    .collect();
                lower_tree(&own, &mut words)
            });
            if let Some(rows) = inverse {
                let bounds = moved(&tree.bounds, instance);
                upper.push(Placed { tree, instance: drawn.instance, rows, bounds });
            }
        }
        let tree = lower_tree(&still, &mut words);
        upper.push(Placed { tree, instance: NO_INSTANCE, rows: [[0; 4]; 3], bounds: tree.bounds });
        upper.retain(|placed| placed.tree.root != EMPTY);
        words[0][0] = match &upper[..] {
            [only] if only.instance == NO_INSTANCE => only.tree.root | TRIANGLES,
            _ => upper_tree(&upper, &mut words),
        };
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
        if needed > limit {
            return Err(GpuError::TooLarge {
                what: "the scene's ray-tracing trees".into(),
                needed,
                limit,
                unit: "bytes",
                advice: "simplify or split the scene",
            });
        }
        Ok(TraceScene { words: Buffer::with_data(gpu, "tracer", &self.words, BufferUsages::STORAGE) })
    }
}

/// A tree among the words.
#[derive(Clone, Copy, Debug)]
struct Tree {
    root: u32,
    bounds: Aabb,
}

/// A tree where it stands in the world.
struct Placed {
    tree: Tree,
    instance: u32,
    rows: [Word; 3],
    bounds: Aabb,
}

fn lower_tree(triangles: &[TriangleRef], words: &mut Vec<Word>) -> Tree {
    let boxes = padded(triangles.iter().map(|t| around(&t.corners)).collect());
    let tree = tree::wide(&boxes, tree::LEAF, LOWER_DEPTH);
    let root = tree::write(&tree, |index| triangles[index as usize].words(), words);
    Tree { root, bounds: tree.total_aabb }
}

fn upper_tree(placed: &[Placed], words: &mut Vec<Word>) -> u32 {
    let boxes = padded(placed.iter().map(|placed| placed.bounds).collect());
    let tree = tree::wide(&boxes, 1, UPPER_DEPTH);
    let thing = |index: u32| {
        let Placed { tree, instance, rows: [x, y, z], .. } = &placed[index as usize];
        [*x, *y, *z, [*instance, tree.root, 0, 0]]
    };
    tree::write(&tree, thing, words)
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
            corners,
        ];
        sane.then_some(TriangleRef { word, corners: at, material, masked })
    })
}

fn to_world(instance: &InstanceData, p: Vec3) -> Vec3 {
    Vec3::from_array(instance.world_from_object.map(|row| Vec4::from(row).dot(p.extend(1.0))))
}

/// Rows of object from world space; nothing for what is squeezed flat.
fn inverse_rows(instance: &InstanceData) -> Option<[Word; 3]> {
    let [x, y, z] = instance.world_from_object.map(|row| Vec4::from(row).as_dvec4());
    let world_from_object = DMat4::from_cols(x, y, z, DVec4::W).transpose();
    let inverse = world_from_object.inverse().transpose();
    let rows = [inverse.x_axis, inverse.y_axis, inverse.z_axis].map(|row| row.as_vec4());
    rows.iter().all(|row| row.is_finite()).then(|| rows.map(|row| row.to_array().map(f32::to_bits)))
}

fn around(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::INVALID, |all, &p| Aabb::new(all.min.min(p.into()), all.max.max(p.into())))
}

/// Widens the boxes of a tree by as much as all rounding together may come to.
fn padded(mut boxes: Vec<Aabb>) -> Vec<Aabb> {
    let farthest = |b: &Aabb| b.min.abs().max(b.max.abs()).max_element();
    let pad = Vec3A::splat(PAD * boxes.iter().map(farthest).fold(LEAST_EXTENT, f32::max));
    for b in &mut boxes {
        *b = Aabb::new(b.min - pad, b.max + pad);
    }
    boxes
}

/// A box in object space as a box in world space.
fn moved(object: &Aabb, instance: &InstanceData) -> Aabb {
    let corners: [Vec3; 8] = std::array::from_fn(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { object.min[axis] } else { object.max[axis] };
        to_world(instance, Vec3::from_array(std::array::from_fn(pick)))
    });
    around(&corners)
}
