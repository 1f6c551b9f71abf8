//! Where virtual lights are put (Keller 1997, "Instant Radiosity"): places of the reflective shadow maps that together carry
//! the light of all of them.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | tiles, by view | `rsm`, lights, the picture's surface buffer, `tile_worths` of the frame before | `tile_worths`: f32, of a lumen | eight lanes each |
//! | scan | `rsm`, those | `rsm_sums`: flux and worth of tiles, and their sums as a tree, two f32 each | a workgroup for 512 tiles, one for what is above |
//! | place | those, lights | `candidates`: [`Vpl`]s, of flux 0 where nothing was found, whose `worths` are −1 | a lane each |
//! | weigh, by view | those, the picture's surface buffer | `worths`: f32, and the threshold of each | four lanes each |
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
//! unbiased whatever w and c are, because no chance is 0. With one candidate a light those that would bring less than their share
//! are left out by chance.
//!
//! # Where they are from frame to frame
//! A few lights that go elsewhere are not seen, many at once flicker (Laine et al. 2007, "Incremental Instant Radiosity for Real-Time
//! Indirect Illumination"; Hedman et al. 2016, "Sequential Monte Carlo Instant Radiosity"). All follows from numbers that belong
//! to places of the maps and stay:
//!
//! - A part of the tree of tiles that has n candidates gives its left half ⌊n p + u⌋ of them, p being that half's share of the weight
//!   and u a number of the part's own. Each has what it is expected to in the mean, and to within about one; if p changes by
//!   ε, one goes to the other side with the chance n ε, and the others stay. Summing up all weights and taking every so many of
//!   them (systematic sampling) would shift all behind a change.
//! - A candidate is kept where q passes a number of its tile's and its own. With more candidates than lights, how many are kept
//!   differs by about √N, so that 2 √N fewer are wanted.
//! - Its block of points follows from the tile, so that its shadow map is the same as before.
//! - What a lumen of a tile brings the picture is a mean over frames, a tenth of it this one's: a camera that goes has other pilot
//!   pixels each frame.
//! - While lamps and things rest, the numbers u turn by 1/256 to 3/256 a frame ([`VplSet::drift`]), so that a few lights go at
//!   a time and the mean over frames ([`super::accumulate`]) is that of several sets.
//!
//! Sets that a still averages have u turned by other shares for each level of the tree, so that together they are spread evenly
//! as well.
//!
//! # Limits
//! The chance is a whole number of 1/32768. What is known of the picture is 256 pixels without shadows: a candidate next
//! to a pilot pixel is kept more often than it deserves, and carries less. Places belong to maps: lights of a lamp that moves go with
//! it.
//!
//! # Cost
//! 40 bytes a candidate, 32 a light, 20 a tile, up to twice as many where they are no power of two. 1,024 candidates or tiles' eighths × 256 pixels × 30 flop are 8 Mflop each; what takes
//! time are six dispatches of 6 µs, and 13 to 20 steps down the tree for each candidate.

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

/// Tiles whose sums a workgroup finds.
const SCANNED: u32 = 512;
/// A frame's share of what tiles are worth, the rest being that of the frames before.
const FRESH: f32 = 0.1;

const SUMS: ViewHint = ViewHint::new(
    "Flux and worth of reflective shadow maps' tiles, and their sums as a tree",
    Mapping::Number,
);
const TILE_WORTHS: ViewHint = ViewHint::new(
    "What a lumen of each tile of the reflective shadow maps would bring the picture, unshadowed",
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
    pub(crate) fresh: f32,
    pub(crate) stride: u32,
    pub(crate) keeps_all: u32,
    pub(crate) seed: u32,
    pub(crate) drift: u32,
    pub(crate) reserved: u32,
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
    slots: Slots,
    // Candidates, tiles.
    sizes: [u32; 2],
    // Whether `tile_worths` holds any.
    has_worths: bool,
}

/// Which set of virtual lights a frame has.
#[derive(Clone, Copy, Debug)]
pub struct VplSet {
    /// What all is turned by.
    pub seed: u32,
    /// Its number among those that are averaged: each goes on where the one before ended.
    pub round: u32,
    /// Steps that frames of a moving picture have gone to other sets, few lights a step.
    pub drift: u32,
    /// Whether it goes on from the frame before.
    pub continues: bool,
}

impl VplRoom {
    /// Two f32 each, flux and worth of the maps' tiles as a tree, see `sampling.wesl`; those of number 1 are of all, lumens.
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
    // The tree's lower parts, and its upper ones.
    scan: [ComputePipeline; 2],
    place: ComputePipeline,
    weigh: ComputePipeline,
    choose: ComputePipeline,
}

impl Pass for Vpls {
    type Key = ();

    fn compile(kit: &Kit, (): &()) -> Result<Self, GpuError> {
        let frame = std::slice::from_ref(&kit.frame_layout);
        let make = |entry, with_frame: bool, constants: &[_]| {
            let shared: Vec<_> = frame.iter().filter(|_| with_frame).collect();
            ComputePipeline::new(&kit.gpu, &kit.library, &shaders::plain(entry), &shared, constants)
        };
        let ((tiles, scan), (place, (weigh, choose))) = parallel::join(
            || {
                let of =
                    |top| make("indirect/vpls/scan.cs.wesl", false, &[("TOP", f64::from(u8::from(top)))]);
                let scan = || Ok([of(false)?, of(true)?]);
                parallel::join(|| make("indirect/vpls/tiles.cs.wesl", true, &[]), scan)
            },
            || {
                let choose = || make("indirect/vpls/choose.cs.wesl", false, &[]);
                let weigh = || parallel::join(|| make("indirect/vpls/weigh.cs.wesl", true, &[]), choose);
                parallel::join(|| make("indirect/vpls/place.cs.wesl", true, &[]), weigh)
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
            let kept = |name, bytes, usage| Buffer::new(gpu, name, Life::Kept, bytes, usage);
            VplRoom {
                // Sets that rest stay.
                vpls: kept("vpls", vpls * each, copied),
                count: kept("vpl_count", 16 * u64::from(SETS), copied | BufferUsages::UNIFORM),
                uniform: make(
                    "vpl_sampling",
                    size_of::<SamplingData>() as u64,
                    BufferUsages::UNIFORM | BufferUsages::COPY_DST,
                ),
                sums: make(
                    "rsm_sums",
                    16 * tiles.next_power_of_two().max(2),
                    storage | BufferUsages::COPY_DST,
                )
                .described(SUMS),
                tile_worths: Buffer::new(gpu, "tile_worths", Life::Kept, 4 * tiles, storage)
                    .described(TILE_WORTHS),
                candidates: make("vpl_candidates", candidates * each, storage),
                worths: make("vpl_worths", 8 * candidates, storage).described(WORTHS),
                slots,
                sizes,
                has_worths: false,
            }
        })
    }

    /// Chooses virtual lights from the maps, for what a surface buffer's depth and surface show.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        (settings, set): (&IndirectSettings, VplSet),
        (group, (depth, surface)): (&Group, (&Texture, &Texture)),
        (plan, maps): (&RsmPlan, &RsmRoom),
        room: &mut VplRoom,
    ) {
        let VplSet { seed, round, drift, continues } = set;
        let by_view = settings.sampling == VplSampling::View;
        let evenly = settings.sampling == VplSampling::Halton;
        let goes_on = std::mem::replace(&mut room.has_worths, by_view) && continues;
        let data = SamplingData {
            tiles: plan.tiles(),
            views: plan.views.len() as u32,
            candidates: candidates(settings),
            vpls: settings.vpls,
            round,
            first_block: round.wrapping_mul(room.slots.all()),
            mode: u32::from(evenly),
            by_view: u32::from(by_view),
            turn: [turn(seed, 0), turn(seed, 1)],
            fresh: if goes_on { FRESH } else { 1.0 },
            stride: stride(plan.views.len(), candidates(settings)),
            keeps_all: u32::from(!by_view),
            seed,
            drift,
            reserved: 0,
        };
        frame.upload(&room.uniform, &[data]);
        if data.views == 0 {
            // Those of other sets stay.
            frame.upload(&room.count, &[[0u32; 4]]);
            // Pictures of the maps look for tiles here.
            frame.clear(&room.sums);
            return;
        }
        let sampling = ("sampling", (&room.uniform).into());
        let (rsm, candidates) = (("rsm", (&maps.rsm).into()), ("candidates", (&room.candidates).into()));
        let (sums, worths) = (("rsm_sums", (&room.sums).into()), ("worths", (&room.worths).into()));
        let one = Dispatch::Groups([1, 1, 1]);
        let each = Dispatch::Threads([data.candidates, 1, 1]);
        let views = ("rsm_views", (&maps.views).into());
        let seen = [("depth", depth.into()), ("surface", surface.into())];
        // Without them something stands in their place that nobody reads.
        let tile_worths = if by_view { (&room.tile_worths).into() } else { rsm.1 };
        let tile_worths = ("tile_worths", tile_worths);
        if by_view {
            let binds = [&[sampling, rsm, views, tile_worths], &seen[..]].concat();
            let shares = Dispatch::Threads([8 * data.tiles, 1, 1]);
            frame.compute("indirect/vpl_tiles", &self.tiles, &[group], &binds, shares);
        }
        let binds = [sampling, rsm, tile_worths, sums];
        let below = Dispatch::Groups([data.tiles.next_power_of_two().div_ceil(SCANNED), 1, 1]);
        frame.compute("indirect/vpl_scan", &self.scan[0], &[], &binds, below);
        if data.tiles > SCANNED {
            frame.compute("indirect/vpl_scan", &self.scan[1], &[], &binds, one);
        }
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
