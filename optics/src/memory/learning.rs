//! Memory and work of a fit of a display model.

use super::engine::{EngineSize, FOLD_STAGES, ORDER_STAGES};
use super::value_bytes::{COMPLEX, COMPLEX_F64, REAL};
use crate::display::parts::layout::{FURTHER_MODES, Layout};
use crate::display::parts::light_blur;
use crate::engine::convolution::tile_columns;
use crate::learning::sizes::CURVATURE_PX;
use crate::learning::{Block, Blocks, KernelModel, ModelPart};
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::optimizer::vectors::HISTORY;

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
    /// Blocks that the fit may have.
    pub blocks: Blocks,
}

impl LearningSize {
    /// Engine during the fit.
    #[must_use]
    pub fn engine(&self) -> EngineSize {
        let varies = self.model == KernelModel::Varying;
        let has_slm = matches!(self.model, KernelModel::Display | KernelModel::Varying);
        EngineSize {
            kernels_per_side: if varies { EngineSize::KERNELS_PER_SIDE_MAX } else { 1 },
            // A varying kernel has more transfer functions than the modes, and no display has both.
            modes: if self.model == KernelModel::Display && self.blocks.contains(Block::PartialCoherence) {
                1 + FURTHER_MODES
            } else {
                1
            },
            has_source: has_slm,
            wraps_phase: has_slm,
            blurs_light: has_slm && self.blocks.contains(Block::LightBlur),
            ..self.engine
        }
    }

    /// Memory of a fit, besides the pairs.
    #[must_use]
    pub fn fit_bytes(&self) -> u64 {
        let stages = self.correlation_bytes().max(self.weighing_bytes()).max(self.dust_bytes());
        self.evaluated_bytes() + if self.model.is_smooth() { self.smooth_bytes() + stages } else { self.bins_bytes() }
    }

    /// Memory that a smooth model keeps between computations, besides the pairs.
    #[must_use]
    pub fn held_bytes(&self) -> u64 {
        self.evaluated_bytes() + self.smooth_bytes()
    }

    /// Memory for a curvature, besides [`Self::held_bytes`].
    #[must_use]
    pub fn weighing_bytes(&self) -> u64 {
        self.curvature_bytes() + self.ghost_bytes()
    }

    /// What every model needs to be compared with a photograph.
    fn evaluated_bytes(&self) -> u64 {
        let (engine, n) = (self.engine(), self.engine.pixels());
        // Phase, photograph and weights of an example, and the pair it is made from.
        let example = (3 + 2) * n * REAL;
        let buffers = engine.engine_bytes() + engine.fields_bytes() + engine.scratch_bytes();
        let back = engine.half_spectrum_bytes(engine.lanes());
        // Light, its slopes, and what returns to the SLM.
        let light = 2 * engine.detector.light_planes() as u64 * n * REAL;
        let light = if engine.modes > 1 || engine.blurs_light { light + engine.sharp_bytes() } else { 0 };
        let returned = if engine.modes > 1 { engine.half_spectrum_bytes(1) } else { 0 };
        buffers + back + light + returned + example
    }

    /// What a smooth model needs in addition: ideal transfer functions and spectra.
    fn smooth_bytes(&self) -> u64 {
        let (engine, n) = (self.engine(), self.engine.pixels());
        let ideal = self.distances as u64 * engine.transfer_bytes() + self.order_bytes();
        let spectra = engine.half_spectrum_bytes(2);
        // Also the slopes of the shown phases by the two numbers of the cross-talk.
        let source = if engine.has_source { COMPLEX * n + 2 * REAL * n } else { 0 };
        ideal + spectra + source + engine.sampling_bytes
    }

    /// Of a display that shows all orders: the first order of each sub-sample at each distance, the products of the
    /// orders, and transfer functions to the sub-samples while others are in use.
    fn order_bytes(&self) -> u64 {
        let engine = self.engine();
        match engine.all_orders {
            true => {
                let to_samples = engine.lanes() * engine.transfer_bytes();
                // The products of the point before are freed when the next ones are there.
                (self.distances as u64 + 1) * to_samples + engine.transfer_bytes() + 2 * engine.order_products_bytes()
            }
            false => 0,
        }
    }

    fn order_products(&self) -> f64 {
        (self.engine.order_products_bytes() / COMPLEX) as f64
    }

    /// Columns of the spectra of the field and of the gradient, and their sums.
    fn correlation_bytes(&self) -> u64 {
        let engine = self.engine();
        let (kernels, threads) = (engine.kernels(), engine.threads as u64);
        let tile = tile_columns::<f32>(engine.height_px) as u64 * engine.height_px as u64 * COMPLEX;
        threads * (kernels + 1) * 2 * tile
            + 2 * engine.width_px as u64 * kernels * (ChebyshevBasis::ORDER_MAX as u64 + 1) * COMPLEX_F64 * 2
    }

    /// Derivatives of one mode's transfer functions by a number of the ghost.
    fn ghost_bytes(&self) -> u64 {
        let engine = self.engine();
        if engine.has_source && self.blocks.contains(Block::Ghost) {
            engine.kernels() * engine.transfer_bytes()
        } else {
            0
        }
    }

    /// Exponents of the dust and factors at each pixel, and vectors of the fit: those of its state, and a point, a
    /// gradient and sums.
    fn dust_bytes(&self) -> u64 {
        let n = if self.engine().has_source { self.engine.pixels() } else { 0 };
        self.dust_state_bytes() + n * (COMPLEX + 3 * 2 * REAL)
    }

    /// State of the fit of the dust: L-BFGS with two numbers for each pixel, the best exponents, and dust of the
    /// display.
    fn dust_state_bytes(&self) -> u64 {
        let n = if self.engine().has_source { self.engine.pixels() } else { 0 };
        n * ((4 + 2 * HISTORY as u64) * 2 * REAL + 4)
    }

    /// Derivatives at the sampled pixels, their products for each row, and some matrices.
    fn curvature_bytes(&self) -> u64 {
        let [rows, columns] = self.region_px.map(|side| side as u64);
        let stride = (rows * columns / CURVATURE_PX as u64).max(1);
        let (rows, parameters) = (rows.div_ceil(stride), self.parameters());
        let samples = self.engine.samples();
        // The light is sampled at all pixels that blur into these.
        let sampled = match self.engine().blurs_light {
            true => {
                (rows * light_blur::TAPS as u64).min(self.engine.height_px as u64) * (columns + light_blur::TAPS as u64)
            }
            false => rows * columns,
        };
        let derivatives = rows * columns * parameters * REAL + sampled * (3 * REAL + samples * COMPLEX);
        let joint = self.joint_parameters();
        derivatives + rows * parameters * parameters / 2 * 8 + 4 * parameters * parameters * 8 + 6 * joint * joint * 8
    }

    /// Number of parameters of the model at one distance, with gain and offset.
    fn parameters(&self) -> u64 {
        self.layout().len() as u64 + 2
    }

    fn joint_parameters(&self) -> u64 {
        // The kernel is a polynomial of the distance of degree 2 at most, and each distance has its own tilts. The
        // modulator is the same at all distances.
        let tilts = if self.engine.all_orders { 4 } else { 2 };
        let kernel = self.layout().range(ModelPart::TransferFunction).len() as u64;
        self.parameters() + kernel * (self.distances.min(3) as u64 - 1) + tilts * self.distances as u64
    }

    /// Layout of the model.
    fn layout(&self) -> Layout {
        let (has_slm, blocks) = match self.model {
            KernelModel::Display => (true, self.blocks.without(Block::Varying)),
            KernelModel::Varying => (true, self.blocks.with(Block::Varying)),
            _ => (false, Blocks::NONE),
        };
        Layout::new(has_slm, self.order, blocks).with_all_orders(self.engine.all_orders)
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
            let joint = self.joint_parameters();
            return 8 * (joint * joint + 8 * joint) + self.dust_state_bytes();
        }
        3 * self.kernel_bytes()
    }

    /// The learned kernel: two numbers for each bin, or some hundred coefficients with two small numbers for each
    /// pixel.
    #[must_use]
    pub fn kernel_bytes(&self) -> u64 {
        match self.model {
            KernelModel::Dense => 4 * self.engine.pixels() * COMPLEX,
            KernelModel::Paper => self.engine.pixels() * COMPLEX,
            KernelModel::Smooth => 8 * self.parameters(),
            KernelModel::Display | KernelModel::Varying => 8 * self.parameters() + 4 * self.engine.pixels(),
        }
    }

    /// Work of one step with one pair: an evaluation and its gradient by the parameters.
    #[must_use]
    pub fn step_work(&self) -> f64 {
        let engine = self.engine();
        let gradient = engine.pixels() as f64 * 4.0 * engine.kernels() as f64 * (self.order + 2) as f64;
        let orders = self.order_products() * (ORDER_STAGES + 2.0 * FOLD_STAGES * engine.samples() as f64);
        engine.evaluation_work() + engine.light_work() + gradient + orders
    }

    /// Work of the curvature of one pair.
    #[must_use]
    pub fn curvature_work(&self) -> f64 {
        let engine = self.engine();
        let layout = self.layout();
        let (source, harmonics) = (layout.source.terms(), layout.range(ModelPart::PhaseResponse).len());
        let propagations = self.order + 1 + if engine.has_source { source + harmonics + 1 + 12 } else { 0 };
        let [rows, columns] = self.region_px.map(|side| side as f64);
        let products = (rows * columns).min(2.0 * CURVATURE_PX as f64) * (self.parameters() as f64).powi(2) / 8.0;
        // Transforms along y for the orders at, below and above the first along each axis.
        let (groups, beyond) = ((2 * (self.order + 1) + 6) as f64, layout.beyond.terms() as f64);
        let orders = match engine.all_orders {
            true => {
                (groups + beyond) * engine.light_work()
                    + (1.0 + beyond) * self.order_products() * FOLD_STAGES * engine.samples() as f64
            }
            false => 0.0,
        };
        propagations as f64 * engine.light_work() + products + orders
    }
}
