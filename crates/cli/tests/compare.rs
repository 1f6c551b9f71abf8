//! `chiaro compare` and `chiaro sweep` as scripts see them.

mod program;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

use program::{assert_fails, cheap, folder, text};

/// With a cache of its own in the folder.
fn chiaro(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chiaro"));
    command
        .env("CHIARO_CACHE", folder.join("cache"))
        .current_dir(folder)
        .args(cheap(arguments))
        .output()
        .unwrap()
}

#[track_caller]
fn run(folder: &Path, arguments: &[&str]) -> (String, String) {
    let output = chiaro(folder, arguments);
    let error = text(&output.stderr).to_owned();
    assert!(output.status.success(), "{error}");
    (text(&output.stdout).to_owned(), error)
}

/// Takes away what may differ from run to run: times, at any depth.
fn without_times(value: &mut Value) {
    match value {
        Value::Object(map) => {
            let is_time = |key: &str| key.ends_with("_ms") || key == "gpu";
            map.retain(|key, _| !is_time(key));
            map.values_mut().for_each(without_times);
        }
        Value::Array(all) => all.iter_mut().for_each(without_times),
        _ => {}
    }
}

fn results(folder: &Path, report: &str) -> Value {
    let text = fs::read_to_string(folder.join(report).join("results.json")).unwrap();
    let mut value = serde_json::from_str(&text).unwrap();
    without_times(&mut value);
    value
}

/// The lines of a sweep, without times.
fn rows(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let mut value = serde_json::from_str(line).unwrap();
        without_times(&mut value);
        value
    };
    text.lines().map(row).collect()
}

fn cached(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let files = fs::read_dir(folder.join("cache")).unwrap().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|found| found == extension)).collect()
}

#[test]
fn two_runs_give_the_same_figures_from_the_cache_and_from_one_that_was_broken() {
    let folder = folder("compare", "twice");
    let arguments = |report: &'static str| {
        let what =
            ["compare", "builtin:cornell", "--size", "48x36", "--part", "direct", "--target-error", "5%"];
        let how = ["--samples", "2", "--seeds", "2", "--timed-frames", "1", "--diffuse-bounces", "0"];
        let whom = ["--technique", "hard:shadow.filter=none", "--technique", "paths:1", "-o", report];
        [&what[..], &how, &whom].concat()
    };
    let (table, _) = run(&folder, &arguments("first"));
    assert!(table.contains("hard") && table.contains("paths:1"), "{table}");
    let first = results(&folder, "first");
    let row = &first["rows"][0];
    assert!(row["nmae"].as_f64().unwrap() < 0.05 && row["noise"] == 0.0, "{row}");
    assert_eq!(row["settings"]["shadow.filter"], "none");
    assert!(row["cost"]["bytes"]["shadow"].as_u64().unwrap() > 0, "{row}");
    assert!(first["rows"][1]["noise"].as_f64().unwrap() > 0.0, "{first}");
    for file in [
        "truth.exr",
        "truth.png",
        "hard.exr",
        "hard.png",
        "hard.error.png",
        "paths_1.error.png",
        "results.csv",
    ] {
        assert!(folder.join("first").join(file).exists(), "{file}");
    }
    let [truth] = &cached(&folder, "exr")[..] else { panic!("one truth is kept") };
    let (_, notes) = run(&folder, &arguments("second"));
    assert!(!notes.contains("is broken"), "{notes}");
    assert_eq!(results(&folder, "second"), first);
    fs::write(truth, "broken").unwrap();
    let (_, notes) = run(&folder, &arguments("third"));
    assert!(notes.contains("is broken, and is made anew"), "{notes}");
    assert_eq!(results(&folder, "third"), first);
}

#[test]
fn a_truth_may_be_a_file_less_another() {
    let folder = folder("compare", "file");
    let size = ["--size", "48x36"];
    run(
        &folder,
        &[&["reference", "builtin:cornell", "--spp", "4", "-o", "full.exr", "--aov", "direct"], &size[..]]
            .concat(),
    );
    let compare = |rest: &[&'static str]| {
        [
            &[
                "compare",
                "builtin:cornell",
                "--seeds",
                "1",
                "--timed-frames",
                "0",
                "--samples",
                "1",
                "--technique",
                "default:indirect.technique=ambient",
                "-o",
                "report",
            ],
            rest,
        ]
        .concat()
    };
    run(&folder, &compare(&["--size", "48x36", "--reference", "full.exr"]));
    let found = results(&folder, "report");
    assert!(found["floor"]["nmae"].as_f64().unwrap() > 0.0, "{found}");
    run(
        &folder,
        &compare(&[
            "--size",
            "48x36",
            "--reference",
            "full.exr",
            "--minus",
            "full.direct.exr",
            "--part",
            "indirect",
        ]),
    );
    let found = results(&folder, "report");
    assert!(found["rows"][0]["mean_ratio"].as_f64().unwrap() > 0.0 && found["floor"].is_null(), "{found}");
    // The other way round, more is subtracted than there is.
    let turned = ["--reference", "full.direct.exr", "--minus", "full.exr", "--part", "indirect"];
    let turned = compare(&[&["--size", "48x36"], &turned[..]].concat());
    assert_fails(&chiaro(&folder, &turned), 1, &["indirect", "darker than black"]);
    let none = ["--part", "caustics", "--target-error", "50%"];
    assert_fails(
        &chiaro(&folder, &compare(&[&["--size", "16x12"], &none[..]].concat())),
        1,
        &["caustics", "is black"],
    );
    let other = compare(&["--size", "64x36", "--reference", "full.exr"]);
    assert_fails(&chiaro(&folder, &other), 2, &["full.exr is 48x36", "--size 48x36"]);
}

#[test]
fn a_moving_picture_is_judged_frame_by_frame() {
    let folder = folder("compare", "frames");
    let what = ["compare", "builtin:dancer", "--size", "32x24", "--part", "direct", "--target-error", "20%"];
    let how = [
        "--frames",
        "0..2",
        "--fps",
        "24",
        "--seeds",
        "1",
        "--timed-frames",
        "0",
        "--technique",
        "default:indirect.technique=ambient",
        "-o",
        "report",
    ];
    let (table, _) = run(&folder, &[&what[..], &how].concat());
    assert!(table.contains("flicker"), "{table}");
    let found = results(&folder, "report");
    assert!(found["rows"][0]["flicker"].as_f64().unwrap() > 0.0, "{found}");
    assert_eq!(found["frames"], 2);
    for file in ["truth/frame.0001.exr", "default/frame.0000.png", "default/frame.0001.error.png"] {
        assert!(folder.join("report").join(file).exists(), "{file}");
    }
}

#[test]
fn shards_of_a_sweep_one_of_them_cut_off_make_the_rows_of_a_single_run() {
    let folder = folder("compare", "sweep");
    let sweep = |output: &'static str, shard: Option<&'static str>| {
        let what =
            ["sweep", "builtin:cornell", "--size", "32x24", "--part", "direct", "--target-error", "10%"];
        let how = ["--seeds", "1", "--samples", "1", "--timed-frames", "0", "--diffuse-bounces", "0"];
        // Moments take no pcf.
        let vary = [
            "--vary",
            "shadow.representation=depth,moments",
            "--vary",
            "shadow.filter=none,pcf",
            "-o",
            output,
        ];
        let shard = shard.map_or(Vec::new(), |shard| vec!["--shard", shard]);
        [&what[..], &how, &vary, &shard].concat()
    };
    let (told, _) = run(&folder, &sweep("all.jsonl", None));
    assert!(told.contains("4 rows written (1 of them refused), 0 stood there already"), "{told}");
    let all = rows(&folder.join("all.jsonl"));
    assert_eq!(all.len(), 4);
    assert!(
        all.iter().any(|row| row["refused"].as_str().is_some_and(|reason| reason.contains("pcf"))),
        "{all:?}"
    );
    run(&folder, &sweep("one.jsonl", Some("1/2")));
    run(&folder, &sweep("two.jsonl", Some("2/2")));
    // Killed while it wrote its last row.
    let path = folder.join("two.jsonl");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, &text[..text.len() - 20]).unwrap();
    let (told, _) = run(&folder, &sweep("two.jsonl", Some("2/2")));
    assert!(told.contains("1 rows written") && told.contains("1 stood there already"), "{told}");
    let by_id = |mut rows: Vec<Value>| {
        rows.sort_by_key(|row| row["id"].as_str().unwrap().to_owned());
        rows
    };
    let parts = [rows(&folder.join("one.jsonl")), rows(&path)].concat();
    assert_eq!(by_id(parts), by_id(all));
}

#[test]
fn what_cannot_be_compared_is_told_before_anything_is_traced() {
    let folder = folder("compare", "wrong");
    let scene = ["compare", "builtin:cornell", "--size", "16x12", "-o", "report"];
    let compare = |rest: &[&str]| chiaro(&folder, &[&scene[..], rest].concat());
    assert_fails(&compare(&["--technique", "slow"]), 2, &["slow", "default", "paths:"]);
    assert_fails(&compare(&["--technique", "a:shadow.filter=round"]), 2, &["shadow.filter", "pcf"]);
    assert_fails(&compare(&["--technique", "paths:0"]), 2, &["milliseconds"]);
    assert_fails(&compare(&["--part", "sunlight"]), 2, &["sunlight", "indirect"]);
    assert_fails(&compare(&["--minus", "a.exr"]), 2, &["--minus", "--reference"]);
    assert_fails(&compare(&["--reference", "no.exr", "--technique", "fast"]), 1, &["no.exr"]);
    let sweep =
        |rest: &[&str]| chiaro(&folder, &[&["sweep", "builtin:cornell", "-o", "rows.jsonl"], rest].concat());
    assert_fails(&sweep(&["--vary", "shadow.filtre=none"]), 2, &["shadow.filtre", "shadow.filter"]);
    assert_fails(&sweep(&["--vary", "size=big"]), 2, &["size=big", "640x360"]);
    assert_fails(&sweep(&["--vary", "samples=1", "--shard", "3/2"]), 2, &["2/8"]);
    fs::write(folder.join("rows.jsonl"), "dear diary\n").unwrap();
    assert_fails(&sweep(&["--vary", "samples=1", "--size", "16x12"]), 1, &["rows.jsonl", "line 1"]);
}
