//! Shadow views of all lights: which maps there are, and what each looks at.

use glam::{Mat4, Vec2, Vec3, Vec4};

use super::casters::Shadowed;
use super::moments::Moments;
use super::project::{corners, light_axes, reversed_perspective};
use super::tint::TintMaps;
use super::{Casters, Filter, Layout, PointLayout, ShadowSettings, cascades, single};
use crate::frame::{LightData, MAX_SHADOW_VIEWS, ShadowViewData};
use crate::view::Hole;
use crate::view::raster::ComputeRaster;

/// A perspective map covers at most this angle from side to side; wider cones take a point light's layout.
const MAX_SPOT_ANGLE_RAD: f32 = 160.0 * std::f32::consts::PI / 180.0;
/// A WebGPU texture array has at most so many layers.
const MAX_VIEWS: usize = MAX_SHADOW_VIEWS;
/// A local light's near plane as a share of the scene's extent. Reversed float depth keeps its precision whatever it is.
const NEAR_SHARE: f32 = 1e-4;
/// Penumbras of pcss reach at most so far, as a share of the map.
pub(super) const MAX_PENUMBRA: f32 = 0.04;

/// What the camera sees, for fitting suns' maps to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// World position.
    pub eye_ws: Vec3,
    /// Unit, where it looks.
    pub forward_ws: Vec3,
    /// From unjittered reversed clip space to world space.
    pub ws_from_clip: Mat4,
}

/// A shadow view on the CPU.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Reversed depth; of a paraboloid, to the light's axes.
    pub clip_from_ws: Mat4,
    /// The light's position with w = 1, or its direction with w = 0.
    pub eye_ws: Vec4,
    /// Texels a side.
    pub resolution: u32,
    /// What shaders read.
    pub data: ShadowViewData,
    /// What a finer cascade draws in its place.
    pub hole: Option<Hole>,
}

/// All views of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowViews {
    /// In the order of their layers.
    pub views: Vec<ShadowView>,
    /// Suns whose cascades are fitted on the GPU, and what to.
    pub fitted: Vec<cascades::SunFit>,
    /// Sentences about what was given up.
    pub notes: Vec<String>,
}

/// What views are fitted to.
#[derive(Clone, Copy, Debug)]
pub struct FitInputs<'a> {
    /// The scene, casters and receivers.
    pub bounds_ws: (Vec3, Vec3),
    /// What of it casts shadows, so that suns' maps reach no farther; `None`: anything may.
    pub casters: Option<&'a Casters>,
    /// Who looks.
    pub camera: CameraView,
    /// How.
    pub settings: &'a ShadowSettings,
    /// Whether casters before a map's near plane are drawn onto it.
    pub clamps_depth: bool,
    /// Whether something see-through may stand before what the depth buffer shows.
    pub see_through: bool,
}

/// Gives every light its shadow views, and writes into the lights which.
pub fn fit(lights: &mut [LightData], inputs: &FitInputs<'_>) -> ShadowViews {
    for light in lights.iter_mut() {
        (light.first_view, light.view_count) = (LightData::NO_VIEW, 0);
    }
    let mut out = ShadowViews::default();
    let settings = inputs.settings;
    if matches!(settings.layout, Layout::None | Layout::Traced) {
        return out;
    }
    let mut total = 0;
    let mut casting = Vec::new();
    let dark = lights.iter().position(|light| {
        let views = views_of(light, settings);
        let fits = total + views <= MAX_VIEWS;
        if fits {
            total += views;
            casting.push(views);
        }
        !fits
    });
    if let Some(dark) = dark {
        out.notes.push(format!(
            "{} lights would need more than {MAX_VIEWS} shadow maps: only the first {dark} cast shadows",
            lights.len()
        ));
    }
    let resolution = within_budget(settings, total, &mut out.notes);
    for (light, count) in lights.iter_mut().zip(casting).filter(|(_, count)| *count > 0) {
        (light.first_view, light.view_count) = (out.views.len() as u32, count as u32);
        let layer = out.views.len() as u32;
        let make = Maker { inputs, resolution, border: border(settings, resolution) };
        match (light.kind, count) {
            (LightData::DIRECTIONAL, _) if settings.layout == Layout::Cascaded => {
                cascades::fit(light, &make, layer, &mut out);
            }
            (LightData::DIRECTIONAL, _) => out.views.push(single::fit(light, &make, layer)),
            (_, 1) => out.views.push(spot(light, &make, layer)),
            (_, 2) => out.views.extend(paraboloids(light, &make, layer)),
            _ => out.views.extend(cube(light, &make, layer)),
        }
    }
    out
}

fn views_of(light: &LightData, settings: &ShadowSettings) -> usize {
    if light.intensity == [0.0; 3] {
        return 0;
    }
    match light.kind {
        LightData::DIRECTIONAL if settings.layout == Layout::Cascaded => settings.cascades as usize,
        LightData::DIRECTIONAL => 1,
        LightData::SPOT if 2.0 * light.cone_rad <= MAX_SPOT_ANGLE_RAD => 1,
        _ => match settings.point_layout {
            PointLayout::Cube => 6,
            PointLayout::Paraboloid => 2,
        },
    }
}

fn within_budget(settings: &ShadowSettings, views: usize, notes: &mut Vec<String>) -> u32 {
    let budget = u64::from(settings.memory_budget) << 20;
    let bytes = |side: u32| {
        let texel = 4 + if settings.transmission_tint { TintMaps::TEXEL_BYTES } else { 0 };
        let rastered = if settings.computes_maps() { ComputeRaster::bytes([side; 2], views) } else { 0 };
        texel * u64::from(side).pow(2) * views as u64
            + Moments::bytes(settings, side, views as u32)
            + rastered
    };
    let mut side = settings.resolution;
    while bytes(side) > budget && side > 16 {
        side /= 2;
    }
    if side != settings.resolution {
        notes.push(format!(
            "{views} shadow maps of {}² texels exceed shadow.memory_budget = {} MiB: they have {side}²",
            settings.resolution, settings.memory_budget
        ));
    }
    side
}

/// Texels at a map's edge that filters read beyond what is looked up there.
fn border(settings: &ShadowSettings, resolution: u32) -> f32 {
    let reach = match settings.filter {
        Filter::None => 0.0,
        Filter::Pcf if settings.pcf_kernel.texels() == 0 => settings.filter_radius,
        Filter::Pcf => 0.5 * settings.pcf_kernel.texels() as f32,
        Filter::Pcss => MAX_PENUMBRA * resolution as f32,
        Filter::Gaussian | Filter::GaussianMip => settings.filter_radius.ceil(),
        Filter::Mip => 2.0,
    };
    // The receiver's offset along its normal, and bilinear neighbours.
    (reach + 2.0).min(0.2 * resolution as f32)
}

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
        let casters = self.inputs.casters.and_then(|casters| casters.shadowed(direction, all));
        casters.unwrap_or(Shadowed { casting: all, region: all })
    }

    /// Near and far distance of a local light.
    fn range(&self, eye: Vec3) -> (f32, f32) {
        let bounds = self.inputs.bounds_ws;
        let reach = corners(bounds).into_iter().map(|corner| corner.distance(eye)).fold(0.0, f32::max);
        let near = (NEAR_SHARE * (bounds.1 - bounds.0).length()).max(NEAR_SHARE * 1e-3 * reach).max(1e-30);
        (near, (1.01 * reach).max(2.0 * near))
    }

    fn perspective(&self, eye: Vec3, direction: Vec3, half: f32, layer: u32) -> ShadowView {
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

fn spot(light: &LightData, make: &Maker<'_>, layer: u32) -> ShadowView {
    make.perspective(light.position_ws.into(), light.direction_ws.into(), light.cone_rad.tan(), layer)
}

/// Faces +X, −X, +Y, −Y, +Z, −Z: the order of `cube_face` in lookup.wesl.
fn cube<'a>(light: &'a LightData, make: &'a Maker<'_>, layer: u32) -> impl Iterator<Item = ShadowView> + 'a {
    let faces = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    (layer..).zip(faces).map(|(layer, face)| make.perspective(light.position_ws.into(), face, 1.0, layer))
}

/// The hemispheres about −Y and +Y.
fn paraboloids<'a>(
    light: &'a LightData,
    make: &'a Maker<'_>,
    layer: u32,
) -> impl Iterator<Item = ShadowView> + 'a {
    let eye = Vec3::from(light.position_ws);
    (layer..).zip([Vec3::NEG_Y, Vec3::Y]).map(move |(layer, axis)| {
        let (near, far) = make.range(eye);
        // Light axes look along −Z; the paraboloid looks along +Z, mirrored so that it stays right-handed.
        let about_z = Mat4::from_scale(Vec3::new(-1.0, 1.0, -1.0)) * Mat4::from_quat(light_axes(axis));
        let clip_from_ws = about_z * Mat4::from_translation(-eye);
        let data = ShadowViewData {
            projection: ShadowViewData::PARABOLOID,
            // In the middle, where a texel is largest: stereographic projection halves angles there.
            texel_m: 4.0 * make.with_border(1.0) / make.resolution as f32,
            near_m: near,
            far_m: far,
            eye_ws: eye.to_array(),
            ..make.data(&clip_from_ws, layer)
        };
        ShadowView { clip_from_ws, eye_ws: eye.extend(1.0), resolution: make.resolution, data, hole: None }
    })
}
