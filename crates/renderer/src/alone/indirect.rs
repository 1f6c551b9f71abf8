//! Indirect light on depth, normals and albedo that the program has drawn.

mod drawn;
mod maker;

use chiaro_gpu::{Gpu, Recorder, TexturePool, wgpu};
use chiaro_scene::{Light, Pose, Scene};
use chiaro_techniques::frame::{FrameData, FrameGroup, LightData};
use chiaro_techniques::indirect::foreign::{ForeignInputs, ForeignRoom};
use chiaro_techniques::indirect::points::PointData;
use chiaro_techniques::indirect::sources::Surroundings;
use chiaro_techniques::indirect::{IndirectSettings, Technique};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::settings::Value;
use chiaro_techniques::shadow::{Casters, Layout, ShadowOutputs, ShadowSettings};
use chiaro_techniques::view::ViewTable;
use chiaro_techniques::view::culling::{Culling, ListRoom};
use chiaro_techniques::{Kit, shaders};
use glam::{Affine3A, Vec3};

use super::group;
use crate::indirect::{GatherAt, IndirectRooms, LitScene, VplInputs, Wanted, near_suns};
use crate::loaded::stored_per_nit;
use crate::{Depth, Error, Settings, Trees, View};

pub use drawn::DrawnSurfaces;
use drawn::HeldTextures;
use maker::Maker;

/// Indirect light of virtual point lights, for a program that draws and lights its surfaces itself.
///
/// The program hands over once what lamps shine at and what stands in their way, and every frame its lamps and what it has drawn.
/// It gets a texture of the light that its surfaces scatter after lamps' light was scattered once before, to be added in its own
/// shading. Nothing else of chiaro runs: no picture is culled, drawn or shaded. Nothing is submitted, waited for or read back, and
/// while sizes and the number of lamps stay the same nothing is allocated.
///
/// Lamps' own light is followed to its first surface by rays, so that walls stop it from either side and glass lets its share
/// through; what stands between virtual lights and surfaces is up to the settings.
#[derive(Debug)]
pub struct IndirectLight {
    gpu: Gpu,
    // With nothing left to the adapter.
    settings: Settings,
    maker: Maker,
    scene: SceneGpu,
    trees: Trees,
    points: Option<PointData>,
    // As they stood at first.
    casters: Casters,
    shadows: ShadowOutputs,
    group: FrameGroup,
    views: ViewTable,
    lists: Option<ListRoom>,
    rooms: IndirectRooms,
    foreign: Option<ForeignRoom>,
    textures: HeldTextures,
    pool: TexturePool,
    recorder: Recorder,
    notes: Vec<String>,
}

impl IndirectLight {
    /// Uploads what lamps shine at, builds its trees (about 4 µs a triangle), spreads points over it for imperfect shadow maps,
    /// and compiles. Of the scene its meshes, nodes and materials count. `indirect.technique = auto` is `ism`.
    ///
    /// # Errors
    /// When the technique makes no virtual lights, compensation is asked for, the scene is unsound or does not fit the adapter, or
    /// a shader does not compile.
    pub fn new(gpu: &Gpu, settings: IndirectSettings, scene: &Scene) -> Result<Self, Error> {
        let settings = resolved(gpu, settings)?;
        scene.validate()?;
        let kit = Kit::new(gpu, shaders::library());
        let pose = scene.pose(0.0);
        let mut uploaded = SceneGpu::upload(gpu, &kit.scene_layout, scene)?;
        let trees = Trees::build(gpu, scene, &pose, &[])?;
        uploaded.facts = trees.facts(uploaded.facts);
        let points = settings.points().map(|options| PointData::build(scene, &pose, options));
        let maker = Maker::compile(&kit, &settings, uploaded.facts)?;
        let group = FrameGroup::new(gpu, &kit.frame_layout, &maker.albedo_table.texture);
        gpu.check()?;
        Ok(Self {
            gpu: gpu.clone(),
            settings,
            maker,
            scene: uploaded,
            trees,
            points,
            casters: Casters::new(scene, &pose, &[]),
            shadows: ShadowOutputs::new(gpu, 1, 1),
            group,
            views: ViewTable::new(gpu),
            lists: None,
            rooms: IndirectRooms::default(),
            foreign: None,
            textures: HeldTextures::new(gpu),
            pool: TexturePool::default(),
            recorder: Recorder::new(gpu, false),
            notes: Vec::new(),
        })
    }

    /// Chooses points for imperfect shadow maps that are dense around a place that the camera looks from, where most of the scene is
    /// far from it and those that there are were not chosen for about there. Takes up to seconds. Without it all are as dense.
    ///
    /// # Errors
    /// When the scene is another than this was made from.
    pub fn look_from(&mut self, scene: &Scene, pose: &Pose, eye_ws: Vec3) -> Result<(), Error> {
        self.trees.check(scene)?;
        let eye_m = eye_ws.as_dvec3() + scene.origin;
        if let (Some(points), Some(options)) = (&self.points, self.settings.points())
            && !points.serves_from(eye_m)
        {
            self.points = Some(PointData::build_for(scene, pose, options, eye_m, Some(points)));
        }
        Ok(())
    }

    /// Moves nodes of the scene that this was made from; the next frame's light follows. What no animation moves makes the trees be
    /// built anew, at once.
    ///
    /// # Errors
    /// When the scene is another, [`Scene::validate_pose`] refuses the pose, or trees had to be built anew and do not fit the
    /// adapter.
    pub fn set_pose(&mut self, scene: &Scene, pose: &Pose) -> Result<(), Error> {
        self.trees.check(scene)?;
        scene.validate_pose(pose)?;
        self.trees.update(scene, pose)?;
        self.scene.set_pose(scene, pose);
        Ok(())
    }

    /// Records what makes this frame's indirect light, of lamps with their poses in the world, on what the program has drawn. To
    /// be called when that stands in the encoder, and before it is shaded.
    ///
    /// The texture is Rgba16Float and as large as the depth; it is the same one until the size changes. Its rgb is radiance in
    /// nits where lamps are in candela and lux, at most 65,000: albedo · irradiance / π, or irradiance / π without an albedo; its
    /// alpha is 0, as is the sky.
    ///
    /// # Errors
    /// When a texture cannot be read or has another size than the depth; when the camera or a lamp's pose are not finite; when maps
    /// of so many lamps do not fit the adapter. Nothing is recorded then.
    pub fn record(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        lights: &[(Light, Affine3A)],
        drawn: &DrawnSurfaces<'_>,
    ) -> Result<&wgpu::TextureView, Error> {
        drawn.check()?;
        let (gpu, settings) = (&self.gpu, &self.settings);
        let (view, far_depth) = View::of_host(drawn.view_from_world, drawn.clip_from_view, drawn.depth_runs)?;
        let size_px = drawn.size_px();
        let mut lights = group::placed(gpu, lights, (&view, size_px))?;
        lights.retain(|light| light.intensity != [0.0; 3]);
        let data = frame_data((&view, size_px), &lights, settings, (&self.scene, &self.casters));
        let passes = self.maker.passes();
        let tracer = &self.trees.traced.words;
        let scene =
            LitScene { gpu: &self.scene, points: self.points.as_ref(), tracer: Some(tracer), sources: None };
        let near = near_suns(&self.casters, &lights, view.eye_ws(), self.scene.bounds_ws);
        let wanted = Wanted {
            lights: &lights,
            near: &near,
            round: 0,
            share: 1.0,
            size_px,
            pictures: false,
            layers: false,
            moves: true,
            around: Surroundings::default(),
            continues: false,
            drift: 0,
            allowed: None,
        };
        let plan = self.rooms.plan((gpu, &self.pool), (passes, scene), settings, &wanted)?;
        self.notes.clear();
        self.notes.extend(plan.note.clone());
        let at_once = Culling::views_at_once(gpu, scene.gpu);
        let drawn_views: Vec<_> = plan.draws().collect();
        self.views.set(gpu, &drawn_views, &[], at_once);
        let together = at_once.min(plan.views());
        let serves = |room: &ListRoom| room.serves(scene.gpu, together);
        let lists = chiaro_gpu::keep(&mut self.lists, serves, || ListRoom::new(gpu, scene.gpu, together));
        let room = self.maker.foreign.room(gpu, &self.pool, size_px, &mut self.foreign);
        self.group.reserve(gpu, lights.len(), None);
        self.shadows.tracer = Some(tracer.clone());
        let [depth, normals, albedo] = self.textures.hold(drawn);

        let mut frame = self.recorder.begin_in(encoder);
        self.group.upload(&mut frame, &data, &lights, &[]);
        self.views.upload(&mut frame);
        self.maker.motion.record(&mut frame, scene.gpu);
        self.maker.refit.record(&mut frame, scene.gpu, &self.trees.traced);
        let group = self.group.group();
        let inputs = ForeignInputs {
            group,
            depth,
            is_reversed: drawn.depth_runs == Depth::Reversed,
            far_depth,
            normals,
            is_biased: drawn.has_biased_normals(),
            albedo,
        };
        self.maker.foreign.record_surface(&mut frame, &inputs, room);
        let culled = self.views.batches().first().cloned();
        let lists =
            culled.map(|batch| passes.culling.record(&mut frame, scene.gpu, &self.views, batch, lists));
        let made_from = VplInputs {
            at: GatherAt { group, passes, scene, plan: &plan },
            shadows: &self.shadows,
            light_grid: None,
            seen: (&room.depth, &room.surface),
            motion: None,
            views: (&self.views, lists.as_ref(), 0),
        };
        let gathered = self.rooms.record(&mut frame, settings.seed, &made_from);
        self.maker.foreign.record_radiance(&mut frame, (group, &gathered.bounced), room);
        frame.submit();
        Ok(room.light.view())
    }

    /// Sentences about what the last frame gave up, for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// All settings that matter.
fn resolved(gpu: &Gpu, mut indirect: IndirectSettings) -> Result<Settings, Error> {
    indirect.technique = match indirect.technique {
        Technique::Auto => Technique::Ism,
        made if made.makes_vpls() => made,
        other => {
            return Err(Error::Combination(format!(
                "indirect light alone takes indirect.technique = rsm, ism or traced, not {}: that makes no virtual lights",
                other.show()
            )));
        }
    };
    if indirect.compensate {
        let refused = "indirect light alone takes indirect.compensate = false: what lamps give the picture is the program's";
        return Err(Error::Combination(refused.into()));
    }
    let shadow = ShadowSettings {
        layout: Layout::Traced,
        rays: 1,
        transmission_tint: true,
        ..ShadowSettings::default()
    };
    Ok(Settings { shadow, indirect, ..Settings::default() }.resolved(gpu))
}

fn frame_data(
    (view, size_px): (&View, [u32; 2]),
    lights: &[LightData],
    settings: &Settings,
    (scene, casters): (&SceneGpu, &Casters),
) -> FrameData {
    FrameData {
        lighting_model: settings.surface.lighting as u32,
        normal_maps: u32::from(settings.surface.normal_maps),
        anisotropy: settings.surface.anisotropy,
        radiance_scale: stored_per_nit((scene.bounds_ws, casters), lights, (0.0, 0.0)),
        ..group::frame_data(view, size_px, &settings.shadow)
    }
}
