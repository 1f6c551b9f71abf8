//! Groups of techniques side by side.

pub mod indirect;
pub mod reference;
pub mod shadows;

use serde::Serialize;

use crate::{Machine, Session};

/// What a suite measured, as a file says it.
#[derive(Debug, Serialize)]
pub struct Report<'a, R> {
    machine: &'a Machine,
    scene: &'a str,
    triangles: u32,
    size: [u32; 2],
    frames: u32,
    rows: &'a [R],
}

impl<'a, R> Report<'a, R> {
    /// Rows, each of so many frames.
    pub fn new<S>(machine: &'a Machine, session: &'a Session<S>, frames: u32, rows: &'a [R]) -> Self {
        Self {
            machine,
            scene: &session.scene_name,
            triangles: session.scene.gpu.triangle_count,
            size: session.size,
            frames,
            rows,
        }
    }
}
