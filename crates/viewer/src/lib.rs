//! The window onto a scene: fly through it, turn every setting, see every buffer and what each pass costs.
//!
//! [`Viewer`] is the whole of it but the window: it takes egui's input, renders the scene and the panel into a texture
//! view, and compiles and loads on another thread while it goes on. [`run`] gives it a window. Nothing in `Viewer`
//! knows of windows, threads or files but the small modules `jobs`, `files` and `reload`, which differ in the browser.
//!
//! ```no_run
//! chiaro_viewer::run(chiaro_viewer::Options { scene: "builtin:nave".into(), ..Default::default() })?;
//! # Ok::<(), chiaro_viewer::ViewerError>(())
//! ```

mod buffers;
mod camera;
mod engine;
mod error;
mod files;
mod jobs;
mod panel;
mod picture;
mod playback;
mod reload;
mod shell;
mod stage;
mod timings;
mod truth;
mod viewer;

pub use error::ViewerError;
pub use shell::{Shell, Wake, run};
pub use truth::Compare;
pub use viewer::{Canvas, Options, Outcome, StartCamera, Viewer};
