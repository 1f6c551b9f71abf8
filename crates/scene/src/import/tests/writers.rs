//! Files as all kinds of programs and systems write them, and what is missing beside them.

use std::fmt::Write;
use std::path::Path;

use glam::{DVec3, Vec3, Vec4};

use super::gltf::square_document;
use crate::invariants::assert_sound;
use crate::{LoadOptions, Memory, Scene, SceneError, load_from};

const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";

/// Loads `t.obj` among files in memory.
fn load_obj(obj: impl Into<Vec<u8>>, beside: &[(&str, &[u8])]) -> Result<Scene, SceneError> {
    load_as(obj, beside, false)
}

fn load_as(obj: impl Into<Vec<u8>>, beside: &[(&str, &[u8])], strict: bool) -> Result<Scene, SceneError> {
    let mut files = Memory::default();
    files.insert("t.obj", obj);
    for (name, content) in beside {
        files.insert(name, *content);
    }
    let scene = load_from(&files, Path::new("t.obj"), &LoadOptions { strict, ..LoadOptions::default() })?;
    assert_sound(&scene);
    Ok(scene)
}

fn area(scene: &Scene) -> f32 {
    let primitives = scene.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let area = |primitive: &crate::Primitive| {
        let corners = primitive.indices.as_chunks::<3>().0.iter();
        let points = corners.map(|triangle| triangle.map(|i| primitive.positions[i as usize]));
        points.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum::<f32>()
    };
    primitives.map(area).sum()
}

/// `text` in UTF-16 with its byte order mark.
fn utf16(text: &str, bytes_of: fn(u16) -> [u8; 2]) -> Vec<u8> {
    format!("\u{feff}{text}").encode_utf16().flat_map(bytes_of).collect()
}

/// A PNG of one pixel.
fn png(rgba: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba(rgba))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

#[test]
fn a_square_with_a_keyholed_hole_has_the_square_s_area_less_the_hole_s() {
    let hole = "v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nv -1 -1 0\nv -1 1 0\nv 1 1 0\nv 1 -1 0\n";
    let scene = load_obj(format!("{hole}f 1 2 3 4 1 5 6 7 8 5\n"), &[]).unwrap();
    assert!((area(&scene) - 12.0).abs() < 1e-5, "{}", area(&scene));
    // The same where the cut has vertices of its own at the same places.
    let scene = load_obj(format!("{hole}v -2 -2 0\nv -1 -1 0\nf 1 2 3 4 9 10 6 7 8 5\n"), &[]).unwrap();
    assert!((area(&scene) - 12.0).abs() < 1e-5, "{}", area(&scene));
}

type Encoding = fn(&str) -> Vec<u8>;

#[test]
fn obj_and_mtl_may_be_utf_8_or_utf_16_with_a_mark_and_end_lines_as_they_like() {
    let obj = format!("mtllib m.mtl\nusemtl rot-grün\n{SQUARE}f 1 2 3 4\n");
    let mtl = "newmtl rot-grün\nKd 1 0 0\n";
    let encodings: [Encoding; 5] = [
        |text| format!("\u{feff}{text}").into_bytes(),
        |text| utf16(text, u16::to_le_bytes),
        |text| utf16(text, u16::to_be_bytes),
        |text| text.replace('\n', "\r").into_bytes(),
        |text| text.chars().map(|c| c as u8).collect(),
    ];
    for encode_obj in encodings {
        for encode_mtl in encodings {
            let scene = load_obj(encode_obj(&obj), &[("m.mtl", &encode_mtl(mtl))]).unwrap();
            assert_eq!(scene.warnings, [""; 0]);
            assert_eq!(scene.materials[0].base_color, Vec4::new(1.0, 0.0, 0.0, 1.0));
            assert_eq!(area(&scene), 4.0);
        }
    }
    // A mark before the first vertex is not part of its keyword.
    assert_eq!(area(&load_obj(format!("\u{feff}{SQUARE}f 1 2 3 4"), &[]).unwrap()), 4.0);
}

#[test]
fn broken_text_is_one_error_in_an_obj_and_one_warning_in_an_mtl() {
    for broken in [&b"\xff\xfev\0 "[..], b"\xfe\xff\0v\0", b"\xff\xfe\0\xd8", b"\xff\xfe\0\0v\0\0\0"] {
        let error = load_obj(broken, &[]).unwrap_err().to_string();
        assert!(error.starts_with("t.obj: text: ") && error.contains("UTF-"), "{error}");
        let obj = format!("mtllib m.mtl\n{SQUARE}f 1 2 3 4\n");
        let scene = load_obj(obj.clone(), &[("m.mtl", broken)]).unwrap();
        assert!(
            scene.warnings.len() == 1 && scene.warnings[0].contains("m.mtl: text: "),
            "{:?}",
            scene.warnings
        );
        assert!(load_as(obj, &[("m.mtl", broken)], true).is_err());
    }
}

#[test]
fn a_comment_s_backslash_joins_nothing() {
    for obj in [
        format!("# made from C:\\models\\\n{SQUARE}f 1 2 3 4\n"),
        format!("{SQUARE}f 1 2 3 4 # in C:\\\nf 1 2 3\n"),
        format!("{SQUARE}f 1 2 \\\n3 4 # in C:\\\nf 1 2 3\n"),
    ] {
        let faces = obj.matches("\nf").count();
        assert_eq!(load_obj(obj.clone(), &[]).unwrap().triangle_count(), faces + 1, "{obj}");
    }
}

#[test]
fn names_that_differ_in_one_latin_1_letter_stay_two() {
    let obj = [
        b"mtllib m.mtl\nusemtl gr\xfcn\n",
        SQUARE.as_bytes(),
        b"vt 0 0\nf 1 2 3\nusemtl gr\xf6n\nf 1/1 3/1 4/1\n",
    ]
    .concat();
    let mtl = b"newmtl gr\xfcn\nKd 0 1 0\nnewmtl gr\xf6n\nKd 0 0 1\nmap_Kd bl\xe4u.png\n";
    let scene = load_obj(obj, &[("m.mtl", &mtl[..]), ("Bläu.png", &png([255; 4]))]).unwrap();
    assert_eq!(scene.warnings, [""; 0]);
    let colours: Vec<Vec4> = scene.materials.iter().map(|material| material.base_color).collect();
    assert_eq!(colours, [Vec4::new(0.0, 1.0, 0.0, 1.0), Vec4::new(0.0, 0.0, 1.0, 1.0)]);
    assert!(scene.materials[1].base_color_texture.is_some());
}

#[test]
fn comments_may_follow_names() {
    let obj = format!(
        "mtllib m.mtl # all of them\n{SQUARE}vt 0 0\nusemtl red # dark\nf 1/1 2/1 3/1 4/1 # a face\n"
    );
    for newmtl in ["newmtl red", "newmtl red # dark", "newmtl red # another"] {
        let mtl = format!("{newmtl}\nKd 1 0 0 # red\nmap_Kd -clamp on a.png   # -s 2 2 from b.png\n");
        let beside = [("m.mtl", mtl.as_bytes()), ("a.png", &png([9; 4])), ("b.png", &png([7; 4]))];
        let scene = load_obj(obj.clone(), &beside).unwrap();
        assert_eq!(scene.warnings, [""; 0]);
        assert_eq!(scene.materials[0].base_color, Vec4::new(1.0, 0.0, 0.0, 1.0));
        assert_eq!(scene.images[0].name, "a.png");
    }
    let mtl = "newmtl red\nmap_Kd tile #2.png\n";
    let beside = [("m.mtl", mtl.as_bytes()), ("tile #2.png", &png([9; 4])), ("tile", &[])];
    assert_eq!(load_obj(obj, &beside).unwrap().images[0].name, "tile #2.png");
}

/// Normals along the edge x = 0, where two squares in two groups meet at a right angle.
fn normals_at_edge(vertices: &str, first: &str, second: &str) -> Vec<Vec3> {
    let obj = format!(
        "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv 0 -1 1\nv 0 1 1\n{vertices}g a\n{first}\ng b\n{second}\n"
    );
    let scene = load_obj(obj, &[]).unwrap();
    assert_eq!(scene.meshes.len(), 2);
    let primitives = scene.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let vertices = primitives.flat_map(|p| p.positions.iter().zip(&p.normals));
    vertices.filter(|(p, _)| p.x == 0.0 && p.z == 0.0).map(|(_, normal)| *normal).collect()
}

#[test]
fn smoothing_groups_reach_over_groups_and_not_to_another_surface() {
    let smooth = Vec3::new(-1.0, 0.0, 1.0).normalize();
    let joined = normals_at_edge("", "s 1\nf 1 2 3 4", "f 2 5 6 3");
    assert!(joined.len() == 4 && joined.iter().all(|n| n.abs_diff_eq(smooth, 1e-5)), "{joined:?}");
    // Two objects that stand beside each other, each smooth by itself: a wall on its floor.
    let touching = normals_at_edge("v 0 -1 0\nv 0 1 0\n", "s 1\nf 1 2 3 4", "f 7 5 6 8");
    assert!(touching.iter().all(|n| n.max_element() > 0.99 || n.min_element() < -0.99), "{touching:?}");
    let other = normals_at_edge("", "s 1\nf 1 2 3 4", "s 2\nf 2 5 6 3");
    assert!(other.iter().all(|n| !n.abs_diff_eq(smooth, 0.1)), "{other:?}");
}

#[test]
fn vertex_colours_are_srgb() {
    let scene = load_obj("v 0 0 0 0.5 0.02 2\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n", &[]).unwrap();
    let expected = Vec4::new(0.214_041_14, 0.02 / 12.92, 1.0, 1.0);
    let colors = &scene.meshes[0].primitives[0].colors;
    assert!(colors[0].abs_diff_eq(expected, 1e-6), "{colors:?}");
    assert_eq!(colors[1..], [Vec4::ONE, Vec4::W]);
}

/// Boxes of this size (metres) in a row of `count`, `step` apart, from `at` on.
fn boxes(at: DVec3, size: f64, count: u32, step: f64) -> String {
    let mut obj = String::new();
    for i in 0..count {
        for k in 0..8 {
            let corner = DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2));
            let p = at + corner * size + DVec3::X * step * f64::from(i);
            // Writing to a string does not fail.
            let _ = writeln!(obj, "v {} {} {}", p.x, p.y, p.z);
        }
        obj += "f -8 -6 -5 -7\nf -4 -3 -1 -2\nf -8 -7 -3 -4\nf -6 -2 -1 -5\nf -8 -4 -2 -6\nf -7 -5 -1 -3\n";
    }
    obj
}

#[test]
fn coordinates_too_far_for_32_bits_count_from_the_scene_s_own_middle() {
    let utm = DVec3::new(499_995.123, 4_649_771.456, 115.5);
    // A single box, a city of 50 km, a millimetre at 100 m.
    for (at, size, count, step) in
        [(utm, 10.0, 1, 0.0), (utm, 12.0, 50, 1000.0), (DVec3::splat(100.0), 1e-3, 2, 0.01)]
    {
        let there = load_obj(boxes(at, size, count, step), &[]).unwrap();
        assert!(there.warnings.len() == 1 && there.warnings[0].contains("origin"), "{:?}", there.warnings);
        let middle = at + (DVec3::splat(size) + DVec3::X * step * f64::from(count - 1)) / 2.0;
        assert!(there.origin_m.abs_diff_eq(middle, 1e-8), "{}", there.origin_m);
        let here = load_obj(boxes(at - middle, size, count, step), &[]).unwrap();
        assert_eq!((here.origin_m, here.warnings.len()), (DVec3::ZERO, 0));
        for (there, here) in there.meshes[0].primitives.iter().zip(&here.meshes[0].primitives) {
            let close = |(a, b): (&Vec3, &Vec3)| a.abs_diff_eq(*b, 1e-6 * (1.0 + b.length()));
            assert!(there.positions.iter().zip(&here.positions).all(close));
            assert!(there.normals.iter().zip(&here.normals).all(close));
        }
    }
}

#[test]
fn coordinates_that_32_bits_hold_well_stay() {
    // Beside the origin, around it however large, far but large, and far with nothing but a point.
    for (at, size, count, step) in [
        (DVec3::new(3.0, -4.0, 20.0), 1.0, 3, 2.0),
        (DVec3::splat(-5e8), 1e6, 1000, 1e6),
        (DVec3::splat(1e6), 1e4, 2, 3e4),
        (DVec3::splat(1e9), 0.0, 1, 0.0),
    ] {
        let scene = load_obj(boxes(at, size, count, step), &[]).unwrap();
        assert_eq!(
            (scene.origin_m, scene.warnings.len()),
            (DVec3::ZERO, 0),
            "{at} {size}: {:?}",
            scene.warnings
        );
    }
}

#[test]
fn what_draws_nothing_says_what_there_is() {
    for obj in [SQUARE, "", "\u{feff}", "v 0 0 0\nv 1 0 0\nl 1 2\nf 1 2\n"] {
        let warnings = load_obj(obj, &[]).unwrap().warnings;
        let vertices = obj.matches('v').count();
        let found = |w: &String| w.contains("draws nothing") && w.contains(&format!("{vertices} vertices"));
        assert!(warnings.iter().any(found), "{warnings:?}");
    }
    for (members, found) in [
        (r#""scenes": [{}]"#, "0 nodes"),
        (r#""scenes": [{"nodes": []}], "nodes": [{}]"#, "1 scenes, 1 nodes"),
        (r#""nodes": [{"children": [1]}, {}]"#, "2 nodes"),
    ] {
        let json = format!(r#"{{"asset": {{"version": "2.0"}}, {members}}}"#);
        let warnings = super::gltf_bytes(Path::new("t.gltf"), json.into()).unwrap().warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("draws nothing"), "{warnings:?}");
        assert!(warnings[0].contains(found), "{warnings:?}");
    }
}

/// A square whose only texture is at this place of its material, in this image.
fn textured(texture: &str, image: &str) -> Vec<u8> {
    let members =
        format!(r#", "materials": [{{{texture}}}], "textures": [{{"source": 0}}], "images": [{{{image}}}]"#);
    square_document(r#", "TEXCOORD_0": 1"#, r#", "indices": 2, "material": 0"#, &members)
}

fn load_glb(glb: Vec<u8>, beside: &[(&str, &[u8])], strict: bool) -> Result<Scene, SceneError> {
    let mut files = Memory::default();
    files.insert("s/t.glb", glb);
    for (name, content) in beside {
        files.insert(name, *content);
    }
    let scene = load_from(&files, Path::new("s/t.glb"), &LoadOptions { strict, ..LoadOptions::default() })?;
    assert_sound(&scene);
    Ok(scene)
}

#[test]
fn a_texture_that_is_missing_or_broken_is_a_warning_unless_nothing_may_stand_in() {
    for image in
        [r#""uri": "gone.png""#, r#""uri": "broken.png""#, r#""uri": "https://example.com/gone.png""#]
    {
        for (texture, is_plain) in [
            (r#""pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0}"#, true),
            (r#""pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}"#, true),
            (r#""emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 1]"#, false),
            (r#""normalTexture": {"index": 0}"#, false),
        ] {
            let beside: [(&str, &[u8]); 1] = [("s/broken.png", b"\x89PNG\r\n")];
            let scene = load_glb(textured(texture, image), &beside, false).unwrap();
            let name = image.split(['"', '/']).rev().find(|part| part.contains("png")).unwrap();
            assert!(scene.warnings.len() == 1 && scene.warnings[0].contains(name), "{:?}", scene.warnings);
            assert!(scene.warnings[0].contains("stand in"), "{:?}", scene.warnings);
            let material = &scene.materials[0];
            assert_eq!((material.base_color, material.emissive), (Vec4::ONE, Vec3::ZERO));
            assert!(!is_plain || material.metallic == 0.0);
            assert_eq!(material.texture_refs().count(), 0);
            let error = load_glb(textured(texture, image), &beside, true).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
    let obj = format!("mtllib m.mtl\n{SQUARE}usemtl m\nf 1 2 3 4\n");
    for mtl in ["newmtl m\nmap_Kd gone.png\n", "newmtl m\nbump broken.png\n", "newmtl other\n"] {
        let beside: [(&str, &[u8]); 2] = [("m.mtl", mtl.as_bytes()), ("broken.png", b"GIF")];
        assert_eq!(load_as(obj.clone(), &beside, false).unwrap().warnings.len(), 1);
        let error = load_as(obj.clone(), &beside, true).unwrap_err().to_string();
        assert!(error.starts_with("t.obj: "), "{error}");
    }
    assert!(load_as(obj, &[], true).unwrap_err().to_string().contains("m.mtl"));
}

#[test]
fn uris_are_found_as_any_system_writes_them() {
    let texture = r#""pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}"#;
    for uri in [
        r"maps\\wood%201.png",
        r"MAPS/Wood 1.PNG",
        r"..\\S\\maps\\wood%201.png",
        r"C:\\models\\Wood 1.png",
        "/elsewhere/wood%201.png",
        "maps/wood%201.png",
    ] {
        // A foreign path's last part is looked for beside the scene.
        let name = if uri.contains("elsewhere/") || uri.contains(':') {
            "s/wood 1.png"
        } else {
            "s/maps/wood 1.png"
        };
        let glb = textured(texture, &format!(r#""uri": "{uri}""#));
        let scene = load_glb(glb, &[(name, &png([1, 2, 3, 255]))], true).unwrap();
        assert_eq!(scene.images[0].rgba, [1, 2, 3, 255], "{uri}");
    }
    // Buffers, too.
    let json = r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": "Data\\A.BIN"}]}"#;
    let mut files = Memory::default();
    files.insert("t.gltf", json);
    files.insert("data/a.bin", *b"abc");
    load_from(&files, Path::new("t.gltf"), &LoadOptions::default()).unwrap();
}
