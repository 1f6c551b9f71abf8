//! Integer and compressed vertices, colours, instances and scenes.

use glam::{Vec2, Vec3, Vec4};

use super::document::{Document, F32, I8, I16, U8, U16, bytes, one_mesh};
use crate::{LoadOptions, Scene, SceneError};

const QUANTIZED: &str =
    r#", "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"]"#;

fn positions(scene: &Scene) -> &[Vec3] {
    &scene.meshes[0].primitives[0].positions
}

#[test]
fn quantized_positions_are_numbers_or_shares_as_the_accessor_says() {
    let i8s: [i8; 12] = [-128, 0, 0, 0, 127, 0, 0, 0, 0, 64, 0, 0];
    let u16s: [u16; 12] = [0, 0, 0, 0, 65_535, 0, 0, 0, 0, 500, 0, 0];
    let i16s = u16s.map(|x| (x / 2) as i16);
    let u8s = i8s.map(|x| x.max(0) as u8 * 2);
    for (component, content, plain, share) in [
        (I8, bytes(&i8s), [-128.0, 127.0, 64.0], [-1.0, 1.0, 64.0 / 127.0]),
        (U8, bytes(&u8s), [0.0, 254.0, 128.0], [0.0, 254.0 / 255.0, 128.0 / 255.0]),
        (I16, bytes(&i16s), [0.0, 32_767.0, 250.0], [0.0, 1.0, 250.0 / 32_767.0]),
        (U16, bytes(&u16s), [0.0, 65_535.0, 500.0], [0.0, 1.0, 500.0 / 65_535.0]),
    ] {
        for (normalized, [first, second, third]) in [(false, plain), (true, share)] {
            let mut document = Document::default();
            document.stream(component, "VEC3", 3, &content, &format!(r#", "normalized": {normalized}"#));
            let scene = document.load(&one_mesh("", "", QUANTIZED));
            let expected = [first * Vec3::X, second * Vec3::X, third * Vec3::Y];
            assert!(
                positions(&scene).iter().zip(expected).all(|(p, e)| p.abs_diff_eq(e, 1e-6)),
                "{component}"
            );
            assert!(document.refused(&one_mesh("", "", "")).contains("component type"));
        }
    }
}

#[test]
fn quantized_normals_are_shares_and_coordinates_either() {
    let mut document = Document::triangle();
    document.stream(I8, "VEC3", 3, &[0, 127, 0, 0].repeat(3), r#", "normalized": true"#);
    document.stream(I16, "VEC2", 3, &bytes(&[2_i16, -3].repeat(3)), "");
    let scene = document.load(&one_mesh(r#", "NORMAL": 1, "TEXCOORD_0": 2"#, "", QUANTIZED));
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!((primitive.normals[0], primitive.uvs[0][2]), (Vec3::Y, Vec2::new(2.0, -3.0)));
}

#[test]
fn colors_of_every_type_arrive_and_further_sets_do_not() {
    let expected = Vec4::new(1.0, 0.2, 0.0, 1.0);
    for (component, kind, content) in [
        (F32, "VEC3", bytes(&[1.0_f32, 0.2, 0.0].repeat(3))),
        (F32, "VEC4", bytes(&[1.0_f32, 0.2, 0.0, 1.0].repeat(3))),
        (U8, "VEC3", [255, 51, 0, 77].repeat(3)),
        (U8, "VEC4", [255, 51, 0, 255].repeat(3)),
        (U16, "VEC3", bytes(&[65_535_u16, 13_107, 0, 7].repeat(3))),
        (U16, "VEC4", bytes(&[65_535_u16, 13_107, 0, 65_535].repeat(3))),
    ] {
        let mut document = Document::triangle();
        document.stream(component, kind, 3, &content, r#", "normalized": true"#);
        document.floats("VEC3", &[0.5; 9]);
        let scene = document.load(&one_mesh(r#", "COLOR_0": 1, "COLOR_1": 2"#, "", ""));
        let colors = &scene.meshes[0].primitives[0].colors;
        assert!(colors.iter().all(|c| c.abs_diff_eq(expected, 1e-4)), "{kind} of {component}: {colors:?}");
    }
}

#[test]
fn every_attribute_may_be_sparse_over_data_or_over_zeros() {
    let mut document = Document::triangle();
    let values = document.view(&bytes(&[5.0_f32, 6.0, 7.0]), "");
    let at = document.view(&bytes(&[2_u16]), "");
    let sparse = format!(
        r#""componentType": {F32}, "count": 3, "type": "VEC3", "sparse": {{"count": 1,
        "indices": {{"bufferView": {at}, "componentType": {U16}}}, "values": {{"bufferView": {values}}}}}"#
    );
    document.accessor(&sparse);
    document.accessor(&format!(r#""bufferView": 0, {sparse}"#));
    let over = |accessor: &str| {
        one_mesh("", "", "").replace(r#""POSITION": 0"#, &format!(r#""POSITION": {accessor}"#))
    };
    let end = Vec3::new(5.0, 6.0, 7.0);
    assert_eq!(positions(&document.load(&over("1"))), [Vec3::ZERO, Vec3::ZERO, end]);
    assert_eq!(positions(&document.load(&over("2"))), [Vec3::ZERO, Vec3::X, end]);
    // The replaced element must be there.
    document.accessor(&sparse.replace(r#""count": 3"#, r#""count": 2"#));
    assert!(document.refused(&over("3")).contains("sparse: element 2 of 2"));
}

#[test]
fn accessors_and_buffers_without_data_are_zeros_until_data_is_needed() {
    let mut document = Document::triangle();
    document.accessor(&format!(r#""componentType": {F32}, "count": 3, "type": "VEC2""#));
    document.fallback = r#", {"byteLength": 9}"#.to_owned();
    let scene = document.load(&one_mesh(r#", "TEXCOORD_0": 1"#, "", ""));
    assert_eq!(scene.meshes[0].primitives[0].uvs[0], [Vec2::ZERO; 3]);
    let view = document.raw_view(r#"{"buffer": 1, "byteLength": 9}"#);
    document
        .accessor(&format!(r#""bufferView": {view}, "componentType": {U8}, "count": 9, "type": "SCALAR""#));
    let error = document.refused(&one_mesh("", r#", "indices": 2"#, ""));
    assert!(error.contains("buffers[1]") && error.contains("no data"), "{error}");
}

/// A document of one triangle at places that `attributes` (accessors 1, 2, 3) says.
fn instanced(attributes: &str) -> Result<Scene, SceneError> {
    let mut document = Document::triangle();
    document.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 9.0, 0.0]);
    document.stream(
        I16,
        "VEC4",
        2,
        &bytes(&[0_i16, 0, 32_767, 0, 0, 0, 0, 32_767]),
        r#", "normalized": true"#,
    );
    document.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0]);
    document.parse(&format!(
        r#""nodes": [{{"mesh": 0, "translation": [100, 0, 0], "children": [1], "extensions":
        {{"EXT_mesh_gpu_instancing": {{"attributes": {{{attributes}}}}}}}}}, {{}}], "extensionsRequired":
        ["EXT_mesh_gpu_instancing"], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}]"#
    ))
}

#[test]
fn instances_become_children_of_their_node() {
    let scene = instanced(r#""TRANSLATION": 1, "ROTATION": 2"#).unwrap();
    crate::invariants::assert_sound(&scene);
    assert_eq!((scene.nodes[0].mesh, scene.nodes.len(), scene.triangle_count()), (None, 4, 2));
    let world = scene.world_from_node();
    let second_corner = |node: usize| world[node].transform_point3(Vec3::X);
    // The first is turned half around z, the second 9 m up.
    assert!(second_corner(1).abs_diff_eq(Vec3::new(99.0, 0.0, 0.0), 1e-4));
    assert!(second_corner(2).abs_diff_eq(Vec3::new(101.0, 9.0, 0.0), 1e-4));
    assert!(
        instanced(r#""TRANSLATION": 1, "SCALE": 3"#).unwrap_err().to_string().contains("differ in length")
    );
    assert!(instanced(r#""TRANSLATION": 7"#).unwrap_err().to_string().contains("TRANSLATION"));
    let plain = instanced(r#""_ID": 1"#).unwrap();
    assert_eq!((plain.nodes[0].mesh, plain.warnings.len()), (Some(0), 1));
}

/// A document whose positions (accessor 1) and indices (2) are compressed, for the extension of this name.
fn compressed(extension: &str, flip: Option<usize>) -> Result<Scene, SceneError> {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
    let mut positions = meshopt::encode_vertex_buffer(&corners).unwrap();
    if let Some(at) = flip {
        let at = at % positions.len();
        positions[at] ^= 0x55;
    }
    let indices = meshopt::encode_index_buffer(&[0, 1, 2, 2, 1, 3], 4).unwrap();
    let mut document = Document::default();
    let mut compressed = |content: &[u8], stride: usize, count: usize, mode: &str| {
        let stored = document.view(content, "");
        let place = document.place(stored);
        document.raw_view(&format!(
            r#"{{"buffer": 1, "byteLength": {}, "extensions": {{"{extension}": {{{place}, "byteStride": {stride},
            "count": {count}, "mode": "{mode}"}}}}}}"#,
            stride * count
        ))
    };
    let positions = compressed(&positions, 12, 4, "ATTRIBUTES");
    let indices = compressed(&indices, 2, 6, "TRIANGLES");
    document.accessor(&format!(
        r#""bufferView": {positions}, "componentType": {F32}, "count": 4, "type": "VEC3""#
    ));
    document.accessor(&format!(
        r#""bufferView": {indices}, "componentType": {U16}, "count": 6, "type": "SCALAR""#
    ));
    document.fallback = format!(
        r#", {{"byteLength": 1000000000000, "extensions": {{"{extension}": {{"fallback": true}}}}}}"#
    );
    document.parse(&one_mesh("", r#", "indices": 1"#, &format!(r#", "extensionsRequired": ["{extension}"]"#)))
}

#[test]
fn compressed_views_need_no_fallback() {
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let scene = compressed(extension, None).unwrap();
        crate::invariants::assert_sound(&scene);
        assert_eq!(scene.triangle_count(), 2);
        assert_eq!(scene.bounds(), Some((Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0))));
    }
    // Damage is an error or other positions, never a panic.
    for at in 0..60 {
        let _ = compressed("EXT_meshopt_compression", Some(at));
    }
}

#[test]
fn filters_of_compressed_views_are_undone() {
    let directions = [[0.6_f32, 0.0, 0.8, 0.0], [0.0, -1.0, 0.0, 0.0], [-0.6, 0.64, -0.48, 0.0]];
    let normals: Vec<[i8; 4]> = meshopt::encode_filter_oct(&directions, 8);
    let encoded = meshopt::encode_vertex_buffer(&normals).unwrap();
    let mut document = Document::triangle();
    let stored = document.view(&encoded, "");
    let place = document.place(stored);
    let view = |stride: usize, filter: &str| {
        format!(
            r#"{{"buffer": 0, "byteLength": 12, "byteStride": 4, "extensions": {{"EXT_meshopt_compression": {{{place},
            "byteStride": {stride}, "count": 3, "mode": "ATTRIBUTES", "filter": "{filter}"}}}}}}"#
        )
    };
    let members = one_mesh(r#", "NORMAL": 1"#, "", QUANTIZED);
    let mut filtered = document.clone();
    let normals = filtered.raw_view(&view(4, "OCTAHEDRAL"));
    let accessor = format!(
        r#""bufferView": {normals}, "componentType": {I8}, "count": 3, "type": "VEC3", "normalized": true"#
    );
    filtered.accessor(&accessor);
    let scene = filtered.load(&members);
    for (normal, [x, y, z, _]) in scene.meshes[0].primitives[0].normals.iter().zip(directions) {
        assert!(normal.abs_diff_eq(Vec3::new(x, y, z), 0.02), "{normal}");
    }
    // A filter that the elements' size does not permit, and a count that the bytes cannot hold.
    for wrong in [
        view(4, "QUATERNION"),
        view(12, "OCTAHEDRAL"),
        view(4, "OCTAHEDRAL").replace("\"count\": 3", "\"count\": 99999999"),
    ] {
        let mut document = document.clone();
        document.raw_view(&wrong);
        document.accessor(&accessor);
        let error = document.refused(&members);
        assert!(error.contains("bufferViews[2].extensions.EXT_meshopt_compression"), "{error}");
    }
}

#[test]
fn scenes_are_chosen_by_name_or_number() {
    let document = Document::default();
    let bytes = document.glb(
        r#""nodes": [{"name": "a"}, {"name": "b"}, {"name": "c"}], "scene": 1,
        "scenes": [{"name": "first", "nodes": [0]}, {"nodes": [1]}, {"name": "0", "nodes": [2]}]"#,
    );
    let load = |scene: Option<&str>| {
        let mut files = crate::Memory::default();
        files.insert("s.glb", bytes.clone());
        let options = LoadOptions { scene: scene.map(str::to_owned), ..LoadOptions::default() };
        crate::load_from(&files, std::path::Path::new("s.glb"), &options)
    };
    // A name counts before a number.
    for (scene, node) in [(None, "b"), (Some("first"), "a"), (Some("1"), "b"), (Some("0"), "c")] {
        let scene = load(scene).unwrap();
        assert_eq!(scene.nodes[0].name, node);
        assert_eq!(scene.scene_names, ["first", "", "0"]);
    }
    let error = load(Some("other")).unwrap_err();
    assert!(
        matches!(error, SceneError::UnknownScene { .. }) && error.to_string().contains("0 “first”"),
        "{error}"
    );
    let builtin = crate::load_with(
        "builtin:cornell",
        &LoadOptions { scene: Some("1".to_owned()), ..LoadOptions::default() },
    );
    assert!(matches!(builtin, Err(SceneError::UnknownScene { .. })));
}
