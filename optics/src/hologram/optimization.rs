//! One way to run every method: start, step, save, resume.

use super::adam::AdamState;
use super::double_phase::double_phase;
use super::gerchberg_saxton;
use super::meter::Clock;
use super::problem::HologramProblem;
use super::rounded::Levels;
use super::state::{OptimizationState, Run};
use crate::optimizer::limited_memory::{LimitedMemory, Workspace};
use crate::{Error, Evaluation, Plane, Result};
use num_complex::Complex32;
use serde::{Deserialize, Serialize};
use std::time::Duration;

/// How a phase is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HologramMethod {
    /// Adam: a step along the gradient, scaled for each pixel by its history. The gain lags by one step.
    Adam {
        /// \[rad\], above 0, at most 10.
        learning_rate: f64,
    },
    /// L-BFGS: the curvature of the loss from its last gradients, with the gain fitted at every evaluation. A step is an
    /// evaluation.
    #[default]
    Lbfgs,
    /// Gerchberg–Saxton with the phase-only constraint.
    GerchbergSaxton,
    /// Gerchberg–Saxton with weights that raise the target where light is missing.
    WeightedGerchbergSaxton,
    /// Double phase: no iterations.
    DoublePhase,
}

impl HologramMethod {
    /// Whether the method follows the gradient of the whole [loss](super::Loss), and can go on through a display's levels.
    #[must_use]
    pub fn follows_gradient(self) -> bool {
        match self {
            Self::Adam { .. } | Self::Lbfgs => true,
            Self::GerchbergSaxton | Self::WeightedGerchbergSaxton | Self::DoublePhase => false,
        }
    }
}

/// How long, and for what levels.
#[derive(Clone, Debug)]
pub struct HologramOptions {
    /// How a phase is found.
    pub method: HologramMethod,
    /// Steps in all, at least 1; [`HologramMethod::DoublePhase`] takes one.
    pub iterations: u32,
    /// The last third of the steps goes on through these levels, and the phases found are ones that the display shows.
    /// Only where [`HologramMethod::follows_gradient`].
    pub levels: Option<Levels>,
}

impl HologramOptions {
    /// Any number of levels.
    #[must_use]
    pub fn new(method: HologramMethod, iterations: u32) -> Self {
        Self { method, iterations, levels: None }
    }

    /// Steps with phases that are not rounded.
    pub(super) fn free_iterations(&self) -> u32 {
        let steps = if self.method == HologramMethod::DoublePhase { 1 } else { self.iterations };
        if self.levels.is_some() { steps - steps.div_ceil(3) } else { steps }
    }

    fn all_iterations(&self) -> u32 {
        if self.method == HologramMethod::DoublePhase { 1 } else { self.iterations }
    }

    pub(super) fn validate(&self) -> Result<()> {
        if self.iterations == 0 {
            return Err(Error::OutOfRange { name: "iterations", value: 0.0, allowed: "at least 1" });
        }
        if let HologramMethod::Adam { learning_rate } = self.method
            && !(learning_rate > 0.0 && learning_rate <= 10.0)
        {
            let allowed = "above 0 and at most 10 rad";
            return Err(Error::OutOfRange { name: "learning_rate", value: learning_rate, allowed });
        }
        if self.levels.is_some() && !self.method.follows_gradient() {
            let needed = "only adam and lbfgs can optimize through a display's levels";
            return Err(Error::Empty { name: "levels", needed });
        }
        Ok(())
    }
}

/// An optimization under way.
#[derive(Debug)]
pub struct Optimization {
    problem: HologramProblem,
    options: HologramOptions,
    state: OptimizationState,
    scratch: Scratch,
}

/// Memory that holds nothing from one step to the next; empty until a method needs it.
#[derive(Debug, Default)]
struct Scratch {
    gradient: Vec<f32>,
    /// Of L-BFGS.
    workspace: Workspace,
    /// Of Gerchberg–Saxton.
    field: Vec<Complex32>,
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Steps done.
    pub iteration: u32,
    /// Steps at the end.
    pub iterations: u32,
    /// Of the phase that this step looked at.
    pub evaluation: Evaluation,
}

impl Optimization {
    /// Starts from `phases`, the frames' rows one after the other; [`HologramMethod::DoublePhase`] takes them for the phases of the
    /// light in the image.
    ///
    /// # Errors
    ///
    /// [`Error`] for phases of another size or options out of range.
    pub fn start(mut problem: HologramProblem, options: HologramOptions, phases: Vec<f32>) -> Result<Self> {
        options.validate()?;
        let core = &mut problem.core;
        let (rows, width_px) = (core.frames * core.engine().height_px(), core.engine().width_px());
        let phase = Plane::try_from_vec(rows, width_px, phases)?;
        phase.expect_finite("initial_phase")?;
        let phase = phase.into_vec();
        let run = match options.method {
            HologramMethod::Adam { .. } => Run::Adam(AdamState::new(core, phase)),
            HologramMethod::Lbfgs => Run::Lbfgs { memory: Box::new(LimitedMemory::new(phase)), gain: 0.0 },
            HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => {
                Run::GerchbergSaxton { wanted: core.target_amplitudes(), phase }
            }
            HologramMethod::DoublePhase => {
                let (phase, largest_amplitude) = double_phase(core, &phase);
                Run::DoublePhase { phase, largest_amplitude }
            }
        };
        Ok(Self { problem, options, state: OptimizationState { iteration: 0, run }, scratch: Scratch::default() })
    }

    /// Everything that the next step depends on.
    #[must_use]
    pub fn state(&self) -> &OptimizationState {
        &self.state
    }

    /// Goes on from where [`Self::state`] was taken, with the same problem and options.
    ///
    /// # Errors
    ///
    /// [`Error`] for options out of range, or a state that is not of this problem and these options.
    pub fn resume(problem: HologramProblem, options: HologramOptions, state: OptimizationState) -> Result<Self> {
        options.validate()?;
        state.check(&problem.core, &options)?;
        Ok(Self { problem, options, state, scratch: Scratch::default() })
    }

    /// From now on the time of the passes that take light to the image and back is added up, by `clock`.
    #[must_use]
    pub fn timed_by(mut self, clock: Clock) -> Self {
        self.problem.core.meter.clock = Some(clock);
        self
    }

    /// The time that evaluations of loss and gradient have taken, where a clock was given: Fourier transforms, with what is
    /// done in the same passes over memory. What is left of a step is the method's own.
    #[must_use]
    pub fn transforming(&self) -> Duration {
        self.problem.core.meter.spent
    }

    /// The next step, or `None` at the end.
    pub fn step(&mut self) -> Option<Step> {
        let (iterations, free_iterations) = (self.options.all_iterations(), self.options.free_iterations());
        if self.state.iteration >= iterations {
            return None;
        }
        if self.state.iteration >= free_iterations {
            self.state.run.round();
        }
        let evaluation = self.advance();
        self.state.iteration += 1;
        if let Run::Lbfgs { memory, .. } = &self.state.run
            && memory.counts.converged
        {
            // No better point is to be found: what is left of the free steps would find none either.
            self.state.iteration = self.state.iteration.max(free_iterations);
        }
        Some(Step { iteration: self.state.iteration, iterations, evaluation })
    }

    /// One step of the method that has its turn.
    fn advance(&mut self) -> Evaluation {
        let Self { problem, options, state, scratch: Scratch { gradient, workspace, field } } = self;
        let problem = &mut problem.core;
        match &mut state.run {
            Run::Adam(state) => {
                let HologramMethod::Adam { learning_rate } = options.method else {
                    unreachable!("the state is the method's")
                };
                gradient.resize(state.phase.len(), 0.0);
                state.step(problem, learning_rate, gradient)
            }
            Run::Lbfgs { memory, gain } => {
                let mut found = None;
                memory.advance(workspace, |phase, gradient| {
                    let evaluation = problem.evaluate_fitted(phase, gradient);
                    found = Some(evaluation);
                    evaluation.loss
                });
                let evaluation = found.expect("every step evaluates once");
                *gain = evaluation.best_gain;
                evaluation
            }
            Run::GerchbergSaxton { phase, wanted } => {
                let weighted = options.method == HologramMethod::WeightedGerchbergSaxton;
                gerchberg_saxton::round(problem, weighted, wanted, phase, field)
            }
            Run::DoublePhase { phase, .. } => problem.measure(phase, 1.0),
            Run::Rounded(state) => {
                gradient.resize(state.phase.len(), 0.0);
                let levels = options.levels.as_ref().expect("rounded for the levels given");
                state.step(problem, levels, options.all_iterations() - options.free_iterations(), gradient)
            }
        }
    }

    /// φ \[rad\], not wrapped, of all frames, one after the other: the best found so far.
    #[must_use]
    pub fn phases(&self) -> &[f32] {
        self.state.phases()
    }

    /// What the field was divided by to fit the modulator, for [`HologramMethod::DoublePhase`]: with the leftovers of the encoding
    /// filtered away, the light is 1/this² of the target's.
    #[must_use]
    pub fn largest_amplitude(&self) -> Option<f64> {
        match &self.state.run {
            Run::DoublePhase { largest_amplitude, .. } => Some(*largest_amplitude),
            _ => None,
        }
    }

    /// The loss of any phases, such as those that a display shows instead of the ones found.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] for phases of another size.
    pub fn measure(&mut self, phases: &[f32]) -> Result<Evaluation> {
        let (rows, width_px) =
            (self.problem.frames() * self.problem.core.engine().height_px(), self.problem.core.engine().width_px());
        Plane::try_from_vec(rows, width_px, phases.to_vec())?;
        Ok(self.problem.measure(phases, 1.0))
    }

    /// The problem that is solved.
    #[must_use]
    pub fn problem(&self) -> &HologramProblem {
        &self.problem
    }

    /// Steps done.
    #[must_use]
    pub fn iteration(&self) -> u32 {
        self.state.iteration
    }
}

#[cfg(test)]
#[path = "optimization_tests.rs"]
mod tests;
