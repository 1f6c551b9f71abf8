//! Photons by rays: caustics as they are, of any number of mirrors and interfaces, frame by frame.
//!
//! Lamps send photons towards the box around what mirrors or refracts ([`super::Casters`]): points and spots within a cone,
//! suns through a rectangle, each photon with the light of its share of them (`paths/aim.wesl`). They go through the scene's trees
//! with the vertices, materials and random numbers of the reference (`paths/`): Fresnel's law decides by chance between mirroring
//! and passing, what lies between absorbs, and where a surface scatters the photon leaves its light in the pixel that shows the
//! place, if that pixel's surface is the photon's (Dutré, Lafortune & Willems 1993, without its shadow ray). As the eye is
//! all that they are gathered for, there is no map in space: each pixel holds sums.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | places | surface buffer | `caustic_places` | a lane a pixel |
//! | photons | trees, scene, lamps, `caustic_places` | `photon_sums` | each of 65,536 lanes for some |
//! | spread | these | `caustic_spread`, `caustic_tiles` | a lane a pixel |
//! | gather | all of these | [`CausticLight`] | a lane a pixel |
//!
//! | buffer | format | unit |
//! | --- | --- | --- |
//! | `photon_sums` | 16 words of totals, then 8 a pixel: light · cosine to the eye in three channels, photons, the sum of directions towards the light by luminance | steps |
//! | `caustic_places` | Rgba32Uint: position, the triangle's normal | m |
//! | `caustic_spread` | Rgba32Float: photons, how far they spread, lux of a step, log2 of the view depth | px, m |
//! | `caustic_tiles` | R32Uint: farthest spread in 8 × 8 pixels + 1 | px |
//! | [`CausticLight`] | Rgba16Float | nits · radiance scale |
//!
//! # Density
//! A pixel of area A_px (at the photon's place, square to the ray) sees E = Σ Φ cos θ_eye / A_px lux on the surface. Where it
//! holds fewer than `caustics.filter_photons`, its light spreads over its neighbours on the same surface, up to as many pixels
//! away as it takes to find that many photons, by the kernel (1 − dx²/r²)(1 − dy²/r²) over its own sum. So the picture's energy
//! stays what it was, dense places stay sharp to the pixel, and single photons become soft spots. A still's frames have other
//! photons each, and spread as if those of all were there: the bias vanishes as they become many.
//!
//! # Sums
//! A step is 2⁻³⁰ of all lamps' light towards the box, by its brightest channel. A photon's mean share is 2³⁰ over their
//! number, its light is cut at three times that (by chance and dispersion a photon may carry more than was emitted with it), and so
//! all photons of a frame in one pixel make 3 · 2³⁰ steps: no sum overflows, however bright a focus. Directions count a quarter,
//! with a sign. Steps are rounded up or down by chance, so that what is less than one is not lost.
//!
//! # Limits
//! - Lamps alone: glowing meshes, the environment and the sky cause none. Of more than 1,024 lamps the brightest towards the box do.
//! - One box holds all casters: where they stand far apart, photons between them are spent for nothing, and come as direct light,
//!   which they do not count as.
//! - What the camera sees in mirrors shows no caustics, nor do see-through surfaces; what stands behind these does.
//! - Where a pixel's middle shows another surface than the photon's, within a pixel of silhouettes, its light is lost or counts on
//!   the other one, where they touch.
//! - Rough mirrors and rough glass scatter: what comes from them is indirect light.
//!
//! # Cost
//! Room: 80 bytes a pixel. Times: `docs/caustics.md`.

use std::f32::consts::TAU;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Scale, Texture,
    TextureOptions, TexturePool, ViewHint,
};
use glam::Vec3;

use super::{CausticFilter, CausticLight, CausticsSettings};
use crate::frame::LightData;
use crate::paths::{EVERYWHERE, cone_height, seen_area};
use crate::rays::TraceFacts;
use crate::scene::{SceneFacts, SceneGpu};
use crate::{Kit, Pass, shaders};

const LIGHT: ViewHint = ViewHint::scaled(
    "What caustics bring, as a white surface would show it; its second layer: mean directions towards the light",
    Mapping::Exposed,
    Scale::Nits,
);
const PLACES: ViewHint =
    ViewHint::new("Places that caustics may fall on, in bits: black is none", Mapping::Number);
const SPREAD: ViewHint = ViewHint::new(
    "Photons of each pixel red, pixels that they spread to each side green, both as x / (1 + x)",
    Mapping::Range,
);
const TILES: ViewHint = ViewHint::new(
    "How far photons spread at most, of 8 × 8 pixels: a colour each, black is none",
    Mapping::Number,
);
const SUMS: ViewHint = ViewHint::scaled(
    "Light of photons by pixel, eight words each: hotter is more",
    Mapping::Heat,
    Scale::By(1.0 / 65_536.0),
);

/// Words before the pixels' in `photon_sums`, and words of a pixel.
const TOTALS: u64 = 16;
const PIXEL_WORDS: u64 = 8;
/// Lamps that photons come from at most.
const MOST_LAMPS: usize = 1024;
/// Steps of all lamps' light towards the casters.
const STEPS: f64 = (1u32 << 30) as f64;
/// As many lanes as an H200 runs at once: more wait, and those of fewer photons each for the longest of their neighbours'.
/// Measured: 1 M photons through a knot took 2.6 ms, and 3.3, 2.9, 3.2 and 4.3 with 2¹⁵, 2¹⁷, 2¹⁸ and 2²⁰ lanes.
const BUSY_LANES: u32 = 1 << 16;
/// Pixels a side of a tile.
const TILE: u32 = 8;

/// Twin of `CausticPass` in `photons.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct CausticPass {
    pub target_lo: [f32; 3],
    pub diagonal: f32,
    pub target_hi: [f32; 3],
    pub pixel_m2: f32,
    pub photons: u32,
    pub lanes: u32,
    pub first: u32,
    pub seed: u32,
    pub interfaces: u32,
    pub disperses: u32,
    pub lamps: u32,
    pub step: f32,
    pub enough: f32,
    pub widest: u32,
    pub reserved0: u32,
    pub reserved1: u32,
}

/// Where a frame's photons come from and go to.
#[derive(Clone, Copy, Debug)]
pub struct PhotonsWanted<'a> {
    /// Lights as shaders see them.
    pub lights: &'a [LightData],
    /// The box around what causes caustics, m.
    pub casters_ws: Option<(Vec3, Vec3)>,
    /// The scene's box, m.
    pub bounds_ws: (Vec3, Vec3),
    /// Of a pixel one metre ahead on the camera's axis, m²; of an orthographic camera's pixel.
    pub pixel_m2: f32,
    /// What random numbers start from.
    pub seed: u32,
    /// Of a still's frames which one this is, and 1/√ of how many there are.
    pub round: u32,
    /// See `round`.
    pub share: f32,
}

/// What a frame's photons are.
#[derive(Clone, Debug)]
pub struct PhotonPlan {
    pass: CausticPass,
    lamps: Vec<[f32; 4]>,
    /// Lumens of a step of the sums.
    pub step_lm: f32,
}

impl PhotonPlan {
    /// Chooses lamps by what they send towards the casters. `None` where there is no such light: nothing is to be done.
    pub fn new(settings: &CausticsSettings, wanted: &PhotonsWanted<'_>) -> Option<Self> {
        let target = wanted.casters_ws?;
        let (lamps, flux) = lamps(wanted.lights, target)?;
        let photons = settings.photons;
        let before = u64::from(wanted.round) * u64::from(photons);
        // Another sequence each time that the numbers of photons begin anew.
        let begun = (before >> 32) as u32;
        let step = (flux / STEPS) as f32;
        let spreads = settings.filter == CausticFilter::Adaptive;
        let (lo, hi) = wanted.bounds_ws;
        let pass = CausticPass {
            target_lo: target.0.to_array(),
            diagonal: lo.distance(hi),
            target_hi: target.1.to_array(),
            pixel_m2: wanted.pixel_m2,
            photons,
            lanes: photons.min(BUSY_LANES),
            first: before as u32,
            seed: wanted.seed.wrapping_add(begun.wrapping_mul(0x9e37_79b9)),
            interfaces: settings.interfaces,
            disperses: u32::from(settings.dispersion),
            lamps: lamps.len() as u32,
            step,
            enough: settings.filter_photons as f32 * wanted.share * wanted.share,
            widest: if spreads { settings.filter_width.min(TILE) } else { 0 },
            reserved0: 0,
            reserved1: 0,
        };
        Some(Self { pass, lamps, step_lm: step })
    }
}

/// The lamps that shine towards a box, brightest first: the chance of one up to each, of each, and which it is. With all
/// their light, lm, by its brightest channel.
fn lamps(lights: &[LightData], target: (Vec3, Vec3)) -> Option<(Vec<[f32; 4]>, f64)> {
    let fluxes = (0u32..).zip(lights).map(|(index, light)| (index, f64::from(flux_towards(light, target))));
    let mut fluxes: Vec<_> = fluxes.filter(|(_, flux)| flux.is_finite() && *flux > 0.0).collect();
    fluxes.sort_by(|a, b| b.1.total_cmp(&a.1));
    fluxes.truncate(MOST_LAMPS);
    let total: f64 = fluxes.iter().map(|(_, flux)| flux).sum();
    let mut below = 0.0;
    let entries = fluxes.into_iter().map(|(index, flux)| {
        below += flux;
        [(below / total) as f32, (flux / total) as f32, f32::from_bits(index), 0.0]
    });
    let entries: Vec<_> = entries.collect();
    // A step is a number that the GPU divides by.
    (!entries.is_empty() && total / STEPS > f64::from(f32::MIN_POSITIVE)).then_some((entries, total))
}

/// What a lamp sends towards a box at most, lm, by its brightest channel.
fn flux_towards(light: &LightData, target: (Vec3, Vec3)) -> f32 {
    let peak = Vec3::from(light.intensity).max_element();
    if light.kind == LightData::DIRECTIONAL {
        return peak * seen_area(light.direction_ws.into(), target);
    }
    let own = if light.kind == LightData::SPOT { 1.0 - light.cone_rad.cos() } else { EVERYWHERE };
    peak * TAU * own.min(cone_height(light.position_ws.into(), target))
}

/// What light is traced through and seen on.
#[derive(Clone, Copy, Debug)]
pub struct PhotonInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// Geometry and materials.
    pub scene: &'a SceneGpu,
    /// The trees' words.
    pub tracer: &'a Buffer,
    /// Of the surface buffer.
    pub depth: &'a Texture,
    /// The surface buffer.
    pub surface: &'a Texture,
}

/// What photons are summed up in, of one size.
#[derive(Debug)]
pub struct PhotonRoom {
    /// See the module's page; the first words tell what became of the light, in the order of `photons.wesl`.
    pub sums: Buffer,
    places: Texture,
    spread: Texture,
    tiles: Texture,
    light: CausticLight,
    pass: Buffer,
    lamps: Buffer,
}

/// The passes.
#[derive(Debug)]
pub struct PhotonTrace {
    places: ComputePipeline,
    trace: ComputePipeline,
    spread: ComputePipeline,
    gather: ComputePipeline,
}

impl Pass for PhotonTrace {
    type Key = SceneFacts;

    fn compile(kit: &Kit, facts: &SceneFacts) -> Result<Self, GpuError> {
        let make = |entry, constants: &[_]| {
            let shared = [&kit.frame_layout, &kit.scene_layout];
            ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &shared, constants)
        };
        let traced = [&facts.constants()[..], &TraceFacts::of(*facts).constants()].concat();
        Ok(Self {
            places: make("caustics/photon_trace/places.cs.wesl", &[])?,
            trace: make("caustics/photon_trace/trace.cs.wesl", &traced)?,
            spread: make("caustics/photon_trace/spread.cs.wesl", &[])?,
            gather: make("caustics/photon_trace/gather.cs.wesl", &[])?,
        })
    }

    fn serves(has: &SceneFacts, wanted: &SceneFacts) -> bool {
        has.serve(*wanted)
    }
}

impl PhotonTrace {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the picture has too many pixels for the adapter.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        room: &'r mut Option<PhotonRoom>,
    ) -> Result<&'r PhotonRoom, GpuError> {
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let needed = 4 * (TOTALS + PIXEL_WORDS * pixels);
        let limit = gpu.limits.max_storage_buffer_binding_size;
        if needed > limit {
            return Err(GpuError::TooLarge {
                what: "the photons of so large a picture".into(),
                needed,
                limit,
                unit: "bytes",
                advice: "render it smaller, or without caustics",
            });
        }
        let serves = |room: &PhotonRoom| {
            let has = room.spread.options();
            [has.width, has.height] == size
        };
        Ok(chiaro_gpu::keep(room, serves, || {
            let lend = |name, size: [u32; 2], format, hint| {
                let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
                let options = TextureOptions::new(size[0], size[1], format, usage);
                pool.lend(gpu, name, Life::Frame, options).described(hint)
            };
            let buffer = |name, bytes, usage| {
                Buffer::new(gpu, name, Life::Frame, bytes, usage | BufferUsages::COPY_DST)
            };
            PhotonRoom {
                sums: buffer("photon_sums", needed, BufferUsages::STORAGE | BufferUsages::COPY_SRC)
                    .described(SUMS),
                places: lend("caustic_places", size, TextureFormat::Rgba32Uint, PLACES),
                spread: lend("caustic_spread", size, TextureFormat::Rgba32Float, SPREAD),
                tiles: lend(
                    "caustic_tiles",
                    size.map(|side| side.div_ceil(TILE)),
                    TextureFormat::R32Uint,
                    TILES,
                ),
                light: CausticLight::new(gpu, pool, size, LIGHT),
                pass: buffer("caustic_pass", size_of::<CausticPass>() as u64, BufferUsages::UNIFORM),
                lamps: buffer("caustic_lamps", (16 * MOST_LAMPS) as u64, BufferUsages::UNIFORM),
            }
        }))
    }

    /// Sends photons, and finds what they bring each pixel.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        plan: &PhotonPlan,
        inputs: &PhotonInputs<'_>,
        room: &PhotonRoom,
    ) -> CausticLight {
        frame.upload(&room.pass, &[plan.pass]);
        frame.upload(&room.lamps, &plan.lamps);
        frame.clear(&room.sums);
        let groups = [inputs.group, inputs.scene.group()];
        let options = room.spread.options();
        let pixels = Dispatch::Threads([options.width, options.height, 1]);
        let shown = [
            ("depth", inputs.depth.into()),
            ("surface", inputs.surface.into()),
            ("caustic_places", (&room.places).into()),
        ];
        frame.compute("caustics/places", &self.places, &groups, &shown, pixels);
        let seen = [
            ("caustic_places", (&room.places).into()),
            ("caustic_pass", (&room.pass).into()),
            ("photon_sums", (&room.sums).into()),
        ];
        let traced = [("tracer", inputs.tracer.into()), ("caustic_lamps", (&room.lamps).into())];
        let lanes = Dispatch::Threads([plan.pass.lanes, 1, 1]);
        frame.compute("caustics/photons", &self.trace, &groups, &[&seen[..], &traced].concat(), lanes);
        let made = [("caustic_spread", (&room.spread).into()), ("caustic_tiles", (&room.tiles).into())];
        let binds = [&seen[..], &made].concat();
        frame.compute("caustics/spread", &self.spread, &groups, &binds, pixels);
        let binds = [&seen[..], &made, &[room.light.bind()]].concat();
        frame.compute("caustics/gather", &self.gather, &groups, &binds, pixels);
        room.light.clone()
    }
}
