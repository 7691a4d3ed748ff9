//! How far a phase is from showing a target, and in which direction it gets nearer.

use crate::engine::{Engine, Fields};
use crate::photometry::{Comparison, Sums};
use crate::real::Real;
use crate::{Detector, Error, Plane, RegionOfInterest, Result};

/// A target, where it counts, and the display that is to show it.
#[derive(Debug)]
pub struct HologramProblem<T = f32> {
    engine: Engine<T>,
    target: Plane<T>,
    region: RegionOfInterest,
    fields: Fields<T>,
}

/// What an evaluation found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// Σ(s·p − t)² / n in the region of interest, at the gain s that was asked for.
    pub loss: f64,
    /// The gain that fits best: the next evaluation's, where gain is fitted.
    pub best_gain: f64,
    /// The loss at that gain.
    pub best_loss: f64,
}

impl From<Sums> for Evaluation {
    fn from(sums: Sums) -> Self {
        Self { loss: sums.loss(), best_gain: sums.best_gain(), best_loss: sums.best_loss() }
    }
}

impl<T: Real> HologramProblem<T> {
    /// `target`: intensity in linear light, of the engine's size.
    ///
    /// # Errors
    ///
    /// [`Error`] for a target of another size, with values that are negative or not finite, or that is black in all of
    /// the region of interest.
    pub fn new(engine: Engine<T>, target: Plane<T>, region: RegionOfInterest) -> Result<Self> {
        target.expect_size("target_intensity", engine.height_px(), engine.width_px())?;
        target.map(|t| t.wide() as f32).expect_finite("target_intensity")?;
        if let Some(&value) = target.values().iter().find(|value| **value < T::zero()) {
            let allowed = "0 or above";
            return Err(Error::OutOfRange { name: "target_intensity", value: value.wide(), allowed });
        }
        let lit = |y| region.columns(y).is_some_and(|columns| target.row(y)[columns].iter().any(|t| *t > T::zero()));
        if !(0..target.height_px()).any(lit) {
            let needed = "some light is needed in the region of interest";
            return Err(Error::Empty { name: "target_intensity", needed });
        }
        let fields = Fields::new(&engine.convolver);
        Ok(Self { engine, target, region, fields })
    }

    /// The display.
    #[must_use]
    pub fn engine(&self) -> &Engine<T> {
        &self.engine
    }

    /// The loss at `gain` and its gradient ∂L/∂φ, written to `gradient`; both `height_px · width_px` values.
    ///
    /// With the gain fitted in closed form the same gradient is exact at [`Evaluation::best_gain`], since there the loss
    /// does not change with the gain.
    pub fn evaluate(&mut self, phase: &[T], gain: f64, gradient: &mut [T]) -> Evaluation {
        let Self { engine, fields, .. } = self;
        engine.send(phase, fields);
        let Fields { spectrum, tiles } = fields;
        let comparison = compare_with(&self.target, self.region, engine.detector, gain);
        let sums = engine.convolver.compare(tiles, &comparison, spectrum);
        let back = &mut tiles[..engine.convolver.half_spectrum_len(1)];
        engine.convolver.propagate_adjoint(spectrum, &engine.transfer, back);
        let width_px = engine.width_px();
        engine.convolver.inverse_rows(back, gradient, |y, b, out| {
            engine.slm.phase_gradient_row(y, &phase[y * width_px..][..width_px], b, out);
        });
        sums.into()
    }

    /// The loss at `gain` alone, without the way back that its gradient takes.
    pub fn measure(&mut self, phase: &[T], gain: f64) -> Evaluation {
        self.engine.send(phase, &mut self.fields);
        let comparison = compare_with(&self.target, self.region, self.engine.detector, gain);
        self.engine.convolver.measure(&self.fields.tiles, &comparison).into()
    }
}

fn compare_with<T>(picture: &Plane<T>, region: RegionOfInterest, detector: Detector, gain: f64) -> Comparison<'_, T> {
    let weight_sum = region.pixels() as f64;
    Comparison { picture, weight: None, region, detector, gain, offset: 0.0, weight_sum }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::initial_phase;
    use crate::{Carrier, DisplayModel, Grid, KernelShape, OpticalSetup, SmoothField};
    use num_complex::Complex64;

    /// A display with every flaw that the model knows.
    fn flawed(setup: OpticalSetup) -> DisplayModel {
        let smooth = |order, scale: f64| {
            let mut field = SmoothField::flat(order);
            let both = field.log_amplitude.iter_mut().chain(&mut field.phase);
            both.enumerate().for_each(|(i, c)| *c = scale * (1.7 * i as f64 + 0.3).sin());
            field
        };
        DisplayModel {
            kernel: KernelShape::Smooth(smooth(3, 0.3)),
            source: smooth(2, 0.1),
            response: vec![[0.15, -0.05], [0.02, 0.04]],
            zero_order: Complex64::new(0.03, -0.02),
            ..DisplayModel::ideal(setup)
        }
    }

    fn problem(
        height_px: usize,
        width_px: usize,
        detector: Detector,
        carrier: Option<Carrier>,
    ) -> HologramProblem<f64> {
        let grid = Grid::try_new(height_px, width_px, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 3e-3).unwrap();
        let engine = Engine::new(&flawed(setup), detector, carrier).unwrap();
        let target = Plane::from_fn(height_px, width_px, |y, x| 0.5 + 0.5 * ((3 * y + 5 * x) as f64).sin());
        HologramProblem::new(engine, target, RegionOfInterest::middle(&grid)).unwrap()
    }

    #[test]
    fn the_gradient_is_that_of_central_differences() {
        for (height_px, width_px) in [(16, 24), (17, 13), (11, 30)] {
            for detector in Detector::ALL {
                for carrier in [None, Some(Carrier::HalfOrderX), Some(Carrier::HalfOrderY)] {
                    let mut problem = problem(height_px, width_px, detector, carrier);
                    let phase = initial_phase(height_px, width_px, 6.0, 5).unwrap().map(f64::from).into_vec();
                    let direction: Vec<f64> = (0..phase.len()).map(|i| (i as f64 * 2.3).cos()).collect();
                    let mut gradient = vec![0.0; phase.len()];
                    problem.evaluate(&phase, 0.7, &mut gradient);
                    let slope: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
                    let h = 1e-5;
                    let mut at = |step: f64| {
                        let moved: Vec<f64> = phase.iter().zip(&direction).map(|(p, d)| p + step * d).collect();
                        problem.measure(&moved, 0.7).loss
                    };
                    let difference = (at(h) - at(-h)) / (2.0 * h);
                    let error = (slope - difference).abs() / difference.abs();
                    assert!(error < 1e-6, "{detector:?} {carrier:?}: {slope} against {difference}");
                }
            }
        }
    }

    #[test]
    fn the_fitted_gain_is_the_best_one() {
        let mut problem = problem(20, 20, Detector::Pixel, None);
        let phase = vec![0.5; 400];
        let best = problem.measure(&phase, 1.0);
        let at_best = problem.measure(&phase, best.best_gain);
        assert!((at_best.loss - best.best_loss).abs() < 1e-12);
        for gain in [0.99, 1.01] {
            assert!(problem.measure(&phase, gain * best.best_gain).loss > at_best.loss);
        }
    }
}
