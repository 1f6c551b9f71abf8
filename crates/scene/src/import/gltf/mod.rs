//! glTF 2.0 and GLB.
//!
//! The `gltf` crate parses; it trusts a file in places where it must not (accessor arithmetic, images without a media
//! type, cameras of the wrong kind), so that accessors are read by [`accessor`] and
//! its convenience readers are not used.

mod accessor;
mod animation;
mod buffers;
mod deform;
mod document;
mod far;
mod file;
mod instancing;
mod material;
mod meshopt;
mod node;
mod placed;
mod primitive;
mod skin;
mod texture;

use std::path::Path;

use self::accessor::Accessors;
use self::buffers::Buffers;
use self::document::Parsed;
use self::file::File;
use self::material::Materials;
use self::primitive::Meshes;
use super::files::Files;
use super::limits::Budget;
use super::options::LoadOptions;
use super::warnings::Warnings;
use super::{reach, source};
use crate::{Scene, SceneError};

/// Loads a `.gltf` or `.glb` file.
pub(super) fn load(files: &dyn Files, path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    from_bytes(files, path, source::read_file(files, path)?, options)
}

/// Loads a scene from the content of the file `path`, relative to which other files are found.
pub(super) fn from_bytes(
    files: &dyn Files,
    path: &Path,
    bytes: Vec<u8>,
    options: &LoadOptions,
) -> Result<Scene, SceneError> {
    let mut warnings = Warnings::new(options.strict);
    let Parsed { document, blob, remainders } = document::parse(path, bytes, &mut warnings)?;
    let file = File { path, files, limits: &options.limits, document: &document };
    let buffers = Buffers::read(file, blob)?;
    let mut materials = Materials::new(file, &buffers);
    let mut meshes = Meshes {
        file,
        accessors: Accessors::new(file, &buffers),
        materials: &mut materials,
        budget: Budget::new(file.limits),
    };

    let mut scene = Scene { name: source::scene_name(path), ..Scene::default() };
    let names = document.scenes().map(|scene| scene.name().unwrap_or_default().to_owned());
    scene.scene_names = names.collect();
    let mut nodes = node::convert(&mut meshes, options.scene.as_deref(), &mut scene, &mut warnings)?;
    skin::convert(&mut meshes, &mut nodes, &mut scene, &mut warnings)?;
    animation::convert(&mut meshes, &nodes, &mut scene, &mut warnings)?;
    far::place(&mut scene, &nodes.ids, &remainders);
    materials.finish(&mut scene);
    if scene.triangle_count() == 0 {
        let meshes = document.nodes().filter(|node| node.mesh().is_some()).count();
        warnings.add(format!(
            "it draws nothing: its scene has {} nodes and no triangle; the whole file has {} scenes, {} nodes, {meshes} \
             of them with a mesh, and {} meshes",
            scene.nodes.len(),
            document.scenes().len(),
            document.nodes().len(),
            document.meshes().len()
        ));
    }
    scene.warnings = warnings.into_messages();
    reach::check(path, &scene)?;
    Ok(scene)
}
