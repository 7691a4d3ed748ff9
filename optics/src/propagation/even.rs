//! Fourier transforms of even sequences, and the transfer function of an even impulse response.

use crate::interrupt;
use crate::numerics::buffers::zeros;
use lightpath_fft::FftPlanner;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Several even sequences, each with a period of `2·half`.
#[derive(Clone, Copy, Debug)]
pub(super) struct EvenSequences {
    pub(super) count: usize,
    /// Half of the period. The values at 0 … `half` determine all others.
    pub(super) half: usize,
    /// Number of bins of each transform that are kept, from bin 0 on: at most `half + 1`.
    pub(super) kept: usize,
}

/// Fourier transform of each sequence f_0, f_1, …, f_half, f_{half − 1}, …, f_1, where `fill(s, f)` writes f_0 to
/// f_half of the sequence s. The forward and the inverse transform of an even sequence are the same, apart from the
/// scale.
///
/// With N = `half`, a transform of N values gives all 2N bins F of a sequence f:
///
/// ```text
/// y_j = (f_j + f_{N−j})/2 − sin(πj/N) (f_j − f_{N−j}),   Y = DFT of y_0 … y_{N−1}
/// F_2k = Y_k + Y_{N−k},   F_{2k+1} = F_{2k−1} + i (Y_k − Y_{N−k}),   F_1 = f_0 − f_N + 2 Σ_{0<j<N} f_j cos(πj/N)
/// ```
///
/// Source: W. H. Press et al., Numerical Recipes, 3rd ed., section 12.4.2, there for real sequences.
pub(super) fn even_transform(
    EvenSequences { count, half, kept }: EvenSequences,
    fill: impl Fn(usize, &mut [Complex64]) + Sync,
) -> Vec<Complex64> {
    let fft = FftPlanner::new().plan_fft_forward(half);
    let angles: Vec<(f64, f64)> = (0..half).map(|j| (PI * j as f64 / half as f64).sin_cos()).collect();
    let mut spectra: Vec<Complex64> = zeros(count * kept);
    spectra.par_chunks_exact_mut(kept).enumerate().for_each_init(
        || (vec![Complex64::ZERO; half + 1], vec![Complex64::ZERO; fft.get_inplace_scratch_len()]),
        |(sequence, scratch), (s, out)| {
            interrupt::check();
            fill(s, sequence);
            let mut odd = sequence[0] - sequence[half];
            odd += 2.0 * sequence[1..half].iter().zip(&angles[1..]).map(|(f, (_, cos))| f * cos).sum::<Complex64>();
            // y_j and y_{N−j} come from the same two values.
            for j in 0..=half / 2 {
                let (a, b, sin) = (sequence[j], sequence[half - j], angles[j].0);
                let (mean, difference) = (0.5 * (a + b), sin * (a - b));
                (sequence[j], sequence[half - j]) = (mean - difference, mean + difference);
            }
            fft.process_with_scratch(&mut sequence[..half], scratch);
            for k in 0..kept.div_ceil(2) {
                let (y, mirrored) = (sequence[k % half], sequence[(half - k) % half]);
                out[2 * k] = y + mirrored;
                if k > 0 {
                    let step = y - mirrored;
                    odd += Complex64::new(-step.im, step.re);
                }
                if let Some(out) = out.get_mut(2 * k + 1) {
                    *out = odd;
                }
            }
        },
    );
    spectra
}

/// The transfer function of an even impulse response, at the padded bins from zero frequency to half the sampling
/// frequency. It is even along both axes, so these bins determine all others.
#[derive(Clone, Debug)]
pub(super) struct EvenSpectrum {
    height_px: usize,
    width_px: usize,
    /// Values in order of fx, then fy: all fy of the first fx, then of the next.
    values: Vec<Complex64>,
}

impl EvenSpectrum {
    /// The transfer function of the impulse response `h(y, x)` at the lags 0 … height and 0 … width.
    pub(super) fn new(height_px: usize, width_px: usize, h: impl Fn(usize, usize) -> Complex64 + Sync) -> Self {
        // First along x for each lag along y, then along y for each fx.
        let rows = EvenSequences { count: height_px + 1, half: width_px, kept: width_px + 1 };
        let along_x = even_transform(rows, |y, row| row.iter_mut().enumerate().for_each(|(x, value)| *value = h(y, x)));
        let columns = EvenSequences { count: width_px + 1, half: height_px, kept: height_px + 1 };
        let values = even_transform(columns, |u, column| {
            column.iter_mut().enumerate().for_each(|(y, value)| *value = along_x[y * (width_px + 1) + u]);
        });
        Self { height_px, width_px, values }
    }

    /// The transfer function at the padded bin (`u`, `v`), 0 ≤ u < 2·width, 0 ≤ v < 2·height.
    pub(super) fn at_bins(&self, u: usize, v: usize) -> Complex64 {
        let (u, v) = (u.min(2 * self.width_px - u), v.min(2 * self.height_px - v));
        self.values[u * (self.height_px + 1) + v]
    }
}

/// The transfer function of the impulse response `h(y, x)` at any frequency \[cycles/px\], from its definition in
/// O(pixels).
pub(super) fn even_sum(
    height_px: usize,
    width_px: usize,
    fx: f64,
    fy: f64,
    h: impl Fn(usize, usize) -> Complex64,
) -> Complex64 {
    // The lag of a whole side stands for the lags on both sides, which have the same place in the padded frame.
    let weight = |lag: usize, side_px: usize, f: f64| {
        let both = if lag == 0 || lag == side_px { 1.0 } else { 2.0 };
        both * (TAU * f * lag as f64).cos()
    };
    let mut sum = Complex64::ZERO;
    for y in 0..=height_px {
        let along_x: Complex64 = (0..=width_px).map(|x| h(y, x) * weight(x, width_px, fx)).sum();
        sum += along_x * weight(y, height_px, fy);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::band_response::band_response;
    use super::super::impulse_response::sampled_response;
    use super::*;
    use crate::display::OpticalSetup;
    use crate::numerics::Grid;
    use crate::numerics::grid::frequency;

    #[test]
    fn fast_spectrum_matches_definition() {
        for (height_px, width_px, distance_m) in [(1, 1, 0.01), (7, 4, -0.002), (6, 11, 0.05)] {
            let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
            let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
            let of_band = band_response(&setup);
            let of_band = |y: usize, x: usize| of_band[y * (width_px + 1) + x];
            let of_point = sampled_response(&setup);
            let responses: [&(dyn Fn(usize, usize) -> Complex64 + Sync); 2] = [&of_band, &of_point];
            for h in responses {
                let fast = EvenSpectrum::new(height_px, width_px, h);
                for v in 0..2 * height_px {
                    for u in 0..2 * width_px {
                        let (fx, fy) = (frequency(u, 2 * width_px, 1.0), frequency(v, 2 * height_px, 1.0));
                        let plain = even_sum(height_px, width_px, fx, fy, h);
                        assert!((fast.at_bins(u, v) - plain).norm() < 1e-12, "{height_px}×{width_px}: ({u}, {v})");
                    }
                }
            }
        }
    }
}
