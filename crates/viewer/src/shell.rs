//! The window: winit's events in, frames out.

use std::sync::Arc;
use std::time::Duration;

use chiaro::{Gpu, GpuOptions, wgpu};
use web_time::Instant;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{DeviceEvent, DeviceId, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, EventLoopProxy};
use winit::window::{CursorGrabMode, Fullscreen, Window, WindowId};

use crate::ViewerError;
use crate::viewer::{Canvas, Options, Outcome, Viewer};

/// Opens a window on a scene and runs until it is closed.
///
/// # Errors
/// When there is no display or no device, or a lost device cannot be opened again.
pub fn run(options: Options) -> Result<(), ViewerError> {
    let event_loop = EventLoop::with_user_event().build().map_err(|e| no_display(&e))?;
    let mut shell = Shell::new(&event_loop, options);
    event_loop.run_app(&mut shell).map_err(|e| no_display(&e))?;
    shell.error.map_or(Ok(()), Err)
}

/// winit's reason, without the place in winit's source that it begins with.
fn no_display(error: &dyn std::error::Error) -> ViewerError {
    let text = error.to_string();
    let reason = text.split_once(": ").map_or(text.as_str(), |(_, reason)| reason);
    ViewerError::NoDisplay(reason.trim_end_matches('.').to_owned())
}

/// What wakes a waiting event loop.
#[derive(Debug)]
pub enum Wake {
    /// A frame is due in so long.
    Repaint(Duration),
    /// The browser has given a device, or has not.
    #[cfg(target_arch = "wasm32")]
    Opened(std::rc::Rc<std::cell::RefCell<Option<Result<Open, ViewerError>>>>),
}

/// A device lost more often than this is not going to stay.
const MAX_LOSSES: u32 = 3;
/// When a frame cannot be had, the next try is so far away.
const RETRY: Duration = Duration::from_millis(50);

/// The viewer in its window, as winit drives it.
#[derive(Debug)]
pub struct Shell {
    options: Options,
    proxy: EventLoopProxy<Wake>,
    window: Option<Arc<Window>>,
    open: Option<Open>,
    losses: u32,
    /// Why the event loop ended, when it was not the user.
    pub error: Option<ViewerError>,
}

/// A window that can be drawn to.
pub struct Open {
    window: Arc<Window>,
    instance: wgpu::Instance,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    viewer: Viewer,
    input: egui_winit::State,
    next: Option<Instant>,
    shown: Shown,
}

/// What was last asked of the window.
#[derive(Debug, Default, PartialEq)]
struct Shown {
    title: String,
    grabs_mouse: bool,
    fullscreen: bool,
    vsync: bool,
}

impl std::fmt::Debug for Open {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Open").field("viewer", &self.viewer).finish_non_exhaustive()
    }
}

impl Shell {
    /// A shell that opens its window once the event loop runs.
    pub fn new(event_loop: &EventLoop<Wake>, options: Options) -> Self {
        let proxy = event_loop.create_proxy();
        Self { options, proxy, window: None, open: None, losses: 0, error: None }
    }

    /// The viewer, once its window is open.
    pub fn viewer(&mut self) -> Option<&mut Viewer> {
        self.open.as_mut().map(|open| &mut open.viewer)
    }

    /// The window, once it is open.
    pub fn window(&self) -> Option<&Window> {
        self.window.as_deref()
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewerError) {
        self.error = Some(error);
        event_loop.exit();
    }

    /// Opens the device and puts a viewer on it.
    #[cfg(not(target_arch = "wasm32"))]
    fn start(&mut self, event_loop: &ActiveEventLoop, window: Arc<Window>) {
        let opening =
            Open::new(window, event_loop.owned_display_handle(), self.options.clone(), self.proxy.clone());
        match pollster::block_on(opening) {
            Ok(open) => self.open = Some(open),
            Err(error) => self.fail(event_loop, error),
        }
    }

    /// Opens the device and puts a viewer on it, once the browser has one.
    #[cfg(target_arch = "wasm32")]
    fn start(&mut self, event_loop: &ActiveEventLoop, window: Arc<Window>) {
        let proxy = self.proxy.clone();
        let opening =
            Open::new(window, event_loop.owned_display_handle(), self.options.clone(), self.proxy.clone());
        wasm_bindgen_futures::spawn_local(async move {
            let slot = std::rc::Rc::new(std::cell::RefCell::new(Some(opening.await)));
            // Fails only when the page is being left.
            let _ = proxy.send_event(Wake::Opened(slot));
        });
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        let Some(reason) = open.draw() else { return };
        self.losses += 1;
        if self.losses > MAX_LOSSES {
            self.fail(event_loop, chiaro::GpuError::DeviceLost(reason).into());
            return;
        }
        self.options = open.viewer.memory();
        let window = open.window.clone();
        self.open = None;
        self.start(event_loop, window);
        if let Some(open) = &mut self.open {
            open.viewer.tell(format!(
                "The graphics device was lost ({reason}) and has been opened again. If this goes on, close other \
                 programs that use it, or update its driver."
            ));
        }
    }
}

impl ApplicationHandler<Wake> for Shell {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let [width, height] = self.options.size;
        let attributes = Window::default_attributes()
            .with_title("chiaro")
            .with_inner_size(PhysicalSize::new(width, height));
        match event_loop.create_window(attributes) {
            Ok(window) => {
                let window = Arc::new(window);
                self.window = Some(window.clone());
                self.start(event_loop, window);
            }
            Err(error) => self.fail(event_loop, no_display(&error)),
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, wake: Wake) {
        match wake {
            Wake::Repaint(after) => {
                if let Some(open) = &mut self.open {
                    open.redraw_after(after);
                }
            }
            #[cfg(target_arch = "wasm32")]
            Wake::Opened(slot) => match slot.borrow_mut().take() {
                Some(Ok(open)) => self.open = Some(open),
                Some(Err(error)) => {
                    tracing::error!("{error}");
                    self.error = Some(error);
                }
                None => {}
            },
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        if event == WindowEvent::CloseRequested {
            event_loop.exit();
            return;
        }
        if event == WindowEvent::RedrawRequested {
            self.draw(event_loop);
            return;
        }
        let Some(open) = &mut self.open else { return };
        match &event {
            WindowEvent::Resized(size) => open.resize(*size),
            WindowEvent::DroppedFile(path) => open.viewer.open(&path.to_string_lossy()),
            _ => {}
        }
        if open.input.on_window_event(&open.window, &event).repaint {
            open.redraw_after(Duration::ZERO);
        }
    }

    fn device_event(&mut self, _: &ActiveEventLoop, _: DeviceId, event: DeviceEvent) {
        if let (Some(open), DeviceEvent::MouseMotion { delta }) = (&mut self.open, event)
            && open.shown.grabs_mouse
            && open.input.on_mouse_motion(delta)
        {
            open.redraw_after(Duration::ZERO);
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let Some(open) = &mut self.open else { return };
        match open.next {
            Some(next) if next <= Instant::now() => {
                open.next = None;
                open.window.request_redraw();
                event_loop.set_control_flow(ControlFlow::Wait);
            }
            Some(next) => event_loop.set_control_flow(ControlFlow::WaitUntil(next)),
            None => event_loop.set_control_flow(ControlFlow::Wait),
        }
    }
}

impl Open {
    async fn new(
        window: Arc<Window>,
        display: winit::event_loop::OwnedDisplayHandle,
        options: Options,
        proxy: EventLoopProxy<Wake>,
    ) -> Result<Self, ViewerError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(Box::new(display));
        descriptor.backends = wgpu::Backends::PRIMARY;
        let instance = wgpu::Instance::new(descriptor.with_env());
        let fail = |error: wgpu::CreateSurfaceError| ViewerError::Surface(error.to_string());
        let surface = instance.create_surface(window.clone()).map_err(fail)?;
        let (gpu, adapter) = Gpu::for_surface(&instance, &surface, GpuOptions::default()).await?;
        let size = window.inner_size();
        let mut config = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| ViewerError::Surface(format!("{} cannot present to it", gpu.info.name)))?;
        // egui blends sRGB values as they are.
        let plain = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];
        let formats = surface.get_capabilities(&adapter).formats;
        if let Some(format) = formats.into_iter().find(|format| plain.contains(format)) {
            config.format = format;
        }
        surface.configure(&gpu.device, &config);
        let viewer = Viewer::new(&gpu, config.format, options);
        let context = viewer.context().clone();
        context.set_request_repaint_callback(move |info| {
            // Fails only after the event loop has ended.
            let _ = proxy.send_event(Wake::Repaint(info.delay));
        });
        let side = gpu.limits.max_texture_dimension_2d as usize;
        let scale = Some(window.scale_factor() as f32);
        let input = egui_winit::State::new(
            context,
            egui::ViewportId::ROOT,
            &window,
            scale,
            window.theme(),
            Some(side),
        );
        let next = Some(Instant::now());
        let shown = Shown { vsync: true, ..Shown::default() };
        Ok(Self { window, instance, surface, config, gpu, viewer, input, next, shown })
    }

    fn redraw_after(&mut self, after: Duration) {
        // `None` is further away than clocks reach.
        let Some(due) = Instant::now().checked_add(after) else { return };
        self.next = Some(self.next.map_or(due, |next| next.min(due)));
    }

    fn resize(&mut self, size: PhysicalSize<u32>) {
        let limit = self.gpu.limits.max_texture_dimension_2d;
        // A minimised window has no size.
        if size.width > 0 && size.height > 0 {
            (self.config.width, self.config.height) = (size.width.min(limit), size.height.min(limit));
            self.surface.configure(&self.gpu.device, &self.config);
        }
        self.redraw_after(Duration::ZERO);
    }

    /// Draws and presents a frame. Says why when the device is gone.
    fn draw(&mut self) -> Option<String> {
        let size = self.window.inner_size();
        if size.width == 0 || size.height == 0 {
            return self.viewer.frame(egui::RawInput::default(), None).lost;
        }
        let texture = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture)
            | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => texture,
            missed => return self.missed(&missed),
        };
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let input = self.input.take_egui_input(&self.window);
        let size_px = [self.config.width, self.config.height];
        let outcome = self.viewer.frame(input, Some(Canvas { view: &view, size_px }));
        self.window.pre_present_notify();
        self.gpu.queue.present(texture);
        self.obey(outcome)
    }

    /// No texture to draw to: what helps, and when to try again.
    fn missed(&mut self, missed: &wgpu::CurrentSurfaceTexture) -> Option<String> {
        match missed {
            wgpu::CurrentSurfaceTexture::Lost => match self.instance.create_surface(self.window.clone()) {
                Ok(surface) => {
                    self.surface = surface;
                    self.surface.configure(&self.gpu.device, &self.config);
                }
                Err(error) => return Some(error.to_string()),
            },
            wgpu::CurrentSurfaceTexture::Outdated => self.surface.configure(&self.gpu.device, &self.config),
            _ => {}
        }
        self.redraw_after(RETRY);
        self.viewer.frame(egui::RawInput::default(), None).lost
    }

    fn obey(&mut self, outcome: Outcome) -> Option<String> {
        self.input.handle_platform_output(&self.window, outcome.platform);
        self.redraw_after(outcome.repaint_after);
        let wanted = Shown {
            title: outcome.title,
            grabs_mouse: outcome.grabs_mouse,
            fullscreen: outcome.fullscreen,
            vsync: outcome.vsync,
        };
        if wanted.title != self.shown.title {
            self.window.set_title(&wanted.title);
        }
        if wanted.grabs_mouse != self.shown.grabs_mouse {
            let window = &self.window;
            window.set_cursor_visible(!wanted.grabs_mouse);
            let grabbed = if wanted.grabs_mouse {
                let locked = window.set_cursor_grab(CursorGrabMode::Locked);
                // X11 only confines.
                locked.or_else(|_| window.set_cursor_grab(CursorGrabMode::Confined))
            } else {
                window.set_cursor_grab(CursorGrabMode::None)
            };
            if let Err(error) = grabbed {
                tracing::warn!("the mouse cannot be held: {error}");
            }
        }
        if wanted.fullscreen != self.shown.fullscreen {
            self.window.set_fullscreen(wanted.fullscreen.then_some(Fullscreen::Borderless(None)));
        }
        if wanted.vsync != self.shown.vsync {
            self.config.present_mode =
                if wanted.vsync { wgpu::PresentMode::AutoVsync } else { wgpu::PresentMode::AutoNoVsync };
            self.surface.configure(&self.gpu.device, &self.config);
        }
        self.shown = wanted;
        outcome.lost
    }
}
