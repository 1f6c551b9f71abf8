//! Nothing is built that a browser refuses: every kind of pass once, on a device that is strict about WebGPU.

use chiaro::techniques::post::DebugView;
use chiaro::techniques::{Kit, shaders};
use chiaro::{Aov, Effect, Error, Kind, Pipeline, Recorder, Settings, StillOptions, View, scene};
use chiaro_gpu::wgpu::{Features, Limits};
use chiaro_testkit::{Studio, ambient, device_guaranteed};
use glam::Vec2;

const SIZE: [u32; 2] = [24, 16];

fn small() -> Settings {
    let mut settings = ambient();
    settings.set("shadow.resolution", "64").unwrap();
    settings
}

/// Every choice and switch that costs a pipeline by itself; those of surfaces in both ways of shading.
fn all_settings() -> Vec<Settings> {
    let mut all = Vec::new();
    for pipeline in [Pipeline::Deferred, Pipeline::Forward] {
        let plain = Settings { pipeline, ..small() };
        all.push(plain.clone());
        for field in Settings::fields() {
            let of_both = pipeline == Pipeline::Deferred || field.key.starts_with("surface.");
            if field.effect != Effect::Permutation || !of_both {
                continue;
            }
            let values: Vec<String> = match &field.kind {
                Kind::Switch => vec!["true".into(), "false".into()],
                Kind::Choice(names) => names.iter().map(|(name, _)| (*name).to_owned()).collect(),
                _ => continue,
            };
            for value in values {
                let mut settings = plain.clone();
                settings.set(&field.key, &value).unwrap();
                if field.key == "shadow.representation" && value != "depth" {
                    settings.set("shadow.filter", "gaussian").unwrap();
                }
                if !all.contains(&settings) {
                    all.push(settings);
                }
            }
        }
    }
    all
}

fn look(studio: &mut Studio, name: &str, settings: impl IntoIterator<Item = Settings>) -> usize {
    let gpu = device_guaranteed();
    let mut scene = scene::load(name).unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let mut loaded = studio.load(&scene);
    let mut recorder = Recorder::new(&gpu, false);
    let mut state = chiaro::ViewState::new(studio.renderer());
    let mut rendered = 0;
    for settings in settings {
        match studio.renderer().set(settings.clone()) {
            Ok(()) => {}
            Err(Error::Combination(_)) => continue,
            Err(error) => panic!("{settings:?}: {error}"),
        }
        studio.renderer().equip(&scene, &mut loaded).unwrap();
        let sampling = (Vec2::ZERO, 1.0);
        let prepared = studio.renderer().prepare(&mut state, &loaded, &view, SIZE, sampling).unwrap();
        let mut frame = recorder.begin();
        prepared.record(&mut frame, true);
        frame.submit();
        gpu.check().unwrap_or_else(|error| panic!("{settings:?}: {error}"));
        rendered += 1;
    }
    recorder.wait().unwrap();
    let options = StillOptions { size: SIZE, samples: 1, aovs: vec![Aov::Shadow], ..StillOptions::default() };
    let still = studio.renderer().still(&loaded, &view, &options).unwrap();
    still.picture.wait(&gpu).unwrap();
    rendered
}

#[test]
fn the_device_of_guaranteed_limits_is_strict_about_web_gpu() {
    let gpu = device_guaranteed();
    let mut limits = Limits::default();
    limits.zero_native_only();
    assert_eq!(gpu.limits, limits);
    assert!(gpu.device.features().difference(Features::TIMESTAMP_QUERY).is_empty());
}

#[test]
fn every_choice_of_settings_is_what_a_browser_takes() {
    let gpu = device_guaranteed();
    let mut studio = Studio::new(&gpu, small());
    let all = all_settings();
    let rendered = look(&mut studio, "builtin:cornell", all.iter().cloned());
    assert!(2 * rendered > all.len(), "most of {} were refused", all.len());
}

#[test]
fn glass_leaves_and_what_moves_are_what_a_browser_takes() {
    let gpu = device_guaranteed();
    let both = || [Pipeline::Deferred, Pipeline::Forward].map(|pipeline| Settings { pipeline, ..small() });
    for name in ["builtin:ball", "builtin:dancer"] {
        look(&mut Studio::new(&gpu, small()), name, both());
    }
    let kit = Kit::new(&gpu, shaders::library());
    DebugView::new(&gpu, &kit.library, &kit.frame_layout).unwrap();
}
