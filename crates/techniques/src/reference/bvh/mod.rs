//! Rays through the scene without ray-tracing hardware: two levels of trees that compute shaders walk.
//!
//! A node holds up to eight children, their boxes quantised to eight bits in a grid of its own, in 80 bytes; a ray visits
//! them in the order of its octant, without sorting (Ylitie, Karras & Laine 2017, "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs"). obvhs builds: PLOC (Meister & Bittner 2018) with reinsertion (the same, "Parallel
//! Reinsertion"), folded to eight children by the surface area heuristic. All that neither moves nor is drawn many times
//! lies in one tree in world space, and so does every mesh that bends; meshes that are carried about or drawn often have a
//! tree in object space, entered by the ray turned into that space. An upper tree stands over them.
//!
//! Leaves hold the triangles' corners themselves, exact: neighbours share their edges' ends to the bit, and the test
//! computes with those alone (Woop, Benthin & Wald 2013), so that no ray slips between them but where a compiler fuses the
//! products of one edge's two sides differently, which takes a ray that passes the edge within rounding.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | scene at a pose | `tracer` (group 2, binding 15 of shaders that import `traverse.wesl`) | vec4u | – |
//! | scene group (geometry, clusters, materials, textures: only of masked triangles) | closest or any hit | `Hit` | m |
//!
//! # Motion
//! [`TraceScene::update`] takes a new pose: the upper tree is built anew on the CPU, in the room that it has. Trees of what
//! bends keep their shape; [`Refit`] carries the vertices that `motion` has moved into the leaves, and lays new grids
//! around them from the leaves up: one dispatch per level, no read-back, no allocation on the GPU. Boxes of the upper tree
//! around what bends are those around its joints. Refitted trees are right, but a ray may cost more in them than in ones
//! built for the pose: [`TraceScene::wear`] tells how much, and beyond [`WORN`] they are better built anew. Lights by which
//! paths choose follow; where glowing triangles change their size, the tables are made anew, for a density that did not
//! know of it would be wrong, not just noisy.
//!
//! Triangles count from both sides, but for rays that look (`looking` in `traverse.wesl`) not from the back of single-sided
//! materials.
//!
//! Limits: masked triangles are cut out at the finest mip; blended ones count as masked at half coverage, as in shadow
//! maps. A mesh squeezed flat by a node that moves is not met. Triangles that are not finite when a tree is built never
//! are. 128 MiB, which every adapter binds, hold about 2.1 million triangles.
//!
//! Cost: 48 bytes a triangle and about 10 for its share of nodes; what bends 12 more. The build takes about 4 µs a
//! triangle on one core. On an NVIDIA H100 paths are traced 1.3 to 1.8 times as fast as through a binary tree whose
//! triangles lie in the geometry heap, those of one tree about a tenth faster than through several
//! (`docs/decisions/0017-wide-tree.md`).

mod gather;
mod lamps;
pub(crate) mod refit;
mod tree;
mod upper;

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, GpuError};
use chiaro_scene as cs;
use glam::{Affine3A, DVec3};
use obvhs::aabb::Aabb;

pub(crate) use gather::TriangleRef;
use gather::{PAD, around, farthest, inverse_rows, own_triangles, padded, placed_triangles};
use lamps::{Lamps, emitters};
use refit::{Bending, Plan};
pub use refit::{Refit, WORN};
use tree::{LEAF, LOWER_DEPTH};
use upper::{Place, Placed};

use crate::scene::motion::{Mover, bounds_over_time, same_place};
use crate::scene::{Cut, Drawn};

/// A word of `tracer`.
pub(crate) type Word = [u32; 4];

/// Of the root: its tree's leaves hold triangles.
const TRIANGLES: u32 = 1 << 31;
/// The header's words.
pub(crate) const HEADER: usize = 3;
/// Meshes drawn more than once get a tree of their own from so many triangles on.
const SHARED_TRIANGLES: u32 = 512;

/// What of `traverse.wesl` a scene needs. Shaders made for more serve less.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TraceFacts {
    /// 0: there is one tree, in world space; 1: there are several; 2: instances carry some.
    pub levels: u32,
    /// Whether any triangle is masked.
    pub masks: bool,
}

impl Default for TraceFacts {
    /// What serves all.
    fn default() -> Self {
        Self { levels: 2, masks: true }
    }
}

impl TraceFacts {
    /// Constants of every shader that imports `reference/traverse.wesl`, which without them serves all scenes.
    pub fn constants(self) -> [(&'static str, f64); 2] {
        [("LEVELS", f64::from(self.levels)), ("MASKS", f64::from(u8::from(self.masks)))]
    }
}

/// Trees and lights of a scene as shaders read them, made on the CPU by any thread.
#[derive(Clone, Debug)]
pub struct TraceData {
    words: Vec<Word>,
    facts: TraceFacts,
    parts: Parts,
    plan: Plan,
}

/// What an update needs to know.
#[derive(Clone, Debug)]
struct Parts {
    placed: Vec<Placed>,
    /// Where the room for the upper tree starts; the header and what shines lie before.
    upper: usize,
    header: [Word; HEADER],
    lamps: Lamps,
    origin: DVec3,
    /// Nodes whose triangles lie in the one tree of all that stands still, and where they were then.
    still: Vec<(cs::Id, Affine3A)>,
}

/// [`TraceData`] on the GPU.
#[derive(Clone, Debug)]
pub struct TraceScene {
    /// What `traverse.wesl` calls `tracer`.
    pub words: Buffer,
    /// What shaders may leave out.
    pub facts: TraceFacts,
    parts: Parts,
    bending: Option<Bending>,
    /// Whether vertices may have moved since the last refit.
    stale: bool,
}

impl TraceData {
    /// Builds the trees of a scene as it stands in a pose.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let cut = Cut::new(scene, pose);
        let mut words = vec![[0; 4]; HEADER];
        emitters(scene, pose, &cut).write(&mut words);
        let upper = words.len();
        let places = places(scene, &cut);
        let trees = 1 + places.iter().flatten().count();
        words.resize(upper + upper::room(trees), [0; 4]);

        // Poses between the samples of the animations, or of somebody's own making, may reach farther.
        let reach =
            bounds_over_time(scene).map_or(0.0, |(lo, hi)| farthest(&Aabb::new(lo.into(), hi.into())));
        let mut masks = false;
        let (mut still, mut lying) = (Vec::new(), Vec::new());
        let mut placed = Vec::new();
        let mut plan = Plan::default();
        let mut known = vec![None; scene.meshes.len()];
        for (drawn, place) in cut.drawn.iter().zip(places) {
            let (root, bounds) = match &place {
                None => {
                    lying.push((drawn.node, pose.world_from_node[drawn.node]));
                    still.extend(placed_triangles(scene, &cut, drawn));
                    continue;
                }
                Some(Place::Carried { .. }) => *known[drawn.mesh].get_or_insert_with(|| {
                    let triangles = own_triangles(scene, &cut, drawn);
                    masks |= triangles.iter().any(TriangleRef::masked);
                    lower_tree(&triangles, &mut words, None)
                }),
                Some(_) => {
                    let triangles = placed_triangles(scene, &cut, drawn);
                    masks |= triangles.iter().any(TriangleRef::masked);
                    lower_tree(&triangles, &mut words, Some((&mut plan, reach)))
                }
            };
            placed.extend(place.map(|place| Placed { root, bounds, place }));
        }
        masks |= still.iter().any(TriangleRef::masked);
        let (root, bounds) = lower_tree(&still, &mut words, None);
        placed.push(Placed { root, bounds, place: Place::Still });
        placed.retain(|placed| placed.root != tree::EMPTY);
        let levels = match &placed[..] {
            [Placed { place: Place::Still | Place::Bent(_), .. }] => 0,
            all if all.iter().any(|placed| matches!(placed.place, Place::Carried { .. })) => 2,
            _ => 1,
        };

        let (root, upper_words) = upper::build(&placed, (scene, pose), upper);
        words[upper..upper + upper_words.len()].copy_from_slice(&upper_words);
        words[0][0] = root;
        let header = std::array::from_fn(|i| words[i]);
        let lamps = Lamps::new(scene, pose);
        let parts = Parts { placed, upper, header, lamps, origin: scene.origin, still: lying };
        Self { words, facts: TraceFacts { levels, masks }, parts, plan }
    }

    /// What shaders may leave out.
    pub fn facts(&self) -> TraceFacts {
        self.facts
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
        Ok(TraceScene {
            words: Buffer::with_data(gpu, "tracer", &self.words, BufferUsages::STORAGE),
            facts: self.facts,
            parts: self.parts.clone(),
            bending: self.plan.upload(gpu),
            // The GPU bends by weights of 16 bits: rays must meet what it draws.
            stale: true,
        })
    }
}

impl TraceScene {
    /// Whether vertices may have moved since [`Refit::record`], so that motion and it are due.
    pub fn stale(&self) -> bool {
        self.stale
    }

    /// Takes a new pose of the scene that this was built from, for the commands submitted next; what bends follows with
    /// [`Refit::record`]. `false` when only building anew will do: the scene's origin is another, a glowing triangle has
    /// stopped or begun to be finite, or what no animation moves is elsewhere.
    #[must_use]
    pub fn update(&mut self, gpu: &Gpu, scene: &cs::Scene, pose: &cs::Pose) -> bool {
        let parts = &mut self.parts;
        let strayed = |(node, at): &(cs::Id, Affine3A)| !same_place(at, &pose.world_from_node[*node]);
        if parts.origin != scene.origin || parts.still.iter().any(strayed) {
            return false;
        }
        let write = |first: usize, words: &[Word]| {
            gpu.queue.write_buffer(
                self.words.raw(),
                (first * size_of::<Word>()) as u64,
                bytemuck::cast_slice(words),
            );
        };
        if parts.lamps.changed(pose) {
            let mut words = vec![[0; 4]; HEADER];
            emitters(scene, pose, &Cut::new(scene, pose)).write(&mut words);
            if words.len() != parts.upper {
                return false;
            }
            parts.header = std::array::from_fn(|i| words[i]);
            write(HEADER, &words[HEADER..]);
        }
        let (root, upper_words) = upper::build(&parts.placed, (scene, pose), parts.upper);
        parts.header[0][0] = root;
        write(0, &parts.header);
        write(parts.upper, &upper_words);
        self.stale = true;
        true
    }
}

/// How each drawn mesh gets into the world; `None` for those whose triangles lie in the one tree of all that stands still.
fn places(scene: &cs::Scene, cut: &Cut) -> Vec<Option<Place>> {
    let mut uses = vec![0u32; scene.meshes.len()];
    for drawn in &cut.drawn {
        uses[drawn.mesh] += 1;
    }
    let of = |drawn: &Drawn| {
        let instance = &cut.instances[drawn.instance as usize];
        let node = drawn.node;
        if scene.deforms(&scene.nodes[node]) {
            return Some(Place::Bent(Mover::new(scene, node)));
        }
        let triangles: u32 = cut.heap.clusters[drawn.clusters.clone()].iter().map(|c| c.triangle_count).sum();
        let shared = uses[drawn.mesh] > 1 && triangles >= SHARED_TRIANGLES;
        // What is squeezed flat cannot be entered.
        let lies = drawn.fixed && (!shared || inverse_rows(instance).is_none());
        (!lies).then_some(Place::Carried { instance: drawn.instance, node })
    };
    cut.drawn.iter().map(of).collect()
}

/// Appends the tree of triangles; returns its root and its triangles' bounds. One that bends is noted for refits, with
/// the largest coordinate that it may reach.
fn lower_tree(
    triangles: &[TriangleRef],
    words: &mut Vec<Word>,
    bends: Option<(&mut Plan, f32)>,
) -> (u32, Aabb) {
    let boxes = padded(triangles.iter().map(|t| around(&t.corners)).collect());
    let tree = tree::wide(&boxes, LEAF, LOWER_DEPTH);
    if tree.nodes.is_empty() {
        return (tree::EMPTY, Aabb::INVALID);
    }
    let first = words.len();
    words.extend(tree::words(&tree, |index| triangles[index as usize].words(), first));
    if let Some((plan, reach)) = bends {
        plan.add(&tree, &boxes, (first, PAD * 2.0 * reach.max(farthest(&tree.total_aabb))));
    }
    (first as u32, tree.total_aabb)
}
