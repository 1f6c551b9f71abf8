//! Terrain from pictures, right and wrong.

use std::io::Cursor;
use std::path::Path;

use glam::Vec3;
use image::{DynamicImage, GrayAlphaImage, GrayImage, ImageBuffer, ImageFormat, Luma, LumaA, RgbImage};

use crate::invariants::assert_sound;
use crate::{HeightMap, Memory, Scene, SceneError};

fn png(image: impl Into<DynamicImage>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

fn load(map: &HeightMap, bytes: Vec<u8>) -> Result<Scene, SceneError> {
    let mut files = Memory::default();
    files.insert("hills.png", bytes);
    map.load(&files)
}

fn map(vertices: usize) -> HeightMap {
    HeightMap { size_m: Some([40.0, 20.0]), height_m: Some(8.0), vertices, ..HeightMap::new("hills.png") }
}

/// The vertices of the ground, without sides and bottom: rows along +X of columns along +Z.
fn ground(scene: &Scene) -> &[Vec3] {
    assert_sound(scene);
    &scene.meshes[0].primitives[0].positions
}

#[test]
fn eight_and_sixteen_bits_give_the_same_ground_and_every_texel_its_height() {
    let grey = |x: u32, z: u32| (37 * x + 91 * z + x * z * 13) % 256;
    let eight = png(GrayImage::from_fn(5, 4, |x, z| Luma([grey(x, z) as u8])));
    let sixteen =
        png(DynamicImage::ImageLuma16(ImageBuffer::from_fn(5, 4, |x, z| Luma([257 * grey(x, z) as u16]))));
    // One vertex for each pixel of the 5 × 4, and two between: 13 and 13.
    let scenes = [eight, sixteen].map(|bytes| load(&map(13), bytes).unwrap());
    for scene in &scenes {
        for (x, z) in (0..5).flat_map(|x| (0..4).map(move |z| (x, z))) {
            let p = ground(scene)[(3 * x as usize) * 13 + 4 * z as usize];
            let expected = Vec3::new(
                10.0 * x as f32 - 20.0,
                8.0 * grey(x, z) as f32 / 255.0,
                20.0 / 3.0 * z as f32 - 10.0,
            );
            assert!(p.distance(expected) < 1e-4, "{x}, {z}: {p} should be {expected}");
        }
    }
    assert_eq!(ground(&scenes[0]).len(), 169);
    let off =
        ground(&scenes[0]).iter().zip(ground(&scenes[1])).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
    assert!(off < 1e-5, "{off}");
}

#[test]
fn sixteen_bits_are_finer_than_eight() {
    let ramp = ImageBuffer::from_fn(64, 2, |x, _| Luma([30_000 + x as u16]));
    let scene = load(&map(64), png(DynamicImage::ImageLuma16(ramp))).unwrap();
    let rises = ground(&scene).chunks(64).collect::<Vec<_>>();
    assert!(rises.windows(2).all(|pair| pair[0][0].y < pair[1][0].y));
}

#[test]
fn without_numbers_the_ground_has_the_pictures_shape_and_135_vertices_a_side() {
    let bytes = png(GrayImage::from_fn(40, 20, |x, z| Luma([(x * z) as u8])));
    let scene = load(&HeightMap::new("hills.png"), bytes).unwrap();
    let points = ground(&scene);
    assert_eq!(points.len(), 135 * 135);
    let (lo, hi) = points.iter().fold((points[0], points[0]), |(lo, hi), p| (lo.min(*p), hi.max(*p)));
    assert!((lo.x, hi.x, lo.z, hi.z) == (-50.0, 50.0, -25.0, 25.0) && lo.y == 0.0, "{lo} {hi}");
    assert!((hi.y - 10.0 * (39.0 * 19.0 % 256.0) / 255.0).abs() < 3.0);
    assert!(!scene.placed_cameras().is_empty() && !scene.placed_lights().is_empty());
}

#[test]
fn a_picture_of_one_pixel_is_flat_ground() {
    let scene = load(&map(2), png(GrayImage::from_pixel(1, 1, Luma([255])))).unwrap();
    assert!(ground(&scene).iter().all(|p| p.y == 8.0));
}

#[test]
fn what_is_no_height_map_is_refused_with_the_file_and_the_reason() {
    let grey = || png(GrayImage::new(4, 4));
    let with = |size_m, height_m, vertices| HeightMap { size_m, height_m, ..map(vertices) };
    let nan = f32::NAN;
    let cases: Vec<(HeightMap, Vec<u8>, &str)> = vec![
        (map(3), b"not a picture".to_vec(), "height map"),
        (map(3), Vec::new(), "height map"),
        (map(3), grey()[..60].to_vec(), "height map"),
        (map(3), png(RgbImage::new(4, 4)), "in colour"),
        (map(3), png(GrayAlphaImage::from_pixel(4, 4, LumaA([1, 2]))), "with alpha"),
        (map(0), grey(), "0 vertices"),
        (map(1), grey(), "1 vertices"),
        (map(1 << 40), grey(), "2048"),
        (with(Some([0.0, 1.0]), None, 3), grey(), "0 m"),
        (with(Some([1.0, -1.0]), None, 3), grey(), "-1 m"),
        (with(None, Some(nan), 3), grey(), "NaN m"),
        (with(None, Some(f32::INFINITY), 3), grey(), "inf m"),
    ];
    for (map, bytes, words) in cases {
        let error = load(&map, bytes).unwrap_err().to_string();
        assert!(error.contains("hills.png") && error.contains(words), "`{words}` is not in: {error}");
    }
    let missing = HeightMap::new(Path::new("absent.png")).load(&Memory::default()).unwrap_err();
    assert!(matches!(missing, SceneError::Read { .. }), "{missing}");
}
