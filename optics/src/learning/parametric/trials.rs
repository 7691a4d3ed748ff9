//! Trials of [blocks](Block): which are tried when, and which of them are kept.

use super::{BestModel, ParametricLearner};
use crate::chebyshev::ChebyshevBasis;
use crate::gaussian_blur::sigma_px_of_ratio;
use crate::learning::ghost::GhostSearch;
use crate::learning::{Block, Blocks, PairSource, pair::BoxError};
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

/// A round of trials, each with one block more or one block less.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Whether blocks are added or left out.
    pub change: Change,
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

/// What a trial does with a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// It adds the block to the model.
    Add,
    /// It leaves the block out.
    Remove,
}

impl Round {
    /// Largest validation loss with which a trial passes.
    pub(super) fn bound(&self) -> f64 {
        match self.change {
            Change::Add => self.before.loss * (1.0 - self.block.gain_min()),
            Change::Remove => self.before.loss / (1.0 - self.block.gain_min()),
        }
    }

    /// Whether a trial with this validation loss after its first step is not worth another one.
    pub(super) fn is_hopeless(&self, loss: f64) -> bool {
        match (self.change, self.block) {
            (Change::Add, Block::PartialCoherence) if self.before.blocks.light_blur => {
                loss > HOPELESS_WITHOUT_BLUR * self.before.loss
            }
            (Change::Add, Block::PartialCoherence) => {
                loss > self.before.loss - HOPEFUL * (self.before.loss - self.bound())
            }
            (Change::Add, _) => false,
            (Change::Remove, _) => loss > HOPELESS * self.bound(),
        }
    }

    /// Blocks of the model that is being tried.
    fn blocks(&self) -> Blocks {
        match self.change {
            Change::Add => self.before.blocks.with(self.block),
            Change::Remove => self.before.blocks.without(self.block),
        }
    }
}

impl ParametricLearner {
    /// Starts a round: blocks of the SLM are added at the first order; after the last one, blocks that the model does
    /// not need are left out, and then a varying kernel or a ghost is added. False if there is nothing to try, or no
    /// validation pairs to choose by.
    pub(super) fn start_round(&mut self) -> bool {
        let Some(before) = self.state.best.clone() else { return false };
        let has = |block: &Block| before.blocks.contains(*block);
        // A kernel that varies and several modes together take too many transfer functions.
        let excluded = |block: &Block| *block == Block::Varying && before.blocks.partial_coherence;
        let lacks = |block: &Block| block.belongs_to(self.options.model) && !has(block) && !excluded(block);
        // Light of a ghost or of a varying kernel is little beside what the others change. Dust has a fit of its own.
        let is_last = |block: &Block| matches!(block, Block::Varying | Block::Ghost);
        let all = || Block::ALL.into_iter().filter(|block| *block != Block::Dust);
        let (change, mut untried): (Change, Vec<Block>) = match (self.state.orders_done, self.state.pruned) {
            (false, _) if self.state.order_index > 0 => return false,
            (false, _) => (Change::Add, all().filter(|block| !is_last(block) && lacks(block)).collect()),
            (true, false) => (Change::Remove, all().filter(has).collect()),
            (true, true) => (Change::Add, all().filter(|block| is_last(block) && lacks(block)).collect()),
        };
        if untried.is_empty() {
            return match (self.state.orders_done, std::mem::replace(&mut self.state.pruned, self.state.orders_done)) {
                (true, false) => self.start_round(),
                _ => false,
            };
        }
        let block = untried.remove(0);
        self.start_trial(Round { change, before, block, steps: 0, untried, winner: None });
        true
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
        let with = self.state.best.take().filter(|with| with.loss <= round.bound());
        let both = round.winner.take().into_iter().chain(with);
        round.winner = both.min_by(|a, b| a.loss.total_cmp(&b.loss));
        if round.change == Change::Add && round.winner.is_some() {
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
            self.state.pruned |= round.change == Change::Remove;
            // After a round of removals a varying kernel or a ghost is due.
            if round.change == Change::Add || !self.start_round() {
                self.next_order();
            }
            return;
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
        let wanted = |round: &Round| (round.block, round.change) == (Block::PartialCoherence, Change::Add);
        if !is_start || !self.state.round.as_ref().is_some_and(wanted) {
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
        let seeks = |round: &Round| (round.block, round.change) == (Block::Ghost, Change::Add);
        if !is_start || !self.state.round.as_ref().is_some_and(seeks) {
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
