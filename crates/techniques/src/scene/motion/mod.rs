//! Motion: the pose of a moment becomes geometry, before anything else in a frame looks at it.
//!
//! Keyframes are sampled and the hierarchy is multiplied out on the CPU (`chiaro_scene::Pose`), where cameras, lights
//! and shadow views need them in the same frame anyway; what grows with the geometry is compute. Every moving instance
//! gets its transform, every vertex that bends its place in the world; where each was in the frame before is kept
//! beside it. Bounds follow: a workgroup deforms one cluster and reduces its sphere from the result.
//!
//! | pass | reads | writes |
//! | --- | --- | --- |
//! | instances | transforms of instances that move | `instances`, previous transforms |
//! | deform | shapes at rest, joint matrices, morph weights | `geometry`: positions (now and before), normals, tangents; `clusters`: spheres |
//!
//! Where a file has no normals, they are those of the triangles as they are bent, and tangents lie in them.
//!
//! Sources: glTF 2.0, sections 3.7.2.2 (morph targets) and 3.7.3 (skins), linear blend skinning (Magnenat-Thalmann,
//! Laperrière & Thalmann 1988).
//!
//! Limits: four joints a vertex; texture coordinates and colours do not morph; a cluster that bends is never culled by
//! its normals. Cost: nothing at rest; else 36 bytes read and 36 written a vertex, 12 to 36 more read for each
//! morph target with a weight.

mod bounds;
pub(crate) mod rest;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, parallel};
use chiaro_scene as cs;
use glam::{Affine3A, DVec3, Vec3};

use crate::scene::SceneGpu;
use crate::scene::{InstanceData, bending_instance_data, instance_data};
use crate::{Kit, Pass, shaders};
pub(crate) use bounds::Mover;
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

/// Twin of `ROW` in `deform.cs.wesl`.
const ROW: u32 = 32_768;

/// A node whose mesh bends: where its matrices and morph weights lie in the uploaded pose.
#[derive(Clone, Copy, Debug)]
struct Bending {
    instance: u32,
    node: cs::Id,
    /// In matrices.
    first_matrix: u32,
}

/// What of a scene moves, and its present pose as the GPU takes it.
#[derive(Debug)]
pub struct SceneMotion {
    // Instances that move as a whole, and their nodes.
    rigid: Vec<(u32, cs::Id)>,
    // Those that move only with the origin of world space.
    fixed: Vec<(u32, cs::Id)>,
    origin: DVec3,
    // Whether their places before are of another origin.
    fixed_lag: bool,
    bending: Vec<Bending>,
    movers: Vec<Mover>,
    buffers: Buffers,
    job_count: u32,
    moves: Vec<InstanceMove>,
    pose: Vec<[f32; 4]>,
    generation: u64,
    bounds: Vec<(Vec3, Vec3)>,
    bounds_before: Vec<(Vec3, Vec3)>,
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
    rigid: Vec<(u32, cs::Id)>,
    fixed: Vec<(u32, cs::Id)>,
    bending: Vec<Bending>,
    jobs: Vec<DeformJob>,
    matrices: u32,
    weights: u32,
}

impl MotionBuilder {
    /// Notes an instance whose node moves.
    pub fn add_rigid(&mut self, instance: u32, node: cs::Id) {
        self.rigid.push((instance, node));
    }

    /// Notes an instance whose node rests.
    pub fn add_fixed(&mut self, instance: u32, node: cs::Id) {
        self.fixed.push((instance, node));
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
        self.bending.push(Bending { instance, node, first_matrix: self.matrices });
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
            moves: room(
                "instance_moves",
                ((self.rigid.len() + self.fixed.len() + self.bending.len()) * size_of::<InstanceMove>())
                    as u64,
            ),
            jobs: Buffer::with_data(gpu, "deform_jobs", &self.jobs, storage),
            rest: Buffer::with_data(gpu, "rest", &self.rest.words, storage),
            pose: room("pose", pose_bytes),
        };
        let rigid = self.rigid.iter().map(|(_, node)| *node);
        let nodes: Vec<_> = rigid.chain(self.bending.iter().map(|bending| bending.node)).collect();
        let mut motion = SceneMotion {
            movers: nodes.iter().map(|&node| Mover::new(scene, node)).collect(),
            rigid: self.rigid,
            fixed: self.fixed,
            origin: scene.origin,
            fixed_lag: false,
            bending: self.bending,
            buffers,
            job_count: self.jobs.len() as u32,
            moves: Vec::new(),
            pose: Vec::new(),
            generation: 0,
            bounds: Vec::new(),
            bounds_before: Vec::new(),
            done: Mutex::default(),
        };
        motion.set(scene, &scene.pose(0.0));
        motion.bounds_before.clone_from(&motion.bounds);
        motion
    }
}

impl SceneMotion {
    /// Takes a pose of the scene; whether anything is elsewhere than before.
    pub(crate) fn set(&mut self, scene: &cs::Scene, pose: &cs::Pose) -> bool {
        let moved_origin = scene.origin != self.origin;
        let with_fixed = moved_origin || std::mem::take(&mut self.fixed_lag);
        (self.origin, self.fixed_lag) = (scene.origin, moved_origin);
        let fixed = self.fixed.iter().filter(|_| with_fixed);
        let rigid = self.rigid.iter().chain(fixed).map(|&(instance, node)| {
            InstanceMove::new(instance, &instance_data(&pose.world_from_node[node]))
        });
        // What bends is stored in world space; but a mirror still turns its triangles over.
        let bending = self.bending.iter().map(|&Bending { instance, node, .. }| {
            let joints = scene.joint_matrices(pose, node);
            let matrix = joints.first().unwrap_or(&pose.world_from_node[node]);
            InstanceMove::new(instance, &bending_instance_data(matrix))
        });
        let moves: Vec<_> = rigid.chain(bending).collect();
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
        if moves == self.moves && words == self.pose {
            return false;
        }
        self.moves = moves;
        self.pose = words;
        // Two steps where everything is elsewhere: what was kept of any place holds no more.
        self.generation += if moved_origin { 2 } else { 1 };
        self.bounds_before = std::mem::take(&mut self.bounds);
        self.bounds = self.movers.iter().map(|mover| mover.bounds_ws(scene, pose)).collect();
        true
    }

    /// What world space counts from, in the coordinates of the scene's file, metres.
    pub fn origin(&self) -> DVec3 {
        self.origin
    }

    /// Counts poses: two frames of the same number show the same.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Corners of boxes in world space around everything that moved with the last pose, where it is and where it was.
    pub fn moved_bounds_ws(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
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

/// Corners of a box in world space that holds everything that moves, at any time: sampled over the animations.
pub(crate) fn bounds_over_time(scene: &cs::Scene) -> Option<(Vec3, Vec3)> {
    const SAMPLES: u32 = 32;
    let moving = scene.moving_nodes();
    let drawn = (0..scene.nodes.len()).filter(|&node| scene.nodes[node].mesh.is_some());
    let movers: Vec<_> = drawn
        .filter(|&node| moving[node] || scene.deforms(&scene.nodes[node]))
        .map(|node| Mover::new(scene, node))
        .collect();
    if movers.is_empty() {
        return None;
    }
    let duration_s = f64::from(scene.duration_s().unwrap_or(0.0));
    let samples = if duration_s > 0.0 { SAMPLES } else { 1 };
    let poses = (0..samples).map(|i| scene.pose(duration_s * f64::from(i) / f64::from(SAMPLES)));
    poses.flat_map(|pose| movers.iter().map(|m| m.bounds_ws(scene, &pose)).collect::<Vec<_>>()).reduce(union)
}

/// The box around two boxes. What is not finite is left out.
pub(crate) fn union((a_lo, a_hi): (Vec3, Vec3), (b_lo, b_hi): (Vec3, Vec3)) -> (Vec3, Vec3) {
    (a_lo.min(b_lo), a_hi.max(b_hi))
}

/// Rows of an affine map, so that a point is three dot products.
fn rows(m: &Affine3A) -> [[f32; 4]; 3] {
    let (x, y, z, t) = (m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis, m.translation);
    std::array::from_fn(|row| [x[row], y[row], z[row], t[row]])
}

/// The passes.
#[derive(Debug)]
pub struct Motion {
    instances: ComputePipeline,
    deform: ComputePipeline,
}

/// Which pose the passes carried out, and in which frame; and whether the poses before are those too.
#[derive(Debug, Default)]
struct Done {
    generation: Option<u64>,
    frame: u64,
    settled: bool,
}

impl Pass for Motion {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &[], &[]);
        let (instances, deform) =
            parallel::join(|| make("scene/motion/instances.cs.wesl"), || make("scene/motion/deform.cs.wesl"));
        Ok(Self { instances: instances?, deform: deform? })
    }
}

impl Motion {
    /// Carries out the scene's pose if it is new, and in the frame after lets the previous pose catch up. However many views
    /// of the scene a frame renders, it moves once.
    pub fn record(&self, frame: &mut Frame<'_>, scene: &SceneGpu) {
        let motion = &scene.motion;
        {
            let mut done = motion.done.lock().unwrap_or_else(PoisonError::into_inner);
            let rests = done.generation == Some(motion.generation);
            if rests && (done.settled || done.frame == frame.id()) {
                return;
            }
            *done = Done { generation: Some(motion.generation), frame: frame.id(), settled: rests };
        }
        let buffers = &motion.buffers;
        if !motion.moves.is_empty() {
            frame.upload(&buffers.moves, &motion.moves);
            // There is room for all instances, of which as many move as the shader sees.
            let moves = Binding::BufferRange(&buffers.moves, 0, size_of_val(&motion.moves[..]) as u64);
            let binds = [("moves", moves), ("instances", (&scene.buffers.instances).into())];
            let threads = Dispatch::Threads([motion.moves.len() as u32, 1, 1]);
            frame.compute("motion/instances", &self.instances, &[], &binds, threads);
        }
        if motion.job_count > 0 {
            frame.upload(&buffers.pose, &motion.pose);
            let binds = [
                ("jobs", (&buffers.jobs).into()),
                ("rest", (&buffers.rest).into()),
                ("pose", (&buffers.pose).into()),
                ("geometry", (&scene.buffers.geometry).into()),
                ("clusters", (&scene.buffers.clusters).into()),
            ];
            let groups = [motion.job_count.min(ROW), motion.job_count.div_ceil(ROW), 1];
            frame.compute("motion/deform", &self.deform, &[], &binds, Dispatch::Groups(groups));
        }
    }
}
