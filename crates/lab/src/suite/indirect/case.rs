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

/// What all passes of indirect light are called.
const INDIRECT: &str = "indirect/";

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
    /// Median of all passes of indirect light.
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
            indirect_ms: median(&measured.timings, |name| name.starts_with(INDIRECT)),
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

fn step_of(pass: &str) -> &'static str {
    let is = |(_, begins): &&(&str, &[&str])| begins.iter().any(|begin| pass.starts_with(begin));
    STEPS.iter().find(is).map_or("", |(name, _)| name)
}

/// Steps that take any time.
fn steps(frames: &[FrameTimings]) -> Vec<Step> {
    let sum_of = |wanted: &dyn Fn(&str) -> bool| -> f64 {
        let passes = frames.iter().flat_map(|frame| &frame.passes);
        passes.filter(|pass| wanted(&pass.name)).fold(0.0, |sum, pass| sum + pass.ms)
    };
    let all = sum_of(&|_| true).max(f64::MIN_POSITIVE);
    let step = |name: &'static str| Step {
        name,
        ms: median(frames, |pass| step_of(pass) == name),
        share: sum_of(&|pass| step_of(pass) == name) / all,
    };
    STEPS.iter().map(|(name, _)| step(name)).filter(|step| step.share > 0.0).collect()
}

/// Median over frames of the sum of passes, milliseconds; 0 without frames.
fn median(frames: &[FrameTimings], wanted: impl Fn(&str) -> bool) -> f64 {
    // A sum of nothing would be −0.
    let sum = |frame: &FrameTimings| {
        let passes = frame.passes.iter().filter(|pass| wanted(&pass.name));
        passes.fold(0.0, |sum, pass| sum + pass.ms)
    };
    let mut sums: Vec<f64> = frames.iter().map(sum).collect();
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
        assert_eq!(median(&frames[..2], |name| name.starts_with(INDIRECT)), 4.5);
        assert_eq!(median(&[], |_| true), 0.0);
        assert!(median(&frames, |name| name == "shadow/depth").is_sign_positive());
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
