//! Clusters of virtual point lights (VPLs; Prutkin, Kaplanyan & Dachsbacher 2012, "Reflective Shadow Map Clustering for Real-Time
//! Global Illumination"; Dong et al. 2009, "Real-Time Indirect Illumination with Clustered Visibility").
//!
//! What costs time is a shadow map for each VPL, and gathering. So many more VPLs are placed than there are maps for, and those
//! that lie beside each other and look the same way become one light, as large and as bright as they are together: by
//! k-means (Lloyd 1982), a few iterations a frame, from the centres of the last frame where there is one.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | start | VPLs and their number, a copy of both | `centres` without those of a last frame, `cluster_length`: f32, m | a workgroup |
//! | assign, three times | those | `assigned`: u32, the cluster of each VPL | a lane a VPL |
//! | update, after all but the last | those | `centres`: position, world space, m; unit normal | a workgroup a cluster |
//! | emit, after the last | those | [`Vpl`]s of the first bounce, in the place of those that there were | the same |
//! | finish | those | `vpl_count` of the first bounce | a workgroup |
//!
//! # Distance
//! d² = (w |p − c| / R)² + (w' |n − m|)², of a VPL at p with normal n, a centre c with normal m, and the settings w and w'. R is
//! √(A / π k) of k clusters, where A is the area of all VPLs: what a cluster's radius would be if all were as large. So weights mean the
//! same in scenes of any size. (The papers have linear sums with weights by scene.) A centre is the mean by luminance of flux.
//!
//! # What a cluster is
//! Flux and area are the sums of its VPLs', so that nothing is lost; position and normal are its centre. A cluster that nothing is
//! near to goes where another VPL is, and brings no light until it has some. Where VPLs are fewer than clusters each is a cluster.
//!
//! # Limits
//! - A cluster's centre lies where nothing may be: beside an edge, or in the air of a niche, and has the shadows of that place.
//! - Three iterations do not end where k-means does; from the last frame's centres they go on.
//! - Stills start anew with each sample, so that they repeat.
//! - Distances are compared in f32 as the adapter computes them: VPLs half-way between centres may fall to either.
//!
//! # Cost
//! n VPLs and k clusters: 3 n k distances of 16 operations and as many comparisons of numbers: with 4,096 and 1,024 0.2 Gflop, at
//! 50 Tflop/s 4 µs; what takes time are nine dispatches of 6 µs. 36 bytes a VPL and 32 a cluster.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, History, Life};

use super::settings::IndirectSettings;
use super::vpl::Vpl;
use super::vpls::VplRoom;
use crate::{Kit, Pass, shaders};

/// Times that all VPLs are assigned.
const ITERATIONS: u32 = 3;

/// See `cluster.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct ClusteringData {
    pub(crate) clusters: u32,
    pub(crate) first_block: u32,
    pub(crate) is_warm: u32,
    pub(crate) position: f32,
    pub(crate) normal: f32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
    pub(crate) reserved2: u32,
}

/// See `cluster.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct Centre {
    pub position_ws: [f32; 3],
    pub reserved0: u32,
    pub normal_ws: [f32; 3],
    pub reserved1: u32,
}

/// What clusters are found in.
#[derive(Debug)]
pub struct ClusterRoom {
    /// [`Centre`]s, as the last frame left them.
    pub centres: Buffer,
    /// u32: the cluster of each VPL.
    pub assigned: Buffer,
    members: Buffer,
    member_count: Buffer,
    length: Buffer,
    uniform: Buffer,
    // VPLs and clusters.
    sizes: [u32; 2],
    // By scene.
    found: History<u64, ()>,
}

/// The passes.
#[derive(Debug)]
pub struct Clusters {
    start: ComputePipeline,
    assign: ComputePipeline,
    update: ComputePipeline,
    emit: ComputePipeline,
    finish: ComputePipeline,
}

impl Pass for Clusters {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let compile = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &entry, &[], &[]);
        let make = |entry| compile(shaders::plain(entry));
        Ok(Self {
            start: make("indirect/clusters/start.cs.wesl")?,
            assign: make("indirect/clusters/assign.cs.wesl")?,
            update: compile(shaders::cluster_update(false))?,
            emit: compile(shaders::cluster_update(true))?,
            finish: make("indirect/clusters/finish.cs.wesl")?,
        })
    }
}

impl Clusters {
    /// Room for what settings ask for: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        settings: &IndirectSettings,
        room: &'r mut Option<ClusterRoom>,
    ) -> &'r mut ClusterRoom {
        let sizes = [settings.vpls, settings.lights()];
        chiaro_gpu::keep(
            room,
            |room| room.sizes == sizes,
            || {
                let [vpls, clusters] = sizes.map(u64::from);
                let copied = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
                let make = |name, life, bytes, usage| Buffer::new(gpu, name, life, bytes, usage);
                let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
                let bytes = size_of::<ClusteringData>() as u64;
                ClusterRoom {
                    centres: make("centres", Life::Kept, clusters * size_of::<Centre>() as u64, copied),
                    assigned: make("assigned", Life::Frame, 4 * vpls, copied),
                    members: make("members", Life::Frame, vpls * size_of::<Vpl>() as u64, copied),
                    member_count: make("member_count", Life::Frame, 16, copied),
                    length: make("cluster_length", Life::Frame, 4, BufferUsages::STORAGE),
                    uniform: make("clustering", Life::Frame, bytes, uniform),
                    sizes,
                    found: History::default(),
                }
            },
        )
    }

    /// Makes clusters of the VPLs of the first bounce, in their place. `round` counts the frames of a still; `scene`: whose centres a
    /// frame that `moves` goes on from.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (settings, round): (&IndirectSettings, u32),
        (scene, moves): (u64, bool),
        placed: &VplRoom,
        room: &mut ClusterRoom,
    ) {
        let [vpls, clusters] = room.sizes;
        let is_warm = moves && room.found.get(&scene).is_some();
        room.found.keep(scene, ());
        let data = ClusteringData {
            clusters,
            first_block: round.wrapping_mul(placed.slots().all()),
            is_warm: u32::from(is_warm),
            position: settings.cluster_position,
            normal: settings.cluster_normal,
            reserved0: 0,
            reserved1: 0,
            reserved2: 0,
        };
        frame.upload(&room.uniform, &[data]);
        frame.copy((&placed.vpls, 0), (&room.members, 0), u64::from(vpls) * size_of::<Vpl>() as u64);
        frame.copy((&placed.count, 0), (&room.member_count, 0), 16);
        let clustering = ("clustering", (&room.uniform).into());
        let members = ("members", (&room.members).into());
        let count = ("member_count", (&room.member_count).into());
        let (centres, length) =
            (("centres", (&room.centres).into()), ("cluster_length", (&room.length).into()));
        let assigned = ("assigned", (&room.assigned).into());
        let placed_vpls = ("vpls", (&placed.vpls).into());
        let one = Dispatch::Groups([1, 1, 1]);
        let each = Dispatch::Groups([clusters, 1, 1]);
        let binds = [clustering, members, count, centres, length];
        frame.compute("indirect/cluster_start", &self.start, &[], &binds, one);
        for iteration in 1..=ITERATIONS {
            let binds = [clustering, members, count, centres, length, assigned];
            let lanes = Dispatch::Threads([vpls, 1, 1]);
            frame.compute("indirect/cluster_assign", &self.assign, &[], &binds, lanes);
            let binds = [clustering, members, count, assigned, centres];
            if iteration < ITERATIONS {
                frame.compute("indirect/cluster_update", &self.update, &[], &binds, each);
            } else {
                let binds = [&binds[..], &[placed_vpls]].concat();
                frame.compute("indirect/cluster_emit", &self.emit, &[], &binds, each);
            }
        }
        let binds = [clustering, placed_vpls, count, ("vpl_count", (&placed.count).into())];
        frame.compute("indirect/cluster_finish", &self.finish, &[], &binds, one);
    }
}
