//! The parsed file.

use std::path::Path;

use ::gltf::Document;

use super::super::files::Files;
use super::super::limits::Limits;
use crate::SceneError;

/// The parsed file, and where it came from for messages.
#[derive(Clone, Copy)]
pub(super) struct File<'a> {
    pub path: &'a Path,
    pub files: &'a dyn Files,
    pub limits: &'a Limits,
    pub document: &'a Document,
}

impl File<'_> {
    /// Whether the file names an extension as one that it uses.
    pub fn uses(&self, extension: &str) -> bool {
        self.document.extensions_used().any(|used| used == extension)
    }

    /// An error about `place`, a path in the JSON such as `meshes[2].primitives[0]`.
    pub fn invalid(&self, place: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::Invalid { path: self.path.to_owned(), place: place.into(), problem: problem.into() }
    }
}
