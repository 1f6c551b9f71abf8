//! What the fuzz targets share: limits that keep a run fast, and the use of a loaded scene.

pub mod mutate;

use std::path::Path;

use chiaro_scene::invariants::assert_sound;
use chiaro_scene::{Limits, LoadOptions, Memory, Pose, Scene, load_from};

/// A PNG of one red pixel, half transparent.
pub const PNG: &[u8] = &[
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 1, 0, 0, 0, 1, 8, 6, 0, 0, 0, 31, 21, 196,
    137, 0, 0, 0, 13, 73, 68, 65, 84, 120, 218, 99, 100, 248, 207, 80, 15, 0, 3, 134, 1, 128, 90, 52, 125, 107, 0, 0,
    0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

/// Far below the defaults: an input is to take milliseconds.
fn limits() -> Limits {
    Limits {
        vertices: 1 << 14,
        corners: 1 << 16,
        morph_vertices: 1 << 15,
        nodes: 1 << 10,
        drawn_vertices: 1 << 16,
        keys: 1 << 14,
        elements: 1 << 18,
        empty_elements: 1 << 14,
        decompressed: 1 << 18,
        pixels: 1 << 16,
    }
}

/// Loads the scene at `path`. A refusal is fine; what loads must keep the model's promises and be usable.
pub fn load(files: &Memory, path: &str) {
    let options = LoadOptions { limits: limits(), ..LoadOptions::default() };
    match load_from(files, Path::new(path), &options) {
        Ok(scene) => exercise(scene),
        Err(error) => assert!(error.to_string().starts_with(path) || error.to_string().starts_with("cannot read")),
    }
}

/// Does on the CPU what a renderer would do.
fn exercise(mut scene: Scene) {
    assert_sound(&scene);
    use_pose(&scene, &scene.rest());
    for time_s in [0.0, 0.7, 1e7] {
        use_pose(&scene, &scene.pose(time_s));
    }
    assert_eq!(scene.moving_nodes().len(), scene.nodes.len());
    assert!(scene.duration_s().is_none_or(f32::is_finite));
    scene.add_default_view();
    assert_sound(&scene);
}

fn use_pose(scene: &Scene, pose: &Pose) {
    assert!(pose.world_from_node.iter().all(|world| world.is_finite()));
    assert!(scene.bounds_at(pose).is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite()));
    assert_eq!(scene.placed_cameras_at(pose).len(), scene.nodes.iter().filter(|n| n.camera.is_some()).count());
    assert_eq!(scene.placed_lights_at(pose).len(), scene.nodes.iter().filter(|n| n.light.is_some()).count());
    for (id, node) in scene.nodes.iter().enumerate() {
        let Some(mesh) = node.mesh else { continue };
        assert_eq!(pose.morph_weights[id].len(), scene.meshes[mesh].morph_targets());
        for primitive in &scene.meshes[mesh].primitives {
            for (position, normal) in scene.posed_vertices(pose, id, primitive) {
                assert!(position.is_finite() && (normal.length() - 1.0).abs() < 1e-3, "{position} {normal}");
            }
        }
    }
}
