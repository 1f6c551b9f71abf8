//! Motion vectors: how far what each pixel shows has moved since the frame before, and whether it was seen then. What
//! a technique keeps from frame to frame it looks up where things were, and trusts where they were seen.
//!
//! | output | format | unit |
//! | --- | --- | --- |
//! | motion | Rgba32Float | pixels right, pixels down, metres away from the camera's plane; 1 where this was seen in the frame before |
//! | seen | Rg32Uint | metres along the camera's axis (0: sky), bits of a float; normal of the triangle, octahedral |
//!
//! Of see-through surfaces the nearest moves. A mirror image and what is seen through glass do not move with it; shadows and
//! highlights move by themselves. Cost: 4 bytes a pixel of visibility and 8 of the frame before read, 24 written, and the
//! triangle's corners now and before.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Scale, Texture,
    TextureOptions, TexturePool, ViewHint,
};
use glam::{Mat4, Vec3, Vec4};

use super::culling::DrawLists;
use super::{SurfaceRoom, ViewTable};
use crate::scene::SceneGpu;
use crate::{Kit, Pass, shaders};

/// How to look at motion: a pixel is a quarter of the way to full colour.
pub const MOTION: ViewHint = ViewHint::scaled(
    "How far things have moved since the frame before: red right, green down (pixels), blue away (m); grey rests",
    Mapping::Range,
    Scale::By(0.25),
);

/// See `motion_vectors.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub(crate) struct MomentsData {
    pub(crate) clip_from_ws_now: [[f32; 4]; 4],
    pub(crate) clip_from_ws_before: [[f32; 4]; 4],
    pub(crate) depth_now: [f32; 4],
    pub(crate) depth_before: [f32; 4],
    pub(crate) pixel_m: f32,
    pub(crate) continues: u32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
}

/// Where a frame is seen from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Without jitter.
    pub clip_from_ws: Mat4,
    /// The camera's place.
    pub eye_ws: Vec3,
    /// And axis.
    pub forward_ws: Vec3,
    /// A pixel's side: metres at a distance of one metre; of an orthographic camera, metres.
    pub pixel_m: f32,
}

impl Moment {
    fn depth(&self) -> [f32; 4] {
        let offset = -self.forward_ws.dot(self.eye_ws);
        Vec4::from((self.forward_ws, offset)).to_array()
    }
}

/// What motion is written into, of one size.
#[derive(Debug)]
pub struct MotionRoom {
    motion: Texture,
    // They take turns.
    seen: [Texture; 2],
    turn: usize,
    uniform: Buffer,
}

/// Motion, and what is seen now.
#[derive(Clone, Debug)]
pub struct MotionOutputs {
    /// Rgba32Float.
    pub motion: Texture,
    /// Rg32Uint.
    pub seen: Texture,
}

/// The pass.
#[derive(Debug)]
pub struct MotionVectors {
    pipeline: ComputePipeline,
    layered: bool,
}

impl Pass for MotionVectors {
    /// Whether scenes have see-through surfaces.
    type Key = bool;

    fn compile(kit: &Kit, &layered: &bool) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let entry = shaders::motion_vectors(layered);
        let pipeline = ComputePipeline::new(gpu, library, &entry, &[frame_layout, scene_layout], &[])?;
        Ok(Self { pipeline, layered })
    }

    fn serves(&has: &bool, &wanted: &bool) -> bool {
        has || !wanted
    }
}

impl MotionVectors {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        room: &'r mut Option<MotionRoom>,
    ) -> &'r MotionRoom {
        let serves = |room: &MotionRoom| {
            let has = room.motion.options();
            [has.width, has.height] == size
        };
        chiaro_gpu::keep(room, serves, || {
            let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
            let lend = |name, life, format| {
                pool.lend(gpu, name, life, TextureOptions::new(size[0], size[1], format, usage))
            };
            let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            MotionRoom {
                motion: lend("motion", Life::Frame, TextureFormat::Rgba32Float).described(MOTION),
                seen: [0, 1].map(|_| lend("seen", Life::Kept, TextureFormat::Rg32Uint)),
                turn: 0,
                uniform: Buffer::new(gpu, "moments", Life::Frame, size_of::<MomentsData>() as u64, uniform),
            }
        })
    }

    /// Motion of what a view of a table shows, since the moment before if there was one; `layer` is the nearest layer of
    /// see-through surfaces.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (table, lists, view): (&ViewTable, &DrawLists, u32),
        (surface, layer): (&SurfaceRoom, Option<&Texture>),
        (now, before): (&Moment, Option<&Moment>),
        room: &mut MotionRoom,
    ) -> MotionOutputs {
        room.turn ^= 1;
        let (seen, seen_before) = (&room.seen[room.turn], &room.seen[room.turn ^ 1]);
        let past = before.unwrap_or(now);
        let moments = MomentsData {
            clip_from_ws_now: now.clip_from_ws.to_cols_array_2d(),
            clip_from_ws_before: past.clip_from_ws.to_cols_array_2d(),
            depth_now: now.depth(),
            depth_before: past.depth(),
            pixel_m: now.pixel_m,
            continues: u32::from(before.is_some()),
            reserved0: 0,
            reserved1: 0,
        };
        frame.upload(&room.uniform, &[moments]);
        let mut binds = vec![
            ("view", table.view(view)),
            ("moments", (&room.uniform).into()),
            ("visibility", (&surface.buffer.visibility).into()),
            ("draw_list", (&lists.list).into()),
            ("seen_before", seen_before.into()),
            ("motion", (&room.motion).into()),
            ("seen", seen.into()),
        ];
        if self.layered {
            // Without a layer, what is opaque is the nearest.
            binds.push(("layer_visibility", layer.unwrap_or(&surface.buffer.visibility).into()));
        }
        let options = room.motion.options();
        let threads = Dispatch::Threads([options.width, options.height, 1]);
        frame.compute(
            "surface/motion_vectors",
            &self.pipeline,
            &[frame_group, scene.group()],
            &binds,
            threads,
        );
        MotionOutputs { motion: room.motion.clone(), seen: seen.clone() }
    }
}
