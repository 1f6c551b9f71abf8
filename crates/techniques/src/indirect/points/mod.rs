//! The point set: the scene as so many places of equal area, for whoever splats it instead of drawing it.
//!
//! Points stand for the triangles (Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect
//! Illumination", section 3, preprocessing): a triangle is chosen by its share of the area, a place on it evenly.
//! A point keeps the triangle's name and the place's barycentrics, so that whatever moves or bends takes it along. The
//! paper draws at random; here points are the first dimensions of Owen-scrambled Sobol points: the first says where on the
//! summed-up area, what is left of it within the triangle and the second where there (by Heitz 2019, without folds).
//! Clusters are compact and lie in a row, so that near on the sum is near in space. Any 2ᵏ points in a row, wherever they
//! begin, lie one in each of 2ᵏ equal parts of the area, so that a block of any length is a set of its own; where their number
//! is a power of two, a block may go on from the last point to the first. Every nth point would not do: those lie in one part.
//!
//! | step | reads | writes | format | space, unit |
//! | --- | --- | --- | --- | --- |
//! | [`PointData::build`] (CPU, any thread) | scene at a pose | `point_sources` | 3 words a point, see `build.rs` | – |
//! | [`Points::record`] | `point_sources`, scene group | `points` | 16 bytes a point, see `point.wesl` | world space, m |
//! | | | `point_facts` | [`PointFacts`] | m² |
//!
//! # Holes
//! Masked triangles count by how much of them is there, looked at in 4 to 64 places at the finest mip, two for each texel along
//! a side; a point that falls into a hole is drawn anew. Blended ones count by their mean alpha, and their points are as dense as
//! alpha says. What transmits carries none: light passes. Metals and unlit surfaces carry black ones, which block light.
//!
//! # Distance
//! In scenes of kilometres most points would be where nobody looks. [`PointData::build_for`] makes those far from a view
//! fewer (Ritschel et al. 2011, "Making Imperfect Shadow Maps View-Adaptive"; they have them follow the view's solid angle,
//! which leaves near ones a share that falls with the scene's size): beyond the distance f the area that a point
//! stands for grows with the cube of the distance, in steps of four up to 4¹⁵, so that a ground however wide has no more points
//! than the part of it within 1.6 f. f is twice the distance that half of the solid angle around the view is nearer than,
//! whatever stands before it. Large triangles are cut in parts for it. Where near points would not become at least twice as
//! dense, all stay as dense. The exponent lies in the sources' second word and in the lowest bits of the points'
//! positions; the area that is told ([`PointFacts::point_m2`]) is that of points with exponent 0.
//!
//! Points are for views from within f / 4; beyond, [`PointData::serves_from`] asks for others.
//!
//! # Limits
//! Areas are those of the pose that the points were built in: what a pose stretches has fewer points for its area. Places
//! have 16 bits along a triangle's side, 15 cm on one of 10 km. Of albedo there is one value a point, filtered over the
//! point's own area; normals are the triangle's, towards its front (double-sided surfaces show the same point from behind),
//! within 1°. A triangle without area in the pose of the build never has points. Masked and blended triangles have points of one
//! density, that of their nearest place. A triangle is cut in parts no smaller than 2⁻¹⁴ of it: one of 100 km has parts of 6 m.
//! 128 MiB hold 8,388,608 points.
//!
//! # Cost
//! 28 bytes a point on the GPU, 12 on the CPU. The update reads 12 bytes a point, its triangle and texels, and writes 16, in
//! frames in which something moved. Choosing 2,097,152 points takes, on two cores of an EPYC: 0.4 s of 1 million triangles,
//! 0.9 s where all of them are masked; 1.9 s of 8 million in one mesh, of which cutting them into clusters is 1.2 s, and
//! 0.8 s of 8 instances of one million.

mod build;
pub(in crate::indirect) mod coverage;
pub(in crate::indirect) mod sequence;
#[cfg(test)]
mod tests;
mod thinning;

pub use build::{PointData, PointOptions};
pub use thinning::Thinning;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, History, Life};
use glam::{Vec2, Vec3};

use crate::scene::{SceneFacts, SceneGpu};
use crate::{Kit, Pass, shaders};

/// Twin of `ROW` in `update.cs.wesl`.
const ROW: u32 = 32_768;
/// Threads of a workgroup there.
const GROUP: u32 = 64;

/// See `point.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct PointFacts {
    pub count: u32,
    pub point_m2: f32,
    pub reserved0: u32,
    pub reserved1: u32,
}

/// What a point's words say: twin of `Point` in `point.wesl`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// World space, metres.
    pub position_ws: Vec3,
    /// Of the triangle, towards its front.
    pub normal_ws: Vec3,
    /// Diffuse, linear Rec. 709.
    pub albedo: Vec3,
    /// It stands for 4 to this times [`PointFacts::point_m2`].
    pub exponent: u32,
}

impl Point {
    /// Reads one of `points`.
    pub fn unpack([x, y, z, w]: [u32; 4]) -> Self {
        let code = |shift: u32| f32::from((w >> shift) as u8 as i8) / 127.0;
        let e = Vec2::new(code(0), code(8)).max(Vec2::NEG_ONE);
        let up = 1.0 - e.x.abs() - e.y.abs();
        let folded = |own: f32, other: f32| (1.0 - other.abs()).copysign(own);
        let flat = if up >= 0.0 { e } else { Vec2::new(folded(e.x, e.y), folded(e.y, e.x)) };
        let root =
            Vec3::new((w >> 16 & 31) as f32 / 31.0, (w >> 21 & 63) as f32 / 63.0, (w >> 27) as f32 / 31.0);
        Self {
            position_ws: Vec3::from([x, y, z].map(f32::from_bits)),
            normal_ws: flat.extend(up).normalize_or(Vec3::Z),
            albedo: root * root,
            exponent: x & 1 | (y & 1) << 1 | (z & 3) << 2,
        }
    }
}

/// Points on the GPU.
#[derive(Debug)]
pub struct PointRoom {
    /// What shaders read, see `point.wesl`.
    pub points: Buffer,
    /// A uniform of [`PointFacts`].
    pub facts: Buffer,
    /// How many points there are.
    pub count: u32,
    sources: Buffer,
    data: u64,
    // The pose that they were found in, by scene.
    found: History<u64, u64>,
}

/// The pass that finds points where motion has put their triangles.
#[derive(Debug)]
pub struct Points {
    pipeline: ComputePipeline,
    facts: SceneFacts,
}

impl Pass for Points {
    type Key = SceneFacts;

    fn compile(kit: &Kit, facts: &SceneFacts) -> Result<Self, GpuError> {
        let entry = shaders::plain("indirect/points/update.cs.wesl");
        let shared = &[&kit.scene_layout];
        let pipeline = ComputePipeline::new(&kit.gpu, &kit.library, &entry, shared, &facts.constants())?;
        Ok(Self { pipeline, facts: *facts })
    }

    fn serves(has: &SceneFacts, wanted: &SceneFacts) -> bool {
        has.serve(*wanted)
    }
}

impl Points {
    /// Room for points: what is there if it holds these. Not inside a frame.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the adapter cannot bind so many.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        data: &PointData,
        room: &'r mut Option<PointRoom>,
    ) -> Result<&'r mut PointRoom, GpuError> {
        let needed = u64::from(data.len()) * size_of::<[u32; 4]>() as u64;
        let limit = gpu.limits.max_storage_buffer_binding_size;
        if needed > limit {
            return Err(GpuError::TooLarge {
                what: "the scene's points".into(),
                needed,
                limit,
                unit: "bytes",
                advice: "use fewer points",
            });
        }
        Ok(chiaro_gpu::keep(
            room,
            |room| room.data == data.id,
            || {
                let facts = PointFacts {
                    count: data.len(),
                    point_m2: data.point_m2 as f32,
                    reserved0: 0,
                    reserved1: 0,
                };
                let words = data.sources.as_flattened();
                PointRoom {
                    points: Buffer::new(
                        gpu,
                        "points",
                        Life::Kept,
                        needed,
                        BufferUsages::STORAGE | BufferUsages::COPY_DST,
                    ),
                    facts: Buffer::with_data(gpu, "point_facts", &[facts], BufferUsages::UNIFORM),
                    count: facts.count,
                    sources: Buffer::with_data(gpu, "point_sources", words, BufferUsages::STORAGE),
                    data: data.id,
                    found: History::default(),
                }
            },
        ))
    }

    /// Finds the points again if the scene has moved since, or the room is new. After [`crate::scene::motion::Motion`].
    pub fn record(&self, frame: &mut Frame<'_>, scene: &SceneGpu, room: &mut PointRoom) {
        debug_assert!(self.facts.serve(scene.facts), "points: compiled for another scene");
        let pose = scene.motion.generation();
        if room.found.get(&scene.id()) == Some(&pose) {
            return;
        }
        room.found.keep(scene.id(), pose);
        if room.count == 0 {
            frame.clear(&room.points);
            return;
        }
        let binds = [
            ("point_sources", (&room.sources).into()),
            ("point_facts", (&room.facts).into()),
            ("points", (&room.points).into()),
        ];
        let groups = room.count.div_ceil(GROUP);
        let groups = Dispatch::Groups([groups.min(ROW), groups.div_ceil(ROW), 1]);
        frame.compute("indirect/points", &self.pipeline, &[scene.group()], &binds, groups);
    }
}
