//! The window onto a scene.
