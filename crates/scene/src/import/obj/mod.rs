//! Wavefront OBJ and MTL.
//!
//! `tobj` parses both; it panics on some malformed files and misaligns streams on some legal ones, so that it reads
//! text that [`guard`] (OBJ) and [`library`] (MTL) wrote after checking the file's. What the formats leave open is
//! decided in [`geometry`] and [`material`].

mod bump;
mod geometry;
mod guard;
mod library;
mod map;
mod material;
mod polygon;

use std::path::Path;

use super::warnings::Warnings;
use super::{check_world, scene_name, source};
use crate::{Node, Scene, SceneError, Transform};

/// Loads an `.obj` file and the material libraries that it names.
pub(super) fn load(path: &Path) -> Result<Scene, SceneError> {
    from_bytes(path, &source::read_file(path)?)
}

/// Loads a scene from the content of the file `path`, relative to which other files are found.
pub(super) fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Scene, SceneError> {
    let mut warnings = Warnings::default();
    let checked = guard::check(path, &String::from_utf8_lossy(bytes), &mut warnings)?;
    let library = library::load(path, &checked.libraries, &mut warnings);
    for name in &checked.materials {
        if !library.contains(name) {
            warnings.add(format!("the material `{name}` is in no material library; the default stands in"));
        }
    }
    let models = library.parse(path, &checked)?;
    let mut materials = material::Materials::new(path, &library);
    let mut scene = Scene { name: scene_name(path), ..Scene::default() };
    for mesh in geometry::meshes(path, models, &mut materials, &mut warnings)? {
        let (name, mesh_id) = (mesh.name.clone(), scene.meshes.len());
        scene.meshes.push(mesh);
        scene.nodes.push(Node {
            name,
            parent_from_node: Transform::default(),
            mesh: Some(mesh_id),
            ..Node::default()
        });
    }
    materials.finish(&mut scene);
    scene.warnings = warnings.into_messages();
    check_world(path, &scene)?;
    Ok(scene)
}

/// An error about a line of the OBJ file, counted from 1.
fn invalid(path: &Path, line: usize, problem: impl Into<String>) -> SceneError {
    SceneError::Invalid { path: path.to_owned(), place: format!("line {line}"), problem: problem.into() }
}
