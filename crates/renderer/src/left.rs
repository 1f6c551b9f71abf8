//! What frames leave behind, by name, on its way to the CPU.

use chiaro_gpu::{BufferReadback, Frame, Handle, Readback, Recorder, Resource, TextureOptions, TexturePool};
use chiaro_techniques::post::{Accumulator, Sum};
use glam::Vec2;

use crate::{Error, Gpu, LoadedScene, Renderer, View, ViewState};

/// A texture or buffer that was asked for by name.
#[derive(Debug)]
pub struct LeftOver {
    /// `technique/name`.
    pub name: String,
    /// Channels that it has, 1 to 4; of a buffer 1.
    pub channels: u8,
    /// The thing itself.
    pub content: Left,
}

/// How it came back.
#[derive(Debug)]
pub enum Left {
    /// Rgba32Float: the sum of the still's frames, of textures of numbers as large as the picture.
    Sum(Readback),
    /// The last frame's layer.
    Plain(Readback),
    /// The last frame's layers.
    Layers(Vec<Readback>),
    /// The last frame's bytes.
    Buffer(BufferReadback),
}

/// What is read of a still, gathered while its frames are recorded.
pub(crate) struct Wanted<'a> {
    names: &'a [String],
    pass: Option<Accumulator>,
    sums: Vec<Option<Sum>>,
    last: Vec<Resource>,
}

impl<'a> Wanted<'a> {
    pub(crate) fn new(names: &'a [String]) -> Self {
        Self { names, pass: None, sums: names.iter().map(|_| None).collect(), last: Vec::new() }
    }

    /// To be called after a frame's passes were recorded.
    pub(crate) fn record(
        &mut self,
        frame: &mut Frame<'_>,
        renderer: &Renderer,
        size: [u32; 2],
    ) -> Result<(), Error> {
        if self.names.is_empty() {
            return Ok(());
        }
        let all: Vec<_> = frame.resources().collect();
        if self.last.is_empty() {
            self.last = self.names.iter().map(|name| find(&all, name)).collect::<Result<_, _>>()?;
        } else {
            // What rests, as shadow maps may, later frames do not touch.
            for (last, name) in self.last.iter_mut().zip(self.names) {
                if let Ok(found) = find(&all, name) {
                    *last = found;
                }
            }
        }
        for (resource, sum) in self.last.iter().zip(&mut self.sums) {
            let Handle::Texture(texture) = &resource.handle else { continue };
            if !is_summed(texture.options(), size) {
                continue;
            }
            if self.pass.is_none() {
                let kit = renderer.kit();
                self.pass = Some(Accumulator::raw(&kit.gpu, &kit.library)?);
            }
            let sum = sum.get_or_insert_with(|| Sum::new(renderer.gpu(), &TexturePool::default(), size));
            if let Some(pass) = &self.pass {
                pass.record(frame, texture, 1.0, sum);
            }
        }
        Ok(())
    }

    /// To be called once all frames were submitted.
    pub(crate) fn read(self, gpu: &Gpu) -> Result<Vec<LeftOver>, Error> {
        let all = self.names.iter().zip(&self.last).zip(&self.sums);
        all.map(|((name, resource), sum)| {
            let (channels, content) = match (&resource.handle, sum) {
                (Handle::Buffer(buffer), _) => (1, Left::Buffer(BufferReadback::start(gpu, buffer))),
                (Handle::Texture(texture), Some(sum)) => {
                    (texture.options().format.components(), Left::Sum(Readback::start(gpu, sum.texture())?))
                }
                (Handle::Texture(texture), None) => {
                    let options = texture.options();
                    let read = |layer| Readback::start_layer(gpu, texture, layer);
                    let content = match options.layers {
                        None => Left::Plain(read(0)?),
                        Some(layers) => Left::Layers((0..layers).map(read).collect::<Result<_, _>>()?),
                    };
                    (options.format.components(), content)
                }
            };
            Ok(LeftOver { name: name.clone(), channels, content })
        })
        .collect()
    }
}

fn is_summed(options: &TextureOptions, size: [u32; 2]) -> bool {
    use chiaro_gpu::wgpu::TextureSampleType::{Depth, Float};
    let numbers = matches!(options.format.sample_type(None, None), Some(Float { .. } | Depth));
    numbers && options.layers.is_none() && [options.width, options.height] == size
}

/// Whether copies of it can be read.
fn is_readable(resource: &Resource) -> bool {
    matches!(&resource.handle, Handle::Buffer(_))
        || matches!(&resource.handle, Handle::Texture(texture) if texture.options().samples == 1)
}

fn find(all: &[Resource], name: &str) -> Result<Resource, Error> {
    let found = all.iter().find(|resource| resource.name.to_string() == name);
    let problem = match found {
        Some(resource) if is_readable(resource) => return Ok(resource.clone()),
        Some(_) => format!("{name} has several samples a pixel, which no file holds"),
        None => format!("there is no {name}"),
    };
    let readable = all.iter().filter(|resource| is_readable(resource));
    let known: Vec<_> = readable.map(|resource| resource.name.to_string()).collect();
    Err(Error::Nothing { problem, known: known.join(", ") })
}

impl Renderer {
    /// What a frame leaves behind that [`crate::StillOptions::left`] takes. Renders a frame to see, in a view of its own, where
    /// nothing rests yet. What follows a pose to the GPU, such as trees that are refitted, only the first frame after it
    /// has.
    ///
    /// # Errors
    /// As [`Renderer::prepare`].
    pub fn leaves(
        &self,
        recorder: &mut Recorder,
        scene: &LoadedScene,
        view: &View,
        size: [u32; 2],
    ) -> Result<Vec<Resource>, Error> {
        let mut state = ViewState::new(self);
        state.show_maps(true);
        let prepared = self.prepare(&mut state, scene, view, size, (Vec2::ZERO, 1.0))?;
        let mut frame = recorder.begin();
        let _ = prepared.record(&mut frame, true);
        let all = frame.resources().filter(is_readable).collect();
        frame.submit();
        Ok(all)
    }
}
