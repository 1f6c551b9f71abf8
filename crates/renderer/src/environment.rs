//! Environment maps from files.

use std::path::Path;

use chiaro_scene::Environment;
use glam::Vec3;

use crate::Error;

/// Widest map that is kept as it is; a cube of the adapter's guaranteed textures shows no more.
const MAX_WIDTH: u32 = 4096;

/// Reads a latitude-longitude picture (Radiance HDR or EXR; a PNG's white is 1) as radiance, 1 in the file being 1 nit.
///
/// Values that are negative or no numbers become 0, infinite ones the largest finite one, and pictures wider than 4,096
/// pixels are averaged down; `warnings` hears of it.
///
/// # Errors
/// [`Error::Image`] when the file cannot be read or is no picture, [`Error::Environment`] when it is empty or its
/// width is not about twice its height.
pub fn load(path: impl AsRef<Path>, warnings: &mut Vec<String>) -> Result<Environment, Error> {
    let path = path.as_ref();
    let image = chiaro_image::read(path)?;
    let (width, height) = image.size();
    // A pixel more or less is rounding; a cross or a square is another projection.
    if width == 0 || height == 0 || width.abs_diff(2 * height) > 2 + height / 8 {
        return Err(Error::Environment {
            file: path.display().to_string(),
            problem: format!(
                "{width}×{height} pixels; a latitude-longitude picture is twice as wide as high"
            ),
        });
    }
    let mut radiance: Vec<_> = image.pixels().iter().map(|&rgb| Vec3::from(rgb)).collect();
    let repaired = repair(&mut radiance);
    if repaired > 0 {
        warnings.push(format!(
            "{}: {repaired} of {} pixels were negative or not finite, and were repaired",
            path.display(),
            radiance.len()
        ));
    }
    let mut environment = Environment { name: path.display().to_string(), width, height, radiance };
    let factor = width.div_ceil(MAX_WIDTH);
    if factor > 1 {
        environment = averaged(&environment, factor);
        warnings.push(format!(
            "{}: {width}×{height} pixels were averaged to {}×{}; store a smaller picture to load faster",
            path.display(),
            environment.width,
            environment.height
        ));
    }
    Ok(environment)
}

/// Makes all values finite and none negative; returns how many pixels were not.
fn repair(radiance: &mut [Vec3]) -> usize {
    let finite = radiance.iter().flat_map(Vec3::to_array).filter(|nits| nits.is_finite());
    let largest = finite.fold(0.0, f32::max);
    let mut repaired = 0;
    for nits in radiance {
        let wrong = nits.to_array().iter().any(|v| !v.is_finite() || *v < 0.0);
        repaired += usize::from(wrong);
        if wrong {
            // max() drops NaN.
            *nits = Vec3::from(nits.to_array().map(|v| v.max(0.0).min(largest)));
        }
    }
    repaired
}

/// Means of blocks of about `factor`² pixels.
fn averaged(environment: &Environment, factor: u32) -> Environment {
    let (width, height) = (environment.width / factor, (environment.height / factor).max(1));
    let span = |index: u32, of: u32, source: u32| {
        let edge = |index: u32| (u64::from(index) * u64::from(source) / u64::from(of)) as u32;
        edge(index)..edge(index + 1).max(edge(index) + 1)
    };
    let mut radiance = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        let rows = span(y, height, environment.height);
        for x in 0..width {
            let columns = span(x, width, environment.width);
            let pixels = rows.clone().flat_map(|row| columns.clone().map(move |column| (row, column)));
            let at = |(row, column)| environment.radiance[(row * environment.width + column) as usize];
            let count = (rows.len() * columns.len()) as f32;
            radiance.push(pixels.map(at).sum::<Vec3>() / count);
        }
    }
    Environment { name: environment.name.clone(), width, height, radiance }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strange_pixels_are_repaired_and_counted() {
        let mut radiance = vec![
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(-1.0, 0.5, 0.0),
            Vec3::new(f32::NAN, 1.0, 1.0),
            Vec3::new(f32::INFINITY, 1.0, f32::NEG_INFINITY),
        ];
        assert_eq!(repair(&mut radiance), 3);
        assert_eq!(radiance[0], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(radiance[1], Vec3::new(0.0, 0.5, 0.0));
        assert_eq!(radiance[2], Vec3::new(0.0, 1.0, 1.0));
        assert_eq!(radiance[3], Vec3::new(3.0, 1.0, 0.0));
    }

    #[test]
    fn averaging_keeps_the_mean_and_every_pixel() {
        let (width, height) = (12, 6);
        let radiance = (0..width * height).map(|i| Vec3::splat(i as f32)).collect();
        let source = Environment { name: String::new(), width, height, radiance };
        let mean = |e: &Environment| e.radiance.iter().sum::<Vec3>() / e.radiance.len() as f32;
        let half = averaged(&source, 2);
        assert_eq!((half.width, half.height), (6, 3));
        assert_eq!(mean(&half), mean(&source));
        assert_eq!(half.radiance[0], Vec3::splat((1.0 + 12.0 + 13.0) / 4.0));
    }

    #[test]
    fn a_missing_file_and_a_square_picture_are_named() {
        let message = load("no/such.hdr", &mut Vec::new()).unwrap_err().to_string();
        assert!(message.contains("no/such.hdr"), "{message}");
        let square = std::env::temp_dir().join("chiaro_square_environment.exr");
        let image = chiaro_image::Image::filled(4, 4, [1.0; 3]);
        chiaro_image::write_exr(&square, &image, chiaro_image::Precision::Half).unwrap();
        let message = load(&square, &mut Vec::new()).unwrap_err().to_string();
        assert!(message.contains("chiaro_square") && message.contains("4×4"), "{message}");
    }
}
