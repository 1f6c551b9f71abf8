//! What conditions say does nothing changes no bit of a picture.

use chiaro_gpu::{Gpu, GpuOptions};
use chiaro_scene::{Light, LightKind, Node, Scene, Transform};
use chiaro_techniques::settings::Kind;
use glam::{Affine3A, Quat, Vec3};

use super::{Settings, with};
use crate::settings::LITERALLY;
use crate::{LoadedScene, Renderer, StillOptions, View};

/// Small maps, so that filters and biases show.
const SIDE: &str = "128";

/// Together they make every condition false once, and true.
const COMBINATIONS: [&[(&str, &str)]; 21] = [
    &[],
    &[("pipeline", "forward"), ("surface.msaa", "1"), ("shadow.transmission_tint", "true")],
    &[("shadow.layout", "none")],
    &[("shadow.layout", "traced")],
    &[("shadow.layout", "traced"), ("shadow.rays", "3"), ("shadow.transmission_tint", "true")],
    &[("shadow.layout", "single"), ("shadow.pcf_kernel", "disc")],
    &[("shadow.splits", "2,4,6"), ("shadow.filter", "none")],
    &[("shadow.filter", "pcss"), ("shadow.point_layout", "paraboloid")],
    &[("shadow.filter", "pcss"), ("shadow.bias.receiver_plane", "false")],
    &[("shadow.darkens", "thesis"), ("shadow.bias.receiver_plane", "false")],
    &[("shadow.representation", "variance"), ("shadow.filter", "gaussian")],
    &[("shadow.representation", "exponential"), ("shadow.filter", "gaussian-mip")],
    &[("shadow.representation", "exponential"), ("shadow.filter", "none"), ("shadow.darkens", "thesis")],
    &[("shadow.representation", "evsm2"), ("shadow.filter", "mip")],
    &[("shadow.representation", "evsm4"), ("shadow.filter", "none"), ("shadow.cascades", "1")],
    &[("shadow.representation", "moments"), ("shadow.filter", "gaussian")],
    &[
        ("indirect.technique", "ism"),
        ("indirect.vpls", "16"),
        ("indirect.rsm_resolution", "64"),
        ("indirect.points", "1024"),
        ("indirect.points_per_vpl", "64"),
        ("indirect.ism_resolution", "32"),
        ("indirect.filter", "discontinuity"),
    ],
    &[
        ("indirect.technique", "rsm"),
        ("indirect.vpls", "16"),
        ("indirect.rsm_resolution", "64"),
        ("indirect.sampling", "importance"),
        ("indirect.interleave", "1"),
        ("indirect.compensate", "true"),
        ("indirect.clusters", "4"),
    ],
    &[
        ("indirect.technique", "rsm"),
        ("indirect.vpls", "16"),
        ("indirect.rsm_resolution", "64"),
        ("indirect.clamp", "0"),
    ],
    &[("caustics.technique", "photon_trace"), ("caustics.photons", "1024")],
    &[("caustics.technique", "photon_trace"), ("caustics.photons", "1024"), ("caustics.filter", "none")],
];

/// A sun, a point and a spot light.
fn scene() -> (Scene, View) {
    let mut scene = chiaro_scene::load("builtin:cornell").unwrap();
    let lights =
        [(LightKind::Directional, 2.0, Vec3::ZERO), (LightKind::Point, 0.5, Vec3::new(0.1, 0.6, 0.1))];
    for (kind, intensity, at) in lights {
        let light = Light { name: String::new(), kind, color: Vec3::ONE, intensity, range_m: None };
        scene.lights.push(light);
        let turn = Quat::from_rotation_arc(Vec3::NEG_Z, Vec3::new(0.2, -0.5, -1.0).normalize());
        scene.nodes.push(Node {
            light: Some(scene.lights.len() - 1),
            parent_from_node: Transform::Matrix(Affine3A::from_rotation_translation(turn, at)),
            ..Node::default()
        });
    }
    scene.add_default_view();
    let view = View::from_scene(&scene, 0).unwrap();
    (scene, view)
}

/// A value as far from this one as there is.
fn another(kind: &Kind, value: &str) -> String {
    let far = |low: f32, high: f32| {
        let is_low = value.parse::<f32>().is_ok_and(|value| value - low > high - value);
        if is_low { low.to_string() } else { high.to_string() }
    };
    match kind {
        Kind::Switch => (value != "true").to_string(),
        Kind::Choice(names) => {
            let other = names.iter().rev().find(|(name, _)| *name != value);
            other.map_or(value, |(name, _)| name).to_owned()
        }
        Kind::Whole(low, high) => far(*low as f32, *high as f32),
        Kind::Number(low, high) | Kind::WordOrNumber(_, low, high) => far(*low, *high),
        Kind::WordOrList(..) => "1,2,3".to_owned(),
    }
}

/// What changes all that does nothing, in as few changes as go together.
fn changes(base: &Settings) -> Vec<Vec<&'static str>> {
    let idle = Settings::fields().iter().filter(|field| base.idle(&field.key).is_some());
    let mut left: Vec<_> = idle.map(|field| field.key.as_str()).collect();
    let mut all = Vec::new();
    while !left.is_empty() {
        let mut together = Vec::new();
        left.retain(|key| {
            let fits = changed(base, &[&together[..], &[*key]].concat()).shadow.refused().is_none();
            together.extend(fits.then_some(*key));
            !fits
        });
        assert!(!together.is_empty(), "{left:?} go with nothing");
        all.push(together);
    }
    all
}

fn changed(base: &Settings, keys: &[&str]) -> Settings {
    let mut settings = base.clone();
    for field in Settings::fields().iter().filter(|field| keys.contains(&field.key.as_str())) {
        let value = another(&field.kind, &base.get(&field.key).unwrap());
        settings.set(&field.key, &value).unwrap();
        assert_ne!(settings.get(&field.key), base.get(&field.key), "{}", field.key);
    }
    settings
}

fn combinations() -> impl Iterator<Item = Settings> {
    // Indirect light as it is by default takes a second a frame without a GPU.
    let cheap = [("shadow.resolution", SIDE), ("indirect.technique", "ambient")];
    COMBINATIONS.into_iter().map(move |combination| with(&[&cheap, combination].concat()))
}

#[test]
fn every_condition_is_false_in_one_of_the_combinations_and_true_in_another() {
    for field in Settings::fields().iter().filter(|field| field.only.is_some()) {
        let idle: Vec<_> = combinations().map(|settings| settings.idle(&field.key).is_some()).collect();
        assert!(idle.contains(&true) && idle.contains(&false), "{}", field.key);
    }
}

#[test]
fn what_does_nothing_reaches_no_plan() {
    for base in combinations() {
        for keys in changes(&base) {
            assert_eq!(changed(&base, &keys).effective(), base.effective(), "{keys:?}");
        }
    }
}

fn picture(
    renderer: &mut Renderer,
    settings: &Settings,
    (scene, loaded): (&Scene, &mut LoadedScene),
    view: &View,
) -> Vec<u8> {
    renderer.set(settings.clone()).unwrap();
    renderer.equip(scene, loaded).unwrap();
    let options = StillOptions { size: [48, 36], samples: 1, ..StillOptions::default() };
    let still = renderer.still(loaded, view, &options).unwrap();
    still.radiance.wait(renderer.gpu()).unwrap().bytes
}

#[test]
fn what_does_nothing_changes_no_bit_of_a_picture_even_where_it_is_handed_on() {
    let gpu = pollster::block_on(Gpu::new(GpuOptions::default())).unwrap();
    let (scene, view) = scene();
    let (mut renderer, mut loaded) =
        Renderer::with_scene(&gpu, combinations().next().unwrap(), &scene).unwrap();
    LITERALLY.set(true);
    let mut wrong = Vec::new();
    for base in combinations() {
        let expected = picture(&mut renderer, &base, (&scene, &mut loaded), &view);
        for keys in changes(&base) {
            if picture(&mut renderer, &changed(&base, &keys), (&scene, &mut loaded), &view) == expected {
                continue;
            }
            for key in keys {
                if picture(&mut renderer, &changed(&base, &[key]), (&scene, &mut loaded), &view) != expected {
                    wrong.push(format!("{key} beside {}", base.idle(key).unwrap()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "these matter: {wrong:#?}");
}
