//! State of an optimization that is saved and restored. A restored optimization continues with the same bits.

use super::adam::AdamState;
use super::evaluate::ProblemSize;
use super::options::{HologramMethod, HologramOptions};
use super::rounded::Rounded;
use crate::error::{Error, Result};
use crate::numerics::Plane;
use crate::numerics::optimizer::limited_memory::LimitedMemory;
use serde::{Deserialize, Serialize};

/// State that the next step depends on, in addition to the problem and the options.
///
/// State may hold NaN, and line searches an infinite bound. A storage format must preserve both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizationState {
    /// Number of steps done.
    pub(super) iteration: u32,
    pub(super) run: Run,
}

/// State of the current method between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Run {
    Adam(AdamState),
    Lbfgs {
        memory: Box<LimitedMemory>,
        /// Gain that fitted best in the last evaluation.
        gain: f64,
    },
    GerchbergSaxton {
        /// Phases φ of all frames \[rad\].
        phase: Vec<f32>,
        /// Weighted target amplitudes W√t of each plane.
        wanted: Vec<Plane<f32>>,
    },
    DoublePhase {
        phase: Vec<f32>,
        largest_amplitude: f64,
    },
    Rounded(Rounded),
}

impl OptimizationState {
    /// The best phases φ \[rad\] found so far, not wrapped, one frame after the other.
    pub(super) fn phases(&self) -> &[f32] {
        match &self.run {
            Run::Adam(state) => &state.phase,
            Run::Lbfgs { memory, .. } => &memory.point,
            Run::GerchbergSaxton { phase, .. } | Run::DoublePhase { phase, .. } => phase,
            Run::Rounded(state) => &state.phase,
        }
    }

    /// Checks that the state belongs to a problem of this size and to these options.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a state of another problem or method.
    pub(super) fn check(&self, size: ProblemSize, options: &HologramOptions) -> Result<()> {
        let len = size.parameters();
        let fits = match (&self.run, options.method) {
            (Run::Adam(state), HologramMethod::Adam { .. }) => {
                [&state.phase, &state.first_moment, &state.second_moment].iter().all(|values| values.len() == len)
            }
            (Run::Lbfgs { memory, .. }, HologramMethod::Lbfgs) => memory.is_consistent(len),
            (
                Run::GerchbergSaxton { phase, wanted },
                HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton,
            ) => {
                phase.len() == len
                    && wanted.len() == size.planes
                    && wanted.iter().all(|plane| plane.expect_size("state", size.height_px, size.width_px).is_ok())
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
        let allowed = "the state of an optimization with the same problem, method and size";
        Err(Error::OutOfRange { name: "state", value: self.phases().len() as f64, allowed })
    }
}

impl Run {
    /// Switches to the optimization through a display's levels, if the method supports it and has not switched yet.
    pub(super) fn round(&mut self) {
        let (phase, gain) = match self {
            Self::Adam(state) => (std::mem::take(&mut state.phase), state.gain),
            Self::Lbfgs { memory, gain } => (std::mem::take(&mut memory.point), *gain),
            Self::GerchbergSaxton { .. } | Self::DoublePhase { .. } | Self::Rounded(_) => return,
        };
        *self = Self::Rounded(Rounded::new(phase, gain));
    }
}
