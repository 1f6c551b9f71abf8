//! Directions and colours of vertices, a word each; `geometry.wesl` reads them.

use glam::{Vec2, Vec3, Vec4};

/// Octahedral coordinates of a unit vector; twin of `oct_from_unit` in `oct.wesl`.
fn oct(n: Vec3) -> Vec2 {
    let p = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs()).max(1e-20);
    if n.z >= 0.0 {
        return p;
    }
    let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
    Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

fn snorm_pair(v: Vec2) -> u32 {
    let code = |x: f32| u32::from((x.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    code(v.x) | code(v.y) << 16
}

/// A unit vector, octahedral, 16 bits a component.
pub(crate) fn normal_word(normal: Vec3) -> u32 {
    snorm_pair(oct(normal))
}

/// The bitangent's sign takes the low bit of the second component.
pub(super) fn tangent_word(tangent: Vec4) -> u32 {
    let word = snorm_pair(oct(tangent.truncate())) & !(1 << 16);
    // All ones means none; the neighbour is half a thousandth of a degree away.
    (word | u32::from(tangent.w < 0.0) << 16).min(u32::MAX - 1)
}

/// Square roots of linear colour in unorm bytes: finer where it is dark.
pub(super) fn color_word(color: Vec4) -> u32 {
    let code = |x: f32| (x.clamp(0.0, 1.0) * 255.0).round() as u32;
    code(color.x.max(0.0).sqrt())
        | code(color.y.max(0.0).sqrt()) << 8
        | code(color.z.max(0.0).sqrt()) << 16
        | code(color.w) << 24
}
