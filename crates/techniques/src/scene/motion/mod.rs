//! Motion: the pose of a moment becomes geometry, before anything else in a frame looks at it.
//!
//! Keyframes are sampled and the hierarchy is multiplied out on the CPU (`chiaro_scene::Pose`), where cameras, lights
//! and shadow views need them in the same frame anyway; what grows with the geometry is compute. Every moving instance
//! gets its transform, every vertex that bends its place in the world; where each was in the frame before is kept
//! beside it. Bounds follow: a workgroup deforms one cluster and reduces its sphere from the result.
//!
//! | pass | reads | writes |
//! | --- | --- | --- |
//! | instances | transforms of instances that moved | `instances`, previous transforms |
//! | deform | shapes at rest, joint matrices, morph weights | `geometry`: positions (now and before), normals, tangents; `clusters`: spheres |
//!
//! Where a file has no normals, they are those of the triangles as they are bent, and tangents lie in them.
//!
//! Sources: glTF 2.0, sections 3.7.2.2 (morph targets) and 3.7.3 (skins), linear blend skinning (Magnenat-Thalmann,
//! Laperrière & Thalmann 1988).
//!
//! Limits: four joints a vertex; texture coordinates and colours do not morph; a cluster that bends is never culled by
//! its normals. What no animation moves may be moved by a pose of somebody's own making. Cost: nothing at rest, and of
//! instances only for those that moved; else 36 bytes read and 36 written a vertex, 12 to 36 more read for each
//! morph target with a weight.

mod bounds;
mod pass;
pub(crate) mod rest;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, Gpu, Life};
use chiaro_scene as cs;
use glam::{Affine3A, DVec3, Vec3};

use super::instance::{InstanceData, bending_instance_data, instance_data};
pub(crate) use bounds::{Mover, bounds_over_time, union};
pub use pass::Motion;
use rest::Rest;

/// See `instances.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct InstanceMove {
    pub(crate) world_from_object: [[f32; 4]; 3],
    pub(crate) max_scale: f32,
    pub(crate) flags: u32,
    pub(crate) instance: u32,
    pub(crate) reserved: u32,
}

impl InstanceMove {
    fn new(instance: u32, to: &InstanceData) -> Self {
        Self {
            world_from_object: to.world_from_object,
            max_scale: to.max_scale,
            flags: to.flags,
            instance,
            reserved: 0,
        }
    }
}

/// See `deform.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct DeformJob {
    pub(crate) cluster: u32,
    pub(crate) rest: u32,
    pub(crate) first_matrix: u32,
    pub(crate) flags: u32,
    pub(crate) morph: u32,
    pub(crate) target_count: u32,
    pub(crate) first_weight: u32,
    pub(crate) morph_stride: u32,
}

/// A node whose mesh bends: where its matrices and morph weights lie in the uploaded pose.
#[derive(Clone, Copy, Debug)]
struct Bending {
    node: cs::Id,
    /// In matrices.
    first_matrix: u32,
}

/// An instance, and where it stands.
#[derive(Clone, Copy, Debug)]
struct Carried {
    instance: u32,
    node: cs::Id,
    bends: bool,
    /// Whether there is a [`Mover`] of it: of what an animation moves, and of what somebody has moved.
    is_mover: bool,
    /// Of what bends, its first joint.
    world_from_object: Affine3A,
    /// Since which generation.
    since: u64,
}

impl Carried {
    fn new(instance: u32, node: cs::Id, bends: bool, is_mover: bool) -> Self {
        Self { instance, node, bends, is_mover, world_from_object: Affine3A::IDENTITY, since: 0 }
    }

    /// Where it stands in a pose.
    fn place(&self, scene: &cs::Scene, pose: &cs::Pose) -> Affine3A {
        let joint = self.bends.then(|| scene.joint_matrices(pose, self.node).first().copied()).flatten();
        joint.unwrap_or(pose.world_from_node[self.node])
    }

    fn data(&self) -> InstanceMove {
        // What bends is stored in world space; but a mirror still turns its triangles over.
        let data = if self.bends { bending_instance_data } else { instance_data };
        InstanceMove::new(self.instance, &data(&self.world_from_object))
    }
}

/// Bit for bit: what is not a number stays where it is.
pub(crate) fn same_place(a: &Affine3A, b: &Affine3A) -> bool {
    a.to_cols_array().map(f32::to_bits) == b.to_cols_array().map(f32::to_bits)
}

/// What of a scene moves, and its present pose as the GPU takes it.
#[derive(Debug)]
pub struct SceneMotion {
    carried: Vec<Carried>,
    origin: DVec3,
    bending: Vec<Bending>,
    movers: Vec<Mover>,
    // How many of them, from the first on, move by themselves; others were moved by somebody.
    animated: usize,
    buffers: Buffers,
    job_count: u32,
    pose: Vec<[f32; 4]>,
    // Since which generation.
    pose_since: u64,
    generation: u64,
    bounds: Vec<(Vec3, Vec3)>,
    bounds_before: Vec<(Vec3, Vec3)>,
    // How far the corners of the movers' boxes went with the last pose.
    steps_m: Vec<[Vec3; 2]>,
    // The last generation that does not go on from the one before.
    broken: u64,
    done: Mutex<Done>,
}

#[derive(Debug)]
struct Buffers {
    moves: Buffer,
    jobs: Buffer,
    rest: Buffer,
    pose: Buffer,
}

/// Collects what moves while a scene is uploaded.
#[derive(Default)]
pub(crate) struct MotionBuilder {
    pub rest: Rest,
    carried: Vec<Carried>,
    bending: Vec<Bending>,
    jobs: Vec<DeformJob>,
    matrices: u32,
    weights: u32,
}

impl MotionBuilder {
    /// Notes an instance, and whether its node moves.
    pub fn add_rigid(&mut self, instance: u32, node: cs::Id, moves: bool) {
        self.carried.push(Carried::new(instance, node, false, moves));
    }

    /// Notes a node whose mesh bends, drawn by these clusters, which were cut in the order of the mesh's primitives.
    pub fn add_bending(&mut self, scene: &cs::Scene, instance: u32, node: cs::Id, clusters: Range<usize>) {
        let scene_node = &scene.nodes[node];
        let Some(mesh) = scene_node.mesh else { return };
        let target_count = scene.meshes[mesh].morph_targets() as u32;
        let joints = scene_node.skin.map_or(1, |skin| scene.skins[skin].joints.len() as u32);
        for (index, cluster) in clusters.enumerate() {
            let place = self.rest.places[&mesh][index];
            self.jobs.push(DeformJob {
                cluster: cluster as u32,
                rest: place.rest,
                first_matrix: self.matrices,
                flags: u32::from(scene_node.skin.is_some()) | u32::from(place.flat) << 1,
                morph: place.morph,
                target_count,
                first_weight: self.weights,
                morph_stride: place.morph_stride,
            });
        }
        self.carried.push(Carried::new(instance, node, true, true));
        self.bending.push(Bending { node, first_matrix: self.matrices });
        self.matrices += joints;
        self.weights += target_count;
    }

    /// Bytes of the largest buffer that this asks for.
    pub fn largest_buffer(&self) -> u64 {
        4 * self.rest.words.len() as u64
    }

    /// Uploads what does not change, and takes the pose at time 0.
    pub fn finish(mut self, gpu: &Gpu, scene: &cs::Scene) -> SceneMotion {
        for job in &mut self.jobs {
            job.first_weight += 12 * self.matrices;
        }
        let storage = BufferUsages::STORAGE;
        let room = |name, bytes: u64| {
            Buffer::new(gpu, name, Life::Kept, bytes.max(64), storage | BufferUsages::COPY_DST)
        };
        let pose_bytes = 48 * u64::from(self.matrices) + 4 * u64::from(self.weights.next_multiple_of(4));
        let buffers = Buffers {
            moves: room("instance_moves", (self.carried.len() * size_of::<InstanceMove>()) as u64),
            jobs: Buffer::with_data(gpu, "deform_jobs", &self.jobs, storage),
            rest: Buffer::with_data(gpu, "rest", &self.rest.words, storage),
            pose: room("pose", pose_bytes),
        };
        let pose = scene.pose(0.0);
        for carried in &mut self.carried {
            carried.world_from_object = carried.place(scene, &pose);
        }
        let moving = self.carried.iter().filter(|carried| carried.is_mover);
        let movers: Vec<_> = moving.map(|carried| Mover::new(scene, carried.node)).collect();
        let bounds: Vec<_> = movers.iter().map(|mover| mover.bounds_ws(scene, &pose)).collect();
        let mut motion = SceneMotion {
            animated: movers.len(),
            movers,
            carried: self.carried,
            origin: scene.origin,
            bending: self.bending,
            buffers,
            job_count: self.jobs.len() as u32,
            pose: Vec::new(),
            // Instances stand as they were uploaded; what bends is bent by the first frame.
            pose_since: 1,
            generation: 1,
            bounds_before: bounds.clone(),
            steps_m: vec![[Vec3::ZERO; 2]; bounds.len()],
            broken: 0,
            bounds,
            done: Mutex::default(),
        };
        motion.pose = motion.words(scene, &pose);
        motion
    }
}

impl SceneMotion {
    /// Takes a pose of the scene, which is `scene_m` from corner to corner; whether anything is elsewhere than before.
    pub(crate) fn set(&mut self, scene: &cs::Scene, pose: &cs::Pose, scene_m: f32) -> bool {
        let moved_origin = scene.origin != self.origin;
        // Two steps where everything is elsewhere: what was kept of any place holds no more.
        let next = self.generation + if moved_origin { 2 } else { 1 };
        // Where the animations would have things that have moved with the origin.
        let home = moved_origin.then(|| scene.pose(0.0));
        self.origin = scene.origin;
        let mut moved = false;
        let mut before = self.bounds.clone();
        for carried in &mut self.carried {
            let (from, to) = (carried.world_from_object, carried.place(scene, pose));
            if same_place(&from, &to) {
                continue;
            }
            let home = home.as_ref().is_some_and(|home| same_place(&home.world_from_node[carried.node], &to));
            if !carried.is_mover && !home {
                carried.is_mover = true;
                let mover = Mover::new(scene, carried.node);
                before.push(mover.bounds_at(&[from], &[]));
                self.movers.push(mover);
            }
            (carried.world_from_object, carried.since, moved) = (to, next, true);
        }
        let words = self.words(scene, pose);
        if words != self.pose {
            (self.pose, self.pose_since, moved) = (words, next, true);
        }
        if moved {
            self.generation = next;
            self.bounds_before = before;
            self.bounds = self.movers.iter().map(|mover| mover.bounds_ws(scene, pose)).collect();
            if self.jumps(scene_m) || moved_origin {
                self.broken = next;
            }
        }
        moved
    }

    /// Whether a quarter of what moves, by the area it takes, and so much that it counts in a scene of this size, went far for
    /// its own size with the last pose, and not as it did with the pose before.
    fn jumps(&mut self, scene_m: f32) -> bool {
        let (mut all, mut jumped) = (0.0, 0.0);
        self.steps_m.resize(self.bounds.len(), [Vec3::ZERO; 2]);
        let boxes = self.bounds.iter().zip(&self.bounds_before);
        for ((now, before), last) in boxes.zip(&mut self.steps_m) {
            let size = (now.1 - now.0).length().max((before.1 - before.0).length());
            let step = [now.0 - before.0, now.1 - before.1];
            let far = |went: Vec3| went.length() > JUMP_SHARE * size;
            all += size * size;
            if step.into_iter().zip(*last).any(|(step, last)| far(step) && far(step - last)) {
                jumped += size * size;
            }
            *last = step;
        }
        jumped > (0.25 * all).max(LEAST_AREA * scene_m * scene_m)
    }

    /// Whether what a view kept of a generation holds for the next frame: the previous positions are, or will be, those of
    /// then, and nothing jumped meanwhile.
    pub fn goes_on_from(&self, generation: u64) -> bool {
        let done = self.done.lock().unwrap_or_else(PoisonError::into_inner);
        let was_now = generation == done.generation;
        // Another view of the same frame has moved the scene already.
        let was_before = done.generation == self.generation && generation == done.before;
        generation >= self.broken && (was_now || was_before)
    }

    /// What bends, as the GPU takes it: joint matrices, then morph weights.
    fn words(&self, scene: &cs::Scene, pose: &cs::Pose) -> Vec<[f32; 4]> {
        let mut words: Vec<[f32; 4]> = Vec::with_capacity(self.pose.len());
        for bending in &self.bending {
            debug_assert_eq!(words.len(), 3 * bending.first_matrix as usize);
            let joints = scene.joint_matrices(pose, bending.node);
            if joints.is_empty() {
                words.extend(rows(&pose.world_from_node[bending.node]));
            } else {
                words.extend(joints.iter().flat_map(rows));
            }
        }
        let weights: Vec<f32> = self
            .bending
            .iter()
            .flat_map(|bending| pose.morph_weights[bending.node].iter().copied())
            .collect();
        words.extend(
            weights.chunks(4).map(|four| std::array::from_fn(|i| four.get(i).copied().unwrap_or(0.0))),
        );
        words
    }

    /// Nodes that a pose has moved though no animation does, in the order in which they were first.
    pub fn strayed(&self) -> Vec<cs::Id> {
        self.movers[self.animated..].iter().map(Mover::node).collect()
    }

    /// Corners of boxes in world space around what moves, as it stands now: first what animations move, then what a pose has
    /// moved though none does.
    pub fn present_bounds_ws(&self) -> &[(Vec3, Vec3)] {
        &self.bounds
    }

    /// What world space counts from, in the coordinates of the scene's file, metres.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Counts poses: two frames of the same number show the same.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Whether anything has moved since a generation of whose box, two corners in world space, `counts` holds; of generations before
    /// the last nobody knows.
    pub fn moved_since(&self, generation: u64, counts: impl Fn((Vec3, Vec3)) -> bool) -> bool {
        match self.generation.wrapping_sub(generation) {
            0 => false,
            1 => self.moved_bounds_ws().any(counts),
            _ => true,
        }
    }

    /// Corners of boxes in world space around everything that moved with the last pose, where it is and where it was.
    fn moved_bounds_ws(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.bounds.iter().chain(&self.bounds_before).copied()
    }

    /// Corners of a box in world space around everything that can move, as it is now; `None` when nothing does.
    pub(crate) fn bounds_ws(&self) -> Option<(Vec3, Vec3)> {
        self.bounds.iter().copied().reduce(union)
    }

    /// Bytes on the GPU.
    pub(crate) fn bytes(&self) -> u64 {
        let Buffers { moves, jobs, rest, pose } = &self.buffers;
        [moves, jobs, rest, pose].map(|buffer| buffer.raw().size()).iter().sum()
    }
}

/// What goes further than this share of its own size with a pose may have jumped.
const JUMP_SHARE: f32 = 0.25;
/// What is smaller than this share of a scene's size squared breaks no picture.
const LEAST_AREA: f32 = 0.01;

/// Rows of an affine map, so that a point is three dot products.
fn rows(m: &Affine3A) -> [[f32; 4]; 3] {
    let (x, y, z, t) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation);
    std::array::from_fn(|row| [x[row], y[row], z[row], t[row]])
}

/// What the passes carried out: which pose, in which frame, and of which generation the poses before are.
#[derive(Debug, Default)]
struct Done {
    generation: u64,
    before: u64,
    frame: u64,
}
