//! Textures and images; those that a material uses.

use std::collections::HashMap;

use ::gltf::json::{Value, deserialize, extensions};
use ::gltf::texture::{MagFilter, WrappingMode};
use glam::{Affine2, Vec2};

use super::super::source::{Decoder, Resource};
use super::super::warnings::Warnings;
use super::buffers::Buffers;
use super::file::File;
use crate::{Filter, Id, ImageData, Scene, SceneError, Texture, TextureRef, Wrap};

/// What a texture that is not there leaves.
const WITHOUT: &str =
    "the materials' factors stand in, without the glow or metal that the texture was to place";

/// KHR_texture_transform.
#[derive(Clone, Copy, Debug)]
pub(super) struct Transform {
    pub(super) offset: [f32; 2],
    pub(super) rotation: f32,
    pub(super) scale: [f32; 2],
    pub(super) tex_coord: Option<u32>,
}

impl Transform {
    pub(super) fn from_json(value: &Value) -> Result<Self, ::gltf::json::Error> {
        let json: extensions::texture::TextureTransform = deserialize::from_value(value.clone())?;
        let (offset, rotation, scale) = (json.offset.0, json.rotation.0, json.scale.0);
        Ok(Self { offset, rotation, scale, tex_coord: json.tex_coord })
    }

    /// Scale, then rotation, then translation. The rotation is counter-clockwise to the eye; as v points down, that
    /// is a negative angle in the plane of (u, v).
    fn affine(&self) -> Affine2 {
        Affine2::from_scale_angle_translation(Vec2::from(self.scale), -self.rotation, Vec2::from(self.offset))
    }
}

/// Which of the file's sets of texture coordinates a material uses as its first and its second.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UvSets([Option<u32>; 2]);

impl UvSets {
    /// Where the file's TEXCOORD_`set` goes: 0 and 1 to their own places if those are free, any other to a free one.
    fn slot(&mut self, set: u32) -> Option<usize> {
        let known = self.0.iter().position(|known| *known == Some(set));
        let own = (0..2).find(|&slot| slot as u32 == set && self.0[slot].is_none());
        let slot = known.or(own).or_else(|| self.0.iter().position(Option::is_none))?;
        self.0[slot] = Some(set);
        Some(slot)
    }

    /// The file's sets; where the material uses none, that of the place's number.
    pub(super) fn sets(self) -> [u32; 2] {
        [self.0[0].unwrap_or(0), self.0[1].unwrap_or(1)]
    }
}

/// The textures and images of one file.
pub(super) struct Textures<'a> {
    file: File<'a>,
    buffers: &'a Buffers,
    decoder: Decoder,
    done: Vec<Texture>,
    images: Vec<ImageData>,
    /// Our index by the file's; `None` where the file gives no image that chiaro could read.
    converted: HashMap<usize, Option<Id>>,
    /// The same for images, `None` for one that is missing or broken.
    decoded: HashMap<usize, Option<Id>>,
}

impl<'a> Textures<'a> {
    pub(super) fn new(file: File<'a>, buffers: &'a Buffers) -> Self {
        Self {
            file,
            buffers,
            decoder: Decoder::new(file.limits),
            done: Vec::new(),
            images: Vec::new(),
            converted: HashMap::new(),
            decoded: HashMap::new(),
        }
    }

    pub(super) fn finish(self, scene: &mut Scene) {
        scene.textures = self.done;
        scene.images = self.images;
    }

    /// A material's use, at `place`, of the file's texture `index`.
    pub(super) fn reference(
        &mut self,
        index: usize,
        tex_coord: u32,
        transform: Option<Transform>,
        uv_sets: &mut UvSets,
        place: &str,
        warnings: &mut Warnings,
    ) -> Result<Option<TextureRef>, SceneError> {
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(tex_coord);
        let Some(uv_set) = uv_sets.slot(set) else {
            warnings.add(format!(
                "{place} was left out: it uses TEXCOORD_{set}, the material's third set of coordinates"
            ));
            return Ok(None);
        };
        let uv_transform = transform.map_or(Affine2::IDENTITY, |t| t.affine());
        if !uv_transform.is_finite() {
            return Err(self.file.invalid(place, "its KHR_texture_transform is not finite"));
        }
        let texture = if let Some(&known) = self.converted.get(&index) {
            known
        } else {
            let texture = self.convert(index, warnings)?;
            self.converted.insert(index, texture);
            texture
        };
        Ok(texture.map(|texture| TextureRef { texture, uv_set, uv_transform }))
    }

    fn convert(&mut self, index: usize, warnings: &mut Warnings) -> Result<Option<Id>, SceneError> {
        let json = self.file.document.as_json();
        // The crate validated the index itself; a texture without a source is legal, though only an extension makes
        // sense of it.
        let source = json.textures[index].source.value();
        if source >= json.images.len() {
            warnings.add(format!(
                "textures[{index}] was left out: its image is in an extension that is not supported"
            ));
            return Ok(None);
        }
        let known = if let Some(&known) = self.decoded.get(&source) {
            known
        } else {
            let image = match self.decode(source) {
                Ok(image) => {
                    self.images.push(image);
                    Some(self.images.len() - 1)
                }
                // A limit is no fault of the image.
                Err(error) if self.decoder.is_exhausted() => return Err(error),
                Err(error) => {
                    warnings.stand_in(error, WITHOUT)?;
                    None
                }
            };
            self.decoded.insert(source, image);
            image
        };
        let Some(image) = known else { return Ok(None) };
        let sampler = self.file.document.textures().nth(index).map(|texture| texture.sampler());
        let wrap = |mode| match mode {
            WrappingMode::ClampToEdge => Wrap::Clamp,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::Repeat => Wrap::Repeat,
        };
        self.done.push(Texture {
            image,
            wrap: sampler.as_ref().map_or_else(Default::default, |s| [wrap(s.wrap_s()), wrap(s.wrap_t())]),
            filter: match sampler.and_then(|s| s.mag_filter()) {
                Some(MagFilter::Nearest) => Filter::Nearest,
                Some(MagFilter::Linear) | None => Filter::Linear,
            },
        });
        Ok(Some(self.done.len() - 1))
    }

    fn decode(&mut self, index: usize) -> Result<ImageData, SceneError> {
        let place = format!("images[{index}]");
        // The JSON itself: the crate's accessor insists on a media type, which decoding does not need.
        let image = &self.file.document.as_json().images[index];
        let (name, bytes) = if let Some(view) = image.buffer_view {
            let view = self.file.document.views().nth(view.value());
            let bytes = view.and_then(|view| self.buffers.view(&view));
            let bytes = bytes.ok_or_else(|| {
                self.file.invalid(&*place, "its buffer view reaches past the end of its buffer")
            })?;
            (image.name.clone().unwrap_or_else(|| place.clone()), bytes.to_vec())
        } else if let Some(uri) = &image.uri {
            let resource = Resource::resolve(self.file.files, self.file.path, uri, &place)?;
            let name = match &resource {
                Resource::File(path) => path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
                Resource::Data(_) => image.name.clone().unwrap_or_else(|| place.clone()),
            };
            (name, resource.into_bytes(self.file.files)?)
        } else {
            return Err(self.file.invalid(place, "it has neither a URI nor a buffer view"));
        };
        self.decoder
            .decode(&bytes, &name)
            .map_err(|problem| self.file.invalid(format!("{place} ({name})"), problem))
    }
}
