//! Tests that need a GPU: functions against quadrature and formulas, analytic scenes through the whole renderer,
//! pipelines against each other, references, goldens.

mod brdf;
mod brdf_sample;
mod bsdf_sample;
mod chi_square;
mod culling;
mod emitter_sample;
mod environment;
mod extent;
mod follow;
mod ggx_sun;
mod goldens;
mod light_paths;
mod lights;
mod log;
mod materials;
mod motion;
mod pipelines;
mod references;
mod robust;
mod seen;
mod shadow_cascades;
mod shadow_low_light;
mod shadow_moments;
mod shadow_raster;
mod shadow_table;
mod shadow_thesis;
mod shadows;
mod strict;
mod surface;
mod textures;
mod trace;
mod transparency;
mod truth;
mod unlit;
mod views;
