//! What `render` and `bench` share: a device, settings, a scene and a camera, from the same flags.

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use chiaro::scene::{HeightMap, LoadOptions, Pose, Scene, Source};
use chiaro::{Gpu, GpuOptions, Kit, LoadedScene, Lookout, Renderer, Settings, View, scene};

use crate::args::{SceneArgs, SettingsArgs};

/// Everything that a frame needs, or what is traced instead.
pub struct Session<R = Renderer> {
    pub gpu: Gpu,
    pub renderer: R,
    pub scene: LoadedScene,
    pub scene_name: String,
    pub view: View,
    pub size: [u32; 2],
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
pub struct Tracing {
    kit: Kit,
    settings: Settings,
}

impl Tracing {
    pub fn kit(&self) -> &Kit {
        &self.kit
    }

    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}

impl Session {
    /// Opens the device, reads the scene, compiles the passes. Remarks for the user go to standard error.
    pub fn open(scene_args: &SceneArgs, settings_args: &SettingsArgs) -> anyhow::Result<Self> {
        Self::open_as(scene_args, settings(settings_args)?)
    }

    /// The same with settings that were read already.
    pub fn open_as(scene_args: &SceneArgs, settings: Settings) -> anyhow::Result<Self> {
        Self::open_with(scene_args, settings, Scene::add_default_view, |gpu, settings, scene| {
            Ok(Renderer::with_scene(gpu, settings, scene)?)
        })
    }

    /// Tells what the renderer gave up, once.
    pub fn tell_notes(&self) {
        for note in self.renderer.notes() {
            eprintln!("warning: {note}");
        }
    }
}

impl Session<Tracing> {
    /// Opens the device and reads the scene, which gets light only where nothing in it shines.
    pub fn open_to_trace(scene_args: &SceneArgs, settings_args: &SettingsArgs) -> anyhow::Result<Self> {
        Self::open_with(
            scene_args,
            settings(settings_args)?,
            Scene::add_default_view_to_trace,
            |gpu, settings, scene| {
                let kit = Kit::new(gpu, chiaro::techniques::shaders::library());
                let loaded = LoadedScene::upload(&kit, scene)?;
                Ok((Tracing { kit, settings }, loaded))
            },
        )
    }
}

impl<R> Session<R> {
    fn open_with(
        scene_args: &SceneArgs,
        settings: Settings,
        complete: fn(&mut Scene),
        load: fn(&Gpu, Settings, &Scene) -> anyhow::Result<(R, LoadedScene)>,
    ) -> anyhow::Result<Self> {
        let source = source(scene_args);
        let options = LoadOptions {
            scene: scene_args.scene_in_file.clone(),
            strict: scene_args.strict,
            ..LoadOptions::default()
        };
        let mut scene = source.load(&options)?;
        if let Some(path) = &scene_args.environment {
            scene.environment = Some(chiaro::environment::load(path, &mut scene.warnings)?);
        }
        for warning in &scene.warnings {
            eprintln!("warning: {warning}");
        }
        complete(&mut scene);
        let eye = eye(&scene, scene_args)?;
        let gpu = open_gpu()?;
        let size = scene_args.size.unwrap_or_default();
        let size = [size.width, size.height];
        let limit = gpu.limits.max_texture_dimension_2d;
        if size.iter().any(|&side| side > limit) {
            bail!("--size {}x{}: {} renders up to {limit}x{limit}", size[0], size[1], gpu.info.name);
        }
        let (_, view) = settle(&mut scene, 0.0, eye)?;
        let (renderer, loaded) = load(&gpu, settings, &scene)?;
        Ok(Self {
            gpu,
            renderer,
            scene: loaded,
            scene_name: source.to_string(),
            view,
            size,
            source: scene,
            eye,
        })
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
    pub fn go_to(&mut self, time_s: f64) -> anyhow::Result<()> {
        let (pose, view) = settle(&mut self.source, time_s, self.eye)?;
        self.scene.set_pose(&self.source, &pose)?;
        self.view = view;
        Ok(())
    }
}

/// The scene that is asked for, or the default.
pub fn source(args: &SceneArgs) -> Source {
    let Some(image) = &args.terrain.height_map else {
        let name = args.scene.clone();
        return name.unwrap_or_else(|| format!("builtin:{}", scene::builtin::DEFAULT)).into();
    };
    Source::HeightMap(HeightMap {
        image: image.clone(),
        size_m: args.terrain.size_m.map(|size| size.0),
        height_m: args.terrain.height_m,
        vertices: args.terrain.vertices,
    })
}

/// A camera of the user's own.
pub fn own_view(args: &SceneArgs) -> Option<Lookout> {
    let view = args.view.as_ref()?;
    Some(Lookout { eye_m: view.eye_m.into(), target_m: view.target_m.into(), yfov_rad: view.yfov_rad })
}

/// Opens the best device, and says when it is a slow one.
pub fn open_gpu() -> anyhow::Result<Gpu> {
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
    if gpu.is_software() {
        eprintln!("note: {} runs on the CPU; a graphics card would be much faster", gpu.info.name);
    }
    Ok(gpu)
}

/// Preset, changes and pipeline, in this order.
pub fn settings(args: &SettingsArgs) -> anyhow::Result<Settings> {
    let mut settings = Settings { seed: args.seed, ..Settings::default() };
    if let Some(preset) = &args.preset {
        let is_file = std::path::Path::new(preset).extension().is_some_and(|e| e.eq_ignore_ascii_case("ron"));
        let text = is_file
            .then(|| std::fs::read_to_string(preset).with_context(|| format!("cannot read preset {preset}")))
            .transpose()?;
        settings.apply_preset(preset, text.as_deref())?;
    }
    for change in &args.set {
        settings.set(&change.key, &change.value)?;
    }
    if let Some(pipeline) = &args.pipeline {
        settings.set("pipeline", pipeline)?;
    }
    Ok(settings)
}

/// Every setting's value, as text.
pub fn by_key(settings: &Settings) -> BTreeMap<String, String> {
    let fields = Settings::fields().iter();
    fields.filter_map(|field| Some((field.key.clone(), settings.get(&field.key)?))).collect()
}

/// Tells which of the changes asked for do nothing beside the others.
pub fn warn_of_idle(args: &SettingsArgs) -> anyhow::Result<()> {
    let settings = settings(args)?;
    let keys: std::collections::BTreeSet<_> = args.set.iter().map(|change| &change.key).collect();
    for key in keys {
        if let Some(only) = settings.idle(key) {
            eprintln!("warning: --set {key} does nothing here, {only}");
        }
    }
    Ok(())
}

fn see(scene: &Scene, pose: &Pose, eye: Eye) -> anyhow::Result<View> {
    match eye {
        Eye::Own(lookout) => Ok(lookout.view(scene)),
        Eye::Camera(index) => View::from_pose(scene, pose, index).context("the scene has no camera"),
    }
}

/// Lets world space count from near the eye; returns the pose that everything has then, and the view.
fn settle(scene: &mut Scene, time_s: f64, eye: Eye) -> anyhow::Result<(Pose, View)> {
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

fn eye(scene: &Scene, args: &SceneArgs) -> anyhow::Result<Eye> {
    if let Some(view) = own_view(args) {
        return Ok(Eye::Own(view));
    }
    let placed = scene.placed_cameras();
    let names: Vec<_> = placed.iter().map(|(camera, _)| scene.cameras[*camera].name.as_str()).collect();
    let index = match &args.camera {
        None => 0,
        Some(wanted) => match names.iter().position(|name| name == wanted) {
            Some(index) => index,
            None => {
                wanted.parse::<usize>().ok().filter(|&index| index < placed.len()).with_context(|| {
                    let list: Vec<_> =
                        names.iter().enumerate().map(|(i, name)| format!("{i} “{name}”")).collect();
                    format!("--camera {wanted}: the scene has these cameras: {}", list.join(", "))
                })?
            }
        },
    };
    Ok(Eye::Camera(index))
}
