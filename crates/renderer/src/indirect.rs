//! Indirect light by virtual lights, as a frame makes it: their places, their shadows, and what they give the picture.

use chiaro_gpu::{Buffer, Frame, Gpu, Group, Texture, TexturePool};
use chiaro_techniques::frame::LightData;
use chiaro_techniques::indirect::accumulate::{Accumulate, Allowed};
use chiaro_techniques::indirect::bounces::{BounceRoom, Bounces};
use chiaro_techniques::indirect::clusters::{ClusterRoom, Clusters};
use chiaro_techniques::indirect::compensate::{Compensate, CompensateInputs, CompensateRoom};
use chiaro_techniques::indirect::gather::{Gather, GatherInputs, GatherRoom, Gathered, Gathers};
use chiaro_techniques::indirect::ism::{Ism, IsmAtlas, IsmInputs, IsmPlan, IsmRoom};
use chiaro_techniques::indirect::pictures::{PictureInputs, PictureRoom, Pictures};
use chiaro_techniques::indirect::points::{PointData, PointRoom, Points};
use chiaro_techniques::indirect::rsm::{self, Rsm, RsmInputs, RsmPlan, RsmRoom, RsmView};
use chiaro_techniques::indirect::sources::{SourcePool, SourceRoom, Sources, Surroundings};
use chiaro_techniques::indirect::vpls::{VplRoom, VplSet, Vpls, candidates};
use chiaro_techniques::indirect::{IndirectSettings, LitBy, SCATTERED, SOURCES, Slots, VplSampling};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::shadow::{Casters, ShadowOutputs};
use chiaro_techniques::view::culling::{Culling, DrawLists};
use chiaro_techniques::view::{MotionOutputs, Surfaces, ViewData, ViewTable};
use glam::Vec3;

use crate::{Error, Settings};

mod kept;

use kept::{Means, Rested};

/// What makes it.
#[derive(Clone, Copy)]
pub(crate) struct IndirectPasses<'a> {
    pub surfaces: &'a Surfaces,
    pub culling: &'a Culling,
    pub rsm: &'a Rsm,
    pub vpls: &'a Vpls,
    pub gather: &'a Gather,
    // Where settings ask for imperfect shadow maps.
    pub points: Option<&'a Points>,
    pub ism: Option<&'a Ism>,
    // Where settings ask for more than one.
    pub bounces: Option<&'a Bounces>,
    // Where settings ask for them.
    pub sources: Option<&'a Sources>,
    // Where settings ask for any.
    pub clusters: Option<&'a Clusters>,
    // Where settings ask for it.
    pub compensate: Option<&'a Compensate>,
    // Where frames are averaged.
    pub accumulate: Option<&'a Accumulate>,
    // Where something may ask for them.
    pub pictures: Option<&'a Pictures>,
}

/// What lamps shine at, and what stands between virtual lights and what they light.
#[derive(Clone, Copy)]
pub(crate) struct LitScene<'a> {
    pub gpu: &'a SceneGpu,
    pub points: Option<&'a PointData>,
    // The trees' words.
    pub tracer: Option<&'a Buffer>,
    // What glows of it, and what its surroundings are; none where nothing shines itself.
    pub sources: Option<&'a SourcePool>,
}

/// What virtual lights and their shadows lie in, for one view.
#[derive(Debug, Default)]
pub(crate) struct IndirectRooms {
    points: Option<PointRoom>,
    rsm: Option<RsmRoom>,
    vpls: Option<VplRoom>,
    ism: Option<IsmRoom>,
    bounces: Option<BounceRoom>,
    clusters: Option<ClusterRoom>,
    compensate: Option<CompensateRoom>,
    sources: Option<SourceRoom>,
    // What the virtual lights of what shines itself, and their maps, were made from, and the generation of the scene's pose; none
    // where they have to be made.
    rested: Option<(Rested, u64)>,
    gather: LightRooms,
    // Light of opaque surfaces, in moving pictures.
    accumulated: Means,
    // Of see-through layers.
    layer: LightRooms,
    // Where they are wanted.
    pictures: Option<PictureRoom>,
}

/// Light of both kinds.
#[derive(Debug, Default)]
struct LightRooms {
    bounced: Option<GatherRoom>,
    // Where anything shines itself.
    sourced: Option<GatherRoom>,
}

/// What a frame asks for.
pub(crate) struct Wanted<'a> {
    pub lights: &'a [LightData],
    /// Of each light: see [`near_suns`].
    pub near: &'a [Option<(Vec3, Vec3)>],
    pub round: u32,
    /// Of frames that are averaged: 1/√ of how many.
    pub share: f32,
    pub size_px: [u32; 2],
    pub pictures: bool,
    // Whether see-through layers are gathered for, too.
    pub layers: bool,
    // Whether what is late may wait.
    pub moves: bool,
    /// What surrounds the scene.
    pub around: Surroundings,
    // Whether the frame goes on from the one before.
    pub continues: bool,
    // Steps to other sets of virtual lights.
    pub drift: u32,
    // In moving pictures that average light.
    pub allowed: Option<Allowed>,
}

/// What a frame does.
#[derive(Debug)]
pub(crate) struct IndirectPlan {
    settings: IndirectSettings,
    around: Surroundings,
    rsm: RsmPlan,
    round: u32,
    moves: bool,
    share: f32,
    continues: bool,
    drift: u32,
    allowed: Option<Allowed>,
    /// What was given up, for the user.
    pub note: Option<String>,
}

/// Group 0 and the scene, what makes light of it, and the plan of the frame.
#[derive(Clone, Copy)]
pub(crate) struct GatherAt<'a> {
    pub group: &'a Group,
    pub passes: IndirectPasses<'a>,
    pub scene: LitScene<'a>,
    pub plan: &'a IndirectPlan,
}

/// What virtual lights are made from.
pub(crate) struct VplInputs<'a> {
    pub at: GatherAt<'a>,
    pub shadows: &'a ShadowOutputs,
    // Where compensation may ask for it.
    pub light_grid: Option<&'a Buffer>,
    // Depth and surface of the surface buffer.
    pub seen: (&'a Texture, &'a Texture),
    // How opaque surfaces have moved, where frames are averaged.
    pub motion: Option<&'a MotionOutputs>,
    // Where reflective shadow maps stand in the table of views, and what was culled with its first batch, if any was.
    pub views: (&'a ViewTable, Option<&'a DrawLists>, u32),
}

impl IndirectPlan {
    /// Views to be drawn, for the table.
    pub fn draws(&self) -> impl ExactSizeIterator<Item = ViewData> {
        self.rsm.draws()
    }

    /// With the bound of this frame: frames that are averaged have other virtual lights each, together as many as if each
    /// stood for less.
    fn bounded(&self) -> IndirectSettings {
        IndirectSettings { clamp: self.settings.clamp * self.share, ..self.settings.clone() }
    }

    /// Whether the light of frames is averaged.
    pub fn averages(&self) -> bool {
        self.allowed.is_some()
    }

    /// All views that there are.
    pub fn views(&self) -> usize {
        self.rsm.views.len()
    }
}

/// Of each light that is a sun a box around what casts its shadows about a camera, where that is a small part of the scene.
pub(crate) fn near_suns(
    casters: &Casters,
    lights: &[LightData],
    eye_ws: Vec3,
    bounds_ws: (Vec3, Vec3),
) -> Vec<Option<(Vec3, Vec3)>> {
    let near = |light: &LightData| {
        let is_sun = light.kind == LightData::DIRECTIONAL;
        is_sun.then(|| casters.casting(light.direction_ws.into(), eye_ws, bounds_ws)).flatten()
    };
    lights.iter().map(near).collect()
}

/// Reflective shadow maps take this much at most, and less where the adapter binds less, bytes.
const MOST_RSM_BYTES: u64 = 256 << 20;
/// They are made no smaller than this to fit, texels a side.
const LEAST_RSM_SIDE: u32 = 16;

/// The views of all lights, by as many texels a side as are asked for or fit; and what to tell of it.
fn reflective_views(
    gpu: &Gpu,
    scene: &SceneGpu,
    (lights, near): (&[LightData], &[Option<(Vec3, Vec3)>]),
    settings: &IndirectSettings,
    candidates: u32,
) -> (Vec<RsmView>, Option<String>) {
    let wanted = settings.rsm_resolution;
    let most = MOST_RSM_BYTES.min(gpu.limits.max_storage_buffer_binding_size);
    let mut side = wanted;
    loop {
        let views = rsm::fit(lights, (scene.bounds_ws, near), side, candidates);
        if rsm::bytes(&views) <= most || side / 2 < LEAST_RSM_SIDE {
            let note = (side < wanted).then(|| {
                let count = views.len();
                format!(
                    "indirect.rsm_resolution is {side} instead of {wanted}: maps of {count} views of lights would take \
                     more than {} MiB",
                    most >> 20
                )
            });
            return (views, note);
        }
        side /= 2;
    }
}

impl IndirectRooms {
    /// Makes room, and says what a frame draws.
    ///
    /// # Errors
    /// When something does not fit the adapter.
    pub fn plan(
        &mut self,
        (gpu, pool): (&Gpu, &TexturePool),
        (passes, scene): (IndirectPasses<'_>, LitScene<'_>),
        settings: &Settings,
        wanted: &Wanted<'_>,
    ) -> Result<IndirectPlan, Error> {
        let indirect = &settings.indirect;
        let sources = scene.sources.is_some_and(|pool| pool.glows() || wanted.around.nits != Vec3::ZERO);
        let slots = Slots::new(indirect, LitBy { lamps: !wanted.lights.is_empty(), sources });
        let evenly = if indirect.sampling == VplSampling::Halton { candidates(indirect) } else { 0 };
        let (views, note) = reflective_views(gpu, scene.gpu, (wanted.lights, wanted.near), indirect, evenly);
        let most = if wanted.moves { indirect.rsm_maps as usize } else { usize::MAX };
        let of = (scene.gpu, passes.surfaces);
        let rsm = passes.rsm.plan((gpu, pool), of, views, (most, indirect.rsm_cache), &mut self.rsm)?;
        passes.vpls.room(gpu, indirect, (slots, rsm.tiles()), &mut self.vpls);
        let mut atlases = 0;
        match (passes.points, passes.ism, scene.points) {
            (Some(points), Some(ism), Some(data)) if settings.points().is_some() => {
                points.room(gpu, data, &mut self.points)?;
                let plan = IsmPlan::new(gpu, indirect, slots.all())?;
                let room = chiaro_gpu::keep(
                    &mut self.ism,
                    |room| room.serves(plan, wanted.pictures),
                    || ism.room(gpu, plan, wanted.pictures),
                );
                atlases = room.atlases().len();
            }
            _ => (self.points, self.ism) = (None, None),
        }
        self.bounces = passes.bounces.map(|bounces| self.bounces.take().unwrap_or_else(|| bounces.room(gpu)));
        self.sources = passes.sources.map(|sources| self.sources.take().unwrap_or_else(|| sources.room(gpu)));
        match passes.clusters.filter(|_| indirect.makes_clusters()) {
            Some(clusters) => {
                clusters.room(gpu, indirect, &mut self.clusters);
            }
            None => self.clusters = None,
        }
        match passes.compensate.filter(|_| indirect.compensates()) {
            Some(compensate) => {
                compensate.room(gpu, pool, wanted.size_px, &mut self.compensate);
            }
            None => self.compensate = None,
        }
        for (rooms, wants) in [(&mut self.gather, true), (&mut self.layer, wanted.layers)] {
            let all = [
                (Gathers::Bounced, &mut rooms.bounced, wants),
                (Gathers::Sources, &mut rooms.sourced, wants && slots.shine()),
            ];
            for (light, room, wants) in all {
                if wants {
                    passes.gather.room((gpu, pool), wanted.size_px, atlases, light, room);
                } else {
                    *room = None;
                }
            }
        }
        match passes.accumulate {
            // Frames that average nothing leave what there is.
            Some(accumulate) if wanted.allowed.is_some() => {
                accumulate.room(gpu, pool, wanted.size_px, &mut self.accumulated.bounced);
                if slots.shine() {
                    accumulate.room(gpu, pool, wanted.size_px, &mut self.accumulated.sourced);
                } else {
                    self.accumulated.sourced = None;
                }
            }
            Some(_) => {}
            None => self.accumulated = Means::default(),
        }
        match passes.pictures.filter(|_| wanted.pictures) {
            Some(pictures) => {
                let has_points = self.points.is_some();
                pictures.room((gpu, pool), wanted.size_px, &rsm, has_points, &mut self.pictures);
            }
            None => self.pictures = None,
        }
        let (settings, around) = (indirect.clone(), wanted.around);
        let &Wanted { round, moves, share, continues, drift, allowed, .. } = wanted;
        Ok(IndirectPlan { settings, around, rsm, round, moves, share, continues, drift, allowed, note })
    }

    /// Places virtual lights, draws their shadows and gathers their light. `seed`: what sequences are turned by.
    pub fn record(&mut self, frame: &mut Frame<'_>, seed: u32, light: &VplInputs<'_>) -> Gathered {
        let VplInputs { at, shadows, light_grid, seen, motion, views: (table, lists, first) } = *light;
        let GatherAt { group, passes, scene, plan } = at;
        let indirect = &plan.settings;
        let (Some(maps), Some(placed)) = (&mut self.rsm, &mut self.vpls) else {
            unreachable!("what is planned has room")
        };
        let drawn = RsmInputs {
            group,
            scene: scene.gpu,
            surfaces: passes.surfaces,
            plan: &plan.rsm,
            table,
            first,
            lists,
            culling: passes.culling,
            shadows,
        };
        passes.rsm.record(frame, &drawn, maps);
        let IndirectPlan { round, drift, continues, .. } = *plan;
        let set = VplSet { seed, round, drift, continues };
        passes.vpls.record(frame, (indirect, set), (group, seen), (&plan.rsm, maps), placed);
        let slots = placed.slots();
        let now = match (&self.ism, scene.points) {
            // Clusters are made from lights that lie where these would.
            (Some(room), Some(points)) if plan.moves && slots.shine() && !indirect.makes_clusters() => {
                Some(Rested {
                    made_by: passes.rsm.id(),
                    settings: indirect.clone(),
                    slots: *slots,
                    seed,
                    scene: scene.gpu.id(),
                    points: points.id(),
                    around: plan.around,
                    rooms: [placed.vpls.raw().clone(), room.atlases()[0].words.raw().clone()],
                })
            }
            _ => None,
        };
        let pose = scene.gpu.motion.generation();
        let now = now.map(|now| (now, pose));
        let rest = match (&self.rested, &now) {
            (Some((had, pose)), Some((now, _))) => {
                had == now && !scene.gpu.motion.moved_since(*pose, |_| true)
            }
            _ => false,
        };
        self.rested = now;
        if let (Some(clusters), Some(room)) = (passes.clusters, &mut self.clusters) {
            clusters.record(frame, (indirect, plan.round), (scene.gpu.id(), plan.moves), placed, room);
        }
        if let (Some(sources), Some(pool), Some(room), true) =
            (passes.sources, scene.sources, &self.sources, slots.shine() && !rest)
        {
            let (what, vpls) = ((pool, plan.around), (&placed.vpls, &placed.count));
            sources.record(frame, (slots, plan.round), scene.gpu, what, vpls, room);
        }
        if let (Some(points), Some(ism), Some(pool), Some(room), Some(data)) =
            (passes.points, passes.ism, &mut self.points, &self.ism, scene.points)
        {
            points.record(frame, scene.gpu, pool);
            let of = |set| IsmInputs {
                points: &pool.points,
                pool: pool.count,
                vpls: &placed.vpls,
                vpl_count: &placed.count,
                set,
                scene_area_m2: data.counted_m2() as f32,
                dense: data.thinning().map(|thinning| {
                    ((thinning.eye_m - scene.gpu.motion.origin()).as_vec3(), thinning.from_m)
                }),
                bounds_ws: scene.gpu.bounds_ws,
            };
            ism.record(frame, indirect, &of(0), room);
            let bounce = |frame: &mut Frame<'_>, set, lit_by: &[u32]| {
                if let (Some(bounces), Some(told)) = (passes.bounces, &self.bounces) {
                    bounces.record(
                        frame,
                        (slots, seed, plan.round),
                        (&of(set), lit_by),
                        room.atlases(),
                        told,
                    );
                    ism.record(frame, indirect, &of(set), room);
                }
            };
            if slots.shine() && !rest {
                ism.record(frame, indirect, &of(SOURCES), room);
                bounce(frame, SCATTERED, &[SOURCES]);
            }
            for set in 1..indirect.made_bounces() {
                let lit_by = [set - 1, SCATTERED];
                let sets = if set == 1 && slots.shine() { 2 } else { 1 };
                bounce(frame, set, &lit_by[..sets]);
            }
        }
        if let (Some(pictures), Some(room)) = (passes.pictures, &self.pictures) {
            let shown = PictureInputs {
                group,
                seen,
                maps: (&plan.rsm, maps),
                vpls: placed,
                points: self.points.as_ref(),
            };
            pictures.record(frame, &shown, room);
        }
        let mut given_back = None;
        if let (Some(compensate), Some(room), Some(light_grid)) =
            (passes.compensate, &self.compensate, light_grid)
        {
            let ((depth, surface), vpl_count) = (seen, &placed.count);
            let scene = scene.gpu;
            let shown = CompensateInputs { group, scene, depth, surface, shadows, light_grid, vpl_count };
            compensate.record(frame, (&plan.bounded(), plan.round), &shown, room);
            given_back = Some(room.given_back());
        }
        let gathered = self.gather(frame, at, (seen, &self.gather), given_back);
        match (passes.accumulate, motion, plan.allowed) {
            (Some(accumulate), Some(motion), Some(allowed)) => {
                self.accumulated.record(frame, accumulate, (seen.1, motion, allowed), gathered)
            }
            _ => gathered,
        }
    }

    /// Gathers for a layer of see-through surfaces, where there is room for any.
    pub fn layer_gatherer<'a>(
        &'a self,
        at: Option<GatherAt<'a>>,
    ) -> Option<impl Fn(&mut Frame<'_>, &Texture, &Texture) -> Gathered + 'a> {
        let at = at.filter(|_| self.layer.bounced.is_some())?;
        Some(move |frame: &mut Frame<'_>, depth: &Texture, surface: &Texture| {
            self.gather(frame, at, ((depth, surface), &self.layer), None)
        })
    }

    fn gather(
        &self,
        frame: &mut Frame<'_>,
        at: GatherAt<'_>,
        ((depth, surface), rooms): ((&Texture, &Texture), &LightRooms),
        given_back: Option<&Texture>,
    ) -> Gathered {
        let (Some(room), Some(vpls)) = (&rooms.bounced, &self.vpls) else {
            unreachable!("what is planned has room")
        };
        let atlases: &[IsmAtlas] = self.ism.as_ref().map_or(&[], IsmRoom::atlases);
        let bounced = GatherInputs {
            group: at.group,
            scene: Some(at.scene.gpu),
            depth,
            surface,
            vpls: &vpls.vpls,
            vpl_count: &vpls.count,
            light: Gathers::Bounced,
            atlases,
            tracer: at.scene.tracer,
            given_back,
        };
        let sourced = GatherInputs { light: Gathers::Sources, given_back: None, ..bounced };
        let settings = at.plan.bounded();
        Gathered {
            bounced: at.passes.gather.record(frame, &settings, &bounced, room),
            sourced: rooms
                .sourced
                .as_ref()
                .map(|room| at.passes.gather.record(frame, &settings, &sourced, room)),
        }
    }
}
