//! Where virtual lights are put (Keller 1997, "Instant Radiosity"): places of the reflective shadow maps that together carry
//! the light of all of them.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | tiles, by view | `rsm`, lights, the picture's surface buffer | `tile_worths`: f32 | eight lanes each |
//! | scan | `rsm`, those | `rsm_sums`: weights of all tiles up to each, then each's, f32 | a workgroup |
//! | place | those, lights | `candidates`: [`Vpl`]s, of flux 0 where nothing was found, whose `worths` are −1 | a lane each |
//! | weigh, by view | those, the picture's surface buffer | `worths`: f32 | four lanes each |
//! | choose | those | `vpls`; `vpl_count`: how many, and the mean of their fluxes by octaves | a workgroup |
//!
//! # Flux
//! A candidate that is found with the chance p stands for Φ / (p M), of M candidates: by flux p is a texel's share of all weight,
//! so that all carry the same luminance; evenly p is one texel of a light's map and M the light's share of the candidates. It
//! stands for as much area, as a disc: its radius bounds how near it may be to what it lights. By view p is a texel's share of
//! its tile's flux times the tile's chance, 0.8 w / Σw + 0.2 Φ / ΣΦ: w is what the tile would bring the picture. So there are more
//! and smaller ones near what is seen.
//!
//! # By what they bring the picture
//! w of a tile is its light on 16 × 16 pixels, none of them shadowed, no pixel nearer than half its own footprint; c of
//! a candidate is the same. It is kept with the chance q = min(1, N (0.8 c / Σc + 0.2 / M')), M' of M lit, and carries Φ / q:
//! unbiased whatever w and c are, because no chance is 0. Of all candidates one draw decides (systematic sampling, Madow & Madow
//! 1944), from place to place in the maps, so that as many lights are kept as there are chances. With one candidate a light
//! those that would bring less than their share are left out by chance: 781 of 1,024 remain in sponza, 960 in sibenik.
//!
//! # Limits
//! The chance is a whole number of 1/32768. What is known of the picture is 256 pixels without shadows: a candidate next
//! to a pilot pixel is kept more often than it deserves, and carries less.
//!
//! # Cost
//! 40 bytes a candidate, 32 a light, 8 a tile. 1,024 candidates or tiles' eighths × 256 pixels × 30 flop are 8 Mflop each; what takes
//! time are five dispatches of 6 µs.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Texture, ViewHint,
    parallel,
};

use super::rsm::{RsmPlan, RsmRoom};
use super::settings::{IndirectSettings, VplSampling};
use super::slots::SETS;
use super::slots::Slots;
use super::vpl::Vpl;
use crate::{Kit, Pass, shaders};

const SUMS: ViewHint = ViewHint::new("Flux of reflective shadow maps up to each tile", Mapping::Number);
const TILE_WORTHS: ViewHint = ViewHint::new(
    "What each tile of the reflective shadow maps would bring the picture, unshadowed",
    Mapping::Number,
);
const WORTHS: ViewHint =
    ViewHint::new("What each candidate would bring the picture, unshadowed", Mapping::Number);

/// See `sampling.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub(crate) struct SamplingData {
    pub(crate) tiles: u32,
    pub(crate) views: u32,
    pub(crate) candidates: u32,
    pub(crate) vpls: u32,
    pub(crate) round: u32,
    pub(crate) first_block: u32,
    pub(crate) mode: u32,
    pub(crate) by_view: u32,
    pub(crate) turn: [f32; 2],
    pub(crate) chance: f32,
    pub(crate) stride: u32,
    pub(crate) keeps_all: u32,
    pub(crate) reserved0: u32,
    pub(crate) reserved1: u32,
    pub(crate) reserved2: u32,
}

/// Candidates of these settings.
pub fn candidates(settings: &IndirectSettings) -> u32 {
    let each = if settings.sampling == VplSampling::View { settings.candidates } else { 1 };
    settings.vpls * each
}

/// Virtual lights and what they are chosen from.
#[derive(Debug)]
pub struct VplRoom {
    /// [`Vpl`]s.
    pub vpls: Buffer,
    /// For each set four words: how many; of the first bounce the mean of their fluxes by octaves, f32, lumens; the number of
    /// the first.
    pub count: Buffer,
    uniform: Buffer,
    sums: Buffer,
    tile_worths: Buffer,
    candidates: Buffer,
    worths: Buffer,
    chances: Buffer,
    slots: Slots,
    // Candidates, tiles.
    sizes: [u32; 2],
}

impl VplRoom {
    /// f32: the flux of all tiles of the maps up to each, lumens; the last is that of all.
    pub fn sums(&self) -> &Buffer {
        &self.sums
    }

    /// Which lights there may be.
    pub fn slots(&self) -> &Slots {
        &self.slots
    }
}

/// The passes.
#[derive(Debug)]
pub struct Vpls {
    tiles: ComputePipeline,
    scan: ComputePipeline,
    place: ComputePipeline,
    weigh: ComputePipeline,
    choose: ComputePipeline,
}

impl Pass for Vpls {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let frame = std::slice::from_ref(&kit.frame_layout);
        let make = |entry, with_frame: bool| {
            let shared: Vec<_> = frame.iter().filter(|_| with_frame).collect();
            ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &shared, &[])
        };
        let ((tiles, scan), (place, (weigh, choose))) = parallel::join(
            || {
                let scan = || make("indirect/vpls/scan.cs.wesl", false);
                parallel::join(|| make("indirect/vpls/tiles.cs.wesl", true), scan)
            },
            || {
                let choose = || make("indirect/vpls/choose.cs.wesl", false);
                let weigh = || parallel::join(|| make("indirect/vpls/weigh.cs.wesl", true), choose);
                parallel::join(|| make("indirect/vpls/place.cs.wesl", true), weigh)
            },
        );
        Ok(Self { tiles: tiles?, scan: scan?, place: place?, weigh: weigh?, choose: choose? })
    }
}

impl Vpls {
    /// Room for as many as settings ask for, placed in so many tiles: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        gpu: &Gpu,
        settings: &IndirectSettings,
        (slots, tiles): (Slots, u32),
        room: &'r mut Option<VplRoom>,
    ) -> &'r VplRoom {
        let sizes = [candidates(settings), tiles.max(1)];
        let serves = |room: &VplRoom| (room.slots, room.sizes) == (slots, sizes);
        chiaro_gpu::keep(room, serves, || {
            let [candidates, tiles] = sizes.map(u64::from);
            // No fewer than are placed, before clusters are made of them.
            let vpls = u64::from(slots.all().max(settings.vpls));
            let each = size_of::<Vpl>() as u64;
            let storage = BufferUsages::STORAGE;
            let copied = storage | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
            let make = |name, bytes, usage| Buffer::new(gpu, name, Life::Frame, bytes, usage);
            VplRoom {
                vpls: make("vpls", vpls * each, copied),
                count: make("vpl_count", 16 * u64::from(SETS), copied | BufferUsages::UNIFORM),
                uniform: make(
                    "vpl_sampling",
                    size_of::<SamplingData>() as u64,
                    BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                ),
                sums: make("rsm_sums", 8 * tiles, storage).described(SUMS),
                tile_worths: make("tile_worths", 4 * tiles, storage).described(TILE_WORTHS),
                candidates: make("vpl_candidates", candidates * each, storage),
                worths: make("vpl_worths", 4 * candidates, storage).described(WORTHS),
                chances: make("vpl_chances", 4 * candidates, storage),
                slots,
                sizes,
            }
        })
    }

    /// Chooses virtual lights from the maps, for what a surface buffer's depth and surface show. `round` counts the frames of a still: each goes on where the one before ended.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (settings, seed, round): (&IndirectSettings, u32, u32),
        (group, (depth, surface)): (&Group, (&Texture, &Texture)),
        (plan, maps): (&RsmPlan, &RsmRoom),
        room: &VplRoom,
    ) {
        let data = SamplingData {
            tiles: plan.tiles(),
            views: plan.views.len() as u32,
            candidates: candidates(settings),
            vpls: settings.vpls,
            round,
            first_block: round.wrapping_mul(room.slots.all()),
            mode: u32::from(settings.sampling == VplSampling::Halton),
            by_view: u32::from(settings.sampling == VplSampling::View),
            turn: [turn(seed, 0), turn(seed, 1)],
            chance: turn(seed.wrapping_add(round.wrapping_mul(0x9e37_79b9)), 2),
            stride: stride(plan.views.len(), candidates(settings)),
            keeps_all: u32::from(settings.sampling != VplSampling::View),
            reserved0: 0,
            reserved1: 0,
            reserved2: 0,
        };
        frame.upload(&room.uniform, &[data]);
        if data.views == 0 {
            frame.clear(&room.count);
            // Nobody reads them, but they are bound.
            frame.clear(&room.vpls);
            return;
        }
        let sampling = ("sampling", (&room.uniform).into());
        let (rsm, candidates) = (("rsm", (&maps.rsm).into()), ("candidates", (&room.candidates).into()));
        let (sums, worths) = (("rsm_sums", (&room.sums).into()), ("worths", (&room.worths).into()));
        let one = Dispatch::Groups([1, 1, 1]);
        let each = Dispatch::Threads([data.candidates, 1, 1]);
        let views = ("rsm_views", (&maps.views).into());
        let seen = [("depth", depth.into()), ("surface", surface.into())];
        let by_view = settings.sampling == VplSampling::View;
        // Without them something stands in their place that nobody reads.
        let tile_worths = if by_view { (&room.tile_worths).into() } else { rsm.1 };
        let tile_worths = ("tile_worths", tile_worths);
        if by_view {
            let binds = [&[sampling, rsm, views, tile_worths], &seen[..]].concat();
            let shares = Dispatch::Threads([8 * data.tiles, 1, 1]);
            frame.compute("indirect/vpl_tiles", &self.tiles, &[group], &binds, shares);
        }
        frame.compute("indirect/vpl_scan", &self.scan, &[], &[sampling, rsm, tile_worths, sums], one);
        let binds = [sampling, rsm, sums, views, candidates, worths];
        frame.compute("indirect/vpl_place", &self.place, &[group], &binds, each);
        if data.keeps_all == 0 {
            let binds = [&[sampling, candidates, worths], &seen[..]].concat();
            let shares = Dispatch::Threads([4 * data.candidates, 1, 1]);
            frame.compute("indirect/vpl_weigh", &self.weigh, &[group], &binds, shares);
        }
        let binds = [
            sampling,
            candidates,
            worths,
            ("chances", (&room.chances).into()),
            ("vpls", (&room.vpls).into()),
            ("vpl_count", (&room.count).into()),
        ];
        frame.compute("indirect/vpl_choose", &self.choose, &[], &binds, one);
    }
}

/// What a seed turns a sequence by, 0..1; nothing for seed 0.
pub(super) fn turn(seed: u32, dimension: u32) -> f32 {
    let mut v = seed ^ dimension.wrapping_mul(0x85eb_ca6b);
    for multiplier in [0x7feb_352d, 0x846c_a68b] {
        v = (v ^ (v >> 15)).wrapping_mul(multiplier);
    }
    let chance = (v >> 8) as f32 / (1 << 24) as f32;
    if seed == 0 && dimension < 2 { 0.0 } else { chance }
}

/// Of candidates that several lights are dealt, how far apart neighbours in the order of the lights are: coprime to how many
/// there are, near the golden section of it, so that any run of candidates has its share of every light.
fn stride(views: usize, candidates: u32) -> u32 {
    if views < 2 || candidates < 4 {
        return 1;
    }
    let coprime = |stride: &u32| {
        let (mut a, mut b) = (candidates, *stride);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let golden = (f64::from(candidates) * 0.618_034) as u32;
    (golden..candidates).find(coprime).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_visit_every_candidate() {
        for candidates in [1, 2, 3, 4, 5, 16, 1000, 1024, 4096, 65_535] {
            let stride = stride(13, candidates);
            let mut seen = vec![false; candidates as usize];
            for i in 0..candidates {
                seen[((i * stride) % candidates) as usize] = true;
            }
            assert!(seen.iter().all(|seen| *seen), "{candidates} by {stride}");
        }
    }

    #[test]
    fn seeds_turn_sequences_differently() {
        assert_eq!([turn(0, 0), turn(0, 1)], [0.0; 2]);
        assert!((1..100).all(|seed| (0.0..1.0).contains(&turn(seed, 0)) && turn(seed, 0) != turn(seed, 1)));
    }
}
