//! Places of nodes beyond what the crate's `f32` holds: JSON has numbers of 64 bits.

use ::gltf::json::{Root, Value, deserialize};
use glam::DVec3;

use crate::{Id, Keys, Scene};

/// Nearer than this, metres, `f32` holds a micrometre.
const NEAR_M: f32 = 16.0;

/// By node of the file, what is left of its translation when `f32` is taken away; empty where nothing is far.
pub(super) fn remainders(root: &Root, json: &[u8]) -> Vec<DVec3> {
    let read = |node: &::gltf::json::Node| {
        node.translation.or_else(|| node.matrix.map(|m| [m[12], m[13], m[14]])).unwrap_or_default()
    };
    if root.nodes.iter().all(|node| read(node).iter().all(|x| x.abs() < NEAR_M)) {
        return Vec::new();
    }
    let Ok(value) = deserialize::from_slice::<Value>(json) else { return Vec::new() };
    let number = |node: usize, member: &str, index: usize| {
        value.pointer(&format!("/nodes/{node}/{member}/{index}")).and_then(Value::as_f64)
    };
    let remainder = |(index, node): (usize, &::gltf::json::Node)| {
        let (member, first) = if node.translation.is_some() { ("translation", 0) } else { ("matrix", 12) };
        let rounded = read(node);
        DVec3::from_array(std::array::from_fn(|axis| {
            number(index, member, first + axis).map_or(0.0, |exact| exact - f64::from(rounded[axis]))
        }))
    };
    root.nodes.iter().enumerate().map(remainder).collect()
}

/// Gives the scene's nodes what is left of their translations; not those whose translation keyframes replace.
pub(super) fn place(scene: &mut Scene, ids: &[Option<Id>], remainders: &[DVec3]) {
    for (id, &remainder) in ids.iter().zip(remainders).filter_map(|(id, r)| Some(((*id)?, r))) {
        let mut channels = scene.animations.iter().flat_map(|animation| &animation.channels);
        if !channels.any(|channel| channel.node == id && matches!(channel.keys, Keys::Translation(_))) {
            scene.nodes[id].offset = remainder;
        }
    }
}
