//! The thesis' figure 6.1: filters of interleaved light side by side, each with its error against the same VPLs without
//! interleaving.

use std::fmt::Write as _;
use std::path::Path;

use chiaro::{Aov, Recorder, Settings, StillOptions};
use chiaro_image::{CompareOptions, Comparison, Image};

use super::case::{Case, Cost};
use crate::pictures::{mean, screen};
use crate::technique::file_name;
use crate::{Error, Session};

/// When the pictures are taken, of the animation.
const WHEN: f64 = 0.25;

/// What the others are held against, then without a filter, then the filters.
pub(super) fn cases(vpls: u32, points: u32) -> Vec<Case> {
    let interleaved = |name: &str| Case::thesis(name.into(), vpls, points, true);
    let mut cases = vec![
        Case::thesis("not interleaved".into(), vpls, points, false),
        interleaved("no filter").with("indirect.filter", "none"),
    ];
    for width in ["3", "5", "7"] {
        cases.push(interleaved(&format!("discontinuity {width}")).with("indirect.filter_width", width));
    }
    cases.push(interleaved("edges").with("indirect.filter", "edges"));
    cases
}

/// The indirect light of a case, nits; its picture is written to a folder.
pub(super) fn picture(
    session: &mut Session,
    (case, base): (&Case, &Settings),
    folder: &Path,
) -> Result<Image, Error> {
    case.set(session, base)?;
    let time_s = session.duration_s().map_or(0.0, |duration_s| WHEN * f64::from(duration_s));
    session.go_to(time_s)?;
    let Session { gpu, renderer, scene, view, size, .. } = &mut *session;
    let aovs = vec![Aov::Indirect];
    let options = StillOptions { size: *size, samples: 1, aovs, ..StillOptions::default() };
    renderer.cut();
    let mut still = renderer.still_in(&mut Recorder::new(gpu, false), scene, view, &options, |_| {})?;
    let path = folder.join(file_name(&case.name.replace(' ', "_")) + ".png");
    chiaro_image::write_png(&path, &screen(&still.picture.wait(gpu)?)?)?;
    let (_, light) =
        still.aovs.pop().ok_or_else(|| Error::Work("a still without its indirect light".to_owned()))?;
    mean(&light.wait(gpu)?, options.samples)
}

/// How far a case's light is from that which is not interleaved; none where that is black.
pub(super) fn error(light: &Image, truth: &Image) -> Result<Option<f64>, Error> {
    let comparison = Comparison::new(light, truth, &CompareOptions::default())?;
    Ok(Some(comparison.metrics().nmae).filter(|nmae| nmae.is_finite()))
}

/// What [`cases`] took.
pub(super) fn table(costs: &[Cost]) -> String {
    let mut text = "\n## The thesis' figure 6.1\n\nFilters of interleaved light: what they take, and the error (nmae) of the \
                    indirect light against that of the same VPLs without interleaving.\n\n\
                    | filter | picture | gather, ms | filter, ms | nmae |\n| --- | --- | ---: | ---: | ---: |\n"
        .to_owned();
    for cost in costs {
        let nmae = cost.nmae.map_or("–".to_owned(), |nmae| format!("{nmae:.4}"));
        let picture = file_name(&cost.name.replace(' ', "_")) + ".png";
        let (gather, filter) = (cost.step_ms("gather"), cost.step_ms("filter"));
        // Writing to a string does not fail.
        let _ = writeln!(text, "| {0} | ![{0}]({picture}) | {gather:.3} | {filter:.3} | {nmae} |", cost.name);
    }
    text
}
