//! The shared assets, where they are present: `CHIARO_ASSETS`, or `../shared` beside the repository.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::load;
use crate::invariants::assert_sound;
use crate::{Scene, mesh};

/// The shared folder; says so where it is absent.
fn shared() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let folder = std::env::var_os("CHIARO_ASSETS").map_or(beside, PathBuf::from);
    if folder.join("assets").is_dir() {
        return Some(folder);
    }
    // Not `eprintln`, which the test harness would swallow.
    let message =
        "NOT TESTED: the shared assets are absent; set CHIARO_ASSETS to the folder that holds `assets`";
    let _ = writeln!(std::io::stderr(), "{message}");
    None
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
