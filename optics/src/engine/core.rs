//! Computations of the processor's engine, in f32 or f64: a [`Prepared`] display in the layout of the passes.

use super::convolution::{Convolver, Kernels, Real, Transfer};
use super::kept_transfers::KeptTransfers;
use super::order_products::OrderProducts;
use super::prepared::{Modulator, Prepared, PreparedMode, TransferFunction, windows};
use super::sample_transfers::sample_transfers;
use super::slm::{Shown, Slm};
use super::sub_samples::{offsets_px, sub_samples};
use crate::display::parts::ghost::TransferErrors;
use crate::display::parts::order_errors::OrderErrors;
use crate::display::{Carrier, Detector, DisplayModel, KernelShape, LightBlur, OpticalSetup};
use crate::error::Result;
use crate::interrupt;
use crate::numerics::Plane;
use crate::numerics::buffers::zeros;
use crate::propagation::passes::has_sample_transfers;
use crate::propagation_method::ConvolutionMethod;
use num_complex::{Complex, Complex64};
use rayon::prelude::*;
use std::sync::Arc;

/// An [`Engine`](crate::Engine) in the precision `T`: f32 in production, f64 as a reference.
#[derive(Clone, Debug)]
pub struct EngineCore<T> {
    pub(crate) convolver: Arc<Convolver<T>>,
    pub(crate) kernels: Arc<Kernels<T>>,
    pub(crate) slm: Arc<Slm<T>>,
    pub(crate) detector: Detector,
    pub(super) transmission: Transmission,
    pub(super) setup: OpticalSetup,
    /// Errors that differ from order to order, which the transfer functions to the sub-samples have.
    pub(crate) order_errors: Option<Arc<OrderErrors>>,
    /// Part of the light that this mode has.
    pub(crate) share: f64,
    /// The display's further modes of light.
    pub(crate) further: Vec<Mode<T>>,
    /// Blur of the light of all modes; `None`: none.
    pub(crate) blur: Option<LightBlur>,
    /// Where exact transfer functions are kept; `None`: nowhere.
    pub(super) kept: Option<Arc<dyn KeptTransfers<T>>>,
}

/// What distinguishes a mode of a display's light from the others.
#[derive(Clone, Debug)]
pub(crate) struct Mode<T> {
    pub(crate) share: f64,
    pub(crate) kernels: Arc<Kernels<T>>,
    transmission: Transmission,
}

/// Part of the light that the optics let pass at each frequency.
#[derive(Clone, Debug)]
pub(super) enum Transmission {
    /// All light passes.
    FreeSpace,
    /// |E|² of these errors.
    Smooth(Arc<TransferErrors>),
    /// |H|² of the kernel.
    Bins,
}

/// Buffers of half-transformed fields: row-major spectra and tiles of columns. They are reused between calls.
#[derive(Debug)]
pub(crate) struct Fields<T> {
    pub(crate) spectrum: Vec<Complex<T>>,
    pub(crate) tiles: Vec<Complex<T>>,
}

impl<T: Real> EngineCore<T> {
    /// Creates the engine of a display, seen by a detector, with an optional carrier grating on its modulator.
    ///
    /// # Errors
    ///
    /// The errors of [`DisplayModel::validate`].
    pub fn new(model: &DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Self> {
        Ok(Self::of(&Prepared::new(model, detector, carrier)?))
    }

    /// Creates the engine of a prepared display.
    #[must_use]
    pub fn of(prepared: &Prepared<'_>) -> Self {
        let errors = prepared.order_errors();
        let convolver = Arc::new(convolver(&prepared.setup(), prepared.detector(), errors.as_ref()));
        Self::of_parts(prepared, convolver, |mode| Arc::new(sample_kernels(mode)))
    }

    /// Engine of a display with all orders whose sub-samples are named later, by [`Self::light_at`].
    ///
    /// # Errors
    ///
    /// The errors of [`DisplayModel::validate`].
    pub(crate) fn without_samples(model: &DisplayModel) -> Result<Self> {
        let prepared = Prepared::new(model, Detector::Point, None)?;
        let convolver = Arc::new(Convolver::new(prepared.height_px(), prepared.width_px(), &[0.0]));
        Ok(Self::of_parts(&prepared, convolver, |mode| Arc::new(sample_kernels(mode))))
    }

    /// Engine of a prepared display, from plans that were made for it and the kernels of each of its modes.
    pub(super) fn of_parts(
        prepared: &Prepared<'_>,
        convolver: Arc<Convolver<T>>,
        kernels_of: impl Fn(&PreparedMode<'_>) -> Arc<Kernels<T>>,
    ) -> Self {
        let slm = Arc::new(Slm::of(&prepared.modulator()));
        let mut modes = prepared.modes().map(|mode| Mode::of(&mode, kernels_of(&mode)));
        let Mode { share, kernels, transmission } =
            modes.next().unwrap_or_else(|| unreachable!("every display has a first mode"));
        Self {
            convolver,
            kernels,
            slm,
            detector: prepared.detector(),
            transmission,
            setup: prepared.setup(),
            order_errors: prepared.order_errors().map(Arc::new),
            share,
            further: modes.collect(),
            blur: prepared.blur(),
            kept: None,
        }
    }

    /// Whether all light of the display interferes.
    pub(crate) fn is_coherent(&self) -> bool {
        self.further.is_empty()
    }

    /// Engines of the display with each mode of its light alone, before its blur. They share all large data.
    pub(crate) fn modes(&self) -> impl Iterator<Item = Self> + '_ {
        let (share, kernels, transmission) = (self.share, Arc::clone(&self.kernels), self.transmission.clone());
        let first = Mode { share, kernels, transmission };
        std::iter::once(first).chain(self.further.iter().cloned()).map(|Mode { share, kernels, transmission }| Self {
            convolver: Arc::clone(&self.convolver),
            kernels,
            slm: Arc::clone(&self.slm),
            detector: self.detector,
            transmission,
            setup: self.setup,
            order_errors: self.order_errors.clone(),
            share,
            further: Vec::new(),
            blur: None,
            kept: self.kept.clone(),
        })
    }

    /// Whether the exact transfer function to every place in a pixel is known.
    pub(super) fn has_exact_places(&self) -> bool {
        let is_one_kernel = !matches!(self.transmission, Transmission::Bins) && self.kernels.transfers.len() == 1;
        self.shows_all_orders() || has_sample_transfers(&self.setup) && is_one_kernel
    }

    /// Engine that sees one place in each pixel, through the exact transfer function to it. The kernel of a display
    /// that shows all orders multiplies it; for others it holds the errors of the kernel.
    pub(super) fn at_place(&self, transfer: Transfer<T>) -> Self {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        if self.shows_all_orders() {
            let convolver = Convolver::with_transfers(height_px, width_px, vec![transfer]);
            return Self { convolver: Arc::new(convolver), ..self.clone() };
        }
        let convolver = Arc::new(Convolver::new(height_px, width_px, Detector::Point.offsets_px()));
        Self { convolver, kernels: Arc::new(Kernels::single(transfer.scaled())), ..self.clone() }
    }

    /// Whether the display shows all orders of its pixels.
    pub(crate) fn shows_all_orders(&self) -> bool {
        self.setup.method() == ConvolutionMethod::AllOrders
    }

    /// Engine of the same display with another detector. Both engines share the transfer functions.
    #[must_use]
    pub fn with_detector(&self, detector: Detector) -> Self {
        let convolver = convolver(&self.setup, detector, self.order_errors.as_deref());
        Self { convolver: Arc::new(convolver), detector, ..self.clone() }
    }

    /// Detector that measures the light of a pixel.
    #[must_use]
    pub fn detector(&self) -> Detector {
        self.detector
    }

    /// Part of a pixel's side along which the camera sees light.
    pub(crate) fn camera_fill_factor(&self) -> f64 {
        self.setup.camera_fill_factor()
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.convolver.height_px
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.convolver.width_px
    }

    /// Complex field of the first mode in the image plane at the pixels' centres, for a `phase` \[rad\] on the SLM.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn field(&self, phase: &Plane<T>) -> Result<Plane<Complex<T>>> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        let shown = self.slm.shown(phase.values());
        Ok(self.propagate_rows(|y, row| self.slm.field_row(y, shown.row(y), row)))
    }

    /// Propagates a complex `field` at the SLM to the image plane. The model of the SLM is not used.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a field of another size.
    pub fn propagate(&self, field: &Plane<Complex<T>>) -> Result<Plane<Complex<T>>> {
        field.expect_size("field", self.height_px(), self.width_px())?;
        Ok(self.propagate_rows(|y, row| row.copy_from_slice(field.row(y))))
    }

    /// Light that the detector measures at each pixel. With the supersampled detector this is the mean over the
    /// sub-samples.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub fn light(&self, phase: &Plane<T>) -> Result<Plane<T>> {
        phase.expect_size("phase", self.height_px(), self.width_px())?;
        Ok(self.blurred(self.sum_over_modes(|mode| {
            let mut fields = Fields::for_light(mode);
            mode.send(phase.values(), &mut fields);
            let mut light = Plane::filled(mode.height_px(), mode.width_px(), T::zero());
            mode.convolver.light(&fields.tiles, light.values_mut());
            light
        })))
    }

    /// Sum of the light of all modes before its blur, where `light` computes that of a mode for all of the light.
    pub(super) fn sum_over_modes(&self, light: impl Fn(&Self) -> Plane<T>) -> Plane<T> {
        if self.is_coherent() {
            return light(self);
        }
        let mut sum: Option<Plane<T>> = None;
        for mode in self.modes() {
            let (light, share) = (light(&mode), T::of(mode.share));
            let sum = sum.get_or_insert_with(|| Plane::filled(light.height_px(), light.width_px(), T::zero()));
            sum.values_mut().par_iter_mut().zip(light.values()).for_each(|(sum, &light)| *sum = *sum + light * share);
        }
        sum.unwrap_or_else(|| light(self))
    }

    /// Propagates the phase on the SLM to half-transformed fields in the image plane.
    pub(crate) fn send(&self, phase: &[T], fields: &mut Fields<T>) {
        self.send_shown(&self.slm.shown(phase), fields);
    }

    /// [`Self::send`] for the phases that the SLM shows.
    pub(crate) fn send_shown(&self, shown: &Shown<'_, T>, fields: &mut Fields<T>) {
        self.send_rows(fields, |y, row| self.slm.field_row(y, shown.row(y), row));
    }

    /// Propagates a field on the SLM, which `fill` writes row by row, to half-transformed fields in the image plane.
    pub(crate) fn send_rows(&self, fields: &mut Fields<T>, fill: impl Fn(usize, &mut [Complex<T>]) + Sync) {
        let Fields { spectrum, tiles } = fields;
        let spectrum = &mut spectrum[..self.kernels.half_spectrum_len(&self.convolver)];
        self.convolver.forward_rows(spectrum, &self.kernels.along_x, fill);
        self.convolver.propagate(spectrum, &self.kernels, &mut tiles[..self.image_len()]);
    }

    /// Propagates half-transformed fields in the image plane, given in the spectrum, back to the SLM, and calls
    /// `use_row(y, row, out)` with each row.
    pub(crate) fn return_rows<R: Send>(
        &self,
        fields: &mut Fields<T>,
        results: &mut [R],
        use_row: impl Fn(usize, &[Complex<T>], &mut [R]) + Sync,
    ) {
        let Fields { spectrum, tiles } = fields;
        let tiles = &mut tiles[..self.kernels.half_spectrum_len(&self.convolver)];
        self.convolver.propagate_adjoint(&spectrum[..self.image_len()], &self.kernels, tiles);
        self.convolver.inverse_rows(tiles, &self.kernels.along_x, results, use_row);
    }

    /// Number of sub-samples in a pixel.
    pub(crate) fn samples_per_pixel(&self) -> usize {
        self.convolver.samples_per_pixel()
    }

    /// Number of values in the half-transformed fields in the image plane.
    pub(crate) fn image_len(&self) -> usize {
        self.convolver.half_spectrum_len(self.convolver.lanes())
    }

    fn propagate_rows(&self, fill: impl Fn(usize, &mut [Complex<T>]) + Sync) -> Plane<Complex<T>> {
        let point = match self.detector {
            Detector::Point => self.clone(),
            Detector::Pixel | Detector::Supersampled => self.with_detector(Detector::Point),
        };
        let mut fields = Fields::new(&point);
        point.send_rows(&mut fields, fill);
        let zero = Complex::new(T::zero(), T::zero());
        let mut field = Plane::filled(self.height_px(), self.width_px(), zero);
        point.convolver.inverse_rows(&fields.tiles[..point.image_len()], &[None], field.values_mut(), |_, row, out| {
            out.copy_from_slice(row)
        });
        field
    }
}

impl<T> Mode<T> {
    /// A mode of which only the light in the image plane is wanted.
    pub(crate) fn with_kernels(kernels: Arc<Kernels<T>>) -> Self {
        Self { share: 1.0, kernels, transmission: Transmission::FreeSpace }
    }

    fn of(mode: &PreparedMode<'_>, kernels: Arc<Kernels<T>>) -> Self {
        let model = mode.model();
        let transmission = match (model.transfer_errors(), &model.kernel) {
            (Some(errors), _) => Transmission::Smooth(Arc::new(errors)),
            (None, KernelShape::Bins(_)) => Transmission::Bins,
            (None, _) => Transmission::FreeSpace,
        };
        Self { share: mode.share(), kernels, transmission }
    }
}

impl<T: Real> Fields<T> {
    pub(crate) fn new(engine: &EngineCore<T>) -> Self {
        Self::for_all([engine])
    }

    /// Buffers that are large enough for each of several engines of one size and detector.
    pub(crate) fn for_all<'a>(engines: impl IntoIterator<Item = &'a EngineCore<T>>) -> Self {
        let len_of =
            |engine: &EngineCore<T>| engine.image_len().max(engine.kernels.half_spectrum_len(&engine.convolver));
        let len = engines.into_iter().map(len_of).max().unwrap_or(0);
        Self { spectrum: zeros(len), tiles: zeros(len) }
    }

    /// Buffers that are large enough for `EngineCore::send`, without propagation back.
    pub(crate) fn for_light(engine: &EngineCore<T>) -> Self {
        Self { spectrum: zeros(engine.kernels.half_spectrum_len(&engine.convolver)), tiles: zeros(engine.image_len()) }
    }
}

/// Plans of convolutions with the transfer functions of a setup that a detector measures.
pub(crate) fn convolver<T: Real>(
    setup: &OpticalSetup,
    detector: Detector,
    errors: Option<&OrderErrors>,
) -> Convolver<T> {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    match setup.method() {
        ConvolutionMethod::AllOrders => {
            let (places, weights): (Vec<_>, Vec<_>) = sub_samples(setup, detector).into_iter().unzip();
            // The light of a pixel is the mean over its sub-samples.
            let factor = |weight: f64| T::of((weight * places.len() as f64).sqrt());
            let exact = sample_transfers(setup, &places);
            let products = errors.map(|errors| OrderProducts::beside_exact(setup, errors));
            let behind = |exact: Transfer<T>, place: [f64; 2]| match &products {
                Some(products) => products.fold(&exact, (place, 1.0), &products.ones()),
                None => exact,
            };
            let transfers = exact.into_iter().zip(&places).zip(&weights);
            let weighted = transfers.map(|((exact, &place), &weight)| behind(exact, place).times(factor(weight)));
            Convolver::with_transfers(height_px, width_px, weighted.collect())
        }
        _ => Convolver::new(height_px, width_px, &offsets_px(setup, detector)),
    }
}

/// Samples the kernel of a mode, or the grid of kernels that approximates a kernel that varies over the SLM.
pub(crate) fn sample_kernels<T: Real>(mode: &PreparedMode<'_>) -> Kernels<T> {
    let grid = mode.model().setup.grid();
    let sample = |transfer: &TransferFunction<'_>| sample_transfer(transfer, grid.height_px(), grid.width_px());
    kernels(mode.transfers().iter().map(sample).collect())
}

/// A single kernel, or a grid of kernels with their windows.
pub(crate) fn kernels<T: Real>(transfers: Vec<Transfer<T>>) -> Kernels<T> {
    match <[_; 1]>::try_from(transfers) {
        Ok([transfer]) => Kernels::single(transfer),
        Err(transfers) => {
            let windows = windows(transfers.len(), transfers[0].height_px, transfers[0].width_px);
            let in_precision = |window: Vec<f64>| window.into_iter().map(T::of).collect();
            let [along_x, along_y] = windows.map(|windows| windows.into_iter().map(in_precision).collect());
            Kernels::grid(transfers, along_x, along_y)
        }
    }
}

fn sample_transfer<T: Real>(of: &TransferFunction<'_>, height_px: usize, width_px: usize) -> Transfer<T> {
    let sampler = of.sampler();
    let mut transfer = Transfer::zeros(height_px, width_px);
    transfer.fill_columns(|fx, fys, column| {
        let mut exact = vec![Complex64::ZERO; column.len()];
        sampler(fx, fys, &mut exact);
        column.iter_mut().zip(exact).for_each(|(value, exact)| *value = in_precision(exact));
    });
    transfer
}

impl<T: Real> Slm<T> {
    /// Tables of the modulator of a display.
    #[must_use]
    pub fn of(modulator: &Modulator<'_>) -> Self {
        let mut slm = Self::ideal(modulator.width_px(), modulator.carrier());
        slm.harmonics = modulator.harmonics().iter().map(|&[a, b]| [T::of(a), T::of(b)]).collect();
        slm.zero_order = in_precision(modulator.zero_order());
        slm.source = modulator.has_source().then(|| {
            let mut light = tabulate_source(modulator);
            if modulator.has_dust() {
                for_each_row(modulator, &mut light, |y, light, factors| {
                    modulator.dust_row(y, factors);
                    light.iter_mut().zip(factors).for_each(|(light, factor)| *light = *light * in_precision(*factor));
                });
            }
            light
        });
        slm.crosstalk = modulator.crosstalk();
        slm.phase_gain = modulator.is_uneven().then(|| tabulate_gain(modulator));
        slm
    }
}

/// 1 + v of a response that varies over the SLM, at every pixel.
pub(crate) fn tabulate_gain<T: Real>(modulator: &Modulator<'_>) -> Vec<T> {
    let mut row = vec![0.0; modulator.width_px()];
    let of_row = |y| {
        modulator.phase_gain_row(y, &mut row);
        row.iter().copied().map(T::of).collect::<Vec<_>>()
    };
    (0..modulator.height_px()).flat_map(of_row).collect()
}

/// Complex amplitude of the source at every pixel.
pub(crate) fn tabulate_source<T: Real>(modulator: &Modulator<'_>) -> Vec<Complex<T>> {
    let mut values: Vec<Complex<T>> = zeros(modulator.height_px() * modulator.width_px());
    for_each_row(modulator, &mut values, |y, out, exact| {
        modulator.source_row(y, exact);
        out.iter_mut().zip(exact).for_each(|(out, exact)| *out = in_precision(*exact));
    });
    values
}

/// Calls `write(y, row, scratch)` in parallel with each row of an array, and a row in f64.
fn for_each_row<T: Send>(
    modulator: &Modulator<'_>,
    values: &mut [T],
    write: impl Fn(usize, &mut [T], &mut [Complex64]) + Sync + Send,
) {
    let width_px = modulator.width_px();
    let scratch = || vec![Complex64::ZERO; width_px];
    values.par_chunks_mut(width_px).enumerate().for_each_init(scratch, |scratch, (y, row)| {
        interrupt::check();
        write(y, row, scratch);
    });
}

fn in_precision<T: Real>(exact: Complex64) -> Complex<T> {
    Complex::new(T::of(exact.re), T::of(exact.im))
}
