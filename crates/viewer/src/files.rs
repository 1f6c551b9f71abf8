//! Screenshots as files.

use chiaro::Pixels;
use chiaro_image::{Image, ImageError, Picture};

use crate::picture::Pair;

/// What to write beside the PNG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Radiance in nits, too.
    pub exr: bool,
}

/// Writes `chiaro-NAME-TIME.png`, and with `exr` the radiance beside it; returns the names.
///
/// # Errors
/// When the current folder cannot be written to.
#[cfg(not(target_arch = "wasm32"))]
pub fn write(scene: &str, pair: &Pair, wanted: Wanted) -> Result<String, ImageError> {
    let seconds =
        std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let stem: String = scene.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    let name = format!("chiaro-{stem}-{}", stamp(seconds));
    let png = format!("{name}.png");
    chiaro_image::write_png(&png, &picture(&pair.picture)?)?;
    if !wanted.exr {
        return Ok(png);
    }
    let exr = format!("{name}.exr");
    let radiance = radiance(&pair.radiance, pair.frames)?;
    chiaro_image::write_exr(&exr, &radiance, chiaro_image::Precision::Float)?;
    Ok(format!("{png} and {exr}"))
}

/// A page has no folder to write to.
///
/// # Errors
/// Never; the text says what to do.
#[cfg(target_arch = "wasm32")]
pub fn write(_scene: &str, pair: &Pair, _wanted: Wanted) -> Result<String, ImageError> {
    picture(&pair.picture)?;
    Ok("nothing: use the browser's own screenshot".into())
}

fn picture(pixels: &Pixels) -> Result<Picture, ImageError> {
    let rgb = pixels.bytes.chunks_exact(4).flat_map(|rgba| [rgba[0], rgba[1], rgba[2]]).collect();
    Picture::from_bytes(pixels.width, pixels.height, rgb)
}

#[cfg(not(target_arch = "wasm32"))]
fn radiance(sum: &Pixels, frames: u32) -> Result<Image, ImageError> {
    let share = 1.0 / frames.max(1) as f32;
    let pixels = sum.floats().chunks_exact(4).map(|rgba| [0, 1, 2].map(|i| rgba[i] * share)).collect();
    Image::from_pixels(sum.width, sum.height, pixels)
}

/// `20261122-205501`, in UTC, of seconds since 1970.
#[cfg(not(target_arch = "wasm32"))]
fn stamp(seconds: u64) -> String {
    // Days to civil date (Hinnant 2013, "chrono-Compatible Low-Level Date Algorithms"), in eras of 400 years that
    // begin in March.
    let days = seconds / 86_400 + 719_468;
    let (era, day_of_era) = (days / 146_097, days % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let (hour, minute, second) = (seconds / 3600 % 24, seconds / 60 % 60, seconds % 60);
    format!("{year:04}{month:02}{day:02}-{hour:02}{minute:02}{second:02}")
}

#[cfg(test)]
mod tests {
    use super::stamp;

    #[test]
    fn stamps_are_civil_dates() {
        assert_eq!(stamp(0), "19700101-000000");
        assert_eq!(stamp(951_782_399), "20000228-235959");
        assert_eq!(stamp(951_782_400), "20000229-000000");
        assert_eq!(stamp(1_798_761_599), "20261231-235959");
    }
}
