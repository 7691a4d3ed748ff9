//! The curvature of the loss, from the derivatives of the light.
//!
//! ```text
//! e = s p + o − t,   L = Σ w e² / Σ w,   ∂²L/∂θ∂θ′ ≈ 2 Σ w (∂e/∂θ)(∂e/∂θ′) / Σ w        Gauss and Newton
//! ∂e/∂θ = s · mean over the sub-samples of 2 Re( u* ∂u/∂θ )
//! ```
//!
//! Gain s and offset o follow every change of θ, so the part of ∂e that they can compensate does not count as
//! curvature. What remains is A − B C⁻¹ Bᵀ: A the curvature in θ, C that in s and o, B the mixed one.
//!
//! u is analytic in the complex coefficient of each polynomial, so log amplitude and phase share one ∂u. For a term of
//! the kernel, ∂u = F⁻¹[ T_i(fx) T_j(fy) H F c ]: the transforms along columns are done once for each j, those along
//! rows for each term, and for some rows only. For a term of the kernel's variation over the SLM, ∂u is the sum of the
//! light of the local kernels, each multiplied by the power of its position.
//!
//! Light that [blurs](crate::LightBlur) is sampled at the pixels around the rows, too, and ∂e is blurred like it.

use super::fit::{Fit, tabulate, variation_degrees};
use super::pair::Example;
use super::products::Products;
use crate::display::parts::light_blur::Blur;
use crate::display::parts::{Block, ModelPart};
use crate::display::{LightBlur, SpatialVariation};
use crate::engine::slm::{BLOCK, BlockResponse, Shown, ShownRow, Slm};
use crate::engine::{EngineCore, Real};
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::gaussian_blur::reached;
use num_complex::Complex;
use pulp::Arch;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

/// The curvature matrix and the gradient of a loss at a point.
#[derive(Clone, Debug)]
pub(super) struct Curvature {
    /// Symmetric curvature matrix, row after row.
    pub(super) matrix: Vec<f64>,
    /// Gradient over the sampled rows only. It is consistent with the matrix, but too coarse for descent.
    pub(super) gradient: Vec<f64>,
}

/// ∂e/∂θ of some rows of an image.
pub(super) struct Jacobian<T> {
    rows: Vec<usize>,
    columns: Range<usize>,
    /// The rows and columns at which the light is sampled: these, and those that blur into them.
    sampled: (Vec<usize>, Range<usize>),
    size_px: [usize; 2],
    blur: Option<LightBlur>,
    parameters: usize,
    samples: usize,
    /// The field u of a mode, indexed \[sampled row\]\[sub-sample\]\[x\].
    field: Vec<Complex<T>>,
    /// The derivatives ∂e/∂θ, indexed \[row\]\[θ\]\[x\].
    values: Vec<T>,
    /// The light of all modes before its blur, indexed \[sampled row\]\[x\].
    light: Vec<T>,
    /// Two derivatives before the blur, indexed \[derivative\]\[sampled row\]\[x\].
    derivatives: [Vec<T>; 2],
}

impl<T: Real> Fit<T> {
    /// The curvature of a pair's loss at the current parameters, from every `stride`-th row starting at row `first`.
    pub(super) fn curvature(&mut self, example: &Example<T>, first: usize, stride: usize) -> Curvature {
        self.propagate_and_fit_exposure(example);
        let mut jacobian = Jacobian::new(self, example, first, stride);
        let is_coherent = self.engine.is_coherent();
        self.for_each_mode(|fit, m| {
            if !is_coherent {
                fit.engine.send(example.phase.values(), &mut fit.out);
            }
            fit.derivatives_in_mode(m, example, &mut jacobian);
        });
        jacobian.curvature(self, example)
    }

    /// Adds the derivatives of the light of mode `m`, which the fit has just propagated.
    fn derivatives_in_mode(&mut self, m: usize, example: &Example<T>, jacobian: &mut Jacobian<T>) {
        let (layout, engine, further) = (self.layout, self.engine.clone(), m.checked_sub(1));
        jacobian.store_field(self, further.map(|further| layout.mode_light(further)));
        match self.orders.take() {
            None => self.kernel_derivatives(&engine, (None, layout.kernel, 0), jacobian),
            Some(orders) => {
                self.order_derivatives(&engine, &orders, jacobian);
                self.orders = Some(orders);
            }
        }
        if let Some(further) = further {
            self.kernel_derivatives(&engine, (None, layout.mode, layout.mode_errors(further)), jacobian);
        }
        if layout.varies() {
            for power in 0..SpatialVariation::POWERS {
                let series = (Some(power), layout.variation, layout.variation(power));
                self.kernel_derivatives(&engine, series, jacobian);
            }
        }
        if layout.blocks.contains(Block::Ghost) {
            self.ghost_derivatives(&engine, jacobian);
        }
        // The derivatives by the source change the windows of the kernels, which then must have one owner.
        drop(engine);
        if layout.has_slm() {
            self.slm_derivatives(example, jacobian);
        }
    }

    /// Adds the derivatives by the terms of a series that begins at `start` in θ: the kernel's series, that of a
    /// further mode, or that of one power of the position on the SLM.
    fn kernel_derivatives(
        &mut self,
        engine: &EngineCore<T>,
        (power, basis, start): (Option<usize>, ChebyshevBasis, usize),
        jacobian: &mut Jacobian<T>,
    ) {
        let (convolver, kernels) = (&engine.convolver, &engine.kernels);
        let polynomials_x = self.smooth.polynomials_x();
        let field = &self.out.spectrum[..kernels.half_spectrum_len(convolver)];
        convolver.weigh_spectra(field, kernels, &self.layout.local_weights(kernels.lanes(), power), &mut self.spectra);
        for j in 0..=basis.order() {
            let tiles = &mut self.out.tiles[..engine.image_len()];
            convolver.return_weighed(&self.spectra, self.smooth.polynomial_y(j), tiles);
            for (slot, (i, _)) in basis.degrees().enumerate().filter(|(_, degrees)| degrees.1 == j) {
                jacobian.add_derivatives(
                    self,
                    Some(&polynomials_x[i]),
                    Some(start + slot),
                    Some(start + basis.terms() + slot),
                );
            }
        }
    }

    /// Adds the derivatives by the numbers of the ghost.
    fn ghost_derivatives(&mut self, engine: &EngineCore<T>, jacobian: &mut Jacobian<T>) {
        let (start, convolver) = (self.layout.start(ModelPart::Ghost), &engine.convolver);
        let mut kernels = (*engine.kernels).clone();
        for (number, slots) in [
            (0, [Some(start), Some(start + 1)]),
            (2, [None, Some(start + 2)]),
            (3, [None, Some(start + 3)]),
            (4, [None, Some(start + 4)]),
        ] {
            for (of, derivative) in engine.kernels.transfers.iter().zip(&mut kernels.transfers) {
                self.smooth.differentiate_ghost(&self.ghost, number, of, derivative);
            }
            let field = &self.out.spectrum[..engine.kernels.half_spectrum_len(convolver)];
            convolver.propagate(field, &kernels, &mut self.out.tiles[..engine.image_len()]);
            jacobian.add_derivatives(self, None, slots[0], slots[1]);
        }
    }

    fn slm_derivatives(&mut self, example: &Example<T>, jacobian: &mut Jacobian<T>) {
        let (layout, slm) = (self.layout, Arc::clone(&self.engine.slm));
        let shown = slm.shown(example.phase.values());
        self.source_derivatives(&shown, &slm, jacobian);
        // ∂c is i e^{ir} times a real number for each of these, so the derivative is the one of a phase.
        for k in 0..layout.range(ModelPart::PhaseResponse).len() / 2 {
            for cosine in [false, true] {
                self.send_rows(|y, row| {
                    turned_row(&slm, y, shown.row(y), row, |BlockResponse { turn, .. }| {
                        let power = (0..k).fold(*turn, |power, _| power.multiplied(turn));
                        if cosine { power.re } else { power.im }
                    });
                });
                jacobian.add_derivatives(
                    self,
                    None,
                    None,
                    Some(layout.start(ModelPart::PhaseResponse) + 2 * k + usize::from(cosine)),
                );
            }
        }
        self.send_rows(|y, row| undiffracted_row(&slm, y, row));
        jacobian.add_derivatives(
            self,
            None,
            Some(layout.start(ModelPart::ZeroOrder)),
            Some(layout.start(ModelPart::ZeroOrder) + 1),
        );
        for (axis, slopes) in slm.shown_slopes(example.phase.values()).into_iter().flatten().enumerate() {
            let width_px = self.engine.width_px();
            self.send_rows(|y, row| {
                turned_row(&slm, y, shown.row(y), row, |response| response.slope);
                row.iter_mut().zip(&slopes[y * width_px..]).for_each(|(c, &slope)| *c = c.scale(slope));
            });
            jacobian.add_derivatives(self, None, None, Some(layout.start(ModelPart::Crosstalk) + axis));
        }
        if layout.blocks.contains(Block::UnevenResponse) {
            let polynomials_y: Vec<Vec<T>> = tabulate(layout.source.order(), self.engine.height_px());
            for (slot, (i, j)) in variation_degrees().enumerate() {
                let along_x = std::mem::take(&mut self.polynomials_x[i]);
                self.send_rows(|y, row| {
                    let shown = shown.row(y);
                    turned_row(&slm, y, shown, row, |_| [polynomials_y[j][y]; BLOCK]);
                    for ((c, &phase), &t) in row.iter_mut().zip(shown.phases()).zip(&along_x) {
                        *c = c.scale(phase * t);
                    }
                });
                self.polynomials_x[i] = along_x;
                jacobian.add_derivatives(self, None, None, Some(layout.start(ModelPart::UnevenResponse) + slot));
            }
        }
    }

    /// Adds the derivatives by the terms T_i(x) T_j(y) of the source: rows are transformed once for each i, and T_j is
    /// a window along y.
    fn source_derivatives(&mut self, shown: &Shown<'_, T>, slm: &Slm<T>, jacobian: &mut Jacobian<T>) {
        let (basis, start) = (self.layout.source, self.layout.source());
        let polynomials_y: Vec<Vec<T>> = tabulate(basis.order(), self.engine.height_px());
        let windows = self.engine.kernels.along_y.clone();
        for i in 0..=basis.order() {
            let Self { engine, out, polynomials_x, .. } = self;
            let spectrum = &mut out.spectrum[..engine.kernels.half_spectrum_len(&engine.convolver)];
            engine.convolver.forward_rows(spectrum, &engine.kernels.along_x, |y, row| {
                slm.field_row(y, shown.row(y), row);
                row.iter_mut().zip(&polynomials_x[i]).for_each(|(c, &t)| *c = c.scale(t));
            });
            for (slot, (_, j)) in basis.degrees().enumerate().filter(|(_, degrees)| degrees.0 == i) {
                let Self { engine, out, .. } = self;
                let kernels = Arc::make_mut(&mut engine.kernels);
                kernels.along_y =
                    windows.iter().map(|window| Some(times(window.as_deref(), &polynomials_y[j]))).collect();
                let spectrum = &out.spectrum[..kernels.half_spectrum_len(&engine.convolver)];
                let image_len = engine.convolver.half_spectrum_len(engine.convolver.lanes());
                engine.convolver.propagate(spectrum, kernels, &mut out.tiles[..image_len]);
                jacobian.add_derivatives(self, None, Some(start + slot), Some(start + basis.terms() + slot));
            }
        }
        Arc::make_mut(&mut self.engine.kernels).along_y = windows;
    }

    /// Propagates a field with the given rows instead of the SLM's field.
    fn send_rows(&mut self, fill: impl Fn(usize, &mut [Complex<T>]) + Sync) {
        self.engine.send_rows(&mut self.out, fill);
    }
}

/// A window times a polynomial.
fn times<T: Real>(window: Option<&[T]>, polynomial: &[T]) -> Vec<T> {
    match window {
        Some(window) => window.iter().zip(polynomial).map(|(&w, &t)| w * t).collect(),
        None => polynomial.to_vec(),
    }
}

/// Row of a · k · e^{ir} times a real number for each pixel of a block.
fn turned_row<T: Real>(
    slm: &Slm<T>,
    y: usize,
    shown: ShownRow<'_, T>,
    row: &mut [Complex<T>],
    factors: impl Fn(&BlockResponse<T>) -> [T; BLOCK],
) {
    for (block, (shown, row)) in shown.blocks().zip(row.chunks_mut(BLOCK)).enumerate() {
        let response = slm.respond(y, block * BLOCK, shown);
        let factors = factors(&response);
        for (x, c) in row.iter_mut().enumerate() {
            let factor = response.sign[x] * factors[x];
            *c = Complex::new(response.modulated.re[x] * factor, response.modulated.im[x] * factor);
        }
    }
    times_source(slm, y, row);
}

/// Row of a · k.
fn undiffracted_row<T: Real>(slm: &Slm<T>, y: usize, row: &mut [Complex<T>]) {
    row.iter_mut().enumerate().for_each(|(x, c)| *c = Complex::new(slm.sign(y, x), T::zero()));
    times_source(slm, y, row);
}

fn times_source<T: Real>(slm: &Slm<T>, y: usize, row: &mut [Complex<T>]) {
    if let Some(source) = &slm.source {
        row.iter_mut().zip(&source[y * slm.width_px..]).for_each(|(c, &a)| *c = *c * a);
    }
}

impl<T: Real> Jacobian<T> {
    fn new(fit: &Fit<T>, example: &Example<T>, first: usize, stride: usize) -> Self {
        let (height_px, width_px) = (fit.engine.height_px(), fit.engine.width_px());
        let in_region = (0..height_px).filter(|&y| example.region.columns(y).is_some());
        let rows: Vec<usize> = in_region.skip(first).step_by(stride).collect();
        let columns = rows.first().and_then(|&y| example.region.columns(y)).unwrap_or_default();
        let [reach_x, reach_y] = fit.engine.blur.map_or([0, 0], |blur| Blur::<T>::reach(blur.ratios()));
        let near: BTreeSet<usize> = rows.iter().flat_map(|&y| reached(&(y..y + 1), reach_y, height_px)).collect();
        let sampled = (near.into_iter().collect::<Vec<_>>(), reached(&columns, reach_x, width_px));
        // Gain and offset follow after θ.
        let (parameters, samples) = (fit.layout.len() + 2, fit.engine.samples_per_pixel());
        let (pixels, sampled_px) = (rows.len() * columns.len(), sampled.0.len() * sampled.1.len());
        Self {
            rows,
            columns,
            sampled,
            size_px: [height_px, width_px],
            blur: fit.engine.blur,
            parameters,
            samples,
            field: zeros(sampled_px * samples),
            values: zeros(pixels * parameters),
            light: zeros(sampled_px),
            derivatives: [zeros(sampled_px), zeros(sampled_px)],
        }
    }

    /// Stores u, the field that the fit has just propagated, and adds its light. Writes ∂e by the logarithm of the
    /// mode's part of the light to the slot `light_slot`, but for a multiple of the light of all modes, which the gain
    /// compensates.
    fn store_field(&mut self, fit: &Fit<T>, light_slot: Option<usize>) {
        let convolver = &fit.engine.convolver;
        let ((rows, columns), samples) = (&self.sampled, self.samples);
        let (width_px, width, arch) = (convolver.width_px, columns.len(), Arch::new());
        let (gain, share) = (T::of(fit.gain), T::of(fit.engine.share / samples as f64));
        let light = self.light.par_chunks_mut(width).zip(self.derivatives[0].par_chunks_mut(width));
        self.field.par_chunks_mut(samples * width).zip(light).zip(rows).for_each_init(
            || convolver.scratch.take(),
            |scratch, ((field, (light, by_share)), &y)| {
                convolver.sample_row(arch, &fit.out.tiles, y, scratch);
                for (stored, row) in field.chunks_exact_mut(width).zip(scratch.samples.chunks_exact(width_px)) {
                    stored.copy_from_slice(&row[columns.clone()]);
                }
                for x in 0..width {
                    let of_mode = (0..samples).fold(T::zero(), |sum, s| sum + field[s * width + x].norm_sqr()) * share;
                    light[x] = light[x] + of_mode;
                    by_share[x] = gain * of_mode;
                }
            },
        );
        if let Some(slot) = light_slot {
            self.add_blurred(&[(slot, T::one())], 0);
        }
    }

    /// Writes ∂e for the field that the fit has just propagated, with its spectrum weighted by columns: to the slot
    /// `real` for the field itself, and to the slot `imaginary` for i times the field.
    pub(super) fn add_derivatives(
        &mut self,
        fit: &Fit<T>,
        weights: Option<&[T]>,
        real: Option<usize>,
        imaginary: Option<usize>,
    ) {
        self.add_to_slots(fit, weights, &[([real, imaginary], T::one())]);
    }

    /// [`Self::add_derivatives`] for several pairs of slots, each with a factor.
    pub(super) fn add_to_slots(&mut self, fit: &Fit<T>, weights: Option<&[T]>, slots: &[([Option<usize>; 2], T)]) {
        let convolver = &fit.engine.convolver;
        let ((rows, columns), samples) = (&self.sampled, self.samples);
        let (width_px, width, arch) = (convolver.width_px, columns.len(), Arch::new());
        let factor = T::of(2.0 * fit.gain * fit.engine.share / samples as f64);
        let [has_real, has_imaginary] = [0, 1].map(|i| slots.iter().any(|(pair, _)| pair[i].is_some()));
        let [of_real, of_imaginary] = &mut self.derivatives;
        let out = of_real.par_chunks_mut(width).zip(of_imaginary.par_chunks_mut(width));
        out.zip(self.field.par_chunks(samples * width)).zip(rows).for_each_init(
            || convolver.scratch.take(),
            |scratch, (((of_real, of_imaginary), field), &y)| {
                convolver.sample_weighed_row(arch, &fit.out.tiles, y, weights, scratch);
                of_real.fill(T::zero());
                of_imaginary.fill(T::zero());
                for (u, d) in field.chunks_exact(width).zip(scratch.samples.chunks_exact(width_px)) {
                    let d = &d[columns.clone()];
                    if has_real {
                        for ((out, u), d) in of_real.iter_mut().zip(u).zip(d) {
                            *out = *out + factor * (u.re * d.re + u.im * d.im);
                        }
                    }
                    if has_imaginary {
                        for ((out, u), d) in of_imaginary.iter_mut().zip(u).zip(d) {
                            *out = *out + factor * (u.im * d.re - u.re * d.im);
                        }
                    }
                }
            },
        );
        for derivative in 0..2 {
            let slot = |&(pair, sign): &([Option<usize>; 2], T)| pair[derivative].map(|slot| (slot, sign));
            let slots: Vec<(usize, T)> = slots.iter().filter_map(slot).collect();
            self.add_blurred(&slots, derivative);
        }
    }

    /// Adds one of the derivatives, blurred as the light is, to some slots, each with a factor.
    fn add_blurred(&mut self, slots: &[(usize, T)], derivative: usize) {
        let blur = self.blur.map(|blur| Blur::new(blur.ratios()));
        self.add(slots, derivative, blur.as_ref());
    }

    /// Adds one of the derivatives, behind a blur, to some slots, each with a factor.
    fn add(&mut self, slots: &[(usize, T)], derivative: usize, blur: Option<&Blur<T>>) {
        if slots.is_empty() {
            return;
        }
        let (width, (sampled_rows, sampled_columns)) = (self.columns.len(), &self.sampled);
        let (size_px, columns) = (self.size_px, &self.columns);
        let near = |i: usize| &self.derivatives[derivative][i * sampled_columns.len()..][..sampled_columns.len()];
        let rows = self.values.par_chunks_mut(self.parameters * width).zip(&self.rows).enumerate();
        rows.for_each(|(i, (values, &y))| {
            let blurred = blur.map(|blur| {
                let near = |y: usize| near(sampled_rows.partition_point(|&sampled| sampled < y));
                let mut part = vec![T::zero(); width];
                blur.add_part(size_px, (y, columns.clone()), (sampled_columns.start, near), &mut part);
                part
            });
            let part = blurred.as_deref().unwrap_or_else(|| near(i));
            for &(slot, factor) in slots {
                let out = &mut values[slot * width..][..width];
                out.iter_mut().zip(part).for_each(|(out, &value)| *out = *out + factor * value);
            }
        });
    }

    /// Writes ∂e by the gain, times the gain, to its slot, and ∂e by the two q of the blur.
    fn add_light(&mut self, fit: &Fit<T>) {
        let gain = T::of(fit.gain);
        self.derivatives[0].iter_mut().zip(&self.light).for_each(|(out, &light)| *out = gain * light);
        self.add_blurred(&[(fit.layout.len(), T::one())], 0);
        let slopes = self.blur.map(|blur| Blur::slopes(blur.ratios()));
        for (axis, slope) in slopes.iter().flatten().enumerate() {
            self.add(&[(fit.layout.start(ModelPart::LightBlur) + axis, T::one())], 0, Some(slope));
        }
    }

    /// Computes the matrix 2 Σ w ∂e ∂e′ / Σ w and the gradient 2 Σ w e ∂e / Σ w.
    fn curvature(mut self, fit: &Fit<T>, example: &Example<T>) -> Curvature {
        let (parameters, width, arch) = (self.parameters, self.columns.len(), Arch::new());
        let (gain_slot, offset) = (fit.layout.len(), T::of(fit.offset));
        self.add_light(fit);
        let columns = self.columns.clone();
        let rows = self.values.par_chunks_mut(parameters * width).zip(&self.rows).map(|(values, &y)| {
            interrupt::check();
            let (photo, weight) = (&example.photo.row(y)[columns.clone()], &example.weight.row(y)[columns.clone()]);
            let mut error = vec![T::zero(); width];
            for x in 0..width {
                values[(gain_slot + 1) * width + x] = T::one();
                error[x] = values[gain_slot * width + x] + offset - photo[x];
            }
            for row in values.chunks_exact_mut(width) {
                row.iter_mut().zip(weight).for_each(|(value, &weight)| *value = *value * weight);
            }
            let counted = weight.iter().map(|weight| weight.wide()).sum::<f64>();
            let (products, gradient) = arch.dispatch(Products { values, error: &error, parameters, width });
            (counted, products, gradient)
        });
        let rows: Vec<_> = rows.collect();
        let mut curvature = Curvature { matrix: vec![0.0; parameters * parameters], gradient: vec![0.0; parameters] };
        let counted: f64 = rows.iter().map(|(counted, ..)| counted).sum();
        let scale = 2.0 / counted.max(1.0);
        for (_, products, gradient) in rows {
            curvature.gradient.iter_mut().zip(gradient).for_each(|(sum, value)| *sum += scale * value);
            let mut products = products.into_iter();
            for a in 0..parameters {
                for b in a..parameters {
                    curvature.matrix[a * parameters + b] += scale * products.next().unwrap_or(0.0);
                }
            }
        }
        for a in 0..parameters {
            for b in 0..a {
                curvature.matrix[a * parameters + b] = curvature.matrix[b * parameters + a];
            }
        }
        curvature.without_exposure()
    }
}

impl Curvature {
    /// Eliminates the last two parameters, gain and offset, which follow all others.
    fn without_exposure(self) -> Self {
        let Self { matrix, gradient } = self;
        let (all, n) = (gradient.len(), gradient.len() - 2);
        let at = |a: usize, b: usize| matrix[a * all + b];
        let (gg, go, oo) = (at(n, n), at(n, n + 1), at(n + 1, n + 1));
        let determinant = gg * oo - go * go;
        // C⁻¹; only for the offset when the light is dark or uniform.
        let inverse = if determinant > 1e-9 * gg * oo {
            [oo / determinant, -go / determinant, gg / determinant]
        } else {
            [0.0, 0.0, if oo > 0.0 { 1.0 / oo } else { 0.0 }]
        };
        let eliminated = |a: [f64; 2], b: [f64; 2]| {
            let [i, j, k] = inverse;
            a[0] * (i * b[0] + j * b[1]) + a[1] * (j * b[0] + k * b[1])
        };
        let mixed = |a: usize| [at(a, n), at(a, n + 1)];
        let exposure = [gradient[n], gradient[n + 1]];
        let pairs = (0..n).flat_map(|a| (0..n).map(move |b| (a, b)));
        Self {
            matrix: pairs.map(|(a, b)| at(a, b) - eliminated(mixed(a), mixed(b))).collect(),
            gradient: (0..n).map(|a| gradient[a] - eliminated(mixed(a), exposure)).collect(),
        }
    }
}

#[cfg(test)]
#[path = "jacobian_tests.rs"]
mod tests;
