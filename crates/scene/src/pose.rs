//! Where everything is at a moment: keyframes sampled, the hierarchy multiplied out.
//!
//! Source: glTF 2.0, section 3.11 and appendix C.

use std::collections::HashSet;

use glam::{Affine3A, Mat4, Quat, Vec3};

use crate::{Animation, Channel, Id, Interpolation, Keys, Scene, Transform};

/// A scene's moving parts at one moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// World transform of every node, in node order; the world counts from [`Scene::origin`].
    pub world_from_node: Vec<Affine3A>,
    /// Morph weights of every node; empty where its mesh has no morph targets.
    pub morph_weights: Vec<Vec<f32>>,
}

impl Pose {
    /// Stands a node, with all that hangs on it, elsewhere: animated or not, a mesh, a camera or a light. `scene` is the one
    /// that the pose is of. What hangs on a node squeezed flat is not carried along. A transform that is not finite is told
    /// by whoever takes the pose ([`Scene::validate_pose`]).
    ///
    /// # Panics
    /// When the scene has no such node.
    pub fn set_world(&mut self, scene: &Scene, node: Id, world_from_node: Affine3A) {
        let by = world_from_node * self.world_from_node[node].inverse();
        self.world_from_node[node] = world_from_node;
        if !by.is_finite() {
            return;
        }
        let mut carried = vec![false; scene.nodes.len()];
        carried[node] = true;
        for (index, child) in scene.nodes.iter().enumerate().skip(node + 1) {
            if child.parent.is_some_and(|parent| carried[parent]) {
                carried[index] = true;
                self.world_from_node[index] = by * self.world_from_node[index];
            }
        }
    }
}

/// Which property of a node a channel drives.
fn property(keys: &Keys) -> u8 {
    match keys {
        Keys::Translation(_) => 0,
        Keys::Rotation(_) => 1,
        Keys::Scale(_) => 2,
        Keys::MorphWeights(_) => 3,
    }
}

impl Scene {
    /// The pose without any animation.
    pub fn rest(&self) -> Pose {
        self.multiplied_out(
            self.nodes.iter().map(|node| node.parent_from_node).collect(),
            self.rest_weights(),
        )
    }

    /// The pose at `time_s` seconds. Every animation of [`Scene::playing`] runs from time 0 and starts again when it
    /// is over. Negative times count as 0.
    pub fn pose(&self, time_s: f64) -> Pose {
        let mut local: Vec<_> = self.nodes.iter().map(|node| node.parent_from_node).collect();
        let mut weights = self.rest_weights();
        for animation in self.playing().into_iter().map(|id| &self.animations[id]) {
            let at_s = looped(time_s, animation.duration_s());
            for channel in &animation.channels {
                channel.apply(at_s, &mut local[channel.node], &mut weights[channel.node]);
            }
        }
        self.multiplied_out(local, weights)
    }

    /// The animations that play: in the file's order, each that moves nothing an earlier one moves. A model's many
    /// independent parts move together; of several ways that one character moves, the first is shown.
    pub fn playing(&self) -> Vec<Id> {
        let mut taken = HashSet::new();
        let moves = |animation: &Animation| -> Vec<_> {
            animation.channels.iter().map(|channel| (channel.node, property(&channel.keys))).collect()
        };
        let mut free = |animation: &Animation| {
            let targets = moves(animation);
            let free = !targets.is_empty() && targets.iter().all(|target| !taken.contains(target));
            if free {
                taken.extend(targets);
            }
            free
        };
        (0..self.animations.len()).filter(|&id| free(&self.animations[id])).collect()
    }

    /// Seconds until every playing animation has run once; `None` when nothing moves.
    pub fn duration_s(&self) -> Option<f32> {
        self.playing().into_iter().map(|id| self.animations[id].duration_s()).reduce(f32::max)
    }

    /// Whether each node's world transform changes over time.
    pub fn moving_nodes(&self) -> Vec<bool> {
        let mut moving = vec![false; self.nodes.len()];
        for animation in self.playing().into_iter().map(|id| &self.animations[id]) {
            for channel in animation.channels.iter().filter(|c| !matches!(c.keys, Keys::MorphWeights(_))) {
                moving[channel.node] = true;
            }
        }
        for (index, node) in self.nodes.iter().enumerate() {
            moving[index] |= node.parent.is_some_and(|parent| moving[parent]);
        }
        moving
    }

    /// World pose of every camera that a node places, as (camera, world_from_camera).
    pub fn placed_cameras_at(&self, pose: &Pose) -> Vec<(Id, Mat4)> {
        let placed = self.nodes.iter().zip(&pose.world_from_node);
        placed.filter_map(|(node, m)| node.camera.map(|c| (c, Mat4::from(*m)))).collect()
    }

    /// World pose of every light that a node places, as (light, world_from_light).
    pub fn placed_lights_at(&self, pose: &Pose) -> Vec<(Id, Affine3A)> {
        let placed = self.nodes.iter().zip(&pose.world_from_node);
        placed.filter_map(|(node, m)| node.light.map(|l| (l, *m))).collect()
    }

    fn rest_weights(&self) -> Vec<Vec<f32>> {
        let of = |node: &crate::Node| match node.mesh {
            Some(mesh) if node.morph_weights.is_empty() => self.meshes[mesh].morph_weights.clone(),
            _ => node.morph_weights.clone(),
        };
        self.nodes.iter().map(of).collect()
    }
}

/// Seconds into an animation that repeats. Its very end still shows the last key.
fn looped(time_s: f64, duration_s: f32) -> f32 {
    let duration_s = f64::from(duration_s);
    let time_s = time_s.max(0.0);
    if time_s <= duration_s || duration_s <= 0.0 {
        return time_s.min(duration_s) as f32;
    }
    (time_s % duration_s) as f32
}

impl Channel {
    /// Sets the animated property to its value at `at_s` seconds. Before the first key and after the last, theirs.
    fn apply(&self, at_s: f32, local: &mut Transform, weights: &mut [f32]) {
        let spot = self.spot(at_s);
        let cubic = self.interpolation == Interpolation::Cubic;
        let vector = |keys: &[Vec3]| spot.mix(cubic, |i| keys[i], Vec3::lerp);
        if let Keys::MorphWeights(keys) = &self.keys {
            let count = weights.len();
            for (target, weight) in weights.iter_mut().enumerate() {
                *weight = spot.mix(cubic, |i| keys[i * count + target], |a, b, t| a + t * (b - a));
            }
            return;
        }
        // A matrix cannot be animated part by part.
        if let Transform::Matrix(matrix) = *local {
            let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
            *local = Transform::Trs { translation, rotation, scale };
        }
        let Transform::Trs { translation, rotation, scale } = local else { return };
        match &self.keys {
            Keys::Translation(keys) => *translation = vector(keys),
            Keys::Scale(keys) => *scale = vector(keys),
            Keys::Rotation(keys) => {
                let mixed = spot.mix(cubic, |i| keys[i], Quat::slerp);
                // A spline may pass through zero, where there is no rotation.
                *rotation = if mixed.length_squared() > 1e-12 { mixed.normalize() } else { *rotation };
            }
            Keys::MorphWeights(_) => {}
        }
    }

    /// Between which keys a time lies.
    fn spot(&self, at_s: f32) -> Spot {
        let times = &self.times_s;
        let after = times.partition_point(|&time| time <= at_s);
        if after == 0 || after == times.len() {
            return Spot { key: after.saturating_sub(1), next: None };
        }
        if self.interpolation == Interpolation::Step {
            return Spot { key: after - 1, next: None };
        }
        let span_s = times[after] - times[after - 1];
        Spot { key: after - 1, next: Some(((at_s - times[after - 1]) / span_s, span_s)) }
    }
}

/// A key, and how far on the way to the next: the share 0..1 of the span, and the span in seconds.
struct Spot {
    key: usize,
    next: Option<(f32, f32)>,
}

impl Spot {
    /// The value here, from values by index and a straight mix of two.
    fn mix<T>(&self, cubic: bool, value: impl Fn(usize) -> T, straight: impl Fn(T, T, f32) -> T) -> T
    where
        T: Copy + std::ops::Add<Output = T> + std::ops::Mul<f32, Output = T>,
    {
        if !cubic {
            return match self.next {
                None => value(self.key),
                Some((t, _)) => straight(value(self.key), value(self.key + 1), t),
            };
        }
        let at = 3 * self.key;
        let Some((t, span_s)) = self.next else { return value(at + 1) };
        let (t2, t3) = (t * t, t * t * t);
        value(at + 1) * (2.0 * t3 - 3.0 * t2 + 1.0)
            + value(at + 2) * (span_s * (t3 - 2.0 * t2 + t))
            + value(at + 4) * (3.0 * t2 - 2.0 * t3)
            + value(at + 3) * (span_s * (t3 - t2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Node;

    fn channel(interpolation: Interpolation, keys: Keys) -> Channel {
        Channel { node: 0, times_s: vec![1.0, 3.0], interpolation, keys }
    }

    /// Height of the only node at a time.
    fn height(channels: Vec<Channel>, time_s: f64) -> f32 {
        let animation = Animation { name: String::new(), channels };
        let scene = Scene { nodes: vec![Node::default()], animations: vec![animation], ..Scene::default() };
        scene.pose(time_s).world_from_node[0].translation.y
    }

    #[test]
    fn steps_hold_lines_connect_and_ends_stay() {
        let keys = Keys::Translation(vec![Vec3::Y, 5.0 * Vec3::Y]);
        for (interpolation, at_2) in [(Interpolation::Step, 1.0), (Interpolation::Linear, 3.0)] {
            let at = |t| height(vec![channel(interpolation, keys.clone())], t);
            assert_eq!([at(0.0), at(2.0), at(3.0)], [1.0, at_2, 5.0]);
            // It starts again after its end, and before the first key that key holds.
            assert_eq!(at(3.5), 1.0);
        }
    }

    #[test]
    fn a_spline_with_the_tangents_of_a_parabola_is_that_parabola() {
        // y = t² has the slope 2t, here at t = 1 and t = 3; slopes beyond the ends must not matter.
        let keys = [9e9, 1.0, 2.0, 6.0, 9.0, 9e9].map(|y| y * Vec3::Y);
        for t in [1.0, 1.3, 2.0, 2.9, 3.0] {
            let y =
                height(vec![channel(Interpolation::Cubic, Keys::Translation(keys.to_vec()))], f64::from(t));
            assert!((y - t * t).abs() < 1e-5, "{y} at {t}");
        }
    }

    #[test]
    fn what_hangs_on_a_node_moves_with_it() {
        let node = |parent, y: f32| Node {
            parent,
            parent_from_node: Transform::Matrix(Affine3A::from_translation(y * Vec3::Y)),
            ..Node::default()
        };
        let nodes = vec![node(None, 1.0), node(Some(0), 1.0), node(None, 5.0), node(Some(1), 1.0)];
        let scene = Scene { nodes, ..Scene::default() };
        let mut pose = scene.rest();
        pose.set_world(&scene, 1, Affine3A::from_scale(Vec3::splat(2.0)));
        let heights: Vec<_> = pose.world_from_node.iter().map(|world| world.translation.y).collect();
        assert_eq!(heights, [1.0, 0.0, 5.0, 2.0]);
    }

    #[test]
    fn rotations_take_the_shorter_arc_at_even_speed() {
        let turn = Quat::from_rotation_x(1.0);
        let keys = Keys::Rotation(vec![Quat::IDENTITY, -turn]);
        let animation =
            Animation { channels: vec![channel(Interpolation::Linear, keys)], ..Default::default() };
        let scene = Scene { nodes: vec![Node::default()], animations: vec![animation], ..Scene::default() };
        let (_, rotation, _) = scene.pose(1.5).world_from_node[0].to_scale_rotation_translation();
        assert!(rotation.abs_diff_eq(Quat::from_rotation_x(0.25), 1e-5), "{rotation}");
    }

    #[test]
    fn independent_animations_play_together_and_of_rivals_the_first() {
        let lift = |y| vec![channel(Interpolation::Linear, Keys::Translation(vec![y * Vec3::Y; 2]))];
        let grow = vec![channel(Interpolation::Linear, Keys::Scale(vec![Vec3::ONE; 2]))];
        let animation = |channels| Animation { name: String::new(), channels };
        let scene = Scene {
            nodes: vec![Node::default()],
            animations: vec![animation(lift(1.0)), animation(lift(2.0)), animation(grow), animation(vec![])],
            ..Scene::default()
        };
        assert_eq!(scene.playing(), [0, 2]);
        assert_eq!(scene.pose(2.0).world_from_node[0].translation.y, 1.0);
        assert_eq!(scene.duration_s(), Some(3.0));
        assert_eq!(scene.moving_nodes(), [true]);
    }
}
