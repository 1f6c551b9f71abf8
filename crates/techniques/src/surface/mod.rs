//! Surfaces: what a camera sees, as geometry and material, before any light.
//!
//! Geometry is culled per view in clusters ([`culling`]); a raster pass writes depth and which triangle each pixel
//! shows (the visibility buffer, Burns & Hunt 2013); a compute pass turns that into the surface buffer. Fragments do
//! next to nothing, because on data-centre GPUs they are 20–30 times slower than compute. The buffer holds opaque and
//! masked surfaces; what others are seen through is [`crate::transparency`].
//!
//! | output | format | space, unit |
//! | --- | --- | --- |
//! | depth | Depth32Float | reversed: near = 1, infinity = 0 |
//! | visibility | R32Uint | triangle of the camera's draw list + 1; 0 = nothing |
//! | surface | Rgba32Uint | packed, see `surface.wesl` |
//! | emissive | Rgba16Float | nits · radiance scale; only for scenes with glowing materials |
//!
//! Limits: 128 MiB of geometry words and of draw list on guaranteed WebGPU limits (11 million triangles a view).
//! Cost: 20 bytes a pixel written, 24 with the visibility buffer.

pub mod clusters;
pub mod culling;
mod exact;
pub mod material;
pub mod scene;
mod settings;
mod shares;
pub mod texture;

pub use scene::{SceneFacts, SceneGpu};
pub use settings::{Lighting, Msaa, SurfaceSettings};

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, ComputePipeline, DepthAttachment, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life,
    RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions, TexturePool,
};
use culling::{CullView, Culling, DrawLists, draw_classes};

use crate::shaders::{self, Layer};

/// What [`Surfaces::record_resolve`] leaves.
#[derive(Clone, Debug)]
pub struct SurfaceBuffer {
    /// Depth32Float, reversed.
    pub depth: Texture,
    /// R32Uint, triangle + 1.
    pub visibility: Texture,
    /// Rgba32Uint.
    pub surface: Texture,
    /// Rgba16Float, for scenes that glow.
    pub emissive: Option<Texture>,
}

/// The passes from geometry to the surface buffer.
#[derive(Debug)]
pub struct Surfaces {
    culling: Culling,
    visibility: [RenderPipeline; scene::KINDS],
    resolve: [ComputePipeline; 2],
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
        let resolve =
            |glows| ComputePipeline::new(gpu, library, &shaders::resolve(glows, false), shared, &materials);
        Ok(Self {
            culling: Culling::new(gpu, library, scene_layout)?,
            visibility: [visibility(0)?, visibility(1)?, visibility(2)?, visibility(3)?],
            resolve: [resolve(false)?, resolve(true)?],
            indexed,
            facts,
            buffer: None,
        })
    }

    /// What scenes these passes were compiled for.
    pub fn facts(&self) -> SceneFacts {
        self.facts
    }

    /// Makes room for a scene at a picture size. Not inside a frame.
    pub fn reserve(&mut self, gpu: &Gpu, pool: &TexturePool, scene: &SceneGpu, [width, height]: [u32; 2]) {
        self.culling.reserve(gpu, scene, 1);
        let same = |b: &SurfaceBuffer| {
            let o = b.depth.options();
            o.width == width && o.height == height && b.emissive.is_some() == scene.glows
        };
        if self.buffer.as_ref().is_some_and(same) {
            return;
        }
        let sampled = TextureUsages::TEXTURE_BINDING;
        let lend = |name, format, usage| {
            pool.lend(gpu, name, Life::Frame, TextureOptions::new(width, height, format, sampled | usage))
        };
        self.buffer = Some(SurfaceBuffer {
            depth: lend("depth", TextureFormat::Depth32Float, TextureUsages::RENDER_ATTACHMENT),
            visibility: lend("visibility", TextureFormat::R32Uint, TextureUsages::RENDER_ATTACHMENT),
            surface: lend("surface", TextureFormat::Rgba32Uint, TextureUsages::STORAGE_BINDING),
            emissive: scene
                .glows
                .then(|| lend("emissive", TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING)),
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
    ) -> Texture {
        let buffer = self.buffer();
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
        frame.compute("surface/resolve", &self.resolve[usize::from(scene.glows)], shared, &binds, threads);
        buffer.clone()
    }
}

/// Which faces a class drops when seen by a camera.
pub fn cull_mode(class: usize) -> Option<wgpu::Face> {
    (class & 1 == 0).then_some(wgpu::Face::Back)
}
