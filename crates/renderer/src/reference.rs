//! Path-traced truth, sample by sample.

use bytemuck::Zeroable;
use chiaro_gpu::{Frame, Gpu, Readback, Texture, wgpu};
use chiaro_scene::Scene;
use chiaro_techniques::reference::bvh::{TraceData, TraceScene};
use chiaro_techniques::reference::first_hit::{FirstHitSum, FirstHitTracer};
use chiaro_techniques::reference::path::{PathSum, PathTracer};
use chiaro_techniques::shared::frame::{FrameData, FrameGroup, LightData};
use glam::Vec2;

pub use chiaro_techniques::reference::first_hit::FirstHit;
pub use chiaro_techniques::reference::path::PathOptions;

use crate::{Error, Kit, LoadedScene, Settings, View};

/// An image being path traced: the mean of samples that [`Reference::add`] adds.
///
/// Of the settings those count that say what is there, not how it is drawn: `surface.lighting`, `surface.normal_maps`
/// and `environment.*`. Where a scene has no environment, the surroundings are black.
#[derive(Debug)]
pub struct Reference {
    kit: Kit,
    frame_group: FrameGroup,
    traced: TraceScene,
    tracer: PathTracer,
    sum: PathSum,
    observer: Option<FirstHitTracer>,
    observed: Vec<FirstHitSum>,
    options: PathOptions,
}

impl Reference {
    /// Builds the scene's trees, and compiles the path tracer. `loaded` is `scene` uploaded by the same kit, as it stands at
    /// time 0.
    ///
    /// # Errors
    /// When the scene's trees do not fit the adapter, or a shader does not compile.
    pub fn new(
        kit: &Kit,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        (view, size_px): (&View, [u32; 2]),
        options: PathOptions,
    ) -> Result<Self, Error> {
        let gpu = &kit.gpu;
        let traced = TraceData::build(scene).upload(gpu)?;
        let facts = loaded.gpu.facts;
        let tracer = PathTracer::new(gpu, &kit.library, &kit.frame_layout, &kit.scene_layout, facts)?;
        let mut frame_group = kit.frame_group()?;
        let environment = loaded.environment.as_ref().map(|map| &map.texture);
        frame_group.reserve(gpu, loaded.lights.len(), 0, environment);
        let data = frame_data(loaded, settings, view, size_px);
        let lights: Vec<_> =
            loaded.lights.iter().map(|l| LightData { first_view: LightData::NO_VIEW, ..*l }).collect();
        gpu.queue.write_buffer(frame_group.frame.raw(), 0, bytemuck::bytes_of(&data));
        gpu.queue.write_buffer(frame_group.lights.raw(), 0, bytemuck::cast_slice(&lights));
        let sum = PathSum::new(gpu, size_px);
        gpu.check()?;
        Ok(Self {
            kit: kit.clone(),
            frame_group,
            traced,
            tracer,
            sum,
            observer: None,
            observed: Vec::new(),
            options,
        })
    }

    /// Sums up these quantities, too, in layers of the name [`FirstHit::layer`]. To be said before the first sample.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn observe(&mut self, loaded: &LoadedScene, wanted: &[FirstHit]) -> Result<(), Error> {
        let Kit { gpu, library, frame_layout, scene_layout, .. } = &self.kit;
        self.observer =
            Some(FirstHitTracer::new(gpu, library, frame_layout, scene_layout, loaded.gpu.facts)?);
        let size = self.sum.sum().options();
        let size_px = [size.width, size.height];
        self.observed = wanted.iter().map(|&what| FirstHitSum::new(gpu, size_px, what)).collect();
        Ok(())
    }

    /// Records `count` more samples of every pixel. However they are grouped, the image is the same.
    pub fn add(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32) {
        let scene = (self.frame_group.group(), &loaded.gpu, &self.traced);
        // llvmpipe silently ends all loops of an invocation after 65,535 iterations together: a sample is well below that.
        let each = if self.kit.gpu.is_software() { 1 } else { count.max(1) };
        for first in (0..count).step_by(each as usize) {
            let now = each.min(count - first);
            let samples = (self.sum.samples(), now);
            if let Some(observer) = &self.observer {
                for sum in &mut self.observed {
                    observer.record(frame, scene, self.options.seed, samples, sum);
                }
            }
            self.tracer.record(frame, scene, self.options, now, &mut self.sum);
        }
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.sum.samples()
    }

    /// Rgba32Float: nits summed over samples, and how much of the pixel surfaces cover.
    ///
    /// # Errors
    /// When the image is larger than the device can read back.
    pub fn sum(&self) -> Result<Readback, Error> {
        Ok(Readback::start(&self.kit.gpu, self.sum.sum())?)
    }

    /// Rgba32Float: squares of the samples' nits, summed.
    ///
    /// # Errors
    /// As [`Reference::sum`].
    pub fn squares(&self) -> Result<Readback, Error> {
        Ok(Readback::start(&self.kit.gpu, self.sum.squares())?)
    }

    /// Everything that samples are added to, by names that stay: Rgba32Float, summed over samples.
    pub fn layers(&self) -> impl Iterator<Item = (&'static str, &Texture)> {
        self.sum.layers().chain(self.observed.iter().map(|sum| (sum.what.layer(), sum.texture())))
    }

    /// A read-back of each of [`Reference::layers`]: all that [`Reference::restore`] needs.
    ///
    /// # Errors
    /// As [`Reference::sum`].
    pub fn read_layers(&self) -> Result<Vec<(&'static str, Readback)>, Error> {
        self.layers().map(|(name, texture)| Ok((name, Readback::start(&self.kit.gpu, texture)?))).collect()
    }

    /// Goes on from where a reference of the same scene, settings, view, size and options stood after so many samples:
    /// what is added then gives the image, bit for bit, that one without a break would. `layers` are its
    /// [`Reference::layers`], four floats a pixel, row after row from the top; further ones do no harm.
    ///
    /// # Errors
    /// When a layer is missing or of another size. Nothing has changed then.
    pub fn restore<L: AsRef<[f32]>>(&mut self, samples: u32, layers: &[(&str, L)]) -> Result<(), Error> {
        let fitting = self.layers().map(|(name, texture)| {
            let (_, texels) = layers
                .iter()
                .find(|(found, _)| *found == name)
                .ok_or_else(|| Error::Unfinished(format!("its layer `{name}` is missing")))?;
            let texels = texels.as_ref();
            let options = texture.options();
            let needed = 4 * options.width as usize * options.height as usize;
            if texels.len() != needed {
                let found = texels.len();
                return Err(Error::Unfinished(format!(
                    "its layer `{name}` has {found} values, not {needed}"
                )));
            }
            Ok((texture, texels))
        });
        for (texture, texels) in fitting.collect::<Result<Vec<_>, _>>()? {
            upload(&self.kit.gpu, texture, texels);
        }
        self.sum.resume(samples);
        Ok(())
    }
}

/// Fills an Rgba32Float texture, whose usage holds `COPY_DST`.
fn upload(gpu: &Gpu, texture: &Texture, texels: &[f32]) {
    let (width, height) = (texture.options().width, texture.options().height);
    gpu.queue.write_texture(
        texture.raw().as_image_copy(),
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
}

fn frame_data(loaded: &LoadedScene, settings: &Settings, view: &View, size_px: [u32; 2]) -> FrameData {
    let turn = settings.environment.rotation.to_radians();
    let clip_from_ws = view.clip_from_ws(size_px, Vec2::ZERO).to_cols_array_2d();
    let nits = loaded.environment.as_ref().map_or(0.0, |map| map.nits * settings.environment.intensity);
    FrameData {
        clip_from_ws,
        relative_from_clip: view.relative_from_clip(size_px, Vec2::ZERO).to_cols_array_2d(),
        previous_clip_from_ws: clip_from_ws,
        eye_ws: view.eye_ws().to_array(),
        orthographic: u32::from(view.is_orthographic()),
        forward_ws: view.forward_ws().to_array(),
        footprint_scale: 1.0,
        size_px,
        directional_lights: loaded.directional as u32,
        local_lights: (loaded.lights.len() - loaded.directional) as u32,
        lighting_model: settings.surface.lighting as u32,
        seed: settings.seed,
        radiance_scale: 1.0,
        normal_maps: u32::from(settings.surface.normal_maps),
        anisotropy: 1,
        environment_nits: nits,
        environment_share: 1.0,
        environment_turn: [turn.cos(), turn.sin()],
        show_direct: 1.0,
        show_indirect: 1.0,
        ..FrameData::zeroed()
    }
}
