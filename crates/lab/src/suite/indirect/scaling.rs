//! How indirect light's time grows with what settings ask for.

use std::fmt::Write as _;

use super::case::{Case, Cost};
use crate::plot::{Curve, Panel};

/// Steps that the curves show beside their sum.
const STEPS: [&str; 5] = ["placing VPLs", "imperfect maps", "pull-push", "gather", "filter"];

/// What is varied alone.
pub(super) struct Axis {
    pub title: &'static str,
    /// What the values are.
    pub unit: &'static str,
    /// What stands in tables, where a point is on the axis, pixels, and the case.
    pub points: Vec<(String, f64, [u32; 2], Case)>,
}

/// Imperfect shadow maps as the base has them, but for one key.
fn varied(key: &'static str, value: u32) -> Case {
    let changes = vec![("indirect.technique", "ism".to_owned())];
    Case { name: value.to_string(), changes }.with(key, &value.to_string())
}

/// An axis of a key.
pub(super) fn of_key(
    (title, unit): (&'static str, &'static str),
    key: &'static str,
    values: &[u32],
    size: [u32; 2],
) -> Axis {
    let point = |&value: &u32| (value.to_string(), f64::from(value), size, varied(key, value));
    Axis { title, unit, points: values.iter().map(point).collect() }
}

/// The axis of the picture's size: the session's, times these.
pub(super) fn of_size(factors: &[f64], [width, height]: [u32; 2]) -> Axis {
    let point = |&factor: &f64| {
        let side = |pixels: u32| ((f64::from(pixels) * factor).round() as u32).max(1);
        let size = [side(width), side(height)];
        let name = format!("{}x{}", size[0], size[1]);
        let millions = f64::from(size[0]) * f64::from(size[1]) * 1e-6;
        let case = Case { name: name.clone(), changes: vec![("indirect.technique", "ism".to_owned())] };
        (name, millions, size, case)
    };
    Axis { title: "Picture", unit: "million pixels", points: factors.iter().map(point).collect() }
}

/// What an axis took.
pub(super) fn table(axis: &Axis, costs: &[Cost]) -> String {
    let mut text = format!("\n### {}\n\n| {} | all |", axis.title, axis.unit);
    for step in STEPS {
        let _ = write!(text, " {step} |");
    }
    text += "\n| ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n";
    for ((name, ..), cost) in axis.points.iter().zip(costs) {
        let _ = write!(text, "| {name} | {:.3} |", cost.indirect_ms);
        for step in STEPS {
            let _ = write!(text, " {:.3} |", cost.step_ms(step));
        }
        text.push('\n');
    }
    text
}

/// The same as curves.
pub(super) fn panel(axis: &Axis, costs: &[Cost], adapter: &str) -> Panel {
    let curve = |name: &str, of: &dyn Fn(&Cost) -> f64| {
        let points = axis.points.iter().zip(costs).map(|((_, x, ..), cost)| (*x, of(cost))).collect();
        Curve { name: name.to_owned(), points }
    };
    let mut curves = vec![curve("indirect light", &|cost| cost.indirect_ms)];
    curves.extend(STEPS.map(|step| curve(step, &|cost| cost.step_ms(step))));
    let title = format!("{}: GPU time of indirect light, ms", axis.title);
    Panel { title, x: axis.unit, low: Some(0.0), curves, notes: vec![adapter.to_owned()] }
}
