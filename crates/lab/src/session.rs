//! A device, settings, a scene and a camera: what pictures are made of and measured on.

use std::collections::BTreeMap;
use std::path::PathBuf;

use chiaro::scene::{LoadOptions, Pose, Scene, Source};
use chiaro::{Gpu, GpuOptions, Kit, LoadedScene, Lookout, Renderer, Settings, View};

use crate::Error;

/// What is seen, and from where.
#[derive(Clone, Debug)]
pub struct SceneChoice {
    /// A file, a built-in scene, or terrain.
    pub source: Source,
    /// Which scene of a file that holds several, by its number from 0 or by its name; `None` is the file's own choice.
    pub scene_in_file: Option<String>,
    /// Refuse missing or broken textures instead of warning.
    pub strict: bool,
    /// A picture of the surroundings.
    pub environment: Option<PathBuf>,
    /// A camera of the scene, by its number from 0 or by its name; `None` is the first.
    pub camera: Option<String>,
    /// A camera of the user's own instead.
    pub view: Option<Lookout>,
    /// Pixels.
    pub size: [u32; 2],
}

/// Everything that a frame needs, or what is traced instead.
#[derive(Debug)]
pub struct Session<R = Renderer> {
    /// The device.
    pub gpu: Gpu,
    /// What makes pictures.
    pub renderer: R,
    /// The scene on the device, as it is at the moment.
    pub scene: LoadedScene,
    /// What it was asked for by.
    pub scene_name: String,
    /// Where the picture is taken from.
    pub view: View,
    /// Pixels.
    pub size: [u32; 2],
    /// The scene as it was read.
    pub source: Scene,
    eye: Eye,
}

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug)]
enum Eye {
    /// The scene's camera of this number, which may move.
    Camera(usize),
    /// A place of the user's own.
    Own(Lookout),
}

/// In the renderer's place where light is traced: no pass of a frame is compiled.
#[derive(Debug)]
pub struct Tracing {
    kit: Kit,
    settings: Settings,
}

impl Tracing {
    /// What the tracers are compiled with.
    pub fn kit(&self) -> &Kit {
        &self.kit
    }

    /// Those that say what is there count.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}

/// Hears sentences for the user: warnings of the scene, and that a device is slow.
pub type Tell<'a> = &'a mut dyn FnMut(&str);

impl Session {
    /// Opens the device, reads the scene, compiles the passes.
    ///
    /// # Errors
    /// When the scene cannot be read or has no such camera, the device fails, or settings do not go together.
    pub fn open(choice: &SceneChoice, settings: Settings, tell: Tell<'_>) -> Result<Self, Error> {
        let complete =
            if settings.lit_by_glow() { Scene::add_default_view_to_trace } else { Scene::add_default_view };
        Self::open_with((choice, None), settings, tell, complete, with_renderer)
    }

    /// The same of a scene that gets light only where nothing in it shines, as its truth does; on a device that is open
    /// already.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn open_to_compare(
        gpu: &Gpu,
        choice: &SceneChoice,
        settings: Settings,
        tell: Tell<'_>,
    ) -> Result<Self, Error> {
        let choice = (choice, Some(gpu));
        Self::open_with(choice, settings, tell, Scene::add_default_view_to_trace, with_renderer)
    }

    /// What the renderer gave up.
    pub fn notes(&self) -> &[String] {
        self.renderer.notes()
    }
}

fn with_renderer(gpu: &Gpu, settings: Settings, scene: &Scene) -> Result<(Renderer, LoadedScene), Error> {
    Ok(Renderer::with_scene(gpu, settings, scene)?)
}

impl Session<Tracing> {
    /// Opens the device and reads the scene, which gets light only where nothing in it shines.
    ///
    /// # Errors
    /// As [`Session::open`].
    pub fn open_to_trace(choice: &SceneChoice, settings: Settings, tell: Tell<'_>) -> Result<Self, Error> {
        let load = |gpu: &Gpu, settings: Settings, scene: &Scene| {
            let kit = Kit::new(gpu, chiaro::techniques::shaders::library());
            let loaded = LoadedScene::upload(&kit, scene)?;
            Ok((Tracing { kit, settings }, loaded))
        };
        Self::open_with((choice, None), settings, tell, Scene::add_default_view_to_trace, load)
    }
}

impl<R> Session<R> {
    fn open_with(
        (choice, gpu): (&SceneChoice, Option<&Gpu>),
        settings: Settings,
        tell: Tell<'_>,
        complete: fn(&mut Scene),
        load: impl FnOnce(&Gpu, Settings, &Scene) -> Result<(R, LoadedScene), Error>,
    ) -> Result<Self, Error> {
        let options = LoadOptions {
            scene: choice.scene_in_file.clone(),
            strict: choice.strict,
            ..LoadOptions::default()
        };
        let mut scene = choice.source.load(&options)?;
        if let Some(path) = &choice.environment {
            scene.environment = Some(chiaro::environment::load(path, &mut scene.warnings)?);
        }
        for warning in &scene.warnings {
            tell(&format!("warning: {warning}"));
        }
        complete(&mut scene);
        let eye = eye(&scene, choice)?;
        let gpu = gpu.map_or_else(|| open_gpu(tell), |gpu| Ok(gpu.clone()))?;
        let size = choice.size;
        let limit = gpu.limits.max_texture_dimension_2d;
        if size.iter().any(|&side| side > limit) {
            let [width, height] = size;
            let name = &gpu.info.name;
            return Err(Error::Work(format!(
                "--size {width}x{height}: {name} renders up to {limit}x{limit}"
            )));
        }
        let (_, view) = settle(&mut scene, 0.0, eye)?;
        let (renderer, mut loaded) = load(&gpu, settings, &scene)?;
        loaded.look_from(view.eye_ws());
        let scene_name = choice.source.to_string();
        Ok(Self { gpu, renderer, scene: loaded, scene_name, view, size, source: scene, eye })
    }

    /// Seconds until everything that moves has done so once; `None` when nothing does.
    pub fn duration_s(&self) -> Option<f32> {
        self.source.duration_s()
    }

    /// The scene's camera that looks, by its number and name; none where the view is the user's own.
    pub fn camera(&self) -> Option<(usize, &str)> {
        let Eye::Camera(index) = self.eye else { return None };
        let (camera, _) = *self.source.placed_cameras().get(index)?;
        Some((index, &self.source.cameras[camera].name))
    }

    /// Moves scene and camera to a moment.
    ///
    /// # Errors
    /// When the pose does not fit the device.
    pub fn go_to(&mut self, time_s: f64) -> Result<(), Error> {
        let (pose, view) = settle(&mut self.source, time_s, self.eye)?;
        self.scene.set_pose(&self.source, &pose)?;
        self.scene.look_from(view.eye_ws());
        self.view = view;
        Ok(())
    }
}

/// Opens the best device, and says when it is a slow one.
///
/// # Errors
/// When there is none.
pub fn open_gpu(tell: Tell<'_>) -> Result<Gpu, Error> {
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    if gpu.is_software() {
        let name = &gpu.info.name;
        tell(&format!("note: {name} runs on the CPU; a graphics card would be much faster"));
    }
    Ok(gpu)
}

/// Every setting's value, as text.
pub fn by_key(settings: &Settings) -> BTreeMap<String, String> {
    let fields = Settings::fields().iter();
    fields.filter_map(|field| Some((field.key.clone(), settings.get(&field.key)?))).collect()
}

/// A camera in words that tell it from all others.
pub fn camera_text(view: &View) -> String {
    // The command line's views are neither shifted nor of an aspect of their own.
    let View { world_from_camera, projection, near_m, far_m, .. } = view;
    format!("{projection:?}, near {near_m} m, far {far_m} m, world_from_camera {world_from_camera}")
}

/// Whether a setting says what is there, and so counts in a truth.
pub fn counts_in_truth(key: &str) -> bool {
    ["surface.lighting", "surface.normal_maps", "environment."].iter().any(|known| key.starts_with(known))
}

/// The settings that count in a truth, with their values.
pub fn truth_settings(settings: &Settings) -> String {
    let keys = Settings::fields().iter().map(|field| &field.key).filter(|key| counts_in_truth(key));
    let values = keys.map(|key| format!("{key}={}", settings.get(key).unwrap_or_default()));
    values.collect::<Vec<_>>().join(" ")
}

fn see(scene: &Scene, pose: &Pose, eye: Eye) -> Result<View, Error> {
    match eye {
        Eye::Own(lookout) => Ok(lookout.view(scene)),
        Eye::Camera(index) => View::from_pose(scene, pose, index)
            .ok_or_else(|| Error::Work("the scene has no camera".to_owned())),
    }
}

/// Lets world space count from near the eye; returns the pose that everything has then, and the view.
fn settle(scene: &mut Scene, time_s: f64, eye: Eye) -> Result<(Pose, View), Error> {
    let pose = scene.pose(time_s);
    let view = see(scene, &pose, eye)?;
    let eye_m = view.eye_ws().as_dvec3() + scene.origin;
    if !scene.settle(Some(eye_m)) {
        return Ok((pose, view));
    }
    let pose = scene.pose(time_s);
    let view = see(scene, &pose, eye)?;
    Ok((pose, view))
}

fn eye(scene: &Scene, choice: &SceneChoice) -> Result<Eye, Error> {
    if let Some(view) = choice.view {
        return Ok(Eye::Own(view));
    }
    let placed = scene.placed_cameras();
    let names: Vec<_> = placed.iter().map(|(camera, _)| scene.cameras[*camera].name.as_str()).collect();
    let Some(wanted) = &choice.camera else { return Ok(Eye::Camera(0)) };
    let by_number = || wanted.parse::<usize>().ok().filter(|&index| index < placed.len());
    let index = names.iter().position(|name| name == wanted).or_else(by_number);
    index.map(Eye::Camera).ok_or_else(|| {
        let list: Vec<_> = names.iter().enumerate().map(|(i, name)| format!("{i} “{name}”")).collect();
        Error::Work(format!("--camera {wanted}: the scene has these cameras: {}", list.join(", ")))
    })
}
