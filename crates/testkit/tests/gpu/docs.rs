//! What the book shows of a frame is what a frame does.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use chiaro::scene;
use chiaro::{PassLog, Recorder, View, ViewState};
use chiaro_testkit::{Studio, device_guaranteed, direct};
use glam::Vec2;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/architecture.md");
const MARKS: [&str; 2] = ["<!-- frame -->\n", "<!-- /frame -->"];

/// Passes in their order, with an arrow from what wrote a resource last to what reads it or writes on.
fn diagram(log: &[PassLog]) -> String {
    let mut names: Vec<&str> = Vec::new();
    let mut writers: BTreeMap<&str, usize> = BTreeMap::new();
    let mut arrows: BTreeMap<(usize, usize), Vec<&str>> = BTreeMap::new();
    for pass in log {
        // The same pass for every map, mip or layer is one step.
        if names.last() != Some(&pass.name) {
            names.push(pass.name);
        }
        let step = names.len() - 1;
        for read in pass.reads.iter().chain(&pass.writes) {
            if let Some(&writer) = writers.get(read)
                && writer != step
            {
                let labels = arrows.entry((writer, step)).or_default();
                if !labels.contains(read) {
                    labels.push(read);
                }
            }
        }
        writers.extend(pass.writes.iter().map(|&written| (written, step)));
    }
    let mut text = String::from("```mermaid\nflowchart TD\n");
    for (step, name) in names.iter().enumerate() {
        let _ = writeln!(text, "    p{step}[\"{name}\"]");
    }
    for ((from, to), labels) in &arrows {
        let _ = writeln!(text, "    p{from} -- \"{}\" --> p{to}", labels.join(", "));
    }
    text + "```\n"
}

#[test]
fn the_architectures_diagram_is_that_of_a_frame() {
    let gpu = device_guaranteed();
    let mut scene = scene::load("builtin:ball").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "64"), ("surface.layers", "1")]));
    let loaded = studio.load(&scene);
    let mut state = ViewState::new(studio.renderer());
    let prepared =
        studio.renderer().prepare(&mut state, &loaded, &view, [32, 32], (Vec2::ZERO, 1.0)).unwrap();
    let mut recorder = Recorder::new(&gpu, false);
    let mut frame = recorder.begin();
    prepared.record(&mut frame, true);
    frame.submit();
    let expected = diagram(recorder.log());
    let page = std::fs::read_to_string(PAGE).unwrap();
    let [from, to] = MARKS.map(|mark| page.find(mark).expect("the page has marks around its diagram"));
    let from = from + MARKS[0].len();
    if std::env::var_os("CHIARO_BLESS").is_some_and(|value| value == "1") {
        std::fs::write(PAGE, [&page[..from], &expected, &page[to..]].concat()).unwrap();
        return;
    }
    assert_eq!(&page[from..to], expected, "CHIARO_BLESS=1 writes the diagram into docs/architecture.md");
}

/// All Rust text of a folder.
fn sources(folder: &Path) -> String {
    let mut text = String::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            text += &sources(&path);
        } else if path.extension().is_some_and(|end| end == "rs") {
            text += &std::fs::read_to_string(path).unwrap();
        }
    }
    text
}

#[test]
fn passes_whose_times_are_listed_are_called_so() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let code = sources(&Path::new(root).join("crates/techniques/src"));
    let page = std::fs::read_to_string(format!("{root}/docs/performance.md")).unwrap();
    let is_name = |word: &&str| {
        word.split('/').count() == 2
            && word.split('/').all(|part| {
                // `million/s` is a unit.
                part.len() > 1 && part.chars().all(|c| c.is_ascii_lowercase() || c == '_')
            })
    };
    let rows = page.lines().filter_map(|line| line.strip_prefix('|'));
    let first = rows.filter_map(|row| row.split('|').next());
    let names: Vec<_> = first.flat_map(|cell| cell.split([' ', ',', '`'])).filter(is_name).collect();
    assert!(names.len() > 10, "{names:?}");
    let unknown: Vec<_> = names.iter().filter(|name| !code.contains(&format!("\"{name}\""))).collect();
    assert!(unknown.is_empty(), "docs/performance.md times passes that there are none of: {unknown:?}");
}
