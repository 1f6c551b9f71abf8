//! The bind group of a text for other programs, and what all such texts read.

use bytemuck::Zeroable;
use chiaro_gpu::shader::Alone;
use chiaro_gpu::{Binding, Buffer, Gpu, Life, wgpu};
use chiaro_scene::Light;
use chiaro_techniques::frame::{FIRST_LIGHT_BYTES, FrameData, LightData, ShadowViewData};
use chiaro_techniques::light;
use chiaro_techniques::shadow::ShadowSettings;
use glam::{Affine3A, Vec2};

use crate::checks::{check_size, check_view};
use crate::{Error, View};

/// What a program's shaders look shadows up with: text, and the bind group that it reads.
#[derive(Debug)]
pub struct Snippet {
    pub(super) gpu: Gpu,
    pub(super) settings: ShadowSettings,
    text: Alone,
    layout: wgpu::BindGroupLayout,
    frame: Buffer,
    lighting: Buffer,
    bind_group: wgpu::BindGroup,
}

impl Snippet {
    /// Binds what `find` knows by name besides frame and lights.
    pub(super) fn new<'a>(
        gpu: &Gpu,
        settings: ShadowSettings,
        text: Alone,
        find: impl Fn(&str) -> Option<Binding<'a>>,
    ) -> Self {
        let layout = layout(gpu, &text);
        let (frame, lighting) = (frame(gpu), lighting(gpu, 1));
        let bind_group = bound(gpu, &layout, &text, (&frame, &lighting), |name| find(name));
        Self { gpu: gpu.clone(), settings, text, layout, frame, lighting, bind_group }
    }

    /// Writes what a frame's shaders read; whether there was room for the lights.
    pub(super) fn write(
        &mut self,
        lights: &[LightData],
        views: &[ShadowViewData],
        (view, size_px): (&View, [u32; 2]),
    ) -> bool {
        let bytes = FIRST_LIGHT_BYTES + size_of_val(lights) as u64;
        let holds = self.lighting.raw().size() >= bytes;
        if !holds {
            self.lighting = lighting(&self.gpu, lights.len());
        }
        let data = frame_data(view, size_px, &self.settings);
        let queue = &self.gpu.queue;
        queue.write_buffer(self.frame.raw(), 0, bytemuck::bytes_of(&data));
        queue.write_buffer(self.lighting.raw(), 0, bytemuck::cast_slice(views));
        queue.write_buffer(self.lighting.raw(), FIRST_LIGHT_BYTES, bytemuck::cast_slice(lights));
        holds
    }

    /// Binds anew, after something was made anew.
    pub(super) fn rebind<'a>(&mut self, find: impl Fn(&str) -> Option<Binding<'a>>) {
        let buffers = (&self.frame, &self.lighting);
        self.bind_group = bound(&self.gpu, &self.layout, &self.text, buffers, |name| find(name));
    }

    /// WGSL for a fragment or compute shader whose group of this number is [`Snippet::bind_group`]. It has
    /// `chiaro_light_visibility(light: u32, position_ws: vec3f, normal_ws: vec3f, pixel: vec2f) -> vec3f`: how much of a
    /// light, by its number in what was set last, arrives at a point whose triangle has this unit normal, by colour; `pixel`
    /// is the fragment's position.
    pub fn wgsl(&self, group: u32) -> String {
        self.text.wgsl(group)
    }

    /// For the program's pipeline layouts.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// What the text binds; another one may follow from whatever takes `&mut self`.
    pub fn bind_group(&self) -> &wgpu::BindGroup {
        &self.bind_group
    }
}

/// Lights as shaders take them, once they and who looks at them are such that shadows can be looked up.
pub(super) fn placed(
    gpu: &Gpu,
    lights: &[(Light, Affine3A)],
    (view, size_px): (&View, [u32; 2]),
) -> Result<Vec<LightData>, Error> {
    check_size(gpu, size_px)?;
    check_view(view, size_px)?;
    if let Some(number) = lights.iter().position(|(_, pose)| !pose.is_finite()) {
        let name = &lights[number].0.name;
        let name = if name.is_empty() { String::new() } else { format!(" “{name}”") };
        let problem = "has a pose with a number that is not finite";
        return Err(Error::Unfit { what: format!("light {number}{name}"), problem });
    }
    Ok(lights.iter().map(|(light, pose)| light::placed(light, pose)).collect())
}

fn layout(gpu: &Gpu, text: &Alone) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = text
        .bindings
        .iter()
        .map(|binding| wgpu::BindGroupLayoutEntry {
            binding: binding.binding,
            visibility: wgpu::ShaderStages::FRAGMENT | wgpu::ShaderStages::COMPUTE,
            ty: binding.ty,
            count: None,
        })
        .collect();
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("chiaro shadows"), entries: &entries };
    gpu.device.create_bind_group_layout(&descriptor)
}

fn bound<'a>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    text: &Alone,
    (frame, lighting): (&'a Buffer, &'a Buffer),
    find: impl Fn(&str) -> Option<Binding<'a>>,
) -> wgpu::BindGroup {
    let find = |name: &str| match name {
        "frame" => Some(frame.into()),
        "lighting" => Some(lighting.into()),
        _ => find(name),
    };
    let handles: Vec<_> =
        text.bindings.iter().filter_map(|wanted| Some((wanted.binding, find(&wanted.name)?))).collect();
    let entries: Vec<_> = handles
        .iter()
        .map(|(binding, handle)| wgpu::BindGroupEntry { binding: *binding, resource: handle.resource() })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: Some("chiaro shadows"), layout, entries: &entries };
    gpu.device.create_bind_group(&descriptor)
}

fn lighting(gpu: &Gpu, lights: usize) -> Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let bytes = FIRST_LIGHT_BYTES + (lights.max(1) * size_of::<LightData>()) as u64;
    Buffer::new(gpu, "lighting", Life::Kept, bytes, usage)
}

fn frame(gpu: &Gpu) -> Buffer {
    let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
    Buffer::new(gpu, "frame", Life::Kept, size_of::<FrameData>() as u64, usage)
}

pub(super) fn frame_data(view: &View, size_px: [u32; 2], settings: &ShadowSettings) -> FrameData {
    FrameData {
        clip_from_ws: view.clip_from_ws(size_px, Vec2::ZERO).to_cols_array_2d(),
        relative_from_clip: view.relative_from_clip(size_px, Vec2::ZERO).to_cols_array_2d(),
        eye_ws: view.eye_ws().to_array(),
        orthographic: u32::from(view.is_orthographic()),
        forward_ws: view.forward_ws().to_array(),
        footprint_scale: 1.0,
        size_px,
        anisotropy: 1,
        shadow: settings.parameters(),
        ..FrameData::zeroed()
    }
}
