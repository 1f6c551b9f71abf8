//! Every lighting technique, one folder each, Rust and WESL side by side.
//!
//! A folder holds the technique's idea and limits (`mod.rs`), its parameters (`settings.rs`), its passes and its
//! shaders. Entry files end in `.cs.wesl` (compute) or `.vs.wesl` (vertex and fragment); other `.wesl` files are
//! libraries that entries import.
//!
//! A technique's pass type has `new` (compiles), `reserve` (allocates, outside frames) and `record` (records into a
//! [`chiaro_gpu::Frame`], typed handles in and out, allocates nothing).

pub mod caustics;
pub mod direct;
pub mod environment;
pub mod indirect;
pub mod motion;
pub mod post;
pub mod reference;
pub mod settings;
pub mod shaders;
pub mod shadow;
pub mod shared;
pub mod surface;
pub mod transparency;

#[cfg(test)]
mod budget_tests;
#[cfg(test)]
mod layout_tests;
