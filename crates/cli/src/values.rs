//! The values that flags take, parsed with errors that say what would be right.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use chiaro::scene::HeightMap;
use chiaro::{Kind, Settings, Shard};
use clap::builder::{PossibleValue, PossibleValuesParser};

/// The largest side of an image, the guaranteed limit of a 2D texture in WebGPU.
const MAX_SIDE: u32 = 8192;
/// More machines than anybody has.
const MAX_SHARDS: u32 = 65_536;

/// An image's size, written `1280x720`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Default for Size {
    fn default() -> Self {
        Self { width: 1280, height: 720 }
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
        text.split_once('x')
            .and_then(|(width, height)| Some(Self { width: side(width)?, height: side(height)? }))
            .ok_or_else(|| format!("write two whole numbers of 1 to {MAX_SIDE} pixels, such as 1280x720"))
    }
}

/// A camera, written `x,y,z,tx,ty,tz,yfov_deg`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Where the camera is.
    pub eye_m: [f64; 3],
    /// What it looks at; not the eye itself.
    pub target_m: [f64; 3],
    /// Angle from the lower to the upper edge of the image, between 0 and π.
    pub yfov_rad: f32,
}

impl FromStr for View {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text
            .split(',')
            .map(|part| {
                let number = part.trim().parse::<f64>().ok().filter(|number| number.is_finite());
                number.ok_or_else(|| format!("`{part}` is not a number"))
            })
            .collect::<Result<Vec<_>, _>>()?;
        let [x, y, z, tx, ty, tz, yfov_deg] = numbers[..] else {
            return Err(format!(
                "{} numbers where 7 are needed: eye x,y,z and target x,y,z in metres, then the vertical field of \
                 view in degrees",
                numbers.len()
            ));
        };
        let (eye_m, target_m) = ([x, y, z], [tx, ty, tz]);
        if eye_m == target_m {
            return Err(
                "the eye and the target are the same point, so there is no direction to look in".to_owned()
            );
        }
        if yfov_deg <= 0.0 || yfov_deg >= 180.0 {
            return Err(format!("a field of view of {yfov_deg}° is not between 0° and 180°"));
        }
        Ok(Self { eye_m, target_m, yfov_rad: yfov_deg.to_radians() as f32 })
    }
}

/// Frames of an animation, written `A..B`: A is the first, B the first that is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    /// The first frame.
    pub start: u32,
    /// One past the last frame; more than `start`.
    pub end: u32,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let range = text
            .split_once("..")
            .and_then(|(start, end)| Some(Self { start: start.parse().ok()?, end: end.parse().ok()? }))
            .ok_or("write two frame numbers such as 0..120, which are the 120 frames from 0 to 119")?;
        if range.start < range.end {
            Ok(range)
        } else {
            Err(format!("no frame is from {} up to, but not including, {}", range.start, range.end))
        }
    }
}

/// One changed setting, written `key=value`. Whether the key exists and takes the value is not known here.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Such as `shadow.filter`.
    pub key: String,
    /// Everything after the first `=`.
    pub value: String,
}

impl FromStr for Setting {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once('=').map(|(key, value)| (key.trim(), value.trim())) {
            Some((key, value)) if !key.is_empty() && !value.is_empty() => {
                Ok(Self { key: key.to_owned(), value: value.to_owned() })
            }
            _ => {
                Err("write KEY=VALUE, such as shadow.filter=pcf; `chiaro settings` lists the keys".to_owned())
            }
        }
    }
}

/// A key and the values that it is to have, written `key=v1,v2`, or `key=v1;v2` of values with commas.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Vary(pub chiaro_lab::Vary);

impl FromStr for Vary {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Setting { key, value } = text.parse()?;
        // Values may be lists themselves.
        let separator = if value.contains(';') { ';' } else { ',' };
        let values: Vec<_> = value.split(separator).map(|value| value.trim().to_owned()).collect();
        if values.iter().any(String::is_empty) {
            return Err("a value is missing; write KEY=V1,V2, or KEY=V1;V2 of values with commas".to_owned());
        }
        Ok(Self(chiaro_lab::Vary { key, values }))
    }
}

/// The values of a setting that is a choice, with their meanings.
pub fn values_of(key: &str) -> PossibleValuesParser {
    let field = Settings::fields().iter().find(|field| field.key == key);
    let names = match field.map(|field| &field.kind) {
        Some(Kind::Choice(names)) => *names,
        _ => &[],
    };
    let value = |(name, meaning): &(&'static str, &'static str)| {
        PossibleValue::new(*name).help(meaning.trim().trim_end_matches('.'))
    };
    names.iter().map(value).collect::<Vec<_>>().into()
}

/// Terrain's extent along X and Z, written `400,300`, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundSize(pub [f32; 2]);

impl FromStr for GroundSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (x, z) = text.split_once(',').ok_or("write two lengths in metres such as 400,300")?;
        Ok(Self([terrain_metres(x.trim())?, terrain_metres(z.trim())?]))
    }
}

/// A length of terrain.
pub fn terrain_metres(text: &str) -> Result<f32, String> {
    let (least, most) = (HeightMap::METRES.start(), HeightMap::METRES.end());
    let length = text.parse().ok().filter(|length| HeightMap::METRES.contains(length));
    length.ok_or_else(|| format!("write metres from {least} to {most}, such as 60"))
}

/// Vertices along a side of terrain.
pub fn terrain_vertices(text: &str) -> Result<usize, String> {
    let (least, most) = (HeightMap::VERTICES.start(), HeightMap::VERTICES.end());
    let number = text.parse().ok().filter(|number| HeightMap::VERTICES.contains(number));
    number.ok_or_else(|| format!("write a whole number from {least} to {most}"))
}

/// A whole number from 1.
pub fn positive(text: &str) -> Result<u32, String> {
    text.parse().ok().filter(|number| *number > 0).ok_or_else(|| "write a whole number from 1".to_owned())
}

/// One of many parts of a reference, written `2/8`.
pub fn shard(text: &str) -> Result<Shard, String> {
    let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    let shard = parts.map(|(number, of)| Shard { number, of });
    shard.filter(|shard| shard.of <= MAX_SHARDS && (1..=shard.of).contains(&shard.number)).ok_or_else(|| {
        format!("write I/N, the I-th of N parts, I from 1 to N and N up to {MAX_SHARDS}, such as 2/8")
    })
}

/// A standard deviation in pixels. The bound keeps the filter smaller than any image it makes sense on.
pub fn blur_px(text: &str) -> Result<f64, String> {
    number_where(text, |px| (0.0..=1000.0).contains(&px), "write pixels from 0 to 1000, such as 2 or 0.5")
}

/// A moment of the animation.
pub fn seconds(text: &str) -> Result<f64, String> {
    number_where(text, |seconds| seconds >= 0.0, "write seconds from 0, such as 1.5")
}

/// A span of time.
pub fn some_seconds(text: &str) -> Result<f64, String> {
    number_where(text, |seconds| seconds > 0.0, "write seconds above 0, such as 60")
}

/// A part of something, as a factor or in percent.
pub fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = text.strip_suffix('%').map_or((text, 1.0), |number| (number.trim_end(), 0.01));
    let advice = "write a number above 0, such as 0.01, or a percentage such as 1%";
    Ok(unit * number_where(number, |share| share > 0.0, advice)?)
}

/// A frame rate.
pub fn frames_per_second(text: &str) -> Result<f64, String> {
    let advice = "write frames per second from 0.001 to 100000, such as 24";
    number_where(text, |fps| (0.001..=100_000.0).contains(&fps), advice)
}

fn number_where(text: &str, holds: impl Fn(f64) -> bool, advice: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && holds(*number));
    number.ok_or_else(|| advice.to_owned())
}

/// A file that a rendered image or animation can be written to.
pub fn render_output(text: &str) -> Result<PathBuf, String> {
    with_extension(text, &["png", "exr", "mp4", "webp"])
}

/// A file that scene radiance can be written to.
pub fn radiance_output(text: &str) -> Result<PathBuf, String> {
    with_extension(text, &["exr"])
}

/// A file that a picture of differences can be written to.
pub fn chart_output(text: &str) -> Result<PathBuf, String> {
    with_extension(text, &["png", "svg"])
}

/// The last part of a file's name, in small letters.
pub fn extension(path: &Path) -> String {
    path.extension().and_then(|extension| extension.to_str()).unwrap_or_default().to_lowercase()
}

fn with_extension(text: &str, known: &[&str]) -> Result<PathBuf, String> {
    let path = Path::new(text);
    if known.contains(&extension(path).as_str()) {
        Ok(path.to_owned())
    } else {
        Err(format!("the file's name must end in .{}", known.join(" or .")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_is_two_sides_that_a_texture_can_have() {
        assert_eq!("1920x1080".parse(), Ok(Size { width: 1920, height: 1080 }));
        for wrong in ["", "1920", "0x10", "10x0", "-3x4", "9000x10", "1.5x2", "10x10x10", "10X10"] {
            assert!(wrong.parse::<Size>().is_err(), "{wrong} was taken");
        }
    }

    #[test]
    fn a_view_is_seven_numbers() {
        let view: View = "-1,2.5,3, 0,0,-4,90".parse().unwrap();
        assert_eq!((view.eye_m, view.target_m), ([-1.0, 2.5, 3.0], [0.0, 0.0, -4.0]));
        assert!((view.yfov_rad - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
    }

    #[test]
    fn a_view_that_sees_nothing_is_refused_with_the_reason() {
        for (wrong, reason) in [
            ("1,2,3", "3 numbers"),
            ("1,2,3,4,5,6,x", "`x`"),
            ("1,2,3,4,5,inf,60", "`inf`"),
            ("1,2,3,1,2,3,60", "same point"),
            ("1,2,3,4,5,6,0", "field of view"),
            ("1,2,3,4,5,6,180", "field of view"),
        ] {
            let error = wrong.parse::<View>().unwrap_err();
            assert!(error.contains(reason), "{wrong}: {error}");
        }
    }

    #[test]
    fn frames_leave_out_the_end() {
        assert_eq!("3..8".parse(), Ok(FrameRange { start: 3, end: 8 }));
        for wrong in ["3", "8..3", "3..3", "..3", "3..", "-1..3", "1..=3"] {
            assert!(wrong.parse::<FrameRange>().is_err(), "{wrong} was taken");
        }
    }

    #[test]
    fn a_shard_is_one_of_as_many_as_there_are() {
        assert_eq!(shard("2/8"), Ok(Shard { number: 2, of: 8 }));
        assert_eq!(shard("1/1"), Ok(Shard::default()));
        for wrong in ["0/8", "9/8", "1/0", "-1/2", "2", "/", "1/2/3", "a/b", "1/65537", "1.5/2", ""] {
            assert!(shard(wrong).is_err(), "{wrong} was taken");
        }
    }

    #[test]
    fn a_setting_is_split_at_its_first_equals_sign() {
        let setting: Setting = "camera.tone_map=a=b".parse().unwrap();
        assert_eq!((setting.key.as_str(), setting.value.as_str()), ("camera.tone_map", "a=b"));
        for wrong in ["", "key", "=value", "key="] {
            assert!(wrong.parse::<Setting>().is_err(), "{wrong} was taken");
        }
    }

    #[test]
    fn what_varies_is_a_list_of_values() {
        let Vary(vary) = "shadow.filter = pcf, pcss".parse().unwrap();
        assert_eq!(
            (vary.key.as_str(), vary.values),
            ("shadow.filter", vec!["pcf".to_owned(), "pcss".to_owned()])
        );
        let Vary(lists) = "shadow.splits=5,20;10,40".parse().unwrap();
        assert_eq!(lists.values, ["5,20", "10,40"]);
        assert!("shadow.filter=".parse::<Vary>().is_err() && "a=1,,2".parse::<Vary>().is_err());
    }

    #[test]
    fn outputs_are_told_by_their_extension() {
        assert!(render_output("a/b.PNG").is_ok() && render_output("b.Mp4").is_ok());
        for wrong in ["b.jpg", "png", ".png", ""] {
            assert!(render_output(wrong).is_err() && chart_output(wrong).is_err(), "{wrong} was taken");
        }
        assert!(chart_output("b.exr").is_err() && radiance_output("b.png").is_err());
    }

    #[test]
    fn numbers_keep_their_ranges() {
        assert_eq!(positive("7"), Ok(7));
        assert_eq!(blur_px("0"), Ok(0.0));
        assert!(positive("0").is_err() && blur_px("-1").is_err() && blur_px("nan").is_err());
        assert_eq!((share("0.01"), share("2.5 %")), (Ok(0.01), Ok(0.025)));
        assert!(share("0").is_err() && share("%").is_err() && some_seconds("0").is_err());
        assert!(seconds("-0.1").is_err() && frames_per_second("0").is_err() && seconds("inf").is_err());
        assert!(frames_per_second("1e-320").is_err() && frames_per_second("1e300").is_err());
    }
}
