//! Truth: light transport without shortcuts, on any GPU, which every real-time technique is measured against.
//!
//! - [`bvh`]: rays through the scene in compute; any technique may import `reference/traverse.wesl`.
//! - [`path`]: the path tracer.
//! - [`first_hit`]: what its camera rays meet first.

pub mod bvh;
pub mod first_hit;
pub mod path;
