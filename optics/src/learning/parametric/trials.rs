//! Trials of [blocks](Block): which are tried when, and which of them are kept.

use super::{BestModel, ParametricLearner};
use crate::learning::blocks::{Block, Blocks};
use crate::learning::ghost_search::GhostSearch;
use crate::learning::pair::{BoxError, PairSource};
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::gaussian_blur::sigma_px_of_ratio;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, SQRT_2, TAU};

/// Validation loss, relative to the largest with which it passes, above which a trial without a block ends after one
/// step.
const HOPELESS: f64 = 2.0;
/// Least part of the decrease with which it passes that a trial of modes of light must have reached after one step. Its
/// steps take three times as long as those of other trials.
const HOPEFUL: f64 = 1.0 / 3.0;
/// Validation loss, relative to that before the trial, above which a trial of modes of light that starts without the blur
/// so far ends after one step.
const HOPELESS_WITHOUT_BLUR: f64 = 1.25;
/// Least distance of each mode's image from the image so far, at the start of a trial \[px\].
const MODE_RADIUS_PX: f64 = 0.5;
/// Direction of the first mode's image, so that none lies on an axis \[turns\].
const MODE_TURN: f64 = 0.04;
/// Defocus of the further modes, to either side, at the start of a trial: half their phase at the end of the band
/// \[rad\].
const MODE_DEFOCUS_RAD: f64 = 0.3;

/// Which blocks are tried. The stages follow one another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrialStage {
    /// At the lowest order of the kernel, blocks of the SLM and of the light are added.
    #[default]
    First,
    /// At the highest order, blocks are left out that the model does not need: a kernel of low order can make a block
    /// look useful.
    Pruning,
    /// A varying kernel or a ghost is added. Their light is little beside what the others change.
    Last,
    /// After a fit of the dust, any block is added that the model lacks.
    BehindDust,
    /// Blocks are left out that gain too little beside all others.
    FinalPruning,
}

impl TrialStage {
    /// Whether the trials of this stage add a block, or leave one out.
    fn adds(self) -> bool {
        matches!(self, Self::First | Self::Last | Self::BehindDust)
    }

    /// Least relative difference that `block` makes to the validation loss if it is kept in this stage. Mechanisms hide
    /// each other: beside what others leave, a block seems to gain little. Therefore the first stages demand less.
    fn gain_min(self, block: Block) -> f64 {
        match self {
            Self::First | Self::Pruning | Self::Last => block.first_gain_min(),
            Self::BehindDust | Self::FinalPruning => block.gain_min(),
        }
    }

    /// Whether `block` is tried in this stage, if the model lacks it or has it.
    fn tries(self, block: Block) -> bool {
        match self {
            // Dust has a fit of its own.
            _ if block == Block::Dust => false,
            Self::First => !matches!(block, Block::Varying | Block::Ghost),
            Self::Last => matches!(block, Block::Varying | Block::Ghost),
            Self::Pruning | Self::BehindDust => true,
            Self::FinalPruning => block.first_gain_min() < block.gain_min(),
        }
    }
}

/// A round of trials, each with one block more or one block less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// The stage that the round belongs to.
    pub stage: TrialStage,
    /// Best model on the validation pairs before the round.
    pub before: BestModel,
    /// The block that is being tried.
    pub block: Block,
    /// Steps that the trial has taken.
    pub steps: u32,
    /// Blocks to try next.
    pub untried: Vec<Block>,
    /// The best model of a trial that passed.
    pub winner: Option<BestModel>,
}

impl Round {
    /// Largest validation loss with which a trial passes.
    pub(super) fn bound(&self) -> f64 {
        let gain_min = self.stage.gain_min(self.block);
        match self.stage.adds() {
            true => self.before.loss * (1.0 - gain_min),
            false => self.before.loss / (1.0 - gain_min),
        }
    }

    /// Whether a trial with this validation loss after its first step is not worth another one.
    pub(super) fn is_hopeless(&self, loss: f64) -> bool {
        match (self.stage.adds(), self.block) {
            (true, Block::PartialCoherence) if self.before.blocks.light_blur => {
                loss > HOPELESS_WITHOUT_BLUR * self.before.loss
            }
            (true, Block::PartialCoherence) => loss > self.before.loss - HOPEFUL * (self.before.loss - self.bound()),
            (true, _) => false,
            (false, _) => loss > HOPELESS * self.bound(),
        }
    }

    /// Blocks of the model that is being tried.
    fn blocks(&self) -> Blocks {
        match self.stage.adds() {
            true => self.before.blocks.with(self.block),
            false => self.before.blocks.without(self.block),
        }
    }

    fn adds(&self, block: Block) -> bool {
        self.stage.adds() && self.block == block
    }
}

impl ParametricLearner {
    /// Starts a round of the current [stage](TrialStage), or of those that follow it at once. False if there is nothing
    /// to try, or no validation pairs to choose by.
    pub(super) fn start_round(&mut self) -> bool {
        let Some(before) = self.state.best.clone() else { return false };
        if self.state.trials == TrialStage::First && self.state.order_index > 0 {
            return false;
        }
        let mut untried = self.candidates(&before);
        if untried.is_empty() && self.state.trials == TrialStage::Pruning {
            self.state.trials = TrialStage::Last;
            untried = self.candidates(&before);
        }
        if untried.is_empty() {
            return false;
        }
        let block = untried.remove(0);
        self.start_trial(Round { stage: self.state.trials, before, block, steps: 0, untried, winner: None });
        true
    }

    /// The blocks that the current stage tries on a model.
    fn candidates(&self, model: &BestModel) -> Vec<Block> {
        let stage = self.state.trials;
        // A kernel that varies and several modes together take too many transfer functions.
        let excluded = |block| block == Block::Varying && model.blocks.partial_coherence;
        let lacks = |block: Block| block.belongs_to(self.options.model) && !model.blocks.contains(block);
        let changes = |block| match stage.adds() {
            true => lacks(block) && !excluded(block),
            false => model.blocks.contains(block) && !self.state.needed.contains(block),
        };
        Block::ALL.into_iter().filter(|&block| stage.tries(block) && changes(block)).collect()
    }

    /// Starts to fit the best model so far with one more or one less block.
    pub(super) fn start_trial(&mut self, round: Round) {
        let BestModel { order, blocks, parameters, .. } = &round.before;
        let of = |blocks| self.layout_of(*order as usize, blocks);
        let (from, layout) = (self.joint.with_layout(of(*blocks)), of(round.blocks()));
        self.start_layout(layout, &from, parameters);
        (self.state.best, self.state.round) = (None, Some(round));
    }

    /// Goes on to the next block of the round. After the last one keeps the model of the best trial that passed, or
    /// returns to the model before the round.
    pub(super) fn end_trial(&mut self, mut round: Round) {
        let tried = self.state.best.take();
        if !round.stage.adds() && tried.as_ref().is_some_and(|without| round.is_hopeless(without.loss)) {
            self.state.needed = self.state.needed.with(round.block);
        }
        let with = tried.filter(|with| with.loss <= round.bound());
        let both = round.winner.take().into_iter().chain(with);
        round.winner = both.min_by(|a, b| a.loss.total_cmp(&b.loss));
        if round.stage.adds() && round.winner.is_some() {
            // Modes are as dear as three holograms, and describe a part of what the winner describes. They wait until
            // no other block helps.
            round.untried.retain(|block| *block != Block::PartialCoherence);
        }
        if !round.untried.is_empty() {
            let block = round.untried.remove(0);
            return self.start_trial(Round { block, steps: 0, ..round });
        }
        let Some(winner) = round.winner else {
            self.state.best = Some(round.before);
            if round.stage == TrialStage::Pruning {
                self.state.trials = TrialStage::Last;
                if self.start_round() {
                    return;
                }
            }
            return self.next_order();
        };
        let layout = self.layout_of(winner.order as usize, winner.blocks);
        self.start_layout(layout, &self.joint.with_layout(layout), &winner.parameters);
        self.state.adopted = true;
        self.state.best = Some(winner);
    }

    /// Gives the modes of light a start if partially coherent light is about to be tried: three images of the same
    /// light around the image so far, at slightly different distances. If the light blurs, the images are as far apart
    /// as the blur is wide, and the blur starts anew, because the modes may describe better what it describes.
    pub(super) fn separate_modes(&mut self) {
        let is_start = self.state.refinement.is_none();
        if !is_start || !self.state.round.as_ref().is_some_and(|round| round.adds(Block::PartialCoherence)) {
            return;
        }
        let layout = self.joint.layout;
        let blur = layout.blocks.light_blur.then_some(layout.light_blur());
        let radii_px = blur.map_or([MODE_RADIUS_PX; 2], |start| {
            let theta = self.joint.plane_parameters(0, &self.state.parameters);
            (0..2).for_each(|axis| self.joint.set_shared(&mut self.state.parameters, start + axis, 0.0));
            // Three places on a circle have half the square of its radius as their variance along each axis.
            [0, 1].map(|axis| (SQRT_2 * sigma_px_of_ratio(theta[start + axis])).max(MODE_RADIUS_PX))
        });
        let place_px = |mode: usize| {
            let angle = TAU * (mode as f64 / (layout.modes + 1) as f64 + MODE_TURN);
            [radii_px[0] * angle.cos(), radii_px[1] * angle.sin()]
        };
        let mut add = |start: usize, basis: ChebyshevBasis, degrees: (usize, usize), by: f64| {
            if let Some(term) = basis.degrees().position(|of_term| of_term == degrees) {
                let position = start + basis.terms() + term;
                self.joint.add_to_all_planes(&mut self.state.parameters, position, by);
            }
        };
        let first = place_px(0);
        for (axis, degrees) in [(1, 0), (0, 1)].into_iter().enumerate() {
            add(0, layout.kernel, degrees, PI * first[axis]);
            for m in 0..layout.modes {
                let shift_px = place_px(m + 1)[axis] - first[axis];
                add(layout.mode_errors(m), layout.mode, degrees, PI * shift_px);
            }
        }
        for (m, degrees) in (0..layout.modes).flat_map(|m| [(m, (2, 0)), (m, (0, 2))]) {
            let side = if m % 2 == 0 { 1.0 } else { -1.0 };
            add(layout.mode_errors(m), layout.mode, degrees, side * MODE_DEFOCUS_RAD);
        }
    }

    /// Whether a ghost is to be tried, but none can be seen. Otherwise the trial of a ghost starts with the one that is
    /// seen.
    pub(super) fn lacks_ghost(&mut self, pairs: &dyn PairSource) -> Result<bool, BoxError> {
        let is_start = self.state.refinement.is_none();
        if !is_start || !self.state.round.as_ref().is_some_and(|round| round.adds(Block::Ghost)) {
            return Ok(false);
        }
        let mut search = GhostSearch::new(self.fit.engine.height_px(), self.fit.engine.width_px());
        let theta = self.state.parameters.clone();
        self.each_in_use(pairs, &theta, |fit, _, example, _| {
            fit.add_to_search(example, &mut search);
            0.0
        })?;
        let Some(ghost) = search.found() else { return Ok(true) };
        for (i, number) in ghost.numbers().into_iter().enumerate() {
            self.joint.set_shared(&mut self.state.parameters, self.joint.layout.ghost() + i, number);
        }
        Ok(false)
    }
}
