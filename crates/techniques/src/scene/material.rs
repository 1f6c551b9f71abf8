//! Materials as shaders read them: twins of `Material` in `scene.wesl`.

use bytemuck::{Pod, Zeroable};
use chiaro_scene as cs;

use super::texture::TextureSlots;

/// See `scene.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct MaterialData {
    pub base_color: [f32; 4],
    pub emissive: [f32; 3],
    pub kind: u32,
    pub metallic: f32,
    pub roughness: f32,
    pub specular: f32,
    pub normal_scale: f32,
    pub specular_color: [f32; 3],
    pub occlusion_strength: f32,
    pub absorption: [f32; 3],
    pub transmission: f32,
    pub ior: f32,
    pub thickness: f32,
    pub dispersion: f32,
    pub alpha_cutoff: f32,
    pub f0_factor: f32,
    pub flags: u32,
    pub base_color_texture: [u32; 2],
    pub metallic_roughness_texture: [u32; 2],
    pub normal_texture: [u32; 2],
    pub occlusion_texture: [u32; 2],
    pub emissive_texture: [u32; 2],
    pub specular_texture: [u32; 2],
    pub specular_color_texture: [u32; 2],
    pub transmission_texture: [u32; 2],
    pub thickness_texture: [u32; 2],
}

const METALLIC_ROUGHNESS: u32 = 0;
const PHONG: u32 = 1;
const UNLIT: u32 = 2;

/// Blended surfaces cast shadows as masked at half coverage.
const BLEND_CUTOFF: f32 = 0.5;

/// Whether other surfaces may be seen through a material.
pub fn see_through(material: &cs::Material) -> bool {
    material.alpha == cs::AlphaMode::Blend || transmission(material) > 0.0
}

/// Share of light that passes; metals and the Phong model pass none.
pub fn transmission(material: &cs::Material) -> f32 {
    if material.reflection == cs::Reflection::MetallicRoughness { material.transmission } else { 0.0 }
}

/// F0 over that of glass of index 1.5, 0.04 (Schlick 1994); an index of 0 means full reflection (KHR_materials_ior).
fn f0_factor(material: &cs::Material) -> f32 {
    if material.ior == 1.5 || material.reflection != cs::Reflection::MetallicRoughness {
        return 1.0;
    }
    let root = (material.ior - 1.0) / (material.ior + 1.0);
    root * root / 0.04
}

/// Per metre; infinite distances take nothing away, black takes all that half floats can say.
fn absorption(material: &cs::Material) -> [f32; 3] {
    let per_metre =
        |left: f32| (-left.max(1e-6).ln() / material.attenuation_distance.max(1e-6)).clamp(0.0, 6e4);
    material.attenuation_color.to_array().map(per_metre)
}

/// Alpha below which a surface is a hole; 0 = no mask.
pub fn alpha_cutoff(material: &cs::Material) -> f32 {
    match material.alpha {
        cs::AlphaMode::Opaque => 0.0,
        cs::AlphaMode::Mask { cutoff } => cutoff,
        cs::AlphaMode::Blend => BLEND_CUTOFF,
    }
}

/// Whether what looks passes through a surface's back. The boundary of a volume has an inside. Twin of `one_sided` in
/// `paths/vertex.wesl`.
pub fn one_sided(material: &cs::Material) -> bool {
    let bounds_volume = transmission(material) > 0.0 && material.thickness > 0.0;
    !(material.double_sided || bounds_volume)
}

/// Whether a material shines by itself.
pub fn glows(material: &cs::Material) -> bool {
    material.emissive != glam::Vec3::ZERO
}

/// Whether a material is shown as it is, whatever the light.
pub fn is_unlit(material: &cs::Material) -> bool {
    material.reflection == cs::Reflection::Unlit
}

/// Packs a material; what texture.wesl says of their uses goes to the end of the `geometry` heap.
pub fn pack(material: &cs::Material, slots: &TextureSlots, geometry: &mut Vec<u32>) -> MaterialData {
    let (kind, roughness) = match material.reflection {
        cs::Reflection::MetallicRoughness => (METALLIC_ROUGHNESS, material.roughness),
        // The surface buffer keeps a roughness; phong_exponent() in brdf.wesl inverts this.
        cs::Reflection::Phong { exponent } => (PHONG, (2.0 / (exponent + 2.0)).powf(0.25)),
        cs::Reflection::Unlit => (UNLIT, 1.0),
    };
    let mut texture = |reference: &Option<cs::TextureRef>, linear: bool| {
        let Some(reference) = reference else { return [0, 0] };
        let Some(slot) = slots.slot(reference.texture, linear) else { return [0, 0] };
        let mut word = slot.word | (u32::from(reference.uv_set != 0) << 20) | 1 << 31;
        let offset = geometry.len() as u32;
        geometry.extend(slot.exact.into_iter().flatten());
        if reference.uv_transform != glam::Affine2::IDENTITY {
            word |= 1 << 21;
            geometry.extend(reference.uv_transform.to_cols_array().map(f32::to_bits));
        }
        [word, offset]
    };
    MaterialData {
        base_color: material.base_color.to_array(),
        emissive: material.emissive.to_array(),
        kind,
        metallic: material.metallic,
        roughness,
        specular: material.specular,
        normal_scale: material.normal_scale,
        specular_color: material.specular_color.to_array(),
        occlusion_strength: material.occlusion_strength,
        absorption: absorption(material),
        transmission: transmission(material),
        ior: if material.ior == 0.0 { 1.0 } else { material.ior },
        // What has no index of refraction does not bend light either.
        thickness: if material.ior == 0.0 { 0.0 } else { material.thickness },
        dispersion: material.dispersion,
        alpha_cutoff: alpha_cutoff(material),
        f0_factor: f0_factor(material),
        flags: u32::from(material.alpha == cs::AlphaMode::Blend),
        base_color_texture: texture(&material.base_color_texture, false),
        metallic_roughness_texture: texture(&material.metallic_roughness_texture, true),
        normal_texture: texture(&material.normal_texture, true),
        occlusion_texture: texture(&material.occlusion_texture, true),
        emissive_texture: texture(&material.emissive_texture, false),
        specular_texture: texture(&material.specular_texture, true),
        specular_color_texture: texture(&material.specular_color_texture, false),
        transmission_texture: texture(&material.transmission_texture, true),
        thickness_texture: texture(&material.thickness_texture, true),
    }
}
