//! WESL modules in, checked WGSL out.
//!
//! All use of `wesl` and of naga's reflection stays in this folder. A [`Library`] holds the modules of a crate by
//! path; [`Library::link`] joins an entry file with what it imports under a set of `@if` flags and validates the
//! result with naga, so that a mistake is found without a GPU.

mod compiled;
mod layout;
mod link;
mod mangle;
mod reflect;

pub(crate) use compiled::Shader;
pub use layout::{check_layout, struct_layout};
pub use link::{Library, Permutation};
pub use reflect::{Linked, Reflected};
