//! The log's handles: every texture and buffer of a frame by name, none of them kept alive.

use chiaro::scene;
use chiaro::{Handle, Pipeline, Recorder, Resource, Settings, StillOptions, View};
use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{Life, TextureOptions, TexturePool};
use chiaro_testkit::{Studio, ambient, device};
use glam::Vec2;

const SIZE: [u32; 2] = [48, 32];

fn leaves(pipeline: Pipeline, recorder: &mut Recorder) -> Vec<Resource> {
    let gpu = device();
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let mut settings = Settings { pipeline, ..ambient() };
    settings.set("shadow.resolution", "64").unwrap();
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(&scene);
    // Of a later frame, in which the shadow maps are those of the first.
    let mut state = chiaro::ViewState::new(studio.renderer());
    let sampling = (Vec2::ZERO, 1.0);
    let prepared = studio.renderer().prepare(&mut state, &loaded, &view, SIZE, sampling).unwrap();
    let mut frame = recorder.begin();
    prepared.record(&mut frame, true);
    frame.submit();
    let prepared = studio.renderer().prepare(&mut state, &loaded, &view, SIZE, sampling).unwrap();
    let mut frame = recorder.begin();
    let outputs = prepared.record(&mut frame, true);
    let all: Vec<_> = frame.resources().collect();
    frame.submit();
    let textures: Vec<_> = all
        .iter()
        .filter_map(|found| if let Handle::Texture(t) = &found.handle { Some(t) } else { None })
        .collect();
    let surface = outputs.surface.unwrap();
    for texture in [&outputs.radiance, &outputs.shadows.maps, &surface.depth, &surface.visibility] {
        assert!(textures.contains(&texture), "{} is not offered", texture.name());
    }
    all
}

#[test]
fn a_frame_offers_everything_that_its_passes_touched_by_a_name_of_its_own() {
    for pipeline in [Pipeline::Deferred, Pipeline::Forward] {
        let mut recorder = Recorder::new(&device(), false);
        let all = leaves(pipeline, &mut recorder);
        let names: Vec<_> = all.iter().map(|found| found.name.to_string()).collect();
        for pass in recorder.log() {
            let technique = pass.name.split_once('/').unwrap().0;
            for written in &pass.writes {
                let name = format!("{technique}/{written}");
                assert!(names.contains(&name), "{} writes {name}, which is not in {names:?}", pass.name);
            }
        }
        let made = ["shadow/shadow_maps", "direct/radiance", "direct/light_grid", "surface/depth"];
        // What only a shared bind group holds, and several of one name.
        let uploaded = ["view/materials", "view/material_textures", "view/material_textures.2"];
        for name in made.into_iter().chain(uploaded) {
            assert!(names.iter().any(|other| other == name), "{name} is not in {names:?}");
        }
        let mut once = names.clone();
        once.sort_unstable();
        once.dedup();
        assert_eq!(once.len(), names.len(), "two of one name in {names:?}");
    }
}

#[test]
fn the_log_keeps_nothing_alive() {
    let gpu = device();
    let mut recorder = Recorder::new(&gpu, false);
    drop(leaves(Pipeline::Deferred, &mut recorder));
    // The renderer is gone, and with it what it drew to.
    let names: Vec<_> = recorder.resources().map(|found| found.name.to_string()).collect();
    assert!(names.is_empty(), "{names:?}");
}

#[test]
fn a_texture_that_the_log_knows_goes_back_to_its_pool() {
    let gpu = device();
    let pool = TexturePool::default();
    let options = TextureOptions::new(7, 5, TextureFormat::Rgba8Unorm, TextureUsages::RENDER_ATTACHMENT);
    let mut recorder = Recorder::new(&gpu, false);
    let texture = pool.lend(&gpu, "lent", Life::Frame, options);
    let raw = texture.raw().clone();
    let mut frame = recorder.begin();
    let color = [chiaro_gpu::Attachment {
        texture: &texture,
        layer: 0,
        clear: Some(chiaro_gpu::wgpu::Color::WHITE),
        resolve: None,
    }];
    frame.render("test/draw", chiaro_gpu::Targets { color: &color, depth: None }, |_| {});
    frame.submit();
    let names: Vec<_> = recorder.resources().map(|found| found.name.to_string()).collect();
    assert_eq!(names, ["test/lent"]);
    drop(texture);
    assert_eq!(recorder.resources().count(), 0);
    assert!(*pool.lend(&gpu, "again", Life::Frame, options).raw() == raw, "a new texture was made");
}

#[test]
fn what_is_asked_for_by_name_comes_back_and_an_unknown_name_tells_all() {
    let gpu = device();
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let mut settings = ambient();
    settings.set("shadow.resolution", "64").unwrap();
    let mut studio = Studio::new(&gpu, settings);
    let loaded = studio.load(&scene);
    let options = |name: &str| StillOptions {
        size: SIZE,
        samples: 2,
        left: vec![name.into()],
        ..StillOptions::default()
    };
    let error = studio.renderer().still(&loaded, &view, &options("direct/dreams")).unwrap_err().to_string();
    for name in ["direct/dreams", "shadow/shadow_maps", "surface/visibility"] {
        assert!(error.contains(name), "{error}");
    }
    let mut still = studio.renderer().still(&loaded, &view, &options("direct/radiance")).unwrap();
    let Some(chiaro::Left::Sum(sum)) = still.left.pop().map(|left| left.content) else {
        panic!("not summed")
    };
    // Unlike the picture's sum, in stored units.
    let (sum, nits) = (sum.wait(&gpu).unwrap().floats(), still.radiance.wait(&gpu).unwrap().floats());
    for (stored, nits) in sum.iter().zip(&nits).enumerate().filter(|(i, _)| i % 4 < 3).map(|(_, pair)| pair) {
        let expected = nits * loaded.radiance_scale;
        assert!((stored - expected).abs() <= 1e-4 * expected.abs(), "{stored} is not {expected}");
    }
}

#[test]
fn whatever_is_listed_comes_back_from_stills_of_many_frames() {
    let gpu = device();
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let moments = [("shadow.representation", "evsm4"), ("shadow.filter", "gaussian-mip")];
    for changes in [&[("shadow.fit", "depth")][..], &moments, &[("shadow.raster", "compute")]] {
        let mut settings = ambient();
        for (key, value) in [&[("shadow.resolution", "64")], changes].concat() {
            settings.set(key, value).unwrap();
        }
        let mut studio = Studio::new(&gpu, settings);
        let loaded = studio.load(&scene);
        let mut recorder = Recorder::new(&gpu, false);
        let listed = studio.renderer().leaves(&mut recorder, &loaded, &view, SIZE).unwrap();
        let left: Vec<_> = listed.iter().map(|resource| resource.name.to_string()).collect();
        let options = StillOptions { size: SIZE, samples: 3, left: left.clone(), ..StillOptions::default() };
        // In the second still as well, before which all maps rest.
        for _ in 0..2 {
            let still = studio.renderer().still(&loaded, &view, &options).unwrap();
            let names: Vec<_> = still.left.into_iter().map(|left| left.name).collect();
            assert_eq!(names, left, "{changes:?}");
        }
    }
}
