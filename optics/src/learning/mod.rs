//! Learning a [`DisplayModel`](crate::DisplayModel) from photographs of holograms.
//!
//! ```text
//! min over θ of  mean over pairs of  min over s, o of  Σ w ( s · D(|H ∗ c(φ)|²) + o − photo )² / Σ w
//! ```
//!
//! φ is the hologram, photo its photograph. w is 1 in the region of interest and 0 where the camera saturates, as in
//! [`compare`], which measures finished models. s and o are gain and offset of the exposure: each photograph has its
//! own. Only `paper` and `dense` share one pair of s and o among all photographs and fit it after each epoch.
//! [`parametric`] models describe the display by some dozens or hundreds of numbers, [`bins`] models by two numbers for
//! each frequency. A display that was photographed at several distances can be learned as [one](Learner::start_joint),
//! and its kernel can be [interpolated] between the distances.
//!
//! Learning is a sequence of [steps](Learner::step). It can stop after any step and go on later: [`Learner::state`] is
//! all that the next step depends on.

mod adjoint;
#[cfg(test)]
mod adjoint_tests;
mod along_z;
mod band_pass;
pub mod bins;
mod columns;
mod course;
mod dust;
mod fit;
mod ghost;
mod ghost_search;
mod jacobian;
mod layout;
mod learner;
mod mode_buffers;
mod modes;
mod options;
mod order_fit;
mod order_jacobian;
mod pair;
pub mod parametric;
mod parts;
#[cfg(test)]
mod plain_adjoint;
mod products;
mod progress;
mod schedule;
mod screening;
mod slm_gradient;
mod smooth_transfer;
mod strengths;
mod suggestion;
mod uncertainty;

/// Sizes that determine the memory of a fit.
pub(crate) mod sizes {
    pub(crate) use super::parametric::CURVATURE_PX;
}

pub use crate::display::parts::blocks::Blocks;
pub use crate::display::parts::measures::Unit;
pub use crate::display::parts::{Block, ModelPart, without_each_part};
pub use along_z::interpolated;
pub use learner::{LearnState, Learner};
pub use options::{KernelModel, LearnOptions};
pub use pair::{BoxError, LearningPairs, Pair, PairSource, compare, unsaturated_px};
pub use parts::PartCost;
pub use progress::{LearnStage, LearnStep};
pub use strengths::{Measure, PartStrength};
pub use suggestion::{HologramChoice, Suggestion};
pub use uncertainty::{ModelUncertainty, ResponseCovariance};
