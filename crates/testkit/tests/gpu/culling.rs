//! Cluster culling against the CPU and against drawing everything.

use bytemuck::{Pod, Zeroable};
use chiaro::View;
use chiaro::scene::{self, Scene};
use chiaro_gpu::{Buffer, Dispatch, Frame, Gpu, Recorder, TexturePool};
use chiaro_techniques::Pass;
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::scene::CLASSES;
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::view::culling::{Culling, ListRoom};
use chiaro_techniques::view::{Hole, ViewData, ViewTable};
use chiaro_techniques::view::{Raster, SurfaceKey, SurfaceSettings, Surfaces};
use chiaro_testkit::{Bench, Output, Stage, Studio, camera_above, device, device_guaranteed, direct};
use glam::{Affine3A, Mat4, Vec2, Vec3, Vec4};

use crate::shadow_raster::sieves;

/// Numbers that are the same every time (Steele & Vigna's SplitMix64).
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn within(&mut self, lo: f32, hi: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let unit = ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32;
        lo + (hi - lo) * unit
    }
}

const SIZE: [u32; 2] = [96, 64];

fn random_views(scene: &Scene, count: usize) -> Vec<View> {
    let (lo, hi) = scene.bounds().unwrap();
    let mut random = Random::new(5);
    let mut point = || {
        let mut axis = |i: usize| random.within(lo[i], hi[i]);
        Vec3::new(axis(0), axis(1), axis(2))
    };
    (0..count).map(|i| View::look_at(point(), point(), 0.4 + 0.2 * i as f32, 0.05)).collect()
}

fn view_data(view: &View) -> ViewData {
    ViewData::new(&view.clip_from_ws(SIZE, Vec2::ZERO), view.eye_ws().extend(1.0), SIZE)
}

/// The same with planes without a normal: everything is inside.
fn everything(view: &View) -> ViewData {
    let ViewData { planes, .. } = ViewData::new(&Mat4::ZERO, Vec4::W, SIZE);
    ViewData { planes, ..view_data(view) }
}

/// A buffer's words, whatever its usage.
fn words(bench: &Bench, frame: &mut Frame<'_>, buffer: &Buffer) -> Output<u32> {
    let shader = ("tests/words.cs.wesl", include_str!("wesl/words.cs.wesl"));
    let count = (buffer.raw().size() / 4) as u32;
    let groups = count.div_ceil(64);
    let work = (Dispatch::Groups([groups.min(1024), groups.div_ceil(1024), 1]), count as usize);
    bench.record(frame, shader, &[], None, &[("input", buffer.into())], work)
}

/// Items of a view's draw list, one a triangle, class after class.
fn listed(arguments: &[u32], list: &[u32], view: usize) -> Vec<u32> {
    let mut items = Vec::new();
    for class in 0..CLASSES {
        let [count, instances, first, ..] = arguments[5 * (view * CLASSES + class)..][..5] else {
            unreachable!()
        };
        assert_eq!((count % 3, instances), (0, 1));
        let entries = &list[first as usize..(first + count) as usize];
        for corners in entries.chunks(3) {
            assert!(corners.iter().all(|corner| corner >> 8 == corners[0] >> 8), "corners of one item");
            items.push(corners[0] >> 8);
        }
    }
    items
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Sphere {
    center: Vec3,
    radius: f32,
    triangles: u32,
    pad: [u32; 3],
}

#[test]
fn a_views_draw_list_is_that_of_the_cpu_in_the_scenes_order_every_time() {
    let scene = scene::load("builtin:nave").unwrap();
    let gpu = device();
    let bench = Bench::new(&gpu);
    let uploaded = SceneGpu::upload(&gpu, &bench.kit.scene_layout, &scene).unwrap();
    let shader = ("tests/spheres.cs.wesl", include_str!("wesl/spheres.cs.wesl"));
    let count = uploaded.item_count as usize;
    let work = (Dispatch::Threads([uploaded.item_count, 1, 1]), count);
    let spheres: Vec<Sphere> = bench.run(shader, &[], Some(&uploaded), &[], work);

    let culling = Culling::compile(&bench.kit, &()).unwrap();
    let mut views: Vec<_> = random_views(&scene, 6).iter().map(view_data).collect();
    // Two views leave a square tower out.
    let hole = Hole { rows: [Vec3::X.extend(-1.0), Vec3::Z.extend(2.0)], half: 3.0 };
    for view in &mut views[..2] {
        *view = view.without(Some(hole));
        assert!(!view.sees(Vec3::new(1.0, 2.0, -2.0), 0.5));
    }
    let mut table = ViewTable::new(&gpu);
    table.set(&gpu, &views, &[], views.len());
    let room = ListRoom::new(&gpu, &uploaded, views.len());
    let mut before: Vec<Vec<u32>> = Vec::new();
    for run in 0..2 {
        let mut recorder = Recorder::new(&gpu, false);
        let mut frame = recorder.begin();
        table.upload(&mut frame);
        let lists = culling.record(&mut frame, &uploaded, &table, table.batches()[0].clone(), &room);
        let [arguments, list] =
            [&lists.arguments, &lists.list].map(|buffer| words(&bench, &mut frame, buffer));
        frame.submit();
        let (arguments, list) = (bench.read(&arguments), bench.read(&list));
        for (index, view) in views.iter().enumerate() {
            let found = listed(&arguments, &list, index);
            let mut expected = Vec::new();
            let mut doubtful = Vec::new();
            for (item, sphere) in (0u32..).zip(&spheres) {
                // Where rounding decides, either answer is right.
                let (more, less) = (sphere.radius * 1.0001 + 1e-5, sphere.radius * 0.9999 - 1e-5);
                if view.sees(sphere.center, more) != view.sees(sphere.center, less) {
                    doubtful.push(item);
                } else if view.sees(sphere.center, sphere.radius) {
                    expected.extend(std::iter::repeat_n(item, sphere.triangles as usize));
                }
            }
            let certain: Vec<_> = found.iter().copied().filter(|item| !doubtful.contains(item)).collect();
            assert_eq!(certain, expected, "view {index}");
            let all = uploaded.triangle_count as usize;
            assert!(
                !expected.is_empty() && expected.len() < all,
                "the view must cut the scene, not hold all {all}"
            );
            if run == 0 {
                before.push(found);
            } else {
                assert_eq!(found, before[index], "view {index} in another run");
            }
        }
    }
}

/// The packed surface buffer as a view sees the scene, drawn from the clusters that `cull` keeps.
struct Surveyor<'a> {
    gpu: &'a Gpu,
    bench: Bench,
    culling: Culling,
    surfaces: Surfaces,
}

impl<'a> Surveyor<'a> {
    fn new(gpu: &'a Gpu, scene: &Scene, raster: Raster) -> (Self, SceneGpu) {
        let bench = Bench::new(gpu);
        let uploaded = SceneGpu::upload(gpu, &bench.kit.scene_layout, scene).unwrap();
        let settings = SurfaceSettings { raster, ..Default::default() };
        let key = SurfaceKey::new(&settings, uploaded.facts);
        let surfaces = Surfaces::compile(&bench.kit, &key).unwrap();
        let culling = Culling::compile(&bench.kit, &()).unwrap();
        (Self { gpu, bench, culling, surfaces }, uploaded)
    }

    fn surface(&mut self, scene: &SceneGpu, view: &View, drawn: ViewData) -> Vec<[u32; 4]> {
        self.surface_among(scene, view, &[drawn], 0)
    }

    /// As one of several views sees it, which are culled together.
    fn surface_among(
        &mut self,
        scene: &SceneGpu,
        view: &View,
        drawn: &[ViewData],
        number: u32,
    ) -> Vec<[u32; 4]> {
        let data = FrameData {
            clip_from_ws: view.clip_from_ws(SIZE, Vec2::ZERO).to_cols_array_2d(),
            relative_from_clip: view.relative_from_clip(SIZE, Vec2::ZERO).to_cols_array_2d(),
            eye_ws: view.eye_ws().to_array(),
            forward_ws: view.forward_ws().to_array(),
            footprint_scale: 1.0,
            size_px: SIZE,
            anisotropy: 1,
            ..FrameData::zeroed()
        };
        self.bench.set_frame(&data);
        let mut table = ViewTable::new(self.gpu);
        table.set(self.gpu, drawn, &[], drawn.len());
        let (lists, mut room) = (ListRoom::new(self.gpu, scene, drawn.len()), None);
        let room = self.surfaces.room(self.gpu, &TexturePool::default(), SIZE, &mut room);
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        table.upload(&mut frame);
        let lists = self.culling.record(&mut frame, scene, &table, table.batches()[0].clone(), &lists);
        let (shared, view) = ((self.bench.frame.group(), scene), (&table, &lists, number));
        self.surfaces.record_visibility(&mut frame, shared, view, room);
        let buffer = self.surfaces.record_resolve(&mut frame, shared, view, room);
        let shader = ("tests/texels.cs.wesl", include_str!("wesl/texels.cs.wesl"));
        let work = (Dispatch::Threads([SIZE[0], SIZE[1], 1]), (SIZE[0] * SIZE[1]) as usize);
        let inputs = [("surface", (&buffer.surface).into())];
        let texels = self.bench.record(&mut frame, shader, &[], None, &inputs, work);
        frame.submit();
        self.bench.read(&texels)
    }
}

#[test]
fn culling_loses_no_visible_triangle() {
    let gpu = device();
    let scene = scene::load("builtin:nave").unwrap();
    let (mut surveyor, uploaded) = Surveyor::new(&gpu, &scene, Raster::Hardware);
    for (index, view) in random_views(&scene, 5).iter().enumerate() {
        let all = surveyor.surface(&uploaded, view, everything(view));
        let culled = surveyor.surface(&uploaded, view, view_data(view).dropping_back_faces());
        let differing = all.iter().zip(&culled).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 0, "pixels of view {index}");
        let seen = all.iter().filter(|texel| texel[1] >> 30 != 3).count();
        assert!(seen > 100, "view {index} shows only {seen} pixels of the scene");
    }
}

#[test]
fn a_spots_view_is_that_of_a_camera_put_there_whatever_is_culled_beside_it() {
    let gpu = device();
    for scene in [scene::load("builtin:nave").unwrap(), sieves().scene] {
        // Eighty degrees wide, with a far plane.
        let (near, far) = (0.05f32, 60.0f32);
        let (half, a) = (40f32.to_radians().tan(), near / (far - near));
        let clip_from_ls = Mat4::from_cols(
            Vec4::new(1.0 / half, 0.0, 0.0, 0.0),
            Vec4::new(0.0, SIZE[0] as f32 / SIZE[1] as f32 / half, 0.0, 0.0),
            Vec4::new(0.0, 0.0, a, -1.0),
            Vec4::new(0.0, 0.0, a * far, 0.0),
        );
        for raster in [Raster::Hardware, Raster::Compute] {
            let (mut surveyor, uploaded) = Surveyor::new(&gpu, &scene, raster);
            let cameras = random_views(&scene, 3);
            let spot = |camera: &View| {
                let clip_from_ws = clip_from_ls * camera.world_from_camera.inverse();
                ViewData::new(&clip_from_ws, camera.eye_ws().extend(1.0), SIZE).dropping_back_faces()
            };
            let beside = [view_data(&cameras[1]), everything(&cameras[2]), spot(&cameras[0])];
            let alone = surveyor.surface(&uploaded, &cameras[0], beside[2]);
            let found = surveyor.surface_among(&uploaded, &cameras[0], &beside, 2);
            assert!(alone.iter().filter(|texel| texel[1] >> 30 != 3).count() > 100, "{raster:?}");
            assert!(found == alone, "{raster:?}");
        }
    }
}

#[test]
fn more_clusters_are_culled_than_one_row_of_workgroups_takes() {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    stage.quad(Vec3::ZERO, Vec3::X * 0.1, Vec3::NEG_Z * 0.1, material);
    let node = stage.scene.nodes[0].clone();
    // Two rows of the first step, seventy of the last.
    let count = 70_000;
    stage.scene.nodes = vec![node; count];
    let gpu = device_guaranteed();
    let bench = Bench::new(&gpu);
    let scene = SceneGpu::upload(&gpu, &bench.kit.scene_layout, &stage.scene).unwrap();
    assert_eq!(scene.item_count as usize, count);
    let culling = Culling::compile(&bench.kit, &()).unwrap();
    let mut table = ViewTable::new(&gpu);
    table.set(&gpu, &[view_data(&camera_above(1.0))], &[], 1);
    let room = ListRoom::new(&gpu, &scene, 1);
    let mut recorder = Recorder::new(&gpu, false);
    let mut frame = recorder.begin();
    table.upload(&mut frame);
    let lists = culling.record(&mut frame, &scene, &table, 0..1, &room);
    let [arguments, list] = [&lists.arguments, &lists.list].map(|buffer| words(&bench, &mut frame, buffer));
    frame.submit();
    let found = listed(&bench.read(&arguments), &bench.read(&list), 0);
    assert!(found.into_iter().eq((0..count as u32).flat_map(|item| [item, item])));
}

#[test]
fn compute_rasters_the_cameras_view_as_the_hardware_does() {
    let gpu = device_guaranteed();
    let scenes = [scene::load("builtin:nave").unwrap(), sieves().scene];
    for (number, scene) in scenes.iter().enumerate() {
        let (mut hardware, uploaded) = Surveyor::new(&gpu, scene, Raster::Hardware);
        let (mut compute, again) = Surveyor::new(&gpu, scene, Raster::Compute);
        let mut views = random_views(scene, 3);
        views.push(View::look_at(Vec3::new(1.0, 3.0, 0.5), Vec3::ZERO, 1.0, 0.05));
        for (index, view) in views.iter().enumerate() {
            let drawn = view_data(view).dropping_back_faces();
            let expected = hardware.surface(&uploaded, view, drawn);
            let found = compute.surface(&again, view, drawn);
            let differing = expected.iter().zip(&found).filter(|(a, b)| a != b).count();
            // An edge through a pixel's middle rounds to either side, and filters of holes differ a little.
            assert!(differing * 100 < found.len(), "scene {number}, view {index}: {differing} pixels differ");
            assert_eq!(compute.surface(&again, view, drawn), found, "scene {number}, view {index}, twice");
        }
    }
}

#[test]
fn of_surfaces_at_one_depth_the_first_is_seen_in_compute_too() {
    let gpu = device();
    let mut stage = Stage::new();
    for shade in 0..7 {
        let material = stage.material(chiaro::scene::Material {
            base_color: Vec3::splat(0.1 + 0.1 * shade as f32).extend(1.0),
            double_sided: shade % 2 == 0,
            ..Default::default()
        });
        // One facing down, which nobody sees.
        let across = if shade == 3 { Vec3::Z } else { Vec3::NEG_Z };
        stage.quad(Vec3::ZERO, Vec3::X * 0.8, across * 0.8, material);
    }
    let view = View::look_at(Vec3::new(0.3, 2.0, 0.2), Vec3::ZERO, 0.8, 0.05);
    let drawn = view_data(&view).dropping_back_faces();
    let [expected, found] = [Raster::Hardware, Raster::Compute].map(|raster| {
        let (mut surveyor, uploaded) = Surveyor::new(&gpu, &stage.scene, raster);
        surveyor.surface(&uploaded, &view, drawn)
    });
    assert!(found.iter().filter(|texel| texel[1] >> 30 != 3).count() * 2 > found.len());
    assert_eq!(expected, found);
}

#[test]
fn a_mirrored_instance_keeps_its_front() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.layout", "none")]));
    for mirror in [Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, 1.0, -1.0), Vec3::new(1.0, -1.0, 1.0)] {
        let mut stage = Stage::new();
        let single_sided = chiaro::scene::Material { specular: 0.0, ..Default::default() };
        let material = stage.material(single_sided);
        // Off the middle, so that the mirrored quad stands elsewhere; facing up.
        stage.quad(Vec3::new(0.5, 0.0, -0.25), Vec3::X * 0.25, Vec3::NEG_Z * 0.25, material);
        let mesh = stage.scene.meshes[0].clone();
        stage.scene.nodes.clear();
        stage.scene.meshes.clear();
        stage.place(mesh, Affine3A::from_scale(mirror));
        stage.sun(std::f32::consts::PI, Vec3::NEG_Y);
        stage.sun(std::f32::consts::PI * 0.25, Vec3::Y);
        let scene = studio.load(&stage.scene);
        let image = studio.radiance(&scene, &camera_above(1.0), [64, 64], 1);
        let center = Vec3::new(0.5, 0.0, -0.25) * mirror;
        let at = |x: f32| ((x + 1.0) * 32.0) as u32;
        let found = image.pixel(at(center.x), at(center.z))[0];
        // Turned upside down its front looks down: single-sided, it is not seen from above.
        let expected = if mirror.y < 0.0 { 0.0 } else { 1.0 };
        // Half-float radiance.
        assert!((found - expected).abs() < 2e-3, "{mirror}: {found} is not {expected}");
    }
}
