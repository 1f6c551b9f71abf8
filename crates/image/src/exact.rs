//! Sums without rounding.

/// Floats of a sum at most: all bits between the smallest and the largest float, 24 a float, and one that is added.
const MOST: usize = 16;
/// Of [`sweep`] at most; a few do.
const SWEEPS: usize = 64;

/// Sums of 32-bit floats that lose nothing: what one float cannot hold of a sum stands in further ones (Shewchuk 1997,
/// "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", grow-expansion).
///
/// The floats of a sum depend on its value alone, for each is all that the ones before it leave, rounded to nearest: sums of
/// sums are the same bits in whatever order and grouping. That holds for all finite floats; a sum beyond the largest is
/// infinite.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactSums {
    // The sums rounded, then what is left of them, and so on; as many as any sum needs.
    layers: Vec<Vec<f32>>,
}

impl ExactSums {
    /// So many sums of nothing.
    pub fn new(count: usize) -> Self {
        Self { layers: vec![vec![0.0; count]] }
    }

    /// Adds a value to each sum; values beyond their number are left alone.
    pub fn add(&mut self, values: &[f32]) {
        for (index, &value) in values.iter().enumerate().take(self.layers[0].len()) {
            if value == 0.0 {
                continue;
            }
            let mut parts = [0.0; MOST];
            let count = self.layers.len().min(MOST - 1);
            for (part, layer) in parts.iter_mut().zip(&self.layers) {
                *part = layer[index];
            }
            grow(&mut parts, count, value);
            let needed = parts.iter().take_while(|part| **part != 0.0).count();
            while self.layers.len() < needed {
                self.layers.push(vec![0.0; self.layers[0].len()]);
            }
            for (layer, part) in self.layers.iter_mut().zip(parts) {
                layer[index] = part;
            }
        }
    }

    /// The sums rounded to nearest, what that leaves of them, what that leaves, and so on.
    pub fn layers(&self) -> &[Vec<f32>] {
        &self.layers
    }

    /// The same, to keep.
    pub fn into_layers(self) -> Vec<Vec<f32>> {
        self.layers
    }
}

/// The rounded sum of two floats, and what it is off by, exactly (Knuth).
fn two_sum(a: f32, b: f32) -> (f32, f32) {
    let sum = a + b;
    let of_b = sum - a;
    (sum, (a - (sum - of_b)) + (b - of_b))
}

/// Adds a value to the first `count` of a sum's floats, the largest first, of which there is one more then.
fn grow(parts: &mut [f32; MOST], count: usize, value: f32) {
    let mut carried = value;
    for index in (0..count).rev() {
        (carried, parts[index + 1]) = two_sum(carried, parts[index]);
    }
    parts[0] = carried;
    if parts.iter().all(|part| part.is_finite()) {
        normalised(&mut parts[..=count]);
        return;
    }
    // What was lost before a sum became infinite is not a number, and no part of it.
    let sum: f32 = parts.iter().filter(|part| !part.is_nan()).sum();
    let broken = value.is_nan() || parts[0].is_nan();
    *parts = [0.0; MOST];
    parts[0] = if broken { f32::NAN } else { sum };
}

/// Makes each float what the ones before it leave, rounded to nearest, of any floats with the same sum.
fn normalised(parts: &mut [f32]) {
    for first in 0..parts.len() {
        let rest = &mut parts[first..];
        sweep(rest);
        let [leading, next, after, ..] = rest else { return };
        if *after == 0.0 {
            return;
        }
        // Half way to another float the sweep takes the even one, whatever comes after.
        let other = two_sum(*leading, 2.0 * *next);
        if other.1 == 0.0 && next.signum() == after.signum() {
            (*leading, *next) = (other.0, -*next);
        }
    }
}

/// Adds neighbours up until every float is its sum with the next one, rounded, and all zeros stand behind.
fn sweep(parts: &mut [f32]) {
    for _ in 0..SWEEPS {
        let mut count = 0;
        for index in 0..parts.len() {
            let part = std::mem::take(&mut parts[index]);
            if part != 0.0 {
                parts[count] = part;
                count += 1;
            }
        }
        let mut changed = false;
        for index in (1..count).rev() {
            let (sum, rest) = two_sum(parts[index - 1], parts[index]);
            changed |= sum != parts[index - 1];
            (parts[index - 1], parts[index]) = (sum, rest);
        }
        if !changed {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summed(values: impl IntoIterator<Item = f32>) -> ExactSums {
        let mut sums = ExactSums::new(1);
        values.into_iter().for_each(|value| sums.add(&[value]));
        sums
    }

    fn parts(sums: &ExactSums) -> Vec<f32> {
        sums.layers().iter().map(|layer| layer[0]).filter(|part| *part != 0.0).collect()
    }

    /// In units of 2⁻⁶⁴.
    fn whole(value: f32) -> i128 {
        (f64::from(value) * 2f64.powi(64)) as i128
    }

    #[test]
    fn what_floats_lose_is_kept() {
        assert_eq!(parts(&summed([1e8, 1.0, 1e-8, -1e8])), [1.0, 1e-8]);
        let thousand = summed((0..1000).map(|_| 0.1));
        let exact: f64 = parts(&thousand).into_iter().map(f64::from).sum();
        assert_eq!(exact, 1000.0 * f64::from(0.1f32));
        // Half a step more than an even float, and a little: up, not to even.
        assert_eq!(parts(&summed([16_777_216.0, 1.0, 1e-9]))[..2], [16_777_218.0, -1.0]);
        // All that floats span.
        let all = [f32::MAX, 1.0, f32::MIN_POSITIVE * 3e7, f32::from_bits(1)];
        assert_eq!(parts(&summed(all)), all[..]);
        assert_eq!(parts(&summed([f32::MAX, f32::MAX, 1.0])), [f32::INFINITY]);
        assert!(parts(&summed([1.0, f32::NAN, 1.0]))[0].is_nan());
        assert_eq!(summed([1.0, -1.0]).layers()[0][0].to_bits(), 0);
    }

    #[test]
    fn sums_are_exact_and_do_not_depend_on_order_or_grouping() {
        let mut state = 1u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            (state >> 33) % below
        };
        for _ in 0..4000 {
            let count = 1 + next(20) as usize;
            let mut value = || {
                let mantissa = next(1 << 25) as f32 - (1 << 24) as f32;
                // Now close to each other, now far apart, now halves of each other's last places.
                mantissa.signum()
                    * if next(4) == 0 { 1.0 } else { mantissa.abs() }
                    * 2f32.powi(next(76) as i32 - 40)
            };
            let values: Vec<f32> = (0..count).map(|_| value()).collect();
            let found = parts(&summed(values.iter().copied()));
            let exact: i128 = values.iter().copied().map(whole).sum();
            assert_eq!(found.iter().copied().map(whole).sum::<i128>(), exact, "{values:?}");
            let mut left = exact;
            for &part in &found {
                assert_eq!(part, left as f32 * 2f32.powi(-64), "{values:?}: {found:?}");
                left -= whole(part);
            }
            let mut turned = values.clone();
            turned.rotate_left(next(count as u64) as usize);
            assert_eq!(parts(&summed(turned.iter().copied())), found, "{values:?}");
            let both = turned.split_at(next(count as u64) as usize);
            let both = [both.0, both.1].map(|group| parts(&summed(group.iter().copied())));
            assert_eq!(parts(&summed(both.into_iter().flatten())), found, "{values:?}");
        }
    }
}
