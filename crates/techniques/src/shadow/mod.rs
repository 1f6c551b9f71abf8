//! Shadow maps (Williams 1978): the scene's depth seen from each light, compared with the depth of what is shaded.
//!
//! A sun has one orthographic map around what the camera can see of the scene; a spot light one perspective map around
//! its cone. Points are unshadowed so far. Every view keeps reversed depth (near 1, far 0) in its layer of one texture
//! array; outside its map a view casts no shadow. Percentage-closer filtering and the receiver's bias, which follows
//! from the texel's size on the receiver and the filter's reach, are in `lookup.wesl`.
//!
//! | input | output | format | space, unit |
//! | --- | --- | --- | --- |
//! | lights, scene bounds, camera | shadow views (group 0) | `ShadowView` | world metres |
//! | scene geometry | maps | Depth32Float array, a layer a view | reversed light-clip z |
//!
//! Limits: see-through surfaces cast full shadows, blended ones where their alpha is at least a half;
//! a spot wider than 160° is lit but unshadowed beyond that; one map for a sun is coarse in large scenes.
//! Cost: 4 bytes a texel, and one raster of the culled casters whenever light, camera (suns) or scene changed: a map that
//! rests is kept (`shadow.cache`).

pub mod raster;
mod settings;
mod views;

pub use settings::{Filter, Layout, PcfKernel, ShadowSettings};
pub use views::{CameraView, ShadowView, fit};

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Binding, Buffer, DepthAttachment, Frame, Gpu, GpuError, Group, GroupLayout, Life, RenderPipeline,
    RenderPipelineOptions, Targets, Texture, TextureOptions,
};

use crate::shaders;
use crate::surface::culling::{CullView, Culling, DEPTH_COMPARE, draw_classes};
use crate::surface::scene::KINDS;
use crate::surface::{SceneFacts, SceneGpu};

/// What [`ShadowMaps::record`] writes.
#[derive(Clone, Debug)]
pub struct ShadowOutputs {
    /// Depth32Float array, a layer per view.
    pub maps: Texture,
    /// Comparison sampler: passes where the receiver's reversed depth is at least the map's.
    pub compare: wgpu::Sampler,
    /// Plain sampler, for fetching four depths at once.
    pub gather: wgpu::Sampler,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct DrawView {
    clip_from_ws: [[f32; 4]; 4],
    // Uniform bindings start at multiples of 256 bytes.
    _pad: [[f32; 4]; 12],
}

const DRAW_VIEW_BYTES: u64 = 64;

/// The shadow map passes.
#[derive(Debug)]
pub struct ShadowMaps {
    culling: Culling,
    pipelines: [RenderPipeline; KINDS],
    outputs: ShadowOutputs,
    draw_views: Buffer,
    capacity: usize,
    // What lies in the maps: the views they were rendered for, the scene, and which of its poses.
    rendered: (u64, Vec<ShadowView>),
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
        Ok(Self {
            culling: Culling::new(gpu, library, scene_layout)?,
            pipelines: [pipeline(0)?, pipeline(1)?, pipeline(2)?, pipeline(3)?],
            outputs: ShadowOutputs { maps: maps(gpu, 1, 1), compare, gather },
            draw_views: draw_views(gpu, 1),
            capacity: 1,
            rendered: (0, Vec::new()),
            pose: 0,
            keeps: true,
            cull_front: settings.bias_cull_front,
            facts,
        })
    }

    /// Whether these passes serve `settings` without being made again.
    pub fn serves(&self, settings: &ShadowSettings, facts: SceneFacts) -> bool {
        self.cull_front == settings.bias_cull_front && self.facts == facts
    }

    /// Makes room for so many views. Not inside a frame. With `keeps`, views that rest keep their maps.
    pub fn reserve(&mut self, gpu: &Gpu, scene: &SceneGpu, views: &[ShadowView], keeps: bool) {
        self.culling.reserve(gpu, scene, views.len());
        let resolution = views.first().map_or(1, |view| view.resolution);
        let layers = views.len().max(1) as u32;
        let options = self.outputs.maps.options();
        if options.width != resolution || options.layers != Some(layers) {
            self.outputs.maps = maps(gpu, resolution, layers);
            self.rendered.1.clear();
        }
        if self.rendered.0 != scene.id() || !keeps {
            self.rendered = (scene.id(), Vec::new());
        }
        self.keeps = keeps;
        if views.len() > self.capacity {
            self.capacity = views.len();
            self.draw_views = draw_views(gpu, self.capacity);
        }
    }

    /// Renders the maps of views that moved since they were rendered last, and of those that see something that did.
    pub fn record(
        &mut self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        scene: &SceneGpu,
        views: &[ShadowView],
    ) -> ShadowOutputs {
        let keeps_near = frame.gpu().optional.depth_clip_control;
        let cull_view = |v: &ShadowView| CullView::new(&v.clip_from_ws, v.eye_ws, false, keeps_near);
        let casters_moved = |view: &ShadowView| match scene.motion.generation().wrapping_sub(self.pose) {
            0 => false,
            1 => {
                let view = cull_view(view);
                scene
                    .motion
                    .moved_bounds_ws()
                    .any(|(lo, hi)| view.sees(0.5 * (lo + hi), 0.5 * lo.distance(hi)))
            }
            _ => true,
        };
        let moved: Vec<(u32, &ShadowView)> = (0..)
            .zip(views)
            .filter(|(layer, view)| {
                self.rendered.1.get(*layer as usize) != Some(*view) || casters_moved(view)
            })
            .collect();
        let matrices: Vec<_> = moved
            .iter()
            .map(|(_, v)| DrawView {
                clip_from_ws: v.clip_from_ws.to_cols_array_2d(),
                _pad: Zeroable::zeroed(),
            })
            .collect();
        frame.upload(&self.draw_views, &matrices);
        let batch = Culling::views_at_once(frame.gpu(), scene);
        let names = ["shadow/cull_count", "shadow/cull_scan", "shadow/cull_expand"];
        for (first, chunk) in (0..).step_by(batch).zip(moved.chunks(batch)) {
            let cull_views: Vec<_> = chunk.iter().map(|(_, view)| cull_view(view)).collect();
            let lists = self.culling.record(frame, names, scene, &cull_views);
            for (index, (layer, _)) in chunk.iter().enumerate() {
                let targets = Targets {
                    color: &[],
                    depth: Some(DepthAttachment {
                        texture: &self.outputs.maps,
                        layer: *layer,
                        clear: Some(0.0),
                    }),
                };
                let offset = ((first + index) * size_of::<DrawView>()) as u64;
                let binds = [("draw_view", Binding::BufferRange(&self.draw_views, offset, DRAW_VIEW_BYTES))];
                frame.render("shadow/depth", targets, |pass| {
                    let shared = &[frame_group, scene.group()];
                    draw_classes(
                        pass,
                        &self.pipelines,
                        scene.classes(),
                        shared,
                        &binds,
                        (&lists, index, true),
                    );
                });
            }
        }
        if self.keeps && (!moved.is_empty() || self.rendered.1.len() != views.len()) {
            self.rendered = (scene.id(), views.to_vec());
        }
        self.pose = scene.motion.generation();
        self.outputs.clone()
    }
}

fn maps(gpu: &Gpu, resolution: u32, layers: u32) -> Texture {
    let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
    let options =
        TextureOptions::new(resolution, resolution, TextureFormat::Depth32Float, usage).array(layers);
    Texture::new(gpu, "shadow_maps", Life::Kept, options)
}

fn draw_views(gpu: &Gpu, views: usize) -> Buffer {
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    Buffer::new(gpu, "draw_views", Life::Frame, (views * size_of::<DrawView>()) as u64, usage)
}
