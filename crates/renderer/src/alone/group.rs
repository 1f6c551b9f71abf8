//! The bind group of a text for other programs, and what all such texts read.

use bytemuck::Zeroable;
use chiaro_gpu::shader::Alone;
use chiaro_gpu::{Binding, Buffer, Gpu, Life, wgpu};
use chiaro_techniques::frame::{FIRST_LIGHT_BYTES, FrameData, LightData};
use chiaro_techniques::shadow::ShadowSettings;
use glam::Vec2;

use crate::View;

pub(super) fn layout(gpu: &Gpu, text: &Alone) -> wgpu::BindGroupLayout {
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

/// Binds what `find` knows by name.
pub(super) fn bound<'a>(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    text: &Alone,
    find: impl Fn(&str) -> Option<Binding<'a>>,
) -> wgpu::BindGroup {
    let handles: Vec<_> =
        text.bindings.iter().filter_map(|wanted| Some((wanted.binding, find(&wanted.name)?))).collect();
    let entries: Vec<_> = handles
        .iter()
        .map(|(binding, handle)| wgpu::BindGroupEntry { binding: *binding, resource: handle.resource() })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: Some("chiaro shadows"), layout, entries: &entries };
    gpu.device.create_bind_group(&descriptor)
}

pub(super) fn lighting(gpu: &Gpu, lights: usize) -> Buffer {
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
    let bytes = FIRST_LIGHT_BYTES + (lights.max(1) * size_of::<LightData>()) as u64;
    Buffer::new(gpu, "lighting", Life::Kept, bytes, usage)
}

pub(super) fn frame(gpu: &Gpu) -> Buffer {
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
