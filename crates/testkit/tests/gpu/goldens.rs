//! Pictures that a person has looked at.

use chiaro::{Settings, View, scene};
use chiaro_testkit::{Studio, Tolerance, assert_golden, device};

fn assert_looks_the_same(name: &str) {
    let mut scene = scene::load(&format!("builtin:{name}")).unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let gpu = device();
    let mut settings = Settings::default();
    // Fewer than by default, which take a second a frame without a GPU.
    for (key, value) in [
        ("shadow.resolution", "1024"),
        ("indirect.vpls", "256"),
        ("indirect.ism_resolution", "64"),
        ("indirect.points_per_vpl", "2048"),
    ] {
        settings.set(key, value).unwrap();
    }
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(&scene);
    let picture = studio.picture(&loaded, &view, [128, 72], 8);
    assert_golden(name, &picture, Tolerance::default());
}

#[test]
fn the_nave_looks_as_it_did() {
    assert_looks_the_same("nave");
}

#[test]
fn the_cornell_box_looks_as_it_did() {
    assert_looks_the_same("cornell");
}
