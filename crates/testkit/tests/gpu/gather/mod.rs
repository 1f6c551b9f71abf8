//! Light of virtual point lights at pixels, against sums on the CPU, and what its filters leave of it.

mod filter;
mod sight;
mod steady;
mod sums;

use chiaro_techniques::indirect::SETS;
use std::f32::consts::PI;

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::wgpu::{self, TextureFormat, TextureUsages};
use chiaro_gpu::{
    Buffer, Frame, Gpu, Life, Readback, Recorder, Samples, Texture, TextureOptions, TexturePool,
};
use chiaro_techniques::Compiled;
use chiaro_techniques::frame::FrameData;
use chiaro_techniques::indirect::gather::{Gather, GatherInputs, GatherKey, GatherRoom, Gathers, Sight};
use chiaro_techniques::indirect::ism::IsmAtlas;
use chiaro_techniques::indirect::{IndirectSettings, IrradianceFilter, Vpl};
use chiaro_techniques::scene::{SceneFacts, SceneGpu};
use chiaro_testkit::Bench;
use glam::{Mat3, Mat4, Vec3, Vec4};

use crate::culling::Random;

/// Half a step of half floats is 2⁻¹¹.
const HALF_STEP: f32 = 1.0 / 2048.0;
const NEAR_M: f32 = 0.1;
/// A stored unit is 4 nits.
const RADIANCE_SCALE: f32 = 0.25;
/// Flux that bounds go by where what they take is given back.
const EVEN_LM: f32 = 12.0;
const NOWHERE: f32 = -60.0;
const METALLIC_ROUGHNESS: u32 = 0;
const UNLIT: u32 = 2;
const SKY: u32 = 3;

fn key(sight: Sight, filter: IrradianceFilter, clamp_loss: bool) -> GatherKey {
    GatherKey { sight, filter, wide: false, clamp_loss, sources: false, facts: SceneFacts::default() }
}

fn settings(interleave: u32) -> IndirectSettings {
    IndirectSettings { interleave, ..IndirectSettings::default() }
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug)]
struct Shown {
    kind: u32,
    position: Vec3,
    normal: Vec3,
    view_depth: f32,
}

/// A camera and what it sees of rectangles: centre and two half sides, with fronts towards it.
struct Picture {
    size: [u32; 2],
    frame: FrameData,
    pixels: Vec<Shown>,
}

impl Picture {
    /// Seen from a place towards another, over 60° up and down.
    fn new(size: [u32; 2], (eye, target): (Vec3, Vec3), rectangles: &[[Vec3; 3]]) -> Self {
        let [width, height] = size.map(|pixels| pixels as f32);
        let forward = (target - eye).normalize();
        let up = if forward.y.abs() < 0.9 { Vec3::Y } else { Vec3::Z };
        let right = forward.cross(up).normalize();
        let world_from_camera = Mat3::from_cols(right, right.cross(forward), -forward);
        let turn = Mat4::from_mat3(world_from_camera.transpose());
        // Reversed, without an end.
        let focal = 1.0 / (PI / 6.0).tan();
        let clip_from_camera = Mat4::from_cols(
            Vec4::new(focal * height / width, 0.0, 0.0, 0.0),
            Vec4::new(0.0, focal, 0.0, 0.0),
            Vec4::new(0.0, 0.0, 0.0, -1.0),
            Vec4::new(0.0, 0.0, NEAR_M, 0.0),
        );
        let relative_from_clip = (clip_from_camera * turn).inverse();
        let frame = FrameData {
            clip_from_ws: (clip_from_camera * turn * Mat4::from_translation(-eye)).to_cols_array_2d(),
            relative_from_clip: relative_from_clip.to_cols_array_2d(),
            eye_ws: eye.into(),
            forward_ws: forward.into(),
            size_px: size,
            radiance_scale: RADIANCE_SCALE,
            gathers: 1,
            ..Zeroable::zeroed()
        };
        let shown = |i: u32| {
            let at = |pixel: u32, across: f32| (pixel as f32 + 0.5) / across * 2.0 - 1.0;
            let ndc = Vec3::new(at(i % size[0], width), -at(i / size[0], height), 0.5);
            let ray = relative_from_clip.project_point3(ndc).normalize();
            let nearest = rectangles.iter().filter_map(|[centre, a, b]| {
                let normal = a.cross(*b).normalize();
                let normal = if normal.dot(ray) > 0.0 { -normal } else { normal };
                let t = normal.dot(centre - eye) / normal.dot(ray);
                let off = eye + t * ray - centre;
                let inside =
                    off.dot(*a).abs() <= a.length_squared() && off.dot(*b).abs() <= b.length_squared();
                (t > 0.0 && inside).then_some((t, normal))
            });
            match nearest.min_by(|a, b| a.0.total_cmp(&b.0)) {
                None => Shown { kind: SKY, position: Vec3::ZERO, normal: Vec3::Z, view_depth: f32::INFINITY },
                Some((t, normal)) => Shown {
                    kind: METALLIC_ROUGHNESS,
                    position: eye + t * ray,
                    normal,
                    view_depth: t * ray.dot(forward),
                },
            }
        };
        Self { size, frame, pixels: (0..size[0] * size[1]).map(shown).collect() }
    }

    /// Depth and surface buffer; shading and geometric normals are the same.
    fn textures(&self, gpu: &Gpu) -> [Texture; 2] {
        // The difference of the normals in the middle of its range: none.
        const SAME_NORMAL: u32 = 63 | 63 << 7 | 0x20_0000;
        let depths: Vec<_> = self.pixels.iter().map(|pixel| NEAR_M / pixel.view_depth).collect();
        let words: Vec<_> = self
            .pixels
            .iter()
            .map(|pixel| {
                let normal = Vpl::new(Vec3::ZERO, pixel.normal, Vec3::ZERO, 0).normal;
                [normal, pixel.kind << 30, 0, SAME_NORMAL]
            })
            .collect();
        [
            texture(gpu, "depth", self.size, TextureFormat::R32Float, &depths),
            texture(gpu, "surface", self.size, TextureFormat::Rgba32Uint, &words),
        ]
    }
}

fn texture<T: Pod>(
    gpu: &Gpu,
    name: &'static str,
    [width, height]: [u32; 2],
    format: TextureFormat,
    texels: &[T],
) -> Texture {
    let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST;
    let texture = Texture::new(gpu, name, Life::Kept, TextureOptions::new(width, height, format, usage));
    gpu.queue.write_texture(
        texture.raw().as_image_copy(),
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(width * size_of::<T>() as u32),
            rows_per_image: None,
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    texture
}

/// The texels of a texture, so many numbers each.
fn texels<const N: usize>(gpu: &Gpu, texture: &Texture) -> Vec<[f32; N]> {
    let channels = Readback::start(gpu, texture).unwrap().wait(gpu).unwrap().channels();
    let channels: [Vec<f32>; N] = std::array::from_fn(|i| match &channels[i] {
        Samples::Float(numbers) => numbers.clone(),
        Samples::Whole(_) => panic!("numbers, not words"),
    });
    (0..channels[0].len()).map(|texel| std::array::from_fn(|i| channels[i][texel])).collect()
}

/// Everything else that light is gathered of.
#[derive(Clone, Copy, Default)]
struct Others<'a> {
    atlases: &'a [IsmAtlas],
    rays: Option<(&'a SceneGpu, &'a Buffer)>,
    given_back: Option<&'a Texture>,
}

/// The pass.
struct Rig<'a> {
    gpu: &'a Gpu,
    bench: Bench,
    pass: Compiled<Gather>,
    pool: TexturePool,
    room: Option<GatherRoom>,
}

impl<'a> Rig<'a> {
    fn new(gpu: &'a Gpu, key: GatherKey) -> Self {
        let bench = Bench::new(gpu);
        let pass = Compiled::new(&bench.kit, key).unwrap();
        Self { gpu, bench, pass, pool: TexturePool::default(), room: None }
    }

    /// The irradiance of all pixels.
    fn light(&mut self, picture: &Picture, settings: &IndirectSettings, vpls: &[Vpl]) -> Vec<[f32; 4]> {
        let buffers = self.buffers(vpls);
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame = recorder.begin();
        let lit = self.record(&mut frame, picture, settings, [&buffers.0, &buffers.1], Others::default());
        frame.submit();
        texels(self.gpu, &lit)
    }

    fn buffers(&self, vpls: &[Vpl]) -> (Buffer, Buffer) {
        let mut count = [[0; 4]; SETS as usize];
        count[0] = [vpls.len() as u32, EVEN_LM.to_bits(), 0, 0];
        (self.bench.buffer("vpls", vpls), self.bench.buffer("vpl_count", &count))
    }

    fn record(
        &mut self,
        frame: &mut Frame<'_>,
        picture: &Picture,
        settings: &IndirectSettings,
        [vpls, vpl_count]: [&Buffer; 2],
        others: Others<'_>,
    ) -> Texture {
        self.bench.set_frame(&picture.frame);
        let [depth, surface] = picture.textures(self.gpu);
        let room = self.pass.room(
            (self.gpu, &self.pool),
            picture.size,
            others.atlases.len(),
            Gathers::Bounced,
            &mut self.room,
        );
        let inputs = GatherInputs {
            group: self.bench.frame.group(),
            scene: others.rays.map(|(scene, _)| scene),
            depth: &depth,
            surface: &surface,
            vpls,
            vpl_count,
            light: Gathers::Bounced,
            atlases: others.atlases,
            tracer: others.rays.map(|(_, tracer)| tracer),
            given_back: others.given_back,
        };
        self.pass.record(frame, settings, &inputs, room)
    }
}

/// Rectangles of a room of 2 × 2 × 2 m.
fn walls() -> Vec<[Vec3; 3]> {
    crate::ism::walls()
}

/// VPLs on the room's walls, of different colours and sizes.
fn scattered(count: usize, seed: u64) -> Vec<Vpl> {
    let mut random = Random::new(seed);
    let walls = walls();
    (0..count)
        .map(|i| {
            let [centre, a, b] = walls[(random.within(0.0, 5.999)) as usize];
            let at = centre + random.within(-0.95, 0.95) * a + random.within(-0.95, 0.95) * b;
            let flux = Vec3::from_array(std::array::from_fn(|_| random.within(0.0, 30.0)));
            Vpl::new(at, -centre, flux, i as u32 % 4).with_radius(random.within(0.01, 0.4))
        })
        .collect()
}

/// log2 of it is a half float, of ordinary size here.
pub(crate) fn radius(vpl: &Vpl) -> f32 {
    let bits = (vpl.block_radius >> 16) as i32;
    let size = (1.0 + (bits & 0x3ff) as f32 / 1024.0) * ((bits >> 10 & 31) as f32 - 15.0).exp2();
    (if bits >> 15 == 1 { -size } else { size }).exp2()
}

/// Light that a pixel gets of VPLs that it sees, stored units, and the share that the bound takes.
fn twin(shown: &Shown, vpls: &[Vpl], clamp: f32, sees: impl Fn(Vec3, &Vpl) -> bool) -> (Vec3, f32) {
    let normal = Vpl::new(Vec3::ZERO, shown.normal, Vec3::ZERO, 0).normal_ws();
    let (mut sum, mut unbounded) = (Vec3::ZERO, Vec3::ZERO);
    for vpl in vpls {
        let to = Vec3::from(vpl.position_ws) - shown.position;
        let (d, w) = (to.length(), to.normalize());
        let cosines = normal.dot(w).max(0.0) * -vpl.normal_ws().dot(w).min(0.0);
        if cosines > 0.0 && sees(shown.position, vpl) {
            let radius = radius(vpl);
            let flux = Vec3::from(vpl.flux) * cosines / PI.powi(2) * RADIANCE_SCALE;
            sum += flux / (d * d + (clamp * radius).powi(2));
            unbounded += flux / (d * d);
        }
    }
    let luminance = Vec3::new(0.2126, 0.7152, 0.0722);
    let left = sum.dot(luminance) / unbounded.dot(luminance);
    (sum, if unbounded == Vec3::ZERO { 0.0 } else { 1.0 - left })
}

/// The VPLs of a pixel's sub-image.
fn block(i: usize, [width, _]: [u32; 2], n: u32, vpls: &[Vpl]) -> &[Vpl] {
    let (x, y) = (i as u32 % width, i as u32 / width);
    let k = (x % n + n * (y % n)) as usize;
    let squares = (n * n) as usize;
    &vpls[k * vpls.len() / squares..(k + 1) * vpls.len() / squares]
}
