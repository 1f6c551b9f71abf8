//! What shines itself as virtual lights: what glowing meshes send out, and what they and surroundings give a floor, against
//! formulas; and that all of it rests while the scene does.

use std::f32::consts::PI;

use chiaro::scene::{AlphaMode, Environment, Filter, Material, Scene, Wrap};
use chiaro::{Aov, Left, Recorder, Sampling, StillOptions, View, ViewState};
use chiaro_gpu::BufferReadback;
use chiaro_techniques::indirect::{SETS, SOURCES, Vpl};
use chiaro_testkit::{Stage, Studio, camera_above, device, direct, place_below};
use glam::{Vec3, Vec4};

const SIDE: u32 = 32;
const ALBEDO: f32 = 0.5;

fn studio(changes: &[(&str, &str)]) -> Studio {
    let few = [
        ("indirect.technique", "ism"),
        ("indirect.vpls", "64"),
        ("indirect.rsm_resolution", "64"),
        ("indirect.points", "65536"),
        ("indirect.points_per_vpl", "2000"),
        ("indirect.ism_resolution", "64"),
    ];
    Studio::new(&device(), direct(&[&few, changes].concat()))
}

/// A floor, and over it a pane of 1 m² that shines down.
fn pane(material: Material) -> Stage {
    let mut stage = Stage::floor(ALBEDO);
    let glowing = stage.material(material);
    stage.quad(Vec3::Y * 1.5, Vec3::X * 0.5, Vec3::Z * 0.5, glowing);
    stage
}

fn glowing() -> Material {
    Material {
        emissive: Vec3::new(100.0, 50.0, 20.0),
        base_color: Vec4::W,
        specular: 0.0,
        ..Material::default()
    }
}

/// Half of a picture of 2 × 2 texels is white, half black and transparent.
fn half_white(stage: &mut Stage) -> chiaro::scene::TextureRef {
    let rgba = [[255; 4], [255; 4], [0; 4], [0; 4]].concat();
    stage.texture(2, [Wrap::Clamp; 2], Filter::Nearest, rgba)
}

#[test]
fn glowing_meshes_send_out_what_their_textures_masks_and_sides_say() {
    let plain = pane(glowing());
    let both = pane(Material { double_sided: true, ..glowing() });
    let mut textured = pane(glowing());
    let texture = half_white(&mut textured);
    textured.scene.materials.last_mut().unwrap().emissive_texture = Some(texture);
    let mut masked = pane(glowing());
    let texture = half_white(&mut masked);
    let material = masked.scene.materials.last_mut().unwrap();
    material.base_color_texture = Some(texture);
    material.alpha = AlphaMode::Mask { cutoff: 0.5 };
    let mut studio = studio(&[]);
    for (name, stage, shares) in [
        ("plain", plain, 1.0),
        ("both sides", both, 2.0),
        ("textured", textured, 0.5),
        ("masked", masked, 0.5),
    ] {
        let scene = studio.load(&stage.scene);
        let left = ["vpls", "vpl_count"].map(|name| format!("indirect/{name}")).to_vec();
        let options = StillOptions { size: [16; 2], samples: 1, left, ..StillOptions::default() };
        let still = studio.renderer().still(&scene, &camera_above(4.0), &options).unwrap();
        let gpu = device();
        let mut left = still.left.into_iter().map(|left| match left.content {
            Left::Buffer(buffer) => buffer.wait(&gpu).unwrap(),
            _ => panic!("no buffer"),
        });
        let vpls: Vec<Vpl> = bytemuck::pod_collect_to_vec(&left.next().unwrap());
        let counts: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&left.next().unwrap());
        assert_eq!(counts.len(), SETS as usize);
        let [count, _, first, _] = counts[SOURCES as usize];
        let own = &vpls[first as usize..][..count as usize];
        let found: Vec3 = own.iter().map(|vpl| Vec3::from(vpl.flux)).sum();
        let expected = PI * shares * Vec3::new(100.0, 50.0, 20.0);
        assert!(
            ((found - expected) / expected).abs().max_element() < 0.03,
            "{name}: {found} lm, not {expected}"
        );
        let down = own.iter().filter(|vpl| vpl.normal_ws().y < 0.0).count();
        let all_down = if name == "both sides" { count / 2 } else { count };
        assert!(down.abs_diff(all_down as usize) < 24, "{name}: {down} of {count} shine down");
    }
}

#[test]
fn a_glowing_pane_lights_a_floor_as_its_form_factor_says_and_a_block_shadows_it() {
    let mut stage = pane(glowing());
    let black = stage.material(Material { base_color: Vec4::W, specular: 0.0, ..Material::default() });
    stage.cuboid(Vec3::new(-1.6, 0.4, 0.0), Vec3::new(0.1, 0.4, 2.0), black);
    // Each place by all of them: what is filtered is smoothed over neighbours half a metre off.
    let mut studio = studio(&[("indirect.interleave", "1")]);
    let scene = studio.load(&stage.scene);
    let light = studio.aov(&scene, &camera_above(4.0), [SIDE; 2], 8, Aov::Direct);
    // Off a floor's place, of red.
    let expected = |at: Vec3| -> f32 {
        let cells = (0..24).flat_map(|i| (0..24).map(move |j| [i, j].map(|k| (k as f32 + 0.5) / 24.0 - 0.5)));
        let given = cells.map(|[x, z]| {
            let to = Vec3::new(x, 1.5, z) - at;
            (to.y / to.length()).powi(2) / to.length_squared() / 576.0
        });
        100.0 * ALBEDO / PI * given.sum::<f32>()
    };
    let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| [x, y]));
    let (mut found, mut open, mut shadow, mut kept_off) = (0.0, 0.0, 0.0, 0.0);
    for [x, y] in pixels {
        let at = place_below([x, y], SIDE, 4.0);
        let seen = light.pixel(x, y)[0];
        if at.x > 0.7 {
            (found, open) = (found + seen, open + expected(at));
        } else if at.x < -1.9 && at.x > -2.3 && at.z.abs() < 0.8 {
            (shadow, kept_off) = (shadow + seen, kept_off + expected(at));
        }
    }
    assert!((found / open - 1.0).abs() < 0.03, "{} of the light", found / open);
    assert!(shadow < 0.05 * kept_off && kept_off > 0.0, "{shadow} of {kept_off} in the block's shadow");
}

/// A floor in the open under an even sky, a roofed and walled corner of it.
fn under_a_sky() -> Stage {
    let mut stage = Stage::floor(ALBEDO);
    let radiance = vec![Vec3::splat(3.0); 32 * 16];
    stage.scene.environment = Some(Environment { name: "even".into(), width: 32, height: 16, radiance });
    let black = stage.material(Material { base_color: Vec4::W, specular: 0.0, ..Material::default() });
    let at = Vec3::new(-2.0, 0.0, 0.0);
    stage.cuboid(at + Vec3::Y * 1.1, Vec3::new(1.2, 0.1, 1.2), black);
    for side in [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z] {
        let half = Vec3::new(1.2, 0.6, 1.2) - side.abs() * 1.1;
        stage.cuboid(at + 1.1 * side + Vec3::Y * 0.5, half, black);
    }
    stage
}

#[test]
fn an_even_sky_lights_the_open_floor_evenly_and_what_is_shut_in_not_at_all() {
    let stage = under_a_sky();
    let mut studio = studio(&[("indirect.sources", "256")]);
    let scene = studio.load(&stage.scene);
    let open = studio.aov(&scene, &camera_above(4.0), [SIDE; 2], 4, Aov::Direct);
    let far = (0..SIDE).flat_map(|y| (26..SIDE).map(move |x| [x, y]));
    let sum: f32 = far.map(|[x, y]| open.pixel(x, y)[0]).sum();
    let mean = sum / (6 * SIDE) as f32;
    assert!((mean / (3.0 * ALBEDO) - 1.0).abs() < 0.03, "{mean} nits in the open");
    let inside = View::look_at(Vec3::new(-2.0, 0.9, 0.0), Vec3::new(-2.0, 0.0, 0.01), 0.9, 0.01);
    let dark = studio.aov(&scene, &inside, [SIDE; 2], 4, Aov::Direct);
    let mean = dark.pixels().iter().map(|pixel| pixel[0]).sum::<f32>() / (SIDE * SIDE) as f32;
    assert!(mean < 0.02 * 3.0 * ALBEDO, "{mean} nits inside");
}

/// Frames of a moving picture: how many placed virtual lights on what shines, and what lies in a buffer afterwards.
struct Film {
    studio: Studio,
    scene: chiaro::LoadedScene,
    state: ViewState,
    recorder: Recorder,
}

impl Film {
    fn new(scene: &Scene) -> Self {
        let mut studio = studio(&[]);
        let scene = studio.load(scene);
        let state = ViewState::new(studio.renderer());
        Self { studio, scene, state, recorder: Recorder::new(&device(), false) }
    }

    fn frame(&mut self) -> (usize, Vec<u8>) {
        let Self { studio, scene, state, recorder } = self;
        let view = camera_above(4.0);
        let prepared = studio.renderer().prepare(state, scene, &view, [SIDE; 2], Sampling::Moving).unwrap();
        let mut frame = recorder.begin();
        prepared.record(&mut frame, true);
        let found = ["indirect/vpls", "indirect/ism_atlas"]
            .map(|name| frame.resources().find(|resource| resource.name.to_string() == name).unwrap().handle);
        frame.submit();
        let gpu = device();
        let bytes = found.map(|handle| match handle {
            chiaro::Handle::Buffer(buffer) => BufferReadback::start(&gpu, &buffer).wait(&gpu).unwrap(),
            chiaro::Handle::Texture(_) => panic!("no buffer"),
        });
        (recorder.log().iter().filter(|pass| pass.name == "indirect/sources").count(), bytes.concat())
    }
}

#[test]
fn what_shines_rests_with_the_scene_and_is_made_again_where_anything_changes() {
    let scene = under_a_sky().scene;
    let mut film = Film::new(&scene);
    let (made, first) = film.frame();
    assert_eq!(made, 1);
    for _ in 0..2 {
        assert!(film.frame() == (0, first.clone()), "a frame at rest has other lights or maps");
    }
    let turned = {
        let mut settings = film.studio.settings().clone();
        settings.set("environment.rotation", "70").unwrap();
        settings
    };
    film.studio.set(turned);
    let (made, after) = film.frame();
    assert!(made == 1 && after != first, "{made}");
    assert_eq!(film.frame().0, 0);
    // Passes that are compiled anew need not make the same.
    film.studio = studio(&[("environment.rotation", "70")]);
    film.studio.renderer().equip(&scene, &mut film.scene).unwrap();
    assert_eq!(film.frame().0, 1);
    assert_eq!(film.frame().0, 0);
    // A pose in which nothing stands elsewhere.
    film.scene.set_pose(&scene, &scene.pose(0.0)).unwrap();
    assert_eq!(film.frame(), (0, after.clone()));
    let mut elsewhere = scene.clone();
    let lifted = glam::Affine3A::from_translation(Vec3::Y);
    elsewhere.nodes[1].parent_from_node = chiaro::scene::Transform::Matrix(lifted);
    film.scene.set_pose(&elsewhere, &elsewhere.pose(0.0)).unwrap();
    let (made, moved) = film.frame();
    assert!(made == 1 && moved != after, "{made}");
}
