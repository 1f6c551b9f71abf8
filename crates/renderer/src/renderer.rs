//! The renderer: passes for the current settings, and what a frame needs to be prepared.

use std::iter;

use chiaro_gpu::shader::Library;
use chiaro_gpu::{Frame, Gpu, GroupLayout, TexturePool};
use chiaro_scene::Scene;
use chiaro_techniques::caustics::photon_trace::{PhotonPlan, PhotonsWanted};
use chiaro_techniques::direct::Permutations;
use chiaro_techniques::environment::{arriving, sky, sky_light};
use chiaro_techniques::frame::{FrameData, LightData};
use chiaro_techniques::indirect::sources::Surroundings;
use chiaro_techniques::indirect::{SkyView, ambient};
use chiaro_techniques::light::grid_size;
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::shadow::{CameraView, FitInputs, ShadowPlan, ShadowViews, fit};
use chiaro_techniques::view::ViewData;
use chiaro_techniques::view::culling::{Culling, ListRoom};
use chiaro_techniques::{Kit, shaders};
use glam::{Vec2, Vec3};

use crate::checks::{check_settings, check_size, check_view};
use crate::indirect::{IndirectPlan, Wanted, near_suns};
use crate::moving::{Look, Moves, Sampling};
use crate::passes::{Missing, Passes};
use crate::pipelines::{FrameInputs, FrameOutputs, record};
use crate::plan::{Built, Plan};
use crate::still_passes::StillPasses;
use crate::view_state::{Histories, Rooms};
use crate::{Error, LoadedScene, Settings, Trees, View, ViewState};

/// Renders scenes with the techniques that [`Settings`] choose.
///
/// A frame is [`Renderer::prepare`], which may allocate, then [`Prepared::record`], which does not. Programs that must not
/// stall compile on another thread: [`Renderer::plan`], [`Plan::build`], [`Renderer::install`].
#[derive(Debug)]
pub struct Renderer {
    kit: Kit,
    settings: Settings,
    // The same with nothing left to the adapter.
    resolved: Settings,
    passes: Passes,
    // What of scenes they were compiled for.
    facts: SceneFacts,
    // Counts installations of passes, so that a plan made before the last one is known.
    generation: u64,
    pub(crate) pool: TexturePool,
    // Of stills.
    pub(crate) still_view: Option<ViewState>,
    // What stills are made with beside frames.
    pub(crate) still_passes: Option<StillPasses>,
}

/// A frame that is ready to be recorded.
#[derive(Debug)]
#[must_use = "a frame is prepared to be recorded"]
pub struct Prepared<'a> {
    renderer: &'a Renderer,
    state: &'a mut ViewState,
    scene: &'a LoadedScene,
    data: FrameData,
    shadow_views: ShadowViews,
    shadow_plan: ShadowPlan,
    // Where virtual lights are made.
    indirect: Option<IndirectPlan>,
    // Where light goes through mirrors and glass.
    photons: Option<PhotonPlan>,
    lights: Vec<LightData>,
    // Of a moving picture.
    moves: Option<Moves>,
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
        let mut loaded = LoadedScene::upload(&kit, scene)?;
        gear_up(&kit.gpu, &settings, (scene, &mut loaded))?;
        Ok((Self::with(kit, settings, loaded.gpu.facts)?, loaded))
    }

    fn with(kit: Kit, settings: Settings, facts: SceneFacts) -> Result<Self, Error> {
        let resolved = settings.resolved(&kit.gpu);
        check_settings(&kit.gpu, &resolved)?;
        let passes = Missing::of(None, &resolved, facts).compile(&kit)?;
        let Some(passes) = passes.into_passes() else { unreachable!("everything was missing") };
        kit.gpu.check()?;
        Ok(Self {
            kit,
            settings,
            resolved,
            passes,
            facts,
            generation: 0,
            pool: TexturePool::default(),
            still_view: None,
            still_passes: None,
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
        check_settings(&self.kit.gpu, &resolved)?;
        let facts = self.facts.union(facts);
        let missing = Missing::of(Some(&self.passes), &resolved, facts);
        Ok(Plan::new(self.kit.clone(), settings, facts, self.generation, missing))
    }

    /// A plan to compile everything anew from other shaders.
    pub fn plan_shaders(&self, library: Library) -> Plan {
        let kit = Kit { library, ..self.kit.clone() };
        let missing = Missing::of(None, &self.resolved, self.facts);
        Plan::new(kit, self.settings.clone(), self.facts, self.generation, missing)
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
        self.facts = built.facts;
        built.found.install(&mut self.passes);
        true
    }

    /// What shaders that look up lights are compiled for.
    pub fn permutations(&self) -> Permutations {
        *self.passes.direct.key()
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

    /// Sentences about what the last still gave up, for the user.
    pub fn notes(&self) -> &[String] {
        self.still_view.as_ref().map_or(&[], ViewState::notes)
    }

    /// Uploads a scene, and compiles what its materials need beyond those of earlier scenes.
    ///
    /// # Errors
    /// When it does not fit the adapter, or [`Scene::validate`] refuses it.
    pub fn load(&mut self, scene: &Scene) -> Result<LoadedScene, Error> {
        let mut loaded = LoadedScene::upload(&self.kit, scene)?;
        self.equip(scene, &mut loaded)?;
        Ok(loaded)
    }

    /// Gives a scene what the settings need of it beyond its upload, trees for rays and points for imperfect shadow maps, and
    /// compiles what it needs beyond earlier scenes. After [`Renderer::set`] has turned rays on, where
    /// [`LoadedScene::upload`] was called by hand, and where [`LoadedScene::trees_are_due`] or [`LoadedScene::points_are_due`];
    /// waits for all.
    ///
    /// # Errors
    /// When the trees do not fit the adapter, or a shader does not compile.
    pub fn equip(&mut self, scene: &Scene, loaded: &mut LoadedScene) -> Result<(), Error> {
        gear_up(&self.kit.gpu, &self.settings, (scene, &mut *loaded))?;
        let built = self.plan(self.settings.clone(), loaded.gpu.facts)?.build()?;
        self.install(built);
        self.kit.gpu.check()?;
        Ok(())
    }

    /// Computes a frame's data and makes room for it in the view's state. A frame of a moving picture
    /// ([`Sampling::Moving`]) goes on from the last one of this state, if there was one and nothing has jumped since.
    ///
    /// # Errors
    /// When the picture has no pixels, or more to a side than the adapter can do; when the view is not finite; when the
    /// scene lacks trees that settings shoot rays through or points that they draw, or needs passes that are not compiled:
    /// [`Renderer::equip`] sees to both.
    pub fn prepare<'a>(
        &'a self,
        state: &'a mut ViewState,
        scene: &'a LoadedScene,
        view: &View,
        size_px: [u32; 2],
        sampling: impl Into<Sampling>,
    ) -> Result<Prepared<'a>, Error> {
        let (gpu, passes) = (&self.kit.gpu, &self.passes);
        check_size(gpu, size_px)?;
        if scene.lacks_trees(&self.resolved) {
            return Err(Error::NoTrees);
        }
        if scene.lacks_points(&self.resolved) {
            return Err(Error::NoPoints);
        }
        if !self.facts.serve(scene.gpu.facts) {
            return Err(Error::NoPasses);
        }
        let settings = &self.resolved;
        check_view(view, size_px)?;
        let sampling = sampling.into();
        let smooths = sampling == Sampling::Moving && settings.smooths();
        let accumulates = sampling == Sampling::Moving && settings.indirect.accumulates();
        let look = Look { scene, view, size_px, settings };
        let moves = sampling.moves().then(|| {
            let Rooms { motion, antialias, .. } = &state.rooms;
            let has_room = motion.is_some() && (antialias.is_some() || !smooths);
            Moves::new(&look, has_room.then_some(&state.history.seen), [smooths, accumulates])
        });
        let (jitter_px, footprint_scale, round) = match sampling {
            Sampling::Single { jitter_px, footprint_scale, round } => (jitter_px, footprint_scale, round),
            Sampling::Moving | Sampling::Steady => {
                let (jitter_px, scale) = moves.as_ref().map_or((Vec2::ZERO, 1.0), |moves| moves.sampling);
                (jitter_px, scale, 0)
            }
        };
        let clip_from_ws = view.clip_from_ws(size_px, jitter_px);
        let steady = view.clip_from_ws(size_px, Vec2::ZERO);
        let bounds = scene.gpu.bounds_ws;
        let around_eye = scene.casters.around(view.eye_ws()).unwrap_or(bounds);
        let camera = CameraView {
            eye_ws: view.eye_ws(),
            forward_ws: view.forward_ws(),
            ws_from_clip: steady.inverse(),
        };
        let mut lights = scene.lights().to_vec();
        let inputs = FitInputs {
            bounds_ws: bounds,
            casters: Some(&scene.casters),
            camera,
            settings: &settings.shadow,
            clamps_depth: gpu.optional.depth_clip_control,
            see_through: scene.gpu.see_through(),
        };
        let shadow_views = fit(&mut lights, &inputs);
        state.notes.clone_from(&shadow_views.notes);
        let grid = grid_size(size_px, lights.len() - scene.directional());
        let sky_view = sky_view(&mut state.history, scene, view.eye_ws());
        let map = scene.environment.as_ref();
        let factor = settings.environment.intensity;
        let turn = settings.environment.rotation.to_radians();
        let share = map.map_or(0.0, |_| arriving(sky_view.share));
        let mean = map.map(|map| (map.harmonics.mean * factor, share));
        let stand_in = ambient(&settings.indirect, &lights, around_eye, sky_view.share, mean);
        let sky = sky(&settings.environment, &lights, map.is_some());
        let afar = match map {
            Some(map) => map.harmonics.turned(turn, factor * share),
            None => sky_light(sky, sky_view.share, sky_view.direction),
        };
        let [show_direct, show_indirect, show_caustics] = settings.camera.show.weights();
        let around = Surroundings { nits: if map.is_some() { Vec3::splat(factor) } else { sky }, turn };
        let lit_by_sources =
            settings.indirect.shines() && (scene.sources.glows() || around.nits != Vec3::ZERO);
        let shows_sources = lit_by_sources && show_direct > 0.0;
        let gathers = settings.indirect.technique.makes_vpls() && (show_indirect > 0.0 || shows_sources);
        let of_frames = if moves.is_some() { 1.0 } else { footprint_scale };
        let traces = settings.caustics.technique.makes_any() && show_caustics > 0.0;
        let wanted = PhotonsWanted {
            lights: &lights,
            casters_ws: scene.specular.bounds_ws(),
            bounds_ws: bounds,
            pixel_m2: view.pixel_m2(size_px),
            seed: settings.seed,
            round,
            share: of_frames,
        };
        let photons = traces.then(|| PhotonPlan::new(&settings.caustics, &wanted)).flatten();
        let follows = settings.follows_mirrors() && scene.specular.bounds_ws().is_some();
        let holds = |held: bool, bit: u32| if held { bit } else { 0 };
        let data = FrameData {
            clip_from_ws: clip_from_ws.to_cols_array_2d(),
            relative_from_clip: view.relative_from_clip(size_px, jitter_px).to_cols_array_2d(),
            eye_ws: view.eye_ws().to_array(),
            orthographic: u32::from(view.is_orthographic()),
            forward_ws: view.forward_ws().to_array(),
            footprint_scale,
            size_px,
            directional_lights: scene.directional() as u32,
            local_lights: (lights.len() - scene.directional()) as u32,
            grid,
            grid_slices: slices(view, around_eye, grid[2]),
            lighting_model: settings.surface.lighting as u32,
            normal_maps: u32::from(settings.surface.normal_maps),
            ambient: stand_in.map(|channel| channel.to_array()),
            environment: afar.map(|channel| channel.to_cols_array_2d()),
            sky: sky.to_array(),
            radiance_scale: scene.radiance_scale,
            environment_diffuse: f32::from(u8::from(
                settings.indirect.technique.lights_by_all() && !lit_by_sources,
            )),
            anisotropy: settings.surface.anisotropy,
            environment_nits: map.map_or(0.0, |map| map.nits * factor),
            environment_share: share,
            environment_turn: [turn.cos(), turn.sin()],
            gathers: holds(gathers, FrameData::BOUNCED)
                | holds(gathers && lit_by_sources, FrameData::SOURCED)
                | holds(photons.is_some(), FrameData::CAUSTICS)
                | holds(follows, FrameData::FOLLOWED),
            mirrors_sources: f32::from(u8::from(around.nits == Vec3::ZERO)),
            show_direct,
            show_indirect,
            show_caustics,
            show_unlit: 0.0,
            shadow: settings.shadow.parameters(),
        };
        let eye =
            if view.is_orthographic() { view.forward_ws().extend(0.0) } else { view.eye_ws().extend(1.0) };
        let environment = map.map(|map| &map.texture);
        state.frame_group.reserve(gpu, lights.len(), environment);
        let rooms = &mut state.rooms;
        let shadow_settings = &settings.shadow;
        let shadow = passes.shadows.room(gpu, &scene.gpu, &shadow_views, shadow_settings, &mut rooms.shadow);
        let shadow_plan = passes.shadows.plan(gpu, &scene.gpu, &shadow_views, shadow);
        let camera =
            ViewData { footprint_scale, ..ViewData::new(&clip_from_ws, eye, size_px).dropping_back_faces() };
        let at_once = Culling::views_at_once(gpu, &scene.gpu);
        let (known, fitted) = shadow_plan.views();
        rooms.views.anisotropy = settings.surface.anisotropy;
        let near =
            if gathers { near_suns(&scene.casters, &lights, view.eye_ws(), bounds) } else { Vec::new() };
        let wanted = Wanted {
            lights: &lights,
            near: &near,
            round,
            share: of_frames,
            size_px,
            pictures: state.wants_pictures,
            layers: scene.gpu.see_through(),
            moves: moves.is_some(),
            around,
            continues: moves.as_ref().is_some_and(|moves| moves.before.is_some()),
            drift: moves.as_ref().map_or(0, Moves::drift),
            allowed: moves.as_ref().and_then(|moves| moves.irradiance),
        };
        let indirect = gathers
            .then(|| {
                let made_by = passes.indirect().ok_or(Error::NoPasses)?;
                rooms.indirect.plan((gpu, &self.pool), (made_by, scene.lit()), settings, &wanted)
            })
            .transpose()?;
        state.notes.extend(indirect.as_ref().and_then(|plan| plan.note.clone()));
        let reflective = indirect.iter().flat_map(IndirectPlan::draws);
        let first: Vec<_> = iter::once(camera).chain(reflective).chain(known.iter().copied()).collect();
        rooms.views.set(gpu, &first, fitted, at_once);
        // As many as may ever be culled together, so that frames do not allocate when more maps are drawn.
        let reflective = indirect.as_ref().map_or(0, IndirectPlan::views);
        let together = at_once.min(1 + reflective + shadow_views.views.len());
        let serves = |room: &ListRoom| room.serves(&scene.gpu, together);
        chiaro_gpu::keep(&mut rooms.lists, serves, || ListRoom::new(gpu, &scene.gpu, together));
        passes.surfaces.room(gpu, &self.pool, size_px, &mut rooms.surface);
        match photons.as_ref() {
            Some(_) => {
                let pass = passes.photons.as_ref().ok_or(Error::NoPasses)?;
                pass.room(gpu, &self.pool, size_px, &mut rooms.photons)?;
            }
            None => rooms.photons = None,
        }
        match passes.specular.as_ref().filter(|_| follows) {
            Some(pass) => {
                pass.room(gpu, &self.pool, size_px, &mut rooms.specular);
            }
            None => rooms.specular = None,
        }
        let targets = (scene.gpu.unlit, state.wants_parts, photons.is_some());
        passes.direct.room(gpu, &self.pool, (size_px, grid), targets, &mut rooms.light);
        match passes.transparency.as_ref().filter(|_| scene.gpu.see_through()) {
            Some(transparency) => {
                transparency.room(gpu, &self.pool, size_px, settings.surface.layers, &mut rooms.layers);
            }
            None => rooms.layers = None,
        }
        if moves.is_some() {
            passes.motion_vectors.room(gpu, &self.pool, size_px, &mut rooms.motion);
        }
        if !scene.gpu.see_through() {
            rooms.opaque_motion = None;
        } else if accumulates {
            passes.motion_vectors.room(gpu, &self.pool, size_px, &mut rooms.opaque_motion);
        }
        if let Some(antialias) = passes.antialias.as_ref().filter(|_| smooths) {
            antialias.room(gpu, &self.pool, (size_px, scene.gpu.unlit), &mut rooms.antialias);
        }
        Ok(Prepared {
            renderer: self,
            state,
            scene,
            data,
            shadow_views,
            shadow_plan,
            indirect,
            photons,
            lights,
            moves,
        })
    }
}

impl Prepared<'_> {
    /// Records the frame. `wants_surface`: make the surface buffer even where the pipeline does without.
    pub fn record(self, frame: &mut Frame<'_>, wants_surface: bool) -> FrameOutputs {
        let Self {
            renderer,
            state,
            scene,
            data,
            shadow_views,
            shadow_plan,
            indirect,
            photons,
            lights,
            moves,
        } = self;
        let views: Vec<_> = shadow_views.views.iter().map(|view| view.data).collect();
        state.frame_group.upload(frame, &data, &lights, &views);
        state.rooms.views.upload(frame);
        let inputs = FrameInputs {
            scene,
            group: &state.frame_group,
            shadow_views: &shadow_views,
            shadow_plan: &shadow_plan,
            indirect: indirect.as_ref(),
            photons: photons.as_ref(),
            wants_surface,
            moves: moves.as_ref(),
            data,
        };
        let outputs = record(&renderer.resolved, &renderer.passes, frame, &inputs, &mut state.rooms);
        if let Some(moves) = moves {
            moves.keep(&mut state.history.seen);
        }
        outputs
    }
}

impl ViewState {
    /// A view without any room yet.
    pub fn new(renderer: &Renderer) -> Self {
        let table = &renderer.passes.albedo_table.texture;
        Self::without_room(renderer.gpu(), renderer.frame_layout(), table)
    }
}

/// How much sky the eye sees; looked up again only when it moved.
fn sky_view(history: &mut Histories, scene: &LoadedScene, eye_ws: Vec3) -> SkyView {
    let key = (scene.gpu.id(), eye_ws.as_dvec3() + scene.gpu.motion.origin());
    if let Some(view) = history.sky.get(&key) {
        return *view;
    }
    let view = scene.openness.sky_view(eye_ws);
    history.sky.keep(key, view);
    view
}

fn gear_up(gpu: &Gpu, settings: &Settings, (scene, loaded): (&Scene, &mut LoadedScene)) -> Result<(), Error> {
    if loaded.lacks_trees(settings) || loaded.trees_are_due() {
        let trees = Trees::build(gpu, scene, loaded.pose(), &loaded.moved())?;
        loaded.give_trees(scene, trees)?;
    }
    let are_due = loaded.lacks_points(settings) || loaded.points_are_due();
    if let Some(choose) = loaded.choose_points(settings).filter(|_| are_due) {
        let points = choose(scene, loaded.pose());
        loaded.give_points(points);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn renderers_plans_and_what_they_become_may_change_threads() {
        fn sent<T: Send>() {}
        sent::<Plan>();
        sent::<Built>();
        sent::<LoadedScene>();
        sent::<Renderer>();
    }
}
