//! Plans of fast Fourier transforms of any length, in f32 and f64.
//!
//! The transforms are those of the crate rustfft. Its code is generic, so each crate that names its planner compiles all
//! of its transforms again, for each kind of vector register: more than a third of the engine's code. Here they are
//! compiled once, for the two precisions that exist.

use std::fmt;
use std::sync::Arc;

pub use rustfft::{Fft, FftDirection, FftNum, num_traits};

/// A precision with transforms of its own: f32 or f64.
pub trait Precision: FftNum {
    /// A planner without plans.
    #[doc(hidden)]
    fn planner() -> rustfft::FftPlanner<Self>;

    /// A plan for transforms of `length` samples.
    #[doc(hidden)]
    fn plan(planner: &mut rustfft::FftPlanner<Self>, length: usize, direction: FftDirection) -> Arc<dyn Fft<Self>>;
}

// Not inlined: otherwise the crate that calls them would compile the transforms.
macro_rules! precision {
    ($number:ty) => {
        impl Precision for $number {
            #[inline(never)]
            fn planner() -> rustfft::FftPlanner<Self> {
                rustfft::FftPlanner::new()
            }

            #[inline(never)]
            fn plan(
                planner: &mut rustfft::FftPlanner<Self>,
                length: usize,
                direction: FftDirection,
            ) -> Arc<dyn Fft<Self>> {
                planner.plan_fft(length, direction)
            }
        }
    };
}

precision!(f32);
precision!(f64);

/// Plans transforms. Plans of one planner share their tables.
///
/// ```
/// use lightpath_fft::FftPlanner;
///
/// let mut constant = vec![rustfft::num_complex::Complex::new(1.0, 0.0); 6];
/// FftPlanner::<f64>::new().plan_fft_forward(6).process(&mut constant);
/// assert!((constant[0].re - 6.0).abs() < 1e-12 && constant[1].norm() < 1e-12);
/// ```
pub struct FftPlanner<T: Precision>(rustfft::FftPlanner<T>);

impl<T: Precision> fmt::Debug for FftPlanner<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FftPlanner").finish_non_exhaustive()
    }
}

impl<T: Precision> FftPlanner<T> {
    /// A planner without plans.
    #[must_use]
    #[expect(clippy::new_without_default, reason = "a planner has no value that a default would be")]
    pub fn new() -> Self {
        Self(T::planner())
    }

    /// The transform Σ f(x) e^{∓i2πfx/length} of `length` samples, − for forward and + for inverse, without a factor.
    pub fn plan_fft(&mut self, length: usize, direction: FftDirection) -> Arc<dyn Fft<T>> {
        T::plan(&mut self.0, length, direction)
    }

    /// The forward transform of `length` samples.
    pub fn plan_fft_forward(&mut self, length: usize) -> Arc<dyn Fft<T>> {
        self.plan_fft(length, FftDirection::Forward)
    }

    /// The inverse transform of `length` samples, without the factor 1/length.
    pub fn plan_fft_inverse(&mut self, length: usize) -> Arc<dyn Fft<T>> {
        self.plan_fft(length, FftDirection::Inverse)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::num_complex::Complex;
    use std::f64::consts::TAU;

    // Lengths with their own transforms, with products of those, and with primes.
    const LENGTHS: [usize; 7] = [1, 8, 30, 31, 97, 210, 1024];

    fn sum(values: &[Complex<f64>], bin: usize, sign: f64) -> Complex<f64> {
        let turn = sign * TAU / values.len() as f64;
        let term = |(x, value): (usize, &Complex<f64>)| value * Complex::cis(turn * (bin * x % values.len()) as f64);
        values.iter().enumerate().map(term).sum()
    }

    #[test]
    fn transforms_of_both_precisions_are_the_sums_of_their_definition() {
        let (mut narrow, mut wide) = (FftPlanner::<f32>::new(), FftPlanner::<f64>::new());
        for (length, (direction, sign)) in
            LENGTHS.into_iter().flat_map(|n| [(n, (FftDirection::Forward, -1.0)), (n, (FftDirection::Inverse, 1.0))])
        {
            let values = (0..length).map(|x| Complex::new((x * 7 % 5) as f64 - 2.0, (x * x % 11) as f64 / 4.0));
            let values: Vec<_> = values.collect();
            let mut exact = values.clone();
            wide.plan_fft(length, direction).process(&mut exact);
            let mut rounded: Vec<_> = values.iter().map(|v| Complex::new(v.re as f32, v.im as f32)).collect();
            narrow.plan_fft(length, direction).process(&mut rounded);
            for bin in 0..length {
                let expected = sum(&values, bin, sign);
                assert!((exact[bin] - expected).norm() < 1e-11 * length as f64, "{length} {direction:?} bin {bin}");
                let widened = Complex::new(f64::from(rounded[bin].re), f64::from(rounded[bin].im));
                assert!((widened - expected).norm() < 1e-5 * length as f64, "{length} {direction:?} bin {bin}, f32");
            }
        }
    }
}
