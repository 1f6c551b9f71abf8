//! Linear images: EXR, HDR and PNG, colour, error metrics.
//!
//! An [`Image`] holds linear Rec. 709 colours in `f32`, usually scene radiance in nits; a [`Picture`] holds the 8-bit
//! sRGB bytes that a screen shows. [`read`] takes EXR, Radiance HDR or PNG to an [`Image`]; [`write_exr`] and
//! [`write_png`] go the other way; [`Layers`] are an EXR's further channels. [`Comparison`] measures one image against
//! another and draws where they differ; a [`Sequence`] does so for the frames of an animation, and measures how they flicker.
//!
//! ```
//! use chiaro_image::{Comparison, CompareOptions, Image};
//!
//! let reference = Image::filled(64, 48, [1.0, 0.5, 0.25]);
//! let brighter = Image::filled(64, 48, [1.1, 0.55, 0.275]);
//! let metrics = Comparison::new(&brighter, &reference, &CompareOptions::default())?.metrics();
//! assert!((metrics.mean_ratio - 1.1).abs() < 1e-6);
//! # Ok::<(), chiaro_image::ImageError>(())
//! ```

pub mod colour;
mod compare;
mod error;
mod exact;
mod exr_file;
mod file;
mod filter;
mod flip;
mod hdr_file;
mod hdr_flip;
mod heat;
mod layers;
mod linear;
mod picture;
mod sequence;
mod ssim;
mod write;

pub use compare::{CompareOptions, Comparison, Metrics};
pub use error::ImageError;
pub use exact::ExactSums;
pub use exr_file::{Precision, write_exr};
pub use file::read;
pub use heat::Heat;
pub use layers::{Layers, read_about, read_layers, write_layers};
pub use linear::{Image, MAX_PIXELS, Region};
pub use picture::{Picture, write_png};
pub use sequence::{ComparedFrame, FrameMetrics, Sequence, SequenceMetrics};
