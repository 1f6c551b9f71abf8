//! The viewer without its window.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use chiaro::scene::{Scene, Source};
use chiaro::techniques::indirect::points::PointData;
use chiaro::techniques::indirect::{IndirectSettings, Technique};
use chiaro::techniques::shadow::ShadowSettings;
use chiaro::{Error, Gpu, GpuError, Library, Lookout, Recorder, Settings, Trees, View, wgpu};
use egui_wgpu::ScreenDescriptor;

use crate::buffers::{Place, Source as Buffer};
use crate::camera::FlyCamera;
use crate::engine::{Engine, Rebuilt};
use crate::files;
use crate::jobs::Jobs;
use crate::panel::notices::Notices;
use crate::panel::state::PanelState;
use crate::panel::style::style;
use crate::picture::{Picture, Shot, Shows};
use crate::playback::Playback;
use crate::reload::ShaderFiles;
use crate::stage::{Request, Stage};
use crate::timings::TimingHistory;
use crate::truth::{Compare, Truth};

/// Which camera a viewer starts with.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum StartCamera {
    /// The scene's first.
    #[default]
    First,
    /// The scene's camera of this name or number.
    Named(String),
    /// One of your own, in the scene's world space.
    At(View),
    /// One of your own, in the coordinates of the scene's file.
    From(Lookout),
}

/// What a viewer starts with.
#[derive(Clone, Debug)]
pub struct Options {
    /// What to show.
    pub scene: Source,
    /// A picture of the surroundings that takes the place of the scene's own.
    pub environment: Option<PathBuf>,
    /// A texture or material library that is missing or broken is an error, not a warning.
    pub strict: bool,
    /// Settings.
    pub settings: Settings,
    /// Camera.
    pub camera: StartCamera,
    /// Size of the window's inside, in pixels.
    pub size: [u32; 2],
    /// Samples a pixel that the path-traced truth ends with.
    pub truth_samples: u32,
    /// A folder of WESL files that take the place of the built-in shaders, and are read again when they change.
    pub shaders: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            scene: format!("builtin:{}", chiaro::scene::builtin::DEFAULT).into(),
            environment: None,
            strict: false,
            settings: Settings::default(),
            camera: StartCamera::First,
            size: [1280, 800],
            truth_samples: 4096,
            shaders: None,
        }
    }
}

/// When the GPU is asked again whether it has done what it was given.
const GPU_BUSY: Duration = Duration::from_millis(3);

/// What a frame is drawn to.
#[derive(Clone, Copy, Debug)]
pub struct Canvas<'a> {
    /// Of the format that the viewer was made for.
    pub view: &'a wgpu::TextureView,
    /// Pixels.
    pub size_px: [u32; 2],
}

/// What a frame asks of the window.
#[derive(Default)]
pub struct Outcome {
    /// Cursor, clipboard, input method.
    pub platform: egui::PlatformOutput,
    /// When the next frame is due; zero is at once.
    pub repaint_after: Duration,
    /// The window's title.
    pub title: String,
    /// Whether the mouse belongs to the camera: hidden and kept in the window.
    pub grabs_mouse: bool,
    /// Whether frames wait for the screen.
    pub vsync: bool,
    /// Whether the window fills the screen.
    pub fullscreen: bool,
    /// The device is gone, and why: a new viewer is needed, see [`Viewer::memory`].
    pub lost: Option<String>,
}

impl std::fmt::Debug for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("Outcome");
        text.field("repaint_after", &self.repaint_after).field("title", &self.title);
        text.field("lost", &self.lost).finish_non_exhaustive()
    }
}

/// What jobs report.
pub(crate) enum Report {
    Started(Result<(Box<Engine>, Result<Box<Stage>, String>), String>),
    Loaded(Result<Box<Stage>, String>),
    Rebuilt(Result<Box<Rebuilt>, String>, Purpose),
    /// Of which scene.
    Grown(Result<Box<Trees>, String>, Arc<Scene>),
    /// Of which scene.
    Strewn(Box<PointData>, Arc<Scene>),
    Written(Result<String, String>),
}

/// What a compilation was for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    Settings,
    Shaders,
}

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Eye {
    /// A camera of the scene, which may move.
    Placed(usize),
    /// Where the user flew.
    Free(FlyCamera),
}

/// A scene, its picture and the panel, over input events and a texture to draw to.
pub struct Viewer {
    pub(crate) gpu: Gpu,
    pub(crate) ctx: egui::Context,
    painter: egui_wgpu::Renderer,
    pub(crate) recorder: Recorder,
    jobs: Jobs<Report>,
    pub(crate) engine: Option<Engine>,
    pub(crate) stage: Option<Stage>,
    // Loaded, but its materials still need passes.
    incoming: Option<Box<Stage>>,
    pub(crate) loading: Option<Source>,
    pub(crate) building: bool,
    // Trees for rays through the scene: whether some are being built, and some that still need passes.
    growing: bool,
    grown: Option<(Box<Trees>, Arc<Scene>)>,
    // The same of points for imperfect shadow maps.
    strewing: bool,
    strewn: Option<(Box<PointData>, Arc<Scene>)>,
    // With what the last picture was made.
    drew: Settings,
    // What the panel shows; in force once everything it needs is compiled.
    pub(crate) wanted: Settings,
    start: StartCamera,
    pub(crate) eye: Eye,
    // Metres per second.
    pub(crate) speed: f32,
    pub(crate) playback: Playback,
    pub(crate) picture: Picture,
    pub(crate) truth: Truth,
    pub(crate) picture_id: Option<egui::TextureId>,
    pub(crate) buffer_id: Option<egui::TextureId>,
    shot: Option<(Shot, files::Wanted)>,
    // Files that are watched, and those read that are not compiled yet.
    shader_files: Option<ShaderFiles>,
    shaders: Option<Library>,
    shader_folder: Option<PathBuf>,
    pub(crate) timings: TimingHistory,
    pub(crate) panel: PanelState,
    pub(crate) notices: Notices,
    source: Source,
    environment: Option<String>,
    strict: bool,
    lost: Option<String>,
    animated: bool,
}

impl std::fmt::Debug for Viewer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Viewer").field("scene", &self.source).finish_non_exhaustive()
    }
}

/// Lets egui show a texture, under the name that the one before it had.
fn offer(
    painter: &mut egui_wgpu::Renderer,
    gpu: &Gpu,
    view: &wgpu::TextureView,
    known: Option<egui::TextureId>,
) -> egui::TextureId {
    let filter = wgpu::FilterMode::Linear;
    match known {
        None => painter.register_native_texture(&gpu.device, view, filter),
        Some(id) => {
            painter.update_egui_texture_from_wgpu_texture(&gpu.device, view, filter, id);
            id
        }
    }
}

/// Compiles the first passes.
fn start(jobs: &mut Jobs<Report>, gpu: &Gpu, settings: &Settings, request: Request) {
    let (gpu, settings) = (gpu.clone(), settings.clone());
    jobs.start(move || {
        let started = Engine::new(&gpu, settings, &request);
        let told = started
            .map(|(engine, stage)| (Box::new(engine), stage.map(Box::new).map_err(|e| e.to_string())))
            .map_err(|e| e.to_string());
        Report::Started(told)
    });
}

impl Viewer {
    /// Starts compiling and loading; the first frames say so. `format` is that of the canvases to come.
    pub fn new(gpu: &Gpu, format: wgpu::TextureFormat, options: Options) -> Self {
        let ctx = egui::Context::default();
        style(&ctx);
        let wake = ctx.clone();
        let painter = egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default());
        let mut jobs = Jobs::new(move || wake.request_repaint());
        let wake = ctx.clone();
        let truth = Truth::new(gpu, options.truth_samples, move || wake.request_repaint());
        let environment = options.environment.map(|path| path.to_string_lossy().into_owned());
        let strict = options.strict;
        let request = Request {
            source: options.scene.clone(),
            environment: environment.clone(),
            strict,
            glow_lights: options.settings.lit_by_glow(),
        };
        start(&mut jobs, gpu, &options.settings, request);
        let mut viewer = Self {
            gpu: gpu.clone(),
            ctx,
            painter,
            recorder: Recorder::new(gpu, true),
            jobs,
            engine: None,
            stage: None,
            incoming: None,
            loading: Some(options.scene.clone()),
            building: false,
            growing: false,
            grown: None,
            strewing: false,
            strewn: None,
            drew: options.settings.clone(),
            wanted: options.settings,
            start: options.camera,
            eye: Eye::Placed(0),
            speed: 1.0,
            playback: Playback::default(),
            picture: Picture::new(gpu),
            truth,
            picture_id: None,
            buffer_id: None,
            shot: None,
            shader_files: None,
            shaders: None,
            shader_folder: options.shaders.clone(),
            timings: TimingHistory::default(),
            panel: PanelState::default(),
            notices: Notices::default(),
            source: options.scene,
            environment,
            strict,
            lost: None,
            animated: false,
        };
        if let Some(folder) = options.shaders {
            let wake = viewer.ctx.clone();
            match ShaderFiles::watch(&folder, move || wake.request_repaint()) {
                Ok(files) => viewer.shader_files = Some(files),
                Err(error) => viewer.notices.fail(format!("shaders are not watched: {error}")),
            }
        }
        viewer
    }

    /// egui's context, for the window's input and repaint requests.
    pub fn context(&self) -> &egui::Context {
        &self.ctx
    }

    /// Loads a scene beside the frame, or lights the present one by another environment (`.hdr`, `.exr`); what is shown
    /// stays until then.
    pub fn open(&mut self, source: &str) {
        let extension = source.rsplit_once('.').map_or("", |(_, extension)| extension).to_ascii_lowercase();
        if ["hdr", "exr"].contains(&extension.as_str()) {
            self.environment = Some(source.to_owned());
            self.load(&self.source.clone());
        } else {
            self.load(&source.into());
        }
    }

    fn load(&mut self, source: &Source) {
        let Some(engine) = &self.engine else {
            self.loading = Some(source.clone());
            return;
        };
        let (kit, request) = (engine.renderer.kit().clone(), self.request(source));
        self.loading = Some(source.clone());
        self.jobs.start(move || {
            let stage = Stage::load(&kit, &request);
            Report::Loaded(stage.map(Box::new).map_err(|e| e.to_string()))
        });
    }

    /// How that scene is loaded.
    fn request(&self, source: &Source) -> Request {
        let (environment, strict) = (self.environment.clone(), self.strict);
        let glow_lights = self.wanted.lit_by_glow();
        Request { source: source.clone(), environment, strict, glow_lights }
    }

    /// Settings as the panel shows them; they are in force once what they need is compiled.
    pub fn settings(&self) -> &Settings {
        &self.wanted
    }

    /// Changes settings, as the panel does.
    pub fn set(&mut self, settings: Settings) {
        self.wanted = settings;
    }

    /// Whether nothing is being loaded or compiled, and the settings shown are in force.
    pub fn is_settled(&self) -> bool {
        let in_force = self.engine.as_ref().is_some_and(|engine| *engine.renderer.settings() == self.wanted);
        let busy = self.building || self.growing || self.strewing;
        in_force && self.loading.is_none() && self.incoming.is_none() && !busy
    }

    /// The picture without the panel, 8-bit sRGB; `None` before the first frame of a scene.
    pub fn picture(&self) -> Option<&chiaro::Texture> {
        self.stage.as_ref().and(self.picture.texture())
    }

    /// The buffer that is shown beside or instead of the picture, 8-bit sRGB; `None` where there is none.
    pub fn buffer(&self) -> Option<&chiaro::Texture> {
        self.picture.drawn().filter(|drawn| drawn.exists).and(self.picture.buffer_texture())
    }

    /// Names of all buffers that the newest frame has, in the order of the keys.
    pub fn buffers(&self) -> impl Iterator<Item = String> + '_ {
        self.picture.offer().iter().map(|(source, _)| source.to_string())
    }

    /// Why the buffer that is shown is black, where settings leave it nothing to show.
    pub fn black_buffer(&self) -> Option<String> {
        let shown = self.panel.shown_buffer;
        let Buffer::Quantity(aov) = shown.source else { return None };
        let only = self.wanted.blackens(aov).filter(|_| shown.place != Place::Off)?;
        Some(format!("Black here: there is something to see {only}."))
    }

    /// Frames that the picture is the mean of.
    pub fn frames(&self) -> u32 {
        self.picture.frames()
    }

    /// How the picture is compared with the path-traced truth.
    pub fn compare(&self) -> Compare {
        self.panel.compare
    }

    /// Compares the picture with the truth, as the panel does.
    pub fn set_compare(&mut self, compare: Compare) {
        self.panel.compare = compare;
    }

    /// Samples a pixel of the truth, and its radiance in nits summed over them; `None` before there is one.
    pub fn truth(&self) -> Option<(&chiaro::Texture, u32)> {
        self.truth.sum().map(|sum| (sum.nits, sum.frames))
    }

    /// Mean standard error of the truth's pixels relative to its mean, once that was measured.
    pub fn truth_noise(&self) -> Option<f32> {
        self.truth.noise()
    }

    /// First column of the picture that shows the truth; `None` where none does.
    pub fn truth_column(&self) -> Option<u32> {
        self.picture.truth().map(|shows| shows.first_column)
    }

    /// What is wrong with the shaders on disk; the last good ones are in use.
    pub fn shader_error(&self) -> Option<&str> {
        self.panel.shader_error.as_deref()
    }

    /// Why the last change of settings was refused.
    pub fn settings_error(&self) -> Option<&str> {
        self.panel.settings_error.as_deref()
    }

    /// Messages that the window shows.
    pub fn messages(&self) -> impl Iterator<Item = &str> {
        self.notices.texts()
    }

    /// What a new viewer needs to go on where this one ended.
    pub fn memory(&self) -> Options {
        Options {
            scene: self.source.clone(),
            settings: self.wanted.clone(),
            environment: self.environment.as_ref().map(PathBuf::from),
            strict: self.strict,
            camera: self.view().map_or(StartCamera::First, StartCamera::At),
            truth_samples: self.truth.most_samples(),
            shaders: self.shader_folder.clone(),
            ..Options::default()
        }
    }

    /// Tells the user something.
    pub fn tell(&mut self, message: impl Into<String>) {
        self.notices.tell(message);
    }

    /// Draws a frame. Without a canvas (a window that is minimised) it only takes in what has been loaded or compiled.
    pub fn frame(&mut self, input: egui::RawInput, canvas: Option<Canvas<'_>>) -> Outcome {
        self.take_reports();
        self.truth.take_reports();
        self.take_shaders();
        self.take_shot();
        self.settle();
        // Maps what the GPU has sent, such as timings; a failure shows in `check`.
        let _ = self.gpu.device.poll(wgpu::PollType::Poll);
        self.check();
        // Nothing can be drawn with a device that is gone.
        let Some(canvas) = canvas.filter(|_| self.lost.is_none()) else {
            return self.outcome(egui::PlatformOutput::default(), Duration::MAX);
        };
        let ctx = self.ctx.clone();
        let output = ctx.run_ui(input, |ui| self.ui(ui));
        self.act(&ctx);
        self.settle();
        self.draw_picture();
        self.paint(&ctx, output.shapes, output.pixels_per_point, output.textures_delta, canvas);
        if self.animated {
            ctx.request_repaint();
        }
        let root = output.viewport_output.get(&egui::ViewportId::ROOT);
        let repaint_after = if self.animated {
            Duration::ZERO
        } else {
            root.map_or(Duration::MAX, |viewport| viewport.repaint_delay)
        };
        self.outcome(output.platform_output, repaint_after)
    }

    fn outcome(&mut self, platform: egui::PlatformOutput, repaint_after: Duration) -> Outcome {
        self.check();
        let name = self.stage.as_ref().map(|stage| stage.name.as_str());
        Outcome {
            platform,
            repaint_after,
            title: name.map_or("chiaro".into(), |name| format!("{name} – chiaro")),
            grabs_mouse: self.panel.grabs_mouse,
            vsync: self.panel.vsync,
            fullscreen: self.panel.fullscreen,
            lost: self.lost.clone(),
        }
    }

    /// Hears what the device has to say.
    fn check(&mut self) {
        match self.gpu.check() {
            Ok(()) => {}
            Err(GpuError::DeviceLost(reason)) => self.lost = Some(reason),
            Err(error) => self.notices.fail(error.to_string()),
        }
    }

    fn take_reports(&mut self) {
        while let Some(report) = self.jobs.poll() {
            match report {
                Report::Started(Ok((engine, stage))) => {
                    self.engine = Some(*engine);
                    let asked = self.loading.clone().filter(|asked| *asked != self.source);
                    match (asked, stage) {
                        // Something else was dropped onto the window meanwhile.
                        (Some(source), _) => self.load(&source),
                        (None, Ok(stage)) => self.incoming = Some(stage),
                        (None, Err(error)) => {
                            self.loading = None;
                            self.notices.fail(error);
                        }
                    }
                }
                Report::Started(Err(error)) => {
                    self.notices.fail(error);
                    if self.wanted == Settings::default() {
                        self.loading = None;
                    } else {
                        self.wanted = Settings::default();
                        let request = self.request(&self.source);
                        start(&mut self.jobs, &self.gpu, &self.wanted, request);
                    }
                }
                Report::Loaded(Ok(stage)) => self.incoming = Some(stage),
                Report::Loaded(Err(error)) => {
                    self.loading = None;
                    self.notices.fail(error);
                }
                Report::Grown(trees, scene) => {
                    self.growing = false;
                    match trees {
                        Ok(trees) => self.grown = Some((trees, scene)),
                        Err(error) => {
                            self.panel.settings_error = Some(error);
                            self.wanted.shadow.layout = ShadowSettings::default().layout;
                            if self.wanted.indirect.technique == Technique::Traced {
                                self.wanted.indirect.technique = IndirectSettings::default().technique;
                            }
                        }
                    }
                }
                Report::Strewn(points, scene) => {
                    self.strewing = false;
                    self.strewn = Some((points, scene));
                }
                Report::Written(Ok(names)) => self.notices.tell(format!("wrote {names}")),
                Report::Written(Err(error)) => self.notices.fail(error),
                Report::Rebuilt(Err(error), Purpose::Shaders) => {
                    self.building = false;
                    self.panel.shader_error = Some(error);
                }
                Report::Rebuilt(Ok(rebuilt), purpose) => {
                    self.building = false;
                    if purpose == Purpose::Shaders {
                        self.panel.shader_error = None;
                        self.truth.shaders_changed();
                    }
                    if let Some(engine) = &mut self.engine {
                        // One that is out of date is planned again by `settle`.
                        engine.install(*rebuilt);
                    }
                }
                Report::Rebuilt(Err(error), Purpose::Settings) => {
                    self.building = false;
                    self.panel.settings_error = Some(error);
                    self.incoming = None;
                    self.loading = None;
                    if let Some(engine) = &self.engine {
                        self.wanted = engine.renderer.settings().clone();
                    }
                }
            }
        }
    }

    /// The scene that is to be shown next.
    fn coming(&mut self) -> Option<&mut Stage> {
        self.incoming.as_deref_mut().or(self.stage.as_mut())
    }

    /// Has trees built for rays, where settings ask for some and the scene has none, or others are due; whether it lacks
    /// any.
    fn grow(&mut self) -> bool {
        // Another scene may have come since they were begun.
        let grown = self.grown.take();
        let is_due = |of: &Arc<Scene>, stage: &Stage| Arc::ptr_eq(&stage.scene, of);
        self.grown = grown.filter(|(_, of)| self.coming().is_some_and(|stage| is_due(of, stage)));
        let (busy, wanted) = (self.growing || self.grown.is_some(), self.wanted.clone());
        let Some(stage) = self.coming() else { return false };
        let lacks = stage.loaded.lacks_trees(&wanted);
        if !busy && (lacks || stage.loaded.trees_are_due()) {
            let (scene, pose, moved) = (stage.scene.clone(), stage.pose.clone(), stage.loaded.moved());
            let gpu = self.gpu.clone();
            self.growing = true;
            self.jobs.start(move || {
                let trees = Trees::build(&gpu, &scene, &pose, &moved);
                Report::Grown(trees.map(Box::new).map_err(|e| e.to_string()), scene)
            });
        }
        lacks && self.grown.is_none()
    }

    /// Has points built for imperfect shadow maps, where settings ask for some that the scene does not have, or others would
    /// serve the view better; whether it lacks any.
    fn strew(&mut self) -> bool {
        let strewn = self.strewn.take();
        let (busy, wanted) = (self.strewing, self.wanted.clone());
        let view = self.view();
        if let (Some(view), Some(stage)) = (view, &mut self.stage) {
            stage.loaded.look_from(view.eye_ws());
        }
        let Some(options) = wanted.points() else { return false };
        let Some(stage) = self.coming() else { return false };
        let lacks = stage.loaded.lacks_points(&wanted);
        let wants = lacks || stage.loaded.points_are_due();
        // Another scene may have come since they were begun, or others be wanted.
        let serves = |(points, of): &(Box<PointData>, Arc<Scene>)| {
            Arc::ptr_eq(&stage.scene, of) && *points.options() == options
        };
        let strewn = strewn.filter(|strewn| wants && serves(strewn));
        if wants
            && strewn.is_none()
            && !busy
            && let Some(choose) = stage.loaded.choose_points(&wanted)
        {
            let (scene, pose) = (stage.scene.clone(), stage.pose.clone());
            self.strewing = true;
            self.jobs.start(move || Report::Strewn(Box::new(choose(&scene, &pose)), scene));
        }
        self.strewn = strewn;
        lacks && self.strewn.is_none()
    }

    /// Brings settings and the scene into force as far as that needs no compiling, and has the rest compiled.
    fn settle(&mut self) {
        if self.engine.is_some() {
            // Both at once.
            let lacks = [self.grow(), self.strew()];
            if lacks.contains(&true) {
                return self.apply_what_is_free();
            }
        }
        let facts = self.coming().map(|stage| stage.loaded.gpu.facts).unwrap_or_default();
        let facts = self.grown.as_ref().map_or(facts, |(trees, _)| trees.facts(facts));
        let Some(engine) = &mut self.engine else { return };
        let is_settled = self.incoming.is_none() && self.grown.is_none() && self.strewn.is_none();
        if is_settled && *engine.renderer.settings() == self.wanted {
            return;
        }
        let plan = match engine.renderer.plan(self.wanted.clone(), facts) {
            Ok(plan) => plan,
            Err(error) => {
                self.panel.settings_error = Some(error.to_string());
                self.wanted = engine.renderer.settings().clone();
                return;
            }
        };
        let known = engine.renderer.permutations();
        if plan.is_empty() && plan.permutations() == known {
            match Rebuilt::new(plan, known, false) {
                Ok(nothing) => engine.install(nothing),
                Err(_) => return,
            };
            if let Some((trees, scene)) = self.grown.take()
                && let Some(stage) = self.coming()
                && let Err(error) = stage.loaded.give_trees(&scene, *trees)
            {
                self.notices.fail(error.to_string());
            }
            if let Some((points, _)) = self.strewn.take()
                && let Some(stage) = self.coming()
            {
                stage.loaded.give_points(*points);
            }
            if let Some(stage) = self.incoming.take() {
                self.show(*stage);
            }
            return;
        }
        if !self.building {
            self.building = true;
            self.jobs.start(move || {
                let rebuilt = Rebuilt::new(plan, known, false).map(Box::new).map_err(|e| e.to_string());
                Report::Rebuilt(rebuilt, Purpose::Settings)
            });
        }
        self.apply_what_is_free();
    }

    /// Has changed shaders compiled; until that is done, and where it fails, the last good ones stay.
    fn take_shaders(&mut self) {
        if let Some(changed) = self.shader_files.as_mut().and_then(ShaderFiles::poll) {
            self.shaders = Some(changed);
        }
        if self.building || self.incoming.is_some() {
            return;
        }
        if let (Some(engine), Some(library)) = (&self.engine, self.shaders.take_if(|_| self.engine.is_some()))
        {
            let (plan, known) = (engine.renderer.plan_shaders(library), engine.renderer.permutations());
            self.building = true;
            self.jobs.start(move || {
                let rebuilt = Rebuilt::new(plan, known, true).map(Box::new).map_err(|e| e.to_string());
                Report::Rebuilt(rebuilt, Purpose::Shaders)
            });
        }
    }

    /// Starts reading back the picture, to be written when it has arrived.
    pub fn screenshot(&mut self, exr: bool) {
        match self.picture.read(self.panel.shown_buffer, self.truth.sum()) {
            Some(Ok(shot)) => self.shot = Some((shot, files::Wanted { exr })),
            Some(Err(error)) => self.notices.fail(error.to_string()),
            None => {}
        }
    }

    fn take_shot(&mut self) {
        let Some((shot, wanted)) = &self.shot else { return };
        let wanted = *wanted;
        match shot.poll(&self.gpu) {
            Ok(None) => self.ctx.request_repaint(),
            Ok(Some(pair)) => {
                self.shot = None;
                let name = self.stage.as_ref().map_or("picture".into(), |stage| stage.name.clone());
                self.jobs.start(move || {
                    Report::Written(files::write(&name, &pair, wanted).map_err(|e| e.to_string()))
                });
            }
            Err(error) => {
                self.shot = None;
                self.notices.fail(error.to_string());
            }
        }
    }

    /// While pipelines are compiled, the settings that need none change at once.
    fn apply_what_is_free(&mut self) {
        let Some(engine) = &mut self.engine else { return };
        let mut free = engine.renderer.settings().clone();
        let points = free.points();
        let had = (free.seed, free.indirect.points);
        free.pipeline = self.wanted.pipeline;
        free.seed = self.wanted.seed;
        for field in Settings::fields().iter().filter(|f| f.effect != chiaro::Effect::Permutation) {
            if let Some(value) = self.wanted.get(&field.key) {
                // It was in range where it comes from.
                let _ = free.set(&field.key, &value);
            }
        }
        if free.points() != points {
            // What is shown goes on with the points that it has.
            (free.seed, free.indirect.points) = had;
        }
        if free == *engine.renderer.settings() {
            return;
        }
        let known = engine.renderer.permutations();
        if let Ok(plan) = engine.renderer.plan(free, chiaro::techniques::scene::SceneFacts::default())
            && plan.is_empty()
            && plan.permutations() == known
            && let Ok(nothing) = Rebuilt::new(plan, known, false)
        {
            engine.install(nothing);
        }
    }

    /// Puts a scene on show.
    fn show(&mut self, stage: Stage) {
        self.loading = None;
        for warning in &stage.scene.warnings {
            self.notices.tell(format!("{}: {warning}", stage.name));
        }
        self.speed = stage.size_m() * 0.1;
        self.playback = Playback { speed: self.playback.speed, ..Playback::default() };
        self.eye = match std::mem::take(&mut self.start) {
            StartCamera::First => Eye::Placed(0),
            StartCamera::At(view) => Eye::Free(FlyCamera::new(view)),
            StartCamera::From(lookout) => Eye::Free(FlyCamera::new(lookout.view(&stage.scene))),
            StartCamera::Named(wanted) => {
                let by_name = stage.cameras.iter().position(|name| *name == wanted);
                let by_number = || wanted.parse().ok().filter(|n| *n < stage.cameras.len());
                let found = by_name.or_else(by_number);
                if found.is_none() {
                    let list: Vec<_> =
                        stage.cameras.iter().enumerate().map(|(n, name)| format!("{n} “{name}”")).collect();
                    self.notices.fail(format!("no camera {wanted}; the scene has {}", list.join(", ")));
                }
                Eye::Placed(found.unwrap_or(0))
            }
        };
        self.source.clone_from(&stage.source);
        self.stage = Some(stage);
    }

    /// What is seen.
    pub(crate) fn view(&self) -> Option<View> {
        match self.eye {
            Eye::Free(camera) => Some(camera.view()),
            Eye::Placed(number) => {
                let stage = self.stage.as_ref()?;
                stage.view(number).or_else(|| stage.view(0))
            }
        }
    }

    /// Renders the scene into the picture where that would change it.
    fn draw_picture(&mut self) {
        self.animated = false;
        let (Some(view), Some(size_px)) = (self.view(), self.panel.picture_px) else { return };
        let (Some(engine), Some(stage)) = (&mut self.engine, &mut self.stage) else { return };
        if self.picture.resize(size_px) {
            engine.renderer.trim();
            let view = self.picture.texture().map(chiaro::Texture::view);
            self.picture_id = view.map(|view| offer(&mut self.painter, &self.gpu, view, self.picture_id));
        }
        let shown = self.panel.shown_buffer;
        if self.picture.show_buffer(shown.place) || (shown.place != Place::Off && self.buffer_id.is_none()) {
            let view = self.picture.buffer_texture().map(chiaro::Texture::view);
            self.buffer_id = view.map(|view| offer(&mut self.painter, &self.gpu, view, self.buffer_id));
        }
        let now = (self.playback.time_s, shown);
        let compare = self.panel.compare;
        let draws = self.picture.wants_frame(engine, stage, &view, now);
        self.truth.settle(engine, stage, compare != Compare::Off);
        if compare != Compare::Off {
            self.truth.aim(engine.renderer.settings(), stage, (&view, size_px));
        }
        let wanted = compare != Compare::Off && self.truth.wants_samples();
        let refines = wanted && self.truth.is_ready(self.picture.moves());
        // At rest the two take turns: a slow frame would starve the truth.
        let waits = wanted && !self.picture.moves() && self.truth.samples() < self.picture.frames();
        let draws = draws && !waits || self.panel.continuous;
        let shows = |truth: &Truth| {
            let first_column = compare.first_column(self.panel.divider, size_px[0])?;
            Some(Shows { first_column, samples: truth.sum()?.frames })
        };
        self.animated = draws || refines;
        if !draws && !refines && shows(&self.truth) == self.picture.truth() {
            if wanted {
                self.ctx.request_repaint_after(GPU_BUSY);
            }
            return;
        }
        let mut frame = self.recorder.begin();
        if draws {
            match self.picture.record(&mut frame, engine, (stage, &view), shown) {
                Ok(()) if self.drew == *engine.renderer.settings() => {}
                Ok(()) => self.drew.clone_from(engine.renderer.settings()),
                // Comes, or is compiled.
                Err(Error::NoTrees | Error::NoPoints | Error::NoPasses) => {}
                Err(error) => {
                    self.panel.settings_error = Some(error.to_string());
                    self.wanted.clone_from(&self.drew);
                }
            }
        }
        if refines {
            self.truth.record(&mut frame, stage);
        }
        let shown_truth = shows(&self.truth);
        if shown_truth != self.picture.truth() {
            self.picture.show_truth(&mut frame, engine, self.truth.sum().zip(shown_truth));
        }
        frame.submit();
        if refines {
            self.truth.submitted(!draws);
        }
        for timings in self.recorder.take_timings() {
            self.timings.gpu_took(&timings);
        }
        self.timings.frame_took(f64::from(self.ctx.input(|i| i.unstable_dt)) * 1e3);
        if draws {
            self.panel.notes = self.picture.notes().to_vec();
        }
    }

    /// Paints the window's content.
    fn paint(
        &mut self,
        ctx: &egui::Context,
        shapes: Vec<egui::epaint::ClippedShape>,
        pixels_per_point: f32,
        mut textures: egui::TexturesDelta,
        canvas: Canvas<'_>,
    ) {
        let Gpu { device, queue, .. } = &self.gpu;
        for (id, deltas) in &textures.set {
            deltas.iter().for_each(|delta| self.painter.update_texture(device, queue, *id, delta));
        }
        let primitives = ctx.tessellate(shapes, pixels_per_point);
        let screen = ScreenDescriptor { size_in_pixels: canvas.size_px, pixels_per_point };
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("window") });
        let mut commands = self.painter.update_buffers(device, queue, &mut encoder, &primitives, &screen);
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: canvas.view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            self.painter.render(&mut pass.forget_lifetime(), &primitives, &screen);
        }
        commands.push(encoder.finish());
        queue.submit(commands);
        for id in &textures.free {
            self.painter.free_texture(id);
        }
        textures.clear();
    }
}
