//! Trees of bending meshes follow their vertices: node by node from the leaves up, on the GPU.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, Life};
use obvhs::aabb::Aabb;
use obvhs::cwbvh::{BRANCHING, CwBvh};

use super::tree::NODE;
use super::triangle::TRIANGLE;

/// Beyond this [`super::TraceScene::wear`] it pays to build a scene's trees anew.
pub const WORN: f32 = 1.5;
/// What testing a triangle costs, a node's boxes being 1: as obvhs weighs them.
const TRIANGLE_COST: f32 = 0.3;

/// See `refit.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct RefitJob {
    pub(crate) node: u32,
    pub(crate) own: u32,
    pub(crate) children: u32,
    pub(crate) pad: f32,
}

/// See `refit.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct NodeBox {
    pub(crate) lo: [f32; 3],
    pub(crate) leaf_area: f32,
    pub(crate) hi: [f32; 3],
    pub(crate) area: f32,
}

/// What is to be done to trees of bending meshes.
#[derive(Clone, Debug, Default)]
pub(super) struct Plan {
    /// By height above the leaves.
    levels: Vec<Vec<RefitJob>>,
    triangles: Vec<u32>,
    trees: Vec<Built>,
    boxes: usize,
}

/// A tree as it was built.
#[derive(Clone, Debug)]
struct Built {
    /// Its root among the boxes; its other nodes follow.
    root: usize,
    nodes: usize,
    cost: f32,
}

impl Plan {
    /// Takes a tree whose words start at `first`, over triangles in `boxes`.
    pub fn add(&mut self, tree: &CwBvh, boxes: &[Aabb], (first, pad): (usize, f32)) {
        let mut heights = vec![0; tree.nodes.len()];
        let mut found = vec![NodeBox::zeroed(); tree.nodes.len()];
        let mut around = vec![Aabb::INVALID; tree.nodes.len()];
        // Children stand after their parents.
        for (index, node) in tree.nodes.iter().enumerate().rev() {
            for child in (0..BRANCHING).filter(|&child| !node.is_child_empty(child)) {
                if node.is_leaf(child) {
                    let (first, count) = node.child_primitives(child);
                    let held = &tree.primitive_indices[first as usize..(first + count) as usize];
                    let leaf = held.iter().fold(Aabb::INVALID, |all, &i| all.union(&boxes[i as usize]));
                    found[index].leaf_area += count as f32 * leaf.half_area();
                    around[index] = around[index].union(&leaf);
                } else {
                    let inner = node.child_node_index(child) as usize;
                    heights[index] = heights[index].max(heights[inner] + 1);
                    around[index] = around[index].union(&around[inner]);
                }
            }
            found[index].area = around[index].half_area();
            let height: usize = heights[index];
            self.levels.resize(self.levels.len().max(height + 1), Vec::new());
            self.levels[height].push(RefitJob {
                node: (first + NODE * index) as u32,
                own: (self.boxes + index) as u32,
                children: (self.boxes + node.child_base_idx as usize) as u32,
                pad,
            });
        }
        let things = first + NODE * tree.nodes.len();
        self.triangles.extend((0..tree.primitive_indices.len()).map(|i| (things + TRIANGLE * i) as u32));
        self.trees.push(Built { root: self.boxes, nodes: tree.nodes.len(), cost: cost(&found) });
        self.boxes += tree.nodes.len();
    }

    /// Whether nothing bends.
    pub fn is_empty(&self) -> bool {
        self.triangles.is_empty()
    }

    pub fn upload(&self, gpu: &Gpu) -> Option<Bending> {
        let storage = BufferUsages::STORAGE;
        (!self.is_empty()).then(|| Bending {
            levels: self
                .levels
                .iter()
                .map(|jobs| (Buffer::with_data(gpu, "refit_jobs", jobs, storage), jobs.len() as u32))
                .collect(),
            triangles: Buffer::with_data(gpu, "bending_triangles", &self.triangles, storage),
            triangle_count: self.triangles.len() as u32,
            boxes: Buffer::new(
                gpu,
                "node_boxes",
                Life::Kept,
                (self.boxes * size_of::<NodeBox>()) as u64,
                storage | BufferUsages::COPY_SRC,
            ),
            trees: self.trees.clone(),
        })
    }
}

/// Expected cost of a ray that meets the root's box, by the surface area heuristic (MacDonald & Booth 1990).
fn cost(boxes: &[NodeBox]) -> f32 {
    let Some(root) = boxes.first().filter(|root| root.area > 0.0) else { return 0.0 };
    let all: f64 = boxes.iter().map(|b| f64::from(b.area + TRIANGLE_COST * b.leaf_area)).sum();
    (all / f64::from(root.area)) as f32
}

/// A [`Plan`] on the GPU.
#[derive(Clone, Debug)]
pub(super) struct Bending {
    pub levels: Vec<(Buffer, u32)>,
    pub triangles: Buffer,
    pub triangle_count: u32,
    pub boxes: Buffer,
    trees: Vec<Built>,
}

impl Bending {
    /// See [`super::TraceScene::wear`].
    pub fn wear(&self, boxes: &[u8]) -> f32 {
        let boxes: Vec<NodeBox> = bytemuck::pod_collect_to_vec(boxes);
        let worn = self
            .trees
            .iter()
            .filter_map(|built| Some(cost(boxes.get(built.root..built.root + built.nodes)?) / built.cost));
        worn.filter(|wear| wear.is_finite()).fold(0.0, f32::max)
    }
}
