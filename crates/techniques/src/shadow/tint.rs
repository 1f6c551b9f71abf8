//! Tinted shadows of see-through casters: an approximation for scenes without caustics (`shadow.transmission_tint`).
//!
//! The light that glass lets through goes straight on, in the glass' colour: it is neither refracted nor focused, and
//! nothing is lost to reflection. See-through casters then leave the depth maps and are drawn into two maps of their
//! own, the depth of the nearest and the product of what all let through.

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, Bind, DepthAttachment, Frame, Gpu, GpuError, Group, GroupLayout, Life, Mapping,
    RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions, ViewHint,
};

use crate::scene::SEE_THROUGH;
use crate::scene::SceneFacts;
use crate::shaders;
use crate::view::culling::{DrawLists, Kinds, draw_classes};

const THROUGH: ViewHint =
    ViewHint::new("The nearest see-through caster from each light, a layer each", Mapping::ShadowDepth);

/// The maps of see-through casters; stand-ins of one texel where there are none.
#[derive(Clone, Debug)]
pub struct TintMaps {
    /// Depth32Float array, a layer per view: the nearest see-through caster, reversed.
    pub through: Texture,
    /// Rgba8Unorm array: the share of the light that passes all of them.
    pub tint: Texture,
}

impl TintMaps {
    /// Bytes of a texel of both.
    pub(super) const TEXEL_BYTES: u64 = 4 + 4;

    pub(super) fn new(gpu: &Gpu, side: u32, layers: u32) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT;
        let make = |name, format| {
            let options = TextureOptions::new(side, side, format, usage).array(layers);
            Texture::new(gpu, name, Life::Kept, options)
        };
        Self {
            through: make("shadow_through", TextureFormat::Depth32Float).described(THROUGH),
            tint: make("shadow_tint", TextureFormat::Rgba8Unorm),
        }
    }

    pub(super) fn binds(&self) -> [Bind<'_>; 2] {
        [("shadow_through", (&self.through).into()), ("shadow_tint", (&self.tint).into())]
    }
}

/// The pass that multiplies tints.
#[derive(Debug)]
pub(super) struct Tint {
    // Of all kinds alike.
    pipelines: Kinds,
}

impl Tint {
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        shared: &[&GroupLayout],
        facts: SceneFacts,
    ) -> Result<Self, GpuError> {
        let product = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::Dst,
            dst_factor: wgpu::BlendFactor::Zero,
            operation: wgpu::BlendOperation::Add,
        };
        let target = [wgpu::ColorTargetState {
            format: TextureFormat::Rgba8Unorm,
            blend: Some(wgpu::BlendState { color: product, alpha: wgpu::BlendComponent::REPLACE }),
            write_mask: wgpu::ColorWrites::ALL,
        }];
        let constants = facts.constants();
        let options = RenderPipelineOptions {
            targets: &target,
            unclipped_depth: gpu.optional.depth_clip_control,
            constants: &constants,
            ..Default::default()
        };
        let entry = shaders::plain("shadow/tint.vs.wesl");
        let drawn = facts.draws(SEE_THROUGH);
        let any = drawn.contains(&true);
        let pipeline =
            any.then(|| RenderPipeline::new(gpu, library, &entry, shared, &options)).transpose()?;
        Ok(Self { pipelines: drawn.map(|drawn| pipeline.clone().filter(|_| drawn)) })
    }

    /// Draws the see-through casters of one view: `depth` are the pipelines of depth maps.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        shared: &[&Group],
        depth: &Kinds,
        (maps, layer): (&TintMaps, u32),
        binds: &[Bind<'_>],
        (lists, view): (&DrawLists, u32),
    ) {
        let nearest = DepthAttachment { texture: &maps.through, layer, clear: Some(0.0) };
        let targets = Targets { color: &[], depth: Some(nearest) };
        frame.render("shadow/through", targets, |pass| {
            draw_classes(pass, depth, SEE_THROUGH, shared, binds, (lists, view, true));
        });
        let color =
            [Attachment { texture: &maps.tint, layer, clear: Some(wgpu::Color::WHITE), resolve: None }];
        frame.render("shadow/tint", Targets { color: &color, depth: None }, |pass| {
            draw_classes(pass, &self.pipelines, SEE_THROUGH, shared, binds, (lists, view, true));
        });
    }
}
