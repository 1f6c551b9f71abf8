//! The program that the shadows come to: a floor and 400 posts, drawn by wgpu alone.

use chiaro::wgpu::util::{BufferInitDescriptor, DeviceExt};
use chiaro::wgpu::{self, BufferUsages, TextureFormat, TextureUsages, vertex_attr_array};
use glam::{Mat4, Vec3};

/// The way the sun's light travels.
pub const SUN: Vec3 = Vec3::new(0.6, -1.0, -0.4);
/// Around the floor and the posts, metres.
pub const BOUNDS_WS: (Vec3, Vec3) = (Vec3::new(-40.0, -0.1, -40.0), Vec3::new(40.0, 2.0, 40.0));
const DEPTH: TextureFormat = TextureFormat::Depth32Float;

/// Pipelines, buffers and targets.
pub struct Program {
    depth_only: wgpu::RenderPipeline,
    shaded: wgpu::RenderPipeline,
    vertices: wgpu::Buffer,
    count: u32,
    /// The picture.
    pub color: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl Program {
    /// `lookup` is put before the program's own shader, and has group 1.
    pub fn new(
        device: &wgpu::Device,
        lookup: &str,
        shadows: &wgpu::BindGroupLayout,
        [width, height]: [u32; 2],
    ) -> Self {
        let source = wgpu::ShaderSource::Wgsl((lookup.to_owned() + include_str!("posts.wgsl")).into());
        let module = &device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let matrix = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let pipeline = |groups: &[Option<&wgpu::BindGroupLayout>], fragment| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                bind_group_layouts: groups,
                ..Default::default()
            });
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: None,
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride: size_of::<[Vec3; 2]>() as u64,
                        step_mode: wgpu::VertexStepMode::Vertex,
                        attributes: &vertex_attr_array![0 => Float32x3, 1 => Float32x3],
                    })],
                },
                primitive: wgpu::PrimitiveState::default(),
                // Reversed, as chiaro's maps and views are.
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: DEPTH,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment,
                multiview_mask: None,
                cache: None,
            })
        };
        let fragment = wgpu::FragmentState {
            module,
            entry_point: None,
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(TextureFormat::Rgba8UnormSrgb.into())],
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
        let vertices = vertices();
        Self {
            depth_only: pipeline(&[Some(&matrix)], None),
            shaded: pipeline(&[Some(&matrix), Some(shadows)], Some(fragment)),
            count: vertices.len() as u32,
            vertices: device.create_buffer_init(&BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(&vertices),
                usage: BufferUsages::VERTEX,
            }),
            color: target(TextureFormat::Rgba8UnormSrgb, TextureUsages::COPY_SRC),
            depth: target(DEPTH, TextureUsages::empty()),
        }
    }

    /// Draws everything in depth alone.
    pub fn draw_depth(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clip_from_world: Mat4,
        depth: &wgpu::TextureView,
    ) {
        self.record(device, encoder, (&self.depth_only, clip_from_world, None), &[], depth);
    }

    /// Draws everything for the camera.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        clip_from_world: Mat4,
        shadows: &wgpu::BindGroup,
    ) {
        let sky = wgpu::Color { r: 0.3, g: 0.5, b: 0.8, a: 1.0 };
        let color = [Some(wgpu::RenderPassColorAttachment {
            view: &self.color,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(sky), store: wgpu::StoreOp::Store },
        })];
        self.record(device, encoder, (&self.shaded, clip_from_world, Some(shadows)), &color, &self.depth);
    }

    fn record(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        (pipeline, clip_from_world, shadows): (&wgpu::RenderPipeline, Mat4, Option<&wgpu::BindGroup>),
        color: &[Option<wgpu::RenderPassColorAttachment<'_>>],
        depth: &wgpu::TextureView,
    ) {
        let matrix = device.create_buffer_init(&BufferInitDescriptor {
            label: None,
            contents: bytemuck::bytes_of(&clip_from_world),
            usage: BufferUsages::UNIFORM,
        });
        let matrix = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: matrix.as_entire_binding() }],
        });
        let depth_ops = wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: color,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(depth_ops),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &matrix, &[]);
        pass.set_bind_group(1, shadows, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..self.count, 0..1);
    }
}

/// Corners with their normals: three a triangle, counter-clockwise from outside.
fn vertices() -> Vec<[Vec3; 2]> {
    let post = |i: u16| {
        let place = [i % 20, i / 20].map(|n| 4.0 * (f32::from(n) - 9.5));
        (Vec3::new(place[0], 0.8, place[1]), Vec3::new(0.2, 0.8, 0.2))
    };
    let floor = (Vec3::new(0.0, -0.05, 0.0), Vec3::new(40.0, 0.05, 40.0));
    let sides = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)];
    let faces = sides.into_iter().flat_map(|(n, u)| [(n, u), (-n, u)]);
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let cube: Vec<_> =
        faces.flat_map(|(n, u)| corners.map(|(a, b)| [n + a * u + b * n.cross(u), n])).collect();
    let boxes = (0..400).map(post).chain([floor]);
    boxes.flat_map(|(middle, half)| cube.iter().map(move |&[p, n]| [middle + half * p, n])).collect()
}
