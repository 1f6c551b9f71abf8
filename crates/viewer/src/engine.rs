//! The renderer with the passes that make its frames visible, and how both are compiled beside the frame.

use chiaro::techniques::post::{Accumulator, AovPass, DebugView, Display};
use chiaro::{Built, Error, Gpu, GpuError, Kit, Plan, Renderer, Settings};

use chiaro::techniques::direct::Permutations;

use crate::stage::{self, Request, Stage};

/// What turns frames into pictures.
#[derive(Debug)]
pub struct PicturePasses {
    /// Sums up frames.
    pub accumulator: Accumulator,
    /// Exposes and tone-maps.
    pub display: Display,
    /// Shows buffers.
    pub debug: DebugView,
    /// Shows single quantities.
    pub aov: AovPass,
}

impl PicturePasses {
    fn new(kit: &Kit, permutations: Permutations) -> Result<Self, Error> {
        Ok(Self {
            accumulator: Accumulator::new(&kit.gpu, &kit.library)?,
            display: Display::new(&kit.gpu, &kit.library)?,
            debug: DebugView::new(&kit.gpu, &kit.library, &kit.frame_layout)?,
            aov: aov(kit, permutations)?,
        })
    }
}

fn aov(kit: &Kit, permutations: Permutations) -> Result<AovPass, Error> {
    Ok(AovPass::new(kit, permutations, 1)?)
}

/// Everything that is compiled.
#[derive(Debug)]
pub struct Engine {
    /// Renders.
    pub renderer: Renderer,
    /// Shows what it rendered.
    pub passes: PicturePasses,
    /// Counts what was installed.
    pub generation: u64,
}

/// Compiled beside the frame, not yet in force.
#[derive(Debug)]
pub struct Rebuilt {
    built: Built,
    aov: Option<AovPass>,
    passes: Option<PicturePasses>,
}

impl Engine {
    /// Loads a scene and compiles what it and the settings need; without the scene where that cannot be read. Takes up to
    /// seconds; any thread may do it.
    ///
    /// # Errors
    /// When the settings do not go together, or the adapter cannot do them.
    pub fn new(
        gpu: &Gpu,
        settings: Settings,
        request: &Request,
    ) -> Result<(Self, Result<Stage, Error>), Error> {
        let (renderer, stage) = match stage::read(request) {
            Ok(scene) => {
                let (renderer, loaded) = Renderer::with_scene(gpu, settings, &scene)?;
                (renderer, Ok(Stage::new(&request.source, scene, loaded)))
            }
            Err(error) => (Renderer::new(gpu, settings)?, Err(error)),
        };
        let passes = PicturePasses::new(renderer.kit(), renderer.permutations())?;
        Ok((Self { renderer, passes, generation: 0 }, stage))
    }

    /// Takes over what was compiled; `false` when it is out of date.
    pub fn install(&mut self, rebuilt: Rebuilt) -> bool {
        if !self.renderer.install(rebuilt.built) {
            return false;
        }
        self.generation += 1;
        if let Some(passes) = rebuilt.passes {
            self.passes = passes;
        }
        if let Some(aov) = rebuilt.aov {
            self.passes.aov = aov;
        }
        true
    }
}

impl Rebuilt {
    /// Builds a plan. `known` is what the present passes were compiled for; with `all` every pass is made anew, for
    /// changed shaders.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(plan: Plan, known: Permutations, all: bool) -> Result<Self, Error> {
        let (kit, permutations) = (plan.kit().clone(), plan.permutations());
        caught(&kit.gpu, || {
            Ok(Self {
                aov: (!all && known != permutations).then(|| aov(&kit, permutations)).transpose()?,
                passes: all.then(|| PicturePasses::new(&kit, permutations)).transpose()?,
                built: plan.build()?,
            })
        })
    }
}

/// Validation errors of `work` become its own, where they would else be the device's.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn caught<T>(gpu: &Gpu, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    let scope = gpu.device.push_error_scope(chiaro::wgpu::ErrorFilter::Validation);
    let result = work();
    match pollster::block_on(scope.pop()) {
        Some(error) => Err(GpuError::Device(error.to_string()).into()),
        None => result,
    }
}

/// In the browser a scope's outcome cannot be waited for: errors are the device's.
#[cfg(target_arch = "wasm32")]
pub(crate) fn caught<T>(_gpu: &Gpu, work: impl FnOnce() -> Result<T, Error>) -> Result<T, Error> {
    work()
}
