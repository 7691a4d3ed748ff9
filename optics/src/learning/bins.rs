//! Models with two numbers for each frequency: `paper` and `dense`.
//!
//! They are fitted by Adam with a constant learning rate, one pair at a time in the order of the pair source, as in the
//! paper.

use super::options::{KernelModel, LearnOptions};
use super::pair::{BoxError, Example, PairSource, measure_each, total};
use super::progress::{LearnStage, LearnStep};
use crate::display::parts::blocks::Blocks;
use crate::display::{DisplayModel, KernelShape, OpticalSetup};
use crate::engine::convolution::{Kernels, Transfer, split_bin};
use crate::engine::{EngineCore, Fields};
use crate::error::Error;
use crate::interrupt;
use crate::numerics::Plane;
use crate::numerics::buffers::zeros;
use crate::numerics::optimizer::adam::AdamStep;
use num_complex::Complex32;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// State of the fit of a model of bins: all that the next step depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BinsState {
    /// Two numbers for each bin, column after column: amplitude and phase (`paper`), or real and imaginary part
    /// (`dense`).
    pub parameters: Vec<f32>,
    /// First moments of Adam.
    pub first_moment: Vec<f32>,
    /// Second moments of Adam.
    pub second_moment: Vec<f32>,
    /// Steps of Adam so far.
    pub adam_steps: u32,
    /// Sum of the losses of the current epoch.
    pub epoch_loss: f64,
    /// Gain of the photographs, fitted at the start and after each epoch.
    pub gain: f64,
    /// Offset of the photographs, fitted together with the gain.
    pub offset: f64,
    /// Mean training loss of each epoch.
    pub loss_history: Vec<f64>,
}

/// Fit of a model of bins.
#[derive(Debug)]
pub struct BinsLearner {
    setup: OpticalSetup,
    options: LearnOptions,
    band: Band,
    engine: EngineCore<f32>,
    out: Fields<f32>,
    back: Vec<Complex32>,
    state: BinsState,
}

impl BinsLearner {
    pub(super) fn start(setup: OpticalSetup, options: LearnOptions, pairs: &dyn PairSource) -> Result<Self, BoxError> {
        let band = Band::new(&setup, options.model);
        let parameters = match options.model {
            KernelModel::Paper => {
                let mut random = ChaCha8Rng::seed_from_u64(options.seed);
                (0..band.parameters()).map(|_| random.random()).collect()
            }
            _ => band.ideal(&setup),
        };
        let zeros = vec![0.0; parameters.len()];
        let state = BinsState {
            parameters,
            first_moment: zeros.clone(),
            second_moment: zeros,
            gain: 1.0,
            ..BinsState::default()
        };
        let mut learner = Self::resume(setup, options, state)?;
        learner.fit_gain(pairs)?;
        Ok(learner)
    }

    pub(super) fn resume(setup: OpticalSetup, options: LearnOptions, state: BinsState) -> Result<Self, Error> {
        let band = Band::new(&setup, options.model);
        if state.parameters.len() != band.parameters() {
            let value = state.parameters.len() as f64;
            return Err(Error::OutOfRange { name: "state", value, allowed: "the number of parameters of the model" });
        }
        let mut engine = EngineCore::new(&DisplayModel::ideal(setup), options.detector, options.carrier)?;
        let dark = Transfer::zeros(setup.grid().height_px(), setup.grid().width_px());
        engine.kernels = Arc::new(Kernels::single(dark));
        let out = Fields::new(&engine);
        let back: Vec<Complex32> = zeros(out.spectrum.len());
        let mut learner = Self { setup, options, band, engine, out, back, state };
        learner.write_transfer();
        Ok(learner)
    }

    pub(super) fn state(&self) -> &BinsState {
        &self.state
    }

    pub(super) fn model(&self) -> DisplayModel {
        let bins = self.band.centred(&self.state.parameters);
        DisplayModel {
            kernel: KernelShape::Bins(bins),
            gain: self.state.gain,
            offset: self.state.offset,
            ..DisplayModel::ideal(self.setup)
        }
    }

    pub(super) fn step(&mut self, pairs: &dyn PairSource) -> Result<Option<LearnStep>, BoxError> {
        let (count, total) = (pairs.len() as u32, self.options.epochs * pairs.len() as u32);
        if self.state.adam_steps >= total {
            return Ok(None);
        }
        let pair = self.state.adam_steps % count;
        let example = Example::new(&pairs.pair(pair as usize)?, &self.engine, self.options.region)?;
        let loss = self.descend(&example);
        self.state.epoch_loss += loss;
        if pair + 1 == count {
            self.state.loss_history.push(self.state.epoch_loss / f64::from(count));
            self.state.epoch_loss = 0.0;
            self.fit_gain(pairs)?;
        }
        let (step, steps_total) = (self.state.adam_steps, total);
        Ok(Some(LearnStep {
            stage: LearnStage::Adam,
            step,
            steps_total,
            loss,
            validation_loss: None,
            order: 0,
            blocks: Blocks::NONE,
            trial: None,
        }))
    }

    fn descend(&mut self, example: &Example<f32>) -> f64 {
        let Self { engine, out, back, band, state, .. } = self;
        let convolver = &engine.convolver;
        engine.send(example.phase.values(), out);
        let comparison = example.comparison(engine, state.gain, state.offset);
        let sums = convolver.compare(&out.tiles, &comparison, back);
        let one = convolver.half_spectrum_len(1);
        let field = &out.spectrum[..one];
        let columns = convolver.correlate(field, back, &engine.kernels, &mut out.tiles[..one], |_, column, u, g| {
            band.gradient(column, u, g)
        });

        state.adam_steps += 1;
        // The loss is a mean over pixels, so its gradients are small; the scale keeps Adam's ε small beside them.
        let step = AdamStep::new(self.options.learning_rate, state.adam_steps, example.photo.values().len() as f64);
        let len = 2 * band.rows.len();
        let gradients: Vec<&Vec<Complex32>> = band.columns.iter().map(|&column| &columns[column]).collect();
        (
            state.parameters.par_chunks_mut(len),
            state.first_moment.par_chunks_mut(len),
            state.second_moment.par_chunks_mut(len),
            gradients,
        )
            .into_par_iter()
            .for_each(|(parameters, m, v, gradient)| {
                interrupt::check();
                let gradient = band.parameter_gradient(parameters, gradient);
                step.take(parameters, m, v, &gradient);
            });
        self.write_transfer();
        sums.loss()
    }

    fn fit_gain(&mut self, pairs: &dyn PairSource) -> Result<(), BoxError> {
        let each = measure_each(&self.engine, &mut self.out, pairs, self.options.region)?;
        (self.state.gain, self.state.offset) = total(&each).best_gain_and_offset();
        Ok(())
    }

    fn write_transfer(&mut self) {
        let transfer = Arc::make_mut(&mut self.engine.kernels).first_mut();
        let scale = transfer.scale();
        let (band, parameters) = (&self.band, &self.state.parameters);
        transfer.write_columns(|i, column| {
            column.fill(Complex32::ZERO);
            let Ok(position) = band.columns.binary_search(&i) else { return };
            let numbers = parameters[position * 2 * band.rows.len()..].as_chunks().0;
            for (&row, &number) in band.rows.iter().zip(numbers) {
                column[row] = band.value(number) * scale;
            }
        });
    }
}

/// The bins that are learned, and the meaning of their two numbers.
#[derive(Debug)]
struct Band {
    polar: bool,
    /// Learned columns of the transfer function, ascending; `columns_centred` has their columns in the centred plane.
    columns: Vec<usize>,
    columns_centred: Vec<usize>,
    /// Learned bins of a column, ascending; `rows_centred` has their rows in the centred plane.
    rows: Vec<usize>,
    rows_centred: Vec<usize>,
}

impl Band {
    fn new(setup: &OpticalSetup, model: KernelModel) -> Self {
        let polar = model == KernelModel::Paper;
        let along = |n: usize| {
            // `paper` has as many bins as the display has pixels (one less for an odd number), `dense` has all padded
            // bins.
            let side = if polar { n / 2 * 2 } else { 2 * n };
            let centred = |i: usize| {
                let bin = split_bin(i, n) as isize;
                let signed = if bin < n as isize { bin } else { bin - 2 * n as isize };
                usize::try_from(signed + (side / 2) as isize).ok().filter(|&position| position < side)
            };
            (0..2 * n).filter_map(|i| centred(i).map(|position| (i, position))).unzip()
        };
        let (columns, columns_centred) = along(setup.grid().width_px());
        let (rows, rows_centred) = along(setup.grid().height_px());
        Self { polar, columns, columns_centred, rows, rows_centred }
    }

    fn parameters(&self) -> usize {
        2 * self.columns.len() * self.rows.len()
    }

    fn ideal(&self, setup: &OpticalSetup) -> Vec<f32> {
        let grid = setup.grid();
        let frequency = |centred: usize, side: usize, n: usize| {
            (centred as f64 - (side / 2) as f64) / (2 * n) as f64 / grid.pixel_pitch_m()
        };
        let sampled = setup.sampled();
        let mut parameters = Vec::with_capacity(self.parameters());
        for &x in &self.columns_centred {
            interrupt::check();
            let fx = frequency(x, self.columns.len(), grid.width_px());
            for &y in &self.rows_centred {
                let h = sampled.at(fx, frequency(y, self.rows.len(), grid.height_px()));
                parameters.extend([h.re as f32, h.im as f32]);
            }
        }
        parameters
    }

    fn value(&self, [a, b]: [f32; 2]) -> Complex32 {
        if self.polar { Complex32::from_polar(a, b) } else { Complex32::new(a, b) }
    }

    /// ∂L/∂H* = u*·g at the learned bins of a column, without the scale of the transfer function.
    fn gradient(&self, column: usize, u: &[Complex32], g: &[Complex32]) -> Vec<Complex32> {
        if self.columns.binary_search(&column).is_err() {
            return Vec::new();
        }
        self.rows.iter().map(|&row| u[row].conj() * g[row]).collect()
    }

    /// Turns ∂L/∂H* into the gradient with respect to the two numbers of each bin.
    fn parameter_gradient(&self, parameters: &[f32], gradient: &[Complex32]) -> Vec<f32> {
        let polar = |(&[_, phase], &d): (&[f32; 2], &Complex32), amplitude: f32| {
            let turned = d.conj() * Complex32::cis(phase);
            [2.0 * turned.re, -2.0 * amplitude * turned.im]
        };
        let bins = parameters.as_chunks().0.iter().zip(gradient);
        if self.polar {
            bins.flat_map(|(number, d)| polar((number, d), number[0])).collect()
        } else {
            bins.flat_map(|(_, d)| [2.0 * d.re, 2.0 * d.im]).collect()
        }
    }

    fn centred(&self, parameters: &[f32]) -> Plane<Complex32> {
        let mut plane = Plane::filled(self.rows.len(), self.columns.len(), Complex32::ZERO);
        let width_px = self.columns.len();
        let mut numbers = parameters.as_chunks().0.iter();
        for &x in &self.columns_centred {
            interrupt::check();
            for (&y, &number) in self.rows_centred.iter().zip(&mut numbers) {
                plane.values_mut()[y * width_px + x] = self.value(number);
            }
        }
        plane
    }
}
