//! Gerchberg–Saxton with a phase-only modulator, and its weighted variant.
//!
//! ```text
//! u = A c,   c′ = c − Aᴴ[ w ( 1 − W√t / (s√p) ) u ],   φ ← phase that shows arg c′
//! weighted:  W ← W · √t / (s√p)
//! ```
//!
//! c the field on the SLM, A the propagation, p the detector's light, t the target, s the gain that fits the amplitudes best,
//! w the weights, W 1 at first. In the picture the amplitude becomes the target's and the phase stays; outside, where w = 0,
//! the light stays as it is. For a unitary A this is the round trip of R. Gerchberg and W. Saxton, Optik 35, 237 (1972);
//! written as a difference it also serves a cropped A, several sub-samples, planes and frames, whose corrections are
//! averaged. The weights raise the target where light is missing: R. Di Leonardo, F. Ianni and G. Ruocco, Optics Express
//! 15, 1913 (2007).

use super::problem::HologramProblem;
use crate::real::Real;
use crate::{Evaluation, Plane};
use num_complex::Complex;
use rayon::prelude::*;

/// Fields on the SLM on their way.
#[derive(Debug)]
pub(super) struct GerchbergSaxton<T> {
    /// W√t of each plane.
    pub(super) wanted: Vec<Plane<T>>,
    weighted: bool,
    field: Vec<Complex<T>>,
}

impl<T: Real> GerchbergSaxton<T> {
    /// Goes on from `wanted`, or begins with the targets themselves.
    pub(super) fn new(problem: &HologramProblem<T>, weighted: bool, wanted: Option<Vec<Plane<T>>>) -> Self {
        Self {
            wanted: wanted.unwrap_or_else(|| problem.target_amplitudes()),
            weighted,
            field: vec![Complex::new(T::zero(), T::zero()); problem.parameters()],
        }
    }

    /// One round. The evaluation is that of the phase before it.
    pub(super) fn step(&mut self, problem: &mut HologramProblem<T>, phase: &mut [T]) -> Evaluation {
        let evaluation = problem.excess(phase, &mut self.wanted, self.weighted, &mut self.field);
        let engine = problem.engine();
        let (height_px, width_px) = (engine.height_px(), engine.width_px());
        phase.par_chunks_mut(width_px).zip(self.field.par_chunks(width_px)).enumerate().for_each_init(
            || engine.convolver.scratch.take(),
            |scratch, (i, (phase, excess))| {
                let (y, field) = (i % height_px, &mut scratch.row[..width_px]);
                engine.slm.field_row(y, phase, field);
                field.iter_mut().zip(excess).for_each(|(c, &excess)| *c = *c - excess);
                engine.slm.phase_of_row(y, field, phase);
            },
        );
        evaluation
    }
}
