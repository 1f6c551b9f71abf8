//! Settings from scene radiance to the screen.

use crate::settings::{Kind, Value};
use crate::{choice, settings};

choice! {
    /// The curve from exposed radiance to the screen, in the order of `tone_map.cs.wesl`.
    pub enum Curve {
        /// Punchy, filmic, hue shifts towards white.
        Aces = "aces",
        /// Softer, keeps hues of bright colours.
        Agx = "agx",
        /// Clamped.
        None = "none",
    }
}

choice! {
    /// Which light a picture shows.
    pub enum Show {
        /// All of it.
        Both = "both",
        /// What glows or is behind everything where it is seen, and what reaches its first surface with nothing between.
        Direct = "direct",
        /// What was scattered before, and what stands in for it.
        Indirect = "indirect",
        /// What came through mirrors and smooth glass alone, then is scattered by one surface.
        Caustics = "caustics",
    }
}

impl Show {
    /// Weights of direct light, of indirect light and of caustics.
    pub fn weights(self) -> [f32; 3] {
        match self {
            Self::Both => [1.0, 1.0, 1.0],
            Self::Direct => [1.0, 0.0, 0.0],
            Self::Indirect => [0.0, 1.0, 0.0],
            Self::Caustics => [0.0, 0.0, 1.0],
        }
    }
}

choice! {
    /// What smooths the edges of pictures that move.
    pub enum Smoothing {
        /// Nothing.
        None = "none",
        /// The mean of frames, each taken elsewhere within its pixels, that follows what moves.
        Taa = "taa",
    }
}

/// Exposure of pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// From the picture's own histogram.
    Auto,
    /// Exposure value at ISO 100.
    Ev100(f32),
}

impl Value for Exposure {
    type Range = std::ops::RangeInclusive<f32>;
    fn parse(text: &str, range: &Self::Range) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        f32::parse(text, range).map(Self::Ev100).map_err(|expected| format!("auto or {expected}"))
    }
    fn show(&self) -> String {
        match self {
            Self::Auto => "auto".into(),
            Self::Ev100(ev) => ev.to_string(),
        }
    }
    fn kind(range: &Self::Range) -> Kind {
        Kind::WordOrNumber("auto", *range.start(), *range.end())
    }
}

settings! {
    /// From radiance to the screen. EXR files are not touched by these, except by `show`. Neither
    /// exposure nor curve touch the colour of unlit materials: 1 is white.
    pub struct CameraSettings: "camera" {
        /// Exposure: auto from the picture's histogram, or by hand; +1 halves the brightness. 15 suits a sunny day,
        /// 7 a lit room.
        exposure_ev100: Exposure = Exposure::Auto, "EV100", -16.0..=24.0, Uniform;
        /// Curve from exposed radiance to the screen.
        tone_map: Curve = Curve::Aces, "", (), Uniform;
        /// Which light the picture shows: all of it, or direct or indirect light alone, as `--aov` has them.
        show: Show = Show::Both, "", (), Uniform;
    }
}

settings! {
    /// What becomes of radiance before the screen.
    pub struct PostSettings: "post" {
        /// What smooths pictures that move, in the viewer and in sequences of one sample a frame: none, or taa, the mean of
        /// frames that follows what moves. Pictures at rest are averaged either way. Costs 24 bytes a pixel of memory beside
        /// 32 of motion, and two passes.
        antialias: Smoothing = Smoothing::Taa, "", (), Permutation;
    }
}
