//! Skins and morph targets.

use glam::{Vec3, Vec4};

use super::document::{Document, F32, U8, U16, bytes, one_mesh};
use crate::invariants::assert_sound;
use crate::{Scene, SceneError};

const IMAGE: &str = r#""images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}], "textures": [{"source": 0}]"#;

/// A triangle bent by two joints, of which the second is 5 m up: its JOINTS_0 is accessor 1, its WEIGHTS_0 2.
fn bent(weights: [[f32; 4]; 3]) -> Document {
    let mut document = Document::triangle();
    document.stream(U8, "VEC4", 3, &[0, 1, 9, 9, 0, 1, 9, 9, 1, 0, 9, 9], "");
    document.floats("VEC4", weights.as_flattened());
    document
}

/// Its members, with more of the skin and of the document.
fn skinned(skin: &str, members: &str) -> String {
    format!(
        r#""nodes": [{{"mesh": 0, "skin": 0, "translation": [70, 0, 0]}}, {{"name": "low"}}, {{"name": "high",
        "translation": [0, 5, 0]}}], "scenes": [{{"nodes": [0, 1, 2]}}], "skins": [{{"joints": [1, 2]{skin}}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}}}]}}]{members}"#
    )
}

fn world(scene: &Scene) -> Vec<Vec3> {
    let primitive = &scene.meshes[0].primitives[0];
    scene.posed_vertices(&scene.rest(), 0, primitive).map(|(position, _)| position).collect()
}

#[test]
fn joints_carry_vertices_in_proportion_and_the_meshs_own_node_does_not() {
    let document = bent([[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]);
    let scene = document.load(&skinned("", ""));
    let expected = [Vec3::ZERO, Vec3::new(1.0, 2.5, 0.0), Vec3::new(0.0, 6.0, 0.0)];
    assert_eq!(world(&scene), expected);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn inverse_bind_matrices_come_first() {
    let mut document = bent([[1.0, 0.0, 0.0, 0.0]; 3]);
    let down = glam::Mat4::from_translation(Vec3::new(0.0, -5.0, 0.0)).to_cols_array();
    document.floats("MAT4", &[glam::Mat4::IDENTITY.to_cols_array(), down].concat());
    let scene = document.load(&skinned(r#", "inverseBindMatrices": 3"#, ""));
    assert_eq!(world(&scene), [Vec3::ZERO, Vec3::X, Vec3::Y]);
    let one = document.refused(&skinned(r#", "inverseBindMatrices": 3"#, "").replace("[1, 2]", "[1, 2, 0]"));
    assert!(one.contains("skins[0].inverseBindMatrices"), "{one}");
}

#[test]
fn weights_are_normalised_and_without_any_the_first_joint_takes_all() {
    let document = bent([[0.2, 0.2, 0.0, 0.0], [0.0; 4], [0.0, 3.0, 0.0, -1.0]]);
    let scene = document.load(&skinned("", ""));
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!(primitive.joint_weights, [Vec4::new(0.5, 0.5, 0.0, 0.0), Vec4::X, Vec4::Y]);
    assert_eq!(primitive.joints, [[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]);
}

#[test]
fn weights_may_be_normalised_integers() {
    let mut document = Document::triangle();
    document.stream(U16, "VEC4", 3, &bytes(&[1_u16, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]), "");
    document.stream(U8, "VEC4", 3, &[255, 0, 0, 0, 51, 204, 0, 0, 0, 255, 0, 0], r#", "normalized": true"#);
    let scene = document.load(&skinned("", ""));
    let weights = &scene.meshes[0].primitives[0].joint_weights;
    assert!(weights[1].abs_diff_eq(Vec4::new(0.2, 0.8, 0.0, 0.0), 1e-6), "{weights:?}");
}

#[test]
fn of_eight_joints_the_four_strongest_stay_with_one_warning() {
    let mut document = Document::triangle();
    document.stream(U8, "VEC4", 3, &[0, 1, 2, 3].repeat(3), "");
    document.floats("VEC4", &[0.1, 0.2, 0.0, 0.1].repeat(3));
    document.stream(U8, "VEC4", 3, &[4, 5, 6, 7].repeat(3), "");
    document.floats("VEC4", &[0.4, 0.05, 0.1, 0.05].repeat(3));
    let nodes: Vec<_> = (0..8).map(|i| format!(r#"{{"name": "{i}"}}"#)).collect();
    let scene = document.load(&format!(
        r#""nodes": [{{"mesh": 0, "skin": 0}}, {}], "skins": [{{"joints": [1, 2, 3, 4, 5, 6, 7, 8]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2, "JOINTS_1": 3,
        "WEIGHTS_1": 4}}}}]}}]"#,
        nodes.join(", ")
    ));
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!(primitive.joints[0], [4, 1, 0, 3]);
    assert!(primitive.joint_weights[2].abs_diff_eq(Vec4::new(0.5, 0.25, 0.125, 0.125), 1e-6));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
}

#[test]
fn a_joint_that_the_skin_lacks_is_refused_by_place() {
    let document = bent([[1.0, 0.0, 0.0, 0.0]; 3]);
    let error = document.refused(&skinned("", "").replace("[1, 2]", "[1]"));
    assert!(error.contains("nodes[0].skin") && error.contains("joint 1"), "{error}");
}

#[test]
fn one_mesh_may_be_drawn_with_a_skin_with_another_and_with_none() {
    let document = bent([[0.0, 1.0, 0.0, 0.0]; 3]);
    let scene = document.load(
        r#""nodes": [{"mesh": 0, "skin": 0}, {"mesh": 0, "skin": 1}, {"mesh": 0}, {"skin": 1},
        {"translation": [0, 5, 0]}, {}], "skins": [{"joints": [4, 5]}, {"joints": [5, 5]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}]"#,
    );
    let skins: Vec<_> = scene.nodes.iter().map(|node| node.skin).collect();
    assert_eq!(skins, [Some(0), Some(1), None, None, None, None]);
    let pose = scene.rest();
    let third = |node| scene.posed_vertices(&pose, node, &scene.meshes[0].primitives[0]).nth(2).unwrap().0;
    assert_eq!([third(0), third(1), third(2)], [Vec3::new(0.0, 6.0, 0.0), Vec3::Y, Vec3::Y]);
}

#[test]
fn a_skin_on_a_mesh_without_joints_is_left_out_with_a_warning() {
    let scene = Document::triangle().load(
        r#""nodes": [{"mesh": 0, "skin": 0}, {}], "skins": [{"joints": [1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]"#,
    );
    assert_eq!((scene.nodes[0].skin, scene.warnings.len()), (None, 1));
}

#[test]
fn joints_outside_the_scene_come_with_their_parents() {
    let document = bent([[0.0, 1.0, 0.0, 0.0]; 3]);
    let members = r#""nodes": [{"mesh": 0, "skin": 0}, {"translation": [0, 1, 0], "children": [2, 3], "mesh": 0},
        {}, {"translation": [0, 2, 0]}], "scenes": [{"nodes": [0]}], "skins": [{"joints": [2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}}]}]"#;
    let scene = document.load(members);
    assert_eq!(scene.nodes.len(), 4);
    assert_eq!(scene.nodes.iter().filter(|node| node.mesh.is_some()).count(), 1);
    assert_eq!(world(&scene)[0], Vec3::new(0.0, 3.0, 0.0));
    let cycle = document.refused(&members.replace(r#"{"translation": [0, 2, 0]}"#, r#"{"children": [1]}"#));
    assert!(cycle.contains("cycle"), "{cycle}");
}

/// A triangle with a target that lifts its first vertex by 2 m and turns its normal.
fn morphed(members: &str) -> Result<Scene, SceneError> {
    let mut document = Document::triangle();
    document.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let values = document.view(&bytes(&[0.0_f32, 2.0, 0.0]), "");
    let at = document.view(&[0_u8], "");
    document.accessor(&format!(
        r#""componentType": {F32}, "count": 3, "type": "VEC3", "sparse": {{"count": 1,
        "indices": {{"bufferView": {at}, "componentType": {U8}}}, "values": {{"bufferView": {values}}}}}"#
    ));
    document.floats("VEC3", &[1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let attributes =
        r#"{"attributes": {"POSITION": 0, "NORMAL": 1}, "targets": [{"POSITION": 2, "NORMAL": 3}]"#;
    document.parse(&format!(r#""meshes": [{{"primitives": [{attributes}}}]{members}"#))
}

#[test]
fn targets_may_be_sparse_and_weights_stand_at_the_mesh_or_the_node() {
    let scene =
        morphed(r#", "weights": [0.5]}], "nodes": [{"mesh": 0}, {"mesh": 0, "weights": [1]}]"#).unwrap();
    assert_sound(&scene);
    let pose = scene.rest();
    let first = |node| scene.posed_vertices(&pose, node, &scene.meshes[0].primitives[0]).next().unwrap();
    assert_eq!((first(0).0, first(1).0), (Vec3::Y, 2.0 * Vec3::Y));
    assert!(first(1).1.abs_diff_eq(Vec3::X, 1e-6), "{}", first(1).1);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn weights_of_the_wrong_number_are_filled_up_with_a_warning() {
    let scene = morphed(r#", "weights": [0.5, 7]}], "nodes": [{"mesh": 0, "weights": [1, 2, 3]}]"#).unwrap();
    assert_sound(&scene);
    assert_eq!(
        (&scene.meshes[0].morph_weights[..], &scene.nodes[0].morph_weights[..]),
        (&[0.5][..], &[1.0][..])
    );
    assert_eq!(scene.warnings.len(), 2);
}

#[test]
fn primitives_with_fewer_targets_get_ones_that_change_nothing() {
    let mut document = Document::triangle();
    document.floats("VEC3", &[0.0, 1.0, 0.0].repeat(3));
    let scene = document.load(
        r#""nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}},
        {"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}, {"POSITION": 1}]}]}]"#,
    );
    let targets = scene.meshes[0].primitives.iter().map(|p| p.morph_targets.len());
    assert_eq!(targets.collect::<Vec<_>>(), [2, 2]);
    assert_eq!((scene.meshes[0].morph_weights.len(), scene.warnings.len()), (2, 1));
}

/// Splitting for flat normals and tangents, and dropping what no triangle uses, takes every stream along.
#[test]
fn joints_and_targets_follow_their_vertices_through_splits() {
    // Two triangles that share an edge, folded, and a fifth vertex that none uses, which comes first.
    let positions = [[9.0, 9.0, 9.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut document = Document::default();
    document.floats("VEC3", positions.as_flattened());
    document.stream(U8, "VEC4", 5, &(0..5).flat_map(|i| [i, 0, 0, 0]).collect::<Vec<u8>>(), "");
    document.floats("VEC4", &[1.0, 0.0, 0.0, 0.0].repeat(5));
    document.floats("VEC3", &(0..5).flat_map(|i| [i as f32, 0.0, 0.0]).collect::<Vec<_>>());
    document.stream(U8, "SCALAR", 6, &[1_u8, 2, 3, 1, 4, 2], "");
    document.floats("VEC2", &positions.map(|[x, y, z]| [x + z, y + 2.0 * z]).concat());
    for material in ["{}", r#"{"normalTexture": {"index": 0}}"#] {
        let scene = document.load(&format!(
            r#""nodes": [{{"mesh": 0, "skin": 0}}], "skins": [{{"joints": [0, 0, 0, 0, 0]}}],
            "materials": [{material}], {IMAGE}, "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0,
            "JOINTS_0": 1, "WEIGHTS_0": 2, "TEXCOORD_0": 5}}, "targets": [{{"POSITION": 3}}], "indices": 4,
            "material": 0}}]}}]"#
        ));
        let primitive = &scene.meshes[0].primitives[0];
        assert_eq!(primitive.positions.len(), 6, "{material}");
        for (vertex, position) in primitive.positions.iter().enumerate() {
            let source = positions.iter().position(|p| Vec3::from(*p) == *position).unwrap();
            assert_eq!(usize::from(primitive.joints[vertex][0]), source, "{material}");
            assert_eq!(primitive.morph_targets[0].positions[vertex].x, source as f32, "{material}");
        }
    }
}

#[test]
fn targets_must_have_the_positions_length_and_be_finite() {
    for (target, place) in [(1, "targets[0].POSITION"), (2, "targets[0].POSITION"), (9, "targets")] {
        let mut document = Document::triangle();
        document.floats("VEC3", &[0.0, 1.0, 0.0].repeat(2));
        document.floats("VEC3", &[f32::NAN, 1.0, 0.0].repeat(3));
        let targets = format!(r#", "targets": [{{"POSITION": {target}}}]"#);
        let error = document.refused(&one_mesh("", &targets, ""));
        assert!(error.contains(place), "{error}");
    }
}

#[test]
fn normals_are_unit_at_any_scale() {
    for scale in ["1e-11", "3e-20", "1", "1e11"] {
        let nodes = format!(r#"{{"mesh": 0, "scale": [{scale}, {scale}, {scale}]}}"#);
        let scene = Document::triangle().load(&one_mesh("", "", "").replacen(r#"{"mesh": 0}"#, &nodes, 1));
        let pose = scene.rest();
        for (_, normal) in scene.posed_vertices(&pose, 0, &scene.meshes[0].primitives[0]) {
            assert!((normal.length() - 1.0).abs() < 1e-5, "{normal} at {scale}");
        }
    }
}

#[test]
fn a_mesh_without_normals_has_those_of_its_triangles_as_they_are_bent() {
    // A square of two triangles that share their vertices, of which a target lifts one corner; joints leave it alone.
    let mut document = Document::default();
    document.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    document.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    document.stream(U8, "SCALAR", 6, &[0_u8, 1, 2, 0, 2, 3], "");
    let targets = r#", "targets": [{"POSITION": 1}], "indices": 2"#;
    let members = one_mesh("", targets, "").replace(r#"{"mesh": 0}"#, r#"{"mesh": 0, "weights": [2]}"#);
    for (scale, flips) in [("1, 1, 1", false), ("-1, 1, 1", true)] {
        let node = format!(r#"{{"mesh": 0, "scale": [{scale}],"#);
        let scene = document.load(&members.replace(r#"{"mesh": 0,"#, &node));
        let primitive = &scene.meshes[0].primitives[0];
        assert_eq!((primitive.positions.len(), primitive.flat), (6, true));
        let turned = if flips { Vec3::new(-1.0, 1.0, 1.0) } else { Vec3::ONE };
        let expected = [Vec3::new(-2.0, 2.0, 1.0) / 3.0 * turned, Vec3::Z];
        for (corner, &vertex) in primitive.indices.iter().enumerate() {
            let (_, normal) = scene.posed_vertices(&scene.rest(), 0, primitive).nth(vertex as usize).unwrap();
            assert!(normal.abs_diff_eq(expected[corner / 3], 1e-6), "{normal} at corner {corner}");
        }
    }
    // What nothing bends keeps to as few vertices as it has normals.
    let still = document.load(&one_mesh("", r#", "indices": 2"#, ""));
    let primitive = &still.meshes[0].primitives[0];
    assert_eq!((primitive.positions.len(), primitive.flat), (4, false));
}
