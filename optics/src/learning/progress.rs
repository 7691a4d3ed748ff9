//! Progress of learning.

use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;

/// Progress after one step of learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnStep {
    /// Stage of learning that the step belongs to.
    pub stage: LearnStage,
    /// Pair evaluations so far.
    pub step: u32,
    /// Pair evaluations that learning is expected to take, at least `step`. It may take fewer or more.
    pub steps_total: u32,
    /// Loss of this step: in Adam that of one pair, in the refinement the mean over all pairs.
    pub loss: f64,
    /// Lowest loss on the validation pairs so far; after the last step that of the final model, from which a part that
    /// explained too little was left out. `None` without validation pairs, or before their first evaluation.
    pub validation_loss: Option<f64>,
    /// Order of the kernel; 0 for models of bins.
    pub order: u32,
    /// Blocks of the model that is being fitted.
    pub blocks: Blocks,
    /// The block that is being tried, if any.
    pub trial: Option<Block>,
}

/// Stage of learning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearnStage {
    /// Adam over single pairs.
    Adam,
    /// Levenberg and Marquardt's method over all pairs.
    Refinement,
}
