//! What [`crate::model`] promises, as a check for tests and fuzzing.

use crate::{Interpolation, Keys, Scene};

/// Panics with the place where `scene` breaks an invariant of the data model.
///
/// # Panics
/// That is what it is for.
pub fn assert_sound(scene: &Scene) {
    let name = &scene.name;
    for (i, node) in scene.nodes.iter().enumerate() {
        assert!(node.parent.is_none_or(|parent| parent < i), "{name}: nodes[{i}].parent");
        assert!(node.mesh.is_none_or(|id| id < scene.meshes.len()), "{name}: nodes[{i}].mesh");
        assert!(node.camera.is_none_or(|id| id < scene.cameras.len()), "{name}: nodes[{i}].camera");
        assert!(node.light.is_none_or(|id| id < scene.lights.len()), "{name}: nodes[{i}].light");
        assert!(node.parent_from_node.affine().is_finite(), "{name}: nodes[{i}] is not finite");
    }
    for (i, node) in scene.nodes.iter().enumerate() {
        let place = format!("{name}: nodes[{i}]");
        let targets = node.mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets());
        let weights = node.morph_weights.len();
        assert!(weights == 0 || weights == targets, "{place}: {weights} morph weights for {targets} targets");
        let Some(skin) = node.skin else { continue };
        let joints = scene.skins[skin].joints.len();
        let mesh = &scene.meshes[node.mesh.unwrap_or_else(|| panic!("{place}: a skin without a mesh"))];
        for primitive in &mesh.primitives {
            assert_eq!(primitive.joints.len(), primitive.positions.len(), "{place}: joints");
            let used = primitive.joints.iter().flatten().copied().max().unwrap_or(0);
            assert!(usize::from(used) < joints, "{place}: joint {used} of {joints}");
        }
    }
    for (i, skin) in scene.skins.iter().enumerate() {
        assert_eq!(skin.joints.len(), skin.joint_from_object.len(), "{name}: skins[{i}]");
        assert!(skin.joints.iter().all(|&joint| joint < scene.nodes.len()), "{name}: skins[{i}]");
        assert!(skin.joint_from_object.iter().all(glam::Affine3A::is_finite), "{name}: skins[{i}]");
    }
    for (i, animation) in scene.animations.iter().enumerate() {
        for (c, channel) in animation.channels.iter().enumerate() {
            assert_sound_channel(scene, channel, &format!("{name}: animations[{i}].channels[{c}]"));
        }
    }
    if let Some(environment) = &scene.environment {
        assert_eq!(environment.radiance.len(), (environment.width * environment.height) as usize, "{name}");
        assert!(environment.radiance.iter().all(|r| r.is_finite() && r.min_element() >= 0.0), "{name}");
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

fn assert_sound_channel(scene: &Scene, channel: &crate::Channel, place: &str) {
    assert!(channel.node < scene.nodes.len(), "{place}: node");
    let times = &channel.times_s;
    assert!(times.first().is_some_and(|&first| first >= 0.0), "{place}: times");
    assert!(
        times.windows(2).all(|pair| pair[0] < pair[1]) && times.iter().all(|t| t.is_finite()),
        "{place}: times"
    );
    let targets = scene.nodes[channel.node].mesh.map_or(0, |mesh| scene.meshes[mesh].morph_targets());
    let (count, finite, each) = match &channel.keys {
        Keys::Translation(keys) | Keys::Scale(keys) => (keys.len(), keys.iter().all(|k| k.is_finite()), 1),
        Keys::Rotation(keys) => (keys.len(), keys.iter().all(|k| k.is_finite()), 1),
        Keys::MorphWeights(keys) => (keys.len(), keys.iter().all(|k| k.is_finite()), targets),
    };
    let per_key = if channel.interpolation == Interpolation::Cubic { 3 } else { 1 };
    assert!(finite && each > 0 && count == times.len() * per_key * each, "{place}: {count} values");
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
    if primitive.flat {
        let mut triangle_of = vec![None; count];
        for (corner, &vertex) in primitive.indices.iter().enumerate() {
            let triangle = *triangle_of[vertex as usize].get_or_insert(corner / 3);
            assert_eq!(triangle, corner / 3, "{place}: a vertex of two flat triangles");
        }
    }
    let is_unit = |length: f32| (length - 1.0).abs() < 1e-4;
    assert!(primitive.normals.iter().all(|n| is_unit(n.length())), "{place}: normals are not unit vectors");

    let material = &scene.materials[primitive.material];
    let tangents = if material.normal_texture.is_some() { count } else { 0 };
    assert_eq!(primitive.tangents.len(), tangents, "{place}: tangents");
    let is_tangent = |t: &glam::Vec4| is_unit(t.truncate().length()) && t.w.abs() == 1.0;
    assert!(primitive.tangents.iter().all(is_tangent), "{place}: tangents are not unit vectors");

    assert_eq!(primitive.joints.len(), primitive.joint_weights.len(), "{place}: joint weights");
    let is_mean = |w: &glam::Vec4| w.min_element() >= 0.0 && (w.element_sum() - 1.0).abs() < 1e-3;
    assert!(primitive.joint_weights.iter().all(is_mean), "{place}: joint weights do not add up to 1");
    for target in &primitive.morph_targets {
        for stream in [&target.positions, &target.normals, &target.tangents] {
            assert!(stream.is_empty() || stream.len() == count, "{place}: morph target");
            assert!(stream.iter().all(|d| d.is_finite()), "{place}: morph target is not finite");
        }
    }
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
