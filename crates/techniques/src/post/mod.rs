//! From radiance to pictures: accumulation of jittered frames, temporal anti-aliasing, exposure, tone mapping, and single
//! quantities (AOVs).
//!
//! | output | format | unit |
//! | --- | --- | --- |
//! | sum | Rgba32Float | nits summed over frames; alpha sums how much of the pixel surfaces cover |
//! | unlit | Rgba32Float | the colour of unlit materials, summed alike: 1 is the display's white |
//! | picture | Rgba8Unorm | sRGB code values |
//! | a host program's target | 8-bit RGBA or BGRA, or Rgba16Float | the picture, or nits |
//!
//! Exposure is deterministic: a histogram of integer counts, no history.

mod antialias;
mod aov;
mod debug_view;
mod parts;
mod present;
mod settings;

#[cfg(test)]
pub(crate) use antialias::AntialiasData;
pub use antialias::{Antialias, AntialiasInputs, AntialiasRoom};
pub use aov::{Aov, AovPass};
#[cfg(test)]
pub(crate) use debug_view::DebugInput;
pub use debug_view::DebugView;
pub use parts::Parts;
pub use present::{Present, Presented};
pub use settings::{CameraSettings, Curve, Exposure, PostSettings, Show, Smoothing};

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::shader::Library;
use chiaro_gpu::wgpu::{BufferUsages, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Life, Texture, TextureOptions, TexturePool,
    parallel,
};

use crate::shaders;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Accumulation {
    size_px: [u32; 2],
    frames_before: u32,
    nits: f32,
    lent: f32,
    reserved: [u32; 3],
}

/// Two textures that take turns as sum and sum before.
///
/// A picture that comes to rest goes over into a sum without a step: the moving picture's mean is lent to the sum as many
/// times as [`Sum::LENT`] says, and every frame takes one of them back.
#[derive(Clone, Debug)]
pub struct Sum {
    textures: [Texture; 2],
    turn: usize,
    frames: u32,
    // How many of them are lent.
    lent: u32,
}

impl Sum {
    /// Frames that a moving picture stands for when it comes to rest.
    pub const LENT: u32 = 16;

    /// An empty sum.
    pub fn new(gpu: &Gpu, pool: &TexturePool, [width, height]: [u32; 2]) -> Self {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba32Float, usage);
        let textures = [0, 1].map(|_| pool.lend(gpu, "sum", Life::Kept, options));
        Self { textures, turn: 0, frames: 0, lent: 0 }
    }

    /// Forgets what was summed: the next frame starts anew in the same textures.
    pub fn restart(&mut self) {
        (self.frames, self.lent) = (0, 0);
    }

    /// Frames summed, those that are lent among them.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Frames summed that are not lent.
    pub fn own_frames(&self) -> u32 {
        self.frames - self.lent
    }

    /// The newest sum: nits, and coverage by surfaces in alpha.
    pub fn texture(&self) -> &Texture {
        &self.textures[self.turn]
    }

    fn before(&self) -> &Texture {
        self.texture()
    }

    fn after(&self) -> &Texture {
        &self.textures[self.turn ^ 1]
    }

    /// One frame more.
    fn count(&mut self) {
        self.turn ^= 1;
        self.frames += 1;
    }
}

/// Sums up frames.
#[derive(Debug)]
pub struct Accumulator {
    pipeline: ComputePipeline,
    uniform: Buffer,
    raw: bool,
}

impl Accumulator {
    /// Compiles the pass.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn new(gpu: &Gpu, library: &Library) -> Result<Self, GpuError> {
        Self::of(gpu, library, false)
    }

    /// Sums up any values of four channels as they are, negative and endless ones, too.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn raw(gpu: &Gpu, library: &Library) -> Result<Self, GpuError> {
        Self::of(gpu, library, true)
    }

    fn of(gpu: &Gpu, library: &Library, raw: bool) -> Result<Self, GpuError> {
        Ok(Self {
            pipeline: ComputePipeline::new(gpu, library, &shaders::accumulate(raw), &[], &[])?,
            uniform: uniform::<Accumulation>(gpu, "accumulation"),
            raw,
        })
    }

    /// Adds a frame whose stored units are `nits` each.
    pub fn record(&self, frame: &mut Frame<'_>, radiance: &Texture, nits: f32, sum: &mut Sum) {
        self.add(frame, (radiance, None), nits, sum);
    }

    /// Adds a frame of a picture that has come to rest; `moved` is its mean while it moved, see [`Sum`].
    pub fn record_at_rest(
        &self,
        frame: &mut Frame<'_>,
        (radiance, moved): (&Texture, &Texture),
        nits: f32,
        sum: &mut Sum,
    ) {
        let lent = match (sum.frames, sum.lent) {
            (0, _) => {
                sum.lent = Sum::LENT - 1;
                (Sum::LENT - 1) as f32
            }
            (_, 0) => return self.add(frame, (radiance, None), nits, sum),
            _ => {
                sum.lent -= 1;
                -1.0
            }
        };
        self.add(frame, (radiance, Some((moved, lent))), nits, sum);
        sum.frames = Sum::LENT;
    }

    fn add(
        &self,
        frame: &mut Frame<'_>,
        (radiance, lent): (&Texture, Option<(&Texture, f32)>),
        nits: f32,
        sum: &mut Sum,
    ) {
        let options = *sum.texture().options();
        let size_px = [options.width, options.height];
        let (moved, lent) = lent.unwrap_or((radiance, 0.0));
        let input = Accumulation { size_px, frames_before: sum.frames, nits, lent, reserved: [0; 3] };
        frame.upload(&self.uniform, &[input]);
        let mut binds = vec![
            ("accumulation", (&self.uniform).into()),
            ("radiance", radiance.into()),
            ("sum_before", sum.before().into()),
            ("sum", sum.after().into()),
        ];
        if !self.raw {
            binds.push(("lent", moved.into()));
        }
        frame.compute("post/accumulate", &self.pipeline, &[], &binds, over(sum));
        sum.count();
    }
}

/// What a picture is made of.
#[derive(Clone, Copy, Debug)]
pub struct Summed<'a> {
    /// Nits summed over frames.
    pub nits: &'a Texture,
    /// How many.
    pub frames: u32,
    /// The colour of unlit materials summed over as many, 1 for the display's white, where there are any.
    pub unlit: Option<&'a Texture>,
    /// Whether `nits` holds that colour, too, at 1 nit for white.
    pub holds_unlit: bool,
}

/// Turns a sum into a picture.
#[derive(Debug)]
pub struct Display {
    histogram: ComputePipeline,
    exposure: ComputePipeline,
    tone_map: ComputePipeline,
    bins: Buffer,
    histogram_input: Buffer,
    exposure_input: Buffer,
    exposure_value: Buffer,
    curve: Buffer,
    no_unlit: Texture,
}

impl Display {
    /// Compiles the passes.
    ///
    /// # Errors
    /// When a shader does not compile.
    pub fn new(gpu: &Gpu, library: &Library) -> Result<Self, GpuError> {
        let storage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let (histogram, (exposure, tone_map)) = parallel::join(
            || plain(gpu, library, "post/histogram.cs.wesl"),
            || {
                let exposure = || plain(gpu, library, "post/exposure.cs.wesl");
                parallel::join(exposure, || plain(gpu, library, "post/tone_map.cs.wesl"))
            },
        );
        Ok(Self {
            histogram: histogram?,
            exposure: exposure?,
            tone_map: tone_map?,
            bins: Buffer::new(gpu, "histogram", Life::Frame, 4 * 256, storage),
            histogram_input: uniform::<[u32; 4]>(gpu, "histogram_input"),
            exposure_input: uniform::<[u32; 4]>(gpu, "exposure_input"),
            exposure_value: Buffer::new(gpu, "exposure", Life::Kept, 16, storage),
            curve: uniform::<[u32; 4]>(gpu, "tone_map"),
            no_unlit: no_unlit(gpu),
        })
    }

    /// The factor from nits to the picture's linear values, one float. Written by [`Display::record`].
    pub fn exposure(&self) -> &Buffer {
        &self.exposure_value
    }

    /// A picture's texture.
    pub fn picture(gpu: &Gpu, pool: &TexturePool, [width, height]: [u32; 2]) -> Texture {
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        let options = TextureOptions::new(width, height, TextureFormat::Rgba8Unorm, usage);
        pool.lend(gpu, "picture", Life::Kept, options)
    }

    /// Exposes and tone-maps a sum; the colour of unlit materials, summed over as many frames, is added as it is.
    pub fn record(
        &self,
        frame: &mut Frame<'_>,
        settings: &CameraSettings,
        (sum, unlit): (&Sum, Option<&Sum>),
        picture: &Texture,
    ) {
        let unlit = unlit.map(Sum::texture);
        let (automatic, ev) = match settings.exposure_ev100 {
            Exposure::Auto => (1, 0.0f32),
            Exposure::Ev100(ev) => (0, ev),
        };
        frame.upload(&self.exposure_input, &[[automatic, ev.to_bits(), 0, 0]]);
        let frames = (sum.frames.max(1) as f32).to_bits();
        frame.upload(&self.histogram_input, &[[frames, 0, 0, 0]]);
        frame.clear(&self.bins);
        let bins = ("histogram", (&self.bins).into());
        let input = ("histogram_input", (&self.histogram_input).into());
        let color = ("unlit", unlit.unwrap_or(&self.no_unlit).into());
        let binds = [("sum", sum.texture().into()), color, input, bins];
        frame.compute("post/histogram", &self.histogram, &[], &binds, over(sum));
        let exposure = ("exposure", (&self.exposure_value).into());
        let binds = [("exposure_input", (&self.exposure_input).into()), bins, exposure];
        frame.compute("post/exposure", &self.exposure, &[], &binds, Dispatch::Groups([1; 3]));
        let summed = Summed { nits: sum.texture(), frames: sum.frames, unlit, holds_unlit: false };
        self.tone_map(frame, settings, &summed, 0, picture);
    }

    /// Tone-maps the columns from `first_column` on of a sum, exposed as [`Display::record`] exposed
    /// last.
    pub fn tone_map(
        &self,
        frame: &mut Frame<'_>,
        settings: &CameraSettings,
        &Summed { nits, frames, unlit, holds_unlit }: &Summed<'_>,
        first_column: u32,
        picture: &Texture,
    ) {
        let frames = (frames.max(1) as f32).to_bits();
        frame.upload(
            &self.curve,
            &[[settings.tone_map as u32, frames, first_column, f32::from(u8::from(holds_unlit)).to_bits()]],
        );
        let binds = [
            ("tone_map", (&self.curve).into()),
            ("sum", nits.into()),
            ("unlit", unlit.unwrap_or(&self.no_unlit).into()),
            ("exposure", (&self.exposure_value).into()),
            ("picture", picture.into()),
        ];
        let options = nits.options();
        let columns = options.width.saturating_sub(first_column);
        if columns > 0 {
            let pixels = Dispatch::Threads([columns, options.height, 1]);
            frame.compute("post/tone_map", &self.tone_map, &[], &binds, pixels);
        }
    }
}

/// Black.
fn no_unlit(gpu: &Gpu) -> Texture {
    let options = TextureOptions::new(1, 1, TextureFormat::Rgba32Float, TextureUsages::TEXTURE_BINDING);
    Texture::new(gpu, "no_unlit", Life::Kept, options)
}

fn plain(gpu: &Gpu, library: &Library, entry: &'static str) -> Result<ComputePipeline, GpuError> {
    ComputePipeline::new(gpu, library, &shaders::plain(entry), &[], &[])
}

fn uniform<T>(gpu: &Gpu, name: &'static str) -> Buffer {
    let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
    Buffer::new(gpu, name, Life::Frame, size_of::<T>() as u64, usage)
}

fn over(sum: &Sum) -> Dispatch<'static> {
    let options = sum.texture().options();
    Dispatch::Threads([options.width, options.height, 1])
}
