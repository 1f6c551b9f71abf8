//! The shadow map passes.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Buffer, DepthAttachment, Frame, Gpu, GpuError, Group, History, Life, Mapping, RenderPipeline,
    RenderPipelineOptions, Targets, Texture, TextureOptions, ViewHint, parallel,
};
use glam::Vec4Swizzles;

use super::cascades::{FitRoom, Fitter};
use super::moments::{MomentKey, MomentOutputs, MomentRoom, Moments};
use super::tint::{Tint, TintMaps};
use super::views::{ShadowView, ShadowViews};
use super::{Fit, PointLayout, ShadowSettings};
use crate::frame::{FrameGroup, ShadowViewData};
use crate::scene::{CLASSES, OPAQUE};
use crate::scene::{SceneFacts, SceneGpu};
use crate::view::culling::{Culling, DEPTH_COMPARE, DrawLists, Kinds, ListRoom, draw_classes, kinds_by_mask};
use crate::view::raster::{ComputeRaster, Draws, RasterRoom};
use crate::view::{ViewData, ViewTable};
use crate::{Kit, Pass, shaders};

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
    /// The scene's trees, for rays that take the place of maps.
    pub tracer: Option<Buffer>,
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
            tracer: None,
        }
    }

    /// What `shadow/lookup.wesl` and `shadow/traced.wesl` bind.
    pub fn binds(&self) -> Vec<Bind<'_>> {
        let mut binds = self.moments.binds().to_vec();
        binds.extend(self.tint.binds());
        binds.extend(self.tracer.as_ref().map(|tracer| ("tracer", tracer.into())));
        binds.extend([
            ("shadow_maps", (&self.maps).into()),
            ("shadow_compare", (&self.compare).into()),
            ("shadow_gather", (&self.gather).into()),
        ]);
        binds
    }
}

/// The shadow map passes.
#[derive(Debug)]
pub struct ShadowMaps {
    pipelines: Kinds,
    paraboloid: Option<Kinds>,
    fitter: Option<Fitter>,
    tint: Option<Tint>,
    moments: Moments,
    raster: Option<ComputeRaster>,
    facts: SceneFacts,
    // What these passes drew, others need not have drawn alike.
    id: u64,
}

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// Maps of one size and number, and what lies in them.
#[derive(Debug)]
pub struct ShadowRoom {
    outputs: ShadowOutputs,
    moments: MomentRoom,
    raster: Option<RasterRoom>,
    fit: Option<FitRoom>,
    // For views that are not culled with the camera.
    lists: Option<ListRoom>,
    // By passes and scene.
    rendered: History<[u64; 2], Rendered>,
}

/// What lies in maps: the views that they were rendered for, and the pose.
#[derive(Debug)]
struct Rendered {
    views: ShadowViews,
    pose: u64,
}

/// Which maps a frame renders: by layer, those first whose views are known before it begins.
#[derive(Clone, Debug, Default)]
pub struct ShadowPlan {
    layers: Vec<u32>,
    known: usize,
    views: Vec<ViewData>,
}

impl ShadowPlan {
    /// The views to draw that are known when the frame begins, and those that are fitted in it.
    pub fn views(&self) -> (&[ViewData], &[ViewData]) {
        self.views.split_at(self.known)
    }
}

/// What [`ShadowMaps::record`] draws.
#[derive(Clone, Copy, Debug)]
pub struct ShadowInputs<'a> {
    /// Geometry and materials.
    pub scene: &'a SceneGpu,
    /// All views of the lights.
    pub views: &'a ShadowViews,
    /// Those to be drawn.
    pub plan: &'a ShadowPlan,
    /// Where the plan's views stand, from number `first` on.
    pub table: &'a ViewTable,
    /// See `table`.
    pub first: u32,
    /// What was culled with the table's first batch.
    pub lists: &'a DrawLists,
    /// Culls the other batches.
    pub culling: &'a Culling,
    /// The picture's, for cascades that are fitted to it.
    pub depth: Option<&'a Texture>,
    /// The scene's trees, where it has any.
    pub tracer: Option<&'a Buffer>,
    /// How.
    pub settings: &'a ShadowSettings,
}

/// What [`ShadowMaps`] are compiled for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadowKey {
    facts: SceneFacts,
    cull_front: bool,
    computes: bool,
    moments: MomentKey,
    tint: bool,
    paraboloids: bool,
    fits: bool,
}

impl ShadowKey {
    /// What settings that leave nothing to the adapter ask for.
    pub fn new(settings: &ShadowSettings, facts: SceneFacts) -> Self {
        let computes = settings.computes_maps();
        Self {
            facts,
            cull_front: settings.bias_cull_front,
            computes,
            moments: MomentKey::new(settings, computes),
            tint: settings.transmission_tint,
            paraboloids: settings.point_layout == PointLayout::Paraboloid,
            fits: settings.fit == Fit::Depth,
        }
    }
}

impl Pass for ShadowMaps {
    type Key = ShadowKey;

    fn serves(has: &ShadowKey, wanted: &ShadowKey) -> bool {
        // What can do more stays.
        let (paraboloids, fits) = (has.paraboloids | wanted.paraboloids, has.fits | wanted.fits);
        *has == ShadowKey { paraboloids, fits, ..*wanted }
    }

    fn compile(kit: &Kit, key: &ShadowKey) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let ShadowKey { facts, cull_front, computes, .. } = *key;
        let materials = facts.constants();
        let tint = ("TINT", f64::from(u8::from(key.tint)));
        let casting = [&materials[..], &[tint]].concat();
        let shared = &[frame_layout, scene_layout];
        let pipeline = |masked: bool| {
            let options = RenderPipelineOptions {
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                cull: cull_front.then_some(wgpu::Face::Front),
                unclipped_depth: gpu.optional.depth_clip_control,
                constants: if masked { &casting } else { &[] },
                ..Default::default()
            };
            RenderPipeline::new(gpu, library, &shaders::shadow_depth(masked), shared, &options)
        };
        let paraboloid = |masked: bool| {
            let options = RenderPipelineOptions {
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                constants: if masked { &materials } else { &[] },
                ..Default::default()
            };
            let entry = shaders::shadow_paraboloid(masked, cull_front);
            RenderPipeline::new(gpu, library, &entry, shared, &options)
        };
        // What is see-through casts, too.
        let drawn = facts.draws(0..CLASSES);
        let paraboloid = || key.paraboloids.then(|| kinds_by_mask(drawn, paraboloid)).transpose();
        let raster = || {
            let draws = Draws::Depth { cull_front };
            computes.then(|| ComputeRaster::new(gpu, library, scene_layout, facts, draws)).transpose()
        };
        let fitter = || key.fits.then(|| Fitter::new(gpu, library, frame_layout)).transpose();
        let tint = || key.tint.then(|| Tint::new(gpu, library, shared, facts)).transpose();
        let moments = || Moments::compile(kit, &key.moments);
        let ((pipelines, paraboloid), ((raster, fitter), (tint, moments))) = parallel::join(
            || parallel::join(|| kinds_by_mask(drawn, pipeline), paraboloid),
            || parallel::join(|| parallel::join(raster, fitter), || parallel::join(tint, moments)),
        );
        Ok(Self {
            tint: tint?,
            moments: moments?,
            pipelines: pipelines?,
            paraboloid: paraboloid?,
            fitter: fitter?,
            raster: raster?,
            facts,
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
        })
    }
}

impl ShadowMaps {
    /// Room for the maps of so many views: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        scene: &SceneGpu,
        views: &ShadowViews,
        settings: &ShadowSettings,
        room: &'r mut Option<ShadowRoom>,
    ) -> &'r mut ShadowRoom {
        let resolution = views.views.first().map_or(1, |view| view.resolution);
        let layers = views.views.len().max(1) as u32;
        let computed = self.raster.is_some();
        let tinted = if self.tint.is_some() { [resolution, layers] } else { [1, 1] };
        let serves = |room: &ShadowRoom| {
            let [maps, tint] = [&room.outputs.maps, &room.outputs.tint.tint].map(|maps| *maps.options());
            [maps.width, maps.layers.unwrap_or(1)] == [resolution, layers]
                && (maps.format == TextureFormat::R32Float) == computed
                && [tint.width, tint.layers.unwrap_or(1)] == tinted
                && self.moments.fits(&room.moments, settings, resolution, layers)
        };
        let room = chiaro_gpu::keep(room, serves, || {
            let moments = self.moments.room(gpu, settings, resolution, layers);
            ShadowRoom {
                outputs: ShadowOutputs {
                    maps: maps(gpu, resolution, layers, computed),
                    moments: moments.outputs(),
                    tint: TintMaps::new(gpu, tinted[0], tinted[1]),
                    ..ShadowOutputs::new(gpu, 1, 1)
                },
                moments,
                raster: None,
                fit: None,
                lists: None,
                rendered: History::default(),
            }
        });
        if !settings.cache {
            room.rendered.cut();
        }
        let drawn = views.views.len();
        if let Some(raster) = self.raster.as_ref().filter(|_| drawn > 0) {
            let size = [resolution; 2];
            let at_once = ComputeRaster::views_at_once(gpu, size).min(drawn).max(1);
            let serves = |room: &RasterRoom| room.serves(size, at_once);
            chiaro_gpu::keep(&mut room.raster, serves, || raster.room(gpu, size, at_once));
        }
        if self.fitter.is_some() {
            let serves = |room: &FitRoom| room.serves(drawn);
            chiaro_gpu::keep(&mut room.fit, serves, || FitRoom::new(gpu, drawn));
        }
        // One batch goes with the camera's view.
        let culled = Culling::views_at_once(gpu, scene);
        if drawn >= culled || !views.fitted.is_empty() {
            let culled = drawn.min(culled);
            let serves = |room: &ListRoom| room.serves(scene, culled);
            chiaro_gpu::keep(&mut room.lists, serves, || ListRoom::new(gpu, scene, culled));
        }
        room
    }

    /// Which maps are to be rendered: of the views that moved since they were rendered last, and of those that see something
    /// that did.
    pub fn plan(&self, gpu: &Gpu, scene: &SceneGpu, views: &ShadowViews, room: &ShadowRoom) -> ShadowPlan {
        let draw = |view: &ShadowView| {
            let clamps = gpu.optional.depth_clip_control;
            draw_view(view, clamps)
        };
        let rendered = room.rendered.get(&[self.id, scene.id()]);
        let motion = &scene.motion;
        // Whatever moves may change what is in the picture, and with it the fit.
        let refit = rendered.is_none_or(|rendered| {
            rendered.pose != motion.generation() || rendered.views.fitted != views.fitted
        });
        let is_fitted = |layer: u32| views.fitted.iter().any(|sun| sun.holds(layer));
        let moved = (0..).zip(&views.views).filter(|&(layer, view)| {
            rendered.is_none_or(|rendered| {
                rendered.views.views.get(layer as usize) != Some(view)
                    || rendered.pose != motion.generation() && draw(view).sees_moved(motion, rendered.pose)
            }) || refit && is_fitted(layer)
        });
        let (fitted, known): (Vec<u32>, Vec<u32>) =
            moved.map(|(layer, _)| layer).partition(|&layer| is_fitted(layer));
        let layers = [&known[..], &fitted].concat();
        let views = layers.iter().map(|&layer| draw(&views.views[layer as usize])).collect();
        ShadowPlan { layers, known: known.len(), views }
    }

    /// Renders the maps that were planned.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        group: &FrameGroup,
        inputs: &ShadowInputs<'_>,
        room: &mut ShadowRoom,
    ) -> ShadowOutputs {
        let ShadowInputs { scene, views, plan, table, first, settings, .. } = *inputs;
        debug_assert!(self.facts.serve(scene.facts), "shadow: compiled for another scene");
        if let (Some(fitter), Some(fit), Some(depth)) = (&self.fitter, &room.fit, inputs.depth)
            && !views.fitted.is_empty()
        {
            let (known, fitted) = plan.views();
            if !fitted.is_empty() {
                let clamps = frame.gpu().optional.depth_clip_control;
                let draws: Vec<_> = views.views.iter().map(|view| draw_view(view, clamps)).collect();
                fitter.record(frame, group.group(), (views, &draws), depth, fit);
            }
            fit.take(frame, &views.fitted, &group.lighting);
            for (to, &layer) in (first + known.len() as u32..).zip(&plan.layers[known.len()..]) {
                table.take(frame, (&fit.draws, layer), to);
            }
        }
        for batch in table.batches() {
            let drawn = batch.start.max(first)..batch.end.min(first + plan.layers.len() as u32);
            if drawn.is_empty() {
                continue;
            }
            let lists = if *batch == inputs.lists.views {
                inputs.lists.clone()
            } else if let Some(lists) = &room.lists {
                inputs.culling.record(frame, scene, table, batch.clone(), lists)
            } else {
                unreachable!("there is room for views that are not culled with the camera")
            };
            self.record_batch(frame, group.group(), inputs, (&lists, drawn), room);
        }
        if !views.views.is_empty() {
            let maps = &room.outputs.maps;
            self.moments.record(frame, group.group(), settings, maps, &plan.layers, &mut room.moments);
        }
        if settings.cache {
            let pose = scene.motion.generation();
            match room.rendered.get(&[self.id, scene.id()]) {
                // Most frames of a still scene change nothing.
                Some(rendered) if plan.layers.is_empty() && rendered.pose == pose => {}
                _ => room.rendered.keep([self.id, scene.id()], Rendered { views: views.clone(), pose }),
            }
        }
        ShadowOutputs { tracer: inputs.tracer.cloned(), ..room.outputs.clone() }
    }

    fn record_batch(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        inputs: &ShadowInputs<'_>,
        (lists, drawn): (&DrawLists, Range<u32>),
        room: &ShadowRoom,
    ) {
        let ShadowInputs { scene, views, plan, table, first, .. } = *inputs;
        let outputs = &room.outputs;
        if let (Some(raster), Some(raster_room)) = (&self.raster, &room.raster) {
            raster.record(frame, scene, (table, lists), drawn, raster_room, &outputs.maps);
            return;
        }
        for number in drawn {
            let layer = plan.layers[(number - first) as usize];
            let attachment = DepthAttachment { texture: &outputs.maps, layer, clear: Some(0.0) };
            let targets = Targets { color: &[], depth: Some(attachment) };
            let binds = [("view", table.view(number)), ("draw_list", (&lists.list).into())];
            let curved = views.views[layer as usize].data.projection == ShadowViewData::PARABOLOID;
            let pipelines = self.paraboloid.as_ref().filter(|_| curved).unwrap_or(&self.pipelines);
            let shared = &[frame_group, scene.group()];
            frame.render("shadow/depth", targets, |pass| {
                let classes = if self.tint.is_some() { OPAQUE } else { scene.classes() };
                draw_classes(pass, pipelines, classes, shared, &binds, (lists, number, !curved));
            });
            if let Some(tint) = &self.tint {
                let target = (&outputs.tint, layer);
                tint.record(frame, shared, &self.pipelines, target, &binds, (lists, number));
            }
        }
    }
}

/// A shadow view as it is drawn. `clamps`: whether the hardware clamps casters before the near plane to it.
fn draw_view(view: &ShadowView, clamps: bool) -> ViewData {
    let (data, size_px) = (&view.data, [view.resolution; 2]);
    let drawn = if data.projection == ShadowViewData::PARABOLOID {
        // The hemisphere, and a little more for filters: a texel is at most this large an angle.
        let plane = view.clip_from_ws.row(2);
        let beyond = 2.0 * data.border * data.texel_m * data.far_m;
        let plane = plane.xyz().extend(plane.w + beyond);
        ViewData::of_plane(&view.clip_from_ws, plane, view.eye_ws, size_px)
    } else {
        let plain = ViewData::new(&view.clip_from_ws, view.eye_ws, size_px).without(view.hole);
        if clamps { plain.clamping_near() } else { plain }
    };
    ViewData {
        // Compute clamps without the adapter's help.
        depth_limit: f32::MAX,
        near_m: data.near_m,
        share: 1.0 - 2.0 * data.border / view.resolution as f32,
        layer: data.layer,
        ..drawn
    }
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
