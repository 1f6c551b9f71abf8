//! Reflective shadow maps (Dachsbacher & Stamminger 2005, "Reflective Shadow Maps"): what each light shines at, and how much
//! light goes on from there. Virtual lights are placed in them ([`crate::indirect::vpls`]).
//!
//! A map is a surface buffer like the camera's, of a view of the one table: culled, rastered and resolved by
//! [`crate::view`], one map after the other in the same textures, and kept as 16 bytes a texel in one buffer of all maps. Maps
//! whose light rests, and sees nothing that moves, are kept from frame to frame.
//!
//! | step | reads | writes | by |
//! | --- | --- | --- | --- |
//! | visibility, resolve | scene | depth, surface of one map | [`Surfaces`] |
//! | light | those, shadows, lights | `rsm`: see `rsm.wesl` | a lane a texel |
//!
//! A texel carries the flux that its surface scatters on as Lambert's: of a local light I(ω) Δω ρ with Δω = Δω₀ cos³θ, θ from
//! the view's axis; of a sun E ΔA ρ; times what its shadows let through, lumens. ρ is the diffuse albedo and, of dielectrics
//! rougher than 0.2–0.4, the gloss: a named bias, for it is not scattered evenly. Metals and mirrors carry nothing.
//!
//! # Limits
//! See-through casters and backs of single-sided surfaces stop light as far as the shadow technique says so, and where its
//! maps reach. A sun has one map around the whole scene, and a second one of what casts its shadows where that is a small
//! part of it ([`crate::shadow::Casters::casting`]): texels of the first that the second shows are left to that.
//!
//! # Cost
//! 16 bytes a texel kept: 4 MiB of 512²; 24–32 bytes a texel of the largest map while drawing. A map that is drawn
//! takes a raster pass of what it sees, a resolve and this pass: 262,144 texels at about 60 bytes are 16 MB, at 3.3 TB/s 5 µs.

mod views;

pub use views::{RsmView, RsmViewData, fit};

use std::sync::atomic::{AtomicU64, Ordering};

use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{
    Binding, Buffer, ComputePipeline, Dispatch, Frame, Gpu, GpuError, Group, History, Life, TexturePool,
};

use crate::scene::{SceneFacts, SceneGpu};
use crate::shadow::{Lookup, ShadowOutputs};
use crate::view::culling::{Culling, DrawLists, ListRoom};
use crate::view::{SurfaceRoom, Surfaces, ViewData, ViewTable};
use crate::{Kit, Pass, shaders};
use views::TILE;

/// Bytes that uniform bindings are apart.
const STRIDE: u64 = 256;

/// The pass that turns surfaces into light.
#[derive(Debug)]
pub struct Rsm {
    light: ComputePipeline,
    // What these passes drew, others need not have drawn alike.
    id: u64,
}

static NEXT_ID: AtomicU64 = AtomicU64::new(1);

/// What lies in the maps.
#[derive(Clone, Debug)]
struct Drawn {
    view: RsmView,
    pose: u64,
    // Among those that were recorded.
    frame: u64,
}

/// The maps of all lights.
#[derive(Debug)]
pub struct RsmRoom {
    /// See `rsm.wesl`.
    pub rsm: Buffer,
    /// [`RsmViewData`], one behind the other.
    pub views: Buffer,
    // The same, as far apart as uniform bindings.
    uniforms: Buffer,
    // By side.
    surfaces: Vec<(u32, Option<SurfaceRoom>)>,
    // For views that are not culled with the camera.
    lists: Option<ListRoom>,
    words: u64,
    capacity: usize,
    // That were recorded.
    frames: u64,
    // By passes and scene; by view.
    drawn: History<[u64; 2], Vec<Option<Drawn>>>,
}

/// Which maps a frame draws.
#[derive(Clone, Debug, Default)]
pub struct RsmPlan {
    /// All.
    pub views: Vec<RsmView>,
    // Those to be drawn, and those that wait for their turn.
    drawn: Vec<usize>,
    waiting: Vec<usize>,
}

impl RsmPlan {
    /// The views to be drawn.
    pub fn draws(&self) -> impl ExactSizeIterator<Item = ViewData> {
        self.drawn.iter().map(|&number| self.views[number].draw)
    }

    /// Tiles of all maps.
    pub fn tiles(&self) -> u32 {
        self.views.first().map_or(0, |view| view.data.tiles)
    }
}

/// What [`Rsm::record`] draws.
#[derive(Clone, Copy, Debug)]
pub struct RsmInputs<'a> {
    /// Group 0.
    pub group: &'a Group,
    /// Geometry and materials.
    pub scene: &'a SceneGpu,
    /// Draws them.
    pub surfaces: &'a Surfaces,
    /// What is to be drawn.
    pub plan: &'a RsmPlan,
    /// Where the plan's draws stand, from number `first` on.
    pub table: &'a ViewTable,
    /// See `table`.
    pub first: u32,
    /// What was culled with the table's first batch, if any was.
    pub lists: Option<&'a DrawLists>,
    /// Culls the other batches.
    pub culling: &'a Culling,
    /// What stops light.
    pub shadows: &'a ShadowOutputs,
}

impl Pass for Rsm {
    type Key = (Lookup, SceneFacts);

    fn compile(kit: &Kit, &(shadow, facts): &Self::Key) -> Result<Self, GpuError> {
        let Kit { gpu, library, frame_layout, scene_layout } = kit;
        let entry = shaders::rsm_light(shadow.source);
        let constants = shadow.constants(gpu, shadow.facts(facts));
        let light = ComputePipeline::new(gpu, library, &entry, &[frame_layout, scene_layout], &constants)?;
        Ok(Self { light, id: NEXT_ID.fetch_add(1, Ordering::Relaxed) })
    }
}

impl Rsm {
    /// Room for the maps of so many views, and which of them a frame draws: those that show something else than they did,
    /// `most` at most unless one has not been drawn yet; all, where none `keeps`. Not inside a frame.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] when the maps are more than the adapter can bind.
    pub fn plan(
        &self,
        (gpu, pool): (&Gpu, &TexturePool),
        (scene, surfaces): (&SceneGpu, &Surfaces),
        views: Vec<RsmView>,
        (most, keeps): (usize, bool),
        room: &mut Option<RsmRoom>,
    ) -> Result<RsmPlan, GpuError> {
        let words = bytes(&views) / 4;
        let limit = gpu.limits.max_storage_buffer_binding_size.min(gpu.limits.max_buffer_size);
        if 4 * words > limit {
            return Err(GpuError::TooLarge {
                what: format!("the reflective shadow maps of {} views of lights", views.len()),
                needed: 4 * words,
                limit,
                unit: "bytes",
                advice: "make indirect.rsm_resolution smaller, or take fewer lights",
            });
        }
        let serves = |room: &RsmRoom| room.words == words && room.capacity == views.len().max(1);
        let room = chiaro_gpu::keep(room, serves, || {
            let count = views.len().max(1);
            let copied = BufferUsages::COPY_DST;
            let make = |name, life, bytes, usage| Buffer::new(gpu, name, life, bytes, usage);
            RsmRoom {
                rsm: make("rsm", Life::Kept, 4 * words.max(1), BufferUsages::STORAGE | copied),
                views: make(
                    "rsm_views",
                    Life::Frame,
                    (count * size_of::<RsmViewData>()) as u64,
                    BufferUsages::STORAGE | copied,
                ),
                uniforms: make(
                    "rsm_uniforms",
                    Life::Frame,
                    count as u64 * STRIDE,
                    BufferUsages::UNIFORM | copied,
                ),
                surfaces: Vec::new(),
                lists: None,
                words,
                capacity: count,
                frames: 0,
                drawn: History::default(),
            }
        });
        for side in views.iter().map(|view| view.data.side) {
            let at = room.surfaces.iter().position(|(has, _)| *has == side);
            let at = at.unwrap_or_else(|| {
                room.surfaces.push((side, None));
                room.surfaces.len() - 1
            });
            surfaces.room(gpu, pool, [side; 2], &mut room.surfaces[at].1);
        }
        room.surfaces.retain(|(side, _)| views.iter().any(|view| view.data.side == *side));
        let culled = Culling::views_at_once(gpu, scene);
        // One batch goes with the camera's view.
        if views.len() >= culled {
            let culled = culled.min(views.len());
            let serves = |room: &ListRoom| room.serves(scene, culled);
            chiaro_gpu::keep(&mut room.lists, serves, || ListRoom::new(gpu, scene, culled));
        }
        if !keeps {
            room.drawn.cut();
        }
        let drawn = room.drawn.get(&[self.id, scene.id()]);
        let rests = |number: usize, view: &RsmView| {
            let has = drawn.and_then(|drawn| drawn.get(number)?.as_ref());
            has.is_some_and(|has| has.view.shows_as(view) && !view.draw.sees_moved(&scene.motion, has.pose))
        };
        let mut due: Vec<usize> = (0..views.len()).filter(|&number| !rests(number, &views[number])).collect();
        // What was drawn longest ago comes first.
        let since =
            |number: &usize| drawn.and_then(|drawn| Some(drawn.get(*number)?.as_ref()?.frame)).unwrap_or(0);
        due.sort_by_key(since);
        let first = drawn.is_none_or(|drawn| drawn.iter().any(Option::is_none));
        let waiting = if first { Vec::new() } else { due.split_off(most.min(due.len())) };
        Ok(RsmPlan { views, drawn: due, waiting })
    }

    /// Tells the passes of one compilation from those of others, which need not draw alike.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Draws the maps that were planned.
    pub fn record(&self, frame: &mut Frame<'_>, inputs: &RsmInputs<'_>, room: &mut RsmRoom) {
        let RsmInputs { group, scene, surfaces, plan, table, first, .. } = *inputs;
        let data: Vec<_> = plan.views.iter().map(|view| view.data).collect();
        if data.is_empty() {
            // Nobody reads them, but they are bound.
            frame.clear(&room.views);
            frame.clear(&room.rsm);
        }
        frame.upload(&room.views, &data);
        for batch in table.batches() {
            let drawn = batch.start.max(first)..batch.end.min(first + plan.drawn.len() as u32);
            if drawn.is_empty() {
                continue;
            }
            let lists = if let Some(lists) = inputs.lists.filter(|lists| lists.views == *batch) {
                lists.clone()
            } else if let Some(lists) = &room.lists {
                inputs.culling.record(frame, scene, table, batch.clone(), lists)
            } else {
                unreachable!("there is room for views that are not culled with the camera")
            };
            for number in drawn {
                let view = &plan.views[plan.drawn[(number - first) as usize]];
                let side = view.data.side;
                let found = room.surfaces.iter().find(|(has, _)| *has == side);
                let Some(surface) = found.and_then(|(_, room)| room.as_ref()) else {
                    unreachable!("there is room for maps of every side")
                };
                let seen = (table, &lists, number);
                surfaces.record_visibility(frame, (group, scene), seen, surface);
                let buffer = surfaces.record_resolve(frame, (group, scene), seen, surface);
                let at = u64::from(view.draw.layer) * STRIDE;
                frame.upload_at(&room.uniforms, at, &[view.data]);
                let uniform = Binding::BufferRange(&room.uniforms, at, size_of::<RsmViewData>() as u64);
                let mut binds = inputs.shadows.binds();
                binds.extend([
                    ("rsm_view", uniform),
                    ("depth", (&buffer.depth).into()),
                    ("surface", (&buffer.surface).into()),
                    ("rsm", (&room.rsm).into()),
                ]);
                let texels = Dispatch::Threads([side, side, 1]);
                frame.compute("indirect/rsm", &self.light, &[group, scene.group()], &binds, texels);
            }
        }
        let key = [self.id, scene.id()];
        let pose = scene.motion.generation();
        room.frames += 1;
        let mut drawn = room.drawn.get(&key).cloned().unwrap_or_default();
        drawn.resize(plan.views.len(), None);
        for (number, view) in plan.views.iter().enumerate() {
            if plan.drawn.contains(&number) {
                drawn[number] = Some(Drawn { view: *view, pose, frame: room.frames });
            } else if let Some(rests) = drawn[number].as_mut().filter(|_| !plan.waiting.contains(&number)) {
                rests.pose = pose;
            }
        }
        room.drawn.keep(key, drawn);
    }
}

/// What the maps of all views take, bytes.
pub fn bytes(views: &[RsmView]) -> u64 {
    let tiles = views.first().map_or(0, |view| u64::from(view.data.tiles));
    4 * tiles * (1 + 4 * u64::from(TILE * TILE))
}
