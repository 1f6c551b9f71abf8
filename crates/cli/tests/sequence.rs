//! `chiaro diff --sequence` as scripts see it: folders of numbered images.

mod program;

use std::process::{Command, Output};

use chiaro_image::{Image, Precision, write_exr};
use serde_json::Value;

use program::{assert_fails, cheap, folder, text};

fn chiaro(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_chiaro")).args(cheap(arguments)).output().unwrap()
}

/// A folder of flat images of these names and values.
fn frames(name: &str, images: &[(&str, f32)]) -> String {
    let folder = folder("sequence", name);
    for (file, value) in images {
        let image = Image::filled(12, 10, [*value; 3]);
        write_exr(folder.join(file), &image, Precision::Float).unwrap();
    }
    folder.to_str().unwrap().to_owned()
}

fn json(arguments: &[&str]) -> (Value, String) {
    let output = chiaro(&[&["diff", "--sequence", "--json"], arguments].concat());
    let error = text(&output.stderr);
    assert!(output.status.success(), "{error}");
    (serde_json::from_slice(&output.stdout).unwrap(), error.to_owned())
}

fn near(found: &Value, expected: f64) {
    assert!((found.as_f64().unwrap() - expected).abs() < 1e-6, "{found} is not {expected}");
}

#[test]
fn planted_flicker_is_measured_of_each_frame_and_of_all() {
    // Numbers need not begin at 0, nor have the same names; AOVs lie beside some.
    let a = frames(
        "planted_a",
        &[
            ("a.0008.exr", 2.1),
            ("a.0009.exr", 1.9),
            ("a.0010.exr", 2.1),
            ("a.0008.motion.exr", 5.0),
            ("a.0009.shadow.shadow_maps.0.exr", 5.0),
            ("a.0009.shadow.shadow_maps.1.exr", 5.0),
            ("cover.exr", 5.0),
        ],
    );
    let b = frames("planted_b", &[("8.exr", 2.0), ("9.exr", 2.0), ("10.exr", 2.0)]);
    let (found, notes) = json(&[&a, &b]);
    assert!(notes.is_empty(), "{notes}");
    let rows = found["frames"].as_array().unwrap();
    assert_eq!(rows.iter().map(|row| row["frame"].as_u64().unwrap()).collect::<Vec<_>>(), [8, 9, 10]);
    assert_eq!(rows[0]["flicker"], Value::Null);
    rows[1..].iter().for_each(|row| near(&row["flicker"], 0.1));
    let all = &found["all"];
    near(&all["flicker"], 0.1);
    near(&all["nmae"], 0.05);
    near(&all["mean_ratio"], 6.1 / 6.0);
    assert_eq!((&all["frames"], &all["changes"], &all["pixels"]), (&3.into(), &2.into(), &360.into()));

    // Each frame as it is by itself.
    let [one, other] = [format!("{a}/a.0009.exr"), format!("{b}/9.exr")];
    let output = chiaro(&["diff", &one, &other, "--json"]);
    let alone: Value = serde_json::from_slice(&output.stdout).unwrap();
    for metric in ["mean_ratio", "nmae", "relmse", "flip"] {
        assert_eq!(rows[1][metric], alone[metric], "{metric}");
    }
}

#[test]
fn frames_that_are_left_out_take_their_changes_with_them() {
    let names: Vec<_> = (0..5).map(|number| format!("a.{number:04}.exr")).collect();
    let list = |values: [f32; 5]| names.iter().map(String::as_str).zip(values).collect::<Vec<_>>();
    let a = frames("from_a", &list([9.0, 1.0, 1.2, 1.0, 1.2]));
    let b = frames("from_b", &list([1.0; 5]));
    let (found, _) = json(&[&a, &b, "--from", "1"]);
    near(&found["frames"][1]["flicker"], 8.0);
    near(&found["all"]["flicker"], 0.2);
    near(&found["all"]["nmae"], 0.1);
    assert_eq!((&found["all"]["frames"], &found["from"]), (&4.into(), &1.into()));
    let (found, notes) = json(&[&a, &b, "--from", "4"]);
    assert_eq!(found["all"]["flicker"], Value::Null);
    assert!(notes.contains("no flicker"), "{notes}");
    assert_fails(
        &chiaro(&["diff", "--sequence", &a, &b, "--from", "5"]),
        2,
        &["--from 5", "last frame is 4"],
    );
}

#[test]
fn a_table_and_a_plot_tell_the_same() {
    let a = frames("plot_a", &[("a.1.exr", 1.1), ("a.2.exr", 0.9)]);
    let b = frames("plot_b", &[("a.1.exr", 1.0), ("a.2.exr", 1.0)]);
    let plot = folder("sequence", "plot").join("new/plot.svg");
    let output = chiaro(&["diff", "--sequence", &a, &b, "--blur", "1", "-o", plot.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    let last = table.lines().last().unwrap();
    assert_eq!(last.split_whitespace().collect::<Vec<_>>()[..4], ["1", "on", "1.000000", "0.100000"]);
    assert!(last.ends_with("0.200000"), "{table}");
    let svg = std::fs::read_to_string(plot).unwrap();
    for word in ["<svg", "flicker: 0.2000", "nmae: 0.1000", "mean ratio: 1.0000", "</svg>"] {
        assert!(svg.contains(word), "{word} is not in {svg}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
}

#[test]
fn a_mask_is_one_for_all_frames_or_one_for_each() {
    let half = |value: f32| Image::from_fn(12, 10, move |x, _| [if x < 6 { value } else { 1.0 }; 3]);
    let (a, mask) = (folder("sequence", "mask_a"), folder("sequence", "mask"));
    for (number, value) in [(0, 3.0), (1, 5.0)] {
        let file = format!("a.000{number}.exr");
        write_exr(a.join(&file), &half(value), Precision::Float).unwrap();
        write_exr(mask.join(&file), &half(0.0), Precision::Float).unwrap();
    }
    let b = frames("mask_b", &[("a.0000.exr", 1.0), ("a.0001.exr", 1.0)]);
    // The mask is above 0 on the right: what is left is the left half, which is 3 and 5.
    let (a, each) = (a.to_str().unwrap(), mask.to_str().unwrap());
    let one = format!("{each}/a.0001.exr");
    for mask in [each, &one] {
        let (found, _) = json(&[a, &b, "--mask", mask]);
        near(&found["all"]["mean_ratio"], 4.0);
        near(&found["all"]["flicker"], 2.0);
    }
    std::fs::remove_file(&one).unwrap();
    let output = chiaro(&["diff", "--sequence", a, &b, "--mask", each]);
    assert_fails(&output, 1, &["frame 1", "mask holds no frame 1"]);
}

#[test]
fn what_does_not_match_is_named() {
    let a = frames("match_a", &[("a.0000.exr", 1.0), ("a.0001.exr", 1.0)]);
    let diff = |one: &str, other: &str| chiaro(&["diff", "--sequence", one, other]);
    let empty = folder("sequence", "match_empty");
    std::fs::write(empty.join("a.0001.png"), "").unwrap();
    std::fs::create_dir(empty.join("a.0002.exr")).unwrap();
    let empty = empty.to_str().unwrap();
    assert_fails(&diff(&a, empty), 1, &["match_empty", "no numbered EXR"]);
    assert_fails(&diff(&a, &format!("{empty}/none")), 1, &["match_empty/none", "cannot read the folder"]);
    assert_fails(&diff(&format!("{a}/a.0000.exr"), &a), 1, &["a.0000.exr is a file", "folders"]);
    assert_fails(&chiaro(&["diff", &a, &a]), 2, &["is a folder", "--sequence"]);

    let more: Vec<_> = (0..9).map(|number| format!("a.{number}.exr")).collect();
    let more = frames("match_more", &more.iter().map(|name| (name.as_str(), 1.0)).collect::<Vec<_>>());
    let words = ["frame 2, 3, 4, 5, 6 (and 2 more)", "match_more", "not in"];
    assert_fails(&diff(&a, &more), 1, &words);
    assert_fails(&diff(&more, &a), 1, &words);

    let twice = frames("match_twice", &[("a.0001.exr", 1.0), ("b.1.exr", 1.0)]);
    assert_fails(&diff(&twice, &a), 1, &["a.0001.exr", "b.1.exr", "frame 1"]);

    let black = frames("match_black", &[("a.0000.exr", 1.0), ("a.0001.exr", 0.0)]);
    assert_fails(&diff(&a, &black), 1, &["frame 1", "black"]);
    let broken = frames("match_broken", &[("a.0000.exr", 1.0)]);
    std::fs::write(format!("{broken}/a.0001.exr"), "no image").unwrap();
    assert_fails(&diff(&broken, &a), 1, &["frame 1", "a.0001.exr", "neither EXR"]);
}

#[test]
fn sizes_that_differ_between_folders_or_frames_are_told() {
    let a = frames("size_a", &[("a.0000.exr", 1.0), ("a.0001.exr", 1.0)]);
    let other = |name: &str| {
        let path = frames(name, &[("a.0000.exr", 1.0)]);
        let image = Image::filled(10, 12, [1.0; 3]);
        write_exr(format!("{path}/a.0001.exr"), &image, Precision::Float).unwrap();
        path
    };
    let (b, c) = (other("size_b"), other("size_c"));
    assert_fails(&chiaro(&["diff", "--sequence", &a, &b]), 1, &["frame 1", "12×10", "10×12"]);
    let output = chiaro(&["diff", "--sequence", &b, &c]);
    assert_fails(&output, 1, &["frame 1", "the frame before is 12×10", "10×12"]);
}

#[test]
fn gaps_and_frames_alone_are_noted() {
    let list = [("a.0000.exr", 1.0), ("a.0001.exr", 1.0), ("a.0005.exr", 1.0)];
    let (a, b) = (frames("gap_a", &list), frames("gap_b", &list));
    let (found, notes) = json(&[&a, &b]);
    assert!(notes.contains("left out after 1;"), "{notes}");
    assert_eq!((&found["all"]["flicker"], &found["all"]["changes"]), (&0.0.into(), &2.into()));
    let (a, b) = (frames("alone_a", &list[..1]), frames("alone_b", &list[..1]));
    let (found, notes) = json(&[&a, &b]);
    assert!(notes.contains("no flicker"), "{notes}");
    assert_eq!(found["all"]["flicker"], Value::Null);
}

#[test]
fn values_of_any_size_are_measured_and_drawn() {
    let list =
        |values: [f32; 3]| ["a.0.exr", "a.1.exr", "a.2.exr"].into_iter().zip(values).collect::<Vec<_>>();
    let plot = folder("sequence", "size_plot").join("plot.svg");
    for (name, a, b) in [
        ("nan", [f32::NAN, f32::INFINITY, 1.0], [1.0; 3]),
        ("huge", [f32::MAX, 0.0, f32::MAX], [f32::MAX, f32::MAX, 1.0]),
        ("tiny", [1e-45, 1e-45, 1e-38], [1e-45, 1e-38, 1e-45]),
        ("negative", [-1.0, -5.0, 2.0], [-1.0, 1.0, -2.0]),
        ("far", [f32::MAX; 3], [1e-38; 3]),
    ] {
        let (a, b) = (frames(&format!("any_{name}_a"), &list(a)), frames(&format!("any_{name}_b"), &list(b)));
        let output = chiaro(&["diff", "--sequence", &a, &b, "-o", plot.to_str().unwrap()]);
        assert!(output.status.success(), "{name}: {}", text(&output.stderr));
        let svg = std::fs::read_to_string(&plot).unwrap();
        assert!(svg.contains("</svg>") && !svg.contains("NaN") && !svg.contains(">inf"), "{name}: {svg}");
        let found = json(&[&a, &b]).0;
        assert_eq!(found["frames"].as_array().unwrap().len(), 3);
        if name == "nan" {
            assert_eq!(found["all"]["not_finite"], 2 * 3 * 120);
        }
    }
}

#[test]
fn flags_that_do_not_go_with_sequences_are_wrong_usage() {
    let wrong = |flags: &[&str], words: &[&str]| {
        assert_fails(&chiaro(&[&["diff", "a", "b"], flags].concat()), 2, words);
    };
    wrong(&["--from", "3"], &["--sequence"]);
    wrong(&["--from", "3", "--minus-a", "c"], &["--from"]);
    wrong(&["--sequence", "--minus-a", "c"], &["--minus-a"]);
    wrong(&["--sequence", "--minus-b", "c"], &["--minus-b"]);
    wrong(&["--sequence", "-o", "heat.png"], &["heat.png", ".svg"]);
    wrong(&["-o", "plot.svg"], &["plot.svg", ".png"]);
    wrong(&["--sequence", "-o", "plot.svg", "--heat", "flip"], &["--heat"]);
    wrong(&["--sequence", "--from", "-1"], &["-1"]);
    wrong(&["--sequence", "--from", "99999999999999999999"], &["--from"]);
    wrong(&["--sequence", "--from", "x"], &["--from"]);
    wrong(&["--sequence", "--sequence"], &["--sequence"]);
}

#[test]
fn a_black_reference_stops_only_where_it_counts() {
    let images = |name, first| frames(name, &[("0.exr", first), ("1.exr", 1.0), ("2.exr", 1.0)]);
    let (a, b) = (images("black_a", 1.0), images("black_b", 0.0));
    let (found, notes) = json(&[&a, &b, "--from", "1"]);
    assert!(notes.contains("frame 0 does not count") && notes.contains("black"), "{notes}");
    assert_eq!(found["frames"].as_array().unwrap().len(), 2);
    near(&found["all"]["flicker"], 0.0);
    assert_fails(&chiaro(&["diff", "--sequence", &a, &b]), 1, &["frame 0", "black"]);
}
