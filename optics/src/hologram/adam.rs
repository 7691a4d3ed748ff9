//! [Adam](crate::optimizer::adam) on the phase, with the gain fitted.
//!
//! The loss is a mean over the region of interest, so its gradient shrinks with the number of pixels; it is scaled by
//! that number, which leaves Adam's steps as they are but keeps its ε small.

use super::HologramProblem;
use crate::optimizer::adam::AdamStep;
use crate::real::Real;
use crate::{Error, Evaluation, Plane, Result};
use pulp::Arch;
use rayon::prelude::*;

/// Everything that a step depends on: saved and restored, the optimization goes on to the same bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct AdamState<T = f32> {
    /// φ \[rad\], not wrapped; row-major.
    pub phase: Vec<T>,
    /// m
    pub first_moment: Vec<T>,
    /// v
    pub second_moment: Vec<T>,
    /// Steps done.
    pub iteration: u32,
    /// The gain that the next step compares with.
    pub gain: f64,
}

/// An optimization under way.
#[derive(Debug)]
pub struct Adam<T = f32> {
    problem: HologramProblem<T>,
    learning_rate: f64,
    state: AdamState<T>,
    gradient: Vec<T>,
}

impl<T: Real> Adam<T> {
    /// Starts from `phase`, with steps of `learning_rate` \[rad\].
    ///
    /// # Errors
    ///
    /// [`Error`] for a phase of another size or a learning rate that is not above 0 and at most 10.
    pub fn start(mut problem: HologramProblem<T>, learning_rate: f64, phase: Plane<T>) -> Result<Self> {
        let (height_px, width_px) = (problem.frames() * problem.engine().height_px(), problem.engine().width_px());
        phase.expect_size("phase", height_px, width_px)?;
        let state = AdamState::new(&mut problem, phase.into_vec());
        Self::resume(problem, learning_rate, state)
    }

    /// Goes on from where [`Self::state`] was taken, with the same problem and learning rate.
    ///
    /// # Errors
    ///
    /// [`Error`] for a state of another size or a learning rate that is not above 0 and at most 10.
    pub fn resume(problem: HologramProblem<T>, learning_rate: f64, state: AdamState<T>) -> Result<Self> {
        if !(learning_rate > 0.0 && learning_rate <= 10.0) {
            let allowed = "above 0 and at most 10 rad";
            return Err(Error::OutOfRange { name: "learning_rate", value: learning_rate, allowed });
        }
        let (height_px, width_px) = (problem.frames() * problem.engine().height_px(), problem.engine().width_px());
        for values in [&state.phase, &state.first_moment, &state.second_moment] {
            if values.len() != height_px * width_px {
                return Err(Error::SizeMismatch {
                    name: "state",
                    width_px,
                    height_px,
                    actual_width_px: values.len(),
                    actual_height_px: 1,
                });
            }
        }
        let gradient = vec![T::zero(); height_px * width_px];
        Ok(Self { problem, learning_rate, state, gradient })
    }

    /// One step. The evaluation is that of the phase before it.
    ///
    /// The gain is the best fit of the step before, which costs no pass of its own.
    pub fn step(&mut self) -> Evaluation {
        self.state.step(&mut self.problem, self.learning_rate, &mut self.gradient)
    }

    /// Everything that the next step depends on.
    #[must_use]
    pub fn state(&self) -> &AdamState<T> {
        &self.state
    }

    /// Ends the optimization.
    #[must_use]
    pub fn into_state(self) -> AdamState<T> {
        self.state
    }
}

impl<T: Real> AdamState<T> {
    /// At the start, at the gain that fits best.
    pub(super) fn new(problem: &mut HologramProblem<T>, phase: Vec<T>) -> Self {
        let gain = problem.measure(&phase, 1.0).best_gain;
        let zeros = vec![T::zero(); phase.len()];
        Self { phase, first_moment: zeros.clone(), second_moment: zeros, iteration: 0, gain }
    }

    pub(super) fn step(
        &mut self,
        problem: &mut HologramProblem<T>,
        learning_rate: f64,
        gradient: &mut [T],
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
