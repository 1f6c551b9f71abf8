//! Recording a frame.
//!
//! A pass is a pipeline and the handles that fill its bind groups. What it reads is group 0–2, what it writes is
//! group 3 and its attachments; nothing is listed by hand.

use crate::group::{FIRST_OWN_GROUP, Group};
use crate::log::Resource;
use crate::recorder::{Bind, Recorder};
use crate::render_pass::{RenderPass, Targets};
use crate::resource::next_id;
use crate::{Buffer, ComputePipeline, Gpu};

/// How many workgroups to start.
#[derive(Clone, Copy, Debug)]
pub enum Dispatch<'a> {
    /// Exactly these.
    Groups([u32; 3]),
    /// Enough to cover so many invocations with the pipeline's own workgroup size.
    Threads([u32; 3]),
    /// As many as a buffer says at a byte offset.
    Indirect(&'a Buffer, u64),
}

/// A frame being recorded.
#[derive(Debug)]
pub struct Frame<'r> {
    recorder: &'r mut Recorder,
    encoder: wgpu::CommandEncoder,
    id: u64,
}

impl Recorder {
    /// Starts a frame with an encoder of its own.
    pub fn begin(&mut self) -> Frame<'_> {
        let encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        self.begin_in(encoder)
    }

    /// Starts a frame in a host program's encoder. Hand it back to the host with [`Frame::finish`], and call
    /// [`Recorder::submitted`] after the host submitted it.
    pub fn begin_in(&mut self, encoder: wgpu::CommandEncoder) -> Frame<'_> {
        self.forget();
        Frame { recorder: self, encoder, id: next_id() }
    }
}

impl Frame<'_> {
    /// A number that no other frame has.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The device this frame runs on.
    pub fn gpu(&self) -> &Gpu {
        &self.recorder.gpu
    }

    /// The textures and buffers that passes touched so far; see [`Recorder::resources`].
    pub fn resources(&self) -> impl Iterator<Item = Resource> + '_ {
        self.recorder.resources()
    }

    /// Copies `data` to the start of a buffer before the passes that follow.
    pub fn upload<T: bytemuck::NoUninit>(&mut self, buffer: &Buffer, data: &[T]) {
        self.upload_at(buffer, 0, data);
    }

    /// The same from a byte offset on.
    pub fn upload_at<T: bytemuck::NoUninit>(&mut self, buffer: &Buffer, offset: u64, data: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let Some(size) = std::num::NonZeroU64::new(bytes.len() as u64) else { return };
        let belt = &mut self.recorder.belt;
        belt.write_buffer(&mut self.encoder, buffer.raw(), offset, size).copy_from_slice(bytes);
        self.recorder.written.insert(buffer.id());
    }

    /// Zeroes a buffer before the passes that follow.
    pub fn clear(&mut self, buffer: &Buffer) {
        self.encoder.clear_buffer(buffer.raw(), 0, None);
        self.recorder.written.insert(buffer.id());
    }

    /// Copies bytes from one buffer to another, each from its byte offset on, before the passes that follow.
    pub fn copy(&mut self, (from, from_at): (&Buffer, u64), (to, to_at): (&Buffer, u64), size: u64) {
        self.encoder.copy_buffer_to_buffer(from.raw(), from_at, to.raw(), to_at, size);
        self.recorder.written.insert(to.id());
    }

    /// Records a compute pass.
    ///
    /// # Panics
    /// When `binds` lacks a handle that the shader needs, or (debug) it reads what was not written.
    pub fn compute(
        &mut self,
        name: &'static str,
        pipeline: &ComputePipeline,
        shared: &[&Group],
        binds: &[Bind<'_>],
        dispatch: Dispatch<'_>,
    ) {
        let recorder = &mut *self.recorder;
        let interface = &pipeline.interface;
        recorder.start_pass(name);
        recorder.note(name, interface, shared, binds);
        let own = [0, 1].map(|slot| recorder.own_group(interface, slot, binds));
        let query = recorder.profiler.as_ref().map(|p| p.begin_pass_query(name, &mut self.encoder));
        {
            let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(name),
                timestamp_writes: query
                    .as_ref()
                    .and_then(wgpu_profiler::GpuProfilerQuery::compute_pass_timestamp_writes),
            });
            pass.set_pipeline(&pipeline.raw);
            for group in shared.iter().filter(|g| interface.shared.contains(&g.index)) {
                pass.set_bind_group(group.index, &group.raw, &[]);
            }
            for (index, group) in (FIRST_OWN_GROUP..).zip(&own) {
                if let Some(group) = group {
                    pass.set_bind_group(index, group, &[]);
                }
            }
            match dispatch {
                Dispatch::Groups([x, y, z]) => pass.dispatch_workgroups(x, y, z),
                Dispatch::Threads(threads) => {
                    let [x, y, z] = std::array::from_fn(|i| threads[i].div_ceil(interface.workgroup[i]));
                    pass.dispatch_workgroups(x, y, z);
                }
                Dispatch::Indirect(buffer, offset) => pass.dispatch_workgroups_indirect(buffer.raw(), offset),
            }
        }
        if let (Some(profiler), Some(query)) = (&recorder.profiler, query) {
            profiler.end_query(&mut self.encoder, query);
        }
    }

    /// Records a render pass; `draws` records what is drawn in it.
    pub fn render(
        &mut self,
        name: &'static str,
        targets: Targets<'_>,
        draws: impl FnOnce(&mut RenderPass<'_, '_>),
    ) {
        let recorder = &mut *self.recorder;
        recorder.start_pass(name);
        for attachment in targets.color {
            recorder.draws_to(name, attachment.texture);
            if let Some(resolve) = attachment.resolve {
                recorder.draws_to(name, resolve);
            }
        }
        if let Some(depth) = targets.depth {
            recorder.draws_to(name, depth.texture);
        }
        let color: Vec<_> = targets
            .color
            .iter()
            .map(|attachment| {
                Some(wgpu::RenderPassColorAttachment {
                    view: attachment.texture.layer_view(attachment.layer),
                    depth_slice: None,
                    resolve_target: attachment.resolve.map(|texture| texture.layer_view(0)),
                    ops: wgpu::Operations {
                        load: attachment.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                        store: wgpu::StoreOp::Store,
                    },
                })
            })
            .collect();
        let query = recorder.profiler.as_ref().map(|p| p.begin_pass_query(name, &mut self.encoder));
        {
            let raw = self.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(name),
                color_attachments: &color,
                depth_stencil_attachment: targets.depth.map(|depth| wgpu::RenderPassDepthStencilAttachment {
                    view: depth.texture.layer_view(depth.layer),
                    depth_ops: Some(wgpu::Operations {
                        load: depth.clear.map_or(wgpu::LoadOp::Load, wgpu::LoadOp::Clear),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                timestamp_writes: query
                    .as_ref()
                    .and_then(wgpu_profiler::GpuProfilerQuery::render_pass_timestamp_writes),
                ..Default::default()
            });
            draws(&mut RenderPass { recorder, raw, name });
        }
        if let (Some(profiler), Some(query)) = (&recorder.profiler, query) {
            profiler.end_query(&mut self.encoder, query);
        }
    }

    /// Ends recording and submits.
    pub fn submit(mut self) {
        self.close();
        self.recorder.gpu.queue.submit([self.encoder.finish()]);
        self.recorder.submitted();
    }

    /// Ends recording and gives the encoder back to a host program.
    pub fn finish(mut self) -> wgpu::CommandEncoder {
        self.close();
        self.encoder
    }

    fn close(&mut self) {
        if let Some(profiler) = &mut self.recorder.profiler {
            profiler.resolve_queries(&mut self.encoder);
        }
        self.recorder.belt.finish_and_recall_on_submit(&self.encoder);
    }
}
