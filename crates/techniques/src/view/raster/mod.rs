//! Depth and visibility rastered in compute: for GPUs whose fixed raster hardware is small beside their compute units.
//!
//! Triangles of a few texels are drawn by the lane that transformed them; larger ones are cut into tiles of up to 64×64
//! texels, drawn by a team of 32 lanes each (after Laine & Karras 2011, "High-
//! Performance Software Rasterization on GPUs", and the split by size of Karis et al. 2021, "Nanite"). Depth bits order
//! like positive floats, so an atomic maximum keeps the nearest and the map is the same every time. Edges are whole
//! numbers of 1/256 texel, as in hardware: no holes between neighbours, and the same texels as the hardware's.
//!
//! | step | reads | writes |
//! | --- | --- | --- |
//! | triangles, opaque and masked | draw lists, scene | depth bits, list of tiles |
//! | tiles, opaque and masked | list of tiles | depth bits |
//! | the same again, with numbers | depth bits, list of tiles | the smallest triangle number at each texel's depth |
//! | resolve | depth bits, numbers | R32Float maps, reversed depth; R32Uint triangle + 1; zeroed bits |
//!
//! Shadow maps are depth alone ([`ComputeRaster::record`], many views at once), a camera's view has numbers too
//! ([`ComputeRaster::record_visibility`], one view): what hardware leaves that draws a list in order and keeps the first of
//! equal depths.
//!
//! Limits: maps of at most [`ComputeRaster::MAX_RESOLUTION`], and 4 bytes a texel of all views of a batch in one storage
//! binding. Before the near plane casters are kept and their depth clamped to 1, or dropped, as each view says.
//! Cost: a read and, where visible, an atomic for every texel of every triangle, and 16 bytes a texel of the map.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{
    Bind, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, GroupLayout, Life, Texture, parallel,
};

use crate::scene::{CLASSES, OPAQUE};
use crate::scene::{SceneFacts, SceneGpu};
use crate::shaders;
use crate::view::culling::DrawLists;
use crate::view::{MAX_VIEWS, ViewTable};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct RasterData {
    pub(crate) size: [u32; 2],
    pub(crate) columns: u32,
    pub(crate) texels: u32,
    pub(crate) first: u32,
    pub(crate) capacity: u32,
    pub(crate) phase: u32,
    pub(crate) anisotropy: u32,
    pub(crate) footprint_scale: f32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
    pub(crate) reserved2: u32,
}

/// Words before the views' texels; see `raster.wesl`.
const HEADER: u64 = 32;
/// Texels across and down of a block.
const BLOCK: [u32; 2] = [8, 4];
/// Bytes of a tile in the work list.
const TILE_BYTES: u64 = 80;
/// The work list has room for a tile every so many texels of the maps, for so many at least, as small maps have more
/// triangles a texel, and for so many at most: what finds no room is drawn much more slowly. Sponza in four cascades of 2048²
/// needs about two fifths of it.
const TEXELS_PER_TILE: u64 = 16;
const MIN_TILES: u64 = 1 << 16;
const MAX_TILES: u64 = 3 << 19;
/// Lanes of a workgroup of the triangle pass, and its workgroups a view at most.
const TRIANGLE_LANES: u32 = 128;
const MAX_TRIANGLE_GROUPS: u32 = 32_768;
/// Workgroups that share the list of tiles: enough to fill the largest GPUs.
const TILE_GROUPS: u32 = 2048;
/// Blocks that a workgroup of the last pass takes.
const RESOLVE_BLOCKS: u32 = 32;

/// What is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draws {
    /// The depth of all surfaces, as shadow maps hold it.
    Depth {
        /// Only back faces.
        cull_front: bool,
    },
    /// Depth and triangle number of opaque surfaces, single-sided ones from their front.
    Numbers,
}

/// The passes of the compute rasteriser.
#[derive(Debug)]
pub struct ComputeRaster {
    draws: Draws,
    // Opaque, and masked where there are any.
    triangles: Vec<ComputePipeline>,
    tiles: Vec<ComputePipeline>,
    resolve: ComputePipeline,
}

/// What is drawn into.
#[derive(Debug)]
pub struct RasterRoom {
    // For depth; for numbers.
    uniforms: [Buffer; 2],
    depths: Buffer,
    tiles: Buffer,
    size: [u32; 2],
    views: u32,
    capacity: u32,
}

impl ComputeRaster {
    /// Texels a side at most.
    pub const MAX_RESOLUTION: u32 = 8192;

    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        scene_layout: &GroupLayout,
        facts: SceneFacts,
        draws: Draws,
    ) -> Result<Self, GpuError> {
        let materials = facts.constants();
        let numbers = draws == Draws::Numbers;
        let cull_front = draws == Draws::Depth { cull_front: true };
        let culls = [("CULL_FRONT", f64::from(u8::from(cull_front)))];
        let make = |permutation, constants: &[(&'static str, f64)]| {
            ComputePipeline::new(gpu, library, &permutation, &[scene_layout], constants)
        };
        let triangles = |kind| {
            let masked = kind > 0;
            let mut constants = if numbers { Vec::new() } else { culls.to_vec() };
            constants.extend(materials.iter().filter(|_| masked));
            make(shaders::raster_triangles(masked, numbers), &constants)
        };
        let tiles = |kind| {
            let masked = kind > 0;
            make(shaders::raster_tiles(masked, numbers), if masked { &materials } else { &[] })
        };
        let [_, _, masked, masked_both] = facts.draws(if numbers { OPAQUE } else { 0..CLASSES });
        let kinds = if masked || masked_both { 2 } else { 1 };
        let (triangles, tiles) =
            parallel::join(|| parallel::each(kinds, triangles), || parallel::each(kinds, tiles));
        Ok(Self {
            draws,
            triangles: triangles?,
            tiles: tiles?,
            resolve: make(shaders::raster_resolve(numbers), &[])?,
        })
    }

    /// How many views of a size fit one [`ComputeRaster::record`]; 0 = none, use the hardware.
    pub fn views_at_once(gpu: &Gpu, size: [u32; 2]) -> usize {
        Self::views_in(gpu.limits.max_storage_buffer_binding_size, size)
    }

    /// The same where buffers of so many bytes can be bound.
    pub fn views_in(binding_bytes: u64, size: [u32; 2]) -> usize {
        if size.into_iter().any(|side| side > Self::MAX_RESOLUTION) {
            return 0;
        }
        let fit =
            (binding_bytes.min(DEPTH_BUDGET_BYTES) / 4).saturating_sub(HEADER) / u64::from(texels(size));
        (fit as usize).min(MAX_VIEWS)
    }

    /// Bytes at most that depth and lists of so many views of a size take beside their maps, on any adapter.
    pub fn bytes(size: [u32; 2], views: usize) -> u64 {
        let all_texels =
            views.clamp(1, Self::views_in(u64::MAX, size).max(1)) as u64 * u64::from(texels(size));
        4 * (HEADER + all_texels) + TILE_BYTES * tiles(all_texels)
    }

    /// Whether a view of a size can be drawn with numbers: they take as much room as its depth.
    pub fn fits_visibility(gpu: &Gpu, size: [u32; 2]) -> bool {
        Self::views_at_once(gpu, size) >= 2
    }

    /// Room for so many views at once (at most [`ComputeRaster::views_at_once`]; one with numbers). Not inside a frame.
    pub fn room(&self, gpu: &Gpu, size: [u32; 2], views: usize) -> RasterRoom {
        let views = views.clamp(1, Self::views_at_once(gpu, size).max(1)) as u32;
        let all_texels = u64::from(views) * u64::from(texels(size));
        let capacity = tiles(all_texels);
        let buffer = |name, life, size| Buffer::new(gpu, name, life, size, BufferUsages::STORAGE);
        let words = HEADER + if self.draws == Draws::Numbers { 2 * all_texels } else { all_texels };
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = size_of::<RasterData>() as u64;
        RasterRoom {
            uniforms: [(); 2].map(|()| Buffer::new(gpu, "raster", Life::Frame, uniform, usage)),
            // Empty when made, and emptied by the last step of every frame.
            depths: buffer("raster_depths", Life::Kept, 4 * words),
            tiles: buffer("raster_tiles", Life::Frame, TILE_BYTES * capacity),
            size,
            views,
            capacity: capacity as u32,
        }
    }

    /// Draws views of a table, of those that the lists were culled for, into the layers of an R32Float array that shaders
    /// may write: as many at once as there is room for. They filter masked surfaces alike.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        scene: &SceneGpu,
        (table, lists): (&ViewTable, &DrawLists),
        views: Range<u32>,
        room: &RasterRoom,
        target: &Texture,
    ) {
        for first in views.clone().step_by(room.views as usize) {
            let count = room.views.min(views.end - first);
            let drawn = (table, lists, first..first + count);
            self.draw(frame, scene, drawn.clone(), (room, 0), &DEPTH_NAMES);
            let maps = ("maps", target.into());
            self.resolve(frame, "shadow/raster_resolve", drawn, room, &[maps]);
        }
    }

    /// Draws what a view of a table, one of those that the lists were culled for, sees of a scene's opaque surfaces: depth
    /// (R32Float, reversed) and triangle + 1 of the lists (R32Uint; 0 = nothing).
    pub fn record_visibility(
        &self,
        frame: &mut Frame<'_>,
        scene: &SceneGpu,
        (table, lists): (&ViewTable, &DrawLists),
        view: u32,
        room: &RasterRoom,
        (depth, visibility): (&Texture, &Texture),
    ) {
        let drawn = (table, lists, view..view + 1);
        for (phase, names) in (0..).zip([&VISIBILITY_NAMES, &NUMBER_NAMES]) {
            self.draw(frame, scene, drawn.clone(), (room, phase), names);
        }
        let targets = [("depth_map", depth.into()), ("visibility", visibility.into())];
        self.resolve(frame, "surface/raster_resolve", drawn, room, &targets);
    }

    // Triangles, then the tiles of large ones.
    fn draw(
        &self,
        frame: &mut Frame<'_>,
        scene: &SceneGpu,
        (table, lists, views): (&ViewTable, &DrawLists, Range<u32>),
        (room, phase): (&RasterRoom, usize),
        [triangles, tiles]: &[[&'static str; 2]; 2],
    ) {
        let uniform = &room.uniforms[phase];
        let first = lists.slot(views.start) as u32;
        let footprint_scale = table.views()[views.start as usize].footprint_scale;
        let shared = RasterData { anisotropy: table.anisotropy, footprint_scale, ..room.data() };
        frame.upload(uniform, &[RasterData { first, phase: phase as u32, ..shared }]);
        let binds = [
            ("raster", uniform.into()),
            ("views", table.batch(lists.views.start)),
            ("draw_arguments", (&lists.arguments).into()),
            ("draw_list", (&lists.list).into()),
            ("depths", (&room.depths).into()),
            ("tiles", (&room.tiles).into()),
        ];
        let group = &[scene.group()];
        let groups = scene.triangle_count.div_ceil(TRIANGLE_LANES).clamp(1, MAX_TRIANGLE_GROUPS);
        let of_views = Dispatch::Groups([groups, views.len() as u32, 1]);
        let kinds = if masked(scene, self.draws) { 2 } else { 1 };
        for (name, pipeline) in triangles.iter().zip(&self.triangles).take(kinds) {
            frame.compute(name, pipeline, group, &binds, of_views);
        }
        for (name, pipeline) in tiles.iter().zip(&self.tiles).take(kinds) {
            frame.compute(name, pipeline, group, &binds, Dispatch::Groups([TILE_GROUPS, 1, 1]));
        }
    }

    fn resolve(
        &self,
        frame: &mut Frame<'_>,
        name: &'static str,
        (table, lists, views): (&ViewTable, &DrawLists, Range<u32>),
        room: &RasterRoom,
        targets: &[Bind<'_>],
    ) {
        let mut binds = vec![
            ("raster", (&room.uniforms[0]).into()),
            ("views", table.batch(lists.views.start)),
            ("depths", (&room.depths).into()),
        ];
        binds.extend(targets);
        let columns = room.size[0].div_ceil(BLOCK[0]).div_ceil(RESOLVE_BLOCKS);
        let groups = [columns, room.size[1].div_ceil(BLOCK[1]), views.len() as u32];
        frame.compute(name, &self.resolve, &[], &binds, Dispatch::Groups(groups));
    }
}

impl RasterRoom {
    /// Whether it serves so many views of a size.
    pub fn serves(&self, size: [u32; 2], views: usize) -> bool {
        self.size == size && self.views as usize >= views
    }

    fn data(&self) -> RasterData {
        RasterData {
            size: self.size,
            columns: self.size[0].div_ceil(BLOCK[0]),
            texels: texels(self.size),
            capacity: self.capacity,
            ..Zeroable::zeroed()
        }
    }
}

/// Passes by name: triangles and tiles, each opaque and masked.
const DEPTH_NAMES: [[&str; 2]; 2] = [
    ["shadow/raster_triangles", "shadow/raster_masked"],
    ["shadow/raster_tiles", "shadow/raster_masked_tiles"],
];
const VISIBILITY_NAMES: [[&str; 2]; 2] = [
    ["surface/raster_triangles", "surface/raster_masked"],
    ["surface/raster_tiles", "surface/raster_masked_tiles"],
];
const NUMBER_NAMES: [[&str; 2]; 2] = [
    ["surface/raster_numbers", "surface/raster_masked_numbers"],
    ["surface/raster_tile_numbers", "surface/raster_masked_tile_numbers"],
];

/// Depth bits of the views drawn at once take at most this much.
const DEPTH_BUDGET_BYTES: u64 = 512 << 20;

/// Tiles that the work list has room for.
fn tiles(all_texels: u64) -> u64 {
    (all_texels / TEXELS_PER_TILE).clamp(MIN_TILES, MAX_TILES)
}

/// Texels of a map in whole blocks.
fn texels([width, height]: [u32; 2]) -> u32 {
    width.next_multiple_of(BLOCK[0]) * height.next_multiple_of(BLOCK[1])
}

/// Whether anything drawn has holes.
fn masked(scene: &SceneGpu, draws: Draws) -> bool {
    let first = &scene.class_first;
    first[2] < first[4] || (draws != Draws::Numbers && first[6] < scene.item_count)
}
