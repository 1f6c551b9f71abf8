//! Bytes from files and URIs, pixels from bytes.

use std::io::Cursor;
use std::path::{Component, Path, PathBuf};

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};

use super::files::Files;
use super::limits::Limits;
use crate::{ImageData, SceneError};

/// Longest side of an image in pixels: the largest 2D texture that today's GPUs take.
const MAX_IMAGE_SIDE: u32 = 16_384;

/// The scene's name: the file's stem.
pub(super) fn scene_name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The whole content of a file.
pub(super) fn read_file(files: &dyn Files, path: &Path) -> Result<Vec<u8>, SceneError> {
    files.read(path).map_err(|source| SceneError::Read { path: path.to_owned(), source })
}

/// What a URI in a scene file refers to.
pub(super) enum Resource {
    /// `data:` – the bytes themselves.
    Data(Vec<u8>),
    /// A file, relative to the scene file.
    File(PathBuf),
}

impl Resource {
    /// Resolves `uri` as found at `place` in the scene file `scene`.
    pub(super) fn resolve(
        files: &dyn Files,
        scene: &Path,
        uri: &str,
        place: &str,
    ) -> Result<Self, SceneError> {
        let invalid = |problem: String| SceneError::Invalid {
            path: scene.to_owned(),
            place: place.to_owned(),
            problem,
        };
        if uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:")) {
            let url =
                data_url::DataUrl::process(uri).map_err(|e| invalid(format!("not a data URI: {e:?}")))?;
            let (bytes, _) = url.decode_to_vec().map_err(|e| invalid(format!("not valid base64: {e:?}")))?;
            return Ok(Self::Data(bytes));
        }
        if has_scheme(uri) {
            return Err(SceneError::Unsupported {
                path: scene.to_owned(),
                feature: format!("the URI `{uri}` at {place}"),
                advice: "refer to files by a path relative to the scene file, or embed them".to_owned(),
            });
        }
        let decoded = percent_encoding::percent_decode_str(uri)
            .decode_utf8()
            .map_err(|_| invalid(format!("`{uri}` does not decode to UTF-8")))?;
        if decoded.is_empty() || decoded.contains('\0') {
            return Err(invalid("the URI is empty or contains a zero byte".to_owned()));
        }
        let directory = scene.parent().unwrap_or(Path::new(""));
        // Exporters that forget to percent-encode write names with a literal percent sign.
        if let Some(found) = [&*decoded, uri].iter().find_map(|name| find_file(files, directory, name)) {
            return Ok(Self::File(found));
        }
        let relative = Path::new(&*decoded);
        let is_absolute =
            relative.components().any(|c| matches!(c, Component::RootDir | Component::Prefix(_)));
        if is_absolute || has_drive(&decoded) {
            return Err(invalid(format!(
                "`{decoded}` is an absolute path; it must be relative to the scene file"
            )));
        }
        Ok(Self::File(directory.join(relative)))
    }

    /// The bytes, read now if they are in a file.
    pub(super) fn into_bytes(self, files: &dyn Files) -> Result<Vec<u8>, SceneError> {
        match self {
            Self::Data(bytes) => Ok(bytes),
            Self::File(path) => read_file(files, &path),
        }
    }
}

/// Finds the file `name` below `directory`: as it is, or else as any system writes it, with backslashes, in the wrong
/// case, or by a path that made sense on the author's machine only, of which the last part is tried.
pub(super) fn find_file(files: &dyn Files, directory: &Path, name: &str) -> Option<PathBuf> {
    find_as_named(files, directory, name).or_else(|| {
        let name = name.replace('\\', "/");
        find_as_named(files, directory, Path::new(&name).file_name()?.to_str()?)
    })
}

/// The same without the last resort.
pub(super) fn find_as_named(files: &dyn Files, directory: &Path, name: &str) -> Option<PathBuf> {
    if name.is_empty() || name.contains('\0') {
        return None;
    }
    let is_relative = |path: &Path| path.is_relative() && !has_drive(name);
    let exact = directory.join(name);
    if is_relative(Path::new(name)) && files.exists(&exact) {
        return Some(exact);
    }
    let name = name.replace('\\', "/");
    let relative = Path::new(&name);
    is_relative(relative).then(|| files.find(directory, relative)).flatten()
}

/// Whether a path starts with a drive's letter, as `C:/a.png`.
fn has_drive(path: &str) -> bool {
    matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic())
}

/// Whether `uri` starts with a scheme (RFC 3986, section 3.1) such as `https:`; a single letter is a drive.
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.len() > 1
            && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Decodes images to RGBA8 within a budget for the whole scene.
#[derive(Debug)]
pub(super) struct Decoder {
    max_pixels: usize,
    pixels_left: usize,
    is_exhausted: bool,
}

impl Decoder {
    pub(super) fn new(limits: &Limits) -> Self {
        Self { max_pixels: limits.pixels, pixels_left: limits.pixels, is_exhausted: false }
    }

    /// Whether an image did not fit into the budget, however well it is.
    pub(super) fn is_exhausted(&self) -> bool {
        self.is_exhausted
    }

    /// Decodes `bytes`; `name` is for messages, and its extension helps with formats without a signature (TGA).
    /// The error says what is wrong with the image.
    pub(super) fn decode(&mut self, bytes: &[u8], name: &str) -> Result<ImageData, String> {
        let pixels = self.decode_dynamic(bytes, name)?.into_rgba8();
        let (width, height) = pixels.dimensions();
        Ok(ImageData { name: name.to_owned(), width, height, rgba: pixels.into_raw() })
    }

    /// Like [`Self::decode`], in the image's own format.
    pub(super) fn decode_dynamic(&mut self, bytes: &[u8], name: &str) -> Result<DynamicImage, String> {
        let mut reader =
            ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
        if reader.format().is_none() {
            let format =
                ImageFormat::from_path(name).map_err(|_| "not an image of a known format".to_owned())?;
            reader.set_format(format);
        }
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(MAX_IMAGE_SIDE);
        limits.max_image_height = Some(MAX_IMAGE_SIDE);
        // Sixteen bits and four channels of the largest image, and as much again for the decoder.
        limits.max_alloc = Some(16 * u64::from(MAX_IMAGE_SIDE).pow(2));
        reader.limits(limits);
        let decoder = reader.into_decoder().map_err(|e| e.to_string())?;
        let (width, height) = decoder.dimensions();
        let pixels = width as usize * height as usize;
        if pixels == 0 {
            return Err("the image has no pixels".to_owned());
        }
        let Some(left) = self.pixels_left.checked_sub(pixels) else {
            self.is_exhausted = true;
            return Err(format!("the scene's images have more than {} pixels together", self.max_pixels));
        };
        self.pixels_left = left;
        DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())
    }
}
