//! Shadows of single quads: where geometry says, and nowhere else.

use std::f32::consts::PI;

use chiaro::scene::{AlphaMode, Filter, LightKind, Material, Wrap};
use chiaro::{LoadedScene, Settings};
use chiaro_testkit::{Stage, Studio, camera_above, device, direct};
use glam::{Affine2, Quat, Vec2, Vec3};

const KERNELS: [&str; 5] = ["none", "2", "3", "5", "7"];

fn settings(kernel: &str, resolution: &str) -> Settings {
    let filter: [(&str, &str); 2] = if kernel == "none" {
        [("shadow.filter", "none"); 2]
    } else {
        [("shadow.filter", "pcf"), ("shadow.pcf_kernel", kernel)]
    };
    let mut settings = direct(&filter);
    settings.set("shadow.resolution", resolution).unwrap();
    settings
}

fn floor() -> Stage {
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    stage.quad(Vec3::ZERO, Vec3::X * 3.0, Vec3::NEG_Z * 3.0, material);
    stage
}

/// Visibility over the floor from above, under a sun of π/cos θ lux: radiance 1 where lit.
fn visibility(studio: &mut Studio, scene: &LoadedScene, half: f32, side: u32) -> Vec<Vec<f32>> {
    let image = studio.radiance(scene, &camera_above(half), [side; 2], 1);
    image.pixels().chunks(side as usize).map(|row| row.iter().map(|pixel| pixel[0]).collect()).collect()
}

/// Where a row crosses one half, in pixels from its left end.
fn crossings(row: &[f32]) -> Vec<f32> {
    let pairs = row.windows(2).enumerate();
    let crossed = pairs.filter(|(_, p)| (p[0] < 0.5) != (p[1] < 0.5));
    crossed.map(|(i, p)| i as f32 + 0.5 + (0.5 - p[0]) / (p[1] - p[0])).collect()
}

#[test]
fn a_quads_shadow_ends_where_geometry_says() {
    // A shallow ray moves 0.9 m sideways over the caster's height: its shadow stands beside it.
    let (height, half, slope) = (1.2, 0.3, 0.75);
    let direction = Vec3::new(slope, -1.0, 0.0).normalize();
    let mut stage = floor();
    let material = stage.lambert(1.0);
    stage.quad(Vec3::new(0.0, height, 0.0), Vec3::X * half, Vec3::NEG_Z * half, material);
    stage.sun(PI / -direction.y, direction);
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "512"));
    let scene = studio.load(&stage.scene);
    let (view_half, side) = (1.5, 192);
    let pixel = 2.0 * view_half / side as f32;
    // The map covers the floor at most: 6 m, √2 as much across, and its side is rounded up to a quarter octave.
    let texel = 6.0 * 2f32.sqrt() * 2f32.powf(0.25) / 512.0;
    for kernel in KERNELS {
        studio.set(settings(kernel, "512"));
        let rows = visibility(&mut studio, &scene, view_half, side);
        // The middle row crosses the shadow from left to right; a column through its middle from top to bottom.
        let middle = (slope * height + view_half) / pixel;
        let column: Vec<f32> = rows.iter().map(|row| row[middle as usize]).collect();
        let center = side as f32 / 2.0;
        // The caster itself, lit, hides nothing of its shadow.
        for (line, center) in [(&rows[side as usize / 2], middle), (&column, center)] {
            let found = crossings(line);
            let expected = [center - half / pixel, center + half / pixel];
            assert_eq!(found.len(), 2, "kernel {kernel}: {found:?} should be {expected:?}");
            for (found, expected) in found.iter().zip(expected) {
                // A texel for the map; an unfiltered edge shows only to half a pixel.
                let off = (found - expected).abs() * pixel;
                assert!(off <= texel + 0.5 * pixel, "kernel {kernel}: edge off by {} texels", off / texel);
            }
        }
        let inside = rows[side as usize / 2][middle as usize];
        assert!(inside == 0.0, "kernel {kernel}: {inside} in the shadow's middle");
    }
}

#[test]
fn light_passes_the_holes_of_a_masked_quad() {
    let direction = Vec3::new(0.8, -1.0, 0.0).normalize();
    let height = 1.5;
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "1024"));
    for double_sided in [false, true] {
        let mut stage = floor();
        // 4 × 4 texels of 0.2 m, every other a hole; below the cut-off is a hole, at it none.
        let solid = |i: usize| (i % 4 + i / 4).is_multiple_of(2);
        let rgba = (0..16).flat_map(|i| [255, 255, 255, if solid(i) { 128 } else { 127 }]).collect();
        let mut texture = stage.texture(4, [Wrap::Clamp; 2], Filter::Nearest, rgba);
        // Transformed and back again, so that the transform is in the test.
        texture.uv_transform = Affine2::from_scale(Vec2::splat(2.0));
        let material = stage.material(Material {
            base_color_texture: Some(texture),
            alpha: AlphaMode::Mask { cutoff: 128.0 / 255.0 },
            specular: 0.0,
            double_sided,
            ..Material::default()
        });
        stage.quad(Vec3::new(0.0, height, 0.0), Vec3::X * 0.4, Vec3::NEG_Z * 0.4, material);
        for uv in &mut stage.scene.meshes[1].primitives[0].uvs[0] {
            *uv *= 0.5;
        }
        stage.sun(PI / -direction.y, direction);
        let scene = studio.load(&stage.scene);
        let (half, side) = (2.0, 128);
        let rows = visibility(&mut studio, &scene, half, side);
        for i in 0..16usize {
            let center = Vec2::new((i % 4) as f32 * 0.2 - 0.3 + 0.8 * height, (i / 4) as f32 * 0.2 - 0.3);
            let at = ((center + half) / (2.0 * half) * side as f32).as_uvec2();
            let found = rows[at.y as usize][at.x as usize];
            let expected = if solid(i) { 0.0 } else { 1.0 };
            // Half-float radiance.
            assert!((found - expected).abs() < 2e-3, "hole {i}, {double_sided}: {found} is not {expected}");
        }
    }
}

/// The darkest pixel of a plane that fills the picture, turned so that the sun meets it at `degrees` from its normal.
/// `tilt` leans the plane, whose normal the surface buffer then keeps only to its 7 bits.
fn darkest(studio: &mut Studio, degrees: f32, tilt: Quat) -> (f32, usize) {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let direction = tilt * Vec3::new(sine * 0.4f32.cos(), -cosine, sine * 0.4f32.sin());
    let mut stage = Stage::new();
    let material = stage.lambert(1.0);
    stage.quad(Vec3::ZERO, tilt * Vec3::X * 3.0, tilt * Vec3::NEG_Z * 3.0, material);
    stage.sun(PI / cosine, direction);
    let scene = studio.load(&stage.scene);
    let rows = visibility(studio, &scene, 1.0, 96);
    let lit = rows.iter().flatten().copied();
    (lit.clone().fold(1.0, f32::min), lit.filter(|&v| v <= 0.99).count())
}

const SLANTS_DEG: [f32; 7] = [0.0, 5.0, 20.0, 40.0, 60.0, 75.0, 85.0];

#[test]
fn a_plane_has_no_acne_at_any_slant() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "256"));
    for (kernel, receiver_plane) in
        KERNELS.into_iter().flat_map(|kernel| [(kernel, "true"), (kernel, "false")])
    {
        let mut changed = settings(kernel, "256");
        changed.set("shadow.bias.receiver_plane", receiver_plane).unwrap();
        studio.set(changed);
        for degrees in SLANTS_DEG {
            let (darkest, dark) = darkest(&mut studio, degrees, Quat::IDENTITY);
            assert!(
                darkest > 0.99,
                "kernel {kernel}, receiver plane {receiver_plane}, {degrees}°: {darkest}, {dark} of {} pixels",
                96 * 96
            );
        }
    }
}

#[test]
fn a_leaning_plane_has_no_acne_at_any_slant() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "256"));
    for kernel in ["none", "3", "7"] {
        studio.set(settings(kernel, "256"));
        for tilt in [Quat::from_rotation_x(0.31), Quat::from_euler(glam::EulerRot::XZY, -0.47, 0.52, 0.2)] {
            for degrees in SLANTS_DEG {
                let (darkest, dark) = darkest(&mut studio, degrees, tilt);
                // Shading by the rounded normal is off, at a slant, by a few hundredths; acne is far darker.
                assert!(
                    darkest > 0.97,
                    "kernel {kernel}, {degrees}°, leaning by {tilt}: {darkest}, {dark} of {} pixels",
                    96 * 96
                );
            }
        }
    }
}

#[test]
fn a_plane_has_no_acne_under_a_spot() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "256"));
    for kernel in KERNELS {
        studio.set(settings(kernel, "256"));
        for tilt in [0.0, 1.0, 4.0] {
            let mut stage = floor();
            let at = Vec3::new(-1.0, 0.5, 0.0);
            let kind = LightKind::Spot { inner_rad: 1.0, outer_rad: 1.05 };
            stage.light(kind, 10.0, None, at, Vec3::new(tilt, -1.0, 0.0));
            let scene = studio.load(&stage.scene);
            let shadowed = visibility(&mut studio, &scene, 1.0, 96);
            let mut unshadowed = settings(kernel, "256");
            unshadowed.set("shadow.layout", "none").unwrap();
            studio.set(unshadowed);
            let lit = visibility(&mut studio, &scene, 1.0, 96);
            studio.set(settings(kernel, "256"));
            let pairs = shadowed.iter().flatten().zip(lit.iter().flatten());
            let dark = pairs.filter(|(shadowed, lit)| **shadowed < 0.99 * **lit).count();
            assert_eq!(dark, 0, "kernel {kernel}, tilt {tilt}: dark pixels of {}", 96 * 96);
        }
    }
}

#[test]
fn a_map_is_rendered_again_only_when_its_light_or_its_casters_changed() {
    let gpu = device();
    let lamp = |x: f32| {
        let mut stage = floor();
        let material = stage.lambert(1.0);
        stage.quad(Vec3::Z, Vec3::X * 0.5, Vec3::NEG_Z * 0.5, material);
        stage.light(
            LightKind::Spot { inner_rad: 0.9, outer_rad: 1.0 },
            10.0,
            None,
            Vec3::new(x, 4.0, 0.0),
            Vec3::NEG_Y,
        );
        stage
    };
    let mut renderer = chiaro::Renderer::new(&gpu, direct(&[])).unwrap();
    let [first, second] = [0.0, 0.5].map(|x| renderer.load(&lamp(x).scene).unwrap());
    let mut recorder = chiaro::Recorder::new(&gpu, false);
    let mut state = chiaro::ViewState::new(&renderer);
    let mut renders = |renderer: &mut chiaro::Renderer, scene: &LoadedScene| {
        let view = camera_above(3.0);
        let prepared = renderer.prepare(&mut state, scene, &view, [32, 32], (Vec2::ZERO, 1.0)).unwrap();
        let mut frame = recorder.begin();
        prepared.record(&mut frame, false);
        frame.submit();
        recorder.log().iter().any(|pass| pass.name == "shadow/depth")
    };
    assert!(renders(&mut renderer, &first), "the first frame has no map yet");
    assert!(!renders(&mut renderer, &first), "nothing changed");
    assert!(renders(&mut renderer, &second), "another scene");
    assert!(!renders(&mut renderer, &second), "nothing changed");
    let mut uncached = renderer.settings().clone();
    uncached.set("shadow.cache", "false").unwrap();
    renderer.set(uncached).unwrap();
    assert!(renders(&mut renderer, &second) && renders(&mut renderer, &second), "the cache is off");
}

#[test]
fn glass_tints_the_light_it_lets_through_where_asked() {
    let mut stage = floor();
    let glass = stage.material(Material {
        base_color: Vec3::new(0.9, 0.5, 0.1).extend(1.0),
        transmission: 0.8,
        specular: 0.0,
        double_sided: true,
        ..Material::default()
    });
    let opaque = stage.lambert(1.0);
    // The floor is seen past the glass: the sun comes from the side.
    let direction = Vec3::new(1.0, -1.0, 0.0).normalize();
    stage.quad(Vec3::new(-0.6, 1.2, 0.0), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, glass);
    stage.quad(Vec3::new(-0.6, 1.2, 1.5), Vec3::X * 0.5, Vec3::NEG_Z * 0.5, opaque);
    // Above the glass: not tinted, and a full shadow.
    stage.quad(Vec3::new(-1.4, 2.0, -0.3), Vec3::X * 0.2, Vec3::NEG_Z * 0.2, opaque);
    stage.sun(PI / -direction.y, direction);
    let gpu = device();
    for filter in [["depth", "pcf"], ["evsm4", "gaussian"]] {
        let resolution = ("shadow.resolution", "512");
        let changes = [("shadow.representation", filter[0]), ("shadow.filter", filter[1]), resolution];
        let mut studio = Studio::new(&gpu, direct(&changes));
        let scene = studio.load(&stage.scene);
        let (half, side) = (2.0, 128);
        let at = |studio: &mut Studio, x: f32, z: f32| {
            let image = studio.radiance(&scene, &camera_above(half), [side; 2], 1);
            let pixel = ((Vec2::new(x, z) + half) / (2.0 * half) * side as f32).as_uvec2();
            Vec3::from(image.pixels()[(pixel.y * side + pixel.x) as usize])
        };
        let shadow = Vec2::new(0.6, 0.0);
        let full = at(&mut studio, shadow.x, shadow.y);
        assert!(full.max_element() < 0.02, "glass casts a full shadow: {full}");
        let mut tinted = direct(&changes);
        tinted.set("shadow.transmission_tint", "true").unwrap();
        studio.set(tinted);
        let found = at(&mut studio, shadow.x, shadow.y);
        let expected = 0.8 * Vec3::new(0.9, 0.5, 0.1);
        assert!(found.distance(expected) < 0.01, "{filter:?}: {found} is not {expected}");
        let (lit, dark, above) =
            (at(&mut studio, 1.5, -1.0), at(&mut studio, 0.6, 1.5), at(&mut studio, -1.4, -0.3));
        assert!(lit.distance(Vec3::ONE) < 0.02 && dark.max_element() < 0.02, "{filter:?}: {lit}, {dark}");
        assert!(above.distance(Vec3::ONE) < 0.02, "{filter:?}: above the glass {above}");
    }
}

#[test]
fn a_masked_fence_is_cut_out_of_cube_and_paraboloids_alike() {
    let mut stage = floor();
    let rgba =
        (0..16).flat_map(|i| [255, 255, 255, if (i % 4 + i / 4) % 2 == 0 { 255 } else { 0 }]).collect();
    let texture = stage.texture(4, [Wrap::Repeat; 2], Filter::Nearest, rgba);
    let fence = stage.material(Material {
        base_color_texture: Some(texture),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        double_sided: true,
        ..Material::default()
    });
    stage.quad(Vec3::new(0.3, 1.0, 0.2), Vec3::new(0.8, 0.1, 0.0), Vec3::new(0.0, 0.1, -0.8), fence);
    stage.light(LightKind::Point, 10.0, None, Vec3::new(0.1, 2.0, -0.1), Vec3::NEG_Y);
    let gpu = device();
    let mut studio = Studio::new(&gpu, settings("3", "512"));
    let scene = studio.load(&stage.scene);
    let mut seen = ["cube", "paraboloid"].map(|layout| {
        let mut settings = settings("3", "512");
        settings.set("shadow.point_layout", layout).unwrap();
        studio.set(settings);
        let image = studio.aov(&scene, &camera_above(2.9), [96, 96], 1, chiaro::Aov::Shadow);
        image.pixels().iter().map(|pixel| pixel[0]).collect::<Vec<f32>>()
    });
    let [cube, paraboloid] = &mut seen;
    let dark = cube.iter().filter(|&&v| v < 0.1).count();
    // Half of the fence's shadow, which is about 3.4 m wide, and not all of it.
    assert!((400..1400).contains(&dark), "{dark} pixels in shadow");
    let off = cube.iter().zip(paraboloid).map(|(a, b)| (*a - *b).abs()).sum::<f32>() / (96.0 * 96.0);
    assert!(off < 0.01, "cube and paraboloid differ by {off}");
}
