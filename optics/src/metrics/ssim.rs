//! Structural similarity.
//!
//! ```text
//! SSIM = mean over windows of  l · cs
//! l = (2 μp μt + C₁) / (μp² + μt² + C₁),   cs = (2 σpt + C₂) / (σp² + σt² + C₂)
//! ```
//!
//! μ, σ² and σpt are the means, variances and covariance of reconstruction p and target t in a window of 11×11 samples.
//! The window has Gaussian weights with σ = 1.5 samples and the sum 1; C₁ = 0.01² and C₂ = 0.03² for a data range of 1.
//! Only windows inside the region of interest count. Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli: Image
//! quality assessment: from error visibility to structural similarity, IEEE Trans. Image Processing 13, 600 (2004).
//!
//! The window is separable: rows are filtered along x as they are read, then a block of rows is filtered along y. Only
//! the sum of the two variances is needed, so four filtered images are enough.

use super::pair::{Gain, ImagePair};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::numerics::vectorized::vectorized;
use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;
use std::ops::Range;

/// Samples along a side of the window, which are also the fewest along a side of a region of interest.
pub const SSIM_SIDE_MIN: usize = 11;
/// Standard deviation of the window's weights, in samples.
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Number of rows of windows that are computed together: few, to need little memory, but enough that the ten rows that
/// a block shares with the next one are a small part of the work.
const BLOCK: usize = 32;

/// Mean structural similarity in the region of interest. It is at most 1, for two that are equal after the gain.
///
/// The window has a fixed number of samples, so with several sub-samples per pixel it covers a smaller part of the
/// image.
///
/// # Errors
///
/// [`Error::SizeMismatch`] when the reconstruction is not of the target's size or a whole multiple of it;
/// [`Error::OutOfRange`] when the region leaves the target, or when one of its sides has less than
/// [`SSIM_SIDE_MIN`] samples.
pub fn ssim(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    let pair = ImagePair::new(reconstruction, target, roi, gain)?;
    let side = pair.height().min(pair.width());
    if side < SSIM_SIDE_MIN {
        let allowed = "at least 11 samples for SSIM";
        return Err(Error::OutOfRange { name: "region_of_interest's shorter side", value: side as f64, allowed });
    }
    Ok(similarity(&pair).ssim)
}

/// Means of the similarity and its factors over all windows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Similarity {
    /// Mean of l · cs.
    pub(super) ssim: f64,
    /// Mean of cs.
    pub(super) contrast_structure: f64,
}

/// Computes the similarity of a pair that has at least one window.
pub(super) fn similarity(pair: &ImagePair<'_>) -> Similarity {
    let weights = weights();
    let rows = pair.height() + 1 - SSIM_SIDE_MIN;
    let blocks = (0..rows.div_ceil(BLOCK)).into_par_iter().map_init(
        || Block::new(pair.width()),
        |block, i| {
            interrupt::check();
            let end = ((i + 1) * BLOCK).min(rows);
            vectorized(
                #[inline(always)]
                || block.similarity(pair, &weights, i * BLOCK..end),
            )
        },
    );
    // Collected first, so that the sum is in the order of the blocks and does not depend on the threads.
    let sum = blocks.collect::<Vec<_>>().iter().fold([0.0; 2], |sum, block| [sum[0] + block[0], sum[1] + block[1]]);
    let windows = (rows * (pair.width() + 1 - SSIM_SIDE_MIN)) as f64;
    Similarity { ssim: sum[0] / windows, contrast_structure: sum[1] / windows }
}

/// Weights e^{−x²/2σ²} at the window's samples, scaled to the sum 1.
fn weights() -> [f64; SSIM_SIDE_MIN] {
    let middle = (SSIM_SIDE_MIN / 2) as f64;
    let bell = std::array::from_fn::<f64, SSIM_SIDE_MIN, _>(|i| (-((i as f64 - middle) / SIGMA).powi(2) / 2.0).exp());
    let sum: f64 = bell.iter().sum();
    bell.map(|weight| weight / sum)
}

/// Working memory for a block of rows. Arrays of four hold p, t, p² + t² and pt.
struct Block {
    /// Number of windows in a row.
    windows: usize,
    /// One row of samples.
    row: [Vec<f64>; 4],
    /// Rows that the windows of the block cover, filtered along x.
    filtered: [Vec<f64>; 4],
    /// Moments of one row of windows.
    moments: [Vec<f64>; 4],
}

impl Block {
    fn new(width: usize) -> Self {
        let windows = width + 1 - SSIM_SIDE_MIN;
        let zeros = |len| std::array::from_fn(|_| vec![0.0; len]);
        let rows = BLOCK + SSIM_SIDE_MIN - 1;
        Self { windows, row: zeros(width), filtered: zeros(rows * windows), moments: zeros(windows) }
    }

    /// Computes the sums of l · cs and of cs over the windows that begin in `rows`.
    #[inline(always)]
    fn similarity(&mut self, pair: &ImagePair<'_>, weights: &[f64; SSIM_SIDE_MIN], rows: Range<usize>) -> [f64; 2] {
        let Self { windows, row, filtered, moments } = self;
        for (i, y) in (rows.start..rows.end + SSIM_SIDE_MIN - 1).enumerate() {
            let [light, target, squares, products] = row;
            pair.read_row(y, light, target);
            for ((square, product), (p, t)) in squares.iter_mut().zip(products).zip(light.iter().zip(&*target)) {
                (*square, *product) = (p * p + t * t, p * t);
            }
            for (row, filtered) in row.iter().zip(&mut *filtered) {
                filter_along_x(row, weights, &mut filtered[i * *windows..][..*windows]);
            }
        }
        let mut sum = [0.0; 2];
        for i in 0..rows.len() {
            for (filtered, moments) in filtered.iter().zip(&mut *moments) {
                filter_along_y(&filtered[i * *windows..][..SSIM_SIDE_MIN * *windows], weights, moments);
            }
            let [ssim, contrast_structure] = sum_of_windows(moments);
            sum = [sum[0] + ssim, sum[1] + contrast_structure];
        }
        sum
    }
}

#[inline(always)]
fn filter_along_x(row: &[f64], weights: &[f64; SSIM_SIDE_MIN], out: &mut [f64]) {
    out.fill(0.0);
    for (i, weight) in weights.iter().enumerate() {
        for (out, value) in out.iter_mut().zip(&row[i..]) {
            *out += value * weight;
        }
    }
}

#[inline(always)]
fn filter_along_y(rows: &[f64], weights: &[f64; SSIM_SIDE_MIN], out: &mut [f64]) {
    out.fill(0.0);
    for (row, weight) in rows.chunks_exact(out.len()).zip(weights) {
        for (out, value) in out.iter_mut().zip(row) {
            *out += value * weight;
        }
    }
}

/// Number of independent partial sums. They let the compiler use vector instructions and keep the order of additions
/// fixed.
const LANES: usize = 8;

#[inline(always)]
fn sum_of_windows(moments: &[Vec<f64>; 4]) -> [f64; 2] {
    let [p, t, squares, products] = moments;
    let windows = p.len().min(t.len()).min(squares.len()).min(products.len());
    let (mut ssim, mut contrast_structure) = ([0.0; LANES], [0.0; LANES]);
    let whole = windows / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            let i = start + lane;
            let [both, cs] = factors([p[i], t[i], squares[i], products[i]]);
            ssim[lane] += both;
            contrast_structure[lane] += cs;
        }
    }
    for i in whole..windows {
        let [both, cs] = factors([p[i], t[i], squares[i], products[i]]);
        ssim[i - whole] += both;
        contrast_structure[i - whole] += cs;
    }
    [ssim.iter().sum(), contrast_structure.iter().sum()]
}

/// l · cs and cs of a window.
#[inline(always)]
fn factors([p, t, squares, products]: [f64; 4]) -> [f64; 2] {
    let (pt, pp_tt) = (p * t, p * p + t * t);
    let cs = (2.0 * (products - pt) + C2) / (squares - pp_tt + C2);
    [cs * (2.0 * pt + C1) / (pp_tt + C1), cs]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::test_images::{card, noisy_card};
    use crate::numerics::Grid;

    fn whole(plane: &Plane<f32>) -> RegionOfInterest {
        RegionOfInterest::full(&Grid::try_new(plane.height_px(), plane.width_px(), 8e-6).unwrap())
    }

    /// The definition of SSIM, evaluated window by window.
    fn plain(p: &Plane<f32>, t: &Plane<f32>, gain: f64) -> Similarity {
        let weights = weights();
        let (rows, columns) = (p.height_px() + 1 - SSIM_SIDE_MIN, p.width_px() + 1 - SSIM_SIDE_MIN);
        let mut result = Similarity::default();
        for (top, left) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
            let mean = |value: &dyn Fn(f64, f64) -> f64| {
                let mut sum = 0.0;
                for (y, x) in (0..SSIM_SIDE_MIN).flat_map(|y| (0..SSIM_SIDE_MIN).map(move |x| (y, x))) {
                    let (p, t) = (f64::from(p.at(top + y, left + x)), f64::from(t.at(top + y, left + x)));
                    sum += weights[y] * weights[x] * value(gain * p, t);
                }
                sum
            };
            let (mean_p, mean_t) = (mean(&|p, _| p), mean(&|_, t| t));
            let (variance_p, variance_t) = (mean(&|p, _| (p - mean_p).powi(2)), mean(&|_, t| (t - mean_t).powi(2)));
            let covariance = mean(&|p, t| (p - mean_p) * (t - mean_t));
            let brightness = (2.0 * mean_p * mean_t + C1) / (mean_p.powi(2) + mean_t.powi(2) + C1);
            let contrast_structure = (2.0 * covariance + C2) / (variance_p + variance_t + C2);
            result.ssim += brightness * contrast_structure / (rows * columns) as f64;
            result.contrast_structure += contrast_structure / (rows * columns) as f64;
        }
        result
    }

    #[test]
    fn ssim_matches_definition() {
        // Sizes with more rows than a block, with fewer windows than lanes, and with odd and even sides.
        for (height_px, width_px, gain) in [(11, 11, 1.0), (12, 14, 0.7), (45, 23, 1.3), (76, 20, 1.0)] {
            let (p, t) = (noisy_card(height_px, width_px), card(height_px, width_px));
            let expected = plain(&p, &t, gain);
            let pair = ImagePair::new(&p, &t, whole(&t), Gain::Given(gain)).unwrap();
            let found = similarity(&pair);
            // Variances are second moments minus squared means: their error is a few ε of numbers up to 1, divided by
            // C₂ = 9e-4.
            assert!((found.ssim - expected.ssim).abs() < 1e-11, "{height_px}×{width_px}: {found:?} {expected:?}");
            assert!((found.contrast_structure - expected.contrast_structure).abs() < 1e-11);
        }
    }

    /// Expected values are from scikit-image 0.26.0, with the same arrays in float64 and `gain` times `p`:
    /// `structural_similarity(t, gain * p, gaussian_weights=True, sigma=1.5, use_sample_covariance=False,
    /// data_range=1.0)`.
    #[test]
    fn ssim_matches_scikit_image() {
        for (height_px, width_px, same, half, fitted) in [
            (45, 64, 0.544_970_405_796_943_4, 0.515_502_845_469_159_5, 0.554_701_983_480_942_7),
            (64, 101, 0.539_039_416_845_232_1, 0.512_337_596_549_848_7, 0.550_179_166_073_851_9),
        ] {
            let (p, t) = (noisy_card(height_px, width_px), card(height_px, width_px));
            for (gain, expected) in [(Gain::Given(1.0), same), (Gain::Given(0.5), half), (Gain::Fitted, fitted)] {
                let found = ssim(&p, &t, whole(&t), gain).unwrap();
                assert!((found - expected).abs() < 1e-12, "{height_px}×{width_px} {gain:?}: {found} {expected}");
            }
        }
    }

    #[test]
    fn ssim_matches_closed_forms() {
        let t = card(30, 40);
        assert!((ssim(&t, &t, whole(&t), Gain::Given(1.0)).unwrap() - 1.0).abs() < 1e-12);
        assert!((ssim(&t.map(|t| 3.0 * t), &t, whole(&t), Gain::Fitted).unwrap() - 1.0).abs() < 1e-6);
        // Two uniform greys differ in brightness only.
        let (a, b) = (0.25, 0.75);
        let found = ssim(&t.map(|_| a as f32), &t.map(|_| b as f32), whole(&t), Gain::Given(1.0)).unwrap();
        assert!((found - (2.0 * a * b + C1) / (a * a + b * b + C1)).abs() < 1e-12);
        // Noise on a uniform grey and its negative have an SSIM near −1.
        let noise = |sign: f32| Plane::from_fn(30, 40, |y, x| 0.5 + sign * 0.25 * (1.0 - 2.0 * ((y + x) % 2) as f32));
        assert!(ssim(&noise(1.0), &noise(-1.0), whole(&t), Gain::Given(1.0)).unwrap() < -0.95);
    }

    #[test]
    fn sub_samples_are_compared_with_their_pixels() {
        let (t, samples) = (card(12, 15), noisy_card(24, 30));
        let enlarged = Plane::from_fn(24, 30, |y, x| t.at(y / 2, x / 2));
        let roi = RegionOfInterest::try_new(&Grid::try_new(12, 15, 8e-6).unwrap(), 2, 1, 11, 9).unwrap();
        let of_samples = RegionOfInterest::try_new(&Grid::try_new(24, 30, 8e-6).unwrap(), 4, 2, 22, 18).unwrap();
        let found = ssim(&samples, &t, roi, Gain::Fitted).unwrap();
        assert_eq!(found, ssim(&samples, &enlarged, of_samples, Gain::Fitted).unwrap());
    }

    #[test]
    fn too_small_region_is_refused_with_its_size() {
        let t = card(10, 40);
        let error = ssim(&t, &t, whole(&t), Gain::Fitted).unwrap_err().to_string();
        assert!(error.contains("is 10") && error.contains("at least 11"), "{error}");
    }

    #[test]
    fn ssim_does_not_depend_on_number_of_threads() {
        let (p, t) = (noisy_card(150, 60), card(150, 60));
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ssim(&p, &t, whole(&t), Gain::Fitted).unwrap().to_bits())
        };
        assert_eq!([on(1), on(2), on(8)], [on(1); 3]);
    }
}
