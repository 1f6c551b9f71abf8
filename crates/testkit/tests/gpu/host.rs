//! chiaro inside a program with a device, an encoder, a texture, a camera and a scene of its own.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use chiaro::alone::Shadows;
use chiaro::scene::{Light, LightKind, Projection, Scene, SceneError};
use chiaro::techniques::shadow::{Filter, Representation, ShadowSettings};
use chiaro::wgpu::{self, TextureFormat, TextureUsages};
use chiaro::{
    Canvas, Depth, Error, Gpu, GpuError, LoadedScene, Readback, Reference, ReferenceOptions, Renderer,
    Samples, Settings, StillOptions, Texture, View,
};
use chiaro_testkit::{Stage, camera_above, device, direct};
use glam::camera::rh::proj::directx as right;
use glam::camera::{lh, rh};
use glam::{Mat4, Quat, Vec2, Vec3};

const SIZE: [u32; 2] = [60, 40];
const PICTURES: [TextureFormat; 4] = [
    TextureFormat::Rgba8Unorm,
    TextureFormat::Rgba8UnormSrgb,
    TextureFormat::Bgra8Unorm,
    TextureFormat::Bgra8UnormSrgb,
];

/// A box on a floor in the sun, and something unlit.
fn stage() -> Scene {
    let mut stage = Stage::floor(0.6);
    let red = stage.lambert(0.3);
    stage.cuboid(Vec3::new(0.5, 0.5, 0.2), Vec3::splat(0.5), red);
    let sign = stage.material(chiaro::scene::Material {
        reflection: chiaro::scene::Reflection::Unlit,
        base_color: Vec3::new(0.8, 0.4, 0.1).extend(1.0),
        double_sided: true,
        ..Default::default()
    });
    stage.quad(Vec3::new(-1.0, 0.5, 0.0), Vec3::X * 0.5, Vec3::Y * 0.4, sign);
    stage.sun(20_000.0, Vec3::new(0.4, -1.0, -0.3));
    stage.scene
}

fn camera() -> View {
    View::look_at(Vec3::new(1.0, 2.0, 5.0), Vec3::new(0.0, 0.4, 0.0), 0.8, 0.1)
}

fn settings() -> Settings {
    direct(&[("shadow.resolution", "256"), ("camera.exposure_ev100", "13")])
}

/// A device as a host program makes it.
fn host(limits: wgpu::Limits) -> (wgpu::Adapter, wgpu::Device, wgpu::Queue) {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    let instance = wgpu::Instance::new(descriptor.with_env());
    let options = wgpu::RequestAdapterOptions::default();
    let adapter = pollster::block_on(instance.request_adapter(&options)).unwrap();
    let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    (adapter, device, queue)
}

fn texture(gpu: &Gpu, format: TextureFormat, [width, height]: [u32; 2], samples: u32) -> wgpu::Texture {
    let usage = if samples > 1 { TextureUsages::empty() } else { TextureUsages::COPY_SRC };
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: samples,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: usage | TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
        view_formats: &[format.add_srgb_suffix(), format.remove_srgb_suffix()],
    })
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
}

fn read(gpu: &Gpu, texture: &wgpu::Texture) -> chiaro::Pixels {
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let texture = Texture::of_host("target", &view, texture.format());
    Readback::start(gpu, &texture).unwrap().wait(gpu).unwrap()
}

/// What a canvas draws to a texture of `own` format through a view of `format`.
fn drawn(
    renderer: &Renderer,
    (scene, view): (&LoadedScene, &View),
    (own, format): (TextureFormat, TextureFormat),
    size: [u32; 2],
) -> chiaro::Pixels {
    let gpu = renderer.gpu();
    let target = texture(gpu, own, size, 1);
    let target_view =
        target.create_view(&wgpu::TextureViewDescriptor { format: Some(format), ..Default::default() });
    let mut canvas = Canvas::new(renderer, format).unwrap();
    let mut encoder = encoder(gpu);
    canvas.record(renderer, (scene, view), &mut encoder, &target_view).unwrap();
    gpu.queue.submit([encoder.finish()]);
    read(gpu, &target)
}

/// The numbers of an Rgba16Float texture, texel by texel.
fn halves(pixels: &chiaro::Pixels) -> Vec<f32> {
    let channels = pixels.channels();
    let channel = |i: usize| match &channels[i] {
        Samples::Float(values) => values,
        whole @ Samples::Whole(_) => panic!("{whole:?}"),
    };
    (0..channel(0).len()).flat_map(|texel| [0, 1, 2, 3].map(|i| channel(i)[texel])).collect()
}

fn codes(pixels: &chiaro::Pixels) -> Vec<u8> {
    let swapped = pixels.format.remove_srgb_suffix() == TextureFormat::Bgra8Unorm;
    let (texels, _) = pixels.bytes.as_chunks::<4>();
    let rgba = |&[a, b, c, alpha]: &[u8; 4]| if swapped { [c, b, a, alpha] } else { [a, b, c, alpha] };
    texels.iter().flat_map(rgba).collect()
}

#[test]
fn an_adopted_device_that_lacks_limits_is_refused_with_each_of_them() {
    let wanted = wgpu::Limits {
        max_storage_buffers_per_shader_stage: 4,
        max_texture_dimension_2d: 2048,
        ..Gpu::required_limits()
    };
    let (adapter, device, queue) = host(wanted);
    let error = Gpu::adopt(&adapter, device, queue).unwrap_err();
    let GpuError::Missing { what, .. } = &error else { panic!("{error}") };
    for missing in [
        "max_storage_buffers_per_shader_stage = 8 (it has 4)",
        "max_texture_dimension_2d = 8192 (it has 2048)",
    ] {
        assert!(what.contains(missing), "{error}");
    }
    assert_eq!(what.matches("it has").count(), 2, "{error}");
}

#[test]
fn an_adopted_device_keeps_its_handlers_and_all_its_errors() {
    let (adapter, device, queue) = host(Gpu::required_limits());
    let (heard, lost) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicU32::new(0)));
    let (sink, count) = (heard.clone(), lost.clone());
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        sink.lock().unwrap().push(error.to_string());
    }));
    device.set_device_lost_callback(move |_, _| {
        count.fetch_add(1, Ordering::Relaxed);
    });
    let gpu = Gpu::adopt(&adapter, device.clone(), queue).unwrap();
    let (mut renderer, scene) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    let pair = (TextureFormat::Rgba8Unorm, TextureFormat::Rgba8Unorm);
    let picture = drawn(&renderer, (&scene, &camera()), pair, SIZE);
    assert!(picture.bytes.iter().any(|&code| code > 100));
    // A shader that does not compile is an error of who compiles it.
    let library = renderer.kit().library.clone();
    let broken = library.replaced(|path| (path == "view/resolve.cs.wesl").then(|| "fn main( {".into()));
    assert!(renderer.plan_shaders(broken).build().is_err());
    assert_eq!(*heard.lock().unwrap(), Vec::<String>::new());
    // The host's own mistakes are the host's to hear of, each once, whatever chiaro does meanwhile.
    let mistake = || {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mistake"),
            size: 4,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::VERTEX,
            mapped_at_creation: false,
        })
    };
    mistake();
    gpu.check().unwrap();
    renderer.set(direct(&[("shadow.layout", "none")])).unwrap();
    renderer
        .still(&scene, &camera(), &StillOptions { size: SIZE, samples: 1, ..Default::default() })
        .unwrap();
    assert_eq!(heard.lock().unwrap().len(), 1);
    let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
    drawn(&renderer, (&scene, &camera()), pair, SIZE);
    mistake();
    assert!(pollster::block_on(scope.pop()).is_some());
    assert_eq!(heard.lock().unwrap().len(), 1);
    device.destroy();
    let _ = device.poll(wgpu::PollType::Poll);
    assert_eq!(lost.load(Ordering::Relaxed), 1);
}

#[test]
fn a_target_of_any_format_has_the_still_s_picture() {
    let gpu = device();
    let (mut renderer, scene) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    for size in [SIZE, [33, 7]] {
        let options = StillOptions { size, samples: 1, ..StillOptions::default() };
        let still = renderer.still(&scene, &camera(), &options).unwrap();
        let expected = still.picture.wait(&gpu).unwrap().bytes;
        for own in PICTURES {
            for format in [own, own.remove_srgb_suffix(), own.add_srgb_suffix()] {
                let picture = codes(&drawn(&renderer, (&scene, &camera()), (own, format), size));
                assert!(picture == expected, "{own:?} as {format:?}, {size:?}");
            }
        }
        let mut nits = still.radiance.wait(&gpu).unwrap();
        nits.add_floats(&still.unlit.unwrap().wait(&gpu).unwrap());
        let half = TextureFormat::Rgba16Float;
        let radiance = halves(&drawn(&renderer, (&scene, &camera()), (half, half), size));
        for (texel, (found, expected)) in radiance.iter().zip(nits.floats()).enumerate() {
            let expected = if texel % 4 == 3 { 1.0 } else { expected };
            assert!(
                (found - expected).abs() <= 1e-3 * expected + 1e-6,
                "{found} is not {expected} at {texel}"
            );
        }
    }
}

#[test]
fn nothing_is_drawn_before_the_host_submits_and_views_do_not_mix() {
    let gpu = device();
    let (renderer, scene) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    let format = TextureFormat::Rgba8Unorm;
    let views = [camera(), camera_above(2.0)];
    let targets = [SIZE, [32, 32]].map(|size| texture(&gpu, format, size, 1));
    let mut canvases = [(); 2].map(|()| Canvas::new(&renderer, format).unwrap());
    let mut encoder = encoder(&gpu);
    for ((canvas, view), target) in canvases.iter_mut().zip(&views).zip(&targets) {
        let target = target.create_view(&wgpu::TextureViewDescriptor::default());
        canvas.record(&renderer, (&scene, view), &mut encoder, &target).unwrap();
    }
    assert!(targets.iter().all(|target| read(&gpu, target).bytes.iter().all(|&code| code == 0)));
    gpu.queue.submit([encoder.finish()]);
    for ((target, view), size) in targets.iter().zip(&views).zip([SIZE, [32, 32]]) {
        let alone = drawn(&renderer, (&scene, view), (format, format), size);
        assert!(read(&gpu, target).bytes == alone.bytes, "{size:?}");
    }
}

#[test]
fn targets_that_do_not_serve_are_refused_by_what_they_lack() {
    let gpu = device();
    let (renderer, scene) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    let refused = Canvas::new(&renderer, TextureFormat::R8Unorm).unwrap_err();
    assert!(refused.to_string().contains("its format is R8Unorm; pictures go to"), "{refused}");
    let mut canvas = Canvas::new(&renderer, TextureFormat::Rgba8UnormSrgb).unwrap();
    let mut tell = |target: &wgpu::Texture| {
        let view = target.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = encoder(&gpu);
        let result = canvas.record(&renderer, (&scene, &camera()), &mut encoder, &view);
        gpu.queue.submit([encoder.finish()]);
        result.unwrap_err().to_string()
    };
    let other = texture(&gpu, TextureFormat::Bgra8Unorm, SIZE, 1);
    let plain = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 8, height: 8, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: TextureFormat::Rgba8UnormSrgb,
        usage: TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let many = texture(&gpu, TextureFormat::Rgba8UnormSrgb, SIZE, 4);
    for (target, told) in [
        (&other, "its format is Bgra8Unorm, but the canvas was made for Rgba8UnormSrgb"),
        (&plain, "its usage lacks RENDER_ATTACHMENT"),
        (&many, "it has 4 samples a pixel instead of 1"),
    ] {
        let error = tell(target);
        assert!(error.contains(told), "{error}");
    }
}

#[test]
fn a_host_s_camera_shows_what_chiaro_s_own_shows() {
    let gpu = device();
    let (renderer, scene) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    let format = (TextureFormat::Rgba8Unorm, TextureFormat::Rgba8Unorm);
    let picture = |view: &View| drawn(&renderer, (&scene, view), format, SIZE).bytes;
    let aspect = SIZE[0] as f32 / SIZE[1] as f32;
    let world = rh::view::look_at_mat4(Vec3::new(1.0, 2.0, 5.0), Vec3::new(0.0, 0.4, 0.0), Vec3::Y);
    // The same camera with +Z forwards.
    let ahead = Mat4::from_scale(Vec3::new(1.0, 1.0, -1.0));
    let perspective = [
        (world, right::perspective(0.8, aspect, 0.1, 50.0), Depth::Standard),
        (world, right::perspective_infinite(0.8, aspect, 0.1), Depth::Standard),
        (world, right::perspective_infinite_reverse(0.8, aspect, 0.1), Depth::Reversed),
        (world, right::perspective(0.8, aspect, 50.0, 0.1), Depth::Reversed),
        (ahead * world, lh::proj::directx::perspective(0.8, aspect, 0.1, 50.0), Depth::Standard),
        (ahead * world, lh::proj::directx::perspective_infinite_reverse(0.8, aspect, 0.1), Depth::Reversed),
    ];
    let flat = View {
        projection: chiaro::scene::Projection::Orthographic { half_height_m: 1.5 },
        far_m: 50.0,
        ..camera()
    };
    let half = Vec2::new(1.5 * aspect, 1.5);
    let orthographic = [
        (right::orthographic(-half.x, half.x, -half.y, half.y, 0.1, 50.0), Depth::Standard),
        (right::orthographic(-half.x, half.x, -half.y, half.y, 50.0, 0.1), Depth::Reversed),
    ]
    .map(|(clip, depth)| (world, clip, depth));
    for (own, cameras) in [(camera(), &perspective[..]), (flat, &orthographic[..])] {
        let expected = picture(&own);
        for (world, clip, depth) in cameras {
            let view = View::from_matrices(*world, *clip, *depth).unwrap();
            let found = picture(&view);
            // Rounding of the matrices may move an edge across a pixel's middle.
            let other = found.iter().zip(&expected).filter(|(a, b)| a.abs_diff(**b) > 1).count();
            assert!(other <= 12, "{other} codes differ: {clip} {depth:?} became {view:?}");
        }
    }
    // A shifted lens shows a part of a wider picture, here the right half of one twice as wide.
    let wide = [2 * SIZE[0], SIZE[1]];
    let own = drawn(&renderer, (&scene, &camera()), format, wide).bytes;
    let shift =
        Mat4::from_translation(Vec3::new(-1.0, 0.0, 0.0)) * Mat4::from_scale(Vec3::new(2.0, 1.0, 1.0));
    let clip = shift * right::perspective_infinite_reverse(0.8, 2.0 * aspect, 0.1);
    let half = picture(&View::from_matrices(world, clip, Depth::Reversed).unwrap());
    let right_half = own.chunks_exact(8 * SIZE[0] as usize).flat_map(|row| &row[4 * SIZE[0] as usize..]);
    // The dither is by the pixel, and shadow maps are fitted to what is seen.
    let alike = half.iter().zip(right_half).filter(|(a, b)| a.abs_diff(**b) < 4).count();
    assert!(alike > half.len() * 97 / 100, "{alike} of {}", half.len());
}

#[test]
fn what_moves_and_how_it_is_lit_is_the_host_s() {
    let gpu = device();
    let source = stage();
    let (renderer, mut scene) = Renderer::with_scene(&gpu, settings(), &source).unwrap();
    let half = (TextureFormat::Rgba16Float, TextureFormat::Rgba16Float);
    let radiance =
        |scene: &LoadedScene| halves(&drawn(&renderer, (scene, &camera_above(2.0)), half, [24, 24]));
    // A floor's node, a box of six, a sign, a sun: turned with all that hangs on it.
    let mut pose = source.rest();
    let sun = source.nodes.iter().position(|node| node.light.is_some()).unwrap();
    let turn = Mat4::from_quat(Quat::from_rotation_y(0.7));
    let before = pose.world_from_node[sun];
    pose.set_world(&source, sun, glam::Affine3A::from_mat4(turn) * before);
    scene.set_pose(&source, &pose).unwrap();
    let moved = radiance(&scene);
    let mut posed = source.clone();
    posed.nodes[sun].parent_from_node = chiaro::scene::Transform::Matrix(pose.world_from_node[sun]);
    let (_, fresh) = Renderer::with_scene(&gpu, settings(), &posed).unwrap();
    assert!(moved == radiance(&fresh));
    // Twice as bright and blue, without a reload.
    let mut lit = source.clone();
    lit.lights[0].intensity *= 2.0;
    lit.lights[0].color = Vec3::new(0.0, 0.0, 1.0);
    scene.set_pose(&source, &source.rest()).unwrap();
    let white = radiance(&scene);
    scene.set_lights(&lit);
    let blue = radiance(&scene);
    let floor = |image: &[f32]| [0, 1, 2].map(|channel| image[4 * 26 + channel]);
    assert_eq!(floor(&blue)[0], 0.0);
    assert!(
        (floor(&blue)[2] / floor(&white)[2] - 2.0).abs() < 0.01,
        "{:?} {:?}",
        floor(&blue),
        floor(&white)
    );
}

#[test]
fn a_technique_alone_is_text_for_any_group_and_says_what_it_cannot_do() {
    let gpu = device();
    let mut shadows = Shadows::new(&gpu, ShadowSettings::default()).unwrap();
    for group in [0, 3] {
        let text = shadows.wgsl(group);
        assert_eq!(text.matches("@group(").count(), text.matches(&format!("@group({group})")).count());
        assert!(text.contains("fn chiaro_light_visibility(light: u32, position_ws: vec3f"), "{text}");
        assert!(!text.contains("override ") && !text.contains("@fragment"), "{text}");
    }
    // Four cascades, a spot's map, a cube.
    let light = |kind| {
        let light = Light { name: String::new(), kind, color: Vec3::ONE, intensity: 1.0, range_m: None };
        (light, glam::Affine3A::from_translation(Vec3::Y))
    };
    let spot = LightKind::Spot { inner_rad: 0.3, outer_rad: 0.5 };
    let lights = [LightKind::Directional, spot, LightKind::Point].map(light);
    let bounds = (Vec3::NEG_ONE, Vec3::ONE);
    shadows.fit(&lights, (&camera(), SIZE), bounds).unwrap();
    assert_eq!(shadows.maps().count(), 4 + 1 + 6);
    // What is no number is told, and what was fitted stays.
    let nowhere = View { world_from_camera: Mat4::NAN, ..camera() };
    let mut gone = lights.clone();
    gone[1].1.translation.x = f32::NAN;
    for (result, words) in [
        (shadows.fit(&lights, (&camera(), [0, 8]), bounds), "0×8 pixels"),
        (shadows.fit(&lights, (&nowhere, SIZE), bounds), "clip_from_world is not finite"),
        (
            shadows.fit(&gone, (&camera(), SIZE), bounds),
            "light 1 has a pose with a number that is not finite",
        ),
        (shadows.fit(&lights, (&camera(), SIZE), (Vec3::NAN, Vec3::ONE)), "the bounds are not the smallest"),
    ] {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(words), "`{words}` is not in: {error}");
    }
    assert_eq!(shadows.maps().count(), 4 + 1 + 6);
    assert!(shadows.maps().all(|map| map.clip_from_world.is_finite()));
    let moments = ShadowSettings {
        representation: Representation::Variance,
        filter: Filter::Gaussian,
        ..ShadowSettings::default()
    };
    let error = Shadows::new(&gpu, moments).unwrap_err().to_string();
    assert!(error.contains("shadow.representation = depth only"), "{error}");
}

#[test]
fn scenes_that_break_rules_reach_neither_gpu_nor_tracer() {
    let gpu = device();
    let (mut renderer, sound) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    let faults: [fn(&mut Scene); 4] = [
        |scene| scene.meshes[1].primitives[0].indices[2] = 4_000_000_000,
        |scene| scene.meshes[1].primitives[0].positions[0].x = f32::NAN,
        |scene| scene.nodes[2].parent = Some(3),
        |scene| scene.nodes[1].mesh = Some(99),
    ];
    for fault in faults {
        let mut scene = stage();
        fault(&mut scene);
        let loaded = renderer.load(&scene).map(|_| ());
        let pose = sound.pose();
        let traced =
            Reference::build(renderer.kit(), &scene, (pose, sound.gpu.facts), ReferenceOptions::default());
        for result in [loaded, traced.map(|_| ())] {
            assert!(matches!(result, Err(Error::Scene(SceneError::Unsound { .. }))), "{result:?}");
        }
    }
    let (_, empty) = Renderer::with_scene(&gpu, settings(), &Scene::default()).unwrap();
    let format = (TextureFormat::Rgba8Unorm, TextureFormat::Rgba8Unorm);
    drawn(&renderer, (&empty, &camera()), format, [8, 8]);
}

#[test]
fn what_cannot_be_rendered_is_refused_before_the_device_hears_of_it() {
    let gpu = device();
    let (mut renderer, loaded) = Renderer::with_scene(&gpu, settings(), &stage()).unwrap();
    for size in [[0, 0], [5, 0], [u32::MAX, 1]] {
        let options = StillOptions { size, samples: 1, ..StillOptions::default() };
        assert!(matches!(renderer.still(&loaded, &camera(), &options), Err(Error::Size { .. })), "{size:?}");
        gpu.check().unwrap();
    }
    let off = [
        View { near_m: f32::NAN, ..camera() },
        View { projection: Projection::Perspective { yfov_rad: 0.0 }, ..camera() },
        View { world_from_camera: Mat4::from_translation(Vec3::splat(f32::INFINITY)), ..camera() },
    ];
    for view in off {
        let options = StillOptions { size: SIZE, samples: 1, ..StillOptions::default() };
        let refused = renderer.still(&loaded, &view, &options);
        assert!(matches!(refused, Err(Error::Matrix { .. })), "{view:?}");
    }
    // Uploaded, but nothing is compiled for it.
    let renderer = &mut Renderer::new(&gpu, settings()).unwrap();
    let mut loaded = LoadedScene::upload(renderer.kit(), &stage()).unwrap();
    let options = StillOptions { size: SIZE, samples: 1, ..StillOptions::default() };
    assert!(matches!(renderer.still(&loaded, &camera(), &options), Err(Error::NoPasses)));
    renderer.equip(&stage(), &mut loaded).unwrap();
    renderer.still(&loaded, &camera(), &options).unwrap();
}
