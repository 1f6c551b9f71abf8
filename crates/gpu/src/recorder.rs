//! What frames are recorded with: bind groups, staging memory, the log and timings.

use std::collections::{HashMap, HashSet};
use std::sync::Weak;

use wgpu_profiler::GpuProfiler;

use crate::group::Group;
use crate::handle::Bound;
use crate::log::{Resource, Resources};
use crate::pipeline::Interface;
use crate::profile::{FrameTimings, profiler};
use crate::resource::{Binding, Life, Texture};
use crate::{Gpu, GpuError};

/// A handle for the WESL global of that name.
pub type Bind<'a> = (&'static str, Binding<'a>);

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
    pub(crate) gpu: Gpu,
    pub(crate) profiler: Option<GpuProfiler>,
    groups: HashMap<Box<[u64]>, CachedGroup>,
    pub(crate) belt: wgpu::util::StagingBelt,
    key: Vec<u64>,
    log: Vec<PassLog>,
    resources: Resources,
    pub(crate) written: HashSet<u64>,
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

    /// Forgets the last frame, and bind groups of what nobody holds any more.
    pub(crate) fn forget(&mut self) {
        self.log.clear();
        self.resources.clear();
        self.written.clear();
        self.groups.retain(|_, group| group.alive.iter().all(|handle| handle.strong_count() > 0));
    }

    /// To be called once the frame's commands were submitted.
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

    /// A pass begins.
    pub(crate) fn start_pass(&mut self, name: &'static str) {
        self.log.push(PassLog { name, reads: Vec::new(), writes: Vec::new() });
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

    pub(crate) fn draws_to(&mut self, pass: &'static str, texture: &Texture) {
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
