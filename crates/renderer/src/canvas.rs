//! Frames on textures of a host program.

use chiaro_gpu::{Recorder, Texture, TexturePool, wgpu};
use chiaro_techniques::post::{Accumulator, Display, Present, Presented, Sum, Summed};

use crate::{Error, Kit, LoadedScene, Renderer, Sampling, View, ViewState};

/// Draws frames onto textures of a host program, in the host's own command encoders: a window of the host's, a view in its
/// editor. What a view keeps from frame to frame is in here, so each view has a canvas of its own, and one [`Renderer`]
/// serves all.
///
/// Nothing is submitted, waited for or read back. Targets are pictures, exposed and tone-mapped as the renderer's settings
/// say, in `Rgba8Unorm`, `Bgra8Unorm` or the sRGB format of either; or radiance in nits, in `Rgba16Float`.
#[derive(Debug)]
pub struct Canvas {
    recorder: Recorder,
    state: ViewState,
    accumulator: Accumulator,
    display: Display,
    present: Present,
    format: wgpu::TextureFormat,
    pool: TexturePool,
    // Of the last target's size.
    room: Option<(Sum, Texture)>,
    // For scenes that have unlit materials.
    unlit: Option<Sum>,
}

impl Canvas {
    /// A canvas for target views of one format. Compiles what brings frames there.
    ///
    /// # Errors
    /// [`Error::Target`] for any other format than those of [`Canvas`].
    pub fn new(renderer: &Renderer, format: wgpu::TextureFormat) -> Result<Self, Error> {
        let Kit { gpu, library, .. } = renderer.kit();
        let what = Presented::by_format(format).ok_or_else(|| {
            Error::Target(format!(
                "its format is {format:?}; pictures go to Rgba8Unorm, Bgra8Unorm, Rgba8UnormSrgb or Bgra8UnormSrgb, \
                 radiance to Rgba16Float"
            ))
        })?;
        Ok(Self {
            recorder: Recorder::new(gpu, false),
            state: ViewState::new(renderer),
            accumulator: Accumulator::new(gpu, library)?,
            display: Display::new(gpu, library)?,
            present: Present::new(gpu, library, format, what)?,
            format,
            pool: TexturePool::default(),
            room: None,
            unlit: None,
        })
    }

    /// Records a frame that covers `target`: a view, in the canvas' format, of one layer's first mip. Frames are as large as
    /// their target.
    ///
    /// # Errors
    /// [`Error::Target`] when the texture cannot be drawn to, [`Error::Size`] when it is larger than pictures can be.
    /// Nothing is recorded then.
    pub fn record(
        &mut self,
        renderer: &Renderer,
        (scene, view): (&LoadedScene, &View),
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
    ) -> Result<(), Error> {
        let texture = target.texture();
        check(texture, self.format)?;
        let gpu = renderer.gpu();
        let size_px = [texture.width(), texture.height()];
        let prepared = renderer.prepare(&mut self.state, scene, view, size_px, Sampling::Moving)?;
        let (sum, picture) = match self.room.take() {
            Some(room) if size_of_texture(&room.1) == size_px => self.room.insert(room),
            _ => {
                (self.unlit, self.room) = (None, None);
                self.pool.trim();
                let picture = Display::picture(gpu, &self.pool, size_px);
                self.room.insert((Sum::new(gpu, &self.pool, size_px), picture))
            }
        };
        let target = Texture::of_host("target", target, self.format);

        let mut frame = self.recorder.begin_in(encoder);
        let outputs = prepared.record(&mut frame, false);
        sum.restart();
        self.accumulator.record(&mut frame, &outputs.radiance, 1.0 / scene.radiance_scale, sum);
        self.unlit = outputs.unlit.as_ref().map(|color| {
            let mut unlit = self.unlit.take().unwrap_or_else(|| Sum::new(gpu, &self.pool, size_px));
            unlit.restart();
            self.accumulator.record(&mut frame, color, 1.0, &mut unlit);
            unlit
        });
        if self.present.what() != Presented::Radiance {
            let camera = &renderer.settings().camera;
            self.display.record(&mut frame, camera, (sum, self.unlit.as_ref()), picture);
        }
        let unlit = self.unlit.as_ref().map(Sum::texture);
        let summed = Summed { nits: sum.texture(), frames: sum.frames(), unlit, holds_unlit: false };
        self.present.record(&mut frame, picture, &summed, &target);
        frame.submit();
        Ok(())
    }

    /// What the view keeps from frame to frame: its notes for the user, and what a cut forgets.
    pub fn state(&mut self) -> &mut ViewState {
        &mut self.state
    }
}

fn size_of_texture(texture: &Texture) -> [u32; 2] {
    let options = texture.options();
    [options.width, options.height]
}

fn check(texture: &wgpu::Texture, format: wgpu::TextureFormat) -> Result<(), Error> {
    let own = texture.format();
    let problem = if own.remove_srgb_suffix() != format.remove_srgb_suffix() {
        format!("its format is {own:?}, but the canvas was made for {format:?}")
    } else if !texture.usage().contains(wgpu::TextureUsages::RENDER_ATTACHMENT) {
        format!("its usage lacks RENDER_ATTACHMENT; it has {:?}", texture.usage())
    } else if texture.sample_count() != 1 {
        format!("it has {} samples a pixel instead of 1", texture.sample_count())
    } else if texture.dimension() != wgpu::TextureDimension::D2 {
        format!("it is {:?} instead of D2", texture.dimension())
    } else {
        return Ok(());
    };
    Err(Error::Target(problem))
}
