//! The light that leaves the SLM.
//!
//! ```text
//! c(x, y) = k(x, y) · a(x, y) · ( e^{i r(φ)} + z₀ ),   r(φ) = φ + Σ_k ( a_k sin kφ + b_k cos kφ )
//! ```
//!
//! φ displayed phase \[rad\], a source profile (complex), r the SLM's phase response, z₀ undiffracted light. With a carrier
//! φ includes its grating, and k = ±1 follows it, so that c is described in the direction in which the image leaves.

use crate::carrier::Carrier;
use crate::real::{Real, unit};
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;

/// What an SLM does, in the precision of an engine.
#[derive(Clone, Debug)]
pub(crate) struct Slm<T> {
    pub(crate) width_px: usize,
    /// `None`: one everywhere.
    pub(crate) source: Option<Vec<Complex<T>>>,
    /// [a_k, b_k] for k = 1, 2, …
    pub(crate) harmonics: Vec<[T; 2]>,
    pub(crate) zero_order: Complex<T>,
    pub(crate) carrier: Option<Carrier>,
}

impl<T: Real> Slm<T> {
    /// An SLM that does just what it is told.
    pub(crate) fn ideal(width_px: usize, carrier: Option<Carrier>) -> Self {
        let zero_order = Complex::new(T::zero(), T::zero());
        Self { width_px, source: None, harmonics: Vec::new(), zero_order, carrier }
    }

    /// c along row `y`, for the phase before the carrier is added.
    pub(crate) fn field_row(&self, y: usize, phase: &[T], field: &mut [Complex<T>]) {
        Arch::new().dispatch(FieldRow { slm: self, y, phase, field });
    }

    /// ∂L/∂φ along row `y` from b = ∂L/∂c*: 2 Re( b* · dc/dφ ).
    pub(crate) fn phase_gradient_row(&self, y: usize, phase: &[T], b: &[Complex<T>], gradient: &mut [T]) {
        Arch::new().dispatch(PhaseGradientRow { slm: self, y, phase, b, gradient });
    }

    #[inline(always)]
    fn write_field_row(&self, y: usize, phase: &[T], field: &mut [Complex<T>]) {
        for (x, (c, &phase)) in field.iter_mut().zip(phase).enumerate() {
            let (_, steered) = self.response(self.displayed(y, x, phase));
            *c = (steered + self.zero_order).scale(self.sign(y, x));
        }
        if let Some(source) = &self.source {
            for (c, &a) in field.iter_mut().zip(&source[y * self.width_px..]) {
                *c = *c * a;
            }
        }
    }

    #[inline(always)]
    fn write_phase_gradient_row(&self, y: usize, phase: &[T], b: &[Complex<T>], gradient: &mut [T]) {
        let two = T::of(2.0);
        match &self.source {
            None => {
                for (x, ((gradient, &phase), &b)) in gradient.iter_mut().zip(phase).zip(b).enumerate() {
                    let (slope, steered) = self.response(self.displayed(y, x, phase));
                    *gradient = -two * self.sign(y, x) * slope * (b.conj() * steered).im;
                }
            }
            Some(source) => {
                let row = &source[y * self.width_px..];
                for (x, (((gradient, &phase), &b), &a)) in gradient.iter_mut().zip(phase).zip(b).zip(row).enumerate() {
                    let (slope, steered) = self.response(self.displayed(y, x, phase));
                    *gradient = -two * self.sign(y, x) * slope * (b.conj() * steered * a).im;
                }
            }
        }
    }

    /// r′(φ) and e^{i r(φ)}.
    #[inline(always)]
    pub(crate) fn response(&self, phase: T) -> (T, Complex<T>) {
        let turn = unit(phase);
        if self.harmonics.is_empty() {
            return (T::one(), turn);
        }
        let (mut response, mut slope, mut power) = (phase, T::one(), turn);
        for (k, &[a, b]) in self.harmonics.iter().enumerate() {
            response = response + a * power.im + b * power.re;
            slope = slope + T::of((k + 1) as f64) * (a * power.re - b * power.im);
            power = power * turn;
        }
        (slope, unit(response))
    }

    /// The phase with the carrier's grating.
    #[inline(always)]
    pub(crate) fn displayed(&self, y: usize, x: usize, phase: T) -> T {
        match self.carrier {
            Some(carrier) if carrier.is_odd(y, x) => phase + T::of(PI),
            _ => phase,
        }
    }

    /// k at a pixel: −1 where the carrier adds π.
    #[inline(always)]
    pub(crate) fn sign(&self, y: usize, x: usize) -> T {
        match self.carrier {
            Some(carrier) if carrier.is_odd(y, x) => -T::one(),
            _ => T::one(),
        }
    }
}

/// [`Slm::field_row`] as an operation that is compiled for the vector instructions of the machine at hand. A closure of
/// this size may be called instead of inlined, and is then compiled for the oldest machine.
struct FieldRow<'a, T> {
    slm: &'a Slm<T>,
    y: usize,
    phase: &'a [T],
    field: &'a mut [Complex<T>],
}

impl<T: Real> WithSimd for FieldRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_field_row(self.y, self.phase, self.field);
    }
}

/// [`Slm::phase_gradient_row`], likewise.
struct PhaseGradientRow<'a, T> {
    slm: &'a Slm<T>,
    y: usize,
    phase: &'a [T],
    b: &'a [Complex<T>],
    gradient: &'a mut [T],
}

impl<T: Real> WithSimd for PhaseGradientRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_phase_gradient_row(self.y, self.phase, self.b, self.gradient);
    }
}
