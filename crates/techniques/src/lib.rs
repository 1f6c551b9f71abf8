//! Every lighting technique, one folder each, Rust and WESL side by side.
//!
//! A folder holds the technique's idea and limits (`mod.rs`), its parameters (`settings.rs`), its passes and its
//! shaders. Entry files end in `.cs.wesl` (compute) or `.vs.wesl` (vertex and fragment); other `.wesl` files are
//! libraries that entries import.
//!
//! A technique's pass type is a [`Pass`]: what was compiled, and nothing else. Its `room` makes what it writes into, outside
//! frames; `record` records into a [`chiaro_gpu::Frame`], typed handles and the room in, typed handles out, and allocates
//! nothing.

pub mod caustics;
pub mod direct;
pub mod environment;
pub mod frame;
pub mod indirect;
mod kit;
pub mod light;
pub mod paths;
pub mod post;
pub mod rays;
pub mod reference;
pub mod scene;
pub mod settings;
pub mod shaders;
pub mod shadow;
pub mod shared;
pub mod specular;
pub mod transparency;
pub mod view;

pub use kit::{Compiled, Kit, Pass};

#[cfg(test)]
mod budget_tests;
#[cfg(test)]
mod layout_tests;
