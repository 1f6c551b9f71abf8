//! Clusters of virtual point lights against a twin on the CPU, and what they may not change.

use chiaro::{Aov, Settings, View};
use chiaro_gpu::{Buffer, BufferReadback, Gpu, Recorder};
use chiaro_techniques::indirect::clusters::{Centre, ClusterRoom, Clusters};
use chiaro_techniques::indirect::vpls::{VplRoom, Vpls};
use chiaro_techniques::indirect::{IndirectSettings, Technique, Vpl};
use chiaro_techniques::indirect::{LitBy, Slots};
use chiaro_techniques::{Kit, Pass, shaders};
use chiaro_testkit::{Studio, TestGpu, device, nmae};
use glam::Vec3;

use crate::culling::Random;

const ITERATIONS: usize = 3;

struct Rig {
    gpu: TestGpu,
    settings: IndirectSettings,
    vpls: Vpls,
    clusters: Clusters,
    placed: Option<VplRoom>,
    room: Option<ClusterRoom>,
    recorder: Recorder,
}

fn read<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(gpu: &Gpu, buffer: &Buffer) -> Vec<T> {
    bytemuck::pod_collect_to_vec(&BufferReadback::start(gpu, buffer).wait(gpu).unwrap())
}

impl Rig {
    fn new(vpls: u32, clusters: u32) -> Self {
        let gpu = device();
        let kit = Kit::new(&gpu, shaders::library());
        let technique = Technique::Ism;
        let settings = IndirectSettings { technique, vpls, clusters, ..IndirectSettings::default() };
        Self {
            vpls: Vpls::compile(&kit, &()).unwrap(),
            clusters: Clusters::compile(&kit, &()).unwrap(),
            placed: None,
            room: None,
            recorder: Recorder::new(&gpu, false),
            gpu,
            settings,
        }
    }

    /// The lights that clusters of some are; the geometric mean of their fluxes; and the cluster of each.
    fn clustered(&mut self, vpls: &[Vpl], moves: bool) -> (Vec<Vpl>, f32, Vec<u32>) {
        let slots = Slots::new(&self.settings, LitBy { lamps: true, sources: false });
        let placed = self.vpls.room(&self.gpu, &self.settings, (slots, 1), &mut self.placed);
        let room = self.clusters.room(&self.gpu, &self.settings, &mut self.room);
        let mut frame = self.recorder.begin();
        frame.clear(&placed.vpls);
        frame.clear(&placed.count);
        frame.upload(&placed.vpls, vpls);
        frame.upload(&placed.count, &[[vpls.len() as u32, 0, 0, 0]]);
        self.clusters.record(&mut frame, (&self.settings, 0), (7, moves), placed, room);
        frame.submit();
        let count: Vec<u32> = read(&self.gpu, &placed.count);
        let mut lights: Vec<Vpl> = read(&self.gpu, &placed.vpls);
        lights.truncate(count[0] as usize);
        let mut assigned: Vec<u32> = read(&self.gpu, &room.assigned);
        assigned.truncate(vpls.len());
        (lights, f32::from_bits(count[1]), assigned)
    }
}

fn luminance(flux: [f32; 3]) -> f32 {
    Vec3::from(flux).dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Lights on the walls of a room around a place.
fn on_walls(count: u32, around: Vec3) -> Vec<Vpl> {
    let mut random = Random::new(5);
    let one = |i: u32| {
        let axis = (i % 3) as usize;
        let side = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let mut at = Vec3::ZERO.map(|_| random.within(-1.0, 1.0));
        at[axis] = side;
        let mut normal = Vec3::ZERO;
        normal[axis] = -side;
        let flux = Vec3::ZERO.map(|_| random.within(0.1, 5.0));
        Vpl::new(around + at, normal, flux, i).with_radius(random.within(0.01, 0.1))
    };
    (0..count).map(one).collect()
}

/// Lloyd's algorithm; whose centre each light is nearest to at last, and the clusters.
fn twin(
    vpls: &[Vpl],
    settings: &IndirectSettings,
    start: Option<Vec<(Vec3, Vec3)>>,
) -> (Vec<usize>, Vec<Vpl>) {
    let clusters = settings.clusters as usize;
    let place = |v: &Vpl| (Vec3::from(v.position_ws), v.normal_ws());
    let area: f32 = vpls.iter().map(|v| v.radius().powi(2)).sum();
    let length = (area / clusters as f32).sqrt();
    let first = || (0..clusters).map(|i| place(&vpls[i.min(vpls.len() - 1)])).collect();
    let mut centres: Vec<_> = start.unwrap_or_else(first);
    let mut lights = Vec::new();
    let mut assigned = Vec::new();
    for iteration in 1..=ITERATIONS {
        let apart = |v: &Vpl, (at, normal): (Vec3, Vec3)| {
            let (position, own) = place(v);
            (settings.cluster_position / length * (position - at)).length_squared()
                + (settings.cluster_normal * (own - normal)).length_squared()
        };
        let nearest = |v: &Vpl| {
            let all = centres.iter().map(|&centre| apart(v, centre)).enumerate();
            all.fold((0, f32::MAX), |best, (i, d)| if d < best.1 { (i, d) } else { best }).0
        };
        assigned = vpls.iter().map(nearest).collect();
        let mut next = centres.clone();
        lights.clear();
        for (number, centre) in next.iter_mut().enumerate() {
            let own: Vec<_> =
                vpls.iter().zip(&assigned).filter(|(_, of)| **of == number).map(|(v, _)| v).collect();
            let all: f32 = own.iter().map(|v| luminance(v.flux)).sum();
            let mean =
                |of: fn(&Vpl) -> Vec3| own.iter().map(|v| luminance(v.flux) * of(v)).sum::<Vec3>() / all;
            if all > 0.0 {
                *centre = (mean(|v| Vec3::from(v.position_ws)), mean(Vpl::normal_ws).normalize());
            } else if iteration < ITERATIONS {
                *centre = place(&vpls[number * vpls.len() / clusters]);
            }
            let flux = own.iter().map(|v| Vec3::from(v.flux)).sum::<Vec3>();
            let area: f32 = own.iter().map(|v| v.radius().powi(2)).sum();
            lights.push(Vpl::new(centre.0, centre.1, flux, number as u32).with_radius(area.sqrt()));
        }
        centres = next;
    }
    (assigned, lights)
}

#[track_caller]
fn assert_same(lights: &[Vpl], twin: &[Vpl], size_m: f32) {
    assert_eq!(lights.len(), twin.len());
    for (number, (light, twin)) in lights.iter().zip(twin).enumerate() {
        let off = Vec3::from(light.position_ws).distance(twin.position_ws.into());
        assert!(off < 1e-4 * size_m, "{number}: {off} m");
        assert!(light.normal_ws().distance(twin.normal_ws()) < 1e-3, "{number}");
        let flux = Vec3::from(light.flux).distance(twin.flux.into());
        assert!(flux <= 1e-4 * Vec3::from(twin.flux).length(), "{number}: {flux} lm");
        assert!((light.radius() / twin.radius() - 1.0).abs() < 0.01, "{number}: {} m", light.radius());
        assert_eq!(light.block(), number as u32);
    }
}

#[test]
fn clusters_are_those_of_lloyds_algorithm_from_the_first_lights_and_from_the_last_frames_centres() {
    let mut rig = Rig::new(512, 100);
    let vpls = on_walls(500, Vec3::ZERO);
    let (lights, mean, assigned) = rig.clustered(&vpls, false);
    let (expected, twins) = twin(&vpls, &rig.settings, None);
    assert_eq!(assigned.iter().map(|i| *i as usize).collect::<Vec<_>>(), expected);
    assert_same(&lights, &twins, 1.0);
    let lit: Vec<_> = lights.iter().map(|v| luminance(v.flux)).filter(|flux| *flux > 0.0).collect();
    let octaves = lit.iter().map(|flux| flux.log2()).sum::<f32>() / lit.len() as f32;
    assert!((mean / octaves.exp2() - 1.0).abs() < 1e-3);
    // Other lights, from where those were; a still begins anew.
    let centres: Vec<Centre> = read(&rig.gpu, &rig.room.as_ref().unwrap().centres);
    let start = centres.iter().map(|c| (Vec3::from(c.position_ws), Vec3::from(c.normal_ws))).collect();
    let others: Vec<_> = on_walls(512, 0.01 * Vec3::X).split_off(100);
    let (warm, ..) = rig.clustered(&others, true);
    assert_same(&warm, &twin(&others, &rig.settings, Some(start)).1, 1.0);
    assert!(rig.clustered(&vpls, false).0 == lights);
}

#[test]
fn no_flux_and_no_area_is_lost_and_scenes_of_any_size_have_the_same_clusters() {
    for (around, scale) in
        [(Vec3::ZERO, 1.0), (Vec3::ZERO, 1e-3), (Vec3::ZERO, 1e7), (Vec3::splat(2000.0), 1.0)]
    {
        let vpls: Vec<_> = on_walls(300, around)
            .iter()
            .map(|v| {
                let at = scale * Vec3::from(v.position_ws);
                Vpl::new(at, v.normal_ws(), v.flux.into(), 0).with_radius(scale * v.radius())
            })
            .collect();
        for clusters in [1, 7, 64, 299] {
            let (lights, _, assigned) = Rig::new(300, clusters).clustered(&vpls, false);
            let sum = |of: &[Vpl]| of.iter().map(|v| Vec3::from(v.flux)).sum::<Vec3>();
            let area = |of: &[Vpl]| of.iter().map(|v| f64::from(v.radius()).powi(2)).sum::<f64>();
            assert!((sum(&lights) / sum(&vpls) - 1.0).abs().max_element() < 1e-4, "{clusters}");
            assert!((area(&lights) / area(&vpls) - 1.0).abs() < 0.02, "{clusters}");
            assert!(lights.len() as u32 == clusters && assigned.iter().all(|of| *of < clusters));
            if clusters == 64 && scale != 1.0 {
                let (own, ..) = Rig::new(300, 64).clustered(&on_walls(300, Vec3::ZERO), false);
                let same = own.iter().zip(&lights).filter(|(a, b)| {
                    (Vec3::from(b.position_ws) / scale).distance(a.position_ws.into()) < 1e-3
                });
                assert!(same.count() > 60, "×{scale}");
            }
        }
    }
}

#[test]
fn fewer_lights_than_clusters_stay_what_they_are_and_none_are_none() {
    let mut rig = Rig::new(64, 32);
    let vpls = on_walls(20, Vec3::ZERO);
    let (lights, ..) = rig.clustered(&vpls, false);
    assert_eq!(lights.len(), 20);
    let flux: f32 = lights.iter().map(|v| v.flux[0]).sum();
    assert!((flux / vpls.iter().map(|v| v.flux[0]).sum::<f32>() - 1.0).abs() < 1e-4);
    assert_eq!(rig.clustered(&[], false).0, []);
    assert_eq!(rig.clustered(&[], true).0, []);
}

#[test]
fn clusters_light_a_scene_as_their_lights_do() {
    let gpu = device();
    let of = |changes: &[(&str, &str)]| {
        let mut settings = Settings::default();
        let few = [
            ("environment.sky", "none"),
            ("indirect.technique", "ism"),
            ("indirect.points", "16384"),
            ("indirect.points_per_vpl", "1024"),
            ("indirect.ism_resolution", "32"),
            ("indirect.rsm_resolution", "128"),
        ];
        few.iter().chain(changes).for_each(|(key, value)| settings.set(key, value).unwrap());
        let scene = chiaro::scene::load("builtin:cornell").unwrap();
        let mut studio = Studio::new(&gpu, settings);
        let loaded = studio.load(&scene);
        let view = View::from_scene(&scene, 0).unwrap();
        studio.aov(&loaded, &view, [64, 64], 4, Aov::Indirect)
    };
    let all = of(&[("indirect.vpls", "1024")]);
    let few = of(&[("indirect.vpls", "1024"), ("indirect.clusters", "128")]);
    let mean = |image: &chiaro_image::Image| image.pixels().iter().flatten().sum::<f32>();
    let (share, off) = (mean(&few) / mean(&all), nmae(&few, &all));
    assert!((share - 1.0).abs() < 0.05 && off < 0.1, "{share} of the light, {off} elsewhere");
}
