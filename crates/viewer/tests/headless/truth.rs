//! The path-traced truth beside the picture.

use chiaro::{Integrator, Pixels, Readback, Recorder, Reference, ReferenceOptions, Renderer, Texture};
use chiaro::{View, scene};
use chiaro_testkit::ambient;
use chiaro_viewer::{Compare, Options, Viewer};
use egui::{CursorIcon, Event, Key, Modifiers, PointerButton, Pos2, pos2};

use crate::driver::{Driver, SIZE};

fn driver(scene: &str, truth_samples: u32) -> Driver {
    let mut driver = Driver::new(Options {
        scene: scene.into(),
        settings: ambient(),
        truth_samples,
        ..Options::default()
    });
    driver.settle();
    driver
}

fn samples(viewer: &Viewer) -> u32 {
    viewer.truth().map_or(0, |(_, samples)| samples)
}

fn read(driver: &Driver, texture: &Texture) -> Pixels {
    Readback::start(&driver.gpu, texture).unwrap().wait(&driver.gpu).unwrap()
}

/// The picture once it and the truth have come to rest.
fn picture(driver: &mut Driver, compare: Compare, truth_samples: u32) -> Pixels {
    driver.viewer.set_compare(compare);
    driver.until("as far as it goes", |viewer| {
        let is_done = compare == Compare::Off || samples(viewer) == truth_samples;
        is_done && viewer.frames() >= 64 && viewer.truth_column().is_some() == (compare != Compare::Off)
    });
    read(driver, driver.viewer.picture().unwrap())
}

/// Left of the column all is as in `left`, and from there on as in `right`.
fn assert_split(picture: &Pixels, (left, right): (&Pixels, &Pixels), column: u32) {
    let texels =
        picture.bytes.chunks_exact(4).zip(left.bytes.chunks_exact(4).zip(right.bytes.chunks_exact(4)));
    for (number, (shown, (left, right))) in (0..).zip(texels) {
        let (x, y) = (number % picture.width, number / picture.width);
        let expected = if x < column { left } else { right };
        assert_eq!(shown, expected, "{x}, {y}; the divider stands at {column}");
    }
}

#[test]
fn the_truth_is_what_the_reference_makes() {
    let mut driver = driver("builtin:cornell", 5);
    let picture = picture(&mut driver, Compare::Truth, 5);
    let found = read(&driver, driver.viewer.truth().unwrap().0).floats();

    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let (view, size) = (View::from_scene(&scene, 0).unwrap(), [picture.width, picture.height]);
    let (renderer, loaded) = Renderer::with_scene(&driver.gpu, ambient(), &scene).unwrap();
    let (kit, settings) = (renderer.kit(), renderer.settings());
    let scenes = (&scene, &loaded);
    let mut reference = Reference::new(
        kit,
        scenes,
        settings,
        (&view, size),
        ReferenceOptions { integrator: Integrator::Full, ..ReferenceOptions::default() },
    )
    .unwrap();
    let mut recorder = Recorder::new(&driver.gpu, false);
    let mut frame = recorder.begin();
    reference.add(&mut frame, &loaded, 5);
    frame.submit();
    let expected = reference.sum().unwrap().wait(&driver.gpu).unwrap().floats();
    assert!(found == expected, "the viewer's samples are others");
    assert!(expected.iter().any(|nits| *nits > 0.0));
}

#[test]
fn unlit_materials_show_their_colour_on_screen_in_the_picture_and_in_the_truth() {
    let mut driver = driver(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/headless/unlit.gltf"), 3);
    for compare in [Compare::Off, Compare::Truth] {
        let picture = picture(&mut driver, compare, 3);
        // A tenth from the left, in the middle; the sun on the right is of 1000 lx.
        let at = 4 * (picture.height / 2 * picture.width + picture.width / 10) as usize;
        let rgb = &picture.bytes[at..at + 3];
        // Half of white is sRGB code 187.5, dithered.
        assert!(rgb.iter().all(|code| (187..=188).contains(code)), "{compare:?}: {rgb:?}");
    }
}

#[test]
fn a_split_picture_is_one_mode_left_and_the_other_right_of_the_divider() {
    let mut driver = driver("builtin:cornell", 3);
    let truth = picture(&mut driver, Compare::Truth, 3);
    let split = picture(&mut driver, Compare::Split, 3);
    let column = driver.viewer.truth_column().unwrap();
    let off = picture(&mut driver, Compare::Off, 3);
    assert_eq!(column, off.width.div_ceil(2));
    assert_split(&split, (&off, &truth), column);
    assert!(off.bytes != truth.bytes);

    // The picture fills the window's left, without a margin; its pixels are the window's.
    driver.viewer.set_compare(Compare::Split);
    driver.frame(Vec::new());
    let divider = pos2(column as f32, 40.0);
    driver.frame(vec![Event::PointerMoved(divider + egui::vec2(40.0, 0.0))]);
    driver.frame(Vec::new());
    assert_eq!(driver.cursor, CursorIcon::Default);
    let mut at = divider;
    for to in [20.0, 150.0] {
        drag(&mut driver, at, pos2(to, 50.0));
        at = pos2(to, 50.0);
        let moved = picture(&mut driver, Compare::Split, 3);
        assert_eq!(driver.viewer.truth_column(), Some(to as u32));
        assert_split(&moved, (&off, &truth), to as u32);
    }
    // It is the divider that was dragged, not the camera.
    assert!(picture(&mut driver, Compare::Off, 3).bytes == off.bytes);
}

fn drag(driver: &mut Driver, from: Pos2, to: Pos2) {
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    driver.frame(vec![Event::PointerMoved(from)]);
    driver.frame(vec![Event::PointerMoved(from)]);
    assert_eq!(driver.cursor, CursorIcon::ResizeHorizontal);
    driver.frame(vec![button(from, true)]);
    driver.frame(vec![Event::PointerMoved(from.lerp(to, 0.5))]);
    driver.frame(vec![Event::PointerMoved(to)]);
    driver.frame(vec![button(to, false)]);
}

#[test]
fn rest_refines_and_what_changes_light_or_view_starts_anew() {
    let mut driver = driver("builtin:cornell", 32);
    driver.press(Key::T);
    assert_eq!(driver.viewer.compare(), Compare::Split);
    driver.until("measured", |viewer| viewer.truth_noise().is_some());
    let early = driver.viewer.truth_noise().unwrap();
    driver.until("refined", |viewer| samples(viewer) == 32);
    driver.until("measured again", |viewer| viewer.truth_noise().is_some_and(|noise| noise < 0.6 * early));
    let late = driver.viewer.truth_noise().unwrap();
    assert!(late > 0.1 * early, "{early} {late}: eight times the samples have about a third of the noise");

    let mut settings = driver.viewer.settings().clone();
    settings.set("camera.exposure_ev100", "4").unwrap();
    settings.set("indirect.technique", "none").unwrap();
    driver.viewer.set(settings.clone());
    driver.settle();
    assert_eq!(samples(&driver.viewer), 32, "exposure is none of the truth's business");

    for turn in ["another BRDF", "another view"] {
        if turn == "another BRDF" {
            settings.set("surface.lighting", "lambert").unwrap();
            driver.viewer.set(settings.clone());
            driver.settle();
        } else {
            driver.press(Key::W);
        }
        assert!(samples(&driver.viewer) < 32, "{turn}: its samples are averaged with those before");
        assert_eq!(driver.viewer.truth_noise(), None, "{turn}");
        driver.until("measured", |viewer| viewer.truth_noise().is_some());
    }
}

#[test]
fn refining_creates_nothing_and_survives_every_size() {
    let mut driver = driver("builtin:cornell", 1 << 20);
    driver.viewer.set_compare(Compare::Truth);
    driver.until("refining", |viewer| samples(viewer) >= 10 && viewer.frames() >= 64);
    let (before, first) = (driver.gpu.created.total(), samples(&driver.viewer));
    driver.until("refining on", |viewer| samples(viewer) >= first + 10);
    assert_eq!(driver.gpu.created.total(), before, "refining makes GPU objects");

    for size in [[1, 1], [301, 40], [0, 0], [302, 23], [900, 1], [400, 200], [333, 77], SIZE] {
        driver.size = size;
        for compare in [Compare::Split, Compare::Off, Compare::Truth] {
            driver.viewer.set_compare(compare);
            driver.frame(Vec::new());
            driver.frame(Vec::new());
        }
    }
    driver.until("refining", |viewer| samples(viewer) >= 2);
}

#[test]
fn another_scene_gets_trees_of_its_own() {
    let mut driver = driver("builtin:cornell", 2);
    let room = picture(&mut driver, Compare::Truth, 2);
    driver.viewer.open("builtin:ring");
    driver.settle();
    assert_eq!(samples(&driver.viewer), 0, "samples of the scene before are shown");
    let ring = picture(&mut driver, Compare::Truth, 2);
    assert!(room.bytes != ring.bytes);
}
