//! Cluster culling of a batch of views with compacted draw lists.
//!
//! | step | reads | writes |
//! | --- | --- | --- |
//! | count | items, view planes | triangles per (view, item), 0 = culled |
//! | scan | those | offsets; draw arguments per (view, class) |
//! | expand | offsets, cluster triangles | draw list: item << 8 \| vertex, 3 a triangle |
//!
//! A prefix sum instead of appending keeps the list's order, and with it the image, the same every time. One indirect
//! draw per view and class serves everything: no multi-draw, no first-instance feature.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, CompareFunction, WasmNotSendSync};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Draw, Frame, Gpu, GpuError, Life, RenderPass, RenderPipeline, parallel,
};

use super::{MAX_VIEWS, ViewTable};
use crate::scene::{CLASSES, KINDS, SceneGpu};
use crate::{Kit, Pass, shaders};

/// Every view keeps reversed depth: 1 near, 0 far.
pub const DEPTH_COMPARE: CompareFunction = CompareFunction::Greater;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct CullClasses {
    pub(crate) first: [u32; CLASSES],
    pub(crate) item_count: u32,
    pub(crate) list_stride: u32,
    pub(crate) row: u32,
    _pad: u32,
}

const ARGUMENT_BYTES: u64 = 20;
/// Workgroups a row of dispatches: WebGPU takes 65,535 a dimension. Short, so that scenes of tests have several.
const ROW: u32 = 1024;

/// The culling passes.
#[derive(Debug)]
pub struct Culling {
    count: ComputePipeline,
    scan: ComputePipeline,
    expand: ComputePipeline,
}

/// What a batch of views is culled into.
#[derive(Debug)]
pub struct ListRoom {
    classes: Buffer,
    offsets: Buffer,
    list: Buffer,
    arguments: Buffer,
    view_capacity: usize,
    items: u32,
    triangles: u32,
}

/// Draws of the culled views.
#[derive(Clone, Debug)]
pub struct DrawLists {
    /// `item << 8 | vertex`, three a triangle.
    pub list: Buffer,
    /// `DrawIndexedIndirect` per (view, class).
    pub arguments: Buffer,
    /// Which views of the table were culled.
    pub views: Range<u32>,
}

impl DrawLists {
    /// Where a view stands among those that were culled with it.
    ///
    /// # Panics
    /// When it was not: a mistake in the calling pass.
    pub fn slot(&self, view: u32) -> usize {
        assert!(self.views.contains(&view), "view {view} was not culled with {:?}", self.views);
        (view - self.views.start) as usize
    }

    /// Draws one class of a view: indexed by the list, or with vertices that fetch the list themselves.
    pub fn draw(&self, view: u32, class: usize, indexed: bool) -> Draw<'_> {
        let offset = (self.slot(view) * CLASSES + class) as u64 * ARGUMENT_BYTES;
        if indexed {
            Draw::IndexedIndirect { indices: &self.list, arguments: &self.arguments, offset }
        } else {
            Draw::Indirect(&self.arguments, offset)
        }
    }
}

impl ListRoom {
    /// Room for a scene in so many views, at most [`Culling::views_at_once`]. Not inside a frame.
    pub fn new(gpu: &Gpu, scene: &SceneGpu, views: usize) -> Self {
        let views = views.clamp(1, Culling::views_at_once(gpu, scene));
        let storage = BufferUsages::STORAGE;
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let list = 12 * u64::from(scene.triangle_count) * views as u64;
        // As a uniform its size is that of the shader's array.
        let arguments = (MAX_VIEWS * CLASSES) as u64 * ARGUMENT_BYTES;
        let buffer = |name, size, usage| Buffer::new(gpu, name, Life::Frame, size, usage);
        Self {
            classes: buffer("cull_classes", size_of::<CullClasses>() as u64, uniform),
            offsets: buffer("cull_offsets", 4 * u64::from(scene.item_count) * views as u64, storage),
            list: buffer("draw_list", list, storage | BufferUsages::INDEX),
            arguments: buffer(
                "draw_arguments",
                arguments,
                storage | BufferUsages::INDIRECT | BufferUsages::UNIFORM,
            ),
            view_capacity: views,
            items: scene.item_count,
            triangles: scene.triangle_count,
        }
    }

    /// Whether it serves so many views of a scene.
    pub fn serves(&self, scene: &SceneGpu, views: usize) -> bool {
        self.view_capacity >= views
            && self.items == scene.item_count
            && self.triangles == scene.triangle_count
    }
}

impl Pass for Culling {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let shared = &[&kit.scene_layout];
        let make = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), shared, &[]);
        let (count, (scan, expand)) = parallel::join(
            || make("view/cull_count.cs.wesl"),
            || parallel::join(|| make("view/cull_scan.cs.wesl"), || make("view/cull_expand.cs.wesl")),
        );
        Ok(Self { count: count?, scan: scan?, expand: expand? })
    }
}

impl Culling {
    /// How many views of a scene fit one [`Culling::record`].
    pub fn views_at_once(gpu: &Gpu, scene: &SceneGpu) -> usize {
        let list = u64::from(scene.triangle_count.max(1)) * 12;
        let fit = gpu.limits.max_storage_buffer_binding_size.min(LIST_BUDGET_BYTES) / list;
        (fit as usize).clamp(1, MAX_VIEWS)
    }

    /// Culls the scene for some neighbouring views of a table, which was uploaded.
    ///
    /// # Panics
    /// When there is too little room: a mistake in the calling code.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        scene: &SceneGpu,
        table: &ViewTable,
        views: Range<u32>,
        room: &ListRoom,
    ) -> DrawLists {
        assert!(room.serves(scene, views.len()), "room for other than {} views", views.len());
        let classes = CullClasses {
            first: scene.class_first,
            item_count: scene.item_count,
            list_stride: scene.triangle_count,
            row: ROW,
            _pad: 0,
        };
        frame.upload(&room.classes, &[classes]);
        let view_count = views.len() as u32;
        let over = |groups: u32| Dispatch::Groups([groups.min(ROW), view_count, groups.div_ceil(ROW)]);
        let group = &[scene.group()];
        let (classes, offsets) = (("classes", (&room.classes).into()), ("offsets", (&room.offsets).into()));
        let binds = [classes, ("views", table.batch(views.start)), offsets];
        frame.compute("view/cull_count", &self.count, group, &binds, over(scene.item_count.div_ceil(64)));
        let binds = [classes, offsets, ("draw_arguments", (&room.arguments).into())];
        frame.compute("view/cull_scan", &self.scan, group, &binds, Dispatch::Groups([view_count, 1, 1]));
        let binds = [classes, offsets, ("draw_list", (&room.list).into())];
        frame.compute("view/cull_expand", &self.expand, group, &binds, over(scene.item_count));
        DrawLists { list: room.list.clone(), arguments: room.arguments.clone(), views }
    }
}

/// Draw lists of the views culled at once take at most this much.
const LIST_BUDGET_BYTES: u64 = 128 << 20;

/// Pipelines by kind of class, of those kinds that there are.
pub type Kinds = [Option<RenderPipeline>; KINDS];

/// Makes the pipelines of the kinds that are drawn.
///
/// # Errors
/// Those of `make`.
pub fn kinds(
    drawn: [bool; KINDS],
    make: impl Fn(usize) -> Result<RenderPipeline, GpuError> + WasmNotSendSync,
) -> Result<Kinds, GpuError> {
    let made = parallel::each(KINDS, |kind| drawn[kind].then(|| make(kind)).transpose())?;
    let mut made = made.into_iter();
    Ok(std::array::from_fn(|_| made.next().flatten()))
}

/// The same where faces of both sides are drawn alike: one pipeline for masked kinds, one for the others.
///
/// # Errors
/// Those of `make`.
pub fn kinds_by_mask(
    drawn: [bool; KINDS],
    make: impl Fn(bool) -> Result<RenderPipeline, GpuError> + WasmNotSendSync,
) -> Result<Kinds, GpuError> {
    let made = parallel::each(2, |masked| {
        let wanted = drawn[2 * masked] || drawn[2 * masked + 1];
        wanted.then(|| make(masked == 1)).transpose()
    })?;
    Ok(std::array::from_fn(|kind| made[kind / 2].clone().filter(|_| drawn[kind])))
}

/// Draws some classes of a view with pipelines by kind of class. A kind without one has nothing to draw.
pub fn draw_classes(
    pass: &mut RenderPass<'_, '_>,
    pipelines: &Kinds,
    classes: Range<usize>,
    shared: &[&chiaro_gpu::Group],
    binds: &[chiaro_gpu::Bind<'_>],
    (lists, view, indexed): (&DrawLists, u32, bool),
) {
    for class in classes {
        if let Some(pipeline) = &pipelines[class % KINDS] {
            pass.draw(pipeline, shared, binds, lists.draw(view, class, indexed));
        }
    }
}
