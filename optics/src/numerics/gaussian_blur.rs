//! Gaussian blur along both axes with few weights, and its adjoint and derivatives.
//!
//! ```text
//! b(y, x) = Σ_k Σ_l K_k(q_y) K_l(q_x) v(y + k, x + l),   K_k(q) = q^{k²} / Σ_j q^{j²},   j, k, l = −reach … reach
//! ```
//!
//! q along each axis is the weight of a neighbour relative to the value's own. K samples a Gaussian of standard
//! deviation σ = 1/√(−2 ln q) \[px\]. Unlike in σ, the blur has a slope in q at q = 0, so that a fit can start there.
//! Beyond the edge, the values of the edge continue.

use super::real::Number;
use crate::interrupt;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Number of rows that are blurred together. Each needs its neighbours, which are blurred along x for each group again.
const ROWS: usize = 16;

/// q of a Gaussian with a standard deviation \[px\].
pub(crate) fn ratio_of_sigma_px(sigma_px: f64) -> f64 {
    if sigma_px > 0.0 { (-0.5 / (sigma_px * sigma_px)).exp() } else { 0.0 }
}

/// Standard deviation \[px\] of the Gaussian of a q.
pub(crate) fn sigma_px_of_ratio(q: f64) -> f64 {
    if q > 0.0 { (-2.0 * q.ln()).sqrt().recip() } else { 0.0 }
}

/// K_k(q), and its derivative by q.
pub(crate) fn weights<const TAPS: usize>(q: f64) -> [[f64; TAPS]; 2] {
    let squared = |tap: usize| tap.abs_diff(TAPS / 2).pow(2) as i32;
    let powers: [f64; TAPS] = std::array::from_fn(|tap| q.powi(squared(tap)));
    let slopes: [f64; TAPS] = std::array::from_fn(|tap| match squared(tap) {
        0 => 0.0,
        square => f64::from(square) * q.powi(square - 1),
    });
    let (sum, sum_slope) = (powers.iter().sum::<f64>(), slopes.iter().sum::<f64>());
    let slope = |tap| (slopes[tap] - powers[tap] / sum * sum_slope) / sum;
    [powers.map(|power| power / sum), std::array::from_fn(slope)]
}

/// Shape of what is blurred: rows of some planes, one plane of a row after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    pub(crate) width_px: usize,
    pub(crate) planes: usize,
}

impl Rows {
    fn len(self) -> usize {
        self.planes * self.width_px
    }

    fn of_planes(self) -> impl Iterator<Item = (usize, Range<usize>)> {
        (0..self.planes).map(move |plane| (plane, plane * self.width_px..(plane + 1) * self.width_px))
    }
}

/// Weights along one axis. Those that cannot change a sum in this precision are 0.
#[derive(Clone, Copy, Debug)]
struct Taps<T, const TAPS: usize> {
    weights: [T; TAPS],
    /// Distance of the farthest neighbour whose weight is not 0.
    reach: usize,
}

impl<T: Number, const TAPS: usize> Taps<T, TAPS> {
    fn new(weights: [f64; TAPS]) -> Self {
        let largest = weights.iter().fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
        let negligible = T::epsilon().wide() / 64.0 * largest;
        let reach = (0..=TAPS / 2).rfind(|by| weights[TAPS / 2 + by].abs() > negligible).unwrap_or(0);
        let used = Self::near(reach);
        Self { weights: std::array::from_fn(|k| T::of(if used.contains(&k) { weights[k] } else { 0.0 })), reach }
    }

    /// The taps within a distance of the middle one.
    fn near(reach: usize) -> Range<usize> {
        TAPS / 2 - reach..TAPS / 2 + reach + 1
    }

    /// Weight with which the value of pixel `to` blurs into pixel `from`, one of `n` along the axis.
    fn between(&self, from: usize, to: usize, n: usize) -> T {
        let reached = |k: usize| (from + k).saturating_sub(TAPS / 2).min(n - 1);
        (0..TAPS).filter(|&k| reached(k) == to).fold(T::zero(), |sum, k| sum + self.weights[k])
    }

    /// The weights that are not 0, all within [`Self::reach`].
    fn used(&self) -> &[T] {
        &self.weights[Self::near(self.reach)]
    }
}

/// A blur along both axes with at most `TAPS` weights, in the precision of an engine.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GaussianBlur<T, const TAPS: usize> {
    along_x: Taps<T, TAPS>,
    along_y: Taps<T, TAPS>,
}

impl<T: Number, const TAPS: usize> GaussianBlur<T, TAPS> {
    /// The blur with q along x and along y.
    pub(crate) fn new(ratios: [f64; 2]) -> Self {
        let [[along_x, _], [along_y, _]] = ratios.map(weights);
        Self { along_x: Taps::new(along_x), along_y: Taps::new(along_y) }
    }

    /// The derivatives of the blur by q along x and along y.
    pub(crate) fn slopes(ratios: [f64; 2]) -> [Self; 2] {
        let [[along_x, slope_x], [along_y, slope_y]] = ratios.map(weights).map(|both| both.map(Taps::new));
        [Self { along_x: slope_x, along_y }, Self { along_x, along_y: slope_y }]
    }

    /// Blurs values, which `fill(y, plane, row)` writes, into `out`.
    pub(crate) fn blur(&self, rows: Rows, fill: impl Fn(usize, usize, &mut [T]) + Sync, out: &mut [T]) {
        let (width_px, row_len) = (rows.width_px, rows.len());
        let height_px = out.len() / row_len;
        let [reach_x, reach_y] = [self.along_x.reach, self.along_y.reach];
        out.par_chunks_mut(ROWS * row_len).enumerate().for_each_init(
            || (vec![T::zero(); width_px + 2 * reach_x], vec![T::zero(); (ROWS + 2 * reach_y) * row_len]),
            |(padded, along_x), (group, out)| {
                interrupt::check();
                let first = group * ROWS;
                let count = out.len() / row_len;
                for (i, row) in along_x.chunks_exact_mut(row_len).take(count + 2 * reach_y).enumerate() {
                    let y = (first + i).saturating_sub(reach_y).min(height_px - 1);
                    for (plane, row) in row.chunks_exact_mut(width_px).enumerate() {
                        fill(y, plane, &mut padded[reach_x..reach_x + width_px]);
                        let (left, right) = (padded[reach_x], padded[reach_x + width_px - 1]);
                        padded[..reach_x].fill(left);
                        padded[reach_x + width_px..].fill(right);
                        sum_taps::<T, TAPS>(self.along_x.used(), |k| &padded[k..], row);
                    }
                }
                for (i, out) in out.chunks_exact_mut(row_len).enumerate() {
                    sum_taps::<T, TAPS>(self.along_y.used(), |k| &along_x[(i + k) * row_len..], out);
                }
            },
        );
    }

    /// Applies the adjoint of [`Self::blur`] to `values`, and adds the result to `out`, or overwrites it.
    pub(crate) fn spread(&self, rows: Rows, values: &[T], add: bool, out: &mut [T]) {
        let (width_px, row_len) = (rows.width_px, rows.len());
        let height_px = values.len() / row_len;
        let [reach_x, reach_y] = [self.along_x.reach, self.along_y.reach];
        out.par_chunks_mut(row_len).enumerate().for_each_init(
            || (vec![T::zero(); width_px + 2 * reach_x], vec![T::zero(); width_px]),
            |(padded, row), (y, out)| {
                interrupt::check();
                let weights_y: [T; TAPS] = std::array::from_fn(|k| match (y + k).checked_sub(reach_y) {
                    Some(from) if k <= 2 * reach_y && from < height_px => self.along_y.between(from, y, height_px),
                    _ => T::zero(),
                });
                // Rows beyond the edge have the weight 0.
                let from = |k: usize| (y + k).saturating_sub(reach_y).min(height_px - 1) * row_len;
                for (_, plane) in rows.of_planes() {
                    let summed = &mut padded[reach_x..reach_x + width_px];
                    sum_taps::<T, TAPS>(&weights_y[..=2 * reach_y], |k| &values[from(k) + plane.start..], summed);
                    sum_taps::<T, TAPS>(self.along_x.used(), |k| &padded[k..], row);
                    let summed = &padded[reach_x..reach_x + width_px];
                    for x in [0, width_px - 1] {
                        let near = x.saturating_sub(reach_x)..(x + reach_x + 1).min(width_px);
                        let weighed = near.map(|from| self.along_x.between(from, x, width_px) * summed[from]);
                        row[x] = weighed.fold(T::zero(), |sum, value| sum + value);
                    }
                    let out = &mut out[plane];
                    match add {
                        true => out.iter_mut().zip(&*row).for_each(|(out, &value)| *out = *out + value),
                        false => out.copy_from_slice(row),
                    }
                }
            },
        );
    }

    /// How many pixels away, along x and along y, a value can be that changes the blur with these q, or a derivative of
    /// it by one of them.
    pub(crate) fn reach(ratios: [f64; 2]) -> [usize; 2] {
        let [by_x, by_y] = Self::slopes(ratios);
        [by_x.along_x.reach.max(by_y.along_x.reach), by_x.along_y.reach.max(by_y.along_y.reach)]
    }

    /// Adds what blurs into a part of one row to `out`: the values at the columns `columns`. `near(y)` has the values
    /// of row `y` of `size_px` rows and columns, from the column `first` on.
    pub(crate) fn add_part<'a>(
        &self,
        [height_px, width_px]: [usize; 2],
        (y, columns): (usize, Range<usize>),
        (first, near): (usize, impl Fn(usize) -> &'a [T]),
        out: &mut [T],
    ) where
        T: 'a,
    {
        let reached = |i: usize, k: usize, reach: usize, n: usize| (i + k).saturating_sub(reach).min(n - 1);
        let [of_x, of_y] = [&self.along_x, &self.along_y].map(Taps::used);
        let [reach_x, reach_y] = [self.along_x.reach, self.along_y.reach];
        let mut along_y = vec![T::zero(); near(y).len()];
        sum_taps::<T, TAPS>(of_y, |k| near(reached(y, k, reach_y, height_px)), &mut along_y);
        for (x, out) in columns.zip(out) {
            let weighed = of_x.iter().enumerate();
            let weighed = weighed.map(|(k, &weight)| weight * along_y[reached(x, k, reach_x, width_px) - first]);
            *out = weighed.fold(*out, |sum, value| sum + value);
        }
    }
}

/// The places along an axis of `n` values from which a range can be reached.
pub(crate) fn reached(range: &Range<usize>, reach: usize, n: usize) -> Range<usize> {
    range.start.saturating_sub(reach)..(range.end + reach).min(n)
}

/// Number of values that are summed together, in vector registers.
const LANES: usize = 32;

/// `out` = Σ_k weight_k · values(k), of at most `TAPS` weights.
fn sum_taps<'a, T: Number, const TAPS: usize>(weights: &[T], values: impl Fn(usize) -> &'a [T], out: &mut [T]) {
    let taps: [&[T]; TAPS] = std::array::from_fn(|k| if k < weights.len() { &values(k)[..out.len()] } else { &[] });
    Arch::new().dispatch(TapSum { weights, taps: &taps[..weights.len()], out });
}

/// A sum of any number of taps, so that its code is compiled once for all blurs.
struct TapSum<'a, T> {
    weights: &'a [T],
    taps: &'a [&'a [T]],
    out: &'a mut [T],
}

impl<T: Number> WithSimd for TapSum<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { weights, taps, out } = self;
        let (blocks, rest) = out.as_chunks_mut::<LANES>();
        let first_of_rest = blocks.len() * LANES;
        for (block, out) in blocks.iter_mut().enumerate() {
            let mut sums = [T::zero(); LANES];
            for (&weight, tap) in weights.iter().zip(taps) {
                let Some(values) = tap[block * LANES..].first_chunk::<LANES>() else { continue };
                for lane in 0..LANES {
                    sums[lane] = sums[lane] + weight * values[lane];
                }
            }
            *out = sums;
        }
        for (i, out) in (first_of_rest..).zip(rest) {
            *out = weights.iter().zip(taps).fold(T::zero(), |sum, (&weight, tap)| sum + weight * tap[i]);
        }
    }
}

/// A blurred plane by the definition: slow, for comparison.
pub(crate) fn by_definition<const TAPS: usize>(
    values: &crate::numerics::plane::Plane<f64>,
    ratios: [f64; 2],
) -> crate::numerics::plane::Plane<f64> {
    let (height_px, width_px) = (values.height_px(), values.width_px());
    let [[along_x, _], [along_y, _]] = ratios.map(weights::<TAPS>);
    let near = |i: usize, k: usize, n: usize| (i + k).saturating_sub(TAPS / 2).min(n - 1);
    crate::numerics::plane::Plane::from_fn(height_px, width_px, |y, x| {
        let taps = (0..TAPS).flat_map(|k| (0..TAPS).map(move |l| (k, l)));
        taps.map(|(k, l)| along_y[k] * along_x[l] * values.at(near(y, k, height_px), near(x, l, width_px))).sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::plane::Plane;

    fn noise(len: usize, by: usize) -> Vec<f64> {
        (0..len).map(|i| ((i * by % 29) as f64 - 14.0) / 7.0).collect()
    }

    fn product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    #[test]
    fn blur_matches_definition_and_spreading_is_its_adjoint() {
        for (ratio_x, ratio_y) in [(0.0, 0.0), (0.1, 0.0), (0.05, 0.3), (0.6, 0.6), (0.88, 0.4)] {
            for (height_px, width_px, planes) in [(37, 23, 1), (19, 8, 4), (5, 9, 1), (1, 4, 2), (2, 1, 1)] {
                matches_definition::<7>((height_px, width_px, planes), [ratio_x, ratio_y]);
                matches_definition::<13>((height_px, width_px, planes), [ratio_x, ratio_y]);
            }
        }
    }

    fn matches_definition<const TAPS: usize>(shape: (usize, usize, usize), ratios: [f64; 2]) {
        let (height_px, width_px, planes) = shape;
        let (rows, len) = (Rows { width_px, planes }, height_px * width_px * planes);
        let (a, b) = (noise(len, 7), noise(len, 11));
        let blurred = |blur: &GaussianBlur<f64, TAPS>| {
            let fill = |y: usize, plane: usize, row: &mut [f64]| {
                row.copy_from_slice(&a[(y * planes + plane) * width_px..][..width_px]);
            };
            let mut out = vec![0.0; len];
            blur.blur(rows, fill, &mut out);
            out
        };
        let blur = GaussianBlur::<f64, TAPS>::new(ratios);
        let found = blurred(&blur);
        for plane in 0..planes {
            let of_plane = |values: &[f64]| {
                Plane::from_fn(height_px, width_px, |y, x| values[(y * planes + plane) * width_px + x])
            };
            let (found, expected) = (of_plane(&found), by_definition::<TAPS>(&of_plane(&a), ratios));
            assert!(found.values().iter().zip(expected.values()).all(|(a, b)| (a - b).abs() < 1e-13), "{shape:?}");
            let part = width_px / 3..width_px - width_px / 4;
            let seen = reached(&part, blur.along_x.reach, width_px);
            for y in 0..height_px {
                let (plane, mut out) = (of_plane(&a), vec![0.5; part.len()]);
                let near = |y: usize| &plane.row(y)[seen.clone()];
                blur.add_part([height_px, width_px], (y, part.clone()), (seen.start, near), &mut out);
                let expected = &expected.row(y)[part.clone()];
                assert!(out.iter().zip(expected).all(|(a, b)| (a - 0.5 - b).abs() < 1e-13), "row {y} of {shape:?}");
            }
        }
        let mut spread = b.clone();
        blur.spread(rows, &b, true, &mut spread);
        spread.iter_mut().zip(&b).for_each(|(sum, before)| *sum -= before);
        let (there, back) = (product(&found, &b), product(&a, &spread));
        assert!((there - back).abs() < 1e-11, "{shape:?}, {ratios:?}: {there}, {back}");
        for (axis, slope) in GaussianBlur::<f64, TAPS>::slopes(ratios).iter().enumerate() {
            let h = 1e-6;
            let moved = |by: f64| {
                let mut ratios = ratios;
                ratios[axis] += by;
                blurred(&GaussianBlur::new(ratios))
            };
            let (after, before, exact) = (moved(h), moved(-h), blurred(slope));
            let slopes = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * h));
            assert!(slopes.zip(&exact).all(|(a, b)| (a - b).abs() < 1e-8), "{ratios:?} along axis {axis}");
        }
    }

    #[test]
    fn ratio_and_standard_deviation_are_inverse() {
        assert!((ratio_of_sigma_px(0.45) - (-1.0_f64 / (2.0 * 0.45 * 0.45)).exp()).abs() < 1e-15);
        for sigma_px in [0.0, 0.2, 0.45, 1.9] {
            assert!((sigma_px_of_ratio(ratio_of_sigma_px(sigma_px)) - sigma_px).abs() < 1e-12);
        }
    }
}
