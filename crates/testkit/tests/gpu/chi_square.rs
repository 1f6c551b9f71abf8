//! Random draws against their density.

use std::fmt::Debug;

/// Cells that expect fewer draws are one: chi-square holds for many.
const RARE: f64 = 20.0;

/// Asserts that draws were counted about as often as expected, cell by cell (counted, expected).
#[track_caller]
pub fn assert_drawn_as_expected(cells: impl IntoIterator<Item = (f64, f64)>, what: &impl Debug) {
    let (rare, mut kept): (Vec<_>, Vec<_>) = cells.into_iter().partition(|cell| cell.1 < RARE);
    kept.push(rare.into_iter().fold((0.0, 0.0), |sum, cell| (sum.0 + cell.0, sum.1 + cell.1)));
    let square = |&(counted, expected): &(f64, f64)| (counted - expected).powi(2) / expected.max(RARE);
    let chi: f64 = kept.iter().map(square).sum();
    let freedom = kept.len() as f64;
    // Six standard deviations: one run in a billion.
    let limit = freedom + 6.0 * (2.0 * freedom).sqrt();
    let worst = kept.iter().max_by(|a, b| square(a).total_cmp(&square(b)));
    assert!(chi < limit, "{chi} over {limit} for {what:?}: {worst:?}");
}
