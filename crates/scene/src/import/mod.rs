//! Reading scenes from files.

mod gltf;
mod obj;

use crate::{Scene, SceneError};

/// Loads `builtin:NAME`, a `.gltf`/`.glb` or an `.obj` file.
///
/// # Errors
/// Names the file, the place in it and what to do; see [`SceneError`].
pub fn load(scene: &str) -> Result<Scene, SceneError> {
    let _ = scene;
    unimplemented!()
}
