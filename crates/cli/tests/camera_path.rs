//! `chiaro bench --camera-path` as scripts see it.

mod moving;
mod program;

use std::process::{Command, Output};

use program::{assert_fails, cheap, folder, text};

fn bench(arguments: &[&str]) -> Output {
    let fast = ["--size", "16x12", "--set", "shadow.resolution=64"];
    let arguments = [&["bench"], &fast[..], arguments].concat();
    Command::new(env!("CARGO_BIN_EXE_chiaro")).args(cheap(&arguments)).output().unwrap()
}

#[test]
fn every_frame_of_the_path_is_measured_once() {
    let folder = folder("camera_path", "measured");
    let moving = moving::write(&folder);
    let [svg, json] = ["new/path.svg", "json/path.json"].map(|name| folder.join(name));
    let [svg_name, json_name] = [&svg, &json].map(|path| path.to_str().unwrap());
    let output = bench(&[&moving, "--camera-path", "--fps", "30", "-o", svg_name, "--json", json_name]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    for words in
        ["camera “ride”, 30 frames at 30 a second", "median", "99 %", "maximum", "frame, first to last"]
    {
        assert!(table.contains(words), "`{words}` is not in {table}");
    }
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    let frames = report["frames"].as_array().unwrap();
    assert_eq!((frames.len(), &report["timings"]["frames"]), (30, &30.into()));
    assert!((frames[15]["time_s"].as_f64().unwrap() - 0.5).abs() < 1e-9);
    let mut spans: Vec<_> = frames.iter().map(|frame| frame["gpu_ms"].as_f64().unwrap()).collect();
    spans.sort_by(f64::total_cmp);
    let whole = &report["timings"]["frame_span"];
    assert_eq!(whole["max_ms"].as_f64(), spans.last().copied());
    assert!((whole["median_ms"].as_f64().unwrap() - 0.5 * (spans[14] + spans[15])).abs() < 1e-9);
    let passes = report["timings"]["passes"].as_array().unwrap();
    assert!(passes.iter().any(|pass| pass["name"] == "direct/shade" && pass["p99_ms"].as_f64().is_some()));
    let svg = std::fs::read_to_string(svg).unwrap();
    for word in ["<svg", "moving.gltf", "direct/shade", "median", "</svg>"] {
        assert!(svg.contains(word), "{word} is not in {svg}");
    }
}

#[test]
fn a_camera_that_rests_has_no_path() {
    let moving = moving::write(&folder("camera_path", "rests"));
    for (scene, flags, words) in [
        (moving.as_str(), &["--camera", "rest"][..], &["camera “rest” rests", "“ride”"][..]),
        (&moving, &["--camera", "1"], &["camera “rest” rests", "“ride”"]),
        (&moving, &["--view", "0,0,5,0,0,0,40"], &["--view"]),
        (&moving, &["--fps", "1000000"], &["--fps"]),
        (&moving, &["--fps", "0"], &["--fps"]),
        (&moving, &["--fps", "1"], &["1 frames", "2 to 100000"]),
        (&moving, &["--frames", "10"], &["--frames"]),
        (&moving, &["--suite", "shadows"], &["--suite"]),
        (&moving, &["-o", "plot.png"], &["plot.png", ".svg"]),
        (&moving, &["-o", "plot"], &["plot", ".svg"]),
        ("builtin:cornell", &[], &["camera “front” rests", "all cameras"]),
    ] {
        assert_fails(&bench(&[&[scene, "--camera-path"], flags].concat()), 2, words);
    }
    assert_fails(&bench(&[&moving, "--fps", "30"]), 2, &["--camera-path"]);
    assert_fails(&bench(&[&moving, "--fps", "30", "--suite", "reference"]), 2, &["--fps"]);
    assert_fails(&bench(&[&moving, "-o", "plot.svg"]), 2, &["plot.svg", "--camera-path"]);
    assert_fails(&bench(&[&moving, "--camera-path", "--camera", "none"]), 1, &["none", "“ride”"]);
    assert_fails(&bench(&["missing.glb", "--camera-path"]), 1, &["missing.glb"]);
}
