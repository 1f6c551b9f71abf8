//! What [`crate::model`] promises of scenes from files and built-in ones beyond [`Scene::validate`], as a check for tests
//! and fuzzing.

use crate::Scene;

/// Panics with the place where `scene` breaks an invariant of the data model.
///
/// # Panics
/// That is what it is for.
pub fn assert_sound(scene: &Scene) {
    if let Err(error) = scene.validate() {
        panic!("{error}");
    }
    let name = &scene.name;
    assert!(scene.bounds().is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite()), "{name}: bounds");
    for (m, mesh) in scene.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            assert_unit(scene, primitive, &format!("{name}: meshes[{m}].primitives[{p}]"));
        }
    }
}

fn assert_unit(scene: &Scene, primitive: &crate::Primitive, place: &str) {
    let is_unit = |length: f32| (length - 1.0).abs() < 1e-4;
    assert!(primitive.normals.iter().all(|n| is_unit(n.length())), "{place}: normals are not unit vectors");
    let material = &scene.materials[primitive.material];
    assert_eq!(primitive.tangents.is_empty(), material.normal_texture.is_none(), "{place}: tangents");
    let is_tangent = |t: &glam::Vec4| is_unit(t.truncate().length()) && t.w.abs() == 1.0;
    assert!(primitive.tangents.iter().all(is_tangent), "{place}: tangents are not unit vectors");
    let is_mean = |w: &glam::Vec4| w.min_element() >= 0.0 && (w.element_sum() - 1.0).abs() < 1e-3;
    assert!(primitive.joint_weights.iter().all(is_mean), "{place}: joint weights do not add up to 1");
}
