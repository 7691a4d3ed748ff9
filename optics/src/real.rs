//! The two precisions of the engine: f32 for work, f64 for reference.

use num_complex::Complex;
use rustfft::{FftNum, num_traits::Float};

/// f32 or f64.
pub trait Real: FftNum + Float {
    /// The nearest number of this precision.
    fn of(value: f64) -> Self;

    /// The same number in f64.
    fn wide(self) -> f64;

    /// Sine and cosine.
    ///
    /// For f32 the error is at most 2e-7 where |x| ≤ 1e4; larger arguments lose accuracy in proportion. The code has
    /// no branches, so that a loop over it becomes vector instructions.
    fn sine_cosine(self) -> (Self, Self);

    /// e^x. For f32 the relative error is at most 2e-7; arguments are clamped to ±80. Without branches, as above.
    fn exponential(self) -> Self;
}

impl Real for f64 {
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

impl Real for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn wide(self) -> f64 {
        f64::from(self)
    }

    // Reduction to [−π/4, π/4] by a three-part π/2, then the Taylor-like minimax polynomials.
    #[inline(always)]
    fn sine_cosine(self) -> (Self, Self) {
        const HALF_PI: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];
        let quarter_turns = (self * std::f32::consts::FRAC_2_PI).round_ties_even();
        let x = self - quarter_turns * HALF_PI[0] - quarter_turns * HALF_PI[1] - quarter_turns * HALF_PI[2];
        let x2 = x * x;
        let sine = x + x * x2 * (-1.666_665_5e-1 + x2 * (8.332_161e-3 + x2 * -1.951_529_6e-4));
        let cosine = 1.0 - 0.5 * x2 + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + x2 * 2.443_315_7e-5));
        let quadrant = quarter_turns as i32;
        let swap = quadrant & 1 != 0;
        let (s, c) = if swap { (cosine, sine) } else { (sine, cosine) };
        let s = if quadrant & 2 != 0 { -s } else { s };
        let c = if (quadrant + 1) & 2 != 0 { -c } else { c };
        (s, c)
    }

    // e^x = 2^n · e^r with |r| ≤ ln 2 / 2, and a Taylor series for e^r.
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

/// e^{ix}.
#[inline(always)]
pub(crate) fn unit<T: Real>(x: T) -> Complex<T> {
    let (sine, cosine) = x.sine_cosine();
    Complex::new(cosine, sine)
}

/// e^{ix}, rounded once from f64.
pub(crate) fn unit_of<T: Real>(x: f64) -> Complex<T> {
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
