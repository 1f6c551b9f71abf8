//! Rays through the BVH on the GPU against the same rays on the CPU, with nothing but what WebGPU
//! guarantees.

use bytemuck::{Pod, Zeroable};
use chiaro::scene::{self, AlphaMode, Filter, Material, Mesh, Scene, Wrap};
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{ComputePipeline, Dispatch, Gpu, Life, Readback, Recorder, Texture, TextureOptions};
use chiaro_techniques::reference::bvh::TraceData;
use chiaro_techniques::shaders;
use chiaro_techniques::surface::SceneGpu;
use chiaro_testkit::{Bench, Exact, Stage, device_guaranteed};
use glam::{Affine3A, Quat, Vec3};

use crate::culling::Random;

const BATCH: usize = 2048;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Ray {
    origin: Vec3,
    t_min: f32,
    direction: Vec3,
    t_max: f32,
}

/// Distance (−1 = a miss), whether anything is met before `t_max`, instance, sum of the barycentrics.
fn shoot(gpu: &Gpu, scene: &Scene, rays: &[Ray]) -> Vec<[f32; 4]> {
    let bench = Bench::new(gpu);
    let loaded = SceneGpu::upload(gpu, &bench.scene_layout, scene).unwrap();
    let traced = TraceData::build(scene, &scene.pose(0.0)).upload(gpu).unwrap();
    let library = shaders::library().with(&[("tests/rays.cs.wesl", include_str!("wesl/rays.cs.wesl"))]);
    let layouts = [&bench.frame_layout, &bench.scene_layout];
    let constants = loaded.facts.constants();
    let entry = Permutation::plain("tests/rays.cs.wesl");
    let pipeline = ComputePipeline::new(gpu, &library, &entry, &layouts, &constants).unwrap();
    let usage = TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
    let options = TextureOptions::new(BATCH as u32, 1, TextureFormat::Rgba32Float, usage);
    let texture = Texture::new(gpu, "hits", Life::Kept, options);
    let groups = [bench.frame.group(), loaded.group()];
    let mut recorder = Recorder::new(gpu, false);
    let mut hits = Vec::new();
    for batch in rays.chunks(BATCH) {
        let mut padded = batch.to_vec();
        padded.resize(BATCH, Ray::zeroed());
        let buffer = bench.buffer("rays", &padded);
        let binds =
            [("rays", (&buffer).into()), ("tracer", (&traced.words).into()), ("hits", (&texture).into())];
        let mut frame = recorder.begin();
        frame.compute("test", &pipeline, &groups, &binds, Dispatch::Threads([BATCH as u32, 1, 1]));
        frame.submit();
        let floats = Readback::start(gpu, &texture).unwrap().wait(gpu).unwrap().floats();
        let (found, _) = floats.as_chunks::<4>();
        hits.extend(&found[..batch.len()]);
    }
    hits
}

/// Rays between random places in and around the scene.
fn random_rays(scene: &Scene, count: usize) -> Vec<Ray> {
    let (lo, hi) = scene.bounds().unwrap();
    let (middle, half) = (0.5 * (lo + hi), 0.55 * (hi - lo) + 0.01);
    let mut random = Random::new(11);
    let mut point = || middle + half * Vec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
    let ray = |i: usize| {
        let (origin, target) = (point(), point());
        let direction = (target - origin).normalize();
        // Every eighth along an axis, where slabs divide by zero.
        let direction =
            if i.is_multiple_of(8) { Vec3::AXES[i / 8 % 3] * direction.z.signum() } else { direction };
        Ray { origin, t_min: 0.0, direction, t_max: (target - origin).length() }
    };
    (0..count).map(ray).collect()
}

fn assert_same_hits(mut scene: Scene, count: usize) {
    // The twin on the CPU knows no masks.
    scene.materials.iter_mut().for_each(|material| material.alpha = AlphaMode::Opaque);
    let exact = Exact::new(&scene);
    let rays = random_rays(&scene, count);
    let hits = shoot(&device_guaranteed(), &scene, &rays);
    let mut differ = Vec::new();
    let mut met = 0;
    for (ray, hit) in rays.iter().zip(&hits) {
        let expected = exact.nearest(ray.origin, ray.direction);
        let t = expected.map(|at| (at.position - ray.origin).dot(ray.direction));
        let same = match t {
            None => hit[0] < 0.0,
            // Grazing rays and close starts are as good as positions are, a hundredth of a millimetre a metre.
            Some(t) => hit[0] >= 0.0 && (hit[0] - t).abs() <= 1e-4 * t.max(0.1),
        };
        met += usize::from(t.is_some());
        let on_the_edge = t.is_some_and(|t| (t - ray.t_max).abs() <= 1e-4 * ray.t_max);
        let any = on_the_edge || (hit[1] > 0.0) == t.is_some_and(|t| t < ray.t_max);
        if !same || !any {
            differ.push((t, *hit, ray.t_max));
        }
    }
    assert!(met > count / 20, "only {met} of {count} rays met anything");
    // Rays that pass an edge of the scene within rounding may do so on either side.
    assert!(
        differ.len() <= count / 5000,
        "{} of {count}: {:?}",
        differ.len(),
        &differ[..differ.len().min(5)]
    );
}

#[test]
fn rays_meet_the_same_places_of_a_nave_as_on_the_cpu() {
    assert_same_hits(scene::load("builtin:nave").unwrap(), 10_000);
}

#[test]
fn rays_meet_the_same_places_of_a_courtyard_as_on_the_cpu() {
    assert_same_hits(scene::load("builtin:courtyard").unwrap(), 10_000);
}

#[test]
fn rays_meet_a_bending_snake_as_on_the_cpu() {
    assert_same_hits(scene::load("builtin:dancer").unwrap(), 10_000);
}

/// A wavy sheet of 2,048 triangles.
fn sheet(material: usize) -> Mesh {
    let mut stage = Stage::new();
    for i in 0..1024 {
        let (x, z) = ((i % 32) as f32 / 16.0 - 1.0, (i / 32) as f32 / 16.0 - 1.0);
        let y = 0.2 * (5.0 * x).sin() * (3.0 * z).cos();
        stage.quad(Vec3::new(x, y, z), Vec3::X / 32.0, Vec3::NEG_Z / 32.0, material);
    }
    let primitives = stage.scene.meshes.into_iter().flat_map(|mesh| mesh.primitives).collect();
    Mesh { primitives, ..Mesh::default() }
}

#[test]
fn rays_meet_a_mesh_wherever_it_is_drawn() {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    stage.scene.meshes.push(sheet(material));
    let mut random = Random::new(3);
    for i in 0..40 {
        let mut three = |reach: f32| Vec3::from_array([0; 3].map(|_| random.within(-reach, reach)));
        let turn = Quat::from_scaled_axis(three(3.0));
        // Mirrored, stretched, and one squeezed flat.
        let scale = if i == 7 { Vec3::new(1.0, 0.0, 1.0) } else { three(1.5) };
        let pose = Affine3A::from_scale_rotation_translation(scale, turn, three(4.0));
        stage.place(Mesh::default(), pose);
        stage.scene.nodes.last_mut().unwrap().mesh = Some(0);
    }
    assert_same_hits(stage.scene, 10_000);
}

#[test]
fn rays_pass_where_a_mask_is_cut_out() {
    let mut stage = Stage::new();
    let rgba = (0..64).flat_map(|i| [255, 255, 255, if i % 8 < 4 { 255 } else { 0 }]).collect();
    let texture = stage.texture(8, [Wrap::Clamp; 2], Filter::Nearest, rgba);
    let material = stage.material(Material {
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        base_color_texture: Some(texture),
        ..Material::default()
    });
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, material);
    let rays = [(-0.9, -1.0), (-0.1, -1.0), (0.1, -1.0), (0.9, -1.0), (-0.5, 1.0), (0.5, 1.0)];
    let rays = rays.map(|(x, y)| Ray {
        origin: Vec3::new(x, -2.0 * y, 0.3),
        t_min: 0.0,
        direction: Vec3::Y * y,
        t_max: 3.0,
    });
    let hits = shoot(&device_guaranteed(), &stage.scene, &rays);
    let expected = [true, true, false, false, true, false];
    for (hit, expected) in hits.iter().zip(expected) {
        assert_eq!((hit[0] > 0.0, hit[1] > 0.0), (expected, expected), "{hits:?}");
    }
}

#[test]
fn strange_rays_and_triangles_meet_nothing() {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, material);
    stage.quad(Vec3::NAN, Vec3::X, Vec3::NEG_Z, material);
    stage.quad(Vec3::INFINITY, Vec3::X, Vec3::NEG_Z, material);
    stage.quad(Vec3::Y, Vec3::ZERO, Vec3::ZERO, material);
    let down = Ray { origin: Vec3::new(0.1, 2.0, 0.2), t_min: 0.0, direction: Vec3::NEG_Y, t_max: 9.0 };
    let rays = [
        down,
        Ray { direction: Vec3::ZERO, ..down },
        Ray { direction: Vec3::NAN, ..down },
        Ray { origin: Vec3::NAN, ..down },
        Ray { origin: Vec3::INFINITY, ..down },
        Ray { t_max: 1.5, ..down },
        Ray { origin: Vec3::new(0.0, 1.0, 0.0), direction: Vec3::X, ..down },
    ];
    let hits = shoot(&device_guaranteed(), &stage.scene, &rays);
    assert!((hits[0][0] - 2.0).abs() < 1e-6 && hits[0][1] == 1.0, "{hits:?}");
    assert!(hits[1..5].iter().all(|hit| hit[0] < 0.0 && hit[1] == 0.0), "{hits:?}");
    assert!(hits[5][1] == 0.0 && hits[6][0] < 0.0, "{hits:?}");
    let empty = shoot(&device_guaranteed(), &Scene::default(), &rays[..1]);
    assert!(empty[0][0] < 0.0 && empty[0][1] == 0.0, "{empty:?}");
}
