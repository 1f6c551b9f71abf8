//! See-through surfaces: alpha blending and transmission, in any order and number of layers up to a limit.
//!
//! Opaque surfaces are rendered first. Then see-through ones are peeled into layers, the nearest first (Everitt 2001,
//! "Interactive Order-Independent Transparency"): each layer is a visibility buffer of its own. From the farthest to the
//! nearest a layer is resolved and lit like an opaque surface and laid over a copy of the picture so far, which is also
//! what refraction and frosted glass look up. Sorted by pixel, not by object, and the same every time.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | camera's draw list, opaque depth | layers' visibility and depth | R32Uint, Depth32Float | as the surface buffer |
//! | those, lights, shadows, picture so far | the same picture, changed | Rgba16Float | nits · radiance scale |
//!
//! Limits and stated biases: what lies behind the last layer (`surface.layers`) is opaque only; of surfaces in exactly one
//! plane one is seen. The surface buffer and everything made of it (AOVs) hold opaque surfaces only. Refraction bends
//! the ray once, at the surface, for the material's thickness, and finds only what the picture shows (Morgan
//! McGuire & Mara 2017 call it screen-space refraction): what is hidden or off the picture is replaced by the
//! environment, or without one by the picture's edge; neighbours may already hold nearer layers. Frosted glass blurs by
//! 16 taps of mips. Lights do not shine through a surface: they are seen through it. Shadows are full behind
//! transmission, and masked at half alpha behind blending. Under MSAA layers are sampled once a pixel; jittered frames
//! smooth them.
//!
//! Cost: nothing without see-through materials. With them per layer, full of surfaces or empty: 8 bytes a pixel of
//! memory, one raster pass over the see-through triangles, and about 40 bytes a pixel of bandwidth; where a layer shows
//! something, 48 bytes a pixel more and its lighting.

use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, Binding, ComputePipeline, DepthAttachment, Dispatch, Frame, Gpu, GpuError, Group, Life,
    RenderPipeline, RenderPipelineOptions, Targets, Texture, TextureOptions, TexturePool, parallel,
};

use crate::direct::LightInputs;
use crate::indirect::gather::Gathered;
use crate::scene::SEE_THROUGH;
use crate::scene::{SceneFacts, SceneGpu};
use crate::shaders::{self, Layer};
use crate::shadow::Lookup;
use crate::view::ViewTable;
use crate::view::cull_mode;
use crate::view::culling::{DEPTH_COMPARE, DrawLists, Kinds, draw_classes, kinds};
use crate::{Kit, Pass};

/// Sides of the copied picture are multiples of this, so that all its mips are exact halves.
const BLOCK: u32 = 64;
/// Mips of the copied picture: down to one texel a block.
const MIPS: u32 = 7;

/// The passes.
#[derive(Debug)]
pub struct Transparency {
    // The first layer, and those behind another.
    peel: Vec<Kinds>,
    resolve: ComputePipeline,
    // The picture so far with its mips, and further mips.
    behind: Vec<ComputePipeline>,
    shade: ComputePipeline,
    sampler: wgpu::Sampler,
    facts: SceneFacts,
    indexed: bool,
}

/// Gathers the light of a layer by its depth and surface.
pub type GatherLayer<'a> = &'a dyn Fn(&mut Frame<'_>, &Texture, &Texture) -> Gathered;

/// Adds what a layer mirrors and lets through to the picture, by its depth and surface and by what passes it.
pub type FollowLayer<'a> = &'a dyn Fn(&mut Frame<'_>, &Texture, &Texture, &Texture);

/// Layers of one size.
#[derive(Debug)]
pub struct LayerRoom {
    // Visibility and depth, from the nearest.
    layers: Vec<(Texture, Texture)>,
    surface: Texture,
    through: Texture,
    emissive: Option<Texture>,
    behind: Texture,
}

impl LayerRoom {
    /// Which triangle of the nearest layer each pixel shows: R32Uint, triangle of the camera's draw list + 1.
    pub fn nearest(&self) -> Option<&Texture> {
        self.layers.first().map(|(visibility, _)| visibility)
    }
}

impl Pass for Transparency {
    type Key = (Lookup, SceneFacts);

    fn compile(kit: &Kit, &(shadow, facts): &Self::Key) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let shared = &[frame_layout, scene_layout];
        let materials = facts.constants();
        let indexed = gpu.optional.primitive_index;
        let target = [wgpu::ColorTargetState {
            format: TextureFormat::R32Uint,
            blend: None,
            write_mask: wgpu::ColorWrites::ALL,
        }];
        let peel = |layer: Layer, kind: usize| {
            let masked = kind & 2 != 0;
            let mut constants = if masked { materials.to_vec() } else { Vec::new() };
            if indexed {
                constants.push(("CLASS", (SEE_THROUGH.start + kind) as f64));
            }
            let options = RenderPipelineOptions {
                targets: &target,
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                cull: cull_mode(kind),
                constants: &constants,
                ..Default::default()
            };
            RenderPipeline::new(gpu, library, &shaders::visibility(indexed, masked, layer), shared, &options)
        };
        let drawn = facts.draws(SEE_THROUGH);
        let peels = |after: usize| kinds(drawn, |kind| peel([Layer::First, Layer::Next][after], kind));
        let resolve = shaders::resolve(facts.glows, true);
        let resolve = || ComputePipeline::new(gpu, library, &resolve, shared, &materials);
        let behind = |after| ComputePipeline::new(gpu, library, &shaders::behind(after == 0), &[], &[]);
        let constants = shadow.constants(gpu, facts);
        let shade = shaders::shade_layer(facts.glows, shadow.source);
        let shade = || ComputePipeline::new(gpu, library, &shade, shared, &constants);
        let ((shade, peel), (resolve, behind)) = parallel::join(
            || parallel::join(shade, || parallel::each(2, peels)),
            || parallel::join(resolve, || parallel::each(2, behind)),
        );
        Ok(Self {
            peel: peel?,
            resolve: resolve?,
            behind: behind?,
            shade: shade?,
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("behind"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
            facts,
            indexed,
        })
    }
}

impl Transparency {
    /// Room for so many layers at a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        layers: u32,
        room: &'r mut Option<LayerRoom>,
    ) -> &'r LayerRoom {
        let serves = |room: &LayerRoom| {
            let has = room.surface.options();
            [has.width, has.height] == size
                && room.layers.len() == layers as usize
                && room.emissive.is_some() == self.facts.glows
        };
        let sampled = TextureUsages::TEXTURE_BINDING;
        let lend = |name, format, usage| {
            let options = TextureOptions::new(size[0], size[1], format, sampled | usage);
            pool.lend(gpu, name, Life::Frame, options)
        };
        let (attachment, storage) = (TextureUsages::RENDER_ATTACHMENT, TextureUsages::STORAGE_BINDING);
        let [wide, high] = size.map(|side| side.next_multiple_of(BLOCK));
        let copy = TextureOptions::new(wide, high, TextureFormat::Rgba16Float, sampled | storage);
        let layer = |_| {
            (
                lend("layer_visibility", TextureFormat::R32Uint, attachment),
                lend("layer_depth", TextureFormat::Depth32Float, attachment),
            )
        };
        chiaro_gpu::keep(room, serves, || LayerRoom {
            layers: (0..layers).map(layer).collect(),
            surface: lend("layer_surface", TextureFormat::Rgba32Uint, storage),
            through: lend("layer_through", TextureFormat::Rgba32Uint, storage),
            emissive: self.facts.glows.then(|| lend("layer_emissive", TextureFormat::Rgba16Float, storage)),
            behind: pool.lend(gpu, "behind", Life::Frame, TextureOptions { mips: MIPS, ..copy }),
        })
    }

    /// Lays the see-through surfaces of a view over `radiance`, the picture of what is opaque with its depth. `gather` finds
    /// the indirect light of each layer, where there is any; `follow` adds what smooth glass shows, where rays follow it.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (table, lists, view): (&ViewTable, &DrawLists, u32),
        (light, gather, follow): (LightInputs<'_>, Option<GatherLayer<'_>>, Option<FollowLayer<'_>>),
        opaque_depth: &Texture,
        (radiance, room): (&Texture, &LayerRoom),
    ) {
        let shared: &[&Group] = &[frame_group, scene.group()];
        for number in 0..room.layers.len() {
            self.record_peel(frame, shared, (table, lists, view), (room, number), opaque_depth);
        }
        let options = room.surface.options();
        let pixels = Dispatch::Threads([options.width, options.height, 1]);
        for (visibility, depth) in room.layers.iter().rev() {
            let mut binds = vec![
                ("visibility", visibility.into()),
                ("surface", (&room.surface).into()),
                ("through", (&room.through).into()),
            ];
            binds.extend(room.emissive.as_ref().map(|emissive| ("emissive", emissive.into())));
            let resolve =
                [&binds[..], &[("draw_list", (&lists.list).into()), ("view", table.view(view))]].concat();
            frame.compute("transparency/resolve", &self.resolve, shared, &resolve, pixels);
            self.record_behind(frame, radiance, &room.behind);
            let gathered = gather.map(|gather| gather(frame, depth, &room.surface));
            let (bounced, sourced) = gathered.as_ref().map(Gathered::parts).unwrap_or_default();
            let own = LightInputs {
                irradiance: bounced.unwrap_or(light.irradiance),
                source_irradiance: sourced.unwrap_or(light.source_irradiance),
                ..light
            };
            binds.extend(own.binds());
            binds.extend([
                ("depth", depth.into()),
                ("opaque_depth", opaque_depth.into()),
                ("behind", (&room.behind).into()),
                ("behind_sampler", (&self.sampler).into()),
                ("radiance", radiance.into()),
            ]);
            frame.compute("transparency/shade", &self.shade, shared, &binds, pixels);
            if let Some(follow) = follow {
                follow(frame, depth, &room.surface, &room.through);
            }
        }
    }

    fn record_peel(
        &self,
        frame: &mut Frame<'_>,
        shared: &[&Group],
        (table, lists, view): (&ViewTable, &DrawLists, u32),
        (room, number): (&LayerRoom, usize),
        opaque_depth: &Texture,
    ) {
        let (visibility, depth) = &room.layers[number];
        let targets = Targets {
            color: &[Attachment {
                texture: visibility,
                layer: 0,
                clear: Some(wgpu::Color::TRANSPARENT),
                resolve: None,
            }],
            depth: Some(DepthAttachment { texture: depth, layer: 0, clear: Some(0.0) }),
        };
        let mut binds = vec![
            ("view", table.view(view)),
            ("draw_arguments", (&lists.arguments).into()),
            ("draw_list", (&lists.list).into()),
            ("opaque_depth", opaque_depth.into()),
        ];
        let before = number.checked_sub(1).map(|before| &room.layers[before].1);
        binds.extend(before.map(|depth| ("front_depth", depth.into())));
        frame.render("transparency/peel", targets, |pass| {
            let pipelines = &self.peel[usize::from(number > 0)];
            draw_classes(pass, pipelines, SEE_THROUGH, shared, &binds, (lists, view, self.indexed));
        });
    }

    /// Copies the picture so far, and makes its mips in two steps of at most four.
    fn record_behind(&self, frame: &mut Frame<'_>, radiance: &Texture, behind: &Texture) {
        let options = behind.options();
        let threads = |shift: u32| Dispatch::Threads([options.width >> shift, options.height >> shift, 1]);
        let fine = [
            ("source", radiance.into()),
            ("whole", Binding::Mip(behind, 0)),
            ("half", Binding::Mip(behind, 1)),
            ("quarter", Binding::Mip(behind, 2)),
            ("eighth", Binding::Mip(behind, 3)),
        ];
        frame.compute("transparency/behind", &self.behind[0], &[], &fine, threads(0));
        let coarse = [
            ("source", Binding::Mip(behind, 3)),
            ("half", Binding::Mip(behind, 4)),
            ("quarter", Binding::Mip(behind, 5)),
            ("eighth", Binding::Mip(behind, 6)),
        ];
        frame.compute("transparency/behind_coarse", &self.behind[1], &[], &coarse, threads(3));
    }
}
