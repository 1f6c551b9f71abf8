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
    pub alpha_cutoff: f32,
    pub reserved: f32,
    pub base_color_texture: [u32; 2],
    pub metallic_roughness_texture: [u32; 2],
    pub normal_texture: [u32; 2],
    pub occlusion_texture: [u32; 2],
    pub emissive_texture: [u32; 2],
    pub specular_texture: [u32; 2],
    pub specular_color_texture: [u32; 2],
}

const METALLIC_ROUGHNESS: u32 = 0;
const PHONG: u32 = 1;
const UNLIT: u32 = 2;

/// Blended surfaces are drawn as masked at half coverage until blending exists.
const BLEND_CUTOFF: f32 = 0.5;

/// Alpha below which a surface is a hole; 0 = no mask.
pub fn alpha_cutoff(material: &cs::Material) -> f32 {
    match material.alpha {
        cs::AlphaMode::Opaque => 0.0,
        cs::AlphaMode::Mask { cutoff } => cutoff,
        cs::AlphaMode::Blend => BLEND_CUTOFF,
    }
}

/// Whether a material shines by itself.
pub fn glows(material: &cs::Material) -> bool {
    material.emissive != glam::Vec3::ZERO || material.reflection == cs::Reflection::Unlit
}

/// Packs a material; texture transforms go to the end of the `geometry` heap.
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
        let mut word = slot | (u32::from(reference.uv_set != 0) << 16) | 1 << 31;
        let mut offset = 0;
        if reference.uv_transform != glam::Affine2::IDENTITY {
            word |= 1 << 17;
            offset = geometry.len() as u32;
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
        alpha_cutoff: alpha_cutoff(material),
        reserved: 0.0,
        base_color_texture: texture(&material.base_color_texture, false),
        metallic_roughness_texture: texture(&material.metallic_roughness_texture, true),
        normal_texture: texture(&material.normal_texture, true),
        occlusion_texture: texture(&material.occlusion_texture, true),
        emissive_texture: texture(&material.emissive_texture, false),
        specular_texture: texture(&material.specular_texture, true),
        specular_color_texture: texture(&material.specular_color_texture, false),
    }
}
