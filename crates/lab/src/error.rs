//! What goes wrong while techniques are measured.

use std::path::{Path, PathBuf};

/// Why something could not be measured.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Rendering or tracing failed.
    #[error(transparent)]
    Chiaro(#[from] chiaro::Error),
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] chiaro::GpuError),
    /// The scene could not be read.
    #[error(transparent)]
    Scene(#[from] chiaro::scene::SceneError),
    /// A picture could not be read, written or compared.
    #[error(transparent)]
    Image(#[from] chiaro_image::ImageError),
    /// A file or folder could not be read or written.
    #[error("{what} {}: {source}", path.display())]
    File {
        /// `cannot write` and the like.
        what: &'static str,
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A row of CSV could not be made.
    #[error("cannot write a table: {0}")]
    Csv(#[from] csv::Error),
    /// A value could not be written as, or read from, JSON.
    #[error("JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The truth is black, so that there is nothing to hold anything against.
    #[error("{0}")]
    Black(String),
    /// What was asked for cannot be asked for.
    #[error("{0}")]
    Usage(String),
    /// The work failed for another reason.
    #[error("{0}")]
    Work(String),
    /// Something went wrong with one of several.
    #[error("{what}: {source}")]
    Of {
        /// Which.
        what: String,
        /// Why.
        source: Box<Error>,
    },
}

impl Error {
    /// Whether whoever asked is to blame, rather than a file, the device or the work.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Usage(_) => true,
            Self::Of { source, .. } => source.is_usage(),
            Self::Chiaro(error) => is_usage(error),
            _ => false,
        }
    }

    /// Whether only this row of a table cannot be had.
    pub fn is_of_row(&self) -> bool {
        match self {
            Self::Black(_) => true,
            Self::Of { source, .. } => source.is_of_row(),
            _ => self.is_usage(),
        }
    }

    /// The same with what it is about.
    #[must_use]
    pub fn of(self, what: impl Into<String>) -> Self {
        Self::Of { what: what.into(), source: Box::new(self) }
    }

    pub(crate) fn file(what: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::File { what, path, source }
    }
}

/// Whether an error of the renderer says that settings are not what they can be.
pub fn is_usage(error: &chiaro::Error) -> bool {
    use chiaro::Error::{Combination, Nothing, Preset, SettingValue, UnknownSetting};
    matches!(
        error,
        UnknownSetting { .. } | SettingValue { .. } | Combination(_) | Preset { .. } | Nothing { .. }
    )
}
