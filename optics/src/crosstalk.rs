//! Cross-talk between neighbouring pixels of the SLM: how the phases that it is given become the phases that it shows.
//!
//! ```text
//! ψ(y, x) = Σ_k Σ_l K_k(q_y) K_l(q_x) wrap( φ + grating )(y + k, x + l),   K_k(q) = q^{k²} / Σ_j q^{j²},   j, k, l = −3 … 3
//! ```
//!
//! φ is the phase \[rad\], wrapped to [0, 2π) with the carrier's grating before it blurs, as the voltages of
//! neighbouring pixels blur. So a jump from 2π to 0 becomes a slope. q along each axis is the weight of a neighbour
//! relative to the pixel's own. K samples a Gaussian of standard deviation σ = 1/√(−2 ln q) \[px\]. Beyond the edge,
//! the phases of the edge continue. Measured modulators: S. Moser, M. Ritsch-Marte and G. Thalhammer, Optics Express
//! 27, 25046 (2019).

use crate::buffers::zeros;
use crate::interrupt;
use crate::real::Number;
use crate::smooth_field::out_of_range;
use crate::{Plane, Result};
use pulp::Arch;
use rayon::prelude::*;

/// Number of pixels on either side that blur into a pixel.
const REACH: usize = 3;
const TAPS: usize = 2 * REACH + 1;
/// Number of rows that are blurred together. Each needs its neighbours, which are blurred along x for each group again.
const ROWS: usize = 16;

/// Cross-talk between neighbouring pixels: the weight q of a neighbour's phase relative to the pixel's own, along x and
/// along y.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Crosstalk {
    /// q along x, 0 to [`Self::RATIO_MAX`].
    pub ratio_x: f64,
    /// q along y, 0 to [`Self::RATIO_MAX`].
    pub ratio_y: f64,
}

impl Crosstalk {
    /// No cross-talk.
    pub const NONE: Self = Self { ratio_x: 0.0, ratio_y: 0.0 };
    /// Largest q, of a standard deviation of 0.99 px. With a larger one, more than three pixels on either side would
    /// count.
    pub const RATIO_MAX: f64 = 0.6;

    /// Cross-talk with a standard deviation along x and one along y \[px\].
    #[must_use]
    pub fn of_sigma_px(sigma_px: [f64; 2]) -> Self {
        let [ratio_x, ratio_y] = sigma_px.map(|sigma| if sigma > 0.0 { (-0.5 / (sigma * sigma)).exp() } else { 0.0 });
        Self { ratio_x, ratio_y }
    }

    /// Standard deviation of the blur along x and along y \[px\].
    #[must_use]
    pub fn sigma_px(&self) -> [f64; 2] {
        self.ratios().map(|q| if q > 0.0 { (-2.0 * q.ln()).sqrt().recip() } else { 0.0 })
    }

    /// Whether each pixel shows its own phase.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// q along x and along y.
    #[must_use]
    pub fn ratios(&self) -> [f64; 2] {
        [self.ratio_x, self.ratio_y]
    }

    pub(crate) fn validate(&self) -> Result<()> {
        match self.ratios().into_iter().find(|q| !(0.0..=Self::RATIO_MAX).contains(q)) {
            Some(q) => Err(out_of_range("crosstalk", q, "0 to 0.6")),
            None => Ok(()),
        }
    }
}

/// K_k(q), k = −3 … 3, and its derivative by q.
fn weights(q: f64) -> [[f64; TAPS]; 2] {
    let powers = [1.0, q, q.powi(4), q.powi(9)];
    let slopes = [0.0, 1.0, 4.0 * q.powi(3), 9.0 * q.powi(8)];
    let both_sides = |of: [f64; REACH + 1]| of[0] + 2.0 * of[1..].iter().sum::<f64>();
    let (sum, sum_slope) = (both_sides(powers), both_sides(slopes));
    let distance = |tap: usize| tap.abs_diff(REACH);
    let weight = |tap| powers[distance(tap)] / sum;
    let slope = |tap| (slopes[distance(tap)] - weight(tap) * sum_slope) / sum;
    [std::array::from_fn(weight), std::array::from_fn(slope)]
}

/// A blur along both axes, in the precision of an engine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Blur<T> {
    along_x: [T; TAPS],
    along_y: [T; TAPS],
}

impl<T: Number> Blur<T> {
    /// The blur by cross-talk.
    pub(crate) fn new(crosstalk: &Crosstalk) -> Self {
        let [[along_x, _], [along_y, _]] = crosstalk.ratios().map(weights);
        Self { along_x: along_x.map(T::of), along_y: along_y.map(T::of) }
    }

    /// The derivatives of the blur by q along x and along y.
    pub(crate) fn slopes(crosstalk: &Crosstalk) -> [Self; 2] {
        let [[along_x, slope_x], [along_y, slope_y]] =
            crosstalk.ratios().map(weights).map(|both| both.map(|w| w.map(T::of)));
        [Self { along_x: slope_x, along_y }, Self { along_x, along_y: slope_y }]
    }

    /// Blurs rows of `width_px`, which `fill(y, row)` writes.
    pub(crate) fn blurred(&self, width_px: usize, height_px: usize, fill: impl Fn(usize, &mut [T]) + Sync) -> Vec<T> {
        let (arch, mut out) = (Arch::new(), zeros(width_px * height_px));
        out.par_chunks_mut(ROWS * width_px).enumerate().for_each_init(
            || (vec![T::zero(); width_px + 2 * REACH], vec![T::zero(); (ROWS + 2 * REACH) * width_px]),
            |(padded, along_x), (group, out)| {
                interrupt::check();
                let first = group * ROWS;
                let count = out.len() / width_px;
                for (i, row) in along_x.chunks_exact_mut(width_px).take(count + 2 * REACH).enumerate() {
                    fill((first + i).saturating_sub(REACH).min(height_px - 1), &mut padded[REACH..REACH + width_px]);
                    let (left, right) = (padded[REACH], padded[REACH + width_px - 1]);
                    padded[..REACH].fill(left);
                    padded[REACH + width_px..].fill(right);
                    arch.dispatch(|| sum_taps(&self.along_x, |k| &padded[k..], row));
                }
                for (i, out) in out.chunks_exact_mut(width_px).enumerate() {
                    arch.dispatch(|| sum_taps(&self.along_y, |k| &along_x[(i + k) * width_px..], out));
                }
            },
        );
        out
    }

    /// Applies the adjoint of [`Self::blurred`] to `values`, and adds the result to `out`, or overwrites it.
    pub(crate) fn spread(&self, width_px: usize, values: &[T], add: bool, out: &mut [T]) {
        let (arch, height_px) = (Arch::new(), values.len() / width_px);
        out.par_chunks_mut(width_px).enumerate().for_each_init(
            || (vec![T::zero(); width_px + 2 * REACH], vec![T::zero(); width_px]),
            |(padded, row), (y, out)| {
                interrupt::check();
                let weights_y: [T; TAPS] = std::array::from_fn(|k| match (y + k).checked_sub(REACH) {
                    Some(from) if from < height_px => weight_between(&self.along_y, from, y, height_px),
                    _ => T::zero(),
                });
                // Rows beyond the edge have the weight 0.
                let from = |k: usize| (y + k).saturating_sub(REACH).min(height_px - 1) * width_px;
                let summed = &mut padded[REACH..REACH + width_px];
                arch.dispatch(|| sum_taps(&weights_y, |k| &values[from(k)..], summed));
                arch.dispatch(|| sum_taps(&self.along_x, |k| &padded[k..], row));
                let summed = &padded[REACH..REACH + width_px];
                for x in [0, width_px - 1] {
                    let near = x.saturating_sub(REACH)..(x + REACH + 1).min(width_px);
                    let weighed = near.map(|from| weight_between(&self.along_x, from, x, width_px) * summed[from]);
                    row[x] = weighed.fold(T::zero(), |sum, value| sum + value);
                }
                match add {
                    true => out.iter_mut().zip(&*row).for_each(|(out, &value)| *out = *out + value),
                    false => out.copy_from_slice(row),
                }
            },
        );
    }
}

/// Weight with which the value of pixel `to` blurs into pixel `from`, one of `n` along an axis.
fn weight_between<T: Number>(weights: &[T; TAPS], from: usize, to: usize, n: usize) -> T {
    let reached = |k: usize| (from + k).saturating_sub(REACH).min(n - 1);
    (0..TAPS).filter(|&k| reached(k) == to).fold(T::zero(), |sum, k| sum + weights[k])
}

/// `out` = Σ_k weight_k · values(k).
#[inline(always)]
fn sum_taps<'a, T: Number>(weights: &[T; TAPS], values: impl Fn(usize) -> &'a [T], out: &mut [T]) {
    let taps: [&[T]; TAPS] = std::array::from_fn(|k| &values(k)[..out.len()]);
    for (i, out) in out.iter_mut().enumerate() {
        let mut sum = weights[0] * taps[0][i];
        for k in 1..TAPS {
            sum = sum + weights[k] * taps[k][i];
        }
        *out = sum;
    }
}

/// The phases that an SLM with cross-talk shows for wrapped phases, by the definition: slow, for comparison.
#[must_use]
pub fn shown_phase(wrapped: &Plane<f64>, crosstalk: &Crosstalk) -> Plane<f64> {
    let (height_px, width_px) = (wrapped.height_px(), wrapped.width_px());
    let [[along_x, _], [along_y, _]] = crosstalk.ratios().map(weights);
    let near = |i: usize, k: usize, n: usize| (i + k).saturating_sub(REACH).min(n - 1);
    Plane::from_fn(height_px, width_px, |y, x| {
        let taps = (0..TAPS).flat_map(|k| (0..TAPS).map(move |l| (k, l)));
        taps.map(|(k, l)| along_y[k] * along_x[l] * wrapped.at(near(y, k, height_px), near(x, l, width_px))).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(height_px: usize, width_px: usize, by: usize) -> Vec<f64> {
        (0..height_px * width_px).map(|i| ((i * by % 29) as f64 - 14.0) / 7.0).collect()
    }

    #[test]
    fn blur_matches_definition_and_spreading_is_its_adjoint() {
        for (height_px, width_px) in [(37, 23), (5, 9), (1, 4), (2, 1)] {
            for (ratio_x, ratio_y) in [(0.0, 0.0), (0.1, 0.0), (0.05, 0.3), (0.6, 0.6)] {
                let crosstalk = Crosstalk { ratio_x, ratio_y };
                let (a, b) = (noise(height_px, width_px, 7), noise(height_px, width_px, 11));
                let plane = Plane::try_from_vec(height_px, width_px, a.clone()).unwrap();
                let blur = Blur::<f64>::new(&crosstalk);
                let fill = |y: usize, row: &mut [f64]| row.copy_from_slice(plane.row(y));
                let blurred = blur.blurred(width_px, height_px, fill);
                let expected = shown_phase(&plane, &crosstalk);
                assert!(blurred.iter().zip(expected.values()).all(|(a, b)| (a - b).abs() < 1e-13), "{crosstalk:?}");
                let mut spread = b.clone();
                blur.spread(width_px, &b, true, &mut spread);
                spread.iter_mut().zip(&b).for_each(|(sum, before)| *sum -= before);
                let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
                let (there, back) = (product(&blurred, &b), product(&a, &spread));
                assert!((there - back).abs() < 1e-11, "{height_px}×{width_px}, {crosstalk:?}: {there}, {back}");
                for (axis, slope) in Blur::<f64>::slopes(&crosstalk).iter().enumerate() {
                    let h = 1e-6;
                    let moved = |by: f64| {
                        let mut ratios = crosstalk.ratios();
                        ratios[axis] += by;
                        let [ratio_x, ratio_y] = ratios;
                        Blur::<f64>::new(&Crosstalk { ratio_x, ratio_y }).blurred(width_px, height_px, fill)
                    };
                    let (after, before, exact) = (moved(h), moved(-h), slope.blurred(width_px, height_px, fill));
                    let slopes = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * h));
                    assert!(slopes.zip(&exact).all(|(a, b)| (a - b).abs() < 1e-8), "{crosstalk:?} along axis {axis}");
                }
            }
        }
    }

    #[test]
    fn ratio_and_standard_deviation_are_inverse() {
        let crosstalk = Crosstalk::of_sigma_px([0.45, 0.0]);
        assert!((crosstalk.ratio_x - (-1.0_f64 / (2.0 * 0.45 * 0.45)).exp()).abs() < 1e-15);
        assert!((crosstalk.sigma_px()[0] - 0.45).abs() < 1e-12 && crosstalk.sigma_px()[1] == 0.0);
        assert!(Crosstalk { ratio_x: 0.7, ratio_y: 0.0 }.validate().is_err());
        assert!(Crosstalk { ratio_x: 0.1, ratio_y: f64::NAN }.validate().is_err());
    }
}
