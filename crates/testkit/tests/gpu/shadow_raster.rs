//! The compute rasteriser against the hardware's, texel by texel.

use bytemuck::cast_slice;
use chiaro::Pipeline;
use chiaro::scene::{self, AlphaMode, Filter, Id, LightKind, Material, Mesh, Primitive, Scene, Wrap};
use chiaro_gpu::wgpu::{Face, TextureFormat, TextureUsages};
use chiaro_gpu::{
    DepthAttachment, Gpu, Life, Readback, Recorder, RenderPipeline, RenderPipelineOptions, Targets, Texture,
    TextureOptions,
};
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::scene::CLASSES;
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::view::culling::{Culling, DEPTH_COMPARE, DrawLists, ListRoom, draw_classes, kinds};
use chiaro_techniques::view::raster::{ComputeRaster, Draws};
use chiaro_techniques::view::{ViewData, ViewTable};
use chiaro_techniques::{Pass, shaders};
use chiaro_testkit::{Bench, Stage, Studio, camera_above, device, device_guaranteed, direct, nmae};
use glam::{Affine3A, Mat4, Quat, Vec2, Vec3, Vec4};

use crate::culling::Random;

const ANISOTROPY: u32 = 4;

/// A view to draw.
#[derive(Clone, Copy, Debug)]
struct RasterView {
    clip_from_ws: Mat4,
    /// Whether what is before the near plane is dropped; otherwise its depth is 1.
    clip_near: bool,
    layer: u32,
}

impl RasterView {
    fn data(&self, side: u32) -> ViewData {
        let data = ViewData::new(&self.clip_from_ws, Vec4::W, [side; 2]);
        let data = if self.clip_near { data } else { data.clamping_near() };
        ViewData { layer: self.layer, ..data }
    }
}

/// Both ways of rasterising one scene.
struct Both<'a> {
    gpu: &'a Gpu,
    bench: Bench,
    scene: SceneGpu,
    culling: Culling,
    raster: ComputeRaster,
    cull_front: bool,
}

impl<'a> Both<'a> {
    fn new(gpu: &'a Gpu, scene: &Scene, cull_front: bool) -> Self {
        let bench = Bench::new(gpu);
        let library = shaders::library();
        bench.set_frame(&FrameData { anisotropy: ANISOTROPY, ..bytemuck::Zeroable::zeroed() });
        let scene = SceneGpu::upload(gpu, &bench.kit.scene_layout, scene).unwrap();
        Self {
            gpu,
            culling: Culling::compile(&bench.kit, &()).unwrap(),
            raster: {
                let draws = Draws::Depth { cull_front };
                ComputeRaster::new(gpu, &library, &bench.kit.scene_layout, scene.facts, draws).unwrap()
            },
            bench,
            scene,
            cull_front,
        }
    }

    /// The views' table, culled for.
    fn lists(
        &mut self,
        frame: &mut chiaro_gpu::Frame<'_>,
        views: &[RasterView],
        side: u32,
    ) -> (ViewTable, DrawLists) {
        let views: Vec<_> = views.iter().map(|view| view.data(side)).collect();
        let mut table = ViewTable::new(self.gpu);
        table.anisotropy = ANISOTROPY;
        table.set(self.gpu, &views, &[], views.len());
        table.upload(frame);
        let room = ListRoom::new(self.gpu, &self.scene, views.len());
        let lists = self.culling.record(frame, &self.scene, &table, table.batches()[0].clone(), &room);
        (table, lists)
    }

    fn hardware(&mut self, view: &RasterView, resolution: u32) -> Vec<f32> {
        let usage = TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC;
        let options = TextureOptions::new(resolution, resolution, TextureFormat::Depth32Float, usage);
        let map = Texture::new(self.gpu, "map", Life::Kept, options.array(1));
        let materials = self.scene.facts.constants();
        let library = shaders::library();
        let pipeline = |class: usize| {
            let masked = class & 2 != 0;
            let options = RenderPipelineOptions {
                depth: Some((TextureFormat::Depth32Float, DEPTH_COMPARE)),
                cull: self.cull_front.then_some(Face::Front),
                unclipped_depth: !view.clip_near,
                constants: if masked { &materials } else { &[] },
                ..Default::default()
            };
            let shared = &[&self.bench.kit.frame_layout, &self.bench.kit.scene_layout];
            let permutation = shaders::shadow_depth(masked);
            RenderPipeline::new(self.gpu, &library, &permutation, shared, &options)
        };
        let pipelines = kinds(self.scene.facts.draws(0..CLASSES), pipeline).unwrap();
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        let (table, lists) = self.lists(&mut frame, &[*view], resolution);
        let depth = Some(DepthAttachment { texture: &map, layer: 0, clear: Some(0.0) });
        frame.render("hardware", Targets { color: &[], depth }, |pass| {
            let shared = &[self.bench.frame.group(), self.scene.group()];
            let binds = [("view", table.view(0))];
            draw_classes(pass, &pipelines, self.scene.classes(), shared, &binds, (&lists, 0, true));
        });
        frame.submit();
        cast_slice(&Readback::start(self.gpu, &map).unwrap().wait(self.gpu).unwrap().bytes).to_vec()
    }

    /// The map of the last view, which goes to layer 0.
    fn compute(&mut self, views: &[RasterView], resolution: u32) -> Vec<f32> {
        let room = self.raster.room(self.gpu, [resolution; 2], views.len());
        let usage = TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        let options = TextureOptions::new(resolution, resolution, TextureFormat::R32Float, usage);
        let maps = Texture::new(self.gpu, "maps", Life::Kept, options.array(views.len().max(2) as u32));
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        let (table, lists) = self.lists(&mut frame, views, resolution);
        let drawn = lists.views.clone();
        self.raster.record(&mut frame, &self.scene, (&table, &lists), drawn, &room, &maps);
        frame.submit();
        Readback::start(self.gpu, &maps).unwrap().wait(self.gpu).unwrap().floats()
    }

    /// Share of texels that differ by more than `tolerance`, which are all on edges.
    fn assert_same(&mut self, name: &str, view: &RasterView, resolution: u32, tolerance: f32, share: f64) {
        let hardware = self.hardware(view, resolution);
        let compute = self.compute(&[*view], resolution);
        assert_eq!(hardware.len(), compute.len());
        let differ = |(a, b): (&f32, &f32)| (a - b).abs() > tolerance;
        let found = hardware.iter().zip(&compute).filter(|pair| differ(*pair)).count();
        let covered = hardware.iter().filter(|depth| **depth > 0.0).count();
        assert!(covered * 20 > hardware.len(), "{name}: only {covered} texels covered");
        assert!(found as f64 <= share * covered as f64, "{name}: {found} of {covered} texels differ");
    }
}

fn orthographic(turn: Quat, half: f32, near: f32, far: f32) -> RasterView {
    let a = 1.0 / (far - near);
    let clip_from_vs = Mat4::from_cols(
        Vec4::new(1.0 / half, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 1.0 / half, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, 0.0),
        Vec4::new(0.0, 0.0, a * far, 1.0),
    );
    RasterView { clip_from_ws: clip_from_vs * Mat4::from_quat(turn), clip_near: false, layer: 0 }
}

fn spot(eye: Vec3, target: Vec3, clip_near: bool) -> RasterView {
    let (near, far) = (0.05, 50.0);
    let a = near / (far - near);
    let clip_from_vs = Mat4::from_cols(
        Vec4::new(0.9, 0.0, 0.0, 0.0),
        Vec4::new(0.0, 0.9, 0.0, 0.0),
        Vec4::new(0.0, 0.0, a, -1.0),
        Vec4::new(0.0, 0.0, a * far, 0.0),
    );
    let turn = Quat::from_rotation_arc((target - eye).normalize(), Vec3::NEG_Z);
    let clip_from_ws = clip_from_vs * Mat4::from_quat(turn) * Mat4::from_translation(-eye);
    RasterView { clip_from_ws, clip_near, layer: 0 }
}

fn awkward() -> Quat {
    Quat::from_euler(glam::EulerRot::XYZ, 0.513, -0.271, 0.377)
}

/// Triangles that share corners.
fn mesh(positions: Vec<Vec3>, indices: Vec<u32>, material: Id) -> Mesh {
    let normals = vec![Vec3::Y; positions.len()];
    let primitive = Primitive { positions, normals, indices, material, ..Primitive::default() };
    Mesh { primitives: vec![primitive], ..Mesh::default() }
}

fn sphere(center: Vec3, radius: f32, rings: u32, material: Id) -> Mesh {
    use std::f32::consts::PI;
    let sides = 2 * rings;
    let mut positions = Vec::new();
    for ring in 0..=rings {
        for side in 0..sides {
            let (theta, phi) = (PI * ring as f32 / rings as f32, 2.0 * PI * side as f32 / sides as f32);
            let direction = Vec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin());
            positions.push(center + radius * direction);
        }
    }
    let mut indices = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let next = (side + 1) % sides;
            let [a, b] = [ring * sides + side, ring * sides + next];
            indices.extend([a, b, b + sides, a, b + sides, a + sides]);
        }
    }
    mesh(positions, indices, material)
}

/// A sheet over the unit square (x, z in ±1), of uneven cells with shaken corners and heights.
fn sheet(cells: usize, shake: f32, material: Id) -> Mesh {
    let mut random = Random::new(11);
    let at = |i: usize| 2.0 * (i as f32 / cells as f32).powi(3) - 1.0;
    let mut positions = Vec::new();
    for z in 0..=cells {
        for x in 0..=cells {
            let inner = |i: usize| if i == 0 || i == cells { 0.0 } else { 1.0 };
            let step = |i: usize| at((i + 1).min(cells)) - at(i.min(cells - 1));
            let mut shaken = |i: usize| at(i) + inner(i) * step(i) * random.within(-0.3, 0.3) * shake;
            let (px, pz) = (shaken(x), shaken(z));
            positions.push(Vec3::new(px, random.within(-0.1, 0.1) * shake, pz));
        }
    }
    let mut indices = Vec::new();
    let row = cells as u32 + 1;
    for z in 0..cells as u32 {
        for x in 0..cells as u32 {
            let a = z * row + x;
            indices.extend([a, a + row, a + 1, a + 1, a + row, a + row + 1]);
        }
    }
    mesh(positions, indices, material)
}

fn lambert() -> (Stage, Id) {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    (stage, material)
}

#[test]
fn slanted_quads_and_spheres_are_those_of_the_hardware() {
    let (mut stage, material) = lambert();
    let mut random = Random::new(3);
    for _ in 0..40 {
        let mut vector = |r: f32| Vec3::new(random.within(-r, r), random.within(-r, r), random.within(-r, r));
        let (center, u, v) = (vector(2.0), vector(0.7), vector(0.7));
        stage.quad(center, u, v, material);
    }
    // A dense sphere, whose triangles are smaller than texels, and a coarse one.
    stage.place(sphere(Vec3::new(1.0, 0.5, 0.0), 0.5, 200, material), Affine3A::IDENTITY);
    stage.place(sphere(Vec3::new(-1.0, -0.5, 0.5), 0.8, 8, material), Affine3A::IDENTITY);
    let gpu = device();
    for cull_front in [false, true] {
        let mut both = Both::new(&gpu, &stage.scene, cull_front);
        // The second size is no whole number of blocks.
        for resolution in [512, 203] {
            let name = format!("orthographic {resolution} {cull_front}");
            both.assert_same(&name, &orthographic(awkward(), 2.5, -4.0, 4.0), resolution, 2e-6, 1e-3);
            let name = format!("spot {resolution} {cull_front}");
            let view = spot(Vec3::new(3.0, 3.0, 2.0), Vec3::ZERO, true);
            both.assert_same(&name, &view, resolution, 2e-6, 1e-3);
        }
    }
}

#[test]
fn what_reaches_before_the_near_plane_and_behind_the_eye_is_that_of_the_hardware() {
    let (mut stage, material) = lambert();
    stage.quad(Vec3::new(0.0, -1.0, 0.0), Vec3::X * 30.0, Vec3::NEG_Z * 30.0, material);
    stage.quad(Vec3::new(2.0, 0.0, 0.3), Vec3::new(4.0, 1.0, 0.4), Vec3::new(0.2, 3.0, -0.7), material);
    stage.quad(Vec3::new(0.02, 0.0, 0.0), Vec3::Y * 0.01, Vec3::Z * 0.01, material);
    let gpu = device();
    let mut both = Both::new(&gpu, &stage.scene, false);
    for clip_near in [true, false] {
        for target in [Vec3::new(1.0, -0.3, 0.1), Vec3::new(-1.0, -0.1, 0.7), Vec3::new(0.1, -1.0, -0.1)] {
            let view = spot(Vec3::ZERO, target, clip_near);
            both.assert_same(&format!("{target} {clip_near}"), &view, 256, 2e-6, 2e-3);
        }
        let view = RasterView { clip_near, ..orthographic(awkward(), 3.0, 0.5, 2.0) };
        both.assert_same(&format!("orthographic {clip_near}"), &view, 256, 2e-6, 2e-3);
    }
}

#[test]
fn triangles_far_larger_than_the_map_are_those_of_the_hardware() {
    for (size, tolerance) in [(10.0, 2e-6), (100.0, 2e-6), (2000.0, 2e-5)] {
        let (mut stage, material) = lambert();
        stage.quad(
            Vec3::ZERO,
            Vec3::new(size, 0.01 * size, 0.3 * size),
            Vec3::new(0.2, 0.0, -size),
            material,
        );
        stage.quad(Vec3::new(0.4, 0.3, 0.0), Vec3::X * 0.1, Vec3::NEG_Z * size, material);
        let gpu = device();
        let mut both = Both::new(&gpu, &stage.scene, false);
        let view = orthographic(awkward(), 1.0, -20.0, 20.0);
        both.assert_same(&format!("{size} m"), &view, 512, tolerance, 2e-3);
    }
}

/// A quad and thirty small ones with holes, over a whole one.
pub fn sieves() -> Stage {
    let mut stage = Stage::new();
    let mut random = Random::new(8);
    let side = 64;
    let rgba = (0..side * side).flat_map(|_| [255, 255, 255, random.within(0.0, 255.0) as u8]).collect();
    let texture = stage.texture(side, [Wrap::Repeat; 2], Filter::Linear, rgba);
    let material = stage.material(Material {
        base_color_texture: Some(texture),
        alpha: AlphaMode::Mask { cutoff: 0.45 },
        double_sided: true,
        ..Material::default()
    });
    let solid = stage.lambert(0.5);
    stage.quad(Vec3::ZERO, Vec3::new(1.5, 0.4, 0.0), Vec3::new(0.0, 0.7, -1.5), material);
    stage.quad(Vec3::new(0.3, -1.0, 0.0), Vec3::X, Vec3::NEG_Z, solid);
    for i in 0..30 {
        let at = Vec3::new(0.1 * i as f32 - 1.5, 1.0, 0.3);
        stage.quad(at, Vec3::new(0.04, 0.0, 0.01), Vec3::new(0.0, 0.01, -0.03), material);
    }
    stage
}

#[test]
fn holes_of_masked_casters_are_those_of_the_hardware() {
    let stage = sieves();
    let gpu = device();
    let mut both = Both::new(&gpu, &stage.scene, false);
    // Quads of fragments tell differences for gradients, the compute path the gradient itself: filtering differs a little
    // in perspective, and with it what is just at the cut-off.
    both.assert_same("orthographic", &orthographic(awkward(), 2.0, -4.0, 4.0), 256, 2e-6, 2e-3);
    both.assert_same("spot", &spot(Vec3::new(1.0, 3.0, 0.5), Vec3::ZERO, true), 256, 2e-6, 1e-2);
}

#[test]
fn a_whole_scene_is_that_of_the_hardware_whatever_is_drawn_beside_it_and_the_same_every_time() {
    let scene = scene::load("builtin:nave").unwrap();
    let gpu = device();
    let mut both = Both::new(&gpu, &scene, false);
    let (lo, hi) = scene.bounds().unwrap();
    let reach = 0.5 * lo.distance(hi);
    let center = Mat4::from_translation(-0.5 * (lo + hi));
    let view = |half: f32| {
        let view = orthographic(awkward(), half, -reach, reach);
        RasterView { clip_from_ws: view.clip_from_ws * center, ..view }
    };
    both.assert_same("whole", &view(reach), 512, 5e-6, 5e-4);
    both.assert_same("part", &view(0.1 * reach), 512, 5e-6, 5e-4);
    let alone = both.compute(&[view(reach)], 512);
    assert!(alone == both.compute(&[view(reach)], 512), "another run");
    let beside = RasterView { layer: 1, ..view(0.3 * reach) };
    let third = RasterView { layer: 2, ..spot(Vec3::ZERO, Vec3::ONE, true) };
    assert!(alone == both.compute(&[beside, view(reach), third], 512), "beside other views");
}

#[test]
fn a_sheet_of_triangles_has_no_hole() {
    let (mut stage, material) = lambert();
    stage.place(sheet(48, 1.0, material), Affine3A::IDENTITY);
    let gpu = device();
    let mut both = Both::new(&gpu, &stage.scene, false);
    let mut random = Random::new(21);
    let down = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    for round in 0..12 {
        // Near views see few large triangles of a part, far ones all of them; always from above, so that no texel is free.
        let half = [0.02, 0.1, 0.4, 0.6][round % 4];
        let tilt = Quat::from_rotation_z(random.within(-3.0, 3.0)) * down;
        let view = orthographic(tilt, half, -4.0, 4.0);
        let shift = Vec2::new(random.within(-0.1, 0.1), random.within(-0.1, 0.1));
        let moved = Mat4::from_translation(Vec3::new(shift.x, 0.0, shift.y));
        let view = RasterView { clip_from_ws: view.clip_from_ws * moved, ..view };
        let map = both.compute(&[view], 256);
        let free = map.iter().filter(|depth| **depth <= 0.0).count();
        assert_eq!(free, 0, "round {round}");
        let eye = Vec3::new(shift.x, 0.15 + 0.5 * half, shift.y);
        let view = spot(eye, eye + Vec3::NEG_Y, false);
        let free = both.compute(&[view], 256).iter().filter(|depth| **depth <= 0.0).count();
        assert_eq!(free, 0, "round {round} in perspective");
    }
}

#[test]
fn a_fan_that_reaches_far_beyond_the_map_has_no_hole() {
    let (mut stage, material) = lambert();
    let count = 40u32;
    let mut positions = vec![Vec3::new(0.013, 0.0, -0.021)];
    positions.extend((0..count).map(|i| {
        let angle = i as f32 / count as f32 * std::f32::consts::TAU;
        // From just outside the map to five hundred times as far.
        let far = 1.7 * 300f32.powf((i % 7) as f32 / 6.0);
        Vec3::new(angle.cos() * far, 0.0, angle.sin() * far)
    }));
    let indices = (0..count).flat_map(|i| [0, 1 + (i + 1) % count, 1 + i]).collect();
    stage.place(mesh(positions, indices, material), Affine3A::IDENTITY);
    let gpu = device();
    let mut both = Both::new(&gpu, &stage.scene, false);
    let down = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    for turn in 0..8 {
        let tilt = Quat::from_rotation_z(0.37 * turn as f32) * down;
        let map = both.compute(&[orthographic(tilt, 1.0, -4.0, 4.0)], 512);
        let free = map.iter().filter(|depth| **depth <= 0.0).count();
        assert_eq!(free, 0, "turn {turn}");
    }
}

#[test]
fn more_tiles_than_the_list_holds_lose_no_triangle() {
    let (mut stage, material) = lambert();
    for i in 0..1100 {
        // Each fills all 36 tiles; the list holds one for every sixteen texels.
        let at = Vec3::new(0.0, 0.001 * i as f32, 0.0);
        stage.quad(at, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, material);
    }
    let gpu = device();
    let mut both = Both::new(&gpu, &stage.scene, false);
    let down = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
    both.assert_same("crowd", &orthographic(down, 1.0, -4.0, 4.0), 384, 2e-6, 0.0);
}

#[test]
fn it_runs_with_no_more_than_is_guaranteed() {
    let (mut stage, material) = lambert();
    stage.quad(Vec3::ZERO, Vec3::X * 2.0, Vec3::NEG_Z * 2.0, material);
    let gpu = device_guaranteed();
    let mut both = Both::new(&gpu, &stage.scene, false);
    assert!(both.compute(&[spot(Vec3::Y, Vec3::ZERO, true)], 64).iter().all(|depth| *depth > 0.0));
}

#[test]
fn a_picture_lit_through_computed_maps_is_that_of_the_hardwares() {
    let (mut stage, material) = lambert();
    stage.quad(Vec3::ZERO, Vec3::X * 3.0, Vec3::NEG_Z * 3.0, material);
    for i in 0..6 {
        let at = Vec3::new(0.5 * i as f32 - 1.2, 0.3 + 0.1 * i as f32, 0.2 * i as f32 - 0.5);
        stage.quad(at, Vec3::new(0.2, 0.1, 0.0), Vec3::new(0.05, 0.0, -0.2), material);
    }
    stage.sun(2.0, Vec3::new(0.4, -1.0, 0.3));
    let spot = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.6 };
    stage.light(spot, 3.0, None, Vec3::new(-1.0, 2.0, 0.0), Vec3::new(0.3, -1.0, 0.0));
    stage.light(LightKind::Point, 1.0, None, Vec3::new(0.3, 1.5, 0.4), Vec3::NEG_Y);
    let gpu = device_guaranteed();
    let changes: [&[(&str, &str)]; 5] = [
        &[("shadow.layout", "single"), ("shadow.filter", "none")],
        &[("shadow.layout", "cascaded"), ("shadow.pcf_kernel", "5")],
        &[("shadow.fit", "depth"), ("shadow.bias.receiver_plane", "false")],
        &[("shadow.pcf_kernel", "disc")],
        &[("shadow.representation", "evsm4"), ("shadow.filter", "gaussian")],
    ];
    for (change, forward) in changes.into_iter().zip([false, false, true, true, false]) {
        let images = ["hardware", "compute"].map(|raster| {
            let all = [change, &[("shadow.raster", raster), ("shadow.resolution", "256")]].concat();
            let mut settings = direct(&all);
            if forward {
                settings.pipeline = Pipeline::Forward;
            }
            let mut studio = Studio::new(&gpu, settings);
            let scene = studio.load(&stage.scene);
            studio.radiance(&scene, &camera_above(2.0), [64, 64], 1)
        });
        // A texel at an edge may fall to either side, and depth clamped or clipped before the near plane differs.
        let difference = nmae(&images[1], &images[0]);
        assert!(difference < 1e-3, "{change:?}: {difference}");
    }
}
