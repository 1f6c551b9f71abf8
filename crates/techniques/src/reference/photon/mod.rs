//! Light paths: what no path from the camera finds, light of lamps without extent that mirrors and glass gather.
//!
//! Paths start at the emitters, by flux. At every surface that scatters they are connected with the camera (Dutré,
//! Lafortune & Willems 1993), which is exact and brings the picture all that is seen directly. What the camera sees in
//! mirrors or through glass cannot be connected: there, each lane leaves one of its photons in a hash grid (Hachisuka &
//! Jensen 2010), and the path tracer's paths gather those within a radius that shrinks from round to round (Knaus &
//! Zwicker 2011, "Progressive Photon Mapping: A Probabilistic Approach"), so that the estimate converges.
//!
//! Alone (as [`PhotonMap::new`] is told) the light paths make the whole picture of surfaces that scatter;
//! mirrors and glass stay black. Beside the path tracer they bring just the paths that leave mirrors and smooth interfaces
//! for a surface that scatters, and the path tracer leaves those out: nothing counts twice.
//!
//! | input | output | format | unit |
//! | --- | --- | --- | --- |
//! | frame, scene groups, `tracer`, `emitters` | splats, hash grid, photons in one buffer, see `map.wesl` | words | nits, lm |
//!
//! Bias: photons gathered are blurred by their radius, which the pixel's footprint bounds and which falls with the sixth
//! root of the rounds. A splat counts up to 2²² times what a white surface under the brightest light shows. Bent normals
//! are corrected for as Veach (1997, §5.3.2) says, clamped where they graze.
//!
//! Splats are kept for each part of the light: `caustics`, what no surface has scattered before the one that is seen,
//! `indirect`, and of light paths alone `direct`.
//!
//! Limits: beside the path tracer 48 bytes a pixel, and 40 a light path, of which larger pictures have fewer than pixels;
//! alone 72 bytes a pixel.

use std::f32::consts::PI;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, GroupLayout, Life};
use glam::Vec3;

use crate::paths::Interfaces;
use crate::rays::{TraceFacts, TraceScene};
use crate::reference::path::emitters::Emitters;
use crate::scene::{SceneFacts, SceneGpu};
use crate::shaders;

/// Twin of `PhotonPass` in `map.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct PhotonPass {
    pub scene_lo: [f32; 3],
    pub lanes: u32,
    pub scene_hi: [f32; 3],
    pub paths: u32,
    pub target_lo: [f32; 3],
    pub cells: u32,
    pub target_hi: [f32; 3],
    pub first_path: u32,
    pub size_px: [u32; 2],
    pub max_depth: u32,
    pub diffuse_bounces: u32,
    pub seed: u32,
    pub caustics_only: u32,
    pub pixel_m2: f32,
    pub step: f32,
    pub radius_m: f32,
    pub shrunk: f32,
    pub footprint: f32,
    pub share: f32,
    pub first_lane: u32,
    pub end_lane: u32,
    pub aimed: f32,
    pub reserved: u32,
}

/// Words of a pixel's splats of one part of the light, of a cell, and of a photon.
const SPLAT_WORDS: u64 = 6;
const CELL_WORDS: u64 = 2;
const PHOTON_WORDS: u64 = 8;
/// Fewer lanes than this are not worth a dispatch.
const LEAST_LANES: u64 = 1 << 12;
/// The first round's largest radius, as a part of the scene's diagonal.
const RADIUS: f32 = 1.0 / 200.0;
/// The first round's radius in pixels.
const RADIUS_PX: f32 = 3.0;
/// How much of a round's photons the next keeps (Knaus & Zwicker 2011, eq. 15).
const KEPT: f64 = 2.0 / 3.0;
/// Steps of a splat in the radiance of a white surface under the brightest light.
const STEPS: f32 = (1u32 << 28) as f32;

/// Where and how bright light paths are, of one view of a scene.
#[derive(Clone, Copy, Debug)]
pub struct PhotonView {
    /// Pixels.
    pub size_px: [u32; 2],
    /// Of a pixel one metre ahead on the camera's axis, m²; of an orthographic camera's pixel.
    pub pixel_m2: f32,
    /// Radiance of a white surface under the brightest light, nits.
    pub typical_nits: f32,
    /// World-space bounds of the scene, m.
    pub bounds_ws: (Vec3, Vec3),
    /// Bounds of what mirrors or refracts, m; `None` if nothing does.
    pub specular_ws: Option<(Vec3, Vec3)>,
}

/// What light paths leave behind.
#[derive(Clone, Debug)]
pub struct PhotonMap {
    pub(crate) words: Buffer,
    pub(crate) uniform: Buffer,
    /// Of the size that it was made for.
    pub view: PhotonView,
    alone: bool,
    lanes: u32,
    cells: u32,
}

impl PhotonMap {
    /// Room for the splats of a picture, and for as many light paths as it has pixels, or as fit; `alone`: no path
    /// tracer beside them brings what they would leave out.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the picture has too many pixels for the adapter.
    pub fn new(gpu: &Gpu, view: PhotonView, alone: bool) -> Result<Self, GpuError> {
        let pixels = u64::from(view.size_px[0]) * u64::from(view.size_px[1]);
        // Nothing gathers light paths that are alone.
        let (parts, kept) = if alone { (3, 0) } else { (2, 1) };
        let cells = |lanes: u64| kept * lanes.next_power_of_two();
        let bytes = |lanes: u64| {
            4 * (parts * SPLAT_WORDS * pixels + CELL_WORDS * cells(lanes) + kept * PHOTON_WORDS * lanes)
        };
        let limit = gpu.limits.max_storage_buffer_binding_size;
        let mut lanes = pixels.clamp(LEAST_LANES, 1 << 22);
        while bytes(lanes) > limit && lanes > LEAST_LANES {
            lanes /= 2;
        }
        if bytes(lanes) > limit {
            return Err(GpuError::TooLarge {
                what: "the light paths of so large a picture".into(),
                needed: bytes(lanes),
                limit,
                unit: "bytes",
                advice: "render it smaller",
            });
        }
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let words = Buffer::new(gpu, "photons", Life::Kept, bytes(lanes), usage);
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let uniform = Buffer::new(gpu, "photon_pass", Life::Kept, size_of::<PhotonPass>() as u64, usage);
        Ok(Self { words, uniform, view, alone, lanes: lanes as u32, cells: cells(lanes) as u32 })
    }

    /// Light paths for each sample of the picture.
    pub fn lanes(&self) -> u32 {
        self.lanes
    }
}

/// Which light paths.
#[derive(Clone, Copy, Debug)]
pub struct PhotonOptions {
    /// Most edges of a path; 0 = no limit.
    pub max_depth: u32,
    /// Most times that light is scattered from one surface to another.
    pub diffuse_bounces: u32,
    /// What random numbers start from.
    pub seed: u32,
}

/// The pass.
#[derive(Debug)]
pub struct PhotonTracer {
    pipeline: ComputePipeline,
}

impl PhotonTracer {
    /// Compiles the pass for scenes of these facts; `frame_layout` is one without shadow views.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(
        gpu: &Gpu,
        library: &Library,
        (frame_layout, scene_layout): (&GroupLayout, &GroupLayout),
        (facts, trees, interfaces): (SceneFacts, TraceFacts, Interfaces),
    ) -> Result<Self, GpuError> {
        let shared = &[frame_layout, scene_layout];
        let mut constants = [&facts.constants()[..], &trees.constants()].concat();
        constants.push(interfaces.constant());
        let pipeline = ComputePipeline::new(gpu, library, &shaders::photon_trace(), shared, &constants)?;
        Ok(Self { pipeline })
    }

    /// Traces some lanes of a round, which is the light paths of samples `first..first + samples`, all lanes in turn. `map`
    /// holds this round's alone: the first lane empties it.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (frame_group, scene): (&Group, &SceneGpu),
        (traced, emitters): (&TraceScene, &Emitters),
        options: PhotonOptions,
        (first, samples): (u32, u32),
        (map, lanes): (&PhotonMap, Range<u32>),
    ) {
        let PhotonView { size_px, pixel_m2, typical_nits, bounds_ws: (lo, hi), .. } = map.view;
        let (target_lo, target_hi) = map.view.specular_ws.unwrap_or((lo, hi));
        let round = f64::from(first / samples.max(1));
        // A radius' square falls like the product of (k + kept) / (k + 1), which goes as this power.
        let shrunk = (round + 1.0).powf(0.5 * (KEPT - 1.0)) as f32;
        // Paths that leave emitters for what is not there are none, and those that are left number all the same.
        let aimed = if map.alone { emitters.aimed } else { 1.0 };
        let paths = ((samples as f32 * aimed).ceil() as u32).clamp(1, samples.max(1));
        let before = u64::from(first / samples.max(1)) * u64::from(paths) * u64::from(map.lanes);
        // Another sequence each time that the numbers of paths begin anew.
        let begun = (before >> 32) as u32;
        let pass = PhotonPass {
            scene_lo: lo.to_array(),
            scene_hi: hi.to_array(),
            target_lo: target_lo.to_array(),
            target_hi: target_hi.to_array(),
            lanes: map.lanes,
            paths,
            cells: map.cells,
            first_path: before as u32,
            size_px,
            max_depth: options.max_depth,
            diffuse_bounces: options.diffuse_bounces,
            seed: options.seed.wrapping_add(begun.wrapping_mul(0x9e37_79b9)),
            caustics_only: u32::from(!map.alone),
            pixel_m2,
            step: typical_nits / STEPS,
            radius_m: RADIUS * (hi - lo).length().max(1e-30) * shrunk,
            shrunk,
            footprint: RADIUS_PX * (pixel_m2 / PI).sqrt(),
            share: 1.0 / (map.lanes as f32 * paths as f32),
            first_lane: lanes.start,
            end_lane: lanes.end,
            aimed: paths as f32 / samples.max(1) as f32,
            reserved: 0,
        };
        if lanes.start == 0 {
            frame.clear(&map.words);
        }
        frame.upload(&map.uniform, &[pass]);
        let binds = [
            ("photon_pass", (&map.uniform).into()),
            ("tracer", (&traced.words).into()),
            ("emitters", (&emitters.words).into()),
            ("photons", (&map.words).into()),
        ];
        let groups = (lanes.end - lanes.start).div_ceil(64);
        let rows = groups.div_ceil(65_535);
        let groups = Dispatch::Groups([groups.div_ceil(rows), rows, 1]);
        frame.compute("reference/photons", &self.pipeline, &[frame_group, scene.group()], &binds, groups);
    }
}
