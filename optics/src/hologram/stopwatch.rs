//! Time spent in evaluations of loss and gradient, measured with a clock that the caller gives. This crate reads
//! no clock of its own.

use super::adam::AdamState;
use super::evaluate::{Evaluate, Evaluation, ProblemSize, Project};
use crate::metrics::Gain;
use crate::numerics::Plane;
use std::time::Duration;

/// Monotonic clock: returns the time since a fixed moment.
pub type Clock = fn() -> Duration;

/// Adds up the time between starts and stops; measures nothing without a clock.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stopwatch {
    pub(super) clock: Option<Clock>,
    pub(super) spent: Duration,
}

impl Stopwatch {
    pub(super) fn start(&self) -> Option<Duration> {
        self.clock.map(|clock| clock())
    }

    pub(super) fn stop(&mut self, begin: Option<Duration>) {
        if let (Some(clock), Some(begin)) = (self.clock, begin) {
            self.spent += clock().saturating_sub(begin);
        }
    }
}

/// A problem whose evaluations of loss and gradient, and projections, are timed.
#[derive(Debug)]
pub(super) struct Timed<'a> {
    pub(super) body: &'a mut dyn Project,
    pub(super) stopwatch: &'a mut Stopwatch,
}

impl Timed<'_> {
    /// Runs one round of [`Project::project`].
    pub(super) fn project(&mut self, phase: &mut [f32], wanted: &mut [Plane<f32>], weighted: bool) -> Evaluation {
        self.timed(|body| body.project(phase, wanted, weighted))
    }

    fn timed(&mut self, evaluate: impl FnOnce(&mut dyn Project) -> Evaluation) -> Evaluation {
        let begin = self.stopwatch.start();
        let evaluation = evaluate(self.body);
        self.stopwatch.stop(begin);
        evaluation
    }
}

impl Evaluate for Timed<'_> {
    fn size(&self) -> ProblemSize {
        self.body.size()
    }

    fn evaluate(&mut self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Evaluation {
        self.timed(|body| body.evaluate(phase, gain, gradient))
    }

    fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        self.body.measure(phase, gain)
    }

    fn light(&mut self, phase: &[f32]) -> Vec<f32> {
        self.body.light(phase)
    }

    fn adam_steps(
        &mut self,
        state: &mut AdamState,
        learning_rate: f64,
        steps: u32,
        gradient: &mut [f32],
        each: &mut dyn FnMut(Evaluation),
    ) {
        let begin = self.stopwatch.start();
        self.body.adam_steps(state, learning_rate, steps, gradient, each);
        self.stopwatch.stop(begin);
    }

    fn latest_light(&self) -> Option<&[f32]> {
        self.body.latest_light()
    }
}
