//! A scene on the GPU: group 1. Twins of `Cluster`, `Instance` and `Item` in `scene.wesl`.
//!
//! Every primitive is cut into clusters of at most 128 triangles over at most 128 vertices (meshoptimizer), whose
//! vertices are stored together: a draw list entry is then an item and a byte. Items, a cluster at an instance, are
//! sorted by class, so that one prefix sum lays out the draws of all classes.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{self, BindingType, BufferBindingType, ShaderStages};
use chiaro_gpu::{Binding, Buffer, Gpu, GpuError, Group, GroupLayout, Texture};
use chiaro_scene as cs;
use glam::{Affine3A, Vec2, Vec3, Vec4};

use super::{material, texture};

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ClusterData {
    pub sphere: [f32; 4],
    pub cone: [f32; 4],
    pub positions: u32,
    pub attributes: u32,
    pub triangles: u32,
    pub triangle_count: u32,
    pub extras: u32,
    pub material: u32,
    pub double_sided: u32,
    pub vertex_count: u32,
}

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct InstanceData {
    pub world_from_object: [[f32; 4]; 3],
    pub previous_world_from_object: [[f32; 4]; 3],
    pub max_scale: f32,
    pub flags: u32,
    pub node: u32,
    pub reserved: u32,
}

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ItemData {
    pub cluster: u32,
    pub instance: u32,
}

const NO_EXTRAS: u32 = u32::MAX;
const MAX_CLUSTER_VERTICES: usize = 128;
const MAX_CLUSTER_TRIANGLES: usize = 128;
/// meshoptimizer's trade between round clusters (0) and clusters whose normals agree (1).
const CONE_WEIGHT: f32 = 0.25;
/// A draw list entry keeps 24 bits for the item.
const MAX_ITEMS: usize = 1 << 24;

/// How clusters are drawn: each class is one indirect draw per view.
pub const CLASSES: usize = 4;

/// Class of a material: bit 0 double-sided, bit 1 masked.
fn class(material: &cs::Material) -> usize {
    usize::from(material.double_sided) | usize::from(material::alpha_cutoff(material) > 0.0) << 1
}

/// A scene's buffers and textures, and the facts that passes need about it.
#[derive(Debug)]
pub struct SceneGpu {
    group: Group,
    /// Draws in all: clusters times their instances.
    pub item_count: u32,
    /// First item of each class.
    pub class_first: [u32; CLASSES],
    /// Triangles of all items.
    pub triangle_count: u32,
    /// World-space corners, metres; zero-sized without geometry.
    pub bounds_ws: (Vec3, Vec3),
    /// Whether any material shines by itself.
    pub glows: bool,
    /// What shaders may leave out.
    pub facts: SceneFacts,
    /// Bytes on the GPU.
    pub bytes: u64,
}

/// What a scene's materials use, so that shaders are compiled without the rest. Passes made for more serve less.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// Bits of `TEXTURES` in `texture.wesl`.
    pub textures: u32,
    /// Texture size classes in use.
    pub size_classes: u32,
}

impl SceneFacts {
    fn of(scene: &cs::Scene, size_classes: u32) -> Self {
        let bits = |m: &cs::Material| {
            let uses = [
                m.base_color_texture.is_some(),
                m.metallic_roughness_texture.is_some(),
                m.normal_texture.is_some(),
                m.occlusion_texture.is_some(),
                m.emissive_texture.is_some(),
                m.specular_texture.is_some(),
                m.specular_color_texture.is_some(),
            ];
            uses.iter().enumerate().fold(0, |bits, (bit, used)| bits | u32::from(*used) << bit)
        };
        Self { textures: scene.materials.iter().fold(0, |all, m| all | bits(m)), size_classes }
    }

    /// What serves both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            textures: self.textures | other.textures,
            size_classes: self.size_classes.max(other.size_classes),
        }
    }

    /// Constants of every shader that evaluates materials.
    pub fn constants(self) -> [(&'static str, f64); 2] {
        [("TEXTURES", f64::from(self.textures)), ("SIZE_CLASSES", f64::from(self.size_classes.max(1)))]
    }
}

impl SceneGpu {
    /// The layout that pipelines are made against.
    pub fn layout(gpu: &Gpu) -> GroupLayout {
        let all = ShaderStages::VERTEX_FRAGMENT | ShaderStages::COMPUTE;
        let shading = ShaderStages::FRAGMENT | ShaderStages::COMPUTE;
        let storage = BindingType::Buffer {
            ty: BufferBindingType::Storage { read_only: true },
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let array = BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2Array,
            multisampled: false,
        };
        let entries = [
            ("geometry", all, storage),
            ("clusters", all, storage),
            ("instances", all, storage),
            ("items", all, storage),
            ("materials", all, storage),
            ("color_small", shading, array),
            ("color_medium", shading, array),
            ("color_large", shading, array),
            ("linear_small", shading, array),
            ("linear_medium", shading, array),
            ("linear_large", shading, array),
            ("material_sampler", shading, BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
        ];
        GroupLayout::new(gpu, 1, &entries)
    }

    /// Uploads a scene.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the scene does not fit the adapter's limits.
    pub fn upload(gpu: &Gpu, layout: &GroupLayout, scene: &cs::Scene) -> Result<Self, GpuError> {
        let mut heap = Heap::default();
        for mesh in &scene.meshes {
            heap.add_mesh(mesh, &scene.materials);
        }
        let world = scene.world_from_node();
        let mut instances = Vec::new();
        let mut items: Vec<(usize, ItemData)> = Vec::new();
        let mut triangles = 0u64;
        for (node, (scene_node, world)) in scene.nodes.iter().zip(&world).enumerate() {
            let Some(mesh) = scene_node.mesh else { continue };
            let instance = instances.len() as u32;
            instances.push(instance_data(world, node as u32));
            for cluster in heap.clusters_of_mesh[mesh].clone() {
                let data = &heap.clusters[cluster];
                triangles += u64::from(data.triangle_count);
                let class = class(&scene.materials[data.material as usize]);
                items.push((class, ItemData { cluster: cluster as u32, instance }));
            }
        }
        items.sort_by_key(|(class, _)| *class);
        let class_first = std::array::from_fn(|class| items.partition_point(|(c, _)| *c < class) as u32);
        let items: Vec<_> = items.into_iter().map(|(_, item)| item).collect();
        check(gpu, &items, triangles, heap.words.len())?;

        let (arrays, slots, size_classes) = texture::upload(gpu, scene)?;
        let materials: Vec<_> =
            scene.materials.iter().map(|m| material::pack(m, &slots, &mut heap.words)).collect();
        let usage = wgpu::BufferUsages::STORAGE;
        let geometry = Buffer::with_data(gpu, "geometry", &heap.words, usage);
        let clusters = Buffer::with_data(gpu, "clusters", &heap.clusters, usage);
        let instances = Buffer::with_data(gpu, "instances", &instances, usage);
        let item_buffer = Buffer::with_data(gpu, "items", &items, usage);
        let materials = Buffer::with_data(gpu, "materials", &materials, usage);
        let sampler = sampler(gpu);
        let mut bindings: Vec<Binding<'_>> =
            [&geometry, &clusters, &instances, &item_buffer, &materials].map(Binding::from).to_vec();
        bindings.extend(arrays.iter().map(Binding::from));
        bindings.push((&sampler).into());
        let group = layout.group(gpu, &bindings);
        let buffers = [&geometry, &clusters, &instances, &item_buffer, &materials];
        let bytes = buffers.iter().map(|b| b.raw().size()).sum::<u64>()
            + arrays.iter().map(Texture::bytes).sum::<u64>();
        Ok(Self {
            group,
            item_count: items.len() as u32,
            class_first,
            triangle_count: triangles as u32,
            bounds_ws: scene.bounds().unwrap_or_default(),
            glows: scene.materials.iter().any(material::glows),
            facts: SceneFacts::of(scene, size_classes),
            bytes,
        })
    }

    /// The filled group.
    pub fn group(&self) -> &Group {
        &self.group
    }
}

fn check(gpu: &Gpu, items: &[ItemData], triangles: u64, words: usize) -> Result<(), GpuError> {
    let binding = gpu.limits.max_storage_buffer_binding_size;
    let too_large = |what: &str, needed: u64, limit: u64, unit| {
        Err(GpuError::TooLarge {
            what: what.into(),
            needed,
            limit,
            unit,
            advice: "simplify or split the scene",
        })
    };
    if items.len() >= MAX_ITEMS {
        return too_large("the scene's clusters", items.len() as u64, MAX_ITEMS as u64, "clusters");
    }
    // A draw list holds three words a triangle, and offsets count them in 31 bits.
    let list = triangles * 12;
    if list > binding || triangles > 1 << 29 {
        return too_large("the scene's draw list", list, binding.min(12 << 29), "bytes");
    }
    let heap = words as u64 * 4;
    if heap > binding {
        return too_large("the scene's geometry", heap, binding, "bytes");
    }
    Ok(())
}

fn sampler(gpu: &Gpu) -> wgpu::Sampler {
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("material textures"),
        address_mode_u: wgpu::AddressMode::Repeat,
        address_mode_v: wgpu::AddressMode::Repeat,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    })
}

/// The instance of a node at its pose, at rest.
pub fn instance_data(world_from_object: &Affine3A, node: u32) -> InstanceData {
    let m = world_from_object.matrix3;
    let axes = [m.x_axis, m.y_axis, m.z_axis].map(Vec3::from);
    let lengths = axes.map(Vec3::length);
    let longest = lengths.into_iter().fold(0.0, f32::max);
    let tolerance = 1e-3 * longest * longest;
    let equal = lengths.iter().all(|l| (l - longest).abs() <= 1e-3 * longest);
    let square = [(0, 1), (1, 2), (2, 0)].iter().all(|&(a, b)| axes[a].dot(axes[b]).abs() <= tolerance);
    // A shear stretches more than any axis; the Frobenius norm bounds every direction.
    let max_scale = if square { longest } else { lengths.iter().map(|l| l * l).sum::<f32>().sqrt() };
    let mirrored = m.determinant() < 0.0;
    let t = world_from_object.translation;
    let rows = std::array::from_fn(|row| [axes[0][row], axes[1][row], axes[2][row], t[row]]);
    InstanceData {
        world_from_object: rows,
        previous_world_from_object: rows,
        max_scale,
        // Normal cones survive rotation, uniform scale and translation only.
        flags: u32::from(mirrored) | u32::from(equal && square && !mirrored) << 1,
        node,
        reserved: 0,
    }
}

#[derive(Default)]
struct Heap {
    words: Vec<u32>,
    clusters: Vec<ClusterData>,
    clusters_of_mesh: Vec<std::ops::Range<usize>>,
}

impl Heap {
    fn add_mesh(&mut self, mesh: &cs::Mesh, materials: &[cs::Material]) {
        let first = self.clusters.len();
        for primitive in &mesh.primitives {
            self.add_primitive(primitive, &materials[primitive.material]);
        }
        self.clusters_of_mesh.push(first..self.clusters.len());
    }

    fn add_primitive(&mut self, primitive: &cs::Primitive, material: &cs::Material) {
        let positions: &[u8] = bytemuck::cast_slice(&primitive.positions);
        // The stride divides the bytes and the offset is inside it, so this cannot fail.
        let Ok(adapter) = meshopt::VertexDataAdapter::new(positions, size_of::<Vec3>(), 0) else { return };
        let meshlets = meshopt::build_meshlets(
            &primitive.indices,
            &adapter,
            MAX_CLUSTER_VERTICES,
            MAX_CLUSTER_TRIANGLES,
            CONE_WEIGHT,
        );
        for meshlet in meshlets.iter() {
            let bounds = meshopt::compute_meshlet_bounds(meshlet, &adapter);
            let cluster = ClusterData {
                sphere: [bounds.center[0], bounds.center[1], bounds.center[2], bounds.radius],
                cone: [bounds.cone_axis[0], bounds.cone_axis[1], bounds.cone_axis[2], bounds.cone_cutoff],
                positions: self.words.len() as u32,
                attributes: 0,
                triangles: 0,
                triangle_count: (meshlet.triangles.len() / 3) as u32,
                extras: NO_EXTRAS,
                material: primitive.material as u32,
                double_sided: u32::from(material.double_sided),
                vertex_count: meshlet.vertices.len() as u32,
            };
            self.add_cluster(primitive, meshlet, cluster);
        }
    }

    fn add_cluster(
        &mut self,
        primitive: &cs::Primitive,
        meshlet: meshopt::Meshlet<'_>,
        mut cluster: ClusterData,
    ) {
        let vertices = || meshlet.vertices.iter().map(|&vertex| vertex as usize);
        for vertex in vertices() {
            self.words.extend(primitive.positions[vertex].to_array().map(f32::to_bits));
        }
        cluster.attributes = self.words.len() as u32;
        for vertex in vertices() {
            let normal = primitive.normals.get(vertex).copied().unwrap_or(Vec3::Y);
            let uv = primitive.uvs[0].get(vertex).copied().unwrap_or_default();
            self.words.push(snorm_pair(oct(normal)));
            self.words.push(primitive.tangents.get(vertex).map_or(u32::MAX, |&t| tangent_word(t)));
            self.words.extend([uv.x.to_bits(), uv.y.to_bits()]);
        }
        if !primitive.uvs[1].is_empty() || !primitive.colors.is_empty() {
            cluster.extras = self.words.len() as u32;
            for vertex in vertices() {
                let first = primitive.uvs[0].get(vertex).copied().unwrap_or_default();
                let uv = primitive.uvs[1].get(vertex).copied().unwrap_or(first);
                let color = primitive.colors.get(vertex).copied().unwrap_or(Vec4::ONE);
                self.words.extend([uv.x.to_bits(), uv.y.to_bits(), color_word(color)]);
            }
        }
        cluster.triangles = self.words.len() as u32;
        let corners = meshlet.triangles.chunks_exact(3);
        self.words.extend(corners.map(|c| u32::from(c[0]) | u32::from(c[1]) << 8 | u32::from(c[2]) << 16));
        self.clusters.push(cluster);
    }
}

/// Octahedral coordinates of a unit vector; twin of `oct_from_unit` in `oct.wesl`.
fn oct(n: Vec3) -> Vec2 {
    let p = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs()).max(1e-20);
    if n.z >= 0.0 {
        return p;
    }
    let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
    Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

fn snorm_pair(v: Vec2) -> u32 {
    let code = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    code(v.x) | code(v.y) << 16
}

/// The bitangent's sign takes the low bit of the second component.
fn tangent_word(tangent: Vec4) -> u32 {
    let word = snorm_pair(oct(tangent.truncate())) & !(1 << 16);
    // All ones means none; the neighbour is half a thousandth of a degree away.
    (word | u32::from(tangent.w < 0.0) << 16).min(u32::MAX - 1)
}

/// Square roots of linear colour in unorm bytes: finer where it is dark.
fn color_word(color: Vec4) -> u32 {
    let code = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u32;
    code(color.x.max(0.0).sqrt())
        | code(color.y.max(0.0).sqrt()) << 8
        | code(color.z.max(0.0).sqrt()) << 16
        | code(color.w) << 24
}
