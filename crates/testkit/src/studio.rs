//! Pictures of scenes in nits.

use chiaro::scene::Scene;
use chiaro::{Aov, Gpu, LoadedScene, Renderer, Settings, StillOptions, View};
use chiaro_image::{CompareOptions, Comparison, Image, Picture};

/// Settings for the light of lamps alone under a black sky, as the reference images have it, with single settings changed.
///
/// # Panics
/// When a key or value is wrong.
pub fn direct(changes: &[(&str, &str)]) -> Settings {
    let mut settings = Settings::default();
    let preset = settings.apply_preset("direct", None);
    let mut all = [("environment.sky", "none")].into_iter().chain(changes.iter().copied());
    let changed = preset.and_then(|()| all.try_for_each(|(key, value)| settings.set(key, value)));
    if let Err(error) = changed {
        panic!("{error}");
    }
    settings
}

/// Default settings but for indirect light, whose default takes a second a frame without a GPU, however small the picture: for
/// tests of other things.
///
/// # Panics
/// When there is no such key or value.
pub fn ambient() -> Settings {
    let mut settings = Settings::default();
    need(settings.set("indirect.technique", "ambient"));
    settings
}

/// A renderer and the pictures it takes.
#[derive(Debug)]
pub struct Studio {
    gpu: Gpu,
    settings: Settings,
    // Once there is a scene: what is compiled without one is mostly compiled anew for its materials.
    renderer: Option<Renderer>,
}

/// Unwraps what a test cannot go on without.
pub(crate) fn need<T>(result: Result<T, impl std::fmt::Display>) -> T {
    match result {
        Ok(value) => value,
        Err(error) => panic!("{error}"),
    }
}

impl Studio {
    /// Passes are compiled with the first scene.
    pub fn new(gpu: &Gpu, settings: Settings) -> Self {
        Self { gpu: gpu.clone(), settings, renderer: None }
    }

    /// The renderer.
    ///
    /// # Panics
    /// When the settings do not go together.
    pub fn renderer(&mut self) -> &mut Renderer {
        let Self { gpu, settings, renderer } = self;
        renderer.get_or_insert_with(|| need(Renderer::new(gpu, settings.clone())))
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        self.renderer.as_ref().map_or(&self.settings, Renderer::settings)
    }

    /// Changes settings.
    ///
    /// # Panics
    /// When they do not go together.
    pub fn set(&mut self, settings: Settings) {
        match &mut self.renderer {
            Some(renderer) => need(renderer.set(settings)),
            None => self.settings = settings,
        }
    }

    /// Uploads a scene.
    ///
    /// # Panics
    /// When it does not fit the adapter, or the settings do not go together.
    pub fn load(&mut self, scene: &Scene) -> LoadedScene {
        if let Some(renderer) = &mut self.renderer {
            return need(renderer.load(scene));
        }
        let (renderer, loaded) = need(Renderer::with_scene(&self.gpu, self.settings.clone(), scene));
        self.renderer = Some(renderer);
        loaded
    }

    /// The mean radiance of `samples` frames, nits, with 1 nit for the white of unlit materials.
    ///
    /// # Panics
    /// When the device fails.
    pub fn radiance(&mut self, scene: &LoadedScene, view: &View, size: [u32; 2], samples: u32) -> Image {
        let options = StillOptions { size, samples, ..StillOptions::default() };
        let still = need(self.renderer().still(scene, view, &options));
        let mut sum = need(still.radiance.wait(&self.gpu));
        if let Some(unlit) = still.unlit {
            sum.add_floats(&need(unlit.wait(&self.gpu)));
        }
        image(&sum, samples)
    }

    /// The mean of one quantity over `samples` frames.
    ///
    /// # Panics
    /// When the device fails.
    pub fn aov(&mut self, scene: &LoadedScene, view: &View, size: [u32; 2], samples: u32, aov: Aov) -> Image {
        let [image] = self.aovs(scene, view, size, samples, [aov]);
        image
    }

    /// Several quantities of the same frames.
    ///
    /// # Panics
    /// When the device fails.
    pub fn aovs<const N: usize>(
        &mut self,
        scene: &LoadedScene,
        view: &View,
        size: [u32; 2],
        samples: u32,
        aovs: [Aov; N],
    ) -> [Image; N] {
        let options = StillOptions { size, samples, aovs: aovs.to_vec(), ..StillOptions::default() };
        let still = need(self.renderer().still(scene, view, &options));
        let images: Vec<_> = still
            .aovs
            .into_iter()
            .map(|(_, readback)| image(&need(readback.wait(&self.gpu)), samples))
            .collect();
        let Ok(images) = images.try_into() else { panic!("not all of {aovs:?} came back") };
        images
    }

    /// The mean radiance, as [`Studio::radiance`] has it, and its parts: direct and indirect light, and caustics. `moving`: of
    /// a single sample, averaged over time.
    ///
    /// # Panics
    /// When the device fails.
    pub fn parts(
        &mut self,
        scene: &LoadedScene,
        view: &View,
        size: [u32; 2],
        (samples, moving): (u32, bool),
    ) -> (Image, [Image; 3]) {
        let aovs = vec![Aov::Direct, Aov::Indirect, Aov::Caustics];
        let options = StillOptions { size, samples, aovs, moving, ..StillOptions::default() };
        let still = need(self.renderer().still(scene, view, &options));
        let mut sum = need(still.radiance.wait(&self.gpu));
        if let Some(unlit) = still.unlit {
            sum.add_floats(&need(unlit.wait(&self.gpu)));
        }
        let read = |(_, readback): (Aov, chiaro::Readback)| image(&need(readback.wait(&self.gpu)), samples);
        let Ok(parts) = still.aovs.into_iter().map(read).collect::<Vec<_>>().try_into() else {
            panic!("not all parts came back")
        };
        (image(&sum, samples), parts)
    }

    /// The tone-mapped picture.
    ///
    /// # Panics
    /// When the device fails.
    pub fn picture(&mut self, scene: &LoadedScene, view: &View, size: [u32; 2], samples: u32) -> Picture {
        let options = StillOptions { size, samples, ..StillOptions::default() };
        let still = need(self.renderer().still(scene, view, &options));
        let pixels = need(still.picture.wait(&self.gpu));
        let (texels, _) = pixels.bytes.as_chunks::<4>();
        need(Picture::from_bytes(
            pixels.width,
            pixels.height,
            texels.iter().flat_map(|t| &t[..3]).copied().collect(),
        ))
    }
}

/// Sums of so many frames as means; alpha is coverage, of no use here.
pub(crate) fn image(pixels: &chiaro::Pixels, samples: u32) -> Image {
    let floats = pixels.floats();
    let (texels, _) = floats.as_chunks::<4>();
    let means = texels.iter().map(|&[r, g, b, _]| [r, g, b].map(|sum| sum / samples.max(1) as f32));
    need(Image::from_pixels(pixels.width, pixels.height, means.collect()))
}

/// Mean |A − B| over mean B.
///
/// # Panics
/// When the sizes differ or B is black.
pub fn nmae(a: &Image, b: &Image) -> f64 {
    let metrics = need(Comparison::new(a, b, &CompareOptions::default())).metrics();
    assert_eq!(metrics.not_finite, 0, "values that are not finite");
    metrics.nmae
}
