//! A scene on show: what is on the GPU, and what the panel says about it.

use std::sync::Arc;

use chiaro::scene::{LoadOptions, Pose, Scene, Source};
use chiaro::{Error, Kit, LoadedScene, View};

/// A scene, ready to be rendered.
#[derive(Debug)]
pub struct Stage {
    /// As it was asked for.
    pub source: Source,
    /// For the title.
    pub name: String,
    /// On the CPU, for poses, cameras and trees.
    pub scene: Arc<Scene>,
    /// On the GPU.
    pub loaded: LoadedScene,
    /// Names of the cameras, in placing order.
    pub cameras: Vec<String>,
    /// Seconds of its animation.
    pub duration_s: Option<f64>,
    /// Where everything is now.
    pub pose: Pose,
}

/// What is to be put on show.
#[derive(Clone, Debug)]
pub struct Request {
    /// A scene.
    pub source: Source,
    /// A picture of the surroundings.
    pub environment: Option<String>,
    /// Nothing may stand in for what is missing: [`LoadOptions::strict`].
    pub strict: bool,
    /// Glowing meshes are lights, so that a scene with some gets no sun: [`Settings::lit_by_glow`](chiaro::Settings::lit_by_glow).
    pub glow_lights: bool,
}

/// Reads a scene from its file.
///
/// # Errors
/// When it, or the picture of its surroundings, cannot be read.
pub fn read(Request { source, environment, strict, glow_lights }: &Request) -> Result<Scene, Error> {
    let options = LoadOptions { strict: *strict, ..LoadOptions::default() };
    let mut scene = source.load(&options)?;
    if let Some(file) = environment {
        scene.environment = Some(chiaro::environment::load(file, &mut scene.warnings)?);
    }
    if *glow_lights {
        scene.add_default_view_to_trace();
    } else {
        scene.add_default_view();
    }
    let eye = View::from_scene(&scene, 0).map(|view| view.eye_ws().as_dvec3() + scene.origin);
    scene.settle(eye);
    Ok(scene)
}

impl Stage {
    /// Reads and uploads a scene. Takes up to seconds; any thread may do it.
    ///
    /// # Errors
    /// When it cannot be read, or does not fit the adapter.
    pub fn load(kit: &Kit, request: &Request) -> Result<Self, Error> {
        let scene = read(request)?;
        let loaded = LoadedScene::upload(kit, &scene)?;
        Ok(Self::new(&request.source, scene, loaded))
    }

    /// Names what there is.
    pub fn new(source: &Source, scene: Scene, loaded: LoadedScene) -> Self {
        let file = source.to_string();
        let file = file.strip_prefix("builtin:").unwrap_or(&file);
        let name = file.rsplit(['/', '\\']).next().unwrap_or(file).to_owned();
        let cameras = scene.placed_cameras();
        let label = |(number, (camera, _)): (usize, &(usize, glam::Mat4))| {
            let name = &scene.cameras[*camera].name;
            if name.is_empty() { format!("camera {number}") } else { name.clone() }
        };
        let cameras = cameras.iter().enumerate().map(label).collect();
        let duration_s = scene.duration_s().map(f64::from).filter(|s| *s > 0.0);
        let pose = scene.pose(0.0);
        Self { source: source.clone(), name, cameras, duration_s, pose, loaded, scene: Arc::new(scene) }
    }

    /// Moves everything to a moment.
    ///
    /// # Errors
    /// When something would stand nowhere then; all stays where it is.
    pub fn set_time(&mut self, time_s: f64) -> Result<(), chiaro::Error> {
        let pose = self.scene.pose(time_s);
        self.loaded.set_pose(&self.scene, &pose)?;
        self.pose = pose;
        Ok(())
    }

    /// The scene's camera of that number, at the present moment.
    pub fn view(&self, camera: usize) -> Option<View> {
        View::from_pose(&self.scene, &self.pose, camera)
    }

    /// How fast one may fly through it, metres per second.
    pub fn speeds(&self) -> std::ops::RangeInclusive<f32> {
        1e-4 * self.size_m()..=1e2 * self.size_m()
    }

    /// Length of the scene's diagonal, metres; 1 where there is nothing.
    pub fn size_m(&self) -> f32 {
        let (lo, hi) = self.loaded.gpu.bounds_ws;
        let length = (hi - lo).length();
        if length > 0.0 && length.is_finite() { length } else { 1.0 }
    }
}
