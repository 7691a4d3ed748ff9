//! Rounds of trials of [blocks](Block): which are tried when, and which of them pass.

use super::model::Model;
use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::terms::Turn;
use serde::{Deserialize, Serialize};

/// Validation loss, relative to the largest with which it passes, above which a trial without a block ends after one
/// step.
const HOPELESS: f64 = 2.0;

/// Which blocks are tried. The stages follow one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::learning) enum TrialStage {
    /// At the lowest order of the kernel, blocks of the SLM and of the light are added.
    First,
    /// At the highest order, blocks are left out that the model does not need.
    Pruning,
    /// Blocks are added whose light is little beside what the others change.
    Last,
    /// After a fit of the dust, any block is added that the model lacks.
    BehindDust,
    /// Blocks are left out that gain too little beside all others.
    FinalPruning,
}

impl TrialStage {
    /// Whether the trials of this stage add a block, or leave one out.
    pub(super) fn adds(self) -> bool {
        matches!(self, Self::First | Self::Last | Self::BehindDust)
    }

    /// Least relative difference that `block` makes to the validation loss if it is kept in this stage. Mechanisms hide
    /// each other: beside what others leave, a block seems to gain little. Therefore the first stages demand less.
    fn gain_min(self, block: Block) -> f64 {
        match self {
            Self::First | Self::Pruning | Self::Last => block.terms().first_gain_min,
            Self::BehindDust | Self::FinalPruning => block.terms().gain_min,
        }
    }

    /// Whether `block` is tried in this stage on a model with some blocks.
    fn tries(self, block: Block, blocks: Blocks) -> bool {
        let terms = block.terms();
        let is_excluded = || terms.never_beside.is_some_and(|other| blocks.contains(other));
        let has_its_turn = match self {
            Self::First => terms.turn == Turn::First,
            Self::Last => terms.turn == Turn::Last,
            Self::Pruning | Self::BehindDust => terms.turn != Turn::OwnFit,
            Self::FinalPruning => terms.first_gain_min < terms.gain_min,
        };
        has_its_turn && blocks.contains(block) != self.adds() && !(self.adds() && is_excluded())
    }
}

/// A round of trials, each with one block more or one block less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::learning) struct Round {
    /// The stage that the round belongs to.
    pub(super) stage: TrialStage,
    /// Best model before the round.
    pub(in crate::learning) before: Model,
    /// The block that is being tried.
    pub(super) block: Block,
    /// Blocks to try next.
    pub(super) untried: Vec<Block>,
    /// Best model of this trial.
    pub(super) found: Option<Model>,
    /// Best model of a trial that passed.
    pub(super) winner: Option<Model>,
}

impl Round {
    /// Starts a round on a model, of those `blocks` that the stage tries. Blocks that are `needed` are not left out.
    pub(super) fn start(stage: TrialStage, before: Model, blocks: &[Block], needed: Blocks) -> Option<Self> {
        let is_tried = |&block: &Block| stage.tries(block, before.blocks) && (stage.adds() || !needed.contains(block));
        let mut untried = blocks.iter().copied().filter(is_tried);
        let block = untried.next()?;
        Some(Self { stage, before, block, untried: untried.collect(), found: None, winner: None })
    }

    /// Ends the trial in progress. False after the last trial of the round; otherwise the next one begins.
    pub(super) fn goes_on(&mut self) -> bool {
        let bound = self.bound();
        let passed = self.found.take().filter(|found| found.loss <= bound);
        self.winner = self.winner.into_iter().chain(passed).min_by(|a, b| a.loss.total_cmp(&b.loss));
        if self.stage.adds() && self.winner.is_some() {
            self.untried.retain(|block| block.terms().dear.is_none());
        }
        if self.untried.is_empty() {
            return false;
        }
        self.block = self.untried.remove(0);
        true
    }

    /// Blocks of the model that is being tried.
    pub(in crate::learning) fn blocks(&self) -> Blocks {
        match self.stage.adds() {
            true => self.before.blocks.with(self.block),
            false => self.before.blocks.without(self.block),
        }
    }

    /// The block that this trial adds.
    pub(in crate::learning) fn added(&self) -> Option<Block> {
        self.stage.adds().then_some(self.block)
    }

    /// Largest validation loss with which a trial passes.
    pub(super) fn bound(&self) -> f64 {
        let gain_min = self.stage.gain_min(self.block);
        match self.stage.adds() {
            true => self.before.loss * (1.0 - gain_min),
            false => self.before.loss / (1.0 - gain_min),
        }
    }

    /// Whether the trial, with what it has found so far, is not worth another step.
    pub(super) fn is_hopeless(&self) -> bool {
        let Some(Model { loss, .. }) = self.found else { return false };
        let before = self.before.loss;
        match (self.stage.adds(), self.block.terms().dear) {
            (false, _) => loss > HOPELESS * self.bound(),
            (true, None) => false,
            (true, Some(dear)) if self.before.blocks.contains(dear.replaces) => loss > dear.loss_max * before,
            (true, Some(dear)) => loss > before - dear.hopeful * (before - self.bound()),
        }
    }
}
