//! The point set on the GPU against its twin on the CPU, and against formulas.

use chiaro::scene::{Filter, Material, Reflection, Scene, Wrap};
use chiaro::{LoadedScene, Recorder};
use chiaro_gpu::{BufferReadback, Dispatch};
use chiaro_techniques::indirect::points::{Point, PointData, PointOptions, PointRoom, Points, Thinning};
use chiaro_techniques::scene::motion::Motion;
use chiaro_techniques::{Kit, Pass, shaders};
use chiaro_testkit::{Bench, Stage, TestGpu, device_guaranteed};
use glam::{Affine3A, DVec3, Vec3, Vec4};

/// Points of a scene, and whatever finds them.
struct Set {
    gpu: TestGpu,
    loaded: LoadedScene,
    data: PointData,
    motion: Motion,
    points: Points,
    room: Option<PointRoom>,
    recorder: Recorder,
}

impl Set {
    fn new(scene: &Scene, options: PointOptions) -> Self {
        let gpu = device_guaranteed();
        let kit = Kit::new(&gpu, shaders::library());
        let loaded = LoadedScene::upload(&kit, scene).unwrap();
        Self {
            data: PointData::build(scene, &scene.pose(0.0), options),
            motion: Motion::compile(&kit, &()).unwrap(),
            points: Points::compile(&kit, &loaded.gpu.facts).unwrap(),
            room: None,
            recorder: Recorder::new(&gpu, false),
            loaded,
            gpu,
        }
    }

    /// The points after a frame, and whether it had to look for them.
    fn frame(&mut self) -> (Vec<Point>, bool) {
        let room = self.points.room(&self.gpu, &self.data, &mut self.room).unwrap();
        let mut frame = self.recorder.begin();
        self.motion.record(&mut frame, &self.loaded.gpu);
        self.points.record(&mut frame, &self.loaded.gpu, room);
        frame.submit();
        let bytes = BufferReadback::start(&self.gpu, &room.points).wait(&self.gpu).unwrap();
        let words: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
        let found = self.recorder.log().iter().any(|pass| pass.name == "indirect/points");
        (words[..room.count as usize].iter().map(|words| Point::unpack(*words)).collect(), found)
    }

    /// Points against where the CPU has them in a pose.
    #[track_caller]
    fn assert_as_in(&mut self, scene: &Scene, pose: &chiaro::scene::Pose, tolerance_m: f32) {
        let (points, found) = self.frame();
        assert!(found);
        let (mut off_m, mut off) = (0f32, 0f32);
        for (point, (at, normal)) in points.iter().zip(self.data.places(scene, pose)) {
            off_m = off_m.max(point.position_ws.distance(at));
            off = off.max(point.normal_ws.distance(normal));
        }
        assert!(off_m <= tolerance_m && off < 0.03, "{off_m} m and {off} off");
        assert!(!self.frame().1, "nothing moved");
    }
}

fn options(points: u32) -> PointOptions {
    PointOptions { points, seed: 3 }
}

#[test]
fn points_go_where_their_triangles_go() {
    let scene = crate::motion::moving();
    for scene in [crate::motion::facetted(scene.clone()), scene] {
        let mut set = Set::new(&scene, options(5000));
        let at_rest = set.data.places(&scene, &scene.pose(0.0));
        for time_s in [0.0, 0.4, 1.0] {
            let pose = scene.pose(time_s);
            set.loaded.set_pose(&scene, &pose).unwrap();
            set.assert_as_in(&scene, &pose, 1e-3);
        }
        let now = set.data.places(&scene, &scene.pose(1.0));
        let moved = at_rest.iter().zip(&now).filter(|(a, b)| a.0.distance(b.0) > 0.1).count();
        assert!(moved > 200, "{moved} of {} points moved", now.len());
        // Points chosen anew take the others' place.
        set.data = PointData::build(&scene, &scene.pose(0.4), options(100));
        set.assert_as_in(&scene, &scene.pose(1.0), 1e-3);
    }
}

#[test]
fn a_pose_that_leaves_no_area_leaves_points_that_are_numbers() {
    let mut stage = Stage::floor(0.5);
    let grey = stage.lambert(0.5);
    stage.quad(Vec3::Y, Vec3::X, Vec3::NEG_Z, grey);
    let scene = stage.scene;
    let mut set = Set::new(&scene, options(512));
    for (world, whole) in [
        (Affine3A::from_scale(Vec3::new(1.0, 1.0, 0.0)), false),
        (Affine3A::from_scale(Vec3::ZERO), false),
        (Affine3A::from_scale(Vec3::splat(1e-12)), false),
        (Affine3A::from_scale(Vec3::splat(1e13)), true),
        (Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)), true),
    ] {
        let mut pose = scene.pose(0.0);
        pose.set_world(&scene, 1, world);
        set.loaded.set_pose(&scene, &pose).unwrap();
        let (points, found) = set.frame();
        assert!(found && points.len() == 512);
        for point in points {
            assert!(point.position_ws.is_finite() && point.albedo.abs_diff_eq(Vec3::splat(0.5), 0.1));
            assert!((point.normal_ws.length() - 1.0).abs() < 1e-3);
            assert!(!whole || point.normal_ws.y > 0.99, "{}", point.normal_ws);
        }
    }
}

#[test]
fn a_scene_without_area_has_no_points() {
    let mut set = Set::new(&Scene::default(), options(64));
    assert_eq!(set.frame(), (Vec::new(), false));
}

#[test]
fn points_that_fill_more_than_a_row_of_workgroups_are_all_found() {
    let count = (1 << 21) + 100;
    let scene = Stage::floor(0.5).scene;
    let (points, _) = Set::new(&scene, options(count)).frame();
    assert_eq!(points.len(), count as usize);
    assert!(points.iter().all(|point| point.normal_ws.y > 0.99 && point.albedo.x > 0.4));
    let mean =
        points.iter().map(|point| point.position_ws.as_dvec3()).sum::<glam::DVec3>() / f64::from(count);
    assert!(mean.length() < 1e-3, "{mean}");
}

/// Means of the albedos at x < 0 and x > 0.
fn albedos(points: &[Point]) -> [Vec3; 2] {
    [-1.0, 1.0].map(|side: f32| {
        let there: Vec<_> = points.iter().filter(|p| p.position_ws.x * side > 0.2).collect();
        assert!(there.len() > 500);
        there.iter().map(|p| p.albedo).sum::<Vec3>() / there.len() as f32
    })
}

#[test]
fn albedo_is_what_is_reflected_diffusely() {
    let wrap = [Wrap::Clamp; 2];
    let mut stage = Stage::new();
    // The left half black, the right half white and metal by half.
    let halves =
        |left: [u8; 4], right: [u8; 4]| (0..64).flat_map(|i| if i % 8 < 4 { left } else { right }).collect();
    let map = stage.texture(8, wrap, Filter::Linear, halves([0, 0, 0, 255], [255; 4]));
    let metal = stage.texture(8, wrap, Filter::Linear, halves([0, 0, 255, 255], [0, 0, 128, 255]));
    let base_color = Vec4::new(0.9, 0.3, 0.05, 1.0);
    let plain = Material { base_color, ..Material::default() };
    for (material, left, right) in [
        (plain.clone(), 1.0, 1.0),
        (Material { base_color_texture: Some(map), ..plain.clone() }, 0.0, 1.0),
        (Material { metallic: 1.0, ..plain.clone() }, 0.0, 0.0),
        (
            Material { metallic: 1.0, metallic_roughness_texture: Some(metal), ..plain.clone() },
            0.0,
            1.0 - 128.0 / 255.0,
        ),
        (Material { reflection: Reflection::Unlit, ..plain }, 0.0, 0.0),
    ] {
        let mut scene = Stage { scene: stage.scene.clone() };
        let made_of = scene.material(material);
        scene.quad(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, made_of);
        let (points, _) = Set::new(&scene.scene, options(4096)).frame();
        for (found, share) in albedos(&points).into_iter().zip([left, right]) {
            let expected = share * base_color.truncate();
            // Codes are a thirtieth apart; their mean is not off.
            assert!(found.abs_diff_eq(expected, 2e-3), "{found} instead of {expected}");
        }
    }
}

#[test]
fn points_that_stand_for_much_see_a_texture_from_afar() {
    let mut stage = Stage::new();
    // A board of black and white, a texel each.
    let rgba = (0..64 * 64).flat_map(|i| if (i + i / 64) % 2 == 0 { [255; 4] } else { [0, 0, 0, 255] });
    let map = stage.texture(64, [Wrap::Repeat; 2], Filter::Linear, rgba.collect());
    let board = stage.material(Material { base_color_texture: Some(map), ..Material::default() });
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, board);
    let grey = |point: &Point| (point.albedo - 0.5).abs().max_element() < 0.06;
    let share = |points: Vec<Point>| points.iter().filter(|p| grey(p)).count() as f32 / points.len() as f32;
    // 256 points: 16 texels each; the others a quarter of one, where filters leave 37 % grey.
    assert_eq!(share(Set::new(&stage.scene, options(256)).frame().0), 1.0);
    assert!(share(Set::new(&stage.scene, options(16_384)).frame().0) < 0.5);
    // From afar again.
    let thinning = Thinning { eye_m: 100.0 * DVec3::Y, from_m: 15.0 };
    let mut set = Set::new(&stage.scene, options(16_384));
    set.data = PointData::build_thinned(&stage.scene, &stage.scene.pose(0.0), options(16_384), thinning);
    let (points, _) = set.frame();
    assert!(points.iter().all(|point| point.exponent == 4), "{:?}", points[0]);
    assert!(points.iter().all(|point| (point.position_ws.y).abs() < 1e-6));
}

#[test]
fn packed_points_are_the_same_in_rust_and_in_shaders() {
    let gpu = device_guaranteed();
    let bench = Bench::new(&gpu);
    let mut points = Vec::new();
    for i in 0..4000u32 {
        // Directions of all octants, and the axes; sizes from 1 mm to 10,000 km.
        let turn = |k: f32| (i as f32 * k).sin();
        let mut normal = Vec3::new(turn(0.7), turn(1.3), turn(2.9)).normalize();
        if i < 6 {
            normal = Vec3::ZERO;
            normal[(i % 3) as usize] = if i < 3 { 1.0 } else { -1.0 };
        }
        let position = 10f32.powi((i % 11) as i32 - 3) * Vec3::new(turn(3.1), turn(4.3), turn(5.7));
        let albedo = Vec3::new(i as f32 / 3999.0, (i % 17) as f32 / 16.0, (i % 5) as f32 / 4.0);
        points.push(Point { position_ws: position, normal_ws: normal, albedo, exponent: i % 16 });
    }
    let input: Vec<Vec4> = points
        .iter()
        .flat_map(|p| {
            [p.position_ws.extend(p.exponent as f32), p.normal_ws.extend(0.0), p.albedo.extend(0.0)]
        })
        .collect();
    let input: Vec<[f32; 4]> = input.iter().map(Vec4::to_array).collect();
    let buffer = bench.buffer("input", &input);
    let shader = ("tests/points.cs.wesl", include_str!("wesl/points.cs.wesl"));
    let work = (Dispatch::Threads([4000, 1, 1]), 4 * points.len());
    let found: Vec<[u32; 4]> = bench.run(shader, &[], None, &[("input", (&buffer).into())], work);
    let mut sums = [Vec3::ZERO; 2];
    for (point, words) in points.iter().zip(found.as_chunks::<4>().0) {
        let own = Point::unpack(words[0]);
        let [shader, normal, albedo] = [1, 2, 3].map(|i| Vec4::from(words[i].map(f32::from_bits)));
        assert_eq!((own.position_ws, own.exponent as f32), (shader.truncate(), shader.w));
        assert!(own.normal_ws.abs_diff_eq(normal.truncate(), 1e-6), "{own:?} {normal}");
        assert!(own.albedo.abs_diff_eq(albedo.truncate(), 1e-6), "{own:?} {albedo}");

        assert_eq!(own.exponent, point.exponent);
        let slack = 4e-7 * point.position_ws.abs();
        assert!((own.position_ws - point.position_ws).abs().cmple(slack).all(), "{own:?} {point:?}");
        assert!(own.normal_ws.distance(point.normal_ws) < 0.02, "{own:?} {point:?}");
        let steps = (own.albedo.powf(0.5) - point.albedo.powf(0.5)).abs() * Vec3::new(31.0, 63.0, 31.0);
        assert!(steps.max_element() < 1.001, "{own:?} {point:?}");
        sums[0] += own.albedo;
        sums[1] += point.albedo;
    }
    assert!((sums[0] / sums[1] - 1.0).abs().max_element() < 2e-3, "{sums:?}");
}
