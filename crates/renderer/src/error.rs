//! What a user of the library can act on.

use chiaro_gpu::GpuError;
use chiaro_image::ImageError;
use chiaro_scene::SceneError;

/// Why something could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A device, shader or memory problem.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The scene could not be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A picture could not be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A picture is no environment map.
    #[error("environment map {file}: {problem}")]
    Environment {
        /// The file.
        file: String,
        /// What is wrong.
        problem: String,
    },
    /// No setting has that key.
    #[error("no setting is called `{key}`; the nearest are {nearest}. `chiaro settings` lists all")]
    UnknownSetting {
        /// The key asked for.
        key: String,
        /// Keys that are spelled alike.
        nearest: String,
    },
    /// A setting's value is not allowed.
    #[error("`{key}` cannot be `{value}`: it takes {expected}")]
    SettingValue {
        /// The key.
        key: String,
        /// The value asked for.
        value: String,
        /// What it takes.
        expected: String,
    },
    /// Settings that do not go together, or that this adapter cannot do.
    #[error("{0}")]
    Combination(String),
    /// Rays were asked for, and the scene has no trees for them.
    #[error("settings shoot rays at a scene that has no trees for them: give it some by `Renderer::equip`")]
    NoTrees,
    /// Imperfect shadow maps were asked for, and the scene has no points to draw them from.
    #[error(
        "settings draw imperfect shadow maps of a scene that has no points: give it some by `Renderer::equip`"
    )]
    NoPoints,
    /// A pose or trees that are not of the scene that was loaded.
    #[error("{what} of another scene: {problem}")]
    Foreign {
        /// `pose` or `trees`.
        what: &'static str,
        /// How it is seen.
        problem: String,
    },
    /// The scene draws what no pass was compiled for.
    #[error(
        "no passes are compiled for what this scene draws: `Renderer::equip` compiles them, or `Renderer::plan`"
    )]
    NoPasses,
    /// A picture of no or too many pixels.
    #[error("a picture cannot have {}×{} pixels: it takes 1 to {most} a side", size[0], size[1])]
    Size {
        /// Pixels asked for.
        size: [u32; 2],
        /// Pixels of a side at most.
        most: u32,
    },
    /// A matrix that is none of a camera.
    #[error("a view cannot be made of these matrices: {matrix} {problem}")]
    Matrix {
        /// `view_from_world`, `clip_from_view`, or what follows from both.
        matrix: &'static str,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// Lights or bounds that nothing can be fitted to.
    #[error("{what} {problem}")]
    Unfit {
        /// Which light, or the bounds.
        what: String,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A texture that frames cannot be drawn to.
    #[error("frames cannot be drawn to this texture: {0}")]
    Target(String),
    /// A texture of a host program that light cannot be found on.
    #[error("the {texture} texture cannot be read: {problem}")]
    Unread {
        /// `depth`, `normals` or `albedo`.
        texture: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// A frame leaves nothing of that name that could be read.
    #[error("{problem}; a frame with these settings leaves {known}")]
    Nothing {
        /// What is wrong with the name.
        problem: String,
        /// What could be asked for.
        known: String,
    },
    /// Sums that a reference cannot go on from.
    #[error("the unfinished reference does not fit: {0}")]
    Unfinished(String),
    /// A preset could not be read.
    #[error("preset {name}: {problem}")]
    Preset {
        /// Name or file.
        name: String,
        /// What is wrong.
        problem: String,
    },
}
