//! Reading and measuring the path-traced references, where they are at hand.
//!
//! They are too large for the repository. They are looked for in the folder that `CHIARO_ASSETS` names, or else in
//! `shared` beside the checkout; each holds a folder `references`. Without them these tests say so and pass: what
//! they check is checked on small images elsewhere.

use std::path::{Path, PathBuf};

use chiaro_image::{CompareOptions, Comparison, Image, Metrics, read};

fn references() -> Option<PathBuf> {
    let folder = std::env::var_os("CHIARO_ASSETS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3).map(|parent| parent.join("shared")),
        |folder| Some(PathBuf::from(folder)),
    );
    let found = folder.map(|folder| folder.join("references")).filter(|folder| folder.is_dir());
    if found.is_none() {
        eprintln!("NOT CHECKED: no reference images in $CHIARO_ASSETS/references or ../shared/references");
    }
    found
}

fn metrics(folder: &Path, a: &str, b: &str, options: &CompareOptions) -> Metrics {
    let load = |name: &str| -> Image { read(folder.join(name)).unwrap() };
    Comparison::new(&load(a), &load(b), options).unwrap().metrics()
}

/// NumPy's and flip-evaluator's figures for the same files, which are PIZ-compressed half floats.
fn assert_close(found: &Metrics, [mean_ratio, nmae, relmse, flip]: [f64; 4]) {
    for (name, found, expected) in [
        ("mean_ratio", found.mean_ratio, mean_ratio),
        ("nmae", found.nmae, nmae),
        ("relmse", found.relmse, relmse),
        ("flip", found.flip, flip),
    ] {
        assert!((found - expected).abs() < 1e-4, "{name} is {found}, expected {expected}");
    }
}

#[test]
fn direct_light_against_all_light_has_the_known_distance() {
    let Some(folder) = references() else { return };
    let found =
        metrics(&folder, "cornell_point.direct.exr", "cornell_point.full.exr", &CompareOptions::default());
    assert_close(&found, [0.567448, 0.432552, 0.274103, 0.346823]);
}

#[test]
fn caustics_alone_have_the_known_distance() {
    let Some(folder) = references() else { return };
    let mask = read(folder.join("glass_knot.mask.exr")).unwrap();
    let direct = read(folder.join("glass_knot.direct.exr")).unwrap();
    let options =
        CompareOptions { mask: Some(&mask), minus_a: Some(&direct), minus_b: Some(&direct), blur_px: 2.0 };
    let found = metrics(&folder, "glass_knot.particles.exr", "glass_knot.light1.exr", &options);
    assert_close(&found, [1.116904, 0.116904, 0.472484, 0.111828]);
}

#[test]
fn every_reference_can_be_read() {
    let Some(folder) = references() else { return };
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "exr") {
            let image = read(&path).unwrap();
            assert!(image.pixels().iter().flatten().all(|value| value.is_finite()), "{}", path.display());
            count += 1;
        }
    }
    assert!(count > 0, "the folder of references holds no EXR");
}
