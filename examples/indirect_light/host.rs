//! The program that the light comes to: boxes in a room, in depth, normals and albedo first and then in light, by wgpu alone. Its
//! depth is 0 at the near plane and 1 at the far one.

use chiaro::Depth;
use chiaro::alone::DrawnSurfaces;
use chiaro::wgpu::util::{BufferInitDescriptor, DeviceExt};
use chiaro::wgpu::{self, BufferUsages, ShaderStages, TextureFormat, TextureUsages, vertex_attr_array};
use glam::camera::rh;
use glam::{Mat4, Quat, Vec3, Vec4};

/// A spot.
pub struct Lamp {
    pub place: Vec3,
    pub direction: Vec3,
    pub inner_rad: f32,
    pub outer_rad: f32,
    pub candela: f32,
}

/// It shines at the left wall.
pub const LAMP: Lamp = Lamp {
    place: Vec3::new(0.2, 2.7, 0.6),
    direction: Vec3::new(-1.0, -0.4, -0.2),
    inner_rad: 0.35,
    outer_rad: 0.45,
    candela: 2000.0,
};

const DEPTH: TextureFormat = TextureFormat::Depth32Float;
const NORMAL: TextureFormat = TextureFormat::Rgba16Float;
const ALBEDO: TextureFormat = TextureFormat::Rgba8UnormSrgb;
const COLOR: TextureFormat = TextureFormat::Rgba8UnormSrgb;

/// A box.
pub struct Block {
    middle: Vec3,
    half: Vec3,
    turn: Quat,
    pub albedo: Vec3,
}

impl Block {
    /// Its corners with their normals, three a triangle, counter-clockwise from outside.
    pub fn corners(&self) -> impl Iterator<Item = [Vec3; 2]> + '_ {
        let sides = [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)];
        let faces = sides.into_iter().flat_map(|(n, u)| [(n, u), (-n, u)]);
        let places = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let cube = faces.flat_map(move |(n, u)| places.map(|(a, b)| [n + a * u + b * n.cross(u), n]));
        cube.map(|[p, n]| [self.middle + self.turn * (self.half * p), self.turn * n])
    }
}

/// A room that is open in front, and two boxes in it.
pub fn boxes() -> Vec<Block> {
    let block = |middle: [f32; 3], half: [f32; 3], turn_rad, albedo: [f32; 3]| Block {
        middle: middle.into(),
        half: half.into(),
        turn: Quat::from_rotation_y(turn_rad),
        albedo: albedo.into(),
    };
    let (white, red, blue) = ([0.75, 0.75, 0.72], [0.75, 0.16, 0.1], [0.15, 0.25, 0.65]);
    vec![
        block([0.0, -0.1, 0.0], [2.2, 0.1, 2.0], 0.0, white),
        block([0.0, 3.1, 0.0], [2.2, 0.1, 2.0], 0.0, white),
        block([0.0, 1.5, -2.1], [2.2, 1.7, 0.1], 0.0, white),
        block([-2.1, 1.5, 0.0], [0.1, 1.5, 2.0], 0.0, red),
        block([2.1, 1.5, 0.0], [0.1, 1.5, 2.0], 0.0, blue),
        block([-0.4, 0.9, -0.8], [0.45, 0.9, 0.45], 0.3, white),
        block([0.8, 0.4, 0.5], [0.4, 0.4, 0.4], -0.4, white),
    ]
}

/// Pipelines, buffers and targets.
pub struct Program {
    surfaces: wgpu::RenderPipeline,
    shading: wgpu::RenderPipeline,
    vertices: wgpu::Buffer,
    count: u32,
    frame: wgpu::BindGroup,
    read: wgpu::BindGroupLayout,
    view_from_world: Mat4,
    clip_from_view: Mat4,
    depth: wgpu::TextureView,
    normal: wgpu::TextureView,
    albedo: wgpu::TextureView,
    /// The picture.
    pub color: wgpu::TextureView,
}

impl Program {
    pub fn new(device: &wgpu::Device, boxes: &[Block], [width, height]: [u32; 2]) -> Self {
        let corners: Vec<[Vec3; 3]> =
            boxes.iter().flat_map(|block| block.corners().map(|[p, n]| [p, n, block.albedo])).collect();
        let eye = Vec3::new(0.0, 1.5, 6.4);
        let view_from_world = rh::view::look_at_mat4(eye, Vec3::new(0.0, 1.5, 0.0), Vec3::Y);
        let clip_from_view = rh::proj::directx::perspective(0.75, width as f32 / height as f32, 0.1, 50.0);
        let clip_from_world = clip_from_view * view_from_world;
        let init = |contents: &[u8], usage| {
            device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
        };
        let matrices = [clip_from_world, clip_from_world.inverse()];
        let (inner, outer) = (LAMP.inner_rad.cos(), LAMP.outer_rad.cos());
        let lamp =
            [LAMP.place.extend(LAMP.candela), LAMP.direction.normalize().extend(inner), Vec4::splat(outer)];
        let frame = [bytemuck::cast_slice::<_, u8>(&matrices), bytemuck::cast_slice(&lamp)].concat();
        let frame = init(&frame, BufferUsages::UNIFORM);
        let source = wgpu::ShaderSource::Wgsl(include_str!("host.wgsl").into());
        let module = &device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
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
        let buffer = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let held = layout(device, &[buffer]);
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let float = texture(wgpu::TextureSampleType::Float { filterable: false });
        let read = layout(device, &[texture(wgpu::TextureSampleType::Depth), float, float, float]);
        let pipeline = |groups: &[Option<&wgpu::BindGroupLayout>],
                        [vertex, fragment]: [&str; 2],
                        buffers: &[Option<wgpu::VertexBufferLayout<'_>>],
                        targets: &[Option<wgpu::ColorTargetState>],
                        depth_stencil| {
            let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                bind_group_layouts: groups,
                ..Default::default()
            });
            let compilation_options = wgpu::PipelineCompilationOptions::default;
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(vertex),
                    compilation_options: compilation_options(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Back), ..Default::default() },
                depth_stencil,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(fragment),
                    compilation_options: compilation_options(),
                    targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let depth_stencil = wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        };
        let corner = wgpu::VertexBufferLayout {
            array_stride: size_of::<[Vec3; 3]>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3],
        };
        let entries = &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }];
        Self {
            surfaces: pipeline(
                &[Some(&held)],
                ["corner", "surface"],
                &[Some(corner)],
                &[Some(NORMAL.into()), Some(ALBEDO.into())],
                Some(depth_stencil),
            ),
            shading: pipeline(
                &[Some(&held), Some(&read)],
                ["screen", "shade"],
                &[],
                &[Some(COLOR.into())],
                None,
            ),
            frame: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &held,
                entries,
            }),
            read,
            count: corners.len() as u32,
            vertices: init(bytemuck::cast_slice(&corners), BufferUsages::VERTEX),
            view_from_world,
            clip_from_view,
            depth: target(DEPTH, TextureUsages::TEXTURE_BINDING),
            normal: target(NORMAL, TextureUsages::TEXTURE_BINDING),
            albedo: target(ALBEDO, TextureUsages::TEXTURE_BINDING),
            color: target(COLOR, TextureUsages::COPY_SRC),
        }
    }

    /// Draws depth, normals and albedo.
    pub fn draw(&self, encoder: &mut wgpu::CommandEncoder) {
        let load = wgpu::LoadOp::Clear(1.0);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(target(&self.normal)), Some(target(&self.albedo))],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.surfaces);
        pass.set_bind_group(0, &self.frame, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..self.count, 0..1);
    }

    /// What was drawn.
    pub fn drawn(&self) -> DrawnSurfaces<'_> {
        DrawnSurfaces {
            view_from_world: self.view_from_world,
            clip_from_view: self.clip_from_view,
            depth_runs: Depth::Standard,
            depth: &self.depth,
            normals: &self.normal,
            albedo: Some(&self.albedo),
        }
    }

    /// Lights it by the lamp, and adds indirect light.
    pub fn shade(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        indirect: &wgpu::TextureView,
    ) {
        let views = [&self.depth, &self.normal, &self.albedo, indirect];
        let entries: Vec<_> = (0..)
            .zip(views)
            .map(|(binding, view)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::TextureView(view),
            })
            .collect();
        let (layout, entries) = (&self.read, &entries[..]);
        let read = device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(target(&self.color))],
            ..Default::default()
        });
        pass.set_pipeline(&self.shading);
        pass.set_bind_group(0, &self.frame, &[]);
        pass.set_bind_group(1, &read, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// What a pass reads, from binding 0 on.
fn layout(device: &wgpu::Device, types: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
    let entry = |(binding, ty): (u32, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
        binding,
        visibility: ShaderStages::VERTEX_FRAGMENT,
        ty: *ty,
        count: None,
    };
    let entries: Vec<_> = (0..).zip(types).map(entry).collect();
    let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
    device.create_bind_group_layout(&descriptor)
}

fn target(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    let load = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
    let ops = wgpu::Operations { load, store: wgpu::StoreOp::Store };
    wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops }
}
