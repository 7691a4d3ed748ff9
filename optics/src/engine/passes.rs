//! Single passes of an evaluation, to measure the time of each pass.
//!
//! [`HologramProblem::evaluate`](crate::HologramProblem::evaluate) takes five passes over memory, each on all threads:
//!
//! | pass | operation |
//! |---|---|
//! | [`Pass::ForwardRows`] | computes the modulator's field from the phase and transforms it along x |
//! | [`Pass::ForwardColumns`] | transforms along y, multiplies by H, transforms back for each offset along y |
//! | [`Pass::Compare`] | transforms back along x, computes loss and gradient, transforms along x |
//! | [`Pass::BackwardColumns`] | transforms along y, multiplies by H*, transforms back along y |
//! | [`Pass::BackwardRows`] | transforms back along x and computes the gradient of the phase |
//!
//! ```
//! use lightpath_optics::engine::passes::{Pass, Passes};
//! use lightpath_optics::{Detector, DisplayModel, Engine, Grid, OpticalSetup, Plane, RegionOfInterest};
//! let grid = Grid::try_new(36, 64, 8e-6)?;
//! let engine = Engine::new(&DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 0.01)?), Detector::Pixel, None)?;
//! let (target, phase) = (Plane::filled(36, 64, 0.5_f32), Plane::filled(36, 64, 0.0_f32));
//! let mut passes = Passes::new(engine, target, RegionOfInterest::middle(&grid), phase)?;
//! for pass in Pass::ALL {
//!     let started = std::time::Instant::now();
//!     passes.run(pass);
//!     eprintln!("{:>16} {:?}", pass.name(), started.elapsed());
//! }
//! # Ok::<(), lightpath_optics::Error>(())
//! ```

use super::core::Fields;
use super::photometry::{Comparison, Quantity};
use super::single_precision::Engine;
use crate::error::Result;
use crate::numerics::{Plane, RegionOfInterest};

/// Part of an evaluation that passes over memory once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Pass {
    /// Computes the spectra of rows from the phase.
    ForwardRows,
    /// Propagates the spectra of rows to the image plane, without the inverse transform along x.
    ForwardColumns,
    /// Computes the light and the gradient of the loss, and the spectra of the gradient's rows.
    Compare,
    /// Applies the adjoint of [`Self::ForwardColumns`].
    BackwardColumns,
    /// Computes the gradient of the phase.
    BackwardRows,
}

impl Pass {
    /// All passes, in the order of an evaluation.
    pub const ALL: [Self; 5] =
        [Self::ForwardRows, Self::ForwardColumns, Self::Compare, Self::BackwardColumns, Self::BackwardRows];

    /// Name of the pass in lower case.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ForwardRows => "forward rows",
            Self::ForwardColumns => "forward columns",
            Self::Compare => "compare",
            Self::BackwardColumns => "backward columns",
            Self::BackwardRows => "backward rows",
        }
    }
}

/// Evaluation at one phase, in f32, whose passes run one at a time.
#[derive(Debug)]
pub struct Passes {
    engine: Engine,
    target: Plane<f32>,
    region: RegionOfInterest,
    phase: Plane<f32>,
    fields: Fields<f32>,
    gradient: Plane<f32>,
}

impl Passes {
    /// Prepares an evaluation for a `target` (intensity, linear light) and a `phase` \[rad\] of the engine's size.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a target or phase of another size.
    pub fn new(engine: Engine, target: Plane<f32>, region: RegionOfInterest, phase: Plane<f32>) -> Result<Self> {
        let (height_px, width_px) = (engine.height_px(), engine.width_px());
        target.expect_size("target_intensity", height_px, width_px)?;
        phase.expect_size("phase", height_px, width_px)?;
        let fields = Fields::new(&engine.core);
        let gradient = Plane::filled(height_px, width_px, 0.0);
        Ok(Self { engine, target, region, phase, fields, gradient })
    }

    /// Runs one pass on the result of the previous pass. Passes may run in any order, but only the order of
    /// [`Pass::ALL`] gives the gradient. [`Pass::BackwardColumns`] overwrites the field that [`Pass::Compare`] reads.
    pub fn run(&mut self, pass: Pass) {
        let Self { engine, target, region, phase, fields: Fields { spectrum, tiles }, gradient } = self;
        let engine = &engine.core;
        let convolver = &engine.convolver;
        let slm_len = engine.kernels.half_spectrum_len(convolver);
        match pass {
            Pass::ForwardRows => {
                let shown = engine.slm.shown(phase.values());
                convolver.forward_rows(&mut spectrum[..slm_len], &engine.kernels.along_x, |y, row| {
                    engine.slm.field_row(y, shown.row(y), row);
                });
            }
            Pass::ForwardColumns => {
                convolver.propagate(&spectrum[..slm_len], &engine.kernels, &mut tiles[..engine.image_len()]);
            }
            Pass::Compare => {
                let comparison = Comparison {
                    quantity: Quantity::Intensity,
                    picture: target,
                    weight: None,
                    region: *region,
                    detector: engine.detector(),
                    gain: 1.0,
                    offset: 0.0,
                    weight_sum: region.pixels() as f64,
                };
                convolver.compare(tiles, &comparison, spectrum);
            }
            Pass::BackwardColumns => {
                let spectrum = &spectrum[..engine.image_len()];
                convolver.propagate_adjoint(spectrum, &engine.kernels, &mut tiles[..slm_len]);
            }
            Pass::BackwardRows => {
                let (tiles, windows) = (&tiles[..slm_len], &engine.kernels.along_x);
                let shown = engine.slm.shown(phase.values());
                convolver.inverse_rows(tiles, windows, gradient.values_mut(), |y, b, out| {
                    engine.slm.phase_gradient_row(y, shown.row(y), b, out);
                });
                if engine.slm.crosstalk.is_some() {
                    let by_shown = gradient.values().to_vec();
                    engine.slm.gradient_of_displayed(&by_shown, false, gradient.values_mut());
                }
            }
        }
    }

    /// Gradient ∂L/∂φ at a gain of 1, after all passes have run in the order of [`Pass::ALL`].
    #[must_use]
    pub fn gradient(&self) -> &Plane<f32> {
        &self.gradient
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, OpticalSetup};
    use crate::hologram::{HologramProblem, initial_phase};
    use crate::numerics::Grid;

    #[test]
    fn all_passes_give_gradient_of_evaluation() {
        let grid = Grid::try_new(34, 45, 8e-6).unwrap();
        let model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 5e-3).unwrap());
        let region = RegionOfInterest::middle(&grid);
        let target = Plane::from_fn(34, 45, |y, x| ((y * 3 + x) % 7) as f32 / 7.0);
        let phase = initial_phase(34, 45, 6.0, 2).unwrap();
        for detector in Detector::ALL {
            let engine = Engine::new(&model, detector, None).unwrap();
            let mut expected = vec![0.0; 34 * 45];
            let mut problem = HologramProblem::new(engine.clone(), target.clone(), region).unwrap();
            problem.evaluate(phase.values(), 1.0, &mut expected);
            let mut passes = Passes::new(engine, target.clone(), region, phase.clone()).unwrap();
            Pass::ALL.into_iter().for_each(|pass| passes.run(pass));
            assert_eq!(passes.gradient().values(), expected, "{detector:?}");
        }
    }
}
