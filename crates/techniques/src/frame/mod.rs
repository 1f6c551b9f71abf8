//! Group 0, the frame: Rust twins of `frame.wesl`, checked against naga by a test.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{self, BindingType, BufferBindingType, ShaderStages};
use chiaro_gpu::{Buffer, Frame, Gpu, Group, GroupLayout, Life, Texture, TextureOptions};

/// What is the same for every pass of a frame; see `frame.wesl` for meanings and units.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct FrameData {
    pub clip_from_ws: [[f32; 4]; 4],
    pub relative_from_clip: [[f32; 4]; 4],
    pub eye_ws: [f32; 3],
    pub orthographic: u32,
    pub forward_ws: [f32; 3],
    pub footprint_scale: f32,
    pub size_px: [u32; 2],
    pub directional_lights: u32,
    pub local_lights: u32,
    pub grid: [u32; 4],
    pub grid_slices: [f32; 2],
    pub lighting_model: u32,
    pub normal_maps: u32,
    pub ambient: [[f32; 4]; 3],
    pub environment: [[[f32; 4]; 4]; 3],
    pub sky: [f32; 3],
    pub radiance_scale: f32,
    pub environment_diffuse: f32,
    pub anisotropy: u32,
    pub environment_nits: f32,
    pub environment_share: f32,
    pub environment_turn: [f32; 2],
    pub gathers: u32,
    pub mirrors_sources: f32,
    pub show_direct: f32,
    pub show_indirect: f32,
    pub show_caustics: f32,
    pub show_unlit: f32,
    pub shadow: ShadowParameters,
}

impl FrameData {
    /// The same view without light, for the colour that unlit materials bring to the picture: stored as it is, 0..1 of the
    /// display's white, times `weight`.
    #[must_use]
    pub fn without_light(&self, weight: f32) -> Self {
        let [columns, rows, slices, _] = self.grid;
        Self {
            directional_lights: 0,
            local_lights: 0,
            grid: [columns, rows, slices, 0],
            ambient: Zeroable::zeroed(),
            environment: Zeroable::zeroed(),
            sky: [0.0; 3],
            radiance_scale: 1.0,
            environment_nits: 0.0,
            environment_share: 0.0,
            show_direct: 0.0,
            gathers: self.gathers & Self::FOLLOWED,
            show_indirect: 0.0,
            show_caustics: 0.0,
            show_unlit: weight,
            ..*self
        }
    }

    /// Of `gathers`: `irradiance` holds indirect light.
    pub const BOUNCED: u32 = 1;
    /// Of `gathers`: `source_irradiance` holds light of what glows and surrounds the scene.
    pub const SOURCED: u32 = 2;
    /// Of `gathers`: `caustics` holds light through mirrors and glass.
    pub const CAUSTICS: u32 = 4;
    /// Of `gathers`: rays follow what mirrors and smooth glass show, and shading leaves it out.
    pub const FOLLOWED: u32 = 8;

    /// The same view of direct light alone, as far as it is shown.
    #[must_use]
    pub fn direct_only(&self) -> Self {
        Self {
            gathers: self.gathers & (Self::SOURCED | Self::FOLLOWED),
            show_indirect: 0.0,
            show_caustics: 0.0,
            ..*self
        }
    }

    /// The same view of caustics alone, as far as they are shown.
    #[must_use]
    pub fn caustics_only(&self) -> Self {
        Self {
            radiance_scale: self.radiance_scale,
            gathers: self.gathers & (Self::CAUSTICS | Self::FOLLOWED),
            show_caustics: self.show_caustics,
            ..self.without_light(0.0)
        }
    }

    /// Radiance behind everything in stored units; `None` where that is an environment map.
    pub fn stored_sky(&self) -> Option<[f32; 3]> {
        let stored = |nits: f32| (nits * self.show_direct * self.radiance_scale).min(65_000.0);
        (self.environment_nits <= 0.0).then(|| self.sky.map(stored))
    }
}

/// What all shadow views share; see `frame.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ShadowParameters {
    pub floor: f32,
    pub blend: f32,
    pub filter_radius: f32,
    pub light_size: f32,
    pub bleed_reduction: f32,
    pub positive_exponent: f32,
    pub negative_exponent: f32,
    pub anisotropy: f32,
    pub min_variance: f32,
    pub clamps: u32,
    pub rays: u32,
    pub reserved: u32,
}

/// A light as shaders see it; see `frame.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct LightData {
    pub position_ws: [f32; 3],
    pub kind: u32,
    pub direction_ws: [f32; 3],
    pub inverse_range_squared: f32,
    pub intensity: [f32; 3],
    pub first_view: u32,
    pub cone_scale: f32,
    pub cone_offset: f32,
    pub view_count: u32,
    pub cone_rad: f32,
}

impl LightData {
    /// `kind` of a directional light.
    pub const DIRECTIONAL: u32 = 0;
    /// `kind` of a point light.
    pub const POINT: u32 = 1;
    /// `kind` of a spot light.
    pub const SPOT: u32 = 2;
    /// `first_view` of a light without shadow.
    pub const NO_VIEW: u32 = u32::MAX;
}

/// A shadow map's view as shaders see it; see `frame.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ShadowViewData {
    pub clip_from_ws: [[f32; 4]; 4],
    pub layer: u32,
    pub projection: u32,
    pub texel_m: f32,
    pub normal_offset: f32,
    pub constant_bias: f32,
    pub slope_bias: f32,
    pub near_m: f32,
    pub far_m: f32,
    pub eye_ws: [f32; 3],
    pub resolution: f32,
    pub begin_m: f32,
    pub end_m: f32,
    pub border: f32,
    pub reserved: u32,
}

impl ShadowViewData {
    /// `projection` of a sun's view.
    pub const PARALLEL: u32 = 0;
    /// `projection` of a spot's view and of a cube's face.
    pub const PERSPECTIVE: u32 = 1;
    /// `projection` of a hemisphere.
    pub const PARABOLOID: u32 = 2;
}

/// Shadow views of a frame at most, as a WebGPU texture array has layers.
pub const MAX_SHADOW_VIEWS: usize = 256;
/// Where the lights begin in [`FrameGroup::lighting`].
pub const FIRST_LIGHT_BYTES: u64 = (MAX_SHADOW_VIEWS * size_of::<ShadowViewData>()) as u64;

/// Group 0's buffers. Light and shadow view buffers grow, and never shrink.
#[derive(Debug)]
pub struct FrameGroup {
    layout: GroupLayout,
    /// [`FrameData`].
    pub frame: Buffer,
    /// [`MAX_SHADOW_VIEWS`] [`ShadowViewData`], then [`LightData`], directional ones first.
    pub lighting: Buffer,
    albedo_table: Texture,
    environment: Texture,
    no_environment: Texture,
    sampler: wgpu::Sampler,
    capacity: usize,
    group: Group,
}

impl FrameGroup {
    /// The layout that pipelines are made against.
    pub fn layout(gpu: &Gpu) -> GroupLayout {
        let all = ShaderStages::VERTEX_FRAGMENT | ShaderStages::COMPUTE;
        let shading = ShaderStages::FRAGMENT | ShaderStages::COMPUTE;
        let buffer = |ty| BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let storage = buffer(BufferBindingType::Storage { read_only: true });
        let table = BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let cube = BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::Cube,
            multisampled: false,
        };
        let entries = [
            ("frame", all, buffer(BufferBindingType::Uniform)),
            ("lighting", shading, storage),
            ("albedo_table", shading, table),
            ("environment", shading, cube),
            ("environment_sampler", shading, BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
        ];
        GroupLayout::new(gpu, 0, &entries)
    }

    /// Makes the group with room for a few lights.
    pub fn new(gpu: &Gpu, layout: &GroupLayout, albedo_table: &Texture) -> Self {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let frame = Buffer::new(gpu, "frame", Life::Kept, size_of::<FrameData>() as u64, usage);
        let capacity = 16;
        let lighting = lighting_buffer(gpu, capacity);
        let (environment, sampler) = (no_environment(gpu), environment_sampler(gpu));
        let group = fill(gpu, layout, (&frame, &lighting, albedo_table, &environment, &sampler));
        Self {
            layout: layout.clone(),
            frame,
            lighting,
            albedo_table: albedo_table.clone(),
            no_environment: environment.clone(),
            environment,
            sampler,
            capacity,
            group,
        }
    }

    /// Makes room for so many lights, and takes the scene's environment. To be called when the scene or settings change.
    pub fn reserve(&mut self, gpu: &Gpu, lights: usize, environment: Option<&Texture>) {
        let environment = environment.unwrap_or(&self.no_environment);
        let fits = lights <= self.capacity;
        if fits && self.environment == *environment {
            return;
        }
        self.environment = environment.clone();
        if !fits {
            self.capacity = lights.next_power_of_two();
            self.lighting = lighting_buffer(gpu, self.capacity);
        }
        let handles = (&self.frame, &self.lighting, &self.albedo_table, &self.environment, &self.sampler);
        self.group = fill(gpu, &self.layout, handles);
    }

    /// Fills the group for the passes that follow; see [`FrameGroup::reserve`].
    pub fn upload(
        &self,
        frame: &mut Frame<'_>,
        data: &FrameData,
        lights: &[LightData],
        views: &[ShadowViewData],
    ) {
        frame.upload(&self.frame, std::slice::from_ref(data));
        frame.upload_at(&self.lighting, 0, views);
        frame.upload_at(&self.lighting, FIRST_LIGHT_BYTES, lights);
    }

    /// The filled group.
    pub fn group(&self) -> &Group {
        &self.group
    }
}

fn lighting_buffer(gpu: &Gpu, lights: usize) -> Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let bytes = FIRST_LIGHT_BYTES + (lights * size_of::<LightData>()) as u64;
    Buffer::new(gpu, "lighting", Life::Kept, bytes, usage)
}

fn fill(
    gpu: &Gpu,
    layout: &GroupLayout,
    (frame, lighting, table, environment, sampler): (&Buffer, &Buffer, &Texture, &Texture, &wgpu::Sampler),
) -> Group {
    layout.group(gpu, &[frame.into(), lighting.into(), table.into(), environment.into(), sampler.into()])
}

/// A cube of one black texel a face, for scenes without an environment.
fn no_environment(gpu: &Gpu) -> Texture {
    let options =
        TextureOptions::cube(1, 1, wgpu::TextureFormat::Rgba16Float, wgpu::TextureUsages::TEXTURE_BINDING);
    Texture::new(gpu, "environment", Life::Kept, options)
}

/// Blends texels and mips.
pub(crate) fn environment_sampler(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("environment"),
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    })
}
