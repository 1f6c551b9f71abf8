//! Instances: twins of `Instance` in `scene.wesl`.

use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, Vec3};

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct InstanceData {
    pub world_from_object: [[f32; 4]; 3],
    pub previous_world_from_object: [[f32; 4]; 3],
    pub max_scale: f32,
    pub flags: u32,
    pub reserved: [u32; 2],
}

impl InstanceData {
    /// Of [`InstanceData::flags`]: the triangles' winding is turned over.
    pub(crate) const MIRRORED: u32 = 1;
}

/// The instance of a mesh that bends, whose vertices are stored in world space; `matrix` tells whether it is mirrored.
pub(crate) fn bending_instance_data(matrix: &Affine3A) -> InstanceData {
    let flags = u32::from(matrix.matrix3.determinant() < 0.0);
    InstanceData { flags, ..instance_data(&Affine3A::IDENTITY) }
}

/// The instance of a node at its pose, at rest.
pub fn instance_data(world_from_object: &Affine3A) -> InstanceData {
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
        reserved: [0; 2],
    }
}
