//! The frame functions: one straight line each.

use chiaro_gpu::{Buffer, Frame, Texture, wgpu};
use chiaro_techniques::caustics::CausticLight;
use chiaro_techniques::caustics::photon_trace::{PhotonInputs, PhotonPlan, PhotonRoom};
use chiaro_techniques::direct::{LightInputs, LightRoom};
use chiaro_techniques::frame::{FrameData, FrameGroup};
use chiaro_techniques::indirect::gather::Gathered;
use chiaro_techniques::post::{AntialiasRoom, Parts};
use chiaro_techniques::shadow::{
    ShadowInputs, ShadowOutputs, ShadowPlan, ShadowRoom, ShadowSettings, ShadowViews,
};
use chiaro_techniques::specular::{SpecularRoom, SpecularSurfaces};
use chiaro_techniques::transparency::{FollowLayer, GatherLayer, LayerRoom};
use chiaro_techniques::view::culling::{DrawLists, ListRoom};
use chiaro_techniques::view::{MotionOutputs, MotionRoom, SurfaceBuffer, SurfaceRoom, ViewTable};

use crate::indirect::{GatherAt, IndirectPlan, IndirectRooms, VplInputs};
use crate::moving::Moves;
use crate::passes::Passes;
use crate::view_state::Rooms;
use crate::{LoadedScene, Pipeline, Settings};

/// What a frame leaves behind, valid until the next.
#[derive(Clone, Debug)]
pub struct FrameOutputs {
    /// Rgba16Float, nits · radiance scale; unlit materials are black.
    pub radiance: Texture,
    /// Rgba16Float, what unlit materials add to the picture once it is exposed: 1 is the display's white. Only for scenes
    /// that have such materials.
    pub unlit: Option<Texture>,
    /// The frame's light taken apart, where [`ViewState::take_apart`](crate::ViewState::take_apart) asked for it.
    pub parts: Option<Parts>,
    /// Shadow maps.
    pub shadows: ShadowOutputs,
    /// Lights per froxel.
    pub light_grid: Buffer,
    /// How far things have moved since the frame before, in frames of moving pictures ([`crate::Sampling::Moving`]) that are
    /// averaged, or that something asks for the surface buffer of.
    pub motion: Option<MotionOutputs>,
    /// Depth, normals, materials of opaque surfaces; the forward pipeline makes it only where something asks for it.
    pub surface: Option<SurfaceBuffer>,
}

/// What a frame function needs to know.
pub(crate) struct FrameInputs<'a> {
    pub scene: &'a LoadedScene,
    pub group: &'a FrameGroup,
    pub shadow_views: &'a ShadowViews,
    pub shadow_plan: &'a ShadowPlan,
    pub indirect: Option<&'a IndirectPlan>,
    pub photons: Option<&'a PhotonPlan>,
    pub wants_surface: bool,
    pub moves: Option<&'a Moves>,
    pub data: FrameData,
}

/// The camera's number in the table of views; shadow views follow.
const CAMERA: u32 = 0;

/// What shading leaves.
struct Shaded {
    radiance: Texture,
    unlit: Option<Texture>,
    parts: Option<Parts>,
}

/// Records what `shade` does to one target under the frame's light, to another for the colour of unlit materials, and to one
/// for each part of the light that the frame is asked for: the same surfaces with other weights.
///
/// This is the one place where the parts are told from each other.
fn shade_all(
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    room: &LightRoom,
    mut shade: impl FnMut(&mut Frame<'_>, &Texture, Option<wgpu::Color>),
) -> Shaded {
    let light = inputs.data;
    let unlit = room.unlit.as_ref().map(|target| (target, light.without_light(light.show_direct)));
    let direct = room.direct.as_ref().map(|target| (target, light.direct_only()));
    shade(frame, &room.radiance, sky(&light));
    let caustics = room.caustics.as_ref().map(|target| (target, light.caustics_only()));
    for (target, data) in [unlit, direct, caustics].into_iter().flatten() {
        frame.upload(&inputs.group.frame, &[data]);
        shade(frame, target, sky(&data));
        frame.upload(&inputs.group.frame, &[light]);
    }
    let (radiance, unlit) = (room.radiance.clone(), room.unlit.clone());
    let parts = room.direct.clone().map(|direct| {
        let (picture, unlit) = (radiance.clone(), unlit.clone());
        Parts { picture, direct, caustics: room.caustics.clone(), unlit }
    });
    Shaded { radiance, unlit, parts }
}

/// What is behind everything, in stored units; `None` = the environment.
fn sky(data: &FrameData) -> Option<wgpu::Color> {
    data.stored_sky().map(|stored| {
        let [r, g, b] = stored.map(f64::from);
        wgpu::Color { r, g, b, a: 0.0 }
    })
}

pub(crate) fn record(
    settings: &Settings,
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    rooms: &mut Rooms,
) -> FrameOutputs {
    let Rooms {
        views,
        lists,
        surface,
        shadow,
        light,
        layers,
        motion,
        opaque_motion,
        antialias,
        indirect,
        photons,
        specular,
    } = rooms;
    let (Some(lists), Some(surface), Some(shadow), Some(light)) = (lists, surface, shadow, light) else {
        unreachable!("what is prepared has room")
    };
    let (layers, photons, specular) = (layers.as_ref(), photons.as_ref(), specular.as_ref());
    let rooms = FrameRooms { views, lists, surface, light, layers, photons, specular };
    // Without see-through surfaces all motion is that of opaque ones.
    let opaque = if rooms.layers.is_some() { opaque_motion.as_mut() } else { motion.as_mut() };
    let changing = ChangingRooms { shadow, indirect, opaque_motion: opaque };
    let (lists, outputs) = match settings.pipeline {
        Pipeline::Deferred => deferred(settings, passes, frame, inputs, (&rooms, changing)),
        Pipeline::Forward => forward(settings, passes, frame, inputs, (&rooms, changing)),
    };
    match (inputs.moves, motion) {
        (Some(moves), Some(motion)) if moves.antialias.is_some() || inputs.wants_surface => {
            let kept = (motion, antialias.as_mut());
            move_on(passes, frame, inputs, (&rooms, &lists), moves, kept, outputs)
        }
        _ => outputs,
    }
}

/// Finds how far everything has moved, and averages the picture with those before.
fn move_on(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    (rooms, lists): (&FrameRooms<'_>, &DrawLists),
    moves: &Moves,
    (motion, antialias): (&mut MotionRoom, Option<&mut AntialiasRoom>),
    mut outputs: FrameOutputs,
) -> FrameOutputs {
    let layer = rooms.layers.and_then(LayerRoom::nearest);
    // Where indirect light has not asked for the same.
    let found = outputs.motion.take();
    let vectors =
        found.unwrap_or_else(|| vectors(passes, frame, inputs, (rooms, lists, layer), moves, motion));
    if let (Some(pass), Some(room), Some(by)) = (&*passes.antialias, antialias, &moves.antialias) {
        let picture = (&outputs.radiance, outputs.unlit.as_ref());
        (outputs.radiance, outputs.unlit) = pass.record(frame, picture, &vectors, by, room);
    }
    outputs.motion = Some(vectors);
    outputs
}

fn vectors(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    (rooms, lists, layer): (&FrameRooms<'_>, &DrawLists, Option<&Texture>),
    moves: &Moves,
    motion: &mut MotionRoom,
) -> MotionOutputs {
    let camera = (rooms.views, lists, CAMERA);
    let moments = (&moves.now, moves.before.as_ref());
    let groups = (inputs.group.group(), &inputs.scene.gpu);
    passes.motion_vectors.record(frame, groups, camera, (rooms.surface, layer), moments, motion)
}

/// How far opaque surfaces have moved, where their indirect light is averaged.
fn opaque_motion(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    (rooms, lists): (&FrameRooms<'_>, &DrawLists),
    motion: Option<&mut MotionRoom>,
) -> Option<MotionOutputs> {
    let moves = inputs.moves.filter(|_| inputs.indirect.is_some_and(IndirectPlan::averages))?;
    Some(vectors(passes, frame, inputs, (rooms, lists, None), moves, motion?))
}

/// Room that holds what frames leave for the next.
struct ChangingRooms<'a> {
    shadow: &'a mut ShadowRoom,
    indirect: &'a mut IndirectRooms,
    opaque_motion: Option<&'a mut MotionRoom>,
}

/// All the other room that a frame has.
struct FrameRooms<'a> {
    views: &'a ViewTable,
    lists: &'a ListRoom,
    surface: &'a SurfaceRoom,
    light: &'a LightRoom,
    layers: Option<&'a LayerRoom>,
    photons: Option<&'a PhotonRoom>,
    specular: Option<&'a SpecularRoom>,
}

fn deferred(
    settings: &Settings,
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    (rooms, changing): (&FrameRooms<'_>, ChangingRooms<'_>),
) -> (DrawLists, FrameOutputs) {
    let group = inputs.group.group();
    let scene = &inputs.scene.gpu;
    follow(passes, frame, inputs.scene);
    let lists = cull(passes, frame, inputs, rooms);
    let camera = (rooms.views, &lists, CAMERA);
    let depth = passes.surfaces.record_visibility(frame, (group, scene), camera, rooms.surface);
    let shadow_inputs = shadow_inputs(passes, inputs, rooms, (&lists, Some(&depth)), &settings.shadow);
    let shadows = passes.shadows.record(frame, inputs.group, &shadow_inputs, changing.shadow);
    let surface = passes.surfaces.record_resolve(frame, (group, scene), camera, rooms.surface);
    let light_grid = passes.direct.record_grid(frame, group, rooms.light);
    let moved = opaque_motion(passes, frame, inputs, (rooms, &lists), changing.opaque_motion);
    let indirect = changing.indirect;
    let gather_at = gathers_at(passes, inputs);
    let gathered = gather_at.map(|at| {
        let views = (rooms.views, Some(&lists), CAMERA + 1);
        let seen = (&surface.depth, &surface.surface);
        let (light_grid, motion) = (Some(&light_grid), moved.as_ref());
        let light = VplInputs { at, shadows: &shadows, light_grid, seen, motion, views };
        indirect.record(frame, settings.seed, &light)
    });
    let gather_layer = indirect.layer_gatherer(gather_at);
    let gather_layer = gather_layer.as_ref().map(|gather| gather as GatherLayer<'_>);
    let caustics = caustics(passes, frame, inputs, rooms, &surface);
    let caustics = caustics.as_ref().unwrap_or(&rooms.light.no_caustics);
    let (bounced, sourced) = gathered.as_ref().map(Gathered::parts).unwrap_or_default();
    let light = LightInputs {
        shadows: &shadows,
        light_grid: &light_grid,
        irradiance: bounced.unwrap_or(&rooms.light.no_irradiance),
        source_irradiance: sourced.unwrap_or(&rooms.light.no_irradiance),
        caustics,
    };
    let Shaded { radiance, unlit, parts } = shade_all(frame, inputs, rooms.light, |frame, radiance, _| {
        passes.direct.record_deferred(frame, (group, scene), &surface, light, radiance);
        follow_mirrors(passes, frame, inputs, rooms, (&surface, radiance));
        if let (Some(transparency), Some(layers)) = (&*passes.transparency, rooms.layers) {
            let follow = layer_follower(passes, inputs, rooms, (&surface.depth, radiance));
            let follow = follow.as_ref().map(|follow| follow as FollowLayer<'_>);
            let picture = (radiance, layers);
            let light = (light, gather_layer, follow);
            transparency.record(frame, (group, scene), camera, light, &surface.depth, picture);
        }
    });
    let surface = Some(surface);
    let motion = moved.filter(|_| rooms.layers.is_none());
    (lists, FrameOutputs { radiance, unlit, parts, shadows, light_grid, motion, surface })
}

fn forward(
    settings: &Settings,
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    (rooms, changing): (&FrameRooms<'_>, ChangingRooms<'_>),
) -> (DrawLists, FrameOutputs) {
    let group = inputs.group.group();
    let scene = &inputs.scene.gpu;
    follow(passes, frame, inputs.scene);
    let lists = cull(passes, frame, inputs, rooms);
    let camera = (rooms.views, &lists, CAMERA);
    let wants_surface = inputs.wants_surface
        || inputs.indirect.is_some()
        || inputs.photons.is_some()
        || rooms.specular.is_some();
    let needs_depth = wants_surface
        || inputs.moves.is_some_and(|moves| moves.antialias.is_some())
        || rooms.layers.is_some()
        || !inputs.shadow_views.fitted.is_empty();
    let depth =
        needs_depth.then(|| passes.surfaces.record_visibility(frame, (group, scene), camera, rooms.surface));
    let shadow_inputs = shadow_inputs(passes, inputs, rooms, (&lists, depth.as_ref()), &settings.shadow);
    let shadows = passes.shadows.record(frame, inputs.group, &shadow_inputs, changing.shadow);
    let surface =
        wants_surface.then(|| passes.surfaces.record_resolve(frame, (group, scene), camera, rooms.surface));
    let light_grid = passes.direct.record_grid(frame, group, rooms.light);
    let moved = opaque_motion(passes, frame, inputs, (rooms, &lists), changing.opaque_motion);
    let indirect = changing.indirect;
    let gather_at = gathers_at(passes, inputs);
    let gathered = gather_at.zip(surface.as_ref()).map(|(at, surface)| {
        let views = (rooms.views, Some(&lists), CAMERA + 1);
        let seen = (&surface.depth, &surface.surface);
        let (light_grid, motion) = (Some(&light_grid), moved.as_ref());
        let light = VplInputs { at, shadows: &shadows, light_grid, seen, motion, views };
        indirect.record(frame, settings.seed, &light)
    });
    let gather_layer = indirect.layer_gatherer(gather_at);
    let gather_layer = gather_layer.as_ref().map(|gather| gather as GatherLayer<'_>);
    let caustics = surface.as_ref().and_then(|surface| caustics(passes, frame, inputs, rooms, surface));
    let caustics = caustics.as_ref().unwrap_or(&rooms.light.no_caustics);
    let (bounced, sourced) = gathered.as_ref().map(Gathered::parts).unwrap_or_default();
    let light = LightInputs {
        shadows: &shadows,
        light_grid: &light_grid,
        irradiance: bounced.unwrap_or(&rooms.light.no_irradiance),
        source_irradiance: sourced.unwrap_or(&rooms.light.no_irradiance),
        caustics,
    };
    let Shaded { radiance, unlit, parts } = shade_all(frame, inputs, rooms.light, |frame, radiance, sky| {
        let lists = (&lists, rooms.light);
        passes.direct.record_forward(frame, (group, scene), lists, light, sky, radiance);
        if let Some(surface) = &surface {
            follow_mirrors(passes, frame, inputs, rooms, (surface, radiance));
        }
        if let (Some(transparency), Some(layers), Some(depth)) = (&*passes.transparency, rooms.layers, &depth)
        {
            let follow = layer_follower(passes, inputs, rooms, (depth, radiance));
            let follow = follow.as_ref().map(|follow| follow as FollowLayer<'_>);
            let light = (light, gather_layer, follow);
            transparency.record(frame, (group, scene), camera, light, depth, (radiance, layers));
        }
    });
    let motion = moved.filter(|_| rooms.layers.is_none());
    (lists, FrameOutputs { radiance, unlit, parts, shadows, light_grid, motion, surface })
}

/// Where virtual lights are gathered, if any are made.
fn gathers_at<'a>(passes: &'a Passes, inputs: &FrameInputs<'a>) -> Option<GatherAt<'a>> {
    let (group, scene) = (inputs.group.group(), inputs.scene.lit());
    let (plan, passes) = inputs.indirect.zip(passes.indirect())?;
    Some(GatherAt { group, passes, scene, plan })
}

/// Finds what comes through mirrors and glass, if anything does.
fn caustics(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    rooms: &FrameRooms<'_>,
    surface: &SurfaceBuffer,
) -> Option<CausticLight> {
    let (plan, trees) = inputs.photons.zip(inputs.scene.trees.as_ref())?;
    let (pass, room) = passes.photons.as_ref().zip(rooms.photons)?;
    let inputs = PhotonInputs {
        group: inputs.group.group(),
        scene: &inputs.scene.gpu,
        tracer: &trees.traced.words,
        depth: &surface.depth,
        surface: &surface.surface,
    };
    Some(pass.record(frame, plan, &inputs, room))
}

/// Adds what opaque mirrors show, and keeps the picture for what see-through surfaces show, where rays follow them.
fn follow_mirrors(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    rooms: &FrameRooms<'_>,
    (surface, radiance): (&SurfaceBuffer, &Texture),
) {
    let Some((pass, room)) = passes.specular.as_ref().zip(rooms.specular) else { return };
    let Some(trees) = &inputs.scene.trees else { return };
    let surfaces = SpecularSurfaces {
        depth: &surface.depth,
        surface: &surface.surface,
        through: None,
        opaque_depth: &surface.depth,
    };
    let groups = (inputs.group.group(), &inputs.scene.gpu, &trees.traced.words);
    pass.record_copy(frame, radiance, room);
    pass.record_follow(frame, groups, surfaces, (radiance, room));
    if rooms.layers.is_some() {
        pass.record_copy(frame, radiance, room);
    }
}

/// What adds what a see-through layer shows, where rays follow it.
fn layer_follower<'a>(
    passes: &'a Passes,
    inputs: &'a FrameInputs<'_>,
    rooms: &'a FrameRooms<'_>,
    (opaque_depth, radiance): (&'a Texture, &'a Texture),
) -> Option<impl Fn(&mut Frame<'_>, &Texture, &Texture, &Texture) + 'a> {
    let (pass, room) = passes.specular.as_ref().zip(rooms.specular)?;
    let trees = inputs.scene.trees.as_ref()?;
    let groups = (inputs.group.group(), &inputs.scene.gpu, &trees.traced.words);
    Some(move |frame: &mut Frame<'_>, depth: &Texture, surface: &Texture, through: &Texture| {
        let surfaces = SpecularSurfaces { depth, surface, through: Some(through), opaque_depth };
        pass.record_follow(frame, groups, surfaces, (radiance, room));
    })
}

/// Lets geometry, and the trees over it, follow the scene's pose.
fn follow(passes: &Passes, frame: &mut Frame<'_>, scene: &LoadedScene) {
    passes.motion.record(frame, &scene.gpu);
    if let (Some(refit), Some(trees)) = (&*passes.refit, &scene.trees) {
        refit.record(frame, &scene.gpu, &trees.traced);
    }
}

/// Culls for the camera, and for as many of the other views that are known by now as go with it.
fn cull(
    passes: &Passes,
    frame: &mut Frame<'_>,
    inputs: &FrameInputs<'_>,
    rooms: &FrameRooms<'_>,
) -> DrawLists {
    let together = rooms.views.batches()[0].clone();
    passes.culling.record(frame, &inputs.scene.gpu, rooms.views, together, rooms.lists)
}

fn shadow_inputs<'a>(
    passes: &'a Passes,
    inputs: &FrameInputs<'a>,
    rooms: &FrameRooms<'a>,
    (lists, depth): (&'a DrawLists, Option<&'a Texture>),
    settings: &'a ShadowSettings,
) -> ShadowInputs<'a> {
    ShadowInputs {
        scene: &inputs.scene.gpu,
        views: inputs.shadow_views,
        plan: inputs.shadow_plan,
        table: rooms.views,
        first: CAMERA + 1 + inputs.indirect.map_or(0, |plan| plan.draws().len() as u32),
        lists,
        culling: &passes.culling,
        depth,
        tracer: inputs.scene.trees.as_ref().map(|trees| &trees.traced.words),
        settings,
    }
}
