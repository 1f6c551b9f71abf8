//! Surfaces: what a camera sees, as geometry and material, before any light.
//!
//! Geometry is culled per view in clusters ([`culling`]); a raster pass writes depth and which triangle each pixel
//! shows (the visibility buffer, Burns & Hunt 2013); a compute pass turns that into the surface buffer. Fragments do
//! next to nothing, because on data-centre GPUs they are 20–30 times slower than compute. The buffer holds opaque and
//! masked surfaces; what others are seen through is [`crate::transparency`].
//!
//! | output | format | space, unit |
//! | --- | --- | --- |
//! | depth | Depth32Float (R32Float where compute draws) | reversed: near = 1, infinity = 0 |
//! | visibility | R32Uint | triangle of the camera's draw list + 1; 0 = nothing |
//! | surface | Rgba32Uint | packed, see `surface.wesl` |
//! | emissive | Rgba16Float | nits · radiance scale; only where compiled for a scene with glowing materials |
//!
//! Limits: 128 MiB of geometry words and of draw list on guaranteed WebGPU limits (11 million triangles a view).
//! Cost: 20 bytes a pixel written, 24 with the visibility buffer.

pub mod clusters;
pub mod culling;
mod exact;
pub mod material;
pub mod raster;
pub mod scene;
mod settings;
mod shares;
pub mod texture;

pub use scene::{SceneFacts, SceneGpu};
pub use settings::{Lighting, Msaa, Raster, SurfaceSettings};

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, ComputePipeline, DepthAttachment, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life,
    Mapping, RenderPipeline, RenderPipelineOptions, Scale, Targets, Texture, TextureOptions, TexturePool,
    ViewHint, parallel,
};
use culling::{CullView, Culling, DrawLists, Kinds, draw_classes, kinds};
use glam::Mat4;
use raster::{ComputeRaster, Draws};

use crate::shaders::{self, Layer};

const VISIBILITY: ViewHint = ViewHint::new("Which triangle each pixel shows: a colour each", Mapping::Number);
const EMISSIVE: ViewHint = ViewHint::scaled("What glows by itself", Mapping::Exposed, Scale::Nits);

/// What [`Surfaces::record_resolve`] leaves.
#[derive(Clone, Debug)]
pub struct SurfaceBuffer {
    /// Depth32Float, or R32Float where compute draws; reversed. Shaders read either as `texture_2d<f32>`.
    pub depth: Texture,
    /// R32Uint, triangle + 1.
    pub visibility: Texture,
    /// Rgba32Uint.
    pub surface: Texture,
    /// Rgba16Float, where passes were compiled for a scene that glows.
    pub emissive: Option<Texture>,
}

/// A view that surfaces are drawn for.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceView {
    /// What it may see.
    pub cull: CullView,
    /// Reversed depth.
    pub clip_from_ws: Mat4,
    /// How much smaller than a pixel a texture's footprint is.
    pub footprint_scale: f32,
    /// Taps along a slanted footprint at most.
    pub anisotropy: u32,
}

/// The passes from geometry to the surface buffer.
#[derive(Debug)]
pub struct Surfaces {
    culling: Culling,
    visibility: Kinds,
    // Draws in their place, where the picture fits it.
    raster: Option<ComputeRaster>,
    resolve: ComputePipeline,
    indexed: bool,
    facts: SceneFacts,
    buffer: Option<SurfaceBuffer>,
}

impl Surfaces {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        frame_layout: &GroupLayout,
        scene_layout: &GroupLayout,
        settings: &SurfaceSettings,
        facts: SceneFacts,
    ) -> Result<Self, GpuError> {
        let shared = &[frame_layout, scene_layout];
        let materials = facts.constants();
        let indexed = gpu.optional.primitive_index;
        let target = [wgpu::ColorTargetState {
            format: TextureFormat::R32Uint,
            blend: None,
            write_mask: wgpu::ColorWrites::ALL,
        }];
        let visibility = |class: usize| {
            let masked = class & 2 != 0;
            let mut constants = if masked { materials.to_vec() } else { Vec::new() };
            if indexed {
                constants.push(("CLASS", class as f64));
            }
            let options = RenderPipelineOptions {
                targets: &target,
                depth: Some((TextureFormat::Depth32Float, culling::DEPTH_COMPARE)),
                cull: cull_mode(class),
                constants: &constants,
                ..Default::default()
            };
            let entry = shaders::visibility(indexed, masked, Layer::None);
            RenderPipeline::new(gpu, library, &entry, shared, &options)
        };
        let resolve = shaders::resolve(facts.glows, false);
        let raster = || {
            (settings.raster == Raster::Compute)
                .then(|| ComputeRaster::new(gpu, library, scene_layout, facts, Draws::Numbers))
                .transpose()
        };
        let ((visibility, raster), (culling, resolve)) = parallel::join(
            || parallel::join(|| kinds(facts.draws(scene::OPAQUE), visibility), raster),
            || {
                parallel::join(
                    || Culling::new(gpu, library, scene_layout),
                    || ComputePipeline::new(gpu, library, &resolve, shared, &materials),
                )
            },
        );
        Ok(Self {
            culling: culling?,
            visibility: visibility?,
            raster: raster?,
            resolve: resolve?,
            indexed,
            facts,
            buffer: None,
        })
    }

    /// What scenes these passes were compiled for.
    pub fn facts(&self) -> SceneFacts {
        self.facts
    }

    /// Whether these passes serve `settings` without being made again.
    pub fn serves(&self, settings: &SurfaceSettings, facts: SceneFacts) -> bool {
        self.facts == facts && self.raster.is_some() == (settings.raster == Raster::Compute)
    }

    /// Makes room for a scene at a picture size. Not inside a frame.
    ///
    /// # Panics
    /// When the passes were compiled for less than the scene needs.
    pub fn reserve(&mut self, gpu: &Gpu, pool: &TexturePool, scene: &SceneGpu, [width, height]: [u32; 2]) {
        assert!(self.facts.serve(scene.facts), "surface: compiled for another scene: {:?}", self.facts);
        self.culling.reserve(gpu, scene, 1);
        let computes = self.raster.is_some() && ComputeRaster::fits_visibility(gpu, [width, height]);
        let (format, usage) = if computes {
            (TextureFormat::R32Float, TextureUsages::STORAGE_BINDING)
        } else {
            (TextureFormat::Depth32Float, TextureUsages::RENDER_ATTACHMENT)
        };
        let same = |b: &SurfaceBuffer| {
            let o = b.depth.options();
            [o.width, o.height] == [width, height] && o.format == format
        };
        if let Some(raster) = self.raster.as_mut().filter(|_| computes) {
            raster.reserve(gpu, [width, height], 1);
        }
        if self.buffer.as_ref().is_some_and(same) {
            return;
        }
        let sampled = TextureUsages::TEXTURE_BINDING;
        let lend = |name, format, usage| {
            pool.lend(gpu, name, Life::Frame, TextureOptions::new(width, height, format, sampled | usage))
        };
        self.buffer = Some(SurfaceBuffer {
            depth: lend("depth", format, usage),
            visibility: lend("visibility", TextureFormat::R32Uint, usage).described(VISIBILITY),
            surface: lend("surface", TextureFormat::Rgba32Uint, TextureUsages::STORAGE_BINDING),
            emissive: self
                .facts
                .glows
                .then(|| lend("emissive", TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING))
                .map(|texture| texture.described(EMISSIVE)),
        });
    }

    /// Culls for the camera; the forward pipeline draws from the list directly.
    pub fn cull(&self, frame: &mut Frame<'_>, scene: &SceneGpu, camera: &CullView) -> DrawLists {
        let names = ["surface/cull_count", "surface/cull_scan", "surface/cull_expand"];
        self.culling.record(frame, names, scene, &[*camera], &[])
    }

    /// Depth and visibility of opaque surfaces alone; returns the depth.
    ///
    /// # Panics
    /// When [`Surfaces::reserve`] was not called.
    pub fn record_visibility(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        scene: &SceneGpu,
        lists: &DrawLists,
        view: &SurfaceView,
    ) -> Texture {
        let buffer = self.buffer();
        let computes = buffer.depth.options().format == TextureFormat::R32Float;
        if let Some(raster) = self.raster.as_ref().filter(|_| computes) {
            let view = (view.clip_from_ws, view.footprint_scale, view.anisotropy);
            raster.record_visibility(frame, scene, lists, view, (&buffer.depth, &buffer.visibility));
            return buffer.depth.clone();
        }
        let shared = &[frame_group, scene.group()];
        let targets = Targets {
            color: &[Attachment {
                texture: &buffer.visibility,
                layer: 0,
                clear: Some(wgpu::Color::TRANSPARENT),
                resolve: None,
            }],
            depth: Some(DepthAttachment { texture: &buffer.depth, layer: 0, clear: Some(0.0) }),
        };
        let binds = [("draw_arguments", (&lists.arguments).into()), ("draw_list", (&lists.list).into())];
        frame.render("surface/visibility", targets, |pass| {
            draw_classes(pass, &self.visibility, scene::OPAQUE, shared, &binds, (lists, 0, self.indexed));
        });
        buffer.depth.clone()
    }

    // Frames are recorded after `reserve`: no room is a mistake of the caller's code.
    fn buffer(&self) -> &SurfaceBuffer {
        match &self.buffer {
            Some(buffer) => buffer,
            None => panic!("surface: no room reserved"),
        }
    }

    /// The surface buffer from this frame's visibility.
    ///
    /// # Panics
    /// When [`Surfaces::reserve`] was not called.
    pub fn record_resolve(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        scene: &SceneGpu,
        lists: &DrawLists,
    ) -> SurfaceBuffer {
        let buffer = self.buffer();
        let shared = &[frame_group, scene.group()];
        let mut binds = vec![
            ("visibility", (&buffer.visibility).into()),
            ("draw_list", (&lists.list).into()),
            ("surface", (&buffer.surface).into()),
        ];
        if let Some(emissive) = &buffer.emissive {
            binds.push(("emissive", emissive.into()));
        }
        let options = buffer.surface.options();
        let threads = Dispatch::Threads([options.width, options.height, 1]);
        frame.compute("surface/resolve", &self.resolve, shared, &binds, threads);
        buffer.clone()
    }
}

/// Which faces a class drops when seen by a camera.
pub fn cull_mode(class: usize) -> Option<wgpu::Face> {
    (class & 1 == 0).then_some(wgpu::Face::Back)
}
