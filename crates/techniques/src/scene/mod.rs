//! A scene on the GPU: bind group 1, and what moves in it.
//!
//! Geometry is cut into clusters ([`clusters`]) that lie in one heap of words; an item is a cluster at an instance, and
//! items are sorted by class, so that one prefix sum lays out the draws of all classes. Where everything is, and where it
//! was in the frame before, belongs to the scene ([`motion`]), whoever looks at it.

pub mod clusters;
mod exact;
mod gpu;
mod instance;
pub mod material;
pub mod motion;
mod shares;
pub(crate) mod srgb;
pub mod texture;
pub(crate) mod words;

pub use gpu::{CLASSES, ItemData, KINDS, OPAQUE, SEE_THROUGH, SceneFacts, SceneGpu};
pub(crate) use gpu::{Cut, Drawn};
pub use instance::{InstanceData, instance_data};
