//! Cascades: a sun's maps for slices of what the camera sees (Zhang, Sun, Xu & Lun 2006, "Parallel-Split Shadow Maps").
//!
//! Every map is a sphere around its slice, so that its size stays when the camera turns; it moves by whole texels of a
//! grid that hangs on the world, so that edges rest (Valient 2006). How far slices reach follows from the scene and, in
//! large steps, from how far outside it the camera is: never from where it looks. `fit.cs.wesl` is the twin that fits
//! slices to the depths of the picture.

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life, Texture,
};
use glam::{Mat3, Mat4, Vec2, Vec3};

use super::casters::Shadowed;
use super::maker::Maker;
use super::views::{ShadowView, ShadowViews, SunFit};
use super::{CameraView, CascadeSelect, Fit, FitInputs, Representation};
use crate::frame::{LightData, ShadowViewData};
use crate::shaders;
use crate::view::project::{corners, light_axes, reversed_orthographic, slack};
use crate::view::{Hole, ViewData};

/// Radii are rounded up to these parts of an octave, so that rounding errors do not move edges.
const RADIUS_STEPS: f32 = 32.0;
/// Splits by ratio begin no nearer than at this share of the end.
const LEAST_NEAR: f32 = 1e-3;
/// How far outside the scene the camera is counts in these shares of the distance.
const BEGIN_STEPS: f32 = 16.0;

/// Holes move by these shares of a cascade's half side.
const HOLE_STEP: f32 = 0.125;

/// From where to where a cascade's depth reaches along the light.
#[derive(Clone, Copy, Debug)]
struct Along {
    near_m: f32,
    far_m: f32,
    // Whether it is as far as the cascade reaches across instead.
    own_near: bool,
    own_far: bool,
}

/// The rays through the picture's corners: `origin + step · view depth`.
#[derive(Clone, Copy, Debug)]
struct Rays {
    origins: [Vec3; 4],
    steps: [Vec3; 4],
    // Where the camera's near plane is.
    near_m: f32,
}

impl Rays {
    fn of(camera: &CameraView) -> Self {
        let depth = |p: Vec3| camera.forward_ws.dot(p - camera.eye_ws);
        let mut near_m = 0.0;
        let rays = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| {
            let near = camera.ws_from_clip.project_point3(Vec3::new(x, y, 1.0));
            let further = camera.ws_from_clip.project_point3(Vec3::new(x, y, 0.5));
            let step = (further - near) / camera.forward_ws.dot(further - near).max(1e-30);
            near_m = depth(near).max(0.0);
            (near - step * depth(near), step)
        });
        Self { origins: rays.map(|(origin, _)| origin), steps: rays.map(|(_, step)| step), near_m }
    }

    fn at(&self, depth_m: f32) -> [Vec3; 4] {
        std::array::from_fn(|i| self.origins[i] + self.steps[i] * depth_m)
    }

    fn is_orthographic(&self) -> bool {
        self.origins[0].distance(self.origins[2]) > 1e-3 * (self.steps[0].length() + self.near_m)
    }
}

/// A box's diagonal; that of a point is 1.
fn extent((lo, hi): (Vec3, Vec3)) -> f32 {
    let length = (hi - lo).length();
    if length > 0.0 { length } else { 1.0 }
}

/// View depths that hold everything visible that shadows may fall on, whichever way the camera looks.
fn reach(camera: &CameraView, rays: &Rays, (lo, hi): (Vec3, Vec3)) -> (f32, f32) {
    let eye = camera.eye_ws;
    let furthest = corners((lo, hi)).into_iter().map(|c| c.distance(eye)).fold(0.0, f32::max);
    let size = extent((lo, hi));
    let end = size * (furthest / size).max(1.0).log2().ceil().exp2();
    if rays.is_orthographic() {
        return (rays.near_m, end);
    }
    let nearest = eye.distance(eye.clamp(lo, hi));
    // A ray slanted from the axis reaches as far at a smaller depth.
    let cosine = rays.steps.iter().map(|step| step.length().recip()).fold(1.0, f32::min);
    let step = end / BEGIN_STEPS;
    (((nearest * cosine / step).floor() * step).max(rays.near_m), end)
}

/// Where slice `i` of `count` begins (Zhang et al. 2006, eq. 5).
fn split(i: u32, count: u32, (begin, end): (f32, f32), lambda: f32) -> f32 {
    if i == 0 {
        return begin;
    }
    let near = begin.max(LEAST_NEAR * end);
    let t = i as f32 / count as f32;
    lambda * near * (end / near).powf(t) + (1.0 - lambda) * (near + (end - near) * t)
}

/// A sphere around the rays between two depths: centre and radius.
fn sphere(rays: &Rays, begin: f32, end: f32) -> (Vec3, f32) {
    let (near, far) = (rays.at(begin), rays.at(end));
    let middle = |c: &[Vec3; 4]| c.iter().sum::<Vec3>() / 4.0;
    let (a, b) = (middle(&near), middle(&far));
    let (near_r, far_r) = (near[0].distance(a), far[0].distance(b));
    let height2 = a.distance_squared(b).max(1e-30);
    // The point of the axis as far from the near corners as from the far ones.
    let t = ((height2 + far_r * far_r - near_r * near_r) / (2.0 * height2)).clamp(0.0, 1.0);
    let center = a + (b - a) * t;
    let radius = near.iter().chain(&far).map(|c| c.distance(center)).fold(0.0, f32::max);
    (center, ((radius.log2() * RADIUS_STEPS).ceil() / RADIUS_STEPS).exp2())
}

/// Adds a sun's cascades.
pub(super) fn fit(light: &LightData, make: &Maker<'_>, first: u32, out: &mut ShadowViews) {
    let inputs = make.inputs;
    let (camera, settings) = (&inputs.camera, inputs.settings);
    let rays = Rays::of(camera);
    let Shadowed { casting, region } = make.shadowed(light.direction_ws.into());
    let range = reach(camera, &rays, region);
    let axes = Mat3::from_quat(light_axes(light.direction_ws.into()));
    // Nothing that a map could show is wider, across the light, than what casts.
    let scene = (axes * (0.5 * (casting.0 + casting.1)), 0.5 * extent(casting) * 1.001);
    let along = along(&axes, region, inputs);
    // What a finer cascade is sure to be looked up for, the next need not draw. That is so where a cascade is chosen by its
    // sides alone: not by distance, and not by how deep a short range for moments reaches.
    let holes = settings.cascade_select == CascadeSelect::Projection && !along.own_far;
    let mut finer: Option<(Vec3, f32)> = None;
    let count = settings.cascades;
    for i in 0..count {
        let slice = settings.splits.slice(i, range).unwrap_or_else(|| {
            let at = |i| split(i, count, range, settings.split_lambda);
            (at(i), at(i + 1))
        });
        let (center, radius) = sphere(&rays, slice.0, slice.1);
        let (center, radius) = if radius < scene.1 { (axes * center, radius) } else { scene };
        let (clip_from_ls, data) = parallel(center, radius, along, make);
        let hole = finer.filter(|_| holes).and_then(|finer| hole(finer, &axes, &data, make));
        finer = Some((center, 0.5 * data.resolution * data.texel_m));
        let clip_from_ws = clip_from_ls * Mat4::from_mat3(axes);
        let data = ShadowViewData {
            begin_m: slice.0,
            end_m: slice.1,
            ..ShadowViewData { clip_from_ws: clip_from_ws.to_cols_array_2d(), layer: first + i, ..data }
        };
        let eye_ws = Vec3::from(light.direction_ws).extend(0.0);
        out.views.push(ShadowView { clip_from_ws, eye_ws, resolution: make.resolution, data, hole });
    }
    if settings.fit == Fit::Depth {
        let row = |i: usize| axes.row(i).extend(0.0).to_array();
        out.fitted.push(SunFit {
            light_from_ws: [row(0), row(1), row(2)],
            origins_ws: rays.origins.map(|origin| origin.extend(1.0).to_array()),
            steps_ws: rays.steps.map(|step| step.extend(0.0).to_array()),
            scene_ls: scene.0.extend(scene.1).to_array(),
            begin_m: range.0,
            end_m: range.1,
            lambda: settings.split_lambda,
            least_near_m: if inputs.see_through { range.0 } else { 0.0 },
            first_view: first,
            count,
            near_m: along.near_m,
            far_m: along.far_m,
            own_range: u32::from(along.own_near) | u32::from(along.own_far) << 1,
            holes: u32::from(holes),
            blend: settings.blend,
            reserved: 0,
        });
    }
}

/// How far cascades reach along the light: through all casters and receivers that there are. Moments want a short range to
/// be precise in.
fn along(axes: &Mat3, region: (Vec3, Vec3), inputs: &FitInputs<'_>) -> Along {
    let depths = corners(region).map(|corner| -(*axes * corner).z);
    let (near, far) = depths.into_iter().fold((f32::MAX, f32::MIN), |(n, f), d| (n.min(d), f.max(d)));
    let slack = slack(near, far, region);
    let moments = inputs.settings.representation != Representation::Depth;
    Along {
        near_m: near - slack,
        far_m: far + slack,
        // Casters before the map are drawn onto its near plane.
        own_near: moments && inputs.clamps_depth,
        own_far: moments,
    }
}

/// A parallel view around a sphere in the light's axes, on the grid of its texels.
fn parallel(center: Vec3, radius: f32, along: Along, make: &Maker<'_>) -> (Mat4, ShadowViewData) {
    let half = make.with_border(radius);
    let texel = 2.0 * half / make.resolution as f32;
    let center = (center / texel).round() * texel;
    let far = if along.own_far { half - center.z } else { along.far_m };
    let near = if along.own_near { -half - center.z } else { along.near_m };
    let clip_from_ls = reversed_orthographic(Vec2::splat(half), near, far)
        * Mat4::from_translation(Vec3::new(-center.x, -center.y, 0.0));
    let data = ShadowViewData { texel_m: texel, near_m: near, far_m: far, ..make.data(&clip_from_ls, 0) };
    (clip_from_ls, data)
}

/// What the next finer cascade is looked up for alone: its middle, less where it fades and where the filter of this one
/// reaches in. It moves in steps, so that this one's map may rest when the finer one moves.
fn hole(
    (center, half): (Vec3, f32),
    axes: &Mat3,
    coarser: &ShadowViewData,
    make: &Maker<'_>,
) -> Option<Hole> {
    let step = HOLE_STEP * half;
    let share = 1.0 - 2.0 * make.border / make.resolution as f32;
    let reach = make.border * coarser.texel_m + 0.5 * step;
    let half = half * share * (1.0 - make.inputs.settings.blend) - reach;
    let middle = (center / step).round() * step;
    let row = |i: usize| axes.row(i).extend(-middle[i]);
    (half > 0.0).then(|| Hole { rows: [row(0), row(1)], half })
}

/// Suns in one frame whose cascades are fitted on the GPU.
const MAX_SUNS: u64 = 256;
/// Pixels of a workgroup of `depth_bounds.cs.wesl`.
const BOUNDS_TILE: [u32; 2] = [16, 64];

/// Fits cascades to the depths of the picture.
#[derive(Debug)]
pub(super) struct Fitter {
    bounds: ComputePipeline,
    fit: ComputePipeline,
}

/// What is fitted.
#[derive(Debug)]
pub(super) struct FitRoom {
    count: usize,
    depth_bounds: Buffer,
    suns: Buffer,
    frustum: Buffer,
    views: Buffer,
    /// [`ViewData`] of all layers, of which those of suns are fitted.
    pub draws: Buffer,
}

impl FitRoom {
    /// Room for so many views.
    pub fn new(gpu: &Gpu, count: usize) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let make = |name, life, bytes: u64| Buffer::new(gpu, name, life, bytes, usage);
        let kept = |name, each: usize| make(name, Life::Kept, (count.max(1) * each) as u64);
        Self {
            count,
            depth_bounds: make("depth_bounds", Life::Frame, 8),
            suns: make("sun_fits", Life::Frame, MAX_SUNS * size_of::<SunFit>() as u64),
            frustum: kept("frustum_views", size_of::<ShadowViewData>()),
            views: kept("fitted_views", size_of::<ShadowViewData>()),
            draws: kept("fitted_draws", size_of::<ViewData>()),
        }
    }

    /// Puts fitted views in the place of the frustum's, among those that are looked up.
    pub fn take(&self, frame: &mut Frame<'_>, suns: &[SunFit], lighting: &Buffer) {
        let each = size_of::<ShadowViewData>() as u64;
        for sun in suns {
            let at = u64::from(sun.first_view) * each;
            frame.copy((&self.views, at), (lighting, at), u64::from(sun.count) * each);
        }
    }

    /// Whether it serves so many views.
    pub fn serves(&self, count: usize) -> bool {
        self.count >= count
    }
}

impl Fitter {
    pub fn new(gpu: &Gpu, library: &Library, frame_layout: &GroupLayout) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(gpu, library, &shaders::plain(entry), &[frame_layout], &[]);
        Ok(Self { bounds: make("shadow/depth_bounds.cs.wesl")?, fit: make("shadow/fit.cs.wesl")? })
    }

    /// Measures the picture's depths and fits all cascades to them. `draws`: the views as the frustum would have them drawn.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        group: &Group,
        (views, draws): (&ShadowViews, &[ViewData]),
        depth: &Texture,
        room: &FitRoom,
    ) {
        let data: Vec<_> = views.views.iter().map(|view| view.data).collect();
        frame.upload(&room.frustum, &data);
        frame.upload(&room.draws, draws);
        frame.upload(&room.suns, &views.fitted);
        frame.clear(&room.depth_bounds);
        let options = depth.options();
        let tiles = [options.width.div_ceil(BOUNDS_TILE[0]), options.height.div_ceil(BOUNDS_TILE[1]), 1];
        let binds = [("depth", depth.into()), ("depth_bounds", (&room.depth_bounds).into())];
        frame.compute("shadow/depth_bounds", &self.bounds, &[group], &binds, Dispatch::Groups(tiles));
        let binds = [
            ("suns", (&room.suns).into()),
            ("frustum_views", (&room.frustum).into()),
            ("depth_bounds", (&room.depth_bounds).into()),
            ("fitted_views", (&room.views).into()),
            ("fitted_draws", (&room.draws).into()),
        ];
        let suns = Dispatch::Groups([views.fitted.len() as u32, 1, 1]);
        frame.compute("shadow/fit", &self.fit, &[], &binds, suns);
    }
}
