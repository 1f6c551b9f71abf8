//! What stands in for the window and its user.

use std::time::{Duration, Instant};

use chiaro::{Pixels, Readback, wgpu};
use chiaro_testkit::{TestGpu, ambient, device_of_its_own};
use chiaro_viewer::{Canvas, Options, Viewer};
use egui::{Event, Key, Modifiers};

/// The sample size keeps a software rasteriser quick.
pub const SIZE: [u32; 2] = [480, 130];
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Bgra8Unorm;
/// Compiling on a busy machine; a viewer that has not settled by then never will.
const PATIENCE: Duration = Duration::from_mins(2);

/// A viewer, its canvas and its clock.
pub struct Driver {
    pub viewer: Viewer,
    pub gpu: TestGpu,
    pub size: [u32; 2],
    pub cursor: egui::CursorIcon,
    time_s: f64,
    pipelines_before: u64,
}

impl Driver {
    pub fn new(options: Options) -> Self {
        let gpu = device_of_its_own();
        let pipelines_before = gpu.created.pipelines_here();
        let viewer = Viewer::new(&gpu, FORMAT, options);
        let cursor = egui::CursorIcon::Default;
        Self { viewer, gpu, size: SIZE, cursor, time_s: 0.0, pipelines_before }
    }

    pub fn cornell() -> Self {
        let mut driver =
            Self::new(Options { scene: "builtin:cornell".into(), settings: ambient(), ..Options::default() });
        driver.settle();
        driver
    }

    /// One frame with these events, and the check that it found nothing to complain about.
    pub fn frame(&mut self, events: Vec<Event>) {
        self.time_s += 1.0 / 60.0;
        let [width, height] = self.size;
        let mut input = egui::RawInput {
            screen_rect: Some(egui::Rect::from_min_size(
                egui::Pos2::ZERO,
                egui::vec2(width as f32, height as f32),
            )),
            time: Some(self.time_s),
            focused: true,
            events,
            ..Default::default()
        };
        input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(1.0);
        let outcome = if width == 0 || height == 0 {
            self.viewer.frame(input, None)
        } else {
            let texture = self.gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("canvas"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            self.viewer.frame(input, Some(Canvas { view: &view, size_px: self.size }))
        };
        assert_eq!(outcome.lost, None);
        self.cursor = outcome.platform.cursor_icon;
        let complaints: Vec<_> =
            self.viewer.messages().filter(|text| text.contains("the GPU reported")).collect();
        assert!(complaints.is_empty(), "{complaints:?}");
        assert_eq!(
            self.gpu.created.pipelines_here(),
            self.pipelines_before,
            "a pipeline was built on the frame's own thread"
        );
    }

    pub fn press(&mut self, key: Key) {
        for pressed in [true, false] {
            let event =
                Event::Key { key, physical_key: None, pressed, repeat: false, modifiers: Modifiers::NONE };
            self.frame(vec![event]);
        }
    }

    /// Frames until nothing is being compiled or loaded.
    pub fn settle(&mut self) {
        self.until("settled", Viewer::is_settled);
    }

    pub fn until(&mut self, what: &str, done: impl Fn(&Viewer) -> bool) {
        let start = Instant::now();
        loop {
            self.frame(Vec::new());
            if done(&self.viewer) {
                return;
            }
            let messages: Vec<_> = self.viewer.messages().collect();
            assert!(start.elapsed() < PATIENCE, "never {what}: {messages:?}");
            if !self.viewer.is_settled() {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }

    /// The picture that has come to rest.
    pub fn picture(&mut self) -> Pixels {
        self.until("at rest", |viewer| viewer.frames() >= 64);
        let texture = self.viewer.picture().expect("a scene is on show");
        Readback::start(&self.gpu, texture).unwrap().wait(&self.gpu).unwrap()
    }
}

pub fn mean(pixels: &Pixels) -> f64 {
    let colours = pixels.bytes.chunks_exact(4).map(|p| f64::from(p[0]) + f64::from(p[1]) + f64::from(p[2]));
    colours.sum::<f64>() / (3.0 * f64::from(pixels.width * pixels.height))
}
