//! A parametric model during the fit: its loss for one pair, and the gradient with respect to all its parameters.

use super::adjoint::{Adjoint, FieldAdjoint, ModeAdjoint};
use super::ghost::{GhostSums, NO_GHOST_SUMS, ghost_gradient};
use super::layout::Layout;
use super::mode_buffers::ModeBuffers;
use super::order_fit::{OrderFit, OrderSums};
use super::pair::Example;
use super::smooth_transfer::{ColumnSums, SmoothTransfer};
use crate::display::parts::Block;
use crate::display::parts::response_variation::RESPONSE_VARIATION_ORDER;
use crate::display::{Carrier, Detector, DisplayModel, Dust, Ghost, KernelShape, OpticalSetup};
use crate::engine::Real;
use crate::engine::convolution::Transfer;
use crate::engine::photometry::Sums;
use crate::engine::prepared::Modulator;
use crate::engine::{EngineCore, Fields, Mode, kernels, tabulate_gain, tabulate_source};
use crate::error::Error;
use crate::numerics::buffers::zeros;
use crate::numerics::chebyshev::{ChebyshevBasis, polynomials, position};
use num_complex::{Complex, Complex64};
use rayon::prelude::*;
use std::sync::Arc;

/// A parametric model at one or several planes. Set a plane's parameters first, then evaluate pairs of that plane.
#[derive(Debug)]
pub(super) struct Fit<T> {
    /// Setup of each plane; the setups differ in their distances only.
    pub(super) setups: Vec<OpticalSetup>,
    pub(super) layout: Layout,
    pub(super) engine: EngineCore<T>,
    pub(super) smooth: SmoothTransfer<T>,
    /// Errors that differ from order to order, on a display that shows all orders.
    pub(super) orders: Option<OrderFit<T>>,
    /// Sums for the gradient by them, over all modes.
    order_sums: Vec<OrderSums>,
    /// Gain and offset that fit the latest photograph best.
    pub(super) gain: f64,
    pub(super) offset: f64,
    /// The ghost of the model.
    pub(super) ghost: Ghost,
    /// T_i at the x of each pixel.
    pub(super) polynomials_x: Vec<Vec<T>>,
    pub(super) out: Fields<T>,
    /// Half-transformed gradient in the image plane.
    pub(super) back: Vec<Complex<T>>,
    pub(super) modes: ModeBuffers<T>,
    /// Factor of the light on each pixel by dust; `None`: 1 everywhere.
    dust: Option<Vec<Complex<T>>>,
    /// Buffer for the spectra of derivatives.
    pub(super) spectra: Vec<Complex<T>>,
}

impl<T: Real> Fit<T> {
    pub(super) fn new(
        setups: Vec<OpticalSetup>,
        layout: Layout,
        detector: Detector,
        carrier: Option<Carrier>,
    ) -> Result<Self, Error> {
        let engine = EngineCore::new(&DisplayModel::ideal(setups[0]), detector, carrier)?;
        let polynomials_x = tabulate(layout.source.order(), engine.width_px());
        let out = Fields::new(&engine);
        let (back, spectra) = (zeros(engine.image_len()), zeros(engine.convolver.half_spectrum_len(2)));
        Ok(Self {
            smooth: SmoothTransfer::new(&setups, layout.kernel.order()),
            orders: OrderFit::new(&setups, detector),
            order_sums: Vec::new(),
            setups,
            layout,
            engine,
            gain: 1.0,
            offset: 0.0,
            ghost: Ghost::NONE,
            polynomials_x,
            out,
            back,
            modes: ModeBuffers::empty(),
            dust: None,
            spectra,
        })
    }

    /// The fit of a learned model, with its dust, at one plane.
    pub(super) fn of_model(
        model: &DisplayModel,
        layout: Layout,
        detector: Detector,
        carrier: Option<Carrier>,
    ) -> Result<Self, Error> {
        let mut fit = Self::new(vec![model.setup], layout, detector, carrier)?;
        fit.set_dust(model.dust.steps().map(Dust::exponents_of).as_deref());
        fit.set(0, &layout.parameters(model));
        Ok(fit)
    }

    /// Changes the order of the kernel or the blocks.
    pub(super) fn change_layout(&mut self, layout: Layout) {
        if layout.source != self.layout.source {
            self.polynomials_x = tabulate(layout.source.order(), self.engine.width_px());
        }
        if layout.kernel != self.layout.kernel {
            self.smooth.change_order(layout.kernel.order());
        }
        self.layout = layout;
    }

    /// Allocates `count` transfer functions for each mode of the light, and the fields for them.
    fn allocate_kernels(&mut self, count: usize, modes: usize) {
        let (height_px, width_px) = (self.engine.height_px(), self.engine.width_px());
        let kernels = || Arc::new(kernels(vec![Transfer::zeros(height_px, width_px); count]));
        // Frees memory before the new ones are allocated.
        (self.engine.further, self.modes) = (Vec::new(), ModeBuffers::empty());
        self.engine.kernels = kernels();
        self.engine.further = (1..modes).map(|_| Mode::with_kernels(kernels())).collect();
        self.out = Fields::new(&self.engine);
        self.modes = ModeBuffers::of(&self.engine);
    }

    /// Sets the dust: the logarithm of the amplitude and the phase of each pixel's factor. The next [`Self::set`] uses
    /// it.
    pub(super) fn set_dust(&mut self, exponents: Option<&[f32]>) {
        let factor = |&[log_amplitude, phase]: &[f32; 2]| {
            let factor = Complex64::from_polar(f64::from(log_amplitude).exp(), phase.into());
            Complex::new(T::of(factor.re), T::of(factor.im))
        };
        self.dust = exponents.map(|exponents| exponents.as_chunks().0.par_iter().map(factor).collect());
    }

    /// Takes the display that θ describes at a plane.
    pub(super) fn set(&mut self, plane: usize, parameters: &[f64]) {
        let layout = self.layout;
        FieldAdjoint::set(self, plane, &layout, &layout.model(&self.setups[plane], (1.0, 0.0), parameters));
    }

    fn take(&mut self, plane: usize, model: &DisplayModel) {
        let shares = model.coherence.shares();
        if let (Some(orders), Some(errors)) = (&mut self.orders, model.order_errors()) {
            orders.set(plane, &errors);
            self.engine.convolver = Arc::new(orders.convolver(&orders.ones()));
        }
        let on_spectrum = model.on_spectrum();
        let local: Vec<Vec<DisplayModel>> =
            on_spectrum.modes().map(|mode| mode.local_kernels().unwrap_or_else(|| vec![mode.into_owned()])).collect();
        if (self.engine.kernels.transfers.len(), self.engine.further.len() + 1) != (local[0].len(), local.len()) {
            self.allocate_kernels(local[0].len(), local.len());
        }
        let blur = self.layout.blocks.contains(Block::LightBlur).then_some(model.light_blur);
        let had_blur = std::mem::replace(&mut self.engine.blur, blur).is_some();
        if had_blur != blur.is_some() {
            self.modes = ModeBuffers::of(&self.engine);
        }
        self.for_each_mode(|fit, m| {
            fit.engine.share = shares[m];
            let transfers = &mut Arc::make_mut(&mut fit.engine.kernels).transfers;
            for (model, transfer) in local[m].iter().zip(transfers) {
                if let KernelShape::Smooth(errors) = &model.kernel {
                    fit.smooth.apply(plane, errors, transfer);
                    fit.smooth.add_ghost(&model.ghost, transfer);
                }
            }
        });
        self.ghost = model.ghost;
        if self.layout.has_slm() {
            let modulator = Modulator::of(model, self.engine.slm.carrier);
            let slm = Arc::make_mut(&mut self.engine.slm);
            slm.harmonics = model.response.iter().map(|&[a, b]| [T::of(a), T::of(b)]).collect();
            slm.zero_order = Complex::new(T::of(model.zero_order.re), T::of(model.zero_order.im));
            let mut source = tabulate_source(&modulator);
            if let Some(dust) = &self.dust {
                source.par_iter_mut().zip(dust).for_each(|(a, d)| *a = *a * d);
            }
            slm.source = Some(source);
            let blocks = self.layout.blocks;
            slm.crosstalk = blocks.contains(Block::Crosstalk).then_some(model.crosstalk);
            slm.phase_gain = blocks.contains(Block::UnevenResponse).then(|| tabulate_gain(&modulator));
        }
    }

    /// Propagates a hologram, then fits gain and offset to its photograph: they belong to the exposure, not to the
    /// display. If the light does not correlate with the photograph, the gain is 0 and nothing is learned from the
    /// pair.
    pub(super) fn propagate_and_fit_exposure(&mut self, example: &Example<T>) {
        let sums = self.measure(example);
        let (gain, offset) = sums.best_gain_and_offset();
        (self.gain, self.offset) = if gain > 0.0 { (gain, offset) } else { (0.0, sums.t / sums.w) };
    }

    /// The loss of one pair at its best gain and offset, and the gradient with respect to θ.
    pub(super) fn evaluate(&mut self, example: &Example<T>) -> (Sums, Vec<f64>) {
        let (sums, adjoint) = self.adjoint(example);
        (sums, self.layout.gradient(&adjoint))
    }

    /// A loss of the light of one pair, and its gradient with respect to θ. `loss(light, slopes)` writes its derivative
    /// by the light at each pixel. The light must be coherent, the detector have one light plane, and the display no
    /// ghost and no blur.
    pub(super) fn evaluate_light(
        &mut self,
        example: &Example<T>,
        loss: impl FnOnce(&[T], &mut [T]) -> f64,
    ) -> (f64, Vec<f64>) {
        let Self { engine, out, back, .. } = self;
        engine.send(example.phase.values(), out);
        let mut light: Vec<T> = zeros(engine.height_px() * engine.width_px());
        let mut slopes = light.clone();
        engine.convolver.add_light(&out.tiles, 1.0, true, None, &mut light);
        let loss = loss(&light, &mut slopes);
        let factor = 1.0 / engine.samples_per_pixel() as f64;
        engine.convolver.weigh_sampled_tiles(&out.tiles, &slopes, factor, back);
        self.order_sums.clear();
        let columns = self.correlate_mode(&|smooth, _, [h, u, g]| (smooth.column_sums(h, u, g), NO_GHOST_SUMS));
        (loss, self.layout.gradient(&self.gradient(example, None, &columns)))
    }

    /// The gradient from the sums of all columns, and from what was propagated back to the SLM.
    fn gradient(&self, example: &Example<T>, ghost: Option<Ghost>, columns: &[(ColumnSums, GhostSums)]) -> Adjoint {
        let (count, modes) = (self.engine.kernels.transfers.len(), self.engine.further.len() + 1);
        let of_mode = |columns: &[(ColumnSums, GhostSums)]| {
            let of_kernel = |kernel| columns.iter().skip(kernel).step_by(count).map(|(smooth, _)| smooth);
            ModeAdjoint {
                light: columns.iter().map(|(smooth, _)| smooth[0].re).sum(),
                kernels: (0..count).map(|kernel| self.smooth.gradient(of_kernel(kernel))).collect(),
            }
        };
        let of_orders =
            |orders: &OrderFit<T>| orders.gradient(self.layout.kernel, self.layout.beyond, &self.order_sums);
        Adjoint {
            modes: columns.chunks_exact(columns.len() / modes).map(of_mode).collect(),
            orders: self.orders.as_ref().map(of_orders),
            ghost: ghost.map(|ghost| ghost_gradient(&ghost, columns.iter().map(|(_, of_ghost)| of_ghost))),
            blur: self.engine.blur.is_some().then_some(self.modes.by_blur),
            modulator: self.layout.has_slm().then(|| self.slm_gradient(example)),
        }
    }

    /// Propagates a pair and the gradient of its loss, and calls `visit(smooth, column, [h, u, g])` for each column of
    /// each kernel in each mode: the transfer function, and the spectra of the outgoing field and of the
    /// back-propagated gradient. The results are ordered by mode, then by column, then by kernel.
    pub(super) fn correlate<R: Send>(
        &mut self,
        example: &Example<T>,
        visit: impl Fn(&SmoothTransfer<T>, usize, [&[Complex<T>]; 3]) -> R + Sync,
    ) -> (Sums, Vec<R>) {
        self.propagate_and_fit_exposure(example);
        let comparison = example.comparison(&self.engine, self.gain, self.offset);
        self.order_sums.clear();
        if !self.engine.needs_all_light() {
            let sums = self.engine.convolver.compare(&self.out.tiles, &comparison, &mut self.back);
            return (sums, self.correlate_mode(&visit));
        }
        let (sums, mut columns) = (self.compare_modes(&comparison), Vec::new());
        self.for_each_mode(|fit, m| {
            fit.weigh_mode();
            columns.extend(fit.correlate_mode(&visit));
            fit.add_returned(m);
        });
        (sums, columns)
    }

    /// Adds the sums of the mode whose engine the fit has now, for the gradient by errors that differ from order to
    /// order.
    fn add_order_sums(&mut self) {
        let Self { engine, smooth, orders, order_sums, out, back, .. } = self;
        let Some(orders) = orders else { return };
        let (convolver, kernels) = (&engine.convolver, &engine.kernels);
        let field = &out.spectrum[..kernels.half_spectrum_len(convolver)];
        let beyond_y = orders.beyond_y();
        let of_mode = convolver.correlate_samples(field, back, kernels, |column, v, gradients| {
            orders.sums(column, [v, gradients], smooth.polynomials_y(), &beyond_y)
        });
        match order_sums.is_empty() {
            true => *order_sums = of_mode,
            false => order_sums.iter_mut().zip(&of_mode).for_each(|(sums, more)| sums.add(more)),
        }
    }

    /// [`Self::correlate`] for the mode whose engine the fit has now.
    fn correlate_mode<R: Send>(
        &mut self,
        visit: &(impl Fn(&SmoothTransfer<T>, usize, [&[Complex<T>]; 3]) -> R + Sync),
    ) -> Vec<R> {
        self.add_order_sums();
        let Self { engine, smooth, out, back, .. } = self;
        let (convolver, kernels) = (&engine.convolver, &engine.kernels);
        let (field, tiles) = (&out.spectrum[..kernels.half_spectrum_len(convolver)], &mut out.tiles);
        let tiles = &mut tiles[..kernels.half_spectrum_len(convolver)];
        convolver.correlate(field, back, kernels, tiles, |kernel, column, u, g| {
            let mut h = u.to_vec();
            kernels.transfers[kernel].read_column(column, &mut h);
            visit(smooth, column, [&h, u, g])
        })
    }

    /// The loss of one pair at its best gain and offset. Adds `share` times the gradient with respect to the exponents
    /// of the dust to `gradient`, two numbers for each pixel.
    pub(super) fn evaluate_dust(&mut self, example: &Example<T>, share: f64, gradient: &mut [T]) -> Sums {
        self.propagate_and_fit_exposure(example);
        let comparison = example.comparison(&self.engine, self.gain, self.offset);
        if !self.engine.needs_all_light() {
            let Fields { spectrum, tiles } = &mut self.out;
            let sums = self.engine.convolver.compare(tiles, &comparison, spectrum);
            self.return_to_dust(example, share, gradient);
            return sums;
        }
        let sums = self.compare_modes(&comparison);
        self.for_each_mode(|fit, _| {
            fit.weigh_mode();
            // The spectrum is needed again for the next mode.
            std::mem::swap(&mut fit.out.spectrum, &mut fit.back);
            fit.return_to_dust(example, share, gradient);
            std::mem::swap(&mut fit.out.spectrum, &mut fit.back);
        });
        sums
    }

    /// Propagates the half-transformed gradient in the spectrum back, and adds `share` times the gradient by the dust.
    fn return_to_dust(&mut self, example: &Example<T>, share: f64, gradient: &mut [T]) {
        let Self { engine, out, .. } = self;
        let (slm, shown) = (&engine.slm, engine.slm.shown(example.phase.values()));
        engine.return_rows(out, gradient.as_chunks_mut().0, |y, b, out: &mut [[T; 2]]| {
            let mut field: Vec<Complex<T>> = zeros(b.len());
            slm.field_row(y, shown.row(y), &mut field);
            let twice = T::of(2.0 * share);
            for ((out, c), b) in out.iter_mut().zip(&field).zip(b) {
                let product = b.conj() * c;
                *out = [out[0] + twice * product.re, out[1] - twice * product.im];
            }
        });
    }
}

impl<T: Real> FieldAdjoint<T> for Fit<T> {
    fn set(&mut self, plane: usize, layout: &Layout, model: &DisplayModel) {
        self.change_layout(*layout);
        self.take(plane, model);
    }

    fn measure(&mut self, example: &Example<T>) -> Sums {
        if self.engine.needs_all_light() {
            return self.measure_modes(example);
        }
        let Self { engine, out, .. } = self;
        engine.send(example.phase.values(), out);
        engine.convolver.measure(&out.tiles, &example.comparison(engine, 1.0, 0.0))
    }

    fn adjoint(&mut self, example: &Example<T>) -> (Sums, Adjoint) {
        let ghost = self.layout.blocks.contains(Block::Ghost).then_some(self.ghost);
        let (sums, columns) = self.correlate(example, |smooth, column, [h, u, g]| {
            let of_ghost = ghost.map_or(NO_GHOST_SUMS, |ghost| smooth.ghost_sums(&ghost, column, [h, u, g]));
            (smooth.column_sums(h, u, g), of_ghost)
        });
        (sums, self.gradient(example, ghost, &columns))
    }
}

/// Degrees (i, j) of the terms of the response's variation, in the order of their coefficients.
pub(super) fn variation_degrees() -> impl Iterator<Item = (usize, usize)> {
    std::iter::once((0, 0)).chain(ChebyshevBasis::new(RESPONSE_VARIATION_ORDER).degrees())
}

/// T_0 … T_order at the position of each of `n` pixels.
pub(super) fn tabulate<T: Real>(order: usize, n: usize) -> Vec<Vec<T>> {
    let at: Vec<Vec<f64>> = (0..n).map(|i| polynomials(order, position(i, n))).collect();
    (0..=order).map(|j| at.iter().map(|t| T::of(t[j])).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Orders;
    use crate::display::parts::ModelPart;
    use crate::display::parts::blocks::Blocks;
    use crate::hologram::initial_phase;
    use crate::learning::options::KernelModel;
    use crate::learning::pair::Pair;
    use crate::numerics::{Grid, Plane, RegionOfInterest};

    const ALL_ORDERS: Orders = Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.7 };

    /// All blocks but the varying kernel.
    const ALL: Blocks = Blocks::ALL.without(Block::Varying);

    #[test]
    fn gradient_of_every_parameter_matches_central_differences() {
        let first =
            |(model, order, blocks, carrier, detector)| (model, order, blocks, carrier, detector, Orders::First);
        let all = |(model, order, blocks, detector)| (model, order, blocks, None, detector, ALL_ORDERS);
        let of_all_orders = [
            (KernelModel::Smooth, 3, Blocks::NONE, Detector::Point),
            (KernelModel::Display, 4, Blocks::NONE, Detector::Supersampled),
            (KernelModel::Varying, 4, Blocks::NONE.with(Block::Varying), Detector::Pixel),
            (KernelModel::Display, 3, ALL, Detector::Pixel),
        ];
        let of_first = [
            (KernelModel::Smooth, 3, Blocks::NONE, None, Detector::Pixel),
            (KernelModel::Display, 4, Blocks::NONE, None, Detector::Pixel),
            (KernelModel::Display, 2, Blocks::NONE, Some(Carrier::HalfOrderX), Detector::Pixel),
            (KernelModel::Varying, 5, Blocks::NONE.with(Block::Varying), Some(Carrier::HalfOrderX), Detector::Pixel),
            (KernelModel::Display, 2, ALL, None, Detector::Point),
            (KernelModel::Display, 2, Blocks::NONE.with(Block::LightBlur), None, Detector::Pixel),
            (KernelModel::Display, 2, ALL, Some(Carrier::HalfOrderX), Detector::Pixel),
            (KernelModel::Display, 2, ALL, Some(Carrier::HalfOrderY), Detector::Supersampled),
        ];
        let cases = of_first.into_iter().map(first).chain(of_all_orders.into_iter().map(all));
        for (model, order, blocks, carrier, detector, orders) in cases {
            let grid = Grid::try_new(18, 23, 8e-6).unwrap();
            let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap().with_orders(orders).unwrap();
            let layout = Layout::of(model, order, blocks).on(&setup);
            let mut fit = Fit::<f64>::new(vec![setup], layout, detector, carrier).unwrap();
            let photo = Plane::from_fn(18, 23, |y, x| 0.5 + 0.5 * ((y * 2 + x * 3) as f32).sin());
            let mut theta: Vec<f64> = (0..fit.layout.len()).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect();
            theta[layout.range(ModelPart::Crosstalk)].iter_mut().for_each(|q| *q = 0.1 + q.abs());
            theta[layout.range(ModelPart::LightBlur)].iter_mut().for_each(|q| *q = 0.2 + q.abs());
            fit.set(0, &theta);
            let example = |seed| {
                let pair = Pair { phase: initial_phase(18, 23, 6.0, seed).unwrap(), photo: photo.clone() };
                Example::new(&pair, &fit.engine, RegionOfInterest::middle(&grid)).unwrap()
            };
            // A photograph that has nothing of the light has no gradient.
            let examples: Vec<_> = (3..20).map(example).collect();
            let example = examples.into_iter().find(|example| {
                fit.propagate_and_fit_exposure(example);
                fit.gain > 0.0
            });
            let example = example.expect("a photograph that has something of the light");
            let (_, gradient) = fit.evaluate(&example);
            let scale = gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            for i in 0..theta.len() {
                let h = 1e-5;
                let mut at = |step: f64| {
                    let mut moved = theta.clone();
                    moved[i] += step;
                    fit.set(0, &moved);
                    fit.evaluate(&example).0.loss()
                };
                let difference = (at(h) - at(-h)) / (2.0 * h);
                assert!(
                    (gradient[i] - difference).abs() < 1e-6 * scale,
                    "{model:?}, {orders}, {blocks:?}, parameter {i} of {}: {} against {difference}",
                    theta.len(),
                    gradient[i]
                );
            }
        }
    }

    #[test]
    fn gradient_of_dust_matches_central_differences() {
        for (blocks, carrier, detector) in [
            (Blocks::NONE, None, Detector::Point),
            (ALL, Some(Carrier::HalfOrderX), Detector::Pixel),
            (Blocks::ALL, None, Detector::Supersampled),
        ] {
            let grid = Grid::try_new(12, 17, 8e-6).unwrap();
            let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
            let layout = Layout::of(KernelModel::Varying, 2, blocks);
            let mut fit = Fit::<f64>::new(vec![setup], layout, detector, carrier).unwrap();
            let photo = Plane::from_fn(12, 17, |y, x| 0.5 + 0.5 * ((y * 2 + x * 3) as f32).sin());
            let phase = initial_phase(12, 17, 6.0, 3).unwrap();
            let example = Example::new(&Pair { phase, photo }, &fit.engine, RegionOfInterest::middle(&grid)).unwrap();
            let mut theta: Vec<f64> = (0..fit.layout.len()).map(|i| 0.1 * (i as f64 * 1.3 + 0.5).sin()).collect();
            theta[layout.range(ModelPart::Crosstalk)].iter_mut().for_each(|q| *q = 0.1 + q.abs());
            // With much of a blur the light would not correlate with the photograph.
            theta[layout.range(ModelPart::LightBlur)].iter_mut().for_each(|q| *q = 0.02 + 0.2 * q.abs());
            let mut exponents: Vec<f32> = (0..2 * 12 * 17).map(|i| 0.3 * (i as f32 * 1.9).sin()).collect();
            let mut evaluate = |exponents: &[f32], gradient: &mut [f64]| {
                fit.set_dust(Some(exponents));
                fit.set(0, &theta);
                0.7 * fit.evaluate_dust(&example, 0.7, gradient).loss()
            };
            let mut gradient = vec![0.0; exponents.len()];
            evaluate(&exponents, &mut gradient);
            let scale = gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            for i in (0..exponents.len()).step_by(7) {
                let mut at = |step: f32| {
                    let before = exponents[i];
                    exponents[i] += step;
                    let moved = f64::from(exponents[i] - before);
                    let loss = evaluate(&exponents, &mut vec![0.0; gradient.len()]);
                    exponents[i] = before;
                    (loss, moved)
                };
                let ((after, up), (before, down)) = (at(1e-3), at(-1e-3));
                let difference = (after - before) / (up - down);
                assert!(
                    (gradient[i] - difference).abs() < 1e-5 * scale,
                    "{blocks:?}, {i}: {} against {difference}",
                    gradient[i]
                );
            }
        }
    }
}
