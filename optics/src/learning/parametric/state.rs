//! What a fit has reached, and all that its next step depends on.

use super::{Round, TrialStage};
use crate::learning::blocks::Blocks;
use crate::learning::dust::DustFit;
use crate::numerics::Plane;
use crate::numerics::optimizer::damped::DampedState;
use serde::{Deserialize, Serialize};

/// State of the fit of a parametric model: all that the next step depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParametricState {
    /// θ, in the order of the internal layout.
    pub parameters: Vec<f64>,
    /// First moments of Adam.
    pub first_moment: Vec<f64>,
    /// Second moments of Adam.
    pub second_moment: Vec<f64>,
    /// Steps of Adam so far.
    pub adam_steps: u32,
    /// Sum of the losses of the current epoch.
    pub epoch_loss: f64,
    /// Gain that fits all photographs best, fitted at the start and at the end.
    pub gain: f64,
    /// Offset that fits all photographs best, fitted together with the gain.
    pub offset: f64,
    /// Indices of the training pairs in use.
    pub kept: Vec<u32>,
    /// Whether the pairs have been screened again after Adam.
    pub rescreened: bool,
    /// The screening of all pairs by the fitted model.
    pub last_screening: LastScreening,
    /// Index of the current order in the list of the orders to fit, which is also the number of finished orders.
    pub order_index: u32,
    /// Order of the kernel that is being fitted.
    pub order: u32,
    /// Blocks of the model that is being fitted.
    pub blocks: Blocks,
    /// The round of trials of blocks in progress, if any.
    pub round: Option<Round>,
    /// Whether a block has just been kept and is being refined.
    pub adopted: bool,
    /// Blocks without which the model was hopeless at the highest order of the kernel.
    pub needed: Blocks,
    /// Which blocks are being tried, or will be next.
    pub trials: TrialStage,
    /// Refinement of the current order; `None` before Adam has ended.
    pub refinement: Option<DampedState>,
    /// Running mean of the curvature, row after row; empty when the curvature is computed from all pairs.
    pub curvature: Vec<f64>,
    /// Number of steps that have used this curvature.
    pub curvature_steps: u32,
    /// Whether the last step failed and the curvature starts anew.
    pub restarted: bool,
    /// Evaluations of all pairs that previous orders have taken.
    pub evaluations: u32,
    /// Evaluations of all pairs that trials and refinements of blocks have taken.
    pub trial_evaluations: u32,
    /// Best model so far on the validation pairs; while a block is tried, the best with this block.
    pub best: Option<BestModel>,
    /// Number of steps of the current order or trial since the last validation gain.
    pub steps_without_gain: u32,
    /// A and B of the display's [dust](crate::Dust).
    pub dust: Option<Plane<[i16; 2]>>,
    /// Fit of the dust in progress.
    pub dust_fit: Option<DustFit>,
    /// The other blocks with which the dust was fitted last.
    pub blocks_beside_dust: Option<Blocks>,
    /// Whether learning has ended.
    pub converged: bool,
    /// Mean training loss of each epoch, then of each refinement step.
    pub loss_history: Vec<f64>,
}

/// State of the screening by the fitted model.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LastScreening {
    /// The model is not fitted yet.
    #[default]
    Pending,
    /// The model is fitted, and the next step screens the pairs.
    Due,
    /// The pairs have been screened.
    Done,
}

/// A model with a lower validation loss than all models before it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BestModel {
    /// Order of the kernel.
    pub order: u32,
    /// Blocks of the model.
    pub blocks: Blocks,
    /// θ of the model.
    pub parameters: Vec<f64>,
    /// Loss on the validation pairs.
    pub loss: f64,
    /// Best validation loss at the end of the previous order.
    pub loss_before: f64,
}
