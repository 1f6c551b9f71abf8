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

pub mod culling;
mod motion_vectors;
pub mod project;
pub mod raster;
mod settings;
mod table;

#[cfg(test)]
pub(crate) use motion_vectors::MomentsData;
pub use motion_vectors::{MOTION, Moment, MotionOutputs, MotionRoom, MotionVectors};
pub use settings::{Lighting, Msaa, Raster, SurfaceSettings};
pub use table::{Hole, MAX_VIEWS, ViewData, ViewTable};

use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, ComputePipeline, DepthAttachment, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping,
    RenderPipeline, RenderPipelineOptions, Scale, Targets, Texture, TextureOptions, TexturePool, ViewHint,
    parallel,
};
use culling::{DrawLists, Kinds, draw_classes, kinds};
use raster::{ComputeRaster, Draws, RasterRoom};

use crate::scene::{self, SceneFacts, SceneGpu};
use crate::shaders::{self, Layer};
use crate::{Kit, Pass};

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

/// The passes from geometry to the surface buffer.
#[derive(Debug)]
pub struct Surfaces {
    visibility: Kinds,
    // Draws in their place, where the picture fits it.
    raster: Option<ComputeRaster>,
    resolve: ComputePipeline,
    indexed: bool,
    facts: SceneFacts,
}

/// A surface buffer of one size, to be filled from any view.
#[derive(Debug)]
pub struct SurfaceRoom {
    buffer: SurfaceBuffer,
    // Where compute draws.
    raster: Option<RasterRoom>,
}

/// What [`Surfaces`] are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SurfaceKey {
    /// Whether compute draws.
    pub computes: bool,
    /// What scenes use.
    pub facts: SceneFacts,
}

impl SurfaceKey {
    /// What settings that leave nothing to the adapter ask for.
    pub fn new(settings: &SurfaceSettings, facts: SceneFacts) -> Self {
        Self { computes: settings.raster == Raster::Compute, facts }
    }
}

impl Pass for Surfaces {
    type Key = SurfaceKey;

    fn compile(kit: &Kit, &SurfaceKey { computes, facts }: &SurfaceKey) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
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
            computes
                .then(|| ComputeRaster::new(gpu, library, scene_layout, facts, Draws::Numbers))
                .transpose()
        };
        let (visibility, (raster, resolve)) = parallel::join(
            || kinds(facts.draws(scene::OPAQUE), visibility),
            || parallel::join(raster, || ComputePipeline::new(gpu, library, &resolve, shared, &materials)),
        );
        Ok(Self { visibility: visibility?, raster: raster?, resolve: resolve?, indexed, facts })
    }
}

impl Surfaces {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        room: &'r mut Option<SurfaceRoom>,
    ) -> &'r SurfaceRoom {
        let raster = self.raster.as_ref().filter(|_| ComputeRaster::fits_visibility(gpu, size));
        let serves = |room: &SurfaceRoom| {
            let has = room.buffer.depth.options();
            [has.width, has.height] == size
                && room.raster.is_some() == raster.is_some()
                && room.buffer.emissive.is_some() == self.facts.glows
        };
        chiaro_gpu::keep(room, serves, || {
            let (format, usage) = if raster.is_some() {
                (TextureFormat::R32Float, TextureUsages::STORAGE_BINDING)
            } else {
                (TextureFormat::Depth32Float, TextureUsages::RENDER_ATTACHMENT)
            };
            let lend = |name, format, usage| {
                let usage = TextureUsages::TEXTURE_BINDING | usage;
                pool.lend(gpu, name, Life::Frame, TextureOptions::new(size[0], size[1], format, usage))
            };
            let storage = TextureUsages::STORAGE_BINDING;
            let buffer = SurfaceBuffer {
                depth: lend("depth", format, usage),
                visibility: lend("visibility", TextureFormat::R32Uint, usage).described(VISIBILITY),
                surface: lend("surface", TextureFormat::Rgba32Uint, storage),
                emissive: self
                    .facts
                    .glows
                    .then(|| lend("emissive", TextureFormat::Rgba16Float, storage).described(EMISSIVE)),
            };
            SurfaceRoom { buffer, raster: raster.map(|raster| raster.room(gpu, size, 1)) }
        })
    }

    /// Depth and visibility of opaque surfaces alone, of one view of a table, which the lists were culled for; returns the
    /// depth.
    pub fn record_visibility(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (table, lists, view): (&ViewTable, &DrawLists, u32),
        room: &SurfaceRoom,
    ) -> Texture {
        debug_assert!(self.facts.serve(scene.facts), "surface: compiled for another scene");
        let buffer = &room.buffer;
        if let (Some(raster), Some(raster_room)) = (&self.raster, &room.raster) {
            let targets = (&buffer.depth, &buffer.visibility);
            raster.record_visibility(frame, scene, (table, lists), view, raster_room, targets);
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
        let binds = [
            ("view", table.view(view)),
            ("draw_arguments", (&lists.arguments).into()),
            ("draw_list", (&lists.list).into()),
        ];
        frame.render("surface/visibility", targets, |pass| {
            draw_classes(pass, &self.visibility, scene::OPAQUE, shared, &binds, (lists, view, self.indexed));
        });
        buffer.depth.clone()
    }

    /// The surface buffer of a view from this frame's visibility.
    pub fn record_resolve(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (table, lists, view): (&ViewTable, &DrawLists, u32),
        room: &SurfaceRoom,
    ) -> SurfaceBuffer {
        let buffer = &room.buffer;
        let shared = &[frame_group, scene.group()];
        let mut binds = vec![
            ("view", table.view(view)),
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
