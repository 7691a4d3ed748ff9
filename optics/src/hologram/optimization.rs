//! Common interface of all optimization methods: start, step, save and resume.

use super::adam::AdamState;
use super::double_phase::double_phase;
use super::evaluate::{Evaluate, Evaluation, ProblemSize};
use super::options::{HologramMethod, HologramOptions};
use super::problem::HologramProblem;
use super::state::{OptimizationState, Run};
use super::stopwatch::{Clock, Stopwatch, Timed};
use crate::error::Result;
use crate::metrics::Gain;
use crate::numerics::Plane;
use crate::numerics::optimizer::limited_memory::{LimitedMemory, Workspace};
use std::time::Duration;

/// Smallest part of the loss that rounding must add for the last third of the steps to be spent on it.
const ROUNDING_LOSS_MIN: f64 = 1.0;

/// A running optimization of the phases of a [`HologramProblem`].
#[derive(Debug)]
pub struct Optimization {
    pub(super) problem: HologramProblem,
    options: HologramOptions,
    pub(super) state: OptimizationState,
    scratch: Scratch,
    stopwatch: Stopwatch,
}

/// Scratch memory whose contents do not matter between steps; empty until a method needs it.
#[derive(Debug, Default)]
struct Scratch {
    gradient: Vec<f32>,
    /// Scratch memory of L-BFGS.
    workspace: Workspace,
}

/// Progress and evaluation of one optimization step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Number of steps done.
    pub iteration: u32,
    /// Total number of steps.
    pub iterations: u32,
    /// Evaluation of the phase that this step evaluated, before the phase was changed.
    pub evaluation: Evaluation,
}

impl Optimization {
    /// Starts an optimization from `phases` \[rad\], which hold the rows of one frame after the other.
    /// [`HologramMethod::DoublePhase`] takes them as the phases of the light in the image.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::Error) for phases of another size, phases that are not finite, or options out of range.
    pub fn start(mut problem: HologramProblem, options: HologramOptions, phases: Vec<f32>) -> Result<Self> {
        options.validate()?;
        let body = &mut *problem.body;
        let size = body.size();
        let phase = Plane::try_from_vec(size.frames * size.height_px, size.width_px, phases)?;
        phase.expect_finite("initial_phase")?;
        let phase = phase.into_vec();
        let run = match options.method {
            HologramMethod::Adam { .. } => {
                let gain = body.measure(&phase, 1.0).best_gain;
                Run::Adam(AdamState::new(phase, gain))
            }
            HologramMethod::Lbfgs => Run::Lbfgs { memory: Box::new(LimitedMemory::new(phase)), gain: 0.0 },
            HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => {
                Run::GerchbergSaxton { wanted: body.target_amplitudes(), phase }
            }
            HologramMethod::DoublePhase => {
                let (phase, largest_amplitude) = double_phase(body, &phase);
                Run::DoublePhase { phase, largest_amplitude }
            }
        };
        Ok(Self::at(problem, options, OptimizationState { iteration: 0, run }))
    }

    /// State that the next step depends on; `Self::resume` continues from a copy of it.
    #[must_use]
    pub fn state(&self) -> &OptimizationState {
        &self.state
    }

    /// Continues an optimization from a copy of [`Self::state`], with the same problem and options.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::Error) for options out of range, or a state that does not belong to this problem and these
    /// options.
    pub fn resume(problem: HologramProblem, options: HologramOptions, state: OptimizationState) -> Result<Self> {
        options.validate()?;
        state.check(problem.body.size(), &options)?;
        Ok(Self::at(problem, options, state))
    }

    fn at(problem: HologramProblem, options: HologramOptions, state: OptimizationState) -> Self {
        Self { problem, options, state, scratch: Scratch::default(), stopwatch: Stopwatch::default() }
    }

    /// Measures the time of later evaluations with `clock`; see `Self::evaluation_time`.
    #[must_use]
    pub fn timed_by(mut self, clock: Clock) -> Self {
        self.stopwatch.clock = Some(clock);
        self
    }

    /// Total time of the evaluations of loss and gradient since `Self::timed_by` set a clock; zero without a clock.
    /// It covers the Fourier transforms and the work done in the same passes over memory. The rest of a step's time is
    /// spent in the method itself.
    #[must_use]
    pub fn evaluation_time(&self) -> Duration {
        self.stopwatch.spent
    }

    /// Takes the next step; `None` once all steps are done.
    pub fn step(&mut self) -> Option<Step> {
        let mut taken = None;
        self.steps(1, |step| taken = Some(step));
        taken
    }

    /// Takes at least one step, at most `most`, and calls `each` with each; with none once all steps are done. Adam takes
    /// as many as it can in one call of [`Evaluate::adam_steps`], the others one. The steps are the same as those of
    /// [`Self::step`].
    pub fn steps(&mut self, most: u32, mut each: impl FnMut(Step)) {
        let (first, iterations) = (self.state.iteration, self.options.all_iterations());
        let free_steps = self.options.free_iterations().saturating_sub(first);
        let (Run::Adam(adam), HologramMethod::Adam { learning_rate }) = (&mut self.state.run, self.options.method)
        else {
            self.single_step().into_iter().for_each(each);
            return;
        };
        // The step to the levels of the display is taken between two steps.
        if free_steps == 0 {
            self.single_step().into_iter().for_each(each);
            return;
        }
        let gradient = &mut self.scratch.gradient;
        gradient.resize(adam.phase.len(), 0.0);
        let mut problem = Timed { body: &mut *self.problem.body, stopwatch: &mut self.stopwatch };
        let mut iteration = first;
        problem.adam_steps(adam, learning_rate, free_steps.min(most.max(1)), gradient, &mut |evaluation| {
            iteration += 1;
            each(Step { iteration, iterations, evaluation });
        });
        self.state.iteration = iteration;
    }

    /// One step of any method; `None` once all steps are done.
    fn single_step(&mut self) -> Option<Step> {
        let (iterations, free_iterations) = (self.options.all_iterations(), self.options.free_iterations());
        if self.state.iteration >= iterations {
            return None;
        }
        if self.state.iteration == free_iterations && self.loses_by_rounding() {
            self.state.run.round();
        }
        let evaluation = self.advance();
        self.state.iteration += 1;
        if self.has_converged() {
            // L-BFGS cannot find a better point, so the remaining steps without rounding are skipped.
            let end = if self.state.iteration <= free_iterations { free_iterations } else { iterations };
            self.state.iteration = end;
        }
        Some(Step { iteration: self.state.iteration, iterations, evaluation })
    }

    fn has_converged(&self) -> bool {
        matches!(&self.state.run, Run::Lbfgs { memory, .. } if memory.counts.converged)
    }

    /// Whether rounding the present phases to the levels costs more than further steps without rounding may gain.
    fn loses_by_rounding(&mut self) -> bool {
        let Some(levels) = &self.options.levels else { return false };
        let ProblemSize { height_px, width_px, .. } = self.problem.body.size();
        let phases = self.state.phases();
        let mut shown = vec![0.0; phases.len()];
        for (i, (shown, phase)) in shown.chunks_mut(width_px).zip(phases.chunks(width_px)).enumerate() {
            levels.show_row(i % height_px, phase, shown);
        }
        let free_loss = self.problem.body.measure(phases, 1.0).best_loss;
        let rounded_loss = self.problem.body.measure(&shown, 1.0).best_loss;
        self.has_converged() || rounded_loss - free_loss > ROUNDING_LOSS_MIN * free_loss
    }

    /// Takes one step of the current method: the chosen one, or rounding to levels.
    fn advance(&mut self) -> Evaluation {
        let Self { problem, options, state, scratch: Scratch { gradient, workspace }, stopwatch } = self;
        let problem = &mut Timed { body: &mut *problem.body, stopwatch };
        match &mut state.run {
            Run::Adam(state) => {
                let HologramMethod::Adam { learning_rate } = options.method else {
                    unreachable!("the state belongs to the method")
                };
                gradient.resize(state.phase.len(), 0.0);
                let mut taken = None;
                problem.adam_steps(state, learning_rate, 1, gradient, &mut |evaluation| taken = Some(evaluation));
                taken.expect("one step is evaluated once")
            }
            Run::Lbfgs { memory, gain } => {
                let mut found = None;
                memory.advance(workspace, |phase, gradient| {
                    let evaluation = problem.evaluate(phase, Gain::Fitted, gradient);
                    found = Some(evaluation);
                    evaluation.loss
                });
                let evaluation = found.expect("every step evaluates once");
                *gain = evaluation.best_gain;
                evaluation
            }
            Run::GerchbergSaxton { phase, wanted } => {
                let weighted = options.method == HologramMethod::WeightedGerchbergSaxton;
                problem.project(phase, wanted, weighted)
            }
            Run::DoublePhase { phase, .. } => problem.measure(phase, 1.0),
            Run::Rounded(state) => {
                gradient.resize(state.phase.len(), 0.0);
                let levels = options.levels.as_ref().expect("options with levels");
                state.step(problem, levels, options.all_iterations() - options.free_iterations(), gradient)
            }
        }
    }

    /// The best phases φ \[rad\] found so far, not wrapped, one frame after the other.
    #[must_use]
    pub fn phases(&self) -> &[f32] {
        self.state.phases()
    }

    /// Largest amplitude of the field, by which [`HologramMethod::DoublePhase`] divides it to fit the modulator; `None`
    /// for other methods. After the errors of the encoding are filtered away, the light is the target's divided by this
    /// number squared.
    #[must_use]
    pub fn largest_amplitude(&self) -> Option<f64> {
        match &self.state.run {
            Run::DoublePhase { largest_amplitude, .. } => Some(*largest_amplitude),
            _ => None,
        }
    }

    /// Evaluates the loss of any phases \[rad\], such as those that a display shows after rounding.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for phases of another size.
    pub fn measure(&mut self, phases: &[f32]) -> Result<Evaluation> {
        let size = self.problem.body.size();
        Plane::try_from_vec(size.frames * size.height_px, size.width_px, phases.to_vec())?;
        Ok(self.problem.measure(phases, 1.0))
    }

    /// The problem that this optimization solves.
    #[must_use]
    pub fn problem(&self) -> &HologramProblem {
        &self.problem
    }

    /// Number of steps done.
    #[must_use]
    pub fn iteration(&self) -> u32 {
        self.state.iteration
    }
}

#[cfg(test)]
#[path = "optimization_tests.rs"]
mod tests;
