//! Where a scene comes from.

use std::fmt;

use crate::{Disk, HeightMap, LoadOptions, Scene, SceneError, load_with};

/// A scene to load.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A `.gltf`, `.glb` or `.obj` file, or `builtin:NAME`.
    Named(String),
    /// Terrain from a picture of its heights.
    HeightMap(HeightMap),
}

impl Source {
    /// Loads it.
    ///
    /// # Errors
    /// As those of [`load_with`] and [`HeightMap::load`].
    pub fn load(&self, options: &LoadOptions) -> Result<Scene, SceneError> {
        match self {
            Self::Named(name) => load_with(name, options),
            Self::HeightMap(map) => map.load(&Disk),
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
        }
    }
}
