//! The gradient of a pair's loss by the parameters of the SLM.

use super::adjoint::ModulatorAdjoint;
use super::columns::project;
use super::fit::{Fit, variation_degrees};
use super::pair::Example;
use crate::display::parts::Block;
use crate::display::parts::layout::FINE_SOURCE_ORDER;
use crate::display::parts::phase_response::HARMONICS;
use crate::display::parts::response_variation::RESPONSE_VARIATION_ORDER;
use crate::engine::Real;
use crate::engine::slm::{BLOCK, BlockResponse, ShownRow, Slm};
use crate::numerics::chebyshev::{polynomials, position};
use num_complex::{Complex, Complex64};
use pulp::Arch;

/// Contribution of one row to the gradient of the SLM's parameters.
#[derive(Clone, Copy, Debug)]
struct RowSums {
    /// Σ b* · c · T_i(x)
    source: [Complex64; FINE_SOURCE_ORDER + 1],
    /// Im Σ b* · a e^{ir} · (sin kφ, cos kφ)
    response: [[f64; 2]; HARMONICS],
    /// Σ b* · a
    zero_order: Complex64,
    /// Σ ∂L/∂ψ · ∂ψ/∂q along x and along y
    crosstalk: [f64; 2],
    /// Im Σ b* · a e^{ir} · ψ · T_i(x), as the real part
    variation: [Complex64; RESPONSE_VARIATION_ORDER + 1],
}

const NO_SUMS: RowSums = RowSums {
    source: [Complex64::ZERO; FINE_SOURCE_ORDER + 1],
    response: [[0.0; 2]; HARMONICS],
    zero_order: Complex64::ZERO,
    crosstalk: [0.0; 2],
    variation: [Complex64::ZERO; RESPONSE_VARIATION_ORDER + 1],
};

impl<T: Real> Fit<T> {
    /// The gradient by all numbers of the SLM, from the half-transformed gradient that was propagated back.
    pub(super) fn slm_gradient(&self, example: &Example<T>) -> ModulatorAdjoint {
        let (height_px, convolver, kernels) = (self.engine.height_px(), &self.engine.convolver, &self.engine.kernels);
        let (arch, mut rows) = (Arch::new(), vec![NO_SUMS; height_px]);
        let tiles = &self.out.tiles[..kernels.half_spectrum_len(convolver)];
        let (slm, layout) = (&self.engine.slm, &self.layout);
        let (shown, slopes) = (slm.shown(example.phase.values()), slm.shown_slopes(example.phase.values()));
        convolver.inverse_rows(tiles, &kernels.along_x, &mut rows, |y, b, out| {
            out[0] = arch.dispatch(|| row_sums(slm, y, shown.row(y), b, &self.polynomials_x[..=layout.source.order()]));
            if layout.blocks.contains(Block::UnevenResponse) {
                let polynomials_x = &self.polynomials_x[..=RESPONSE_VARIATION_ORDER];
                out[0].variation = arch.dispatch(|| variation_sums(slm, y, shown.row(y), b, polynomials_x));
            }
            if let Some(slopes) = &slopes {
                let mut by_shown = vec![T::zero(); b.len()];
                slm.phase_gradient_row(y, shown.row(y), b, &mut by_shown);
                let row = |slopes: &[T]| product(&by_shown, &slopes[y * b.len()..][..b.len()]);
                out[0].crosstalk = [row(&slopes[0]), row(&slopes[1])];
            }
        });

        let order = layout.source.order();
        let mut source = vec![[Complex64::ZERO; FINE_SOURCE_ORDER + 1]; order + 1];
        let (mut response, mut zero_order) = ([[0.0; 2]; HARMONICS], Complex64::ZERO);
        let mut crosstalk = [0.0; 2];
        let mut variation = [[0.0; RESPONSE_VARIATION_ORDER + 1]; RESPONSE_VARIATION_ORDER + 1];
        for (y, row) in rows.iter().enumerate() {
            let at_y = polynomials(order, position(y, height_px));
            for (source, t) in source.iter_mut().zip(&at_y) {
                source.iter_mut().zip(&row.source).for_each(|(sum, value)| *sum += value * t);
            }
            for (variation, t) in variation.iter_mut().zip(&at_y) {
                variation.iter_mut().zip(&row.variation).for_each(|(sum, value)| *sum += value.re * t);
            }
            let flat = response.as_flattened_mut().iter_mut().zip(row.response.as_flattened());
            flat.for_each(|(sum, value)| *sum += value);
            zero_order += row.zero_order;
            crosstalk.iter_mut().zip(row.crosstalk).for_each(|(sum, value)| *sum += value);
        }
        let of_source = |(i, j): (usize, usize)| (2.0 * source[j][i].re, -2.0 * source[j][i].im);
        ModulatorAdjoint {
            source: layout.source.degrees().map(of_source).unzip(),
            response: response.iter().map(|of_harmonic| of_harmonic.map(|sum| -2.0 * sum)).collect(),
            zero_order: [2.0 * zero_order.re, -2.0 * zero_order.im],
            crosstalk,
            variation: variation_degrees().map(|(i, j)| -2.0 * variation[j][i]).collect(),
        }
    }
}

#[inline(always)]
fn row_sums<T: Real>(
    slm: &Slm<T>,
    y: usize,
    shown: ShownRow<'_, T>,
    b: &[Complex<T>],
    polynomials_x: &[Vec<T>],
) -> RowSums {
    let mut sums = NO_SUMS;
    // b* · c
    let mut products = vec![Complex::new(T::zero(), T::zero()); b.len()];
    let rows = shown.blocks().zip(b.chunks(BLOCK)).zip(products.chunks_mut(BLOCK));
    for (i, ((shown, b), products)) in rows.enumerate() {
        let BlockResponse { sign, turn, modulated, .. } = slm.respond(y, i * BLOCK, shown);
        let mut light = slm.source_times_conj(y, i * BLOCK, b);
        for ((re, im), &sign) in light.re.iter_mut().zip(&mut light.im).zip(&sign) {
            (*re, *im) = (*re * sign, *im * sign);
        }
        let turned = light.multiplied(&modulated);
        for (x, product) in products.iter_mut().enumerate() {
            let undiffracted = Complex::new(light.re[x], light.im[x]) * slm.zero_order;
            *product = Complex::new(turned.re[x], turned.im[x]) + undiffracted;
        }
        let mut power = turn;
        for [sine, cosine] in &mut sums.response {
            *sine += dot(&turned.im, &power.im);
            *cosine += dot(&turned.im, &power.re);
            power = power.multiplied(&turn);
        }
        sums.zero_order += Complex64::new(sum(&light.re), sum(&light.im));
    }
    project(|x| products[x], polynomials_x, &mut sums.source);
    sums
}

/// Im Σ b* · a e^{ir} · ψ · T_i(x) along a row, for each i, as the real part.
#[inline(always)]
fn variation_sums<T: Real>(
    slm: &Slm<T>,
    y: usize,
    shown: ShownRow<'_, T>,
    b: &[Complex<T>],
    polynomials_x: &[Vec<T>],
) -> [Complex64; RESPONSE_VARIATION_ORDER + 1] {
    let mut products = vec![T::zero(); b.len()];
    let rows = shown.blocks().zip(b.chunks(BLOCK)).zip(products.chunks_mut(BLOCK));
    for (i, ((shown, b), products)) in rows.enumerate() {
        let BlockResponse { sign, modulated, .. } = slm.respond(y, i * BLOCK, shown);
        let turned = slm.source_times_conj(y, i * BLOCK, b).multiplied(&modulated);
        for ((x, product), &phase) in products.iter_mut().enumerate().zip(shown.phases()) {
            *product = turned.im[x] * sign[x] * phase;
        }
    }
    let mut sums = [Complex64::ZERO; RESPONSE_VARIATION_ORDER + 1];
    project(|x| Complex::new(products[x], T::zero()), polynomials_x, &mut sums);
    sums
}

/// Σ a · b in a fixed order.
fn product<T: Real>(a: &[T], b: &[T]) -> f64 {
    let block = |(a, b): (&[T], &[T])| a.iter().zip(b).fold(T::zero(), |sum, (&a, &b)| sum + a * b).wide();
    a.chunks(BLOCK).zip(b.chunks(BLOCK)).map(block).sum()
}

#[inline(always)]
fn dot<T: Real>(a: &[T; BLOCK], b: &[T; BLOCK]) -> f64 {
    let mut products = *a;
    for (product, &b) in products.iter_mut().zip(b) {
        *product = *product * b;
    }
    sum(&products)
}

/// Sum of the values in a fixed order, in lanes that vector instructions can add.
#[inline(always)]
fn sum<T: Real>(values: &[T; BLOCK]) -> f64 {
    let mut lanes = [0.0; 8];
    for chunk in values.chunks_exact(8) {
        for (lane, value) in lanes.iter_mut().zip(chunk) {
            *lane += value.wide();
        }
    }
    lanes.iter().sum()
}
