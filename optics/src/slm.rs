//! Model of the SLM: computes the field that leaves it, and the gradient of the phase.
//!
//! ```text
//! c(x, y) = k(x, y) · a(x, y) · ( e^{i r(φ)} + z₀ ),   r(φ) = φ + Σ_k ( a_k sin kφ + b_k cos kφ )
//! ```
//!
//! φ is the displayed phase \[rad\], a the complex source profile, r the SLM's phase response, and z₀ undiffracted
//! light. With a carrier φ includes its grating, and k = ±1 is the grating's sign, so that c is the field relative to
//! the direction in which the image leaves.

use crate::carrier::Carrier;
use crate::real::Number;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use std::f64::consts::PI;

/// Parameters of an SLM, in the precision `T` of an engine.
#[derive(Clone, Debug)]
pub(crate) struct Slm<T> {
    pub(crate) width_px: usize,
    /// Complex source profile a at each pixel; `None`: 1 everywhere.
    pub(crate) source: Option<Vec<Complex<T>>>,
    /// Harmonics [a_k, b_k] of the phase response for k = 1, 2, …
    pub(crate) harmonics: Vec<[T; 2]>,
    pub(crate) zero_order: Complex<T>,
    pub(crate) carrier: Option<Carrier>,
}

impl<T: Number> Slm<T> {
    /// SLM without errors, which shows exactly the displayed phase.
    pub(crate) fn ideal(width_px: usize, carrier: Option<Carrier>) -> Self {
        let zero_order = Complex::new(T::zero(), T::zero());
        Self { width_px, source: None, harmonics: Vec::new(), zero_order, carrier }
    }

    /// Computes the field c along row `y`, for the phase before the carrier is added.
    pub(crate) fn field_row(&self, y: usize, phase: &[T], field: &mut [Complex<T>]) {
        Arch::new().dispatch(FieldRow { slm: self, y, phase, field });
    }

    /// Computes the gradient ∂L/∂φ = 2 Re( b* · dc/dφ ) along row `y` from b = ∂L/∂c*.
    pub(crate) fn phase_gradient_row(&self, y: usize, phase: &[T], b: &[Complex<T>], gradient: &mut [T]) {
        Arch::new().dispatch(PhaseGradientRow::<_, false> { slm: self, y, phase, b, gradient });
    }

    /// Adds the gradient of [`Self::phase_gradient_row`] to `gradient`.
    pub(crate) fn add_phase_gradient_row(&self, y: usize, phase: &[T], b: &[Complex<T>], gradient: &mut [T]) {
        Arch::new().dispatch(PhaseGradientRow::<_, true> { slm: self, y, phase, b, gradient });
    }

    #[inline(always)]
    fn write_field_row(&self, y: usize, phase: &[T], field: &mut [Complex<T>]) {
        for (i, (phase, field)) in phase.chunks(BLOCK).zip(field.chunks_mut(BLOCK)).enumerate() {
            let block = self.respond(y, i * BLOCK, phase);
            for (x, c) in field.iter_mut().enumerate() {
                let (re, im) = (block.modulated.re[x] + self.zero_order.re, block.modulated.im[x] + self.zero_order.im);
                *c = Complex::new(re * block.sign[x], im * block.sign[x]);
            }
        }
        if let Some(source) = &self.source {
            for (c, &a) in field.iter_mut().zip(&source[y * self.width_px..]) {
                *c = *c * a;
            }
        }
    }

    #[inline(always)]
    fn write_phase_gradient_row<const ADD: bool>(&self, y: usize, phase: &[T], b: &[Complex<T>], gradient: &mut [T]) {
        let blocks = phase.chunks(BLOCK).zip(b.chunks(BLOCK)).zip(gradient.chunks_mut(BLOCK));
        for (i, ((phase, b), gradient)) in blocks.enumerate() {
            let BlockResponse { slope, sign, modulated, .. } = self.respond(y, i * BLOCK, phase);
            let light = self.source_times_conj(y, i * BLOCK, b);
            for (x, gradient) in gradient.iter_mut().enumerate() {
                let imaginary = light.re[x] * modulated.im[x] + light.im[x] * modulated.re[x];
                let value = -T::of(2.0) * sign[x] * slope[x] * imaginary;
                *gradient = if ADD { *gradient + value } else { value };
            }
        }
    }

    /// Computes b* · a for a block of pixels; zero beyond the row's end.
    #[inline(always)]
    pub(crate) fn source_times_conj(&self, y: usize, x: usize, b: &[Complex<T>]) -> Parts<T> {
        let mut light = Parts { re: [T::zero(); BLOCK], im: [T::zero(); BLOCK] };
        match &self.source {
            None => {
                for (i, b) in b.iter().enumerate() {
                    (light.re[i], light.im[i]) = (b.re, -b.im);
                }
            }
            Some(source) => {
                for (i, (b, a)) in b.iter().zip(&source[y * self.width_px + x..]).enumerate() {
                    (light.re[i], light.im[i]) = (b.re * a.re + b.im * a.im, b.re * a.im - b.im * a.re);
                }
            }
        }
        light
    }

    /// Computes the response of the SLM to at most [`BLOCK`] phases, the first at (y, x).
    #[inline(always)]
    pub(crate) fn respond(&self, y: usize, x: usize, phase: &[T]) -> BlockResponse<T> {
        let (zero, one) = ([T::zero(); BLOCK], [T::one(); BLOCK]);
        let mut displayed = zero;
        displayed[..phase.len()].copy_from_slice(phase);
        let mut sign = one;
        if let Some(carrier) = self.carrier {
            for (i, (displayed, sign)) in displayed.iter_mut().zip(&mut sign).enumerate() {
                if carrier.is_odd(y, x + i) {
                    (*displayed, *sign) = (*displayed + T::of(PI), -T::one());
                }
            }
        }
        let turn = Parts::unit(&displayed);
        if self.harmonics.is_empty() {
            return BlockResponse { sign, slope: one, turn, modulated: turn };
        }
        let (mut response, mut slope, mut power) = (displayed, one, turn);
        for (k, &[a, b]) in self.harmonics.iter().enumerate() {
            let (order, times) = (T::of((k + 1) as f64), power);
            for (i, (response, slope)) in response.iter_mut().zip(&mut slope).enumerate() {
                *response = *response + a * times.im[i] + b * times.re[i];
                *slope = *slope + order * (a * times.re[i] - b * times.im[i]);
            }
            power = times.multiplied(&turn);
        }
        BlockResponse { sign, slope, turn, modulated: Parts::unit(&response) }
    }
}

/// Number of neighbouring pixels that are processed together. Each operation is a loop over plain arrays, which becomes
/// vector instructions.
pub(crate) const BLOCK: usize = 32;

/// Real and imaginary parts of the values of neighbouring pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts<T> {
    pub(crate) re: [T; BLOCK],
    pub(crate) im: [T; BLOCK],
}

/// Response of the SLM to the phases of neighbouring pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BlockResponse<T> {
    /// Sign k of the grating: −1 where the carrier adds π, otherwise 1.
    pub(crate) sign: [T; BLOCK],
    /// Slope r′(φ) of the phase response.
    pub(crate) slope: [T; BLOCK],
    /// Phasor e^{iφ} of the displayed phase.
    pub(crate) turn: Parts<T>,
    /// Phasor e^{i r(φ)} of the phase after the response.
    pub(crate) modulated: Parts<T>,
}

impl<T: Number> Parts<T> {
    /// Computes e^{iφ}.
    #[inline(always)]
    fn unit(phase: &[T; BLOCK]) -> Self {
        let mut parts = Self { re: [T::zero(); BLOCK], im: [T::zero(); BLOCK] };
        for ((re, im), phase) in parts.re.iter_mut().zip(&mut parts.im).zip(phase) {
            (*im, *re) = phase.sine_cosine();
        }
        parts
    }

    #[inline(always)]
    pub(crate) fn multiplied(&self, by: &Self) -> Self {
        let mut product = *self;
        for i in 0..BLOCK {
            product.re[i] = self.re[i] * by.re[i] - self.im[i] * by.im[i];
            product.im[i] = self.re[i] * by.im[i] + self.im[i] * by.re[i];
        }
        product
    }
}

/// [`Slm::field_row`] as an operation that is compiled for the vector instructions of the machine. A closure of this
/// size might be called instead of inlined. It would then be compiled for the oldest supported machine.
struct FieldRow<'a, T> {
    slm: &'a Slm<T>,
    y: usize,
    phase: &'a [T],
    field: &'a mut [Complex<T>],
}

impl<T: Number> WithSimd for FieldRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_field_row(self.y, self.phase, self.field);
    }
}

/// [`Slm::phase_gradient_row`] as an operation that is compiled for the vector instructions of the machine.
struct PhaseGradientRow<'a, T, const ADD: bool> {
    slm: &'a Slm<T>,
    y: usize,
    phase: &'a [T],
    b: &'a [Complex<T>],
    gradient: &'a mut [T],
}

impl<T: Number, const ADD: bool> WithSimd for PhaseGradientRow<'_, T, ADD> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_phase_gradient_row::<ADD>(self.y, self.phase, self.b, self.gradient);
    }
}
