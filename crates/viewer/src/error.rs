//! Why there is no window.

use chiaro::GpuError;

/// What ends the viewer.
#[derive(Debug, thiserror::Error)]
pub enum ViewerError {
    /// There is no display to open a window on.
    #[error(
        "no window can be opened: {0}. Start it in a desktop session, or render an image with `chiaro render`"
    )]
    NoDisplay(String),
    /// The window cannot be drawn to.
    #[error("the window cannot be drawn to: {0}")]
    Surface(String),
    /// No device, or it was lost and could not be opened again.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}
