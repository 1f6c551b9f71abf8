//! How a scene is loaded.

use std::path::Path;

use super::limits::Limits;
use crate::SceneError;

/// How a scene is loaded.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Which of the file's scenes: its name, or its number from 0. `None` is the one that the file says, or its first.
    pub scene: Option<String>,
    /// Whether a texture or material library that is missing or broken is an error. Else it is a warning that says what
    /// stands in.
    pub strict: bool,
    /// How much the file may expand to.
    pub limits: Limits,
}

impl LoadOptions {
    /// Refuses the choice of another scene than the first where there is but one.
    pub(super) fn only_scene(&self, path: &Path) -> Result<(), SceneError> {
        match self.scene.as_deref() {
            None | Some("0") => Ok(()),
            Some(name) => Err(SceneError::UnknownScene {
                path: path.to_owned(),
                name: name.to_owned(),
                known: "0".to_owned(),
            }),
        }
    }
}
