//! Plots as SVG.

use std::path::Path;

use plotters::prelude::*;

use crate::Error;
use crate::files::write_text;

/// A curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What it is called.
    pub name: String,
    /// Where it goes; what is not finite is left out.
    pub points: Vec<(f64, f64)>,
}

/// Curves over one axis, of values from 0, or around another value.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// What the horizontal axis is.
    pub x: &'static str,
    /// Where the vertical axis begins; it fits the values where this is none.
    pub low: Option<f64>,
    /// All of them.
    pub curves: Vec<Curve>,
    /// Lines below the curves' names.
    pub notes: Vec<String>,
}

const WIDTH_PX: u32 = 1000;
const HEIGHT_PX: u32 = 300;
/// On the right, for the curves' names.
const NAMES_PX: u32 = 230;
/// Smaller values are drawn as 0.
const LEAST: f64 = 1e-6;
/// Curves of so few points show them.
const FEW: usize = 60;
/// Told apart by those who are colour-blind, too (Okabe & Ito 2008).
const COLOURS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Writes panels below each other; missing folders are made.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, panels: &[Panel]) -> Result<(), Error> {
    let text =
        svg(panels).map_err(|error| Error::Work(format!("cannot draw {}: {error}", path.display())))?;
    write_text(path, &text)
}

fn svg(panels: &[Panel]) -> Result<String, Box<dyn std::error::Error + '_>> {
    let mut text = String::new();
    let size = (WIDTH_PX, HEIGHT_PX * panels.len() as u32);
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        draw(area, panel)?;
    }
    root.present()?;
    drop(root);
    Ok(text)
}

fn draw<'a>(
    area: &DrawingArea<SVGBackend<'a>, plotters::coord::Shift>,
    panel: &Panel,
) -> Result<(), DrawingAreaErrorKind<<SVGBackend<'a> as DrawingBackend>::ErrorType>> {
    let finite = |curve: &Curve| {
        let points = curve.points.iter().copied();
        points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect::<Vec<_>>()
    };
    let curves: Vec<_> = panel.curves.iter().map(finite).collect();
    let all = || curves.iter().flatten();
    let xs = around(all().map(|point| point.0), None, 0.0);
    let ys = around(all().map(|point| point.1), panel.low, 0.05);
    let longest = curves.iter().map(Vec::len).max().unwrap_or(0);
    let line = |index: usize| 48 + 20 * index as i32;
    // Beside the curves, names hide none of them.
    let (left, right) = area.split_horizontally(WIDTH_PX - NAMES_PX);
    let mut chart = ChartBuilder::on(&left)
        .caption(&panel.title, ("sans-serif", 17))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(xs.0..xs.1, ys.0..ys.1)?;
    chart
        .configure_mesh()
        .x_desc(panel.x)
        .x_labels(longest.clamp(2, 12))
        .x_label_formatter(&|x| format!("{}", (x * 1e3).round() / 1e3))
        .bold_line_style(BLACK.mix(0.12))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (index, (points, Curve { name, .. })) in curves.into_iter().zip(&panel.curves).enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        if points.len() <= FEW {
            chart.draw_series(points.iter().map(|&point| Circle::new(point, 2, colour.filled())))?;
        }
        chart.draw_series(LineSeries::new(points, colour.stroke_width(1)))?;
        let y = line(index);
        right.draw(&PathElement::new(vec![(0, y), (16, y)], colour.stroke_width(3)))?;
        right.draw(&Text::new(name.as_str(), (22, y - 6), ("sans-serif", 13)))?;
    }
    for (index, note) in (panel.curves.len() + 1..).zip(&panel.notes) {
        right.draw(&Text::new(note.as_str(), (0, line(index) - 6), ("sans-serif", 13)))?;
    }
    Ok(())
}

/// The range of values, from `low` where that is given, with a share of itself around it; never empty.
fn around(values: impl Iterator<Item = f64>, low: Option<f64>, share: f64) -> (f64, f64) {
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    let (least, most) = if least > most { (0.0, 1.0) } else { (least, most) };
    let begin = low.map_or(least, |low| low.min(least));
    let extent = most - begin;
    if extent <= 1e-9 * most.abs().max(LEAST) {
        let some = if begin.abs() < LEAST { 1.0 } else { 0.01 * begin.abs() };
        return (if low.is_some() { begin } else { begin - some }, most + some);
    }
    (if low.is_some() { begin } else { begin - share * extent }, most + share * extent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_all_values_and_are_never_empty() {
        assert_eq!(around([1.0, 3.0].into_iter(), None, 0.5), (0.0, 4.0));
        assert_eq!(around([1.0, 3.0].into_iter(), Some(0.0), 0.0), (0.0, 3.0));
        for values in [&[][..], &[0.0], &[1.0], &[-2.0, -2.0], &[1e300], &[0.0, 1e-310]] {
            for low in [None, Some(0.0)] {
                let (begin, end) = around(values.iter().copied(), low, 0.05);
                assert!(begin < end, "{values:?}: {begin}..{end}");
                assert!(
                    values.iter().all(|value| (begin..=end).contains(value)),
                    "{values:?}: {begin}..{end}"
                );
            }
        }
    }

    #[test]
    fn a_plot_has_its_curves_names_and_leaves_out_what_is_not_finite() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 2.0)];
        let curve = |name: &str, points| Curve { name: name.into(), points };
        let curves = vec![curve("nmae", points), curve("none", Vec::new())];
        let text = svg(&[Panel {
            title: "errors < 1".into(),
            x: "frame",
            low: Some(0.0),
            curves,
            notes: vec!["note".into()],
        }])
        .unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{text}");
        for word in ["nmae", "frame", "note", "errors &lt; 1"] {
            assert!(text.contains(word), "{word}: {text}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    }
}
