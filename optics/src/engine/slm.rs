//! Model of the SLM: computes the field that leaves it, and the gradient of the phase.
//!
//! ```text
//! c(x, y) = k(x, y) · a(x, y) · ( e^{i r(ψ)} + z₀ ),   r(ψ) = (1 + v(x, y)) ψ + Σ_k ( a_k sin kψ + b_k cos kψ )
//! ```
//!
//! ψ is the [shown](Shown) phase \[rad\], a the complex source profile with its [dust](crate::Dust), r the SLM's phase
//! response, which may [vary](crate::ResponseVariation) by v, and z₀ undiffracted light. With a carrier ψ includes its
//! grating, and k = ±1 is the grating's sign, so that c is the field relative to the direction in which the image
//! leaves. Without [cross-talk](crate::Crosstalk) and variation, ψ is the displayed phase φ.

use crate::display::parts::crosstalk::Blur;
use crate::display::{Carrier, Crosstalk};
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::gaussian_blur::Rows;
use crate::numerics::real::Number;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

/// Parameters of an SLM, in the precision `T` of an engine.
#[derive(Clone, Debug)]
pub struct Slm<T> {
    pub(crate) width_px: usize,
    /// Complex source profile a with dust at each pixel; `None`: 1 everywhere.
    pub(crate) source: Option<Vec<Complex<T>>>,
    /// Harmonics [a_k, b_k] of the phase response for k = 1, 2, …
    pub(crate) harmonics: Vec<[T; 2]>,
    pub(crate) zero_order: Complex<T>,
    pub(crate) carrier: Option<Carrier>,
    /// Cross-talk between neighbouring pixels; `None`: none.
    pub(crate) crosstalk: Option<Crosstalk>,
    /// 1 + v at each pixel; `None`: 1 everywhere.
    pub(crate) phase_gain: Option<Vec<T>>,
}

/// The phases ψ that the liquid crystal of an SLM shows, for a whole frame: the displayed phases themselves, or wrapped
/// and blurred ones.
#[derive(Clone, Debug)]
pub(crate) struct Shown<'a, T: Clone> {
    phase: Cow<'a, [T]>,
    width_px: usize,
}

impl<T: Number> Shown<'_, T> {
    /// Row `y`.
    pub(crate) fn row(&self, y: usize) -> ShownRow<'_, T> {
        ShownRow(&self.phase[y * self.width_px..][..self.width_px])
    }
}

impl<T: Number> Shown<'_, T> {
    /// The same phases, without a borrow.
    pub(crate) fn into_owned(self) -> Shown<'static, T> {
        Shown { phase: Cow::Owned(self.phase.into_owned()), width_px: self.width_px }
    }
}

/// Shown phases of a row or a part of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShownRow<'a, T>(&'a [T]);

impl<'a, T> ShownRow<'a, T> {
    /// Parts of at most [`BLOCK`] pixels.
    pub(crate) fn blocks(self) -> impl Iterator<Item = ShownRow<'a, T>> {
        self.0.chunks(BLOCK).map(ShownRow)
    }

    /// The shown phases \[rad\].
    pub(crate) fn phases(self) -> &'a [T] {
        self.0
    }
}

impl<T: Number> Slm<T> {
    /// SLM without errors, which shows exactly the displayed phase.
    pub(crate) fn ideal(width_px: usize, carrier: Option<Carrier>) -> Self {
        let zero_order = Complex::new(T::zero(), T::zero());
        Self { width_px, source: None, harmonics: Vec::new(), zero_order, carrier, crosstalk: None, phase_gain: None }
    }

    /// Whether the shown phases differ from the displayed ones: they are wrapped with the grating before they blur or
    /// before their gain varies.
    pub(crate) fn wraps(&self) -> bool {
        self.crosstalk.is_some() || self.phase_gain.is_some()
    }

    /// The phases that the SLM shows for a frame's phases before the carrier is added.
    pub(crate) fn shown<'a>(&self, phase: &'a [T]) -> Shown<'a, T> {
        let width_px = self.width_px;
        let phase = match (&self.crosstalk, self.wraps()) {
            (Some(crosstalk), _) => Cow::Owned(self.blurred(&Blur::new(crosstalk.ratios()), phase)),
            (None, true) => {
                let mut wrapped = phase.to_vec();
                wrapped.par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
                    interrupt::check();
                    self.wrap_row(y, &phase[y * width_px..][..width_px], row);
                });
                Cow::Owned(wrapped)
            }
            (None, false) => Cow::Borrowed(phase),
        };
        Shown { phase, width_px }
    }

    /// The derivatives of the shown phases by q of the cross-talk along x and along y.
    pub(crate) fn shown_slopes(&self, phase: &[T]) -> Option<[Vec<T>; 2]> {
        let crosstalk = self.crosstalk.as_ref()?;
        Some(Blur::slopes(crosstalk.ratios()).map(|blur| self.blurred(&blur, phase)))
    }

    fn blurred(&self, blur: &Blur<T>, phase: &[T]) -> Vec<T> {
        let width_px = self.width_px;
        let fill = |y: usize, _, row: &mut [T]| self.wrap_row(y, &phase[y * width_px..][..width_px], row);
        let mut blurred = zeros(phase.len());
        blur.blur(Rows { width_px, planes: 1 }, fill, &mut blurred);
        blurred
    }

    /// A row as it is displayed; `None` if the shown phases differ from the displayed ones.
    pub(crate) fn displayed_row<'a>(&self, phase: &'a [T]) -> Option<ShownRow<'a, T>> {
        (!self.wraps()).then_some(ShownRow(phase))
    }

    /// Adds the carrier's grating to row `y` and wraps the phases to [0, 2π).
    pub(crate) fn wrap_row(&self, y: usize, phase: &[T], wrapped: &mut [T]) {
        let gratings = match self.carrier {
            None => [T::zero(); 2],
            Some(carrier) => [0, 1].map(|x| if carrier.is_odd(y, x) { T::of(PI) } else { T::zero() }),
        };
        Arch::new().dispatch(|| wrap(gratings, phase, wrapped));
    }

    /// Computes ∂L/∂φ from ∂L/∂ψ, the gradient by the shown phases, and adds it to `gradient` or overwrites it.
    pub(crate) fn gradient_of_displayed(&self, by_shown: &[T], add: bool, gradient: &mut [T]) {
        let blur = Blur::new(self.crosstalk.unwrap_or_default().ratios());
        blur.spread(Rows { width_px: self.width_px, planes: 1 }, by_shown, add, gradient);
    }

    /// Computes the field c along row `y`.
    pub(crate) fn field_row(&self, y: usize, shown: ShownRow<'_, T>, field: &mut [Complex<T>]) {
        Arch::new().dispatch(FieldRow { slm: self, y, shown, field });
    }

    /// Computes the gradient ∂L/∂ψ = 2 Re( b* · dc/dψ ) along row `y` from b = ∂L/∂c*. With cross-talk,
    /// [`Self::gradient_of_displayed`] computes ∂L/∂φ from it.
    pub(crate) fn phase_gradient_row(&self, y: usize, shown: ShownRow<'_, T>, b: &[Complex<T>], gradient: &mut [T]) {
        Arch::new().dispatch(PhaseGradientRow::<_, false> { slm: self, y, shown, b, gradient });
    }

    /// Adds the gradient of [`Self::phase_gradient_row`] to `gradient`.
    pub(crate) fn add_phase_gradient_row(
        &self,
        y: usize,
        shown: ShownRow<'_, T>,
        b: &[Complex<T>],
        gradient: &mut [T],
    ) {
        Arch::new().dispatch(PhaseGradientRow::<_, true> { slm: self, y, shown, b, gradient });
    }

    #[inline(always)]
    fn write_field_row(&self, y: usize, shown: ShownRow<'_, T>, field: &mut [Complex<T>]) {
        for (i, (shown, field)) in shown.blocks().zip(field.chunks_mut(BLOCK)).enumerate() {
            let block = self.respond(y, i * BLOCK, shown);
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
    fn write_phase_gradient_row<const ADD: bool>(
        &self,
        y: usize,
        shown: ShownRow<'_, T>,
        b: &[Complex<T>],
        gradient: &mut [T],
    ) {
        let blocks = shown.blocks().zip(b.chunks(BLOCK)).zip(gradient.chunks_mut(BLOCK));
        for (i, ((shown, b), gradient)) in blocks.enumerate() {
            let BlockResponse { slope, sign, modulated, .. } = self.respond(y, i * BLOCK, shown);
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

    /// Computes the response of the SLM to at most [`BLOCK`] shown phases, the first at (y, x).
    #[inline(always)]
    pub(crate) fn respond(&self, y: usize, x: usize, shown: ShownRow<'_, T>) -> BlockResponse<T> {
        let (zero, one) = ([T::zero(); BLOCK], [T::one(); BLOCK]);
        let phase = shown.0;
        let mut displayed = zero;
        displayed[..phase.len()].copy_from_slice(phase);
        let mut sign = one;
        if let Some(carrier) = self.carrier {
            // Phases that were wrapped contain the grating.
            let grating = if self.wraps() { T::zero() } else { T::of(PI) };
            for (i, (displayed, sign)) in displayed.iter_mut().zip(&mut sign).enumerate() {
                if carrier.is_odd(y, x + i) {
                    (*displayed, *sign) = (*displayed + grating, -T::one());
                }
            }
        }
        let turn = Parts::unit(&displayed);
        if self.harmonics.is_empty() && self.phase_gain.is_none() {
            return BlockResponse { sign, slope: one, turn, modulated: turn };
        }
        let (mut response, mut slope, mut power) = (displayed, one, turn);
        if let Some(gain) = &self.phase_gain {
            let gain = &gain[y * self.width_px + x..][..phase.len()];
            for ((response, slope), &gain) in response.iter_mut().zip(&mut slope).zip(gain) {
                (*response, *slope) = (*response * gain, gain);
            }
        }
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

/// Adds the gratings of even and odd columns to a row of phases, and wraps them to [0, 2π).
#[inline(always)]
fn wrap<T: Number>(gratings: [T; 2], phase: &[T], wrapped: &mut [T]) {
    let turn = T::of(TAU);
    for (x, (out, &phase)) in wrapped.iter_mut().zip(phase).enumerate() {
        let phase = phase + gratings[x % 2];
        *out = phase - turn * (phase / turn).floor();
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
    shown: ShownRow<'a, T>,
    field: &'a mut [Complex<T>],
}

impl<T: Number> WithSimd for FieldRow<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_field_row(self.y, self.shown, self.field);
    }
}

/// [`Slm::phase_gradient_row`] as an operation that is compiled for the vector instructions of the machine.
struct PhaseGradientRow<'a, T, const ADD: bool> {
    slm: &'a Slm<T>,
    y: usize,
    shown: ShownRow<'a, T>,
    b: &'a [Complex<T>],
    gradient: &'a mut [T],
}

impl<T: Number, const ADD: bool> WithSimd for PhaseGradientRow<'_, T, ADD> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.slm.write_phase_gradient_row::<ADD>(self.y, self.shown, self.b, self.gradient);
    }
}
