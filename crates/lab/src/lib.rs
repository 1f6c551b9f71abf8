//! The laboratory: techniques measured by error, noise, flicker, time and memory, against the program's own truth.
//!
//! A [`Session`] is a scene on a device. [`Truths`] traces what is right, to a stated error, and keeps it from one run to the
//! next. [`compare()`] holds [`Technique`]s against it side by side, [`sweep()`] every combination of settings, a row each.
//! [`measure`] times frames, [`suite`] has groups of techniques that belong together.
//!
//! Errors are shares of the truth's mean: [`Figures`] says which, and how bias and noise are told apart (Celarek, Jakob,
//! Wimmer & Lehtinen 2019, "Quantifying the Error of Light Transport Algorithms").

mod cache;
mod compare;
mod cost;
mod error;
mod figures;
pub mod files;
mod filter;
mod judge;
pub mod measure;
mod part;
mod paths;
pub mod pictures;
pub mod plot;
mod row;
mod row_file;
pub mod session;
pub mod suite;
mod sweep;
mod technique;
pub mod timings;
mod trace;
mod truth;
mod truths;

pub use cache::{Cache, VARIABLE};
pub use compare::{Report, Row, Source, compare};
pub use cost::{Cost, cost};
pub use error::{Error, is_usage};
pub use figures::{Figures, Spread, Squares, against};
pub use filter::{Features, filter};
pub use judge::{JudgeOptions, Judged, Moment, judge};
pub use part::Part;
pub use paths::{Paths, Traced};
pub use row::Columns;
pub use session::{SceneChoice, Session, Tracing};
pub use sweep::{SweepOptions, Swept, Vary, sweep};
pub use technique::{Method, Technique, apply_preset};
pub use timings::Machine;
pub use trace::Pace;
pub use truth::{Floor, Noise, Truth};
pub use truths::{TruthOptions, Truths};
