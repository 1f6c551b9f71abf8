//! Where positions count from: `f32` holds millimetres only so far out.
//!
//! A place 14 km out is known to a millimetre, one 100 km out to 8 mm, and what is computed from such places is worse by
//! as much again as there are steps. So places are kept in two parts, an origin in `f64` and the rest in `f32`: nodes are
//! multiplied out in `f64`, and world space is what is left once [`Scene::origin`] is taken away. Up to a stated distance
//! the origin is that of the file, so that scenes near it keep their coordinates.

use glam::{DAffine3, DVec3};

use crate::{Pose, Scene};

/// World space is the file's own as far as this from its origin, metres: numbers of `f32` stand 0.06 mm apart there.
const NEAR_M: f64 = 1000.0;
/// Scenes that are small keep their coordinates to so many of their diagonals, so that a scene's unit does not matter.
const NEAR_DIAGONALS: f64 = 16.0;
/// Origins lie on a grid of this part of that distance, so that like cameras have like ones.
const GRID: f64 = 0.125;

impl Scene {
    /// Chooses the origin that world space counts from: the file's own where the scene is near it, else a point close to
    /// what is looked at, which is the scene's nearest to `eye_m` (in the file's coordinates, metres), or its middle. One
    /// that is still near is kept. Returns whether it is another now; poses, views and bounds of before are off by as much
    /// then.
    pub fn settle(&mut self, eye_m: Option<DVec3>) -> bool {
        let Some((lo, hi)) = self.bounds_at(&self.pose(0.0)) else { return false };
        let (lo, hi) = (lo.as_dvec3() + self.origin, hi.as_dvec3() + self.origin);
        let seen = eye_m.map_or(0.5 * (lo + hi), |eye| eye.clamp(lo, hi));
        let diagonal = lo.distance(hi);
        let near = if diagonal > 0.0 { NEAR_M.min(NEAR_DIAGONALS * diagonal) } else { NEAR_M };
        if !seen.is_finite() || seen.distance(self.origin) <= near {
            return false;
        }
        let step = (GRID * near).log2().floor().exp2();
        self.origin = if seen.length() <= near { DVec3::ZERO } else { (seen / step).round() * step };
        true
    }

    /// World from node for all nodes, from the nodes' own transforms in their parents.
    pub(crate) fn multiplied_out(&self, local: Vec<crate::Transform>, morph_weights: Vec<Vec<f32>>) -> Pose {
        let mut world: Vec<DAffine3> = Vec::with_capacity(local.len());
        for (node, local) in self.nodes.iter().zip(local) {
            let mut own = local.affine().as_daffine3();
            own.translation += node.offset;
            world.push(node.parent.map_or(own, |parent| world[parent] * own));
        }
        let relative = |mut place: DAffine3| {
            place.translation -= self.origin;
            place.as_affine3a()
        };
        Pose { world_from_node: world.into_iter().map(relative).collect(), morph_weights }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Mesh, Node, Primitive, Transform};
    use glam::Vec3;

    /// A triangle of `size` m under two nodes, whose places add up to `at`.
    fn scene(at: DVec3, size: f32) -> Scene {
        let primitive = Primitive {
            positions: vec![Vec3::ZERO, Vec3::X * size, Vec3::Y * size],
            normals: vec![Vec3::Z; 3],
            indices: vec![0, 1, 2],
            ..Primitive::default()
        };
        let parent = Node {
            parent_from_node: Transform::Matrix(glam::Affine3A::from_translation(Vec3::splat(-7.0))),
            offset: at,
            ..Node::default()
        };
        let child = Node {
            parent: Some(0),
            parent_from_node: Transform::Matrix(glam::Affine3A::from_translation(Vec3::splat(7.0))),
            mesh: Some(0),
            ..Node::default()
        };
        Scene {
            meshes: vec![Mesh { primitives: vec![primitive], ..Mesh::default() }],
            materials: vec![crate::Material::default()],
            nodes: vec![parent, child],
            ..Scene::default()
        }
    }

    #[test]
    fn a_scene_near_the_files_origin_keeps_its_coordinates() {
        for (at, size) in [(DVec3::ZERO, 1e-3), (DVec3::X * 900.0, 100.0), (DVec3::splat(1e-2), 1e-3)] {
            let mut scene = scene(at, size);
            assert!(!scene.settle(None) && !scene.settle(Some(at + 2.0)), "{size} m at {at}");
            assert_eq!(scene.origin, DVec3::ZERO);
        }
    }

    #[test]
    fn far_from_it_places_are_as_exact_as_close_to_it() {
        let at = DVec3::new(100_000.125 + 0.001, 3e-4, -70_000.7);
        for size in [1e-3, 1.0, 50.0] {
            let mut scene = scene(at, size);
            assert!(scene.settle(None), "{size} m");
            let place = scene.pose(0.0).world_from_node[1].translation.as_dvec3() + scene.origin;
            assert!(place.distance(at) < 1e-5 * f64::from(size).max(0.1), "{size} m: off by {}", place - at);
            let (lo, _) = scene.bounds().unwrap();
            assert!(lo.length() < 16.0 * 2.0 * size.max(1.0), "{size} m: {lo}");
        }
    }

    #[test]
    fn the_origin_follows_the_eye_over_a_large_scene_and_rests_while_it_is_near() {
        let mut scene = scene(DVec3::ZERO, 50_000.0);
        assert!(scene.settle(Some(DVec3::new(40_000.0, 20_000.0, 2.0))));
        let first = scene.origin;
        assert!(first.distance(DVec3::new(40_000.0, 20_000.0, 0.0)) < 120.0, "{first}");
        assert!(!scene.settle(Some(DVec3::new(40_300.0, 20_100.0, 2.0))));
        assert!(scene.settle(Some(DVec3::new(10_000.0, 20_000.0, 2.0))));
        assert!(scene.settle(Some(DVec3::new(10.0, 20.0, 2.0))));
        assert_eq!(scene.origin, DVec3::ZERO);
    }
}
