//! Memory and work of an engine and of what it computes.

use super::sampling::{ExactSize, RESPONSE_STAGES, quadrant, sampling_bytes, sampling_work};
use super::value_bytes::{COMPLEX, COMPLEX_F64, REAL};
use crate::display::parts::spatial_variation::local_kernels;
use crate::display::{Detector, DisplayModel, KernelShape, OpticalSetup, Orders};
use crate::engine::convolution::{ROWS, padded_columns, tile_columns};
use crate::engine::{order_products, sub_samples};
use crate::hologram::OTHER_ORDERS_PIXELS_MAX;
use crate::propagation::passes::has_sample_transfers;
use crate::propagation_method::ConvolutionMethod;
use crate::second_opinion::OpinionSize;

/// Time of a product of an order: its part of free space, and its errors.
pub(super) const ORDER_STAGES: f64 = 300.0;
/// Time of a product's part in the transfer function to a sub-sample.
pub(super) const FOLD_STAGES: f64 = 20.0;
/// Time of all metrics of a hologram, as optimized and as quantized, for a pixel, in radix-2 stages.
const METRICS_STAGES: f64 = 400.0;
/// Time of a value of a second opinion, in radix-2 stages: its transfer function, and its part of the spectra.
const OPINION_STAGES: f64 = 190.0;
/// The same for a display that shows all orders, whose transfer functions to each place take more.
const OPINION_ORDERS_STAGES: f64 = 330.0;
/// Time of a value of a second opinion for each row and place along y, in radix-2 stages.
const OPINION_ROW_STAGES: f64 = 2.2;
/// Work of a pass over the values besides their transform, in radix-2 stages.
const STAGES_BESIDE: f64 = 4.0;

/// Size of an engine: of its display, its detector and its kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EngineSize {
    /// Rows \[px\].
    pub height_px: usize,
    /// Columns \[px\].
    pub width_px: usize,
    /// Detector.
    pub detector: Detector,
    /// Kernels along each side of the grid that approximates a kernel; 1 for a kernel that does not vary over the SLM.
    pub kernels_per_side: usize,
    /// Modes of light that do not interfere; 1 for coherent light.
    pub modes: usize,
    /// Whether the display has a source profile that is not flat.
    pub has_source: bool,
    /// Whether the phases that the display shows differ from those it is given: by cross-talk, or by a response that
    /// varies over the SLM.
    pub wraps_phase: bool,
    /// Whether the light blurs.
    pub blurs_light: bool,
    /// Whether the display shows all orders of its pixels, so that each sub-sample has a transfer function.
    pub all_orders: bool,
    /// Setup of a display that shows all orders, whose numbers of places in a pixel and of orders depend on it. `None`:
    /// the display shows the first order.
    pub orders_setup: Option<OpticalSetup>,
    /// Whether the display's kernel has errors that differ from order to order.
    pub has_order_errors: bool,
    /// Number of products of the orders of the same display with the other kind of optics.
    pub other_order_products: u64,
    /// Number of transfer functions to sub-samples of that display, of which the others are mirror images.
    pub other_responses: u64,
    /// Whether a filter passes a part of the first order.
    pub is_filtered: bool,
    /// The exact transfer functions with which the quality of holograms is measured; `None`: it is measured without
    /// them.
    pub exact: Option<ExactSize>,
    /// The [`second opinion`](crate::second_opinion); `None`: there is none.
    pub opinion: Option<OpinionSize>,
    /// Memory for the sampling of transfer functions, besides them \[bytes\].
    pub sampling_bytes: u64,
    /// Work of sampling the transfer functions, in values times radix-2 stages.
    pub sampling_work: u64,
    /// Number of threads.
    pub threads: usize,
}

impl EngineSize {
    /// Largest number of kernels along a side, for a kernel whose variation is not known.
    pub const KERNELS_PER_SIDE_MAX: usize = local_kernels::PER_SIDE_MAX;

    /// Size of the engine of an ideal display.
    #[must_use]
    pub fn ideal(height_px: usize, width_px: usize, detector: Detector, threads: usize) -> Self {
        Self {
            height_px,
            width_px,
            detector,
            kernels_per_side: 1,
            modes: 1,
            has_source: false,
            wraps_phase: false,
            blurs_light: false,
            all_orders: false,
            orders_setup: None,
            has_order_errors: false,
            other_order_products: 0,
            other_responses: 0,
            is_filtered: false,
            exact: None,
            opinion: None,
            sampling_bytes: 0,
            sampling_work: 0,
            threads,
        }
    }

    /// The same size with the sampling of a setup. `kernel_has_bins`: the kernel has a value for each frequency.
    #[must_use]
    pub fn sampled_with(self, setup: &OpticalSetup, kernel_has_bins: bool) -> Self {
        self.sampled_behind(setup, kernel_has_bins, false)
    }

    fn sampled_behind(self, setup: &OpticalSetup, kernel_has_bins: bool, has_errors: bool) -> Self {
        let other = setup.with_orders(Orders::SQUARE).ok().filter(|_| !setup.orders().are_all());
        let all = other.filter(|_| has_errors);
        let has_samples = has_sample_transfers(setup) && !kernel_has_bins && self.kernels_per_side == 1;
        Self {
            all_orders: setup.method() == ConvolutionMethod::AllOrders,
            orders_setup: setup.orders().are_all().then_some(*setup),
            has_order_errors: setup.orders().are_all() && has_errors,
            other_order_products: all.as_ref().map_or(0, order_products),
            // Of the first order the engine has one transfer function.
            other_responses: other.map_or(1, |all| sub_samples(&all, Detector::Pixel).len().div_ceil(4) as u64),
            is_filtered: setup.orders().filter().is_some(),
            exact: has_samples.then(|| ExactSize::of(setup, has_errors)),
            opinion: OpinionSize::of(setup, kernel_has_bins, self.kernels_per_side, self.modes),
            sampling_bytes: sampling_bytes(setup),
            sampling_work: sampling_work(setup),
            ..self
        }
        .with_order_errors()
    }

    /// Adds the making of transfer functions behind errors that differ from order to order.
    fn with_order_errors(self) -> Self {
        if !self.has_order_errors {
            return self;
        }
        let products = self.orders_setup.as_ref().map_or(0, order_products);
        let work = |places: u64| (products as f64 * (ORDER_STAGES + FOLD_STAGES * places as f64)) as u64;
        Self {
            sampling_bytes: self.sampling_bytes.max(self.order_products_bytes() + self.transfer_bytes()),
            sampling_work: self.sampling_work + work(self.samples()),
            exact: self.exact.map(|exact| ExactSize {
                bytes: exact.bytes + self.order_products_bytes() + self.transfer_bytes(),
                work: exact.work + work(exact.places),
                ..exact
            }),
            ..self
        }
    }

    /// The products of all orders from which transfer functions behind errors of each order are made.
    pub(super) fn order_products_bytes(&self) -> u64 {
        self.orders_setup.as_ref().map_or(0, order_products) * COMPLEX
    }

    /// Size of the engine of a display model.
    #[must_use]
    pub fn of(model: &DisplayModel, detector: Detector, threads: usize) -> Self {
        let grid = model.setup.grid();
        let varies = !model.variation.is_none();
        let size = Self {
            kernels_per_side: if varies { local_kernels::per_side(&model.variation) } else { 1 },
            modes: model.coherence.shares().len(),
            has_source: !model.source.is_flat() || !model.dust.is_none(),
            wraps_phase: !model.crosstalk.is_none() || !model.response_variation.is_none(),
            blurs_light: !model.light_blur.is_none(),
            ..Self::ideal(grid.height_px(), grid.width_px(), detector, threads)
        };
        let has_errors = matches!(model.kernel, KernelShape::Smooth(_));
        let size = size.sampled_behind(&model.setup, matches!(model.kernel, KernelShape::Bins(_)), has_errors);
        Self { opinion: size.opinion.map(|opinion| opinion.blurred_as(model)), ..size }
    }

    /// Memory of a copy of the light that is compared: its values before the blur, if the light blurs.
    pub(super) fn sharp_bytes(&self) -> u64 {
        if self.blurs_light { self.detector.light_planes() as u64 * self.pixels() * REAL } else { 0 }
    }

    /// The same size with another detector.
    #[must_use]
    pub fn with_detector(self, detector: Detector) -> Self {
        Self { detector, ..self }
    }

    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        self.height_px as u64 * self.width_px as u64
    }

    pub(super) fn kernels(&self) -> u64 {
        (self.kernels_per_side * self.kernels_per_side) as u64
    }

    /// Number of offsets of the sub-samples along each axis.
    pub(super) fn offsets(&self) -> u64 {
        self.detector.offsets_px().len() as u64
    }

    /// Number of sub-samples in a pixel.
    pub(super) fn samples(&self) -> u64 {
        let samples = |setup| sub_samples(&setup, self.detector).len();
        self.orders_setup.map_or(self.detector.samples(), samples) as u64
    }

    /// Number of half-transformed fields in the image.
    pub(super) fn lanes(&self) -> u64 {
        if self.all_orders { self.samples() } else { self.offsets() }
    }

    fn row_len(&self) -> u64 {
        padded_columns(self.width_px, tile_columns::<f32>(self.height_px)) as u64
    }

    /// `lanes` half-transformed fields.
    pub(super) fn half_spectrum_bytes(&self, lanes: u64) -> u64 {
        lanes * self.height_px as u64 * self.row_len() * COMPLEX
    }

    /// One transfer function.
    pub(super) fn transfer_bytes(&self) -> u64 {
        2 * self.half_spectrum_bytes(1)
    }

    /// Transfer functions of all kernels.
    #[must_use]
    pub fn transfers_bytes(&self) -> u64 {
        self.modes as u64 * self.kernels() * self.transfer_bytes()
    }

    /// Transfer functions and tables of the SLM, which an engine keeps.
    #[must_use]
    pub fn engine_bytes(&self) -> u64 {
        self.transfers_bytes()
            + self.sample_transfers_bytes()
            + if self.has_source { COMPLEX * self.pixels() } else { 0 }
            + if self.wraps_phase { REAL * self.pixels() } else { 0 }
    }

    /// Transfer functions to the sub-samples, which an engine keeps if the display shows all orders.
    fn sample_transfers_bytes(&self) -> u64 {
        if self.all_orders { self.lanes() * self.transfer_bytes() } else { 0 }
    }

    /// Memory of the tables of a sampled transfer function that a computation keeps besides the engine.
    #[must_use]
    pub fn sampled_bytes(&self) -> u64 {
        let values = if self.is_filtered { 2 * self.pixels() } else { quadrant(self.height_px, self.width_px) };
        self.sampling_bytes.min(values * COMPLEX_F64)
    }

    /// Scratch memory of all threads, and FFT plans.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        let (w, h, samples) = (self.width_px as u64, self.height_px as u64, self.samples());
        let columns = tile_columns::<f32>(self.height_px) as u64;
        let rows = (4 + samples) * w * COMPLEX + ROWS as u64 * self.row_len() * COMPLEX + (1 + samples) * w * REAL;
        let tile = 5 * columns * h * COMPLEX;
        // Lengths with large prime factors need up to four times their length.
        let plans = 16 * (w + h) * COMPLEX;
        // The shown phases, and the gradient by them.
        let shown = if self.wraps_phase { 2 * self.pixels() * REAL } else { 0 };
        self.threads as u64 * (rows + tile + 4 * w * COMPLEX) + plans + shown
    }

    /// Buffers of half-transformed fields for propagations there and back.
    #[must_use]
    pub fn fields_bytes(&self) -> u64 {
        2 * self.half_spectrum_bytes(self.lanes().max(self.kernels_per_side as u64))
    }

    /// Buffers of half-transformed fields for propagations to the image only.
    #[must_use]
    pub fn light_bytes(&self) -> u64 {
        self.half_spectrum_bytes(self.lanes() + self.kernels_per_side as u64)
    }

    /// Memory for these transfer functions with another detector, and for their sampling.
    pub(super) fn resampling_bytes(&self) -> u64 {
        if self.all_orders { self.sample_transfers_bytes() + 4 * self.pixels() * COMPLEX } else { 0 }
    }

    /// Memory for measuring the quality of a hologram in one plane, as optimized and as quantized, besides the engine.
    #[must_use]
    pub fn quality_bytes(&self, frames: usize) -> u64 {
        const SETS: u64 = 2;
        let (n, several) = (self.pixels(), u64::from(frames * self.modes > 1));
        let (point, fine) = (self.with_detector(Detector::Point), self.with_detector(Detector::Supersampled));
        let (points, samples) = (SETS * n * REAL, 4 * n * REAL);
        let propagated = match self.exact {
            Some(exact) => {
                // The spectra of rows, then a transfer function, the fields, and the light of one place.
                let transfer = point.transfer_bytes() + point.light_bytes() + 2 * n * REAL;
                let own = if exact.places > 4 { SETS * n * REAL } else { 0 };
                own + SETS * samples + 4 * n * COMPLEX + exact.bytes + transfer + point.scratch_bytes()
            }
            None => {
                let propagated = fine.light_bytes().max(fine.half_spectrum_bytes(2) + samples);
                propagated + (SETS - 1 + several) * samples + fine.scratch_bytes()
            }
        };
        // The light of both, a copy of the samples, the halved pictures and the flat pixels.
        let measured = SETS * (samples + n * REAL) + samples + samples / 2 + n;
        // All of the light before its blur is the image's and that of single places.
        let blurred = if self.blurs_light { samples } else { 0 };
        points + propagated.max(measured) + blurred
    }

    /// Work of [`Self::quality_bytes`]: light and metrics for this number of frames.
    #[must_use]
    pub fn quality_work(&self, frames: usize) -> f64 {
        const SETS: f64 = 2.0;
        let (point, fine) = (self.with_detector(Detector::Point), self.with_detector(Detector::Supersampled));
        let (light, sampling) = match self.exact {
            None => (point.light_work() + fine.light_work(), 0),
            Some(exact) => ((exact.places + 1) as f64 * point.light_work(), exact.work),
        };
        self.modes as f64 * (SETS * frames as f64 * light + sampling as f64) + METRICS_STAGES * self.pixels() as f64
    }

    /// Work of a second opinion with an effort on a hologram in one plane, for this number of frames and all of the
    /// detectors.
    #[must_use]
    pub fn opinion_work(&self, frames: usize, rows: usize, detectors: &[Detector]) -> f64 {
        let (values, rows) =
            self.opinion.map_or((0, rows), |opinion| (opinion.values, rows * opinion.rows_for_each as usize));
        let stages = if self.orders_setup.is_some() { OPINION_ORDERS_STAGES } else { OPINION_STAGES };
        let of = |detector: &Detector| {
            let places = match detector {
                Detector::Point => 1,
                Detector::Supersampled => 2,
                Detector::Pixel => 4,
            };
            stages + OPINION_ROW_STAGES * (rows * places) as f64
        };
        values as f64 * frames as f64 * detectors.iter().map(of).sum::<f64>()
    }

    /// Memory for the second opinion on a hologram in one plane, besides the engine and the light of its quality.
    #[must_use]
    pub fn opinion_bytes(&self) -> u64 {
        self.opinion.map_or(0, |opinion| opinion.bytes([self.height_px, self.width_px]))
    }

    /// Memory for measuring what a hologram would show on a display that shows the other diffraction orders, besides
    /// the engine: sampling, an engine with one sub-sample, its fields, and light. 0 where it is not measured.
    #[must_use]
    pub fn other_orders_bytes(&self) -> u64 {
        if self.pixels() > OTHER_ORDERS_PIXELS_MAX as u64 {
            return 0;
        }
        let other = Self { detector: Detector::Point, all_orders: !self.all_orders, ..*self };
        let products = self.other_order_products * COMPLEX
            + if self.other_order_products > 0 { other.transfer_bytes() } else { 0 };
        let sampled = 4 * self.pixels() * COMPLEX + products;
        other.engine_bytes() + sampled + other.light_bytes() + other.scratch_bytes() + 3 * self.pixels() * REAL
    }

    /// Memory of the transfer functions that a cache keeps after judging a hologram: the exact ones, and in a full judging
    /// those of the other orders.
    #[must_use]
    pub fn kept_bytes(&self, is_full: bool) -> u64 {
        let has_others = is_full && self.pixels() <= OTHER_ORDERS_PIXELS_MAX as u64;
        let others = if has_others { self.other_responses } else { 0 };
        (self.exact.map_or(0, |exact| exact.kept) + others) * self.transfer_bytes()
    }

    /// Work of [`Self::other_orders_bytes`] for this number of frames: four sub-samples, and their transfer functions.
    #[must_use]
    pub fn other_orders_work(&self, frames: usize) -> f64 {
        if self.pixels() > OTHER_ORDERS_PIXELS_MAX as u64 {
            return 0.0;
        }
        let point = Self { detector: Detector::Point, ..*self };
        let products = self.other_order_products as f64 * (ORDER_STAGES + 4.0 * FOLD_STAGES);
        4.0 * (frames * self.modes) as f64 * point.light_work()
            + (4 * self.pixels() * RESPONSE_STAGES) as f64
            + products
    }

    /// Work of one propagation to the image and its detection, in values times radix-2 stages.
    #[must_use]
    pub fn light_work(&self) -> f64 {
        let (w, h) = (self.width_px as f64, self.height_px as f64);
        let (lanes, sides) = (self.lanes() as f64, self.kernels_per_side as f64);
        let along_x = (sides + self.samples() as f64) * (w.log2() + STAGES_BESIDE);
        let along_y = (sides * sides + lanes) * (h.log2() + STAGES_BESIDE);
        2.0 * w * h * (along_x + along_y)
    }

    /// Work of one evaluation of a loss and its gradient.
    #[must_use]
    pub fn evaluation_work(&self) -> f64 {
        2.0 * self.light_work()
    }
}
