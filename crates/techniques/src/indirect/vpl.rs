//! Virtual point lights (Keller 1997, "Instant Radiosity"): places that scatter light on as a Lambert surface does.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::scene::words::normal_word;

/// A virtual point light; `vpl.wesl` holds its twin.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Vpl {
    /// Metres; of what is infinitely far see [`Vpl::far`].
    pub position_ws: [f32; 3],
    /// Octahedral, 16-bit snorm each; see [`Vpl::new`].
    pub normal: u32,
    /// Reflected flux in lumens, red, green and blue: albedo × incident flux, over its probability. Of what is infinitely far the
    /// illuminance across its direction, lux.
    pub flux: [f32; 3],
    /// Number of its block of points in the lower 16 bits; in the upper ones log2 of its radius as a half float.
    pub block_radius: u32,
}

/// log2 of the radius of what has none, metres.
const NO_RADIUS: f32 = -60.0;
/// The same of what is infinitely far.
const FAR_RADIUS: f32 = 60.0;

impl Vpl {
    /// With a unit normal, which is rounded by less than 7·10⁻⁵ rad;
    /// `block`: below 65,536. It stands for a place alone: see [`Vpl::with_radius`].
    pub fn new(position_ws: Vec3, normal_ws: Vec3, flux: Vec3, block: u32) -> Self {
        let (position_ws, flux) = (position_ws.to_array(), flux.to_array());
        let point = Self { position_ws, normal: normal_word(normal_ws), flux, block_radius: block & 0xffff };
        point.with_radius(0.0)
    }

    /// Stands for a disc of this radius, metres.
    #[must_use]
    pub fn with_radius(self, metres: f32) -> Self {
        let octaves = half::f16::from_f32(metres.log2().max(NO_RADIUS));
        Self { block_radius: self.block_radius & 0xffff | u32::from(octaves.to_bits()) << 16, ..self }
    }

    /// Light that goes one way from infinitely far, of so many lux across it, and enters the scene's sphere at a place: on its axis,
    /// a radius before the middle.
    pub fn far(enters_ws: Vec3, goes_ws: Vec3, lux: Vec3, block: u32) -> Self {
        let octaves = half::f16::from_f32(FAR_RADIUS);
        let point = Self::new(enters_ws, goes_ws, lux, block);
        Self { block_radius: point.block() | u32::from(octaves.to_bits()) << 16, ..point }
    }

    /// Radius of the disc that it stands for, metres.
    pub fn radius(&self) -> f32 {
        half::f16::from_bits((self.block_radius >> 16) as u16).to_f32().exp2()
    }

    /// Number of its block of points.
    pub fn block(&self) -> u32 {
        self.block_radius & 0xffff
    }

    /// The unit normal.
    pub fn normal_ws(&self) -> Vec3 {
        let snorm = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
        let (x, y) = (snorm(self.normal), snorm(self.normal >> 16));
        let z = 1.0 - x.abs() - y.abs();
        let folded = (-z).max(0.0);
        Vec3::new(x - folded.copysign(x), y - folded.copysign(y), z).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_come_back() {
        for i in 0..1000 {
            let turn = 2.4 * i as f32;
            let z = 1.0 - 2.0 * i as f32 / 999.0;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = Vec3::new(r * turn.cos(), r * turn.sin(), z);
            let back = Vpl::new(Vec3::ZERO, n, Vec3::ONE, 0).normal_ws();
            assert!(n.distance(back) < 7e-5, "{n} became {back}");
        }
    }
}
