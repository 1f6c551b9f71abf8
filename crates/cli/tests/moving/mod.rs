//! A small scene in which a triangle and a camera move.

use std::path::Path;

/// Writes `moving.gltf` into a folder: within a second a triangle goes to the right and the camera `ride` up, the camera
/// `rest` stays.
pub fn write(folder: &Path) -> String {
    let positions = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let (right, up) = ([[0.0; 3], [1.0, 0.0, 0.0]], [[0.0, 0.0, 4.0], [0.0, 0.5, 4.0]]);
    let floats = positions.into_iter().chain(right).chain(up).flatten().chain([0.0, 1.0]);
    let bytes: Vec<u8> = floats.flat_map(|value: f32| value.to_le_bytes()).collect();
    std::fs::create_dir_all(folder).unwrap();
    std::fs::write(folder.join("moving.bin"), &bytes).unwrap();
    let view = |offset: u32, length: u32| serde_json::json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
    let camera = |name: &str| {
        let perspective = serde_json::json!({ "yfov": 0.8, "znear": 0.1 });
        serde_json::json!({ "name": name, "type": "perspective", "perspective": perspective })
    };
    let channel = |sampler: u32, node: u32| serde_json::json!({ "sampler": sampler, "target": { "node": node, "path": "translation" } });
    let gltf = serde_json::json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0, 1, 2] }],
        "scene": 0,
        "nodes": [
            { "mesh": 0 },
            { "camera": 0, "translation": [0.0, 0.0, 4.0] },
            { "camera": 1, "translation": [0.0, 0.0, 5.0] },
        ],
        "cameras": [camera("ride"), camera("rest")],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "buffers": [{ "uri": "moving.bin", "byteLength": bytes.len() }],
        "bufferViews": [view(0, 36), view(36, 24), view(60, 24), view(84, 8)],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3" },
            { "bufferView": 2, "componentType": 5126, "count": 2, "type": "VEC3" },
            { "bufferView": 3, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1] },
        ],
        "animations": [{
            "samplers": [{ "input": 3, "output": 1 }, { "input": 3, "output": 2 }],
            "channels": [channel(0, 0), channel(1, 1)],
        }],
    });
    let path = folder.join("moving.gltf");
    std::fs::write(&path, gltf.to_string()).unwrap();
    path.to_str().unwrap().to_owned()
}
