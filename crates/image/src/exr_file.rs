//! OpenEXR in and out.
//!
//! A file may hold more than the picture: chiaro reads R, G and B from the first part that has them, and whatever
//! other channels (variance, sample counts…) stand beside them do no harm; [`crate::read_layers`] reads those. It may
//! hold less, too: its data window is what it holds, its display window what it is a picture of.

use std::io::{BufRead, Cursor};
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image as ExrImage, IntegerBounds,
    Layer, LineOrder, MetaData, ReadChannels, ReadLayers, SmallVec, SpecificChannels, Vec2, WritableImage,
    f16,
};

use crate::linear::MAX_PIXELS;
use crate::write::write_bytes;
use crate::{Image, ImageError, Region};

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
    let colours = Colours::of(&file);
    let found = file.layer_data.iter().find_map(|layer| Some((layer, colours.of_layer(layer)?)));
    let Some((layer, pixels)) = found else {
        let names: Vec<String> = file
            .layer_data
            .iter()
            .flat_map(|layer| layer.channel_data.list.iter().map(|channel| channel.name.to_string()))
            .collect();
        return Err(ImageError::Invalid {
            path: path.to_owned(),
            problem: format!(
                "no channels R, G and B (or Y, or Y, RY and BY); there are: {}",
                names.join(", ")
            ),
            advice: "rename the channels that hold the picture".to_owned(),
        });
    };
    shown(&file, layer, pixels).map_err(|problem| ImageError::Invalid {
        path: path.to_owned(),
        problem,
        advice: "crop its display window, or check whether the file is damaged".to_owned(),
    })
}

/// Whether a part holds all of the picture that the file shows, and no more.
pub(crate) fn is_whole(file: &Decoded, layer: &Layer<AnyChannels<FlatSamples>>) -> bool {
    layer.absolute_bounds() == file.attributes.display_window
}

/// Pixels that a picture may have for each one that the file holds, and without any question: a few bytes are not to
/// ask for all memory.
const MAX_BLANK: u64 = 256;
const FREE_BLANK: u64 = 1 << 24;

/// What a file's display window shows of the pixels in its data window.
fn shown(
    file: &Decoded,
    layer: &Layer<AnyChannels<FlatSamples>>,
    pixels: Vec<[f32; 3]>,
) -> Result<Image, String> {
    let (data, display) = (layer.absolute_bounds(), file.attributes.display_window);
    let area = |window: &IntegerBounds| window.size.width() as u64 * window.size.height() as u64;
    if area(&display) > MAX_PIXELS.min(FREE_BLANK.max(MAX_BLANK * area(&data))) {
        return Err(format!(
            "its display window has {}×{} pixels, of which its data window holds {}×{} at most",
            display.size.width(),
            display.size.height(),
            data.size.width(),
            data.size.height()
        ));
    }
    // First column or row of the picture, that of the data, and how many are in both. Windows reach to ±2³⁰ at most.
    let span = |data_at: i32, data_size: usize, at: i32, size: usize| {
        let offset = i64::from(data_at) - i64::from(at);
        let (start, end) = (offset.max(0), (offset + data_size as i64).min(size as i64));
        (end > start).then_some((start as u32, (start - offset) as usize, (end - start) as u32))
    };
    let x = span(data.position.x(), data.size.width(), display.position.x(), display.size.width());
    let y = span(data.position.y(), data.size.height(), display.position.y(), display.size.height());
    let Some(((x, skip_x, width), (y, skip_y, height))) = x.zip(y) else {
        return Err("its data window lies outside its display window, so that it shows nothing".to_owned());
    };
    let seen = if (width as usize, height as usize) == (data.size.width(), data.size.height()) {
        pixels
    } else {
        let rows = pixels.chunks_exact(data.size.width()).skip(skip_y).take(height as usize);
        rows.flat_map(|row| &row[skip_x..skip_x + width as usize]).copied().collect()
    };
    let size = (display.size.width() as u32, display.size.height() as u32);
    let origin = [display.position.x(), display.position.y()];
    Ok(Image::part(size, origin, Region { start: [x, y], size: [width, height] }, seen))
}

/// Decodes everything in the bytes of an EXR file.
pub(crate) fn decode_all(path: &Path, bytes: &[u8]) -> Result<Decoded, ImageError> {
    // The header is checked before the decoder allocates what it promises.
    decode_header(path, bytes)?;
    exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|error| undecodable(path, &error))
}

/// Decodes what stands before the pixels of an EXR file.
pub(crate) fn decode_header(path: &Path, source: impl BufRead) -> Result<MetaData, ImageError> {
    let meta = MetaData::read_from_buffered(source, false).map_err(|error| undecodable(path, &error))?;
    for header in &meta.headers {
        let Vec2(width, height) = header.layer_size;
        if width as u64 * height as u64 > MAX_PIXELS {
            let problem = format!("{width}×{height} pixels, more than the {MAX_PIXELS} that chiaro reads");
            return Err(invalid(path, problem, "crop it, or check whether the file is damaged"));
        }
    }
    Ok(meta)
}

fn invalid(path: &Path, problem: String, advice: &str) -> ImageError {
    ImageError::Invalid { path: path.to_owned(), problem, advice: advice.to_owned() }
}

fn undecodable(path: &Path, error: &exr::error::Error) -> ImageError {
    let problem = error.to_string();
    if problem.contains("sampling") {
        let few = format!(
            "it has channels of fewer pixels than the picture ({problem}), as luminance-chroma files do"
        );
        return invalid(path, few, "write it again with the channels R, G and B");
    }
    invalid(
        path,
        format!("not a readable EXR: {problem}"),
        "the file is damaged, or of a kind that chiaro does not read (deep): write it again",
    )
}

/// How a file's channels become colours.
struct Colours {
    /// Luminance of red, green and blue, with the sum 1.
    weights: [f32; 3],
}

/// Luminance of Rec. 709's primaries.
const REC_709: [f32; 3] = [0.2126, 0.7152, 0.0722];

impl Colours {
    fn of(file: &Decoded) -> Self {
        let primaries =
            file.attributes.chromaticities.and_then(|c| luminance([c.red, c.green, c.blue], c.white));
        Self { weights: primaries.unwrap_or(REC_709) }
    }

    /// The layer's pixels, if it has channels R, G and B, or Y alone or with RY and BY.
    fn of_layer(&self, layer: &Layer<AnyChannels<FlatSamples>>) -> Option<Vec<[f32; 3]>> {
        let named = |name: &str| layer.channel_data.list.iter().find(|channel| channel.name == *name);
        if let (Some(r), Some(g), Some(b)) = (named("R"), named("G"), named("B")) {
            return Some(zipped([r, g, b]).collect());
        }
        let y = named("Y")?;
        match (named("RY"), named("BY")) {
            (None, None) => Some(zipped([y; 3]).collect()),
            (Some(ry), Some(by)) => Some(zipped([y, ry, by]).map(|ycc| self.rgb(ycc)).collect()),
            _ => None,
        }
    }

    /// From luminance Y and the chroma (R − Y) / Y and (B − Y) / Y.
    fn rgb(&self, [y, ry, by]: [f32; 3]) -> [f32; 3] {
        let (r, b) = ((ry + 1.0) * y, (by + 1.0) * y);
        [r, (y - self.weights[0] * r - self.weights[2] * b) / self.weights[1], b]
    }
}

/// The samples of three channels.
fn zipped(channels: [&AnyChannel<FlatSamples>; 3]) -> impl Iterator<Item = [f32; 3]> {
    let [a, b, c] = channels.map(|channel| channel.sample_data.values_as_f32());
    a.zip(b).zip(c).map(|((a, b), c)| [a, b, c])
}

/// Luminance of primaries that mix to this white in equal parts, by their xy chromaticities.
fn luminance(primaries: [Vec2<f32>; 3], white: Vec2<f32>) -> Option<[f32; 3]> {
    let xyz = |Vec2(x, y): Vec2<f32>| [x / y, 1.0, (1.0 - x - y) / y];
    let determinant = |[a, b, c]: [[f32; 3]; 3]| {
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
    };
    // Cramer's rule.
    let primaries = primaries.map(xyz);
    let weights = [0, 1, 2].map(|i| {
        let mut with_white = primaries;
        with_white[i] = xyz(white);
        determinant(with_white) / determinant(primaries)
    });
    weights.iter().all(|weight| weight.is_normal()).then_some(weights)
}
