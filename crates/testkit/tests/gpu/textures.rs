//! Sampling of material textures: wrap modes, filters, mip levels, anisotropy.

use bytemuck::{Pod, Zeroable};
use chiaro::Gpu;
use chiaro::scene::{Filter, ImageData, Material, Scene, Texture, TextureRef, Wrap};
use chiaro_gpu::Dispatch;
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::scene::SceneGpu;
use chiaro_testkit::{Bench, Stage, device, device_guaranteed};
use glam::{Vec2, Vec3};

use crate::culling::Random;

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Point {
    uv: Vec2,
    dx: Vec2,
    dy: Vec2,
    material: f32,
    pad: f32,
}

impl Point {
    fn new(uv: Vec2, dx: Vec2, dy: Vec2) -> Self {
        Self { uv, dx, dy, material: 0.0, pad: 0.0 }
    }
}

/// As many as the shader's uniform holds.
const MAX_POINTS: usize = 512;

/// A texture's red channel at points, each 0..1.
fn sample(image: &Image, wrap: [Wrap; 2], filter: Filter, anisotropy: u32, points: &[Point]) -> Vec<f32> {
    let mut stage = Stage::new();
    let material = image.material(&mut stage, wrap, filter);
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::Y, material);
    sample_scene(&device(), &stage.scene, anisotropy, points)
}

/// The textures of a scene's materials at points.
fn sample_scene(gpu: &Gpu, scene: &Scene, anisotropy: u32, points: &[Point]) -> Vec<f32> {
    let bench = Bench::new(gpu);
    bench.set_frame(&FrameData { anisotropy, ..FrameData::zeroed() });
    let scene = SceneGpu::upload(gpu, &bench.kit.scene_layout, scene).unwrap();
    // A uniform: the scene's and the frame's storage buffers and the output are the eight that WebGPU guarantees.
    let mut all = points.to_vec();
    assert!(all.len() <= MAX_POINTS);
    all.resize(MAX_POINTS, Point::zeroed());
    let buffer = bench.buffer("points", &all);
    let shader = ("tests/texture.cs.wesl", include_str!("wesl/texture.cs.wesl"));
    let work = (Dispatch::Threads([points.len() as u32, 1, 1]), points.len());
    let constants = scene.facts.constants();
    let constants: Vec<_> = constants.into_iter().filter(|(name, _)| *name != "TEXTURES").collect();
    let output: Vec<[f32; 4]> =
        bench.run(shader, &constants, Some(&scene), &[("points", (&buffer).into())], work);
    output.into_iter().map(|texel| texel[0]).collect()
}

/// A grey image.
struct Image {
    size: [i32; 2],
    texels: Vec<u8>,
}

impl Image {
    fn random(side: i32) -> Self {
        Self::of_size([side; 2])
    }

    fn of_size(size: [i32; 2]) -> Self {
        let mut random = Random::new(3);
        Self { size, texels: (0..size[0] * size[1]).map(|_| random.within(0.0, 256.0) as u8).collect() }
    }

    /// A material whose linear texture it is.
    fn material(&self, stage: &mut Stage, wrap: [Wrap; 2], filter: Filter) -> usize {
        let rgba = self.texels.iter().flat_map(|&v| [v, v, v, 255]).collect();
        let [width, height] = self.size.map(|side| side as u32);
        stage.scene.images.push(ImageData { name: "grey".into(), width, height, rgba });
        stage.scene.textures.push(Texture { image: stage.scene.images.len() - 1, wrap, filter });
        let texture = TextureRef::new(stage.scene.textures.len() - 1);
        stage.material(Material { metallic_roughness_texture: Some(texture), ..Material::default() })
    }

    fn size(&self) -> Vec2 {
        Vec2::new(self.size[0] as f32, self.size[1] as f32)
    }

    fn texel(&self, wrap: [Wrap; 2], x: i32, y: i32) -> f32 {
        let axis = |i: i32, side: i32, wrap| match wrap {
            Wrap::Repeat => i.rem_euclid(side),
            Wrap::Clamp => i.clamp(0, side - 1),
            Wrap::Mirror => {
                let i = i.rem_euclid(2 * side);
                i.min(2 * side - 1 - i)
            }
        };
        let (x, y) = (axis(x, self.size[0], wrap[0]), axis(y, self.size[1], wrap[1]));
        f32::from(self.texels[(y * self.size[0] + x) as usize]) / 255.0
    }

    fn bilinear(&self, wrap: [Wrap; 2], uv: Vec2) -> f32 {
        let at = uv * self.size() - 0.5;
        let (low, f) = (at.floor().as_ivec2(), at - at.floor());
        let row = |y: i32| {
            let (a, b) = (self.texel(wrap, low.x, y), self.texel(wrap, low.x + 1, y));
            a + (b - a) * f.x
        };
        row(low.y) + (row(low.y + 1) - row(low.y)) * f.y
    }

    /// Mean of the texels in a rectangle.
    fn mean(&self, x: std::ops::Range<i32>, y: std::ops::Range<i32>) -> f32 {
        let texels = y.flat_map(|y| x.clone().map(move |x| (x, y)));
        let values: Vec<_> = texels.map(|(x, y)| self.texel([Wrap::Repeat; 2], x, y)).collect();
        values.iter().sum::<f32>() / values.len() as f32
    }
}

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

fn points_around(count: usize) -> Vec<Point> {
    let mut random = Random::new(4);
    let mut uv = || Vec2::new(random.within(-2.5, 3.5), random.within(-2.5, 3.5));
    (0..count).map(|_| Point::new(uv(), Vec2::ZERO, Vec2::ZERO)).collect()
}

#[test]
fn textures_repeat_mirror_and_clamp_by_axis() {
    let image = Image::random(8);
    let points = points_around(512);
    for wrap in WRAPS.into_iter().flat_map(|u| WRAPS.map(|v| [u, v])) {
        let nearest = sample(&image, wrap, Filter::Nearest, 16, &points);
        let linear = sample(&image, wrap, Filter::Linear, 16, &points);
        for ((point, nearest), linear) in points.iter().zip(nearest).zip(linear) {
            let at = (point.uv * 8.0).floor().as_ivec2();
            let texel = image.texel(wrap, at.x, at.y);
            // Points within rounding of a texel's edge may fall to either side.
            let edge = (point.uv * 8.0 - (point.uv * 8.0).round()).abs().min_element();
            if edge > 1e-4 {
                assert!(
                    (nearest - texel).abs() < 1e-3,
                    "{wrap:?} {}: {nearest} is not texel {texel}",
                    point.uv
                );
            }
            let blend = image.bilinear(wrap, point.uv);
            // Samplers keep at least 6 bits between texels (8 in practice), on either axis.
            assert!((linear - blend).abs() < 0.01, "{wrap:?} {}: {linear} is not {blend}", point.uv);
        }
    }
}

#[test]
fn a_footprint_of_a_power_of_two_texels_shows_that_mip_level() {
    let image = Image::random(64);
    let mut points = Vec::new();
    let mut expected = Vec::new();
    for level in 0..=6 {
        let size = 1 << level;
        for block in 0..(64 / size).min(8) {
            let corner = (block * size, (block * 3 % (64 / size)) * size);
            let uv = Vec2::new(
                (corner.0 as f32 + 0.5 * size as f32) / 64.0,
                (corner.1 as f32 + 0.5 * size as f32) / 64.0,
            );
            let step = size as f32 / 64.0;
            points.push(Point::new(uv, Vec2::new(0.0, step), Vec2::new(-step, 0.0)));
            expected.push((image.mean(corner.0..corner.0 + size, corner.1..corner.1 + size), level));
        }
    }
    let found = sample(&image, [Wrap::Repeat; 2], Filter::Linear, 16, &points);
    for (found, (expected, level)) in found.into_iter().zip(expected) {
        // Each level is rounded to 8 bits; levels and texels are blended with at least 6 bits.
        assert!((found - expected).abs() < 0.012, "level {level}: {found} is not {expected}");
    }
}

#[test]
fn a_slanted_footprint_averages_along_its_longer_side_only() {
    let image = Image::random(64);
    let row = 21;
    let uv = Vec2::new(24.0 / 64.0, (row as f32 + 0.5) / 64.0);
    let texel = 1.0 / 64.0;
    let along = Point::new(uv, Vec2::new(8.0 * texel, 0.0), Vec2::new(0.0, texel));
    let swapped = Point::new(uv, along.dy, -along.dx);
    // The same ellipse by other axes: (a + b)/√2 and (a − b)/√2.
    let turned = {
        let (a, b) = (along.dx, along.dy);
        Point::new(uv, (a + b) * std::f32::consts::FRAC_1_SQRT_2, (a - b) * std::f32::consts::FRAC_1_SQRT_2)
    };
    let points = [along, swapped, turned];
    let line = image.mean(20..28, row..row + 1);
    for found in sample(&image, [Wrap::Repeat; 2], Filter::Linear, 16, &points) {
        // Taps stand on texel centres; 6 bits of blending each.
        assert!((found - line).abs() < 0.012, "{found} is not {line}");
    }
    // Without anisotropy one tap covers it: the mip level of the longer side, blended between four blocks of 8².
    let pair = |y: i32| 0.5 * (image.mean(16..24, y..y + 8) + image.mean(24..32, y..y + 8));
    let share = (row as f32 + 0.5 - 20.0) / 8.0;
    let block = pair(16) + (pair(24) - pair(16)) * share;
    for found in sample(&image, [Wrap::Repeat; 2], Filter::Linear, 1, &points) {
        assert!((found - block).abs() < 0.012, "{found} is not {block}");
    }
    assert!((block - line).abs() > 0.03, "the image must tell a line from a block");
}

#[test]
fn images_of_any_size_keep_their_texels_whatever_is_beside_them() {
    const SIZES: [[i32; 2]; 8] = [[3, 1], [3, 3], [5, 2], [1, 9], [64, 20], [200, 3], [16, 16], [1000, 2]];
    let mut stage = Stage::new();
    // A large class beside them.
    let neighbour = Image::random(512).material(&mut stage, [Wrap::Repeat; 2], Filter::Linear);
    stage.quad(Vec3::ZERO, Vec3::X, Vec3::Y, neighbour);
    let (mut points, mut expected) = (Vec::new(), Vec::new());
    let mut random = Random::new(5);
    for (number, size) in SIZES.into_iter().enumerate() {
        let image = Image::of_size(size);
        for filter in [Filter::Nearest, Filter::Linear] {
            let wrap = [WRAPS[number % 3], WRAPS[(number + 1) % 3]];
            let material = image.material(&mut stage, wrap, filter);
            for _ in 0..24 {
                let [x, y] = size.map(|side| (random.within(-1.5, 2.5) * side as f32).floor());
                // Anywhere within the texel, but for what rounding may move to the next.
                let within = |random: &mut Random| match filter {
                    Filter::Nearest => random.within(0.02, 0.98),
                    Filter::Linear => 0.5,
                };
                let at = Vec2::new(x + within(&mut random), y + within(&mut random));
                let point = Point::new(at / image.size(), Vec2::ZERO, Vec2::ZERO);
                points.push(Point { material: material as f32, ..point });
                expected.push((size, filter, image.texel(wrap, x as i32, y as i32)));
            }
        }
    }
    let found = sample_scene(&device(), &stage.scene, 16, &points);
    for (found, (size, filter, texel)) in found.into_iter().zip(expected) {
        // Places of texels are rounded by their coordinates, a thousand to the image.
        assert!((found - texel).abs() < 2e-3, "{size:?} {filter:?}: {found} is not {texel}");
    }
}

#[test]
fn small_images_of_any_size_are_filtered_like_others() {
    let image = Image::of_size([12, 6]);
    for wrap in WRAPS {
        let wrap = [wrap; 2];
        let points = points_around(128);
        for (point, found) in points.iter().zip(sample(&image, wrap, Filter::Linear, 16, &points)) {
            let blend = image.bilinear(wrap, point.uv);
            assert!((found - blend).abs() < 1e-3, "{wrap:?} {}: {found} is not {blend}", point.uv);
        }
    }
    // Blocks of 2×2, then lines of four texels.
    let step = |texels: [f32; 2]| Vec2::from(texels) / image.size();
    let block = |x: i32, y: i32| {
        let uv = step([x as f32 + 1.0, y as f32 + 1.0]);
        (Point::new(uv, step([2.0, 0.0]), step([0.0, 2.0])), image.mean(x..x + 2, y..y + 2))
    };
    let line = |x: i32, y: i32| {
        let uv = step([x as f32 + 2.0, y as f32 + 0.5]);
        (Point::new(uv, step([4.0, 0.0]), step([0.0, 1.0])), image.mean(x..x + 4, y..y + 1))
    };
    let cases = [block(0, 0), block(4, 2), block(10, 4), line(0, 1), line(3, 5), line(8, 0)];
    let points = cases.map(|(point, _)| point);
    let found = sample(&image, [Wrap::Repeat; 2], Filter::Linear, 16, &points);
    for (found, (point, mean)) in found.into_iter().zip(cases) {
        // Mips are rounded to 8 bits.
        assert!((found - mean).abs() < 0.003, "{point:?}: {found} is not {mean}");
    }
}

/// So many images of 8² texels, each of another grey, sampled in their middles.
fn many(gpu: &Gpu, count: usize) -> (Vec<f32>, Vec<f32>) {
    let mut stage = Stage::new();
    let grey = |i: usize| (i * 37 % 256) as u8;
    for i in 0..count {
        let image = Image { size: [8, 8], texels: vec![grey(i); 64] };
        let material = image.material(&mut stage, [Wrap::Repeat; 2], Filter::Linear);
        if i == 0 {
            stage.quad(Vec3::ZERO, Vec3::X, Vec3::Y, material);
        }
    }
    let points: Vec<_> = (0..count)
        .step_by(count.div_ceil(MAX_POINTS))
        .map(|i| {
            let point = Point::new(Vec2::splat(0.5), Vec2::ZERO, Vec2::ZERO);
            Point { material: i as f32, ..point }
        })
        .collect();
    let expected = points.iter().map(|point| f32::from(grey(point.material as usize)) / 255.0).collect();
    (sample_scene(gpu, &stage.scene, 1, &points), expected)
}

#[test]
fn hundreds_of_textures_of_one_size_are_told_apart() {
    for (gpu, count) in [(device_guaranteed(), 300), (device(), 1000)] {
        let (found, expected) = many(&gpu, count);
        for (i, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            assert!((found - expected).abs() < 1e-3, "{i} of {count}: {found} is not {expected}");
        }
    }
}
