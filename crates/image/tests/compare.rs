//! The metrics, held against known answers and against an independent implementation.

use chiaro_image::{CompareOptions, Comparison, Image, ImageError, Metrics};

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;

fn metrics(a: &Image, b: &Image, options: &CompareOptions) -> Metrics {
    Comparison::new(a, b, options).unwrap().metrics()
}

/// A test image from an integer formula whose values are exact in `f32`.
fn pattern(value: impl Fn(u32, u32, u32) -> f32) -> Image {
    Image::from_fn(WIDTH, HEIGHT, |x, y| [0, 1, 2].map(|channel| value(x, y, channel)))
}

fn reference() -> Image {
    pattern(|x, y, c| ((x * 7 + y * 13 + c * 5) % 32) as f32 / 16.0 + 0.125)
}

fn deviating() -> Image {
    let mut image = pattern(|x, y, c| ((x * 5 + y * 11 + c * 3) % 16) as f32 / 64.0 - 0.125 + 0.03125);
    for (value, reference) in
        image.pixels_mut().iter_mut().flatten().zip(reference().pixels().iter().flatten())
    {
        *value += reference;
    }
    image
}

fn broken() -> Image {
    let mut image = deviating();
    image.pixels_mut()[(3 * WIDTH + 5) as usize] = [f32::NAN; 3];
    image.pixels_mut()[(7 * WIDTH + 9) as usize][1] = f32::INFINITY;
    image
}

fn mask() -> Image {
    pattern(|x, y, _| if (x / 4 + y / 4) % 5 == 0 { 1.0 } else { 0.0 })
}

/// The expected figures were computed from the same images by NumPy in double precision after the definitions that
/// [`Metrics`] states, `flip` by NVIDIA's flip-evaluator 1.7, which works in single precision.
fn assert_golden(
    found: &Metrics,
    [mean_ratio, nmae, relmse, flip]: [f64; 4],
    pixels: usize,
    not_finite: usize,
) {
    for (name, found, expected, tolerance) in [
        ("mean_ratio", found.mean_ratio, mean_ratio, 1e-9),
        ("nmae", found.nmae, nmae, 1e-9),
        ("relmse", found.relmse, relmse, 1e-9),
        ("flip", found.flip, flip, 2e-5),
    ] {
        assert!((found - expected).abs() < tolerance, "{name} is {found}, expected {expected}");
    }
    assert_eq!((found.pixels, found.not_finite), (pixels, not_finite));
}

#[test]
fn metrics_of_whole_images_agree_with_numpy() {
    let found = metrics(&deviating(), &reference(), &CompareOptions::default());
    assert_golden(&found, [1.0214285714285714, 0.05892857142857143, 0.02503315813560329, 0.0912046], 768, 0);
}

#[test]
fn values_that_are_not_finite_are_counted_and_taken_as_black() {
    let found = metrics(&broken(), &reference(), &CompareOptions::default());
    assert_golden(
        &found,
        [1.0192708333333333, 0.060863095238095244, 0.025709009891711623, 0.0951293],
        768,
        4,
    );
}

#[test]
fn masked_metrics_agree_with_numpy() {
    let options = CompareOptions { mask: Some(&mask()), ..CompareOptions::default() };
    let found = metrics(&deviating(), &reference(), &options);
    assert_golden(&found, [1.021608040201005, 0.05910804020100503, 0.02485947984755951, 0.0906925], 608, 0);
}

fn minus_a() -> Image {
    pattern(|x, y, c| ((x + y + c) % 8) as f32 / 64.0)
}

fn minus_b() -> Image {
    pattern(|x, y, c| ((x + 2 * y + c) % 8) as f32 / 64.0)
}

#[test]
fn metrics_of_differences_agree_with_numpy() {
    let (minus_a, minus_b) = (minus_a(), minus_b());
    let options =
        CompareOptions { minus_a: Some(&minus_a), minus_b: Some(&minus_b), ..CompareOptions::default() };
    let found = metrics(&deviating(), &reference(), &options);
    assert_golden(&found, [1.0225563909774436, 0.07142857142857142, 0.07835738860449461, 0.0950312], 768, 0);
}

#[test]
fn blurred_metrics_agree_with_numpy() {
    let options = CompareOptions { blur_px: 1.5, ..CompareOptions::default() };
    let found = metrics(&deviating(), &reference(), &options);
    assert_golden(
        &found,
        [1.0214379351296097, 0.021510035729217242, 0.0006542653748692173, 0.0974401],
        768,
        0,
    );
}

#[test]
fn everything_at_once_agrees_with_numpy() {
    let (mask, minus_a, minus_b) = (mask(), minus_a(), minus_b());
    let options =
        CompareOptions { mask: Some(&mask), minus_a: Some(&minus_a), minus_b: Some(&minus_b), blur_px: 2.0 };
    let found = metrics(&broken(), &reference(), &options);
    assert_golden(
        &found,
        [1.0198841406800372, 0.02232746534877595, 0.0006685005484078085, 0.0975096],
        608,
        4,
    );
}

/// PSNR and SSIM by NumPy and SciPy after the definitions that [`Metrics`] states, in double precision; HDR-FLIP by
/// flip-evaluator 1.7, in single precision.
#[track_caller]
fn assert_looks(found: &Metrics, psnr: f64, ssim: f64, hdr_flip: Option<f64>) {
    assert!((found.psnr - psnr).abs() < 1e-8, "psnr is {}, expected {psnr}", found.psnr);
    assert!((found.ssim - ssim).abs() < 1e-9, "ssim is {}, expected {ssim}", found.ssim);
    if let Some(expected) = hdr_flip {
        assert!((found.hdr_flip - expected).abs() < 2e-5, "HDR-FLIP is {}, not {expected}", found.hdr_flip);
    }
}

#[test]
fn what_a_screen_shows_agrees_with_numpy_and_flip_evaluator() {
    let found = metrics(&deviating(), &reference(), &CompareOptions::default());
    assert_looks(&found, 30.157953036008124, 0.9885500467841952, Some(0.0790752));
    let options = CompareOptions { mask: Some(&mask()), ..CompareOptions::default() };
    let found = metrics(&deviating(), &reference(), &options);
    assert_looks(&found, 30.162615570189804, 0.9884159899337583, None);
}

#[test]
fn images_of_twelve_stops_agree_with_numpy_and_flip_evaluator() {
    let reference = pattern(|x, y, c| (((x * 7 + y * 13 + c * 5) % 12) as f32 - 4.0).exp2());
    let factors = pattern(|x, y, c| 1.0 + ((x * 5 + y * 11 + c * 3) % 16) as f32 / 32.0);
    let mut image = reference.clone();
    for (value, factor) in image.pixels_mut().iter_mut().flatten().zip(factors.pixels().iter().flatten()) {
        *value *= factor;
    }
    let found = metrics(&image, &reference, &CompareOptions::default());
    assert!((found.flip - 0.1823485).abs() < 2e-5, "{found:?}");
    assert_looks(&found, 28.54123758825926, 0.9914080333180069, Some(0.1370022));
}

#[test]
fn an_image_equals_itself() {
    let found = metrics(&reference(), &reference(), &CompareOptions::default());
    assert_golden(&found, [1.0, 0.0, 0.0, 0.0], 768, 0);
    assert_eq!((found.psnr, found.ssim, found.hdr_flip), (f64::INFINITY, 1.0, 0.0));
}

#[test]
fn a_constant_offset_has_the_psnr_that_algebra_gives() {
    // B is shown at 0.9, A at 0.45; 1 is white.
    let [a, b] = [0.5, 1.0].map(|value| Image::filled(8, 8, [value; 3]));
    let srgb = |linear: f64| 1.055 * linear.powf(1.0 / 2.4) - 0.055;
    let found = metrics(&a, &b, &CompareOptions::default());
    let expected = -20.0 * (srgb(0.9) - srgb(0.45)).log10();
    assert!((found.psnr - expected).abs() < 1e-9, "{} is not {expected}", found.psnr);
}

#[test]
fn a_tenth_too_bright_has_the_errors_that_algebra_gives() {
    // On a plain image: B² + (0.05 B)² = 1.0025 B², so relMSE is 0.01 / 1.0025.
    let found =
        metrics(&Image::filled(8, 8, [1.1; 3]), &Image::filled(8, 8, [1.0; 3]), &CompareOptions::default());
    assert!((found.mean_ratio - 1.1).abs() < 1e-6);
    assert!((found.nmae - 0.1).abs() < 1e-6);
    assert!((found.relmse - 0.01 / 1.0025).abs() < 1e-6);
}

#[test]
fn relmse_forgives_one_firefly_in_a_thousand_and_nmae_does_not() {
    let plain = Image::filled(50, 40, [1.0; 3]);
    let mut fireflies = plain.clone();
    fireflies.pixels_mut()[77] = [1000.0; 3];
    fireflies.pixels_mut()[1234] = [1000.0; 3];
    let found = metrics(&fireflies, &plain, &CompareOptions::default());
    assert_eq!(found.relmse, 0.0);
    assert!((found.nmae - 2.0 * 999.0 / 2000.0).abs() < 1e-9);
}

#[test]
fn the_blur_does_not_carry_masked_light_out_of_the_mask() {
    let mask = pattern(|x, _, _| if x < 16 { 1.0 } else { 0.0 });
    let right = pattern(|x, _, _| if x < 16 { 100.0 } else { 1.0 });
    let plain = Image::filled(WIDTH, HEIGHT, [1.0; 3]);
    let options = CompareOptions { mask: Some(&mask), blur_px: 3.0, ..CompareOptions::default() };
    assert!(metrics(&right, &plain, &options).nmae < 1e-12);
}

#[test]
fn different_sizes_are_refused_with_both_sizes() {
    let error = Comparison::new(
        &Image::filled(3, 2, [1.0; 3]),
        &Image::filled(2, 3, [1.0; 3]),
        &CompareOptions::default(),
    )
    .unwrap_err();
    let message = error.to_string();
    assert!(message.contains("3×2") && message.contains("2×3"), "{message}");
}

#[test]
fn a_reference_that_is_not_finite_is_refused_unless_masked() {
    let plain = Image::filled(WIDTH, HEIGHT, [1.0; 3]);
    let error = Comparison::new(&plain, &broken(), &CompareOptions::default()).unwrap_err();
    assert!(matches!(error, ImageError::NotFinite { what: "B", count: 4, first: (5, 3) }), "{error}");
    let everything_broken = pattern(|x, y, _| if (x, y) == (5, 3) || (x, y) == (9, 7) { 1.0 } else { 0.0 });
    let options = CompareOptions { mask: Some(&everything_broken), ..CompareOptions::default() };
    assert!(metrics(&plain, &broken(), &options).nmae.is_finite());
}

#[test]
fn nothing_to_compare_is_an_error_not_a_nan() {
    let plain = Image::filled(4, 4, [1.0; 3]);
    let black = Image::filled(4, 4, [0.0; 3]);
    let all = CompareOptions { mask: Some(&plain), ..CompareOptions::default() };
    assert!(matches!(Comparison::new(&plain, &plain, &all), Err(ImageError::NoReference { .. })));
    let against_black = Comparison::new(&plain, &black, &CompareOptions::default());
    assert!(matches!(against_black, Err(ImageError::NoReference { .. })));
}
