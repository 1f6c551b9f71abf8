//! What is refused before anything is made or recorded: settings, sizes and views.

use chiaro_gpu::Gpu;
use chiaro_techniques::view::raster::ComputeRaster;
use glam::{Mat4, Vec2};

use crate::{Error, Pipeline, Settings, View};

/// Refuses pictures that no texture can hold.
pub(crate) fn check_size(gpu: &Gpu, size: [u32; 2]) -> Result<(), Error> {
    let most = gpu.limits.max_texture_dimension_2d;
    if size.iter().any(|&side| side == 0 || side > most) {
        return Err(Error::Size { size, most });
    }
    Ok(())
}

/// Whether the view has a matrix.
pub(crate) fn check_view(view: &View, size_px: [u32; 2]) -> Result<(), Error> {
    let matrices = [view.clip_from_ws(size_px, Vec2::ZERO), view.relative_from_clip(size_px, Vec2::ZERO)];
    if matrices.iter().all(Mat4::is_finite) {
        return Ok(());
    }
    let problem = "is not finite: see the view's place, angle and near plane";
    Err(Error::Matrix { matrix: "clip_from_world", problem })
}

/// Whether settings go together, and the adapter can do them.
pub(crate) fn check_settings(gpu: &Gpu, settings: &Settings) -> Result<(), Error> {
    let settings = &settings.effective();
    let msaa = settings.surface.msaa.samples();
    let offered = gpu.sample_counts();
    if settings.pipeline == Pipeline::Forward && !offered.contains(&msaa) {
        let offered: Vec<_> = offered.iter().map(ToString::to_string).collect();
        return Err(Error::Combination(format!(
            "surface.msaa = {msaa}: {} offers {}",
            gpu.info.name,
            offered.join(", ")
        )));
    }
    if let Some(reason) = settings.shadow.refused() {
        return Err(Error::Combination(reason));
    }
    if settings.shadow.transmission_tint && settings.caustics.technique.makes_any() {
        return Err(Error::Combination(
            "shadow.transmission_tint does not go with caustics: both would bring the light that glass lets through; \
             take shadow.transmission_tint = false or caustics.technique = none"
                .into(),
        ));
    }
    let side = settings.shadow.resolution;
    if settings.shadow.computes_maps() && ComputeRaster::views_at_once(gpu, [side; 2]) == 0 {
        return Err(Error::Combination(format!(
            "shadow.resolution = {side} is more than shadow.raster = compute can do on {}",
            gpu.info.name
        )));
    }
    if side > gpu.limits.max_texture_dimension_2d {
        return Err(Error::Combination(format!(
            "shadow.resolution = {side} is more than {} allows ({})",
            gpu.info.name, gpu.limits.max_texture_dimension_2d
        )));
    }
    Ok(())
}
