//! Bump maps to normal maps.

use glam::{IVec2, Vec3};
use image::{DynamicImage, RgbaImage};

/// Height of white over black at `-bm 1`, as a share of the image's longer side. MTL leaves the unit open; 2 % of it is
/// a relief that shows without breaking shading, and does not depend on the resolution.
const RELIEF: f32 = 0.02;

/// Whether an image given as a bump map holds normals: nearly all of its texels decode to about unit vectors out of the
/// surface, and on the whole to the surface's own normal, a violet blue that no grey height map has.
pub(super) fn is_normal_map(image: &RgbaImage) -> bool {
    let decode = |texel: &image::Rgba<u8>| {
        Vec3::new(f32::from(texel[0]), f32::from(texel[1]), f32::from(texel[2])) / 127.5 - 1.0
    };
    let (mut unit, mut sum) = (0_usize, Vec3::ZERO);
    for normal in image.pixels().map(decode) {
        unit += usize::from((normal.length() - 1.0).abs() < 0.2 && normal.z > -0.1);
        sum += normal;
    }
    let texels = image.width() as usize * image.height() as usize;
    let mean = sum / texels as f32;
    unit * 10 >= texels * 9 && mean.z > 0.5 && mean.truncate().length() < 0.4
}

/// Tangent-space normals of a height map, by central differences; +y is up in the image. `strength` is `-bm`.
pub(super) fn normals_from_heights(image: &DynamicImage, strength: f32, clamp: bool) -> RgbaImage {
    let heights = image.to_luma32f();
    let size = IVec2::new(heights.width() as i32, heights.height() as i32);
    let relief = strength * RELIEF * size.max_element() as f32;
    let height = |at: IVec2| {
        let at = if clamp { at.clamp(IVec2::ZERO, size - 1) } else { at.rem_euclid(size) };
        heights.get_pixel(at.x as u32, at.y as u32)[0]
    };
    RgbaImage::from_fn(heights.width(), heights.height(), |x, y| {
        let at = IVec2::new(x as i32, y as i32);
        let right = (height(at + IVec2::X) - height(at - IVec2::X)) / 2.0;
        let up = (height(at - IVec2::Y) - height(at + IVec2::Y)) / 2.0;
        let normal = Vec3::new(-right * relief, -up * relief, 1.0).normalize();
        let [r, g, b] = (normal * 127.5 + 127.5).round().to_array().map(|c| c as u8);
        image::Rgba([r, g, b, 255])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_that_rises_to_the_right_and_down_leans_left_and_up() {
        let ramp = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([2 * (x + y) as u8]));
        let normals = normals_from_heights(&ramp.into(), 20.0, true);
        let [x, y, z, _] = normals.get_pixel(32, 32).0;
        assert!(x < 120 && y > 135 && z > 200, "{x} {y} {z}");
    }

    #[test]
    fn a_flat_height_map_gives_the_normal_itself() {
        let flat = image::GrayImage::from_pixel(4, 4, image::Luma([77]));
        let normals = normals_from_heights(&flat.into(), 1.0, false);
        assert!(normals.pixels().all(|texel| texel.0 == [128, 128, 255, 255]));
    }

    #[test]
    fn normal_maps_are_told_from_grey_heights_and_from_pictures() {
        let heights = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([((x * 7) ^ (y * 3)) as u8]));
        assert!(!is_normal_map(&DynamicImage::from(heights.clone()).into_rgba8()));
        assert!(is_normal_map(&normals_from_heights(&heights.into(), 1.0, false)));
        // A bright grey decodes to a unit vector too; a blue sky is bluish but not of unit length.
        assert!(!is_normal_map(&RgbaImage::from_pixel(8, 8, image::Rgba([201, 201, 201, 255]))));
        assert!(!is_normal_map(&RgbaImage::from_pixel(8, 8, image::Rgba([40, 90, 220, 255]))));
    }
}
