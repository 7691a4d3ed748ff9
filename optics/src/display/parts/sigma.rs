//! The strength of a blur: its standard deviation σ along x and along y, and how certain that is.

use super::measures::{Deviation, Measures, Scale, Unit};
use crate::numerics::gaussian_blur::sigma_px_of_ratio;

/// Largest q of any blur.
pub(super) const RATIO_MAX: f64 = 0.88;
/// σ along x and along y.
pub(super) const SCALES: &[Scale] = &[
    Scale { name: "sigma_x", unit: Unit::Pixels, digits: 2 },
    Scale { name: "sigma_y", unit: Unit::Pixels, digits: 2 },
];
/// The measures of a blur.
pub(super) const MEASURES: Measures = Measures { phrase: "σ {} along x, {} along y", scales: SCALES, note: "" };

/// Standard deviation of the σ of a blur along x and along y \[px\] with these q: half the distance between the σ of
/// the limits of q, because σ changes infinitely fast at q = 0.
pub(super) fn deviations_px(ratios: [f64; 2], deviation: Deviation<'_>) -> Vec<f64> {
    let deviations = ratio_deviations(deviation);
    let moved = |by: f64| sigma_px(std::array::from_fn(|axis| ratios[axis] + by * deviations[axis]));
    let (most, least) = (moved(1.0), moved(-1.0));
    (0..2).map(|axis| (most[axis] - least[axis]) / 2.0).collect()
}

/// σ of the strongest blur that could be hidden along x and along y \[px\].
pub(super) fn hidden_px(most: Deviation<'_>) -> Vec<f64> {
    sigma_px(ratio_deviations(most)).to_vec()
}

/// Standard deviation of q along x and along y.
fn ratio_deviations(deviation: Deviation<'_>) -> [f64; 2] {
    [&[1.0, 0.0], &[0.0, 1.0]].map(|slopes| deviation(slopes))
}

/// σ along x and along y \[px\] of a blur with these q, moved into the limits of a blur.
fn sigma_px(ratios: [f64; 2]) -> [f64; 2] {
    ratios.map(|q| sigma_px_of_ratio(q.clamp(0.0, RATIO_MAX)))
}
