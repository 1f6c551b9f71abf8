//! Choosing an adapter and making a device with what chiaro can use.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::ThreadId;

use crate::GpuError;

/// Which adapter to take.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum AdapterChoice {
    /// `CHIARO_ADAPTER` (part of a name) if set, else the best: discrete, integrated, virtual, software.
    #[default]
    Best,
    /// The first whose name contains this, whatever the case.
    Named(String),
    /// A software adapter.
    Software,
}

/// How much to ask of the adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LimitChoice {
    /// What WebGPU guarantees, with larger buffers and textures where the adapter has them.
    #[default]
    Adapter,
    /// Exactly what WebGPU guarantees and no optional feature but timestamps: what every browser has. [`Gpu::new`] then
    /// holds everything to WebGPU's own rules.
    Guaranteed,
}

/// How to choose and open a device.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Which adapter.
    pub adapter: AdapterChoice,
    /// Which limits.
    pub limits: LimitChoice,
}

/// Optional features that chiaro uses where they exist; everything works without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionalFeatures {
    /// GPU time of every pass.
    pub timestamps: bool,
    /// Triangle number in the fragment stage: the visibility pass shares vertices between triangles.
    pub primitive_index: bool,
    /// Depth clamp: casters in front of a shadow view's near plane are kept.
    pub depth_clip_control: bool,
    /// Filtering of 32-bit float textures: moment shadow maps in full precision.
    pub float32_filterable: bool,
}

impl OptionalFeatures {
    const TABLE: [(wgpu::Features, &'static str, &'static str); 4] = [
        (wgpu::Features::TIMESTAMP_QUERY, "timestamp-query", "GPU time of every pass"),
        (wgpu::Features::PRIMITIVE_INDEX, "primitive-index", "visibility pass with shared vertices"),
        (wgpu::Features::DEPTH_CLIP_CONTROL, "depth-clip-control", "shadow casters before the near plane"),
        (wgpu::Features::FLOAT32_FILTERABLE, "float32-filterable", "full-precision moment shadow maps"),
    ];

    /// All of them as wgpu's flags.
    pub fn all_flags() -> wgpu::Features {
        Self::TABLE.iter().fold(wgpu::Features::empty(), |all, (flag, _, _)| all | *flag)
    }

    fn from_flags(flags: wgpu::Features) -> Self {
        Self {
            timestamps: flags.contains(wgpu::Features::TIMESTAMP_QUERY),
            primitive_index: flags.contains(wgpu::Features::PRIMITIVE_INDEX),
            depth_clip_control: flags.contains(wgpu::Features::DEPTH_CLIP_CONTROL),
            float32_filterable: flags.contains(wgpu::Features::FLOAT32_FILTERABLE),
        }
    }
}

/// Counts of GPU objects made through [`Gpu`] since it exists. A frame in steady state adds none.
#[derive(Debug, Default)]
pub struct Created {
    objects: AtomicU64,
    pipelines: Mutex<HashMap<ThreadId, u64>>,
}

impl Created {
    /// Buffers, textures, bind groups and pipelines made so far.
    pub fn total(&self) -> u64 {
        self.objects.load(Ordering::Relaxed)
    }

    /// Pipelines made so far, by any thread.
    pub fn pipelines(&self) -> u64 {
        self.pipelines.lock().unwrap_or_else(PoisonError::into_inner).values().sum()
    }

    /// Pipelines made so far by the calling thread. A thread that draws frames should make none.
    pub fn pipelines_here(&self) -> u64 {
        let pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        pipelines.get(&std::thread::current().id()).copied().unwrap_or(0)
    }

    pub(crate) fn add_pipeline(&self) {
        self.add();
        let mut pipelines = self.pipelines.lock().unwrap_or_else(PoisonError::into_inner);
        *pipelines.entry(std::thread::current().id()).or_default() += 1;
    }

    pub(crate) fn add(&self) {
        self.objects.fetch_add(1, Ordering::Relaxed);
    }
}

/// A device, its queue, and what it can do. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// wgpu's device.
    pub device: wgpu::Device,
    /// wgpu's queue.
    pub queue: wgpu::Queue,
    /// Who made the adapter, and of what kind it is.
    pub info: wgpu::AdapterInfo,
    /// Optional features in use.
    pub optional: OptionalFeatures,
    /// Limits the device was made with.
    pub limits: wgpu::Limits,
    /// Whether compiled pipelines could be kept in files of one's own, as far as the device or its adapter tells. No cache
    /// is in use.
    pub offers_pipeline_cache: bool,
    /// Objects made so far.
    pub created: Arc<Created>,
    samples: Arc<[u32]>,
    problems: Arc<Mutex<Vec<GpuError>>>,
}

impl Gpu {
    /// Features that a device handed to [`Gpu::adopt`] must have: none. [`OptionalFeatures::all_flags`] are used where it
    /// has them.
    pub fn required_features() -> wgpu::Features {
        wgpu::Features::empty()
    }

    /// Limits that a device handed to [`Gpu::adopt`] must have: those WebGPU guarantees. Larger buffers and textures are
    /// used where it has them.
    pub fn required_limits() -> wgpu::Limits {
        wgpu::Limits::default()
    }

    /// Opens a device.
    ///
    /// # Errors
    /// When no adapter matches, or it cannot give the guaranteed WebGPU limits.
    pub async fn new(options: GpuOptions) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::PRIMARY;
        if options.limits == LimitChoice::Guaranteed {
            // wgpu then knows nothing that a browser would not.
            descriptor.flags |= wgpu::InstanceFlags::STRICT_WEBGPU_COMPLIANCE;
        }
        let instance = wgpu::Instance::new(descriptor.with_env());
        let adapters = instance.enumerate_adapters(wgpu::Backends::all()).await;
        let adapter = choose(adapters, &options.adapter)?;
        Self::open(&adapter, options.limits).await
    }

    /// Opens a device that can present to a surface; the adapter tells what the surface can do.
    ///
    /// # Errors
    /// When no adapter that matches can present to it, or it cannot give the guaranteed WebGPU limits.
    pub async fn for_surface(
        instance: &wgpu::Instance,
        surface: &wgpu::Surface<'_>,
        options: GpuOptions,
    ) -> Result<(Self, wgpu::Adapter), GpuError> {
        let mut adapters = instance.enumerate_adapters(wgpu::Backends::all()).await;
        adapters.retain(|adapter| adapter.is_surface_supported(surface));
        let adapter = choose(adapters, &options.adapter)?;
        Ok((Self::open(&adapter, options.limits).await?, adapter))
    }

    /// Opens a device on an adapter, for programs that choose it themselves (a window's surface, say).
    ///
    /// # Errors
    /// When the adapter cannot give the guaranteed WebGPU limits.
    pub async fn open(adapter: &wgpu::Adapter, limits: LimitChoice) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        let mut wanted = OptionalFeatures::all_flags() | ADAPTER_FORMATS;
        let mut required_limits = wgpu::Limits::default();
        match limits {
            LimitChoice::Guaranteed => {
                wanted = wgpu::Features::TIMESTAMP_QUERY;
                if adapter.limits().max_buffers_and_acceleration_structures_per_shader_stage == 0 {
                    // Strict about WebGPU: there are no limits of wgpu's own.
                    required_limits.zero_native_only();
                }
            }
            LimitChoice::Adapter => {
                let has = adapter.limits();
                required_limits.max_buffer_size = has.max_buffer_size;
                required_limits.max_storage_buffer_binding_size = has.max_storage_buffer_binding_size;
                required_limits.max_texture_dimension_2d = has.max_texture_dimension_2d;
                required_limits.max_texture_array_layers = has.max_texture_array_layers;
                required_limits.max_compute_workgroup_storage_size = has.max_compute_workgroup_storage_size;
            }
        }
        let missing = missing_limits(&required_limits, &adapter.limits());
        if !missing.is_empty() {
            return Err(GpuError::Missing { adapter: info.name, what: missing.join(", ") });
        }
        let (device, queue) = adapter
            .request_device(&wgpu::DeviceDescriptor {
                label: Some("chiaro"),
                required_features: adapter.features() & wanted,
                required_limits,
                ..Default::default()
            })
            .await
            .map_err(|e| GpuError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let gpu = Self::with(adapter, device, queue);
        gpu.hear();
        Ok(gpu)
    }

    /// Uses a host program's device, with whatever features and limits beyond the required ones it was made with.
    ///
    /// The device's handlers stay the host's: its uncaptured-error handler and its device-lost callback hear what they
    /// would hear without chiaro, and [`Gpu::check`] has nothing to tell. Errors of chiaro's own shaders and pipelines are
    /// returned by what compiles them.
    ///
    /// # Errors
    /// [`GpuError::Missing`], which names every feature and limit that the device lacks.
    pub fn adopt(
        adapter: &wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Result<Self, GpuError> {
        let limits = device.limits();
        let mut required = Self::required_limits();
        if limits.max_buffers_and_acceleration_structures_per_shader_stage == 0 {
            // Strict about WebGPU: there are no limits of wgpu's own.
            required.zero_native_only();
        }
        let features = Self::required_features() - device.features();
        let mut missing: Vec<_> =
            features.iter_names().map(|(name, _)| format!("the feature {name}")).collect();
        missing.extend(missing_limits(&required, &limits));
        if !missing.is_empty() {
            let adapter = format!("the device on {}", adapter.get_info().name);
            return Err(GpuError::Missing { adapter, what: missing.join(", ") });
        }
        Ok(Self::with(adapter, device, queue))
    }

    fn with(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self {
            info: adapter.get_info(),
            optional: OptionalFeatures::from_flags(device.features()),
            limits: device.limits(),
            offers_pipeline_cache: adapter.features().contains(wgpu::Features::PIPELINE_CACHE),
            created: Arc::default(),
            samples: sample_counts(&device, adapter),
            problems: Arc::default(),
            device,
            queue,
        }
    }

    /// Takes down what the device reports, for [`Gpu::check`].
    fn hear(&self) {
        let sink = self.problems.clone();
        self.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            push(&sink, GpuError::Device(error.to_string()));
        }));
        let sink = self.problems.clone();
        self.device.set_device_lost_callback(move |reason, message| {
            // A device that its owner dropped is no news.
            if reason != wgpu::DeviceLostReason::Destroyed {
                push(&sink, GpuError::DeviceLost(message));
            }
        });
    }

    /// The first error that wgpu reported since the last call; a lost device comes before what follows from it. Of an
    /// adopted device nothing: its host hears of errors.
    ///
    /// # Errors
    /// That error.
    pub fn check(&self) -> Result<(), GpuError> {
        let mut problems = self.problems.lock().unwrap_or_else(PoisonError::into_inner);
        let lost = problems.iter().position(|error| matches!(error, GpuError::DeviceLost(_)));
        let first = problems.drain(..).nth(lost.unwrap_or(0));
        first.map_or(Ok(()), Err)
    }

    /// Samples per pixel that pictures in half floats and their depth can have, ascending.
    pub fn sample_counts(&self) -> &[u32] {
        &self.samples
    }

    /// Whether the adapter runs on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }

    /// Whether the adapter's compute is far stronger than its raster hardware: the data-centre cards that NVIDIA builds with
    /// only a few units for graphics.
    pub fn rasters_slowly(&self) -> bool {
        const CARDS: [&str; 10] =
            ["A100", "A800", "H100", "H800", "H200", "H20", "GH200", "B100", "B200", "GB200"];
        self.info.name.split([' ', '-', '_']).any(|word| CARDS.contains(&word))
    }

    /// Optional features with what they are for, and whether this device has them.
    pub fn feature_table(&self) -> impl Iterator<Item = (&'static str, &'static str, bool)> {
        let has = self.device.features();
        OptionalFeatures::TABLE.into_iter().map(move |(flag, name, what)| (name, what, has.contains(flag)))
    }
}

/// What textures can have beyond what WebGPU guarantees, samples per pixel among it.
const ADAPTER_FORMATS: wgpu::Features = wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES;
/// Samples per pixel that WebGPU guarantees.
const GUARANTEED_SAMPLES: [u32; 2] = [1, 4];

fn sample_counts(device: &wgpu::Device, adapter: &wgpu::Adapter) -> Arc<[u32]> {
    if !device.features().contains(ADAPTER_FORMATS) {
        return GUARANTEED_SAMPLES.into();
    }
    let [color, depth] = [wgpu::TextureFormat::Rgba16Float, wgpu::TextureFormat::Depth32Float]
        .map(|format| adapter.get_texture_format_features(format).flags);
    let both = |count: &u32| color.sample_count_supported(*count) && depth.sample_count_supported(*count);
    [1, 2, 4, 8].into_iter().filter(both).collect()
}

/// Every limit of `wanted` that is worse in `present`, with both values.
fn missing_limits(wanted: &wgpu::Limits, present: &wgpu::Limits) -> Vec<String> {
    let mut missing = Vec::new();
    wanted.check_limits_with_fail_fn(present, false, |name, wanted, present| {
        missing.push(format!("{name} = {wanted} (it has {present})"));
    });
    missing
}

fn push(problems: &Mutex<Vec<GpuError>>, error: GpuError) {
    tracing::error!("{error}");
    problems.lock().unwrap_or_else(PoisonError::into_inner).push(error);
}

fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

fn choose(mut adapters: Vec<wgpu::Adapter>, choice: &AdapterChoice) -> Result<wgpu::Adapter, GpuError> {
    let environment = std::env::var("CHIARO_ADAPTER").ok().filter(|name| !name.is_empty());
    let choice = match (choice, environment) {
        (AdapterChoice::Best, Some(name)) => AdapterChoice::Named(name),
        (choice, _) => choice.clone(),
    };
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    let found: Vec<String> = adapters.iter().map(|adapter| adapter.get_info().name).collect();
    let matches = |info: &wgpu::AdapterInfo| match &choice {
        AdapterChoice::Best => true,
        AdapterChoice::Named(part) => info.name.to_lowercase().contains(&part.to_lowercase()),
        AdapterChoice::Software => info.device_type == wgpu::DeviceType::Cpu,
    };
    adapters.into_iter().find(|adapter| matches(&adapter.get_info())).ok_or_else(|| GpuError::NoAdapter {
        wanted: match choice {
            AdapterChoice::Best => "at all".into(),
            AdapterChoice::Named(part) => format!("named “{part}”"),
            AdapterChoice::Software => "that runs in software".into(),
        },
        found: if found.is_empty() { "none".into() } else { found.join(", ") },
    })
}
