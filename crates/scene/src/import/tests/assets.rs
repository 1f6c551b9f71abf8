//! The shared assets, where they are present: `CHIARO_ASSETS`, or `../shared` beside the repository.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::{LoadOptions, load};
use crate::invariants::assert_sound;
use crate::{Scene, mesh};

/// The shared folder; says so where it is absent.
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("CHIARO_ASSETS").map_or(beside, PathBuf::from);
    if folder.join("assets").is_dir() {
        return Some(folder);
    }
    skipped("the shared assets are absent; set CHIARO_ASSETS to the folder that holds `assets`");
    None
}

/// As in `chiaro-testkit`: on standard error, and in the file that `CHIARO_SKIPPED` names, for the end of `./x test`.
fn skipped(reason: &str) {
    let thread = std::thread::current();
    let line = format!("SKIPPED: {}: {reason}\n", thread.name().unwrap_or("a test"));
    // Not `eprintln`, which the test harness would swallow.
    let _ = std::io::stderr().write_all(line.as_bytes());
    if let Some(path) = std::env::var_os("CHIARO_SKIPPED") {
        let file = std::fs::OpenOptions::new().create(true).append(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(line.as_bytes()));
    }
}

/// Every scene file below `folder`.
fn scene_files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut files = Vec::new();
    for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
        if path.is_dir() {
            files.extend(scene_files(&path));
        } else if ["gltf", "glb", "obj"].map(OsStr::new).map(Some).contains(&path.extension()) {
            files.push(path);
        }
    }
    files.sort();
    files
}

fn load_path(path: &Path) -> Result<Scene, crate::SceneError> {
    load(&path.to_string_lossy())
}

#[test]
fn every_khronos_stanford_and_own_scene_loads_or_is_refused_by_extension() {
    let Some(shared) = shared() else { return };
    let folders = ["assets/khronos", "assets/stanford", "assets/bitterli", "scenes"];
    let files: Vec<PathBuf> = folders.iter().flat_map(|folder| scene_files(&shared.join(folder))).collect();
    assert!(files.len() > 40, "only {} files", files.len());
    for path in files {
        let refused = ["glTF-Draco"].iter().any(|part| path.iter().any(|p| p == *part));
        match load_path(&path) {
            Ok(scene) => {
                assert!(!refused, "{} should be refused", path.display());
                assert_sound(&scene);
                assert!(scene.triangle_count() > 0, "{}", path.display());
            }
            Err(error) => assert!(refused, "{error}"),
        }
    }
}

#[test]
fn every_malformed_file_is_sound_or_an_error() {
    let Some(shared) = shared() else { return };
    let files = scene_files(&shared.join("assets/malformed"));
    assert!(files.len() > 300, "only {} files", files.len());
    let mut errors = 0;
    for path in &files {
        match load_path(path) {
            Ok(scene) => assert_sound(&scene),
            Err(_) => errors += 1,
        }
    }
    assert!(errors > 100, "{errors} of {} were refused", files.len());
}

#[test]
fn sponza_and_sibenik_are_at_the_same_place_as_obj_and_as_glb() {
    let Some(shared) = shared() else { return };
    for (obj, glb) in [("dabrovic-sponza/sponza.obj", "sponza.glb"), ("sibenik/sibenik.obj", "sibenik.glb")] {
        let obj = load_path(&shared.join("assets/noncommercial").join(obj)).unwrap();
        let glb = load_path(&shared.join("scenes").join(glb)).unwrap();
        assert_sound(&obj);
        let ((lo, hi), (glb_lo, glb_hi)) = (obj.bounds().unwrap(), glb.bounds().unwrap());
        assert!(
            lo.abs_diff_eq(glb_lo, 1e-4) && hi.abs_diff_eq(glb_hi, 1e-4),
            "{lo}..{hi}, {glb_lo}..{glb_hi}"
        );
        // The GLBs were made without the triangles that have no area.
        let fewer = obj.triangle_count() - glb.triangle_count();
        assert!(fewer < 20, "{} and {} triangles", obj.triangle_count(), glb.triangle_count());
        assert!(obj.materials.iter().any(|material| material.normal_texture.is_some()));
    }
}

#[test]
fn mcguire_scenes_load() {
    let Some(shared) = shared() else { return };
    for path in scene_files(&shared.join("assets/mcguire")) {
        // The largest, for the time it takes; it loads like the others.
        if path.ends_with("lost_empire.obj") {
            continue;
        }
        let scene = load_path(&path).unwrap();
        assert_sound(&scene);
        assert!(scene.triangle_count() >= 12, "{}", path.display());
    }
}

#[test]
fn generated_tangents_agree_with_those_that_khronos_supplies() {
    let Some(shared) = shared() else { return };
    let path = "assets/khronos/NormalTangentMirrorTest/glTF-Binary/NormalTangentMirrorTest.glb";
    let scene = load_path(&shared.join(path)).unwrap();
    let given = &scene.meshes[0].primitives[0];
    let mut generated = given.clone();
    generated.tangents.clear();
    mesh::generate_tangents(&mut generated, &scene.materials[given.material].normal_texture.unwrap());
    let corners = given.indices.iter().zip(&generated.indices);
    let mut agreeing = 0;
    for (&a, &b) in corners {
        let (a, b) = (given.tangents[a as usize], generated.tangents[b as usize]);
        agreeing += usize::from(a.w == b.w && a.truncate().dot(b.truncate()) > 0.99);
    }
    // A few corners of triangles without an area in the image differ.
    assert!(agreeing * 100 >= given.indices.len() * 98, "{agreeing} of {}", given.indices.len());
}

/// A scene of the Khronos samples; `None` where they are absent.
fn khronos(file: &str) -> Option<Scene> {
    let scene = load_path(&shared()?.join("assets/khronos").join(file)).unwrap();
    assert_sound(&scene);
    Some(scene)
}

/// World positions of every drawn vertex at a time.
fn posed(scene: &Scene, time_s: f64) -> Vec<Vec3> {
    let pose = scene.pose(time_s);
    let drawn = scene.nodes.iter().enumerate().filter_map(|(id, node)| Some((id, &scene.meshes[node.mesh?])));
    let primitives = drawn.flat_map(|(id, mesh)| mesh.primitives.iter().map(move |p| (id, p)));
    primitives.flat_map(|(id, p)| scene.posed_vertices(&pose, id, p).map(|(p, _)| p)).collect()
}

#[test]
fn animated_samples_move_within_reason_and_take_the_time_they_should() {
    // Duration in seconds, and the largest extent at rest in metres as the samples' pictures and files say.
    for (file, duration_s, size) in [
        ("CesiumMan/glTF-Binary/CesiumMan.glb", 2.0, 1.5),
        ("Fox/glTF-Binary/Fox.glb", 3.417, 150.0),
        ("RiggedSimple/glTF-Binary/RiggedSimple.glb", 2.083, 9.5),
        ("RiggedSimple/glTF-Embedded/RiggedSimple.gltf", 2.083, 9.5),
        ("AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb", 4.19, 2.0),
        ("AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf", 4.19, 2.0),
        ("InterpolationTest/glTF-Binary/InterpolationTest.glb", 1.708, 10.0),
        ("BoxAnimated/glTF-Binary/BoxAnimated.glb", 3.708, 1.0),
    ] {
        let Some(scene) = khronos(file) else { return };
        let seconds = scene.duration_s().unwrap();
        assert!((seconds - duration_s).abs() < 0.02, "{file} takes {seconds} s");
        let (lo, hi) = scene.bounds().unwrap();
        let extent = (hi - lo).max_element();
        assert!((0.5 * size..2.0 * size).contains(&extent), "{file} measures {extent} m");
        let (rest, later) = (posed(&scene, 0.0), posed(&scene, 0.7));
        let moved = rest.iter().zip(&later).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!((0.01 * extent..2.0 * extent).contains(&moved), "{file} moves by {moved} m");
    }
}

#[test]
fn quantized_and_float_samples_are_the_same_shape() {
    let pairs = [
        ("Duck/glTF-Binary/Duck.glb", "Duck/glTF-Quantized/Duck.gltf"),
        (
            "AnimatedMorphCube/glTF-Binary/AnimatedMorphCube.glb",
            "AnimatedMorphCube/glTF-Quantized/AnimatedMorphCube.gltf",
        ),
    ];
    for (float, quantized) in pairs {
        let (Some(float), Some(quantized)) = (khronos(float), khronos(quantized)) else { return };
        for time_s in [0.0, 0.7] {
            let bounds = [&float, &quantized].map(|scene| scene.bounds_at(&scene.pose(time_s)).unwrap());
            let [(lo, hi), (other_lo, other_hi)] = bounds;
            let tolerance = 0.01 * (hi - lo).max_element();
            assert!(lo.abs_diff_eq(other_lo, tolerance) && hi.abs_diff_eq(other_hi, tolerance), "{bounds:?}");
        }
        assert_eq!(float.triangle_count(), quantized.triangle_count());
    }
}

#[test]
fn samples_of_single_features_hold_what_their_descriptions_say() {
    let Some(instanced) = khronos("SimpleInstancing/glTF-Binary/SimpleInstancing.glb") else { return };
    assert_eq!(instanced.nodes.iter().filter(|node| node.mesh.is_some()).count(), 125);
    let sparse = khronos("SimpleSparseAccessor/glTF/SimpleSparseAccessor.gltf").unwrap();
    let (lo, hi) = sparse.bounds().unwrap();
    assert!(lo.abs_diff_eq(Vec3::ZERO, 1e-5) && hi.abs_diff_eq(Vec3::new(6.0, 4.0, 0.0), 1e-5), "{lo}..{hi}");
    let modes = khronos("MeshPrimitiveModes/glTF/MeshPrimitiveModes.gltf").unwrap();
    let kinds = modes.warnings.iter().filter(|warning| warning.contains("points and lines")).count();
    assert_eq!((modes.nodes.iter().filter(|node| node.mesh.is_some()).count(), kinds), (3, 4));
    let colored = khronos("VertexColorTest/glTF-Binary/VertexColorTest.glb").unwrap();
    assert!(colored.meshes.iter().flat_map(|mesh| &mesh.primitives).any(|p| !p.colors.is_empty()));
}

#[test]
fn the_scenes_of_a_file_differ() {
    let Some(shared) = shared() else { return };
    let path = shared.join("assets/khronos/MultipleScenes/glTF/MultipleScenes.gltf");
    let load = |scene: &str| {
        let options = LoadOptions { scene: Some(scene.to_owned()), ..LoadOptions::default() };
        crate::load_with(&path.to_string_lossy(), &options)
    };
    let [first, second] = ["0", "1"].map(|scene| load(scene).unwrap());
    assert_eq!(first.scene_names.len(), 2);
    assert_ne!(first.triangle_count(), second.triangle_count());
    assert!(matches!(load("2"), Err(crate::SceneError::UnknownScene { .. })));
}
