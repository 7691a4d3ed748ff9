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

    /// The loss at `gain` alone, at a third of the cost.
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

/// Peak signal-to-noise ratios [dB] in the region of interest, peak 1, gain fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// At the sample points.
    pub psnr_point_db: f64,
    /// Integrated over the pixels.
    pub psnr_pixel_db: f64,
    /// Over all sub-samples.
    pub psnr_supersampled_db: f64,
}

/// How well `phase` shows `target` on the engine's display, in all three detectors.
///
/// # Errors
///
/// As [`HologramProblem::new`], and for a phase of another size.
pub fn quality<T: Real>(
    engine: &Engine<T>,
    phase: &Plane<T>,
    target: &Plane<T>,
    region: RegionOfInterest,
) -> Result<Quality> {
    phase.expect_size("phase", engine.height_px(), engine.width_px())?;
    let psnr_db = |detector| -> Result<f64> {
        let mut problem = HologramProblem::new(engine.with_detector(detector), target.clone(), region)?;
        Ok(-10.0 * problem.measure(phase.values(), 1.0).best_loss.log10())
    };
    Ok(Quality {
        psnr_point_db: psnr_db(Detector::Point)?,
        psnr_pixel_db: psnr_db(Detector::Pixel)?,
        psnr_supersampled_db: psnr_db(Detector::Supersampled)?,
    })
}
