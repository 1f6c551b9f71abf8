//! Transfer functions and luminance of linear Rec. 709 colours.

/// The sRGB value (0–1 for display) of a linear value, IEC 61966-2-1. Not clamped.
pub fn srgb_from_linear(linear: f64) -> f64 {
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The same of values in 0–1, in a third of the time.
pub(crate) fn srgb_from_linear_unit(linear: f64) -> f64 {
    // x^(1/2.4) = c · ⁴√c where c = ∛x.
    let root = cube_root(linear.max(0.0031308));
    if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * root * root.sqrt().sqrt() - 0.055 }
}

/// The linear value of an sRGB value, IEC 61966-2-1; the inverse of [`srgb_from_linear`]. Not clamped.
pub fn linear_from_srgb(srgb: f64) -> f64 {
    if srgb <= 0.04045 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

/// The byte that shows a linear value on an sRGB screen: 0 for NaN and everything below black, 255 above white.
pub fn srgb8_from_linear(linear: f32) -> u8 {
    // `as` saturates and takes NaN to 0, which is the clamp wanted here.
    (srgb_from_linear(linear as f64) * 255.0).round() as u8
}

/// Relative luminance Y of a linear Rec. 709 colour, in the colour's own unit.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The same in `f64`.
pub(crate) fn luminance_f64([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The cube root of a value that is positive and not tiny, in half the time of `f64::cbrt`: loops of it vectorise.
pub(crate) fn cube_root(value: f64) -> f64 {
    cube_root_from(rough_cube_root(value as f32), value)
}

/// The same to 0.003 %.
pub(crate) fn rough_cube_root(value: f32) -> f32 {
    // A third of the exponent is right to 4 %, and each of Halley's steps leaves 2/3 of an error's cube.
    let guess = f32::from_bits(value.to_bits() / 3 + 0x2a51_19f2);
    let cube = guess * guess * guess;
    guess * (cube + 2.0 * value) / (2.0 * cube + value)
}

/// The cube root from a rough one.
pub(crate) fn cube_root_from(rough: f32, value: f64) -> f64 {
    let rough = f64::from(rough);
    let cube = rough * rough * rough;
    rough * (cube + 2.0 * value) / (2.0 * cube + value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_and_linear_are_inverses_for_every_byte() {
        for byte in 0..=255_u8 {
            assert_eq!(srgb8_from_linear(linear_from_srgb(byte as f64 / 255.0) as f32), byte);
        }
    }

    #[test]
    fn cube_roots_are_exact() {
        for value in (1..=1000).map(|i| 0.005 * f64::from(i)) {
            assert!((cube_root(value) / value.cbrt() - 1.0).abs() < 1e-13, "{value}");
            let unit = value / 5.0;
            assert!((srgb_from_linear_unit(unit) - srgb_from_linear(unit)).abs() < 1e-13, "{unit}");
        }
    }

    #[test]
    fn middle_grey_is_byte_118() {
        // 18 % grey is 117.7 of 255 in sRGB.
        assert_eq!(srgb8_from_linear(0.18), 118);
    }

    #[test]
    fn bytes_saturate_and_nan_is_black() {
        let bytes = [f32::NAN, -3.0, f32::NEG_INFINITY, 7.0, f32::INFINITY].map(srgb8_from_linear);
        assert_eq!(bytes, [0, 0, 0, 255, 255]);
    }

    #[test]
    fn white_has_luminance_one() {
        assert!((luminance([1.0; 3]) - 1.0).abs() < 1e-6);
    }
}
