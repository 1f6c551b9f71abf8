//! Where within their pixels frames are taken.

use glam::Vec2;

/// Sub-pixel offsets of a box filter, stratified: a (0,2)-sequence, so that any power of two of them falls one into
/// each of as many equal boxes of any shape (Sobol' 1967).
#[derive(Clone, Copy, Debug)]
pub struct Jitter {
    samples: u32,
}

impl Jitter {
    /// Offsets for so many frames.
    pub fn new(samples: u32) -> Self {
        Self { samples }
    }

    /// Offset of frame `index`, pixels in −½..½.
    pub fn offset_px(&self, index: u32) -> Vec2 {
        if self.samples <= 1 {
            return Vec2::ZERO;
        }
        let unit = |bits: u32| (bits as f32) * 2f32.powi(-32);
        // The second dimension's direction numbers are Pascal's triangle modulo 2.
        let mut second = 0u32;
        let mut direction = 1u32 << 31;
        let mut rest = index;
        while rest != 0 {
            if rest & 1 != 0 {
                second ^= direction;
            }
            direction ^= direction >> 1;
            rest >>= 1;
        }
        // Half a box further, each sample stands in the middle of its box.
        let half = 0.5 / self.samples.next_power_of_two() as f32;
        Vec2::new(unit(index.reverse_bits()), unit(second)) + half - 0.5
    }

    /// How much smaller a texture's footprint is than a pixel.
    pub fn footprint_scale(&self) -> f32 {
        1.0 / (self.samples.max(1) as f32).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixteen_offsets_fall_one_into_each_of_sixteen_boxes_of_any_shape() {
        let jitter = Jitter::new(16);
        for (columns, rows) in [(16, 1), (8, 2), (4, 4), (2, 8), (1, 16)] {
            let mut boxes: Vec<_> = (0..16)
                .map(|i| {
                    let p = jitter.offset_px(i) + 0.5;
                    ((p.x * columns as f32) as u32, (p.y * rows as f32) as u32)
                })
                .collect();
            boxes.sort_unstable();
            boxes.dedup();
            assert_eq!(boxes.len(), 16, "{columns}×{rows}");
        }
        let mean = (0..16).map(|i| jitter.offset_px(i)).sum::<Vec2>() / 16.0;
        assert!(mean.length() < 1e-6, "{mean}");
    }
}
