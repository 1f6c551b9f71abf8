//! Indirect light by virtual lights, as a frame makes it: their places, their shadows, and what they give the picture.

use chiaro_gpu::{Buffer, Frame, Gpu, Group, Texture, TexturePool};
use chiaro_techniques::frame::LightData;
use chiaro_techniques::indirect::compensate::{CompensateInputs, CompensateRoom};
use chiaro_techniques::indirect::gather::{GatherInputs, GatherRoom};
use chiaro_techniques::indirect::ism::{IsmAtlas, IsmInputs, IsmPlan, IsmRoom};
use chiaro_techniques::indirect::pictures::{PictureInputs, PictureRoom};
use chiaro_techniques::indirect::points::PointRoom;
use chiaro_techniques::indirect::rsm::{self, RsmInputs, RsmPlan, RsmRoom, RsmView};
use chiaro_techniques::indirect::vpls::{VplRoom, candidates};
use chiaro_techniques::indirect::{IndirectSettings, VplSampling};
use chiaro_techniques::shadow::ShadowOutputs;
use chiaro_techniques::view::culling::DrawLists;
use chiaro_techniques::view::{SurfaceBuffer, ViewData, ViewTable};

use crate::passes::Passes;
use crate::{Error, LoadedScene, Settings};

/// What virtual lights and their shadows lie in, for one view.
#[derive(Debug, Default)]
pub(crate) struct IndirectRooms {
    points: Option<PointRoom>,
    rsm: Option<RsmRoom>,
    vpls: Option<VplRoom>,
    ism: Option<IsmRoom>,
    compensate: Option<CompensateRoom>,
    gather: Option<GatherRoom>,
    // Of see-through layers.
    layer: Option<GatherRoom>,
    // Where they are wanted.
    pictures: Option<PictureRoom>,
}

/// What a frame asks for.
pub(crate) struct Wanted<'a> {
    pub lights: &'a [LightData],
    pub round: u32,
    /// Of frames that are averaged: 1/√ of how many.
    pub share: f32,
    pub size_px: [u32; 2],
    pub pictures: bool,
    // Whether what is late may wait.
    pub moves: bool,
}

/// What a frame does.
#[derive(Debug)]
pub(crate) struct IndirectPlan {
    rsm: RsmPlan,
    round: u32,
    share: f32,
    /// What was given up, for the user.
    pub note: Option<String>,
}

/// Group 0 and the scene, and the plan of the frame.
#[derive(Clone, Copy)]
pub(crate) struct GatherAt<'a> {
    pub group: &'a Group,
    pub scene: &'a LoadedScene,
    pub plan: &'a IndirectPlan,
}

/// What virtual lights are made from.
pub(crate) struct VplInputs<'a> {
    pub at: GatherAt<'a>,
    pub shadows: &'a ShadowOutputs,
    pub light_grid: &'a Buffer,
    pub surface: &'a SurfaceBuffer,
    // Where reflective shadow maps stand in the table of views, and what was culled with its first batch.
    pub views: (&'a ViewTable, &'a DrawLists, u32),
}

impl IndirectPlan {
    /// Views to be drawn, for the table.
    pub fn draws(&self) -> Vec<ViewData> {
        self.rsm.draws()
    }

    /// With the bound of this frame: frames that are averaged have other virtual lights each, together as many as if each
    /// stood for less.
    fn bounded(&self, settings: &IndirectSettings) -> IndirectSettings {
        IndirectSettings { clamp: settings.clamp * self.share, ..settings.clone() }
    }

    /// All views that there are.
    pub fn views(&self) -> usize {
        self.rsm.views.len()
    }
}

/// Reflective shadow maps take this much at most, and less where the adapter binds less, bytes.
const MOST_RSM_BYTES: u64 = 256 << 20;
/// They are made no smaller than this to fit, texels a side.
const LEAST_RSM_SIDE: u32 = 16;

/// The views of all lights, by as many texels a side as are asked for or fit; and what to tell of it.
fn reflective_views(
    gpu: &Gpu,
    scene: &LoadedScene,
    lights: &[LightData],
    settings: &IndirectSettings,
    candidates: u32,
) -> (Vec<RsmView>, Option<String>) {
    let wanted = settings.rsm_resolution;
    let most = MOST_RSM_BYTES.min(gpu.limits.max_storage_buffer_binding_size);
    let mut side = wanted;
    loop {
        let views = rsm::fit(lights, scene.gpu.bounds_ws, side, candidates);
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
        (passes, scene): (&Passes, &LoadedScene),
        settings: &Settings,
        wanted: &Wanted<'_>,
    ) -> Result<IndirectPlan, Error> {
        let indirect = &settings.indirect;
        let evenly = if indirect.sampling == VplSampling::Halton { candidates(indirect) } else { 0 };
        let (views, note) = reflective_views(gpu, scene, wanted.lights, indirect, evenly);
        let most = if wanted.moves { indirect.rsm_maps as usize } else { usize::MAX };
        let Some(rsm) = passes.rsm.as_ref() else { return Err(Error::NoPasses) };
        let of = (&scene.gpu, &*passes.surfaces);
        let rsm = rsm.plan((gpu, pool), of, views, (most, indirect.rsm_cache), &mut self.rsm)?;
        if let Some(vpls) = passes.vpls.as_ref() {
            vpls.room(gpu, indirect, rsm.tiles(), &mut self.vpls);
        }
        let mut atlases = 0;
        match (passes.points.as_ref(), passes.ism.as_ref(), &scene.points) {
            (Some(points), Some(ism), Some(data)) if settings.points().is_some() => {
                points.room(gpu, data, &mut self.points)?;
                let plan = IsmPlan::new(gpu, indirect, indirect.vpls)?;
                let room = chiaro_gpu::keep(
                    &mut self.ism,
                    |room| room.serves(plan, wanted.pictures),
                    || ism.room(gpu, plan, wanted.pictures),
                );
                atlases = room.atlases().len();
            }
            _ => (self.points, self.ism) = (None, None),
        }
        match passes.compensate.as_ref().filter(|_| indirect.compensates()) {
            Some(compensate) => {
                compensate.room(gpu, pool, wanted.size_px, &mut self.compensate);
            }
            None => self.compensate = None,
        }
        if let Some(gather) = passes.gather.as_ref() {
            gather.room(gpu, pool, wanted.size_px, atlases, &mut self.gather);
            if scene.gpu.see_through() {
                gather.room(gpu, pool, wanted.size_px, atlases, &mut self.layer);
            } else {
                self.layer = None;
            }
        }
        match passes.pictures.as_ref().filter(|_| wanted.pictures) {
            Some(pictures) => {
                let has_points = self.points.is_some();
                pictures.room((gpu, pool), wanted.size_px, &rsm, has_points, &mut self.pictures);
            }
            None => self.pictures = None,
        }
        Ok(IndirectPlan { rsm, round: wanted.round, share: wanted.share, note })
    }

    /// Places virtual lights, draws their shadows and gathers their light.
    pub fn record(
        &mut self,
        frame: &mut Frame<'_>,
        (settings, passes): (&Settings, &Passes),
        light: &VplInputs<'_>,
    ) -> Texture {
        let indirect = &settings.indirect;
        let VplInputs { at, shadows, light_grid, surface, views: (table, lists, first) } = *light;
        let GatherAt { group, scene, plan } = at;
        let (Some(rsm), Some(vpls)) = (passes.rsm.as_ref(), passes.vpls.as_ref()) else {
            unreachable!("what is planned is compiled")
        };
        let (Some(maps), Some(placed)) = (&mut self.rsm, &self.vpls) else {
            unreachable!("what is planned has room")
        };
        let drawn = RsmInputs {
            group,
            scene: &scene.gpu,
            surfaces: &passes.surfaces,
            plan: &plan.rsm,
            table,
            first,
            lists,
            culling: &passes.culling,
            shadows,
        };
        rsm.record(frame, &drawn, maps);
        let how = (indirect, settings.seed, plan.round);
        vpls.record(frame, how, (group, surface), (&plan.rsm, maps), placed);
        if let (Some(points), Some(ism), Some(pool), Some(room), Some(data)) =
            (passes.points.as_ref(), passes.ism.as_ref(), &mut self.points, &self.ism, &scene.points)
        {
            points.record(frame, &scene.gpu, pool);
            let (lo, hi) = scene.gpu.bounds_ws;
            let shadowed = IsmInputs {
                points: &pool.points,
                pool: pool.count,
                vpls: &placed.vpls,
                vpl_count: &placed.count,
                scene_area_m2: data.area_m2 as f32,
                largest_m: lo.distance(hi).max(f32::MIN_POSITIVE),
            };
            ism.record(frame, indirect, &shadowed, room);
        }
        if let (Some(pictures), Some(room)) = (passes.pictures.as_ref(), &self.pictures) {
            let shown = PictureInputs {
                group,
                surface,
                maps: (&plan.rsm, maps),
                vpls: placed,
                points: self.points.as_ref(),
            };
            pictures.record(frame, &shown, room);
        }
        let SurfaceBuffer { depth, surface, .. } = surface;
        let mut given_back = None;
        if let (Some(compensate), Some(room)) = (passes.compensate.as_ref(), &self.compensate) {
            let vpl_count = &placed.count;
            let scene = &scene.gpu;
            let shown = CompensateInputs { group, scene, depth, surface, shadows, light_grid, vpl_count };
            compensate.record(frame, (&plan.bounded(indirect), plan.round), &shown, room);
            given_back = Some(room.given_back());
        }
        self.gather(frame, (settings, passes), at, (depth, surface, &self.gather), given_back)
    }

    /// Gathers for a layer of see-through surfaces, where there is room for any.
    pub fn layer_gatherer<'a>(
        &'a self,
        (settings, passes): (&'a Settings, &'a Passes),
        at: Option<GatherAt<'a>>,
    ) -> Option<impl Fn(&mut Frame<'_>, &Texture, &Texture) -> Texture + 'a> {
        let at = at.filter(|_| self.layer.is_some())?;
        Some(move |frame: &mut Frame<'_>, depth: &Texture, surface: &Texture| {
            self.gather(frame, (settings, passes), at, (depth, surface, &self.layer), None)
        })
    }

    fn gather(
        &self,
        frame: &mut Frame<'_>,
        (settings, passes): (&Settings, &Passes),
        at: GatherAt<'_>,
        (depth, surface, room): (&Texture, &Texture, &Option<GatherRoom>),
        given_back: Option<&Texture>,
    ) -> Texture {
        let (Some(gather), Some(room), Some(vpls)) = (passes.gather.as_ref(), room, &self.vpls) else {
            unreachable!("what is planned has room")
        };
        let atlases: &[IsmAtlas] = self.ism.as_ref().map_or(&[], IsmRoom::atlases);
        let gathered = GatherInputs {
            group: at.group,
            scene: Some(&at.scene.gpu),
            depth,
            surface,
            vpls: &vpls.vpls,
            vpl_count: &vpls.count,
            atlases,
            tracer: at.scene.trees.as_ref().map(|trees| &trees.traced.words),
            given_back,
        };
        gather.record(frame, &at.plan.bounded(&settings.indirect), &gathered, room)
    }
}
