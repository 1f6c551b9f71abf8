//! Terrain whose heights are a picture's grey values.

use std::path::{Path, PathBuf};

use image::DynamicImage;

use super::files::Files;
use super::limits::Limits;
use super::source::scene_name;
use super::source::{Decoder, read_file};
use crate::builtin::{HeightField, height_field};
use crate::{Scene, SceneError};

/// Longer side of terrain whose size is not given, metres.
const SIDE_M: f32 = 100.0;
/// Height of terrain whose height is not given, as a share of its longer side.
const HEIGHT: f32 = 0.1;

/// Terrain made from a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightMap {
    /// A grey picture of 8 or 16 bits. Its left is at −X and its top at −Z; black is at height 0.
    pub image: PathBuf,
    /// Extent along X and Z, metres; `None`: in the picture's shape, the longer side 100 m.
    pub size_m: Option<[f32; 2]>,
    /// Height of white, metres; `None`: a tenth of the longer side.
    pub height_m: Option<f32>,
    /// Vertices along each side, in [`HeightMap::VERTICES`].
    pub vertices: usize,
}

impl HeightMap {
    /// How many vertices a side may have; more triangles than those of the most do not fit WebGPU's guaranteed buffers.
    pub const VERTICES: std::ops::RangeInclusive<usize> = 2..=2048;
    /// Sides and heights that there may be, metres: products of distances between vertices stay within the range of `f32`.
    pub const METRES: std::ops::RangeInclusive<f32> = 1e-3..=1e8;
    /// Vertices along each side where nothing is said.
    pub const DEFAULT_VERTICES: usize = 135;

    /// Terrain from the picture `image`, with the defaults of all else.
    pub fn new(image: impl Into<PathBuf>) -> Self {
        Self { image: image.into(), size_m: None, height_m: None, vertices: Self::DEFAULT_VERTICES }
    }

    /// Reads the picture and makes the terrain, with a sun, a sky and cameras.
    ///
    /// A vertex has the picture's height at its place, linear between the middles of pixels; those at the terrain's edges
    /// have those of the outermost pixels.
    ///
    /// # Errors
    /// When the picture cannot be read or is not grey, or a number is out of range.
    pub fn load(&self, files: &dyn Files) -> Result<Scene, SceneError> {
        let invalid = |place: &str, problem: String| {
            Err(SceneError::Invalid { path: self.image.clone(), place: place.to_owned(), problem })
        };
        let [least, most] = [Self::METRES.start(), Self::METRES.end()];
        if !Self::VERTICES.contains(&self.vertices) {
            let [least, most] = [Self::VERTICES.start(), Self::VERTICES.end()];
            return invalid("terrain", format!("{} vertices a side; take {least} to {most}", self.vertices));
        }
        for length in self.size_m.into_iter().flatten().chain(self.height_m) {
            if !Self::METRES.contains(&length) {
                return invalid("terrain", format!("a length of {length} m; take {least} to {most} m"));
            }
        }
        let Heights { columns, rows, values } = Heights::read(files, &self.image)?;
        let longer = columns.max(rows) as f32;
        let size_m =
            self.size_m.unwrap_or_else(|| [columns, rows].map(|n| (SIDE_M * n as f32 / longer).max(*least)));
        let height_m = self.height_m.unwrap_or(HEIGHT * size_m[0].max(size_m[1]));
        // Position of vertex `i` between the middles of the first and the last of `count` pixels.
        let place = |i: usize, count: usize| {
            let at = i as f64 * (count - 1) as f64 / (self.vertices - 1) as f64;
            let low = (at as usize).min(count - 1);
            (low, (low + 1).min(count - 1), (at - low as f64) as f32)
        };
        let height = |x: usize, z: usize| {
            let ((left, right, u), (top, bottom, v)) = (place(x, columns), place(z, rows));
            let row = |row: usize| {
                let [a, b] = [left, right].map(|column| values[row * columns + column]);
                a + (b - a) * u
            };
            height_m * (row(top) + (row(bottom) - row(top)) * v)
        };
        let name = scene_name(&self.image);
        Ok(height_field(&HeightField { name: &name, side: self.vertices, size_m, height: &height }))
    }
}

/// Grey values 0..1, row by row.
struct Heights {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
}

impl Heights {
    fn read(files: &dyn Files, path: &Path) -> Result<Self, SceneError> {
        let bytes = read_file(files, path)?;
        let name = path.to_string_lossy();
        let image = Decoder::new(&Limits::default()).decode_dynamic(&bytes, &name).map_err(|problem| {
            let (path, place) = (path.to_owned(), "height map".to_owned());
            SceneError::Invalid { path, place, problem }
        })?;
        let [columns, rows] = [image.width() as usize, image.height() as usize];
        let values = match image {
            DynamicImage::ImageLuma8(grey) => grey.iter().map(|value| f32::from(*value) / 255.0).collect(),
            DynamicImage::ImageLuma16(grey) => {
                grey.iter().map(|value| f32::from(*value) / 65_535.0).collect()
            }
            other => {
                let kind = if other.color().has_color() { "in colour" } else { "with alpha" };
                return Err(SceneError::Unsupported {
                    path: path.to_owned(),
                    feature: format!("a height map {kind}"),
                    advice: "save it as a grey picture of 8 or 16 bits, without alpha".to_owned(),
                });
            }
        };
        Ok(Self { columns, rows, values })
    }
}
