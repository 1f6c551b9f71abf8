//! From boxes to a tree of eight-way nodes: twins of what `traverse.wesl` reads.

use std::ops::Range;

use glam::Vec3A;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh;
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::cwbvh::{BRANCHING, CwBvh};
use obvhs::ploc::PlocBuilder;

/// A word of `tracer`.
pub(crate) type Word = [u32; 4];

/// The reference to nothing.
pub(super) const EMPTY: u32 = u32::MAX;
/// Words of a node.
pub(super) const NODE: usize = 5;
/// Most nodes on any way from the root down: with [`LOWER_DEPTH`] and the two groups that a ray leaves where it enters
/// an instance, as many as the shader's stack holds.
pub(super) const UPPER_DEPTH: usize = 10;
/// The same of a mesh's tree.
pub(super) const LOWER_DEPTH: usize = 20;
/// A binary tree deeper than that would be converted by too deep a recursion.
const BINARY_DEPTH: usize = 256;
/// Things of a leaf at most: a node counts them with three bits.
pub(super) const LEAF: usize = 3;

/// The tree over `boxes`; leaves hold up to `most` of them, and no way down is longer than `deepest` nodes.
pub(super) fn wide(boxes: &[Aabb], most: usize, deepest: usize) -> CwBvh {
    let params = BvhBuildParams::very_slow_build();
    let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
        params.ploc_search_distance,
        boxes,
        (0..boxes.len() as u32).collect(),
        params.sort_precision,
        params.search_depth_threshold,
    );
    ReinsertionOptimizer::default().run(&mut binary, params.reinsertion_batch_ratio, None);
    // A chain of nested boxes makes a deep tree, for one. The tree's own order is a good one, cut in eighths.
    if binary_depth(&binary) > BINARY_DEPTH {
        return balanced(boxes, leaves_in_order(&binary), most);
    }
    let wide = bvh2_to_cwbvh(&binary, most as u32, true, false);
    if depth(&wide) > deepest { balanced(boxes, leaves_in_order(&binary), most) } else { wide }
}

/// The tree's nodes, and after them what its leaves hold, `N` words for each thing, as they stand from word `first` on.
pub(super) fn words<const N: usize>(
    tree: &CwBvh,
    thing: impl Fn(u32) -> [Word; N],
    first: usize,
) -> impl Iterator<Item = Word> {
    let things = first + NODE * tree.nodes.len();
    let nodes = tree.nodes.iter().flat_map(move |node| {
        let child_base_idx = first as u32 + NODE as u32 * node.child_base_idx;
        let primitive_base_idx = things as u32 + N as u32 * node.primitive_base_idx;
        let node = CwBvhNode { child_base_idx, primitive_base_idx, ..*node };
        bytemuck::cast::<CwBvhNode, [Word; NODE]>(node)
    });
    nodes.chain(tree.primitive_indices.iter().flat_map(move |&index| thing(index)))
}

/// Inner nodes on the longest way down.
fn binary_depth(tree: &Bvh2) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0usize, 0usize)];
    while let Some((index, depth)) = open.pop() {
        deepest = deepest.max(depth);
        if let Some(node) = tree.nodes.get(index).filter(|node| !node.is_leaf()) {
            let first = node.first_index as usize;
            open.extend([(first, depth + 1), (first + 1, depth + 1)]);
        }
    }
    deepest
}

/// Nodes on the longest way down.
fn depth(tree: &CwBvh) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0usize, 1usize)];
    while let Some((index, depth)) = open.pop() {
        deepest = deepest.max(depth);
        let Some(node) = tree.nodes.get(index) else { continue };
        let children = 0..node.imask.count_ones() as usize;
        open.extend(children.map(|child| (node.child_base_idx as usize + child, depth + 1)));
    }
    deepest
}

fn leaves_in_order(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.primitive_indices.len());
    let mut open = vec![0usize];
    while let Some(index) = open.pop() {
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        if node.is_leaf() {
            order.extend(&tree.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            open.extend([first + 1, first]);
        }
    }
    order
}

/// The tree whose nodes cut what they hold into eight equal parts.
fn balanced(boxes: &[Aabb], order: Vec<u32>, most: usize) -> CwBvh {
    let around = |range: Range<usize>| {
        order[range].iter().fold(Aabb::INVALID, |all, &i| all.union(&boxes[i as usize]))
    };
    let total_aabb = around(0..order.len());
    let mut nodes = vec![CwBvhNode::default()];
    let mut open = vec![(0usize, 0..order.len())];
    while let Some((index, range)) = open.pop() {
        let cut = |part: usize| range.start + range.len() * part / BRANCHING;
        let parts = (0..BRANCHING).map(|part| cut(part)..cut(part + 1)).filter(|part| !part.is_empty());
        let leaves = range.len() <= BRANCHING * most;
        let mut node = CwBvhNode {
            child_base_idx: nodes.len() as u32,
            primitive_base_idx: range.start as u32,
            ..CwBvhNode::default()
        };
        let mut children = [Aabb::INVALID; BRANCHING];
        for (slot, part) in parts.enumerate() {
            children[slot] = around(part.clone());
            if leaves {
                let unary = (1u8 << part.len()) - 1;
                node.child_meta[slot] = unary << 5 | (part.start - range.start) as u8;
            } else {
                node.imask |= 1 << slot;
                node.child_meta[slot] = 1 << 5 | (24 + slot as u8);
                open.push((nodes.len(), part));
                nodes.push(CwBvhNode::default());
            }
        }
        enclose(&mut node, &children);
        nodes[index] = node;
    }
    CwBvh { nodes, primitive_indices: order, total_aabb, ..CwBvh::default() }
}

/// Lays a node's grid around its children. Twin of `enclose` in `refit.cs.wesl`.
fn enclose(node: &mut CwBvhNode, children: &[Aabb; BRANCHING]) {
    let all = children.iter().fold(Aabb::INVALID, |all, child| all.union(child));
    let extent = (all.max - all.min).max(Vec3A::ZERO).to_array();
    // The power of two above: 255 steps reach at least as far.
    let exponents = extent.map(|extent| ((extent / 255.0).to_bits() >> 23) + 1);
    let step = Vec3A::from_array(exponents.map(|e| f32::from_bits(e << 23)));
    node.p = all.min.into();
    node.e = exponents.map(|e| e as u8);
    for (slot, child) in children.iter().enumerate().filter(|(slot, _)| node.child_meta[*slot] != 0) {
        let lo = ((child.min - all.min) / step).floor().to_array().map(|q| q as u8);
        let hi = ((child.max - all.min) / step).ceil().to_array().map(|q| q as u8);
        [node.child_min_x[slot], node.child_min_y[slot], node.child_min_z[slot]] = lo;
        [node.child_max_x[slot], node.child_max_y[slot], node.child_max_z[slot]] = hi;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that every box is in one leaf, and lies in its box.
    fn assert_encloses(tree: &CwBvh, boxes: &[Aabb]) {
        let mut seen = Vec::new();
        let mut open = vec![0usize];
        while let Some(index) = open.pop() {
            let node = &tree.nodes[index];
            for child in (0..BRANCHING).filter(|&child| !node.is_child_empty(child)) {
                let own = node.child_aabb(child);
                let within = |inner: &Aabb, outer: &Aabb| {
                    let slack = 1e-6 * outer.diagonal().length();
                    (inner.min + slack).cmpge(outer.min).all() && (inner.max - slack).cmple(outer.max).all()
                };
                if !node.is_leaf(child) {
                    open.push(node.child_node_index(child) as usize);
                    continue;
                }
                let (first, count) = node.child_primitives(child);
                for &held in &tree.primitive_indices[first as usize..(first + count) as usize] {
                    assert!(within(&boxes[held as usize], &own), "{:?} {own:?}", boxes[held as usize]);
                    seen.push(held);
                }
            }
        }
        seen.sort_unstable();
        assert!(seen.into_iter().eq(0..boxes.len() as u32));
    }

    #[test]
    fn nested_boxes_make_no_deep_tree() {
        // Boxes that all reach to the origin, each larger than the one before, are what makes trees deep.
        let boxes: Vec<_> =
            (0..120).map(|i| Aabb::new(Vec3A::ZERO, Vec3A::splat(1.5f32.powi(i - 60)))).collect();
        let deep = wide(&boxes, 1, usize::MAX);
        let flat = wide(&boxes, 1, 3);
        assert!(depth(&deep) > UPPER_DEPTH && depth(&flat) == 3, "{} and {}", depth(&deep), depth(&flat));
        assert_encloses(&flat, &boxes);
    }

    #[test]
    fn every_thing_is_in_one_leaf_of_either_kind_of_tree() {
        for count in [1usize, 2, 7, 24, 25, 1000] {
            let boxes: Vec<_> = (0..count)
                .map(|i| {
                    let at = |turn: usize| (i * turn % 97) as f32 * 0.1;
                    let lo = Vec3A::new(at(31), at(57), at(83));
                    Aabb::new(lo, lo + Vec3A::new(0.3, 0.0, at(11)))
                })
                .collect();
            assert_encloses(&wide(&boxes, LEAF, LOWER_DEPTH), &boxes);
            assert_encloses(&balanced(&boxes, (0..count as u32).collect(), LEAF), &boxes);
        }
    }
}
