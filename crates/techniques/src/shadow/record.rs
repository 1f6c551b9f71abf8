//! The shadow map passes.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Binding, Buffer, DepthAttachment, Frame, Gpu, GpuError, Group, GroupLayout, Life, Mapping,
    RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions, ViewHint, parallel,
};
use glam::Vec4Swizzles;

use super::cascades::Fitter;
use super::moments::{MomentOutputs, Moments};
use super::tint::{Tint, TintMaps};
use super::views::{ShadowView, ShadowViews};
use super::{Fit, PointLayout, ShadowSettings};
use crate::shaders;
use crate::shared::frame::ShadowViewData;
use crate::surface::culling::{CullView, Culling, DEPTH_COMPARE, Kinds, draw_classes, kinds};
use crate::surface::raster::{ComputeRaster, Draws, MatrixOver, RasterView};
use crate::surface::scene::{CLASSES, OPAQUE};
use crate::surface::{SceneFacts, SceneGpu};

const MAPS: ViewHint =
    ViewHint::new("Depth from each light, a layer each: white is near the light", Mapping::ShadowDepth);

/// What [`ShadowMaps::record`] writes.
#[derive(Clone, Debug)]
pub struct ShadowOutputs {
    /// Depth32Float array, or R32Float where compute rastered it; a layer per view.
    pub maps: Texture,
    /// Comparison sampler: passes where the receiver's reversed depth is at least the map's.
    pub compare: wgpu::Sampler,
    /// Plain sampler, for fetching four depths at once.
    pub gather: wgpu::Sampler,
    /// What was made of the maps.
    pub moments: MomentOutputs,
    /// See-through casters, with `shadow.transmission_tint`.
    pub tint: TintMaps,
}

impl ShadowOutputs {
    /// Empty maps of `side`² texels, to be drawn by the caller: reversed depth, a layer for each view of [`super::fit`], near 1,
    /// cleared to 0. Without moments and tints.
    pub fn new(gpu: &Gpu, side: u32, layers: u32) -> Self {
        let compare = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow_compare"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            compare: Some(wgpu::CompareFunction::GreaterEqual),
            ..Default::default()
        });
        let gather = gpu
            .device
            .create_sampler(&wgpu::SamplerDescriptor { label: Some("shadow_gather"), ..Default::default() });
        Self {
            maps: maps(gpu, side, layers, false),
            compare,
            gather,
            moments: MomentOutputs::stand_in(gpu),
            tint: TintMaps::new(gpu, 1, 1),
        }
    }

    /// What `shadow/lookup.wesl` binds.
    pub fn binds(&self) -> Vec<Bind<'_>> {
        let mut binds = self.moments.binds().to_vec();
        binds.extend(self.tint.binds());
        binds.extend([
            ("shadow_maps", (&self.maps).into()),
            ("shadow_compare", (&self.compare).into()),
            ("shadow_gather", (&self.gather).into()),
        ]);
        binds
    }
}

/// See `draw_view.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct DrawView {
    pub clip_from_ws: [[f32; 4]; 4],
    pub near_m: f32,
    pub share: f32,
    pub resolution: f32,
    pub reserved: f32,
    pub padding: [[f32; 4]; 11],
}

const DRAW_VIEW_BYTES: u64 = size_of::<DrawView>() as u64;

impl DrawView {
    fn of(view: &ShadowView) -> Self {
        let side = view.resolution as f32;
        Self {
            clip_from_ws: view.clip_from_ws.to_cols_array_2d(),
            near_m: view.data.near_m,
            share: 1.0 - 2.0 * view.data.border / side,
            resolution: side,
            reserved: 0.0,
            padding: Zeroable::zeroed(),
        }
    }
}

/// The shadow map passes.
#[derive(Debug)]
pub struct ShadowMaps {
    culling: Culling,
    pipelines: Kinds,
    paraboloid: Option<Kinds>,
    fitter: Option<Fitter>,
    tint: Option<Tint>,
    moments: Moments,
    raster: Option<ComputeRaster>,
    anisotropy: u32,
    outputs: ShadowOutputs,
    draw_views: Buffer,
    capacity: usize,
    // What lies in the maps: the views they were rendered for, the scene, and which of its poses.
    rendered: (u64, ShadowViews),
    pose: u64,
    keeps: bool,
    cull_front: bool,
    facts: SceneFacts,
}

impl ShadowMaps {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        frame_layout: &GroupLayout,
        scene_layout: &GroupLayout,
        settings: &ShadowSettings,
        facts: SceneFacts,
    ) -> Result<Self, GpuError> {
        let materials = facts.constants();
        let shared = &[frame_layout, scene_layout];
        let pipeline = |class: usize| {
            let masked = class & 2 != 0;
            let options = RenderPipelineOptions {
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                cull: settings.bias_cull_front.then_some(wgpu::Face::Front),
                unclipped_depth: gpu.optional.depth_clip_control,
                constants: if masked { &materials } else { &[] },
                ..Default::default()
            };
            RenderPipeline::new(gpu, library, &shaders::shadow_depth(masked), shared, &options)
        };
        let paraboloid = |class: usize| {
            let masked = class & 2 != 0;
            let options = RenderPipelineOptions {
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                constants: if masked { &materials } else { &[] },
                ..Default::default()
            };
            let entry = shaders::shadow_paraboloid(masked, settings.bias_cull_front);
            RenderPipeline::new(gpu, library, &entry, shared, &options)
        };
        // What is see-through casts, too.
        let drawn = facts.draws(0..CLASSES);
        let computed = settings.computes_maps();
        let paraboloid = || {
            (settings.point_layout == PointLayout::Paraboloid).then(|| kinds(drawn, paraboloid)).transpose()
        };
        let raster = || {
            let draws = Draws::Depth { cull_front: settings.bias_cull_front };
            computed.then(|| ComputeRaster::new(gpu, library, scene_layout, facts, draws)).transpose()
        };
        let fitter =
            || (settings.fit == Fit::Depth).then(|| Fitter::new(gpu, library, frame_layout)).transpose();
        let tint = || settings.transmission_tint.then(|| Tint::new(gpu, library, shared, facts)).transpose();
        let moments = || Moments::new(gpu, library, frame_layout, settings, computed);
        let culling = || Culling::new(gpu, library, scene_layout);
        let (((pipelines, paraboloid), (raster, fitter)), ((tint, moments), culling)) = parallel::join(
            || {
                parallel::join(
                    || parallel::join(|| kinds(drawn, pipeline), paraboloid),
                    || parallel::join(raster, fitter),
                )
            },
            || parallel::join(|| parallel::join(tint, moments), culling),
        );
        let moments = moments?;
        let outputs = ShadowOutputs {
            maps: maps(gpu, 1, 1, computed),
            moments: moments.outputs(),
            ..ShadowOutputs::new(gpu, 1, 1)
        };
        Ok(Self {
            tint: tint?,
            moments,
            culling: culling?,
            pipelines: pipelines?,
            paraboloid: paraboloid?,
            fitter: fitter?,
            raster: raster?,
            anisotropy: 1,
            outputs,
            draw_views: draw_views(gpu, 1),
            capacity: 1,
            rendered: (0, ShadowViews::default()),
            pose: 0,
            keeps: true,
            cull_front: settings.bias_cull_front,
            facts,
        })
    }

    /// Whether these passes serve `settings` without being made again.
    pub fn serves(&self, settings: &ShadowSettings, facts: SceneFacts) -> bool {
        self.cull_front == settings.bias_cull_front
            && self.facts == facts
            && self.raster.is_some() == settings.computes_maps()
            && self.moments.serves(settings, settings.computes_maps())
            && self.tint.is_some() == settings.transmission_tint
            && (self.paraboloid.is_some() || settings.point_layout != PointLayout::Paraboloid)
            && (self.fitter.is_some() || settings.fit != Fit::Depth)
    }

    /// Makes room for so many views. Not inside a frame. `anisotropy`: most taps of a masked caster's texture.
    ///
    /// # Panics
    /// When the passes were compiled for less than the scene needs.
    pub fn reserve(
        &mut self,
        gpu: &Gpu,
        scene: &SceneGpu,
        views: &ShadowViews,
        settings: &ShadowSettings,
        anisotropy: u32,
    ) {
        assert!(self.facts.serve(scene.facts), "shadow: compiled for another scene: {:?}", self.facts);
        self.anisotropy = anisotropy;
        let keeps = settings.cache;
        let views = &views.views;
        self.culling.reserve(gpu, scene, views.len());
        let resolution = views.first().map_or(1, |view| view.resolution);
        let layers = views.len().max(1) as u32;
        let options = self.outputs.maps.options();
        if options.width != resolution || options.layers != Some(layers) {
            self.outputs.maps = maps(gpu, resolution, layers, self.raster.is_some());
            self.rendered.1 = ShadowViews::default();
        }
        self.moments.reserve(gpu, settings, resolution, layers);
        let tinted = if self.tint.is_some() { [resolution, layers] } else { [1, 1] };
        let has = self.outputs.tint.tint.options();
        if [has.width, has.layers.unwrap_or(1)] != tinted {
            self.outputs.tint = TintMaps::new(gpu, tinted[0], tinted[1]);
            self.rendered.1 = ShadowViews::default();
        }
        if self.rendered.0 != scene.id() || !keeps {
            self.rendered = (scene.id(), ShadowViews::default());
        }
        self.keeps = keeps;
        if views.len() > self.capacity {
            self.capacity = views.len();
            self.draw_views = draw_views(gpu, self.capacity);
        }
        let at_once = self.views_at_once(gpu, scene, resolution).min(views.len());
        if let Some(raster) = self.raster.as_mut().filter(|_| !views.is_empty()) {
            raster.reserve(gpu, [resolution; 2], at_once);
        }
        if let Some(fitter) = &mut self.fitter {
            fitter.reserve(gpu, views.len());
        }
    }

    fn views_at_once(&self, gpu: &Gpu, scene: &SceneGpu, resolution: u32) -> usize {
        let culled = Culling::views_at_once(gpu, scene);
        match &self.raster {
            Some(_) => culled.min(ComputeRaster::views_at_once(gpu, [resolution; 2])).max(1),
            None => culled,
        }
    }

    /// Layers of the views that moved since they were rendered last, and of those that see something that did.
    fn moved(&self, scene: &SceneGpu, views: &ShadowViews, keeps_near: bool) -> Vec<u32> {
        let (rendered, poses) = (&self.rendered.1, scene.motion.generation().wrapping_sub(self.pose));
        let casters_moved = |view: &ShadowView| match poses {
            0 => false,
            1 => {
                let view = cull_view(view, keeps_near);
                scene
                    .motion
                    .moved_bounds_ws()
                    .any(|(lo, hi)| view.sees(0.5 * (lo + hi), 0.5 * lo.distance(hi)))
            }
            _ => true,
        };
        // Whatever moves may change what is in the picture, and with it the fit.
        let refit = rendered.fitted != views.fitted || poses != 0;
        let fitted = |layer: u32| views.fitted.iter().any(|sun| sun.holds(layer));
        (0..)
            .zip(&views.views)
            .filter(|(layer, view)| {
                rendered.views.get(*layer as usize) != Some(*view)
                    || casters_moved(view)
                    || refit && fitted(*layer)
            })
            .map(|(layer, _)| layer)
            .collect()
    }

    /// Renders the maps of views that moved since they were rendered last, and of those that see something that did.
    /// `frame_views` is group 0's buffer of views. Cascades that are fitted to the picture need its `depth`.
    pub fn record(
        &mut self,
        frame: &mut Frame<'_>,
        (frame_group, frame_views): (&Group, &Buffer),
        scene: &SceneGpu,
        views: &ShadowViews,
        depth: Option<&Texture>,
        settings: &ShadowSettings,
    ) -> ShadowOutputs {
        let keeps_near = frame.gpu().optional.depth_clip_control;
        let moved = self.moved(scene, views, keeps_near);
        let draws: Vec<_> = views.views.iter().map(DrawView::of).collect();
        frame.upload(&self.draw_views, &draws);
        let fitter = self.fitter.as_ref().filter(|_| !views.fitted.is_empty());
        if let (Some(fitter), Some(depth)) = (fitter, depth) {
            let first = |sun: &super::cascades::SunFit| moved.contains(&sun.first_view);
            if views.fitted.iter().any(first) {
                fitter.record(frame, frame_group, views, depth);
            }
            fitter.take(frame, &views.fitted, (frame_views, &self.draw_views));
        }
        let resolution = views.views.first().map_or(1, |view| view.resolution);
        let batch = self.views_at_once(frame.gpu(), scene, resolution);
        let names = ["shadow/cull_count", "shadow/cull_scan", "shadow/cull_expand"];
        for chunk in moved.chunks(batch) {
            let view = |layer: u32| &views.views[layer as usize];
            let cull_views: Vec<_> = chunk.iter().map(|&layer| cull_view(view(layer), keeps_near)).collect();
            let fitted = fitter.map(|fitter| fitter.culls(&views.fitted, chunk)).unwrap_or_default();
            let lists = self.culling.record(frame, names, scene, &cull_views, &fitted);
            if let Some(raster) = &self.raster {
                let of = |&layer: &u32| RasterView {
                    clip_from_ws: view(layer).clip_from_ws,
                    clip_near: false,
                    layer,
                };
                let raster_views: Vec<_> = chunk.iter().map(of).collect();
                // What was fitted on the GPU stands in the draw views alone.
                let is_fitted = |layer: u32| {
                    let mut suns = views.fitted.iter();
                    suns.any(|sun| sun.holds(layer))
                };
                let over: Vec<_> = (0..)
                    .zip(chunk)
                    .filter(|&(_, &layer)| is_fitted(layer))
                    .map(|(to, &layer)| MatrixOver {
                        buffer: &self.draw_views,
                        offset: u64::from(layer) * DRAW_VIEW_BYTES,
                        to,
                    })
                    .collect();
                let target = &self.outputs.maps;
                raster.record(frame, scene, &lists, (&raster_views, &over), self.anisotropy, target);
                continue;
            }
            for (index, &layer) in chunk.iter().enumerate() {
                let attachment = DepthAttachment { texture: &self.outputs.maps, layer, clear: Some(0.0) };
                let targets = Targets { color: &[], depth: Some(attachment) };
                let offset = u64::from(layer) * DRAW_VIEW_BYTES;
                let binds = [
                    ("draw_view", Binding::BufferRange(&self.draw_views, offset, DRAW_VIEW_BYTES)),
                    ("draw_list", (&lists.list).into()),
                ];
                let curved = view(layer).data.projection == ShadowViewData::PARABOLOID;
                let pipelines = self.paraboloid.as_ref().filter(|_| curved).unwrap_or(&self.pipelines);
                frame.render("shadow/depth", targets, |pass| {
                    let shared = &[frame_group, scene.group()];
                    let classes = if self.tint.is_some() { OPAQUE } else { scene.classes() };
                    draw_classes(pass, pipelines, classes, shared, &binds, (&lists, index, !curved));
                });
                if let Some(tint) = &self.tint {
                    let shared = &[frame_group, scene.group()];
                    let target = (&self.outputs.tint, layer);
                    tint.record(frame, shared, &self.pipelines, target, &binds, (&lists, index));
                }
            }
        }
        if !views.views.is_empty() {
            let maps = &self.outputs.maps;
            self.outputs.moments = self.moments.record(frame, frame_group, settings, maps, &moved);
        }
        if self.keeps && (!moved.is_empty() || self.rendered.1 != *views) {
            self.rendered = (scene.id(), views.clone());
        }
        self.pose = scene.motion.generation();
        self.outputs.clone()
    }
}

fn cull_view(view: &ShadowView, keeps_near: bool) -> CullView {
    if view.data.projection != ShadowViewData::PARABOLOID {
        return CullView::new(&view.clip_from_ws, view.eye_ws, false, keeps_near).without(view.hole);
    }
    // The hemisphere, and a little more for filters: a texel is at most this large an angle.
    let plane = view.clip_from_ws.row(2);
    let beyond = 2.0 * view.data.border * view.data.texel_m * view.data.far_m;
    CullView::of_plane(plane.xyz().extend(plane.w + beyond), view.eye_ws)
}

fn maps(gpu: &Gpu, resolution: u32, layers: u32, computed: bool) -> Texture {
    let (format, written) = if computed {
        (TextureFormat::R32Float, TextureUsages::STORAGE_BINDING)
    } else {
        (TextureFormat::Depth32Float, TextureUsages::RENDER_ATTACHMENT)
    };
    let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC | written;
    let options = TextureOptions::new(resolution, resolution, format, usage).array(layers);
    Texture::new(gpu, "shadow_maps", Life::Kept, options).described(MAPS)
}

fn draw_views(gpu: &Gpu, views: usize) -> Buffer {
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
    Buffer::new(gpu, "draw_views", Life::Frame, views as u64 * DRAW_VIEW_BYTES, usage)
}
