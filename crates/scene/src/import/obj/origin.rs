//! Coordinates far from the origin.

use glam::DVec3;

use super::parse::Parsed;

/// What rounding to 32 bits may move a vertex by, as a share of its edges.
const MAX_ROUNDING: f64 = 1e-3;

/// How much closer to the origin everything must get to be moved there.
const LEAST_GAIN: f64 = 4.0;

/// Share of the edges that may be shorter than the one that rounding is held against.
const SHORT_EDGES: f64 = 0.1;

/// A point to count from where the coordinates need one, in metres: the middle of what is drawn, if rounding to 32 bits
/// would bend a tenth of the edges by more than a thousandth of their lengths and is a quarter or less around there.
pub(super) fn local_origin(parsed: &Parsed) -> Option<DVec3> {
    let positions = || parsed.corners.iter().map(|corner| parsed.positions[corner[0] as usize]);
    let first = positions().next()?;
    let (lo, hi) = positions().fold((first, first), |(lo, hi), p| (lo.min(p), hi.max(p)));
    let farthest = lo.abs().max(hi.abs()).max_element();
    let half_extent = (hi - lo).max_element() / 2.0;
    if farthest < LEAST_GAIN * half_extent {
        return None;
    }
    let mut edges: Vec<f64> = Vec::with_capacity(parsed.corners.len());
    for face in &parsed.faces {
        let corners = &parsed.corners[face.corners.clone()];
        let ends = corners.iter().zip(corners.iter().cycle().skip(1));
        let lengths =
            ends.map(|(a, b)| parsed.positions[a[0] as usize].distance(parsed.positions[b[0] as usize]));
        edges.extend(lengths.filter(|&length| length > 0.0));
    }
    if edges.is_empty() {
        return None;
    }
    let short = (edges.len() as f64 * SHORT_EDGES) as usize;
    let (_, &mut short, _) = edges.select_nth_unstable_by(short, f64::total_cmp);
    // Half of the last of 24 bits.
    let rounding = farthest / f64::from(1 << 24);
    (rounding > MAX_ROUNDING * short).then_some((lo + hi) / 2.0)
}
