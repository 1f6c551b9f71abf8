//! Reading scenes from files.
//!
//! Everything that a file says is checked here, once, so that nothing downstream has to: a malformed file ends in a
//! [`SceneError`] that names the place, never in a panic, an endless loop or an allocation out of proportion.

mod files;
mod gltf;
mod height_map;
mod limits;
mod obj;
mod options;
mod reach;
mod source;
mod text;
mod warnings;

#[cfg(test)]
mod tests;

use std::path::Path;

pub use self::files::{Disk, Files, Memory};
pub use self::height_map::HeightMap;
pub use self::limits::Limits;
pub use self::options::LoadOptions;
use crate::{Scene, SceneError, builtin};

/// Loads `builtin:NAME`, a `.gltf`/`.glb` or an `.obj` file.
///
/// Cameras and lights are those of the file, possibly none; see [`Scene::add_default_view`]. Of a file that draws nothing
/// [`Scene::warnings`] say what was found.
///
/// # Errors
/// Names the file, the place in it and what to do; see [`SceneError`].
pub fn load(scene: &str) -> Result<Scene, SceneError> {
    load_with(scene, &LoadOptions::default())
}

/// Like [`load`], with a choice of the scene and of limits.
///
/// # Errors
/// As [`load`]'s, and [`SceneError::UnknownScene`], which lists the scenes that there are.
pub fn load_with(scene: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    let Some(name) = scene.strip_prefix("builtin:") else {
        return load_from(&Disk, Path::new(scene), options);
    };
    options.only_scene(Path::new(scene))?;
    builtin::build(name).ok_or_else(|| SceneError::UnknownBuiltin {
        name: name.to_owned(),
        known: builtin::SCENES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
    })
}

/// Loads the `.gltf`/`.glb` or `.obj` file at `path` among `files`, from which the files that it refers to come too.
///
/// # Errors
/// As [`load_with`]'s.
pub fn load_from(files: &dyn Files, path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let mut scene = match extension.as_str() {
        "gltf" | "glb" => gltf::load(files, path, options),
        "obj" => obj::load(files, path, options),
        _ => Err(SceneError::Unsupported {
            path: path.to_owned(),
            feature: match extension.as_str() {
                "" => "a scene file without an extension".to_owned(),
                other => format!("the scene format `.{other}`"),
            },
            advice: "load a .gltf, .glb or .obj file, or a built-in scene as `builtin:NAME`".to_owned(),
        }),
    }?;
    scene.settle(None);
    Ok(scene)
}
