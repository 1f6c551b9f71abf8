//! The program as scripts see it: exit status, output and errors.

#[expect(dead_code, reason = "not all tests need all of it")]
mod program;

use std::path::PathBuf;
use std::process::{Command, Output};

use chiaro_image::{Image, Precision, read, write_exr};

use program::{assert_fails, cheap, text};

fn chiaro(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_chiaro")).args(cheap(arguments)).output().unwrap()
}

fn image(name: &str, width: u32, height: u32, value: f32) -> String {
    let path = scratch(name);
    write_exr(&path, &Image::filled(width, height, [value; 3]), Precision::Float).unwrap();
    path.to_str().unwrap().to_owned()
}

fn scratch(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("cli").join(name)
}

#[test]
fn every_help_page_has_an_example() {
    for page in [
        &[][..],
        &["render"],
        &["reference"],
        &["merge"],
        &["bench"],
        &["compare"],
        &["sweep"],
        &["diff"],
        &["scenes"],
        &["settings"],
        &["info"],
    ] {
        let output = chiaro(&[page, &["--help"]].concat());
        assert!(output.status.success());
        assert!(text(&output.stdout).contains("\n  chiaro "), "no example in {page:?}");
    }
}

#[test]
fn diff_prints_the_metrics_as_json() {
    let (a, b) = (image("json_a.exr", 8, 6, 1.5), image("json_b.exr", 8, 6, 1.0));
    let output = chiaro(&["diff", &a, &b, "--json"]);
    assert!(output.status.success());
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(metrics["mean_ratio"], 1.5);
    assert_eq!(metrics["nmae"], 0.5);
    assert_eq!(metrics["pixels"], 48);
    assert_eq!(metrics["not_finite"], 0);
    assert!((metrics["relmse"].as_f64().unwrap() - 0.25 / 1.0025).abs() < 1e-9);
    assert!(metrics["flip"].as_f64().unwrap() > 0.0);
    assert!(metrics["hdr_flip"].as_f64().unwrap() > 0.0);
    // 0.9 and, clamped, 1, as sRGB has them.
    let off = 1.0 - (1.055 * 0.9_f64.powf(1.0 / 2.4) - 0.055);
    assert!((metrics["psnr"].as_f64().unwrap() + 20.0 * off.log10()).abs() < 1e-9);
    let (white, grey) = (1.0, 1.0 - off);
    let ssim = (2.0 * white * grey + 1e-4) / (white * white + grey * grey + 1e-4);
    assert!((metrics["ssim"].as_f64().unwrap() - ssim).abs() < 1e-9);
    assert_eq!(metrics.as_object().unwrap().len(), 9);
    let output = chiaro(&["diff", &b, &b, "--json"]);
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&metrics["psnr"], &metrics["ssim"]), (&serde_json::Value::Null, &1.0.into()));
    assert_eq!((&metrics["flip"], &metrics["hdr_flip"]), (&0.0.into(), &0.0.into()));
}

#[test]
fn diff_draws_the_error_and_prints_a_table() {
    let (a, b) = (image("heat_a.exr", 200, 6, 11.0), image("heat_b.exr", 200, 6, 1.0));
    let heat = scratch("new folder/heat.png");
    let output = chiaro(&["diff", &a, &b, "-o", heat.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("mean ratio  11.000000"), "{}", text(&output.stdout));
    // 1000 % off is the bright end of the scale.
    assert_eq!(read(heat).unwrap().pixel(3, 3), [1.0; 3]);
}

#[test]
fn diff_draws_flip_on_its_own_scale() {
    let (a, b) = (image("flip_a.exr", 200, 6, 0.0), image("flip_b.exr", 200, 6, 1.0));
    let pictures = ["error", "flip", "hdr-flip"].map(|heat| {
        let path = scratch(&format!("heat_{heat}.png"));
        let output = chiaro(&["diff", &a, &b, "--heat", heat, "-o", path.to_str().unwrap()]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        read(path).unwrap().pixel(3, 3)
    });
    // 100 % is two thirds up the scale of errors; black for white is near the end of FLIP's.
    assert!(pictures[0] != pictures[1] && pictures[1][2] > pictures[0][2], "{pictures:?}");
    assert!(pictures[2][2] > pictures[0][2], "{pictures:?}");
    assert_fails(&chiaro(&["diff", &a, &b, "--heat", "flip"]), 2, &["--output"]);
}

#[test]
fn diff_subtracts_and_masks() {
    let (a, b) = (image("sub_a.exr", 8, 6, 3.0), image("sub_b.exr", 8, 6, 2.0));
    let (less_a, less_b) = (image("sub_less_a.exr", 8, 6, 2.5), image("sub_less_b.exr", 8, 6, 1.5));
    let open = image("sub_mask.exr", 8, 6, 0.0);
    let flags = ["--minus-a", &less_a, "--minus-b", &less_b, "--mask", &open, "--blur", "1", "--json"];
    let output = chiaro(&[&["diff", &a, &b], &flags[..]].concat());
    let metrics: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((metrics["mean_ratio"].as_f64().unwrap() - 1.0).abs() < 1e-12);
}

#[test]
fn work_that_fails_exits_with_1_and_says_what_where_and_what_to_do() {
    let (a, b) = (image("size_a.exr", 8, 6, 1.0), image("size_b.exr", 6, 8, 1.0));
    assert_fails(&chiaro(&["diff", &a, &b]), 1, &["8×6", "6×8", "same size"]);
    assert_fails(&chiaro(&["diff", &a, "missing.exr"]), 1, &["cannot read missing.exr"]);
    let render = chiaro(&["render", "builtin:cornell", "--environment", "missing.hdr"]);
    assert_fails(&render, 1, &["cannot read missing.hdr"]);
    let render = chiaro(&["render", "builtin:cornell", "--environment", &b]);
    assert_fails(&render, 1, &["size_b.exr", "6×8", "twice as wide"]);
    let text_file = scratch("text.exr");
    std::fs::write(&text_file, "not an image").unwrap();
    assert_fails(&chiaro(&["diff", &a, text_file.to_str().unwrap()]), 1, &["text.exr", "EXR", "convert it"]);
}

/// Traces a scene file of this text.
fn trace(name: &str, text: &str, flags: &[&str]) -> Output {
    let (scene, picture) = (scratch(name), scratch(&format!("{name}.exr")));
    std::fs::create_dir_all(scene.parent().unwrap()).unwrap();
    std::fs::write(&scene, text).unwrap();
    let _ = std::fs::remove_file(&picture);
    let (scene, picture) = (scene.to_str().unwrap(), picture.to_str().unwrap());
    let output =
        chiaro(&[&["reference", scene, "-o", picture, "--size", "8x6", "--spp", "1"], flags].concat());
    assert_eq!(std::fs::exists(picture).unwrap(), output.status.success());
    output
}

#[test]
fn what_is_missing_is_a_warning_and_a_picture_unless_strict() {
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nf 1 2 3\n";
    let output = trace("lone.obj", &format!("mtllib gone.mtl\n{square}"), &[]);
    assert!(output.status.success() && text(&output.stderr).contains("gone.mtl"), "{}", text(&output.stderr));
    let output = trace("lone.obj", &format!("mtllib gone.mtl\n{square}"), &["--strict"]);
    assert_fails(&output, 1, &["lone.obj", "gone.mtl"]);
}

#[test]
fn what_draws_nothing_says_so_and_is_a_picture() {
    let gltf = r#"{"asset": {"version": "2.0"}, "scenes": [{"name": "empty"}]}"#;
    for (name, content) in [("empty.gltf", gltf), ("points.obj", "v 0 0 0\nv 1 1 1\np 1 2\n")] {
        let output = trace(name, content, &[]);
        let error = text(&output.stderr);
        assert!(output.status.success() && error.contains("draws nothing"), "{error}");
    }
}

#[test]
fn a_quantity_that_settings_leave_black_says_why() {
    let picture = scratch("black.png");
    let flags = ["--size", "8x6", "--samples", "1", "--aov", "shadow_texels", "--aov", "depth", "-o"];
    let render = |layout: &str| {
        let set = format!("shadow.layout={layout}");
        let output = chiaro(
            &[&["render", "builtin:cornell", "--set", &set], &flags[..], &[picture.to_str().unwrap()]]
                .concat(),
        );
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stderr).matches("is black here").count()
    };
    assert_eq!([render("traced"), render("none"), render("cascaded")], [1, 1, 0]);
}

#[test]
fn wrong_usage_exits_with_2_and_says_what_is_right() {
    assert_fails(&chiaro(&[]), 2, &["Usage"]);
    assert_fails(&chiaro(&["paint"]), 2, &["paint"]);
    assert_fails(&chiaro(&["diff", "a.exr"]), 2, &["<B>"]);
    assert_fails(&chiaro(&["diff", "a.exr", "b.exr", "-o", "heat.jpg"]), 2, &[".png"]);
    assert_fails(&chiaro(&["diff", "a.exr", "b.exr", "--blur", "-2"]), 2, &["blur"]);
    assert_fails(&chiaro(&["render", "--size", "big"]), 2, &["1280x720"]);
    assert_fails(&chiaro(&["render", "--view", "-1,2,3"]), 2, &["7 are needed"]);
    assert_fails(&chiaro(&["render", "--frames", "9..3"]), 2, &["no frame"]);
    assert_fails(&chiaro(&["render", "--set", "shadow.filter"]), 2, &["KEY=VALUE"]);
    assert_fails(&chiaro(&["render", "--frames", "0..2", "--time", "1"]), 2, &["--time"]);
    assert_fails(&chiaro(&["reference", "builtin:cornell"]), 2, &["--output"]);
    assert_fails(&chiaro(&["reference", "-o", "truth.png"]), 2, &[".exr"]);
    assert_fails(&chiaro(&["reference", "-o", "truth.exr", "--spp", "0"]), 2, &["--spp"]);
    assert_fails(&chiaro(&["reference", "-o", "truth.exr", "--integrator", "light"]), 2, &["--integrator"]);
}

#[test]
fn a_setting_or_part_that_there_is_not_is_wrong_usage_for_every_command() {
    let commands: [&[&str]; 5] = [
        &["render", "builtin:cornell"],
        &["view", "builtin:cornell"],
        &["reference", "builtin:cornell", "-o", "no.exr"],
        &["bench", "builtin:cornell"],
        &["bench", "builtin:cornell", "--suite", "shadows"],
    ];
    for command in commands {
        let with = |more: &[&str]| chiaro(&[command, more].concat());
        assert_fails(
            &with(&["--set", "shadow.resolutoin=1"]),
            2,
            &["shadow.resolutoin", "shadow.resolution"],
        );
        assert_fails(&with(&["--set", "shadow.resolution=many"]), 2, &["many", "16..8192"]);
        assert_fails(&with(&["--set", "shadow.splits=20,5"]), 2, &["20,5", "larger than the one before"]);
        if command[0] != "reference" {
            assert_fails(&with(&["--preset", "thesis"]), 2, &["thesis", "thesis-shadows"]);
        }
        if ["render", "reference"].contains(&command[0]) {
            assert_fails(&with(&["--aov", "dreams"]), 2, &["dreams", "direct, "]);
        }
    }
    let preset = scratch("wrong.ron");
    std::fs::create_dir_all(preset.parent().unwrap()).unwrap();
    std::fs::write(&preset, r#"{ "shadow.resolution": 1 }"#).unwrap();
    let render = chiaro(&["render", "builtin:cornell", "--preset", preset.to_str().unwrap()]);
    assert_fails(&render, 2, &["wrong.ron", "shadow.resolution", "16..8192"]);
}

#[test]
fn what_a_frame_leaves_is_listed_and_written_by_name() {
    let scene =
        ["render", "builtin:cornell", "--size", "32x24", "--samples", "2", "--set", "shadow.resolution=64"];
    let list = chiaro(&[&scene[..], &["--aov", "list"]].concat());
    assert!(list.status.success(), "{}", text(&list.stderr));
    for name in ["indirect ", "lights ", "shadow/shadow_maps ", "surface/visibility ", "direct/light_grid "] {
        assert!(text(&list.stdout).lines().any(|line| line.starts_with(name)), "{}", text(&list.stdout));
    }
    let picture = scratch("left.png");
    let names = ["shadow/shadow_maps", "surface/visibility", "direct/radiance", "direct/light_grid"];
    let asked: Vec<_> = names.iter().flat_map(|name| ["--aov", name]).collect();
    let output = chiaro(&[&scene[..], &asked, &["-o", picture.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", text(&output.stderr));
    let beside = |name: &str| {
        let path = picture.with_extension(name);
        assert!(text(&output.stdout).contains(path.to_str().unwrap()), "{}", text(&output.stdout));
        chiaro_image::read_layers(path).unwrap()
    };
    let map = beside("shadow.shadow_maps.0.exr");
    assert_eq!(map.size(), (64, 64));
    let depth = map.channel("Y").unwrap();
    assert!(depth.iter().any(|z| *z > 0.0) && depth.iter().all(|z| (0.0..=1.0).contains(z)));
    let visibility = beside("surface.visibility.exr");
    assert_eq!(visibility.size(), (32, 24));
    assert!(visibility.words("Y").unwrap().iter().any(|&triangle| triangle > 0));
    let radiance = beside("direct.radiance.exr");
    assert!(radiance.channel("R").unwrap().iter().any(|r| *r > 0.0) && radiance.channel("A").is_some());
    assert!(beside("direct.light_grid.exr").words("Y").is_some());

    let output = chiaro(&[&scene[..], &["--aov", "shadow/dreams"]].concat());
    assert_fails(&output, 2, &["shadow/dreams", "shadow/shadow_maps", "surface/visibility"]);
}

#[test]
fn the_pipeline_is_a_setting_that_a_preset_may_choose() {
    let preset = scratch("forward.ron");
    std::fs::create_dir_all(preset.parent().unwrap()).unwrap();
    std::fs::write(&preset, r#"{ "pipeline": "forward", "surface.msaa": 1 }"#).unwrap();
    let list = |flags: &[&str]| {
        let output = chiaro(&[&["settings", "--json", "--preset", preset.to_str().unwrap()], flags].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        let rows: Vec<serde_json::Value> = serde_json::from_slice(&output.stdout).unwrap();
        let row = |key: &str| rows.iter().find(|row| row["key"] == key).unwrap().clone();
        (row("pipeline"), row("surface.msaa"))
    };
    let (pipeline, msaa) = list(&[]);
    assert_eq!((&pipeline["value"], &pipeline["default"]), (&"forward".into(), &"deferred".into()));
    assert_eq!((&msaa["value"], &msaa["matters"]), (&"1".into(), &true.into()));
    for flags in [["--pipeline", "deferred"], ["--set", "pipeline=deferred"]] {
        let (pipeline, msaa) = list(&flags);
        assert_eq!((&pipeline["value"], &msaa["matters"]), (&"deferred".into(), &false.into()));
    }
    assert_fails(&chiaro(&["render", "--pipeline", "back"]), 2, &["deferred", "forward"]);
}

#[test]
fn a_change_that_does_nothing_is_a_warning_and_marked_in_the_list() {
    let sets = ["--set", "shadow.sigma=3", "--set", "shadow.pcf_kernel=5", "--set", "surface.msaa=8"];
    let output = chiaro(&[&["settings"], &sets[..]].concat());
    let list = text(&output.stdout);
    assert!(list.contains("shadow.sigma = 3 texels"), "{list}");
    assert!(list.contains("Does nothing here, only with shadow.filter=gaussian|gaussian-mip."), "{list}");
    // What goes wrong later does not keep it back.
    let output = chiaro(&[&["render", "missing.glb"], &sets[..]].concat());
    let error = text(&output.stderr);
    let warned =
        "warning: --set shadow.sigma does nothing here, only with shadow.filter=gaussian|gaussian-mip";
    assert!(error.contains(warned), "{error}");
    assert!(error.contains("--set surface.msaa does nothing here, only with pipeline=forward"), "{error}");
    assert!(!error.contains("pcf_kernel"), "{error}");
}

#[test]
fn suites_are_those_that_there_are() {
    let help = chiaro(&["bench", "--help"]);
    let help = text(&help.stdout).to_lowercase();
    for suite in ["shadows", "indirect", "reference"] {
        assert!(help.contains(&format!("- {suite}:")), "{help}");
        assert!(help.contains(&format!("--suite {suite}")), "no example: {help}");
    }
    assert_fails(&chiaro(&["bench", "--suite", "caustics"]), 2, &["shadows", "indirect", "reference"]);
}

#[test]
fn settings_that_do_not_go_together_are_wrong_usage() {
    let sets = ["--set", "shadow.representation=variance", "--set", "shadow.filter=pcf"];
    let render = chiaro(&[&["render", "builtin:cornell", "--size", "8x6"], &sets[..]].concat());
    assert_fails(&render, 2, &["shadow.filter = pcf", "gaussian"]);
}

#[test]
fn a_caster_takes_the_rings_place_or_is_refused_in_one_sentence() {
    let [empty, pane] =
        [("empty.obj", ""), ("pane.obj", "v 1 0 0\nv 0 1 0\nv 0 0 0\nf 1 2 3\n")].map(|(name, faces)| {
            let path = scratch(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, format!("v 0 0 0\n{faces}")).unwrap();
            path.to_str().unwrap().to_owned()
        });
    for command in [&["render"][..], &["view"], &["reference", "-o", "no.exr"], &["bench"]] {
        let with = |more: &[&str]| chiaro(&[command, &["--caster"], more].concat());
        assert_fails(&with(&[&pane, "builtin:ring"]), 2, &["cannot be used with"]);
        assert_fails(&with(&["absent.obj"]), 1, &["absent.obj"]);
        if command != ["view"] {
            assert_fails(&with(&[&empty]), 1, &["empty.obj", "draws nothing", "triangles"]);
        }
    }
    let picture = scratch("caster.png");
    let flags = ["--size", "16x12", "--samples", "1", "-o", picture.to_str().unwrap()];
    let output = chiaro(&[&["render", "--caster", &pane][..], &flags].concat());
    assert!(output.status.success() && picture.exists(), "{}", text(&output.stderr));
}

#[test]
fn terrain_is_made_of_a_picture_or_refused_in_one_sentence() {
    let map = scratch("heights.png");
    std::fs::create_dir_all(map.parent().unwrap()).unwrap();
    let grey = |x: u32, z: u32| [(x * z) as f32 / 225.0; 3];
    let colour = chiaro_image::Image::from_fn(16, 16, grey);
    chiaro_image::write_png(&map, &chiaro_image::Picture::from_linear(&colour, 1.0)).unwrap();
    let map = map.to_str().unwrap();
    for command in [&["render"][..], &["view"], &["reference", "-o", "no.exr"], &["bench"]] {
        let with = |more: &[&str]| chiaro(&[command, &["--height-map", map], more].concat());
        for (more, words) in [
            (&["--vertices", "1"][..], "2 to 2048"),
            (&["--vertices", "1000000000000"], "2 to 2048"),
            (&["--size-m", "0,0"], "metres from"),
            (&["--size-m", "-5,5"], "metres from"),
            (&["--size-m", "5"], "400,300"),
            (&["--height-m", "0"], "metres from"),
            (&["builtin:cornell"], "cannot be used with"),
        ] {
            assert_fails(&with(more), 2, &[words]);
        }
        assert_fails(&chiaro(&[command, &["--size-m", "5,5"]].concat()), 2, &["--height-map"]);
        assert_fails(&chiaro(&[command, &["--height-map", "absent.png"]].concat()), 1, &["absent.png"]);
    }
    // The pictures that chiaro writes are in colour.
    assert_fails(&chiaro(&["render", "--height-map", map]), 1, &["heights.png", "in colour", "grey"]);
    assert_fails(
        &chiaro(&["reference", "--height-map", "Cargo.toml", "-o", "no.exr"]),
        1,
        &["Cargo.toml", "height map"],
    );
}
