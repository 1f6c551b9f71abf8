//! Sequences and orders.

use bytemuck::{Pod, Zeroable};
use chiaro_gpu::Dispatch;
use chiaro_testkit::{Bench, device_guaranteed};

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    halton: [f32; 2],
    morton: u32,
    reserved: u32,
    back: [u32; 2],
    at: [u32; 2],
}

fn answers(input: &[[u32; 2]]) -> Vec<Answer> {
    let gpu = device_guaranteed();
    let bench = Bench::new(&gpu);
    let buffer = bench.buffer("input", input);
    let shader = ("tests/vpl_functions.cs.wesl", include_str!("../wesl/vpl_functions.cs.wesl"));
    let work = (Dispatch::Threads([input.len() as u32, 1, 1]), input.len());
    bench.run(shader, &[], None, &[("input", (&buffer).into())], work)
}

/// Digits mirrored at the point.
fn radical_inverse(mut i: u32, base: u32) -> f64 {
    let (mut sum, mut scale) = (0.0, 1.0);
    while i > 0 {
        scale /= f64::from(base);
        sum += f64::from(i % base) * scale;
        i /= base;
    }
    sum
}

#[test]
fn halton_is_two_radical_inverses() {
    let answers = answers(&vec![[0; 2]; 8192]);
    for (i, answer) in (0..).zip(&answers) {
        for (found, base) in answer.halton.into_iter().zip([2, 3]) {
            let expected = radical_inverse(i, base);
            assert!(
                (f64::from(found) - expected).abs() < 2e-7,
                "{i} in base {base}: {found}, not {expected}"
            );
            assert!((0.0..1.0).contains(&found));
        }
    }
}

#[test]
fn mortons_order_is_a_bijection() {
    const SIDE: u32 = 64;
    let mut input: Vec<_> = (0..SIDE * SIDE).map(|i| [i % SIDE, i / SIDE]).collect();
    let far = [[65_535, 65_535], [65_535, 0], [0, 65_535], [43_690, 21_845], [32_768, 1]];
    input.extend(far);
    let answers = answers(&input);
    let mut seen = vec![false; (SIDE * SIDE) as usize];
    for (i, (given, answer)) in (0..).zip(input.iter().zip(&answers)) {
        assert_eq!(*given, answer.back);
        let bits = |v: u32| (0..16).fold(0, |code, bit| code | (v >> bit & 1) << (2 * bit));
        assert_eq!(answer.morton, bits(given[0]) | bits(given[1]) << 1);
        if i < SIDE * SIDE {
            // A square whose side is a power of two is a run of the order.
            assert!(!std::mem::replace(&mut seen[answer.morton as usize], true));
            assert!(answer.at.iter().all(|v| *v < SIDE));
            assert_eq!(bits(answer.at[0]) | bits(answer.at[1]) << 1, i);
        }
    }
}
