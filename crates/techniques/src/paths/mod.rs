//! Paths of light from surface to surface, for the reference and for whatever traces photons in a frame.
//!
//! - `vertex.wesl`: a ray's hit as a surface.
//! - `bsdf.wesl`: how it scatters, mirrors and refracts; `medium.wesl`: what lies between.
//! - `sampler.wesl`, `roulette.wesl`: random numbers, and which paths end.
//! - `aim.wesl`: how light begins, towards a box; `sight.wesl`: what the camera sees of where it lands.
//! - [`Specular`], [`Interfaces`]: what of a scene mirrors or lets light through.

mod aim;
mod interfaces;

pub(crate) use aim::{EVERYWHERE, cone_height, seen_area};
pub use interfaces::{Interfaces, Specular};
