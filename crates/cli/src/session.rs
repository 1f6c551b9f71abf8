//! What `render` and `bench` share: a device, settings, a scene and a camera, from the same flags.

use anyhow::{Context, bail};
use chiaro::scene::{LoadOptions, Pose, Scene};
use chiaro::{Gpu, GpuOptions, Kit, LoadedScene, Pipeline, Renderer, Settings, View, scene};

use crate::args::{self, SceneArgs, SettingsArgs};

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
    Own(View),
}

/// Near plane of `--view` cameras.
const NEAR_M: f32 = 0.05;

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
        Self::open_with(scene_args, settings_args, Scene::add_default_view, |gpu, settings, scene| {
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
            settings_args,
            Scene::add_default_view_to_trace,
            |gpu, settings, scene| {
                let kit = Kit::new(gpu, chiaro::techniques::shaders::library());
                let loaded = kit.upload(scene)?;
                Ok((Tracing { kit, settings }, loaded))
            },
        )
    }
}

impl<R> Session<R> {
    fn open_with(
        scene_args: &SceneArgs,
        settings_args: &SettingsArgs,
        complete: fn(&mut Scene),
        load: fn(&Gpu, Settings, &Scene) -> anyhow::Result<(R, LoadedScene)>,
    ) -> anyhow::Result<Self> {
        let settings = settings(settings_args)?;
        let name = scene_name(scene_args);
        let options = LoadOptions { scene: scene_args.scene_in_file.clone(), ..LoadOptions::default() };
        let mut scene = scene::load_with(&name, &options)?;
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
        let (renderer, loaded) = load(&gpu, settings, &scene)?;
        let view = see(&scene, &scene.pose(0.0), eye)?;
        Ok(Self { gpu, renderer, scene: loaded, scene_name: name, view, size, source: scene, eye })
    }

    /// Seconds until everything that moves has done so once; `None` when nothing does.
    pub fn duration_s(&self) -> Option<f32> {
        self.source.duration_s()
    }

    /// Moves scene and camera to a moment.
    pub fn go_to(&mut self, time_s: f64) -> anyhow::Result<()> {
        let pose = self.source.pose(time_s);
        self.scene.set_pose(&self.source, &pose);
        self.view = see(&self.source, &pose, self.eye)?;
        Ok(())
    }
}

/// The scene that is asked for, or the default.
pub fn scene_name(args: &SceneArgs) -> String {
    args.scene.clone().unwrap_or_else(|| format!("builtin:{}", scene::builtin::DEFAULT))
}

/// A camera of the user's own.
pub fn own_view(args: &SceneArgs) -> Option<View> {
    let view = args.view.as_ref()?;
    Some(View::look_at(view.eye_ws_m.into(), view.target_ws_m.into(), view.yfov_rad, NEAR_M))
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
    if let Some(pipeline) = args.pipeline {
        settings.pipeline = match pipeline {
            args::Pipeline::Forward => Pipeline::Forward,
            args::Pipeline::Deferred => Pipeline::Deferred,
        };
    }
    Ok(settings)
}

fn see(scene: &Scene, pose: &Pose, eye: Eye) -> anyhow::Result<View> {
    match eye {
        Eye::Own(view) => Ok(view),
        Eye::Camera(index) => View::from_pose(scene, pose, index).context("the scene has no camera"),
    }
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
