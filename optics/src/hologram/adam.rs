//! Hologram optimization with [Adam](crate::numerics::optimizer::adam): updates the phases and fits the gain.
//!
//! The loss is a mean over the region of interest, so its gradient shrinks as the number of pixels grows. The gradient
//! is therefore multiplied by the number of phases. This does not change Adam's steps, but it keeps Adam's ε small
//! beside the gradient.

use super::evaluate::{Evaluate, Evaluation};
use crate::interrupt;
use crate::metrics::Gain;
use crate::numerics::optimizer::adam::AdamStep;
use pulp::Arch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// State of Adam between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct AdamState {
    /// Phases φ \[rad\], not wrapped, in row-major order.
    pub(super) phase: Vec<f32>,
    /// First moment m of the gradient.
    pub(super) first_moment: Vec<f32>,
    /// Second moment v of the gradient.
    pub(super) second_moment: Vec<f32>,
    /// Number of steps done.
    pub(super) iteration: u32,
    /// Gain at which the next step compares the light with the target.
    pub(super) gain: f64,
}

impl AdamState {
    /// Initial state for `phase`, with the gain that fits best.
    pub(super) fn new(problem: &mut dyn Evaluate, phase: Vec<f32>) -> Self {
        let gain = problem.measure(&phase, 1.0).best_gain;
        let zeros = vec![0.0; phase.len()];
        Self { phase, first_moment: zeros.clone(), second_moment: zeros, iteration: 0, gain }
    }

    /// Takes one step and returns the evaluation of the phase before it. The gain is the best fit of the previous
    /// evaluation, so it costs no extra pass.
    pub(super) fn step(&mut self, problem: &mut dyn Evaluate, learning_rate: f64, gradient: &mut [f32]) -> Evaluation {
        let evaluation = problem.evaluate(&self.phase, Gain::Given(self.gain), gradient);
        self.gain = evaluation.best_gain;
        self.iteration += 1;
        let width_px = problem.size().width_px;
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
            .for_each(|(phase, m, v, g)| {
                interrupt::check();
                arch.dispatch(|| step.take(phase, m, v, g));
            });
        evaluation
    }
}
