//! What of a scene rays can meet, triangle by triangle.

use chiaro_scene as cs;
use glam::{DMat4, DVec4, Vec3, Vec3A, Vec4};
use obvhs::aabb::Aabb;

use super::tree::Word;
use crate::scene::material;
use crate::scene::{Cut, Drawn, InstanceData};

/// Of a triangle whose instance is the one that the ray is in, and of a tree in world space.
pub(super) const NO_INSTANCE: u32 = u32::MAX;
/// Of a triangle.
const MASKED: u32 = 1;
const ONE_SIDED: u32 = 2;
const SEE_THROUGH: u32 = 4;
/// Words of a triangle.
pub(super) const TRIANGLE: usize = 3;
/// What boxes are widened by, relative to their tree's largest coordinate: rounding of transforms that the GPU does its
/// own way, and of planes that are found from a node's grid.
pub(super) const PAD: f32 = 2e-6;
/// What counts as a tree's largest coordinate at least, metres.
const LEAST_EXTENT: f32 = 1e-6;
/// Beyond this coordinates are no scene but an accident; what is there is left out.
const FARTHEST: f32 = 1e15;

/// A triangle that is drawn somewhere, or somewhere in its mesh.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TriangleRef {
    /// What names it to shaders: cluster << 8 | triangle, instance, first position in `geometry`, corners of
    /// 8 bits.
    pub word: Word,
    /// World space for what has an instance, else object space.
    pub corners: [Vec3; 3],
    pub material: u32,
    masked: bool,
    one_sided: bool,
    see_through: bool,
}

impl TriangleRef {
    /// Whether parts of it are cut out.
    pub fn masked(&self) -> bool {
        self.masked
    }

    /// What `traverse.wesl` reads.
    pub fn words(&self) -> [Word; TRIANGLE] {
        let flag = |is: bool, flag: u32| if is { flag } else { 0 };
        let flags =
            flag(self.masked, MASKED) | flag(self.one_sided, ONE_SIDED) | flag(self.see_through, SEE_THROUGH);
        let last = [self.word[0], self.word[1], flags];
        std::array::from_fn(|i| {
            let [x, y, z] = self.corners[i].to_array().map(f32::to_bits);
            [x, y, z, last[i]]
        })
    }
}

/// What is to be hit of a drawn mesh, in world space.
pub(crate) fn placed_triangles(scene: &cs::Scene, cut: &Cut, drawn: &Drawn) -> Vec<TriangleRef> {
    let clusters = drawn.clusters.clone();
    clusters.flat_map(|cluster| cluster_triangles(scene, cut, cluster, drawn.instance)).collect()
}

/// The same in object space.
pub(super) fn own_triangles(scene: &cs::Scene, cut: &Cut, drawn: &Drawn) -> Vec<TriangleRef> {
    let clusters = drawn.clusters.clone();
    clusters.flat_map(|cluster| cluster_triangles(scene, cut, cluster, NO_INSTANCE)).collect()
}

/// What is to be hit of a cluster drawn at an instance, or at none.
pub(crate) fn cluster_triangles<'a>(
    scene: &'a cs::Scene,
    cut: &'a Cut,
    cluster: usize,
    instance: u32,
) -> impl Iterator<Item = TriangleRef> + 'a {
    let data = &cut.heap.clusters[cluster];
    let material = data.material;
    let made_of = &scene.materials[material as usize];
    let masked = material::alpha_cutoff(made_of) > 0.0;
    let (one_sided, see_through) = (material::one_sided(made_of), material::see_through(made_of));
    (0..data.triangle_count).filter_map(move |triangle| {
        let packed = cut.heap.words[(data.triangles + triangle) as usize] & 0xff_ffff;
        let corners = [0, 8, 16].map(|shift| {
            let at = (data.positions + 3 * (packed >> shift & 0xff)) as usize;
            let own = Vec3::from_array(std::array::from_fn(|i| f32::from_bits(cut.heap.words[at + i])));
            if instance == NO_INSTANCE { own } else { to_world(&cut.instances[instance as usize], own) }
        });
        let sane = corners.iter().all(|&p| is_somewhere(p));
        let word = [(cluster as u32) << 8 | triangle, instance, data.positions, packed];
        sane.then_some(TriangleRef { word, corners, material, masked, one_sided, see_through })
    })
}

/// Whether a place is one that things may be at.
pub(super) fn is_somewhere(p: Vec3) -> bool {
    p.abs().max_element() < FARTHEST && !p.is_nan()
}

fn to_world(instance: &InstanceData, p: Vec3) -> Vec3 {
    Vec3::from_array(instance.world_from_object.map(|row| Vec4::from(row).dot(p.extend(1.0))))
}

/// Rows of object from world space; nothing for what is squeezed flat.
pub(super) fn inverse_rows(instance: &InstanceData) -> Option<[Word; 3]> {
    let [x, y, z] = instance.world_from_object.map(|row| Vec4::from(row).as_dvec4());
    let inverse = DMat4::from_cols(x, y, z, DVec4::W).transpose().inverse().transpose();
    let rows = [inverse.x_axis, inverse.y_axis, inverse.z_axis].map(DVec4::as_vec4);
    rows.iter().all(|row| row.is_finite()).then(|| rows.map(|row| row.to_array().map(f32::to_bits)))
}

/// The box around points.
pub(super) fn around(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::INVALID, |all, &p| Aabb::new(all.min.min(p.into()), all.max.max(p.into())))
}

/// The largest coordinate of anything in a box.
pub(super) fn farthest(b: &Aabb) -> f32 {
    b.min.abs().max(b.max.abs()).max_element().max(LEAST_EXTENT)
}

/// Widens the boxes of a tree by as much as all rounding together may come to.
pub(super) fn padded(mut boxes: Vec<Aabb>) -> Vec<Aabb> {
    let pad = Vec3A::splat(PAD * boxes.iter().map(farthest).fold(0.0, f32::max));
    for b in &mut boxes {
        *b = Aabb::new(b.min - pad, b.max + pad);
    }
    boxes
}

/// A box in object space as a box in world space.
pub(super) fn moved(object: &Aabb, instance: &InstanceData) -> Aabb {
    let corners: [Vec3; 8] = std::array::from_fn(|corner| {
        let pick = |axis: usize| if corner >> axis & 1 == 0 { object.min[axis] } else { object.max[axis] };
        to_world(instance, Vec3::from_array(std::array::from_fn(pick)))
    });
    around(&corners)
}
