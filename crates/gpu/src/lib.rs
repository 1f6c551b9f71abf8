//! A thin layer over wgpu: which device to use, how passes are recorded and timed, how shaders are linked.
//!
//! - [`Gpu`]: a device with the features chiaro can use; made here or handed in by a host program.
//! - [`shader`]: WESL modules → one WGSL text per entry file and permutation → reflection → pipelines.
//! - [`Frame`]: records passes. The handles that fill a pass' bind groups are its reads and writes, so one log gives
//!   the timing table, the frame diagram, a read-before-write assertion, and every resource by name.
//! - [`Texture`], [`Buffer`], [`TexturePool`]: handles with an identity, so that bind groups are made once and found
//!   again.
//! - [`Readback`], [`BufferReadback`]: pixels and buffers back on the CPU, without blocking.
//!
//! Nothing here knows about light.

mod device;
mod error;
mod frame;
mod group;
mod handle;
mod hint;
mod history;
mod log;
pub mod parallel;
mod pipeline;
mod profile;
mod readback;
mod recorder;
mod render_pass;
mod resource;
mod room;
pub mod shader;

pub use device::{AdapterChoice, Created, Gpu, GpuOptions, LimitChoice, OptionalFeatures};
pub use error::GpuError;
pub use frame::{Dispatch, Frame};
pub use group::{Group, GroupLayout};
pub use handle::Handle;
pub use hint::{Mapping, Scale, ViewHint};
pub use history::History;
pub use log::{Resource, ResourceName};
pub use pipeline::{ComputePipeline, RenderPipeline, RenderPipelineOptions};
pub use profile::{FrameTimings, PassTiming};
pub use readback::{BufferReadback, Pixels, Readback, Samples};
pub use recorder::{Bind, PassLog, Recorder};
pub use render_pass::{Attachment, DepthAttachment, Draw, RenderPass, Targets};
pub use resource::{Binding, Buffer, Life, Texture, TextureOptions, TexturePool};
pub use room::keep;
pub use wgpu;
