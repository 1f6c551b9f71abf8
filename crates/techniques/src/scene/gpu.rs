//! A scene on the GPU: group 1. Twin of `Item` in `scene.wesl`.
//!
//! Items, a cluster at an instance, are sorted by class, so that one prefix sum lays out the draws of all classes.

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{self, BindingType, BufferBindingType, ShaderStages};
use chiaro_gpu::{Binding, Buffer, Gpu, GpuError, Group, GroupLayout, Handle, Texture};
use chiaro_scene as cs;
use glam::Vec3;
use rayon::prelude::*;

use super::clusters::{Heap, Meshlets};
use super::instance::{InstanceData, bending_instance_data, instance_data};
use super::motion::{self, MotionBuilder, SceneMotion, bounds_over_time};
use super::{material, texture};

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct ItemData {
    pub cluster: u32,
    pub instance: u32,
}

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// A draw list entry keeps 24 bits for the item.
const MAX_ITEMS: usize = 1 << 24;

/// How clusters are drawn: each class is one indirect draw per view.
pub const CLASSES: usize = 8;
/// Classes that differ by how they are drawn: double-sided or not, masked or not.
pub const KINDS: usize = 4;
/// Classes of opaque and masked surfaces.
pub const OPAQUE: Range<usize> = 0..KINDS;
/// Classes of surfaces that others are seen through.
pub const SEE_THROUGH: Range<usize> = KINDS..CLASSES;

/// Class of a material: bit 0 double-sided, bit 1 masked or blended, bit 2 see-through.
fn class(material: &cs::Material) -> usize {
    usize::from(material.double_sided)
        | usize::from(material::alpha_cutoff(material) > 0.0) << 1
        | usize::from(material::see_through(material)) << 2
}

/// What motion writes: the very buffers of group 1.
#[derive(Debug)]
pub(crate) struct SceneBuffers {
    pub geometry: Buffer,
    pub clusters: Buffer,
    pub instances: Buffer,
}

/// A scene's buffers and textures, and the facts that passes need about it.
#[derive(Debug)]
pub struct SceneGpu {
    id: u64,
    group: Group,
    pub(crate) buffers: SceneBuffers,
    sampler: wgpu::Sampler,
    /// What moves, and how it stands now.
    pub motion: SceneMotion,
    /// Draws in all: clusters times their instances.
    pub item_count: u32,
    /// First item of each class.
    pub class_first: [u32; CLASSES],
    /// Triangles of all items.
    pub triangle_count: u32,
    /// World-space corners of all geometry at all times, metres, and of what a pose has elsewhere; zero-sized without
    /// geometry.
    pub bounds_ws: (Vec3, Vec3),
    // The same without poses of somebody's own making.
    own_bounds_ws: (Vec3, Vec3),
    /// Whether any material is unlit.
    pub unlit: bool,
    /// What shaders may leave out.
    pub facts: SceneFacts,
    /// Bytes on the GPU.
    pub bytes: u64,
}

/// What a scene's materials use, so that pipelines and what in them serves nothing are left out. Passes made for more serve
/// less.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SceneFacts {
    /// Bits of `TEXTURES` in `texture.wesl`.
    pub textures: u32,
    /// Texture size classes in use.
    pub size_classes: u32,
    /// Whether any texture keeps its texels.
    pub exact_textures: bool,
    /// Classes of surfaces that are drawn, a bit each.
    pub classes: u32,
    /// Whether any material shines by itself.
    pub glows: bool,
    /// Of its trees for rays, once it has some; see `TraceFacts`.
    pub tree_levels: u32,
    /// See `tree_levels`.
    pub tree_masks: bool,
}

impl SceneFacts {
    fn of(scene: &cs::Scene, textures: texture::TextureFacts) -> Self {
        let bits = |m: &cs::Material| {
            let uses = [
                m.base_color_texture.is_some(),
                m.metallic_roughness_texture.is_some(),
                m.normal_texture.is_some(),
                m.occlusion_texture.is_some(),
                m.emissive_texture.is_some(),
                m.specular_texture.is_some(),
                m.specular_color_texture.is_some(),
                m.transmission_texture.is_some(),
                m.thickness_texture.is_some(),
            ];
            uses.iter().enumerate().fold(0, |bits, (bit, used)| bits | u32::from(*used) << bit)
        };
        Self {
            textures: scene.materials.iter().fold(0, |all, m| all | bits(m)),
            size_classes: textures.size_classes,
            exact_textures: textures.exact,
            classes: drawn_materials(scene).fold(0, |all, m| all | 1 << class(m)),
            glows: scene.materials.iter().any(material::glows),
            tree_levels: 0,
            tree_masks: false,
        }
    }

    /// What serves both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            textures: self.textures | other.textures,
            size_classes: self.size_classes.max(other.size_classes),
            exact_textures: self.exact_textures | other.exact_textures,
            classes: self.classes | other.classes,
            glows: self.glows || other.glows,
            tree_levels: self.tree_levels.max(other.tree_levels),
            tree_masks: self.tree_masks || other.tree_masks,
        }
    }

    /// Whether passes made for these serve `other`.
    pub fn serve(self, other: Self) -> bool {
        self.union(other) == self
    }

    /// Whether any surface is see-through.
    pub fn see_through(self) -> bool {
        self.draws(SEE_THROUGH) != [false; KINDS]
    }

    /// Of which kinds there are surfaces among some classes.
    pub fn draws(self, classes: Range<usize>) -> [bool; KINDS] {
        std::array::from_fn(|kind| {
            classes.clone().any(|class| class % KINDS == kind && self.classes & 1 << class != 0)
        })
    }

    /// Constants of every shader that evaluates materials.
    pub fn constants(self) -> [(&'static str, f64); 3] {
        [
            ("TEXTURES", f64::from(self.textures)),
            ("SIZE_CLASSES", f64::from(self.size_classes.max(1))),
            ("EXACT_TEXTURES", f64::from(u8::from(self.exact_textures))),
        ]
    }
}

fn drawn_materials(scene: &cs::Scene) -> impl Iterator<Item = &cs::Material> {
    let meshes = scene.nodes.iter().filter_map(|node| node.mesh);
    let primitives = meshes.flat_map(|mesh| &scene.meshes[mesh].primitives);
    primitives.map(|primitive| &scene.materials[primitive.material])
}

/// A mesh where a node draws it.
pub(crate) struct Drawn {
    pub instance: u32,
    pub node: cs::Id,
    pub mesh: cs::Id,
    pub clusters: Range<usize>,
    /// Neither moves nor bends.
    pub fixed: bool,
}

/// A scene's geometry as it lies in the heap, always the same for the same scene.
pub(crate) struct Cut {
    pub heap: Heap,
    motion: MotionBuilder,
    pub instances: Vec<InstanceData>,
    pub drawn: Vec<Drawn>,
    // Sorted by class; the heap's first words.
    items: Vec<ItemData>,
    class_first: [u32; CLASSES],
    triangles: u64,
}

impl Cut {
    /// Cuts what a scene draws, as it stands in `pose`.
    pub fn new(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let mut heap = Heap::default();
        let cuts = cut(scene);
        let mut motion = MotionBuilder::default();
        let mut clusters_of_mesh = vec![None; scene.meshes.len()];
        let moving = scene.moving_nodes();
        let mut instances = Vec::new();
        let mut drawn = Vec::new();
        for (node, (scene_node, world)) in scene.nodes.iter().zip(&pose.world_from_node).enumerate() {
            let Some(mesh) = scene_node.mesh else { continue };
            let instance = instances.len() as u32;
            let bends = scene.deforms(scene_node);
            let clusters = if bends {
                let clusters = heap.add_bending(scene, (pose, node), &cuts[mesh], &mut motion.rest);
                motion.add_bending(scene, instance, node, clusters.clone());
                instances.push(bending_instance_data(world));
                clusters
            } else {
                motion.add_rigid(instance, node, moving[node]);
                instances.push(instance_data(world));
                let add = || heap.add_mesh(&scene.meshes[mesh], &cuts[mesh], &scene.materials);
                clusters_of_mesh[mesh].get_or_insert_with(add).clone()
            };
            drawn.push(Drawn { instance, node, mesh, clusters, fixed: !bends && !moving[node] });
        }
        let mut items: Vec<(usize, ItemData)> = Vec::new();
        let mut triangles = 0u64;
        for Drawn { instance, clusters, .. } in &drawn {
            for cluster in clusters.clone() {
                let data = &heap.clusters[cluster];
                triangles += u64::from(data.triangle_count);
                let class = class(&scene.materials[data.material as usize]);
                items.push((class, ItemData { cluster: cluster as u32, instance: *instance }));
            }
        }
        items.sort_by_key(|(class, _)| *class);
        let class_first = std::array::from_fn(|class| items.partition_point(|(c, _)| *c < class) as u32);
        let items: Vec<_> = items.into_iter().map(|(_, item)| item).collect();
        heap.begin_with(bytemuck::cast_slice(&items));
        Self { heap, motion, instances, drawn, items, class_first, triangles }
    }
}

/// The clusters of all meshes that are drawn, by mesh and primitive.
fn cut(scene: &cs::Scene) -> Vec<Vec<Meshlets>> {
    let mut drawn = vec![false; scene.meshes.len()];
    for mesh in scene.nodes.iter().filter_map(|node| node.mesh) {
        drawn[mesh] = true;
    }
    let meshes = scene.meshes.par_iter().zip(drawn);
    let mesh = |(mesh, drawn): (&cs::Mesh, bool)| {
        if drawn { mesh.primitives.par_iter().map(Meshlets::new).collect() } else { Vec::new() }
    };
    meshes.map(mesh).collect()
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
        let pose = scene.pose(0.0);
        let Cut { mut heap, motion, instances, items, class_first, triangles, .. } = Cut::new(scene, &pose);
        check(gpu, &items, triangles, (4 * heap.words.len() as u64).max(motion.largest_buffer()))?;

        let (arrays, slots, texture_facts) = texture::upload(gpu, scene)?;
        let materials: Vec<_> =
            scene.materials.iter().map(|m| material::pack(m, &slots, &mut heap.words)).collect();
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let geometry = Buffer::with_data(gpu, "geometry", &heap.words, usage);
        let clusters = Buffer::with_data(gpu, "clusters", &heap.clusters, usage);
        let instances = Buffer::with_data(gpu, "instances", &instances, usage);
        let materials = Buffer::with_data(gpu, "materials", &materials, usage);
        let sampler = sampler(gpu);
        let mut bindings: Vec<Binding<'_>> =
            [&geometry, &clusters, &instances, &materials].map(Binding::from).to_vec();
        bindings.extend(arrays.iter().map(Binding::from));
        bindings.push((&sampler).into());
        let group = layout.group(gpu, &bindings);
        let buffers = [&geometry, &clusters, &instances, &materials];
        let motion = motion.finish(gpu, scene);
        let bytes = buffers.iter().map(|b| b.raw().size()).sum::<u64>()
            + arrays.iter().map(Texture::bytes).sum::<u64>()
            + motion.bytes();
        Ok(Self {
            id: NEXT_ID.fetch_add(1, Ordering::Relaxed),
            group,
            sampler,
            buffers: SceneBuffers { geometry, clusters, instances },
            motion,
            item_count: items.len() as u32,
            class_first,
            triangle_count: triangles as u32,
            bounds_ws: bounds(scene, &pose),
            own_bounds_ws: bounds(scene, &pose),
            unlit: scene.materials.iter().any(material::is_unlit),
            facts: SceneFacts::of(scene, texture_facts),
            bytes,
        })
    }

    /// Takes a pose, to be carried out with the next frame.
    pub fn set_pose(&mut self, scene: &cs::Scene, pose: &cs::Pose) {
        let origin = self.motion.origin();
        let moved = self.motion.set(scene, pose, (self.bounds_ws.1 - self.bounds_ws.0).length());
        if scene.origin != origin {
            self.own_bounds_ws = bounds(scene, &scene.pose(0.0));
            self.bounds_ws = self.own_bounds_ws;
        }
        if moved && let Some(now) = self.motion.bounds_ws() {
            // A pose of somebody's own making may leave the bounds that the animations have. Where it has been is kept, so
            // that what is fitted to the bounds comes to rest, but not what it once reached far outside of them.
            let now = motion::union(self.own_bounds_ws, now);
            let ever = motion::union(self.bounds_ws, now);
            let size = |(lo, hi): (Vec3, Vec3)| (hi - lo).max_element();
            self.bounds_ws = if size(ever) <= 2.0 * size(self.own_bounds_ws) { ever } else { now };
        }
    }

    /// The geometry heap's words, the clusters ([`super::clusters::ClusterData`]) and the instances ([`InstanceData`]), for
    /// programs that look at what motion made of them.
    pub fn buffers(&self) -> [&Buffer; 3] {
        [&self.buffers.geometry, &self.buffers.clusters, &self.buffers.instances]
    }

    /// Whether anything drawn is see-through.
    pub fn see_through(&self) -> bool {
        self.class_first[SEE_THROUGH.start] < self.item_count
    }

    /// The classes that have something to draw.
    pub fn classes(&self) -> Range<usize> {
        if self.see_through() { 0..CLASSES } else { OPAQUE }
    }

    /// What group 1 binds by this name, for bind groups of one's own.
    pub fn binding(&self, name: &str) -> Option<Binding<'_>> {
        Some(match self.group.handle(name) {
            Some(Handle::Buffer(buffer)) => buffer.into(),
            Some(Handle::Texture(texture)) => texture.into(),
            None if name == "material_sampler" => (&self.sampler).into(),
            None => return None,
        })
    }

    /// A number that no other scene has, so that caches know what they hold.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The filled group.
    pub fn group(&self) -> &Group {
        &self.group
    }
}

/// Around everything at all times.
fn bounds(scene: &cs::Scene, pose: &cs::Pose) -> (Vec3, Vec3) {
    let boxes = [scene.bounds_at(pose), bounds_over_time(scene)];
    boxes.into_iter().flatten().reduce(motion::union).unwrap_or_default()
}

fn check(gpu: &Gpu, items: &[ItemData], triangles: u64, heap: u64) -> Result<(), GpuError> {
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
