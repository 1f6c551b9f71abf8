//! Shadow maps (Williams 1978): the scene's depth seen from each light, compared with the depth of what is shaded.
//!
//! A sun has cascades ([`cascades`]) or one map around what the camera can see of the scene; a spot one perspective map
//! around its cone; a point a cube of six or two paraboloids. All are [`ShadowView`]s: a layer each of one texture array,
//! in reversed depth (near 1, far 0); outside its maps a light casts no shadow. What maps hold beside depth is in
//! [`moments`]; filtering and the receiver's bias, which follows from the texel's size on the receiver and the filter's
//! reach, are in `lookup.wesl`.
//!
//! | input | output | format | space, unit |
//! | --- | --- | --- | --- |
//! | lights, scene bounds, camera | shadow views (group 0) | `ShadowView` | world metres |
//! | scene geometry | maps | Depth32Float array (R32Float where compute draws), a layer a view | reversed light-clip z; of a paraboloid near / distance |
//! | maps | moments | R, RG or RGBA32Float array | linear depth 0..1 and functions of it |
//!
//! Limits: see-through surfaces cast full shadows, blended ones where their alpha is at least a half, unless
//! `shadow.transmission_tint` lets light through them in their colour.
//! Cost: 4 bytes a texel (and 4 a channel of moments), and one raster of the culled casters whenever light, camera (suns)
//! or scene changed: a map that rests is kept (`shadow.cache`).

pub mod cascades;
mod casters;
mod fit;
mod maker;
pub mod moments;
mod record;
mod settings;
mod single;
#[cfg(test)]
mod tests;
mod tint;
mod views;

pub use casters::Casters;
pub use fit::fit;
pub use record::{ShadowInputs, ShadowKey, ShadowMaps, ShadowOutputs, ShadowPlan, ShadowRoom};
pub use settings::{
    CascadeSelect, Darkens, Filter, Fit, Layout, PcfKernel, PointLayout, Representation, ShadowSettings,
    Sigma, Splits,
};
pub use tint::TintMaps;
pub use views::{CameraView, FitInputs, ShadowView, ShadowViews, SunFit};

use chiaro_gpu::Gpu;

use crate::frame::ShadowParameters;
use crate::rays::TraceFacts;
use crate::scene::SceneFacts;
use crate::shaders::ShadowSource;

/// What shaders that look shadows up are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lookup {
    representation: Representation,
    filter: Filter,
    kernel: PcfKernel,
    receiver_plane: bool,
    select: CascadeSelect,
    tint: bool,
    darkens_color: bool,
    /// What they are looked up in.
    pub source: ShadowSource,
}

impl Lookup {
    /// What settings ask for.
    pub fn new(settings: &ShadowSettings) -> Self {
        Self {
            representation: settings.representation,
            filter: settings.filter,
            kernel: settings.pcf_kernel,
            receiver_plane: settings.bias_receiver_plane,
            select: settings.cascade_select,
            tint: settings.transmission_tint,
            darkens_color: settings.darkened() != Darkens::Direct,
            source: match settings.layout {
                Layout::Traced => ShadowSource::Rays,
                _ if settings.computes_maps() => ShadowSource::FloatMaps,
                _ => ShadowSource::DepthMaps,
            },
        }
    }

    /// What shaders that look shadows up are made from: rays meet masks and tints, and so materials.
    pub fn facts(self, facts: SceneFacts) -> SceneFacts {
        if self.source == ShadowSource::Rays { facts } else { SceneFacts::default() }
    }

    /// The constants of the lookups.
    pub fn constants(self, gpu: &Gpu, facts: SceneFacts) -> Vec<(&'static str, f64)> {
        if self.source == ShadowSource::Rays {
            let tints = f64::from(u8::from(self.tint));
            let mut constants = [&facts.constants()[..], &TraceFacts::of(facts).constants()].concat();
            constants.extend([("TINTS", tints), ("DARKENS_COLOR", f64::from(u8::from(self.darkens_color)))]);
            return constants;
        }
        let filter = match self.filter {
            Filter::None => 0.0,
            Filter::Pcf if self.kernel == PcfKernel::Disc => 2.0,
            Filter::Pcss => 3.0,
            _ => 1.0,
        };
        let moments = self.representation != Representation::Depth;
        let mut constants = vec![
            ("FILTER", filter),
            // A kernel of no texels would divide by zero where it is not used.
            ("PCF_KERNEL", f64::from(self.kernel.texels().max(2))),
            ("RECEIVER_PLANE", f64::from(self.receiver_plane)),
            ("SELECT_BY_DEPTH", f64::from(self.select == CascadeSelect::Depth)),
            ("TINT", f64::from(self.tint)),
            ("DARKENS_COLOR", f64::from(self.darkens_color)),
            ("MOMENTS", f64::from(moments)),
            ("MOMENT_MIPS", f64::from(moments && self.filter.mips())),
        ];
        constants.extend(moments::constants(gpu, self.representation));
        constants
    }
}

impl ShadowSettings {
    /// What all shadow views share.
    pub fn parameters(&self) -> ShadowParameters {
        let positive = match self.representation {
            Representation::Exponential => self.exponent,
            _ => self.evsm_positive,
        };
        let by_thesis = self.darkens == Darkens::Thesis;
        let depth = self.representation == Representation::Depth;
        let exponential = self.representation == Representation::Exponential;
        ShadowParameters {
            floor: if by_thesis && depth { 0.0 } else { self.floor },
            blend: self.blend,
            filter_radius: self.filter_radius,
            light_size: self.light_size,
            bleed_reduction: if by_thesis && exponential { 0.0 } else { self.bleed_reduction },
            positive_exponent: positive,
            negative_exponent: self.evsm_negative,
            anisotropy: self.anisotropy as f32,
            min_variance: self.min_variance,
            clamps: u32::from(self.darkened() == Darkens::ColorClamped),
            rays: self.rays,
            reserved: 0,
        }
    }
}
