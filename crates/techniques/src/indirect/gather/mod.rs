//! Light of virtual point lights (VPLs) where the camera looks: interleaved gathering and its filter.
//!
//! What every pixel gets from every VPL (Keller 1997, "Instant Radiosity") is a sum that changes slowly from pixel to pixel. So of
//! each square of n × n pixels every one takes another n²th of the VPLs, and a mean over n × n neighbours on the same surface
//! holds them all (Keller & Heidrich 2001, "Interleaved Sampling"; Segovia et al. 2006, "Non-interleaved Deferred Shading of
//! Interleaved Sample Patterns"). The pixels of a square's same place are a sub-image; where the paper sorts pictures into
//! sub-images and back, a workgroup here takes pixels n apart.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | gather, once an atlas | surface, VPLs, their maps or the scene's trees | `irradiance`, with `clamp_loss` where asked for | 64 lanes 8 × 16 pixels of one sub-image |
//! | rows, columns (`edges`) | `irradiance`, surface | `irradiance` | a lane a pixel |
//! | discontinuities, rows, columns (`discontinuity`) | surface; `irradiance` | `discontinuities`; `irradiance` | the same |
//!
//! | input | format | space, unit |
//! | --- | --- | --- |
//! | depth, surface | of the surface buffer | |
//! | VPLs | [`Vpl`](super::Vpl) | world, m, lm |
//! | their number | a uniform of four u32 for each set of VPLs: how many; of the first bounce see [`super::compensate`]; number of the first | |
//! | `given_back`, where there is any | Rgba16Float: irradiance / π | nits · radiance scale |
//! | maps | [`IsmAtlas`], in the order of the VPLs | |
//! | output: `irradiance` | Rgba16Float: irradiance / π, at most 65,000; log2 of the view depth, −60 on sky and unlit surfaces | nits · radiance scale; m |
//! | `discontinuities` | R32Float: 1 on one, 0 elsewhere | |
//! | `clamp_loss` | R32Float: share of the unbounded sum that the bound takes, before filtering | 0..1 |
//!
//! `lookup.wesl` tells what light there is at a place that a pixel shows: `bounced_at`.
//!
//! # Gather
//! Pixel (x, y) is of sub-image k = x mod n + n (y mod n), and is lit by VPLs k · N / n² up to (k + 1) · N / n² of each
//! bounce's N, a contiguous block of the sequence that they come from, n² times as brightly. A VPL of flux Φ that scatters as Lambert's law has it, and
//! stands for a disc of radius r, gives
//!
//! E = Φ / π · cos θ_vpl · cos θ_x · V / (d² + (clamp · r)²).
//!
//! With clamp = 1 this is exact where a disc is seen from its axis: its form factor is r² / (d² + r²). It is bounded by
//! Φ / (π r²), the disc's own radiosity; without the bound a corner has bright spots (Keller 1997). θ_x is the shading normal's,
//! and what is behind the triangle gives nothing. V is 1, what the VPL's imperfect shadow map tells ([`super::ism`]), or what
//! a ray finds: from the receiver as shadows by rays start, to a place a thousandth of the VPL's radius above it.
//!
//! # Filter
//! `edges`: a mean over n pixels of a row, then of a column; with even n over n + 1, whose ends count half. So every sub-image has
//! the same weight, and on a flat wall no pattern is left. A neighbour counts less the farther it is from the pixel's plane
//! (fully up to a tenth of the window's width, nothing from half of it on) and the more its normal differs,
//! max(n · n', 0)⁸, so that normal maps leave most of it. What an edge takes, the pixel n to the other side gets, which is of
//! the same sub-image: no pattern along edges of what is n pixels wide.
//!
//! `discontinuity`: Roberts' cross on depth and normals marks pixels; a Gaussian of σ = 0.3 · width, rows first, stops before
//! marked ones, and leaves them as they are. What it leaves of the pattern is a few per cent where width and n go together.
//!
//! # Limits
//! - Surfaces narrower than n pixels keep a pattern: what they miss of VPLs is nowhere near.
//! - The filter takes irradiance for equal over n pixels: shadows at contacts are blurred by as much, and so is light within r
//!   of a VPL.
//! - Where rows are cut differently from each other, as on rough silhouettes, sub-images have weights that differ a little.
//! - Half floats round each pixel by up to 2⁻¹¹, and each atlas after the first adds as much.
//!
//! # Cost
//! 1,024 VPLs, 4 × 4, 1920 × 1080: 64 VPLs a pixel, 133 M pairs of about 45 operations, and 75 with a map's look-up: at most 16
//! Gflop, at 50 Tflop/s 0.32 ms. Bytes: 20 a pixel read and 8 written, 58 MB; maps 64 MiB, of which a sub-image takes 4 MiB that
//! stay in caches, read from there at 4 bytes a pair, in sectors of 32: 4 GB, at about 10 TB/s 0.4 ms. The filter reads 8 + 20
//! bytes a tap from caches, and 36 a pixel and pass from memory: 149 MB, 0.05 ms; 10 taps of about 150 operations are 3 Gflop,
//! 0.06 ms. Room: 33 MB, and 8 each for discontinuities and loss.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, Life, Mapping, Scale, Texture,
    TextureOptions, TexturePool, ViewHint,
};

use super::ism::IsmAtlas;
use super::settings::{IndirectSettings, IrradianceFilter, Technique};
use super::slots::SOURCES;
use crate::rays::TraceFacts;
use crate::scene::{SceneFacts, SceneGpu};
use crate::{Kit, Pass, shaders};

const IRRADIANCE: ViewHint = ViewHint::scaled(
    "Indirect light that arrives, as a white surface would show it",
    Mapping::Exposed,
    Scale::Nits,
);
const SOURCE_IRRADIANCE: ViewHint = ViewHint::scaled(
    "Light of what glows and surrounds the scene that arrives, as a white surface would show it",
    Mapping::Exposed,
    Scale::Nits,
);
const BETWEEN: ViewHint = ViewHint::scaled(
    "Indirect light that arrives, smoothed along rows or in part",
    Mapping::Exposed,
    Scale::Nits,
);
const DISCONTINUITIES: ViewHint =
    ViewHint::new("Where indirect light is not smoothed: white is an edge", Mapping::Heat);
const CLAMP_LOSS: ViewHint =
    ViewHint::new("Share of indirect light that bounding virtual lights' nearness takes", Mapping::Heat);

/// Pixels across what a workgroup shades of a sub-image; as many down by rays, else twice as many.
const SIDE: u32 = 8;

/// Pixels of a workgroup of `edges.cs.wesl`, along the window and across it.
const EDGES_GROUP: [u32; 2] = [32, 8];

/// What the passes know; `place.wesl` holds its twin.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct GatherData {
    pub(crate) interleave: u32,
    pub(crate) clamp: f32,
    pub(crate) first: u32,
    pub(crate) end: u32,
    pub(crate) adds: u32,
    pub(crate) filter_width: u32,
    pub(crate) discontinuity_depth: f32,
    pub(crate) discontinuity_normal: f32,
    pub(crate) compensates: u32,
    pub(crate) gives_back: u32,
    pub(crate) sets: u32,
    pub(crate) reserved0: u32,
}

/// How it is found whether a place sees a VPL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// Everything does.
    All,
    /// By imperfect shadow maps.
    Ism {
        /// From four texels instead of one.
        closer: bool,
    },
    /// By rays.
    Rays {
        /// Whether see-through surfaces take their share instead of stopping light.
        tint: bool,
    },
}

/// What the shaders are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GatherKey {
    /// Who sees whom.
    pub sight: Sight,
    /// What smooths.
    pub filter: IrradianceFilter,
    /// Whether it smooths more than 4 × 4 pixels.
    pub wide: bool,
    /// Whether it is told what the bound takes.
    pub clamp_loss: bool,
    /// Whether light of what glows and surrounds the scene is gathered, too.
    pub sources: bool,
    /// What rays may meet; the default without rays.
    pub facts: SceneFacts,
}

impl GatherKey {
    /// What settings that leave nothing to the adapter ask for; `tint`: see-through surfaces take their share of rays.
    pub fn new(settings: &IndirectSettings, tint: bool, facts: SceneFacts) -> Option<Self> {
        let sight = match settings.technique {
            Technique::Rsm => Sight::All,
            Technique::Ism => Sight::Ism { closer: settings.ism_closer },
            Technique::Traced => Sight::Rays { tint },
            Technique::Auto | Technique::Ambient | Technique::None => return None,
        };
        let rays = matches!(sight, Sight::Rays { .. });
        let facts = if rays { facts } else { SceneFacts::default() };
        let filter = settings.filter;
        let wide = filter == IrradianceFilter::Edges && settings.interleave > 4;
        let (clamp_loss, sources) = (settings.clamp_loss, settings.sources > 0);
        Some(Self { sight, filter, wide, clamp_loss, sources, facts })
    }
}

/// Whose light is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gathers {
    /// Of VPLs that scatter: indirect light.
    Bounced,
    /// Of VPLs on what shines itself ([`super::sources`]): direct light.
    Sources,
}

impl Gathers {
    /// A bit for each set of VPLs.
    fn sets(self) -> u32 {
        match self {
            Self::Bounced => !(1 << SOURCES),
            Self::Sources => 1 << SOURCES,
        }
    }
}

/// What light is gathered of, and where.
#[derive(Clone, Copy, Debug)]
pub struct GatherInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// The scene, which rays alone need.
    pub scene: Option<&'a SceneGpu>,
    /// Of the surface buffer.
    pub depth: &'a Texture,
    /// The surface buffer.
    pub surface: &'a Texture,
    /// [`Vpl`](super::Vpl)s.
    pub vpls: &'a Buffer,
    /// For each set four words: how many, the flux that bounds of the first one go by, and the number of the first.
    pub vpl_count: &'a Buffer,
    /// Whose light is gathered.
    pub light: Gathers,
    /// Their maps; as many as the room is for, none without maps.
    pub atlases: &'a [IsmAtlas],
    /// The scene's trees, which rays alone need.
    pub tracer: Option<&'a Buffer>,
    /// What the bounds take, where it is given back: see [`super::compensate`].
    pub given_back: Option<&'a Texture>,
}

/// Light that was gathered at each pixel: Rgba16Float, irradiance / π in nits · radiance scale, log2 of the view depth.
#[derive(Clone, Debug)]
pub struct Gathered {
    /// Indirect light.
    pub bounced: Texture,
    /// Straight from what glows and surrounds the scene, where that was gathered.
    pub sourced: Option<Texture>,
}

impl Gathered {
    /// Both.
    pub fn parts(&self) -> (Option<&Texture>, Option<&Texture>) {
        (Some(&self.bounced), self.sourced.as_ref())
    }
}

/// What light is gathered into, of one size.
#[derive(Debug)]
pub struct GatherRoom {
    irradiance: Texture,
    // Where there are several atlases or a filter.
    between: Option<Texture>,
    discontinuities: Option<Texture>,
    // The second where there are several atlases.
    losses: Option<[Texture; 2]>,
    // One an atlas.
    uniforms: Vec<Buffer>,
}

impl GatherRoom {
    /// Rgba16Float: irradiance / π in nits · radiance scale, log2 of the view depth.
    pub fn irradiance(&self) -> &Texture {
        &self.irradiance
    }

    /// R32Float: the share of light that bounding VPLs' nearness takes, where that is asked for.
    pub fn clamp_loss(&self) -> Option<&Texture> {
        self.losses.as_ref().map(|[last, _]| last)
    }

    /// R32Float: 1 where light is not smoothed, with the filter that knows discontinuities.
    pub fn discontinuities(&self) -> Option<&Texture> {
        self.discontinuities.as_ref()
    }
}

/// What smooths.
#[derive(Debug)]
enum Filter {
    None,
    Edges([ComputePipeline; 2]),
    Discontinuity { find: ComputePipeline, smooth: [ComputePipeline; 2] },
}

/// The passes.
#[derive(Debug)]
pub struct Gather {
    shade: ComputePipeline,
    // Of VPLs some of which are infinitely far.
    shade_sources: Option<ComputePipeline>,
    filter: Filter,
    key: GatherKey,
}

impl Pass for Gather {
    type Key = GatherKey;

    fn compile(kit: &Kit, key: &GatherKey) -> Result<Self, GpuError> {
        let shared = [&kit.frame_layout, &kit.scene_layout];
        let make = |permutation, constants: &[_]| {
            ComputePipeline::new(&kit.gpu, &kit.library, &permutation, &shared, constants)
        };
        let flag = |on| f64::from(u8::from(on));
        let constants = match key.sight {
            Sight::All => Vec::new(),
            Sight::Ism { closer } => vec![("ISM_CLOSER", flag(closer))],
            Sight::Rays { tint } => {
                let mut all = key.facts.constants().to_vec();
                all.extend(TraceFacts::of(key.facts).constants());
                all.push(("TINTS", flag(tint)));
                all
            }
        };
        let sight = (matches!(key.sight, Sight::Ism { .. }), matches!(key.sight, Sight::Rays { .. }));
        let both = |permutation: Permutation| {
            let along = |columns| make(permutation.clone(), &[("ALONG_COLUMNS", flag(columns))]);
            Ok([along(false)?, along(true)?])
        };
        Ok(Self {
            shade: make(shaders::gather(sight, key.clamp_loss, false), &constants)?,
            shade_sources: key
                .sources
                .then(|| make(shaders::gather(sight, false, true), &constants))
                .transpose()?,
            filter: match key.filter {
                IrradianceFilter::None => Filter::None,
                IrradianceFilter::Edges => Filter::Edges(both(shaders::edges(key.wide))?),
                IrradianceFilter::Discontinuity => Filter::Discontinuity {
                    find: make(shaders::plain("indirect/gather/discontinuity.cs.wesl"), &[])?,
                    smooth: both(shaders::plain("indirect/gather/gaussian.cs.wesl"))?,
                },
            },
            key: *key,
        })
    }

    fn serves(has: &GatherKey, wanted: &GatherKey) -> bool {
        has.facts.serve(wanted.facts) && *has == GatherKey { facts: has.facts, ..*wanted }
    }
}

impl Gather {
    /// Room for a picture size and so many atlases, one or none alike: what is there if it serves. Not inside a frame.
    pub fn room<'r>(
        &self,
        (gpu, pool): (&Gpu, &TexturePool),
        size: [u32; 2],
        atlases: usize,
        which: Gathers,
        room: &'r mut Option<GatherRoom>,
    ) -> &'r GatherRoom {
        let loses = self.key.clamp_loss && which == Gathers::Bounced;
        let atlases = atlases.max(1);
        let filters = !matches!(self.filter, Filter::None);
        let finds = matches!(self.filter, Filter::Discontinuity { .. });
        let serves = |room: &GatherRoom| {
            let has = room.irradiance.options();
            [has.width, has.height] == size
                && room.between.is_some() == (filters || atlases > 1)
                && room.discontinuities.is_some() == finds
                && room.losses.is_some() == loses
                && room.uniforms.len() == atlases
        };
        chiaro_gpu::keep(room, serves, || {
            let lend = |name, format, hint| {
                let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
                let options = TextureOptions::new(size[0], size[1], format, usage);
                pool.lend(gpu, name, Life::Frame, options).described(hint)
            };
            let light = |name, hint| lend(name, TextureFormat::Rgba16Float, hint);
            let loss = |name| lend(name, TextureFormat::R32Float, CLAMP_LOSS);
            let uniform = |_| {
                let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
                Buffer::new(gpu, "gather", Life::Frame, size_of::<GatherData>() as u64, usage)
            };
            let (name, between, hint) = match which {
                Gathers::Bounced => ("irradiance", "irradiance_between", IRRADIANCE),
                Gathers::Sources => ("source_irradiance", "source_irradiance_between", SOURCE_IRRADIANCE),
            };
            GatherRoom {
                irradiance: light(name, hint),
                between: (filters || atlases > 1).then(|| light(between, BETWEEN)),
                discontinuities: finds
                    .then(|| lend("discontinuities", TextureFormat::R32Float, DISCONTINUITIES)),
                losses: loses.then(|| {
                    let last = loss("clamp_loss");
                    let between = if atlases > 1 { loss("clamp_loss_between") } else { last.clone() };
                    [last, between]
                }),
                uniforms: (0..atlases).map(uniform).collect(),
            }
        })
    }

    /// Gathers light and smooths it.
    ///
    /// # Panics
    /// When maps, the scene or its trees are missing that the key asks for, or what shines itself was not compiled for, or there are more atlases than the room is for, or
    /// `edges` is to smooth more pixels than it was compiled for.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        settings: &IndirectSettings,
        inputs: &GatherInputs<'_>,
        room: &GatherRoom,
    ) -> Texture {
        let reaches = self.key.wide || settings.interleave <= 4 || !matches!(self.filter, Filter::Edges(_));
        assert!(reaches, "indirect.interleave: compiled for 4 at most");
        self.record_gather(frame, settings, inputs, room);
        if settings.interleave > 1 {
            self.record_filter(frame, inputs, room);
        }
        room.irradiance.clone()
    }

    fn record_gather(
        &self,
        frame: &mut Frame<'_>,
        settings: &IndirectSettings,
        inputs: &GatherInputs<'_>,
        room: &GatherRoom,
    ) {
        let n = settings.interleave.max(1);
        let [width, height] = size(room);
        let rows = if matches!(self.key.sight, Sight::Rays { .. }) { SIDE } else { 2 * SIDE };
        let groups = [width.div_ceil(SIDE * n), height.div_ceil(rows * n)];
        let dispatch = Dispatch::Groups([groups[0], groups[1], n * n]);
        let by_map = matches!(self.key.sight, Sight::Ism { .. });
        let (name, shade) = match (inputs.light, &self.shade_sources) {
            (Gathers::Bounced, _) => ("indirect/gather", &self.shade),
            (Gathers::Sources, Some(shade)) => ("indirect/gather_sources", shade),
            (Gathers::Sources, None) => panic!("gathering was not compiled for what shines itself"),
        };
        let count = if by_map { inputs.atlases.len() } else { 1 };
        let mut shared = vec![inputs.group];
        shared.extend(inputs.scene.map(SceneGpu::group));
        for (number, uniform) in (0..count).zip(&room.uniforms) {
            let atlas = by_map.then(|| &inputs.atlases[number]);
            let data = GatherData {
                interleave: n,
                clamp: settings.clamp,
                first: atlas.map_or(0, |atlas| atlas.first),
                end: atlas.map_or(u32::MAX, |atlas| atlas.first + atlas.tiles),
                adds: u32::from(number > 0),
                filter_width: settings.filter_width,
                discontinuity_depth: settings.discontinuity_depth,
                discontinuity_normal: settings.discontinuity_normal,
                compensates: u32::from(inputs.given_back.is_some()),
                // Once.
                gives_back: u32::from(inputs.given_back.is_some() && number + 1 == count),
                sets: inputs.light.sets(),
                reserved0: 0,
            };
            frame.upload(uniform, &[data]);
            // Back and forth, so that the last one writes the result. The first reads nothing, of whatever texture.
            let (before, after) = turns(count - 1 - number, room);
            let before = if number > 0 { before } else { inputs.depth };
            let mut binds = pixel_binds(inputs, uniform);
            binds.extend::<[Bind<'_>; 5]>([
                ("vpls", inputs.vpls.into()),
                ("vpl_count", inputs.vpl_count.into()),
                ("before", before.into()),
                ("given_back", inputs.given_back.unwrap_or(inputs.depth).into()),
                ("gathered", after.into()),
            ]);
            if let Some(losses) = &room.losses {
                let turn = (count - 1 - number) % 2;
                let before = if number > 0 { &losses[turn ^ 1] } else { inputs.depth };
                binds.extend([("lost_before", before.into()), ("clamp_loss", (&losses[turn]).into())]);
            }
            binds.extend(atlas.into_iter().flat_map(IsmAtlas::binds));
            binds.extend(inputs.tracer.map(|tracer| ("tracer", tracer.into())));
            frame.compute(name, shade, &shared, &binds, dispatch);
        }
    }

    fn record_filter(&self, frame: &mut Frame<'_>, inputs: &GatherInputs<'_>, room: &GatherRoom) {
        let [width, height] = size(room);
        let pixels = Dispatch::Threads([width, height, 1]);
        let mut binds = pixel_binds(inputs, &room.uniforms[0]);
        let smooth = match (&self.filter, &room.discontinuities) {
            (Filter::Edges(smooth), _) => smooth,
            (Filter::Discontinuity { find, smooth }, Some(mask)) => {
                let found = [&binds[..], &[("discontinuity", mask.into())]].concat();
                frame.compute("indirect/discontinuities", find, &[inputs.group], &found, pixels);
                binds.push(("discontinuities", mask.into()));
                smooth
            }
            _ => return,
        };
        let names = ["indirect/filter_rows", "indirect/filter_columns"];
        for ((pass, name), turn) in smooth.iter().zip(names).zip([1, 0]) {
            let (before, after) = turns(turn, room);
            let smoothed = [("irradiance", before.into()), ("smoothed", after.into())];
            let dispatch = match &self.filter {
                Filter::Edges(_) => {
                    let [long, wide] = EDGES_GROUP;
                    // Along rows first.
                    let group = if turn == 1 { [long, wide] } else { [wide, long] };
                    Dispatch::Groups([width.div_ceil(group[0]), height.div_ceil(group[1]), 1])
                }
                _ => pixels,
            };
            frame.compute(name, pass, &[inputs.group], &[&binds[..], &smoothed].concat(), dispatch);
        }
    }
}

fn size(room: &GatherRoom) -> [u32; 2] {
    let options = room.irradiance.options();
    [options.width, options.height]
}

/// What is read and what is written so many passes before the last.
fn turns(left: usize, room: &GatherRoom) -> (&Texture, &Texture) {
    let between = room.between.as_ref().unwrap_or(&room.irradiance);
    if left.is_multiple_of(2) { (between, &room.irradiance) } else { (&room.irradiance, between) }
}

/// The handles of `place.wesl`.
fn pixel_binds<'a>(inputs: &GatherInputs<'a>, uniform: &'a Buffer) -> Vec<Bind<'a>> {
    vec![("depth", inputs.depth.into()), ("surface", inputs.surface.into()), ("gather", uniform.into())]
}
