//! Projections of a complex sequence onto real polynomials.

use crate::engine::Real;
use num_complex::{Complex, Complex64};

/// Number of values that are summed in T before the sum is widened to f64.
const BLOCK: usize = 32;

/// Σ_k value(k) · polynomials[j][k] for each j.
#[inline(always)]
pub(super) fn project<T: Real>(value: impl Fn(usize) -> Complex<T>, polynomials: &[Vec<T>], sums: &mut [Complex64]) {
    let len = polynomials.first().map_or(0, Vec::len);
    let mut block = [Complex::new(T::zero(), T::zero()); BLOCK];
    for start in (0..len).step_by(BLOCK) {
        let count = BLOCK.min(len - start);
        for (k, slot) in block.iter_mut().enumerate().take(count) {
            *slot = value(start + k);
        }
        for (sum, polynomial) in sums.iter_mut().zip(polynomials) {
            let (mut re, mut im) = ([T::zero(); 8], [T::zero(); 8]);
            for (k, (v, &t)) in block[..count].iter().zip(&polynomial[start..]).enumerate() {
                re[k % 8] = re[k % 8] + v.re * t;
                im[k % 8] = im[k % 8] + v.im * t;
            }
            let wide = |lanes: [T; 8]| lanes.iter().map(|lane| lane.wide()).sum::<f64>();
            *sum += Complex64::new(wide(re), wide(im));
        }
    }
}
