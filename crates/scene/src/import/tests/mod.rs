//! What import promises, on documents made here and on the shared assets.

mod animation;
mod assets;
mod deform;
mod document;
mod gltf;
mod gltf_malformed;
mod height_map;
mod limits;
mod obj;
mod vertices;
mod writers;

use std::path::Path;

use super::{Disk, LoadOptions, load};
use crate::{Scene, SceneError};

/// Loads glTF bytes as if they were the file `path`.
fn gltf_bytes(path: &Path, bytes: Vec<u8>) -> Result<Scene, SceneError> {
    super::gltf::from_bytes(&Disk, path, bytes, &LoadOptions::default())
}

/// Loads OBJ text as if it were the file `path`.
fn obj_bytes(path: &Path, bytes: &[u8]) -> Result<Scene, SceneError> {
    super::obj::from_bytes(&Disk, path, bytes, &LoadOptions::default())
}

/// What a scene warns of, but for documents of a test that have nothing to draw.
fn warnings(scene: &Scene) -> Vec<&str> {
    scene.warnings.iter().map(String::as_str).filter(|warning| !warning.contains("draws nothing")).collect()
}

#[test]
fn other_extensions_are_refused_by_what_would_do() {
    for scene in ["teapot.fbx", "teapot", "archive.tar.gz"] {
        let error = load(scene).unwrap_err();
        assert!(matches!(error, SceneError::Unsupported { .. }), "{error}");
        assert!(error.to_string().contains(".glb"), "{error}");
    }
}

#[test]
fn extensions_are_compared_without_case() {
    for scene in ["absent.GLB", "absent.gLtF", "absent.OBJ"] {
        let error = load(scene).unwrap_err();
        assert!(matches!(error, SceneError::Read { .. }), "{error}");
    }
}

#[test]
fn an_unknown_builtin_is_refused_with_the_names_there_are() {
    let error = load("builtin:no such scene").unwrap_err().to_string();
    assert!(crate::builtin::SCENES.iter().all(|(name, _)| error.contains(name)), "{error}");
}
