//! `chiaro reference --shard` and `chiaro merge` as scripts see them. Tiny images, any adapter.

#[expect(dead_code, reason = "not all tests need all of it")]
mod program;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use chiaro_image::{CompareOptions, Comparison, Image, Layers, Precision, read, read_layers, write_exr};

use program::text;

fn command(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_chiaro")).args(arguments).output().unwrap()
}

/// An empty folder of a test's own.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("merge").join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// `chiaro reference` of a small picture.
fn trace_scene(scene: &str, output: &Path, arguments: &[&str]) -> Output {
    let size = if arguments.contains(&"--size") { &[][..] } else { &["--size", "16x12"] };
    command(&[&["reference", scene, "-o", output.to_str().unwrap()], size, arguments].concat())
}

fn trace(output: &Path, arguments: &[&str]) -> Output {
    trace_scene("builtin:cornell", output, arguments)
}

fn merge(parts: &[&Path], output: &Path) -> Output {
    let parts = parts.iter().map(|path| path.to_str().unwrap());
    let arguments: Vec<_> =
        ["merge"].into_iter().chain(parts).chain(["-o", output.to_str().unwrap()]).collect();
    command(&arguments)
}

/// What standard output says.
#[track_caller]
fn done(output: &Output) -> &str {
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stdout)
}

/// What standard error says.
#[track_caller]
fn failed(output: &Output, code: i32) -> &str {
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{error}");
    assert!(!error.contains("panicked") && !error.contains("defect"), "{error}");
    error
}

/// All channels, bit by bit.
fn bits(file: &Layers) -> Vec<(&str, Vec<u32>)> {
    let channel = |name| file.channel(name).unwrap().iter().map(|value| value.to_bits()).collect();
    file.names().map(|name| (name, channel(name))).collect()
}

fn nmae(a: &Path, b: &Path) -> f64 {
    let [a, b] = [a, b].map(|path| read(path).unwrap());
    Comparison::new(&a, &b, &CompareOptions::default()).unwrap().metrics().nmae
}

#[test]
fn shards_together_are_the_image_of_one_machine() {
    for (scene, integrator, spp) in [("builtin:ball", "full", "11"), ("builtin:cornell", "path", "8")] {
        let folder = folder(integrator);
        let file = |name: &str| folder.join(name);
        let flags = ["--integrator", integrator, "--spp", spp, "--aov", "indirect", "--aov", "albedo"];
        done(&trace_scene(scene, &file("one.exr"), &flags));
        let parts = [1, 2, 3].map(|number| file(&format!("{number}.exr")));
        for (number, part) in (1..).zip(&parts) {
            let told = trace_scene(scene, part, &[&flags[..], &["--shard", &format!("{number}/3")]].concat());
            assert!(done(&told).contains(&format!("shard {number} of 3")), "{}", text(&told.stdout));
        }
        let [a, b, c] = parts.each_ref().map(PathBuf::as_path);
        let (all, turned) = (file("all.exr"), file("turned.exr"));
        let told = merge(&[a, b, c], &all);
        assert!(done(&told).contains("holds all 3 shards"), "{}", text(&told.stdout));
        done(&merge(&[c, a, b], &turned));
        assert!(std::fs::read(&all).unwrap() == std::fs::read(&turned).unwrap());
        // In two steps.
        let (two, three) = (file("two.exr"), file("three.exr"));
        let told = merge(&[c, a], &two);
        assert!(done(&told).contains("holds shards 1, 3 of 3"), "{}", text(&told.stdout));
        done(&merge(&[b, &two], &three));
        let [all_file, three_file, one] =
            [&all, &three, &file("one.exr")].map(|path| read_layers(path).unwrap());
        assert_eq!(bits(&all_file), bits(&three_file));
        // Each sample once, and nothing else.
        assert_eq!(all_file.about["samples"], one.about["samples"]);
        assert_eq!(all_file.about["shards"], "1-3 of 3");
        // Parts of the light are summed in single floats.
        for (name, most) in [("", 1e-6), ("indirect.", 1e-5), ("albedo.", 1e-6)] {
            let [merged, single] = ["all", "one"].map(|stem| file(&format!("{stem}.{name}exr")));
            assert!(nmae(&merged, &single) <= most, "{integrator} {name}: {}", nmae(&merged, &single));
        }
        let noise = |file: &Layers| file.channel("variance.G").unwrap().iter().sum::<f32>();
        assert!((noise(&all_file) / noise(&one) - 1.0).abs() < 1e-4);
        assert!(nmae(a, &file("one.exr")) > 1e-3, "the first shard is the whole image");
        let single = file("single.exr");
        let told = merge(&[a], &single);
        assert!(done(&told).contains("holds shard 1 of 3"), "{}", text(&told.stdout));
        assert_eq!(read(a).unwrap(), read(&single).unwrap());
    }
}

#[test]
fn a_shard_goes_on_where_it_stopped_and_a_merged_file_does_not() {
    let folder = folder("resume");
    let (through, resumed, merged) = (folder.join("a.exr"), folder.join("b.exr"), folder.join("c.exr"));
    done(&trace(&through, &["--shard", "2/3", "--spp", "9"]));
    done(&trace(&resumed, &["--shard", "2/3", "--spp", "4"]));
    let other = trace(&resumed, &["--shard", "1/3", "--spp", "9", "--resume"]);
    assert!(failed(&other, 1).contains("shards (2 of 3, now 1 of 3)"), "{}", text(&other.stderr));
    let whole = trace(&resumed, &["--spp", "9", "--resume"]);
    assert!(failed(&whole, 1).contains("shards (2 of 3, now whole)"), "{}", text(&whole.stderr));
    done(&trace(&resumed, &["--shard", "2/3", "--spp", "9", "--resume"]));
    assert!(std::fs::read(&through).unwrap() == std::fs::read(&resumed).unwrap());
    // A part would be lost.
    let error = merge(&[&through, &resumed], &resumed);
    assert!(failed(&error, 2).contains("it is one of the parts"), "{}", text(&error.stderr));
    // What a pattern of file names finds beside parts is no part.
    std::fs::copy(&through, folder.join("a.direct.exr")).unwrap();
    let told = merge(&[&through, &folder.join("a.direct.exr")], &merged);
    assert!(text(&told.stderr).contains("a.direct.exr"), "{}", text(&told.stderr));
    done(&told);
    let error = trace(&merged, &["--shard", "2/3", "--spp", "12", "--resume"]);
    let error = failed(&error, 1);
    assert!(error.contains("c.exr was merged") && error.contains("merge them again"), "{error}");
}

#[test]
fn what_does_not_belong_together_is_refused_by_name() {
    let folder = folder("refused");
    let file = |name: &str| folder.join(name);
    let shard = |name: &str, more: &[&str]| {
        let path = file(name);
        done(&trace(&path, &[&["--spp", "3"], more].concat()));
        path
    };
    let first = shard("first.exr", &["--shard", "1/3"]);
    let out = file("out.exr");
    let refused = |parts: &[&Path], words: &[&str]| {
        let output = merge(parts, &out);
        let error = failed(&output, 1);
        for word in words {
            assert!(error.contains(word), "`{word}` is not in: {error}");
        }
        assert!(!out.exists());
    };
    let second = shard("second.exr", &["--shard", "2/3"]);
    refused(&[&first, &second, &first], &["shard 1 of 3 is in both", "first.exr"]);
    let seed = shard("seed.exr", &["--shard", "2/3", "--seed", "5"]);
    refused(&[&first, &second, &seed], &["seed.exr is of another reference", "differ: seed (0, here 5)"]);
    let many = shard("many.exr", &["--shard", "2/2"]);
    refused(&[&first, &many], &["many.exr", "number of shards (3, here 2)"]);
    let small = shard("small.exr", &["--shard", "2/3", "--size", "8x8", "--max-depth", "2"]);
    refused(&[&first, &small], &["small.exr", "size (16x12, here 8x8)", "max depth (0, here 2)"]);
    let whole = shard("whole.exr", &[]);
    refused(&[&first, &whole], &["whole.exr is a whole reference", "--shard"]);
    let plain = file("plain.exr");
    write_exr(&plain, &Image::filled(16, 12, [1.0; 3]), Precision::Float).unwrap();
    refused(&[&first, &plain], &["plain.exr is no part of a reference"]);
    refused(&[&first, &file("absent.exr")], &["absent.exr"]);
    let broken = file("broken.exr");
    let bytes = std::fs::read(&second).unwrap();
    std::fs::write(&broken, &bytes[..bytes.len() / 2]).unwrap();
    refused(&[&first, &broken], &["broken.exr", "damaged"]);
    std::fs::write(&broken, b"no picture at all").unwrap();
    refused(&[&first, &broken], &["broken.exr"]);
}

#[test]
fn shards_that_are_none_are_wrong_usage() {
    let folder = folder("usage");
    let out = folder.join("a.exr");
    for wrong in ["0/3", "4/3", "3", "1/0", "a/b", "-1/3"] {
        let output = trace(&out, &["--shard", wrong]);
        assert!(failed(&output, 2).contains("2/8"), "{}", text(&output.stderr));
    }
    let output = trace(&out, &["--shard", "7/8", "--spp", "4"]);
    let error = failed(&output, 2);
    assert!(error.contains("nothing is left for it of --spp 4") && error.contains("7 samples"), "{error}");
    assert!(!out.exists());
    assert_eq!(command(&["merge", "-o", out.to_str().unwrap()]).status.code(), Some(2));
}
