//! Wavefront OBJ and MTL.
//!
//! Parsed here, by [`parse`] (OBJ) and [`library`] (MTL): the crate for it panics on some malformed files, misaligns
//! streams on some legal ones and knows neither smoothing groups nor line numbers. What the formats leave open is decided
//! in [`geometry`] and [`material`].

mod bump;
mod geometry;
mod library;
mod map;
mod material;
mod origin;
mod parse;
mod polygon;

use std::path::Path;

use super::files::Files;
use super::options::LoadOptions;
use super::warnings::Warnings;
use super::{reach, source, text};
use crate::{Node, Scene, SceneError, Transform};

/// Loads an `.obj` file and the material libraries that it names.
pub(super) fn load(files: &dyn Files, path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    from_bytes(files, path, &source::read_file(files, path)?, options)
}

/// Loads a scene from the content of the file `path`, relative to which other files are found.
pub(super) fn from_bytes(
    files: &dyn Files,
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<Scene, SceneError> {
    options.only_scene(path)?;
    let mut warnings = Warnings::new(options.strict);
    let text = text::decode(bytes).map_err(|problem| SceneError::Invalid {
        path: path.to_owned(),
        place: "text".to_owned(),
        problem,
    })?;
    let mut parsed = parse::Parsed::new(path, &text, &mut warnings)?;
    let mut scene = Scene { name: source::scene_name(path), ..Scene::default() };
    if let Some(origin) = origin::local_origin(&parsed) {
        parsed.positions.iter_mut().for_each(|position| *position -= origin);
        scene.origin_m = origin;
        warnings.add(format!(
            "its coordinates are too far from the origin for 32 bits: ({}, {}, {}) is the scene's origin, from which \
             a camera of your own counts, too",
            origin.x, origin.y, origin.z
        ));
    }
    let library = library::load(files, path, &parsed.libraries, &mut warnings)?;
    for name in &parsed.materials {
        if library.get(name).is_none() {
            let problem = "it is in no material library".to_owned();
            let error =
                SceneError::Invalid { path: path.to_owned(), place: format!("material `{name}`"), problem };
            warnings.stand_in(error, "the default one stands in")?;
        }
    }
    let mut materials = material::Materials::new(files, &options.limits, path, &library);
    for mesh in geometry::meshes(path, &options.limits, &parsed, &mut materials, &mut warnings)? {
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
    if parsed.faces.is_empty() {
        warnings.add(format!(
            "it draws nothing: no face of three corners or more, but {} vertices and {} points, lines and lesser faces",
            parsed.positions.len(),
            parsed.skipped
        ));
    }
    scene.warnings = warnings.into_messages();
    reach::check(path, &scene)?;
    Ok(scene)
}
