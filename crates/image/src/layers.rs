//! EXR files that hold more than a picture: channels by name, and what the file tells of itself.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::fs;
use std::io::{BufReader, Cursor};
use std::path::Path;

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, FlatSamples, Image as ExrImage, IntegerBounds, Layer, LayerAttributes, SmallVec,
    Vec2, WritableImage,
};

use crate::exr_file::{ENCODING, decode_all, decode_header, is_whole};
use crate::write::write_bytes;
use crate::{Image, ImageError};

/// The one attribute of the EXR header that holds all of [`Layers::about`], a line each: several would stand in the
/// file in an order that changes from run to run.
const ABOUT: &str = "chiaro";

/// Channels of one size by name, 32-bit floats or whole numbers, and text about them.
///
/// R, G and B are the picture. Names with a dot are a layer's channels, as other programs show them: `variance.R`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    width: u32,
    height: u32,
    is_part: bool,
    channels: BTreeMap<String, Vec<f32>>,
    words: BTreeMap<String, Vec<u32>>,
    /// Lines of text by key, such as (`seed`, `7`). A key has no colon; line breaks become spaces in the file.
    pub about: BTreeMap<String, String>,
}

impl Layers {
    /// No channels.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, ..Self::default() }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Whether the file showed another picture than the pixels that it held: a crop, or one with a margin.
    pub fn is_part(&self) -> bool {
        self.is_part
    }

    /// Names of all channels, those of floats first, each in alphabetical order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.channels.keys().chain(self.words.keys()).map(String::as_str)
    }

    /// One channel's values, row after row from the top left.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.get(name).map(Vec::as_slice)
    }

    /// One channel's whole numbers, in the same order.
    pub fn words(&self, name: &str) -> Option<&[u32]> {
        self.words.get(name).map(Vec::as_slice)
    }

    /// Adds a channel of whole numbers, or replaces it; files hold them exactly.
    ///
    /// # Errors
    /// As [`Layers::insert`].
    pub fn insert_words(&mut self, name: impl Into<String>, values: Vec<u32>) -> Result<(), ImageError> {
        self.check(values.len())?;
        self.words.insert(name.into(), values);
        Ok(())
    }

    fn check(&self, found: usize) -> Result<(), ImageError> {
        let (width, height) = self.size();
        let expected = width as usize * height as usize;
        if found != expected {
            return Err(ImageError::BufferLength { what: "the channel", width, height, expected, found });
        }
        Ok(())
    }

    /// Adds a channel, or replaces it.
    ///
    /// # Errors
    /// [`ImageError::BufferLength`] unless there is one value per pixel.
    pub fn insert(&mut self, name: impl Into<String>, values: Vec<f32>) -> Result<(), ImageError> {
        self.check(values.len())?;
        self.channels.insert(name.into(), values);
        Ok(())
    }

    /// Adds an image as the channels R, G and B of a layer; of none where the name is empty.
    ///
    /// # Errors
    /// As [`Layers::insert`].
    pub fn insert_image(&mut self, layer: &str, image: &Image) -> Result<(), ImageError> {
        for (index, channel) in ["R", "G", "B"].into_iter().enumerate() {
            let values = image.pixels().iter().map(|pixel| pixel[index]).collect();
            self.insert(named(layer, channel), values)?;
        }
        Ok(())
    }

    /// Adds texels of four floats as the channels R, G, B and A of a layer.
    ///
    /// # Errors
    /// As [`Layers::insert`].
    pub fn insert_texels(&mut self, layer: &str, texels: &[f32]) -> Result<(), ImageError> {
        for (index, channel) in ["R", "G", "B", "A"].into_iter().enumerate() {
            self.insert(named(layer, channel), texels.iter().skip(index).step_by(4).copied().collect())?;
        }
        Ok(())
    }

    /// What [`Layers::insert_texels`] took, if all four channels are there.
    pub fn texels(&self, layer: &str) -> Option<Vec<f32>> {
        let [r, g, b, a] = ["R", "G", "B", "A"].map(|channel| self.channel(&named(layer, channel)));
        let texels = r?.iter().zip(g?).zip(b?).zip(a?);
        Some(texels.flat_map(|(((r, g), b), a)| [*r, *g, *b, *a]).collect())
    }
}

fn named(layer: &str, channel: &str) -> String {
    if layer.is_empty() { channel.to_owned() } else { format!("{layer}.{channel}") }
}

/// Writes an EXR of 32-bit floats and whole numbers in losslessly compressed (ZIP) scan lines, whole or not at all; missing folders of
/// `path` are made. The same layers give the same bytes.
///
/// # Errors
/// [`ImageError::Write`] when the operating system refuses; [`ImageError::Unstorable`] without pixels or channels.
pub fn write_layers(path: impl AsRef<Path>, layers: &Layers) -> Result<(), ImageError> {
    let path = path.as_ref();
    let unstorable = |problem: String, advice: &str| ImageError::Unstorable {
        path: path.to_owned(),
        problem,
        advice: advice.to_owned(),
    };
    if layers.width == 0 || layers.height == 0 || layers.names().next().is_none() {
        return Err(unstorable("the image is empty".to_owned(), "an EXR needs a channel and a pixel"));
    }
    let floats = layers.channels.iter().map(|(name, values)| (name, FlatSamples::F32(values.clone())));
    let words = layers.words.iter().map(|(name, values)| (name, FlatSamples::U32(values.clone())));
    let channels: SmallVec<[_; 4]> =
        floats.chain(words).map(|(name, samples)| AnyChannel::new(utf8(name), samples)).collect();
    let mut about = String::new();
    for (key, value) in &layers.about {
        // Writing to a string does not fail.
        let _ = writeln!(about, "{key}: {}", value.replace(['\r', '\n'], " "));
    }
    let mut attributes = LayerAttributes::default();
    if !about.is_empty() {
        attributes.other.insert(utf8(ABOUT), AttributeValue::Text(utf8(&about)));
    }
    let size = Vec2(layers.width as usize, layers.height as usize);
    let layer = Layer::new(size, attributes, ENCODING, AnyChannels::sort(channels));
    let mut encoded = Cursor::new(Vec::new());
    ExrImage::from_layer(layer)
        .write()
        .to_buffered(&mut encoded)
        .map_err(|error| unstorable(error.to_string(), "this is a defect of chiaro: please report it"))?;
    write_bytes(path, &encoded.into_inner())
}

/// Reads all channels of the first part of an EXR, and what chiaro wrote about them; of a crop the pixels that it holds.
///
/// # Errors
/// [`ImageError::Read`] when the file cannot be opened, [`ImageError::Invalid`] when it is no EXR or damaged.
pub fn read_layers(path: impl AsRef<Path>) -> Result<Layers, ImageError> {
    let path = path.as_ref();
    let bytes = fs::read(path).map_err(|source| ImageError::Read { path: path.to_owned(), source })?;
    let file = decode_all(path, &bytes)?;
    let mut layers = Layers::default();
    let is_part = file.layer_data.first().is_some_and(|layer| !is_whole(&file, layer));
    let Some(layer) = file.layer_data.into_iter().next() else { return Ok(layers) };
    layers.is_part = is_part;
    (layers.width, layers.height) = (layer.size.width() as u32, layer.size.height() as u32);
    for channel in layer.channel_data.list {
        let name = channel.name.to_string();
        match channel.sample_data {
            FlatSamples::U32(values) => layers.insert_words(name, values)?,
            samples => layers.insert(name, samples.values_as_f32().collect())?,
        }
    }
    layers.about = about_in(&layer.attributes.other, &file.attributes.other);
    Ok(layers)
}

/// The same without any channel, from the beginning of the file alone.
///
/// # Errors
/// As [`read_layers`].
pub fn read_about(path: impl AsRef<Path>) -> Result<Layers, ImageError> {
    let path = path.as_ref();
    let read = |source| ImageError::Read { path: path.to_owned(), source };
    let meta = decode_header(path, BufReader::new(fs::File::open(path).map_err(read)?))?;
    let mut layers = Layers::default();
    let Some(header) = meta.headers.first() else { return Ok(layers) };
    let Vec2(width, height) = header.layer_size;
    (layers.width, layers.height) = (width as u32, height as u32);
    let bounds = IntegerBounds::new(header.own_attributes.layer_position, header.layer_size);
    layers.is_part = bounds != header.shared_attributes.display_window;
    layers.about = about_in(&header.own_attributes.other, &header.shared_attributes.other);
    Ok(layers)
}

/// What stands in the attributes of a layer, or in those of its file.
fn about_in(
    layer: &HashMap<Text, AttributeValue>,
    file: &HashMap<Text, AttributeValue>,
) -> BTreeMap<String, String> {
    let found = layer.get(&utf8(ABOUT)).or_else(|| file.get(&utf8(ABOUT)));
    let Some(AttributeValue::Text(text)) = found else { return BTreeMap::new() };
    // The library's own way to a string takes bytes for Latin-1.
    let text = String::from_utf8_lossy(text.as_slice());
    let lines = text.lines().filter_map(|line| line.split_once(": "));
    lines.map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
}

/// Text as UTF-8, which is what EXR files hold in practice; the library's own way panics beyond Latin-1.
fn utf8(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}
