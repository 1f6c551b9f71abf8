//! Geometry cut into clusters: twins of `Cluster` in `scene.wesl` and of the heap that `geometry.wesl` reads.
//!
//! Every primitive is cut into clusters of at most 128 triangles over at most 128 vertices (meshoptimizer), whose
//! vertices are stored together, so that a draw list entry is an item and a byte. Cutting is most of the time that a
//! large scene takes to upload: all primitives are cut at once, and large ones more simply.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use chiaro_scene as cs;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::motion::rest::{self, Rest};
use super::words::{color_word, normal_word, tangent_word};

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
    pub flags: u32,
    pub vertex_count: u32,
}

pub(crate) const NO_EXTRAS: u32 = u32::MAX;
const DOUBLE_SIDED: u32 = 1;
const BENDS: u32 = 2;
/// A normal cone that is never culled.
const NO_CONE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
const MAX_CLUSTER_VERTICES: usize = 128;
const MAX_CLUSTER_TRIANGLES: usize = 128;
/// meshoptimizer's trade between round clusters (0) and clusters whose normals agree (1).
const CONE_WEIGHT: f32 = 0.25;

/// Triangles up to which meshoptimizer's cutter, which takes most of a microsecond for each, cuts a primitive. Larger ones
/// are halved down to clusters, which is quicker.
const PIECE: usize = 1 << 17;

/// A primitive's clusters, by the numbers of its vertices.
pub(crate) struct Meshlets(Vec<Meshlet>);

struct Meshlet {
    vertices: Vec<u32>,
    /// Corners as numbers of `vertices`.
    triangles: Vec<u8>,
    sphere: [f32; 4],
    cone: [f32; 4],
}

impl Meshlets {
    /// Cuts a primitive.
    pub fn new(primitive: &cs::Primitive) -> Self {
        if primitive.indices.len() <= 3 * PIECE {
            return Self(meshlets(&primitive.positions, |adapter| {
                let (vertices, triangles) = (MAX_CLUSTER_VERTICES, MAX_CLUSTER_TRIANGLES);
                meshopt::build_meshlets(&primitive.indices, adapter, vertices, triangles, CONE_WEIGHT)
            }));
        }
        let corners = |t: u32| &primitive.indices[3 * t as usize..][..3];
        let middle = |t: u32| corners(t).iter().map(|&v| primitive.positions[v as usize] / 3.0).sum::<Vec3>();
        let triangles = 0..primitive.indices.len() as u32 / 3;
        let mut triangles: Vec<_> = triangles.into_par_iter().map(|t| (middle(t), t)).collect();
        gather(&mut triangles);
        let cut = |triangles: &[(Vec3, u32)]| {
            let corners = triangles.iter().flat_map(|&(_, t)| corners(t));
            let mut vertices: Vec<u32> = corners.clone().copied().collect();
            vertices.sort_unstable();
            vertices.dedup();
            let place = |vertex: &u32| vertices.partition_point(|v| v < vertex) as u32;
            let indices: Vec<_> = corners.map(place).collect();
            let positions: Vec<_> = vertices.iter().map(|&v| primitive.positions[v as usize]).collect();
            // In their order: as a rule one cluster.
            let mut meshlets = meshlets(&positions, |_| {
                let (vertices, triangles) = (MAX_CLUSTER_VERTICES, MAX_CLUSTER_TRIANGLES);
                meshopt::build_meshlets_scan(&indices, positions.len(), vertices, triangles)
            });
            for vertex in meshlets.iter_mut().flat_map(|meshlet| &mut meshlet.vertices) {
                *vertex = vertices[*vertex as usize];
            }
            meshlets
        };
        Self(triangles.par_chunks(MAX_CLUSTER_TRIANGLES).flat_map_iter(cut).collect())
    }
}

/// Orders triangles, given by their middles, so that every [`MAX_CLUSTER_TRIANGLES`] of them lie together: halves them
/// along the longest side of the box around them until they are so few. These keep the file's order.
fn gather(triangles: &mut [(Vec3, u32)]) {
    if triangles.len() <= MAX_CLUSTER_TRIANGLES {
        triangles.sort_unstable_by_key(|&(_, t)| t);
        return;
    }
    let corners = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (lo, hi) = triangles.iter().fold(corners, |(lo, hi), &(middle, _)| (lo.min(middle), hi.max(middle)));
    let axis = (hi - lo).max_position();
    let half = (triangles.len() / 2).next_multiple_of(MAX_CLUSTER_TRIANGLES);
    triangles.select_nth_unstable_by(half, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    let (low, high) = triangles.split_at_mut(half);
    rayon::join(|| gather(low), || gather(high));
}

/// What meshoptimizer makes of triangles, with bounds.
fn meshlets(
    positions: &[Vec3],
    build: impl FnOnce(&meshopt::VertexDataAdapter<'_>) -> meshopt::Meshlets,
) -> Vec<Meshlet> {
    // The stride divides the bytes and the offset is inside it, so this cannot fail.
    let Ok(adapter) = meshopt::VertexDataAdapter::new(bytemuck::cast_slice(positions), size_of::<Vec3>(), 0)
    else {
        return Vec::new();
    };
    let meshlet = |meshlet: meshopt::Meshlet<'_>| {
        let bounds = meshopt::compute_meshlet_bounds(meshlet, &adapter);
        Meshlet {
            vertices: meshlet.vertices.to_vec(),
            triangles: meshlet.triangles.to_vec(),
            sphere: [bounds.center[0], bounds.center[1], bounds.center[2], bounds.radius],
            cone: [bounds.cone_axis[0], bounds.cone_axis[1], bounds.cone_axis[2], bounds.cone_cutoff],
        }
    };
    build(&adapter).iter().map(meshlet).collect()
}

/// Clusters and the words that hold their vertices and triangles.
#[derive(Default)]
pub(crate) struct Heap {
    pub words: Vec<u32>,
    pub clusters: Vec<ClusterData>,
}

/// How a primitive's vertices get into the heap.
enum Place<'a> {
    /// As they are, in object space.
    Object,
    /// Bent, in world space, to be bent again in every pose: positions now, and where the shape at rest is stored.
    World(&'a [Vec3], &'a mut Rest, &'a mut Vec<rest::Place>),
}

impl Heap {
    /// Puts words before all that is there.
    pub fn begin_with(&mut self, words: &[u32]) {
        self.words.splice(..0, words.iter().copied());
        let by = words.len() as u32;
        for cluster in &mut self.clusters {
            cluster.positions += by;
            cluster.attributes += by;
            cluster.triangles += by;
            if cluster.extras != NO_EXTRAS {
                cluster.extras += by;
            }
        }
    }

    /// Takes a mesh whose primitives have been cut.
    pub fn add_mesh(
        &mut self,
        mesh: &cs::Mesh,
        cut: &[Meshlets],
        materials: &[cs::Material],
    ) -> Range<usize> {
        let first = self.clusters.len();
        for (primitive, meshlets) in mesh.primitives.iter().zip(cut) {
            self.add_primitive(primitive, meshlets, &materials[primitive.material], Place::Object);
        }
        first..self.clusters.len()
    }

    /// Takes a mesh that bends, for one node: its vertices are its own.
    pub fn add_bending(
        &mut self,
        scene: &cs::Scene,
        (pose, node): (&cs::Pose, cs::Id),
        cut: &[Meshlets],
        rest: &mut Rest,
    ) -> Range<usize> {
        let first = self.clusters.len();
        let Some(mesh) = scene.nodes[node].mesh else { return first..first };
        let mut places = Vec::new();
        for (primitive, meshlets) in scene.meshes[mesh].primitives.iter().zip(cut) {
            let positions: Vec<_> = scene.posed_vertices(pose, node, primitive).map(|(p, _)| p).collect();
            let place = Place::World(&positions, rest, &mut places);
            self.add_primitive(primitive, meshlets, &scene.materials[primitive.material], place);
        }
        // Other nodes of the same mesh are cut alike and share its shape at rest.
        rest.places.entry(mesh).or_insert(places);
        first..self.clusters.len()
    }

    fn add_primitive(
        &mut self,
        primitive: &cs::Primitive,
        meshlets: &Meshlets,
        material: &cs::Material,
        mut place: Place<'_>,
    ) {
        for meshlet in &meshlets.0 {
            let cluster = ClusterData {
                sphere: meshlet.sphere,
                cone: meshlet.cone,
                positions: self.words.len() as u32,
                attributes: 0,
                triangles: 0,
                triangle_count: (meshlet.triangles.len() / 3) as u32,
                extras: NO_EXTRAS,
                material: primitive.material as u32,
                flags: if material.double_sided { DOUBLE_SIDED } else { 0 },
                vertex_count: meshlet.vertices.len() as u32,
            };
            self.add_cluster(primitive, meshlet, cluster, &mut place);
        }
    }

    fn add_cluster(
        &mut self,
        primitive: &cs::Primitive,
        meshlet: &Meshlet,
        mut cluster: ClusterData,
        place: &mut Place<'_>,
    ) {
        let vertices = || meshlet.vertices.iter().map(|&vertex| vertex as usize);
        if let Place::World(positions, rest, places) = place {
            cluster.flags |= BENDS;
            cluster.cone = NO_CONE;
            cluster.sphere = sphere(vertices().map(|vertex| positions[vertex]));
            // Now and before.
            for vertex in vertices().chain(vertices()) {
                self.words.extend(positions[vertex].to_array().map(f32::to_bits));
            }
            places.push(rest.add_cluster(primitive, &meshlet.vertices, &meshlet.triangles));
        } else {
            for vertex in vertices() {
                self.words.extend(primitive.positions[vertex].to_array().map(f32::to_bits));
            }
        }
        cluster.attributes = self.words.len() as u32;
        for vertex in vertices() {
            let normal = primitive.normals.get(vertex).copied().unwrap_or(Vec3::Y);
            let uv = primitive.uvs[0].get(vertex).copied().unwrap_or_default();
            self.words.push(normal_word(normal));
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

/// Around the middle of a box; twin of what `deform.cs.wesl` does.
fn sphere(points: impl Iterator<Item = Vec3> + Clone) -> [f32; 4] {
    let (lo, hi) =
        points.clone().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let center = 0.5 * (lo + hi);
    let radius = points.map(|p| p.distance(center)).fold(0.0, f32::max);
    center.extend(1.0001 * radius).to_array()
}
