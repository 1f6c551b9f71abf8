//! What [`crate::model`] promises, as a check for tests.

use crate::Scene;

/// Panics with the place where `scene` breaks an invariant of the data model.
pub(crate) fn assert_sound(scene: &Scene) {
    let name = &scene.name;
    for (i, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| parent < i), "{name}: nodes[{i}].parent");
        assert!(node.mesh.is_none_or(|id| id < scene.meshes.len()), "{name}: nodes[{i}].mesh");
        assert!(node.camera.is_none_or(|id| id < scene.cameras.len()), "{name}: nodes[{i}].camera");
        assert!(node.light.is_none_or(|id| id < scene.lights.len()), "{name}: nodes[{i}].light");
        assert!(node.parent_from_node.affine().is_finite(), "{name}: nodes[{i}] is not finite");
    }
    assert!(scene.bounds().is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite()), "{name}: bounds");
    for texture in &scene.textures {
        assert!(texture.image < scene.images.len(), "{name}: a texture's image");
    }
    for image in &scene.images {
        let texels = image.width as usize * image.height as usize;
        assert!(texels > 0 && image.rgba.len() == 4 * texels, "{name}: {image:?}");
    }
    for material in &scene.materials {
        let floats = [material.metallic, material.roughness, material.specular, material.transmission];
        assert!(floats.iter().all(|x| (0.0..=1.0).contains(x)), "{name}: {material:?}");
        assert!(material.base_color.is_finite() && material.emissive.is_finite(), "{name}: {material:?}");
        for texture in material.texture_refs() {
            assert!(texture.texture < scene.textures.len() && texture.uv_set < 2, "{name}: {material:?}");
        }
    }
    for (m, mesh) in scene.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            assert_sound_primitive(scene, primitive, &format!("{name}: meshes[{m}].primitives[{p}]"));
        }
    }
}

fn assert_sound_primitive(scene: &Scene, primitive: &crate::Primitive, place: &str) {
    let count = primitive.positions.len();
    assert!(
        !primitive.indices.is_empty() && primitive.indices.len().is_multiple_of(3),
        "{place}: no triangles"
    );
    assert!(primitive.indices.iter().all(|&index| (index as usize) < count), "{place}: index range");
    assert!(primitive.positions.iter().all(|p| p.is_finite()), "{place}: positions");
    assert_eq!(primitive.normals.len(), count, "{place}: normals");
    let is_unit = |length: f32| (length - 1.0).abs() < 1e-4;
    assert!(primitive.normals.iter().all(|n| is_unit(n.length())), "{place}: normals are not unit vectors");

    let material = &scene.materials[primitive.material];
    let tangents = if material.normal_texture.is_some() { count } else { 0 };
    assert_eq!(primitive.tangents.len(), tangents, "{place}: tangents");
    let is_tangent = |t: &glam::Vec4| is_unit(t.truncate().length()) && t.w.abs() == 1.0;
    assert!(primitive.tangents.iter().all(is_tangent), "{place}: tangents are not unit vectors");

    for uvs in &primitive.uvs {
        assert!(uvs.is_empty() || uvs.len() == count, "{place}: uvs");
        assert!(uvs.iter().all(|uv| uv.is_finite()), "{place}: uvs are not finite");
    }
    for texture in material.texture_refs() {
        assert_eq!(primitive.uvs[texture.uv_set].len(), count, "{place}: uvs that the material needs");
    }
    assert!(primitive.colors.is_empty() || primitive.colors.len() == count, "{place}: colors");
    assert!(primitive.colors.iter().all(|c| c.is_finite()), "{place}: colors are not finite");
}
