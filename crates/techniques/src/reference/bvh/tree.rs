//! From boxes to a tree of words: twins of what `traverse.wesl` reads.
//!
//! An inner node is four words: lo₀ and a reference to child 0, hi₀ and a reference to child 1, lo₁, hi₁. A reference
//! is the index of a node's first word, or of a leaf's with their count above.

use std::time::Duration;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::Word;

/// The reference to nothing.
pub(super) const EMPTY: u32 = u32::MAX;
const LEAF: u32 = 1 << 31;
const COUNT_SHIFT: u32 = 28;
/// Most inner nodes on any way from the root to a leaf: together as many as the shader's stack holds.
pub(super) const UPPER_DEPTH: usize = 24;
/// The same of a mesh's tree.
pub(super) const LOWER_DEPTH: usize = 40;

/// A tree among the words.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tree {
    pub root: u32,
    pub bounds: Aabb,
}

/// Appends the tree over `boxes`; leaves hold up to `most` of `things`, and no leaf lies deeper than `deepest`.
pub(super) fn write(
    boxes: &[Aabb],
    things: &[Word],
    (most, deepest): (u32, usize),
    words: &mut Vec<Word>,
) -> Tree {
    if boxes.is_empty() {
        return Tree { root: EMPTY, bounds: Aabb::INVALID };
    }
    let params = BvhBuildParams { max_prims_per_leaf: most, ..BvhBuildParams::medium_build() };
    let mut bvh = build_bvh2(boxes, params, &mut Duration::default());
    if depth(&bvh) > deepest {
        // A chain of nested boxes, for one. The tree's own order is a good one, cut in halves.
        bvh = balanced(boxes, &leaves_in_order(&bvh), most as usize);
    }
    Tree { root: append(&bvh, things, words), bounds: bvh.nodes[0].aabb }
}

/// Inner nodes on the longest way down.
fn depth(bvh: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0usize, 0usize)];
    while let Some((node, depth)) = open.pop() {
        deepest = deepest.max(depth);
        if !bvh.nodes[node].is_leaf() {
            let first = bvh.nodes[node].first_index as usize;
            open.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    deepest
}

fn leaves_in_order(bvh: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(bvh.primitive_indices.len());
    let mut open = vec![0usize];
    while let Some(node) = open.pop() {
        let node = &bvh.nodes[node];
        let first = node.first_index as usize;
        if node.is_leaf() {
            order.extend(&bvh.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            open.extend([first + 1, first]);
        }
    }
    order
}

fn balanced(boxes: &[Aabb], order: &[u32], most: usize) -> Bvh2 {
    let mut nodes = vec![Bvh2Node::default()];
    let mut open = vec![(0usize, 0..order.len())];
    while let Some((node, range)) = open.pop() {
        let around = order[range.clone()].iter().map(|&i| boxes[i as usize]);
        let aabb = around.fold(Aabb::INVALID, |a, b| a.union(&b));
        if range.len() <= most {
            nodes[node] = Bvh2Node::new(aabb, range.len() as u32, range.start as u32);
        } else {
            let first = nodes.len();
            let middle = range.start + range.len() / 2;
            nodes[node] = Bvh2Node::new(aabb, 0, first as u32);
            nodes.extend([Bvh2Node::default(); 2]);
            open.extend([(first, range.start..middle), (first + 1, middle..range.end)]);
        }
    }
    Bvh2 { nodes, primitive_indices: order.to_vec(), ..Bvh2::default() }
}

/// Writes nodes depth first, each leaf's things where its turn comes; returns the reference to the root.
fn append(bvh: &Bvh2, things: &[Word], words: &mut Vec<Word>) -> u32 {
    let mut root = EMPTY;
    // A node, and the word and lane where the reference to it is to stand.
    let mut open = vec![(0usize, None)];
    while let Some((index, place)) = open.pop() {
        let node = &bvh.nodes[index];
        let first = node.first_index as usize;
        let at = words.len();
        let reference = if node.is_leaf() {
            let own = &bvh.primitive_indices[first..first + node.prim_count as usize];
            words.extend(own.iter().map(|&thing| things[thing as usize]));
            LEAF | node.prim_count << COUNT_SHIFT | at as u32
        } else {
            let corner = |v: Vec3A| [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), EMPTY];
            for child in [first, first + 1] {
                let aabb = &bvh.nodes[child].aabb;
                words.extend([corner(aabb.min), corner(aabb.max)]);
            }
            open.extend([(first + 1, Some(at + 1)), (first, Some(at))]);
            at as u32
        };
        match place {
            None => root = reference,
            Some(word) => words[word][3] = reference,
        }
    }
    root
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_boxes_make_no_deep_tree() {
        // Boxes that all reach to the origin, each twice as large as the one before, are what makes trees deep.
        let boxes: Vec<_> =
            (0..120).map(|i| Aabb::new(Vec3A::ZERO, Vec3A::splat(1.5f32.powi(i - 60)))).collect();
        let params = BvhBuildParams { max_prims_per_leaf: 1, ..BvhBuildParams::medium_build() };
        let deep = build_bvh2(&boxes, params, &mut Duration::default());
        let flat = balanced(&boxes, &leaves_in_order(&deep), 1);
        assert!(depth(&deep) > UPPER_DEPTH && depth(&flat) == 7, "{} and {}", depth(&deep), depth(&flat));
        let mut seen = leaves_in_order(&flat);
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..120));
        for node in flat.nodes.iter().filter(|node| !node.is_leaf()) {
            for child in &flat.nodes[node.first_index as usize..][..2] {
                assert!(
                    child.aabb.min.cmpge(node.aabb.min).all() && child.aabb.max.cmple(node.aabb.max).all()
                );
            }
        }
    }
}
