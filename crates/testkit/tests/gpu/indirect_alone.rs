//! Indirect light alone, on depth, normals and albedo that another program has drawn.

use chiaro::alone::{DrawnSurfaces, IndirectLight};
use chiaro::scene::{Light, Material, Scene};
use chiaro::techniques::indirect::{IndirectSettings, IsmResolution, Technique};
use chiaro::wgpu::{self, TextureFormat, TextureUsages};
use chiaro::{Aov, Depth, Gpu, Readback, Samples, Texture, View};
use chiaro_image::Image;
use chiaro_testkit::{Stage, Studio, camera_above, device, device_of_its_own, direct, nmae};
use glam::camera::rh::proj::directx;
use glam::{Affine3A, Mat4, Vec2, Vec3};

const SIZE: [u32; 2] = [48, 32];
const NEAR_M: f32 = 0.1;
const FAR_M: f32 = 60.0;

fn small(technique: Technique) -> IndirectSettings {
    IndirectSettings {
        technique,
        vpls: 64,
        rsm_resolution: 64,
        ism_resolution: IsmResolution::Side32,
        points: 4096,
        points_per_vpl: 512,
        bounces: 2,
        ..IndirectSettings::default()
    }
}

fn texture(gpu: &Gpu, format: TextureFormat, [width, height]: [u32; 2], bytes: &[u8]) -> wgpu::TextureView {
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST,
        view_formats: &[],
    });
    if !bytes.is_empty() {
        let layout = wgpu::TexelCopyBufferLayout {
            bytes_per_row: Some(bytes.len() as u32 / height),
            ..Default::default()
        };
        gpu.queue.write_texture(texture.as_image_copy(), bytes, layout, size);
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Texels of an image, with a fourth channel.
fn floats(image: &Image) -> Vec<u8> {
    image.pixels().iter().flat_map(|&[r, g, b]| [r, g, b, 1.0]).flat_map(f32::to_ne_bytes).collect()
}

/// A frame's light by what a program has drawn.
fn light(
    indirect: &mut IndirectLight,
    gpu: &Gpu,
    lamps: &[(Light, Affine3A)],
    drawn: &DrawnSurfaces<'_>,
) -> Image {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let view = indirect.record(&mut encoder, lamps, drawn).unwrap().clone();
    gpu.queue.submit([encoder.finish()]);
    let texture = Texture::of_host("light", &view, view.texture().format());
    let pixels = Readback::start(gpu, &texture).unwrap().wait(gpu).unwrap();
    let channels: Vec<_> = pixels
        .channels()
        .into_iter()
        .map(|channel| match channel {
            Samples::Float(values) => values,
            whole @ Samples::Whole(_) => panic!("{whole:?}"),
        })
        .collect();
    let texels = (0..channels[0].len()).map(|i| [0, 1, 2].map(|channel| channels[channel][i]));
    Image::from_pixels(pixels.width, pixels.height, texels.collect()).unwrap()
}

fn lamps(scene: &Scene) -> Vec<(Light, Affine3A)> {
    let placed = scene.placed_lights_at(&scene.pose(0.0));
    placed.into_iter().map(|(light, pose)| (scene.lights[light].clone(), pose)).collect()
}

/// A floor, a red wall and a box in the sun, and sky.
fn corner() -> Scene {
    let mut stage = Stage::floor(0.6);
    let red = stage.material(Material {
        base_color: Vec3::new(0.8, 0.2, 0.1).extend(1.0),
        specular: 0.0,
        double_sided: true,
        ..Material::default()
    });
    let grey = stage.lambert(0.5);
    stage.quad(Vec3::new(-1.5, 1.0, 0.0), Vec3::Y, Vec3::Z * 2.0, red);
    stage.cuboid(Vec3::new(0.3, 0.4, 0.2), Vec3::splat(0.4), grey);
    stage.sun(20_000.0, Vec3::new(-1.0, -0.8, -0.2));
    stage.scene
}

#[test]
fn it_is_the_renderer_s_own_indirect_light_whichever_way_depth_runs() {
    let gpu = device_of_its_own();
    let (scene, settings) = (corner(), small(Technique::Ism));
    let view = View::look_at(Vec3::new(1.8, 1.6, 3.4), Vec3::new(-0.3, 0.5, 0.0), 0.8, NEAR_M);
    let keys = [
        ("shadow.layout", "traced"),
        ("shadow.rays", "1"),
        ("indirect.technique", "ism"),
        ("indirect.vpls", "64"),
        ("indirect.bounces", "2"),
        ("indirect.rsm_resolution", "64"),
        ("indirect.ism_resolution", "32"),
        ("indirect.points", "4096"),
        ("indirect.points_per_vpl", "512"),
    ];
    let mut studio = Studio::new(&gpu, direct(&keys));
    assert_eq!(studio.renderer().settings().indirect, settings);
    let loaded = studio.load(&scene);
    let aovs = [Aov::Indirect, Aov::Depth, Aov::Normal, Aov::Albedo];
    let [expected, depth, normals, albedo] = studio.aovs(&loaded, &view, SIZE, 1, aovs);

    let mut indirect = IndirectLight::new(&gpu, settings, &scene).unwrap();
    let lamps = lamps(&scene);
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    // Depth of a distance, and of the sky.
    let finite = |metres: f32| (NEAR_M / metres - NEAR_M / FAR_M) / (1.0 - NEAR_M / FAR_M);
    let cameras: [(Mat4, Depth, &dyn Fn(f32) -> f32, f32); 4] = [
        (directx::perspective_infinite_reverse(0.8, aspect, NEAR_M), Depth::Reversed, &|m| NEAR_M / m, 0.0),
        (directx::perspective_infinite(0.8, aspect, NEAR_M), Depth::Standard, &|m| 1.0 - NEAR_M / m, 1.0),
        (directx::perspective(0.8, aspect, NEAR_M, FAR_M), Depth::Standard, &|m| 1.0 - finite(m), 1.0),
        (directx::perspective(0.8, aspect, FAR_M, NEAR_M), Depth::Reversed, &finite, 0.0),
    ];
    let float = TextureFormat::Rgba32Float;
    let (normal_view, albedo_view) =
        (texture(&gpu, float, SIZE, &floats(&normals)), texture(&gpu, float, SIZE, &floats(&albedo)));
    for (clip_from_view, depth_runs, of, sky) in cameras {
        let held = depth.pixels().iter().map(|&[metres, ..]| if metres > 0.0 { of(metres) } else { sky });
        let held: Vec<u8> = held.flat_map(f32::to_ne_bytes).collect();
        let drawn = DrawnSurfaces {
            view_from_world: view.world_from_camera.inverse(),
            clip_from_view,
            depth_runs,
            depth: &texture(&gpu, TextureFormat::R32Float, SIZE, &held),
            normals: &normal_view,
            albedo: Some(&albedo_view),
        };
        let off = nmae(&light(&mut indirect, &gpu, &lamps, &drawn), &expected);
        assert!(off < 0.01, "{depth_runs:?}, {clip_from_view}: {off}");
        // Once sizes are known, frames make nothing.
        let before = gpu.created.total();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        indirect.record(&mut encoder, &lamps, &drawn).unwrap();
        gpu.queue.submit([encoder.finish()]);
        assert_eq!(gpu.created.total(), before);
    }
    gpu.check().unwrap();
}

#[test]
fn a_wall_stops_a_lamp_s_light_from_its_back_until_it_is_moved_away() {
    let gpu = device();
    let mut stage = Stage::floor(0.6);
    let red = stage.lambert(0.5);
    stage.quad(Vec3::new(-1.0, 0.5, 0.0), Vec3::Y * 0.5, Vec3::Z * 2.0, red);
    // Its front looks down: what the sun sees of it is its back.
    let ceiling = stage.material(Material { specular: 0.0, ..Material::default() });
    stage.quad(Vec3::Y * 2.0, Vec3::X * 5.0, Vec3::Z * 5.0, ceiling);
    let node = stage.scene.nodes.len() - 1;
    stage.sun(20_000.0, Vec3::new(-0.3, -1.0, 0.0));
    let scene = stage.scene;
    let (view, size) = (camera_above(2.0), [16, 16]);
    // A floor ten metres away fills the picture.
    let depth = 1.0 - (10.0 - view.near_m) / (view.far_m - view.near_m);
    let depth: Vec<u8> = [depth; 256].into_iter().flat_map(f32::to_ne_bytes).collect();
    let normals: Vec<u8> = [[0i8, 127, 0, 0]; 256].as_flattened().iter().map(|n| *n as u8).collect();
    let drawn = DrawnSurfaces {
        view_from_world: view.world_from_camera.inverse(),
        clip_from_view: view.clip_from_ws(size, Vec2::ZERO) * view.world_from_camera,
        depth_runs: Depth::Reversed,
        depth: &texture(&gpu, TextureFormat::R32Float, size, &depth),
        normals: &texture(&gpu, TextureFormat::Rgba8Snorm, size, &normals),
        albedo: None,
    };
    let mut indirect = IndirectLight::new(&gpu, small(Technique::Traced), &scene).unwrap();
    let lamps = lamps(&scene);
    let brightest = |image: &Image| image.pixels().iter().map(|[r, ..]| *r).fold(0.0, f32::max);
    let covered = brightest(&light(&mut indirect, &gpu, &lamps, &drawn));
    assert!(covered == 0.0, "{covered}");
    let mut pose = scene.pose(0.0);
    pose.set_world(&scene, node, Affine3A::from_translation(Vec3::X * 12.0));
    indirect.set_pose(&scene, &pose).unwrap();
    let open = light(&mut indirect, &gpu, &lamps, &drawn);
    assert!(brightest(&open) > 100.0, "{}", brightest(&open));
    // Grey surfaces scatter their share of it, and normals in a byte are nearly the same ones.
    let grey: Vec<u8> =
        [[0.25f32, 0.25, 0.25, 1.0]; 256].into_iter().flatten().flat_map(f32::to_ne_bytes).collect();
    let upwards: Vec<u8> = [[128u8, 255, 128, 0]; 256].into_iter().flatten().collect();
    let greyed = DrawnSurfaces {
        normals: &texture(&gpu, TextureFormat::Rgba8Unorm, size, &upwards),
        albedo: Some(&texture(&gpu, TextureFormat::Rgba32Float, size, &grey)),
        ..drawn
    };
    let greyed = light(&mut indirect, &gpu, &lamps, &greyed);
    let times_four = greyed.pixels().iter().map(|texel| texel.map(|nits| 4.0 * nits)).collect();
    let off = nmae(&Image::from_pixels(16, 16, times_four).unwrap(), &open);
    assert!(off < 0.02, "{off}");
    let dark = light(&mut indirect, &gpu, &[], &drawn);
    assert!(brightest(&dark) == 0.0, "{}", brightest(&dark));

    // What cannot be read is told, and changes nothing.
    let plain = |format, size| texture(&gpu, format, size, &[]);
    let (colors, large) =
        (plain(TextureFormat::Rgba8UnormSrgb, size), plain(TextureFormat::Rgba16Float, [8, 8]));
    let nowhere = [(lamps[0].0.clone(), Affine3A::from_translation(Vec3::NAN))];
    let mut tell = |lamps: &[_], drawn: &DrawnSurfaces<'_>| {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        indirect.record(&mut encoder, lamps, drawn).unwrap_err().to_string()
    };
    for (error, told) in [
        (
            tell(&lamps, &DrawnSurfaces { depth: &colors, ..drawn }),
            "the depth texture cannot be read: its format is Rgba8UnormSrgb; it takes a depth format",
        ),
        (
            tell(&lamps, &DrawnSurfaces { normals: &colors, ..drawn }),
            "the normals texture cannot be read: its format is Rgba8UnormSrgb; it takes Rgba8Snorm",
        ),
        (
            tell(&lamps, &DrawnSurfaces { albedo: Some(drawn.depth), ..drawn }),
            "the albedo texture cannot be read: its format is R32Float; it takes a format of three",
        ),
        (
            tell(&lamps, &DrawnSurfaces { normals: &large, ..drawn }),
            "the normals texture cannot be read: it has 8×8 pixels, and the depth 16×16",
        ),
        (
            tell(&lamps, &DrawnSurfaces { view_from_world: Mat4::NAN, ..drawn }),
            "view_from_world has a number that is not finite",
        ),
        (tell(&nowhere, &drawn), "light 0 has a pose with a number that is not finite"),
    ] {
        assert!(error.contains(told), "{error} does not tell {told}");
    }
    let again = light(&mut indirect, &gpu, &lamps, &drawn);
    assert!(again.pixels() == open.pixels());
    gpu.check().unwrap();
}

#[test]
fn techniques_without_virtual_lights_are_refused_by_name() {
    let gpu = device();
    for (technique, name) in [(Technique::Ambient, "ambient"), (Technique::None, "none")] {
        let error = IndirectLight::new(&gpu, small(technique), &Scene::default()).unwrap_err().to_string();
        assert!(
            error.contains(&format!("takes indirect.technique = rsm, ism or traced, not {name}")),
            "{error}"
        );
    }
}
