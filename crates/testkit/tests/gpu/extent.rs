//! However large a scene is, and however far from its file's origin, it looks the same.

use std::f32::consts::PI;

use chiaro::scene::{LightKind, Mesh, Node, Primitive, Scene};
use chiaro::{Lookout, Pipeline, ReferenceOptions, Settings, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, Truth, device, direct, nmae};
use glam::{Affine3A, DVec3, Vec3};

const SIZE: [u32; 2] = [64, 48];

/// A floor of 10 m with two boxes under a light.
fn boxes(light: LightKind) -> Stage {
    let mut stage = Stage::new();
    let (white, red) = (stage.lambert(0.8), stage.lambert(0.3));
    stage.quad(Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0, white);
    stage.cuboid(Vec3::Y * 0.5, Vec3::splat(0.5), red);
    stage.cuboid(Vec3::new(1.4, 0.2, 0.6), Vec3::new(0.1, 0.2, 0.3), red);
    let at = Vec3::new(1.0, 2.6, 0.9);
    let intensity = if light == LightKind::Directional { PI } else { 20.0 };
    stage.light(
        light,
        intensity,
        None,
        at,
        if light == LightKind::Directional { Vec3::new(-0.9, -1.0, 0.3) } else { -at },
    );
    stage
}

const LOOKOUT: Lookout =
    Lookout { eye_m: DVec3::new(3.0, 3.0, 4.0), target_m: DVec3::new(0.0, 0.3, 0.0), yfov_rad: 0.7 };

const LIGHTS: [LightKind; 3] =
    [LightKind::Directional, LightKind::Point, LightKind::Spot { inner_rad: 0.5, outer_rad: 0.8 }];

/// Everything under a node that moves and scales it.
fn under(stage: Stage, offset: DVec3, scale: f32) -> Scene {
    let mut scene = stage.scene;
    for node in &mut scene.nodes {
        node.parent = Some(node.parent.map_or(0, |parent| parent + 1));
    }
    let parent_from_node = chiaro::scene::Transform::Matrix(Affine3A::from_scale(Vec3::splat(scale)));
    scene.nodes.insert(0, Node { parent_from_node, offset, ..Node::default() });
    for light in scene.lights.iter_mut().filter(|light| light.kind != LightKind::Directional) {
        light.intensity *= scale * scale;
    }
    scene
}

/// The same lookout, moved and scaled.
fn seen(offset: DVec3, scale: f32) -> Lookout {
    let place = |p: DVec3| offset + p * f64::from(scale);
    Lookout { eye_m: place(LOOKOUT.eye_m), target_m: place(LOOKOUT.target_m), ..LOOKOUT }
}

fn rendered(studio: &mut Studio, scene: &mut Scene, lookout: Lookout) -> Image {
    scene.settle(Some(lookout.eye_m));
    let loaded = studio.load(scene);
    studio.radiance(&loaded, &lookout.view(scene), SIZE, 4)
}

fn traced(scene: &mut Scene, lookout: Lookout, samples: u32) -> Image {
    scene.settle(Some(lookout.eye_m));
    let options = ReferenceOptions { max_depth: 3, ..ReferenceOptions::default() };
    let view = lookout.view(scene);
    Truth::new(&device(), direct(&[]), scene, (&view, SIZE), options).add(&[samples])
}

/// Asserts that scenes under all lights and through both pipelines look as they do at the origin in metres.
fn assert_same(places: &[(DVec3, f32)]) {
    for pipeline in [Pipeline::Forward, Pipeline::Deferred] {
        let mut studio = Studio::new(&device(), Settings { pipeline, ..direct(&[]) });
        for light in LIGHTS {
            let right = rendered(&mut studio, &mut boxes(light).scene, LOOKOUT);
            for &(offset, scale) in places {
                let found =
                    rendered(&mut studio, &mut under(boxes(light), offset, scale), seen(offset, scale));
                let error = nmae(&found, &right);
                assert!(error < 2e-3, "{pipeline:?}, {light:?}, ×{scale} at {offset}: {error}");
            }
        }
    }
}

/// Where a scene of metres has no coordinate that `f32` holds to a millimetre.
const FAR: [DVec3; 2] = [DVec3::new(10_000.3, 12.7, -9_999.9), DVec3::new(-70_000.3, 3_000.1, 70_000.7)];

#[test]
fn a_scene_far_from_the_origin_looks_as_it_does_there() {
    assert_same(&FAR.map(|offset| (offset, 1.0)));
}

#[test]
fn scenes_of_a_millimetre_and_of_ten_thousand_kilometres_look_the_same() {
    assert_same(&[1e-3, 1e7].map(|scale| (DVec3::ZERO, scale)));
}

#[test]
fn traced_pictures_of_far_small_and_large_scenes_are_those_of_the_scene_at_the_origin() {
    for light in [LIGHTS[0], LIGHTS[2]] {
        let right = traced(&mut boxes(light).scene, LOOKOUT, 16);
        for (offset, scale) in [(FAR[1], 1.0), (DVec3::ZERO, 1e-3), (DVec3::ZERO, 1e7)] {
            let found = traced(&mut under(boxes(light), offset, scale), seen(offset, scale), 16);
            let error = nmae(&found, &right);
            assert!(error < 5e-3, "{light:?}, ×{scale} at {offset}: {error}");
        }
    }
}

#[test]
fn an_origin_that_moves_between_frames_changes_nothing() {
    let far = DVec3::new(40_000.0, 0.0, -25_000.0);
    let mut scene = under(boxes(LIGHTS[0]), far, 1.0);
    let mut studio = Studio::new(&device(), direct(&[]));
    let right = rendered(&mut studio, &mut scene.clone(), seen(far, 1.0));
    // Loaded as it lies in its file, where nothing is exact.
    let mut loaded = studio.load(&scene);
    let view = seen(far, 1.0).view(&scene);
    let coarse = studio.radiance(&loaded, &view, SIZE, 4);
    assert!(nmae(&coarse, &right) > 2e-3, "the file's own coordinates would do");
    assert!(scene.settle(Some(seen(far, 1.0).eye_m)));
    loaded.set_pose(&scene, &scene.pose(0.0)).unwrap();
    let found = studio.radiance(&loaded, &seen(far, 1.0).view(&scene), SIZE, 4);
    assert!(nmae(&found, &right) < 1e-6, "{}", nmae(&found, &right));
}

/// A box of 2 m height around the origin, in one piece.
fn slab_of(half: f32, material: usize) -> Mesh {
    let mut sides = Stage::new();
    sides.cuboid(Vec3::ZERO, Vec3::new(half, 1.0, half), material);
    let mut whole = Primitive { material, ..Primitive::default() };
    for side in sides.scene.meshes.into_iter().flat_map(|mesh| mesh.primitives) {
        let first = whole.positions.len() as u32;
        whole.indices.extend(side.indices.iter().map(|index| first + index));
        whole.positions.extend(side.positions);
        whole.normals.extend(side.normals);
        whole.uvs[0].extend(&side.uvs[0]);
    }
    Mesh { primitives: vec![whole], ..Mesh::default() }
}

/// The boxes on ground of so many metres, a flat one or a slab.
fn on_ground(side_m: f32, slab: bool) -> Stage {
    let mut stage = boxes(LightKind::Directional);
    let ground = stage.lambert(0.4);
    let half = 0.5 * side_m;
    if slab {
        stage.place(slab_of(half, ground), Affine3A::from_translation(Vec3::NEG_Y * 1.01));
    } else {
        stage.quad(Vec3::NEG_Y * 0.01, Vec3::X * half, Vec3::NEG_Z * half, ground);
    }
    stage
}

#[test]
fn a_box_keeps_its_shadow_on_ground_of_any_size() {
    let options = ReferenceOptions { max_depth: 2, ..ReferenceOptions::default() };
    let stage = on_ground(300.0, false);
    let view = LOOKOUT.view(&stage.scene);
    // No picture shows the ground's end.
    let right = Truth::new(&device(), direct(&[]), &stage.scene, (&view, SIZE), options).add(&[64]);
    let mut studio = Studio::new(&device(), direct(&[]));
    for (side_m, slab) in [300.0, 3e3, 1e5].map(|side| [(side, false), (side, true)]).into_iter().flatten() {
        let loaded = studio.load(&on_ground(side_m, slab).scene);
        let error = nmae(&studio.radiance(&loaded, &view, SIZE, 16), &right);
        assert!(error < 6e-3, "{side_m} m, slab {slab}: {error}");
    }
}

/// A box of 1 m.
fn crate_at(stage: &mut Stage, at: Vec3) {
    let material = stage.lambert(0.5);
    stage.cuboid(at, Vec3::splat(0.5), material);
}

#[test]
fn a_box_far_away_leaves_the_shadows_of_all_else_as_they_are() {
    let mut studio = Studio::new(&device(), direct(&[]));
    for light in LIGHTS {
        let stage = boxes(light);
        let view = LOOKOUT.view(&stage.scene);
        let loaded = studio.load(&stage.scene);
        let right = studio.radiance(&loaded, &view, SIZE, 4);
        for far_m in [2e4, 1e9] {
            let mut stage = stage.clone();
            crate_at(&mut stage, Vec3::new(far_m, 2.0, -far_m));
            let loaded = studio.load(&stage.scene);
            let error = nmae(&studio.radiance(&loaded, &view, SIZE, 4), &right);
            assert!(error < 2e-3, "{light:?}, {far_m} m: {error}");
        }
    }
}

#[test]
fn a_pose_that_throws_a_box_far_away_spoils_nothing_there_and_nothing_once_it_is_back() {
    let bare = boxes(LightKind::Directional);
    let view = LOOKOUT.view(&bare.scene);
    let mut stage = bare.clone();
    let first = stage.scene.nodes.len();
    crate_at(&mut stage, Vec3::new(-1.5, 0.5, 1.0));
    let mut studio = Studio::new(&device(), direct(&[]));
    let without = studio.load(&bare.scene);
    let mut loaded = studio.load(&stage.scene);
    let mut look = |loaded: &chiaro::LoadedScene| studio.radiance(loaded, &view, SIZE, 4);
    let (without, with) = (look(&without), look(&loaded));
    assert!(nmae(&without, &with) > 0.01, "the box is not seen");
    for far_m in [2e4, 1e12] {
        let mut pose = stage.scene.rest();
        for node in first..stage.scene.nodes.len() {
            let there = Affine3A::from_translation(Vec3::new(far_m, 0.0, -far_m));
            pose.set_world(&stage.scene, node, there * pose.world_from_node[node]);
        }
        loaded.set_pose(&stage.scene, &pose).unwrap();
        let error = nmae(&look(&loaded), &without);
        assert!(error < 2e-3, "at {far_m} m: {error}");
        loaded.set_pose(&stage.scene, &stage.scene.rest()).unwrap();
        let error = nmae(&look(&loaded), &with);
        assert!(error < 2e-3, "back from {far_m} m: {error}");
    }
}

#[test]
fn a_lamp_low_over_a_ground_of_kilometres_is_as_bright_as_its_formula_says() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.layout", "none")]));
    let mut brightest = |half: f32, intensity: f32| {
        let mut stage = Stage::new();
        let white = stage.lambert(0.8);
        stage.quad(Vec3::ZERO, Vec3::X * half, Vec3::NEG_Z * half, white);
        stage.light(LightKind::Point, intensity, None, Vec3::Y * 0.4, Vec3::NEG_Y);
        let scene = studio.load(&stage.scene);
        let image =
            studio.radiance(&scene, &View::look_at(Vec3::new(0.0, 1.0, 1.0), Vec3::ZERO, 0.5, 0.05), SIZE, 1);
        image.pixels().iter().map(|pixel| pixel[1]).fold(0.0, f32::max)
    };
    for half in [2.0, 2500.0] {
        for intensity in [10.0, 1e5] {
            let expected = 0.8 / PI * intensity / 0.16;
            let found = brightest(half, intensity);
            assert!((found / expected - 1.0).abs() < 0.01, "{half} m: {found}, not {expected} nits");
        }
    }
}
