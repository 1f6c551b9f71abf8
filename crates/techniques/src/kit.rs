//! What passes are compiled with, and what every pass has in common.

use chiaro_gpu::shader::Library;
use chiaro_gpu::{Gpu, GpuError, GroupLayout};

use crate::frame::FrameGroup;
use crate::scene::SceneGpu;

/// What every pass is compiled with, and scenes are uploaded with. Cheap to clone, and sent to other threads.
#[derive(Clone, Debug)]
pub struct Kit {
    /// The device.
    pub gpu: Gpu,
    /// The shaders.
    pub library: Library,
    /// Group 0's layout.
    pub frame_layout: GroupLayout,
    /// Group 1's layout.
    pub scene_layout: GroupLayout,
}

impl Kit {
    /// Makes the layouts; compiles nothing yet.
    pub fn new(gpu: &Gpu, library: Library) -> Self {
        let (frame_layout, scene_layout) = (FrameGroup::layout(gpu), SceneGpu::layout(gpu));
        Self { gpu: gpu.clone(), library, frame_layout, scene_layout }
    }
}

/// Pipelines that are compiled together. What they write is not theirs: textures and buffers are rooms, which passes make
/// (`room`) and which are handed to them when they record.
pub trait Pass: Sized {
    /// Exactly what the shaders are compiled for.
    type Key: Clone + std::fmt::Debug + PartialEq;

    /// Compiles the pipelines. Takes up to seconds.
    ///
    /// # Errors
    /// When a shader does not link or compile.
    fn compile(kit: &Kit, key: &Self::Key) -> Result<Self, GpuError>;

    /// Whether what was compiled for one key serves another.
    fn serves(has: &Self::Key, wanted: &Self::Key) -> bool {
        has == wanted
    }
}

/// A pass that some settings and scenes do without.
impl<P: Pass> Pass for Option<P> {
    type Key = Option<P::Key>;

    fn compile(kit: &Kit, key: &Self::Key) -> Result<Self, GpuError> {
        key.as_ref().map(|key| P::compile(kit, key)).transpose()
    }

    fn serves(has: &Self::Key, wanted: &Self::Key) -> bool {
        match (has, wanted) {
            (_, None) => true,
            (Some(has), Some(wanted)) => P::serves(has, wanted),
            (None, Some(_)) => false,
        }
    }
}

/// A pass and what it was compiled for.
#[derive(Debug)]
pub struct Compiled<P: Pass> {
    key: P::Key,
    pass: P,
}

impl<P: Pass> Compiled<P> {
    /// Compiles a pass.
    ///
    /// # Errors
    /// As [`Pass::compile`].
    pub fn new(kit: &Kit, key: P::Key) -> Result<Self, GpuError> {
        Ok(Self { pass: P::compile(kit, &key)?, key })
    }

    /// Whether it serves `wanted`.
    pub fn serves(&self, wanted: &P::Key) -> bool {
        P::serves(&self.key, wanted)
    }

    /// What it was compiled for.
    pub fn key(&self) -> &P::Key {
        &self.key
    }
}

impl<P: Pass> std::ops::Deref for Compiled<P> {
    type Target = P;

    fn deref(&self) -> &P {
        &self.pass
    }
}
