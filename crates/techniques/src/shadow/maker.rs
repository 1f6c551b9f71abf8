//! What all shadow views are made with.

use glam::{Mat4, Vec2, Vec3};

use super::Filter;
use super::casters::Shadowed;
use super::views::{FitInputs, ShadowView};
use crate::frame::ShadowViewData;
use crate::view::project::{corners, light_axes, reversed_perspective};

/// A local light's near plane as a share of the scene's extent. Reversed float depth keeps its precision whatever it is.
const NEAR_SHARE: f32 = 1e-4;

/// What all views are made with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Maker<'a> {
    pub inputs: &'a FitInputs<'a>,
    pub resolution: u32,
    /// Texels.
    pub border: f32,
}

impl Maker<'_> {
    /// Half the side of a map that holds `half` within its border.
    pub fn with_border(&self, half: f32) -> f32 {
        half / (1.0 - 2.0 * self.border / self.resolution as f32)
    }

    pub fn data(&self, clip_from_ws: &Mat4, layer: u32) -> ShadowViewData {
        let settings = self.inputs.settings;
        ShadowViewData {
            clip_from_ws: clip_from_ws.to_cols_array_2d(),
            layer,
            projection: ShadowViewData::PARALLEL,
            texel_m: 0.0,
            // One unfiltered test is off by up to half a texel, as much as the bilinear kernel's half reach.
            normal_offset: settings.bias_normal_offset
                * if settings.filter == Filter::None { 1.5 } else { 1.0 },
            constant_bias: settings.bias_constant,
            slope_bias: settings.bias_slope,
            near_m: 0.0,
            far_m: 0.0,
            eye_ws: [0.0; 3],
            resolution: self.resolution as f32,
            begin_m: 0.0,
            end_m: f32::MAX,
            border: self.border,
            reserved: 0,
        }
    }

    /// Where a sun's shadows may be: all that casts, and all that it casts on.
    pub fn shadowed(&self, direction: Vec3) -> Shadowed {
        let all = self.inputs.bounds_ws;
        let eye = self.inputs.camera.eye_ws;
        let casters = self.inputs.casters.and_then(|casters| casters.shadowed(direction, eye, all));
        casters.unwrap_or(Shadowed { casting: all, region: all })
    }

    /// Near and far distance of a local light.
    pub fn range(&self, eye: Vec3) -> (f32, f32) {
        let own = self.inputs.casters.and_then(|casters| casters.around(eye));
        let bounds = own.unwrap_or(self.inputs.bounds_ws);
        let reach = corners(bounds).into_iter().map(|corner| corner.distance(eye)).fold(0.0, f32::max);
        let near = (NEAR_SHARE * (bounds.1 - bounds.0).length()).max(NEAR_SHARE * 1e-3 * reach).max(1e-30);
        (near, (1.01 * reach).max(2.0 * near))
    }

    pub fn perspective(&self, eye: Vec3, direction: Vec3, half: f32, layer: u32) -> ShadowView {
        let half = self.with_border(half);
        let (near, far) = self.range(eye);
        let ls_from_ws = Mat4::from_quat(light_axes(direction)) * Mat4::from_translation(-eye);
        let clip_from_ws = reversed_perspective(Vec2::splat(half), near, far) * ls_from_ws;
        let data = ShadowViewData {
            projection: ShadowViewData::PERSPECTIVE,
            texel_m: 2.0 * half / self.resolution as f32,
            near_m: near,
            far_m: far,
            eye_ws: eye.to_array(),
            ..self.data(&clip_from_ws, layer)
        };
        ShadowView { clip_from_ws, eye_ws: eye.extend(1.0), resolution: self.resolution, data, hole: None }
    }
}
