//! Cluster culling per view with compacted draw lists.
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
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{BufferUsages, CompareFunction, WasmNotSendSync};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Draw, Frame, Gpu, GpuError, GroupLayout, Life, RenderPass,
    RenderPipeline, parallel,
};
use glam::{Mat4, Vec3, Vec4, Vec4Swizzles};

use super::scene::{CLASSES, KINDS, SceneGpu};
use crate::shaders;

/// Views of one [`Culling::record`] at most.
pub const MAX_VIEWS: usize = 64;

/// Every view keeps reversed depth: 1 near, 0 far.
pub const DEPTH_COMPARE: CompareFunction = CompareFunction::Greater;

/// A view to cull for.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct CullView {
    pub(crate) planes: [[f32; 4]; 6],
    pub(crate) eye_ws: [f32; 4],
    pub(crate) flags: [u32; 4],
    pub(crate) hole: [[f32; 4]; 2],
}

/// A prism along parallel rays that another view draws: what lies wholly inside is left to it. Metres from its middle plane
/// = xyz · position + w, twice, each less than the half side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// Across, two ways.
    pub rows: [Vec4; 2],
    /// Metres.
    pub half: f32,
}

impl CullView {
    /// A view of reversed depth. With `keep_before_near`, casters between the light and the near plane stay.
    ///
    /// `eye_ws`: the eye with w = 1, or the direction of parallel rays with w = 0.
    pub fn new(clip_from_ws: &Mat4, eye_ws: Vec4, drop_back_faces: bool, keep_before_near: bool) -> Self {
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| clip_from_ws.row(row));
        // Gribb & Hartmann 2001: clip-space inequalities as planes. Reversed depth: near is z ≤ w, far is z ≥ 0.
        let near = if keep_before_near { Vec4::W } else { w - z };
        let planes = [w + x, w - x, w + y, w - y, z, near].map(|plane| {
            let length = plane.xyz().length();
            // An infinite far plane has no normal: nothing is beyond it.
            if length > 1e-30 { (plane / length).to_array() } else { [0.0, 0.0, 0.0, 1.0] }
        });
        Self {
            planes,
            eye_ws: eye_ws.to_array(),
            flags: [u32::from(drop_back_faces), 0, 0, 0],
            hole: [[0.0; 4]; 2],
        }
    }

    /// A view of all on a plane's positive side.
    pub fn of_plane(plane: Vec4, eye_ws: Vec4) -> Self {
        let mut planes = [[0.0, 0.0, 0.0, 1.0]; 6];
        planes[0] = (plane / plane.xyz().length().max(1e-30)).to_array();
        Self { planes, eye_ws: eye_ws.to_array(), flags: [0; 4], hole: [[0.0; 4]; 2] }
    }

    /// Leaves out what lies wholly in a hole.
    #[must_use]
    pub fn without(mut self, hole: Option<Hole>) -> Self {
        if let Some(Hole { rows, half }) = hole {
            self.flags[1] = half.to_bits();
            self.hole = rows.map(|row| row.to_array());
        }
        self
    }

    /// Whether a sphere may be seen; twin of the shader's test.
    pub fn sees(&self, center: Vec3, radius: f32) -> bool {
        let half = f32::from_bits(self.flags[1]);
        let within = |&[x, y, z, w]: &[f32; 4]| (Vec3::new(x, y, z).dot(center) + w).abs() + radius < half;
        if self.hole.iter().all(within) {
            return false;
        }
        self.planes.iter().all(|&[x, y, z, w]| Vec3::new(x, y, z).dot(center) + w > -radius)
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct CullClasses {
    pub(crate) first: [u32; CLASSES],
    pub(crate) item_count: u32,
    pub(crate) list_stride: u32,
    _pad: [u32; 2],
}

/// A view that the GPU made, to be culled for in the place of one given to [`Culling::record`].
#[derive(Clone, Copy, Debug)]
pub struct Over<'a> {
    /// [`CullView`]s.
    pub views: &'a Buffer,
    /// Which of them.
    pub from: usize,
    /// The view whose place it takes.
    pub to: usize,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct CullViews {
    count: [u32; 4],
    views: [CullView; MAX_VIEWS],
}

const ARGUMENT_BYTES: u64 = 20;
const EXPAND_ROW: u32 = 32_768;

/// The culling passes and their buffers for a number of views.
#[derive(Debug)]
pub struct Culling {
    count: ComputePipeline,
    scan: ComputePipeline,
    expand: ComputePipeline,
    buffers: Option<Buffers>,
}

#[derive(Debug)]
struct Buffers {
    views: Buffer,
    classes: Buffer,
    offsets: Buffer,
    lists: DrawLists,
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
}

impl DrawLists {
    /// Draws one class of a view: indexed by the list, or with vertices that fetch the list themselves.
    pub fn draw(&self, view: usize, class: usize, indexed: bool) -> Draw<'_> {
        let offset = (view * CLASSES + class) as u64 * ARGUMENT_BYTES;
        if indexed {
            Draw::IndexedIndirect { indices: &self.list, arguments: &self.arguments, offset }
        } else {
            Draw::Indirect(&self.arguments, offset)
        }
    }
}

impl Culling {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(gpu: &Gpu, library: &Library, scene_layout: &GroupLayout) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(gpu, library, &shaders::plain(entry), &[scene_layout], &[]);
        let (count, (scan, expand)) = parallel::join(
            || make("surface/cull_count.cs.wesl"),
            || parallel::join(|| make("surface/cull_scan.cs.wesl"), || make("surface/cull_expand.cs.wesl")),
        );
        Ok(Self { count: count?, scan: scan?, expand: expand?, buffers: None })
    }

    /// How many views of a scene fit one [`Culling::record`].
    pub fn views_at_once(gpu: &Gpu, scene: &SceneGpu) -> usize {
        let list = u64::from(scene.triangle_count.max(1)) * 12;
        let fit = gpu.limits.max_storage_buffer_binding_size.min(LIST_BUDGET_BYTES) / list;
        (fit as usize).clamp(1, MAX_VIEWS)
    }

    /// Makes room. To be called when the scene or the number of views changes, not inside a frame.
    pub fn reserve(&mut self, gpu: &Gpu, scene: &SceneGpu, views: usize) {
        let views = views.clamp(1, Self::views_at_once(gpu, scene));
        let fits = |b: &Buffers| {
            b.view_capacity >= views && b.items == scene.item_count && b.triangles == scene.triangle_count
        };
        if self.buffers.as_ref().is_some_and(fits) {
            return;
        }
        let storage = BufferUsages::STORAGE;
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let list = 12 * u64::from(scene.triangle_count) * views as u64;
        // As a uniform its size is that of the shader's array.
        let arguments = (MAX_VIEWS * CLASSES) as u64 * ARGUMENT_BYTES;
        let buffer = |name, size, usage| Buffer::new(gpu, name, Life::Frame, size, usage);
        self.buffers = Some(Buffers {
            views: Buffer::new(gpu, "cull_views", Life::Frame, size_of::<CullViews>() as u64, uniform),
            classes: buffer("cull_classes", size_of::<CullClasses>() as u64, uniform),
            offsets: buffer("cull_offsets", 4 * u64::from(scene.item_count) * views as u64, storage),
            lists: DrawLists {
                list: buffer("draw_list", list, storage | BufferUsages::INDEX),
                arguments: buffer(
                    "draw_arguments",
                    arguments,
                    storage | BufferUsages::INDIRECT | BufferUsages::UNIFORM,
                ),
            },
            view_capacity: views,
            items: scene.item_count,
            triangles: scene.triangle_count,
        });
    }

    /// Culls the scene for up to [`Culling::views_at_once`] views; `name` labels the passes.
    ///
    /// # Panics
    /// When [`Culling::reserve`] made too little room: a mistake in the calling pass.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        names: [&'static str; 3],
        scene: &SceneGpu,
        views: &[CullView],
        over: &[Over<'_>],
    ) -> DrawLists {
        let buffers = self.buffers.as_ref().filter(|b| b.view_capacity >= views.len());
        let Some(buffers) = buffers else {
            panic!("{}: no room reserved for {} views", names[0], views.len())
        };
        let mut all = CullViews {
            count: [views.len() as u32, scene.item_count, 0, 0],
            views: [CullView::zeroed(); MAX_VIEWS],
        };
        all.views[..views.len()].copy_from_slice(views);
        frame.upload(&buffers.views, &[all]);
        let each = size_of::<CullView>() as u64;
        for Over { views, from, to } in over {
            let to = size_of::<[u32; 4]>() as u64 + *to as u64 * each;
            frame.copy((views, *from as u64 * each), (&buffers.views, to), each);
        }
        let classes = CullClasses {
            first: scene.class_first,
            item_count: scene.item_count,
            list_stride: scene.triangle_count,
            _pad: [0; 2],
        };
        frame.upload(&buffers.classes, &[classes]);
        let (items, view_count) = (scene.item_count, views.len() as u32);
        let group = &[scene.group()];
        let lists = &buffers.lists;
        frame.compute(
            names[0],
            &self.count,
            group,
            &[("cull_views", (&buffers.views).into()), ("offsets", (&buffers.offsets).into())],
            Dispatch::Groups([items.div_ceil(64), view_count, 1]),
        );
        frame.compute(
            names[1],
            &self.scan,
            group,
            &[
                ("classes", (&buffers.classes).into()),
                ("offsets", (&buffers.offsets).into()),
                ("draw_arguments", (&lists.arguments).into()),
            ],
            Dispatch::Groups([view_count, 1, 1]),
        );
        frame.compute(
            names[2],
            &self.expand,
            group,
            &[
                ("classes", (&buffers.classes).into()),
                ("offsets", (&buffers.offsets).into()),
                ("draw_list", (&lists.list).into()),
            ],
            Dispatch::Groups([items.min(EXPAND_ROW), view_count, items.div_ceil(EXPAND_ROW)]),
        );
        lists.clone()
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

/// Draws some classes of a view with pipelines by kind of class. A kind without one has nothing to draw.
pub fn draw_classes(
    pass: &mut RenderPass<'_, '_>,
    pipelines: &Kinds,
    classes: Range<usize>,
    shared: &[&chiaro_gpu::Group],
    binds: &[chiaro_gpu::Bind<'_>],
    (lists, view, indexed): (&DrawLists, usize, bool),
) {
    for class in classes {
        if let Some(pipeline) = &pipelines[class % KINDS] {
            pass.draw(pipeline, shared, binds, lists.draw(view, class, indexed));
        }
    }
}
