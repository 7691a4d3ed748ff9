//! Loss of a hologram's phases and its gradient.

use super::loss::{ImagePlane, Loss, PlaneInput, TargetPlane, weighted_sums};
use super::stopwatch::Stopwatch;
use super::two_passes::Buffers;
use crate::engine::Real;
use crate::engine::photometry::{Comparison, Quantity, Sums};
use crate::engine::{Engine, EngineCore, Fields};
use crate::error::{Error, Result};
use crate::numerics::{Plane, RegionOfInterest};
use num_complex::Complex;

/// Target pictures of a hologram and the display that shows them: one picture, or several at different distances. The
/// hologram is one phase, or several *frames* that are shown so fast that the eye sees the mean of their light.
///
/// Phases and gradients hold the rows of one frame after the other: `frames · height_px · width_px` values. All planes
/// share one gain, as in a single exposure.
#[derive(Debug)]
pub struct HologramProblem {
    pub(super) core: ProblemCore<f32>,
}

/// A [`HologramProblem`] in the precision `T`: f32 in production, f64 in tests of its gradients.
#[derive(Debug)]
pub(super) struct ProblemCore<T> {
    pub(super) planes: Vec<TargetPlane<T>>,
    pub(super) frames: usize,
    pub(super) region: RegionOfInterest,
    pub(super) loss: Loss,
    pub(super) fields: Fields<T>,
    pub(super) buffers: Buffers<T>,
    pub(super) stopwatch: Stopwatch,
}

/// Loss and best gain of a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// The [loss](Loss) at the gain s that the caller gave, or at the best gain if none was given.
    pub loss: f64,
    /// Gain that fits best. Methods whose gain lags by one step use it in their next evaluation.
    pub best_gain: f64,
    /// The loss at [`Self::best_gain`].
    pub best_loss: f64,
}

impl Evaluation {
    pub(super) fn new(sums: &Sums, roughness: f64) -> Self {
        let (loss, best_loss) = (sums.loss() + roughness, sums.best_loss() + roughness);
        Self { loss, best_gain: sums.best_gain(), best_loss }
    }
}

/// Destination of what propagates back from the image planes.
pub(super) enum Sink<'a, T> {
    /// Gradient ∂L/∂φ.
    Gradient(&'a mut [T]),
    /// Field on the SLM, Aᴴg.
    Field(&'a mut [Complex<T>]),
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
    /// [`Error`] for no planes or frames, engines of different sizes or detectors, a target or weight of another size
    /// or with values that are negative or not finite, a plane in which all weights are 0, targets that are black
    /// wherever the weight is positive, or a loss out of range.
    pub fn with_planes(planes: Vec<ImagePlane>, frames: usize, region: RegionOfInterest, loss: Loss) -> Result<Self> {
        let planes = planes.into_iter().map(PlaneInput::from).collect();
        Ok(Self { core: ProblemCore::with_planes(planes, frames, region, loss)? })
    }

    /// Engine of the first plane, which models the display at that plane's distance.
    #[must_use]
    pub fn engine(&self) -> Engine {
        Engine { core: self.core.engine().clone() }
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.core.frames
    }

    /// Number of target pictures.
    #[must_use]
    pub fn planes(&self) -> usize {
        self.core.planes.len()
    }

    /// Loss function of the problem.
    #[must_use]
    pub fn loss(&self) -> &Loss {
        &self.core.loss
    }

    /// Number of values in a phase or a gradient, `frames · height_px · width_px`.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.core.parameters()
    }

    /// Evaluates the loss at `gain` and writes its gradient ∂L/∂φ to `gradient`.
    ///
    /// At [`Evaluation::best_gain`] this gradient equals that of the loss with fitted gain, because the derivative of
    /// the loss by the gain is 0 there.
    pub fn evaluate(&mut self, phase: &[f32], gain: f64, gradient: &mut [f32]) -> Evaluation {
        self.core.evaluate(phase, gain, gradient)
    }

    /// Evaluates the loss at the gain that fits best, min over s of the [loss](Loss), and writes its gradient to
    /// `gradient`.
    pub fn evaluate_fitted(&mut self, phase: &[f32], gradient: &mut [f32]) -> Evaluation {
        self.core.evaluate_fitted(phase, gradient)
    }

    /// Evaluates the loss at `gain` without its gradient, which saves the propagation back.
    pub fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        self.core.measure(phase, gain)
    }
}

impl<T: Real> ProblemCore<T> {
    /// Creates and checks a problem, see [`HologramProblem::with_planes`].
    pub(super) fn with_planes(
        planes: Vec<PlaneInput<T>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Self> {
        loss.validate(region)?;
        let Some(first) = planes.first() else {
            return Err(Error::Empty { name: "planes", needed: "at least one picture is needed" });
        };
        if frames == 0 {
            return Err(Error::OutOfRange { name: "frames", value: 0.0, allowed: "at least 1" });
        }
        let first = first.engine.clone();
        for plane in &planes {
            plane.target.expect_size("target_intensity", first.height_px(), first.width_px())?;
            if plane.engine.detector() != first.detector() {
                return Err(Error::Incompatible { name: "planes", reason: "all planes must have the same detector" });
            }
        }
        let shares = planes.iter().map(|plane| plane.share).sum();
        let checked = planes.into_iter().map(|plane| TargetPlane::new(plane, region, &loss, shares));
        let planes = checked.collect::<Result<Vec<_>>>()?;
        if !planes.iter().any(|plane| plane.is_lit(region)) {
            let needed = "some light is needed in the region of interest";
            return Err(Error::Empty { name: "target_intensity", needed });
        }
        let fields = Fields::for_all(planes.iter().map(|plane| &plane.engine));
        Ok(Self { planes, frames, region, loss, fields, buffers: Buffers::empty(), stopwatch: Stopwatch::default() })
    }

    pub(super) fn engine(&self) -> &EngineCore<T> {
        &self.planes[0].engine
    }

    pub(super) fn parameters(&self) -> usize {
        self.frames * self.frame_len()
    }

    /// Whether the light must be added up or blurred before it is compared, or kept to be compared with itself.
    fn needs_two_passes(&self) -> bool {
        self.frames > 1 || self.loss.has_roughness() || self.planes.iter().any(|plane| plane.engine.needs_all_light())
    }

    pub(super) fn frame_len(&self) -> usize {
        self.engine().height_px() * self.engine().width_px()
    }

    /// Evaluates the loss at `gain` and its gradient, see [`HologramProblem::evaluate`].
    pub(super) fn evaluate(&mut self, phase: &[T], gain: f64, gradient: &mut [T]) -> Evaluation {
        if self.needs_two_passes() {
            return self.evaluate_in_two(phase, Some(gain), gradient);
        }
        let begin = self.stopwatch.start();
        let sums = weighted_sums(self.planes.len(), |p| {
            let plane = &self.planes[p];
            let engine = &plane.engine;
            engine.send(phase, &mut self.fields);
            let Fields { spectrum, tiles } = &mut self.fields;
            let comparison = compare_with(plane, self.loss.quantity, self.region, gain);
            let sums = engine.convolver.compare(tiles, &comparison, spectrum);
            send_back(engine, &mut self.fields, phase, &mut Sink::Gradient(gradient), p > 0);
            (sums, plane.share)
        });
        self.stopwatch.stop(begin);
        Evaluation::new(&sums, 0.0)
    }

    /// Evaluates the loss at the best gain and its gradient, see [`HologramProblem::evaluate_fitted`].
    pub(super) fn evaluate_fitted(&mut self, phase: &[T], gradient: &mut [T]) -> Evaluation {
        self.evaluate_in_two(phase, None, gradient)
    }

    /// Evaluates the loss at `gain` without its gradient, see [`HologramProblem::measure`].
    pub(super) fn measure(&mut self, phase: &[T], gain: f64) -> Evaluation {
        if self.needs_two_passes() {
            self.compute_light(phase);
            let sums = weighted_sums(self.planes.len(), |p| self.measure_plane(p, gain));
            let roughness = (0..self.planes.len()).map(|p| self.roughness(p)).sum();
            return Evaluation::new(&sums, roughness);
        }
        let sums = weighted_sums(self.planes.len(), |p| {
            let plane = &self.planes[p];
            plane.engine.send(phase, &mut self.fields);
            let comparison = compare_with(plane, self.loss.quantity, self.region, gain);
            (plane.engine.convolver.measure(&self.fields.tiles, &comparison), plane.share)
        });
        Evaluation::new(&sums, 0.0)
    }
}

impl<T> Sink<'_, T> {
    pub(super) fn frame(&mut self, f: usize, frame_len: usize) -> Sink<'_, T> {
        let range = f * frame_len..(f + 1) * frame_len;
        match self {
            Self::Gradient(gradient) => Sink::Gradient(&mut gradient[range]),
            Self::Field(field) => Sink::Field(&mut field[range]),
        }
    }
}

/// Propagates the half-transformed gradient in the spectrum back to the SLM. Adds the result to the sink if `add` is
/// true, otherwise overwrites the sink.
pub(super) fn send_back<T: Real>(
    engine: &EngineCore<T>,
    fields: &mut Fields<T>,
    phase: &[T],
    sink: &mut Sink<'_, T>,
    add: bool,
) {
    let slm = &engine.slm;
    match sink {
        Sink::Gradient(gradient) => {
            let shown = slm.shown(phase);
            if slm.crosstalk.is_some() {
                let mut by_shown = vec![T::zero(); phase.len()];
                engine.return_rows(fields, &mut by_shown, |y, b, out| {
                    slm.phase_gradient_row(y, shown.row(y), b, out);
                });
                return slm.gradient_of_displayed(&by_shown, add, gradient);
            }
            engine.return_rows(fields, gradient, |y, b, out| {
                if add {
                    slm.add_phase_gradient_row(y, shown.row(y), b, out);
                } else {
                    slm.phase_gradient_row(y, shown.row(y), b, out);
                }
            });
        }
        Sink::Field(field) => engine.return_rows(fields, field, |_, b, out| {
            if add {
                out.iter_mut().zip(b).for_each(|(out, &b)| *out = *out + b);
            } else {
                out.copy_from_slice(b);
            }
        }),
    }
}

pub(super) fn compare_with<T>(
    plane: &TargetPlane<T>,
    quantity: Quantity,
    region: RegionOfInterest,
    gain: f64,
) -> Comparison<'_, T> {
    Comparison {
        quantity,
        picture: &plane.picture,
        weight: plane.weight.as_ref(),
        region,
        detector: plane.engine.detector,
        gain,
        offset: 0.0,
        weight_sum: plane.weight_sum / plane.share,
    }
}

#[cfg(test)]
#[path = "problem_tests.rs"]
mod tests;
