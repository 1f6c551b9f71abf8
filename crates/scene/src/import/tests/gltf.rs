//! glTF documents as they should be.

use std::f32::consts::FRAC_PI_2;
use std::path::Path;

use glam::{Vec2, Vec3, Vec4};

use super::{gltf_bytes as from_bytes, warnings};
use crate::invariants::assert_sound;
use crate::{AlphaMode, LightKind, Primitive, Projection, Reflection, Scene, SceneError, Transform, Wrap};

/// A GLB of a JSON document and a binary chunk.
pub(super) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut chunks = Vec::new();
    for (kind, content, padding) in [(b"JSON", json.as_bytes(), b' '), (b"BIN\0", binary, 0)] {
        let mut content = content.to_vec();
        content.resize(content.len().next_multiple_of(4), padding);
        chunks.extend((content.len() as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(content);
    }
    let length = 12 + chunks.len() as u32;
    [&b"glTF"[..], &2_u32.to_le_bytes(), &length.to_le_bytes(), &chunks].concat()
}

/// Loads a document without anything to draw but what `members` say.
fn document(members: &str) -> Result<Scene, SceneError> {
    let json = format!(r#"{{"asset": {{"version": "2.0"}}, {members}}}"#);
    from_bytes(Path::new("test.gltf"), json.into_bytes())
}

/// Vertices of a square of two metres in the plane z = 0, texture coordinates as an image lies on it: 4 × (3 positions,
/// 2 coordinates), then six indices of 16 bits.
fn square() -> Vec<u8> {
    let corners: [([f32; 3], [f32; 2]); 4] = [
        ([-1.0, -1.0, 0.0], [0.0, 1.0]),
        ([1.0, -1.0, 0.0], [1.0, 1.0]),
        ([1.0, 1.0, 0.0], [1.0, 0.0]),
        ([-1.0, 1.0, 0.0], [0.0, 0.0]),
    ];
    let floats = corners.iter().flat_map(|(p, uv)| p.iter().chain(uv));
    let indices = [0_u16, 1, 2, 0, 2, 3];
    floats.flat_map(|x| x.to_le_bytes()).chain(indices.iter().flat_map(|i| i.to_le_bytes())).collect()
}

/// A document that draws the [`square`] with more attributes, members of the primitive and members of the document.
pub(super) fn square_document(attributes: &str, primitive: &str, members: &str) -> Vec<u8> {
    let json = format!(
        r#"{{"asset": {{"version": "2.0"}}, "nodes": [{{"mesh": 0}}], "scenes": [{{"nodes": [0]}}],
        "buffers": [{{"byteLength": 92}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 80, "byteStride": 20}},
                        {{"buffer": 0, "byteOffset": 80, "byteLength": 12}}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
              "min": [-1, -1, 0], "max": [1, 1, 0]}},
            {{"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 4, "type": "VEC2"}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0{attributes}}}{primitive}}}]}}]{members}}}"#
    );
    glb(&json, &square())
}

const IMAGE: &str = r#", "images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="}],
    "samplers": [{"wrapS": 33071, "wrapT": 33648}], "textures": [{"source": 0, "sampler": 0}]"#;

fn load_square(attributes: &str, primitive: &str, members: &str) -> Scene {
    let scene = from_bytes(Path::new("square.glb"), square_document(attributes, primitive, members)).unwrap();
    assert_sound(&scene);
    scene
}

fn only_primitive(scene: &Scene) -> &Primitive {
    assert_eq!((scene.meshes.len(), scene.meshes[0].primitives.len()), (1, 1));
    &scene.meshes[0].primitives[0]
}

#[test]
fn a_square_without_normals_gets_flat_ones_and_the_default_material() {
    let scene = load_square("", r#", "indices": 2"#, "");
    let primitive = only_primitive(&scene);
    assert_eq!(scene.triangle_count(), 2);
    assert!(primitive.normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-6)));
    let material = &scene.materials[primitive.material];
    assert_eq!((material.metallic, material.roughness), (1.0, 1.0));
    assert!(primitive.tangents.is_empty() && primitive.uvs[0].is_empty());
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn strips_and_fans_become_triangles_that_all_face_the_same_way() {
    // Without indices: the vertices go around, which a fan follows and a strip folds over.
    let fan = load_square("", r#", "mode": 6"#, "");
    assert!(only_primitive(&fan).normals.iter().all(|n| n.z > 0.99));
    assert_eq!(fan.triangle_count(), 2);
    let indices = r#", "indices": 3, "mode": 5"#;
    let members = r#", "extras": {}"#;
    let strip = square_document("", indices, members);
    // The strip 0 1 3 2 from bytes of its own.
    let text = String::from_utf8_lossy(&strip).replace(
        r#""type": "SCALAR"}]"#,
        r#""type": "SCALAR"}, {"bufferView": 2, "componentType": 5121, "count": 4, "type": "SCALAR"}]"#,
    );
    let json_start = text.find('{').unwrap();
    let json_end = text.rfind('}').unwrap() + 1;
    let json = text[json_start..json_end].replace(r#""byteLength": 92"#, r#""byteLength": 96"#).replace(
        r#""byteLength": 12}]"#,
        r#""byteLength": 12}, {"buffer": 0, "byteOffset": 92, "byteLength": 4}]"#,
    );
    let binary = [&square()[..], &[0, 1, 3, 2]].concat();
    let strip = from_bytes(Path::new("strip.glb"), glb(&json, &binary)).unwrap();
    assert_eq!(strip.triangle_count(), 2);
    assert!(only_primitive(&strip).normals.iter().all(|n| n.z > 0.99));
}

#[test]
fn points_and_lines_are_left_out_with_a_warning() {
    for mode in 0..4 {
        let scene = load_square("", &format!(r#", "mode": {mode}"#), "");
        assert_eq!((scene.triangle_count(), scene.meshes.len(), warnings(&scene).len()), (0, 0, 1));
        assert_eq!(scene.nodes.len(), 1);
    }
}

#[test]
fn a_normal_map_gets_tangents_along_the_image_with_the_bitangent_up() {
    let material = r#", "materials": [{"normalTexture": {"index": 0, "scale": 0.5}}]"#;
    let scene = load_square(
        r#", "TEXCOORD_0": 1"#,
        r#", "indices": 2, "material": 0"#,
        &format!("{material}{IMAGE}"),
    );
    let primitive = only_primitive(&scene);
    assert_eq!(scene.materials[0].normal_scale, 0.5);
    for (tangent, normal) in primitive.tangents.iter().zip(&primitive.normals) {
        assert!(tangent.abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-5), "{tangent}");
        assert!((tangent.w * normal.cross(tangent.truncate())).abs_diff_eq(Vec3::Y, 1e-5));
    }
}

#[test]
fn the_tangents_of_a_rotated_normal_map_turn_with_it() {
    let material = r#", "materials": [{"normalTexture": {"index": 0, "extensions":
        {"KHR_texture_transform": {"rotation": 1.5707963, "offset": [0, 1]}}}}]"#;
    let scene = load_square(
        r#", "TEXCOORD_0": 1"#,
        r#", "indices": 2, "material": 0"#,
        &format!("{material}{IMAGE}"),
    );
    // u' grows along what was v: down the square.
    assert!(only_primitive(&scene).tangents.iter().all(|t| t.truncate().abs_diff_eq(Vec3::NEG_Y, 1e-5)));
}

#[test]
fn texture_transforms_are_scale_then_rotation_then_offset_and_may_name_another_set() {
    let material = format!(
        r#", "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0, "texCoord": 0, "extensions":
        {{"KHR_texture_transform": {{"offset": [0.1, 0.2], "rotation": {FRAC_PI_2}, "scale": [2, 3],
        "texCoord": 1}}}}}}}}}}]"#
    );
    let scene = load_square(
        r#", "TEXCOORD_1": 1"#,
        r#", "indices": 2, "material": 0"#,
        &format!("{material}{IMAGE}"),
    );
    let texture = scene.materials[0].base_color_texture.unwrap();
    assert_eq!(texture.uv_set, 1);
    // Scaled to (2·0.5, 3·0.25); a quarter turn in a plane whose v points down maps (u, v) to (v, −u).
    let got = texture.uv_transform.transform_point2(Vec2::new(0.5, 0.25));
    assert!(got.abs_diff_eq(Vec2::new(0.75 + 0.1, -1.0 + 0.2), 1e-6), "{got}");
    assert_eq!(scene.textures[texture.texture].wrap, [Wrap::Clamp, Wrap::Mirror]);
}

#[test]
fn a_material_whose_coordinates_are_missing_gets_zeros_and_a_warning() {
    let material = r#", "materials": [{"emissiveTexture": {"index": 0, "texCoord": 1}}]"#;
    let scene = load_square("", r#", "indices": 2, "material": 0"#, &format!("{material}{IMAGE}"));
    assert!(scene.warnings[0].contains("TEXCOORD_1"), "{:?}", scene.warnings);
}

#[test]
fn a_material_may_use_any_two_sets_of_coordinates_and_a_third_is_left_out() {
    let material = |occlusion: u32| {
        format!(
            r#", "materials": [{{"emissiveTexture": {{"index": 0, "texCoord": 3}},
            "normalTexture": {{"index": 0, "texCoord": 7}},
            "occlusionTexture": {{"index": 0, "texCoord": {occlusion}}}}}]{IMAGE}"#
        )
    };
    let attributes = r#", "TEXCOORD_0": 1, "TEXCOORD_3": 1, "TEXCOORD_7": 1"#;
    let scene = load_square(attributes, r#", "indices": 2, "material": 0"#, &material(7));
    let [material_0] = &scene.materials[..] else { panic!() };
    let set_of = |texture: Option<crate::TextureRef>| texture.map(|texture| texture.uv_set);
    let [normal, occlusion] = [material_0.normal_texture, material_0.occlusion_texture].map(set_of);
    assert_eq!((normal, occlusion), (Some(1), Some(1)));
    assert_eq!(set_of(material_0.emissive_texture), Some(0));
    assert!(only_primitive(&scene).uvs.iter().all(|uvs| uvs[0] == Vec2::Y) && scene.warnings.is_empty());
    // The order in which a material's textures are looked at decides which of three is left out.
    let scene = load_square(attributes, r#", "indices": 2, "material": 0"#, &material(0));
    assert!(scene.materials[0].occlusion_texture.is_none(), "{:?}", scene.materials[0]);
    assert!(scene.warnings[0].contains("TEXCOORD_0"), "{:?}", scene.warnings);
}

#[test]
fn every_material_parameter_arrives() {
    let material = r#", "extensionsUsed": ["KHR_materials_dispersion"],
        "extensionsRequired": ["KHR_materials_volume", "KHR_materials_specular", "KHR_materials_dispersion"],
        "materials": [{"name": "all", "doubleSided": true, "alphaMode": "MASK", "alphaCutoff": 0.25,
        "emissiveFactor": [1, 0.5, 0], "pbrMetallicRoughness":
        {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.6},
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 10}, "KHR_materials_ior": {"ior": 1.8},
        "KHR_materials_specular": {"specularFactor": 0.7, "specularColorFactor": [2, 1, 0.5]},
        "KHR_materials_transmission": {"transmissionFactor": 0.9, "transmissionTexture": {"index": 0}}, "KHR_materials_dispersion": {"dispersion": 0.2},
        "KHR_materials_volume": {"thicknessFactor": 3, "thicknessTexture": {"index": 0, "texCoord": 1}, "attenuationDistance": 4, "attenuationColor": [0.9, 0.8, 0.7]}}}]"#;
    let attributes = r#", "TEXCOORD_0": 1, "TEXCOORD_1": 1"#;
    let scene = load_square(attributes, r#", "indices": 2, "material": 0"#, &format!("{material}{IMAGE}"));
    let m = &scene.materials[0];
    let uv_sets = [m.transmission_texture, m.thickness_texture].map(|texture| texture.unwrap().uv_set);
    assert_eq!(uv_sets, [0, 1]);
    assert_eq!((m.name.as_str(), m.reflection, m.double_sided), ("all", Reflection::MetallicRoughness, true));
    assert_eq!(m.alpha, AlphaMode::Mask { cutoff: 0.25 });
    assert_eq!(m.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!((m.metallic, m.roughness, m.emissive), (0.5, 0.6, Vec3::new(10.0, 5.0, 0.0)));
    assert_eq!((m.ior, m.specular, m.specular_color), (1.8, 0.7, Vec3::new(2.0, 1.0, 0.5)));
    assert_eq!((m.transmission, m.dispersion, m.thickness), (0.9, 0.2, 3.0));
    assert_eq!((m.attenuation_distance, m.attenuation_color), (4.0, Vec3::new(0.9, 0.8, 0.7)));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
}

#[test]
fn factors_out_of_range_are_clamped_with_a_warning() {
    let material = r#", "materials": [{"pbrMetallicRoughness": {"metallicFactor": 2}}]"#;
    let scene = load_square("", r#", "indices": 2, "material": 0"#, material);
    assert_eq!(scene.materials[0].metallic, 1.0);
    assert!(scene.warnings[0].contains("metallicFactor = 2"), "{:?}", scene.warnings);
}

#[test]
fn nodes_stand_after_their_parents_and_multiply() {
    let scene = document(
        r#""scenes": [{"nodes": [2]}], "nodes": [{"name": "leaf", "scale": [2, 2, 2]},
        {"children": [0], "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1]},
        {"children": [1], "translation": [1, 1, 1], "rotation": [0, 2, 0, 0]}, {"name": "not in the scene"}]"#,
    )
    .unwrap();
    assert_sound(&scene);
    assert_eq!(scene.nodes.len(), 3);
    assert!(matches!(scene.nodes[1].parent_from_node, Transform::Matrix(_)));
    let leaf = scene.world_from_node()[2].transform_point3(Vec3::X);
    assert!(leaf.abs_diff_eq(Vec3::new(1.0 - 7.0, 7.0, 1.0 - 7.0), 1e-5), "{leaf}");
}

#[test]
fn a_file_without_scenes_shows_all_its_roots() {
    let scene = document(r#""nodes": [{"children": [1]}, {}, {}]"#).unwrap();
    assert_eq!(scene.nodes.iter().map(|n| n.parent).collect::<Vec<_>>(), [None, Some(0), None]);
}

#[test]
fn cameras_of_both_kinds_and_lights_of_all_three_arrive() {
    let scene = document(
        r#""nodes": [{"name": "eye", "camera": 0}, {"camera": 1},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}}, {"extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"extensions": {"KHR_lights_punctual": {"light": 2}}}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}},
        {"type": "orthographic", "orthographic": {"xmag": 4, "ymag": 3, "znear": 0, "zfar": 9}}],
        "extensionsUsed": ["KHR_lights_punctual"], "extensions": {"KHR_lights_punctual": {"lights": [
        {"type": "directional", "color": [1, 0.5, 0], "intensity": 3}, {"type": "point", "range": 7},
        {"type": "spot", "name": "beam", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}}]}}"#,
    )
    .unwrap();
    assert_eq!(scene.cameras[0].projection, Projection::Perspective { yfov_rad: 0.8 });
    assert_eq!((scene.cameras[0].name.as_str(), scene.cameras[0].far_m), ("eye", None));
    assert_eq!(scene.cameras[1].projection, Projection::Orthographic { half_height_m: 3.0 });
    assert_eq!((scene.cameras[1].near_m, scene.cameras[1].far_m), (0.0, Some(9.0)));
    let kinds: Vec<_> = scene.lights.iter().map(|light| light.kind).collect();
    let spot = LightKind::Spot { inner_rad: 0.1, outer_rad: 0.2 };
    assert_eq!(kinds, [LightKind::Directional, LightKind::Point, spot]);
    assert_eq!((scene.lights[0].intensity, scene.lights[1].range_m), (3.0, Some(7.0)));
    assert_eq!(scene.lights[2].name, "beam");
}

#[test]
fn what_is_used_but_not_required_is_a_warning_and_what_is_required_an_error() {
    let scene = document(r#""extensionsUsed": ["KHR_materials_sheen"]"#).unwrap();
    assert!(scene.warnings[0].contains("KHR_materials_sheen"));
    for extension in ["KHR_draco_mesh_compression", "KHR_texture_basisu", "X_unheard"] {
        let error = document(&format!(r#""extensionsRequired": ["{extension}"]"#)).unwrap_err();
        assert!(
            matches!(&error, SceneError::Unsupported { feature, .. } if feature.contains(extension)),
            "{error}"
        );
    }
}

#[test]
fn every_2_x_version_is_read_unless_a_later_minimum_is_stated() {
    let load = |asset: &str| from_bytes(Path::new("v.gltf"), format!(r#"{{"asset": {asset}}}"#).into_bytes());
    assert!(load(r#"{"version": "2.1"}"#).is_ok());
    for asset in
        [r#"{"version": "1.0"}"#, r#"{"version": "2.1", "minVersion": "2.1"}"#, r#"{"version": "3.0"}"#]
    {
        assert!(matches!(load(asset), Err(SceneError::Unsupported { .. })), "{asset}");
    }
}
