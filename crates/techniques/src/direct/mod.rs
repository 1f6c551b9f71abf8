//! Direct light from any number of lights, in a deferred (compute) and a forward (MSAA) pipeline over the same WESL.
//!
//! Local lights are found through froxels (Olsson, Billeter & Assarsson 2012, "Clustered Deferred and Forward
//! Shading"): a bit per light says whether it may reach the froxel, so hundreds of lights cost what they light. A
//! light is cut off only by the range its file states: no energy is lost to an invented radius.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | frame, lights, shadow views (group 0) | light_grid | u32 words, a bit a light | – |
//! | surface buffer, shadow maps | radiance | Rgba16Float | nits · radiance scale |
//!
//! Cost: 24 bytes a pixel read, 8 written, and per light the BRDF and the filter's taps.

use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, Bind, Buffer, ComputePipeline, DepthAttachment, Dispatch, Draw, Frame, Gpu, GpuError, Group,
    Life, Mapping, RenderPipeline, RenderPipelineOptions, Scale, Targets, Texture, TextureOptions,
    TexturePool, ViewHint, parallel,
};

use crate::caustics::CausticLight;
use crate::scene::OPAQUE;
use crate::scene::{SceneFacts, SceneGpu};
use crate::shadow::{Lookup, ShadowOutputs, ShadowSettings};
use crate::view::culling::{DEPTH_COMPARE, DrawLists, Kinds, draw_classes, kinds};
use crate::view::{SurfaceBuffer, cull_mode};
use crate::{Kit, Pass, shaders};

const RADIANCE: ViewHint =
    ViewHint::scaled("The frame before averaging and tone mapping", Mapping::Exposed, Scale::Nits);
const UNLIT: ViewHint = ViewHint::new("What unlit materials add: white is the display's", Mapping::Color);
const CAUSTICS: ViewHint = ViewHint::scaled("The frame's caustics alone", Mapping::Exposed, Scale::Nits);
const DIRECT: ViewHint = ViewHint::scaled("The frame's direct light alone", Mapping::Exposed, Scale::Nits);

/// What shaders are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permutations {
    /// How shadows are looked up.
    pub shadow: Lookup,
    /// Samples per pixel of the forward pipeline; `None` for the deferred one.
    pub forward: Option<u32>,
    /// What materials use; of the deferred pipeline only whether they glow, and what rays may meet.
    pub facts: SceneFacts,
}

impl Permutations {
    /// Those that settings ask for.
    pub fn new(shadow: &ShadowSettings, forward: Option<u32>, facts: SceneFacts) -> Self {
        let shadow = Lookup::new(shadow);
        let deferred = SceneFacts { glows: facts.glows, ..shadow.facts(facts) };
        Self { shadow, forward, facts: if forward.is_some() { facts } else { deferred } }
    }

    /// Constants of every shader that looks shadows up.
    pub fn constants(&self, gpu: &Gpu) -> Vec<(&'static str, f64)> {
        self.shadow.constants(gpu, self.facts)
    }
}

/// The direct lighting passes.
#[derive(Debug)]
pub struct DirectLight {
    grid: ComputePipeline,
    shading: Shading,
    permutations: Permutations,
}

/// What turns light and surfaces into radiance.
#[derive(Debug)]
enum Shading {
    Deferred(ComputePipeline),
    Forward { kinds: Kinds, background: RenderPipeline },
}

/// What light is rendered into, of one size.
#[derive(Debug)]
pub struct LightRoom {
    /// Rgba16Float.
    pub radiance: Texture,
    /// Rgba16Float, the colour of unlit materials, where there are any.
    pub unlit: Option<Texture>,
    /// Rgba16Float, direct light alone, where parts of light are asked for.
    pub direct: Option<Texture>,
    /// Rgba16Float, caustics alone, where parts of light are asked for and there are any.
    pub caustics: Option<Texture>,
    /// For frames that have no caustics.
    pub no_caustics: CausticLight,
    /// Black, for frames that gather no indirect light.
    pub no_irradiance: Texture,
    light_grid: Buffer,
    words: u64,
    // Of the forward pipeline: colour and depth.
    multisampled: Option<(Texture, Texture)>,
}

impl Pass for DirectLight {
    type Key = Permutations;

    fn compile(kit: &Kit, &permutations: &Permutations) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let shared = &[frame_layout, scene_layout];
        let constants = permutations.constants(gpu);
        let source = permutations.shadow.source;
        let grid = || ComputePipeline::new(gpu, library, &shaders::plain("light/grid.cs.wesl"), shared, &[]);
        let Some(msaa) = permutations.forward else {
            let shade = shaders::shade(permutations.facts.glows, source);
            let (shade, grid) =
                parallel::join(|| ComputePipeline::new(gpu, library, &shade, shared, &constants), grid);
            return Ok(Self { grid: grid?, shading: Shading::Deferred(shade?), permutations });
        };
        let target = [wgpu::ColorTargetState {
            format: TextureFormat::Rgba16Float,
            blend: None,
            write_mask: wgpu::ColorWrites::ALL,
        }];
        let multisampled = msaa > 1;
        let forward_constants = [&constants[..], &permutations.facts.constants()].concat();
        let forward = |class: usize| {
            let masked = class & 2 != 0;
            let options = RenderPipelineOptions {
                targets: &target,
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                cull: cull_mode(class),
                samples: msaa,
                alpha_to_coverage: masked && multisampled,
                constants: &forward_constants,
                ..Default::default()
            };
            RenderPipeline::new(
                gpu,
                library,
                &shaders::forward(masked, multisampled, source),
                shared,
                &options,
            )
        };
        let background = RenderPipelineOptions {
            targets: &target,
            // Where depth is still 0; what is drawn there leaves it so.
            depth: Some((TextureFormat::Depth32Float, wgpu::CompareFunction::Equal)),
            samples: msaa,
            ..Default::default()
        };
        let background_entry = shaders::background();
        let (kinds, (background, grid)) = parallel::join(
            || kinds(permutations.facts.draws(OPAQUE), forward),
            || {
                let background = || RenderPipeline::new(gpu, library, &background_entry, shared, &background);
                parallel::join(background, grid)
            },
        );
        Ok(Self {
            grid: grid?,
            shading: Shading::Forward { kinds: kinds?, background: background? },
            permutations,
        })
    }
}

impl DirectLight {
    /// Room for a picture size and a light grid; where materials are `unlit` for their colour, and where `parts` of the light
    /// are asked for, for those, and for `caustics` where there may be any. What is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        (size, grid): ([u32; 2], [u32; 4]),
        (unlit, parts, caustics): (bool, bool, bool),
        room: &'r mut Option<LightRoom>,
    ) -> &'r LightRoom {
        let words = grid.iter().map(|&n| u64::from(n)).product();
        let samples = self.permutations.forward;
        let serves = |room: &LightRoom| {
            let has = room.radiance.options();
            let has_samples = room.multisampled.as_ref().map(|(color, _)| color.options().samples);
            [has.width, has.height] == size
                && room.unlit.is_some() == unlit
                && room.direct.is_some() == parts
                && room.caustics.is_some() == (parts && caustics)
                && room.words >= words
                && has_samples == samples
        };
        chiaro_gpu::keep(room, serves, || {
            let lend = |name, format, usage, samples| {
                let options =
                    TextureOptions { samples, ..TextureOptions::new(size[0], size[1], format, usage) };
                pool.lend(gpu, name, Life::Frame, options)
            };
            let attachment = TextureUsages::RENDER_ATTACHMENT;
            let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | attachment;
            LightRoom {
                radiance: lend("radiance", TextureFormat::Rgba16Float, usage, 1).described(RADIANCE),
                unlit: unlit.then(|| lend("unlit", TextureFormat::Rgba16Float, usage, 1).described(UNLIT)),
                direct: parts
                    .then(|| lend("direct_light", TextureFormat::Rgba16Float, usage, 1).described(DIRECT)),
                caustics: (parts && caustics).then(|| {
                    lend("caustics_alone", TextureFormat::Rgba16Float, usage, 1).described(CAUSTICS)
                }),
                no_caustics: CausticLight::none(gpu),
                no_irradiance: Texture::new(
                    gpu,
                    "no_irradiance",
                    Life::Kept,
                    TextureOptions::new(1, 1, TextureFormat::Rgba16Float, TextureUsages::TEXTURE_BINDING),
                ),
                light_grid: Buffer::new(gpu, "light_grid", Life::Frame, 4 * words, BufferUsages::STORAGE),
                words,
                multisampled: samples.map(|samples| {
                    (
                        lend("forward_color", TextureFormat::Rgba16Float, attachment, samples),
                        lend("forward_depth", TextureFormat::Depth32Float, attachment, samples),
                    )
                }),
            }
        })
    }

    /// Finds the lights of every froxel.
    pub fn record_grid(&self, frame: &mut Frame<'_>, frame_group: &Group, room: &LightRoom) -> Buffer {
        let lanes = room.words.div_ceil(64) as u32;
        frame.compute(
            "direct/light_grid",
            &self.grid,
            &[frame_group],
            &[("light_grid", (&room.light_grid).into())],
            Dispatch::Groups([lanes.min(32_768), lanes.div_ceil(32_768), 1]),
        );
        room.light_grid.clone()
    }

    /// Deferred: radiance from the surface buffer.
    ///
    /// # Panics
    /// When compiled for the forward pipeline.
    pub fn record_deferred(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        surface: &SurfaceBuffer,
        light: LightInputs<'_>,
        radiance: &Texture,
    ) {
        let Shading::Deferred(pipeline) = &self.shading else {
            panic!("direct: compiled for the forward pipeline")
        };
        let mut binds = light.binds();
        binds.extend(surface_binds(surface));
        binds.push(("radiance", radiance.into()));
        if let Some(emissive) = &surface.emissive {
            binds.push(("emissive", emissive.into()));
        }
        let options = radiance.options();
        let threads = Dispatch::Threads([options.width, options.height, 1]);
        frame.compute("direct/shade", pipeline, &[frame_group, scene.group()], &binds, threads);
    }

    /// Forward: radiance from the camera's draw list, view 0; `sky` in stored units, `None` draws the environment.
    ///
    /// # Panics
    /// When compiled for the deferred pipeline.
    pub fn record_forward(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (lists, room): (&DrawLists, &LightRoom),
        light: LightInputs<'_>,
        sky: Option<wgpu::Color>,
        radiance: &Texture,
    ) {
        let (Some((color, depth)), Shading::Forward { kinds, background }) =
            (&room.multisampled, &self.shading)
        else {
            panic!("direct: compiled for the deferred pipeline")
        };
        // One sample needs no resolve: the radiance target is drawn into.
        let single = self.permutations.forward == Some(1);
        let attachment = Attachment {
            texture: if single { radiance } else { color },
            layer: 0,
            clear: Some(sky.unwrap_or(wgpu::Color::TRANSPARENT)),
            resolve: (!single).then_some(radiance),
        };
        let passes = Targets {
            color: &[attachment],
            depth: Some(DepthAttachment { texture: depth, layer: 0, clear: Some(0.0) }),
        };
        let binds = light.binds();
        let shared = &[frame_group, scene.group()];
        frame.render("direct/forward", passes, |pass| {
            draw_classes(pass, kinds, OPAQUE, shared, &binds, (lists, 0, true));
            if sky.is_none() {
                pass.draw(background, shared, &binds, Draw::FullScreen);
            }
        });
    }
}

/// What surfaces are lit by.
#[derive(Clone, Copy, Debug)]
pub struct LightInputs<'a> {
    /// Shadows of lamps.
    pub shadows: &'a ShadowOutputs,
    /// Which lamps reach where.
    pub light_grid: &'a Buffer,
    /// Indirect light at each pixel: see [`crate::indirect::gather`].
    pub irradiance: &'a Texture,
    /// The same straight from what glows and surrounds the scene.
    pub source_irradiance: &'a Texture,
    /// Caustics at each pixel: see [`crate::caustics`].
    pub caustics: &'a CausticLight,
}

impl<'a> LightInputs<'a> {
    /// What shaders bind that light surfaces.
    pub fn binds(&self) -> Vec<Bind<'a>> {
        let mut binds = lighting_binds(self.shadows, self.light_grid);
        binds.push(("irradiance", self.irradiance.into()));
        binds.push(("source_irradiance", self.source_irradiance.into()));
        binds.push(self.caustics.bind());
        binds
    }
}

/// What `direct/lighting.wesl` binds.
pub fn lighting_binds<'a>(shadows: &'a ShadowOutputs, light_grid: &'a Buffer) -> Vec<Bind<'a>> {
    let mut binds = shadows.binds();
    binds.push(("light_grid", light_grid.into()));
    binds
}

/// The surface buffer's bindings.
pub fn surface_binds(surface: &SurfaceBuffer) -> [Bind<'_>; 2] {
    [("depth", (&surface.depth).into()), ("surface", (&surface.surface).into())]
}
