//! Reading scenes from files.
//!
//! Everything that a file says is checked here, once, so that nothing downstream has to: a malformed file ends in a
//! [`SceneError`] that names the place, never in a panic, an endless loop or an allocation out of proportion.

mod gltf;
mod obj;
mod source;
mod warnings;

#[cfg(test)]
mod tests;

use std::path::Path;

use crate::{Scene, SceneError, builtin};

/// Coordinates and scales beyond this (metres) are refused: their squares would leave the range of `f32`.
const MAX_COORDINATE: f32 = 1e12;

/// Most vertices that one file may expand to. A few bytes can ask for any number of them (an accessor without data, a
/// mesh that a thousand primitives share), so the sum is limited; 2²⁶ vertices are about 5 GB.
const MAX_VERTICES: usize = 1 << 26;

/// Most triangle corners that one file may expand to, for the same reason.
const MAX_INDICES: usize = 1 << 28;

/// Loads `builtin:NAME`, a `.gltf`/`.glb` or an `.obj` file.
///
/// Cameras and lights are those of the file, possibly none; see [`Scene::add_default_view`].
///
/// # Errors
/// Names the file, the place in it and what to do; see [`SceneError`].
pub fn load(scene: &str) -> Result<Scene, SceneError> {
    if let Some(name) = scene.strip_prefix("builtin:") {
        return builtin::build(name).ok_or_else(|| SceneError::UnknownBuiltin {
            name: name.to_owned(),
            known: builtin::SCENES.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", "),
        });
    }
    let path = Path::new(scene);
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "gltf" | "glb" => gltf::load(path),
        "obj" => obj::load(path),
        _ => Err(SceneError::Unsupported {
            path: path.to_owned(),
            feature: match extension.as_str() {
                "" => "a scene file without an extension".to_owned(),
                other => format!("the scene format `.{other}`"),
            },
            advice: "load a .gltf, .glb or .obj file, or a built-in scene as `builtin:NAME`".to_owned(),
        }),
    }
}

/// The scene's name: the file's stem.
fn scene_name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Refuses a finished scene whose world-space geometry overflows: node transforms multiply, so that this can happen
/// with every single number in range.
fn check_world(path: &Path, scene: &Scene) -> Result<(), SceneError> {
    let placed = scene.world_from_node().iter().all(glam::Affine3A::is_finite);
    let bounded = scene.bounds().is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite());
    if placed && bounded {
        return Ok(());
    }
    Err(SceneError::Invalid {
        path: path.to_owned(),
        place: "nodes".to_owned(),
        problem: "the nodes' transforms multiply to numbers that are not finite".to_owned(),
    })
}

/// What a file may still expand to.
struct Budget {
    vertices: usize,
    indices: usize,
}

impl Default for Budget {
    fn default() -> Self {
        Self { vertices: MAX_VERTICES, indices: MAX_INDICES }
    }
}

impl Budget {
    /// Takes one primitive's share; the error says which limit it exceeds.
    fn spend(&mut self, vertices: usize, indices: usize) -> Result<(), String> {
        let exceeded =
            |what, limit| format!("the file's meshes have more than {limit} {what}; split the scene");
        let vertices_left = self.vertices.checked_sub(vertices);
        self.vertices = vertices_left.ok_or_else(|| exceeded("vertices", MAX_VERTICES))?;
        let indices_left = self.indices.checked_sub(indices);
        self.indices = indices_left.ok_or_else(|| exceeded("triangle corners", MAX_INDICES))?;
        Ok(())
    }
}
