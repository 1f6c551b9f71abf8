//! Real-time shadows, indirect light and caustics on wgpu.
//!
//! ```no_run
//! use chiaro::{Gpu, GpuOptions, Renderer, Settings, StillOptions, View, scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let gpu = pollster::block_on(Gpu::new(GpuOptions::default()))?;
//! let mut renderer = Renderer::new(&gpu, Settings::default())?;
//! let mut nave = scene::load("builtin:nave")?;
//! nave.add_default_view();
//! let view = View::from_scene(&nave, 0).expect("a default view was added");
//! let loaded = renderer.load(&nave)?;
//! let still = renderer.still(&loaded, &view, &StillOptions { size: [1280, 720], ..Default::default() })?;
//! let picture = still.picture.wait(&gpu)?; // 8-bit sRGB; `still.radiance` holds nits
//! # let _ = picture; Ok(()) }
//! ```
//!
//! A program with a wgpu device of its own has it adopted ([`Gpu::required_features`] and [`Gpu::required_limits`] may be
//! asked before there is one), builds a [`View`] from its camera's matrices, and has frames recorded into its own encoder and
//! onto its own texture. What hears of the device's errors stays in place; nothing is submitted or waited for.
//!
//! ```
//! use chiaro::{Canvas, Gpu, Renderer, Settings, View, scene::{Material, Mesh, Node, Primitive, Scene}, wgpu};
//! # use glam::Vec3;
//! # use wgpu::{TextureDimension, TextureFormat, TextureUsages};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> { pollster::block_on(run()) }
//! # async fn run() -> Result<(), Box<dyn std::error::Error>> {
//! let adapter = wgpu::Instance::default().request_adapter(&Default::default()).await?;
//! let (device, queue) = adapter.request_device(&Default::default()).await?;
//! device.on_uncaptured_error(std::sync::Arc::new(|error| panic!("mine to hear: {error}")));
//! let (format, usage) = (TextureFormat::Rgba8UnormSrgb, TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC);
//! let texture = device.create_texture(&wgpu::TextureDescriptor {
//!     label: None, size: wgpu::Extent3d { width: 64, height: 64, depth_or_array_layers: 1 }, mip_level_count: 1,
//!     sample_count: 1, dimension: TextureDimension::D2, format, usage, view_formats: &[] });
//! let (positions, normals) = (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![Vec3::Z; 3]);
//! let triangle = Primitive { positions, normals, indices: vec![0, 1, 2], ..Primitive::default() };
//! let meshes = vec![Mesh { primitives: vec![triangle], ..Mesh::default() }];
//! let nodes = vec![Node { mesh: Some(0), ..Node::default() }];
//! let mut scene = Scene { meshes, nodes, materials: vec![Material::default()], ..Scene::default() };
//! scene.add_default_view(); // a sun, and a camera that sees all
//! let gpu = Gpu::adopt(&adapter, device.clone(), queue.clone())?;
//! let (renderer, loaded) = Renderer::with_scene(&gpu, Settings::default(), &scene)?;
//! let (view, target) = (View::from_scene(&scene, 0).unwrap(), texture.create_view(&Default::default()));
//! let mut encoder = device.create_command_encoder(&Default::default());
//! Canvas::new(&renderer, format)?.record(&renderer, (&loaded, &view), &mut encoder, &target)?;
//! queue.submit([encoder.finish()]);
//! # let texture = chiaro::Texture::of_host("picture", &target, format);
//! # let picture = chiaro::Readback::start(&gpu, &texture)?.wait(&gpu)?;
//! # assert!(picture.bytes.chunks(4).any(|rgba| rgba[0] > 100), "the triangle is lit");
//! # Ok(()) }
//! ```
//!
//! [`alone`] has single techniques for programs that keep their own pipelines and shaders; `examples/` shows both.

pub mod alone;
mod canvas;
mod checks;
pub mod environment;
mod error;
mod indirect;
mod jitter;
mod left;
mod light_change;
mod loaded;
mod moving;
mod passes;
mod pipelines;
mod plan;
mod reference;
mod renderer;
mod settings;
mod still;
mod still_passes;
mod trees;
mod view;
mod view_state;

pub use canvas::Canvas;
pub use chiaro_gpu::{
    AdapterChoice, Buffer, BufferReadback, Frame, FrameTimings, Gpu, GpuError, GpuOptions, Handle,
    LimitChoice, Mapping, OptionalFeatures, PassLog, PassTiming, Pixels, Readback, Recorder, Resource,
    ResourceName, Samples, Scale, Texture, TexturePool, ViewHint, shader::Library, wgpu,
};
pub use chiaro_scene as scene;
pub use chiaro_techniques as techniques;
pub use chiaro_techniques::Kit;
pub use chiaro_techniques::post::Aov;
pub use chiaro_techniques::settings::{Condition, Effect, Field, Kind};
pub use error::Error;
pub use jitter::Jitter;
pub use left::{Left, LeftOver};
pub use loaded::LoadedScene;
pub use moving::Sampling;
pub use pipelines::FrameOutputs;
pub use plan::{Built, Plan};
pub use reference::{FirstHit, Integrator, Reference, ReferenceOptions, Shard};
pub use renderer::{Prepared, Renderer};
pub use settings::{Pipeline, Settings};
pub use still::{Still, StillOptions};
pub use trees::Trees;
pub use view::{Depth, Lookout, View};
pub use view_state::ViewState;
