//! What is saved of an optimization: restored, it goes on to the same bits.

use super::adam::AdamState;
use super::optimization::{HologramMethod, HologramOptions};
use super::problem::ProblemCore;
use super::rounded::Rounded;
use crate::optimizer::limited_memory::LimitedMemory;
use crate::{Error, Plane, Result};
use serde::{Deserialize, Serialize};

/// Everything that the next step depends on, beside the problem and its options.
///
/// Phases may hold NaN, and line searches an infinite bound: a form that is stored must keep both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizationState {
    /// Steps done.
    pub(super) iteration: u32,
    pub(super) run: Run,
}

/// What a method remembers from step to step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Run {
    Adam(AdamState),
    Lbfgs {
        memory: Box<LimitedMemory>,
        /// The gain that fitted best in the last evaluation.
        gain: f64,
    },
    GerchbergSaxton {
        /// φ of all frames.
        phase: Vec<f32>,
        /// W√t of each plane.
        wanted: Vec<Plane<f32>>,
    },
    DoublePhase {
        phase: Vec<f32>,
        largest_amplitude: f64,
    },
    Rounded(Rounded),
}

impl OptimizationState {
    /// φ \[rad\], not wrapped, of all frames, one after the other: the best found so far.
    pub(super) fn phases(&self) -> &[f32] {
        match &self.run {
            Run::Adam(state) => &state.phase,
            Run::Lbfgs { memory, .. } => &memory.point,
            Run::GerchbergSaxton { phase, .. } | Run::DoublePhase { phase, .. } => phase,
            Run::Rounded(state) => &state.phase,
        }
    }

    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a state of another problem or method.
    pub(super) fn check(&self, problem: &ProblemCore<f32>, options: &HologramOptions) -> Result<()> {
        let len = problem.parameters();
        let (height_px, width_px) = (problem.engine().height_px(), problem.engine().width_px());
        let fits = match (&self.run, options.method) {
            (Run::Adam(state), HologramMethod::Adam { .. }) => {
                [&state.phase, &state.first_moment, &state.second_moment].iter().all(|values| values.len() == len)
            }
            (Run::Lbfgs { memory, .. }, HologramMethod::Lbfgs) => memory.is_whole(len),
            (
                Run::GerchbergSaxton { phase, wanted },
                HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton,
            ) => {
                phase.len() == len
                    && wanted.len() == problem.planes.len()
                    && wanted.iter().all(|plane| plane.expect_size("state", height_px, width_px).is_ok())
            }
            (Run::DoublePhase { phase, .. }, HologramMethod::DoublePhase) => phase.len() == len,
            (Run::Rounded(state), _) => {
                options.levels.is_some() && state.phase.len() == len && state.velocity.len() == len
            }
            _ => false,
        };
        if fits {
            return Ok(());
        }
        let allowed = "one of this problem, method and size";
        Err(Error::OutOfRange { name: "state", value: self.phases().len() as f64, allowed })
    }
}

impl Run {
    /// Goes over to phases that settle on a display's levels.
    pub(super) fn round(&mut self) {
        let (phase, gain) = match self {
            Self::Adam(state) => (std::mem::take(&mut state.phase), state.gain),
            Self::Lbfgs { memory, gain } => (std::mem::take(&mut memory.point), *gain),
            Self::GerchbergSaxton { .. } | Self::DoublePhase { .. } | Self::Rounded(_) => return,
        };
        *self = Self::Rounded(Rounded::new(phase, gain));
    }
}
