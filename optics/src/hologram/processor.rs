//! A hologram's problem on the processor: the loss of its phases and the gradient, in fused passes on all threads.

use super::evaluate::Evaluation;
use super::loss::{Loss, PlaneInput, TargetPlane, weighted_sums};
use super::two_pass_buffers::Buffers;
use crate::engine::photometry::{Comparison, Quantity};
use crate::engine::{EngineCore, Fields, Real};
use crate::metrics::Gain;
use crate::numerics::RegionOfInterest;
use num_complex::Complex;

/// A [`HologramProblem`](super::HologramProblem) in the precision `T`: f32 in production, f64 in tests of its gradients.
#[derive(Debug)]
pub(super) struct ProcessorProblem<T> {
    pub(super) planes: Vec<TargetPlane<T>>,
    pub(super) frames: usize,
    pub(super) region: RegionOfInterest,
    pub(super) loss: Loss,
    pub(super) fields: Fields<T>,
    pub(super) buffers: Buffers<T>,
    /// Scratch field of a projection; empty until one needs it.
    pub(super) field: Vec<Complex<T>>,
}

/// Destination of what propagates back from the image planes.
pub(super) enum Sink<'a, T> {
    /// Gradient ∂L/∂φ.
    Gradient(&'a mut [T]),
    /// Field on the SLM, Aᴴg.
    Field(&'a mut [Complex<T>]),
}

impl<T: Real> ProcessorProblem<T> {
    /// Takes planes that [`check_planes`](super::loss::check_planes) has checked.
    pub(super) fn with_planes(planes: Vec<PlaneInput<T>>, frames: usize, region: RegionOfInterest, loss: Loss) -> Self {
        let shares = planes.iter().map(|plane| plane.share).sum();
        let planes: Vec<_> = planes.into_iter().map(|plane| TargetPlane::new(plane, region, &loss, shares)).collect();
        let fields = Fields::for_all(planes.iter().map(|plane| &plane.engine));
        Self { planes, frames, region, loss, fields, buffers: Buffers::empty(), field: Vec::new() }
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

    /// Evaluates the loss and its gradient, see [`Evaluate::evaluate`](super::Evaluate::evaluate).
    pub(super) fn evaluate(&mut self, phase: &[T], gain: Gain, gradient: &mut [T]) -> Evaluation {
        let gain = match gain {
            Gain::Given(gain) if !self.needs_two_passes() => gain,
            _ => return self.evaluate_in_two(phase, gain, gradient),
        };
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
        Evaluation::new(&sums, 0.0)
    }

    /// Evaluates the loss at `gain` without its gradient, see [`Evaluate::measure`](super::Evaluate::measure).
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
#[path = "processor_tests.rs"]
mod tests;
