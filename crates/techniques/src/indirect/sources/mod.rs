//! Virtual point lights (VPLs) on what shines itself: glowing meshes, and the surroundings, be they an environment map or a sky.
//!
//! A lamp has a place and a shadow map; a glowing sign or a sky shines from everywhere. So they are taken for sets of VPLs
//! (Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination", section 5, natural
//! illumination and area lights), each with an imperfect shadow map as any other has one. What they give the first surface is
//! direct light with soft shadows; what that scatters on is found in their maps ([`super::bounces`]) and is indirect light.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | choice (CPU, any thread), once a scene | scene at rest | `source_pool`: places, three u32 each, and directions, four u32 each | |
//! | place | those, scene | VPLs of the set [`SOURCES`], `vpl_count` | a lane each |
//! | their maps: [`super::ism`] | | | |
//! | what they give: [`super::gather`] | | `irradiance` of direct light | |
//! | VPLs where they shine: [`super::bounces`] | | VPLs of the set [`SCATTERED`](super::SCATTERED) | |
//!
//! # Flux
//! Places of glowing triangles are chosen by luminance × area, L(x) dA over its sum W: textures, masks and both sides count. Each of N
//! stands for the area W / (N L) and sends out π L times that, all the same luminance, as Lambert's law has it. Directions ω of
//! surroundings are chosen by luminance × solid angle with the density p, and give L(ω) / (N p) lux across them; so a bright
//! pixel of a map is not missed. VPLs of both kinds lie evenly among each other, so that each pixel of a square of interleaved
//! ones has its share of both.
//!
//! A VPL that is infinitely far has the scene's box for its map, seen along its light: texels are that box's extent over the map's
//! side. Its flux is its illuminance × the map's area.
//!
//! # Limits
//! - A map of the whole scene is coarse: what is nearer than a texel or two to what it shadows does not. In a scene of 40 m and maps
//!   of 128² that is 30 cm.
//! - Gloss shows the surroundings as it does without this, and what glows not at all where there are surroundings, else as if it
//!   was as bright from everywhere.
//! - Luminance × area is that of the scene at rest: what a pose stretches shines as much as before.
//! - Half of the VPLs are for what glows and half for surroundings, where both are there.
//! - What the first bounce's VPLs are placed by is flux alone, not what they bring the picture.
//!
//! # Rest
//! In moving pictures these VPLs, those where they shine, and the maps of both stay as long as nothing moves and the surroundings
//! are the same: only what they give the picture is gathered anew.
//!
//! # Cost
//! 12 bytes a place and 16 a direction, 4,096 each. A dispatch of 6 µs, and what maps and gathering take a VPL.

mod glow;
mod surroundings;

pub use glow::GlowData;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life};
use chiaro_scene as cs;
use glam::Vec3;

use super::slots::{SOURCES, Slots};
use crate::scene::{SceneFacts, SceneGpu};
use crate::{Kit, Pass, shaders};

/// See `sources.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct SourceData {
    pub(crate) count: u32,
    pub(crate) glowing: u32,
    pub(crate) first: u32,
    pub(crate) first_block: u32,
    pub(crate) round: u32,
    pub(crate) places: u32,
    pub(crate) directions: u32,
    pub(crate) reserved2: u32,
    pub(crate) glow: f32,
    pub(crate) radius: f32,
    pub(crate) turn: [f32; 2],
    pub(crate) middle_ws: [f32; 3],
    pub(crate) reserved0: u32,
    pub(crate) nits: [f32; 3],
    pub(crate) reserved1: u32,
}

/// Places and directions that a scene's light may come from, on the GPU.
#[derive(Clone, Debug)]
pub struct SourcePool {
    words: Buffer,
    place_count: u32,
    direction_count: u32,
    glow: f32,
}

impl SourcePool {
    /// Chooses and uploads them; any thread may do it.
    pub fn upload(gpu: &Gpu, scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let glow = GlowData::build(scene, pose);
        let directions = surroundings::directions(scene.environment.as_ref());
        let nowhere = [[0; 3]];
        let places = if glow.places.is_empty() { &nowhere[..] } else { &glow.places };
        let words = [places.as_flattened(), directions.as_flattened()].concat();
        Self {
            words: Buffer::with_data(gpu, "source_pool", &words, BufferUsages::STORAGE),
            place_count: glow.places.len() as u32,
            direction_count: directions.len() as u32,
            glow: glow.glow as f32,
        }
    }

    /// Whether anything in the scene glows.
    pub fn glows(&self) -> bool {
        self.place_count > 0 && self.glow > 0.0
    }
}

/// What surrounds a scene; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Factor on the map's radiance, or the radiance of a sky; 0 without either.
    pub nits: Vec3,
    /// Turn about the vertical, radians.
    pub turn: f32,
}

/// What the passes are told through.
#[derive(Debug)]
pub struct SourceRoom {
    uniform: Buffer,
    count: Buffer,
}

/// The pass.
#[derive(Debug)]
pub struct Sources {
    place: ComputePipeline,
    facts: SceneFacts,
}

impl Pass for Sources {
    type Key = SceneFacts;

    fn compile(kit: &Kit, facts: &SceneFacts) -> Result<Self, GpuError> {
        let entry = shaders::plain("indirect/sources/place.cs.wesl");
        let shared = &[&kit.scene_layout];
        let place = ComputePipeline::new(&kit.gpu, &kit.library, &entry, shared, &facts.constants())?;
        Ok(Self { place, facts: *facts })
    }

    fn serves(has: &SceneFacts, wanted: &SceneFacts) -> bool {
        has.serve(*wanted)
    }
}

impl Sources {
    /// Not inside a frame.
    pub fn room(&self, gpu: &Gpu) -> SourceRoom {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let bytes = size_of::<SourceData>() as u64;
        let copied = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        SourceRoom {
            uniform: Buffer::new(gpu, "sources", Life::Frame, bytes, usage),
            count: Buffer::new(gpu, "source_count", Life::Frame, 16, copied),
        }
    }

    /// Places VPLs on what shines, of which there is something. `round` counts the frames of a still: each goes on where the one
    /// before ended. Into `vpls` and their number, as gathering reads them.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (slots, round): (&Slots, u32),
        scene: &SceneGpu,
        (pool, around): (&SourcePool, Surroundings),
        (vpls, vpl_count): (&Buffer, &Buffer),
        room: &SourceRoom,
    ) {
        debug_assert!(self.facts.serve(scene.facts), "sources: compiled for another scene");
        let own = slots.of(SOURCES);
        let count = own.len() as u32;
        let glowing = match (pool.glows(), around.nits.max_element() > 0.0) {
            (true, true) => count / 2,
            (true, false) => count,
            (false, _) => 0,
        };
        let (lo, hi) = scene.bounds_ws;
        let data = SourceData {
            count,
            glowing,
            first: own.start,
            first_block: round.wrapping_mul(slots.all()).wrapping_add(own.start),
            round,
            places: pool.place_count.max(1),
            directions: pool.direction_count.max(1),
            reserved2: 0,
            glow: pool.glow,
            radius: 0.5 * lo.distance(hi).max(f32::MIN_POSITIVE),
            turn: [around.turn.cos(), around.turn.sin()],
            middle_ws: lo.midpoint(hi).to_array(),
            reserved0: 0,
            nits: around.nits.to_array(),
            reserved1: 0,
        };
        frame.upload(&room.uniform, &[data]);
        frame.upload(&room.count, &[[count, 0, own.start, 0]]);
        frame.copy((&room.count, 0), (vpl_count, 16 * u64::from(SOURCES)), 16);
        let binds = [
            ("sources", (&room.uniform).into()),
            ("source_pool", (&pool.words).into()),
            ("vpls", vpls.into()),
        ];
        let each = Dispatch::Threads([count, 1, 1]);
        frame.compute("indirect/sources", &self.place, &[scene.group()], &binds, each);
    }
}
