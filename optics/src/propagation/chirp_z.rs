//! The chirp-z transform: a Fourier sum at any spacing of its output, in O(n log n).
//!
//! ```text
//! X_k = Σ_n x_n e^{∓i2π·s·p·q},   p = n − (N−1)/2,   q = k − k₀
//!     = e^{∓iπs·q²} Σ_n [x_n e^{∓iπs·p²}] e^{±iπs·(q−p)²}
//! ```
//!
//! n = 0 … N−1 samples, k = 0 … M−1 results, s the spacing \[cycles\] of neighbouring results at neighbouring samples.
//! The second line follows from pq = (p² + q² − (q−p)²)/2. It is a convolution with a chirp, computed by fast Fourier
//! transforms of length N + M − 1 or more. p and q are counted from the middle, which keeps the phases of the chirps
//! small.
//! Sources: L. Bluestein, IEEE Trans. Audio Electroacoust. 18, 451 (1970); L. Rabiner, R. Schafer and C. Rader, ibid.
//! 17, 86 (1969).

use super::transfer_function::phasor;
use crate::numerics::real::Number;
use lightpath_fft::{Fft, FftPlanner};
use num_complex::{Complex, Complex64};
use std::{fmt, sync::Arc};

/// The sign in the exponent of the sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    /// e^{−i2π…}: space to frequency.
    Minus,
    /// e^{+i2π…}: frequency to space.
    Plus,
}

/// A planned chirp-z transform from `samples` values to `results` values.
#[derive(Clone)]
pub(super) struct ChirpZ<T> {
    samples: usize,
    results: usize,
    forward: Arc<dyn Fft<T>>,
    inverse: Arc<dyn Fft<T>>,
    /// Factors of the samples before the convolution: e^{∓iπs·p²}.
    before: Vec<Complex<T>>,
    /// Fourier transform of the chirp e^{±iπs·m²}, divided by its length.
    chirp: Vec<Complex<T>>,
    /// Factors of the results after the convolution: e^{∓iπs·q²}.
    after: Vec<Complex<T>>,
}

impl<T> fmt::Debug for ChirpZ<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ChirpZ({} to {})", self.samples, self.results)
    }
}

/// Positions of the samples or of the results of a transform, in steps from an origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    /// Number of values.
    pub(super) count: usize,
    /// Index of position 0; it may be a fraction.
    pub(super) origin: f64,
}

impl Span {
    /// `count` positions with the origin in their middle.
    pub(super) fn centred(count: usize) -> Self {
        Self { count, origin: middle(count) }
    }

    fn at(self, index: usize) -> f64 {
        index as f64 - self.origin
    }
}

/// The middle of the indices 0 … count−1.
pub(super) fn middle(count: usize) -> f64 {
    (count as f64 - 1.0) / 2.0
}

impl<T: Number> ChirpZ<T> {
    /// Plans the transform from `samples` to `results`, which are `spacing_cycles` apart.
    pub(super) fn new(
        planner: &mut FftPlanner<T>,
        samples: Span,
        results: Span,
        spacing_cycles: f64,
        sign: Sign,
    ) -> Self {
        let length = fast_length(samples.count + results.count - 1);
        let cycles = match sign {
            Sign::Minus => -0.5 * spacing_cycles,
            Sign::Plus => 0.5 * spacing_cycles,
        };
        let narrow = |value: Complex64| Complex::new(T::of(value.re), T::of(value.im));
        let ramp = |span: Span| (0..span.count).map(|i| narrow(phasor(cycles * span.at(i).powi(2)))).collect();
        // The chirp at q − p = k − n − (k₀ − n₀). k − n runs from −(N−1) to M−1; negative values wrap around.
        let mut chirp = vec![Complex64::ZERO; length];
        let between = results.origin - samples.origin;
        for (k, value) in chirp.iter_mut().enumerate().take(results.count) {
            *value = phasor(-cycles * (k as f64 - between).powi(2));
        }
        for n in 1..samples.count {
            chirp[length - n] = phasor(-cycles * (n as f64 + between).powi(2));
        }
        FftPlanner::<f64>::new().plan_fft_forward(length).process(&mut chirp);
        Self {
            samples: samples.count,
            results: results.count,
            forward: planner.plan_fft_forward(length),
            inverse: planner.plan_fft_inverse(length),
            before: ramp(samples),
            chirp: chirp.into_iter().map(|value| narrow(value / length as f64)).collect(),
            after: ramp(results),
        }
    }

    /// Number of input values.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// Number of output values.
    pub(super) fn results(&self) -> usize {
        self.results
    }

    /// Working memory for [`Self::transform`].
    pub(super) fn scratch(&self) -> Vec<Complex<T>> {
        let own = self.forward.get_inplace_scratch_len().max(self.inverse.get_inplace_scratch_len());
        vec![Complex::new(T::zero(), T::zero()); self.chirp.len() + own]
    }

    /// Transforms the `samples` values `x` and writes the values X to `results`.
    pub(super) fn transform(&self, x: &[Complex<T>], results: &mut [Complex<T>], scratch: &mut [Complex<T>]) {
        let (work, scratch) = scratch.split_at_mut(self.chirp.len());
        for ((work, &x), &before) in work.iter_mut().zip(x).zip(&self.before) {
            *work = x * before;
        }
        work[self.samples..].fill(Complex::new(T::zero(), T::zero()));
        self.forward.process_with_scratch(work, scratch);
        for (work, &chirp) in work.iter_mut().zip(&self.chirp) {
            *work = *work * chirp;
        }
        self.inverse.process_with_scratch(work, scratch);
        for ((result, &work), &after) in results.iter_mut().zip(&*work).zip(&self.after) {
            *result = work * after;
        }
    }
}

/// The smallest length of at least `least` whose prime factors are 2, 3 and 5 only.
pub(super) fn fast_length(least: usize) -> usize {
    let is_smooth = |mut n: usize| {
        for factor in [2, 3, 5] {
            while n.is_multiple_of(factor) {
                n /= factor;
            }
        }
        n == 1
    };
    (least.max(1)..).find(|&n| is_smooth(n)).expect("a power of two lies above every size")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn check<T: Number>(bound: f64) {
        for (samples, results, origin, spacing) in
            [(1, 1, 0.0, 0.3), (8, 8, 3.5, 0.125), (7, 13, 20.3, 0.011), (31, 5, -4.0, 0.9), (64, 200, 99.5, 1.7e-3)]
        {
            for sign in [Sign::Minus, Sign::Plus] {
                let turn = if sign == Sign::Minus { -TAU } else { TAU };
                let (from, to) = (Span::centred(samples), Span { count: results, origin });
                let chirp_z = ChirpZ::<T>::new(&mut FftPlanner::new(), from, to, spacing, sign);
                let x: Vec<Complex64> =
                    (0..samples).map(|n| Complex64::new((n as f64 * 2.3).sin(), (n as f64 * 1.1).cos())).collect();
                let narrow: Vec<Complex<T>> = x.iter().map(|x| Complex::new(T::of(x.re), T::of(x.im))).collect();
                let mut found = vec![Complex::new(T::zero(), T::zero()); results];
                // The contents of the working memory before a transform must not change the result.
                let mut scratch = chirp_z.scratch();
                scratch.fill(Complex::new(T::of(f64::NAN), T::one()));
                chirp_z.transform(&narrow, &mut found, &mut scratch);
                let (mut error, mut energy) = (0.0, 0.0);
                for (k, found) in found.iter().enumerate() {
                    let term = |(n, x): (usize, &Complex64)| x * Complex64::cis(turn * spacing * from.at(n) * to.at(k));
                    let expected: Complex64 = x.iter().enumerate().map(term).sum();
                    error += (Complex64::new(found.re.wide(), found.im.wide()) - expected).norm_sqr();
                    // Upper bound of |X|².
                    energy += samples as f64 * x.iter().map(Complex64::norm_sqr).sum::<f64>();
                }
                let error = (error / energy).sqrt();
                assert!(error < bound, "{samples} to {results}: {error:e}");
            }
        }
    }

    // Rounding errors: ε·log₂(length) for each of two transforms, and ε times the phases of the direct sum, up to 800
    // rad.
    #[test]
    fn transform_matches_direct_sum() {
        check::<f64>(1e-13);
        check::<f32>(1e-6);
    }

    #[test]
    fn transform_lengths_have_small_prime_factors() {
        for (least, length) in [(0, 1), (7, 8), (11, 12), (13, 15), (121, 125), (2049, 2160)] {
            assert_eq!(fast_length(least), length);
        }
    }
}
