//! Irradiance without most of its noise, for paths on a budget.

use chiaro::View;
use chiaro_image::Image;
use glam::{DVec3, DVec4, Vec2};
use rayon::prelude::*;

/// What the camera sees first, means over a pixel.
#[derive(Clone, Debug)]
pub struct Features {
    /// Base colour.
    pub albedo: Image,
    /// World-space shading normal.
    pub normal: Image,
    /// Metres along the camera's axis; 0 where nothing is seen.
    pub depth: Image,
    /// What of the picture glows or is background itself, nits: it is no irradiance.
    pub glow: Image,
}

/// Five taps of a cubic B-spline.
const KERNEL: [f32; 5] = [1.0 / 16.0, 4.0 / 16.0, 6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];
/// How far one sample a pixel is spread to each side, of the picture's height; four times the samples half as far.
const REACH: f64 = 1.0 / 24.0;
/// A normal's cosine to this power.
const NORMAL_POWER: i32 = 32;
/// Pixels' widths that a plane may be missed by, for each pixel of distance.
const PLANE: f32 = 1.0;
/// Of colours that are divided by.
const LEAST_ALBEDO: f32 = 0.02;

/// Filters irradiance along edges of planes and normals in steps of growing holes (Dammertz, Sewtz, Hanika & Lensch 2010,
/// "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering", without their colour weight, so that it
/// takes no light away), and multiplies by the albedo afterwards: textures stay sharp. A bias by design: shadows' edges blur,
/// and so does what mirrors show.
pub fn filter(radiance: &Image, features: &Features, view: &View, samples: u32) -> Image {
    let (width, height) = radiance.size();
    let albedo: Vec<[f32; 3]> =
        features.albedo.pixels().iter().map(|a| a.map(|v| v.max(LEAST_ALBEDO))).collect();
    let positions = positions(features, view, [width, height]);
    let lit = radiance.pixels().iter().zip(features.glow.pixels()).zip(&albedo);
    let mut light: Vec<[f32; 3]> = lit.map(|((l, g), a)| [0, 1, 2].map(|c| (l[c] - g[c]) / a[c])).collect();
    let reach = f64::from(height) * REACH / f64::from(samples.max(1)).sqrt();
    let levels = reach.log2().round().max(0.0) as u32;
    for level in 0..levels {
        let step = 1i64 << level;
        let pass = |index: usize| -> [f32; 3] {
            let Some((position, pixel_m)) = positions[index] else { return light[index] };
            let (x, y) = (index as i64 % i64::from(width), index as i64 / i64::from(width));
            let normal = DVec3::from(features.normal.pixels()[index].map(f64::from)).normalize_or_zero();
            let (mut sum, mut weights) = ([0.0; 3], 0.0);
            for (row, down) in KERNEL.into_iter().zip(-2i64..) {
                for (column, right) in KERNEL.into_iter().zip(-2i64..) {
                    let (px, py) = (x + right * step, y + down * step);
                    if px < 0 || py < 0 || px >= i64::from(width) || py >= i64::from(height) {
                        continue;
                    }
                    let there = (py * i64::from(width) + px) as usize;
                    let Some((other, _)) = positions[there] else { continue };
                    let facing =
                        DVec3::from(features.normal.pixels()[there].map(f64::from)).normalize_or_zero();
                    let missed = (other - position).dot(normal).abs();
                    let reach = f64::from(PLANE) * pixel_m * (1.0 + step as f64);
                    let alike = facing.dot(normal).max(0.0).powi(NORMAL_POWER) * (-missed / reach).exp();
                    let weight = if there == index { row * column } else { row * column * alike as f32 };
                    weights += weight;
                    for c in 0..3 {
                        sum[c] += weight * light[there][c];
                    }
                }
            }
            sum.map(|v| v / weights)
        };
        light = (0..light.len()).into_par_iter().map(pass).collect();
    }
    let lit = light.iter().zip(features.glow.pixels()).zip(&albedo);
    let mut lit = lit.map(|((l, g), a)| [0, 1, 2].map(|c| l[c] * a[c] + g[c]));
    Image::from_fn(width, height, |_, _| lit.next().unwrap_or_default())
}

/// Where a pixel's middle is in the world, and how wide a pixel is there, metres; `None` where nothing is seen.
fn positions(features: &Features, view: &View, [width, height]: [u32; 2]) -> Vec<Option<(DVec3, f64)>> {
    let ws_from_clip = view.clip_from_ws([width, height], Vec2::ZERO).as_dmat4().inverse();
    let (eye, forward) = (view.eye_ws().as_dvec3(), view.forward_ws().as_dvec3());
    let ray = |x: f64, y: f64| {
        let at = |depth: f64| {
            let ndc =
                DVec4::new(2.0 * x / f64::from(width) - 1.0, 1.0 - 2.0 * y / f64::from(height), depth, 1.0);
            let p = ws_from_clip * ndc;
            p.truncate() / p.w
        };
        // Depth is reversed, and infinity is 0.
        let (near, far) = (at(1.0), at(0.5));
        (near, far - near)
    };
    let on_plane = |x: f64, y: f64, away: f64| {
        let (from, towards) = ray(x, y);
        from + towards * ((away - (from - eye).dot(forward)) / towards.dot(forward))
    };
    let all = features.depth.pixels().iter().enumerate();
    all.map(|(index, depth)| {
        let away = f64::from(depth[0]);
        let (x, y) = (f64::from(index as u32 % width) + 0.5, f64::from(index as u32 / width) + 0.5);
        (away > 0.0).then(|| {
            let place = on_plane(x, y, away);
            (place, (on_plane(x + 1.0, y, away) - place).length())
        })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use chiaro::Lookout;
    use chiaro::scene::Scene;

    use super::*;

    const WIDTH: u32 = 320;
    const HEIGHT: u32 = 240;
    const EDGE: u32 = 160;

    /// A wall that faces the camera, and its right half `step` nearer; a pixel of it glows.
    fn features(step: f32) -> Features {
        let depth = |x: u32| if x < EDGE { 10.0 } else { 10.0 - step };
        Features {
            albedo: Image::from_fn(WIDTH, HEIGHT, |x, y| [if (x + y) % 2 == 0 { 0.8 } else { 0.2 }; 3]),
            normal: Image::filled(WIDTH, HEIGHT, [0.0, 0.0, 1.0]),
            depth: Image::from_fn(WIDTH, HEIGHT, |x, _| [depth(x); 3]),
            glow: Image::from_fn(WIDTH, HEIGHT, |x, y| [if (x, y) == (200, 50) { 1e4 } else { 0.0 }; 3]),
        }
    }

    fn view() -> View {
        let lookout = Lookout { eye_m: DVec3::new(0.0, 0.0, 10.0), target_m: DVec3::ZERO, yfov_rad: 0.8 };
        lookout.view(&Scene::default())
    }

    #[test]
    fn noise_goes_and_textures_edges_and_what_glows_stay() {
        let features = features(2.0);
        let side = |x: u32| if x < EDGE { 1.0 } else { 3.0 };
        // Irradiance / π, up and down by half of it.
        let light = |x: u32, y: u32| side(x) * if x / 2 % 2 == y / 2 % 2 { 1.5 } else { 0.5 };
        let noisy = Image::from_fn(WIDTH, HEIGHT, |x, y| {
            let glow = features.glow.pixel(x, y)[0];
            features.albedo.pixel(x, y).map(|albedo| albedo * light(x, y) + glow)
        });
        let found = filter(&noisy, &features, &view(), 1);
        for (x, y) in [(60, 120), (150, 30), (EDGE - 1, 120), (EDGE, 120), (300, 200)] {
            let ratio = found.pixel(x, y)[0] / (side(x) * features.albedo.pixel(x, y)[0]);
            assert!((ratio - 1.0).abs() < 0.05, "({x}, {y}): {ratio}");
        }
        assert!(found.pixel(200, 50)[0] > 1e4 && found.pixel(201, 50)[0] < 4.0);
    }

    #[test]
    fn many_samples_are_left_as_they_are() {
        let features = features(0.0);
        let image = Image::from_fn(WIDTH, HEIGHT, |x, y| [(x * y) as f32; 3]);
        let found = filter(&image, &features, &view(), 4096);
        let pairs = image.pixels().iter().flatten().zip(found.pixels().iter().flatten());
        // But for the rounding beside what glows.
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() <= 1e-5 * a.abs() + 2e-3));
    }
}
