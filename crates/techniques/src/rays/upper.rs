//! The tree over trees: a few boxes, sorted anew whenever something has moved.

use chiaro_scene as cs;
use glam::Vec3A;
use obvhs::aabb::Aabb;

use super::tree::{self, EMPTY, NODE, UPPER_DEPTH, Word};
use super::triangle::{NO_INSTANCE, inverse_rows, is_somewhere, moved, padded};
use crate::scene::instance_data;
use crate::scene::motion::Mover;

/// Of the root: its tree's leaves hold triangles.
const TRIANGLES: u32 = 1 << 31;
/// Words of an instance.
const INSTANCE: usize = 4;

/// How a mesh's tree gets into the world.
#[derive(Clone, Debug)]
pub(super) enum Place {
    /// It lies there.
    Still,
    /// A node carries it there.
    Carried { instance: u32, node: cs::Id },
    /// It lies there, but bends.
    Bent(Mover),
}

/// A tree of triangles, and where it is.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub root: u32,
    /// Of the triangles, in the tree's space, as it was built.
    pub bounds: Aabb,
    pub place: Place,
}

impl Placed {
    /// Its box in world space, and its words; nothing for what is squeezed flat, which has no inside to go to.
    fn thing(&self, scene: &cs::Scene, pose: &cs::Pose) -> Option<(Aabb, [Word; INSTANCE])> {
        let lies = [[0; 4], [0; 4], [0; 4], [NO_INSTANCE, self.root, 0, 0]];
        match &self.place {
            Place::Still => Some((self.bounds, lies)),
            Place::Bent(mover) => {
                let (lo, hi) = mover.bounds_ws(scene, pose);
                // In the pose that it was built in, vertices that no joint moves far may round outwards.
                let slack = Vec3A::splat(1e-5 * (hi - lo).length());
                Some((Aabb::new(Vec3A::from(lo) - slack, Vec3A::from(hi) + slack), lies))
            }
            &Place::Carried { instance, node } => {
                let data = instance_data(&pose.world_from_node[node]);
                let [x, y, z] = inverse_rows(&data)?;
                Some((moved(&self.bounds, &data), [x, y, z, [instance, self.root, 0, 0]]))
            }
        }
    }
}

/// The most words that a tree over so many trees takes: each node has two children or more.
pub(super) fn room(count: usize) -> usize {
    NODE * count.saturating_sub(1).max(1) + INSTANCE * count
}

/// What the header says of the root, and the words from `first` on.
pub(super) fn build(
    placed: &[Placed],
    (scene, pose): (&cs::Scene, &cs::Pose),
    first: usize,
) -> (u32, Vec<Word>) {
    if let [Placed { root, place: Place::Still | Place::Bent(_), .. }] = placed {
        return (root | TRIANGLES, Vec::new());
    }
    let things = placed.iter().filter_map(|placed| placed.thing(scene, pose));
    let things: Vec<_> =
        things.filter(|(b, _)| is_somewhere(b.min.into()) && is_somewhere(b.max.into())).collect();
    let boxes = padded(things.iter().map(|(bounds, _)| *bounds).collect());
    let tree = tree::wide(&boxes, 1, UPPER_DEPTH);
    let words: Vec<_> = tree::words(&tree, |index| things[index as usize].1, first).collect();
    (if words.is_empty() { EMPTY } else { first as u32 }, words)
}
