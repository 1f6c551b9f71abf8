//! OpenEXR in and out.
//!
//! A file may hold more than the picture: chiaro reads R, G and B from the first part that has them, and whatever
//! other channels (variance, sample counts…) stand beside them do no harm; [`crate::read_layers`] reads those.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, Layer, LineOrder, MetaData,
    ReadChannels, ReadLayers, SmallVec, SpecificChannels, Vec2, WritableImage, f16,
};

use crate::file::write_bytes;
use crate::linear::MAX_PIXELS;
use crate::{Image, ImageError};

/// How many bits an EXR spends on a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// 16 bits: 11 significant bits, up to 65,504. For pictures.
    Half,
    /// 32 bits: exactly what the image holds. For references and data such as depth.
    #[default]
    Float,
}

/// Increasing lines are the one order in which parallel compression still gives the same file every time.
pub(crate) const ENCODING: Encoding = Encoding {
    compression: Compression::ZIP16,
    blocks: Blocks::ScanLines,
    line_order: LineOrder::Increasing,
};

/// Writes R, G and B as an EXR of losslessly compressed (ZIP) scan lines; missing folders of `path` are made. The
/// same image gives the same bytes.
///
/// # Errors
/// [`ImageError::Write`] when the operating system refuses; [`ImageError::Unstorable`] for an image without pixels,
/// or a finite value that [`Precision::Half`] would turn into infinity.
pub fn write_exr(path: impl AsRef<Path>, image: &Image, precision: Precision) -> Result<(), ImageError> {
    let path = path.as_ref();
    let unstorable = |problem: String, advice: &str| ImageError::Unstorable {
        path: path.to_owned(),
        problem,
        advice: advice.to_owned(),
    };
    if image.pixels().is_empty() {
        return Err(unstorable("the image is empty".to_owned(), "an EXR needs at least one pixel"));
    }
    let size = Vec2(image.width() as usize, image.height() as usize);
    let pixel = |position: Vec2<usize>| image.pixels()[position.flat_index_for_size(size)];
    let mut encoded = Cursor::new(Vec::new());
    let written = match precision {
        Precision::Float => {
            let channels = SpecificChannels::rgb(|position| <(f32, f32, f32)>::from(pixel(position)));
            ExrImage::from_encoded_channels(size, ENCODING, channels).write().to_buffered(&mut encoded)
        }
        Precision::Half => {
            refuse_half_overflow(path, image)?;
            let channels =
                SpecificChannels::rgb(|position| <(f16, f16, f16)>::from(pixel(position).map(f16::from_f32)));
            ExrImage::from_encoded_channels(size, ENCODING, channels).write().to_buffered(&mut encoded)
        }
    };
    written.map_err(|error| unstorable(error.to_string(), "this is a defect of chiaro: please report it"))?;
    write_bytes(path, &encoded.into_inner())
}

fn refuse_half_overflow(path: &Path, image: &Image) -> Result<(), ImageError> {
    let overflows = |value: &f32| value.is_finite() && f16::from_f32(*value).is_infinite();
    let found = image.pixels().iter().enumerate().find_map(|(index, pixel)| {
        pixel.iter().find(|value| overflows(value)).map(|value| (index as u32, value))
    });
    found.map_or(Ok(()), |(index, value)| {
        Err(ImageError::Unstorable {
            path: path.to_owned(),
            problem: format!(
                "pixel ({}, {}) holds {value}, beyond the 65504 of a half float",
                index % image.width(),
                index / image.width()
            ),
            advice: "write it with 32-bit floats".to_owned(),
        })
    })
}

/// An EXR file with all its parts, channels and attributes.
pub(crate) type Decoded = ExrImage<SmallVec<[Layer<AnyChannels<FlatSamples>>; 2]>>;

/// Decodes the bytes of an EXR file's picture; `path` is for messages.
pub(crate) fn decode(path: &Path, bytes: &[u8]) -> Result<Image, ImageError> {
    let file = decode_all(path, bytes)?;
    file.layer_data.iter().find_map(rgb_of_layer).unwrap_or_else(|| {
        let names: Vec<String> = file
            .layer_data
            .iter()
            .flat_map(|layer| layer.channel_data.list.iter().map(|channel| channel.name.to_string()))
            .collect();
        Err(ImageError::Invalid {
            path: path.to_owned(),
            problem: format!("no channels R, G and B (or Y); there are: {}", names.join(", ")),
            advice: "rename the channels that hold the picture".to_owned(),
        })
    })
}

/// Decodes everything in the bytes of an EXR file.
pub(crate) fn decode_all(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    let invalid = |problem: String, advice: &str| ImageError::Invalid {
        path: path.to_owned(),
        problem,
        advice: advice.to_owned(),
    };
    let undecodable = |error: exr::error::Error| {
        invalid(
            format!("not a readable EXR: {error}"),
            "the file is damaged, or of a kind that chiaro does not read (deep or subsampled): write it again",
        )
    };
    // The header is checked before the decoder allocates what it promises.
    let meta = MetaData::read_from_buffered(bytes, false).map_err(undecodable)?;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        if width as u64 * height as u64 > MAX_PIXELS {
            let problem = format!("{width}×{height} pixels, more than the {MAX_PIXELS} that chiaro reads");
            return Err(invalid(problem, "crop it, or check whether the file is damaged"));
        }
    }
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(undecodable)
}

/// The layer's colour, if it has channels R, G and B, or Y.
fn rgb_of_layer(layer: &Layer<AnyChannels<FlatSamples>>) -> Option<Result<Image, ImageError>> {
    let named = |name: &str| layer.channel_data.list.iter().find(|channel| channel.name == *name);
    let grey = || named("Y").map(|y| [y, y, y]);
    let channels = match (named("R"), named("G"), named("B")) {
        (Some(r), Some(g), Some(b)) => [r, g, b],
        _ => grey()?,
    };
    let [red, green, blue] = channels.map(|channel| channel.sample_data.values_as_f32());
    let pixels = red.zip(green).zip(blue).map(|((r, g), b)| [r, g, b]).collect();
    Some(Image::from_pixels(layer.size.width() as u32, layer.size.height() as u32, pixels))
}
