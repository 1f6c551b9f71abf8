//! Light that bounding virtual lights' nearness takes, given back by what the picture shows (Novák, Engelhardt & Dachsbacher
//! 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global Illumination with Virtual Point Lights").
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | radiosity | surface buffer, lamps by froxel, their shadows | `radiosity` | a lane a pixel |
//! | given back | that, surface buffer, `vpl_count` | `given_back` | a lane a pixel |
//!
//! | output | format | unit |
//! | --- | --- | --- |
//! | `radiosity` | Rgba16Float: M / π, what the surface scatters on of the light of lamps, as reflective maps have it | nits · radiance scale |
//! | `given_back` | Rgba16Float: irradiance / π, which gathering adds before it smooths | nits · radiance scale |
//!
//! # What is lost
//! A VPL of flux Φ stands for a disc of radius r, so for the radiosity M = Φ / (π r²) around it. Bounded by b it gives its share of
//! d² / (d² + b²) ([`super::gather`]), and over all sets of VPLs a place x loses what surfaces y send it of
//!
//! E = ∫ M / π · cos θ_x cos θ_y / d² · b² / (d² + b²) dA (Novák et al., eq. 5, whose bound is a least d²).
//!
//! That falls with d⁻⁴ beyond b: what is lost comes from near, mostly from what the picture shows. So that b is known at y
//! without its VPLs, all are bounded as if they carried the same flux F, which is their mean by octaves
//! ([`super::vpls`]): b² = clamp² F / (π M), by luminance. Where VPLs are placed by flux alone, that is each one's own disc.
//! M is of lamps' light alone, as VPLs of the first bounce are: what is given back is not scattered on, and VPLs of further bounces
//! are bounded by their own discs and get nothing back.
//!
//! # Estimate
//! The integral over the picture's pixels has a density of 1 / ρ² around x, as many places in each octave of the distance ρ, because
//! it is not known how near a corner is: ρ = 0.7 (H / 0.7)^((i + u) / 512) pixels, H the picture's height, at angles by the golden
//! section. Of each square of n × n pixels every one takes another n²th of the 512, n² times as brightly, and gathering's filter
//! takes their mean. A pixel shows an area A, the disc of which bounds d: cos θ_x cos θ_y A b² / ((d² + A / π) (d² + A / π + b²)).
//!
//! # Limits
//! - What is out of the picture, or hidden in it, gives nothing back: light at an edge changes as what lights it leaves the picture.
//! - Nothing stands between x and y: thin blockers, stairs and balustrades are shone through.
//! - The last pixels before an edge get less than they lost, as places start at 0.7 pixels.
//! - Places are few: single frames have faint bands along edges of surfaces that are seen from the side. Frames of a still look at
//!   others each.
//! - VPLs of less flux than F are bounded farther out than their own discs. See-through layers are bounded by discs, and get nothing
//!   back.
//!
//! # Cost
//! 1920 × 1080, 4 × 4: `radiosity` 20 bytes a pixel read and 8 written, and lamps with shadows as shading has them;
//! 32 places a pixel of 28 bytes, 1.9 GB from caches, at about 10 TB/s 0.19 ms, and 66 M × 70 flop, 0.09 ms. Gathering reads 8
//! bytes a pixel more. Room: 33 MB. Measured in sponza on an H200: 0.076 and 0.274 ms.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Scale, Texture,
    TextureOptions, TexturePool, ViewHint,
};

use super::settings::IndirectSettings;
use crate::scene::{SceneFacts, SceneGpu};
use crate::shadow::{Lookup, ShadowOutputs};
use crate::{Kit, Pass, shaders};

const RADIOSITY: ViewHint = ViewHint::scaled(
    "What surfaces scatter on of the light of lamps, as Lambert's law has it",
    Mapping::Exposed,
    Scale::Nits,
);
const GIVEN_BACK: ViewHint = ViewHint::scaled(
    "Light that bounding virtual lights' nearness takes, as a white surface would show it, before smoothing",
    Mapping::Exposed,
    Scale::Nits,
);

/// What the pass knows; `nearby.cs.wesl` holds its twin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct CompensateData {
    pub(crate) interleave: u32,
    pub(crate) clamp: f32,
    pub(crate) turn: [f32; 2],
}

/// What is lit, and by what.
#[derive(Clone, Copy, Debug)]
pub struct CompensateInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// The scene, which shadows by rays need.
    pub scene: &'a SceneGpu,
    /// Of the surface buffer.
    pub depth: &'a Texture,
    /// The surface buffer.
    pub surface: &'a Texture,
    /// Shadows of lamps.
    pub shadows: &'a ShadowOutputs,
    /// Which lamps reach where.
    pub light_grid: &'a Buffer,
    /// In its second word the flux that the bounds of virtual lights go by; a uniform of at least 16 bytes.
    pub vpl_count: &'a Buffer,
}

/// What it is written into, of one size.
#[derive(Debug)]
pub struct CompensateRoom {
    radiosity: Texture,
    given_back: Texture,
    uniform: Buffer,
}

impl CompensateRoom {
    /// Rgba16Float: irradiance / π in nits · radiance scale, of each pixel's share of places.
    pub fn given_back(&self) -> &Texture {
        &self.given_back
    }
}

/// The passes.
#[derive(Debug)]
pub struct Compensate {
    radiosity: ComputePipeline,
    nearby: ComputePipeline,
}

impl Pass for Compensate {
    type Key = (Lookup, SceneFacts);

    fn compile(kit: &Kit, &(shadow, facts): &Self::Key) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let make = |entry, constants: &[_]| {
            ComputePipeline::new(gpu, library, &entry, &[frame_layout, scene_layout], constants)
        };
        Ok(Self {
            radiosity: make(shaders::radiosity(shadow.source), &shadow.constants(gpu, shadow.facts(facts)))?,
            nearby: make(shaders::plain("indirect/compensate/nearby.cs.wesl"), &[])?,
        })
    }
}

impl Compensate {
    /// Room for a picture size: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        pool: &TexturePool,
        size: [u32; 2],
        room: &'r mut Option<CompensateRoom>,
    ) -> &'r CompensateRoom {
        let serves = |room: &CompensateRoom| {
            let has = room.radiosity.options();
            [has.width, has.height] == size
        };
        chiaro_gpu::keep(room, serves, || {
            let lend = |name, hint| {
                let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
                let options = TextureOptions::new(size[0], size[1], TextureFormat::Rgba16Float, usage);
                pool.lend(gpu, name, Life::Frame, options).described(hint)
            };
            let bytes = size_of::<CompensateData>() as u64;
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            CompensateRoom {
                radiosity: lend("radiosity", RADIOSITY),
                given_back: lend("given_back", GIVEN_BACK),
                uniform: Buffer::new(gpu, "compensate", Life::Frame, bytes, usage),
            }
        })
    }

    /// Finds what is to be given back; gathering adds it. `round` counts the frames of a still, each of which looks at other
    /// places.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (settings, round): (&IndirectSettings, u32),
        inputs: &CompensateInputs<'_>,
        room: &CompensateRoom,
    ) {
        // The plastic number's powers: no place comes twice (Roberts 2018).
        let turn = [0.754_877_67, 0.569_840_3].map(|step| (f64::from(round) * step).fract() as f32);
        let data = CompensateData { interleave: settings.interleave.max(1), clamp: settings.clamp, turn };
        frame.upload(&room.uniform, &[data]);
        let groups = [inputs.group, inputs.scene.group()];
        let options = room.radiosity.options();
        let pixels = Dispatch::Threads([options.width, options.height, 1]);
        let shown = [("depth", inputs.depth.into()), ("surface", inputs.surface.into())];
        let mut binds = inputs.shadows.binds();
        binds.extend(shown);
        binds.extend([("light_grid", inputs.light_grid.into()), ("radiosity", (&room.radiosity).into())]);
        frame.compute("indirect/radiosity", &self.radiosity, &groups, &binds, pixels);
        let binds = [
            shown[0],
            shown[1],
            ("compensate", (&room.uniform).into()),
            ("vpl_count", inputs.vpl_count.into()),
            ("radiosity", (&room.radiosity).into()),
            ("given_back", (&room.given_back).into()),
        ];
        frame.compute("indirect/given_back", &self.nearby, &groups, &binds, pixels);
    }
}
