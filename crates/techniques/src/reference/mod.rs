//! Truth: light transport without shortcuts, on any GPU, which every real-time technique is measured against.
//!
//! - [`path`]: paths from the camera.
//! - [`photon`]: paths from the lights, for what the former do not find.
//! - [`first_hit`]: what paths from the camera meet first.

pub mod first_hit;
pub mod path;
pub mod photon;
