//! How much of a lamp's light is sent towards a box: twin of `aim.wesl`.

use glam::{BVec3, Vec3};

/// As in `aim.wesl`.
const WIDEST: f32 = 0.99;
/// Height of the cone of all directions.
pub(crate) const EVERYWHERE: f32 = 2.0;

/// 1 − the cosine of the half angle of a cone around a box' corners; [`EVERYWHERE`] for places in it, or so near that no cone
/// less than a hemisphere holds it.
pub(crate) fn cone_height(from: Vec3, (lo, hi): (Vec3, Vec3)) -> f32 {
    let corner = |i: u32| Vec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), hi, lo) - from;
    let corners: [Vec3; 8] = std::array::from_fn(|i| corner(i as u32).normalize_or_zero());
    let axis = corners.iter().sum::<Vec3>().normalize_or_zero();
    let height = corners.iter().map(|c| 0.5 * (*c - axis).length_squared()).fold(0.0, f32::max);
    let inside = from.cmpgt(lo).all() && from.cmplt(hi).all();
    if inside || height >= WIDEST { EVERYWHERE } else { height }
}

/// Area of the rectangle that a box fills as seen along a direction, on the axes of `tangent_frame`, m².
pub(crate) fn seen_area(direction: Vec3, (lo, hi): (Vec3, Vec3)) -> f32 {
    let sign = if direction.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (sign + direction.z);
    let b = direction.x * direction.y * a;
    let x = Vec3::new(1.0 + sign * direction.x * direction.x * a, sign * b, -sign * direction.x);
    let y = Vec3::new(b, sign + direction.y * direction.y * a, -direction.y);
    let half = 0.5 * (hi - lo);
    4.0 * x.abs().dot(half) * y.abs().dot(half)
}
