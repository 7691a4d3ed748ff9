//! Discrete Fourier transforms of small fixed sizes, written out.
//!
//! ```text
//! X_k = Σ_n x_n e^{−i2πnk/R}
//! ```
//!
//! Sizes with coprime factors use the algorithm of I. J. Good (J. R. Stat. Soc. B 20, 361 (1958)), which needs no
//! twiddle factors: of a size a·b, input n = b·n₁ + a·n₂ (mod a·b) is number n₂ of row n₁, and output k is number k mod
//! a of column k mod b. Other composite sizes use that of J. Cooley and J. Tukey (Math. Comput. 19, 297 (1965)).
//!
//! Nothing here is a loop. Whether a compiler unrolls a loop over the numbers of a butterfly depends on the code around
//! it, and a butterfly whose numbers are kept in memory instead of in registers takes three times as long.

use super::lanes::ComplexLanes;
use super::tile::Factors;
use crate::numerics::real::Number;
use num_complex::Complex;
use pulp::Simd;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// A transform of `R` numbers. It is a type because a function passed as an argument would not be inlined.
pub(super) trait Butterfly<const R: usize> {
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; R]) -> [ComplexLanes<T, S>; R];
}

/// What a stage does with the `R` numbers of a butterfly beside the transform. Number k lies in register
/// `first + k · step`.
pub(super) trait StageOf<const R: usize>: Butterfly<R> {
    fn gather<T: Number, S: Simd>(
        simd: S,
        parts: [&[T::Vector<S>]; 2],
        first: usize,
        step: usize,
    ) -> [ComplexLanes<T, S>; R];

    /// Writes the numbers, times their twiddle factors where those are given. The first of these is one.
    fn scatter<T: Number, S: Simd>(
        simd: S,
        y: [ComplexLanes<T, S>; R],
        twiddles: Option<&[Complex<T>]>,
        parts: [&mut [T::Vector<S>]; 2],
        first: usize,
        step: usize,
    );

    /// Writes the numbers, times the factors of their registers.
    fn scatter_times<T: Number, S: Simd>(
        simd: S,
        y: [ComplexLanes<T, S>; R],
        factors: Factors<'_, T>,
        parts: [&mut [T::Vector<S>]; 2],
        first: usize,
        step: usize,
    );
}

pub(super) struct Butterfly2;
pub(super) struct Butterfly3;
pub(super) struct Butterfly4;
pub(super) struct Butterfly5;
pub(super) struct Butterfly6;
pub(super) struct Butterfly8;
pub(super) struct Butterfly9;
pub(super) struct Butterfly10;
pub(super) struct Butterfly12;

impl Butterfly<2> for Butterfly2 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>([a, b]: [ComplexLanes<T, S>; 2]) -> [ComplexLanes<T, S>; 2] {
        [a + b, a - b]
    }
}

impl Butterfly<3> for Butterfly3 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>([a, b, c]: [ComplexLanes<T, S>; 3]) -> [ComplexLanes<T, S>; 3] {
        let sine = (TAU / 3.0).sin();
        let (sum, difference) = (b + c, (b - c).times_minus_i());
        let middle = sum.scaled_plus(-0.5, a);
        [a + sum, difference.scaled_plus(sine, middle), difference.scaled_plus(-sine, middle)]
    }
}

impl Butterfly<4> for Butterfly4 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>([a, b, c, d]: [ComplexLanes<T, S>; 4]) -> [ComplexLanes<T, S>; 4] {
        let (even, odd) = ((a + c, a - c), (b + d, (b - d).times_minus_i()));
        [even.0 + odd.0, even.1 + odd.1, even.0 - odd.0, even.1 - odd.1]
    }
}

impl Butterfly<5> for Butterfly5 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>([a, b, c, d, e]: [ComplexLanes<T, S>; 5]) -> [ComplexLanes<T, S>; 5] {
        let ((sine_1, cosine_1), (sine_2, cosine_2)) = ((TAU / 5.0).sin_cos(), (2.0 * TAU / 5.0).sin_cos());
        let (near, far) = ((b + e, (b - e).times_minus_i()), (c + d, (c - d).times_minus_i()));
        let first = far.0.scaled_plus(cosine_2, near.0.scaled_plus(cosine_1, a));
        let second = far.0.scaled_plus(cosine_1, near.0.scaled_plus(cosine_2, a));
        let first_turn = far.1.scaled_plus(sine_2, near.1.scaled(sine_1));
        let second_turn = far.1.scaled_plus(-sine_1, near.1.scaled(sine_2));
        [a + near.0 + far.0, first + first_turn, second + second_turn, second - second_turn, first - first_turn]
    }
}

impl Butterfly<8> for Butterfly8 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; 8]) -> [ComplexLanes<T, S>; 8] {
        let even = Butterfly4::transform([x[0], x[2], x[4], x[6]]);
        let odd = Butterfly4::transform([x[1], x[3], x[5], x[7]]);
        // The products with e^{−iπ/4} and e^{−i3π/4} need no complex multiplication.
        let eighth = ComplexLanes { re: odd[1].re + odd[1].im, im: odd[1].im - odd[1].re }.scaled(FRAC_1_SQRT_2);
        let three = ComplexLanes { re: odd[3].im - odd[3].re, im: -(odd[3].im + odd[3].re) }.scaled(FRAC_1_SQRT_2);
        let quarter = odd[2].times_minus_i();
        [
            even[0] + odd[0],
            even[1] + eighth,
            even[2] + quarter,
            even[3] + three,
            even[0] - odd[0],
            even[1] - eighth,
            even[2] - quarter,
            even[3] - three,
        ]
    }
}

impl Butterfly<9> for Butterfly9 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; 9]) -> [ComplexLanes<T, S>; 9] {
        let a = Butterfly3::transform([x[0], x[3], x[6]]);
        let b = Butterfly3::transform([x[1], x[4], x[7]]);
        let c = Butterfly3::transform([x[2], x[5], x[8]]);
        let first = Butterfly3::transform([a[0], b[0], c[0]]);
        let second = Butterfly3::transform([a[1], b[1].rotated(1.0 / 9.0), c[1].rotated(2.0 / 9.0)]);
        let third = Butterfly3::transform([a[2], b[2].rotated(2.0 / 9.0), c[2].rotated(4.0 / 9.0)]);
        [first[0], second[0], third[0], first[1], second[1], third[1], first[2], second[2], third[2]]
    }
}

impl Butterfly<6> for Butterfly6 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; 6]) -> [ComplexLanes<T, S>; 6] {
        let a = Butterfly3::transform([x[0], x[2], x[4]]);
        let b = Butterfly3::transform([x[3], x[5], x[1]]);
        let y0 = Butterfly2::transform([a[0], b[0]]);
        let y1 = Butterfly2::transform([a[1], b[1]]);
        let y2 = Butterfly2::transform([a[2], b[2]]);
        [y0[0], y1[1], y2[0], y0[1], y1[0], y2[1]]
    }
}

impl Butterfly<10> for Butterfly10 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; 10]) -> [ComplexLanes<T, S>; 10] {
        let a = Butterfly5::transform([x[0], x[2], x[4], x[6], x[8]]);
        let b = Butterfly5::transform([x[5], x[7], x[9], x[1], x[3]]);
        let y0 = Butterfly2::transform([a[0], b[0]]);
        let y1 = Butterfly2::transform([a[1], b[1]]);
        let y2 = Butterfly2::transform([a[2], b[2]]);
        let y3 = Butterfly2::transform([a[3], b[3]]);
        let y4 = Butterfly2::transform([a[4], b[4]]);
        [y0[0], y1[1], y2[0], y3[1], y4[0], y0[1], y1[0], y2[1], y3[0], y4[1]]
    }
}

impl Butterfly<12> for Butterfly12 {
    #[inline(always)]
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; 12]) -> [ComplexLanes<T, S>; 12] {
        let a = Butterfly4::transform([x[0], x[3], x[6], x[9]]);
        let b = Butterfly4::transform([x[4], x[7], x[10], x[1]]);
        let c = Butterfly4::transform([x[8], x[11], x[2], x[5]]);
        let y0 = Butterfly3::transform([a[0], b[0], c[0]]);
        let y1 = Butterfly3::transform([a[1], b[1], c[1]]);
        let y2 = Butterfly3::transform([a[2], b[2], c[2]]);
        let y3 = Butterfly3::transform([a[3], b[3], c[3]]);
        [y0[0], y1[1], y2[2], y3[0], y0[1], y1[2], y2[0], y3[1], y0[2], y1[0], y2[1], y3[2]]
    }
}

/// Writes out the steps of a stage for each number of the butterfly.
macro_rules! stage {
    ($name:ident, $size:literal: $($k:literal)*) => {
        impl StageOf<$size> for $name {
            #[inline(always)]
            fn gather<T: Number, S: Simd>(
                simd: S,
                [re, im]: [&[T::Vector<S>]; 2],
                first: usize,
                step: usize,
            ) -> [ComplexLanes<T, S>; $size] {
                [$(ComplexLanes::new(simd, re[first + $k * step], im[first + $k * step])),*]
            }

            #[inline(always)]
            fn scatter<T: Number, S: Simd>(
                simd: S,
                y: [ComplexLanes<T, S>; $size],
                twiddles: Option<&[Complex<T>]>,
                [re, im]: [&mut [T::Vector<S>]; 2],
                first: usize,
                step: usize,
            ) {
                $(
                    let value = match twiddles {
                        Some(twiddles) if $k > 0 => y[$k] * ComplexLanes::splat(simd, twiddles[$k]),
                        _ => y[$k],
                    };
                    (re[first + $k * step], im[first + $k * step]) = (value.re.vector, value.im.vector);
                )*
            }

            #[inline(always)]
            fn scatter_times<T: Number, S: Simd>(
                simd: S,
                y: [ComplexLanes<T, S>; $size],
                factors: Factors<'_, T>,
                [re, im]: [&mut [T::Vector<S>]; 2],
                first: usize,
                step: usize,
            ) {
                $(
                    let value = y[$k] * factors.factor(simd, first + $k * step);
                    (re[first + $k * step], im[first + $k * step]) = (value.re.vector, value.im.vector);
                )*
            }
        }
    };
}

stage!(Butterfly2, 2: 0 1);
stage!(Butterfly3, 3: 0 1 2);
stage!(Butterfly4, 4: 0 1 2 3);
stage!(Butterfly5, 5: 0 1 2 3 4);
stage!(Butterfly6, 6: 0 1 2 3 4 5);
stage!(Butterfly8, 8: 0 1 2 3 4 5 6 7);
stage!(Butterfly9, 9: 0 1 2 3 4 5 6 7 8);
stage!(Butterfly10, 10: 0 1 2 3 4 5 6 7 8 9);
stage!(Butterfly12, 12: 0 1 2 3 4 5 6 7 8 9 10 11);
