//! What the camera sees in mirrors and smooth glass: rays follow it to the first surface that scatters.
//!
//! Where a surface mirrors exactly or refracts without blur, a fragment splits the eye's ray by Fresnel's law into what is
//! reflected and what passes (Whitted 1980, "An Improved Illumination Model for Shaded Display"), and follows both through
//! the scene's trees with the vertices and interfaces of the reference (`paths/`): Snell's law, total reflection, absorption by
//! the way inside. At further interfaces only the stronger part goes on, and takes the share of the weaker one with it:
//! neither noise nor a tree of rays. Where a ray ends on what the picture shows, it takes the picture's light, with all that the
//! picture has: shadows, indirect light, caustics. What the picture does not show is lit by lamps with hard shadows and by the
//! surroundings. Shading leaves out what else stands in for mirrors and glass (`followed.wesl`).
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | trees, scene, surface buffer, picture of what is opaque | the same picture, changed | Rgba16Float | nits · radiance scale |
//!
//! The light stays of the part that it is of (`docs/glossary.md`): each part's picture shows that part in its mirrors.
//!
//! # Limits
//! - What is rougher than a mirror (0.0225) keeps its stand-in, and so do blended surfaces.
//! - What the picture does not show has no indirect light but the stand-in, no caustics, and hard shadows whatever
//!   `shadow.*` says; all lamps are looked at. What it shows is taken as it looks from the eye.
//! - Of 13 faces on, rays end black. Glass does not disperse. The weaker parts are taken for as bright as the stronger ones.
//! - Under MSAA mirrors are followed once a pixel.
//! - Frosted glass and rough mirrors are not followed.
//!
//! Cost: nothing without such surfaces or the setting. With them 8 bytes a pixel of room, 16 of bandwidth for each copy of the
//! picture (of what is opaque, and once more before see-through layers), and for each pixel of mirrors and glass two paths
//! (a mirror's second ends where it begins) of up to 13 rays, and one more ray for each lamp where the picture shows nothing; once for each layer of see-through surfaces.

mod settings;

use chiaro_gpu::wgpu::{self, BlendComponent, BlendFactor, BlendOperation, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, Bind, Buffer, ComputePipeline, Dispatch, Draw, Frame, Gpu, GpuError, Group, Life,
    RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions, TexturePool,
};

pub use settings::{SpecularSettings, SpecularTechnique};

use crate::rays::TraceFacts;
use crate::scene::{SceneFacts, SceneGpu};
use crate::{Kit, Pass, shaders};

const ADD: BlendComponent = BlendComponent {
    src_factor: BlendFactor::One,
    dst_factor: BlendFactor::One,
    operation: BlendOperation::Add,
};

/// The passes.
#[derive(Debug)]
pub struct SpecularRays {
    copy: ComputePipeline,
    // Of what is opaque.
    follow: RenderPipeline,
    // Of see-through layers, for scenes that have any.
    follow_layer: Option<RenderPipeline>,
    sampler: wgpu::Sampler,
}

/// A copy of the picture, of one size.
#[derive(Debug)]
pub struct SpecularRoom(Texture);

/// Surfaces whose mirrors are followed.
#[derive(Clone, Copy, Debug)]
pub struct SpecularSurfaces<'a> {
    /// Depth of the surfaces.
    pub depth: &'a Texture,
    /// The surfaces.
    pub surface: &'a Texture,
    /// What passes them, where they are see-through.
    pub through: Option<&'a Texture>,
    /// Depth of what is opaque.
    pub opaque_depth: &'a Texture,
}

impl Pass for SpecularRays {
    type Key = SceneFacts;

    fn compile(kit: &Kit, facts: &SceneFacts) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let shared = &[frame_layout, scene_layout];
        let constants = [&facts.constants()[..], &TraceFacts::of(*facts).constants()].concat();
        let target = [wgpu::ColorTargetState {
            format: TextureFormat::Rgba16Float,
            blend: Some(wgpu::BlendState { color: ADD, alpha: ADD }),
            write_mask: wgpu::ColorWrites::ALL,
        }];
        let follow = |layered| {
            let options =
                RenderPipelineOptions { targets: &target, constants: &constants, ..Default::default() };
            RenderPipeline::new(gpu, library, &shaders::specular_follow(layered), shared, &options)
        };
        Ok(Self {
            copy: ComputePipeline::new(gpu, library, &shaders::plain("specular/copy.cs.wesl"), &[], &[])?,
            follow: follow(false)?,
            follow_layer: facts.see_through().then(|| follow(true)).transpose()?,
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("picture"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
        })
    }

    fn serves(has: &SceneFacts, wanted: &SceneFacts) -> bool {
        has.serve(*wanted)
    }
}

impl SpecularRays {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        [width, height]: [u32; 2],
        room: &'r mut Option<SpecularRoom>,
    ) -> &'r SpecularRoom {
        let serves = |SpecularRoom(picture): &SpecularRoom| {
            let has = picture.options();
            [has.width, has.height] == [width, height]
        };
        chiaro_gpu::keep(room, serves, || {
            let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
            let options = TextureOptions::new(width, height, TextureFormat::Rgba16Float, usage);
            SpecularRoom(pool.lend(gpu, "specular_picture", Life::Frame, options))
        })
    }

    /// Keeps the picture as it is now, to be looked up.
    pub fn record_copy(
        &self,
        frame: &mut Frame<'_>,
        radiance: &Texture,
        SpecularRoom(picture): &SpecularRoom,
    ) {
        let options = picture.options();
        let binds = [("source", radiance.into()), ("picture", picture.into())];
        let threads = Dispatch::Threads([options.width, options.height, 1]);
        frame.compute("specular/copy", &self.copy, &[], &binds, threads);
    }

    /// Adds what surfaces mirror and let through to `radiance`, by the picture that was kept.
    pub fn record_follow(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene, tracer): (&Group, &SceneGpu, &Buffer),
        surfaces: SpecularSurfaces<'_>,
        (radiance, SpecularRoom(picture)): (&Texture, &SpecularRoom),
    ) {
        let pipeline = match surfaces.through {
            Some(_) => self.follow_layer.as_ref(),
            None => Some(&self.follow),
        };
        let Some(pipeline) = pipeline else { return };
        let mut binds: Vec<Bind<'_>> = vec![
            ("tracer", tracer.into()),
            ("depth", surfaces.depth.into()),
            ("surface", surfaces.surface.into()),
            ("opaque_depth", surfaces.opaque_depth.into()),
            ("picture", picture.into()),
            ("picture_sampler", (&self.sampler).into()),
        ];
        binds.extend(surfaces.through.map(|through| ("through", through.into())));
        let attachment = Attachment { texture: radiance, layer: 0, clear: None, resolve: None };
        let targets = Targets { color: &[attachment], depth: None };
        frame.render("specular/follow", targets, |pass| {
            pass.draw(pipeline, &[frame_group, scene.group()], &binds, Draw::FullScreen);
        });
    }
}
