//! glTF documents as they should not be: an error each, never a panic or an endless wait.

use std::path::Path;

use super::gltf::{glb, square_document};
use super::gltf_bytes as from_bytes;
use crate::{Disk, LoadOptions, SceneError};

/// Loads the square's document after one replacement in its JSON; the result must be an error that names `place`.
fn assert_refused(from: &str, to: &str, place: &str) {
    let bytes = square_document(r#", "TEXCOORD_0": 1"#, r#", "indices": 2"#, "");
    let end = bytes.windows(4).position(|w| w == b"BIN\0").unwrap() - 4;
    let json = std::str::from_utf8(&bytes[20..end]).unwrap();
    assert!(json.contains(from), "the test itself: `{from}` is not in the document");
    let error =
        from_bytes(Path::new("bad.glb"), glb(&json.replacen(from, to, 1), &bytes[end + 8..])).unwrap_err();
    assert!(error.to_string().contains(place), "{from} → {to}: {error}");
}

#[test]
fn accessors_must_lie_within_their_views_and_views_within_their_buffers() {
    let huge = u64::MAX.to_string();
    for (from, to) in [
        (r#""count": 4"#, r#""count": 5"#),
        (r#""count": 4"#, r#""count": 0"#),
        (r#""count": 4"#, &format!(r#""count": {huge}"#)),
        (r#""byteOffset": 12"#, r#""byteOffset": 13"#),
        (r#""byteOffset": 12"#, &format!(r#""byteOffset": {huge}"#)),
        (r#""byteLength": 80"#, r#""byteLength": 93"#),
        (r#""byteLength": 80"#, &format!(r#""byteLength": {huge}"#)),
        (r#""byteOffset": 80"#, &format!(r#""byteOffset": {huge}"#)),
        (r#""byteStride": 20"#, r#""byteStride": 8"#),
        (r#""byteStride": 20"#, r#""byteStride": 252"#),
    ] {
        assert_refused(from, to, "accessors[");
    }
    assert_refused(r#""byteStride": 20"#, r#""byteStride": 0"#, "byteStride");
    assert_refused(r#""byteLength": 92"#, &format!(r#""byteLength": {huge}"#), "buffers[0]");
}

#[test]
fn accessors_must_have_the_type_that_their_use_permits() {
    assert_refused(r#""type": "VEC3""#, r#""type": "VEC4""#, "POSITION");
    assert_refused(r#""componentType": 5126"#, r#""componentType": 5120"#, "POSITION");
    assert_refused(r#""componentType": 5123"#, r#""componentType": 5126"#, "indices");
    assert_refused(r#""type": "VEC2""#, r#""type": "MAT2""#, "TEXCOORD_0");
    assert_refused(r#""type": "VEC2""#, r#""type": "TENSOR""#, "accessors[1].type");
}

#[test]
fn streams_must_have_equal_lengths() {
    assert_refused(r#""count": 4, "type": "VEC2""#, r#""count": 3, "type": "VEC2""#, "TEXCOORD_0");
    // The positions get one fewer, so that the last index and the other streams exceed them.
    assert_refused(r#""count": 4, "type": "VEC3""#, r#""count": 3, "type": "VEC3""#, "indices");
}

#[test]
fn an_index_of_an_accessor_that_is_not_there_is_refused() {
    assert_refused(r#""POSITION": 0"#, r#""POSITION": 9"#, "POSITION");
    assert_refused(r#""TEXCOORD_0": 1"#, r#""TEXCOORD_0": 9"#, "TEXCOORD_0");
    assert_refused(r#""bufferView": 1"#, r#""bufferView": 9"#, "accessors[2]");
    assert_refused(r#""mesh": 0"#, r#""mesh": 1"#, "nodes[0].mesh");
}

#[test]
fn a_sparse_accessor_cannot_ask_for_memory_without_data() {
    let sparse = r#""componentType": 5126, "count": 100000000000, "type": "VEC3", "sparse": {"count": 1,
        "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}}"#;
    let from = r#""bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3""#;
    assert_refused(from, sparse, "accessors[0]");
    assert_refused(
        from,
        &sparse.replace("\"count\": 1,", "\"count\": 99,").replace("100000000000", "100"),
        "sparse",
    );
}

#[test]
fn positions_must_be_finite_and_within_reach() {
    for bad in [f32::NAN, f32::INFINITY, 1e30] {
        let mut bytes = square_document("", r#", "indices": 2"#, "");
        let data = bytes.windows(4).position(|w| w == b"BIN\0").unwrap() + 4;
        bytes[data + 20..data + 24].copy_from_slice(&bad.to_le_bytes());
        let error = from_bytes(Path::new("bad.glb"), bytes).unwrap_err().to_string();
        assert!(error.contains("POSITION: element 1"), "{error}");
    }
}

#[test]
fn triangles_without_area_load() {
    let mut bytes = square_document(r#", "TEXCOORD_0": 1"#, r#", "indices": 2"#, "");
    let data = bytes.windows(4).position(|w| w == b"BIN\0").unwrap() + 4;
    bytes[data..data + 80].fill(0);
    let scene = from_bytes(Path::new("flat.glb"), bytes).unwrap();
    crate::invariants::assert_sound(&scene);
    assert_eq!(scene.triangle_count(), 2);
}

/// Loads a document of `members`; the result must be an error that names `place`.
fn assert_members_refused(members: &str, place: &str) {
    let json = format!(r#"{{"asset": {{"version": "2.0"}}, {members}}}"#);
    let error = from_bytes(Path::new("bad.gltf"), json.into_bytes()).unwrap_err().to_string();
    assert!(error.contains(place), "{members}: {error}");
}

#[test]
fn nodes_must_form_a_tree() {
    assert_members_refused(
        r#""scenes": [{"nodes": [0]}], "nodes": [{"children": [1]}, {"children": [0]}]"#,
        "nodes[0]",
    );
    assert_members_refused(
        r#""nodes": [{"children": [2]}, {"children": [2]}, {}], "scenes": [{"nodes": [0, 1]}]"#,
        "nodes[2]",
    );
    assert_members_refused(r#""nodes": [{"children": [7]}]"#, "nodes[0].children");
}

#[test]
fn transforms_must_be_affine_and_finite() {
    let node = |node: &str| format!(r#""nodes": [{{{node}}}]"#);
    assert_members_refused(&node(r#""matrix": [1,0,0,1, 0,1,0,0, 0,0,1,0, 0,0,0,1]"#), "nodes[0].matrix");
    assert_members_refused(&node(r#""scale": [1e39, 1, 1]"#), "nodes[0]");
    assert_members_refused(&node(r#""rotation": [0, 0, 0, 0]"#), "nodes[0].rotation");
    let nested: Vec<String> =
        (1..8).map(|i| format!(r#"{{"scale": [1e12, 1e12, 1e12], "children": [{i}]}}"#)).collect();
    assert_members_refused(&format!(r#""nodes": [{}, {{}}]"#, nested.join(", ")), "not finite");
}

#[test]
fn cameras_and_lights_must_make_sense() {
    for camera in [
        r#"{"type": "perspective", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 1}}"#,
        r#"{"type": "perspective", "perspective": {"yfov": 0, "znear": 1}}"#,
        r#"{"type": "perspective", "perspective": {"yfov": 4, "znear": 1}}"#,
        r#"{"type": "perspective", "perspective": {"yfov": 1, "znear": 0}}"#,
        r#"{"type": "perspective", "perspective": {"yfov": 1, "znear": 2, "zfar": 1}}"#,
        r#"{"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 0, "znear": 0, "zfar": 1}}"#,
    ] {
        assert_members_refused(
            &format!(r#""cameras": [{camera}], "nodes": [{{"camera": 0}}]"#),
            "cameras[0]",
        );
    }
    for light in [
        r#""type": "point", "intensity": -1"#,
        r#""type": "point", "range": 0"#,
        r#""type": "directional", "color": [1e39, 0, 0]"#,
        r#""type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}"#,
        r#""type": "spot", "spot": {"outerConeAngle": 3}"#,
        r#""type": "spot""#,
    ] {
        let members = format!(
            r#""extensions": {{"KHR_lights_punctual": {{"lights": [{{{light}}}]}}}},
            "nodes": [{{"extensions": {{"KHR_lights_punctual": {{"light": 0}}}}}}]"#
        );
        assert_members_refused(&members, "ights[0]");
    }
}

#[test]
fn images_must_be_there_and_decode_where_nothing_may_stand_in() {
    let textured = |image: &str| {
        let members = format!(
            r#", "materials": [{{"emissiveTexture": {{"index": 0}}}}], "textures": [{{"source": 0}}], "images": [{{{image}}}]"#
        );
        let bytes = square_document(r#", "TEXCOORD_0": 1"#, r#", "indices": 2, "material": 0"#, &members);
        let strict = LoadOptions { strict: true, ..LoadOptions::default() };
        super::super::gltf::from_bytes(&Disk, Path::new("nowhere/bad.glb"), bytes, &strict).unwrap_err()
    };
    assert!(matches!(textured(r#""uri": "absent.png""#), SceneError::Read { .. }));
    assert!(matches!(textured(r#""uri": "https://example.com/a.png""#), SceneError::Unsupported { .. }));
    for image in [
        "",
        r#""bufferView": 0"#,
        r#""uri": "data:image/png;base64,AAAA""#,
        r#""uri": "data:image/png;base64,?""#,
        r#""uri": "%ff.png""#,
        r#""uri": "/etc/hostname""#,
    ] {
        let error = textured(image);
        assert!(
            matches!(&error, SceneError::Invalid { place, .. } if place.starts_with("images[0]")),
            "{error}"
        );
    }
}

#[test]
fn a_glb_cut_anywhere_is_an_error_and_flipped_bytes_never_panic() {
    let image = r#", "materials": [{"normalTexture": {"index": 0}}], "textures": [{"source": 0}],
        "images": [{"bufferView": 0, "mimeType": "image/png"}]"#;
    for members in ["", image] {
        let bytes = square_document(r#", "TEXCOORD_0": 1"#, r#", "indices": 2, "material": 0"#, members);
        for end in 0..bytes.len() {
            assert!(from_bytes(Path::new("cut.glb"), bytes[..end].to_vec()).is_err(), "cut at {end}");
        }
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << bit;
                let _ = from_bytes(Path::new("flipped.glb"), bytes);
            }
        }
    }
}
