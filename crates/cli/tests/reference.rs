//! `chiaro reference` as scripts see it: goals, resuming, interruptions, AOVs. Tiny images, any adapter.

mod moving;
#[expect(dead_code, reason = "not all tests need all of it")]
mod program;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};

use chiaro_image::{
    CompareOptions, Comparison, Image, Layers, Precision, read, read_layers, write_exr, write_layers,
};

use program::{cheap, text};

const SCENE: [&str; 3] = ["builtin:cornell", "--size", "64x48"];

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chiaro"));
    command.args(cheap(arguments));
    command
}

fn reference(output: &Path, arguments: &[&str]) -> Output {
    let output = ["-o", output.to_str().unwrap()];
    command(&[&["reference"], &SCENE[..], &output, arguments].concat()).output().unwrap()
}

/// What standard output says.
#[track_caller]
fn done(output: &Output) -> &str {
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// What standard error says.
#[track_caller]
fn failed(output: &Output) -> &str {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(!error.contains("panicked"), "{error}");
    error
}

/// A file's place in a folder that is this test's own, and empty of it.
fn scratch(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("reference").join(name);
    let _ = std::fs::remove_file(&path);
    path
}

/// All channels, bit by bit.
fn bits(file: &Layers) -> Vec<(&str, Vec<u32>)> {
    let channel = |name| file.channel(name).unwrap().iter().map(|value| value.to_bits()).collect();
    file.names().map(|name| (name, channel(name))).collect()
}

fn nmae(a: &Image, b: &Image) -> f64 {
    Comparison::new(a, b, &CompareOptions::default()).unwrap().metrics().nmae
}

#[test]
fn stopped_and_resumed_is_the_same_file_as_run_through() {
    let (through, resumed) = (scratch("through.exr"), scratch("resumed.exr"));
    let aovs = ["--aov", "normal", "--aov", "albedo", "--seed", "3"];
    done(&reference(&through, &[&aovs[..], &["--spp", "7"]].concat()));
    // Without a file there is nothing to go on from, and no reason to complain.
    done(&reference(&resumed, &[&aovs[..], &["--spp", "3", "--resume"]].concat()));
    let part = std::fs::read(&resumed).unwrap();
    let told = reference(&resumed, &[&aovs[..], &["--spp", "7", "--resume"]].concat());
    assert!(done(&told).contains(" 7 spp"), "{}", text(&told.stdout));
    assert_ne!(std::fs::read(&resumed).unwrap(), part);
    assert_eq!(std::fs::read(&resumed).unwrap(), std::fs::read(&through).unwrap());
    for aov in ["normal.exr", "albedo.exr"] {
        let files = [&through, &resumed].map(|path| std::fs::read(path.with_extension(aov)).unwrap());
        assert_eq!(files[0], files[1], "{aov}");
    }
    let told = reference(&resumed, &[&aovs[..], &["--spp", "5", "--resume"]].concat());
    assert!(done(&told).contains("7 spp, nothing to add"), "{}", text(&told.stdout));
    assert_eq!(std::fs::read(&resumed).unwrap(), std::fs::read(&through).unwrap());
}

#[test]
fn the_file_tells_what_it_is_of_and_how_sure_it_is() {
    let path = scratch("layers.exr");
    done(&reference(&path, &["--spp", "4", "--seed", "5", "--max-depth", "3"]));
    let file = read_layers(&path).unwrap();
    let about = |key: &str| file.about[key].as_str();
    assert_eq!((about("seed"), about("max depth"), about("samples")), ("5", "3", "4"));
    assert_eq!((about("scene"), about("integrator")), ("builtin:cornell", "path"));
    assert!(about("settings").contains("environment.intensity=1"), "{}", about("settings"));
    assert_eq!(file.channel("samples"), Some(&[4.0; 64 * 48][..]));
    let pixel = 24 * 64 + 32;
    let at = |channel: &str| file.channel(channel).unwrap()[pixel];
    assert!(at("R") > 0.0);
    assert_eq!(at("R"), at("sum.R") / 4.0);
    assert_eq!(read(&path).unwrap().pixel(32, 24), ["R", "G", "B"].map(at));
    let expected = (at("squares.G") / 4.0 - (at("sum.G") / 4.0).powi(2)) / 4.0;
    assert!((at("variance.G") - expected).abs() <= 1e-4 * expected, "{} is not {expected}", at("variance.G"));
}

#[test]
fn another_reference_is_not_gone_on_from() {
    let path = scratch("foreign.exr");
    done(&reference(&path, &["--spp", "1"]));
    let bytes = std::fs::read(&path).unwrap();
    let resumed = ["--spp", "2", "--resume"];
    let view = ["--view", "0,1,3,0,1,0,40", "--set", "environment.intensity=2"];
    let other = ["--seed", "1", "--max-depth", "2", "--aov", "depth"];
    let output = reference(&path, &[&view[..], &other, &resumed].concat());
    let error = failed(&output);
    let differ = "differ: aovs (, now depth), camera, max depth (0, now 2), seed (0, now 1), settings.";
    for word in ["foreign.exr", differ, "Without --resume"] {
        assert!(error.contains(word), "`{word}` is not in: {error}");
    }
    let name = path.to_str().unwrap();
    let other = ["reference", "builtin:ring", "--size", "32x48", "-o", name];
    let output = command(&[&other, &resumed[..]].concat()).output().unwrap();
    let error = failed(&output);
    assert!(error.contains("scene fingerprint") && error.contains("64x48, now 32x48"), "{error}");
    assert_eq!(std::fs::read(&path).unwrap(), bytes, "the file was touched");

    // The same pixels as a part of a larger picture.
    let at =
        bytes.windows(13).position(|w| w == b"displayWindow").unwrap() + b"displayWindow\0box2i\0".len() + 4;
    let mut part = bytes.clone();
    part[at + 8] = 100;
    std::fs::write(&path, part).unwrap();
    let output = reference(&path, &resumed);
    assert!(failed(&output).contains("display window"), "{}", text(&output.stderr));

    write_exr(&path, &Image::filled(64, 48, [1.0; 3]), Precision::Float).unwrap();
    let output = reference(&path, &resumed);
    assert!(failed(&output).contains("not written by `chiaro reference`"), "{}", text(&output.stderr));
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let output = reference(&path, &resumed);
    let error = failed(&output);
    assert!(error.contains("foreign.exr") && error.contains("damaged"), "{error}");
}

#[test]
fn a_time_limit_ends_the_render_with_what_there_is() {
    let path = scratch("time.exr");
    let output = reference(&path, &["--time-limit", "0.3"]);
    let told = done(&output);
    let samples: u32 = told.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(samples >= 1, "{told}");
    assert_eq!(read_layers(&path).unwrap().about["samples"], samples.to_string());
    // Samples may come first.
    let output = reference(&path, &["--time-limit", "1000", "--spp", "2"]);
    assert!(done(&output).contains(" 2 spp"), "{}", text(&output.stdout));
}

#[test]
fn a_target_error_ends_the_render_where_it_is_reached() {
    let path = scratch("error.exr");
    let noise = |told: &str| -> f64 {
        told.split_once("noise ").unwrap().1.trim_end_matches(" %\n").parse().unwrap()
    };
    let output = reference(&path, &["--spp", "24"]);
    let aim = noise(done(&output));
    let output = reference(&path, &["--target-error", &format!("{}%", 1.05 * aim)]);
    let told = done(&output);
    assert!(noise(told) <= 1.05 * aim, "{told}");
    let samples: u32 = told.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!((17..=32).contains(&samples), "{told}");
    // A finished one has nothing left to do.
    let output = reference(&path, &["--target-error", &format!("{}%", 1.05 * aim), "--resume"]);
    assert!(done(&output).contains("nothing to add"), "{}", text(&output.stdout));
}

/// Ctrl-C once the program listens and `wait` is over.
#[cfg(target_os = "linux")]
fn interrupt(child: &Child, wait: impl FnOnce()) {
    // Until it listens for the signal, which is bit 1 of those that it catches.
    let listens = || {
        let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap_or("0").trim();
        u64::from_str_radix(mask, 16).unwrap() & 2 != 0
    };
    wait_for(listens);
    wait();
    assert!(
        Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().unwrap().success()
    );
}

#[cfg(target_os = "linux")]
#[track_caller]
fn wait_for(holds: impl Fn() -> bool) {
    let start = std::time::Instant::now();
    while !holds() {
        assert!(start.elapsed().as_secs() < 120, "it never came to that");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_render_leaves_a_file_to_go_on_from() {
    let path = scratch("interrupted.exr");
    let aovs = ["--aov", "depth", "-o", path.to_str().unwrap(), "--spp", "1000000000"];
    let mut command = command(&[&["reference"], &SCENE[..], &aovs].concat());
    let child =
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn().unwrap();
    interrupt(&child, || std::thread::sleep(std::time::Duration::from_millis(300)));
    let output = child.wait_with_output().unwrap();
    let error = failed(&output);
    assert!(error.contains("interrupted") && error.contains("--resume"), "{error}");

    let samples: u32 = read_layers(&path).unwrap().about["samples"].parse().unwrap();
    assert!(samples > 0 && read(path.with_extension("depth.exr")).is_ok());
    let through = scratch("uninterrupted.exr");
    let more = (samples + 2).to_string();
    done(&reference(&path, &["--aov", "depth", "--spp", &more, "--resume"]));
    done(&reference(&through, &["--aov", "depth", "--spp", &more]));
    assert_eq!(bits(&read_layers(&path).unwrap()), bits(&read_layers(&through).unwrap()));
    let left = std::fs::read_dir(path.parent().unwrap()).unwrap();
    let parts =
        left.filter(|f| f.as_ref().unwrap().file_name().to_string_lossy().contains("interrupted.exr."));
    assert_eq!(parts.count(), 0);
}

#[test]
fn aovs_are_those_of_the_pictures() {
    let (truth, picture) = (scratch("aov_truth.exr"), scratch("aov_picture.exr"));
    let aovs = ["--aov", "albedo", "--aov", "normal", "--aov", "depth"];
    done(&reference(&truth, &[&aovs[..], &["--spp", "64", "--max-depth", "1"]].concat()));
    let output = ["-o", picture.to_str().unwrap(), "--samples", "16"];
    done(&command(&[&["render"], &SCENE[..], &output, &aovs].concat()).output().unwrap());
    // Edges at other places of a pixel; and bytes, as which pictures keep albedo.
    for (aov, most) in [("albedo", 0.01), ("depth", 0.005)] {
        let [a, b] = [&truth, &picture].map(|path| read(path.with_extension(format!("{aov}.exr"))).unwrap());
        let found = nmae(&a, &b);
        assert!(found <= most, "{aov}: {found}");
    }
    let [a, b] = [&truth, &picture].map(|path| read(path.with_extension("normal.exr")).unwrap());
    // Normals of both signs have no mean to relate to.
    let off = a.pixels().iter().flatten().zip(b.pixels().iter().flatten()).map(|(a, b)| (a - b).abs());
    let mean = off.sum::<f32>() / (3 * 64 * 48) as f32;
    assert!(mean <= 0.01, "normal: {mean}");
    assert!(a.pixels().iter().any(|normal| normal[1] > 0.99), "the floor does not look up");
}

#[test]
fn parts_of_the_light_are_resumed_and_are_the_picture_together() {
    for integrator in ["path", "photon", "full"] {
        let [through, resumed] =
            ["through", "resumed"].map(|name| scratch(&format!("{integrator}_{name}.exr")));
        let trace = |path: &Path, more: &[&str]| {
            let scene = ["reference", "builtin:ball", "--size", "24x18", "--integrator", integrator];
            let aovs = ["--aov", "direct", "--aov", "indirect", "--aov", "caustics"];
            let output = ["-o", path.to_str().unwrap()];
            let output = command(&[&scene, &aovs[..], &output, more].concat()).output().unwrap();
            done(&output);
        };
        trace(&through, &["--spp", "8"]);
        let file = read_layers(&through).unwrap();
        assert_eq!(file.about["integrator"], integrator);
        if integrator == "full" {
            trace(&resumed, &["--spp", "4"]);
            trace(&resumed, &["--spp", "8", "--resume"]);
            assert_eq!(bits(&file), bits(&read_layers(&resumed).unwrap()));
        }

        let whole = read(&through).unwrap();
        let parts = ["direct", "indirect", "caustics"]
            .map(|aov| read(through.with_extension(format!("{aov}.exr"))).unwrap());
        let lit = parts.each_ref().map(|part| part.pixels().iter().flatten().any(|value| *value > 0.0));
        assert_eq!(lit, [true; 3], "{integrator}");
        assert!(parts.iter().all(|part| part.pixels().iter().flatten().all(|value| *value >= 0.0)));
        let together = Image::from_fn(24, 18, |x, y| {
            let [a, b, c] = [0, 1, 2].map(|part| parts[part].pixel(x, y));
            [0, 1, 2].map(|i| a[i] + b[i] + c[i])
        });
        assert!(nmae(&together, &whole) < 1e-5, "{integrator}: {}", nmae(&together, &whole));
        if integrator == "path" {
            // Without further bounces there is nothing else, of the same paths.
            trace(&resumed, &["--spp", "8", "--diffuse-bounces", "0"]);
            let straight = Image::from_fn(24, 18, |x, y| {
                let [a, b] = [0, 2].map(|part| parts[part].pixel(x, y));
                [0, 1, 2].map(|i| a[i] + b[i])
            });
            let off = nmae(&straight, &read(&resumed).unwrap());
            assert!(off < 1e-5, "direct light and caustics: {off}");
        }
    }
}

#[test]
fn sums_of_another_layout_are_not_gone_on_from() {
    let path = scratch("older.exr");
    done(&reference(&path, &["--spp", "1"]));
    let mut file = read_layers(&path).unwrap();
    file.about.remove("layout");
    write_layers(&path, &file).unwrap();
    let output = reference(&path, &["--spp", "2", "--resume"]);
    assert!(failed(&output).contains("another version of chiaro"), "{}", text(&output.stderr));
}

#[test]
fn an_unknown_aov_is_refused_before_any_work() {
    let output = reference(&scratch("no.exr"), &["--aov", "shadow"]);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert!(
        error.contains("shadow") && error.contains("albedo, caustics, depth, direct, indirect, normal"),
        "{error}"
    );
}

/// An empty folder of a test's own.
fn folder(name: &str) -> PathBuf {
    let path = scratch("x").with_file_name(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// `chiaro reference` with the output `a.exr` in a folder.
fn trace(folder: &Path, arguments: &[&str]) -> Output {
    let output = folder.join("a.exr");
    command(&[&["reference", "-o", output.to_str().unwrap()], arguments].concat()).output().unwrap()
}

#[test]
fn numbered_images_are_those_of_their_moments_to_the_bit() {
    let folder = folder("moments");
    let moving = moving::write(&folder);
    // A camera and a lamp, bending, and a camera and a mesh that move: the rays of one tree that follows meet the same
    // triangles at the same places as those of a tree built for the moment.
    for (scene, flags) in [
        (["builtin:flight", "--size", "24x16"], &["--max-depth", "3"][..]),
        (["builtin:dancer", "--size", "24x16"], &["--camera", "hood", "--integrator", "full"]),
        ([&moving, "--size", "24x16"], &["--aov", "depth"]),
    ] {
        let with = |more: &[&str]| trace(&folder, &[&scene[..], flags, &["--spp", "2"], more].concat());
        let told = with(&["--frames", "2..5", "--fps", "1.7"]);
        assert_eq!(done(&told).lines().count(), 3);
        let file = |name: &str| std::fs::read(folder.join(name)).unwrap();
        let [first, last] = ["a.0002.exr", "a.0004.exr"].map(|name| read(folder.join(name)).unwrap());
        assert!(nmae(&first, &last) > 0.01, "{}: nothing moves", scene[0]);
        done(&with(&["--time", &(4.0 / 1.7).to_string()]));
        let off = nmae(&last, &read(folder.join("a.exr")).unwrap());
        assert!(file("a.0004.exr") == file("a.exr"), "{}: {off}", scene[0]);
        if flags.contains(&"depth") {
            assert!(file("a.0004.depth.exr") == file("a.depth.exr"), "{}: depth", scene[0]);
        }
    }
}

#[test]
fn a_sequence_goes_on_and_keeps_what_is_done() {
    let folder = folder("goes_on");
    let moving = moving::write(&folder);
    let scene = [&moving, "--size", "24x16", "--frames", "0..3", "--fps", "2", "--aov", "depth"];
    let with = |more: &[&str]| trace(&folder, &[&scene[..], more].concat());
    done(&with(&["--spp", "4"]));
    let files = || {
        let names = ["a.0000.exr", "a.0001.exr", "a.0002.exr", "a.0002.depth.exr"].map(|n| folder.join(n));
        names.map(|path| {
            (std::fs::read(&path).unwrap(), std::fs::metadata(&path).unwrap().modified().unwrap())
        })
    };
    let through = files();
    // The last one was begun, the one before has lost its AOV.
    let begun = trace(&folder, &[&moving, "--size", "24x16", "--time", "1", "--aov", "depth", "--spp", "1"]);
    done(&begun);
    std::fs::rename(folder.join("a.exr"), folder.join("a.0002.exr")).unwrap();
    std::fs::remove_file(folder.join("a.0002.depth.exr")).unwrap();
    let told = with(&["--spp", "4", "--resume"]);
    let lines: Vec<_> = done(&told).lines().map(|line| line.contains("nothing to add")).collect();
    assert_eq!(lines, [true, true, false], "{}", text(&told.stdout));
    let resumed = files();
    assert_eq!(resumed[0], through[0], "what was done was touched");
    for (resumed, through) in resumed.iter().zip(&through) {
        assert!(resumed.0 == through.0);
    }
    // More samples are more, of all.
    let told = with(&["--spp", "5", "--resume"]);
    assert!(done(&told).lines().all(|line| line.contains(" 5 spp, 0")), "{}", text(&told.stdout));
    // Of another moment.
    let other = ["--frames", "0..3", "--fps", "3", "--aov", "depth", "--spp", "6", "--resume"];
    let told = trace(&folder, &[&[&moving, "--size", "24x16"], &other[..]].concat());
    assert!(failed(&told).contains("a.0001.exr is of another reference"), "{}", text(&told.stderr));
}

#[test]
fn images_of_a_sequence_that_had_their_time_are_done() {
    let folder = folder("timed");
    let moving = moving::write(&folder);
    let scene = [&moving, "--size", "24x16", "--frames", "0..2", "--fps", "2", "--time-limit"];
    let with = |more: &[&str]| trace(&folder, &[&scene[..], more].concat());
    assert!(!done(&with(&["0.2"])).contains("nothing to add"));
    let told = with(&["0.2", "--resume"]);
    assert_eq!(done(&told).matches("nothing to add").count(), 2, "{}", text(&told.stdout));
    // More time is more samples; and no time was up where samples ended the render.
    assert!(!done(&with(&["0.3", "--resume"])).contains("nothing to add"));
    done(&with(&["100", "--spp", "1"]));
    assert!(!done(&with(&["100", "--spp", "2", "--resume"])).contains("nothing to add"));
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_sequence_says_how_to_go_on_and_does() {
    let folder = folder("interrupted_sequence");
    let moving = moving::write(&folder);
    let spp = "300";
    let output = folder.join("a.exr");
    let scene = ["--size", "64x48", "--frames", "0..400", "--fps", "300", "--spp", spp];
    let run = |more: &[&str]| {
        let mut command =
            command(&[&["reference", &moving, "-o", output.to_str().unwrap()], &scene[..], more].concat());
        command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    let third = folder.join("a.0002.exr");
    for flags in [&[][..], &["--resume"]] {
        let child = run(flags);
        interrupt(&child, || wait_for(|| third.exists()));
        let output = child.wait_with_output().unwrap();
        let error = failed(&output);
        assert!(error.contains("interrupted") && error.contains("with --resume goes on"), "{error}");
    }
    let samples = |number: u32| {
        let file = folder.join(format!("a.{number:04}.exr"));
        file.exists().then(|| read_layers(file).unwrap().about["samples"].clone())
    };
    assert_eq!((samples(0).as_deref(), samples(1).as_deref()), (Some(spp), Some(spp)));
    assert!(samples(399).is_none(), "nothing was left to go on with");
}

#[test]
fn a_still_scene_says_that_nothing_moves() {
    let folder = folder("still");
    let scene = ["builtin:cornell", "--size", "8x6", "--spp", "1"];
    let told = trace(&folder, &[&scene[..], &["--frames", "3..5"]].concat());
    done(&told);
    assert!(text(&told.stderr).contains("nothing in this scene moves"), "{}", text(&told.stderr));
    let [a, b] = [3, 4].map(|number| read(folder.join(format!("a.000{number}.exr"))).unwrap());
    assert_eq!(a, b);
}

#[test]
fn frames_that_are_none_are_wrong_usage() {
    let folder = folder("none");
    for flags in [
        &["--frames", "3"][..],
        &["--frames", "5..3"],
        &["--frames", "3..3"],
        &["--frames", "-1..3"],
        &["--frames", "0..99999999999"],
        &["--frames", "0..2", "--time", "1"],
        &["--frames", "0..2", "--fps", "0"],
        &["--frames", "0..2", "--fps", "-24"],
        &["--frames", "0..2", "--fps", "nan"],
        &["--frames", "0..2", "--fps", "1e-300"],
        &["--fps", "24"],
        &["--fps", "24", "--time", "1"],
    ] {
        let output = trace(&folder, &[&["builtin:cornell"], flags].concat());
        assert_eq!(output.status.code(), Some(2), "{flags:?}: {}", text(&output.stderr));
    }
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
}
