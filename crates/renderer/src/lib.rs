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
//! A program with a wgpu device of its own hands it in with [`Gpu::from_device`] (after asking
//! [`Gpu::required_features`] and [`Gpu::required_limits`]), builds a [`View`] from its camera, and records
//! [`Renderer::prepare`]d frames into its own encoder through [`Recorder::begin_in`].

pub mod environment;
mod error;
mod left;
mod loaded;
mod passes;
mod pipelines;
mod plan;
mod reference;
mod renderer;
mod settings;
mod still;
mod trees;
mod view;
mod view_state;

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
pub use left::{Left, LeftOver};
pub use loaded::LoadedScene;
pub use pipelines::FrameOutputs;
pub use plan::{Built, Plan};
pub use reference::{FirstHit, Integrator, Reference, ReferenceOptions};
pub use renderer::{Prepared, Renderer};
pub use settings::{Pipeline, Settings};
pub use still::{Jitter, Still, StillOptions};
pub use trees::Trees;
pub use view::{Lookout, View};
pub use view_state::ViewState;
