//! A scene ready to be rendered.

use chiaro_scene::{Id, Pose, Scene};
use chiaro_techniques::caustics;
use chiaro_techniques::environment::EnvironmentMap;
use chiaro_techniques::frame::LightData;
use chiaro_techniques::indirect::Openness;
use chiaro_techniques::indirect::points::PointData;
use chiaro_techniques::indirect::sources::SourcePool;
use chiaro_techniques::light::{illuminance_scale, light_data};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::shadow::Casters;
use glam::{DVec3, Vec3};

use crate::indirect::LitScene;
use crate::{Error, Settings, Trees, View};

/// A scene on the GPU with its lights.
///
/// Lights, and which of them are directional, follow from the scene alone:
///
/// ```compile_fail,E0616
/// fn darken(scene: &mut chiaro::LoadedScene) {
///     scene.lights.clear();
/// }
/// ```
#[derive(Debug)]
pub struct LoadedScene {
    /// Geometry, materials, textures.
    pub gpu: SceneGpu,
    // Directional ones first, and how many they are.
    lights: Vec<LightData>,
    directional: usize,
    /// Stored radiance per nit, a power of two.
    pub radiance_scale: f32,
    /// How much of the sky a place sees.
    pub openness: Openness,
    /// What of it casts shadows.
    pub casters: Casters,
    /// What of it causes caustics.
    pub specular: caustics::Casters,
    /// What surrounds the scene.
    pub environment: Option<EnvironmentMap>,
    /// How everything stands.
    pub(crate) pose: Pose,
    /// For rays.
    pub(crate) trees: Option<Trees>,
    /// For imperfect shadow maps.
    pub(crate) points: Option<PointData>,
    /// What may shine itself.
    pub(crate) sources: SourcePool,
    // Where views look from, metres from the world's own origin.
    eye_m: Option<DVec3>,
}

/// Stored radiance of a white surface under the brightest light, in general. Half floats reach 65,504 above and 2⁻²⁴
/// below: eight octaves for highlights and glowing things, over thirty for the dark.
pub(crate) const WHITE_STORED: f32 = 256.0;
/// The same where an environment has a sun that would not fit otherwise.
const LEAST_WHITE_STORED: f32 = 1.0;
/// Where mirrors or glass may bundle light, white is stored as so much of it: there is room for foci 4,000 times as bright.
const BESIDE_CASTERS: f32 = 1.0 / 16.0;
/// What the environment's brightest texel may be stored as.
const PEAK_STORED: f32 = 32_768.0;
/// The brightest places that lamps shine at make everything at most this much darker: a lamp may lie in a ceiling.
const LEAST_OF_LAMPS: f32 = 1.0 / 16_384.0;

impl LoadedScene {
    pub(crate) fn new(
        gpu: SceneGpu,
        scene: &Scene,
        environment: Option<EnvironmentMap>,
        (openness, sources): (Openness, SourcePool),
    ) -> Self {
        let pose = scene.pose(0.0);
        let (lights, directional) = light_data(scene, &pose);
        let casters = Casters::new(scene, &pose, &[]);
        let specular = caustics::Casters::new(scene, &pose);
        let of = (&gpu, &casters, &specular);
        let radiance_scale = radiance_scale(of, scene, &lights, environment.as_ref());
        Self {
            gpu,
            lights,
            directional,
            radiance_scale,
            openness,
            casters,
            specular,
            environment,
            pose,
            trees: None,
            points: None,
            sources,
            eye_m: View::from_scene(scene, 0).map(|view| view.eye_ws().as_dvec3() + scene.origin),
        }
    }

    /// Directional lights first.
    pub fn lights(&self) -> &[LightData] {
        &self.lights
    }

    /// How many of [`LoadedScene::lights`] are directional.
    pub fn directional(&self) -> usize {
        self.directional
    }

    /// What indirect light is made of.
    pub(crate) fn lit(&self) -> LitScene<'_> {
        LitScene {
            gpu: &self.gpu,
            points: self.points.as_ref(),
            tracer: self.trees.as_ref().map(|trees| &trees.traced.words),
            sources: Some(&self.sources),
        }
    }

    /// How everything stands now.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// Whether settings shoot rays at the scene, and it has no trees for them: [`Trees::build`] makes some, and
    /// [`LoadedScene::give_trees`] takes them. [`crate::Renderer::load`] and [`crate::Renderer::equip`] do both.
    pub fn lacks_trees(&self, settings: &Settings) -> bool {
        let at_mirrors = settings.shoots_rays_at_mirrors() && self.specular.bounds_ws().is_some();
        (settings.shoots_rays_at_all() || at_mirrors) && self.trees.is_none()
    }

    /// Whether settings draw imperfect shadow maps, and the scene has no points for them, or others: [`LoadedScene::choose_points`]
    /// makes some, and [`LoadedScene::give_points`] takes them. [`crate::Renderer::load`] and [`crate::Renderer::equip`] do both.
    pub fn lacks_points(&self, settings: &Settings) -> bool {
        let options = settings.points();
        options.is_some_and(|options| self.points.as_ref().is_none_or(|points| *points.options() != options))
    }

    /// Tells where the next views look from, so that points can be dense there; at first the scene's first camera.
    pub fn look_from(&mut self, eye_ws: Vec3) {
        self.eye_m = Some(eye_ws.as_dvec3() + self.gpu.motion.origin());
    }

    /// Whether points chosen for where views look from now ([`LoadedScene::look_from`]) would be better than those that the scene
    /// has: shadows are right all the same, but coarser where most of the scene is far away. [`LoadedScene::choose_points`] makes
    /// them on another thread.
    pub fn points_are_due(&self) -> bool {
        let serves = |points: &PointData| self.eye_m.is_none_or(|eye_m| points.serves_from(eye_m));
        self.points.as_ref().is_some_and(|points| !serves(points))
    }

    /// What chooses points of the scene that this was loaded from, as settings want them, for where views look from now; any
    /// thread may do it. `None` where settings draw none.
    pub fn choose_points(
        &self,
        settings: &Settings,
    ) -> Option<impl FnOnce(&Scene, &Pose) -> PointData + Send + use<>> {
        let options = settings.points()?;
        let (eye_m, before) = (self.eye_m, self.points.clone());
        Some(move |scene: &Scene, pose: &Pose| match eye_m {
            Some(eye_m) => PointData::build_for(scene, pose, options, eye_m, before.as_ref()),
            None => PointData::build(scene, pose, options),
        })
    }

    /// Takes points of this scene, in whatever pose they were chosen.
    pub fn give_points(&mut self, points: PointData) {
        self.points = Some(points);
    }

    /// Takes trees of this scene, in whatever pose they were built. [`crate::Renderer::plan`] then tells what is to be
    /// compiled for them.
    ///
    /// # Errors
    /// When they were built for another scene, or had to be built anew and do not fit the adapter.
    pub fn give_trees(&mut self, scene: &Scene, mut trees: Trees) -> Result<(), Error> {
        self.check_scene(scene, "trees")?;
        trees.check(scene)?;
        trees.update(scene, &self.pose)?;
        self.gpu.facts = trees.facts(self.gpu.facts);
        self.trees = Some(trees);
        Ok(())
    }

    /// Whether trees built for the present pose would be better than those that the scene has: bending has worn them, or a
    /// node was moved that no animation moves. Rays are right all the same, but slower. To be asked once a frame;
    /// [`Trees::build`] on another thread, with what [`LoadedScene::moved`] gives, makes them.
    pub fn trees_are_due(&mut self) -> bool {
        self.trees.as_mut().is_some_and(Trees::due)
    }

    /// Nodes that poses have moved though no animation does.
    pub fn moved(&self) -> Vec<Id> {
        self.gpu.motion.strayed()
    }

    /// Moves everything to a pose of the scene that this was loaded from: [`Scene::pose`] at a time, or one of your own
    /// making ([`Pose::set_world`]), which may have any node, light or camera elsewhere. The next frame shows it, and knows where everything was
    /// before. The sky that places see stays that of the scene at rest. A loaded scene starts with the pose at time 0. Where
    /// [`Scene::settle`] has chosen another origin, views must count from it too, as [`View::from_pose`] does.
    /// What a pose puts beyond all scenes is not seen and casts no shadow.
    ///
    /// # Errors
    /// When the scene has other nodes than what was loaded, or [`Scene::validate_pose`] refuses the pose. Everything then
    /// stands as before.
    ///
    /// [`View::from_pose`]: crate::View::from_pose
    pub fn set_pose(&mut self, scene: &Scene, pose: &Pose) -> Result<(), Error> {
        self.check_scene(scene, "pose")?;
        scene.validate_pose(pose)?;
        let (origin, strayed) = (self.gpu.motion.origin(), self.gpu.motion.strayed().len());
        self.gpu.set_pose(scene, pose);
        let motion = &self.gpu.motion;
        if origin != scene.origin {
            self.openness = Openness::new(scene);
        }
        if origin != scene.origin || strayed != motion.strayed().len() {
            self.casters = Casters::new(scene, &scene.pose(0.0), &motion.strayed());
        }
        self.specular.follow(scene, pose);
        self.casters.hold(motion.present_bounds_ws());
        (self.lights, self.directional) = light_data(scene, pose);
        self.pose.clone_from(pose);
        // Trees that do not fit any more are missed by name when the next frame is prepared.
        self.trees = self.trees.take().and_then(|mut trees| trees.update(scene, pose).ok().map(|()| trees));
        Ok(())
    }

    /// Refuses what belongs to a scene that this was not loaded from, as far as counting tells.
    fn check_scene(&self, scene: &Scene, what: &'static str) -> Result<(), Error> {
        let (own, other) = (self.pose.world_from_node.len(), scene.nodes.len());
        if own == other {
            return Ok(());
        }
        let problem = format!("it is of a scene of {other} nodes, and the one that was loaded has {own}");
        Err(Error::Foreign { what, problem })
    }

    /// Takes over how strong, coloured, far-reaching and wide the lights of `scene` are, and of what kind: the scene that
    /// this was loaded from, with other [`Scene::lights`]. The next frame shows it.
    pub fn set_lights(&mut self, scene: &Scene) {
        (self.lights, self.directional) = light_data(scene, &self.pose);
        let of = (&self.gpu, &self.casters, &self.specular);
        self.radiance_scale = radiance_scale(of, scene, &self.lights, self.environment.as_ref());
    }
}

/// Stored radiance per nit.
fn radiance_scale(
    (gpu, casters, specular): (&SceneGpu, &Casters, &caustics::Casters),
    scene: &Scene,
    lights: &[LightData],
    environment: Option<&EnvironmentMap>,
) -> f32 {
    let glow = scene.materials.iter().map(|m| m.emissive.max_element()).fold(0.0, f32::max);
    let around = environment.map_or(0.0, |map| map.harmonics.mean.max_element());
    let peak = environment.map_or(0.0, |map| map.peak);
    let scale = stored_per_nit((gpu.bounds_ws, casters), lights, (glow.max(around), peak));
    if specular.bounds_ws().is_some() { scale * BESIDE_CASTERS } else { scale }
}

/// The same of lamps, and of whatever else has as many nits as `others`, and an environment at most `peak`.
pub(crate) fn stored_per_nit(
    (bounds_ws, casters): ((Vec3, Vec3), &Casters),
    lights: &[LightData],
    (others, peak): (f32, f32),
) -> f32 {
    let illuminance = lights.iter().map(|light| {
        let around = casters.around(light.position_ws.into()).unwrap_or(bounds_ws);
        illuminance_scale(std::slice::from_ref(light), around)
    });
    let white = illuminance.fold(0.0, f32::max) / std::f32::consts::PI;
    // Without any light 1 nit is as good as anything.
    let brightest = if white.max(others) > 0.0 { white.max(others) } else { WHITE_STORED };
    let stored = (PEAK_STORED * brightest / peak.max(1e-30)).clamp(LEAST_WHITE_STORED, WHITE_STORED);
    let scale = (stored / brightest).log2().round().clamp(-60.0, 60.0).exp2();
    // Where a lamp hangs low over a wide ground, what it shines at is far brighter than what is typical.
    let nearest = lights.iter().map(|light| ground_illuminance(casters, light)).fold(0.0, f32::max);
    let most = PEAK_STORED * std::f32::consts::PI / nearest.max(1e-30);
    let fits = most.log2().floor().clamp(-60.0, 60.0).exp2();
    scale.min(fits.max(scale * LEAST_OF_LAMPS))
}

/// The most that a lamp gives a ground, lux.
fn ground_illuminance(casters: &Casters, light: &LightData) -> f32 {
    if light.kind == LightData::DIRECTIONAL {
        return 0.0;
    }
    let peak = Vec3::from(light.intensity).max_element();
    let lit = casters.towards_grounds(light.position_ws.into()).filter_map(|to| {
        // Within a spot's cone as near as its edge comes.
        let off = to.angle_between(light.direction_ws.into()) - light.cone_rad;
        let along = to.length() / off.max(0.0).cos();
        (along > 0.0 && along.is_finite()).then(|| peak / (along * along))
    });
    lit.fold(0.0, f32::max)
}
