//! [Adam](crate::optimizer::adam) on the phase, with the gain fitted.
//!
//! The loss is a mean over the region of interest, so its gradient shrinks with the number of pixels; it is scaled by
//! that number, which leaves Adam's steps as they are but keeps its ε small.

use super::problem::ProblemCore;
use crate::Evaluation;
use crate::optimizer::adam::AdamStep;
use pulp::Arch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Everything that a step depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AdamState {
    /// φ \[rad\], not wrapped; row-major.
    pub(super) phase: Vec<f32>,
    /// m
    pub(super) first_moment: Vec<f32>,
    /// v
    pub(super) second_moment: Vec<f32>,
    /// Steps done.
    pub(super) iteration: u32,
    /// The gain that the next step compares with.
    pub(super) gain: f64,
}

impl AdamState {
    /// At the start, at the gain that fits best.
    pub(super) fn new(problem: &mut ProblemCore<f32>, phase: Vec<f32>) -> Self {
        let gain = problem.measure(&phase, 1.0).best_gain;
        let zeros = vec![0.0; phase.len()];
        Self { phase, first_moment: zeros.clone(), second_moment: zeros, iteration: 0, gain }
    }

    /// One step. The evaluation is that of the phase before it. The gain is the best fit of the step before, which costs no
    /// pass of its own.
    pub(super) fn step(
        &mut self,
        problem: &mut ProblemCore<f32>,
        learning_rate: f64,
        gradient: &mut [f32],
    ) -> Evaluation {
        let evaluation = problem.evaluate(&self.phase, self.gain, gradient);
        self.gain = evaluation.best_gain;
        self.iteration += 1;
        let width_px = problem.engine().width_px();
        let scale = gradient.len() as f64;
        let step = AdamStep::new(learning_rate, self.iteration, scale);
        let arch = Arch::new();
        (
            self.phase.par_chunks_mut(width_px),
            self.first_moment.par_chunks_mut(width_px),
            self.second_moment.par_chunks_mut(width_px),
            gradient.par_chunks(width_px),
        )
            .into_par_iter()
            .for_each(|(phase, m, v, g)| arch.dispatch(|| step.take(phase, m, v, g)));
        evaluation
    }
}
