//! What an optimization is asked for: the method, the number of steps, and the display's levels.

use super::rounded::Levels;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// Method that finds a hologram's phases.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HologramMethod {
    /// Adam: steps along the gradient, scaled for each pixel by the history of its gradient. The gain lags by one step.
    Adam {
        /// Learning rate \[rad\], above 0, at most 10.
        learning_rate: f64,
    },
    /// L-BFGS: estimates the curvature of the loss from the last gradients and fits the gain at every evaluation. Each
    /// step is one evaluation.
    #[default]
    Lbfgs,
    /// Gerchberg–Saxton with the phase-only constraint.
    GerchbergSaxton,
    /// Weighted Gerchberg–Saxton: weights raise the target where light is missing.
    WeightedGerchbergSaxton,
    /// Double-phase encoding of the field on the SLM, without iterations.
    DoublePhase,
}

impl HologramMethod {
    /// Whether the method follows the gradient of the whole [loss](super::Loss). Only such methods can optimize through
    /// a display's levels.
    #[must_use]
    pub fn follows_gradient(self) -> bool {
        match self {
            Self::Adam { .. } | Self::Lbfgs => true,
            Self::GerchbergSaxton | Self::WeightedGerchbergSaxton | Self::DoublePhase => false,
        }
    }
}

/// Options of an optimization: method, number of steps and, if wanted, the display's levels.
#[derive(Clone, Debug)]
pub struct HologramOptions {
    /// Method that finds the phases.
    pub method: HologramMethod,
    /// Total number of steps; without one, the phases stay as they are. [`HologramMethod::DoublePhase`] always takes one.
    pub iterations: u32,
    /// Levels of the display. If given, the last third of the steps moves the phases to these levels, so that the
    /// display can show them exactly. Where rounding would cost little, as with many levels and few steps, these steps
    /// are free like all others. Allowed only if [`HologramMethod::follows_gradient`] is true.
    pub levels: Option<Levels>,
}

impl HologramOptions {
    /// Options without a display's levels: phases are not rounded.
    #[must_use]
    pub fn new(method: HologramMethod, iterations: u32) -> Self {
        Self { method, iterations, levels: None }
    }

    /// Number of steps with phases that are not rounded.
    pub(super) fn free_iterations(&self) -> u32 {
        let steps = if self.method == HologramMethod::DoublePhase { 1 } else { self.iterations };
        if self.levels.is_some() { steps - steps.div_ceil(3) } else { steps }
    }

    pub(super) fn all_iterations(&self) -> u32 {
        if self.method == HologramMethod::DoublePhase { 1 } else { self.iterations }
    }

    pub(super) fn validate(&self) -> Result<()> {
        if let HologramMethod::Adam { learning_rate } = self.method
            && !(learning_rate > 0.0 && learning_rate <= 10.0)
        {
            let allowed = "above 0 and at most 10 rad";
            return Err(Error::OutOfRange { name: "learning_rate", value: learning_rate, allowed });
        }
        if self.levels.is_some() && !self.method.follows_gradient() {
            let reason = "only the methods adam and lbfgs can optimize through a display's levels";
            return Err(Error::Incompatible { name: "levels", reason });
        }
        Ok(())
    }
}
