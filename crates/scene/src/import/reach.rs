//! How far a scene's geometry can get, at any time.
//!
//! Transforms multiply down the hierarchy, keyframes replace them and splines overshoot, so that world-space positions
//! can overflow with every single number in range. A bound of each node's scale and distance, over all of time, tells.

use std::path::Path;

use glam::{Affine3A, Vec3};

use crate::{Channel, Interpolation, Keys, Mesh, Scene, SceneError};

/// The farthest that a position may get, in metres: its square, and sums of such, are in the range of `f32`.
const MAX_REACH: f64 = 1e18;

/// How much a transform stretches at most, and how far it moves.
#[derive(Clone, Copy)]
struct Reach {
    scale: f64,
    distance: f64,
}

impl Reach {
    fn of(affine: &Affine3A) -> Self {
        let columns = affine.matrix3;
        // The Frobenius norm: at least the spectral one.
        let squares = [columns.x_axis, columns.y_axis, columns.z_axis].map(glam::Vec3A::as_dvec3);
        let scale = squares.iter().map(|c| c.length_squared()).sum::<f64>().sqrt();
        Self { scale, distance: affine.translation.as_dvec3().length() }
    }

    /// First `inner`, then this.
    fn after(self, inner: Self) -> Self {
        Self { scale: self.scale * inner.scale, distance: self.distance + self.scale * inner.distance }
    }

    fn max(self, other: Self) -> Self {
        Self { scale: self.scale.max(other.scale), distance: self.distance.max(other.distance) }
    }

    fn is_sound(self) -> bool {
        self.scale <= MAX_REACH && self.distance <= MAX_REACH
    }
}

/// Refuses a finished scene whose geometry could get out of the range of `f32`.
pub(super) fn check(path: &Path, scene: &Scene) -> Result<(), SceneError> {
    let refuse = |place: String, problem: &str| {
        Err(SceneError::Invalid { path: path.to_owned(), place, problem: problem.to_owned() })
    };
    let mut own: Vec<Reach> =
        scene.nodes.iter().map(|node| Reach::of(&node.parent_from_node.affine())).collect();
    let mut weights: Vec<f64> = vec![0.0; scene.nodes.len()];
    // Parts of a pose combine freely over time: the largest scale of any key with the largest of any other.
    for channel in scene.animations.iter().flat_map(|animation| &animation.channels) {
        let largest = largest(channel);
        match channel.keys {
            Keys::Translation(_) => own[channel.node].distance = own[channel.node].distance.max(largest),
            Keys::Scale(_) => own[channel.node].scale = own[channel.node].scale.max(largest),
            Keys::Rotation(_) => {}
            Keys::MorphWeights(_) => weights[channel.node] = weights[channel.node].max(largest),
        }
    }
    let mut world: Vec<Reach> = Vec::with_capacity(own.len());
    let meshes: Vec<(f64, Vec<f64>)> = scene.meshes.iter().map(extent).collect();
    for (node, own) in scene.nodes.iter().zip(own) {
        let reach = node.parent.map_or(own, |parent| world[parent].after(own));
        if !reach.is_sound() {
            return refuse(
                "nodes".to_owned(),
                "the nodes' transforms multiply to numbers that are not finite",
            );
        }
        world.push(reach);
    }
    for (index, node) in scene.nodes.iter().enumerate() {
        let Some(mesh) = node.mesh else { continue };
        let (positions, targets) = &meshes[mesh];
        let at_rest = if node.morph_weights.is_empty() {
            &scene.meshes[mesh].morph_weights
        } else {
            &node.morph_weights
        };
        let weight = |target: usize| f64::from(at_rest[target].abs()).max(weights[index]);
        let morphed: f64 = targets.iter().enumerate().map(|(target, largest)| weight(target) * largest).sum();
        let vertex = Reach { scale: 0.0, distance: positions + morphed };
        let mut placed = world[index];
        if let Some(skin) = node.skin.map(|skin| &scene.skins[skin]) {
            let joints = skin.joints.iter().zip(&skin.joint_from_object);
            placed =
                joints.map(|(&joint, bind)| world[joint].after(Reach::of(bind))).fold(placed, Reach::max);
        }
        if !placed.is_sound() || !placed.after(vertex).is_sound() {
            let problem = "its transforms multiply the mesh's positions to numbers that are not finite";
            return refuse("nodes".to_owned(), problem);
        }
    }
    Ok(())
}

/// The farthest of a mesh's positions from its origin, and the largest difference of each morph target.
fn extent(mesh: &Mesh) -> (f64, Vec<f64>) {
    let farthest = |vectors: &[Vec3]| vectors.iter().map(|v| v.as_dvec3().length()).fold(0.0, f64::max);
    let positions = mesh.primitives.iter().map(|p| farthest(&p.positions)).fold(0.0, f64::max);
    let target = |target: usize| {
        let of = |p: &crate::Primitive| {
            p.morph_targets.get(target).map_or(0.0, |t| farthest(&t.positions).max(farthest(&t.normals)))
        };
        mesh.primitives.iter().map(of).fold(0.0, f64::max)
    };
    (positions, (0..mesh.morph_targets()).map(target).collect())
}

/// The largest length that a channel's value takes on.
fn largest(channel: &Channel) -> f64 {
    let lengths: Vec<f64> = match &channel.keys {
        Keys::Translation(keys) | Keys::Scale(keys) => keys.iter().map(|k| k.as_dvec3().length()).collect(),
        Keys::Rotation(_) => return 1.0,
        Keys::MorphWeights(keys) => keys.iter().map(|&k| f64::from(k.abs())).collect(),
    };
    let largest = lengths.into_iter().fold(0.0, f64::max);
    if channel.interpolation != Interpolation::Cubic {
        return largest;
    }
    // Hermite's basis functions are at most 1 (the two of the values together) and 4/27 < 1 each.
    let span_s = channel.times_s.windows(2).map(|pair| f64::from(pair[1] - pair[0])).fold(0.0, f64::max);
    largest * (1.0 + 2.0 * span_s)
}
