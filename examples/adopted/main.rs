//! Whole frames of chiaro in a program that has a window, a device and a camera of its own.
//!
//! `cargo run --release -p chiaro-examples --bin adopted` turns around a scene in a window, and
//! `… --bin adopted -- picture.png` draws one frame of it without one.

use std::sync::Arc;
use std::time::Instant;

use chiaro::wgpu::{self, TextureFormat, TextureUsages};
use chiaro::{Canvas, Depth, Gpu, LoadedScene, Readback, Renderer, Settings, Texture, View, scene};
use glam::{Mat4, Vec3, camera::rh};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop, OwnedDisplayHandle};
use winit::window::{Window, WindowAttributes, WindowId};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result<()> {
    if let Some(path) = std::env::args().nth(1) {
        return Ok(chiaro_image::write_png(&path, &picture([960, 540])?)?);
    }
    let mut program = Program { window: None };
    Ok(EventLoop::new()?.run_app(&mut program)?)
}

/// What chiaro is to the program.
struct Chiaro {
    renderer: Renderer,
    scene: LoadedScene,
    canvas: Canvas,
}

impl Chiaro {
    fn new(
        adapter: &wgpu::Adapter,
        (device, queue): (wgpu::Device, wgpu::Queue),
        format: TextureFormat,
    ) -> Result<Self> {
        let gpu = Gpu::adopt(adapter, device, queue)?;
        let mut ball = scene::load("builtin:ball")?;
        ball.add_default_view();
        let (renderer, scene) = Renderer::with_scene(&gpu, Settings::default(), &ball)?;
        let canvas = Canvas::new(&renderer, format)?;
        Ok(Self { renderer, scene, canvas })
    }

    /// Draws with the program's camera, `turn_rad` around the scene.
    fn draw(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        turn_rad: f32,
    ) -> Result<()> {
        let aspect = target.texture().width() as f32 / target.texture().height() as f32;
        let (lo, hi) = self.scene.gpu.bounds_ws;
        let away =
            (hi - lo).length() * (Mat4::from_rotation_y(turn_rad) * Vec3::new(0.0, 0.35, 0.6).extend(0.0));
        let middle = 0.5 * (lo + hi);
        let view_from_world = rh::view::look_at_mat4(middle + away.truncate(), middle, Vec3::Y);
        let clip_from_view = rh::proj::directx::perspective(0.8, aspect, 0.01, 1000.0);
        let view = View::from_matrices(view_from_world, clip_from_view, Depth::Standard)?;
        Ok(self.canvas.record(&self.renderer, (&self.scene, &view), encoder, target)?)
    }
}

/// The program's device, with its own way with errors, which stays.
fn open(adapter: &wgpu::Adapter) -> Result<(wgpu::Device, wgpu::Queue)> {
    let descriptor = wgpu::DeviceDescriptor { required_limits: Gpu::required_limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
    device.on_uncaptured_error(Arc::new(|error: wgpu::Error| panic!("{error}")));
    Ok((device, queue))
}

struct Program {
    window: Option<Shown>,
}

struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    chiaro: Chiaro,
    start: Instant,
}

impl Shown {
    fn new(window: Arc<Window>, display: OwnedDisplayHandle) -> Result<Self> {
        let descriptor = wgpu::InstanceDescriptor::new_with_display_handle(Box::new(display));
        let instance = wgpu::Instance::new(descriptor.with_env());
        let surface = instance.create_surface(window.clone())?;
        let options =
            wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&options))?;
        let (device, queue) = open(&adapter)?;
        let size = window.inner_size();
        let config = surface.get_default_config(&adapter, size.width.max(1), size.height.max(1));
        let config = config.ok_or("the adapter cannot present to this window")?;
        surface.configure(&device, &config);
        let chiaro = Chiaro::new(&adapter, (device.clone(), queue.clone()), config.format)?;
        Ok(Self { window, surface, config, device, queue, chiaro, start: Instant::now() })
    }

    fn draw(&mut self) -> Result<()> {
        use wgpu::CurrentSurfaceTexture::{Suboptimal, Success};
        let (Success(texture) | Suboptimal(texture)) = self.surface.get_current_texture() else {
            self.surface.configure(&self.device, &self.config);
            return Ok(());
        };
        let target = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.chiaro.draw(&mut encoder, &target, 0.3 * self.start.elapsed().as_secs_f32())?;
        self.queue.submit([encoder.finish()]);
        self.window.pre_present_notify();
        self.queue.present(texture);
        Ok(())
    }
}

impl ApplicationHandler for Program {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let shown = || -> Result<Shown> {
            let window = events.create_window(WindowAttributes::default().with_title("adopted"))?;
            Shown::new(Arc::new(window), events.owned_display_handle())
        };
        match shown() {
            Ok(shown) => self.window = Some(shown),
            Err(error) => {
                eprintln!("{error}");
                events.exit();
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.window else { return };
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::Resized(size) if size.width > 0 && size.height > 0 => {
                (shown.config.width, shown.config.height) = (size.width, size.height);
                shown.surface.configure(&shown.device, &shown.config);
            }
            WindowEvent::RedrawRequested => {
                if let Err(error) = shown.draw() {
                    eprintln!("{error}");
                    events.exit();
                }
                shown.window.request_redraw();
            }
            _ => {}
        }
    }
}

/// One frame without a window.
fn picture([width, height]: [u32; 2]) -> Result<chiaro_image::Picture> {
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let instance = wgpu::Instance::new(descriptor.with_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = open(&adapter)?;
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Rgba8UnormSrgb,
        usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let target = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let mut chiaro = Chiaro::new(&adapter, (device.clone(), queue.clone()), texture.format())?;
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    chiaro.draw(&mut encoder, &target, 0.5)?;
    queue.submit([encoder.finish()]);
    let gpu = chiaro.renderer.gpu();
    let pixels = Readback::start(gpu, &Texture::of_host("picture", &target, texture.format()))?.wait(gpu)?;
    let rgb = pixels.bytes.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
    Ok(chiaro_image::Picture::from_bytes(width, height, rgb)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_shows_the_scene() {
        let picture = picture([64, 36]).unwrap();
        let levels: Vec<u8> = picture.bytes().chunks_exact(3).map(|rgb| rgb[1]).collect();
        let bright = levels.iter().filter(|&&level| level > 120).count();
        let dark = levels.iter().filter(|&&level| level < 60).count();
        assert!(bright > 100 && dark > 20, "{bright} pixels are bright, {dark} dark");
    }
}
