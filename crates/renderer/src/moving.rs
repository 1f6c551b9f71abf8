//! Pictures that move: how their frames are sampled, and when a frame goes on from the one before.

use chiaro_gpu::History;
use chiaro_techniques::frame::LightData;
use chiaro_techniques::indirect::accumulate::Allowed;
use chiaro_techniques::post::{AntialiasInputs, CameraSettings};
use chiaro_techniques::scene::motion::SceneMotion;
use chiaro_techniques::view::Moment;
use glam::{Quat, Vec2, Vec3};

use crate::jitter::Jitter;
use crate::light_change::light_change;
use crate::{LoadedScene, Settings, View};

/// Where within their pixels frames are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// A frame by itself, or one of several that the caller averages.
    Single {
        /// Moves the picture right and down by parts of a pixel.
        jitter_px: Vec2,
        /// How much smaller than a pixel textures are filtered: 1/√frames averaged.
        footprint_scale: f32,
        /// Its number among those that are averaged: each has random choices of its own.
        round: u32,
    },
    /// A frame of a picture that moves: jittered and averaged over time as `post.antialias` says.
    Moving,
    /// The same without jitter and without averaging: for motion vectors alone.
    Steady,
}

impl Sampling {
    /// The frame of that number among those that are averaged.
    pub fn nth(jitter: &Jitter, index: u32) -> Self {
        let (jitter_px, footprint_scale) = (jitter.offset_px(index), jitter.footprint_scale());
        Self::Single { jitter_px, footprint_scale, round: index }
    }

    /// Whether the frame is one of a picture that moves.
    pub(crate) fn moves(self) -> bool {
        matches!(self, Self::Moving | Self::Steady)
    }
}

impl From<(Vec2, f32)> for Sampling {
    fn from((jitter_px, footprint_scale): (Vec2, f32)) -> Self {
        Self::Single { jitter_px, footprint_scale, round: 0 }
    }
}

/// Frames until offsets within the pixel come again.
const OFFSETS: u32 = 64;
/// How much smaller than a pixel textures are filtered while the camera rests, and while it moves.
const RESTING_FOOTPRINT: f32 = 0.25;
const MOVING_FOOTPRINT: f32 = 0.5;
/// A camera that goes further within a frame than this share of how far away the scene is, or turns further than this
/// (radians), has jumped, unless it went and turned so the frame before.
const JUMP_SHARE: f32 = 0.1;
const JUMP_RAD: f32 = 0.25;

/// Frames of indirect light that count while things move. What they change by more is found pixel by pixel.
const FRAMES_IN_MOTION: f32 = 8.0;
/// As many count as lamps take to change by this much, see [`light_change`].
const CHANGE_THAT_LAGS: f32 = 0.25;

/// What a frame must have in common with the one before to go on from it: scene, size, and all settings but those of the
/// screen.
pub(crate) type SeenKey = (u64, [u32; 2], Settings);

/// What the last frame of a moving picture showed.
pub(crate) type SeenHistory = History<SeenKey, Seen>;

/// What a frame showed.
#[derive(Clone, Debug)]
pub(crate) struct Seen {
    view: View,
    moment: Moment,
    // Of the scene's pose.
    generation: u64,
    lights: Vec<LightData>,
    radiance_scale: f32,
    // Since the last cut.
    frames: u32,
    // Steps to other sets of virtual lights since then.
    drift: u32,
    // Since the frame before, in world axes.
    step_m: Vec3,
    turn_rad: Vec3,
}

/// What a frame of a moving picture goes on from, and what the next may go on from.
#[derive(Clone, Debug)]
pub(crate) struct Moves {
    pub now: Moment,
    pub before: Option<Moment>,
    /// Offset within the pixel, and how much smaller than it textures are filtered.
    pub sampling: (Vec2, f32),
    /// Where frames are averaged.
    pub antialias: Option<AntialiasInputs>,
    /// Where their indirect light is.
    pub irradiance: Option<Allowed>,
    key: SeenKey,
    seen: Seen,
}

/// What is looked at in a frame.
pub(crate) struct Look<'a> {
    pub scene: &'a LoadedScene,
    pub view: &'a View,
    pub size_px: [u32; 2],
    pub settings: &'a Settings,
}

impl Moves {
    /// `smooths`: whether the frame becomes part of a mean; `accumulates`: whether its indirect light does. `history`: of
    /// frames whose textures are still there.
    pub(crate) fn new(
        look: &Look<'_>,
        history: Option<&SeenHistory>,
        [smooths, accumulates]: [bool; 2],
    ) -> Self {
        let key = look.key();
        let last = history.and_then(|history| history.get(&key));
        let before = last.filter(|last| look.goes_on_from(last));
        let mut seen = look.seen(before, last);
        let index = seen.frames - 1;
        let (jitter_px, footprint_scale) = match before {
            Some(before) if smooths && before.moment == seen.moment => {
                (Jitter::new(OFFSETS).offset_px(index % OFFSETS), RESTING_FOOTPRINT)
            }
            // A camera that moves takes every frame elsewhere by itself, and offsets would only be blurred away.
            Some(_) if smooths => (Vec2::ZERO, MOVING_FOOTPRINT),
            _ => (Vec2::ZERO, 1.0),
        };
        let antialias = smooths.then(|| AntialiasInputs {
            rests: before.is_some_and(|before| before.shows_the_same_as(&seen)),
            jitter_px: jitter_px.to_array(),
            history_scale: seen.scale_since(before),
        });
        let irradiance = accumulates.then(|| look.allowed(before, &seen));
        // The mean becomes that of several sets of virtual lights, of which few a frame are others. What changes by itself has no
        // need of it.
        if irradiance.is_some() && before.is_some_and(|before| before.is_lit_as(&seen)) {
            seen.drift = seen.drift.wrapping_add(1);
        }
        let (now, before) = (seen.moment, before.map(|before| before.moment));
        Self { now, before, sampling: (jitter_px, footprint_scale), antialias, irradiance, key, seen }
    }

    /// Steps to other sets of virtual lights since the last cut.
    pub(crate) fn drift(&self) -> u32 {
        self.seen.drift
    }

    /// Once the frame is recorded, the next may go on from it.
    pub(crate) fn keep(self, history: &mut SeenHistory) {
        history.keep(self.key, self.seen);
    }
}

impl Seen {
    /// Stored units of radiance over those of the frame before.
    fn scale_since(&self, before: Option<&Self>) -> f32 {
        before.map_or(1.0, |before| self.radiance_scale / before.radiance_scale)
    }

    fn shows_the_same_as(&self, other: &Self) -> bool {
        self.view == other.view && self.is_lit_as(other)
    }

    fn is_lit_as(&self, other: &Self) -> bool {
        self.generation == other.generation && self.lights == other.lights
    }
}

impl Look<'_> {
    fn key(&self) -> SeenKey {
        let CameraSettings { exposure_ev100, tone_map, .. } = CameraSettings::default();
        let mut settings = self.settings.clone();
        (settings.camera.exposure_ev100, settings.camera.tone_map) = (exposure_ev100, tone_map);
        (self.scene.gpu.id(), self.size_px, settings)
    }

    /// Whether nothing has jumped since a frame.
    fn goes_on_from(&self, seen: &Seen) -> bool {
        let motion: &SceneMotion = &self.scene.gpu.motion;
        let (lo, hi) = self.scene.gpu.bounds_ws;
        let away = (self.view.eye_ws() - 0.5 * (lo + hi)).length().max(0.5 * (hi - lo).length());
        let (step, turn) = went(&seen.view, self.view);
        let jumps = |went: Vec3, last: Vec3, most: f32| went.length().min((went - last).length()) > most;
        let (far, wide) = (jumps(step, seen.step_m, JUMP_SHARE * away), jumps(turn, seen.turn_rad, JUMP_RAD));
        motion.goes_on_from(seen.generation)
            && !(far || wide)
            && seen.view.is_orthographic() == self.view.is_orthographic()
    }

    /// How much of indirect light's past counts: as far back as lamps were much the same.
    fn allowed(&self, before: Option<&Seen>, now: &Seen) -> Allowed {
        let (lo, hi) = self.scene.gpu.bounds_ws;
        let frames = before.map_or(0.0, |before| {
            let most = self.settings.indirect.history as f32;
            let change = light_change(&before.lights, &now.lights, (hi - lo).length());
            let rests = before.generation == now.generation;
            let most = if rests { most } else { most.min(FRAMES_IN_MOTION) };
            if change > 0.0 { most.min(CHANGE_THAT_LAGS / change) } else { most }
        });
        Allowed { frames, history_scale: now.scale_since(before) }
    }

    /// What a frame shows that goes on from one, or only comes after one.
    fn seen(&self, before: Option<&Seen>, last: Option<&Seen>) -> Seen {
        let view = *self.view;
        let moment = Moment {
            clip_from_ws: view.clip_from_ws(self.size_px, Vec2::ZERO),
            eye_ws: view.eye_ws(),
            forward_ws: view.forward_ws(),
            pixel_m: view.pixel_m2(self.size_px).sqrt(),
        };
        let (step_m, turn_rad) = last.map_or((Vec3::ZERO, Vec3::ZERO), |last| went(&last.view, &view));
        Seen {
            view,
            moment,
            generation: self.scene.gpu.motion.generation(),
            lights: self.scene.lights().to_vec(),
            radiance_scale: self.scene.radiance_scale,
            frames: before.map_or(1, |before| before.frames.saturating_add(1)),
            drift: before.map_or(0, |before| before.drift),
            step_m,
            turn_rad,
        }
    }
}

/// How far a camera went, metres, and turned, radians about an axis.
fn went(from: &View, to: &View) -> (Vec3, Vec3) {
    let of = |view: &View| Quat::from_mat4(&view.world_from_camera);
    let turn = of(to) * of(from).inverse();
    // The shorter way round.
    let turn = if turn.w < 0.0 { -turn } else { turn };
    (to.eye_ws() - from.eye_ws(), turn.to_scaled_axis())
}
