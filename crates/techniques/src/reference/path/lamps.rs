//! Glowing meshes that move: what lights are chosen by must know how large they are.

use chiaro_scene as cs;
use glam::Mat3;

/// What lengths may be off by, relatively, before tables are made anew.
const TOLERANCE: f32 = 1e-6;

/// Nodes whose glowing triangles can change their size.
#[derive(Clone, Debug)]
pub(super) struct Lamps {
    carried: Vec<(cs::Id, Mat3)>,
    bent: bool,
}

impl Lamps {
    /// In the pose that the tables are made for.
    pub fn new(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let mut lamps = Self { carried: Vec::new(), bent: false };
        for (node, drawn) in scene.nodes.iter().enumerate() {
            let Some(mesh) = drawn.mesh else { continue };
            let glows = |p: &cs::Primitive| scene.materials[p.material].emissive.max_element() > 0.0;
            if !scene.meshes[mesh].primitives.iter().any(glows) {
                continue;
            }
            if scene.deforms(drawn) {
                lamps.bent = true;
            } else {
                lamps.carried.push((node, lengths(pose, node)));
            }
        }
        lamps
    }

    /// Takes a new pose; whether any area may be another than in the one before.
    pub fn changed(&mut self, pose: &cs::Pose) -> bool {
        let mut changed = self.bent;
        for (node, before) in &mut self.carried {
            let now = lengths(pose, *node);
            let largest = before.to_cols_array().into_iter().fold(0.0, |all: f32, v| all.max(v.abs()));
            // A comparison with NaN is false.
            let same = now.abs_diff_eq(*before, TOLERANCE * largest);
            if !same {
                *before = now;
                changed = true;
            }
        }
        changed
    }
}

/// Squares of lengths along and between a node's axes: all that areas depend on.
fn lengths(pose: &cs::Pose, node: cs::Id) -> Mat3 {
    let m = Mat3::from(pose.world_from_node[node].matrix3);
    m.transpose() * m
}
