//! Shadow views of all lights: which maps there are, and what each looks at.

use glam::{Mat4, Vec3};

use super::maker::Maker;
use super::moments::Moments;
use super::tint::TintMaps;
use super::views::{FitInputs, ShadowView, ShadowViews};
use super::{Filter, Layout, PointLayout, ShadowSettings, cascades, single};
use crate::frame::{LightData, MAX_SHADOW_VIEWS, ShadowViewData};
use crate::view::project::light_axes;
use crate::view::raster::ComputeRaster;

/// A perspective map covers at most this angle from side to side; wider cones take a point light's layout.
const MAX_SPOT_ANGLE_RAD: f32 = 160.0 * std::f32::consts::PI / 180.0;
/// A WebGPU texture array has at most so many layers.
const MAX_VIEWS: usize = MAX_SHADOW_VIEWS;
/// Penumbras of pcss reach at most so far, as a share of the map.
const MAX_PENUMBRA: f32 = 0.04;

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
