//! Further bounces of indirect light: virtual point lights (VPLs) where the light of others arrives, found in their imperfect
//! shadow maps (Ritschel et al. 2008, "Imperfect Shadow Maps for Efficient Computation of Indirect Illumination", section 5,
//! imperfect reflective shadow maps).
//!
//! A map tells which point of the scene a VPL sees in each direction, and a point knows its place, normal and albedo: the map is
//! a reflective one. So each further bounce takes its VPLs from the maps of the one before, and draws maps of its own. What
//! glows and what is around the scene ([`super::sources`]) is a bounce before the first.
//!
//! | step, for each further bounce | reads | writes | by |
//! | --- | --- | --- | --- |
//! | place, for each atlas | VPLs of the bounce before, their maps, points | VPLs behind those that are there, `vpl_count` | a workgroup |
//! | spread | the same | their radii | a workgroup of 64 a VPL |
//! | their maps: [`super::ism`] | | | |
//!
//! | input | format | space, unit |
//! | --- | --- | --- |
//! | points | 16 bytes, see `point.wesl` | world, m |
//! | VPLs | [`Vpl`](super::Vpl): each set has slots of its own, one after the other ([`Slots`]) | world, m, lm |
//! | `vpl_count` | for each set four u32: how many, not read, number of the first, reserved | |
//!
//! # Flux
//! Each of M tries starts from a VPL v that is chosen by its share of the sum of fluxes by luminance, p_v = L_v / ΣL, in a
//! direction by the cosine: that is how Lambert's law sends Φ_v out, so it carries Φ_v / p_v / M = (ΣL / M) Φ_v / L_v, and what
//! it meets scatters albedo times that. Tries are a Halton sequence, base 5 for v and 2 and 3 for directions. What finds nothing
//! has left the scene. The VPL is at the point itself, not where the ray meets the point's plane: that may lie beyond an edge,
//! behind the next wall, and see nothing from there.
//!
//! Filled texels know a depth but no point: they take that of the nearest ring of texels around that has any, and of those the
//! one whose place is nearest to the filled one's.
//!
//! # Radius
//! At a place that gets the irradiance E of the bounce before, there are M E / ΣL of M tries a square metre, so one stands for
//! ΣL / (M E). E is the sum over all VPLs of the bounce before as gathering has it, with their shadows and bounds, by luminance.
//! Of several atlases the first that holds any of them tells of the others, by the share of flux in it. E is taken for no less
//! than a hundredth of ΣL over the scene's area.
//!
//! # Limits
//! - Surfaces scatter from whichever side is lit, as if both had the same albedo.
//! - What points know: one albedo each, filtered over its area; none of gloss, which the first bounce takes for Lambert's where it
//!   is rough; nothing of normal maps. Blended surfaces scatter as often as their alpha says; what transmits scatters nothing.
//! - Points nearer to a VPL's plane than a tenth of their disc's radius are not in its map: near edges a little light is lost.
//! - Errors add up from bounce to bounce, and each has fewer VPLs.
//!
//! # Cost
//! A quarter of the first bounce's VPLs for the second, half as many for each further one; maps and gathering take as much for each
//! VPL as for those of the first. Spread, 256 VPLs × 1,024: 0.26 M pairs of about 90 operations, 24 Mflop. Three to five
//! dispatches of 6 µs a bounce. Room: 48 bytes.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life};

use super::ism::{IsmAtlas, IsmInputs};
use super::slots::Slots;
use super::vpls::turn;
use crate::{Kit, Pass, shaders};

/// Where there is no second set that lights; twin of the one in `bounce.wesl`.
const NO_SET: u32 = u32::MAX;

/// See `bounce.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct BounceData {
    pub(crate) vpl_set: u32,
    pub(crate) first: u32,
    pub(crate) most: u32,
    pub(crate) first_block: u32,
    pub(crate) place: u32,
    pub(crate) appends: u32,
    pub(crate) turn: [f32; 2],
    pub(crate) lit_by: [u32; 2],
    pub(crate) shift: f32,
    pub(crate) reserved0: u32,
}

/// What the passes are told through.
#[derive(Debug)]
pub struct BounceRoom {
    uniform: Buffer,
}

/// The passes.
#[derive(Debug)]
pub struct Bounces {
    place: ComputePipeline,
    spread: ComputePipeline,
}

impl Pass for Bounces {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let make = |entry| ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &[], &[]);
        Ok(Self {
            place: make("indirect/bounces/place.cs.wesl")?,
            spread: make("indirect/bounces/spread.cs.wesl")?,
        })
    }
}

impl Bounces {
    /// Not inside a frame.
    pub fn room(&self, gpu: &Gpu) -> BounceRoom {
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let bytes = size_of::<BounceData>() as u64;
        BounceRoom { uniform: Buffer::new(gpu, "bounce", Life::Frame, bytes, usage) }
    }

    /// Makes the VPLs of the set `inputs.set` where those of one or two others, `lit_by`, shine, by their maps. `round` counts the
    /// frames of a still: each goes on where the one before ended.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (slots, seed, round): (&Slots, u32, u32),
        (inputs, lit_by): (&IsmInputs<'_>, &[u32]),
        atlases: &[IsmAtlas],
        room: &BounceRoom,
    ) {
        let lighting: Vec<_> = lit_by.iter().map(|set| slots.of(*set)).collect();
        let own = slots.of(inputs.set);
        let most = own.len() as u32;
        // Dimensions after those of the first bounce.
        let turned = |dimension| turn(seed, 3 * inputs.set + dimension);
        let mut data = BounceData {
            vpl_set: inputs.set,
            first: own.start,
            most,
            first_block: round.wrapping_mul(slots.all()),
            place: round.wrapping_mul(most),
            appends: 0,
            turn: [turned(0), turned(1)],
            lit_by: [0, 1].map(|number| lit_by.get(number).copied().unwrap_or(NO_SET)),
            shift: turned(2),
            reserved0: 0,
        };
        let bounce = ("bounce", (&room.uniform).into());
        let vpls = ("vpls", inputs.vpls.into());
        let count = ("vpl_count", inputs.vpl_count.into());
        let holds = |atlas: &&IsmAtlas| {
            let last = atlas.first + atlas.tiles;
            lighting.iter().any(|slots| atlas.first < slots.end && slots.start < last)
        };
        for atlas in atlases.iter().filter(holds) {
            frame.upload(&room.uniform, &[data]);
            let [words, uniform] = atlas.binds();
            let binds = [bounce, words, uniform, vpls, count, ("points", inputs.points.into())];
            frame.compute("indirect/bounce_place", &self.place, &[], &binds, Dispatch::Groups([1, 1, 1]));
            data.appends = 1;
        }
        if let Some(atlas) = atlases.iter().find(holds) {
            let [words, uniform] = atlas.binds();
            let binds = [bounce, words, uniform, vpls, count];
            frame.compute(
                "indirect/bounce_spread",
                &self.spread,
                &[],
                &binds,
                Dispatch::Groups([most, 1, 1]),
            );
        }
    }
}
