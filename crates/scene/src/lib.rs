//! What is lit, on the CPU: scenes from glTF, OBJ and from code.
//!
//! A [`Scene`] is plain data without any GPU object: meshes, materials, images, lights and cameras under a
//! node hierarchy. [`load`] reads a file or a built-in scene; everything a file can say is checked there, so that
//! the rest of chiaro may rely on the invariants that [`model`] states. [`Scene::validate`] checks a scene that a program
//! builds itself.
//!
//! Conventions: right-handed, Y up, metres; cameras and lights look along their −Z; colours linear Rec. 709;
//! light is photometric (candela, lux, nits).

mod asked;
pub mod builtin;
mod defaults;
mod deform;
mod error;
mod fingerprint;
mod import;
#[doc(hidden)]
pub mod invariants;
mod mesh;
pub mod model;
mod origin;
mod pose;
mod validate;

pub use asked::Source;
pub use error::SceneError;
pub use fingerprint::text_hash;
pub use import::{Disk, Files, HeightMap, Limits, LoadOptions, Memory, load, load_from, load_with};
pub use model::*;
pub use pose::Pose;
