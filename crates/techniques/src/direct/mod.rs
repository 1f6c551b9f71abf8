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

mod lights;

pub use lights::{grid_size, illuminance_scale, light_data};

use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Attachment, Bind, Buffer, ComputePipeline, DepthAttachment, Dispatch, Draw, Frame, Gpu, GpuError, Group,
    GroupLayout, Life, Mapping, RenderPipeline, RenderPipelineOptions, Scale, Targets, Texture,
    TextureOptions, TexturePool, ViewHint, parallel,
};

use crate::shaders;
use crate::shadow::{Lookup, ShadowOutputs, ShadowSettings};
use crate::surface::culling::{DEPTH_COMPARE, DrawLists, Kinds, draw_classes, kinds};
use crate::surface::scene::OPAQUE;
use crate::surface::{SceneFacts, SceneGpu, SurfaceBuffer, cull_mode};

const RADIANCE: ViewHint =
    ViewHint::scaled("The frame before averaging and tone mapping", Mapping::Exposed, Scale::Nits);
const UNLIT: ViewHint = ViewHint::new("What unlit materials add: white is the display's", Mapping::Color);

/// What shaders are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Permutations {
    /// How shadows are looked up.
    pub shadow: Lookup,
    /// Samples per pixel of the forward pipeline; `None` for the deferred one.
    pub forward: Option<u32>,
    /// What materials use; of the deferred pipeline only whether they glow.
    pub facts: SceneFacts,
}

impl Permutations {
    /// Those that settings ask for.
    pub fn new(shadow: &ShadowSettings, forward: Option<u32>, facts: SceneFacts) -> Self {
        let deferred = SceneFacts { glows: facts.glows, ..SceneFacts::default() };
        Self { shadow: Lookup::new(shadow), forward, facts: if forward.is_some() { facts } else { deferred } }
    }

    /// Constants of every shader that looks shadows up.
    pub fn constants(&self, gpu: &Gpu) -> Vec<(&'static str, f64)> {
        self.shadow.constants(gpu)
    }
}

/// The direct lighting passes.
#[derive(Debug)]
pub struct DirectLight {
    grid: ComputePipeline,
    shading: Shading,
    permutations: Permutations,
    targets: Option<Buffers>,
}

/// What turns light and surfaces into radiance.
#[derive(Debug)]
enum Shading {
    Deferred(ComputePipeline),
    Forward { kinds: Kinds, background: RenderPipeline },
}

#[derive(Debug)]
struct Buffers {
    radiance: Texture,
    unlit: Option<Texture>,
    light_grid: Buffer,
    words: u64,
    multisampled: Option<(Texture, Texture)>,
}

impl DirectLight {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        frame_layout: &GroupLayout,
        scene_layout: &GroupLayout,
        permutations: Permutations,
    ) -> Result<Self, GpuError> {
        let shared = &[frame_layout, scene_layout];
        let constants = permutations.constants(gpu);
        let float_maps = permutations.shadow.float_maps;
        let grid = || ComputePipeline::new(gpu, library, &shaders::plain("direct/grid.cs.wesl"), shared, &[]);
        let Some(msaa) = permutations.forward else {
            let shade = shaders::shade(permutations.facts.glows, float_maps);
            let (shade, grid) =
                parallel::join(|| ComputePipeline::new(gpu, library, &shade, shared, &constants), grid);
            return Ok(Self { grid: grid?, shading: Shading::Deferred(shade?), permutations, targets: None });
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
                &shaders::forward(masked, multisampled, float_maps),
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
            targets: None,
        })
    }

    /// What the passes were compiled for.
    pub fn permutations(&self) -> Permutations {
        self.permutations
    }

    /// Makes room for a picture size and a light grid, and where materials are unlit for their colour. Not inside a frame.
    pub fn reserve(
        &mut self,
        gpu: &Gpu,
        pool: &TexturePool,
        (size, grid): ([u32; 2], [u32; 4]),
        unlit: bool,
    ) {
        let forward = self.permutations.forward.is_some();
        let words = grid.iter().map(|&n| u64::from(n)).product();
        let samples = self.permutations.forward.unwrap_or(1);
        let fits = |b: &Buffers| {
            let o = b.radiance.options();
            let has = b.multisampled.as_ref().map_or(1, |(color, _)| color.options().samples);
            let has_depth = b.multisampled.is_some() == forward;
            let is_right = [o.width, o.height] == size && b.unlit.is_some() == unlit;
            is_right && b.words >= words && has_depth && (!forward || has == samples)
        };
        if self.targets.as_ref().is_some_and(fits) {
            return;
        }
        let lend = |name, format, usage, samples| {
            let options = TextureOptions { samples, ..TextureOptions::new(size[0], size[1], format, usage) };
            pool.lend(gpu, name, Life::Frame, options)
        };
        let attachment = TextureUsages::RENDER_ATTACHMENT;
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | attachment;
        self.targets = Some(Buffers {
            radiance: lend("radiance", TextureFormat::Rgba16Float, usage, 1).described(RADIANCE),
            unlit: unlit.then(|| lend("unlit", TextureFormat::Rgba16Float, usage, 1).described(UNLIT)),
            light_grid: Buffer::new(gpu, "light_grid", Life::Frame, 4 * words, BufferUsages::STORAGE),
            words,
            multisampled: forward.then(|| {
                (
                    lend("forward_color", TextureFormat::Rgba16Float, attachment, samples),
                    lend("forward_depth", TextureFormat::Depth32Float, attachment, samples),
                )
            }),
        });
    }

    // Frames are recorded after `reserve`, which fills the targets: no frame without it is a mistake of the caller's code.
    fn targets(&self) -> &Buffers {
        match &self.targets {
            Some(targets) => targets,
            None => panic!("direct: no room reserved"),
        }
    }

    /// Finds the lights of every froxel.
    pub fn record_grid(&self, frame: &mut Frame<'_>, frame_group: &Group) -> Buffer {
        let targets = self.targets();
        let lanes = targets.words.div_ceil(64) as u32;
        frame.compute(
            "direct/light_grid",
            &self.grid,
            &[frame_group],
            &[("light_grid", (&targets.light_grid).into())],
            Dispatch::Groups([lanes.min(32_768), lanes.div_ceil(32_768), 1]),
        );
        targets.light_grid.clone()
    }

    /// Where light is rendered to, Rgba16Float.
    ///
    /// # Panics
    /// When [`DirectLight::reserve`] was not called, as all that records.
    pub fn radiance(&self) -> &Texture {
        &self.targets().radiance
    }

    /// Where the colour of unlit materials is rendered to, Rgba16Float, if there was asked for room.
    ///
    /// # Panics
    /// When [`DirectLight::reserve`] was not called, as all that records.
    pub fn unlit(&self) -> Option<&Texture> {
        self.targets().unlit.as_ref()
    }

    /// Deferred: radiance from the surface buffer.
    ///
    /// # Panics
    /// When compiled for the forward pipeline.
    pub fn record_deferred(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        surface: &SurfaceBuffer,
        (shadows, light_grid): (&ShadowOutputs, &Buffer),
        radiance: &Texture,
    ) {
        let Shading::Deferred(pipeline) = &self.shading else {
            panic!("direct: compiled for the forward pipeline")
        };
        let mut binds = lighting_binds(shadows, light_grid);
        binds.extend(surface_binds(surface));
        binds.push(("radiance", radiance.into()));
        if let Some(emissive) = &surface.emissive {
            binds.push(("emissive", emissive.into()));
        }
        let options = radiance.options();
        let threads = Dispatch::Threads([options.width, options.height, 1]);
        frame.compute("direct/shade", pipeline, &[frame_group], &binds, threads);
    }

    /// Forward: radiance from the camera's draw list; `sky` in stored units, `None` draws the environment.
    ///
    /// # Panics
    /// When compiled for the deferred pipeline.
    pub fn record_forward(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        lists: &DrawLists,
        (shadows, light_grid): (&ShadowOutputs, &Buffer),
        sky: Option<wgpu::Color>,
        radiance: &Texture,
    ) {
        let targets = self.targets();
        let (Some((color, depth)), Shading::Forward { kinds, background }) =
            (&targets.multisampled, &self.shading)
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
        let binds = lighting_binds(shadows, light_grid);
        let shared = &[frame_group, scene.group()];
        frame.render("direct/forward", passes, |pass| {
            draw_classes(pass, kinds, OPAQUE, shared, &binds, (lists, 0, true));
            if sky.is_none() {
                pass.draw(background, shared, &binds, Draw::FullScreen);
            }
        });
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
