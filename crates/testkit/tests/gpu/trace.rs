//! Rays through the BVH on the GPU against the same rays on the CPU, with nothing but what WebGPU
//! guarantees.

use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use chiaro::scene::{
    self, AlphaMode, Animation, Channel, Filter, Interpolation, Keys, Material, Mesh, MorphTarget, Node,
    Primitive, Scene, Transform, Wrap,
};
use chiaro_gpu::shader::Permutation;
use chiaro_gpu::wgpu::{TextureFormat, TextureUsages};
use chiaro_gpu::{ComputePipeline, Dispatch, Gpu, Life, Readback, Recorder, Texture, TextureOptions};
use chiaro_techniques::rays::{Refit, TraceData, TraceFacts, TraceScene, WORN};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::scene::motion::Motion;
use chiaro_techniques::{Pass, shaders};
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
    let loaded = SceneGpu::upload(gpu, &bench.kit.scene_layout, scene).unwrap();
    let traced = TraceData::build(scene, &scene.pose(0.0), &[]).upload(gpu).unwrap();
    shoot_at(gpu, (&bench, &loaded, &traced), rays)
}

/// A scene's trees, built at time 0 and let follow to other times one after the other.
struct Following {
    bench: Bench,
    loaded: SceneGpu,
    traced: TraceScene,
    passes: (Motion, Refit),
    recorder: Recorder,
}

impl Following {
    fn new(gpu: &Gpu, scene: &Scene) -> Self {
        let bench = Bench::new(gpu);
        let loaded = SceneGpu::upload(gpu, &bench.kit.scene_layout, scene).unwrap();
        let traced = TraceData::build(scene, &scene.pose(0.0), &[]).upload(gpu).unwrap();
        let passes = (Motion::compile(&bench.kit, &()).unwrap(), Refit::compile(&bench.kit, &()).unwrap());
        Self { bench, loaded, traced, passes, recorder: Recorder::new(gpu, false) }
    }

    /// Other trees by the same passes.
    fn load(&mut self, gpu: &Gpu, scene: &Scene) {
        self.loaded = SceneGpu::upload(gpu, &self.bench.kit.scene_layout, scene).unwrap();
        self.traced = TraceData::build(scene, &scene.pose(0.0), &[]).upload(gpu).unwrap();
    }

    fn go_to(&mut self, gpu: &Gpu, scene: &Scene, time_s: f64) {
        let pose = scene.pose(time_s);
        self.loaded.set_pose(scene, &pose);
        assert!(self.traced.update(gpu, scene, &pose));
        let mut frame = self.recorder.begin();
        self.passes.0.record(&mut frame, &self.loaded);
        self.passes.1.record(&mut frame, &self.loaded, &self.traced);
        frame.submit();
    }

    fn wear(&self, gpu: &Gpu) -> f32 {
        self.traced.wear(&self.traced.read_boxes(gpu).unwrap().wait(gpu).unwrap())
    }
}

fn shoot_at(
    gpu: &Gpu,
    (bench, loaded, traced): (&Bench, &SceneGpu, &TraceScene),
    rays: &[Ray],
) -> Vec<[f32; 4]> {
    let pipeline = shooter(gpu, bench, loaded, traced.facts);
    shoot_by(gpu, &pipeline, (bench, loaded, traced), rays)
}

fn shooter(gpu: &Gpu, bench: &Bench, loaded: &SceneGpu, facts: TraceFacts) -> ComputePipeline {
    let library = shaders::library().with(&[("tests/rays.cs.wesl", include_str!("wesl/rays.cs.wesl"))]);
    let layouts = [&bench.kit.frame_layout, &bench.kit.scene_layout];
    let constants = [&loaded.facts.constants()[..], &facts.constants()].concat();
    let entry = Permutation::plain("tests/rays.cs.wesl");
    ComputePipeline::new(gpu, &library, &entry, &layouts, &constants).unwrap()
}

fn shoot_by(
    gpu: &Gpu,
    pipeline: &ComputePipeline,
    (bench, loaded, traced): (&Bench, &SceneGpu, &TraceScene),
    rays: &[Ray],
) -> Vec<[f32; 4]> {
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
        frame.compute("test", pipeline, &groups, &binds, Dispatch::Threads([BATCH as u32, 1, 1]));
        frame.submit();
        let floats = Readback::start(gpu, &texture).unwrap().wait(gpu).unwrap().floats();
        let (found, _) = floats.as_chunks::<4>();
        hits.extend(&found[..batch.len()]);
    }
    hits
}

/// Rays between random places in and around the scene.
fn random_rays((lo, hi): (Vec3, Vec3), count: usize) -> Vec<Ray> {
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
    let rays = random_rays(scene.bounds().unwrap(), count);
    let hits = shoot(&device_guaranteed(), &scene, &rays);
    assert_hits(&Exact::new(&scene), &rays, &hits);
}

fn assert_hits(exact: &Exact, rays: &[Ray], hits: &[[f32; 4]]) {
    let (count, met) = (rays.len(), hits_as_on_the_cpu(exact, rays, hits));
    assert!(met > count / 20, "only {met} of {count} rays met anything");
}

/// How many there are.
fn hits_as_on_the_cpu(exact: &Exact, rays: &[Ray], hits: &[[f32; 4]]) -> usize {
    let count = rays.len();
    let mut differ = Vec::new();
    let mut met = 0;
    for (ray, hit) in rays.iter().zip(hits) {
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
    // Rays that pass an edge of the scene within rounding may do so on either side.
    assert!(
        differ.len() <= count / 5000,
        "{} of {count}: {:?}",
        differ.len(),
        &differ[..differ.len().min(5)]
    );
    met
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

/// Forty of one mesh, in all sizes and directions, every other one of which turns and grows.
fn crowd() -> Scene {
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
        let node = stage.scene.nodes.len() - 1;
        stage.scene.nodes[node].mesh = Some(0);
        if i % 2 == 0 {
            stage.scene.nodes[node].parent_from_node =
                Transform::Trs { translation: pose.translation.into(), rotation: turn, scale };
            let channel =
                |keys| Channel { node, times_s: vec![0.0, 1.0], interpolation: Interpolation::Linear, keys };
            let channels = vec![
                channel(Keys::Rotation(vec![turn, turn * Quat::from_rotation_x(1.5)])),
                channel(Keys::Scale(vec![scale, scale * Vec3::new(0.5, 1.5, -1.0)])),
            ];
            stage.scene.animations.push(Animation { name: String::new(), channels });
        }
    }
    stage.scene
}

#[test]
fn rays_meet_a_mesh_wherever_it_is_drawn() {
    assert_same_hits(crowd(), 10_000);
}

fn assert_follows(mut scene: Scene, count: usize) {
    scene.materials.iter_mut().for_each(|material| material.alpha = AlphaMode::Opaque);
    let gpu = device_guaranteed();
    let mut following = Following::new(&gpu, &scene);
    for time_s in [0.7, 0.2] {
        following.go_to(&gpu, &scene, time_s);
        let pose = scene.pose(time_s);
        let rays = random_rays(scene.bounds_at(&pose).unwrap(), count);
        let hits = shoot_at(&gpu, (&following.bench, &following.loaded, &following.traced), &rays);
        assert_hits(&Exact::at(&scene, &pose), &rays, &hits);
    }
}

#[test]
fn rays_meet_a_snake_where_it_has_bent_to() {
    assert_follows(scene::load("builtin:dancer").unwrap(), 5_000);
}

#[test]
fn rays_meet_what_flies_where_it_has_flown_to() {
    assert_follows(scene::load("builtin:flight").unwrap(), 5_000);
}

#[test]
fn rays_meet_a_crowd_that_turns_and_grows() {
    assert_follows(crowd(), 5_000);
}

#[test]
fn rays_meet_a_tube_that_bends_and_swells() {
    assert_follows(crate::motion::moving(), 5_000);
}

/// A mesh of so many large triangles that stands, moves, bends or has been bent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Small {
    Stands,
    Moves,
    Bends,
    Bent,
}

/// One of them, alone or beside a floor; with no triangle there is one that is no place.
fn small(kind: Small, count: usize, beside: bool) -> Scene {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    let mut random = Random::new(23 + count as u64);
    let mut three = || Vec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
    let mut mesh = Primitive { material, ..Primitive::default() };
    for corner in 0..3 * count.max(1) as u32 {
        mesh.positions.push(if count == 0 { Vec3::NAN } else { three() });
        mesh.normals.push(Vec3::Y);
        mesh.indices.push(corner);
    }
    let mut morph_weights = Vec::new();
    if matches!(kind, Small::Bends | Small::Bent) {
        let positions = mesh.positions.iter().map(|_| 0.7 * three()).collect();
        mesh.morph_targets = vec![MorphTarget { positions, ..MorphTarget::default() }];
        morph_weights = vec![if kind == Small::Bent { 0.8 } else { 0.0 }];
    }
    stage.place(Mesh { primitives: vec![mesh], morph_weights, ..Mesh::default() }, Affine3A::IDENTITY);
    let keys = match kind {
        Small::Moves => Some(Keys::Translation(vec![Vec3::ZERO, Vec3::new(0.5, 0.3, -0.4)])),
        Small::Bends => Some(Keys::MorphWeights(vec![0.0, 1.0])),
        Small::Stands | Small::Bent => None,
    };
    if let Some(keys) = keys {
        let node = stage.scene.nodes.len() - 1;
        stage.scene.nodes[node].parent_from_node = Transform::default();
        let channel = Channel { node, times_s: vec![0.0, 1.0], interpolation: Interpolation::Linear, keys };
        stage.scene.animations.push(Animation { name: String::new(), channels: vec![channel] });
    }
    if beside {
        stage.quad(Vec3::NEG_Y * 0.6, Vec3::X, Vec3::NEG_Z, material);
    }
    stage.scene
}

#[test]
fn trees_of_few_triangles_are_met_alone_and_beside_others_wherever_they_go() {
    let gpu = device_guaranteed();
    let rays = random_rays((Vec3::splat(-1.0), Vec3::ONE), 2 * BATCH);
    let mut following = Following::new(&gpu, &small(Small::Stands, 1, false));
    // One for all, and the one without a level that most of them would get.
    let [all, single] = [TraceFacts::default(), TraceFacts { levels: 0, masks: false }]
        .map(|facts| shooter(&gpu, &following.bench, &following.loaded, facts));
    for kind in [Small::Stands, Small::Moves, Small::Bends, Small::Bent] {
        for (count, beside) in (0..=8).flat_map(|count| [(count, false), (count, true)]) {
            let scene = small(kind, count, beside);
            following.load(&gpu, &scene);
            following.go_to(&gpu, &scene, 0.7);
            let fits = following.traced.facts.levels == 0;
            for pipeline in [Some(&all), fits.then_some(&single)].into_iter().flatten() {
                let traced = (&following.bench, &following.loaded, &following.traced);
                let hits = shoot_by(&gpu, pipeline, traced, &rays);
                if count == 0 {
                    // On the CPU a triangle that is no place would be anywhere.
                    let met = hits.iter().filter(|hit| hit[0] >= 0.0).count();
                    assert_eq!(met > rays.len() / 10, beside, "{kind:?}: {met}");
                    continue;
                }
                let met = hits_as_on_the_cpu(&Exact::at(&scene, &scene.pose(0.7)), &rays, &hits);
                assert!(met > rays.len() / 100, "{kind:?} {count} {beside}: only {met} rays met anything");
            }
        }
    }
}

#[test]
fn shaders_leave_out_what_a_scene_does_not_have() {
    let facts = |scene: &Scene| TraceData::build(scene, &scene.pose(0.0), &[]).facts();
    let mut stage = Stage::floor(0.5);
    assert_eq!(facts(&stage.scene), TraceFacts { levels: 0, masks: false });
    stage.scene.materials[0].alpha = AlphaMode::Mask { cutoff: 0.5 };
    assert_eq!(facts(&stage.scene), TraceFacts { levels: 0, masks: true });
    assert_eq!(facts(&crowd()), TraceFacts { levels: 2, masks: false });
    let mut bent = crate::motion::moving();
    bent.animations.clear();
    assert_eq!(facts(&bent), TraceFacts { levels: 1, masks: false });
}

#[test]
fn a_tree_wears_as_its_mesh_bends_away_from_what_it_was_built_for() {
    let gpu = device_guaranteed();
    let scene = ball();
    let mut following = Following::new(&gpu, &scene);
    following.go_to(&gpu, &scene, 0.0);
    let fresh = following.wear(&gpu);
    assert!((fresh - 1.0).abs() < 0.02, "{fresh}");
    following.go_to(&gpu, &scene, 1.0);
    let worn = following.wear(&gpu);
    assert!(worn > WORN, "{worn}");
    let pose = scene.pose(1.0);
    following.traced = TraceData::build(&scene, &pose, &[]).upload(&gpu).unwrap();
    following.go_to(&gpu, &scene, 1.0);
    let anew = following.wear(&gpu);
    assert!((anew - 1.0).abs() < 0.02, "{anew}");
}

/// A sheet whose quads go to random places of a ball within a second.
pub fn ball() -> Scene {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    let mut mesh = sheet(material);
    let mut random = Random::new(5);
    for primitive in &mut mesh.primitives {
        let to = Vec3::from_array([0; 3].map(|_| random.within(-1.0, 1.0)));
        let positions = primitive.positions.iter().map(|_| to).collect();
        primitive.morph_targets = vec![MorphTarget { positions, ..MorphTarget::default() }];
    }
    mesh.morph_weights = vec![0.0];
    stage.place(mesh, Affine3A::IDENTITY);
    let node = stage.scene.nodes.len() - 1;
    let channel = Channel {
        node,
        times_s: vec![0.0, 1.0],
        interpolation: Interpolation::Linear,
        keys: Keys::MorphWeights(vec![0.0, 1.0]),
    };
    stage.scene.animations.push(Animation { name: String::new(), channels: vec![channel] });
    stage.scene
}

/// A ball of 1 m around a place, closed: neighbours share their corners.
fn closed_ball(material: usize, center: Vec3) -> Primitive {
    const SIDES: u32 = 48;
    const RINGS: u32 = 24;
    let mut ball = Primitive { material, ..Primitive::default() };
    for i in 0..(RINGS + 1) * SIDES {
        let (ring, side) = (i / SIDES, i % SIDES);
        // The poles are all one place.
        let (y, r) = match ring {
            0 => (1.0, 0.0),
            RINGS => (-1.0, 0.0),
            _ => {
                let angle = PI * ring as f32 / RINGS as f32;
                (angle.cos(), angle.sin())
            }
        };
        let around = 2.0 * PI * side as f32 / SIDES as f32;
        ball.positions.push(center + Vec3::new(r * around.cos(), y, r * around.sin()));
        ball.normals.push(Vec3::Y);
        if ring < RINGS {
            let next = ring * SIDES + (side + 1) % SIDES;
            ball.indices.extend([i, next, i + SIDES, i + SIDES, next, next + SIDES]);
        }
    }
    ball
}

/// Rays from within a ball to its corners, to places on its edges and anywhere between.
fn rays_at_seams(ball: &Primitive, center: Vec3, count: usize) -> Vec<Ray> {
    let mut random = Random::new(17);
    let triangles = ball.indices.as_chunks::<3>().0;
    let ray = |i: usize| {
        let [a, b, c] = triangles[i * 7 % triangles.len()].map(|corner| ball.positions[corner as usize]);
        let target = match i % 3 {
            0 => a,
            1 => a.lerp(c, random.within(0.0, 1.0)),
            _ => a.lerp(b, random.within(0.0, 1.0)),
        };
        let origin = center + Vec3::from_array([0; 3].map(|_| random.within(-0.4, 0.4)));
        Ray { origin, t_min: 0.0, direction: target - origin, t_max: 9.0 }
    };
    (0..count).map(ray).collect()
}

#[test]
fn no_ray_slips_out_of_a_closed_ball_between_its_triangles() {
    // At places where coordinates are coarse, lying there and carried there.
    for (center, carried) in
        [(Vec3::ZERO, false), (Vec3::new(90.0, -7.0, 31.0), false), (Vec3::X * 50.0, true)]
    {
        let mut stage = Stage::new();
        let material = stage.lambert(0.5);
        let own = if carried { Vec3::ZERO } else { center };
        let mut ball = closed_ball(material, own);
        let mesh = Mesh { primitives: vec![ball.clone()], ..Mesh::default() };
        stage.place(mesh, Affine3A::from_translation(center - own));
        if carried {
            let node = stage.scene.nodes.len() - 1;
            let second = Node { mesh: stage.scene.nodes[node].mesh, ..Node::default() };
            stage.scene.nodes.push(second);
            ball = closed_ball(material, center);
        }
        let rays = rays_at_seams(&ball, center, 20_000);
        let hits = shoot(&device_guaranteed(), &stage.scene, &rays);
        let out = hits.iter().filter(|hit| hit[0] < 0.0 || hit[1] == 0.0).count();
        assert_eq!(out, 0, "of {} at {center}", rays.len());
    }
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
