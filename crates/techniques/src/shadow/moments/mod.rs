//! Shadow maps of moments: instead of depth they hold numbers whose mean over a region still says how much of the region
//! lies before a receiver, so that they can be blurred and mipmapped like pictures. See `warp.wesl` for what is stored,
//! `bounds.wesl` for what it tells, `lookup.wesl` for how it is sampled.
//!
//! | `shadow.representation` | a texel | format | source |
//! | --- | --- | --- | --- |
//! | variance | d, d² + ¼(dx² + dy²) | Rg32Float | Donnelly & Lauritzen 2006 |
//! | exponential | e^(c·d) | R32Float | Annen et al. 2008 |
//! | evsm2 | p = e^(c₊(2d − 1)), p² | Rg32Float | Lauritzen & McCool 2008 |
//! | evsm4 | p, p², n = −e^(−c₋(2d − 1)), n² | Rgba32Float | the same |
//! | moments | z, z², z³, z⁴ with z = 2d − 1 | Rgba32Float | Peters & Klein 2015 (Hamburger) |
//!
//! d is the linear depth of `linear_depth` in `projection.wesl`, 0 at the view's near plane and 1 at its far plane, where
//! there is nothing, too. All bounds are exact for a region of two depths and a receiver on the farther one; where more
//! depths overlap they let light through, which `shadow.bleed_reduction` cuts.
//!
//! | input | output | format | space, unit |
//! | --- | --- | --- | --- |
//! | maps | `shadow_moments` | above, with mips as `shadow.filter` says | a layer a view, as the maps |
//!
//! Rounding bounds what the numbers tell: a receiver closer behind a flat blocker than about a thousandth of the range
//! (variance, moments; warps less) is lit in part. `bounds.wesl` says how large each allowance is, and why.
//!
//! A filter spreads a slanted receiver over depth; what a representation would take for a shadow of the receiver on itself,
//! `lookup.wesl` allows for by the receiver's plane: a shift towards the light of up to √3 standard deviations (evsm4,
//! moments), or single depths compared with the plane (exponential).
//!
//! Limits: exponential maps leak light close behind casters, and where their filter's region is not planar compare 25 × 4
//! depths instead.
//! Cost: blurring a map reads its depth and writes, reads and writes moments: 4 + 3 · 4 · channels bytes a texel, at
//! 3 TB/s 0.039 ms for variance and 0.022 ms for exponential maps of 2048². Memory: 4 · channels bytes a texel of every
//! view, a third more with mips, and while blurring at most 64 MiB, or one layer.

mod weights;

pub(crate) use weights::Blur;

use chiaro_gpu::wgpu::{self, BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Bind, Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, History, Life, Mapping,
    Texture, TextureOptions, ViewHint,
};

use super::settings::{Representation, ShadowSettings};
use crate::{Kit, Pass, shaders};

const MOMENTS: ViewHint = ViewHint::new(
    "What was made of the depth, a layer each: the first three numbers, grey is 0",
    Mapping::Signed,
);

/// Rows of all layers that are blurred at once take at most this much, or are those of one layer.
const SCRATCH_BYTES: u64 = 64 << 20;
/// Side of the last mip: pixels that cover more than an eighth of a map see no shadow's shape any more.
const LAST_SIDE: u32 = 4;
/// Lists of views start where storage bindings may: every 256 bytes.
const LIST_WORDS: u32 = 64;
/// Rows and columns of a workgroup of `rows.cs.wesl` and `columns.cs.wesl`.
const ROWS_GROUP: [u32; 2] = [64, 4];
const COLUMNS_GROUP: [u32; 2] = [8, 64];

/// What `lookup.wesl` binds.
#[derive(Clone, Debug)]
pub struct MomentOutputs {
    /// A layer per view; a stand-in of one texel where maps hold depth.
    pub moments: Texture,
    /// The same for the sampler; a stand-in where 32-bit floats cannot be filtered.
    pub filtered: Texture,
    /// Blends texels and mips.
    pub sampler: wgpu::Sampler,
    /// How far a texel's filter reaches.
    pub filter: Buffer,
}

impl MomentOutputs {
    /// One texel of nothing, for maps that hold depth alone.
    pub fn stand_in(gpu: &Gpu) -> Self {
        let options =
            TextureOptions::new(1, 1, TextureFormat::Rgba16Float, TextureUsages::TEXTURE_BINDING).array(1);
        let stand_in = Texture::new(gpu, "shadow_moments", Life::Kept, options);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow_moments"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        });
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let filter = Buffer::new(gpu, "moment_filter", Life::Kept, 16, uniform);
        let (moments, filtered) = (stand_in.clone(), stand_in.clone());
        Self { moments, filtered, sampler, filter }
    }

    /// The handles of `lookup.wesl`.
    pub fn binds(&self) -> [Bind<'_>; 4] {
        [
            ("shadow_moments", (&self.moments).into()),
            ("shadow_moments_filtered", (&self.filtered).into()),
            ("moment_sampler", (&self.sampler).into()),
            ("moment_filter", (&self.filter).into()),
        ]
    }
}

/// Overrides of `lookup.wesl`, beside MOMENT_MIPS of the shadow maps' lookup.
pub fn constants(gpu: &Gpu, representation: Representation) -> [(&'static str, f64); 2] {
    let filtered = gpu.optional.float32_filterable;
    [("REPRESENTATION", f64::from(representation as u32)), ("FILTERED", filtered.into())]
}

/// What [`Moments`] are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MomentKey {
    representation: Representation,
    blurs: bool,
    mips: bool,
    float_maps: bool,
}

impl MomentKey {
    /// What settings ask for; `float_maps`: whether maps are R32Float instead of Depth32Float.
    pub fn new(settings: &ShadowSettings, float_maps: bool) -> Self {
        let representation = settings.representation;
        let held = representation != Representation::Depth;
        let (blurs, mips) = (held && settings.filter.blurs(), held && settings.filter.mips());
        Self { representation, blurs, mips, float_maps }
    }
}

#[derive(Debug)]
enum Making {
    /// Maps hold depth.
    Nothing,
    Convert(ComputePipeline),
    Blur {
        rows: ComputePipeline,
        columns: ComputePipeline,
    },
}

/// What texels depend on beside depth. Where it changes, all are made again.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Content {
    blur: Blur,
    exponents: [f32; 2],
}

impl Content {
    fn new(settings: &ShadowSettings) -> Self {
        let exponents = match settings.representation {
            Representation::Exponential => [settings.exponent, 0.0],
            Representation::Evsm2 => [settings.evsm_positive, 0.0],
            Representation::Evsm4 => [settings.evsm_positive, settings.evsm_negative],
            _ => [0.0; 2],
        };
        Self { blur: Blur::new(settings), exponents }
    }
}

/// The passes that make maps of moments.
#[derive(Debug)]
pub struct Moments {
    key: MomentKey,
    making: Making,
    halve: Option<ComputePipeline>,
}

/// Maps of moments of one size and number.
#[derive(Debug)]
pub struct MomentRoom {
    outputs: MomentOutputs,
    key: MomentKey,
    // Side and layers.
    size: [u32; 2],
    scratch: Option<Texture>,
    blur: Buffer,
    lists: Buffer,
    made: History<Content, ()>,
}

impl MomentRoom {
    /// What the passes have made.
    pub fn outputs(&self) -> MomentOutputs {
        self.outputs.clone()
    }
}

impl Pass for Moments {
    type Key = MomentKey;

    fn compile(kit: &Kit, key: &MomentKey) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, .. } = kit;
        let MomentKey { representation, float_maps, .. } = *key;
        let kind = [("REPRESENTATION", f64::from(representation as u32))];
        let channels = representation.channels();
        let pipeline = |permutation, constants: &[(&str, f64)]| {
            ComputePipeline::new(gpu, library, &permutation, &[frame_layout], constants)
        };
        let making = if key.representation == Representation::Depth {
            Making::Nothing
        } else if key.blurs {
            Making::Blur {
                rows: pipeline(shaders::moments_rows(channels, float_maps), &kind)?,
                columns: pipeline(shaders::moments_columns(channels), &[])?,
            }
        } else {
            Making::Convert(pipeline(shaders::moments_convert(channels, float_maps), &kind)?)
        };
        let halve = if key.mips { Some(pipeline(shaders::moments_halve(channels), &[])?) } else { None };
        Ok(Self { key: *key, making, halve })
    }
}

impl Moments {
    /// Bytes that maps of `resolution`² texels take for so many views, beside the depth.
    pub fn bytes(settings: &ShadowSettings, resolution: u32, layers: u32) -> u64 {
        let key = MomentKey::new(settings, false);
        let texel = u64::from(4 * settings.representation.channels());
        let texels: u64 = (0..mips(key, resolution)).map(|mip| u64::from(resolution >> mip).pow(2)).sum();
        let scratch = if key.blurs { scratch_layers(settings, resolution, layers) } else { 0 };
        texel * (texels * u64::from(layers) + u64::from(resolution).pow(2) * u64::from(scratch))
    }

    /// Whether a room serves so many views of a size.
    pub fn fits(&self, room: &MomentRoom, settings: &ShadowSettings, resolution: u32, layers: u32) -> bool {
        let is_depth = settings.representation == Representation::Depth;
        room.key == self.key && (is_depth || room.size == [resolution, layers.max(1)])
    }

    /// Room for so many views. Not inside a frame.
    pub fn room(&self, gpu: &Gpu, settings: &ShadowSettings, resolution: u32, layers: u32) -> MomentRoom {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let mut room = MomentRoom {
            outputs: MomentOutputs::stand_in(gpu),
            key: self.key,
            size: [resolution, layers.max(1)],
            scratch: None,
            blur: Buffer::new(gpu, "blur", Life::Frame, size_of::<Blur>() as u64, usage),
            lists: lists(gpu, 1, 1),
            made: History::default(),
        };
        if self.key.representation == Representation::Depth {
            return room;
        }
        let layers = layers.max(1);
        let format = match settings.representation.channels() {
            1 => TextureFormat::R32Float,
            2 => TextureFormat::Rg32Float,
            _ => TextureFormat::Rgba32Float,
        };
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING;
        let plain = TextureOptions::new(resolution, resolution, format, usage);
        let options = TextureOptions { mips: mips(self.key, resolution), ..plain.array(layers) };
        room.outputs.moments = Texture::new(gpu, "shadow_moments", Life::Kept, options).described(MOMENTS);
        if gpu.optional.float32_filterable {
            room.outputs.filtered = room.outputs.moments.clone();
        }
        let at_once = scratch_layers(settings, resolution, layers);
        room.scratch = self
            .key
            .blurs
            .then(|| Texture::new(gpu, "shadow_moment_rows", Life::Frame, plain.array(at_once)));
        room.lists = lists(gpu, layers, at_once);
        room
    }

    /// Makes the maps of `views` (indices into group 0's views) from their layers in `maps`: those that were rendered again.
    /// Where settings that texels depend on changed, all are made.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        frame_group: &Group,
        settings: &ShadowSettings,
        maps: &Texture,
        views: &[u32],
        room: &mut MomentRoom,
    ) -> MomentOutputs {
        let content = Content::new(settings);
        let moments = &room.outputs.moments;
        let layers = moments.options().layers.unwrap_or(1);
        let all: Vec<u32>;
        let views = if room.made.get(&content).is_some() {
            views
        } else {
            all = (0..layers).collect();
            &all
        };
        if matches!(self.making, Making::Nothing) || views.is_empty() {
            return room.outputs.clone();
        }
        room.made.keep(content, ());
        frame.upload(&room.blur, &[content.blur]);
        frame.upload(&room.outputs.filter, &[[content.blur.deviation(), 0.0, 0.0, 0.0]]);
        let at_once = room.scratch.as_ref().and_then(|scratch| scratch.options().layers).unwrap_or(layers);
        let first_batch = layers.next_multiple_of(LIST_WORDS);
        let stride = at_once.next_multiple_of(LIST_WORDS);
        let mut words = views.to_vec();
        words.resize(first_batch as usize, 0);
        for batch in views.chunks(at_once as usize) {
            words.extend(batch);
            words.resize(words.len().next_multiple_of(LIST_WORDS as usize), 0);
        }
        frame.upload(&room.lists, &words);

        let side = moments.options().width;
        let count = views.len() as u32;
        let shared = &[frame_group];
        let everything = Binding::BufferRange(&room.lists, 0, u64::from(4 * first_batch));
        match &self.making {
            Making::Nothing => {}
            Making::Convert(convert) => {
                let binds = [
                    ("maps", maps.into()),
                    ("blur", (&room.blur).into()),
                    ("moment_views", everything),
                    ("moments", level(moments, 0)),
                ];
                frame.compute(
                    "shadow/moments",
                    convert,
                    shared,
                    &binds,
                    Dispatch::Threads([side, side, count]),
                );
            }
            Making::Blur { rows, columns } => {
                let Some(scratch) = &room.scratch else { return room.outputs.clone() };
                for (index, batch) in (0..).zip(views.chunks(at_once as usize)) {
                    let offset = u64::from(4 * (first_batch + index * stride));
                    let some = Binding::BufferRange(&room.lists, offset, u64::from(4 * stride));
                    let over = |[x, y]: [u32; 2]| {
                        Dispatch::Groups([side.div_ceil(x), side.div_ceil(y), batch.len() as u32])
                    };
                    let common = [("blur", (&room.blur).into()), ("moment_views", some)];
                    let binds = [common[0], common[1], ("maps", maps.into()), ("rows", scratch.into())];
                    frame.compute("shadow/moments_rows", rows, shared, &binds, over(ROWS_GROUP));
                    let binds =
                        [common[0], common[1], ("rows", scratch.into()), ("moments", level(moments, 0))];
                    frame.compute("shadow/moments_columns", columns, shared, &binds, over(COLUMNS_GROUP));
                }
            }
        }
        if let Some(halve) = &self.halve {
            for mip in 1..moments.options().mips {
                let binds = [
                    ("moment_views", everything),
                    ("finer", level(moments, mip - 1)),
                    ("moments", level(moments, mip)),
                ];
                let over = Dispatch::Threads([side >> mip, side >> mip, count]);
                frame.compute("shadow/moments_halve", halve, shared, &binds, over);
            }
        }
        room.outputs.clone()
    }
}

fn mips(key: MomentKey, resolution: u32) -> u32 {
    if key.mips { (resolution / LAST_SIDE).max(1).ilog2() + 1 } else { 1 }
}

/// Layers whose rows are blurred at once.
fn scratch_layers(settings: &ShadowSettings, resolution: u32, layers: u32) -> u32 {
    let layer = u64::from(4 * settings.representation.channels()) * u64::from(resolution).pow(2);
    (SCRATCH_BYTES / layer.max(1)).clamp(1, u64::from(layers.max(1))) as u32
}

/// Room for the list of all layers, and for the lists of those that are blurred at once.
fn lists(gpu: &Gpu, layers: u32, at_once: u32) -> Buffer {
    let words =
        layers.next_multiple_of(LIST_WORDS) + layers.div_ceil(at_once) * at_once.next_multiple_of(LIST_WORDS);
    let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
    Buffer::new(gpu, "moment_views", Life::Frame, u64::from(4 * words), usage)
}

/// One mip, which a texture of one mip is as a whole.
fn level(texture: &Texture, mip: u32) -> Binding<'_> {
    if texture.options().mips > 1 { Binding::Mip(texture, mip) } else { texture.into() }
}
