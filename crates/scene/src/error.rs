//! What can go wrong when a scene is read.

use std::path::PathBuf;

/// Why a scene could not be loaded. Each message names the file, the place in it and what to do.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file, or one that it refers to, could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file that was asked for.
        path: PathBuf,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// The file's content breaks its format's rules.
    #[error("{}: {place}: {problem}", path.display())]
    Invalid {
        /// The scene file.
        path: PathBuf,
        /// Where in the file: a line, or a path such as `meshes[2].primitives[0].indices`.
        place: String,
        /// What is wrong there, and what would be right.
        problem: String,
    },
    /// The file needs something that chiaro does not have.
    #[error("{}: {feature} is not supported: {advice}", path.display())]
    Unsupported {
        /// The scene file.
        path: PathBuf,
        /// The extension or feature, by its name in the format.
        feature: String,
        /// A way on, such as how to convert the file.
        advice: String,
    },
    /// The file has no scene of this name or number.
    #[error("{}: there is no scene `{name}`; there are: {known}", path.display())]
    UnknownScene {
        /// The scene file.
        path: PathBuf,
        /// The name or number asked for.
        name: String,
        /// The numbers and names there are, comma-separated.
        known: String,
    },
    /// A scene that a program built breaks the data model's rules; see [`crate::Scene::validate`].
    #[error("scene “{scene}”: {place}: {problem}")]
    Unsound {
        /// The scene's name.
        scene: String,
        /// Where in the scene: `mesh 2 “wheel”, primitive 0`.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// No built-in scene has this name.
    #[error("no built-in scene is called `{name}`; there are: {known}")]
    UnknownBuiltin {
        /// The name asked for.
        name: String,
        /// The names there are, comma-separated.
        known: String,
    },
}
