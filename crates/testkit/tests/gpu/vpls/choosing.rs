//! Which candidates are kept: by a chance of which the mean of what is kept is the candidates' flux.

use super::*;
use crate::culling::Random;
use chiaro_gpu::wgpu::BufferUsages;
use chiaro_gpu::{Buffer, BufferReadback, ComputePipeline, Dispatch, Frame, Gpu, Life, Recorder};
use chiaro_techniques::shaders;
use chiaro_testkit::{Bench, device_guaranteed};
use glam::Vec3;

/// The pass alone.
struct Rig<'a> {
    gpu: &'a Gpu,
    bench: Bench,
    choose: ComputePipeline,
}

/// Bytes that bindings are apart.
const STRIDE: u64 = 256;

impl<'a> Rig<'a> {
    fn new(gpu: &'a Gpu) -> Self {
        let bench = Bench::new(gpu);
        let entry = shaders::plain("indirect/vpls/choose.cs.wesl");
        let choose = ComputePipeline::new(gpu, &bench.kit.library, &entry, &[], &[]).unwrap();
        Self { gpu, bench, choose }
    }

    /// What is kept where thresholds are turned by each of some shares, of candidates that carry so much and are worth so much.
    fn kept(&self, candidates: &[(f32, f32)], vpls: u32, chances: &[f32], keeps_all: bool) -> Vec<Vec<Vpl>> {
        // Numbers as places.
        let of = |(i, (flux, _)): (usize, &(f32, f32))| {
            Vpl::new(Vec3::X * i as f32, Vec3::Y, Vec3::splat(*flux), i as u32).with_radius(1.0)
        };
        let all: Vec<_> = candidates.iter().enumerate().map(of).collect();
        let worth = |(flux, worth): &(f32, f32)| if *flux > 0.0 { *worth } else { -1.0 };
        // Thresholds in no order, each at even steps.
        let words = (2 * candidates.len()).next_multiple_of(STRIDE as usize / 4);
        let of_one = |i: usize, chance: f32| {
            let threshold = (i as f64 * 0.754_877_666 + f64::from(chance)).fract();
            [worth(&candidates[i]), threshold as f32]
        };
        let worths: Vec<f32> = chances
            .iter()
            .flat_map(|&chance| {
                let mut all: Vec<f32> = (0..candidates.len()).flat_map(|i| of_one(i, chance)).collect();
                all.resize(words, 0.0);
                all
            })
            .collect();
        let (all, worths) = (self.bench.buffer("candidates", &all), self.bench.buffer("worths", &worths));
        let uniforms: Vec<[u32; 64]> = chances
            .iter()
            .map(|_| {
                let data = Sampling {
                    candidates: candidates.len() as u32,
                    vpls,
                    keeps_all: u32::from(keeps_all),
                    ..Sampling::default()
                };
                let mut words = [0; 64];
                words[..16].copy_from_slice(bytemuck::cast_slice(&[data]));
                words
            })
            .collect();
        let uniforms = self.bench.buffer("sampling", &uniforms);
        let room = (u64::from(vpls) * size_of::<Vpl>() as u64).next_multiple_of(STRIDE);
        let many = chances.len() as u64;
        let make = |name, bytes| Buffer::new(self.gpu, name, Life::Kept, bytes, BufferUsages::STORAGE);
        let (kept, counts) = (make("vpls", many * room), make("vpl_count", many * STRIDE));
        let mut recorder = Recorder::new(self.gpu, false);
        let mut frame: Frame<'_> = recorder.begin();
        for i in 0..many {
            let part = |buffer, each, bytes| chiaro_gpu::Binding::BufferRange(buffer, i * each, bytes);
            let binds = [
                ("sampling", part(&uniforms, STRIDE, size_of::<Sampling>() as u64)),
                ("candidates", (&all).into()),
                ("worths", part(&worths, 4 * words as u64, 8 * candidates.len() as u64)),
                ("vpls", part(&kept, room, u64::from(vpls) * size_of::<Vpl>() as u64)),
                ("vpl_count", part(&counts, STRIDE, 16)),
            ];
            frame.compute("test/choose", &self.choose, &[], &binds, Dispatch::Groups([1, 1, 1]));
        }
        frame.submit();
        let read = |buffer| BufferReadback::start(self.gpu, buffer).wait(self.gpu).unwrap();
        let (kept, counts) = (read(&kept), read(&counts));
        let of = |i: usize| {
            let count: Vec<u32> = bytemuck::pod_collect_to_vec(&counts[i * STRIDE as usize..][..8]);
            assert!(count[0] <= vpls, "{} of {vpls}", count[0]);
            let bytes = &kept[i * room as usize..][..count[0] as usize * size_of::<Vpl>()];
            let list: Vec<Vpl> = bytemuck::pod_collect_to_vec(bytes);
            // No holes, nothing without light, in the order of the candidates, each with the block that it had.
            assert!(list.iter().all(|vpl| vpl.flux[0] > 0.0), "of {vpls} at {}: {list:?}", chances[i]);
            assert!(list.windows(2).all(|pair| pair[0].position_ws[0] < pair[1].position_ws[0]));
            // The mean of their fluxes by octaves stands beside their number.
            let octaves = list.iter().map(|vpl| vpl.flux[0].log2()).sum::<f32>() / list.len().max(1) as f32;
            let mean = f32::from_bits(count[1]);
            assert!((mean.log2() - octaves).abs() < 1e-3 * octaves.abs().max(1.0), "{mean}: 2^{octaves}");
            assert!(list.iter().all(|vpl| vpl.block() == vpl.position_ws[0] as u32));
            list
        };
        (0..chances.len()).map(of).collect()
    }

    /// Asserts that every candidate has its flux in the mean, and tells how many are kept at least and at most.
    fn assert_unbiased(&self, candidates: &[(f32, f32)], vpls: u32, name: &str) -> [usize; 2] {
        const MANY: u32 = 512;
        let chances: Vec<_> = (0..MANY).map(|k| (k as f32 + 0.5) / MANY as f32).collect();
        let lists = self.kept(candidates, vpls, &chances, false);
        let mut sums = vec![0.0f64; candidates.len()];
        let mut most = vec![0.0f64; candidates.len()];
        for vpl in lists.iter().flatten() {
            let i = vpl.position_ws[0] as usize;
            sums[i] += f64::from(vpl.flux[0]) / f64::from(MANY);
            most[i] = most[i].max(f64::from(vpl.flux[0]));
        }
        for (i, ((flux, _), (sum, most))) in candidates.iter().zip(sums.iter().zip(&most)).enumerate() {
            // Thresholds at even steps: so often as its share of them, to within one. Of few, some find no room.
            let expected = f64::from(*flux);
            let crowded = if candidates.len() > vpls as usize { 0.5 / f64::from(vpls) } else { 0.0 };
            let off = most / f64::from(MANY) + (crowded + 1e-4) * expected;
            let rare = *most == 0.0;
            assert!((sum - expected).abs() <= off || rare, "{name}: {i} has {sum}, not {expected}");
            // What is never kept in so many draws is kept seldom.
            assert!(!rare || expected == 0.0 || candidates.len() > vpls as usize, "{name}: {i} is lost");
        }
        let counts = lists.iter().map(Vec::len);
        [counts.clone().min().unwrap(), counts.max().unwrap()]
    }
}

fn random(count: usize, seed: u64) -> Vec<(f32, f32)> {
    let mut random = Random::new(seed);
    let one = |_| {
        let lit = random.within(0.0, 1.0) < 0.7;
        let worth = random.within(0.0, 1.0).powi(6);
        if lit { (random.within(0.5, 2.0), worth) } else { (0.0, 0.0) }
    };
    (0..count).map(one).collect()
}

#[test]
fn the_mean_of_what_is_kept_is_what_the_candidates_carry() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    for (count, vpls) in [(64, 16), (300, 75), (1000, 250), (5, 16)] {
        let name = format!("{vpls} of {count}");
        let [least, most] = rig.assert_unbiased(&random(count, count as u64), vpls, &name);
        // All but one, and one more or less by chance; those of great worth count as one.
        assert!(most <= vpls as usize && least > 0, "{name}: {least} to {most}");
    }
}

#[test]
fn as_many_are_kept_as_fit_but_for_chance() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    let even: Vec<_> = (0..400).map(|i| (1.0, 1.0 + (i % 7) as f32)).collect();
    for vpls in [8u32, 50, 100] {
        let [least, most] = rig.assert_unbiased(&even, vpls, "even");
        let deviation = f64::from(vpls).sqrt();
        assert!(
            least as f64 >= f64::from(vpls) - 4.0 * deviation && most <= vpls as usize,
            "{vpls}: {least} to {most}"
        );
    }
}

#[test]
fn without_any_worth_all_lit_have_the_same_chance() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    let blind: Vec<_> = (0..200).map(|i| (if i % 3 == 0 { 0.0 } else { 1.0 }, 0.0)).collect();
    let [least, most] = rig.assert_unbiased(&blind, 40, "blind");
    assert!(least >= 24 && most <= 40, "{least} to {most}");
    let dark = vec![(0.0, 0.0); 100];
    assert_eq!(rig.assert_unbiased(&dark, 40, "dark"), [0; 2]);
}

#[test]
fn a_single_lit_candidate_is_always_kept_as_it_is() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    for (at, worth, vpls) in
        [(0, 1.0, 1), (99, 1.0, 1), (50, 0.0, 2), (50, 1e-30, 2), (50, 1e-42, 64), (50, 1e29, 64)]
    {
        let mut all = vec![(0.0, 0.0); 100];
        all[at] = (3.0, worth);
        for list in rig.kept(&all, vpls, &[0.0, 0.25, 0.5, 0.75, 1.0 - f32::EPSILON], false) {
            assert_eq!(list.len(), 1, "worth {worth}");
            assert!((list[0].flux[0] - 3.0).abs() < 1e-3 && list[0].position_ws[0] == at as f32);
        }
    }
}

#[test]
fn the_least_chance_is_a_chance() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    // Next to nothing beside what is worth all: kept at the least of thresholds alone.
    let mut all = vec![(1.0, 0.0); 65_536];
    all[65_535].1 = 1.0;
    let chances: Vec<_> = (0..256).map(|k| k as f32 / 32_768.0).collect();
    let lists = rig.kept(&all, 4, &chances, false);
    let first = lists.iter().filter(|list| list.first().is_some_and(|vpl| vpl.position_ws[0] == 0.0)).count();
    assert_eq!(first, 1, "kept {first} times");
}

#[test]
fn by_flux_alone_all_that_are_lit_are_kept() {
    let gpu = device_guaranteed();
    let rig = Rig::new(&gpu);
    let all = random(200, 4);
    let lit: Vec<_> = all.iter().map(|(flux, _)| *flux).filter(|flux| *flux > 0.0).collect();
    for list in rig.kept(&all, 200, &[0.0, 0.3, 1.0 - f32::EPSILON], true) {
        assert_eq!(list.iter().map(|vpl| vpl.flux[0]).collect::<Vec<_>>(), lit);
    }
}
