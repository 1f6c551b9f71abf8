//! A sequence of two dimensions whose every run is even.

/// A hash of low bias (Wellons 2018, "lowbias32"); twin of `hash` in `hash.wesl`.
pub(in crate::indirect) fn hash(x: u32) -> u32 {
    let mut v = x;
    v = (v ^ (v >> 16)).wrapping_mul(0x7feb_352d);
    v = (v ^ (v >> 15)).wrapping_mul(0x846c_a68b);
    v ^ (v >> 16)
}

/// Of two numbers.
pub(in crate::indirect) fn combined(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b ^ 0x9e37_79b9))
}

/// 0..1, without 1, from all bits of a hash.
pub(in crate::indirect) fn unit(hash: u32) -> f64 {
    f64::from(hash) / 4_294_967_296.0
}

/// Owen-scrambled points of Sobol's first two dimensions, unshuffled: the first is the radical inverse, of which any 2ᵏ
/// points in a row, wherever they begin, lie one in each of 2ᵏ equal parts; runs that begin at a multiple of their length
/// are (0, 2) nets of both.
#[derive(Clone, Copy, Debug)]
pub(in crate::indirect) struct Sequence {
    first: u32,
    second: u32,
}

impl Sequence {
    pub fn new(seed: u32) -> Self {
        Self { first: combined(seed, 1), second: combined(seed, 2) }
    }

    /// The first dimension of a point.
    pub fn first(self, index: u32) -> u32 {
        scrambled_reversed(index, self.first).reverse_bits()
    }

    /// The second.
    pub fn second(self, index: u32) -> u32 {
        let plain = second_dimension(index.reverse_bits());
        scrambled_reversed(plain.reverse_bits(), self.second).reverse_bits()
    }

    /// Both, 0..1.
    pub fn point(self, index: u32) -> [f64; 2] {
        [unit(self.first(index)), unit(self.second(index))]
    }
}

/// Owen scrambling of reversed bits: each bit flips by a hash of those below it (Laine & Karras 2011; constants by Vegdahl
/// 2021). Twin of the one in `sampler.wesl`.
fn scrambled_reversed(x: u32, seed: u32) -> u32 {
    let mut v = x;
    v ^= v.wrapping_mul(0x3d20_adea);
    v = v.wrapping_add(seed);
    v = v.wrapping_mul((seed >> 16) | 1);
    v ^= v.wrapping_mul(0x0552_6c56);
    v ^ v.wrapping_mul(0x53a2_2864)
}

/// Sobol's second dimension from the first (Ahmed 2024); twin of the one in `sampler.wesl`.
fn second_dimension(first: u32) -> u32 {
    let steps = [(16, !0), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)];
    steps.iter().fold(first, |v, &(shift, mask)| v ^ (v & mask) << shift)
}

/// Weights of a triangle's corners from a point of the square, without bending what is even (Heitz 2019, "A Low-Distortion
/// Map Between Triangle and Square"), in parts of 65,535, whose sum they are.
pub(in crate::indirect) fn corner_weights([x, y]: [f64; 2]) -> [u16; 3] {
    let [x, y] = if y > x { [0.5 * x, y - 0.5 * x] } else { [x - 0.5 * y, 0.5 * y] };
    let [b, c] = [x, y].map(|share| (share * 65_535.0 + 0.5) as u16);
    let b = b.min(u16::MAX - c);
    [u16::MAX - b - c, b, c]
}
