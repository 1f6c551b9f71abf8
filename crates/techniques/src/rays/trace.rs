//! A scene's trees, on the CPU and on the GPU.

use std::sync::atomic::{AtomicBool, Ordering};

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, BufferReadback, Gpu, GpuError};
use chiaro_scene as cs;
use glam::{Affine3A, DVec3};
use obvhs::aabb::Aabb;

use super::refit::{Bending, Plan};
use super::tree::{self, LEAF, LOWER_DEPTH, Word};
use super::triangle::{
    PAD, TriangleRef, around, farthest, inverse_rows, own_triangles, padded, placed_triangles,
};
use super::upper::{self, Place, Placed};
use crate::scene::motion::{Mover, bounds_over_time, same_place};
use crate::scene::{Cut, Drawn, SceneFacts};

/// Words before the trees: the root's.
const HEADER: usize = 1;
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
    /// Those of uploaded scenes.
    pub fn of(facts: SceneFacts) -> Self {
        Self { levels: facts.tree_levels, masks: facts.tree_masks }
    }

    /// Constants of every shader that imports `rays/traverse.wesl`, which without them serves all scenes.
    pub fn constants(self) -> [(&'static str, f64); 2] {
        [("LEVELS", f64::from(self.levels)), ("MASKS", f64::from(u8::from(self.masks)))]
    }
}

/// Trees of a scene as shaders read them, made on the CPU by any thread.
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
    origin: DVec3,
    /// Nodes whose triangles lie in the one tree of all that stands still, and where they were then.
    still: Vec<(cs::Id, Affine3A)>,
}

/// [`TraceData`] on the GPU.
#[derive(Debug)]
pub struct TraceScene {
    /// What `traverse.wesl` calls `tracer`.
    pub words: Buffer,
    /// What shaders may leave out.
    pub facts: TraceFacts,
    parts: Parts,
    bending: Option<Bending>,
    /// Whether vertices may have moved since the last refit.
    stale: AtomicBool,
}

impl TraceData {
    /// Builds the trees of a scene as it stands in a pose. `moved`: nodes that are to be carried though no animation moves
    /// them.
    pub fn build(scene: &cs::Scene, pose: &cs::Pose, moved: &[cs::Id]) -> Self {
        let cut = Cut::new(scene, pose);
        let places = places(scene, &cut, moved);
        let trees = 1 + places.iter().flatten().count();
        let mut words = vec![[0; 4]; HEADER + upper::room(trees)];

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

        let upper = upper_words(&placed, (scene, pose));
        words[..upper.len()].copy_from_slice(&upper);
        let parts = Parts { placed, origin: scene.origin, still: lying };
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
            stale: AtomicBool::new(true),
        })
    }
}

impl TraceScene {
    /// Whether vertices may have moved since [`super::Refit::record`], so that motion and it are due.
    pub fn stale(&self) -> bool {
        self.stale.load(Ordering::Relaxed)
    }

    /// The trees to refit, once for every update.
    pub(super) fn due(&self) -> Option<&Bending> {
        self.bending.as_ref().filter(|_| self.stale.swap(false, Ordering::Relaxed))
    }

    /// Starts reading how large the boxes of bending meshes' trees have become, for [`TraceScene::wear`]; `None` when
    /// nothing bends. Nothing waits for it.
    pub fn read_boxes(&self, gpu: &Gpu) -> Option<BufferReadback> {
        Some(BufferReadback::start(gpu, &self.bending.as_ref()?.boxes))
    }

    /// How many times as much as when it was built a ray costs in the tree of a bending mesh that has worn most, from
    /// what [`TraceScene::read_boxes`] read after a refit. Trees beyond [`super::WORN`] are better built anew, by
    /// [`TraceData::build`] with the present pose: refitting keeps them right, not fast.
    pub fn wear(&self, boxes: &[u8]) -> f32 {
        self.bending.as_ref().map_or(0.0, |bending| bending.wear(boxes))
    }

    /// Takes a new pose of the scene that this was built from, for the commands submitted next; what bends follows with
    /// [`super::Refit::record`]. `false` when only building anew will do: the scene's origin is another, or what no animation
    /// moves is elsewhere.
    #[must_use]
    pub fn update(&mut self, gpu: &Gpu, scene: &cs::Scene, pose: &cs::Pose) -> bool {
        let parts = &mut self.parts;
        let strayed = |(node, at): &(cs::Id, Affine3A)| !same_place(at, &pose.world_from_node[*node]);
        if parts.origin != scene.origin || parts.still.iter().any(strayed) {
            return false;
        }
        let words = upper_words(&parts.placed, (scene, pose));
        gpu.queue.write_buffer(self.words.raw(), 0, bytemuck::cast_slice(&words));
        self.stale.store(true, Ordering::Relaxed);
        true
    }
}

/// The header, and the tree over trees that follows it.
fn upper_words(placed: &[Placed], at: (&cs::Scene, &cs::Pose)) -> Vec<Word> {
    let (root, words) = upper::build(placed, at, HEADER);
    [&[[root, 0, 0, 0]], &words[..]].concat()
}

/// How each drawn mesh gets into the world; `None` for those whose triangles lie in the one tree of all that stands still.
fn places(scene: &cs::Scene, cut: &Cut, moved: &[cs::Id]) -> Vec<Option<Place>> {
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
        let lies = drawn.fixed && !moved.contains(&node) && (!shared || inverse_rows(instance).is_none());
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
