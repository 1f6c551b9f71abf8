//! Light transport without shortcuts, sample by sample.

use bytemuck::Zeroable;
use chiaro_gpu::{Frame, Gpu, Readback, Texture, wgpu};
use chiaro_scene::Scene;
use chiaro_techniques::motion::Motion;
use chiaro_techniques::reference::bvh::{Refit, TraceData, TraceScene};
use chiaro_techniques::reference::first_hit::{FirstHitSum, FirstHitTracer};
use chiaro_techniques::reference::path::{Interfaces, PathOptions, PathSum, PathTracer};
use chiaro_techniques::reference::photon::{
    PhotonMap, PhotonOptions, PhotonTracer, PhotonView, specular_bounds,
};
use chiaro_techniques::shared::frame::{FrameData, FrameGroup, LightData};
use glam::Vec2;

pub use chiaro_techniques::reference::first_hit::FirstHit;

use crate::loaded::WHITE_STORED;
use crate::{Error, Kit, LoadedScene, Settings, View};

/// Which paths make an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Paths from the camera: all light but that of lamps without extent over mirrors or through smooth glass.
    #[default]
    Path,
    /// Paths from the lights to surfaces that scatter and are seen directly; mirrors and smooth glass are black.
    Photon,
    /// Both, nothing twice: everything. Where nothing mirrors or refracts, the same as [`Integrator::Path`].
    Full,
}

/// What is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferenceOptions {
    /// Which paths.
    pub integrator: Integrator,
    /// Most edges of a path: 1 shows what glows, 2 direct light, 3 one bounce; 0 = no limit.
    pub max_depth: u32,
    /// Most times that light is scattered from one surface to another; mirrors and smooth interfaces do not count.
    pub diffuse_bounces: u32,
    /// What random numbers start from.
    pub seed: u32,
}

impl Default for ReferenceOptions {
    fn default() -> Self {
        Self { integrator: Integrator::Path, max_depth: 0, diffuse_bounces: u32::MAX, seed: 0 }
    }
}

/// Samples that share light paths: enough for lanes to balance long paths with short ones.
const ROUND: u32 = 4;

/// An image being traced: the mean of samples that [`Reference::add`] adds.
///
/// Of the settings those count that say what is there, not how it is drawn: `surface.lighting`, `surface.normal_maps`
/// and `environment.*`. Where a scene has no environment, the surroundings are black.
#[derive(Debug)]
pub struct Reference {
    kit: Kit,
    frame_group: FrameGroup,
    traced: TraceScene,
    tracer: PathTracer,
    photons: Option<(PhotonTracer, PhotonMap)>,
    following: Option<Following>,
    sum: PathSum,
    observer: Option<FirstHitTracer>,
    observed: Vec<FirstHitSum>,
    options: ReferenceOptions,
}

/// Passes for scenes that move.
#[derive(Debug)]
struct Following {
    motion: Motion,
    refit: Refit,
}

impl Reference {
    /// Builds the scene's trees for the pose that `loaded`, which is `scene` uploaded by the same kit, has now, and compiles
    /// the tracers.
    ///
    /// # Errors
    /// When the scene's trees or the image's light paths do not fit the adapter, or a shader does not compile.
    pub fn new(
        kit: &Kit,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        (view, size_px): (&View, [u32; 2]),
        options: ReferenceOptions,
    ) -> Result<Self, Error> {
        let gpu = &kit.gpu;
        let traced = TraceData::build(scene, &loaded.pose).upload(gpu)?;
        let facts = (loaded.gpu.facts, traced.facts, Interfaces::of(scene));
        let moves = loaded.gpu.motion.moves();
        let following = moves.then(|| -> Result<_, Error> {
            let (motion, refit) = (Motion::new(gpu, &kit.library)?, Refit::new(gpu, &kit.library)?);
            Ok(Following { motion, refit })
        });
        let following = following.transpose()?;
        let photon_view = photon_view((scene, loaded), (view, size_px));
        let needed = match options.integrator {
            Integrator::Path => false,
            Integrator::Photon => true,
            Integrator::Full => photon_view.specular_ws.is_some(),
        };
        let frame_layout = FrameGroup::layout_without_shadows(gpu);
        let layouts = (&frame_layout, &kit.scene_layout);
        let tracer = PathTracer::new(gpu, &kit.library, layouts, facts, needed)?;
        let photons = needed.then(|| -> Result<_, Error> {
            Ok((PhotonTracer::new(gpu, &kit.library, layouts, facts)?, PhotonMap::new(gpu, photon_view)?))
        });
        let photons = photons.transpose()?;
        let mut frame_group = kit.frame_group_of(&frame_layout)?;
        let environment = loaded.environment.as_ref().map(|map| &map.texture);
        frame_group.reserve(gpu, loaded.lights.len(), 0, environment);
        write_frame(gpu, &frame_group, loaded, &frame_data(loaded, settings, view, size_px));
        let sum = PathSum::new(gpu, size_px, needed);
        gpu.check()?;
        Ok(Self {
            kit: kit.clone(),
            frame_group,
            traced,
            tracer,
            photons,
            following,
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
        let Kit { gpu, library, scene_layout, .. } = &self.kit;
        let frame_layout = FrameGroup::layout_without_shadows(gpu);
        let facts = (loaded.gpu.facts, self.traced.facts);
        self.observer = Some(FirstHitTracer::new(gpu, library, (&frame_layout, scene_layout), facts)?);
        let size = self.sum.sum().options();
        let size_px = [size.width, size.height];
        self.observed = wanted.iter().map(|&what| FirstHitSum::new(gpu, size_px, what)).collect();
        Ok(())
    }

    /// Starts the image again where the scene and the camera are now: `loaded` has taken another pose since. The trees
    /// follow, which is quicker than building them anew but leaves those of bending meshes as good as they fit.
    ///
    /// # Errors
    /// When trees had to be built anew and do not fit the adapter.
    pub fn follow(
        &mut self,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        view: &View,
    ) -> Result<(), Error> {
        let gpu = &self.kit.gpu;
        if !self.traced.update(gpu, scene, &loaded.pose) {
            self.traced = TraceData::build(scene, &loaded.pose).upload(gpu)?;
        }
        let size = self.sum.sum().options();
        let size_px = [size.width, size.height];
        write_frame(gpu, &self.frame_group, loaded, &frame_data(loaded, settings, view, size_px));
        if let Some((_, map)) = &mut self.photons {
            map.view = photon_view((scene, loaded), (view, size_px));
        }
        self.sum.resume(0);
        Ok(())
    }

    /// Samples that are added together: counts are rounded up to a multiple of this.
    pub fn round(&self) -> u32 {
        // llvmpipe silently ends all loops of an invocation after 65,535 iterations together: a sample is well below that.
        if self.photons.is_some() && !self.kit.gpu.is_software() { ROUND } else { 1 }
    }

    /// Light paths for each sample of the image; 0 where there are none.
    pub fn light_paths(&self) -> u32 {
        self.photons.as_ref().map_or(0, |(_, map)| map.lanes())
    }

    /// Records `count` more samples of every pixel, in whole rounds. However they are grouped, the image is the same.
    pub fn add(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32) {
        let ReferenceOptions { integrator, max_depth, diffuse_bounces, seed } = self.options;
        let alone = integrator == Integrator::Photon;
        // Beside light paths that bring all else, what is seen of lights themselves.
        let path = PathOptions { max_depth: if alone { 1 } else { max_depth }, diffuse_bounces, seed };
        let light = PhotonOptions { max_depth, diffuse_bounces, seed, caustics_only: !alone };
        let following = self.following.as_mut().filter(|_| self.traced.stale());
        if let Some(Following { motion, refit }) = following {
            motion.record(frame, &loaded.gpu);
            refit.record(frame, &loaded.gpu, &mut self.traced);
        }
        let scene = (self.frame_group.group(), &loaded.gpu, &self.traced);
        let each = match self.photons {
            Some(_) => self.round(),
            None if self.kit.gpu.is_software() => 1,
            None => count.max(1),
        };
        for first in (0..count).step_by(each as usize) {
            let now = if self.photons.is_some() { each } else { each.min(count - first) };
            let samples = (self.sum.samples(), now);
            if let Some(observer) = &self.observer {
                for sum in &mut self.observed {
                    observer.record(frame, scene, seed, samples, sum);
                }
            }
            let map = self.photons.as_ref().map(|(tracer, map)| {
                tracer.record(frame, scene, light, samples, map);
                map
            });
            self.tracer.record(frame, scene, path, now, (&mut self.sum, map));
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

fn photon_view((scene, loaded): (&Scene, &LoadedScene), (view, size_px): (&View, [u32; 2])) -> PhotonView {
    PhotonView {
        size_px,
        pixel_m2: view.pixel_m2(size_px),
        typical_nits: WHITE_STORED / loaded.radiance_scale,
        bounds_ws: scene.bounds_at(&loaded.pose).unwrap_or_default(),
        specular_ws: specular_bounds(scene, &loaded.pose),
    }
}

fn write_frame(gpu: &Gpu, group: &FrameGroup, loaded: &LoadedScene, data: &FrameData) {
    let lights: Vec<_> =
        loaded.lights.iter().map(|l| LightData { first_view: LightData::NO_VIEW, ..*l }).collect();
    gpu.queue.write_buffer(group.frame.raw(), 0, bytemuck::bytes_of(data));
    gpu.queue.write_buffer(group.lights.raw(), 0, bytemuck::cast_slice(&lights));
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
