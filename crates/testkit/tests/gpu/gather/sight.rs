//! Shadows by maps and by rays.

use super::*;
use chiaro_techniques::indirect::IsmResolution;
use chiaro_techniques::indirect::ism::IsmPlan;
use chiaro_techniques::rays::TraceData;
use chiaro_testkit::{Stage, device, device_guaranteed};

const POINTS: usize = 4000;
const LARGEST_M: f32 = 3.5;

/// A plate in the middle of the room.
fn plate() -> [Vec3; 3] {
    [Vec3::new(0.0, 0.0, -0.2), 0.4 * Vec3::X, 0.4 * Vec3::Y]
}

fn furnished() -> Vec<[Vec3; 3]> {
    walls().into_iter().chain([plate()]).collect()
}

/// Whether nothing but the plate is between a place and a VPL.
fn sees(place: Vec3, vpl: &Vpl) -> bool {
    let [centre, a, b] = plate();
    let to = Vec3::from(vpl.position_ws) - place;
    let t = (centre.z - place.z) / to.z;
    let off = place + t * to - centre;
    !(t > 1e-4 && t < 1.0 - 1e-4 && off.x.abs() < a.x && off.y.abs() < b.y)
}

fn view(size: [u32; 2]) -> Picture {
    Picture::new(size, (Vec3::new(0.8, 0.7, -0.9), Vec3::new(-0.3, -0.4, 1.0)), &furnished())
}

/// Lights on the wall behind the plate.
fn behind_the_plate(count: usize) -> Vec<Vpl> {
    let mut random = Random::new(9);
    (0..count)
        .map(|i| {
            let at = Vec3::new(random.within(-0.8, 0.8), random.within(-0.8, 0.8), -1.0);
            Vpl::new(at, Vec3::Z, Vec3::splat(random.within(5.0, 15.0)), i as u32).with_radius(0.1)
        })
        .collect()
}

fn maps<'a>(gpu: &'a Gpu, vpls: &[Vpl], binding: u64) -> crate::ism::Rig<'a> {
    let (points, area) = crate::ism::scatter(&furnished(), POINTS, vpls.len());
    let settings =
        IndirectSettings { points_per_vpl: POINTS as u32, ..crate::ism::settings(IsmResolution::Side64, 2) };
    let plan = IsmPlan::within(binding, &settings, vpls.len() as u32).unwrap();
    crate::ism::Rig::with_plan(gpu, settings, (&points, area, LARGEST_M), vpls, (plan, 0))
}

/// Light by maps, and what the bound takes of it.
fn by_maps(
    gpu: &Gpu,
    picture: &Picture,
    settings: &IndirectSettings,
    maps: &crate::ism::Rig<'_>,
    closer: bool,
) -> (Vec<[f32; 4]>, Vec<[f32; 1]>) {
    let mut rig = Rig::new(gpu, key(Sight::Ism { closer }, IrradianceFilter::Edges, true));
    let mut recorder = Recorder::new(gpu, false);
    let mut frame = recorder.begin();
    let others = Others { atlases: maps.record(&mut frame), ..Others::default() };
    let lit = rig.record(&mut frame, picture, settings, [&maps.vpls, &maps.vpl_count], others);
    frame.submit();
    (texels(gpu, &lit), texels(gpu, rig.room.as_ref().unwrap().clamp_loss().unwrap()))
}

fn by_rays(gpu: &Gpu, picture: &Picture, settings: &IndirectSettings, vpls: &[Vpl]) -> Vec<[f32; 4]> {
    let mut stage = Stage::new();
    let material = stage.lambert(0.5);
    for [centre, a, b] in furnished() {
        stage.quad(centre, a, b, material);
    }
    let traced = TraceData::build(&stage.scene, &stage.scene.pose(0.0), &[]).upload(gpu).unwrap();
    let mut rig = Rig::new(gpu, key(Sight::Rays { tint: false }, IrradianceFilter::Edges, false));
    let scene = SceneGpu::upload(gpu, &rig.bench.kit.scene_layout, &stage.scene).unwrap();
    let (vpls, count) = rig.buffers(vpls);
    let mut recorder = Recorder::new(gpu, false);
    let mut frame = recorder.begin();
    let others = Others { rays: Some((&scene, &traced.words)), ..Others::default() };
    let lit = rig.record(&mut frame, picture, settings, [&vpls, &count], others);
    frame.submit();
    texels(gpu, &lit)
}

fn mean(light: &[[f32; 4]]) -> f32 {
    light.iter().map(|texel| texel[0]).sum::<f32>() / light.len() as f32
}

/// Mean of the differences, of the mean.
fn apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f32 {
    a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).abs()).sum::<f32>() / a.len() as f32 / mean(b)
}

#[test]
fn by_rays_every_pixel_gets_what_the_cpu_finds_unhidden() {
    let gpu = device();
    let (picture, vpls) = (view([40, 30]), behind_the_plate(6));
    let found = by_rays(&gpu, &picture, &settings(1), &vpls);
    let expected: Vec<_> = picture.pixels.iter().map(|pixel| twin(pixel, &vpls, 1.0, sees).0.x).collect();
    let unshadowed: f32 = picture.pixels.iter().map(|pixel| twin(pixel, &vpls, 1.0, |_, _| true).0.x).sum();
    assert!(expected.iter().sum::<f32>() < 0.9 * unshadowed);
    let wrong = found
        .iter()
        .zip(&expected)
        .filter(|(found, expected)| (found[0] - **expected).abs() > 3e-3 * **expected + 1e-5);
    // Pixels on a shadow's edge may fall to either side.
    let wrong = wrong.count();
    assert!(wrong <= 3, "{wrong} pixels");
}

#[test]
fn maps_and_rays_agree_about_a_plates_shadow() {
    let gpu = device_guaranteed();
    let (picture, vpls) = (view([40, 30]), behind_the_plate(48));
    let maps = maps(&gpu, &vpls, 128 << 20);
    let rays = by_rays(&gpu, &picture, &settings(1), &vpls);
    let all: Vec<_> = picture
        .pixels
        .iter()
        .map(|pixel| [twin(pixel, &vpls, 1.0, |_, _| true).0.x, 0.0, 0.0, 0.0])
        .collect();
    let without = apart(&all, &rays);
    for closer in [false, true] {
        let (lit, _) = by_maps(&gpu, &picture, &settings(1), &maps, closer);
        let (off, total) = (apart(&lit, &rays), mean(&lit) / mean(&rays));
        println!("{closer}: {off} of the light is elsewhere, {without} without shadows; {total} in all");
        assert!(off < 0.025 && without > 0.15, "{closer}: {off}, {without} without shadows");
        assert!((total - 1.0).abs() < 0.01, "{closer}: {total}");
    }
}

#[test]
fn several_atlases_add_up_to_one() {
    let gpu = device();
    let (picture, vpls) = (view([33, 22]), behind_the_plate(40));
    let tile = 4 * 64 * 64;
    let one = maps(&gpu, &vpls, 40 * tile);
    assert_eq!(one.room.atlases().len(), 1);
    for (n, binding, atlases) in [(1, 20 * tile, 2), (4, 20 * tile, 2), (3, 14 * tile, 3)] {
        let several = maps(&gpu, &vpls, binding);
        assert_eq!(several.room.atlases().len(), atlases);
        let settings = settings(n);
        let (expected, lost) = by_maps(&gpu, &picture, &settings, &one, false);
        let (found, also_lost) = by_maps(&gpu, &picture, &settings, &several, false);
        for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
            assert!((a[0] - b[0]).abs() <= 6.0 * HALF_STEP * b[0], "{n}, {atlases}: pixel {i}: {a:?} {b:?}");
            assert_eq!(a[3], b[3]);
            assert!((lost[i][0] - also_lost[i][0]).abs() < 2e-3, "{n}, {atlases}: pixel {i}");
        }
    }
}
