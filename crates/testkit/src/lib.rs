//! What tests share: a headless device, small scenes, pictures of them, compute shaders over the techniques' library,
//! golden images and the folder of references.
//!
//! [`device`] opens the best adapter once per process and fails, never skips, where there is none. [`Studio`] renders
//! [`Stage`]s to linear images in nits, and [`Truth`] traces them; [`Bench`] runs a test's own compute shader. The tests themselves are in
//! `tests/gpu`, one program, so that they share the device and are linked once.

mod bench;
mod device;
mod exact;
mod files;
mod golden;
mod stage;
mod studio;
mod truth;

pub use bench::{Bench, Output};
pub use device::{TestGpu, device, device_guaranteed, device_of_its_own};
pub use exact::{Exact, Hit};
pub use files::{assets, reference, skipped};
pub use golden::{Tolerance, assert_golden};
pub use stage::{Stage, camera_above, place_below};
pub use studio::{Studio, ambient, direct, nmae};
pub use truth::Truth;
