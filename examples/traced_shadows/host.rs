//! The program that the shadows come to: a ring of columns, in depth and normals first and then in light, by wgpu alone.

use chiaro::wgpu::util::{BufferInitDescriptor, DeviceExt};
use chiaro::wgpu::{self, BufferUsages, ShaderStages, TextureFormat, TextureUsages, vertex_attr_array};
use glam::{Mat4, Quat, Vec3};

/// The way the sun's light travels.
pub const SUN: Vec3 = Vec3::new(0.5, -1.0, -0.7);
const DEPTH: TextureFormat = TextureFormat::Depth32Float;
const NORMAL: TextureFormat = TextureFormat::Rgba16Float;

/// Pipelines, buffers and targets.
pub struct Program {
    surfaces: wgpu::RenderPipeline,
    lights: wgpu::RenderPipeline,
    vertices: wgpu::Buffer,
    count: u32,
    depth: wgpu::TextureView,
    normal: wgpu::TextureView,
    /// The picture.
    pub color: wgpu::TextureView,
}

impl Program {
    /// `shadows`: what shoots rays is put before the program's own shader, and has group 1.
    pub fn new(
        device: &wgpu::Device,
        (lookup, shadows): (&str, &wgpu::BindGroupLayout),
        corners: &[[Vec3; 2]],
        [width, height]: [u32; 2],
    ) -> Self {
        let source = wgpu::ShaderSource::Wgsl((lookup.to_owned() + include_str!("host.wgsl")).into());
        let module = &device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::VERTEX_FRAGMENT,
            ty,
            count: None,
        };
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let camera = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let group = |entries: &[wgpu::BindGroupLayoutEntry]| {
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries };
            device.create_bind_group_layout(&descriptor)
        };
        let drawn = group(&[entry(0, camera)]);
        let read = group(&[
            entry(0, camera),
            entry(1, texture(wgpu::TextureSampleType::Depth)),
            entry(2, texture(wgpu::TextureSampleType::Float { filterable: false })),
        ]);
        let pipeline = |groups: &[Option<&wgpu::BindGroupLayout>],
                        [vertex, fragment]: [&str; 2],
                        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
                        (format, depth_stencil)| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                bind_group_layouts: groups,
                ..Default::default()
            });
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(vertex),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(fragment),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    targets: &[Some(wgpu::ColorTargetState::from(format))],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        // Reversed, as chiaro's views are.
        let depth_stencil = wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        };
        let corner = wgpu::VertexBufferLayout {
            array_stride: size_of::<[Vec3; 2]>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &vertex_attr_array![0 => Float32x3, 1 => Float32x3],
        };
        let target = |format, usage| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        let color = TextureFormat::Rgba8UnormSrgb;
        Self {
            surfaces: pipeline(
                &[Some(&drawn)],
                ["corner", "surface"],
                &[Some(corner)],
                (NORMAL, Some(depth_stencil)),
            ),
            lights: pipeline(&[Some(&read), Some(shadows)], ["screen", "light"], &[], (color, None)),
            count: corners.len() as u32,
            vertices: device.create_buffer_init(&BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(corners),
                usage: BufferUsages::VERTEX,
            }),
            depth: target(DEPTH, TextureUsages::TEXTURE_BINDING),
            normal: target(NORMAL, TextureUsages::TEXTURE_BINDING),
            color: target(color, TextureUsages::COPY_SRC),
        }
    }

    /// Draws depth and normals, then lights them.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clip_from_world: Mat4,
        shadows: &wgpu::BindGroup,
    ) {
        let camera = device.create_buffer_init(&BufferInitDescriptor {
            label: None,
            contents: bytemuck::cast_slice(&[clip_from_world, clip_from_world.inverse()]),
            usage: BufferUsages::UNIFORM,
        });
        let camera = wgpu::BindGroupEntry { binding: 0, resource: camera.as_entire_binding() };
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let group = |pipeline: &wgpu::RenderPipeline, entries: &[wgpu::BindGroupEntry<'_>]| {
            let layout = &pipeline.get_bind_group_layout(0);
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries })
        };
        let drawn = group(&self.surfaces, std::slice::from_ref(&camera));
        let read = group(&self.lights, &[camera, view(1, &self.depth), view(2, &self.normal)]);
        let target = |view| {
            let load = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            })
        };
        let depth_ops = wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[target(&self.normal)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(depth_ops),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.surfaces);
        pass.set_bind_group(0, &drawn, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..self.count, 0..1);
        drop(pass);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[target(&self.color)],
            ..Default::default()
        });
        pass.set_pipeline(&self.lights);
        pass.set_bind_group(0, &read, &[]);
        pass.set_bind_group(1, shadows, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// A floor and leaning columns on it: corners with their normals, three a triangle, counter-clockwise from outside.
pub fn corners() -> Vec<[Vec3; 2]> {
    let sides = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)];
    let faces = sides.into_iter().flat_map(|(n, u)| [(n, u), (-n, u)]);
    let places = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let cube: Vec<_> =
        faces.flat_map(|(n, u)| places.map(|(a, b)| [n + a * u + b * n.cross(u), n])).collect();
    let column = |i: u8| {
        let turn = Quat::from_rotation_y(f32::from(i) * std::f32::consts::TAU / 12.0);
        let lean = turn * Quat::from_rotation_x(0.35);
        (turn * Vec3::new(0.0, 1.1, 2.0), Vec3::new(0.15, 1.2, 0.15), lean)
    };
    let floor = (Vec3::new(0.0, -0.05, 0.0), Vec3::new(20.0, 0.05, 20.0), Quat::IDENTITY);
    let boxes = (0..12).map(column).chain([floor]);
    let placed = |(middle, half, turn): (Vec3, Vec3, Quat)| {
        cube.iter().map(move |&[p, n]| [middle + turn * (half * p), turn * n]).collect::<Vec<_>>()
    };
    boxes.flat_map(placed).collect()
}
