//! Sums and phases of many numbers at once, as vector instructions, in f64.

use crate::numerics::vectorized::vectorized;
use num_complex::Complex64;
use std::f64::consts::TAU;

/// Numbers that are computed together.
const LANES: usize = 8;

/// Real and imaginary parts of complex numbers, in two arrays.
#[derive(Clone, Debug)]
pub(super) struct Components(Vec<f64>, Vec<f64>);

impl Components {
    pub(super) fn of(values: impl ExactSizeIterator<Item = Complex64>) -> Self {
        let mut parts = Self(Vec::with_capacity(values.len()), Vec::with_capacity(values.len()));
        values.for_each(|value| {
            parts.0.push(value.re);
            parts.1.push(value.im);
        });
        parts
    }
}

/// Σ a·b for several a of one length, a multiple of eight.
pub(super) fn dots<const COUNT: usize>(a: [&Components; COUNT], b: &Components) -> [Complex64; COUNT] {
    vectorized(
        #[inline(always)]
        || {
            let mut sums = [[[0.0; LANES]; 2]; COUNT];
            let (b_re, b_im) = (b.0.chunks_exact(LANES), b.1.chunks_exact(LANES));
            for (block, (b_re, b_im)) in b_re.zip(b_im).enumerate() {
                let at = block * LANES..(block + 1) * LANES;
                for ([re, im], a) in sums.iter_mut().zip(&a) {
                    let (a_re, a_im) = (&a.0[at.clone()], &a.1[at.clone()]);
                    for i in 0..LANES {
                        re[i] += a_re[i] * b_re[i] - a_im[i] * b_im[i];
                        im[i] += a_re[i] * b_im[i] + a_im[i] * b_re[i];
                    }
                }
            }
            sums.map(|[re, im]| Complex64::new(re.iter().sum(), im.iter().sum()))
        },
    )
}

/// Adds a·b to `sums`, which repeats: the first product of each period to the first sum.
pub(super) fn fold_products(a: &[Complex64], b: &[Complex64], sums: &mut [Complex64]) {
    let period = sums.len();
    vectorized(
        #[inline(always)]
        || {
            for (a, b) in a.chunks(period).zip(b.chunks(period)) {
                for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
                    sum.re += a.re * b.re - a.im * b.im;
                    sum.im += a.re * b.im + a.im * b.re;
                }
            }
        },
    );
}

/// e^{i2π·cycles} for each of the numbers of cycles, which may be up to 2⁴⁸.
pub(super) fn turns(cycles: &[f64], turned: &mut [Complex64]) {
    vectorized(
        #[inline(always)]
        || {
            for (&cycles, turned) in cycles.iter().zip(&mut *turned) {
                *turned = turn(cycles);
            }
        },
    );
}

/// e^{i2π·cycles} without branches: quarters of a turn are subtracted, and the series of sine and cosine summed until
/// they are exact to rounding.
#[inline(always)]
fn turn(cycles: f64) -> Complex64 {
    /// 1.5·2⁵². Adding it rounds to an integer and leaves that integer in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const SINE: [f64; 8] = reciprocals([6.0, 20.0, 42.0, 72.0, 110.0, 156.0, 210.0, 272.0]);
    const COSINE: [f64; 8] = reciprocals([2.0, 12.0, 30.0, 56.0, 90.0, 132.0, 182.0, 240.0]);
    let shifted = 4.0 * cycles + ROUND;
    let (quadrant, quarters) = (shifted.to_bits(), shifted - ROUND);
    let x = TAU * (cycles - 0.25 * quarters);
    let (mut sine, mut cosine) = (1.0, 1.0);
    for i in (0..SINE.len()).rev() {
        sine = 1.0 - x * x * SINE[i] * sine;
        cosine = 1.0 - x * x * COSINE[i] * cosine;
    }
    sine *= x;
    let (re, im) = if quadrant & 1 != 0 { (sine, cosine) } else { (cosine, sine) };
    Complex64::new(signed(re, quadrant.wrapping_add(1)), signed(im, quadrant))
}

const fn reciprocals(numbers: [f64; 8]) -> [f64; 8] {
    let (mut reciprocals, mut i) = (numbers, 0);
    while i < numbers.len() {
        reciprocals[i] = 1.0 / numbers[i];
        i += 1;
    }
    reciprocals
}

/// The value with the opposite sign in the third and fourth `quadrant`.
#[inline(always)]
fn signed(value: f64, quadrant: u64) -> f64 {
    f64::from_bits(value.to_bits() ^ (quadrant << 62 & (1 << 63)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_are_exact_to_rounding() {
        let cycles: Vec<f64> =
            (-4000..4000).map(|i| f64::from(i) * 0.001_237).chain([0.125, 1e4 + 0.3, -0.5]).collect();
        let mut turned = vec![Complex64::ZERO; cycles.len()];
        turns(&cycles, &mut turned);
        for (cycles, turned) in cycles.iter().zip(turned) {
            let error = (turned - Complex64::cis(TAU * (cycles - cycles.round()))).norm();
            assert!(error < 1e-15, "{cycles}: {error:e}");
        }
    }

    #[test]
    fn sums_of_products_are_those_of_complex_numbers() {
        let value = |i: usize| Complex64::new((i % 7) as f64 - 2.0, (i % 5) as f64);
        let [a, b] = [0, 3].map(|from| (from..from + 24).map(value).collect::<Vec<_>>());
        let parts = |values: &[Complex64]| Components::of(values.iter().copied());
        let expected: Complex64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
        let squares: Complex64 = b.iter().map(|b| b * b).sum();
        assert_eq!(dots([&parts(&a), &parts(&b)], &parts(&b)), [expected, squares]);
        let mut sums = [Complex64::ONE; 5];
        fold_products(&a, &b, &mut sums);
        assert_eq!(sums[4], 1.0 + a[4] * b[4] + a[9] * b[9] + a[14] * b[14] + a[19] * b[19]);
        assert_eq!(sums.iter().sum::<Complex64>(), 5.0 + expected);
    }
}
