//! Virtual lights that others light, by their maps.

use super::*;
use chiaro_techniques::indirect::{LitBy, Slots};

use std::collections::HashMap;

use chiaro_techniques::indirect::Technique;
use chiaro_techniques::indirect::bounces::Bounces;
use chiaro_techniques::indirect::points::Point as Unpacked;
use chiaro_testkit::device;

/// Of the first bounce, and as many of the second.
const VPLS: usize = 64;
const POINTS: u32 = 3000;

fn bounce_settings() -> IndirectSettings {
    IndirectSettings {
        technique: Technique::Ism,
        vpls: VPLS as u32,
        bounces: 2,
        points_per_vpl: POINTS,
        ..settings(IsmResolution::Side64, 2)
    }
}

fn luminance(flux: [f32; 3]) -> f32 {
    Vec3::from(flux).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Spread over the walls of the room and facing inwards, of different colours and fluxes.
fn lights() -> Vec<Vpl> {
    let part = |i: usize, step: f64| (i as f64 * step).fract() as f32;
    let light = |i: usize| {
        let [centre, a, b] = walls()[i % 6];
        let at = centre + 0.9 * (2.0 * part(i, 0.7549) - 1.0) * a + 0.9 * (2.0 * part(i, 0.5698) - 1.0) * b;
        let flux = Vec3::new(1.0 + part(i, 0.618), 1.0 + part(i, 0.414), 1.0 + part(i, 0.236));
        Vpl::new(at, -centre, flux * (1 + i % 3) as f32, i as u32).with_radius(0.3)
    };
    (0..VPLS).map(light).collect()
}

/// What the second bounce is made of, and what it is: the room's points, lights of the first and lights of the second.
fn bounced(plan: impl Fn(&IndirectSettings, u32) -> IsmPlan) -> (Vec<[u32; 4]>, Vec<Vpl>, Vec<Vpl>) {
    let gpu = device();
    let settings = bounce_settings();
    let (points, area) = scatter(&walls(), POINTS as usize, VPLS);
    let first = lights();
    let sets = Slots::new(&settings, LitBy { lamps: true, sources: false });
    let mut slots = first.clone();
    slots.resize(sets.all() as usize, Vpl::zeroed());
    let plan = plan(&settings, slots.len() as u32);
    let mut rig = Rig::with_plan(&gpu, settings.clone(), (&points, area, 12f32.sqrt()), &slots, (plan, 0));
    rig.vpl_count = rig.bench.buffer("vpl_count", &counted(VPLS as u32, 0));
    let bounces = Bounces::compile(&rig.bench.kit, &()).unwrap();
    let room = bounces.room(&gpu);
    let mut recorder = Recorder::new(&gpu, false);
    let mut frame = recorder.begin();
    let atlases = rig.record(&mut frame);
    bounces.record(&mut frame, (&sets, 0, 0), (&rig.inputs(1), &[0]), atlases, &room);
    frame.submit();
    let read = |buffer| BufferReadback::start(&gpu, buffer).wait(&gpu).unwrap();
    let vpls: Vec<Vpl> = bytemuck::pod_collect_to_vec(&read(&rig.vpls));
    let count: Vec<u32> = bytemuck::pod_collect_to_vec(&read(&rig.vpl_count));
    assert_eq!(count[..7], [VPLS as u32, 1, 0, 1, count[4], 0, VPLS as u32]);
    let second = vpls[VPLS..][..count[4] as usize].to_vec();
    (points.iter().map(Point::words).collect(), first, second)
}

fn in_one_atlas() -> (Vec<[u32; 4]>, Vec<Vpl>, Vec<Vpl>) {
    bounced(|settings, vpls| IsmPlan::within(128 << 20, settings, vpls).unwrap())
}

#[test]
fn what_lights_send_on_arrives_at_points_of_their_blocks_and_takes_their_colour() {
    let (points, first, second) = in_one_atlas();
    assert!(second.len() >= VPLS - 1, "{} of {VPLS} found anything", second.len());
    let block: HashMap<_, _> =
        points.iter().enumerate().map(|(i, words)| (words[..3].to_vec(), i / POINTS as usize)).collect();
    let total: f32 = first.iter().map(|v| luminance(v.flux)).sum();
    let mut found = [0.0f32; VPLS];
    let mut cosines = 0.0;
    for (i, vpl) in second.iter().enumerate() {
        let place = vpl.position_ws.map(f32::to_bits).to_vec();
        let from = *block.get(&place).expect("a light lies where a point does");
        found[from] += 1.0;
        let source = &first[from];
        let words = points.iter().find(|words| words[..3] == place).unwrap();
        let point = Unpacked::unpack(*words);
        let to = Vec3::from(vpl.position_ws) - Vec3::from(source.position_ws);
        assert!(vpl.normal_ws().dot(to) < 0.0, "{vpl:?} turns away from {source:?}");
        assert!(vpl.normal_ws().dot(point.normal_ws).abs() > 0.999, "{vpl:?}");
        cosines += source.normal_ws().dot(to.normalize()) / second.len() as f32;
        let expected = total / VPLS as f32 / luminance(source.flux) * Vec3::from(source.flux) * point.albedo;
        assert!(Vec3::from(vpl.flux).abs_diff_eq(expected, 1e-3 * expected.max_element()), "{vpl:?}");
        assert_eq!(vpl.block(), (VPLS + i) as u32);
    }
    // By the cosine its mean is two thirds.
    assert!((cosines - 2.0 / 3.0).abs() < 0.03, "{cosines}");
    for (found, vpl) in found.iter().zip(&first) {
        let expected = VPLS as f32 * luminance(vpl.flux) / total;
        assert!((found - expected).abs() < 2.5, "{found} instead of {expected}");
    }
}

#[test]
fn they_stand_for_as_much_area_as_the_light_says_that_arrives() {
    let (_, first, second) = in_one_atlas();
    let total: f32 = first.iter().map(|v| luminance(v.flux)).sum();
    for vpl in &second {
        // In an empty room all see each other.
        let light = |v: &Vpl| {
            let to = Vec3::from(v.position_ws) - Vec3::from(vpl.position_ws);
            let cosines = (-v.normal_ws().dot(to)).max(0.0) * vpl.normal_ws().dot(to).max(0.0);
            let squared = to.length_squared();
            luminance(v.flux) * cosines / (PI * squared * (squared + 0.09))
        };
        let arriving: f32 = first.iter().map(light).sum();
        let expected = (total / VPLS as f32 / arriving / PI).sqrt();
        let ratio = crate::gather::radius(vpl) / expected;
        assert!((0.99..1.06).contains(&ratio), "{ratio} at {vpl:?}");
    }
}

#[test]
fn several_atlases_give_the_same_lights() {
    let (_, _, one) = in_one_atlas();
    // 30 tiles each.
    let (_, _, many) = bounced(|settings, vpls| IsmPlan::within(30 << 14, settings, vpls).unwrap());
    let sorted = |vpls: &[Vpl]| {
        let mut all: Vec<_> =
            vpls.iter().map(|v| (v.position_ws.map(f32::to_bits), v.flux.map(f32::to_bits))).collect();
        all.sort_unstable();
        all
    };
    assert_eq!(sorted(&one), sorted(&many));
}
