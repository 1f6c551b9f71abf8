//! Light transport without shortcuts, sample by sample.

mod frame;
mod options;
mod sums;

use chiaro_gpu::{Buffer, Frame, Gpu, Recorder, Texture, parallel};
use chiaro_scene::{Pose, Scene};
use chiaro_techniques::Pass;
use chiaro_techniques::frame::FrameGroup;
use chiaro_techniques::paths::{Interfaces, Specular};
use chiaro_techniques::rays::{Refit, TraceData, TraceScene, WORN};
use chiaro_techniques::reference::first_hit::{FirstHitSum, FirstHitTracer};
use chiaro_techniques::reference::path::{
    EmitterData, Emitters, PathNoise, PathOptions, PathSum, PathTracer,
};
use chiaro_techniques::reference::photon::{PhotonMap, PhotonOptions, PhotonTracer, PhotonView};
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::scene::motion::Motion;
use chiaro_techniques::shared::albedo_table::AlbedoTable;
use glam::Vec3;

pub use chiaro_techniques::reference::first_hit::FirstHit;
pub use options::{Integrator, ReferenceOptions, Shard};

use frame::{sky, write_frame};

use crate::checks::{check_size, check_view};
use crate::loaded::WHITE_STORED;
use crate::{Error, Kit, LoadedScene, Settings, View};

/// Samples that share light paths: enough for lanes to balance long paths with short ones; where nothing is gathered within
/// a radius that shrinks from round to round, enough to keep a large GPU busy.
const ROUND: u32 = 4;
const ROUND_ALONE: u32 = 16;
/// Dispatches that [`Reference::refine`] records at most.
const DISPATCHES: u32 = 16;
/// Rows that workgroups cover.
const BAND: u32 = 8;
/// Samples of a pixel in one dispatch at most: a driver's watchdog should not notice.
const SAMPLES_AT_ONCE: u32 = 64;
/// Lanes of light paths in one dispatch at least.
const LEAST_LANES: u32 = 1 << 10;

/// An image being traced: the mean of samples that [`Reference::add`] adds.
///
/// Of the settings those count that say what is there, not how it is drawn: `surface.lighting`, `surface.normal_maps`
/// and `environment.*`: where a scene has no environment map, `environment.sky` says what surrounds it.
#[derive(Debug)]
pub struct Reference {
    kit: Kit,
    frame_group: FrameGroup,
    traced: TraceScene,
    emitters: Emitters,
    tracer: PathTracer,
    noise: PathNoise,
    photons: Option<Photons>,
    following: Option<Following>,
    sum: PathSum,
    observer: Option<FirstHitTracer>,
    observed: Vec<FirstHitSum>,
    options: ReferenceOptions,
}

/// Light paths of the pass under way.
#[derive(Debug)]
struct Photons {
    tracer: PhotonTracer,
    // Of the image's size; none before there is one.
    map: Option<PhotonMap>,
    lanes_done: u32,
    specular: Specular,
    // Where what mirrors or refracts is now.
    specular_ws: Option<(Vec3, Vec3)>,
}

/// Passes for scenes that move or bend.
#[derive(Debug)]
struct Following {
    motion: Motion,
    refit: Refit,
}

impl Following {
    fn new(kit: &Kit) -> Result<Self, Error> {
        let (motion, refit) = (Motion::compile(kit, &())?, Refit::compile(kit, &())?);
        Ok(Self { motion, refit })
    }
}

impl Reference {
    /// Builds the scene's trees for the pose that `loaded`, which is `scene` uploaded by the same kit, has now, and compiles
    /// the tracers.
    ///
    /// # Errors
    /// When the scene's trees or the image's light paths do not fit the adapter, a shader does not compile, or
    /// [`Scene::validate`] refuses the scene.
    pub fn new(
        kit: &Kit,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        image: (&View, [u32; 2]),
        options: ReferenceOptions,
    ) -> Result<Self, Error> {
        let mut reference = Self::build(kit, scene, (&loaded.pose, loaded.gpu.facts), options)?;
        reference.restart(loaded, settings, image)?;
        kit.gpu.check()?;
        Ok(reference)
    }

    /// The part of [`Reference::new`] that takes up to seconds and that any thread may do: trees and pipelines, for an image
    /// of one pixel until [`Reference::restart`] says which. `facts` are those of the scene as uploaded.
    ///
    /// # Errors
    /// As [`Reference::new`].
    pub fn build(
        kit: &Kit,
        scene: &Scene,
        (pose, facts): (&Pose, SceneFacts),
        options: ReferenceOptions,
    ) -> Result<Self, Error> {
        scene.validate()?;
        let gpu = &kit.gpu;
        let (trees, emitters) =
            parallel::join(|| TraceData::build(scene, pose, &[]), || EmitterData::build(scene, pose));
        let (traced, emitters) = (trees.upload(gpu)?, emitters.upload(gpu)?);
        let specular = Specular::of(scene);
        let specular_ws = specular.bounds_ws(scene, pose);
        let facts = (facts, traced.facts, Interfaces::of(scene, &specular));
        // What bends but does not move is bent once, by the same pass as in pictures.
        let moves = scene.duration_s().is_some()
            || scene.nodes.iter().any(|node| scene.deforms(node))
            || *pose != scene.pose(0.0);
        let following = moves.then(|| Following::new(kit)).transpose()?;
        let needed = match options.integrator {
            Integrator::Path => false,
            Integrator::Photon => true,
            Integrator::Full => specular_ws.is_some(),
        };
        let layouts = (&kit.frame_layout, &kit.scene_layout);
        let tracer = PathTracer::new(gpu, &kit.library, layouts, facts, needed)?;
        let photons = needed.then(|| -> Result<_, Error> {
            let tracer = PhotonTracer::new(gpu, &kit.library, layouts, facts)?;
            Ok(Photons { tracer, map: None, lanes_done: 0, specular, specular_ws })
        });
        Ok(Self {
            kit: kit.clone(),
            frame_group: FrameGroup::new(gpu, &kit.frame_layout, &AlbedoTable::compile(kit, &())?.texture),
            traced,
            emitters,
            tracer,
            noise: PathNoise::new(gpu, &kit.library)?,
            photons: photons.transpose()?,
            following,
            sum: PathSum::new(gpu, [1; 2]),
            observer: None,
            observed: Vec::new(),
            options,
        })
    }

    /// Starts a new image with the same trees: from another view, of another size, with other settings. Makes textures only
    /// where the size is another than before.
    ///
    /// # Errors
    /// When the image's light paths, or the table of all that shines, do not fit the adapter.
    pub fn restart(
        &mut self,
        loaded: &LoadedScene,
        settings: &Settings,
        (view, size_px): (&View, [u32; 2]),
    ) -> Result<(), Error> {
        let gpu = &self.kit.gpu;
        check_size(gpu, size_px)?;
        check_view(view, size_px)?;
        let same_size = self.sum.size_px() == size_px;
        if let Some(photons) = &mut self.photons {
            let seen = PhotonView {
                size_px,
                pixel_m2: view.pixel_m2(size_px),
                typical_nits: WHITE_STORED / loaded.radiance_scale,
                bounds_ws: loaded.gpu.bounds_ws,
                specular_ws: photons.specular_ws,
            };
            match &mut photons.map {
                Some(map) if same_size => map.view = seen,
                map => *map = Some(PhotonMap::new(gpu, seen, self.options.integrator == Integrator::Photon)?),
            }
            photons.lanes_done = 0;
        }
        let environment = loaded.environment.as_ref().map(|map| &map.texture);
        self.frame_group.reserve(gpu, loaded.lights().len(), environment);
        write_frame(gpu, &self.frame_group, (loaded, settings), (view, size_px));
        self.emitters.set_sky(gpu, sky(loaded, settings))?;
        if same_size {
            self.sum.resume(0);
        } else {
            self.sum = PathSum::new(gpu, size_px);
            for sum in &mut self.observed {
                *sum = FirstHitSum::new(gpu, size_px, sum.what);
            }
        }
        Ok(())
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.kit.gpu
    }

    /// What is traced.
    pub fn options(&self) -> ReferenceOptions {
        self.options
    }

    /// Lets random choices start from another seed. To be followed by [`Reference::restart`] or [`Reference::restore`].
    pub fn reseed(&mut self, seed: u32) {
        self.options.seed = seed;
    }

    /// Starts the image again where the scene is now: `loaded` has taken another pose since. The trees follow, which is
    /// quicker than building them anew but leaves those of bending meshes as good as they fit.
    ///
    /// # Errors
    /// When trees had to be built anew, or light paths to be made room for, and do not fit the adapter.
    pub fn follow(
        &mut self,
        (scene, loaded): (&Scene, &LoadedScene),
        settings: &Settings,
        image: (&View, [u32; 2]),
    ) -> Result<(), Error> {
        if self.following.is_none() {
            self.following = Some(Following::new(&self.kit)?);
        }
        let gpu = &self.kit.gpu;
        if !self.traced.update(gpu, scene, &loaded.pose) {
            self.traced = TraceData::build(scene, &loaded.pose, &[]).upload(gpu)?;
        }
        if !self.emitters.update(gpu, scene, &loaded.pose) {
            self.emitters = EmitterData::build(scene, &loaded.pose).upload(gpu)?;
        }
        if let Some(photons) = &mut self.photons {
            photons.specular_ws = photons.specular.bounds_ws(scene, &loaded.pose);
        }
        self.restart(loaded, settings, image)
    }

    /// Builds the trees anew where bending has worn them so far that rays are slow in them: worth a look after
    /// [`Reference::follow`] where a moment is traced for longer than trees take to build. The image is the same. Returns
    /// whether it built any. Waits for the GPU.
    ///
    /// # Errors
    /// When the trees do not fit the adapter, or the device was lost.
    pub fn renew(
        &mut self,
        recorder: &mut Recorder,
        (scene, loaded): (&Scene, &LoadedScene),
    ) -> Result<bool, Error> {
        let mut frame = recorder.begin();
        self.catch_up(&mut frame, loaded);
        frame.submit();
        let gpu = &self.kit.gpu;
        let Some(boxes) = self.traced.read_boxes(gpu) else { return Ok(false) };
        let worn = self.traced.wear(&boxes.wait(gpu)?) > WORN;
        if worn {
            self.traced = TraceData::build(scene, &loaded.pose, &[]).upload(gpu)?;
        }
        Ok(worn)
    }

    /// Lets vertices and trees take a pose that is new.
    fn catch_up(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene) {
        if let Some(Following { motion, refit }) = self.following.as_mut().filter(|_| self.traced.stale()) {
            motion.record(frame, &loaded.gpu);
            refit.record(frame, &loaded.gpu, &self.traced);
        }
    }

    /// Sums up these quantities, too, in layers of the name [`FirstHit::layer`]. To be said before the first sample. `facts`
    /// are those of the scene as uploaded.
    ///
    /// # Errors
    /// When the shader does not compile.
    pub fn observe(&mut self, facts: SceneFacts, wanted: &[FirstHit]) -> Result<(), Error> {
        let Kit { gpu, library, frame_layout, scene_layout } = &self.kit;
        let facts = (facts, self.traced.facts);
        self.observer = Some(FirstHitTracer::new(gpu, library, (frame_layout, scene_layout), facts)?);
        let size_px = self.sum.size_px();
        self.observed = wanted.iter().map(|&what| FirstHitSum::new(gpu, size_px, what)).collect();
        Ok(())
    }

    /// Samples that are added together: counts are rounded up to a multiple of this.
    pub fn round(&self) -> u32 {
        // llvmpipe silently ends all loops of an invocation after 65,535 iterations together: a sample is well below that.
        match self.options.integrator {
            _ if self.photons.is_none() || self.kit.gpu.is_software() => 1,
            Integrator::Photon => ROUND_ALONE,
            _ => ROUND,
        }
    }

    /// Light paths for each sample of the image; 0 where there are none.
    pub fn light_paths(&self) -> u32 {
        self.photons.as_ref().and_then(|photons| photons.map.as_ref()).map_or(0, PhotonMap::lanes)
    }

    /// Records `count` more samples of every pixel, in whole rounds, beside those that [`Reference::refine`] has under way.
    /// However they are grouped, the image is the same.
    pub fn add(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32) {
        let all = self.sum.samples().saturating_add(self.sum.rows_ahead().1).saturating_add(count);
        while self.sum.samples() < all {
            let now = self.most_at_once().min(all - self.sum.samples());
            self.record(frame, loaded, now, u64::MAX);
        }
    }

    /// Records about `work` samples of single pixels or light paths, but not more than `most` of each pixel, rounded up to
    /// whole rounds: some rows of the image or the whole image several times, so that a dispatch takes as long as a window
    /// can bear. Returns how many it recorded. The image is the same as [`Reference::add`] makes, and
    /// [`Reference::samples`] counts what all rows have.
    pub fn refine(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, work: u64, most: u32) -> u64 {
        let pixels: u64 = self.sum.size_px().map(u64::from).iter().product();
        let mut recorded = 0;
        for _ in 0..DISPATCHES {
            let left = work.saturating_sub(recorded);
            let wanted = most.saturating_sub(self.sum.samples()).min(self.most_at_once());
            let count = wanted.min((left / pixels).clamp(1, u64::from(u32::MAX)) as u32);
            if count == 0 || (recorded > 0 && left < self.least_work(count)) {
                break;
            }
            recorded += self.record(frame, loaded, count, left);
        }
        recorded
    }

    /// Samples that one dispatch may take of a pixel.
    fn most_at_once(&self) -> u32 {
        // See round().
        if self.kit.gpu.is_software() { 1 } else { SAMPLES_AT_ONCE }
    }

    /// Work of the smallest dispatch that comes next.
    fn least_work(&self, count: u32) -> u64 {
        let count = match self.sum.rows_ahead().1 {
            0 if self.photons.is_some() => self.round(),
            0 => count,
            under_way => under_way,
        };
        u64::from(count) * u64::from(BAND * self.sum.size_px()[0])
    }

    /// Records one dispatch of at most about `work`, that of a pass over the image with `count` samples which begins, or of
    /// the one that is under way; returns its work.
    fn record(&mut self, frame: &mut Frame<'_>, loaded: &LoadedScene, count: u32, work: u64) -> u64 {
        let ReferenceOptions { integrator, max_depth, diffuse_bounces, seed, shard } = self.options;
        self.catch_up(frame, loaded);
        let scene = (self.frame_group.group(), &loaded.gpu);
        let target = (&self.traced, &self.emitters);
        let (before, round) = (self.sum.samples(), self.round());
        let (first, step) = shard.numbers(before, round);
        let (rows_done, under_way) = self.sum.rows_ahead();
        let alone = integrator == Integrator::Photon;
        if let Some(Photons { tracer, map: Some(map), lanes_done, .. }) = &mut self.photons
            && under_way == 0
            && *lanes_done < map.lanes()
        {
            let options = PhotonOptions { max_depth, diffuse_bounces, seed };
            let lanes = (work / u64::from(round)).clamp(u64::from(LEAST_LANES), u64::from(u32::MAX)) as u32;
            let end = lanes_done.saturating_add(lanes).min(map.lanes());
            let traced = u64::from(end - *lanes_done) * u64::from(round);
            tracer.record(frame, scene, target, options, (first, round), (map, *lanes_done..end));
            *lanes_done = end;
            return traced;
        }
        let map = self.photons.as_ref().and_then(|photons| photons.map.as_ref());
        let count = match under_way {
            0 if map.is_some() => round,
            0 => count,
            under_way => under_way,
        };
        // Beside light paths that bring all else, what is seen of lights themselves.
        let path = PathOptions { max_depth: if alone { 1 } else { max_depth }, diffuse_bounces, seed };
        let [width, height] = self.sum.size_px();
        let row = u64::from(count) * u64::from(width);
        let bands = (work / (row * u64::from(BAND))).clamp(1, u64::from(u32::MAX / BAND)) as u32;
        let rows = (bands * BAND).min(height - rows_done);
        let numbers = (first, step);
        self.tracer.record(frame, scene, target, path, (numbers, (count, rows)), (&mut self.sum, map));
        // What is read between dispatches must be of whole passes, all of the same.
        if self.sum.rows_ahead().1 == 0 {
            if let Some(photons) = &mut self.photons {
                photons.lanes_done = 0;
            }
            if let Some(observer) = &self.observer {
                for sum in &mut self.observed {
                    let traced = (scene.0, scene.1, &self.traced);
                    observer.record(frame, traced, seed, numbers, (before, count), sum);
                }
            }
        }
        u64::from(rows) * row
    }

    /// Records a measurement of the noise, to be read from [`Reference::noise`] once the frame is submitted.
    pub fn measure_noise(&self, frame: &mut Frame<'_>) {
        self.noise.record(frame, &self.sum, self.round());
    }

    /// One `f32`: pixels' mean standard error relative to the mean of the image, when that was last measured.
    pub fn noise(&self) -> &Buffer {
        self.noise.buffer()
    }

    /// Nits summed over [`Reference::samples`], and how much of the pixel surfaces cover, rounded.
    pub fn sum_texture(&self) -> &Texture {
        self.sum.sum()
    }

    /// Share of the rows that have more samples than [`Reference::samples`] says, 0..1.
    pub fn under_way(&self) -> f32 {
        self.sum.rows_ahead().0 as f32 / self.sum.size_px()[1] as f32
    }

    /// What [`Reference::observe`] was asked to sum up.
    pub fn observed(&self, what: FirstHit) -> Option<&Texture> {
        self.observed.iter().find(|sum| sum.what == what).map(FirstHitSum::texture)
    }

    /// Samples a pixel so far.
    pub fn samples(&self) -> u32 {
        self.sum.samples()
    }
}
