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
        phase.expect_size("phase", problem.engine().height_px(), problem.engine().width_px())?;
        let gain = problem.measure(phase.values(), 1.0).best_gain;
        let zeros = vec![T::zero(); phase.values().len()];
        let state = AdamState {
            phase: phase.into_vec(),
            first_moment: zeros.clone(),
            second_moment: zeros,
            iteration: 0,
            gain,
        };
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
        let (height_px, width_px) = (problem.engine().height_px(), problem.engine().width_px());
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
        let evaluation = self.problem.evaluate(&self.state.phase, self.state.gain, &mut self.gradient);
        self.state.gain = evaluation.best_gain;
        self.state.iteration += 1;
        let width_px = self.problem.engine().width_px();
        let scale = self.gradient.len() as f64;
        let step = AdamStep::new(self.learning_rate, self.state.iteration, scale);
        let arch = Arch::new();
        let state = &mut self.state;
        (
            state.phase.par_chunks_mut(width_px),
            state.first_moment.par_chunks_mut(width_px),
            state.second_moment.par_chunks_mut(width_px),
            self.gradient.par_chunks(width_px),
        )
            .into_par_iter()
            .for_each(|(phase, m, v, g)| arch.dispatch(|| step.take(phase, m, v, g)));
        evaluation
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
