//! Materials; those that a primitive uses, converted when the first one does.

use std::collections::HashMap;

use ::gltf::json::Value;
use ::gltf::material::AlphaMode as GltfAlphaMode;
use ::gltf::texture::Info;
use glam::{Vec3, Vec4};

use super::super::warnings::Warnings;
use super::buffers::Buffers;
use super::file::File;
use super::texture::{Textures, Transform, UvSets};
use crate::{AlphaMode, Id, Material, Reflection, Scene, SceneError, TextureRef};

/// The materials of one file.
pub(super) struct Materials<'a> {
    file: File<'a>,
    textures: Textures<'a>,
    done: Vec<Material>,
    uv_sets: Vec<UvSets>,
    /// Our material by the file's index, `None` being the default material.
    converted: HashMap<Option<usize>, Id>,
}

impl<'a> Materials<'a> {
    pub(super) fn new(file: File<'a>, buffers: &'a Buffers) -> Self {
        Self {
            file,
            textures: Textures::new(file, buffers),
            done: Vec::new(),
            uv_sets: Vec::new(),
            converted: HashMap::new(),
        }
    }

    /// Our index of a primitive's material.
    pub(super) fn id(
        &mut self,
        material: &::gltf::Material<'a>,
        warnings: &mut Warnings,
    ) -> Result<Id, SceneError> {
        if let Some(&id) = self.converted.get(&material.index()) {
            return Ok(id);
        }
        let place = match material.index() {
            Some(index) => format!("materials[{index}]"),
            None => "the default material".to_owned(),
        };
        let mut conversion = Conversion {
            file: self.file,
            textures: &mut self.textures,
            uv_sets: UvSets::default(),
            warnings,
            place,
        };
        let converted = conversion.run(material)?;
        self.uv_sets.push(conversion.uv_sets);
        let id = self.done.len();
        self.done.push(converted);
        self.converted.insert(material.index(), id);
        Ok(id)
    }

    pub(super) fn get(&self, id: Id) -> &Material {
        &self.done[id]
    }

    /// Which of the file's sets of texture coordinates the material reads as [`Primitive::uvs`](crate::Primitive::uvs).
    pub(super) fn uv_sets(&self, id: Id) -> [u32; 2] {
        self.uv_sets[id].sets()
    }

    /// Moves everything into the scene.
    pub(super) fn finish(self, scene: &mut Scene) {
        scene.materials = self.done;
        self.textures.finish(scene);
    }
}

/// The conversion of one material.
struct Conversion<'c, 'a> {
    file: File<'a>,
    textures: &'c mut Textures<'a>,
    uv_sets: UvSets,
    warnings: &'c mut Warnings,
    place: String,
}

impl<'a> Conversion<'_, 'a> {
    fn run(&mut self, source: &::gltf::Material<'a>) -> Result<Material, SceneError> {
        let pbr = source.pbr_metallic_roughness();
        let mut material = Material {
            name: source.name().unwrap_or_default().to_owned(),
            reflection: if source.unlit() { Reflection::Unlit } else { Reflection::MetallicRoughness },
            base_color: Vec4::from(self.factors(pbr.base_color_factor(), 0.0..=1.0, "baseColorFactor")?),
            base_color_texture: self.texture(pbr.base_color_texture(), "baseColorTexture")?,
            metallic: self.factor(pbr.metallic_factor(), 0.0..=1.0, "metallicFactor")?,
            roughness: self.factor(pbr.roughness_factor(), 0.0..=1.0, "roughnessFactor")?,
            metallic_roughness_texture: self
                .texture(pbr.metallic_roughness_texture(), "metallicRoughnessTexture")?,
            emissive: self.emissive(source)?,
            emissive_texture: self.texture(source.emissive_texture(), "emissiveTexture")?,
            alpha: match source.alpha_mode() {
                GltfAlphaMode::Opaque => AlphaMode::Opaque,
                GltfAlphaMode::Blend => AlphaMode::Blend,
                GltfAlphaMode::Mask => AlphaMode::Mask {
                    // Above 1 nothing is present: a legal way to hide a surface.
                    cutoff: self.factor(
                        source.alpha_cutoff().unwrap_or(0.5),
                        0.0..=f32::MAX,
                        "alphaCutoff",
                    )?,
                },
            },
            double_sided: source.double_sided(),
            ..Material::default()
        };
        // A factor of 1 is usual where a texture says what glows and what is metal: without it nothing is known to.
        if source.emissive_texture().is_some() && material.emissive_texture.is_none() {
            material.emissive = Vec3::ZERO;
        }
        if pbr.metallic_roughness_texture().is_some() && material.metallic_roughness_texture.is_none() {
            material.metallic = 0.0;
        }
        self.surface_maps(source, &mut material)?;
        self.dielectric(source, &mut material)?;
        self.volume(source, &mut material)?;
        if material.reflection == Reflection::Unlit {
            // KHR_materials_unlit: nothing but the base colour counts.
            (material.emissive, material.emissive_texture) = (Vec3::ZERO, None);
        }
        Ok(material)
    }

    fn surface_maps(
        &mut self,
        source: &::gltf::Material<'a>,
        material: &mut Material,
    ) -> Result<(), SceneError> {
        if let Some(normal) = source.normal_texture() {
            let transform = normal.extension_value("KHR_texture_transform");
            material.normal_scale =
                self.factor(normal.scale(), f32::MIN..=f32::MAX, "normalTexture.scale")?;
            material.normal_texture =
                self.texture_json(normal.texture().index(), normal.tex_coord(), transform, "normalTexture")?;
        }
        if let Some(occlusion) = source.occlusion_texture() {
            let transform = occlusion.extension_value("KHR_texture_transform");
            material.occlusion_strength =
                self.factor(occlusion.strength(), 0.0..=1.0, "occlusionTexture.strength")?;
            material.occlusion_texture = self.texture_json(
                occlusion.texture().index(),
                occlusion.tex_coord(),
                transform,
                "occlusionTexture",
            )?;
        }
        Ok(())
    }

    fn emissive(&mut self, source: &::gltf::Material<'a>) -> Result<Vec3, SceneError> {
        let factor = Vec3::from(self.factors(source.emissive_factor(), 0.0..=1.0, "emissiveFactor")?);
        let strength =
            self.factor(source.emissive_strength().unwrap_or(1.0), 0.0..=f32::MAX, "emissiveStrength")?;
        Ok(factor * strength)
    }

    /// KHR_materials_ior and KHR_materials_specular.
    fn dielectric(
        &mut self,
        source: &::gltf::Material<'a>,
        material: &mut Material,
    ) -> Result<(), SceneError> {
        if let Some(ior) = source.ior() {
            // Zero is legal and stands for an infinite index: F0 = 1.
            material.ior = if ior == 0.0 { 0.0 } else { self.factor(ior, 1.0..=f32::MAX, "ior")? };
        }
        if let Some(specular) = source.specular() {
            material.specular = self.factor(specular.specular_factor(), 0.0..=1.0, "specularFactor")?;
            let color = specular.specular_color_factor();
            material.specular_color =
                Vec3::from(self.factors(color, 0.0..=f32::MAX, "specularColorFactor")?);
            material.specular_texture = self.texture(specular.specular_texture(), "specularTexture")?;
            material.specular_color_texture =
                self.texture(specular.specular_color_texture(), "specularColorTexture")?;
        }
        Ok(())
    }

    /// KHR_materials_transmission, KHR_materials_volume and KHR_materials_dispersion.
    fn volume(&mut self, source: &::gltf::Material<'a>, material: &mut Material) -> Result<(), SceneError> {
        if let Some(transmission) = source.transmission() {
            material.transmission =
                self.factor(transmission.transmission_factor(), 0.0..=1.0, "transmissionFactor")?;
            material.transmission_texture =
                self.texture(transmission.transmission_texture(), "transmissionTexture")?;
        }
        if let Some(volume) = source.volume() {
            material.thickness = self.factor(volume.thickness_factor(), 0.0..=f32::MAX, "thicknessFactor")?;
            let color = volume.attenuation_color();
            material.attenuation_color = Vec3::from(self.factors(color, 0.0..=1.0, "attenuationColor")?);
            let distance = volume.attenuation_distance();
            material.attenuation_distance = if distance == f32::INFINITY {
                distance
            } else {
                self.factor(distance, f32::MIN_POSITIVE..=f32::MAX, "attenuationDistance")?
            };
            material.thickness_texture = self.texture(volume.thickness_texture(), "thicknessTexture")?;
        }
        if let Some(dispersion) = source.extension_value("KHR_materials_dispersion") {
            let value = dispersion.get("dispersion").map_or(Some(0.0), Value::as_f64);
            let value = value.ok_or_else(|| self.invalid("dispersion", "it must be a number"))?;
            material.dispersion = self.factor(value as f32, 0.0..=f32::MAX, "dispersion")?;
        }
        Ok(())
    }

    fn texture(&mut self, info: Option<Info<'a>>, name: &str) -> Result<Option<TextureRef>, SceneError> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.texture_transform().map(|t| Transform {
            offset: t.offset(),
            rotation: t.rotation(),
            scale: t.scale(),
            tex_coord: t.tex_coord(),
        });
        let place = format!("{}.{name}", self.place);
        self.textures.reference(
            info.texture().index(),
            info.tex_coord(),
            transform,
            &mut self.uv_sets,
            &place,
            self.warnings,
        )
    }

    /// For the two texture infos whose transform the crate does not parse.
    fn texture_json(
        &mut self,
        texture: usize,
        tex_coord: u32,
        transform: Option<&Value>,
        name: &str,
    ) -> Result<Option<TextureRef>, SceneError> {
        let place = format!("{}.{name}", self.place);
        let transform = match transform {
            Some(value) => Some(Transform::from_json(value).map_err(|e| {
                self.file.invalid(format!("{place}.extensions.KHR_texture_transform"), e.to_string())
            })?),
            None => None,
        };
        self.textures.reference(texture, tex_coord, transform, &mut self.uv_sets, &place, self.warnings)
    }

    /// A factor within its range: what lies outside is clamped with a warning, what is not finite refused.
    fn factor(
        &mut self,
        value: f32,
        range: std::ops::RangeInclusive<f32>,
        name: &str,
    ) -> Result<f32, SceneError> {
        if !value.is_finite() {
            return Err(self.invalid(name, "it must be finite"));
        }
        if !range.contains(&value) {
            self.warnings.add(format!("{}.{name} = {value} is out of range and was clamped", self.place));
        }
        Ok(value.clamp(*range.start(), *range.end()))
    }

    fn factors<const N: usize>(
        &mut self,
        mut values: [f32; N],
        range: std::ops::RangeInclusive<f32>,
        name: &str,
    ) -> Result<[f32; N], SceneError> {
        for value in &mut values {
            *value = self.factor(*value, range.clone(), name)?;
        }
        Ok(values)
    }

    fn invalid(&self, name: &str, problem: &str) -> SceneError {
        self.file.invalid(format!("{}.{name}", self.place), problem)
    }
}
