//! Compiling off the frame: a [`Plan`] says what is missing, any thread makes it, and the renderer takes it over.

use chiaro_gpu::{Recorder, parallel};
use chiaro_scene::{Environment, Scene};
use chiaro_techniques::Kit;
use chiaro_techniques::direct::Permutations;
use chiaro_techniques::environment::EnvironmentMap;
use chiaro_techniques::indirect::Openness;
use chiaro_techniques::indirect::sources::SourcePool;
use chiaro_techniques::scene::{SceneFacts, SceneGpu};

use crate::passes::{Found, Missing, permutations};
use crate::{Error, LoadedScene, Settings};

impl LoadedScene {
    /// Uploads a scene; any thread may do it. [`crate::Renderer::plan`] then tells what its materials need compiled.
    ///
    /// # Errors
    /// When it does not fit the adapter, or [`Scene::validate`] refuses it.
    pub fn upload(kit: &Kit, scene: &Scene) -> Result<Self, Error> {
        scene.validate()?;
        let environment = || scene.environment.as_ref().map(|map| environment(kit, map)).transpose();
        let sources = || SourcePool::upload(&kit.gpu, scene, &scene.pose(0.0));
        let (gpu, (environment, around)) = parallel::join(
            || SceneGpu::upload(&kit.gpu, &kit.scene_layout, scene),
            || parallel::join(environment, || parallel::join(|| Openness::new(scene), sources)),
        );
        Ok(Self::new(gpu?, scene, environment?, around))
    }
}

fn environment(kit: &Kit, map: &Environment) -> Result<EnvironmentMap, Error> {
    let mut recorder = Recorder::new(&kit.gpu, false);
    let mut frame = recorder.begin();
    let environment = EnvironmentMap::new(&mut frame, &kit.library, map)?;
    frame.submit();
    Ok(environment)
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

/// What a [`Plan`] became.
#[derive(Debug)]
pub struct Built {
    pub(crate) kit: Kit,
    pub(crate) settings: Settings,
    pub(crate) resolved: Settings,
    pub(crate) generation: u64,
    pub(crate) is_empty: bool,
    pub(crate) facts: SceneFacts,
    pub(crate) found: Found,
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
        self.missing.is_empty()
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
        let found = missing.compile(&kit)?;
        Ok(Built { kit, settings, resolved, generation, is_empty, facts, found })
    }
}
