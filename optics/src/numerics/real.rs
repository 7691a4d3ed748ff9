//! The two precisions of the engine: f32 in production, f64 as a reference.

use bytemuck::Zeroable;
use lightpath_fft::{Precision, num_traits::Float};
use num_complex::Complex;
use pulp::{Simd, bytemuck};

/// Floating-point type of a computation: f32 or f64.
#[allow(private_bounds)] // the operations on vector registers are private to this crate
pub trait Number: Precision + Float + Zeroable + Vectors {
    /// Nearest number of this precision to `value`.
    fn of(value: f64) -> Self;

    /// This number in f64.
    fn wide(self) -> f64;

    /// Sine and cosine of this number.
    ///
    /// For f32 the error is at most 2e-7 for |x| ≤ 1e4; for larger arguments it grows in proportion. The code has no
    /// branches, so that loops over it become vector instructions.
    fn sine_cosine(self) -> (Self, Self);

    /// Exponential e^x of this number x. For f32 the relative error is at most 3e-7, and arguments are clamped to ±80.
    /// The code has no branches, so that loops over it become vector instructions.
    fn exponential(self) -> Self;
}

impl Number for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }

    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        self.sin_cos()
    }

    #[inline(always)]
    fn exponential(self) -> Self {
        self.exp()
    }
}

impl Number for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }

    // The argument is reduced to [−π/4, π/4] with π/2 in three parts. Minimax polynomials then give sine and cosine.
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        const HALF_PI: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
        // Adding 1.5·2²³ rounds to an integer and leaves that integer in the lowest bits.
        const ROUND: f32 = 12_582_912.0;
        let shifted = self * std::f32::consts::FRAC_2_PI + ROUND;
        let (quadrant, quarter_turns) = (shifted.to_bits(), shifted - ROUND);
        let x = self - quarter_turns * HALF_PI[0] - quarter_turns * HALF_PI[1] - quarter_turns * HALF_PI[2];
        let x2 = x * x;
        let sine = x + x * x2 * (-1.666_665_5e-1 + x2 * (8.332_161e-3 + x2 * -1.951_529_6e-4));
        let cosine = 1.0 - 0.5 * x2 + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + x2 * 2.443_315_7e-5));
        let (s, c) = if quadrant & 1 != 0 { (cosine, sine) } else { (sine, cosine) };
        let signed = |value: f32, sign: u32| f32::from_bits(value.to_bits() ^ (sign << 30 & 0x8000_0000));
        (signed(s, quadrant), signed(c, quadrant.wrapping_add(1)))
    }

    // e^x = 2^n · e^r with |r| ≤ ln 2 / 2, where a Taylor series gives e^r.
    #[inline(always)]
    fn exponential(self) -> Self {
        const LN_2: [f32; 2] = [0.693_359_4, -2.121_944_4e-4];
        let x = self.clamp(-80.0, 80.0);
        let n = (x * std::f32::consts::LOG2_E).round_ties_even();
        let r = x - n * LN_2[0] - n * LN_2[1];
        let series =
            1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0))))));
        series * f32::from_bits(((n as i32 + 127) << 23) as u32)
    }
}

/// Operations on vector registers of numbers of this precision, used by [`batch_fft`](crate::numerics::batch_fft).
pub(crate) trait Vectors: Copy {
    type Vector<S: Simd>: Copy;

    fn lanes<S: Simd>() -> usize;
    fn splat<S: Simd>(simd: S, value: Self) -> Self::Vector<S>;
    fn add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn sub<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    fn mul<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>) -> Self::Vector<S>;
    /// Computes a·b + c.
    fn mul_add<S: Simd>(simd: S, a: Self::Vector<S>, b: Self::Vector<S>, c: Self::Vector<S>) -> Self::Vector<S>;
    fn neg<S: Simd>(simd: S, a: Self::Vector<S>) -> Self::Vector<S>;
    /// Views a slice as registers. Values at the end that do not fill a register are omitted.
    fn vectors<S: Simd>(values: &[Self]) -> &[Self::Vector<S>];
    fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [Self::Vector<S>];
    /// Views a slice of complex numbers as pairs of registers, in the order of the memory. Values at the end that do
    /// not fill a pair are omitted.
    fn interleaved<S: Simd>(values: &[Complex<Self>]) -> &[[Self::Vector<S>; 2]];
    fn interleaved_mut<S: Simd>(values: &mut [Complex<Self>]) -> &mut [[Self::Vector<S>; 2]];
    /// Separates a pair of registers of complex numbers into real and imaginary parts. The order of the lanes depends
    /// on the machine.
    fn parts<S: Simd>(simd: S, pair: [Self::Vector<S>; 2]) -> [Self::Vector<S>; 2];
    /// Applies the inverse of [`Self::parts`].
    fn pair<S: Simd>(simd: S, parts: [Self::Vector<S>; 2]) -> [Self::Vector<S>; 2];
}

/// Implements [`Vectors`] with pulp's names for a type.
macro_rules! vectors {
    (
        $real:ty: $vector:ident, $lanes:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident,
        $mul_add:ident, $neg:ident, $vectors:ident, $vectors_mut:ident, $parts:ident, $pair:ident
    ) => {
        impl Vectors for $real {
            type Vector<S: Simd> = S::$vector;

            #[inline(always)]
            fn lanes<S: Simd>() -> usize {
                S::$lanes
            }

            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> S::$vector {
                simd.$splat(value)
            }

            #[inline(always)]
            fn add<S: Simd>(simd: S, a: S::$vector, b: S::$vector) -> S::$vector {
                simd.$add(a, b)
            }

            #[inline(always)]
            fn sub<S: Simd>(simd: S, a: S::$vector, b: S::$vector) -> S::$vector {
                simd.$sub(a, b)
            }

            #[inline(always)]
            fn mul<S: Simd>(simd: S, a: S::$vector, b: S::$vector) -> S::$vector {
                simd.$mul(a, b)
            }

            #[inline(always)]
            fn mul_add<S: Simd>(simd: S, a: S::$vector, b: S::$vector, c: S::$vector) -> S::$vector {
                simd.$mul_add(a, b, c)
            }

            #[inline(always)]
            fn neg<S: Simd>(simd: S, a: S::$vector) -> S::$vector {
                simd.$neg(a)
            }

            #[inline(always)]
            fn vectors<S: Simd>(values: &[Self]) -> &[S::$vector] {
                S::$vectors(values).0
            }

            #[inline(always)]
            fn vectors_mut<S: Simd>(values: &mut [Self]) -> &mut [S::$vector] {
                S::$vectors_mut(values).0
            }

            #[inline(always)]
            fn interleaved<S: Simd>(values: &[Complex<Self>]) -> &[[S::$vector; 2]] {
                S::$vectors(bytemuck::cast_slice(values)).0.as_chunks().0
            }

            #[inline(always)]
            fn interleaved_mut<S: Simd>(values: &mut [Complex<Self>]) -> &mut [[S::$vector; 2]] {
                S::$vectors_mut(bytemuck::cast_slice_mut(values)).0.as_chunks_mut().0
            }

            #[inline(always)]
            fn parts<S: Simd>(simd: S, pair: [S::$vector; 2]) -> [S::$vector; 2] {
                simd.$parts(pair)
            }

            #[inline(always)]
            fn pair<S: Simd>(simd: S, parts: [S::$vector; 2]) -> [S::$vector; 2] {
                simd.$pair(parts)
            }
        }
    };
}

vectors!(
    f32: f32s, F32_LANES, splat_f32s, add_f32s, sub_f32s, mul_f32s, mul_add_e_f32s, neg_f32s,
    as_simd_f32s, as_mut_simd_f32s, deinterleave_shfl_f32s, interleave_shfl_f32s
);
vectors!(
    f64: f64s, F64_LANES, splat_f64s, add_f64s, sub_f64s, mul_f64s, mul_add_e_f64s, neg_f64s,
    as_simd_f64s, as_mut_simd_f64s, deinterleave_shfl_f64s, interleave_shfl_f64s
);

/// The integer nearest to a number below 2⁵¹, without a call that keeps a loop from becoming vector instructions.
#[inline(always)]
pub(crate) fn nearest_integer(x: f64) -> f64 {
    /// 1.5·2⁵². Numbers of its size have no fraction.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    (x + ROUND) - ROUND
}

/// Computes e^{ix} in the precision of `x`.
#[inline(always)]
pub(crate) fn unit<T: Number>(x: T) -> Complex<T> {
    let (sine, cosine) = x.sine_cosine();
    Complex::new(cosine, sine)
}

/// Computes e^{ix} in f64 and rounds it to the precision `T`.
pub(crate) fn unit_of<T: Number>(x: f64) -> Complex<T> {
    Complex::new(T::of(x.cos()), T::of(x.sin()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_sine_and_cosine_are_accurate() {
        let worst = (-400_000..400_000)
            .map(|i| {
                let x = i as f32 * 0.025;
                let (sine, cosine) = x.sine_cosine();
                let exact = f64::from(x);
                (f64::from(sine) - exact.sin()).abs().max((f64::from(cosine) - exact.cos()).abs())
            })
            .fold(0.0, f64::max);
        assert!(worst < 2e-7, "largest error {worst:e}");
    }

    #[test]
    fn fast_exponential_is_accurate() {
        let worst = (-70_000..70_000)
            .map(|i| {
                let x = i as f32 * 1e-3;
                (f64::from(x.exponential()) / f64::from(x).exp() - 1.0).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst < 3e-7, "largest relative error {worst:e}");
    }
}
