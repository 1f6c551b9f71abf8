//! glTF 2.0 and GLB.
//!
//! The `gltf` crate parses; it trusts a file in places where it must not (accessor arithmetic, images without a media
//! type, cameras of the wrong kind), so that its iterators are reached only through the checks in [`accessor`] and
//! its convenience readers are not used.

mod accessor;
mod document;
mod material;
mod node;
mod primitive;
mod texture;

use std::path::Path;

use ::gltf::Document;

use self::accessor::Accessors;
use self::material::Materials;
use self::primitive::Meshes;
use super::warnings::Warnings;
use super::{Budget, check_world, scene_name, source};
use crate::{Scene, SceneError};

/// Loads a `.gltf` or `.glb` file.
pub(super) fn load(path: &Path) -> Result<Scene, SceneError> {
    from_bytes(path, source::read_file(path)?)
}

/// Loads a scene from the content of the file `path`, relative to which other files are found.
pub(super) fn from_bytes(path: &Path, bytes: Vec<u8>) -> Result<Scene, SceneError> {
    let mut warnings = Warnings::default();
    let (document, blob) = document::parse(path, bytes, &mut warnings)?;
    let buffers = document::buffers(path, &document, blob)?;
    let file = File { path, document: &document };
    let mut materials = Materials::new(file, &buffers);
    let accessors = Accessors::new(file, &buffers);
    let mut meshes = Meshes { file, accessors, materials: &mut materials, budget: Budget::default() };

    let mut scene = Scene { name: scene_name(path), ..Scene::default() };
    node::convert(&mut meshes, &mut scene, &mut warnings)?;
    materials.finish(&mut scene);
    scene.warnings = warnings.into_messages();
    check_world(path, &scene)?;
    Ok(scene)
}

/// The parsed file, and where it came from for messages.
#[derive(Clone, Copy)]
struct File<'a> {
    path: &'a Path,
    document: &'a Document,
}

impl File<'_> {
    /// An error about `place`, a path in the JSON such as `meshes[2].primitives[0]`.
    fn invalid(&self, place: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::Invalid { path: self.path.to_owned(), place: place.into(), problem: problem.into() }
    }
}
