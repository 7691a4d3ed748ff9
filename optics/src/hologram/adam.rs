//! Hologram optimization with [Adam](crate::numerics::optimizer::adam): updates the phases and fits the gain.
//!
//! The loss is a mean over the region of interest, so its gradient shrinks as the number of pixels grows. The gradient
//! is therefore multiplied by the number of phases. This does not change Adam's steps, but it keeps Adam's ε small
//! beside the gradient.

use crate::interrupt;
use crate::numerics::optimizer::adam::AdamStep;
use pulp::Arch;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// State of Adam between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AdamState {
    /// Phases φ \[rad\], not wrapped, in row-major order.
    pub phase: Vec<f32>,
    /// First moment m of the gradient, which is multiplied by the number of phases.
    pub first_moment: Vec<f32>,
    /// Second moment v of the gradient, which is multiplied by the number of phases.
    pub second_moment: Vec<f32>,
    /// Number of steps done.
    pub iteration: u32,
    /// Gain at which the next step compares the light with the target.
    pub gain: f64,
}

impl AdamState {
    /// Initial state for `phase`, with the gain that fits best.
    #[must_use]
    pub fn new(phase: Vec<f32>, gain: f64) -> Self {
        let zeros = vec![0.0; phase.len()];
        Self { phase, first_moment: zeros.clone(), second_moment: zeros, iteration: 0, gain }
    }

    /// Takes one step along a gradient, whose evaluation found that `best_gain` fits best. The next step is evaluated at
    /// this gain, so it costs no extra pass.
    pub(super) fn step(&mut self, best_gain: f64, learning_rate: f64, width_px: usize, gradient: &[f32]) {
        self.gain = best_gain;
        self.iteration += 1;
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
    }
}
