//! Shadows by rays against rays on the CPU, formulas, and maps.

use std::f32::consts::PI;

use chiaro::scene::{AlphaMode, Filter, LightKind, Material, Wrap};
use chiaro::{Error, Renderer, Settings, StillOptions};
use chiaro_testkit::{Exact, Stage, Studio, camera_above, device, direct, nmae, place_below};
use glam::{Affine3A, Mat4, Quat, Vec3};

const SIDE: u32 = 96;
const HALF: f32 = 1.5;
const PIPELINES: [&str; 2] = ["deferred", "forward"];

fn traced(changes: &[(&str, &str)]) -> Settings {
    direct(&[&[("shadow.layout", "traced"), ("surface.msaa", "1")], changes].concat())
}

/// A floor, and over it a leaning quad and a box that stands on it.
fn room() -> Stage {
    let mut stage = Stage::floor(1.0);
    let material = stage.lambert(1.0);
    stage.quad(Vec3::new(0.1, 0.7, -0.2), Vec3::new(0.3, 0.1, 0.0), Vec3::new(0.0, 0.0, -0.4), material);
    stage.cuboid(Vec3::new(-0.5, 0.15, 0.4), Vec3::new(0.2, 0.15, 0.1), material);
    stage
}

/// The picture from above against the CPU's rays: pixels that differ by more than `tolerance` of the brightest.
fn wrong(
    image: &chiaro_image::Image,
    exact: &Exact,
    (light_size, rays): (f32, u32),
    tolerance: f32,
) -> usize {
    let expected: Vec<_> = (0..SIDE * SIDE)
        .map(|i| {
            let above = place_below([i % SIDE, i / SIDE], SIDE, HALF) + Vec3::Y * 2.0;
            let hit = exact.nearest(above, Vec3::NEG_Y).unwrap();
            exact.irradiance(hit, light_size, rays)[0] / PI
        })
        .collect();
    let brightest = expected.iter().copied().fold(0.0, f32::max);
    assert!(brightest > 0.0 && expected.contains(&0.0), "there is light and shadow");
    let found = image.pixels().iter().map(|pixel| pixel[0]);
    found.zip(expected).filter(|(found, expected)| (found - expected).abs() > tolerance * brightest).count()
}

/// One light of each kind.
fn lights() -> Vec<(&'static str, Stage)> {
    let sun = |stage: &mut Stage| stage.sun(3.0, Vec3::new(0.5, -1.0, 0.2).normalize());
    let from = Vec3::new(0.6, 1.9, 0.5);
    let spot = |stage: &mut Stage| {
        let kind = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.8 };
        stage.light(kind, 3.0, None, from, Vec3::new(-0.3, -1.0, -0.3).normalize());
    };
    let point = |stage: &mut Stage| stage.light(LightKind::Point, 3.0, None, from, Vec3::NEG_Y);
    let with = |add: &dyn Fn(&mut Stage)| {
        let mut stage = room();
        add(&mut stage);
        stage
    };
    vec![("sun", with(&sun)), ("spot", with(&spot)), ("point", with(&point))]
}

#[test]
fn every_pixel_is_lit_where_the_cpus_rays_are_free() {
    for pipeline in PIPELINES {
        let mut studio = Studio::new(&device(), traced(&[("pipeline", pipeline)]));
        for (light, stage) in lights() {
            let scene = studio.load(&stage.scene);
            let image = studio.radiance(&scene, &camera_above(HALF), [SIDE; 2], 1);
            let wrong = wrong(&image, &Exact::new(&stage.scene), (0.0, 1), 0.01);
            // Pixels whose middle lies on an edge may fall to either side.
            assert!(wrong <= 4, "{pipeline}, {light}: {wrong} pixels");
        }
    }
}

#[test]
fn several_rays_make_penumbras_as_wide_as_the_light() {
    let mut studio = Studio::new(&device(), traced(&[("shadow.rays", "64"), ("shadow.light_size", "0.3")]));
    for (light, stage) in lights() {
        let scene = studio.load(&stage.scene);
        let image = studio.radiance(&scene, &camera_above(HALF), [SIDE; 2], 1);
        let wrong = wrong(&image, &Exact::new(&stage.scene), (0.3, 400), 0.08);
        assert!(wrong <= (SIDE * SIDE / 200) as usize, "{light}: {wrong} pixels");
    }
}

#[test]
fn a_plane_is_lit_at_any_slant_and_place() {
    let mut studio = Studio::new(&device(), traced(&[]));
    for away in [0.0, 500.0] {
        for (slant, lean) in [(0.0f32, 0.0f32), (40.0, 0.3), (75.0, 0.9), (89.0, 0.0), (89.9, 0.4)] {
            let (sine, cosine) = slant.to_radians().sin_cos();
            let (tilt, at) = (Quat::from_rotation_z(lean) * Quat::from_rotation_x(0.2), Vec3::X * away);
            let mut stage = Stage::new();
            let material = stage.lambert(1.0);
            stage.quad(at, tilt * Vec3::X * 3.0, tilt * Vec3::NEG_Z * 3.0, material);
            stage.sun(PI / cosine, tilt * Vec3::new(sine, -cosine, 0.0));
            let scene = studio.load(&stage.scene);
            let mut view = camera_above(1.0);
            view.world_from_camera = Mat4::from_translation(at) * view.world_from_camera;
            let image = studio.radiance(&scene, &view, [64; 2], 1);
            // A normal of 7 bits changes grazing light, no shadow does.
            let dark = image.pixels().iter().filter(|pixel| pixel[0] < 0.1).count();
            assert_eq!(dark, 0, "{slant}° leaning by {lean}, {away} m away");
        }
    }
}

#[test]
fn holes_of_masks_let_rays_through() {
    let mut stage = Stage::floor(1.0);
    // Columns of half a metre, every other a hole.
    let rgba = (0..4).flat_map(|i| [255, 255, 255, if i % 2 == 0 { 255 } else { 0 }]).collect();
    let texture = stage.texture(2, [Wrap::Clamp; 2], Filter::Nearest, rgba);
    let material = stage.material(Material {
        base_color_texture: Some(texture),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        specular: 0.0,
        double_sided: true,
        ..Material::default()
    });
    stage.quad(Vec3::new(0.0, 3.0, 0.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, material);
    stage.light(LightKind::Point, 9.0 * PI, None, Vec3::new(0.0, 3.9, 0.0), Vec3::NEG_Y);
    for pipeline in PIPELINES {
        let mut studio = Studio::new(&device(), traced(&[("pipeline", pipeline)]));
        let scene = studio.load(&stage.scene);
        let image = studio.radiance(&scene, &camera_above(HALF), [SIDE; 2], 1);
        // Below the caster, seen from above it: the camera sees the quad in its own place; beside it lies its shadow.
        let at = |x: f32| image.pixel(((x / HALF * 0.5 + 0.5) * SIDE as f32) as u32, SIDE / 2)[0];
        assert!(at(-1.2) == 0.0 && at(1.2) > 0.1, "{pipeline}: {} and {}", at(-1.2), at(1.2));
    }
}

#[test]
fn glass_tints_the_light_of_rays_as_it_does_that_of_maps() {
    let mut stage = Stage::floor(1.0);
    for (x, alpha) in [(-0.7, AlphaMode::Opaque), (0.7, AlphaMode::Blend)] {
        let material = stage.material(Material {
            base_color: Vec3::new(0.9, 0.5, 0.2).extend(if alpha == AlphaMode::Blend { 0.4 } else { 1.0 }),
            transmission: if alpha == AlphaMode::Blend { 0.0 } else { 0.8 },
            specular: 0.0,
            alpha,
            double_sided: true,
            ..Material::default()
        });
        stage.quad(Vec3::new(x, 2.5, 0.0), Vec3::X * 0.4, Vec3::NEG_Z * 0.4, material);
    }
    stage.sun(PI, Vec3::new(0.0, -1.0, 0.3).normalize());
    let tint = ("shadow.transmission_tint", "true");
    let mut studio = Studio::new(&device(), direct(&[tint, ("shadow.pcf_kernel", "2")]));
    let view = camera_above(HALF);
    let scene = studio.load(&stage.scene);
    let by_maps = studio.radiance(&scene, &view, [SIDE; 2], 1);
    let mut studio = Studio::new(&device(), traced(&[tint]));
    let scene = studio.load(&stage.scene);
    let by_rays = studio.radiance(&scene, &view, [SIDE; 2], 1);
    let off = nmae(&by_rays, &by_maps);
    assert!(off < 0.004, "{off}");
    studio.set(traced(&[]));
    let full = studio.radiance(&scene, &view, [SIDE; 2], 1);
    assert!(nmae(&full, &by_maps) > 0.02, "tints show");
}

#[test]
fn shadows_follow_what_moves_and_bends() {
    let scene = crate::motion::moving();
    let view = crate::motion::view();
    let mut studio = Studio::new(&device(), traced(&[]));
    let frozen = studio.load(&crate::motion::frozen(&scene, 0.7));
    let expected = studio.radiance(&frozen, &view, [SIDE; 2], 1);
    let mut loaded = studio.load(&scene);
    let before = studio.radiance(&loaded, &view, [SIDE; 2], 1);
    for time_s in [0.2, 0.7] {
        loaded.set_pose(&scene, &scene.pose(time_s)).unwrap();
    }
    let followed = studio.radiance(&loaded, &view, [SIDE; 2], 1);
    assert!(nmae(&followed, &expected) < 0.005, "{}", nmae(&followed, &expected));
    assert!(nmae(&before, &expected) > 0.05, "nothing moved");
}

#[test]
fn a_node_that_a_program_moves_takes_its_shadow_along_and_asks_for_new_trees() {
    let stage = &lights()[0].1;
    let caster = 1;
    let mut pose = stage.scene.pose(0.0);
    let there = Affine3A::from_translation(Vec3::new(-0.4, 0.1, 0.2));
    pose.world_from_node[caster] = there * pose.world_from_node[caster];
    let mut studio = Studio::new(&device(), traced(&[]));
    let mut loaded = studio.load(&stage.scene);
    assert!(!loaded.trees_are_due());
    loaded.set_pose(&stage.scene, &pose).unwrap();
    let exact = Exact::at(&stage.scene, &pose);
    let check = |studio: &mut Studio, loaded: &chiaro::LoadedScene| {
        let image = studio.radiance(loaded, &camera_above(HALF), [SIDE; 2], 1);
        let wrong = wrong(&image, &exact, (0.0, 1), 0.01);
        assert!(wrong <= 4, "{wrong} pixels");
    };
    check(&mut studio, &loaded);
    assert!(loaded.trees_are_due());
    studio.renderer().equip(&stage.scene, &mut loaded).unwrap();
    assert!(!loaded.trees_are_due());
    check(&mut studio, &loaded);
    // From now on it is carried.
    loaded.set_pose(&stage.scene, &stage.scene.pose(0.0)).unwrap();
    loaded.set_pose(&stage.scene, &pose).unwrap();
    assert!(!loaded.trees_are_due());
    check(&mut studio, &loaded);
}

#[test]
fn a_scene_without_trees_is_refused_by_name_until_it_is_given_some() {
    let stage = &lights()[0].1;
    let (mut renderer, mut loaded) = Renderer::with_scene(&device(), direct(&[]), &stage.scene).unwrap();
    renderer.set(traced(&[])).unwrap();
    let (view, options) = (camera_above(HALF), StillOptions { size: [8; 2], ..StillOptions::default() });
    assert!(loaded.lacks_trees(renderer.settings()));
    let refused = renderer.still(&loaded, &view, &options).unwrap_err();
    assert!(matches!(refused, Error::NoTrees), "{refused}");
    renderer.equip(&stage.scene, &mut loaded).unwrap();
    renderer.still(&loaded, &view, &options).unwrap();
}

#[test]
fn trees_of_another_scene_are_refused() {
    let stage = &lights()[0].1;
    let (_, mut loaded) = Renderer::with_scene(&device(), traced(&[]), &stage.scene).unwrap();
    // As many nodes and triangles; one corner is elsewhere. And another number of nodes.
    let mut moved = stage.scene.clone();
    moved.meshes[1].primitives[0].positions[0].x += 0.25;
    let others = [moved, Stage::floor(0.5).scene];
    for other in others {
        let trees = chiaro::Trees::build(&device(), &other, &other.pose(0.0), &[]).unwrap();
        let refused = loaded.give_trees(&stage.scene, trees).unwrap_err();
        assert!(matches!(refused, Error::Foreign { what: "trees", .. }), "{refused}");
    }
    let pose = Stage::floor(0.5).scene.rest();
    let refused = loaded.set_pose(&Stage::floor(0.5).scene, &pose).unwrap_err();
    assert!(matches!(refused, Error::Foreign { what: "pose", .. }), "{refused}");
    let trees = chiaro::Trees::build(&device(), &stage.scene, &stage.scene.pose(0.0), &[]).unwrap();
    loaded.give_trees(&stage.scene, trees).unwrap();
}

#[test]
fn what_a_pose_puts_nowhere_casts_no_shadow_until_it_is_back() {
    let mut stage = Stage::floor(1.0);
    let material = stage.lambert(1.0);
    stage.quad(Vec3::new(0.0, 0.5, 0.0), 0.3 * Vec3::X, 0.3 * Vec3::NEG_Z, material);
    stage.sun(3.0, Vec3::new(0.5, -1.0, 0.2).normalize());
    let block = stage.scene.nodes.iter().rposition(|node| node.mesh.is_some()).unwrap();
    let mut studio = Studio::new(&device(), traced(&[]));
    let mut scene = studio.load(&stage.scene);
    let mut look = |scene: &chiaro::LoadedScene| studio.radiance(scene, &camera_above(HALF), [SIDE; 2], 1);
    let before = look(&scene);
    for nowhere in [Vec3::NAN, Vec3::INFINITY] {
        let mut pose = stage.scene.pose(0.0);
        pose.world_from_node[block] = Affine3A::from_translation(nowhere);
        let error = scene.set_pose(&stage.scene, &pose).unwrap_err().to_string();
        assert!(error.contains(&format!("node {block}: its transform in the pose")), "{error}");
        assert!(nmae(&look(&scene), &before) == 0.0, "{nowhere}");
    }
    for nowhere in [Vec3::splat(1e30), Vec3::splat(1e18)] {
        let mut pose = stage.scene.pose(0.0);
        pose.world_from_node[block] = Affine3A::from_translation(nowhere);
        scene.set_pose(&stage.scene, &pose).unwrap();
        let dark = look(&scene).pixels().iter().filter(|pixel| pixel[0] < 0.1).count();
        assert_eq!(dark, 0, "{nowhere}");
        scene.set_pose(&stage.scene, &stage.scene.pose(0.0)).unwrap();
        assert!(nmae(&look(&scene), &before) < 1e-6, "{nowhere}");
    }
}

#[test]
fn an_even_alpha_at_its_cut_off_stops_every_ray() {
    let mut stage = Stage::floor(1.0);
    for (x, alpha) in [(-0.7, AlphaMode::Mask { cutoff: 0.3 }), (0.7, AlphaMode::Blend)] {
        let even = if alpha == AlphaMode::Blend { 0.5 } else { 0.3 };
        let base_color = Vec3::ONE.extend(even);
        let material =
            stage.material(Material { base_color, alpha, double_sided: true, ..Material::default() });
        stage.quad(Vec3::new(x, 2.5, 0.0), Vec3::X * 0.4, Vec3::NEG_Z * 0.4, material);
    }
    // Shadows lie beside the panes that the camera sees.
    stage.sun(3.0, Vec3::new(0.0, -1.0, 0.32).normalize());
    let mut studio = Studio::new(&device(), traced(&[]));
    let scene = studio.load(&stage.scene);
    let image = studio.radiance(&scene, &camera_above(HALF), [SIDE; 2], 1);
    for (i, pixel) in image.pixels().iter().enumerate() {
        let at = place_below([i as u32 % SIDE, i as u32 / SIDE], SIDE, HALF);
        let inside = (at.x.abs() - 0.7).abs() < 0.35 && (at.z - 0.8).abs() < 0.35;
        assert!(!inside || pixel[0] == 0.0, "light at {at}");
    }
}
