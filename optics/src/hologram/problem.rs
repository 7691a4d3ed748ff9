//! A hologram's target pictures with the display that shows them.

use super::backend::{Backend, Picture};
use super::evaluate::{Evaluation, Project};
use super::loss::{ImagePlane, Loss, PlaneInput, check_planes};
use super::processor::ProcessorProblem;
use crate::engine::Engine;
use crate::error::Result;
use crate::metrics::Gain;
use crate::numerics::{Plane, RegionOfInterest};

/// Target pictures of a hologram and the display that shows them: one picture, or several at different distances. The
/// hologram is one phase, or several *frames* that are shown so fast that the eye sees the mean of their light.
///
/// Phases and gradients hold the rows of one frame after the other: `frames · height_px · width_px` values. All planes
/// share one gain, as in a single exposure.
#[derive(Debug)]
pub struct HologramProblem {
    loss: Loss,
    /// What computes.
    pub(super) body: Box<dyn Project>,
}

impl HologramProblem {
    /// Problem with one picture and one frame, compared by intensity. `target` is intensity in linear light, of the
    /// engine's size.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::with_planes`].
    pub fn new(engine: Engine, target: Plane<f32>, region: RegionOfInterest) -> Result<Self> {
        Self::with_planes(vec![ImagePlane::new(engine, target)], 1, region, Loss::default())
    }

    /// Problem with any number of pictures and frames and any loss.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::Error) for no planes or frames, engines of different sizes or detectors, a target or weight of
    /// another size or with values that are negative or not finite, a plane in which all weights are 0, targets that are
    /// black wherever the weight is positive, or a loss out of range.
    pub fn with_planes(planes: Vec<ImagePlane>, frames: usize, region: RegionOfInterest, loss: Loss) -> Result<Self> {
        let planes: Vec<_> = planes.into_iter().map(PlaneInput::from).collect();
        check_planes(&planes.iter().map(PlaneInput::unchecked).collect::<Vec<_>>(), frames, region, &loss)?;
        Ok(Self { loss, body: Box::new(ProcessorProblem::with_planes(planes, frames, region, loss)) })
    }

    /// The same problem on any machine, which prepares the displays for itself.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::with_planes`], and those of [`Backend::hologram`].
    pub fn on(
        backend: &dyn Backend,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Self> {
        check_planes(&pictures.iter().map(Picture::unchecked).collect::<Vec<_>>(), frames, region, &loss)?;
        Ok(Self { loss, body: backend.hologram(pictures, frames, region, loss)? })
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.body.size().frames
    }

    /// Number of target pictures.
    #[must_use]
    pub fn planes(&self) -> usize {
        self.body.size().planes
    }

    /// Loss function of the problem.
    #[must_use]
    pub fn loss(&self) -> &Loss {
        &self.loss
    }

    /// Number of values in a phase or a gradient, `frames · height_px · width_px`.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.body.size().parameters()
    }

    /// Evaluates the loss at `gain` and writes its gradient ∂L/∂φ to `gradient`.
    ///
    /// At [`Evaluation::best_gain`] this gradient equals that of the loss with fitted gain, because the derivative of
    /// the loss by the gain is 0 there.
    pub fn evaluate(&mut self, phase: &[f32], gain: f64, gradient: &mut [f32]) -> Evaluation {
        self.body.evaluate(phase, Gain::Given(gain), gradient)
    }

    /// Evaluates the loss at the gain that fits best, min over s of the [loss](Loss), and writes its gradient to
    /// `gradient`.
    pub fn evaluate_fitted(&mut self, phase: &[f32], gradient: &mut [f32]) -> Evaluation {
        self.body.evaluate(phase, Gain::Fitted, gradient)
    }

    /// Evaluates the loss at `gain` without its gradient, which saves the propagation back.
    pub fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        self.body.measure(phase, gain)
    }
}
