//! Imperfect shadow maps (Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination").
//!
//! A virtual point light (VPL) needs to know what stands between it and every place that it lights, but hardly notices if that
//! is told coarsely: hundreds of such shadows are added up. So each VPL has a small map of its hemisphere, drawn not from
//! triangles but from a few thousand points spread over the whole scene, a block of their own for each VPL; what gaps they
//! leave is filled from coarser levels (pull-push; Marroquim et al. 2007, "Efficient Point-Based Rendering Using Image
//! Reconstruction").
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | splat | points, VPLs and their number | `ism_atlas`: u32, tile after tile | a workgroup a block of 64² texels, kept in its memory |
//! | pull | `ism_atlas` | `ism_pyramid`: f32, levels from 1 on | the same |
//! | push | `ism_pyramid` | `ism_atlas`, in place | the same |
//! | picture, where asked for | `ism_atlas` | `ism_before`, `ism_after`: R32Float, metres, 0 = nothing | a lane a texel |
//!
//! | input | format | space, unit |
//! | --- | --- | --- |
//! | points | 16 bytes: position (3 f32), octahedral normal (2 snorm8), albedo (5-6-5, not read here) | world, m |
//! | VPLs | [`Vpl`](super::Vpl) | world, m, lm |
//! | their number | four u32 a set: how many, not read, number of the first | |
//! | output: an atlas | a texel: depth in the upper 19 bits, point of the block in the lower 13; 0xffffffff = nothing | distance / largest distance of the scene |
//!
//! `lookup.wesl` answers whether a VPL sees a place: `ism_visibility`.
//!
//! # Splat
//! The paraboloid map takes a direction ω of the hemisphere around z to p = ω.xy / (1 + ω.z) (Ritschel et al. 2008, after Brabec
//! et al. 2002), and solid angle to area by dA = dΩ / (1 + ω.z)². A point stands for A = scene area / points per VPL,
//! four times as much for each step of its exponent ([`super::points`]), and is taken for a disc of that area that turns away by θ. From d it covers the cap of half-angle α,
//!
//! tan α = √(A |cos θ| / π) / d,  and in the map a circle of centre ω.xy / (ω.z + cos α), radius sin α / (ω.z + cos α),
//!
//! which for small α is α / (1 + ω.z), times R / 2 in texels. Texels whose centres are inside take part, and the centre's own
//! always: a disc smaller than a texel is one texel large. Each texel's depth is that of the disc's plane, which goes on beyond
//! the disc away from the VPL: ended there, discs of slanted walls shadowed the walls themselves. Points lower than a tenth of
//! the disc's radius √(A / π) over the VPL's plane are the VPL's own surface and left out.
//!
//! A VPL that is infinitely far has the scene's box in its map, seen along its light: see `far.wesl`. A disc covers a circle of area
//! A |cos θ| there.
//!
//! # Pull and push
//! Pull (Marroquim et al. 2007): a coarser texel is the mean of those of its four finer ones that hold anything and are no
//! farther than 1 + t · 2^(l − 1) times the nearest, l the coarser level. Push: an empty texel becomes the mean of the
//! nearest four coarser ones with weights (9, 3, 3, 1) / 16 renormalised over those that hold anything. So does one farther than
//! 1 + t' · 2^l times the farthest of the four: a surface seen through the gaps of a nearer one. (Held against their mean,
//! each level would add a rim to what is in front: with two levels a plate's shadow became 1.7 times as large as it is, and 1.06
//! times so.) What is in front of its surroundings stays. Nothing beyond a tile's border takes part.
//!
//! # Limits
//! - Depth is cut to 11 bits of mantissa, off by at most 2⁻¹² of itself once the middle of the step is taken.
//! - What is nearer than the bias (a texel's width and half a disc's radius) to a surface does not shadow it: contact shadows
//!   are lost. Surfaces are compared with their own plane and do not shadow themselves, but for holes filled flatter than a
//!   slanted wall is: within a fortieth of a room from a corner a VPL loses 1 % of its light.
//! - Of what is seen edge-on, texels that look past its plane hold nothing.
//! - Filling reaches up to 2^(levels + 1) − 2 texels beyond what is there into what is empty, and closes gaps narrower than
//!   2^levels texels in what is in front, whether they are gaps between points or real.
//! - Discs are drawn at `indirect.splat` of their radius: at 0.8 light that gaps let through makes up for what round discs and the
//!   bias take, in the scenes that were measured.
//! - No circle's radius is more than a quarter of the tile: blockers nearer than one to two of a disc's radius are too small.
//! - 0x1fff stands for "no point", in filled texels: of a block of 8,192 points the last one's identity is lost.
//! - An atlas is as large as a binding may be; what is larger is several atlases ([`IsmRoom::atlases`]), and more than
//!   [`Ism::MOST_BYTES`] is refused.
//!
//! # Cost
//! 4 bytes a texel, and for coarser levels up to a third more. 1,024 VPLs of 8,000 points at 128²: atlas 64 MiB, two levels
//! 20 MiB. Bytes: points 131 MB (four times as much from caches, once for each block of a tile), the atlas written, read twice
//! and written in part, at most 268 MB, the levels written and read 42 MB: 441 MB, at 3.3 TB/s 0.13 ms. Operations: 33 M times
//! a point to place at about 80, 25 M texels to draw at 40, 17 M to fill at 40, together 4.3 Gflop, at 50 Tflop/s 0.09 ms. So
//! bytes are the limit, and three dispatches of 6 µs.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Mapping, Scale, Texture,
    TextureOptions, ViewHint,
};

use glam::Vec3;

use super::settings::IndirectSettings;
use super::slots::SOURCES;
use crate::{Kit, Pass, shaders};

const ATLAS: ViewHint = ViewHint::scaled(
    "Imperfect shadow maps, texel after texel: what is hotter is farther, nothing is white",
    Mapping::Heat,
    Scale::By(1.0 / 0x7f00_0000 as f32),
);
const PYRAMID: ViewHint = ViewHint::new(
    "Coarser levels of imperfect shadow maps: distance over the scene's largest",
    Mapping::Distance,
);
const BEFORE: ViewHint = ViewHint::scaled(
    "Imperfect shadow maps as the points leave them, beside each other: white is near, black is nothing",
    Mapping::Distance,
    Scale::OfScene(4.0),
);
const AFTER: ViewHint = ViewHint::scaled(
    "Imperfect shadow maps with their holes filled, beside each other: white is near, black is nothing",
    Mapping::Distance,
    Scale::OfScene(4.0),
);

/// Texels a side at most of a block that a workgroup keeps in its memory.
const BLOCK: u32 = 64;

/// A workgroup's memory that teams take: a block, 2,688 points that wait at two a word, 256 large ones, and two counts.
pub(crate) const TEAMS_BYTES: u32 = 4 * BLOCK * BLOCK + 2 * 2688 + 4 * 256 + 8;

/// As many workgroups as WebGPU lets start in a row.
const MOST_VPLS: u32 = 65_535;

/// What the passes know of an atlas; `atlas.wesl` holds its twin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct IsmData {
    pub(crate) largest_m: f32,
    pub(crate) point_area_m2: f32,
    pub(crate) resolution: u32,
    pub(crate) points_per_vpl: u32,
    pub(crate) pool: u32,
    pub(crate) first: u32,
    pub(crate) tiles: u32,
    pub(crate) levels: u32,
    pub(crate) pull_threshold: f32,
    pub(crate) push_threshold: f32,
    pub(crate) pyramid: u32,
    pub(crate) splat: f32,
    pub(crate) vpl_set: u32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
    pub(crate) reserved2: u32,
    pub(crate) half_m: [f32; 3],
    pub(crate) reserved3: u32,
    pub(crate) dense_at_ws: [f32; 3],
    pub(crate) dense_m: f32,
}

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct IsmInputs<'a> {
    /// 16 bytes a point.
    pub points: &'a Buffer,
    /// How many; blocks that reach beyond the last go on with the first.
    pub pool: u32,
    /// [`Vpl`](super::Vpl)s.
    pub vpls: &'a Buffer,
    /// For each set four words: how many, one that is not read here, and the number of the first.
    pub vpl_count: &'a Buffer,
    /// Number of the set whose maps are drawn.
    pub set: u32,
    /// Area of all that the points stand for, in units of what one of exponent 0 does, m².
    pub scene_area_m2: f32,
    /// Where they are densest, world space, and up to which distance from there, metres, where they are not so everywhere.
    pub dense: Option<(Vec3, f32)>,
    /// A box around the scene, metres.
    pub bounds_ws: (Vec3, Vec3),
}

/// How maps of so many VPLs are laid out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IsmPlan {
    /// Most VPLs.
    pub vpls: u32,
    /// Texels a side of a tile.
    pub resolution: u32,
    /// Coarser levels: no more than there are.
    pub levels: u32,
    /// Tiles of each atlas; the last may have fewer.
    pub tiles: u32,
}

impl IsmPlan {
    /// Lays them out on a device.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when they take more than [`Ism::MOST_BYTES`], a tile more than a binding, or they are more than
    /// 65,535.
    pub fn new(gpu: &Gpu, settings: &IndirectSettings, vpls: u32) -> Result<Self, GpuError> {
        let limits = &gpu.limits;
        Self::within(limits.max_storage_buffer_binding_size.min(limits.max_buffer_size), settings, vpls)
    }

    /// The same where a buffer may have so many bytes.
    ///
    /// # Errors
    /// As [`IsmPlan::new`].
    pub fn within(buffer_bytes: u64, settings: &IndirectSettings, vpls: u32) -> Result<Self, GpuError> {
        let resolution = settings.ism_texels();
        let levels = settings.levels.min(resolution.ilog2());
        let tile = 4 * u64::from(resolution).pow(2);
        let plan = Self {
            vpls: vpls.max(1),
            resolution,
            levels,
            tiles: (buffer_bytes / tile).min(MOST_VPLS.into()) as u32,
        };
        let refused = |needed, limit, unit| {
            Err(GpuError::TooLarge {
                what: format!("an atlas of {vpls} imperfect shadow maps of {resolution}²"),
                needed,
                limit,
                unit,
                advice: "make them smaller, or take fewer virtual lights",
            })
        };
        if vpls > MOST_VPLS {
            return refused(vpls.into(), MOST_VPLS.into(), "workgroups");
        }
        if plan.tiles == 0 {
            return refused(tile, buffer_bytes, "bytes");
        }
        // As many each, so that the last is not left with a few.
        let atlases = plan.vpls.div_ceil(plan.tiles);
        let plan = Self { tiles: plan.vpls.div_ceil(atlases), ..plan };
        if plan.bytes() > Ism::MOST_BYTES {
            return refused(plan.bytes(), Ism::MOST_BYTES, "bytes");
        }
        Ok(plan)
    }

    /// Bytes of all atlases and levels.
    pub fn bytes(self) -> u64 {
        let words = u64::from(self.resolution).pow(2) * u64::from(self.vpls);
        // All atlases share the levels of the largest.
        4 * (words + u64::from(self.pyramid()) * u64::from(self.tiles))
    }

    /// Words of a tile's coarser levels, up to where a block of it is a texel.
    fn pyramid(self) -> u32 {
        let last = self.levels.min(self.resolution.min(BLOCK).ilog2());
        (1..=last).map(|level| (self.resolution >> level).pow(2)).sum()
    }

    /// Blocks of a tile.
    fn blocks(self) -> u32 {
        (self.resolution / self.resolution.min(BLOCK)).pow(2)
    }
}

/// Tiles of some of the VPLs, as `lookup.wesl` binds them.
#[derive(Clone, Debug)]
pub struct IsmAtlas {
    /// A word a texel, tile after tile.
    pub words: Buffer,
    /// How it is read.
    pub uniform: Buffer,
    /// Number of the VPL that the first tile is of.
    pub first: u32,
    /// How many tiles there are.
    pub tiles: u32,
}

impl IsmAtlas {
    /// The handles of `lookup.wesl`.
    pub fn binds(&self) -> [Bind<'_>; 2] {
        [("ism_atlas", (&self.words).into()), ("ism", (&self.uniform).into())]
    }
}

/// What the maps are drawn into.
#[derive(Debug)]
pub struct IsmRoom {
    plan: IsmPlan,
    atlases: Vec<IsmAtlas>,
    pyramid: Buffer,
    // Workgroups: VPLs, blocks of a tile, 1.
    groups: Buffer,
    // Before and after pull-push.
    pictures: Option<[Texture; 2]>,
}

impl IsmRoom {
    /// Whether it serves a plan, with pictures of the tiles or without.
    pub fn serves(&self, plan: IsmPlan, pictures: bool) -> bool {
        self.plan == plan && self.pictures.is_some() == pictures
    }

    /// The maps, in the order of the VPLs.
    pub fn atlases(&self) -> &[IsmAtlas] {
        &self.atlases
    }

    /// Tiles beside each other before and after pull-push, R32Float metres, 0 where nothing is.
    pub fn pictures(&self) -> Option<&[Texture; 2]> {
        self.pictures.as_ref()
    }
}

/// The passes.
#[derive(Debug)]
pub struct Ism {
    splat: ComputePipeline,
    // Of sets that have VPLs infinitely far, where there are any.
    splat_far: Option<ComputePipeline>,
    pull: ComputePipeline,
    push: ComputePipeline,
    picture: ComputePipeline,
}

impl Pass for Ism {
    type Key = bool;

    /// With `far` for VPLs that are infinitely far, too.
    fn compile(kit: &Kit, far: &bool) -> Result<Self, GpuError> {
        let compile = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &entry, &[], &[]);
        let make = |entry| compile(shaders::plain(entry));
        let teams = kit.gpu.limits.max_compute_workgroup_storage_size >= TEAMS_BYTES;
        Ok(Self {
            splat: compile(shaders::ism_splat(teams, false))?,
            splat_far: far.then(|| compile(shaders::ism_splat(teams, true))).transpose()?,
            pull: make("indirect/ism/pull.cs.wesl")?,
            push: make("indirect/ism/push.cs.wesl")?,
            picture: make("indirect/ism/picture.cs.wesl")?,
        })
    }

    fn serves(has: &bool, wanted: &bool) -> bool {
        *has || !wanted
    }
}

impl Ism {
    /// Maps that need more are refused.
    pub const MOST_BYTES: u64 = 2 << 30;

    /// Room for the maps of a plan, and with `pictures` for what shows them. Not inside a frame.
    pub fn room(&self, gpu: &Gpu, plan: IsmPlan, pictures: bool) -> IsmRoom {
        let storage = |name, words: u32| {
            Buffer::new(gpu, name, Life::Frame, 4 * u64::from(words), BufferUsages::STORAGE)
        };
        let copied = BufferUsages::COPY_DST;
        let kept = |name, words: u32| {
            Buffer::new(gpu, name, Life::Kept, 4 * u64::from(words), BufferUsages::STORAGE)
        };
        let atlas = |first: u32| {
            let tiles = plan.tiles.min(plan.vpls - first);
            let size = size_of::<IsmData>() as u64;
            IsmAtlas {
                // Maps of VPLs that rest stay.
                words: kept("ism_atlas", tiles * plan.resolution.pow(2)).described(ATLAS),
                uniform: Buffer::new(gpu, "ism", Life::Frame, size, BufferUsages::UNIFORM | copied),
                first,
                tiles,
            }
        };
        // Those that fit a texture.
        let picture = |name, hint| {
            let fit = (gpu.limits.max_texture_dimension_2d / plan.resolution).max(1);
            let columns = plan.vpls.isqrt().max(1).min(fit);
            let rows = plan.vpls.div_ceil(columns).min(fit);
            let [width, height] = [columns, rows].map(|tiles| tiles * plan.resolution);
            let usage = TextureUsages::STORAGE_BINDING;
            let options = TextureOptions::new(width, height, TextureFormat::R32Float, usage);
            Texture::new(gpu, name, Life::Frame, options).described(hint)
        };
        let groups = [0, plan.blocks(), 1, 0];
        IsmRoom {
            plan,
            atlases: (0..plan.vpls).step_by(plan.tiles as usize).map(atlas).collect(),
            pyramid: storage("ism_pyramid", plan.pyramid() * plan.tiles).described(PYRAMID),
            groups: Buffer::with_data(gpu, "ism_groups", &groups, BufferUsages::INDIRECT | copied),
            pictures: pictures.then(|| [picture("ism_before", BEFORE), picture("ism_after", AFTER)]),
        }
    }

    /// Draws the maps of a set's VPLs, all of which have a tile in the room, and fills their holes.
    ///
    /// # Panics
    /// When they may be infinitely far and this was not compiled for such.
    pub fn record<'r>(
        &self,
        frame: &mut Frame<'_>,
        settings: &IndirectSettings,
        inputs: &IsmInputs<'_>,
        room: &'r IsmRoom,
    ) -> &'r [IsmAtlas] {
        let plan = room.plan;
        let splat = match &self.splat_far {
            _ if inputs.set != SOURCES => &self.splat,
            Some(splat) => splat,
            None => panic!("imperfect shadow maps were not compiled for what is infinitely far"),
        };
        let (lo, hi) = inputs.bounds_ws;
        let points_per_vpl = settings.points_per_vpl.min(inputs.pool).max(1);
        let (dense_at_ws, dense_m) = inputs.dense.unwrap_or_default();
        frame.copy((inputs.vpl_count, 16 * u64::from(inputs.set)), (&room.groups, 0), 4);
        for atlas in &room.atlases {
            let data = IsmData {
                largest_m: lo.distance(hi).max(f32::MIN_POSITIVE),
                point_area_m2: inputs.scene_area_m2 / points_per_vpl as f32,
                resolution: plan.resolution,
                points_per_vpl,
                pool: inputs.pool.max(1),
                first: atlas.first,
                tiles: atlas.tiles,
                levels: plan.levels,
                pull_threshold: settings.pull_threshold,
                push_threshold: settings.push_threshold,
                pyramid: plan.pyramid(),
                splat: settings.splat,
                vpl_set: inputs.set,
                reserved0: 0,
                reserved1: 0,
                reserved2: 0,
                half_m: (0.5 * (hi - lo)).to_array(),
                reserved3: 0,
                dense_at_ws: dense_at_ws.to_array(),
                dense_m,
            };
            frame.upload(&atlas.uniform, &[data]);
            let [words, uniform] = atlas.binds();
            let tiles = ("ism_tiles", words.1);
            let count = ("vpl_count", inputs.vpl_count.into());
            let pyramid = ("ism_pyramid", (&room.pyramid).into());
            let blocks = Dispatch::Indirect(&room.groups, 0);
            let show = |frame: &mut Frame<'_>, name, which: usize| {
                let Some(picture) = room.pictures.as_ref().map(|pictures| &pictures[which]) else { return };
                let binds = [words, uniform, count, ("ism_picture", picture.into())];
                let texels = [picture.options().width, picture.options().height, 1];
                frame.compute(name, &self.picture, &[], &binds, Dispatch::Threads(texels));
            };
            let binds =
                [uniform, count, ("points", inputs.points.into()), ("vpls", inputs.vpls.into()), tiles];
            frame.compute("indirect/ism_splat", splat, &[], &binds, blocks);
            show(frame, "indirect/ism_before", 0);
            if plan.levels > 0 {
                frame.compute(
                    "indirect/ism_pull",
                    &self.pull,
                    &[],
                    &[uniform, words, count, pyramid],
                    blocks,
                );
                frame.compute(
                    "indirect/ism_push",
                    &self.push,
                    &[],
                    &[uniform, count, pyramid, tiles],
                    blocks,
                );
            }
            show(frame, "indirect/ism_after", 1);
        }
        &room.atlases
    }
}

#[cfg(test)]
mod tests;
