//! What is measured, and what it takes.

use chiaro::{FrameTimings, Settings};
use serde::Serialize;

use crate::measure::{Measured, WARM_UP, measure};
use crate::timings::{Summary, summarise};
use crate::{Error, Session};

/// Steps of a frame, in their order, by what the names of their passes begin with. A pass is of the first that it fits.
const STEPS: [(&str, &[&str]); 10] = [
    ("reflective maps", &["indirect/rsm"]),
    ("placing VPLs", &["indirect/vpl_"]),
    ("imperfect maps", &["indirect/points", "indirect/ism_splat"]),
    ("pull-push", &["indirect/ism_pull", "indirect/ism_push"]),
    ("gather", &["indirect/gather"]),
    ("filter", &["indirect/discontinuities", "indirect/filter"]),
    ("camera", &["view/", "surface/", "motion/"]),
    ("shadows", &["shadow/"]),
    ("shading", &["direct/", "transparency/"]),
    ("the rest", &[""]),
];

/// Steps of indirect light: the first so many.
const INDIRECT: usize = 6;
/// What ends the drawing of a surface buffer.
const RESOLVE: &str = "surface/resolve";
/// What follows when it was a reflective map's.
const REFLECTIVE: &str = "indirect/rsm";

/// Settings with a name that says what they are; all of it is set, so that no base changes what a case is.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub name: String,
    pub changes: Vec<(&'static str, String)>,
}

impl Case {
    /// As the thesis had it: so many VPLs placed by Halton, maps of 128² with so many points, two levels of pull-push, 4×4
    /// interleaved or not. A Gaussian of five taps that stops at discontinuities follows where it is.
    pub fn thesis(name: String, vpls: u32, points: u32, interleaved: bool) -> Self {
        let changes = [
            ("indirect.technique", "ism".to_owned()),
            ("indirect.vpls", vpls.to_string()),
            ("indirect.sampling", "halton".to_owned()),
            ("indirect.rsm_resolution", "512".to_owned()),
            ("indirect.ism_resolution", "128".to_owned()),
            ("indirect.points_per_vpl", points.to_string()),
            ("indirect.pull_push.levels", "2".to_owned()),
            ("indirect.interleave", if interleaved { "4" } else { "1" }.to_owned()),
            ("indirect.filter", if interleaved { "discontinuity" } else { "none" }.to_owned()),
            ("indirect.filter_width", "5".to_owned()),
        ];
        Self { name, changes: changes.into() }
    }

    /// Another value.
    pub fn with(mut self, key: &'static str, value: &str) -> Self {
        self.changes.retain(|(known, _)| *known != key);
        self.changes.push((key, value.to_owned()));
        self
    }

    /// Over a base.
    pub fn settings(&self, base: &Settings) -> Result<Settings, Error> {
        let mut settings = base.clone();
        self.changes.iter().try_for_each(|(key, value)| settings.set(key, value))?;
        Ok(settings)
    }

    /// Readies the session for it.
    pub fn set(&self, session: &mut Session, base: &Settings) -> Result<(), Error> {
        session.renderer.set(self.settings(base)?)?;
        session.renderer.equip(&session.source, &mut session.scene)?;
        Ok(())
    }

    /// Times so many frames, which are spread over all of the animation where there is one.
    pub fn cost(&self, session: &mut Session, base: &Settings, frames: u32) -> Result<Cost, Error> {
        self.set(session, base)?;
        let step_s = session.duration_s().map_or(0.0, f64::from) / f64::from(frames.max(1));
        // The warm-up comes from the end: what is kept from frame to frame is as old in the first one as in all others.
        let frame = |index: u32| (i64::from(index) - i64::from(WARM_UP)).rem_euclid(i64::from(frames.max(1)));
        let measured = measure(session, frames, |index| frame(index) as f64 * step_s, || ())?;
        Ok(Cost::new(self, session.size, &measured))
    }
}

/// What a case takes.
#[derive(Clone, Debug, Serialize)]
pub struct Cost {
    /// Which table or curve it belongs to.
    pub group: String,
    /// The case.
    pub name: String,
    /// What it sets, `key=value`.
    pub settings: Vec<String>,
    /// Pixels.
    pub size: [u32; 2],
    /// Median, from the first pass to the last; on the clock where the adapter has no timestamps.
    pub frame_ms: f64,
    /// Median of all passes of indirect light, those that draw reflective maps among them.
    pub indirect_ms: f64,
    /// Steps that there are.
    pub steps: Vec<Step>,
    /// Of the indirect light, where it is held against a picture without interleaving and filter.
    pub nmae: Option<f64>,
    /// By pass, where the adapter has timestamps.
    pub timings: Option<Summary>,
}

/// What a step takes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Step {
    /// Which.
    pub name: &'static str,
    /// Median of its passes' sum.
    pub ms: f64,
    /// Of all passes in all frames, 0 to 1.
    pub share: f64,
}

impl Cost {
    fn new(case: &Case, size: [u32; 2], measured: &Measured) -> Self {
        let timings = summarise(&measured.timings);
        Self {
            group: String::new(),
            name: case.name.clone(),
            settings: case.changes.iter().map(|(key, value)| format!("{key}={value}")).collect(),
            size,
            frame_ms: timings.as_ref().map_or(measured.wall_ms_per_frame, |t| t.frame_span.median_ms),
            indirect_ms: median(&measured.timings, |step| step < INDIRECT),
            steps: steps(&measured.timings),
            nmae: None,
            timings,
        }
    }

    /// Frames a second.
    pub fn frames_per_s(&self) -> f64 {
        1e3 / self.frame_ms
    }

    /// Milliseconds of a step.
    pub fn step_ms(&self, name: &str) -> f64 {
        self.steps.iter().filter(|step| step.name == name).map(|step| step.ms).sum()
    }
}

/// The number of each pass' step. A reflective map is drawn by passes that are called as the camera's are: those before
/// [`REFLECTIVE`], back to where another surface buffer was complete.
fn steps_of(frame: &FrameTimings) -> Vec<usize> {
    let passes = &frame.passes;
    let fits =
        |pass: &str| STEPS.iter().position(|(_, begins)| begins.iter().any(|begin| pass.starts_with(begin)));
    let mut steps: Vec<_> = passes.iter().map(|pass| fits(&pass.name).unwrap_or(STEPS.len() - 1)).collect();
    for (end, _) in passes.iter().enumerate().filter(|(_, pass)| pass.name == REFLECTIVE) {
        for index in (0..end).rev() {
            let name = &passes[index].name;
            let draws = name.starts_with("surface/") || name.starts_with("view/");
            if !draws || (name == RESOLVE && index + 1 != end) {
                break;
            }
            steps[index] = steps[end];
        }
    }
    steps
}

/// Steps that take any time.
fn steps(frames: &[FrameTimings]) -> Vec<Step> {
    let sum_of = |wanted: &dyn Fn(usize) -> bool| frames.iter().map(|frame| sum(frame, wanted)).sum::<f64>();
    let all = sum_of(&|_| true).max(f64::MIN_POSITIVE);
    let step = |(number, (name, _)): (usize, &(&'static str, _))| Step {
        name,
        ms: median(frames, |step| step == number),
        share: sum_of(&|step| step == number) / all,
    };
    STEPS.iter().enumerate().map(step).filter(|step| step.share > 0.0).collect()
}

/// Of the passes of a frame's steps, milliseconds. A plain sum of nothing would be −0.
fn sum(frame: &FrameTimings, wanted: impl Fn(usize) -> bool) -> f64 {
    let timed = frame.passes.iter().zip(steps_of(frame));
    timed.filter(|(_, step)| wanted(*step)).fold(0.0, |sum, (pass, _)| sum + pass.ms)
}

/// Its median over frames; 0 without frames.
fn median(frames: &[FrameTimings], wanted: impl Fn(usize) -> bool) -> f64 {
    let mut sums: Vec<f64> = frames.iter().map(|frame| sum(frame, &wanted)).collect();
    sums.sort_by(f64::total_cmp);
    let middle = sums.len() / 2;
    match (sums.get(middle), sums.len() % 2) {
        (Some(&upper), 0) => 0.5 * (sums[middle - 1] + upper),
        (Some(&one), _) => one,
        (None, _) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chiaro::PassTiming;

    #[test]
    fn every_pass_is_of_one_step_and_shares_are_of_all_frames() {
        let pass = |name: &str, ms| PassTiming { name: name.into(), ms };
        let frame = |rsm: Option<f64>, gather: f64| FrameTimings {
            passes: rsm
                .map(|ms| pass("indirect/rsm", ms))
                .into_iter()
                .chain([pass("indirect/gather", gather), pass("post/tone_map", 1.0)])
                .collect(),
            span_ms: 9.0,
        };
        let frames = [frame(Some(6.0), 1.0), frame(None, 2.0), frame(None, 4.0)];
        let steps = steps(&frames);
        let names: Vec<_> = steps.iter().map(|step| step.name).collect();
        assert_eq!(names, ["reflective maps", "gather", "the rest"]);
        // A map that is drawn in one frame of three counts in the shares, not in the median.
        assert_eq!((steps[0].ms, steps[0].share), (0.0, 6.0 / 16.0));
        assert_eq!((steps[1].ms, steps[1].share), (2.0, 7.0 / 16.0));
        assert_eq!(median(&frames[..2], |step| step < INDIRECT), 4.5);
        assert_eq!(median(&[], |_| true), 0.0);
        assert!(median(&frames, |step| step == STEPS.len()).is_sign_positive());
    }

    #[test]
    fn what_draws_a_reflective_map_is_its_own_and_not_the_cameras() {
        let names = [
            "view/cull_count",
            "surface/visibility",
            RESOLVE,
            "surface/visibility",
            RESOLVE,
            REFLECTIVE,
            "view/cull_count",
            "surface/raster_tiles",
            RESOLVE,
            REFLECTIVE,
            "direct/shade",
        ];
        let passes = names.map(|name| PassTiming { name: name.into(), ms: 1.0 }).into();
        let steps = steps_of(&FrameTimings { passes, span_ms: 11.0 });
        let camera = STEPS.iter().position(|(name, _)| *name == "camera").unwrap();
        assert_eq!(steps[..3], [camera; 3]);
        assert_eq!(steps[3..10], [0; 7]);
        assert_ne!(steps[10], 0);
        assert!(camera >= INDIRECT && STEPS[INDIRECT - 1].0 == "filter");
    }

    #[test]
    fn a_case_is_what_its_name_says_whatever_the_base() {
        let case = Case::thesis("x".into(), 64, 8000, true).with("indirect.filter_width", "7");
        let mut base = Settings::default();
        base.apply_preset("high", None).unwrap();
        let indirect = case.settings(&base).unwrap().indirect;
        assert_eq!((indirect.vpls, indirect.points_per_vpl, indirect.interleave), (64, 8000, 4));
        assert_eq!(indirect.filter_width, 7);
        let mut thesis = Settings::default();
        thesis.apply_preset("thesis-indirect", None).unwrap();
        let as_the_preset = case.with("indirect.vpls", "1024").with("indirect.filter_width", "5");
        assert_eq!(as_the_preset.settings(&Settings::default()).unwrap().indirect, thesis.indirect);
    }
}
