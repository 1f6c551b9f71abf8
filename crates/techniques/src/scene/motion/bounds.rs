//! Boxes around what moves, cheap enough for every frame: from bounds at rest, not from vertices.

use chiaro_scene as cs;
use glam::{Affine3A, Vec3};

/// Something that moves, with what bounds it whatever its pose.
#[derive(Clone, Debug)]
pub(crate) struct Mover {
    node: cs::Id,
    // Object-space boxes: of the vertices that each joint moves; a single one where the node itself does.
    parts: Vec<Option<(Vec3, Vec3)>>,
    // How far each morph target moves any vertex, metres.
    reach: Vec<f32>,
}

impl Mover {
    pub fn new(scene: &cs::Scene, node: cs::Id) -> Self {
        let skin = scene.nodes[node].skin;
        let mut parts = vec![None; skin.map_or(1, |skin| scene.skins[skin].joints.len())];
        let primitives = scene.nodes[node].mesh.map_or(&[][..], |mesh| &scene.meshes[mesh].primitives);
        let mut reach = Vec::new();
        for primitive in primitives {
            for (vertex, &p) in primitive.positions.iter().enumerate() {
                let mut include = |part: usize| {
                    let grown = parts[part].map_or((p, p), |(lo, hi): (Vec3, Vec3)| (lo.min(p), hi.max(p)));
                    parts[part] = Some(grown);
                };
                if skin.is_none() {
                    include(0);
                    continue;
                }
                let weights = primitive.joint_weights[vertex].to_array();
                let used =
                    primitive.joints[vertex].into_iter().zip(weights).filter(|(_, weight)| *weight > 0.0);
                used.for_each(|(joint, _)| include(usize::from(joint)));
            }
            reach.resize(reach.len().max(primitive.morph_targets.len()), 0.0);
            for (reach, target) in reach.iter_mut().zip(&primitive.morph_targets) {
                *reach = target.positions.iter().map(|d| d.length()).fold(*reach, f32::max);
            }
        }
        Self { node, parts, reach }
    }

    /// Which node.
    pub fn node(&self) -> cs::Id {
        self.node
    }

    /// Corners of a box around it in a pose. A vertex lies among the places that its joints would put it, so within
    /// the box around all of those.
    pub fn bounds_ws(&self, scene: &cs::Scene, pose: &cs::Pose) -> (Vec3, Vec3) {
        let joints = scene.joint_matrices(pose, self.node);
        let own = [pose.world_from_node[self.node]];
        self.bounds_at(if joints.is_empty() { &own[..] } else { &joints[..] }, &pose.morph_weights[self.node])
    }

    /// The same by its joints' matrices, or its own where there are none, and its morph weights.
    pub fn bounds_at(&self, matrices: &[Affine3A], weights: &[f32]) -> (Vec3, Vec3) {
        let reach: f32 = self.reach.iter().zip(weights).map(|(reach, weight)| reach * weight.abs()).sum();
        let parts =
            self.parts.iter().zip(matrices).filter_map(|(part, matrix)| Some((part.as_ref()?, matrix)));
        let boxes = parts.map(|(&(lo, hi), matrix)| transformed(lo - reach, hi + reach, matrix));
        let finite = boxes.filter(|(lo, hi)| lo.is_finite() && hi.is_finite());
        finite.reduce(union).unwrap_or_else(|| {
            let at = matrices.first().map_or(Vec3::ZERO, |own| own.translation.into());
            if at.is_finite() { (at, at) } else { (Vec3::ZERO, Vec3::ZERO) }
        })
    }
}

/// Corners of a box in world space that holds everything that moves, at any time: sampled over the animations.
pub(crate) fn bounds_over_time(scene: &cs::Scene) -> Option<(Vec3, Vec3)> {
    const SAMPLES: u32 = 32;
    let moving = scene.moving_nodes();
    let drawn = (0..scene.nodes.len()).filter(|&node| scene.nodes[node].mesh.is_some());
    let movers: Vec<_> = drawn
        .filter(|&node| moving[node] || scene.deforms(&scene.nodes[node]))
        .map(|node| Mover::new(scene, node))
        .collect();
    if movers.is_empty() {
        return None;
    }
    let duration_s = f64::from(scene.duration_s().unwrap_or(0.0));
    let samples = if duration_s > 0.0 { SAMPLES } else { 1 };
    let poses = (0..samples).map(|i| scene.pose(duration_s * f64::from(i) / f64::from(SAMPLES)));
    poses.flat_map(|pose| movers.iter().map(|m| m.bounds_ws(scene, &pose)).collect::<Vec<_>>()).reduce(union)
}

/// The box around two boxes. What is not finite is left out.
pub(crate) fn union((a_lo, a_hi): (Vec3, Vec3), (b_lo, b_hi): (Vec3, Vec3)) -> (Vec3, Vec3) {
    (a_lo.min(b_lo), a_hi.max(b_hi))
}

/// The box around a transformed box (Arvo 1990, "Transforming Axis-Aligned Bounding Boxes").
fn transformed(lo: Vec3, hi: Vec3, matrix: &Affine3A) -> (Vec3, Vec3) {
    let center = matrix.transform_point3(0.5 * (lo + hi));
    let half = 0.5 * (hi - lo);
    let m = matrix.matrix3;
    let reach = Vec3::from(m.x_axis.abs() * half.x + m.y_axis.abs() * half.y + m.z_axis.abs() * half.z);
    (center - reach, center + reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn a_turned_box_is_bounded_by_its_corners() {
        let turn = Affine3A::from_rotation_translation(Quat::from_rotation_z(0.5), Vec3::new(1.0, 2.0, 3.0));
        let (lo, hi) = (Vec3::new(-1.0, 0.0, 2.0), Vec3::new(3.0, 1.0, 2.5));
        let corners = (0..8).map(|i| {
            turn.transform_point3(Vec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), lo, hi))
        });
        let exact = corners.map(|p| (p, p)).reduce(union).unwrap();
        let found = transformed(lo, hi, &turn);
        assert!(found.0.distance(exact.0) < 1e-5 && found.1.distance(exact.1) < 1e-5, "{found:?} {exact:?}");
    }
}
