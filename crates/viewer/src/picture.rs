//! The picture in the window: smoothed over time while something moves, an average of many frames while everything rests.
//! One goes over into the other without a step.

use chiaro::techniques::post::{Display, Sum, Summed};
use chiaro::{
    Error, Frame, Gpu, Jitter, Pixels, Readback, Sampling, Settings, Texture, TexturePool, View, ViewState,
};

use crate::buffers::{self, Drawn, Offer, Place, Shown};
use crate::engine::Engine;
use crate::stage::Stage;

/// Jittered frames that a resting picture is the mean of.
pub const REST_FRAMES: u32 = 64;
/// Sums of more than this lose precision.
const MAX_FRAMES: u32 = 1 << 16;

/// What a picture depends on. Equal keys give equal pictures.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    view: View,
    settings: Settings,
    scene: u64,
    time_s: f64,
    generation: u64,
    shown: Shown,
}

/// Textures of the picture and what lies in them.
#[derive(Debug)]
pub struct Picture {
    gpu: Gpu,
    pool: TexturePool,
    textures: Option<(Sum, Texture)>,
    // The colour of unlit materials, summed beside, for scenes that have any.
    unlit: Option<Sum>,
    key: Option<Key>,
    // Scratch and picture of the buffer that is shown.
    buffer: Option<(Sum, Texture)>,
    drawn: Option<Drawn>,
    offer: Offer,
    // The sum holds a frame of a picture that moved.
    moved: bool,
    // Such a frame's radiance and colour of unlit materials, where they are means over time: the picture at rest starts
    // from them.
    mean: Option<(Texture, Option<Texture>)>,
    truth: Option<Shows>,
    // What frames keep, once there was one.
    state: Option<ViewState>,
}

/// Which part of a picture shows the truth, and of how many samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shows {
    /// From here on.
    pub first_column: u32,
    /// Of every pixel.
    pub samples: u32,
}

impl Picture {
    /// Nothing to show yet.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            pool: TexturePool::default(),
            textures: None,
            unlit: None,
            key: None,
            buffer: None,
            drawn: None,
            offer: Offer::default(),
            moved: false,
            mean: None,
            truth: None,
            state: None,
        }
    }

    /// Sentences about what the last frame gave up, for the user.
    pub fn notes(&self) -> &[String] {
        self.state.as_ref().map_or(&[], ViewState::notes)
    }

    /// The picture, 8-bit sRGB.
    pub fn texture(&self) -> Option<&Texture> {
        self.textures.as_ref().map(|(_, picture)| picture)
    }

    /// Pixels, once there is room for them.
    pub fn size_px(&self) -> Option<[u32; 2]> {
        self.texture().map(|picture| [picture.options().width, picture.options().height])
    }

    /// Whether the newest frame was one of a picture that moved.
    pub fn moves(&self) -> bool {
        self.moved
    }

    /// Which part shows the truth.
    pub fn truth(&self) -> Option<Shows> {
        self.truth
    }

    /// What the buffer that is shown turned out to be.
    pub fn drawn(&self) -> Option<&Drawn> {
        self.drawn.as_ref()
    }

    /// What could be shown of the newest frame.
    pub fn offer(&self) -> &Offer {
        &self.offer
    }

    /// The texture that buffers are drawn to.
    pub fn buffer_texture(&self) -> Option<&Texture> {
        self.buffer.as_ref().map(|(_, picture)| picture)
    }

    /// Frames averaged.
    pub fn frames(&self) -> u32 {
        self.textures.as_ref().map_or(0, |(sum, _)| sum.own_frames())
    }

    /// Makes room; `true` when the texture is another than before.
    pub fn resize(&mut self, size_px: [u32; 2]) -> bool {
        let same = |(sum, _): &(Sum, Texture)| {
            let options = sum.texture().options();
            [options.width, options.height] == size_px
        };
        if self.textures.as_ref().is_some_and(same) {
            return false;
        }
        self.textures = None;
        self.unlit = None;
        self.mean = None;
        self.buffer = None;
        self.drawn = None;
        self.pool.trim();
        let picture = Display::picture(&self.gpu, &self.pool, size_px);
        self.textures = Some((Sum::new(&self.gpu, &self.pool, size_px), picture));
        self.key = None;
        self.truth = None;
        true
    }

    /// Whether a frame would change anything.
    pub fn wants_frame(
        &mut self,
        engine: &Engine,
        stage: &Stage,
        view: &View,
        (time_s, shown): (f64, Shown),
    ) -> bool {
        let key = Key {
            view: *view,
            settings: engine.renderer.settings().clone(),
            scene: stage.loaded.gpu.id(),
            time_s,
            generation: engine.generation,
            shown,
        };
        let Some((sum, _)) = &mut self.textures else { return false };
        if self.key.as_ref() != Some(&key) {
            self.key = Some(key);
            self.moved = true;
            sum.restart();
        } else if self.moved {
            // At rest now: the average starts with a jittered frame.
            self.moved = false;
            sum.restart();
        } else if sum.frames() >= MAX_FRAMES {
            sum.restart();
        }
        sum.own_frames() < REST_FRAMES
    }

    /// How the next frame is sampled.
    fn sampling(&self) -> Sampling {
        if self.moved {
            return Sampling::Moving;
        }
        let jitter = Jitter::new(REST_FRAMES);
        // Its second offset is the pixel's middle; swapped in pairs the picture does not jump when it comes to rest.
        let index = (self.frames() % REST_FRAMES) ^ 1;
        Sampling::nth(&jitter, index)
    }

    /// Makes room for a buffer's picture; `true` when it is another texture than before.
    pub fn show_buffer(&mut self, place: Place) -> bool {
        let Some((_, picture)) = self.textures.as_ref().filter(|_| place != Place::Off) else {
            self.drawn = None;
            return false;
        };
        if self.buffer.is_some() {
            return false;
        }
        let options = picture.options();
        let size_px = [options.width, options.height];
        let picture = Display::picture(&self.gpu, &self.pool, size_px);
        self.buffer = Some((Sum::new(&self.gpu, &self.pool, size_px), picture));
        true
    }

    /// Records a frame, its sum and its picture, and the buffer that is shown.
    ///
    /// # Errors
    /// As [`Renderer::prepare`](chiaro::Renderer::prepare): all stays as it was.
    pub fn record(
        &mut self,
        frame: &mut Frame<'_>,
        engine: &mut Engine,
        (stage, view): (&Stage, &View),
        shown: Shown,
    ) -> Result<(), Error> {
        let sampling = self.sampling();
        let Some((sum, picture)) = &mut self.textures else { return Ok(()) };
        let Engine { renderer, passes, .. } = engine;
        let options = picture.options();
        let size_px = [options.width, options.height];
        let state = self.state.get_or_insert_with(|| ViewState::new(renderer));
        state.take_apart(shown.place != Place::Off && shown.source.is_part());
        state.show_maps(shown.place != Place::Off);
        let prepared = renderer.prepare(state, &stage.loaded, view, size_px, sampling)?;
        let buffer = self.buffer.as_mut().filter(|_| shown.place != Place::Off);
        let outputs = prepared.record(frame, buffer.is_some());
        if self.moved {
            let is_mean = renderer.settings().smooths();
            self.mean = is_mean.then(|| (outputs.radiance.clone(), outputs.unlit.clone()));
        }
        let mean = self.mean.as_ref().filter(|_| !self.moved);
        let starts = sum.frames() == 0;
        let add = |frame: &mut Frame<'_>, layer, mean: Option<&Texture>, nits, sum: &mut Sum| match mean {
            Some(mean) => passes.accumulator.record_at_rest(frame, (layer, mean), nits, sum),
            None => passes.accumulator.record(frame, layer, nits, sum),
        };
        let nits = 1.0 / stage.loaded.radiance_scale;
        add(frame, &outputs.radiance, mean.map(|(radiance, _)| radiance), nits, sum);
        match &outputs.unlit {
            Some(color) => {
                let unlit = self.unlit.get_or_insert_with(|| Sum::new(&self.gpu, &self.pool, size_px));
                if starts {
                    unlit.restart();
                }
                add(frame, color, mean.and_then(|(_, unlit)| unlit.as_ref()), 1.0, unlit);
            }
            None => self.unlit = None,
        }
        passes.display.record(frame, &renderer.settings().camera, (sum, self.unlit.as_ref()), picture);
        self.truth = None;
        self.offer.update(frame);
        if let Some((scratch, picture)) = buffer {
            self.drawn =
                Some(buffers::draw(frame, (engine, state), stage, &outputs, shown, (scratch, picture)));
        }
        Ok(())
    }

    /// Records the truth into its part of the picture, exposed like the rest, and the frames' own sum where the truth is no
    /// longer shown.
    pub fn show_truth(&mut self, frame: &mut Frame<'_>, engine: &Engine, truth: Option<(Summed<'_>, Shows)>) {
        let Some((sum, picture)) = &self.textures else { return };
        let (display, camera) = (&engine.passes.display, &engine.renderer.settings().camera);
        let first = truth.map(|(_, shows)| shows.first_column);
        if self.truth.is_some_and(|before| first.is_none_or(|first| first > before.first_column)) {
            let unlit = self.unlit.as_ref().map(Sum::texture);
            let own = Summed { nits: sum.texture(), frames: sum.frames(), unlit, holds_unlit: false };
            display.tone_map(frame, camera, &own, 0, picture);
        }
        if let Some((traced, shows)) = &truth {
            display.tone_map(frame, camera, traced, shows.first_column, picture);
        }
        self.truth = truth.map(|(_, shows)| shows);
    }

    /// A copy of the picture and of its radiance on their way to the CPU: nits summed over the frames, or, where the truth
    /// fills the picture, over its samples.
    ///
    /// # Errors
    /// When it is too large to be read.
    pub fn read(&self, shown: Shown, truth: Option<Summed<'_>>) -> Option<Result<Shot, chiaro::GpuError>> {
        let (sum, picture) = self.textures.as_ref()?;
        let truth = truth.filter(|_| self.truth.is_some_and(|shows| shows.first_column == 0));
        let unlit = self.unlit.as_ref().map(Sum::texture);
        let own = Summed { nits: sum.texture(), frames: sum.frames(), unlit, holds_unlit: false };
        let shown_sum = truth.unwrap_or(own);
        let unlit = shown_sum.unlit.filter(|_| !shown_sum.holds_unlit);
        let picture = match &self.buffer {
            Some((_, buffer)) if shown.place == Place::Full => buffer,
            _ => picture,
        };
        let start = || {
            Ok(Shot {
                picture: Readback::start(&self.gpu, picture)?,
                radiance: Readback::start(&self.gpu, shown_sum.nits)?,
                unlit: unlit.map(|unlit| Readback::start(&self.gpu, unlit)).transpose()?,
                frames: shown_sum.frames,
            })
        };
        Some(start())
    }
}

/// A screenshot on its way.
#[derive(Debug)]
pub struct Shot {
    picture: Readback,
    radiance: Readback,
    // To be added.
    unlit: Option<Readback>,
    frames: u32,
}

/// A screenshot that has arrived.
#[derive(Debug)]
pub struct Pair {
    /// 8-bit sRGB.
    pub picture: Pixels,
    /// Rgba32Float, nits summed over `frames`, with 1 nit for the white of unlit materials.
    pub radiance: Pixels,
    /// How many frames were summed.
    pub frames: u32,
}

impl Shot {
    /// The pixels if they have arrived.
    ///
    /// # Errors
    /// When the device was lost meanwhile.
    pub fn poll(&self, gpu: &Gpu) -> Result<Option<Pair>, chiaro::GpuError> {
        let (picture, radiance) = (self.picture.poll(gpu)?, self.radiance.poll(gpu)?);
        let unlit = self.unlit.as_ref().map(|unlit| unlit.poll(gpu)).transpose()?;
        let all = picture.zip(radiance).filter(|_| unlit.as_ref().is_none_or(Option::is_some));
        Ok(all
            .map(|(picture, mut radiance)| {
                if let Some(colors) = unlit.flatten() {
                    radiance.add_floats(&colors);
                }
                (picture, radiance)
            })
            .map(|(picture, radiance)| Pair { picture, radiance, frames: self.frames }))
    }
}
