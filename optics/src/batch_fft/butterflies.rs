//! Discrete Fourier transforms of small fixed sizes, written out.
//!
//! ```text
//! X_k = Σ_n x_n e^{−i2πnk/R}
//! ```
//!
//! Sizes with coprime factors use the algorithm of I. J. Good (J. R. Stat. Soc. B 20, 361 (1958)), which needs no
//! twiddle factors. Other composite sizes use that of J. Cooley and J. Tukey (Math. Comput. 19, 297 (1965)).

use super::lanes::ComplexLanes;
use crate::real::Number;
use pulp::Simd;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};

/// A transform of `R` numbers. It is a type because a function passed as an argument would not be inlined.
pub(super) trait Butterfly<const R: usize> {
    fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; R]) -> [ComplexLanes<T, S>; R];
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

/// Implements the transform of a size a·b with coprime factors a and b. Inputs are indexed by n = b·n₁ + a·n₂, outputs
/// by k ≡ k₁ (mod a) and k ≡ k₂ (mod b), that is k = e₁k₁ + e₂k₂ (mod a·b).
macro_rules! coprime {
    ($name:ident, $size:literal = $a:literal ($of_a:ident, $e1:literal) * $b:literal ($of_b:ident, $e2:literal)) => {
        impl Butterfly<$size> for $name {
            #[inline(always)]
            fn transform<T: Number, S: Simd>(x: [ComplexLanes<T, S>; $size]) -> [ComplexLanes<T, S>; $size] {
                let mut rows = [[x[0]; $b]; $a];
                for (n1, row) in rows.iter_mut().enumerate() {
                    let mut along = [x[0]; $b];
                    for (n2, value) in along.iter_mut().enumerate() {
                        *value = x[($b * n1 + $a * n2) % $size];
                    }
                    *row = $of_b::transform(along);
                }
                let mut y = x;
                for k2 in 0..$b {
                    let mut along = [x[0]; $a];
                    for (value, row) in along.iter_mut().zip(&rows) {
                        *value = row[k2];
                    }
                    for (k1, value) in $of_a::transform(along).into_iter().enumerate() {
                        y[($e1 * k1 + $e2 * k2) % $size] = value;
                    }
                }
                y
            }
        }
    };
}

coprime!(Butterfly6, 6 = 2(Butterfly2, 3) * 3(Butterfly3, 4));
coprime!(Butterfly10, 10 = 2(Butterfly2, 5) * 5(Butterfly5, 6));
coprime!(Butterfly12, 12 = 3(Butterfly3, 4) * 4(Butterfly4, 9));
