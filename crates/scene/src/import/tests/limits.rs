//! Few bytes cannot ask for much.

use std::path::Path;

use super::document::{Document, F32, U8, one_mesh};
use crate::{Limits, LoadOptions, Memory, load_from};

/// Small limits, so that the tests need not fill memory to see them.
fn limits() -> Limits {
    Limits {
        vertices: 1000,
        corners: 1000,
        morph_vertices: 1000,
        nodes: 100,
        drawn_vertices: 2000,
        keys: 1000,
        elements: 100_000,
        empty_elements: 5000,
        decompressed: 1000,
        pixels: 10,
    }
}

/// Loads within the limits; the error's text.
fn refused(document: &Document, members: &str) -> String {
    let mut files = Memory::default();
    files.insert("t.glb", document.glb(members));
    let options = LoadOptions { limits: limits(), ..LoadOptions::default() };
    load_from(&files, Path::new("t.glb"), &options).unwrap_err().to_string()
}

fn without_data(document: &mut Document, kind: &str, count: usize) -> usize {
    let zeros = document.view(&[0; 16], "");
    document.accessor(&format!(
        r#""componentType": {F32}, "count": {count}, "type": "{kind}", "sparse": {{"count": 1, "indices":
        {{"bufferView": {zeros}, "componentType": {U8}}}, "values": {{"bufferView": {zeros}}}}}"#
    ))
}

#[test]
fn instances_are_limited() {
    let mut document = Document::triangle();
    without_data(&mut document, "VEC3", 99);
    without_data(&mut document, "VEC3", 100_000_000_000);
    let node = |accessor: usize| {
        format!(
            r#"{{"mesh": 0, "extensions": {{"EXT_mesh_gpu_instancing": {{"attributes": {{"TRANSLATION": {accessor}}}}}}}}}"#
        )
    };
    let members = |nodes: &str| one_mesh("", "", "").replacen(r#"{"mesh": 0}"#, nodes, 1);
    let error = refused(&document, &members(&node(2)));
    assert!(error.contains("TRANSLATION"), "{error}");
    let error = refused(&document, &members(&format!("{}, {}", node(1), node(1))));
    assert!(error.contains("100 nodes"), "{error}");
}

#[test]
fn targets_and_their_vertices_are_limited() {
    let mut document = Document::default();
    without_data(&mut document, "VEC3", 300);
    let targets = [r#"{"POSITION": 0}"#; 4].join(", ");
    let error = refused(&document, &one_mesh("", &format!(r#", "targets": [{targets}]"#), ""));
    assert!(error.contains("1000 vertices of morph targets"), "{error}");
    // One primitive's many empty targets times many primitives.
    let document = Document::triangle();
    let primitive = r#"{"attributes": {"POSITION": 0}}"#;
    let many = ["{}"; 100].join(", ");
    let error = refused(
        &document,
        &format!(
            r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}},
            "targets": [{many}]}}, {}]}}]"#,
            [primitive; 20].join(", ")
        ),
    );
    assert!(error.contains("meshes[0]") && error.contains("vertices of morph targets"), "{error}");
}

#[test]
fn what_nodes_draw_is_limited() {
    let mut document = Document::default();
    without_data(&mut document, "VEC3", 300);
    let nodes = [r#"{"mesh": 0}"#; 7].join(", ");
    let members = one_mesh("", "", "").replacen(r#"{"mesh": 0}"#, &nodes, 1);
    assert!(refused(&document, &members).contains("2000 vertices to draw"));
}

#[test]
fn keys_are_limited_however_often_a_sampler_is_used() {
    let mut document = Document::default();
    document.floats("SCALAR", &(0..60).map(|i| i as f32).collect::<Vec<_>>());
    without_data(&mut document, "VEC3", 60);
    let nodes = ["{}"; 9].join(", ");
    let channels: Vec<_> = (0..9)
        .map(|i| format!(r#"{{"sampler": 0, "target": {{"node": {i}, "path": "translation"}}}}"#))
        .collect();
    let error = refused(
        &document,
        &format!(
            r#""nodes": [{nodes}], "animations": [{{"channels": [{}], "samplers": [{{"input": 0, "output": 1}}]}}]"#,
            channels.join(", ")
        ),
    );
    assert!(error.contains("1000 values of animation keys"), "{error}");
}

#[test]
fn accessors_without_data_and_reading_one_often_are_limited() {
    let mut document = Document::default();
    without_data(&mut document, "VEC3", 6000);
    assert!(refused(&document, &one_mesh("", "", "")).contains("without data"));
    let mut document = Document::triangle();
    document.stream(U8, "SCALAR", 30_000, &vec![0; 30_000], "");
    let primitive = r#"{"attributes": {"POSITION": 0}, "indices": 1}"#;
    let members =
        format!(r#""nodes": [{{"mesh": 0}}], "meshes": [{{"primitives": [{}]}}]"#, [primitive; 9].join(", "));
    let error = refused(&document, &members);
    assert!(error.contains("corners") || error.contains("elements of accessors"), "{error}");
}
