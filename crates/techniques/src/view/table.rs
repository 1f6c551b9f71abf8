//! Views: whatever looks at the scene, all in one table.
//!
//! A camera, a cascade, a face of a cube, a spot and a hemisphere are the same to culling, to the visibility buffer and to
//! its resolve: a record of [`ViewData`]. A frame lays down the views that it draws one behind the other; those that stand
//! together, up to [`MAX_VIEWS`], are culled in one batch. What a view is drawn with is its record's range of the table.

use std::mem::offset_of;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Binding, Buffer, Frame, Gpu, Life};
use glam::{Mat4, Vec3, Vec4, Vec4Swizzles};

use crate::scene::motion::SceneMotion;

/// Views of one batch at most; twin of the shaders' arrays.
pub const MAX_VIEWS: usize = 64;

/// See `view.wesl`. As large as uniform bindings are apart.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ViewData {
    pub clip_from_ws: [[f32; 4]; 4],
    pub planes: [[f32; 4]; 6],
    pub hole: [[f32; 4]; 2],
    pub eye_ws: [f32; 4],
    pub hole_half: f32,
    pub near_m: f32,
    pub share: f32,
    pub footprint_scale: f32,
    pub size_px: [u32; 2],
    pub layer: u32,
    pub flags: u32,
    pub depth_limit: f32,
    pub slot: u32,
    pub reserved0: u32,
    pub reserved1: u32,
}

const DROPS_BACK_FACES: u32 = 1;
/// A plane that everything is inside of.
const NO_PLANE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// A prism along parallel rays that another view draws: what lies wholly inside is left to it. Metres from its middle plane
/// = xyz · position + w, twice, each less than the half side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hole {
    /// Across, two ways.
    pub rows: [Vec4; 2],
    /// Metres.
    pub half: f32,
}

impl ViewData {
    /// Bytes of a record.
    pub const BYTES: u64 = size_of::<Self>() as u64;

    /// A view of reversed depth that drops what is before its near plane.
    ///
    /// `eye_ws`: the eye with w = 1, or the direction of parallel rays with w = 0.
    pub fn new(clip_from_ws: &Mat4, eye_ws: Vec4, size_px: [u32; 2]) -> Self {
        let [x, y, z, w] = [0, 1, 2, 3].map(|row| clip_from_ws.row(row));
        // Gribb & Hartmann 2001: clip-space inequalities as planes. Reversed depth: near is z ≤ w, far is z ≥ 0.
        let planes = [w + x, w - x, w + y, w - y, z, w - z].map(|plane| {
            let length = plane.xyz().length();
            // An infinite far plane has no normal: nothing is beyond it.
            if length > 1e-30 { (plane / length).to_array() } else { NO_PLANE }
        });
        Self {
            clip_from_ws: clip_from_ws.to_cols_array_2d(),
            planes,
            eye_ws: eye_ws.to_array(),
            size_px,
            share: 1.0,
            footprint_scale: 1.0,
            depth_limit: 1.0,
            ..Self::zeroed()
        }
    }

    /// A view of all on a plane's positive side; `axes_from_ws` leads to a hemisphere's axes.
    pub fn of_plane(axes_from_ws: &Mat4, plane: Vec4, eye_ws: Vec4, size_px: [u32; 2]) -> Self {
        let mut planes = [NO_PLANE; 6];
        planes[0] = (plane / plane.xyz().length().max(1e-30)).to_array();
        Self { planes, ..Self::new(axes_from_ws, eye_ws, size_px) }
    }

    /// Leaves out clusters of single-sided surfaces that are seen from behind.
    #[must_use]
    pub fn dropping_back_faces(mut self) -> Self {
        self.flags |= DROPS_BACK_FACES;
        self
    }

    /// Keeps what is before the near plane, on it.
    #[must_use]
    pub fn clamping_near(mut self) -> Self {
        self.planes[5] = NO_PLANE;
        self.depth_limit = f32::MAX;
        self
    }

    /// Leaves out what lies wholly in a hole.
    #[must_use]
    pub fn without(mut self, hole: Option<Hole>) -> Self {
        if let Some(Hole { rows, half }) = hole {
            self.hole_half = half;
            self.hole = rows.map(|row| row.to_array());
        }
        self
    }

    /// Whether a sphere may be seen; twin of the shader's test.
    pub fn sees(&self, center: Vec3, radius: f32) -> bool {
        let within =
            |&[x, y, z, w]: &[f32; 4]| (Vec3::new(x, y, z).dot(center) + w).abs() + radius < self.hole_half;
        if self.hole.iter().all(within) {
            return false;
        }
        self.planes.iter().all(|&[x, y, z, w]| Vec3::new(x, y, z).dot(center) + w > -radius)
    }

    /// Whether anything that may be seen has moved since a pose of this number; of poses before the last nobody knows.
    pub(crate) fn sees_moved(&self, motion: &SceneMotion, pose: u64) -> bool {
        motion.moved_since(pose, |(lo, hi)| self.sees(0.5 * (lo + hi), 0.5 * lo.distance(hi)))
    }
}

/// The views that a frame draws, in the order of their numbers.
#[derive(Debug)]
pub struct ViewTable {
    buffer: Buffer,
    capacity: usize,
    views: Vec<ViewData>,
    batches: Vec<Range<u32>>,
    /// Most texels averaged along a slanted footprint of masked surfaces, where compute draws.
    pub anisotropy: u32,
}

impl ViewTable {
    /// A table with room for one view.
    pub fn new(gpu: &Gpu) -> Self {
        Self { buffer: buffer(gpu, 1), capacity: 1, views: Vec::new(), batches: Vec::new(), anisotropy: 1 }
    }

    /// Takes the views of the next frame, and makes room for them; not inside a frame. Those that are known when it begins
    /// come first. `at_once`: how many are culled together, at most [`MAX_VIEWS`].
    pub fn set(&mut self, gpu: &Gpu, known: &[ViewData], fitted: &[ViewData], at_once: usize) {
        self.views.clear();
        self.batches.clear();
        for batch in known.chunks(at_once).chain(fitted.chunks(at_once)) {
            let first = self.views.len() as u32;
            self.batches.push(first..first + batch.len() as u32);
            self.views.extend((0..).zip(batch).map(|(slot, view)| ViewData { slot, ..*view }));
        }
        if self.views.len() > self.capacity {
            self.capacity = self.views.len().next_power_of_two();
            self.buffer = buffer(gpu, self.capacity);
        }
    }

    /// Which views are culled together.
    pub fn batches(&self) -> &[Range<u32>] {
        &self.batches
    }

    /// The views.
    pub fn views(&self) -> &[ViewData] {
        &self.views
    }

    /// Uploads the views for the passes that follow.
    pub fn upload(&self, frame: &mut Frame<'_>) {
        frame.upload(&self.buffer, &self.views);
    }

    /// Puts what the GPU fitted of a view, in record `from` of a buffer, in the place of another's.
    pub fn take(&self, frame: &mut Frame<'_>, (fitted, from): (&Buffer, u32), to: u32) {
        let at = |view: u32| u64::from(view) * ViewData::BYTES;
        let size = (offset_of!(ViewData, hole_half) + size_of::<f32>()) as u64;
        frame.copy((fitted, at(from)), (&self.buffer, at(to)), size);
    }

    /// What a pass binds for one view.
    pub fn view(&self, view: u32) -> Binding<'_> {
        Binding::BufferRange(&self.buffer, u64::from(view) * ViewData::BYTES, ViewData::BYTES)
    }

    /// What a pass binds for a batch: [`MAX_VIEWS`] records from the first on.
    pub fn batch(&self, first: u32) -> Binding<'_> {
        let size = MAX_VIEWS as u64 * ViewData::BYTES;
        Binding::BufferRange(&self.buffer, u64::from(first) * ViewData::BYTES, size)
    }
}

// A batch is bound as a whole, however few views it has.
fn buffer(gpu: &Gpu, views: usize) -> Buffer {
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    Buffer::new(gpu, "views", Life::Frame, (views + MAX_VIEWS) as u64 * ViewData::BYTES, usage)
}
