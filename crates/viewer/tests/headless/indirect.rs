//! Indirect light in the viewer: one technique after the other, and pictures of what it is made from.

use chiaro::{Pipeline, Pixels, Readback, Settings};
use chiaro_viewer::{Options, StartCamera};
use egui::Key;

use crate::driver::{Driver, mean};

fn driver(scene: &str) -> Driver {
    let mut settings = Settings::default();
    // As little as still shows what it is.
    for (key, value) in [
        ("vpls", "64"),
        ("sampling", "halton"),
        ("rsm_resolution", "64"),
        ("points", "16384"),
        ("points_per_vpl", "1024"),
        ("ism_resolution", "32"),
        ("interleave", "2"),
        ("filter", "discontinuity"),
    ] {
        settings.set(&format!("indirect.{key}"), value).unwrap();
    }
    settings.set("indirect.technique", "ambient").unwrap();
    let mut driver = Driver::new(Options { scene: scene.into(), settings, ..Options::default() });
    driver.settle();
    driver
}

/// The picture after so many frames with a technique, and the check that nothing failed on the way.
fn with(driver: &mut Driver, technique: &str, frames: u32) -> Pixels {
    let mut settings = driver.viewer.settings().clone();
    settings.set("indirect.technique", technique).unwrap();
    driver.viewer.set(settings);
    // Whatever is built meanwhile, there is a picture.
    driver.frame(Vec::new());
    assert!(driver.viewer.picture().is_some());
    driver.settle();
    driver.until("averaged", |viewer| viewer.frames() >= frames);
    let picture = read(driver);
    assert_eq!(driver.viewer.settings_error(), None);
    assert_eq!(driver.viewer.messages().collect::<Vec<_>>(), Vec::<&str>::new());
    picture
}

fn read(driver: &Driver) -> Pixels {
    let texture = driver.viewer.picture().expect("a scene is on show");
    Readback::start(&driver.gpu, texture).unwrap().wait(&driver.gpu).unwrap()
}

fn differ(a: &Pixels, b: &Pixels) -> f64 {
    let both = a.bytes.iter().zip(&b.bytes);
    both.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.bytes.len() as f64
}

#[test]
fn techniques_of_indirect_light_follow_each_other() {
    let mut driver = driver("builtin:cornell");
    let names = ["ambient", "ism", "traced", "rsm", "none"];
    let pictures = names.map(|name| with(&mut driver, name, 64));
    for (number, one) in pictures.iter().enumerate() {
        for (other, name) in pictures.iter().zip(names).skip(number + 1) {
            let apart = differ(one, other);
            assert!(apart > 0.05, "{} and {name} look the same: {apart}", names[number]);
        }
    }
    let [.., rsm, none] = &pictures;
    assert!(mean(none) < mean(rsm), "virtual lights bring nothing");
    // And back: nothing of what was between is left.
    assert!(with(&mut driver, "ism", 64) == pictures[1], "imperfect shadow maps are others the second time");
    // Points of another number are strewn while the old ones are drawn from.
    let mut settings = driver.viewer.settings().clone();
    settings.set("indirect.points", "8192").unwrap();
    driver.viewer.set(settings);
    driver.settle();
    assert!(differ(&driver.picture(), &pictures[1]) > 0.0, "the points are the same");
    assert_eq!(driver.viewer.settings_error(), None);
    // What does not fit is told, and what was there before goes on.
    let before = driver.viewer.settings().clone();
    let mut settings = before.clone();
    settings.set("indirect.vpls", "65535").unwrap();
    settings.set("indirect.ism_resolution", "256").unwrap();
    driver.viewer.set(settings);
    driver.settle();
    let error = driver.viewer.settings_error().expect("17 GB are refused");
    assert!(error.contains("imperfect shadow maps"), "{error}");
    assert_eq!(driver.viewer.settings(), &before);
    assert!(mean(&driver.picture()) > 1.0);
}

#[test]
fn glass_and_both_pipelines_have_indirect_light_too() {
    let mut driver = driver("builtin:pool");
    driver.size = [360, 60];
    let deferred = [with(&mut driver, "none", 2), with(&mut driver, "ism", 2)];
    let mut settings = driver.viewer.settings().clone();
    settings.pipeline = Pipeline::Forward;
    driver.viewer.set(settings);
    driver.settle();
    let forward = with(&mut driver, "ism", 2);
    let [bounced, pipelines] = [differ(&deferred[0], &deferred[1]), differ(&forward, &deferred[1])];
    assert!(pipelines < 0.5 * bounced, "{bounced} of indirect light, {pipelines} between pipelines");
}

#[test]
fn digits_choose_what_indirect_light_is_made_from() {
    let mut driver = driver("builtin:cornell");
    driver.press(Key::Num7);
    assert!(driver.viewer.buffer().is_none(), "there are no virtual lights");
    with(&mut driver, "ism", 1);
    for (key, name) in [
        (Key::Num7, "rsm_picture"),
        (Key::Num8, "ism_after"),
        (Key::Num9, "vpl_picture"),
        (Key::Num0, "discontinuities"),
    ] {
        driver.press(key);
        driver.frame(Vec::new());
        let buffer = driver.viewer.buffer().unwrap_or_else(|| panic!("{name} is not there"));
        let pixels = Readback::start(&driver.gpu, buffer).unwrap().wait(&driver.gpu).unwrap();
        let wrong = pixels.bytes.chunks_exact(4).filter(|p| p[..3] == [255, 0, 255]).count();
        assert!(wrong == 0 && mean(&pixels) > 1.0, "{name}: {wrong} are no numbers, mean {}", mean(&pixels));
        assert!(driver.viewer.buffers().any(|other| other == format!("indirect/{name}")));
    }
    assert!(driver.viewer.buffers().any(|name| name == "indirect/point_picture"));
}

#[test]
fn points_are_chosen_anew_beside_the_frame_where_the_camera_is_far_from_where_they_were_chosen_for() {
    let mut settings = driver("builtin:cornell").viewer.settings().clone();
    settings.set("indirect.technique", "ism").unwrap();
    // A scene that is loaded has points for its first camera.
    let camera = StartCamera::Named("corner".into());
    let mut driver =
        Driver::new(Options { scene: "builtin:cornell".into(), settings, camera, ..Options::default() });
    driver.until("choosing", |viewer| viewer.picture().is_some() && !viewer.is_settled());
    driver.settle();
    driver.until("averaged", |viewer| viewer.frames() >= 2);
    assert!(driver.viewer.is_settled() && mean(&read(&driver)) > 1.0);
}
