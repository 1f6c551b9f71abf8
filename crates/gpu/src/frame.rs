//! Recording a frame.
//!
//! A pass is a pipeline and the handles that fill its bind groups. What it reads is group 0–2, what it writes is
//! group 3 and its attachments; nothing is listed by hand.

use std::collections::{HashMap, HashSet};
use std::sync::Weak;

use wgpu_profiler::GpuProfiler;

use crate::log::{Bound, Resource, Resources};
use crate::pipeline::{FIRST_OWN_GROUP, Interface};
use crate::profile::{FrameTimings, profiler};
use crate::render_pass::{RenderPass, Targets};
use crate::resource::{Binding, Group, Life, Texture, next_id};
use crate::{Buffer, ComputePipeline, Gpu, GpuError};

/// A handle for the WESL global of that name.
pub type Bind<'a> = (&'static str, Binding<'a>);

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

/// One pass in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassLog {
    /// `technique/step`.
    pub name: &'static str,
    /// Names of what it reads.
    pub reads: Vec<&'static str>,
    /// Names of what it writes.
    pub writes: Vec<&'static str>,
}

struct CachedGroup {
    bind_group: wgpu::BindGroup,
    // Of the handles it was made from: a group whose textures nobody holds any more must let go of them.
    alive: Vec<Weak<()>>,
}

/// What lives from frame to frame: bind groups, staging memory, the profiler and the last frame's log.
pub struct Recorder {
    gpu: Gpu,
    profiler: Option<GpuProfiler>,
    groups: HashMap<Box<[u64]>, CachedGroup>,
    belt: wgpu::util::StagingBelt,
    key: Vec<u64>,
    log: Vec<PassLog>,
    resources: Resources,
    written: HashSet<u64>,
    timings: Vec<FrameTimings>,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("groups", &self.groups.len()).finish_non_exhaustive()
    }
}

impl Recorder {
    /// A recorder; with `timed`, every pass is timed where the device can.
    pub fn new(gpu: &Gpu, timed: bool) -> Self {
        Self {
            profiler: profiler(gpu, timed),
            groups: HashMap::new(),
            belt: wgpu::util::StagingBelt::new(gpu.device.clone(), 1 << 16),
            key: Vec::new(),
            log: Vec::new(),
            resources: Resources::default(),
            written: HashSet::new(),
            timings: Vec::new(),
            gpu: gpu.clone(),
        }
    }

    /// Starts a frame with an encoder of its own.
    pub fn begin(&mut self) -> Frame<'_> {
        let encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        self.start(Encoder::Own(encoder))
    }

    /// Starts a frame in a host program's encoder. [`Frame::submit`] then only ends it: the host submits, and tells a recorder that
    /// times passes ([`Recorder::submitted`]).
    pub fn begin_in<'r>(&'r mut self, encoder: &'r mut wgpu::CommandEncoder) -> Frame<'r> {
        self.start(Encoder::Host(encoder))
    }

    fn start<'r>(&'r mut self, encoder: Encoder<'r>) -> Frame<'r> {
        self.log.clear();
        self.resources.clear();
        self.written.clear();
        self.groups.retain(|_, group| group.alive.iter().all(|handle| handle.strong_count() > 0));
        Frame { recorder: self, encoder, id: next_id() }
    }

    /// To be called once the host submitted a frame's commands.
    pub fn submitted(&mut self) {
        if let Some(profiler) = &mut self.profiler {
            if let Err(e) = profiler.end_frame() {
                tracing::warn!("GPU timings of a frame were lost: {e}");
            }
            while let Some(results) = profiler.process_finished_frame(self.gpu.queue.get_timestamp_period()) {
                self.timings.push(FrameTimings::from_results(&results));
            }
        }
    }

    /// Timings that have arrived since the last call, oldest first. They lag the frames they belong to.
    pub fn take_timings(&mut self) -> Vec<FrameTimings> {
        std::mem::take(&mut self.timings)
    }

    /// Blocks until all submitted frames are done and their timings here. For command lines and tests only.
    ///
    /// # Errors
    /// When the device was lost or reported an error.
    pub fn wait(&mut self) -> Result<(), GpuError> {
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|e| GpuError::DeviceLost(e.to_string()))?;
        if let Some(profiler) = &mut self.profiler {
            while let Some(results) = profiler.process_finished_frame(self.gpu.queue.get_timestamp_period()) {
                self.timings.push(FrameTimings::from_results(&results));
            }
        }
        self.gpu.check()
    }

    /// The passes of the last frame with what they read and wrote.
    pub fn log(&self) -> &[PassLog] {
        &self.log
    }

    /// The textures and buffers that the last frame's passes read or wrote and that still exist, in the order in which
    /// they were first touched.
    pub fn resources(&self) -> impl Iterator<Item = Resource> + '_ {
        self.resources.iter()
    }

    /// The bind group of a pass' own group `slot` (0 inputs, 1 outputs), made once and found again.
    pub(crate) fn own_group(
        &mut self,
        interface: &Interface,
        slot: usize,
        binds: &[Bind<'_>],
    ) -> Option<wgpu::BindGroup> {
        let (layout_id, layout) = interface.layouts[slot].as_ref()?;
        self.key.clear();
        self.key.push(*layout_id);
        for wanted in &interface.own[slot] {
            self.key.extend(find(interface, binds, &wanted.name).key());
        }
        if let Some(group) = self.groups.get(self.key.as_slice()) {
            return Some(group.bind_group.clone());
        }
        let entries: Vec<_> = interface.own[slot]
            .iter()
            .map(|wanted| wgpu::BindGroupEntry {
                binding: wanted.binding,
                resource: find(interface, binds, &wanted.name).resource(),
            })
            .collect();
        self.gpu.created.add();
        let bind_group = self.gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&interface.label),
            layout,
            entries: &entries,
        });
        let handles = interface.own[slot].iter().map(|wanted| find(interface, binds, &wanted.name));
        let alive = handles.filter_map(Binding::alive).collect();
        let cached = CachedGroup { bind_group: bind_group.clone(), alive };
        self.groups.insert(self.key.as_slice().into(), cached);
        Some(bind_group)
    }

    /// Notes what a pipeline reads and writes.
    ///
    /// # Panics
    /// In debug builds, when it reads what this frame has not written: a pass is missing or comes too late.
    pub(crate) fn note(
        &mut self,
        name: &'static str,
        interface: &Interface,
        shared: &[&Group],
        binds: &[Bind<'_>],
    ) {
        for group in shared.iter().filter(|g| interface.shared.contains(&g.index)) {
            for (binding, bound) in &group.reads {
                self.read(name, binding, bound);
            }
        }
        for (slot, own) in interface.own.iter().enumerate() {
            for wanted in own {
                if let Some(bound) = Bound::of(find(interface, binds, &wanted.name)) {
                    if slot == 1 { self.wrote(name, &bound) } else { self.read(name, bound.name, &bound) }
                }
            }
        }
    }

    fn read(&mut self, pass: &'static str, resource: &'static str, bound: &Bound) {
        debug_assert!(
            bound.life == Life::Kept || self.written.contains(&bound.id),
            "pass {pass} reads {resource} before this frame wrote it"
        );
        self.resources.touch(pass, bound, false);
        if let Some(entry) = self.log.last_mut()
            && !entry.reads.contains(&resource)
        {
            entry.reads.push(resource);
        }
    }

    fn wrote(&mut self, pass: &'static str, bound: &Bound) {
        self.written.insert(bound.id);
        self.resources.touch(pass, bound, true);
        if let Some(entry) = self.log.last_mut()
            && !entry.writes.contains(&bound.name)
        {
            entry.writes.push(bound.name);
        }
    }

    fn draws_to(&mut self, pass: &'static str, texture: &Texture) {
        self.wrote(pass, &Bound::texture(texture));
    }
}

/// The handle given for a shader's global.
///
/// # Panics
/// When none was given: a mistake in the pass' Rust code, found at its first frame.
fn find<'a>(interface: &Interface, binds: &[Bind<'a>], name: &str) -> Binding<'a> {
    match binds.iter().find(|(given, _)| *given == name) {
        Some((_, binding)) => *binding,
        None => panic!("{} needs a handle for `{name}`, but none was given", interface.label),
    }
}

/// Whose encoder a frame is recorded into.
#[derive(Debug)]
enum Encoder<'r> {
    Own(wgpu::CommandEncoder),
    Host(&'r mut wgpu::CommandEncoder),
}

impl std::ops::Deref for Encoder<'_> {
    type Target = wgpu::CommandEncoder;

    fn deref(&self) -> &wgpu::CommandEncoder {
        match self {
            Self::Own(encoder) => encoder,
            Self::Host(encoder) => encoder,
        }
    }
}

impl std::ops::DerefMut for Encoder<'_> {
    fn deref_mut(&mut self) -> &mut wgpu::CommandEncoder {
        match self {
            Self::Own(encoder) => encoder,
            Self::Host(encoder) => encoder,
        }
    }
}

/// A frame being recorded.
#[derive(Debug)]
pub struct Frame<'r> {
    recorder: &'r mut Recorder,
    encoder: Encoder<'r>,
    id: u64,
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
        recorder.log.push(PassLog { name, reads: Vec::new(), writes: Vec::new() });
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
            profiler.end_query(&mut *self.encoder, query);
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
        recorder.log.push(PassLog { name, reads: Vec::new(), writes: Vec::new() });
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
            profiler.end_query(&mut *self.encoder, query);
        }
    }

    /// Ends recording, and submits a frame that has an encoder of its own; one in a host program's encoder is left to the
    /// host.
    pub fn submit(mut self) {
        self.close();
        if let Encoder::Own(encoder) = self.encoder {
            self.recorder.gpu.queue.submit([encoder.finish()]);
            self.recorder.submitted();
        }
    }

    fn close(&mut self) {
        if let Some(profiler) = &mut self.recorder.profiler {
            profiler.resolve_queries(&mut self.encoder);
        }
        self.recorder.belt.finish_and_recall_on_submit(&self.encoder);
    }
}
