//! Indirect light by imperfect shadow maps: the tables and the figure of the thesis on it (Brno 2013), and how time grows.

mod case;
mod scaling;
mod thesis;
mod widths;

pub use case::{Cost, Step};

use std::path::Path;

use chiaro::Settings;

use crate::files::{bar, create_folder, write_text};
use crate::timings::Machine;
use crate::{Error, Session, plot};

/// What is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Extent {
    /// VPLs of the thesis' tables; the middle one is that of its shares and of its figure.
    pub thesis_vpls: Vec<u32>,
    /// Points a VPL there, usual and fewer.
    pub thesis_points: [u32; 2],
    /// VPLs of the first curve.
    pub vpls: Vec<u32>,
    /// Points a VPL of the second.
    pub points: Vec<u32>,
    /// Texels a side of a VPL's map: 32, 64, 128 or 256.
    pub tiles: Vec<u32>,
    /// Of the session's picture, across and down.
    pub sizes: Vec<f64>,
}

impl Default for Extent {
    fn default() -> Self {
        Self {
            thesis_vpls: vec![16, 64, 256],
            thesis_points: [8000, 4000],
            vpls: vec![64, 256, 512, 1024, 2048, 4096],
            points: vec![1000, 2000, 4000, 6000, 8000],
            tiles: vec![32, 64, 128, 256],
            sizes: vec![0.5, 1.0, 1.5, 2.0, 2.5],
        }
    }
}

/// The base that the suite measures over: only indirect light is compared.
///
/// # Errors
/// None that a caller could make.
pub fn base(mut settings: Settings) -> Result<Settings, Error> {
    settings.set("post.antialias", "none")?;
    Ok(settings)
}

/// Measures all of it over [`base`], so many frames each, along the animation where there is one. Writes `table.md`,
/// `scaling.svg` and the pictures of the figure to a folder. Returns what each row took, and the table.
///
/// # Errors
/// When the device fails, or a file cannot be written.
pub fn run(
    session: &mut Session,
    (base, extent): (&Settings, &Extent),
    (frames, folder): (u32, &Path),
) -> Result<(Vec<Cost>, String), Error> {
    create_folder(folder)?;
    let Extent { thesis_vpls, thesis_points, .. } = extent;
    let middle = thesis_vpls.get(thesis_vpls.len() / 2).copied().unwrap_or(1);
    let rows = thesis::cases(thesis_vpls, *thesis_points);
    let widths = widths::cases(middle, thesis_points[0]);
    let size = session.size;
    let axes = axes(extent, size);
    let count = rows.len() + widths.len() + axes.iter().map(|axis| axis.points.len()).sum::<usize>();
    let bar = bar(count as u64, "{bar:40} {pos}/{len} {msg}, {eta} left");
    let mut costs: Vec<Cost> = Vec::new();
    let mut text = head(session, frames);
    for case in &rows {
        bar.set_message(case.name.clone());
        costs.push(grouped("thesis", case.cost(session, base, frames)?));
        bar.inc(1);
    }
    text += &thesis::table(&costs, thesis_vpls, *thesis_points);
    let begin = costs.len();
    let mut truth = None;
    for case in &widths {
        bar.set_message(case.name.clone());
        let light = widths::picture(session, (case, base), folder)?;
        let mut cost = grouped("filters", case.cost(session, base, frames)?);
        match &truth {
            Some(truth) => cost.nmae = widths::error(&light, truth)?,
            None => truth = Some(light),
        }
        costs.push(cost);
        bar.inc(1);
    }
    text += &widths::table(&costs[begin..]);
    text += "\n## Scaling\n\nMedian milliseconds of the passes `indirect/*` and those that draw reflective maps, with one thing varied over the settings asked for. \
             Where nothing moves, reflective maps are kept. The same as curves: ![curves](scaling.svg)\n";
    let adapter = Machine::of(&session.gpu).adapter;
    let mut panels = Vec::new();
    for axis in &axes {
        let begin = costs.len();
        for (name, _, size, case) in &axis.points {
            bar.set_message(format!("{} {name}", axis.title));
            session.size = *size;
            costs.push(grouped(axis.title, case.cost(session, base, frames)?));
            bar.inc(1);
        }
        text += &scaling::table(axis, &costs[begin..]);
        panels.push(scaling::panel(axis, &costs[begin..], &adapter));
    }
    session.size = size;
    bar.finish_and_clear();
    write_text(&folder.join("table.md"), &text)?;
    if costs.iter().any(|cost| cost.timings.is_some()) {
        plot::write(&folder.join("scaling.svg"), &panels)?;
    }
    Ok((costs, text))
}

fn axes(extent: &Extent, size: [u32; 2]) -> [scaling::Axis; 4] {
    let of_key = |title, key, values: &[u32]| scaling::of_key(title, key, values, size);
    [
        of_key(("VPLs", "VPLs"), "indirect.vpls", &extent.vpls),
        of_key(("Points", "points a VPL"), "indirect.points_per_vpl", &extent.points),
        of_key(("Maps", "texels a side"), "indirect.ism_resolution", &extent.tiles),
        scaling::of_size(&extent.sizes, size),
    ]
}

fn grouped(group: &str, cost: Cost) -> Cost {
    Cost { group: group.to_owned(), ..cost }
}

fn head(session: &Session, frames: u32) -> String {
    let [width, height] = session.size;
    let how =
        if session.duration_s().is_some() { "spread over the animation" } else { "of a picture at rest" };
    format!(
        "# Indirect light on {}\n\n{}, {} triangles, {width}x{height}, {frames} frames each {how}.\n",
        Machine::of(&session.gpu).adapter,
        session.scene_name,
        session.scene.gpu.triangle_count
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneChoice;

    #[test]
    fn all_of_it_is_measured_and_filters_are_nearer_than_none() {
        let choice = SceneChoice {
            source: "builtin:cornell".to_owned().into(),
            scene_in_file: None,
            strict: true,
            environment: None,
            camera: None,
            view: None,
            size: [48, 36],
        };
        let mut settings = base(Settings::default()).unwrap();
        for (key, value) in [
            ("shadow.resolution", "64"),
            ("indirect.vpls", "16"),
            ("indirect.points", "1024"),
            ("indirect.points_per_vpl", "64"),
            ("indirect.ism_resolution", "32"),
        ] {
            settings.set(key, value).unwrap();
        }
        let mut session = Session::open(&choice, settings.clone(), &mut |_| ()).unwrap();
        let extent = Extent {
            thesis_vpls: vec![16],
            thesis_points: [64, 32],
            vpls: vec![8, 16],
            points: vec![64],
            tiles: vec![32],
            sizes: vec![0.5],
        };
        let folder = std::env::temp_dir().join(format!("chiaro-suite-indirect-{}", std::process::id()));
        let (costs, text) = run(&mut session, (&settings, &extent), (2, &folder)).unwrap();
        assert_eq!(costs.len(), 3 + 6 + 5);
        assert_eq!((session.size, costs[13].size), ([48, 36], [24, 18]));
        for name in ["table.md", "scaling.svg", "edges.png", "discontinuity_7.png"] {
            assert!(folder.join(name).is_file(), "{name} is missing");
        }
        std::fs::remove_dir_all(&folder).unwrap();
        let nmae: Vec<_> = costs.iter().filter_map(|cost| cost.nmae).collect();
        assert_eq!(nmae.len(), 5, "{text}");
        assert!(nmae[0] > 0.05, "interleaving alone changes nothing: {nmae:?}");
        assert!(nmae[1..].iter().all(|filtered| *filtered < 0.8 * nmae[0]), "{nmae:?}");
        for cost in &costs {
            assert!(cost.indirect_ms > 0.0 && cost.indirect_ms < cost.frame_ms * 1.5, "{cost:?}");
            assert!((cost.steps.iter().map(|step| step.share).sum::<f64>() - 1.0).abs() < 1e-9);
            let filters = cost.steps.iter().any(|step| step.name == "filter");
            let filtered = !["not interleaved", "no filter"].iter().any(|name| cost.name.contains(name));
            assert_eq!(filters, filtered, "{}", cost.name);
        }
        assert!(
            text.contains("| 16 |") && text.contains("table 6.3") && text.contains("![edges](edges.png)")
        );
    }
}
