//! Where a scene comes from.

use std::fmt;
use std::path::PathBuf;

use crate::builtin::ring_with;
use crate::{Disk, HeightMap, LoadOptions, Scene, SceneError, load_with};

/// A scene to load.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A `.gltf`, `.glb` or `.obj` file, or `builtin:NAME`.
    Named(String),
    /// Terrain from a picture of its heights.
    HeightMap(HeightMap),
    /// `builtin:ring` with the model of this file in the place of its bangle, as large as that; of its gold unless something of it
    /// mirrors or refracts without blur.
    Caster(PathBuf),
}

impl Source {
    /// Loads it.
    ///
    /// # Errors
    /// As those of [`load_with`] and [`HeightMap::load`]; [`SceneError::Invalid`] for a caster that draws nothing.
    pub fn load(&self, options: &LoadOptions) -> Result<Scene, SceneError> {
        match self {
            Self::Named(name) => load_with(name, options),
            Self::HeightMap(map) => map.load(&Disk),
            Self::Caster(model) => {
                let loaded = load_with(&model.to_string_lossy(), options)?;
                ring_with(loaded).ok_or_else(|| SceneError::Invalid {
                    path: model.clone(),
                    place: "meshes".to_owned(),
                    problem: "it draws nothing, and a caster has to: give a model with triangles".to_owned(),
                })
            }
        }
    }
}

impl From<&str> for Source {
    fn from(name: &str) -> Self {
        Self::Named(name.to_owned())
    }
}

impl From<String> for Source {
    fn from(name: String) -> Self {
        Self::Named(name)
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Named(name) => f.write_str(name),
            Self::HeightMap(map) => write!(f, "{}", map.image.display()),
            Self::Caster(model) => write!(f, "builtin:ring with {}", model.display()),
        }
    }
}
