//! Direct light against path-traced references, where they are at hand.

use chiaro::{View, scene};
use chiaro_image::{CompareOptions, Comparison};
use chiaro_testkit::{Studio, assets, device, direct, reference};

fn assert_matches(name: &str, nmae: f64, pipeline: chiaro::Pipeline) {
    let Some(assets) = assets() else { return };
    let expected = reference(&assets, &format!("{name}.direct"));
    let scene = scene::load(&assets.join(format!("scenes/{name}.glb")).to_string_lossy()).unwrap();
    let view = View::from_scene(&scene, 0).unwrap();
    let gpu = device();
    let mut settings = direct(&[]);
    settings.pipeline = pipeline;
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(&scene);
    let found = studio.radiance(&loaded, &view, [expected.width(), expected.height()], 16);
    let metrics = Comparison::new(&found, &expected, &CompareOptions::default()).unwrap().metrics();
    assert_eq!(metrics.not_finite, 0);
    // The bound on energy is the issue's; that on pixels what shadow edges of one map and 16 samples cost.
    assert!(metrics.nmae <= nmae && (metrics.mean_ratio - 1.0).abs() <= 0.02, "{name}: {metrics:?}");
}

#[test]
fn the_cornell_box_under_a_spot_matches_its_reference() {
    assert_matches("cornell_spot", 0.006, chiaro::Pipeline::Deferred);
}

#[test]
fn two_rooms_match_their_reference() {
    assert_matches("two_rooms", 0.01, chiaro::Pipeline::Deferred);
}
