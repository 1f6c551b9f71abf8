//! Compiling off the frame: a [`Plan`] says what is missing, any thread makes it, and the renderer takes it over.

use chiaro_gpu::shader::Library;
use chiaro_gpu::{Gpu, GroupLayout, Recorder, parallel};
use chiaro_scene::{Environment, Scene};
use chiaro_techniques::direct::{DirectLight, Permutations};
use chiaro_techniques::environment::EnvironmentMap;
use chiaro_techniques::indirect::Openness;
use chiaro_techniques::motion::Motion;
use chiaro_techniques::shadow::{Lookup, ShadowMaps};
use chiaro_techniques::shared::albedo_table;
use chiaro_techniques::shared::frame::FrameGroup;
use chiaro_techniques::surface::{SceneFacts, SceneGpu, Surfaces};
use chiaro_techniques::transparency::Transparency;

use crate::renderer::Passes;
use crate::{Error, LoadedScene, Pipeline, Settings};

/// What every pass is compiled with, and scenes are uploaded with. Cheap to clone, and sent to other threads.
#[derive(Clone, Debug)]
pub struct Kit {
    /// The device.
    pub gpu: Gpu,
    /// The shaders.
    pub library: Library,
    /// Group 0's layout.
    pub frame_layout: GroupLayout,
    /// Group 1's layout.
    pub scene_layout: GroupLayout,
}

impl Kit {
    /// Makes the layouts; compiles nothing yet.
    pub fn new(gpu: &Gpu, library: Library) -> Self {
        let (frame_layout, scene_layout) = (FrameGroup::layout(gpu), SceneGpu::layout(gpu));
        Self { gpu: gpu.clone(), library, frame_layout, scene_layout }
    }

    /// Uploads a scene. [`crate::Renderer::plan`] then tells what its materials need compiled.
    ///
    /// # Errors
    /// When it does not fit the adapter.
    pub fn upload(&self, scene: &Scene) -> Result<LoadedScene, Error> {
        let environment = || scene.environment.as_ref().map(|map| self.environment(map)).transpose();
        let (gpu, (environment, openness)) = parallel::join(
            || SceneGpu::upload(&self.gpu, &self.scene_layout, scene),
            || parallel::join(environment, || Openness::new(scene)),
        );
        Ok(LoadedScene::new(gpu?, scene, environment?, openness))
    }

    fn environment(&self, map: &Environment) -> Result<EnvironmentMap, Error> {
        let mut recorder = Recorder::new(&self.gpu, false);
        let mut frame = recorder.begin();
        let environment = EnvironmentMap::new(&mut frame, &self.library, map)?;
        frame.submit();
        Ok(environment)
    }

    pub(crate) fn frame_group(&self) -> Result<FrameGroup, Error> {
        let table = albedo_table::texture(&self.gpu);
        let mut recorder = Recorder::new(&self.gpu, false);
        let mut frame = recorder.begin();
        albedo_table::record(&mut frame, &self.library, &table)?;
        frame.submit();
        Ok(FrameGroup::new(&self.gpu, &self.frame_layout, &table))
    }

    fn motion(&self) -> Result<Motion, Error> {
        Ok(Motion::new(&self.gpu, &self.library)?)
    }

    fn surfaces(&self, settings: &Settings, facts: SceneFacts) -> Result<Surfaces, Error> {
        let (frame, scene) = (&self.frame_layout, &self.scene_layout);
        Ok(Surfaces::new(&self.gpu, &self.library, frame, scene, &settings.surface, facts)?)
    }

    fn shadows(&self, settings: &Settings, facts: SceneFacts) -> Result<ShadowMaps, Error> {
        let (frame, scene) = (&self.frame_layout, &self.scene_layout);
        Ok(ShadowMaps::new(&self.gpu, &self.library, frame, scene, &settings.shadow, facts)?)
    }

    fn direct(&self, settings: &Settings, facts: SceneFacts) -> Result<DirectLight, Error> {
        let (frame, scene) = (&self.frame_layout, &self.scene_layout);
        Ok(DirectLight::new(&self.gpu, &self.library, frame, scene, permutations(settings, facts))?)
    }

    fn transparency(&self, settings: &Settings, facts: SceneFacts) -> Result<Transparency, Error> {
        let (frame, scene) = (&self.frame_layout, &self.scene_layout);
        let lookup = Lookup::new(&settings.shadow);
        Ok(Transparency::new(&self.gpu, &self.library, frame, scene, (lookup, facts))?)
    }
}

/// What must be compiled before settings, a scene or other shaders can be rendered with.
#[derive(Debug)]
pub struct Plan {
    kit: Kit,
    settings: Settings,
    // With nothing left to the adapter.
    resolved: Settings,
    facts: SceneFacts,
    generation: u64,
    missing: Missing,
}

/// Which passes are to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Missing {
    pub frame_group: bool,
    pub motion: bool,
    pub surfaces: bool,
    pub shadows: bool,
    pub direct: bool,
    pub transparency: bool,
}

impl Missing {
    const NONE: Self = Self {
        frame_group: false,
        motion: false,
        surfaces: false,
        shadows: false,
        direct: false,
        transparency: false,
    };

    pub(crate) fn all(facts: SceneFacts) -> Self {
        Self {
            frame_group: true,
            motion: true,
            surfaces: true,
            shadows: true,
            direct: true,
            transparency: facts.see_through(),
        }
    }

    pub(crate) fn from(passes: &Passes, settings: &Settings, facts: SceneFacts) -> Self {
        let lookup = Lookup::new(&settings.shadow);
        let serves = |transparency: &Transparency| transparency.serves(lookup, facts);
        Self {
            surfaces: !passes.surfaces.serves(&settings.surface, facts),
            shadows: !passes.shadows.serves(&settings.shadow, facts),
            direct: passes.direct.permutations() != permutations(settings, facts),
            transparency: facts.see_through() && !passes.transparency.as_ref().is_some_and(serves),
            ..Self::NONE
        }
    }
}

fn permutations(settings: &Settings, facts: SceneFacts) -> Permutations {
    let forward = (settings.pipeline == Pipeline::Forward).then(|| settings.surface.msaa.samples());
    Permutations::new(&settings.shadow, forward, facts)
}

/// What a [`Plan`] became.
#[derive(Debug)]
pub struct Built {
    pub(crate) kit: Kit,
    pub(crate) settings: Settings,
    pub(crate) resolved: Settings,
    pub(crate) generation: u64,
    pub(crate) is_empty: bool,
    pub(crate) frame_group: Option<FrameGroup>,
    pub(crate) motion: Option<Motion>,
    pub(crate) surfaces: Option<Surfaces>,
    pub(crate) shadows: Option<ShadowMaps>,
    pub(crate) direct: Option<DirectLight>,
    pub(crate) transparency: Option<Transparency>,
}

impl Built {
    /// The passes, where all were missing.
    pub(crate) fn into_passes(self) -> Option<Passes> {
        Some(Passes {
            frame_group: self.frame_group?,
            motion: self.motion?,
            surfaces: self.surfaces?,
            shadows: self.shadows?,
            direct: self.direct?,
            transparency: self.transparency,
        })
    }
}

impl Plan {
    pub(crate) fn new(
        kit: Kit,
        settings: Settings,
        facts: SceneFacts,
        generation: u64,
        missing: Missing,
    ) -> Self {
        let resolved = settings.resolved(&kit.gpu);
        Self { kit, settings, resolved, facts, generation, missing }
    }

    /// Whether nothing is to be compiled: [`Plan::build`] is then free.
    pub fn is_empty(&self) -> bool {
        self.missing == Missing::NONE
    }

    /// What shaders that look up lights are compiled for once the plan is installed.
    pub fn permutations(&self) -> Permutations {
        permutations(&self.resolved, self.facts)
    }

    /// What it compiles with.
    pub fn kit(&self) -> &Kit {
        &self.kit
    }

    /// Compiles, on all cores. Takes up to seconds; any thread may do it.
    ///
    /// # Errors
    /// When a shader does not link or compile.
    pub fn build(self) -> Result<Built, Error> {
        let is_empty = self.is_empty();
        let Self { kit, settings, resolved, facts, generation, missing } = self;
        let frame_group = || missing.frame_group.then(|| kit.frame_group()).transpose();
        let motion = || missing.motion.then(|| kit.motion()).transpose();
        let surfaces = || missing.surfaces.then(|| kit.surfaces(&resolved, facts)).transpose();
        let shadows = || missing.shadows.then(|| kit.shadows(&resolved, facts)).transpose();
        let direct = || missing.direct.then(|| kit.direct(&resolved, facts)).transpose();
        let transparency = || missing.transparency.then(|| kit.transparency(&resolved, facts)).transpose();
        // What takes longest first.
        let (((transparency, direct), (surfaces, shadows)), (frame_group, motion)) = parallel::join(
            || parallel::join(|| parallel::join(transparency, direct), || parallel::join(surfaces, shadows)),
            || parallel::join(frame_group, motion),
        );
        Ok(Built {
            frame_group: frame_group?,
            motion: motion?,
            surfaces: surfaces?,
            shadows: shadows?,
            direct: direct?,
            transparency: transparency?,
            kit,
            settings,
            resolved,
            generation,
            is_empty,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plans_and_what_they_become_may_change_threads() {
        fn sent<T: Send>() {}
        sent::<Plan>();
        sent::<Built>();
        sent::<LoadedScene>();
        sent::<crate::Renderer>();
    }
}
