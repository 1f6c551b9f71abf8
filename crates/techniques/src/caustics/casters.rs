//! What causes caustics, and where it stands.

use chiaro_scene as cs;
use glam::{BVec3, Vec3};

use crate::paths::Specular;

/// Two corners of a box.
type Bounds = (Vec3, Vec3);

/// What of a scene mirrors exactly or refracts without blur, and the box that holds it.
#[derive(Clone, Debug)]
pub struct Casters {
    specular: Specular,
    /// Nodes that carry such things, and their box in the node's space.
    carried: Vec<(cs::Id, Bounds)>,
    bends: bool,
    bounds_ws: Option<Bounds>,
}

impl Casters {
    /// Looks at a scene as it stands in a pose; materials' textures are looked through.
    pub fn new(scene: &cs::Scene, pose: &cs::Pose) -> Self {
        let specular = Specular::of(scene);
        let mut casters = Self { specular, carried: Vec::new(), bends: false, bounds_ws: None };
        for (id, node) in scene.nodes.iter().enumerate() {
            let Some(mesh) = node.mesh else { continue };
            let primitives = scene.meshes[mesh].primitives.iter();
            let of_it: Vec<_> = primitives.filter(|p| casters.specular.is(p.material)).collect();
            if of_it.is_empty() {
                continue;
            }
            if scene.deforms(node) {
                casters.bends = true;
            } else {
                let points = of_it.iter().flat_map(|primitive| primitive.positions.iter().copied());
                casters.carried.extend(around(points).map(|bounds| (id, bounds)));
            }
        }
        casters.follow(scene, pose);
        casters
    }

    /// Takes a new pose.
    pub fn follow(&mut self, scene: &cs::Scene, pose: &cs::Pose) {
        self.bounds_ws = if self.bends {
            self.specular.bounds_ws(scene, pose)
        } else {
            let corners = self.carried.iter().flat_map(|(node, bounds)| {
                corners(*bounds).map(|corner| pose.world_from_node[*node].transform_point3(corner))
            });
            around(corners)
        };
    }

    /// The box that holds them, m; `None` where there are none.
    pub fn bounds_ws(&self) -> Option<Bounds> {
        self.bounds_ws
    }
}

fn corners((lo, hi): Bounds) -> [Vec3; 8] {
    std::array::from_fn(|i| Vec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), hi, lo))
}

fn around(points: impl Iterator<Item = Vec3>) -> Option<Bounds> {
    points.map(|p| (p, p)).reduce(|(lo, hi), (a, b)| (lo.min(a), hi.max(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_of_what_mirrors_follows_it() {
        let scene = cs::load("builtin:ball").unwrap();
        let pose = scene.pose(0.0);
        let casters = Casters::new(&scene, &pose);
        let exact = Specular::of(&scene).bounds_ws(&scene, &pose).unwrap();
        let (lo, hi) = casters.bounds_ws().unwrap();
        assert!(lo.cmple(exact.0 + 1e-5).all() && hi.cmpge(exact.1 - 1e-5).all(), "{lo} {hi} {exact:?}");
        let mut moved = pose.clone();
        for node in &mut moved.world_from_node {
            node.translation.x += 1.0;
        }
        let mut casters = casters;
        casters.follow(&scene, &moved);
        assert!((casters.bounds_ws().unwrap().0 - lo - Vec3::X).length() < 1e-5);
    }

    #[test]
    fn where_nothing_mirrors_there_is_no_box() {
        let scene = cs::load("builtin:cornell").unwrap();
        assert!(Casters::new(&scene, &scene.pose(0.0)).bounds_ws().is_none());
    }
}
