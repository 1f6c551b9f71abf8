//! What every pixel is lit by.

use super::*;
use chiaro_testkit::{device, device_guaranteed};

fn inside(size: [u32; 2]) -> Picture {
    let mut picture = Picture::new(size, (Vec3::new(0.3, 0.2, 0.8), Vec3::new(-0.4, -0.3, -0.9)), &walls());
    // What takes no diffuse light.
    for (i, pixel) in picture.pixels.iter_mut().enumerate() {
        match i % 23 {
            7 => pixel.kind = UNLIT,
            11 => *pixel = Shown { kind: SKY, view_depth: f32::INFINITY, ..*pixel },
            _ => {}
        }
    }
    picture
}

#[test]
fn every_pixel_is_the_sum_over_its_sub_images_vpls() {
    let gpu = device_guaranteed();
    let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, true));
    let sizes = [[37, 21], [8, 8], [5, 3], [64, 17], [1, 1], [65, 9]];
    let counts = [150, 0, 1, 7, 64, 300, 65];
    let cases =
        (1..=8u32).flat_map(|n| (0..3).map(move |i| (n, (n as usize + i) % 6, (2 * n as usize + i) % 7)));
    for (n, size, count) in cases {
        let (picture, vpls) = (inside(sizes[size]), scattered(counts[count], u64::from(n)));
        let clamp = [1.0, 0.0, 2.5][count % 3];
        let found = rig.light(&picture, &IndirectSettings { clamp, ..settings(n) }, &vpls);
        let losses = texels::<1>(&gpu, rig.room.as_ref().unwrap().clamp_loss().unwrap());
        for (i, (pixel, (found, [loss]))) in picture.pixels.iter().zip(found.iter().zip(losses)).enumerate() {
            let name = format!("{n}: pixel {i} of {:?}, {} VPLs", picture.size, vpls.len());
            if pixel.kind != METALLIC_ROUGHNESS {
                assert_eq!((*found, loss), ([0.0, 0.0, 0.0, NOWHERE], 0.0), "{name}");
                continue;
            }
            let (sum, lost) = twin(pixel, block(i, picture.size, n, &vpls), clamp, |_, _| true);
            let expected = sum * (n * n) as f32;
            let light = Vec3::from_slice(found);
            // Half floats have no steps below 2⁻²⁴.
            let off = (light - expected).abs() - 2.0 * HALF_STEP * expected;
            assert!(off.max_element() < 1e-6, "{name}: {light} should be {expected}");
            assert!((loss - lost).abs() < 1e-3, "{name}: {loss} of the light is lost, {lost} should be");
            let octaves = pixel.view_depth.log2();
            assert!((found[3] - octaves).abs() < 2.0 * HALF_STEP * octaves.abs().max(1.0), "{name}");
        }
    }
}

#[test]
fn nothing_is_not_a_number_whatever_vpls_are() {
    let gpu = device();
    let picture = inside([24, 16]);
    let on_surface = |i: usize, normal: Vec3, flux: f32| {
        Vpl::new(picture.pixels[i].position, normal, Vec3::splat(flux), 0)
    };
    let all = [
        on_surface(0, picture.pixels[0].normal, 1.0),
        on_surface(30, -picture.pixels[30].normal, 1e20),
        on_surface(30, picture.pixels[31].normal, f32::MAX),
        on_surface(60, Vec3::X, f32::NAN),
        on_surface(60, Vec3::X, f32::INFINITY),
        on_surface(61, Vec3::X, -1.0),
        on_surface(62, Vec3::X, 0.0).with_radius(1e30),
        Vpl::new(Vec3::NAN, Vec3::X, Vec3::ONE, 0),
        Vpl::new(Vec3::splat(f32::INFINITY), Vec3::X, Vec3::ONE, 0),
        Vpl::new(Vec3::splat(1e25), Vec3::NEG_X, Vec3::ONE, 0),
        Vpl::new(Vec3::ZERO, Vec3::NEG_Z, Vec3::ONE, 0),
    ];
    for filter in [IrradianceFilter::Edges, IrradianceFilter::Discontinuity] {
        let mut rig = Rig::new(&gpu, key(Sight::All, filter, true));
        for (clamp, n) in [(0.0, 1), (0.0, 2), (1.0, 4), (16.0, 3)] {
            let found = rig.light(&picture, &IndirectSettings { clamp, ..settings(n) }, &all);
            let fits = |texel: &[f32; 4]| texel.iter().all(|x| x.is_finite() && *x <= 65_500.0);
            assert!(found.iter().all(fits), "{filter:?}, {clamp}, {n}");
            assert!(found.iter().any(|texel| texel[1] > 0.0));
            let losses = texels::<1>(&gpu, rig.room.as_ref().unwrap().clamp_loss().unwrap());
            assert!(losses.iter().all(|[loss]| (0.0..=1.0).contains(loss)));
        }
    }
}

#[test]
fn a_disc_facing_a_place_gives_what_its_form_factor_says() {
    // A picture of one pixel that looks at the middle of a wall.
    let gpu = device();
    let wall = [Vec3::NEG_Z, Vec3::X, Vec3::Y];
    let picture = Picture::new([1, 1], (Vec3::ZERO, Vec3::NEG_Z), &[wall]);
    let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::Edges, true));
    for (d, r) in [(1.0f32, 0.1f32), (0.3, 0.3), (0.05, 0.5)] {
        let flux = 100.0;
        let vpl = Vpl::new(Vec3::new(0.0, 0.0, d - 1.0), Vec3::NEG_Z, Vec3::splat(flux), 0).with_radius(r);
        let [light] = rig.light(&picture, &settings(1), &[vpl])[..] else { panic!("one pixel") };
        let radiance = flux / (PI * r * r) / PI;
        let expected = radiance * r * r / (d * d + r * r) * RADIANCE_SCALE;
        assert!((light[0] / expected - 1.0).abs() < 3e-3, "{d} {r}: {} should be {expected}", light[0]);
        let [[loss]] = texels::<1>(&gpu, rig.room.as_ref().unwrap().clamp_loss().unwrap())[..] else {
            panic!("one pixel")
        };
        assert!((loss - r * r / (d * d + r * r)).abs() < 2e-3, "{d} {r}: {loss}");
    }
}

#[test]
fn with_what_bounds_take_given_back_all_are_bounded_as_if_they_carried_as_much() {
    let gpu = device_guaranteed();
    let mut rig = Rig::new(&gpu, key(Sight::All, IrradianceFilter::None, false));
    let (picture, vpls) = (inside([21, 13]), scattered(90, 7));
    let luminance = |vpl: &Vpl| Vec3::from(vpl.flux).dot(Vec3::new(0.2126, 0.7152, 0.0722));
    let even: Vec<_> =
        vpls.iter().map(|vpl| vpl.with_radius(radius(vpl) * (EVEN_LM / luminance(vpl)).sqrt())).collect();
    let more: Vec<_> = (0..21 * 13).map(|i| [0.01 * i as f32, 0.5, 0.0, 0.0]).collect();
    let given_back = texture(&gpu, "given_back", picture.size, TextureFormat::Rgba32Float, &more);
    let buffers = rig.buffers(&vpls);
    let mut recorder = Recorder::new(&gpu, false);
    let mut frame = recorder.begin();
    let others = Others { given_back: Some(&given_back), ..Others::default() };
    let lit = rig.record(&mut frame, &picture, &settings(3), [&buffers.0, &buffers.1], others);
    frame.submit();
    for (i, (pixel, found)) in picture.pixels.iter().zip(texels::<4>(&gpu, &lit)).enumerate() {
        let (sum, _) = twin(pixel, block(i, picture.size, 3, &even), 1.0, |_, _| true);
        let lit = if pixel.kind == METALLIC_ROUGHNESS { 9.0 * sum } else { Vec3::ZERO };
        let expected = lit + Vec3::from_slice(&more[i]);
        let off = (Vec3::from_slice(&found) - expected).abs() - 3e-3 * expected;
        assert!(off.max_element() < 1e-6, "pixel {i}: {found:?} should be {expected}");
    }
}
