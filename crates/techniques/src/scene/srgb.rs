//! sRGB codes and linear values, by table.

use std::sync::LazyLock;

/// Linear values of sRGB codes.
pub(crate) static DECODE: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|code| {
        let c = code as f32 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
});

/// The nearest sRGB code of a linear value in 0..1.
pub(super) fn encode(linear: f32) -> u8 {
    let encoder = &*ENCODE;
    let mut code = encoder.first[(linear * (STEPS - 1) as f32) as usize];
    while linear >= encoder.starts[usize::from(code) + 1] {
        code += 1;
    }
    code
}

/// Steps of linear values, short enough to hold few codes each.
const STEPS: usize = 1 << 12;

/// The power function by table, which would else be most of the time that mips take.
struct Encoder {
    /// The code of the least value of each step.
    first: Vec<u8>,
    /// The least value of each code; infinity after the last.
    starts: [f32; 257],
}

static ENCODE: LazyLock<Encoder> = LazyLock::new(|| {
    let mut starts = [f32::INFINITY; 257];
    starts[0] = 0.0;
    for code in 1..=255u8 {
        // Positive floats are in the order of their bits.
        let (mut below, mut from) = (0, 1.0f32.to_bits());
        while from - below > 1 {
            let middle = u32::midpoint(below, from);
            if encode_exactly(f32::from_bits(middle)) < code { below = middle } else { from = middle }
        }
        starts[usize::from(code)] = f32::from_bits(from);
    }
    let first = (0..STEPS).map(|step| encode_exactly(step as f32 / (STEPS - 1) as f32)).collect();
    Encoder { first, starts }
});

fn encode_exactly(linear: f32) -> u8 {
    let code = if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (code * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_codes_is_the_power_function() {
        let around = |x: f32| [x.next_down().max(0.0), x, x.next_up().min(1.0)];
        let steps = (0..=1 << 18).map(|i| i as f32 / (1 << 18) as f32);
        for x in steps.chain(ENCODE.starts[1..256].iter().copied()).flat_map(around) {
            assert_eq!(encode(x), encode_exactly(x), "{x}");
        }
    }
}
