//! Animations of nodes and weights.

use glam::{Quat, Vec3};

use super::document::{Document, I16, U8, bytes};
use super::warnings;
use crate::{Interpolation, Keys, Scene};

/// Members of a document with one node that one channel moves: times are accessor 0, values 1.
fn channel(path: &str, interpolation: &str, members: &str) -> String {
    format!(
        r#""nodes": [{{"translation": [3, 0, 0]}}], "animations": [{{"name": "a", "channels": [{{"sampler": 0,
        "target": {{"node": 0, "path": "{path}"}}}}], "samplers": [{{"input": 0, "output": 1,
        "interpolation": "{interpolation}"}}]}}]{members}"#
    )
}

fn moved(times: &[f32], kind: &str, values: &[f32]) -> Document {
    let mut document = Document::default();
    document.floats("SCALAR", times);
    document.floats(kind, values);
    document
}

fn at(scene: &Scene, time_s: f64) -> Vec3 {
    scene.pose(time_s).world_from_node[0].translation.into()
}

#[test]
fn steps_lines_and_splines_arrive() {
    let line = moved(&[0.0, 2.0], "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let scene = line.load(&channel("translation", "LINEAR", ""));
    assert_eq!((at(&scene, 0.5), scene.duration_s()), (Vec3::Y, Some(2.0)));
    let scene = line.load(&channel("translation", "STEP", ""));
    assert_eq!((at(&scene, 0.5), at(&scene, 2.0)), (Vec3::ZERO, 4.0 * Vec3::Y));
    // y = t² between 0 and 2: the tangents are 0 and 4 per second.
    let keys = [0.0, 0.0, 0.0, 4.0, 4.0, 4.0].map(|y| [0.0, y, 0.0]);
    let spline = moved(&[0.0, 2.0], "VEC3", keys.as_flattened());
    let scene = spline.load(&channel("translation", "CUBICSPLINE", ""));
    assert_eq!(scene.animations[0].channels[0].interpolation, Interpolation::Cubic);
    assert!(at(&scene, 1.5).abs_diff_eq(2.25 * Vec3::Y, 1e-5), "{}", at(&scene, 1.5));
    assert_eq!((scene.animations[0].name.as_str(), warnings(&scene).len()), ("a", 0));
}

#[test]
fn rotations_may_be_normalised_integers_and_become_unit() {
    let mut document = Document::default();
    document.floats("SCALAR", &[0.0, 1.0, 2.0]);
    let keys: [i16; 12] = [0, 0, 0, 32_767, 0, 23_170, 0, 23_170, 0, 0, 0, 0];
    document.stream(I16, "VEC4", 3, &bytes(&keys), r#", "normalized": true"#);
    let scene = document.load(&channel("rotation", "LINEAR", ""));
    let Keys::Rotation(keys) = &scene.animations[0].channels[0].keys else { panic!("no rotation") };
    assert!(keys.iter().all(|key| key.is_normalized()));
    assert!(keys[1].abs_diff_eq(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2), 1e-4));
    assert_eq!((keys[2], warnings(&scene).len()), (Quat::IDENTITY, 1));
}

#[test]
fn a_rotations_spline_keeps_its_tangents_lengths() {
    let keys = [[0.0, 3.0, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0], [0.0, 5.0, 0.0, 0.0]];
    let scene = moved(&[0.0], "VEC4", keys.as_flattened()).load(&channel("rotation", "CUBICSPLINE", ""));
    let Keys::Rotation(keys) = &scene.animations[0].channels[0].keys else { panic!("no rotation") };
    assert_eq!((keys[0].length(), keys[1].length(), keys[2].length()), (3.0, 1.0, 5.0));
}

#[test]
fn keys_at_one_time_stay_a_jump_and_times_that_go_back_are_refused() {
    let values: Vec<f32> = [0.0, 1.0, 8.0, 9.0].iter().flat_map(|&y| [0.0, y, 0.0]).collect();
    let scene = moved(&[0.0, 1.0, 1.0, 2.0], "VEC3", &values).load(&channel("translation", "LINEAR", ""));
    assert!((at(&scene, 0.999).y - 1.0).abs() < 0.01 && (at(&scene, 1.001).y - 8.0).abs() < 0.01);
    assert_eq!(warnings(&scene).len(), 1);
    for times in [[0.0, 1.0, 0.5, 2.0], [-1.0, 0.0, 1.0, 2.0], [0.0, 1.0, 2.0, 1e30]] {
        let error = moved(&times, "VEC3", &values).refused(&channel("translation", "LINEAR", ""));
        assert!(error.contains("animations[0].channels[0].sampler.input"), "{error}");
    }
}

#[test]
fn values_must_be_as_many_as_the_keys_need() {
    let document = moved(&[0.0, 1.0], "VEC3", &[0.0; 6]);
    let error = document.refused(&channel("translation", "CUBICSPLINE", ""));
    assert!(error.contains("sampler.output") && error.contains("need 6"), "{error}");
}

#[test]
fn weights_come_in_rows_and_instances_share_them() {
    let mut document = Document::default();
    document.floats("SCALAR", &[0.0, 1.0]);
    document.stream(U8, "SCALAR", 4, &[0, 255, 255, 0], r#", "normalized": true"#);
    document.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    document.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    document.floats("VEC3", &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let members = |node: &str| {
        channel("weights", "LINEAR", "").replace(r#"{"translation": [3, 0, 0]}"#, node)
            + r#", "meshes": [{"primitives": [{"attributes": {"POSITION": 2}, "targets": [{"POSITION": 3}, {}]}]}]"#
    };
    let scene = document.load(&members(r#"{"mesh": 0}"#));
    assert_eq!(scene.pose(0.25).morph_weights[0], [0.25, 0.75]);
    let instanced =
        r#"{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 4}}}}"#;
    let scene = document.load(&members(instanced));
    assert_eq!(scene.pose(0.25).morph_weights, [vec![], vec![0.25, 0.75], vec![0.25, 0.75]]);
    // A node without targets has nothing to animate.
    let scene = document.load(&members("{}"));
    assert_eq!((scene.animations.len(), warnings(&scene).len()), (0, 1));
}

#[test]
fn what_moves_no_node_is_left_out_with_a_warning() {
    let document = moved(&[0.0, 2.0], "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let pointer = r#"{"sampler": 0, "target": {"path": "pointer", "extensions":
        {"KHR_animation_pointer": {"pointer": "/materials/0/alphaCutoff"}}}}, "#;
    for path in ["pointer", "translation"] {
        let members =
            channel(path, "LINEAR", "").replace(r#""channels": ["#, &format!(r#""channels": [{pointer}"#));
        let scene = document.load(&members);
        assert_eq!(scene.animations.len(), usize::from(path == "translation"));
        assert_eq!(warnings(&scene).len(), 1, "{:?}", scene.warnings);
    }
    let error =
        document.refused(&channel("translation", "LINEAR", "").replace(r#""node": 0"#, r#""node": 4"#));
    assert!(error.contains("animations[0].channels[0].target.node"), "{error}");
    let error =
        document.refused(&channel("translation", "LINEAR", "").replace(r#""sampler": 0"#, r#""sampler": 4"#));
    assert!(error.contains("animations[0].channels[0].sampler"), "{error}");
}

#[test]
fn a_matrix_is_taken_apart_to_be_animated() {
    let document = moved(&[0.0, 2.0], "VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let node = |matrix: &str| {
        channel("translation", "LINEAR", "")
            .replace(r#""translation": [3, 0, 0]"#, &format!(r#""matrix": [{matrix}]"#))
    };
    let scene = document.load(&node("2,0,0,0, 0,2,0,0, 0,0,2,0, 7,8,9,1"));
    let world = scene.pose(1.0).world_from_node[0];
    assert!(world.transform_point3(Vec3::X).abs_diff_eq(Vec3::new(2.0, 2.0, 0.0), 1e-5));
    let scene = document.load(&node("0,0,0,0, 0,0,0,0, 0,0,0,0, 7,8,9,1"));
    assert_eq!((scene.animations.len(), warnings(&scene).len()), (0, 1));
}

#[test]
fn animations_that_would_leave_the_range_of_numbers_are_refused() {
    // 1e12 metres times scales of 1e12, but only half a second into the animation.
    let mut document = moved(&[0.0, 1.0], "VEC3", &[1.0, 1.0, 1.0, 1e12, 1e12, 1e12]);
    document.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let scales: Vec<_> =
        (0..4).map(|i| format!(r#"{{"sampler": 0, "target": {{"node": {i}, "path": "scale"}}}}"#)).collect();
    let error = document.refused(&format!(
        r#""nodes": [{{"children": [1]}}, {{"children": [2]}}, {{"children": [3]}}, {{"mesh": 0}}], "animations":
        [{{"channels": [{}], "samplers": [{{"input": 0, "output": 1}}]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 2}}}}]}}]"#,
        scales.join(", ")
    ));
    assert!(error.contains("not finite"), "{error}");
}
