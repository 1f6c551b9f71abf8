//! MTL materials to chiaro's.
//!
//! What MTL leaves open, and habits that exporters share:
//! - Colours are linear, and the specular highlight is a normalised Phong lobe where both Ks and Ns are above zero;
//!   where Kd + Ks would reflect more than arrives, Ks is scaled down. Without a highlight a surface is Lambert's.
//! - A textured material whose Kd is black has a white one: exporters leave Kd out then.
//! - OBJ surfaces have no side: all are double-sided.
//! - `illum` 4, 6, 7 and 9 are glass where the diffuse colour is near black or the surface dissolves; `Tf` is its
//!   colour, `Ni` its index, and 6 and 7 refract.
//! - Dissolve blends otherwise; a dissolve map, or a base colour image with transparent texels, cuts out.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use image::{DynamicImage, RgbaImage, imageops};

use super::super::files::Files;
use super::super::limits::Limits;
use super::super::source::{self, Decoder};
use super::super::warnings::Warnings;
use super::bump;
use super::library::{Library, Source};
use super::map::{self, Map};
use crate::{
    AlphaMode, Filter, Id, ImageData, Material, Reflection, Scene, SceneError, Texture, TextureRef, Wrap,
};

/// Reflectance of a surface that has no material or no Kd: a light grey.
const DEFAULT_DIFFUSE: Vec3 = Vec3::splat(0.8);

/// The most that a glass may reflect diffusely.
const MAX_GLASS_DIFFUSE: f32 = 0.1;

/// Thickness of refracting glass: MTL says none, and any number above 0 says that the object is solid.
const SOLID_M: f32 = 1.0;

/// What a texture that is not there leaves.
const WITHOUT: &str = "the material's plain values stand in";

/// A map and its file.
type Found = (Map, PathBuf);

/// What an image file is read as.
#[derive(Clone, PartialEq, Eq, Hash)]
enum Use {
    Color,
    /// With another file's dissolve as alpha.
    Masked(PathBuf),
    /// White with the file's dissolve as alpha.
    Dissolve,
    /// From heights if it holds heights: strength (`-bm`, its bits) and whether it is clamped.
    Normal {
        strength: u32,
        clamp: bool,
    },
    /// Normals whatever they look like.
    NormalAsIs,
}

/// The materials of one OBJ file; those that are used, converted when they first are.
pub(super) struct Materials<'a> {
    files: &'a dyn Files,
    path: &'a Path,
    directory: &'a Path,
    library: &'a Library,
    converted: HashMap<Option<&'a str>, Id>,
    done: Vec<Material>,
    textures: Vec<Texture>,
    images: Vec<ImageData>,
    /// Images by file and use, and whether the alpha varies; `None` for what could not be read.
    decoded: HashMap<(PathBuf, Use), Option<(Id, bool)>>,
    decoder: Decoder,
}

impl<'a> Materials<'a> {
    pub(super) fn new(files: &'a dyn Files, limits: &Limits, path: &'a Path, library: &'a Library) -> Self {
        Self {
            files,
            path,
            directory: path.parent().unwrap_or(Path::new("")),
            library,
            converted: HashMap::new(),
            done: Vec::new(),
            textures: Vec::new(),
            images: Vec::new(),
            decoded: HashMap::new(),
            decoder: Decoder::new(limits),
        }
    }

    pub(super) fn get(&self, id: Id) -> &Material {
        &self.done[id]
    }

    pub(super) fn finish(self, scene: &mut Scene) {
        scene.materials = self.done;
        scene.textures = self.textures;
        scene.images = self.images;
    }

    /// Our index of the library's material of this name; the default one's where it has none.
    pub(super) fn id(&mut self, name: Option<&str>, warnings: &mut Warnings) -> Result<Id, SceneError> {
        let library = self.library;
        let source = name.and_then(|name| library.get(name));
        let key = source.map(|source| source.name.as_str());
        if let Some(&known) = self.converted.get(&key) {
            return Ok(known);
        }
        let material = match source {
            Some(source) => self.convert(source, warnings)?,
            None => Material {
                base_color: DEFAULT_DIFFUSE.extend(1.0),
                specular: 0.0,
                double_sided: true,
                ..Material::default()
            },
        };
        self.done.push(material);
        self.converted.insert(key, self.done.len() - 1);
        Ok(self.done.len() - 1)
    }

    fn convert(&mut self, source: &Source, warnings: &mut Warnings) -> Result<Material, SceneError> {
        let mut material = Material { name: source.name.clone(), double_sided: true, ..Material::default() };

        self.base_color(source, &mut material, warnings)?;
        let (kd, ks) = (material.base_color.truncate(), color(source.specular).unwrap_or(Vec3::ZERO));
        let ks = ks * energy_scale(kd, ks);
        match source.exponent {
            Some(exponent) if exponent > 0.0 && ks.max_element() > 0.0 => {
                material.reflection = Reflection::Phong { exponent };
                material.specular_color = ks;
                material.specular_color_texture = self.color_texture("map_Ks", source, warnings)?;
            }
            _ => material.specular = 0.0,
        }
        material.emissive_texture = self.color_texture("map_Ke", source, warnings)?;
        let ke = color(source.emissive).unwrap_or(Vec3::ZERO);
        let is_unset = ke == Vec3::ZERO && material.emissive_texture.is_some();
        material.emissive = if is_unset { Vec3::ONE } else { ke };

        if source.map("norm").is_some() {
            if let Some(found) = self.find("norm", source, warnings)? {
                material.normal_scale = found.0.bump;
                material.normal_texture = self.texture(&found, Use::NormalAsIs, warnings)?.map(|(t, _)| t);
            }
        } else if let Some(found) = self.find("bump", source, warnings)? {
            let as_normals = Use::Normal { strength: found.0.bump.to_bits(), clamp: found.0.clamp };
            material.normal_texture = self.texture(&found, as_normals, warnings)?.map(|(t, _)| t);
        }
        if matches!(source.illum, Some(4 | 6 | 7 | 9)) {
            glass(source, &mut material, warnings);
        }
        Ok(material)
    }

    /// Kd, map_Kd, d, Tr and map_d.
    fn base_color(
        &mut self,
        source: &Source,
        material: &mut Material,
        warnings: &mut Warnings,
    ) -> Result<(), SceneError> {
        let mask = self.find("map_d", source, warnings)?;
        let map = self.find("map_Kd", source, warnings)?;
        // Where both are one file, its alpha is meant, if it has one.
        let is_other = |mask: &&Found| map.as_ref().is_none_or(|map| map.1 != mask.1);
        let as_color = mask.as_ref().filter(is_other).map_or(Use::Color, |mask| Use::Masked(mask.1.clone()));
        let mut texture = match &map {
            Some(map) => self.texture(map, as_color, warnings)?,
            None => None,
        };
        let is_textured = texture.is_some();
        if let (false, Some(mask)) = (is_textured, &mask) {
            texture = self.texture(mask, Use::Dissolve, warnings)?;
        }
        let kd = color(source.diffuse).unwrap_or(if is_textured { Vec3::ONE } else { DEFAULT_DIFFUSE });
        let kd = if is_textured && kd == Vec3::ZERO { Vec3::ONE } else { kd };
        let dissolve = source.dissolve.unwrap_or(1.0).clamp(0.0, 1.0);
        material.base_color = kd.extend(dissolve);
        material.base_color_texture = texture.map(|(texture, _)| texture);
        material.alpha = match texture {
            _ if dissolve < 1.0 => AlphaMode::Blend,
            Some((_, true)) => AlphaMode::Mask { cutoff: 0.5 },
            _ => AlphaMode::Opaque,
        };
        Ok(())
    }

    fn color_texture(
        &mut self,
        keyword: &str,
        source: &Source,
        warnings: &mut Warnings,
    ) -> Result<Option<TextureRef>, SceneError> {
        let Some(found) = self.find(keyword, source, warnings)? else { return Ok(None) };
        Ok(self.texture(&found, Use::Color, warnings)?.map(|(texture, _)| texture))
    }

    /// A texture, and whether its alpha varies.
    fn texture(
        &mut self,
        (map, file): &Found,
        used_as: Use,
        warnings: &mut Warnings,
    ) -> Result<Option<(TextureRef, bool)>, SceneError> {
        let key = (file.clone(), used_as);
        let known = if let Some(&known) = self.decoded.get(&key) {
            known
        } else {
            let decoded = match self.decode(&key.0, &key.1) {
                Ok((image, has_alpha)) => {
                    self.images.push(image);
                    Some((self.images.len() - 1, has_alpha))
                }
                Err(problem) => {
                    let problem = format!("the texture {} cannot be read: {problem}", file.display());
                    warnings.stand_in(self.invalid("materials", problem), WITHOUT)?;
                    None
                }
            };
            self.decoded.insert(key, decoded);
            decoded
        };
        let Some((image, has_alpha)) = known else { return Ok(None) };
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        let texture = Texture { image, wrap: [wrap; 2], filter: Filter::Linear };
        let id = self.textures.iter().position(|known| *known == texture).unwrap_or_else(|| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        Ok(Some((TextureRef { uv_transform: map.uv_transform(), ..TextureRef::new(id) }, has_alpha)))
    }

    /// The map of a keyword if the material has it: its file is relative to the material library or else to the OBJ.
    fn find(
        &self,
        keyword: &str,
        source: &Source,
        warnings: &mut Warnings,
    ) -> Result<Option<Found>, SceneError> {
        let Some(text) = source.map(keyword) else { return Ok(None) };
        match map::find(self.files, [&source.directory, self.directory], text) {
            Ok(found) => Ok(Some(found)),
            Err(file) => {
                let problem = format!("the texture `{file}` was not found");
                let error = self.invalid(&format!("material `{}`", source.name), problem);
                warnings.stand_in(error, WITHOUT).map(|()| None)
            }
        }
    }

    fn invalid(&self, place: &str, problem: String) -> SceneError {
        SceneError::Invalid { path: self.path.to_owned(), place: place.to_owned(), problem }
    }

    /// An image, and whether its alpha varies; the error says what is wrong with it.
    fn decode(&mut self, file: &Path, used_as: &Use) -> Result<(ImageData, bool), String> {
        let files = self.files;
        let mut open = |file: &Path| -> Result<DynamicImage, String> {
            let bytes = source::read_file(files, file).map_err(|error| error.to_string())?;
            self.decoder.decode_dynamic(&bytes, &file.to_string_lossy())
        };
        let image = open(file)?;
        let pixels = match used_as {
            Use::Color | Use::NormalAsIs => image.into_rgba8(),
            Use::Dissolve => {
                let white = RgbaImage::from_pixel(image.width(), image.height(), image::Rgba([255; 4]));
                masked(white, &image)
            }
            Use::Masked(mask) => masked(image.into_rgba8(), &open(mask)?),
            Use::Normal { strength, clamp } => {
                let pixels = image.to_rgba8();
                if bump::is_normal_map(&pixels) {
                    pixels
                } else {
                    bump::normals_from_heights(&image, f32::from_bits(*strength), *clamp)
                }
            }
        };
        let is_normal = matches!(used_as, Use::Normal { .. } | Use::NormalAsIs);
        let has_alpha = !is_normal && pixels.pixels().any(|p| p[3] < 255);
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let (width, height) = pixels.dimensions();
        Ok((ImageData { name, width, height, rgba: pixels.into_raw() }, has_alpha))
    }
}

/// Makes a material glass whose `illum` asks for it and whose colours do not contradict.
fn glass(source: &Source, material: &mut Material, warnings: &mut Warnings) {
    let dissolve = material.base_color.w;
    let is_dark =
        source.map("map_Kd").is_none() && material.base_color.truncate().max_element() <= MAX_GLASS_DIFFUSE;
    if !is_dark && dissolve == 1.0 {
        warnings.add(format!(
            "material `{}`: its illum {} asks for glass, but its diffuse colour for an opaque surface, which it became",
            source.name,
            source.illum.unwrap_or_default()
        ));
        return;
    }
    material.transmission = if dissolve < 1.0 { 1.0 - dissolve } else { 1.0 };
    let filter = color(source.filter).filter(|filter| filter.max_element() > 0.0);
    let tint = filter.unwrap_or(if is_dark { Vec3::ONE } else { material.base_color.truncate() });
    material.base_color = tint.min(Vec3::ONE).extend(1.0);
    if matches!(material.alpha, AlphaMode::Blend) {
        material.alpha = AlphaMode::Opaque;
    }
    material.ior = source.ior.filter(|ior| *ior >= 1.0).unwrap_or(material.ior);
    let refracts = matches!(source.illum, Some(6 | 7)) && material.ior > 1.0;
    material.thickness = if refracts { SOLID_M } else { 0.0 };
    // The lobe of Ns, as a roughness: α² = 2 / (n + 2).
    let exponent = source.exponent.unwrap_or(0.0);
    material.roughness = if exponent > 0.0 { (2.0 / (exponent + 2.0)).sqrt().sqrt() } else { 0.0 };
    material.reflection = Reflection::MetallicRoughness;
    (material.specular, material.specular_color, material.specular_color_texture) = (1.0, Vec3::ONE, None);
}

fn color(rgb: Option<[f32; 3]>) -> Option<Vec3> {
    rgb.map(|rgb| Vec3::from(rgb).max(Vec3::ZERO))
}

/// The largest factor up to 1 for Ks that keeps Kd + Ks ≤ 1 in every channel.
fn energy_scale(kd: Vec3, ks: Vec3) -> f32 {
    let channels = kd.to_array().into_iter().zip(ks.to_array()).filter(|(_, ks)| *ks > 0.0);
    channels.map(|(kd, ks)| (1.0 - kd).max(0.0) / ks).fold(1.0, f32::min)
}

/// `image` with the dissolve map's alpha, or its brightness where it has none, as alpha.
fn masked(mut image: RgbaImage, mask: &DynamicImage) -> RgbaImage {
    let mask = if (mask.width(), mask.height()) == image.dimensions() {
        mask.clone()
    } else {
        mask.resize_exact(image.width(), image.height(), imageops::FilterType::Triangle)
    };
    let alpha = mask.color().has_alpha().then(|| mask.to_rgba8());
    let alpha = alpha.filter(|mask| mask.pixels().any(|p| p[3] < 255));
    let luma = mask.to_luma8();
    for (x, y, texel) in image.enumerate_pixels_mut() {
        texel[3] = alpha.as_ref().map_or(luma.get_pixel(x, y)[0], |alpha| alpha.get_pixel(x, y)[3]);
    }
    image
}
