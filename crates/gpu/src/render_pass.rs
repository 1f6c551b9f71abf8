//! Render passes: where they draw, and what.

use crate::group::{FIRST_OWN_GROUP, Group};
use crate::recorder::{Bind, Recorder};
use crate::{Buffer, RenderPipeline, Texture};

/// What to draw.
#[derive(Clone, Copy, Debug)]
pub enum Draw<'a> {
    /// A triangle that covers the target.
    FullScreen,
    /// So many vertices.
    Vertices(u32),
    /// As a `DrawIndirect` at a byte offset says.
    Indirect(&'a Buffer, u64),
    /// As a `DrawIndexedIndirect` at a byte offset says, with 32-bit indices.
    IndexedIndirect {
        /// Indices.
        indices: &'a Buffer,
        /// Arguments.
        arguments: &'a Buffer,
        /// Byte offset of the arguments.
        offset: u64,
    },
}

/// A colour target.
#[derive(Clone, Copy, Debug)]
pub struct Attachment<'a> {
    /// Drawn into.
    pub texture: &'a Texture,
    /// Array layer.
    pub layer: u32,
    /// Colour before the first draw; `None` keeps what is there.
    pub clear: Option<wgpu::Color>,
    /// Receives the samples' mean.
    pub resolve: Option<&'a Texture>,
}

/// A depth target.
#[derive(Clone, Copy, Debug)]
pub struct DepthAttachment<'a> {
    /// Drawn into.
    pub texture: &'a Texture,
    /// Array layer.
    pub layer: u32,
    /// Depth before the first draw; `None` keeps what is there.
    pub clear: Option<f32>,
}

/// Where a render pass draws.
#[derive(Clone, Copy, Debug, Default)]
pub struct Targets<'a> {
    /// Colour targets.
    pub color: &'a [Attachment<'a>],
    /// Depth target.
    pub depth: Option<DepthAttachment<'a>>,
}

/// A render pass being recorded.
pub struct RenderPass<'a, 'e> {
    pub(crate) recorder: &'a mut Recorder,
    pub(crate) raw: wgpu::RenderPass<'e>,
    pub(crate) name: &'static str,
}

impl std::fmt::Debug for RenderPass<'_, '_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RenderPass").field("name", &self.name).finish_non_exhaustive()
    }
}

impl RenderPass<'_, '_> {
    /// Draws.
    ///
    /// # Panics
    /// When `binds` lacks a handle that the shader needs, or (debug) it reads what was not written.
    pub fn draw(&mut self, pipeline: &RenderPipeline, shared: &[&Group], binds: &[Bind<'_>], draw: Draw<'_>) {
        let interface = &pipeline.interface;
        self.recorder.note(self.name, interface, shared, binds);
        self.raw.set_pipeline(&pipeline.raw);
        for group in shared.iter().filter(|g| interface.shared.contains(&g.index)) {
            self.raw.set_bind_group(group.index, &group.raw, &[]);
        }
        for slot in [0, 1] {
            if let Some(group) = self.recorder.own_group(interface, slot, binds) {
                self.raw.set_bind_group(FIRST_OWN_GROUP + slot as u32, &group, &[]);
            }
        }
        match draw {
            Draw::Vertices(count) => self.raw.draw(0..count, 0..1),
            Draw::FullScreen => self.raw.draw(0..3, 0..1),
            Draw::Indirect(buffer, offset) => self.raw.draw_indirect(buffer.raw(), offset),
            Draw::IndexedIndirect { indices, arguments, offset } => {
                self.raw.set_index_buffer(indices.raw().slice(..), wgpu::IndexFormat::Uint32);
                self.raw.draw_indexed_indirect(arguments.raw(), offset);
            }
        }
    }
}
