//! What a machine computes for a display, without a layout of memory: the border below which an engine begins.
//!
//! ```text
//! c(x, y) = k(x, y) · a(x, y) · d(x, y) · ( e^{i r(ψ)} + z₀ )                   modulator
//! u_mo(x, y) = F⁻¹[ Σ_ij H_mij(f) e^{i2πf·o} · F[ ℓ_i(x) ℓ_j(y) c ] ]            mode m, place o in a pixel
//! p(x, y) = blur of Σ_m w_m Σ_o v_o |u_mo(x, y)|²
//! ```
//!
//! A [`Prepared`] tells each factor in f64: the [modulator](Modulator)'s tables, the transfer functions H with the
//! windows ℓ and shares w of each [mode](PreparedMode), the places o with their weights v, and the blur. It borrows the
//! display and holds no table, so it costs nothing to make and to hand on. What computes (the processor's
//! [`EngineCore`](super::EngineCore), a graphics card) samples it once, in its own order and precision.
//!
//! Fields are padded with zeros to twice their size along each axis; frequencies are those of the padded frame
//! \[cycles per pixel\], −½ to ½. On a display that [shows all orders](Prepared::shows_all_orders) each place has a
//! transfer function of its own, by which H is multiplied in place of e^{i2πf·o}.

use super::sub_samples::{WeightedPlace, sub_samples};
use crate::display::parts::ghost::TransferErrors;
use crate::display::parts::order_errors::OrderErrors;
use crate::display::parts::spatial_variation::local_kernels;
use crate::display::{Carrier, Crosstalk, Detector, DisplayModel, Dust, KernelShape, LightBlur, OpticalSetup};
use crate::error::Result;
use crate::numerics::chebyshev::{clenshaw, polynomials, position};
use crate::propagation_method::ConvolutionMethod;
use num_complex::Complex64;
use std::borrow::Cow;

/// A valid display, seen by a detector, with an optional carrier grating on its modulator.
#[derive(Clone, Debug)]
pub struct Prepared<'a> {
    model: &'a DisplayModel,
    /// The display whose kernel is on the spectrum of the modulator's field.
    on_spectrum: Cow<'a, DisplayModel>,
    detector: Detector,
    carrier: Option<Carrier>,
}

impl<'a> Prepared<'a> {
    /// Prepares a display for a detector.
    ///
    /// # Errors
    ///
    /// The errors of [`DisplayModel::validate`].
    pub fn new(model: &'a DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Self> {
        model.validate()?;
        Ok(Self { model, on_spectrum: model.on_spectrum(), detector, carrier })
    }

    /// The display.
    #[must_use]
    pub fn model(&self) -> &'a DisplayModel {
        self.model
    }

    /// Setup of the display.
    #[must_use]
    pub fn setup(&self) -> OpticalSetup {
        self.model.setup
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.setup().grid().height_px()
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.setup().grid().width_px()
    }

    /// Detector that measures the light of a pixel.
    #[must_use]
    pub fn detector(&self) -> Detector {
        self.detector
    }

    /// Places o = (x, y) from the centre of a pixel \[px\] at which the light is computed, ordered by y, then by x, and
    /// the weights v of their light, which add up to 1. [`Detector::Supersampled`] compares each place on its own.
    #[must_use]
    pub fn places(&self) -> Vec<WeightedPlace> {
        sub_samples(&self.model.setup, self.detector)
    }

    /// Whether the display shows all orders of its pixels.
    #[must_use]
    pub fn shows_all_orders(&self) -> bool {
        self.model.setup.method() == ConvolutionMethod::AllOrders
    }

    /// The modulator's tables.
    #[must_use]
    pub fn modulator(&self) -> Modulator<'a> {
        Modulator::of(self.model, self.carrier)
    }

    /// Modes of light, which do not interfere; every display has a first one.
    pub fn modes(&self) -> impl Iterator<Item = PreparedMode<'_>> {
        let shares = self.model.coherence.shares();
        self.on_spectrum.modes().zip(shares).map(|(model, share)| PreparedMode { model, share })
    }

    /// Blur of the light of all modes; `None`: none.
    #[must_use]
    pub fn blur(&self) -> Option<LightBlur> {
        (!self.model.light_blur.is_none()).then_some(self.model.light_blur)
    }

    /// Errors that differ from order to order, which the transfer functions to the places have.
    pub(super) fn order_errors(&self) -> Option<OrderErrors> {
        self.model.order_errors()
    }
}

/// A mode of a display's light: its share, and its transfer functions with their windows on the modulator.
#[derive(Clone, Debug)]
pub struct PreparedMode<'a> {
    model: Cow<'a, DisplayModel>,
    share: f64,
}

impl PreparedMode<'_> {
    /// Part w of the light that this mode has. The parts of all modes add up to 1.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Transfer functions H_ij, at index j · n + i for n windows along each axis. A kernel that does not vary over the
    /// modulator has a single one.
    #[must_use]
    pub fn transfers(&self) -> Vec<TransferFunction<'_>> {
        match self.model.local_kernels() {
            Some(kernels) => kernels.into_iter().map(|model| TransferFunction { model: Cow::Owned(model) }).collect(),
            None => vec![TransferFunction { model: Cow::Borrowed(&self.model) }],
        }
    }

    /// Display with the light of this mode alone.
    pub(super) fn model(&self) -> &DisplayModel {
        &self.model
    }
}

/// Windows ℓ along x and along y for a number of transfer functions: for each window a factor for each pixel of its
/// axis. The windows of an axis add up to 1 at every pixel.
#[must_use]
pub fn windows(transfers: usize, height_px: usize, width_px: usize) -> [Vec<Vec<f64>>; 2] {
    [width_px, height_px].map(|side_px| local_kernels::windows(transfers.isqrt(), side_px))
}

/// A transfer function, as a function of the frequency.
#[derive(Clone, Debug)]
pub struct TransferFunction<'a> {
    model: Cow<'a, DisplayModel>,
}

/// `sampler(fx, fys, column)` writes H at one frequency along x and several along y \[cycles per pixel\].
pub type ColumnSampler<'a> = Box<dyn Fn(f64, &[f64], &mut [Complex64]) + Sync + 'a>;

impl TransferFunction<'_> {
    /// Makes the tables that all columns share.
    #[must_use]
    pub fn sampler(&self) -> ColumnSampler<'_> {
        let (model, pitch_m) = (&*self.model, self.model.setup.grid().pixel_pitch_m());
        match &model.kernel {
            KernelShape::Ideal => {
                let ideal = model.setup.sampled_kernel();
                Box::new(move |fx, fys, column| {
                    let values = column.iter_mut().zip(fys);
                    values.for_each(|(value, &fy)| *value = ideal.at(fx / pitch_m, fy / pitch_m));
                })
            }
            KernelShape::Bins(_) => {
                let sampled = model.sampled();
                Box::new(move |fx, fys, column| {
                    let values = column.iter_mut().zip(fys);
                    values.for_each(|(value, &fy)| *value = sampled(fx / pitch_m, fy / pitch_m));
                })
            }
            KernelShape::Smooth(smooth) => {
                let errors = TransferErrors { smooth: smooth.clone(), ghost: model.ghost };
                let ideal = model.setup.sampled_kernel();
                Box::new(move |fx, fys, column| {
                    let series = errors.along_y(2.0 * fx);
                    for (value, &fy) in column.iter_mut().zip(fys) {
                        *value = ideal.at(fx / pitch_m, fy / pitch_m) * series.at(2.0 * fy);
                    }
                })
            }
        }
    }
}

/// The modulator of a display: numbers and rows of tables.
#[derive(Clone, Copy, Debug)]
pub struct Modulator<'a> {
    model: &'a DisplayModel,
    carrier: Option<Carrier>,
}

impl<'a> Modulator<'a> {
    /// The modulator of a display that may be out of the limits of a valid one, as during a fit.
    pub(crate) fn of(model: &'a DisplayModel, carrier: Option<Carrier>) -> Self {
        Self { model, carrier }
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.model.setup.grid().height_px()
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.model.setup.grid().width_px()
    }

    /// Grating on the modulator, with the sign k.
    #[must_use]
    pub fn carrier(&self) -> Option<Carrier> {
        self.carrier
    }

    /// Harmonics [a_k, b_k] of the phase response r for k = 1, 2, … \[rad\]
    #[must_use]
    pub fn harmonics(&self) -> &'a [[f64; 2]] {
        &self.model.response
    }

    /// Undiffracted light z₀, relative to the light that the modulator turns.
    #[must_use]
    pub fn zero_order(&self) -> Complex64 {
        self.model.zero_order
    }

    /// Cross-talk between neighbouring pixels; `None`: none.
    #[must_use]
    pub fn crosstalk(&self) -> Option<Crosstalk> {
        (!self.model.crosstalk.is_none()).then_some(self.model.crosstalk)
    }

    /// Whether the light on the modulator differs from 1 anywhere.
    #[must_use]
    pub fn has_source(&self) -> bool {
        !self.model.source.is_flat() || self.has_dust()
    }

    /// Writes the amplitudes a of the light on the pixels of row `y`, without dust.
    pub fn source_row(&self, y: usize, row: &mut [Complex64]) {
        // A row has one y, so the series runs along x, with x and y exchanged.
        let source = &self.model.source;
        let (basis, y) = (source.basis(), position(y, self.height_px()));
        let along_x = |coefficients: &[f64]| {
            let (at_y, mut along) = (polynomials(source.order, y), vec![0.0; source.order + 1]);
            for ((i, j), c) in basis.degrees().zip(coefficients) {
                along[i] += c * at_y[j];
            }
            along
        };
        let (log_amplitude, phase) = (along_x(&source.log_amplitude), along_x(&source.phase));
        let width_px = self.width_px();
        for (x, value) in row.iter_mut().enumerate() {
            let x = position(x, width_px);
            *value = Complex64::from_polar(clenshaw(&log_amplitude, x).exp(), clenshaw(&phase, x));
        }
    }

    /// Whether dust lies on the modulator.
    #[must_use]
    pub fn has_dust(&self) -> bool {
        !self.model.dust.is_none()
    }

    /// Writes the factors d of dust on the pixels of row `y`.
    pub fn dust_row(&self, y: usize, row: &mut [Complex64]) {
        match self.model.dust.steps() {
            Some(steps) => row.iter_mut().zip(steps.row(y)).for_each(|(d, &steps)| *d = Dust::factor_of(steps)),
            None => row.fill(Complex64::ONE),
        }
    }

    /// Whether the phase response varies over the modulator.
    #[must_use]
    pub fn is_uneven(&self) -> bool {
        !self.model.response_variation.is_none()
    }

    /// Writes the factors 1 + v of the phase on the pixels of row `y`.
    pub fn phase_gain_row(&self, y: usize, row: &mut [f64]) {
        let (variation, at_y) = (&self.model.response_variation, position(y, self.height_px()));
        let values = row.iter_mut().enumerate();
        values.for_each(|(x, gain)| *gain = 1.0 + variation.value(position(x, self.width_px()), at_y));
    }
}
