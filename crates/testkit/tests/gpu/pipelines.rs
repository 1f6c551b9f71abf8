//! Pipelines, runs and devices against each other.

use chiaro::scene;
use chiaro::techniques::scene::SceneFacts;
use chiaro::{Aov, Gpu, Pipeline, Recorder, Renderer, Settings, StillOptions, View};
use chiaro_image::Image;
use chiaro_testkit::{
    Stage, Studio, ambient, camera_above, device, device_guaranteed, device_of_its_own, direct, nmae,
};
use glam::Vec2;

const SIZE: [u32; 2] = [96, 64];

fn settings(pipeline: Pipeline, msaa: &str) -> Settings {
    let mut settings = Settings { pipeline, ..ambient() };
    settings.set("surface.msaa", msaa).unwrap();
    settings.set("shadow.resolution", "512").unwrap();
    settings
}

fn picture(gpu: &Gpu, name: &str, settings: Settings, samples: u32) -> Image {
    let mut scene = scene::load(name).unwrap();
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    let mut studio = Studio::new(gpu, settings);
    let loaded = studio.load(&scene);
    studio.radiance(&loaded, &view, SIZE, samples)
}

fn assert_pipelines_agree(name: &str) {
    let gpu = device();
    let deferred = picture(&gpu, name, settings(Pipeline::Deferred, "1"), 16);
    let forward = picture(&gpu, name, settings(Pipeline::Forward, "1"), 16);
    let distance = nmae(&forward, &deferred);
    // The surface buffer's bits: 10 of √ colour, 8 of log roughness, 16 of each normal's coordinates.
    assert!(distance < 0.005, "{name}: {distance}");
    assert!(distance > 0.0, "{name}: the two pipelines cannot be equal to the bit; was one rendered twice?");
}

#[test]
fn forward_and_deferred_show_the_same_cornell_box() {
    assert_pipelines_agree("builtin:cornell");
}

#[test]
fn forward_and_deferred_show_the_same_nave() {
    assert_pipelines_agree("builtin:nave");
}

#[test]
fn multisampling_only_smooths_and_what_the_adapter_lacks_is_refused_by_name() {
    let gpu = device();
    let offered = gpu.sample_counts();
    assert!(offered.starts_with(&[1]) && offered.contains(&4), "{offered:?}");
    let one = picture(&gpu, "builtin:cornell", settings(Pipeline::Forward, "1"), 16);
    for msaa in [2, 4, 8] {
        let settings = settings(Pipeline::Forward, &msaa.to_string());
        if offered.contains(&msaa) {
            let distance = nmae(&picture(&gpu, "builtin:cornell", settings, 16), &one);
            // An edge that 16 jittered samples place to a 16th of a pixel and 64 place better: a fifth of this small
            // picture's pixels hold an edge, which makes about a percent.
            assert!(distance < 0.02, "{msaa}: {distance}");
        } else {
            let refused = Renderer::new(&gpu, settings).unwrap_err().to_string();
            assert!(
                refused.contains(&format!("surface.msaa = {msaa}")) && refused.contains("1, "),
                "{refused}"
            );
        }
    }
}

#[test]
fn guaranteed_webgpu_has_one_and_four_samples() {
    let gpu = device_guaranteed();
    assert_eq!(gpu.sample_counts(), [1, 4]);
    let refused = Renderer::new(&gpu, settings(Pipeline::Forward, "8")).unwrap_err().to_string();
    assert!(refused.ends_with("offers 1, 4"), "{refused}");
}

#[test]
fn samples_per_pixel_neither_refuse_nor_compile_anything_of_the_deferred_pipeline() {
    let gpu = device();
    let renderer = Renderer::new(&gpu, settings(Pipeline::Deferred, "8")).unwrap();
    for msaa in ["1", "2", "4"] {
        let plan = renderer.plan(settings(Pipeline::Deferred, msaa), SceneFacts::default()).unwrap();
        assert!(plan.is_empty(), "{msaa}");
    }
}

#[test]
fn the_same_settings_give_the_same_bits() {
    let gpu = device();
    for pipeline in [Pipeline::Deferred, Pipeline::Forward] {
        let [a, b] = [0, 1].map(|_| picture(&gpu, "builtin:cornell", settings(pipeline, "4"), 3));
        assert!(a == b, "{pipeline:?}: two runs differ by {}", nmae(&a, &b));
    }
}

#[test]
fn a_second_still_compiles_nothing() {
    let gpu = device_of_its_own();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "64")]));
    let stage = Stage::floor(0.5);
    let loaded = studio.load(&stage.scene);
    let still = |studio: &mut Studio, aovs: Vec<Aov>| {
        let before = gpu.created.pipelines();
        let options = StillOptions { size: [8; 2], samples: 1, aovs, ..StillOptions::default() };
        let still = studio.renderer().still(&loaded, &camera_above(1.0), &options).unwrap();
        (gpu.created.pipelines() - before, still.picture.wait(&gpu).unwrap().bytes)
    };
    let (first, picture) = still(&mut studio, vec![Aov::Albedo]);
    assert!(first > 0);
    let other = vec![Aov::Normal];
    for aovs in [other.clone(), Vec::new(), other] {
        assert_eq!(still(&mut studio, aovs), (0, picture.clone()));
    }
    assert_eq!(still(&mut studio, vec![Aov::Normal, Aov::Depth]).1, picture);
}

fn assert_guaranteed_is_enough(name: &str, pipeline: Pipeline, msaa: &str) {
    let (full, guaranteed) = (device(), device_guaranteed());
    assert!(!guaranteed.optional.primitive_index && !guaranteed.optional.depth_clip_control);
    let reference = picture(&full, name, settings(pipeline, msaa), 4);
    let distance = nmae(&picture(&guaranteed, name, settings(pipeline, msaa), 4), &reference);
    // Shared vertices or not, clamped depth or not: the same triangles, so only rounding may differ.
    assert!(distance <= 1e-3, "{name} {pipeline:?}: {distance}");
}

#[test]
fn guaranteed_webgpu_is_enough_for_the_cornell_box() {
    assert_guaranteed_is_enough("builtin:cornell", Pipeline::Deferred, "1");
    assert_guaranteed_is_enough("builtin:cornell", Pipeline::Forward, "4");
}

#[test]
fn guaranteed_webgpu_is_enough_for_the_nave() {
    assert_guaranteed_is_enough("builtin:nave", Pipeline::Deferred, "1");
}

#[test]
fn a_steady_frame_allocates_nothing() {
    let gpu = device_of_its_own();
    let mut scene = scene::load("builtin:cornell").unwrap();
    scene.add_default_view();
    let mut view = View::from_scene(&scene, 0).unwrap();
    for (pipeline, msaa) in [(Pipeline::Deferred, "1"), (Pipeline::Forward, "4")] {
        let mut studio = Studio::new(&gpu, settings(pipeline, msaa));
        let loaded = studio.load(&scene);
        let mut state = chiaro::ViewState::new(studio.renderer());
        let mut recorder = Recorder::new(&gpu, false);
        let mut steady = None;
        for index in 0..40 {
            // The camera moves, as it does where frames follow each other.
            view.world_from_camera.w_axis.x += 0.01;
            let prepared =
                studio.renderer().prepare(&mut state, &loaded, &view, SIZE, (Vec2::ZERO, 1.0)).unwrap();
            let mut frame = recorder.begin();
            let _ = prepared.record(&mut frame, false);
            frame.submit();
            // Waiting hands staging memory back, as frames that are presented do in time.
            recorder.wait().unwrap();
            let hal = gpu.device.get_internal_counters().hal;
            let found = [
                gpu.created.total() as isize,
                hal.buffer_memory.read(),
                hal.texture_memory.read(),
                hal.buffers.read(),
                hal.texture_views.read(),
                hal.bind_groups.read(),
                hal.render_pipelines.read() + hal.compute_pipelines.read(),
            ];
            if index == 3 {
                assert!(found.iter().all(|&count| count > 0), "counters are off: {found:?}");
                steady = Some(found);
            } else if let Some(steady) = steady {
                assert_eq!(found, steady, "{pipeline:?}, frame {index}");
            }
        }
    }
}
