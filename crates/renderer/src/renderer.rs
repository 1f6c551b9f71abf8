//! The renderer: passes for the current settings, and what a frame needs to be prepared.

use chiaro_gpu::shader::Library;
use chiaro_gpu::{Frame, Gpu, GroupLayout, TexturePool, wgpu};
use chiaro_scene::Scene;
use chiaro_techniques::caustics;
use chiaro_techniques::direct::{DirectLight, Permutations, grid_size};
use chiaro_techniques::indirect::{Ambient, SkyView, ambient};
use chiaro_techniques::motion::Motion;
use chiaro_techniques::shaders;
use chiaro_techniques::shadow::{CameraView, FitInputs, ShadowMaps, ShadowViews, fit};
use chiaro_techniques::shared::frame::{FrameData, FrameGroup};
use chiaro_techniques::surface::culling::CullView;
use chiaro_techniques::surface::raster::ComputeRaster;
use chiaro_techniques::surface::{SceneFacts, SurfaceView, Surfaces};
use chiaro_techniques::transparency::Transparency;
use glam::{DVec3, Mat4, Vec2, Vec3};

use crate::pipelines::{FrameInputs, FrameOutputs, record};
use crate::plan::{Built, Kit, Missing, Plan};
use crate::{Error, LoadedScene, Pipeline, Settings, View};

/// Compiled passes and their resources.
#[derive(Debug)]
pub(crate) struct Passes {
    pub frame_group: FrameGroup,
    pub motion: Motion,
    pub surfaces: Surfaces,
    pub shadows: ShadowMaps,
    pub direct: DirectLight,
    /// Once a scene had something see-through.
    pub transparency: Option<Transparency>,
}

/// Renders scenes with the techniques that [`Settings`] choose.
///
/// A frame is [`Renderer::prepare`], which may allocate, then [`Renderer::frame`], which does not. Programs that must not
/// stall compile on another thread: [`Renderer::plan`], [`Plan::build`], [`Renderer::install`].
#[derive(Debug)]
pub struct Renderer {
    kit: Kit,
    settings: Settings,
    // The same with nothing left to the adapter.
    resolved: Settings,
    passes: Passes,
    // Counts installations of passes, so that a plan made before the last one is known.
    generation: u64,
    pub(crate) pool: TexturePool,
    prepared: Option<Prepared>,
    // And the origin that it counts from.
    previous_clip_from_ws: Option<(DVec3, Mat4)>,
    // For which scene and eye, and what it was.
    sky_view: Option<(u64, DVec3, SkyView)>,
    notes: Vec<String>,
}

/// One frame's data, computed before it is recorded.
#[derive(Debug)]
struct Prepared {
    data: FrameData,
    camera: SurfaceView,
    shadow_views: ShadowViews,
    lights: Vec<chiaro_techniques::shared::frame::LightData>,
    sky: Option<wgpu::Color>,
}

impl Renderer {
    /// Compiles the passes that the settings need.
    ///
    /// # Errors
    /// When settings do not go together, the adapter cannot do them, or a shader does not compile.
    pub fn new(gpu: &Gpu, settings: Settings) -> Result<Self, Error> {
        Self::with(Kit::new(gpu, shaders::library()), settings, SceneFacts::default())
    }

    /// Uploads a first scene and compiles the passes that it and the settings need.
    ///
    /// # Errors
    /// As [`Renderer::new`] and [`Renderer::load`].
    pub fn with_scene(gpu: &Gpu, settings: Settings, scene: &Scene) -> Result<(Self, LoadedScene), Error> {
        let kit = Kit::new(gpu, shaders::library());
        let loaded = kit.upload(scene)?;
        Ok((Self::with(kit, settings, loaded.gpu.facts)?, loaded))
    }

    fn with(kit: Kit, settings: Settings, facts: SceneFacts) -> Result<Self, Error> {
        let resolved = settings.resolved(&kit.gpu);
        check(&kit.gpu, &resolved)?;
        let plan = Plan::new(kit.clone(), settings.clone(), facts, 0, Missing::all(facts));
        let Some(passes) = plan.build()?.into_passes() else { unreachable!("everything was missing") };
        kit.gpu.check()?;
        Ok(Self {
            kit,
            settings,
            resolved,
            passes,
            generation: 0,
            pool: TexturePool::default(),
            prepared: None,
            previous_clip_from_ws: None,
            sky_view: None,
            notes: Vec::new(),
        })
    }

    /// Changes settings; compiles only what the change needs, and waits for it.
    ///
    /// # Errors
    /// As [`Renderer::new`]; the old settings then stay in force.
    pub fn set(&mut self, settings: Settings) -> Result<(), Error> {
        let built = self.plan(settings, SceneFacts::default())?.build()?;
        self.install(built);
        Ok(())
    }

    /// What must be compiled for these settings, and for a scene of these facts beside those known already.
    ///
    /// # Errors
    /// When settings do not go together, or the adapter cannot do them.
    pub fn plan(&self, settings: Settings, facts: SceneFacts) -> Result<Plan, Error> {
        let resolved = settings.resolved(&self.kit.gpu);
        check(&self.kit.gpu, &resolved)?;
        let facts = self.passes.surfaces.facts().union(facts);
        let missing = Missing::from(&self.passes, &resolved, facts);
        Ok(Plan::new(self.kit.clone(), settings, facts, self.generation, missing))
    }

    /// A plan to compile everything anew from other shaders.
    pub fn plan_shaders(&self, library: Library) -> Plan {
        let kit = Kit { library, ..self.kit.clone() };
        let facts = self.passes.surfaces.facts();
        Plan::new(kit, self.settings.clone(), facts, self.generation, Missing::all(facts))
    }

    /// Takes over what was compiled, and the settings it was compiled for. `false`, and nothing changes, when something else
    /// was installed after the plan was made: plan again.
    pub fn install(&mut self, built: Built) -> bool {
        if built.generation != self.generation {
            return false;
        }
        self.settings = built.settings;
        self.resolved = built.resolved;
        if built.is_empty {
            return true;
        }
        self.generation += 1;
        self.kit = built.kit;
        // New passes have no room yet.
        self.prepared = None;
        if let Some(frame_group) = built.frame_group {
            self.passes.frame_group = frame_group;
        }
        if let Some(motion) = built.motion {
            self.passes.motion = motion;
        }
        if let Some(surfaces) = built.surfaces {
            self.passes.surfaces = surfaces;
        }
        if let Some(shadows) = built.shadows {
            self.passes.shadows = shadows;
        }
        if let Some(direct) = built.direct {
            self.passes.direct = direct;
        }
        if built.transparency.is_some() {
            self.passes.transparency = built.transparency;
        }
        true
    }

    /// What shaders that look up lights are compiled for.
    pub fn permutations(&self) -> Permutations {
        self.passes.direct.permutations()
    }

    /// Frees textures of sizes and kinds that are no longer in use, and that would otherwise be kept for the next use.
    pub fn trim(&self) {
        self.pool.trim();
    }

    /// The settings in force.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.kit.gpu
    }

    /// What passes of one's own are compiled with, and scenes are uploaded with on other threads.
    pub fn kit(&self) -> &Kit {
        &self.kit
    }

    /// Group 0's layout, for passes of one's own.
    pub fn frame_layout(&self) -> &GroupLayout {
        &self.kit.frame_layout
    }

    /// The frame's bind group, for passes of one's own.
    pub fn frame_group(&self) -> &chiaro_gpu::Group {
        self.passes.frame_group.group()
    }

    /// Sentences about what the last [`Renderer::prepare`] gave up, for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Uploads a scene, and compiles what its materials need beyond those of earlier scenes.
    ///
    /// # Errors
    /// When it does not fit the adapter.
    pub fn load(&mut self, scene: &Scene) -> Result<LoadedScene, Error> {
        let loaded = self.kit.upload(scene)?;
        let built = self.plan(self.settings.clone(), loaded.gpu.facts)?.build()?;
        self.install(built);
        self.kit.gpu.check()?;
        Ok(loaded)
    }

    /// Computes a frame's data and makes room for it. `jitter_px` moves the picture by parts of a pixel, and
    /// `footprint_scale` (1/√frames averaged) sharpens textures accordingly.
    pub fn prepare(
        &mut self,
        scene: &LoadedScene,
        view: &View,
        size_px: [u32; 2],
        jitter_px: Vec2,
        footprint_scale: f32,
    ) {
        let settings = &self.resolved;
        let clip_from_ws = view.clip_from_ws(size_px, jitter_px);
        let steady = view.clip_from_ws(size_px, Vec2::ZERO);
        let bounds = scene.gpu.bounds_ws;
        let camera = CameraView {
            eye_ws: view.eye_ws(),
            forward_ws: view.forward_ws(),
            ws_from_clip: steady.inverse(),
        };
        let mut lights = scene.lights.clone();
        let inputs = FitInputs {
            bounds_ws: bounds,
            casters: Some(&scene.casters),
            camera,
            settings: &settings.shadow,
            clamps_depth: self.kit.gpu.optional.depth_clip_control,
            see_through: scene.gpu.see_through(),
        };
        let shadow_views = fit(&mut lights, &inputs);
        self.notes.clone_from(&shadow_views.notes);
        let grid = grid_size(size_px, lights.len() - scene.directional);
        let sky_view = sky_view(&mut self.sky_view, scene, view.eye_ws());
        let map = scene.environment.as_ref();
        let factor = settings.environment.intensity;
        let turn = settings.environment.rotation.to_radians();
        let mean = map.map(|map| map.harmonics.mean * factor);
        let Ambient { radiance: around, sky, environment: share } =
            ambient(&settings.indirect, &lights, bounds, sky_view, mean);
        let [show_direct, show_indirect] = settings.camera.show.weights();
        // Behind everything is a light's own radiance.
        let sky = sky * show_direct;
        let diffuse = map.map_or([Mat4::ZERO; 3], |map| map.harmonics.turned(turn, factor * share));
        let previous = self.previous_clip_from_ws.filter(|(origin, _)| *origin == scene.gpu.motion.origin());
        let data = FrameData {
            clip_from_ws: clip_from_ws.to_cols_array_2d(),
            relative_from_clip: view.relative_from_clip(size_px, jitter_px).to_cols_array_2d(),
            previous_clip_from_ws: previous.map_or(steady, |(_, clip)| clip).to_cols_array_2d(),
            eye_ws: view.eye_ws().to_array(),
            orthographic: u32::from(view.is_orthographic()),
            forward_ws: view.forward_ws().to_array(),
            footprint_scale,
            size_px,
            directional_lights: scene.directional as u32,
            local_lights: (lights.len() - scene.directional) as u32,
            grid,
            grid_slices: slices(view, bounds, grid[2]),
            lighting_model: settings.surface.lighting as u32,
            seed: settings.seed,
            ambient: around.map(|channel| channel.to_array()),
            environment: diffuse.map(|channel| channel.to_cols_array_2d()),
            sky: sky.to_array(),
            radiance_scale: scene.radiance_scale,
            normal_maps: u32::from(settings.surface.normal_maps),
            anisotropy: settings.surface.anisotropy,
            environment_nits: map.map_or(0.0, |map| map.nits * factor),
            environment_share: share,
            environment_turn: [turn.cos(), turn.sin()],
            show_direct,
            show_indirect,
            show_unlit: 0.0,
            reserved0: 0,
            reserved1: 0,
            reserved2: 0,
            shadow: settings.shadow.parameters(),
        };
        self.previous_clip_from_ws = Some((scene.gpu.motion.origin(), steady));
        let eye =
            if view.is_orthographic() { view.forward_ws().extend(0.0) } else { view.eye_ws().extend(1.0) };
        let stored = (sky * scene.radiance_scale).min(Vec3::splat(65000.0)).as_dvec3();
        let sky = map.is_none().then_some(wgpu::Color { r: stored.x, g: stored.y, b: stored.z, a: 0.0 });
        let environment = map.map(|map| &map.texture);
        let views = shadow_views.views.len();
        self.passes.frame_group.reserve(&self.kit.gpu, lights.len(), views, environment);
        self.passes.surfaces.reserve(&self.kit.gpu, &self.pool, &scene.gpu, size_px);
        let (shadow, anisotropy) = (&settings.shadow, settings.surface.anisotropy);
        self.passes.shadows.reserve(&self.kit.gpu, &scene.gpu, &shadow_views, shadow, anisotropy);
        self.passes.direct.reserve(&self.kit.gpu, &self.pool, (size_px, grid), scene.gpu.unlit);
        if let Some(transparency) = &mut self.passes.transparency {
            transparency.reserve(&self.kit.gpu, &self.pool, &scene.gpu, size_px, settings.surface.layers);
        }
        let camera = SurfaceView {
            cull: CullView::new(&clip_from_ws, eye, true, false),
            clip_from_ws,
            footprint_scale,
            anisotropy,
        };
        self.prepared = Some(Prepared { data, camera, shadow_views, lights, sky });
    }

    /// Records a prepared frame. `wants_surface`: make the surface buffer even where the pipeline does without.
    ///
    /// # Panics
    /// When [`Renderer::prepare`] was not called.
    pub fn frame(&mut self, frame: &mut Frame<'_>, scene: &LoadedScene, wants_surface: bool) -> FrameOutputs {
        let Some(prepared) = &self.prepared else { panic!("a frame must be prepared before it is recorded") };
        let group = &self.passes.frame_group;
        frame.upload(&group.frame, &[prepared.data]);
        frame.upload(&group.lights, &prepared.lights);
        let views: Vec<_> = prepared.shadow_views.views.iter().map(|view| view.data).collect();
        frame.upload(&group.shadow_views, &views);
        let inputs = FrameInputs {
            scene,
            camera: prepared.camera,
            shadow_views: &prepared.shadow_views,
            sky: prepared.sky,
            wants_surface,
            data: [prepared.data, prepared.data.without_light(prepared.data.show_direct)],
        };
        record(&self.resolved, &mut self.passes, frame, &inputs)
    }
}

/// How much sky the eye sees; looked up again only when it moved.
fn sky_view(known: &mut Option<(u64, DVec3, SkyView)>, scene: &LoadedScene, eye_ws: Vec3) -> SkyView {
    let place = eye_ws.as_dvec3() + scene.gpu.motion.origin();
    match *known {
        Some((id, eye, view)) if id == scene.gpu.id() && eye == place => view,
        _ => {
            let view = scene.openness.sky_view(eye_ws);
            *known = Some((scene.gpu.id(), place, view));
            view
        }
    }
}

fn check(gpu: &Gpu, settings: &Settings) -> Result<(), Error> {
    let msaa = settings.surface.msaa.samples();
    if settings.pipeline == Pipeline::Forward && ![1, 4].contains(&msaa) {
        return Err(Error::Combination(format!(
            "surface.msaa = {msaa}: the forward pipeline takes 1 or 4, which every adapter has"
        )));
    }
    if let Some(reason) = settings.shadow.refused() {
        return Err(Error::Combination(reason));
    }
    if settings.shadow.transmission_tint && settings.caustics.technique != caustics::Technique::None {
        return Err(Error::Combination(
            "shadow.transmission_tint does not go with caustics: both would bring the light that glass lets through; \
             take shadow.transmission_tint = false or caustics.technique = none"
                .into(),
        ));
    }
    let side = settings.shadow.resolution;
    if settings.shadow.computes_maps() && ComputeRaster::views_at_once(gpu, [side; 2]) == 0 {
        return Err(Error::Combination(format!(
            "shadow.resolution = {side} is more than shadow.raster = compute can do on {}",
            gpu.info.name
        )));
    }
    if side > gpu.limits.max_texture_dimension_2d {
        return Err(Error::Combination(format!(
            "shadow.resolution = {side} is more than {} allows ({})",
            gpu.info.name, gpu.limits.max_texture_dimension_2d
        )));
    }
    Ok(())
}

/// `slice = log2(view depth) · x + y`, from a little in front of the eye to the scene's far end.
fn slices(view: &View, (lo, hi): (Vec3, Vec3), slices: u32) -> [f32; 2] {
    let far = (view.eye_ws() - 0.5 * (lo + hi)).length() + 0.5 * (hi - lo).length();
    let near = (far * 1e-3).max(view.near_m);
    let far = far.max(near * 2.0);
    let scale = slices as f32 / (far / near).log2();
    [scale, -near.log2() * scale]
}
