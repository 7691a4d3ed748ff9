//! Memory of computations at their peak \[bytes\] and their work, counted before they start.
//!
//! The functions mirror the buffers of the engine, the optimizations and the fits: `convolution` (half-transformed
//! fields, transfer functions, scratch), `engine`, `hologram`, `optimizer`, `learning` and `simulated_display`. The test
//! `tests/memory.rs` compares them with counted allocations, so a change of a buffer must change its function here.
//!
//! ```
//! use lightpath_optics::Detector;
//! use lightpath_optics::hologram::HologramMethod;
//! use lightpath_optics::memory::{EngineSize, HologramSize};
//!
//! let engine = EngineSize::ideal(1080, 1920, Detector::Pixel, 2);
//! let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, 200);
//! let mib = (hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes()) >> 20;
//! assert!((250..350).contains(&mib), "{mib} MiB");
//! ```

use crate::chebyshev::ChebyshevBasis;
use crate::convolution::{padded_columns, rows::ROWS, tile_columns};
use crate::hologram::{HologramMethod, OTHER_ORDERS_PIXELS_MAX, SAMPLES_BYTES_MAX};
use crate::learning::KernelModel;
use crate::learning::sizes::{CURVATURE_PX, HARMONICS, SOURCE_ORDER, VARIATION_ORDER};
use crate::optimizer::limited_memory::HISTORY;
use crate::propagation::passes::{band_samples, frequencies, has_sample_transfers, peak_values};
use crate::second_opinion::{Effort, opinion_bytes, values};
use crate::spatial_variation::{SpatialVariation, local_kernels};
use crate::{ConvolutionMethod, Detector, DisplayModel, KernelShape, OpticalSetup};

/// Bytes of a complex number in f32.
const COMPLEX: u64 = 8;
/// Bytes of a complex number in f64.
const COMPLEX_F64: u64 = 16;
/// Bytes of a real number in f32.
const REAL: u64 = 4;

/// Memory of a simulated bench while it exists, for each pixel of its display \[bytes\]: source, speckle, and transfer
/// functions in f64.
const BENCH_BYTES_PER_PX: u64 = 96;
/// Memory for drawing a bench or taking a photograph with it, besides the bench, for each pixel of its display
/// \[bytes\]: padded fields and spectra in f64, and their transposed copies.
const EXPOSURE_BYTES_PER_PX: u64 = 324;

/// Size of an engine: of its display, its detector and its kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EngineSize {
    /// Rows \[px\].
    pub height_px: usize,
    /// Columns \[px\].
    pub width_px: usize,
    /// Detector.
    pub detector: Detector,
    /// Kernels along each side of the grid that approximates a kernel; 1 for a kernel that does not vary over the SLM.
    pub kernels_per_side: usize,
    /// Whether the display has a source profile that is not flat.
    pub has_source: bool,
    /// Whether the display shows all orders of its pixels, so that each sub-sample has a transfer function.
    pub all_orders: bool,
    /// Memory for the sampling of the exact transfer functions to sub-samples, besides them \[bytes\]; `None`: the quality of
    /// holograms is measured without such transfer functions.
    pub samples_bytes: Option<u64>,
    /// Values of transfer functions in the [`second opinion`](crate::second_opinion); 0: none.
    pub opinion_values: u64,
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
            has_source: false,
            all_orders: false,
            samples_bytes: None,
            opinion_values: 0,
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
        let has_samples = has_sample_transfers(setup) && !kernel_has_bins && self.kernels_per_side == 1;
        let ideal = DisplayModel::ideal(*setup);
        Self {
            all_orders: setup.method() == ConvolutionMethod::AllOrders,
            samples_bytes: has_samples.then(|| band_samples(setup, has_errors) * COMPLEX),
            opinion_values: if kernel_has_bins || self.kernels_per_side > 1 {
                0
            } else {
                values(&ideal, Effort::CHEAP)
            },
            sampling_bytes: sampling_bytes(setup),
            sampling_work: sampling_work(setup),
            ..self
        }
    }

    /// Size of the engine of a display model.
    #[must_use]
    pub fn of(model: &DisplayModel, detector: Detector, threads: usize) -> Self {
        let grid = model.setup.grid();
        let varies = !model.variation.is_none();
        let size = Self {
            kernels_per_side: if varies { local_kernels::per_side(&model.variation) } else { 1 },
            has_source: !model.source.is_flat(),
            ..Self::ideal(grid.height_px(), grid.width_px(), detector, threads)
        };
        let has_errors = matches!(model.kernel, KernelShape::Smooth(_));
        size.sampled_behind(&model.setup, matches!(model.kernel, KernelShape::Bins(_)), has_errors)
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

    fn kernels(&self) -> u64 {
        (self.kernels_per_side * self.kernels_per_side) as u64
    }

    /// Number of offsets of the sub-samples along each axis.
    fn offsets(&self) -> u64 {
        self.detector.offsets_px().len() as u64
    }

    /// Number of half-transformed fields in the image.
    fn lanes(&self) -> u64 {
        self.offsets().pow(if self.all_orders { 2 } else { 1 })
    }

    fn row_len(&self) -> u64 {
        padded_columns(self.width_px, tile_columns::<f32>(self.height_px)) as u64
    }

    /// `lanes` half-transformed fields.
    fn half_spectrum_bytes(&self, lanes: u64) -> u64 {
        lanes * self.height_px as u64 * self.row_len() * COMPLEX
    }

    /// One transfer function.
    fn transfer_bytes(&self) -> u64 {
        2 * self.half_spectrum_bytes(1)
    }

    /// Transfer functions of all kernels.
    #[must_use]
    pub fn transfers_bytes(&self) -> u64 {
        self.kernels() * self.transfer_bytes()
    }

    /// Transfer functions and tables of the SLM, which an engine keeps.
    #[must_use]
    pub fn engine_bytes(&self) -> u64 {
        self.transfers_bytes()
            + self.sample_transfers_bytes()
            + if self.has_source { COMPLEX * self.pixels() } else { 0 }
    }

    /// Transfer functions to the sub-samples, which an engine keeps if the display shows all orders.
    fn sample_transfers_bytes(&self) -> u64 {
        if self.all_orders { self.lanes() * self.transfer_bytes() } else { 0 }
    }

    /// Memory of the tables of a sampled transfer function that a computation keeps besides the engine.
    #[must_use]
    pub fn sampled_bytes(&self) -> u64 {
        self.sampling_bytes.min(quadrant(self.height_px, self.width_px) * COMPLEX_F64)
    }

    /// Scratch memory of all threads, and FFT plans.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        let (w, h, samples) = (self.width_px as u64, self.height_px as u64, self.offsets().pow(2));
        let columns = tile_columns::<f32>(self.height_px) as u64;
        let rows = (4 + samples) * w * COMPLEX + ROWS as u64 * self.row_len() * COMPLEX + (1 + samples) * w * REAL;
        let tile = 5 * columns * h * COMPLEX;
        // Lengths with large prime factors need up to four times their length.
        let plans = 16 * (w + h) * COMPLEX;
        self.threads as u64 * (rows + tile + 4 * w * COMPLEX) + plans
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
    fn resampling_bytes(&self) -> u64 {
        if self.all_orders { self.sample_transfers_bytes() + 4 * self.pixels() * COMPLEX } else { 0 }
    }

    /// Memory for measuring the quality of a hologram in one plane, as optimized and as quantized, besides the engine.
    #[must_use]
    pub fn quality_bytes(&self, frames: usize) -> u64 {
        const SETS: u64 = 2;
        let n = self.pixels();
        let (point, fine) = (self.with_detector(Detector::Point), self.with_detector(Detector::Supersampled));
        let (points, samples) = (SETS * n * REAL, 4 * n * REAL);
        let propagated = match self.samples_bytes {
            Some(sampling) => {
                // The spectra of rows, then a transfer function, the fields, and the light of one place.
                let transfer = point.transfer_bytes() + point.light_bytes() + 2 * n * REAL;
                let own = if self.all_orders { SETS * n * REAL } else { point.transfer_bytes() };
                own + SETS * samples + 4 * n * COMPLEX + sampling + transfer + point.scratch_bytes()
            }
            None => {
                let propagated = fine.light_bytes().max(fine.half_spectrum_bytes(2) + samples);
                propagated + (SETS - 1 + u64::from(frames > 1)) * samples + fine.scratch_bytes()
            }
        };
        // The light of both, a copy of the samples, the halved pictures and the flat pixels.
        let measured = SETS * (samples + n * REAL) + samples + samples / 2 + n;
        points + propagated.max(measured)
    }

    /// Memory for the second opinion on a hologram in one plane, besides the engine and the light of its quality.
    #[must_use]
    pub fn opinion_bytes(&self) -> u64 {
        if self.opinion_values == 0 { 0 } else { opinion_bytes([self.height_px, self.width_px], self.opinion_values) }
    }

    /// Memory for measuring what a hologram would show on a display that shows the other diffraction orders, besides the
    /// engine: sampling, an engine with one sub-sample, its fields, and light. 0 where it is not measured.
    #[must_use]
    pub fn other_orders_bytes(&self) -> u64 {
        if self.pixels() > OTHER_ORDERS_PIXELS_MAX as u64 {
            return 0;
        }
        let other = Self { detector: Detector::Point, all_orders: !self.all_orders, ..*self };
        let sampled = 4 * self.pixels() * COMPLEX;
        other.engine_bytes() + sampled + other.light_bytes() + other.scratch_bytes() + 3 * self.pixels() * REAL
    }

    /// Work of [`Self::other_orders_bytes`] for this number of frames: four sub-samples, and their transfer functions.
    #[must_use]
    pub fn other_orders_work(&self, frames: usize) -> f64 {
        if self.pixels() > OTHER_ORDERS_PIXELS_MAX as u64 {
            return 0.0;
        }
        let point = Self { detector: Detector::Point, ..*self };
        4.0 * frames as f64 * point.light_work() + (4 * self.pixels() * RESPONSE_STAGES) as f64
    }

    /// Work of one propagation to the image and its detection, in values times radix-2 stages.
    #[must_use]
    pub fn light_work(&self) -> f64 {
        let (w, h) = (self.width_px as f64, self.height_px as f64);
        let (lanes, sides) = (self.lanes() as f64, self.kernels_per_side as f64);
        let along_x = (sides + self.detector.samples() as f64) * (w.log2() + STAGES_BESIDE);
        let along_y = (sides * sides + lanes) * (h.log2() + STAGES_BESIDE);
        2.0 * w * h * (along_x + along_y)
    }

    /// Work of one evaluation of a loss and its gradient.
    #[must_use]
    pub fn evaluation_work(&self) -> f64 {
        2.0 * self.light_work()
    }

    /// Memory of a simulated bench of this display.
    #[must_use]
    pub fn bench_bytes(&self) -> u64 {
        BENCH_BYTES_PER_PX * self.pixels()
    }

    /// Memory for drawing a simulated bench of this display and for its exposures, with the bench.
    #[must_use]
    pub fn simulation_bytes(&self) -> u64 {
        self.bench_bytes() + EXPOSURE_BYTES_PER_PX * self.pixels()
    }

    /// Work of one photograph of a simulated bench: sixteen images in f64.
    #[must_use]
    pub fn simulation_work(&self, has_field_aberration: bool) -> f64 {
        let (w, h) = (self.width_px as f64, self.height_px as f64);
        let kernels = if has_field_aberration { 49.0 } else { 1.0 };
        let transforms = 4.0 * w * h * ((16.0 + 4.0) * w.log2() + (8.0 + 2.0 * kernels) * h.log2());
        F64_FACTOR * transforms
    }
}

/// Time of sampling the response of a pixel at one lag and of the transforms of four sub-samples, in radix-2 stages of a value.
const RESPONSE_STAGES: u64 = 1000;
/// Time of sampling one frequency of the band response and of its transforms, in radix-2 stages of a value.
const BAND_STAGES: u64 = 220;
/// Work of a pass over the values besides their transform, in radix-2 stages.
const STAGES_BESIDE: f64 = 4.0;
/// Time of a transform of single rows in f64, relative to the engine's in f32.
const F64_FACTOR: f64 = 4.0;

/// Memory for the sampling of a transfer function, besides it: frequencies and lags in f64.
#[must_use]
pub fn sampling_bytes(setup: &OpticalSetup) -> u64 {
    let grid = setup.grid();
    let values = match setup.method() {
        ConvolutionMethod::BandResponse => peak_values(setup),
        // In single precision.
        ConvolutionMethod::AllOrders => 2 * grid.height_px() as u64 * grid.width_px() as u64,
        ConvolutionMethod::RayleighSommerfeld => 2 * quadrant(grid.height_px(), grid.width_px()),
        ConvolutionMethod::FresnelImpulseResponse => 2 * (grid.height_px() + grid.width_px()) as u64,
        _ => 0,
    };
    values * COMPLEX_F64
}

/// Work of sampling a transfer function, in values times radix-2 stages.
#[must_use]
pub fn sampling_work(setup: &OpticalSetup) -> u64 {
    let grid = setup.grid();
    match setup.method() {
        ConvolutionMethod::BandResponse => frequencies(setup) * BAND_STAGES,
        ConvolutionMethod::AllOrders => 4 * grid.height_px() as u64 * grid.width_px() as u64 * RESPONSE_STAGES,
        _ => 2 * quadrant(grid.height_px(), grid.width_px()) * BAND_STAGES,
    }
}

/// Number of lags or frequencies that determine an even transfer function.
fn quadrant(height_px: usize, width_px: usize) -> u64 {
    (height_px as u64 + 1) * (width_px as u64 + 1)
}

/// Size of the optimization of a hologram for one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HologramSize {
    /// Engine of each plane.
    pub engine: EngineSize,
    /// Number of planes.
    pub planes: usize,
    /// Number of frames.
    pub frames: usize,
    /// Whether each plane has weights.
    pub weighted: bool,
    /// Whether the loss compares neighbouring pixels.
    pub rough: bool,
    /// Whether the last steps go through a display's levels.
    pub levels: bool,
    /// Method.
    pub method: HologramMethod,
    /// Number of steps.
    pub iterations: u32,
}

impl HologramSize {
    /// Optimization with one plane and one frame, without weights.
    #[must_use]
    pub fn new(engine: EngineSize, method: HologramMethod, iterations: u32) -> Self {
        Self { engine, planes: 1, frames: 1, weighted: false, rough: false, levels: false, method, iterations }
    }

    /// The phases of all frames.
    #[must_use]
    pub fn phases_bytes(&self) -> u64 {
        self.frames as u64 * self.engine.pixels() * REAL
    }

    /// Pictures of all planes, and their weights.
    #[must_use]
    pub fn pictures_bytes(&self) -> u64 {
        self.planes as u64 * self.engine.pixels() * REAL * if self.weighted { 2 } else { 1 }
    }

    /// Buffers of a [`HologramProblem`](crate::HologramProblem), without its engines: pictures, fields, light.
    #[must_use]
    pub fn problem_bytes(&self) -> u64 {
        self.new_problem_bytes() + self.light_bytes()
    }

    /// Buffers of a problem before its first evaluation.
    fn new_problem_bytes(&self) -> u64 {
        self.pictures_bytes() + self.engine.fields_bytes() + self.engine.scratch_bytes()
    }

    /// Light, slopes and samples that an evaluation in two passes keeps.
    fn light_bytes(&self) -> u64 {
        if !self.takes_two_passes() {
            return 0;
        }
        let light = self.engine.detector.light_planes() as u64 * self.engine.pixels() * REAL;
        (self.planes as u64 + 1) * light + self.samples_bytes().unwrap_or(0)
    }

    /// The kept samples; `None` if they would be too large.
    fn samples_bytes(&self) -> Option<u64> {
        let fields = (self.planes * self.frames) as u64;
        let bytes = fields * self.engine.fields_bytes() / 2;
        if fields == 1 { Some(0) } else { (bytes <= SAMPLES_BYTES_MAX as u64).then_some(bytes) }
    }

    fn takes_two_passes(&self) -> bool {
        match self.method {
            HologramMethod::Lbfgs | HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => true,
            HologramMethod::Adam { .. } | HologramMethod::DoublePhase => self.frames > 1 || self.rough,
        }
    }

    /// State of the method, which a checkpoint stores.
    #[must_use]
    pub fn state_bytes(&self) -> u64 {
        let phases = self.phases_bytes();
        match self.method {
            HologramMethod::Adam { .. } => 3 * phases,
            HologramMethod::Lbfgs => {
                let steps = (self.iterations.saturating_sub(1) as usize).min(HISTORY) as u64;
                (3 + 2 * steps) * phases
            }
            HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => {
                phases + self.planes as u64 * self.engine.pixels() * REAL
            }
            HologramMethod::DoublePhase => phases,
        }
    }

    /// Scratch memory of the method.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        let (phases, targets) = (self.phases_bytes(), self.planes as u64 * self.engine.pixels() * REAL);
        match self.method {
            HologramMethod::Adam { .. } => phases,
            HologramMethod::Lbfgs => 2 * phases + if self.levels { phases } else { 0 },
            HologramMethod::GerchbergSaxton => 2 * phases,
            HologramMethod::WeightedGerchbergSaxton => 2 * phases + targets,
            HologramMethod::DoublePhase => 0,
        }
    }

    /// Memory while the first phases are found: the problem before its first evaluation, the phases and, if they
    /// propagate back from the targets, the phases of the image and the field that the targets send back.
    #[must_use]
    pub fn start_bytes(&self, propagates_back: bool) -> u64 {
        let begun = self.new_problem_bytes() + self.phases_bytes();
        if self.method != HologramMethod::DoublePhase && !propagates_back {
            return begun;
        }
        let n = self.engine.pixels();
        let point = self.engine.with_detector(Detector::Point);
        let targets = self.planes as u64 * n * REAL;
        let fields = point.fields_bytes() + point.scratch_bytes() + point.resampling_bytes();
        begun + self.phases_bytes() + n * COMPLEX + targets + fields
    }

    /// Work of one step.
    #[must_use]
    pub fn step_work(&self) -> f64 {
        let (fields, values) = ((self.planes * self.frames) as f64, self.frames as f64 * self.engine.pixels() as f64);
        let again = if self.samples_bytes().is_none() && self.takes_two_passes() { 1.0 } else { 0.0 };
        let evaluations = fields * (self.engine.evaluation_work() + again * self.engine.light_work());
        let per_value = match self.method {
            HologramMethod::Lbfgs => 24.0,
            HologramMethod::Adam { .. } => 8.0,
            _ => 16.0,
        };
        evaluations + values * per_value
    }
}

/// Size of a fit of a display model to photographs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearningSize {
    /// Engine of the ideal display.
    pub engine: EngineSize,
    /// Model.
    pub model: KernelModel,
    /// Highest order of the kernel.
    pub order: usize,
    /// Number of distances.
    pub distances: usize,
    /// Rows and columns of the region that is compared \[px\].
    pub region_px: [usize; 2],
}

impl LearningSize {
    /// Engine during the fit.
    #[must_use]
    pub fn engine(&self) -> EngineSize {
        let varies = self.model == KernelModel::Varying;
        EngineSize {
            kernels_per_side: if varies { EngineSize::KERNELS_PER_SIDE_MAX } else { 1 },
            has_source: matches!(self.model, KernelModel::Display | KernelModel::Varying),
            ..self.engine
        }
    }

    /// Memory of a fit, besides the pairs.
    #[must_use]
    pub fn fit_bytes(&self) -> u64 {
        let (engine, n) = (self.engine(), self.engine.pixels());
        // Phase, photograph and weights of an example, and the pair it is made from.
        let example = (3 + 2) * n * REAL;
        let buffers = engine.engine_bytes() + engine.fields_bytes() + engine.scratch_bytes();
        let back = engine.half_spectrum_bytes(engine.lanes());
        buffers + back + example + if self.model.is_smooth() { self.smooth_bytes() } else { self.bins_bytes() }
    }

    /// What a smooth model needs in addition: ideal transfer functions, spectra, derivatives.
    fn smooth_bytes(&self) -> u64 {
        let (engine, n) = (self.engine(), self.engine.pixels());
        let ideal = self.distances as u64 * engine.transfer_bytes();
        let (kernels, threads) = (engine.kernels(), engine.threads as u64);
        let spectra = engine.half_spectrum_bytes(2);
        let tile = tile_columns::<f32>(engine.height_px) as u64 * engine.height_px as u64 * COMPLEX;
        let correlation = threads * (kernels + 1) * 2 * tile
            + 2 * engine.width_px as u64 * kernels * (ChebyshevBasis::ORDER_MAX as u64 + 1) * COMPLEX_F64 * 2;
        let source = if engine.has_source { COMPLEX * n } else { 0 };
        ideal + spectra + source + engine.sampling_bytes + correlation.max(self.curvature_bytes())
    }

    /// Derivatives at the sampled pixels, their products for each row, and some matrices.
    fn curvature_bytes(&self) -> u64 {
        let [rows, columns] = self.region_px.map(|side| side as u64);
        let stride = (rows * columns / CURVATURE_PX as u64).max(1);
        let (rows, parameters) = (rows.div_ceil(stride), self.parameters());
        let samples = self.engine.detector.samples() as u64;
        let derivatives = rows * columns * (parameters * REAL + samples * COMPLEX);
        let joint = self.joint_parameters(parameters);
        derivatives + rows * parameters * parameters / 2 * 8 + 4 * parameters * parameters * 8 + 6 * joint * joint * 8
    }

    /// Number of parameters of the model at one distance.
    fn parameters(&self) -> u64 {
        let terms = |order: usize| ChebyshevBasis::new(order).terms();
        let kernel = 2 * terms(self.order);
        let slm = 2 * terms(SOURCE_ORDER) + 2 * HARMONICS + 2;
        let variation = SpatialVariation::POWERS * 2 * terms(VARIATION_ORDER);
        let all = match self.model {
            KernelModel::Display => kernel + slm,
            KernelModel::Varying => kernel + slm + variation,
            _ => kernel,
        };
        all as u64 + 2
    }

    fn joint_parameters(&self, parameters: u64) -> u64 {
        // The kernel is a polynomial of the distance of degree 2 at most, and each distance has its own tilts.
        parameters * self.distances.min(3) as u64 + 2 * self.distances as u64
    }

    /// What a model of bins needs in addition: its state, and the gradient of every bin.
    fn bins_bytes(&self) -> u64 {
        let engine = self.engine();
        let tile = tile_columns::<f32>(engine.height_px) as u64 * engine.height_px as u64 * COMPLEX;
        let correlation = engine.threads as u64 * 4 * tile;
        self.state_bytes() + self.kernel_bytes() + correlation + engine.sampling_bytes
    }

    /// State of the fit, which a checkpoint stores.
    #[must_use]
    pub fn state_bytes(&self) -> u64 {
        if self.model.is_smooth() {
            let joint = self.joint_parameters(self.parameters());
            return 8 * (joint * joint + 8 * joint);
        }
        3 * self.kernel_bytes()
    }

    /// The learned kernel: two numbers for each bin, or some hundred coefficients.
    #[must_use]
    pub fn kernel_bytes(&self) -> u64 {
        match self.model {
            KernelModel::Dense => 4 * self.engine.pixels() * COMPLEX,
            KernelModel::Paper => self.engine.pixels() * COMPLEX,
            _ => 8 * self.parameters(),
        }
    }

    /// Work of one step with one pair: an evaluation and its gradient by the parameters.
    #[must_use]
    pub fn step_work(&self) -> f64 {
        let engine = self.engine();
        let gradient = engine.pixels() as f64 * 4.0 * engine.kernels() as f64 * (self.order + 2) as f64;
        engine.evaluation_work() + engine.light_work() + gradient
    }

    /// Work of the curvature of one pair.
    #[must_use]
    pub fn curvature_work(&self) -> f64 {
        let engine = self.engine();
        let propagations = if engine.has_source { self.order + 20 } else { self.order + 1 };
        let [rows, columns] = self.region_px.map(|side| side as f64);
        let products = (rows * columns).min(2.0 * CURVATURE_PX as f64) * (self.parameters() as f64).powi(2) / 8.0;
        propagations as f64 * engine.light_work() + products
    }
}
