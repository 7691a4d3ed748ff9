//! The course of a parametric fit: what a fit does next, given what it has done.
//!
//! ```text
//!  Adam ─► Screening ─► Order 0 ─► [first] ─► Order 1 … n ─► [pruning] ─► [last] ─► LastScreening ─┐
//!                                                                          ▲       other pairs │   │ the same pairs
//!                                                                          └──── Adoption ◄────┘   ▼
//!                                             Done ◄─ [final pruning] ◄─ [behind dust] ◄────────  Dust
//!                                                                           └─ a block was kept ─► Dust
//!
//!  [stage]:   ─► Trial ─► Trial … ─► none passed, or nothing to try ─►
//!                  ▲         └─► the best that passed: Adoption ─┐
//!                  └─────────────────────────────────────────────┘
//! ```
//!
//! 1. [`Phase::Adam`] takes single pairs and a kernel of low order, and comes close to the optimum.
//! 2. [`Phase::Screening`] leaves out the pairs whose photographs do not show their holograms.
//! 3. [`Phase::Order`] refines the model on the pairs in use by Levenberg and Marquardt's method. With validation
//!    pairs, the model with the lowest validation loss counts, and an order ends when that loss no longer falls.
//! 4. After the lowest order each [block](Block) of the [first stage](TrialStage::First) is [tried](Phase::Trial) alone
//!    for some steps, on the best model so far. The block that gains most is kept if it gains enough, and its model is
//!    refined: [`Phase::Adoption`]. Then the others are tried in another round, because blocks can help only together.
//! 5. The higher orders follow, as long as each lowers the validation loss.
//! 6. After the highest order, [pruning](TrialStage::Pruning) leaves out each kept block in turn, for some steps. It
//!    stays away if the validation loss hardly rises: a kernel of low order can make a block look useful.
//! 7. The [last stage](TrialStage::Last) tries a varying kernel and a ghost.
//! 8. [`Phase::LastScreening`] screens all pairs by the fitted model. If other pairs are in use then, the model is
//!    refined with them and the last stage begins again.
//! 9. [`Phase::Dust`] has two numbers for each pixel and is fitted by L-BFGS, with all other parameters as they are.
//!    Dust can leave so much of the loss that it hides what other blocks gain: if it is kept, the blocks that the model
//!    lacks are tried [again](TrialStage::BehindDust), and if one of them is kept, the dust is fitted once more.
//! 10. [Final pruning](TrialStage::FinalPruning) leaves out the blocks that gain too little beside all others.
//!
//! Without validation pairs there is no best model, and nothing is tried. [`Course::next`] is all that decides. It
//! knows numbers of models and their losses; whoever fits keeps their parameters, and reports a [`Verdict`].

mod model;
mod round;
#[cfg(test)]
mod tests;

pub(super) use model::Model;
pub(super) use round::{Round, TrialStage};

use crate::display::parts::Block;
use crate::display::parts::blocks::Blocks;
use serde::{Deserialize, Serialize};

/// Order of the kernel when neither the options nor validation pairs choose it.
const ORDER_DEFAULT: usize = 8;
/// Least relative decrease of the validation loss by which a step or an order counts as a gain.
const VALIDATION_GAIN_MIN: f64 = 1e-2;
/// Number of consecutive steps without a validation gain after which a refinement ends.
const STEPS_WITHOUT_GAIN_MAX: u32 = 6;
/// Least relative decrease of the training loss. A smaller one ends the refinement of the current order.
const STEP_GAIN_MIN: f64 = 1e-2;
/// Largest number of steps for which a block is tried.
const TRIAL_STEPS: u32 = 3;
/// Least relative decrease of the training loss in a step of a trial. A smaller one ends the trial.
const TRIAL_STEP_GAIN_MIN: f64 = 5e-2;

/// Evaluations that a stage mostly takes: 2 to 4 on simulated benches.
const STAGE_EVALUATIONS: u32 = 3;

/// What stays the same during a fit.
#[derive(Clone, Debug)]
pub(super) struct Rules {
    /// Orders of the kernel to fit one after the other; at least one.
    pub(super) orders: Vec<usize>,
    /// Whether the validation loss decides how many of the orders are fitted.
    pub(super) chooses_order: bool,
    /// Blocks that belong to the model.
    pub(super) blocks: Vec<Block>,
    /// Most evaluations of the pairs in use by all orders together, by each trial, by each adoption, and by each fit of
    /// dust.
    pub(super) evaluations: u32,
}

impl Rules {
    /// Evaluations that a fit is expected to take after `done`: those of all orders, and for each block those of its trials
    /// and of its adoption. The limits on them are ten times higher and seldom reached, so that they tell nothing about the
    /// time that is left.
    pub(super) fn evaluations_expected(&self, done: u32) -> u32 {
        let of_a_stage = self.evaluations.min(STAGE_EVALUATIONS);
        let stages = (self.orders.len() + 2 * self.blocks.len()) as u32;
        (of_a_stage * stages).max(done + of_a_stage)
    }
}

/// What a fit is doing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) enum Phase {
    /// Steps of Adam, each with one pair.
    #[default]
    Adam,
    /// The screening of the pairs by the model that Adam found.
    Screening,
    /// The refinement of an order of the kernel.
    Order {
        /// Index of the order in the list of orders.
        index: usize,
        /// Best validation loss at the end of the previous order, if there was one.
        loss_before: Option<f64>,
    },
    /// The trial of a block.
    Trial(Round),
    /// The refinement of the best model: after a block was kept, or with other pairs. The stage goes on then.
    Adoption(TrialStage),
    /// The screening of all pairs by the fitted model.
    LastScreening,
    /// The fit of the dust beside the best model.
    Dust,
    /// Learning has ended.
    Done,
}

/// What came of the work of a phase.
#[derive(Clone, Debug)]
pub(super) enum Verdict {
    /// A step of Adam was taken.
    Adam {
        /// Whether no other follows.
        is_last: bool,
    },
    /// The pairs were screened.
    Screened {
        /// Whether other pairs are in use than before.
        others: bool,
    },
    /// The block to try cannot be seen in the photographs.
    Unseen,
    /// A step of a refinement was taken.
    Refined(Refined),
    /// A step of the fit of the dust was taken.
    Dusted(Dusted),
}

/// A step of a refinement. The first step only evaluates the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    /// Training loss before the step; `None` for the first.
    pub(super) before: Option<f64>,
    /// Training loss after the step.
    pub(super) loss: f64,
    /// Whether a better point was found.
    pub(super) improved: bool,
    /// Whether the loss fell by about what was predicted.
    pub(super) trusted: bool,
    /// Evaluations of the pairs in use by this refinement so far.
    pub(super) evaluations: u32,
    /// Whether the model that is refined has blocks.
    pub(super) has_blocks: bool,
    /// The model after the step, if there are validation pairs.
    pub(super) validated: Option<Model>,
}

/// A step of the fit of the dust.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dusted {
    /// Evaluations of the pairs in use by this fit so far.
    pub(super) evaluations: u32,
    /// Whether a further step can lower the validation loss.
    pub(super) goes_on: bool,
    /// Validation losses without this fit, and with the best dust of this fit.
    pub(super) losses: Option<(f64, f64)>,
}

/// Where a fit stands in its course.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Course {
    pub(super) phase: Phase,
    /// Number of verdicts in this phase.
    steps: u32,
    /// Number of steps of this phase since the last validation gain.
    without_gain: u32,
    /// Whether the last step failed and the next one starts anew, with the first damping and another curvature.
    pub(super) restarts: bool,
    /// Best model on the validation pairs. A block that is being tried is not part of it.
    best: Option<Model>,
    /// Evaluations of the pairs in use by the orders so far.
    order_evaluations: u32,
    /// Evaluations of the pairs in use by trials, adoptions and fits of dust so far.
    trial_evaluations: u32,
    /// Blocks without which the model was hopeless at the highest order of the kernel.
    needed: Blocks,
    /// Whether the fitted model has screened all pairs.
    is_screened: bool,
    /// Blocks beside which the dust was fitted last.
    beside_dust: Option<Blocks>,
    /// Whether the last fit of the dust was kept.
    pub(super) keeps_dust: bool,
}

impl Course {
    /// The course of a fit with or without steps of Adam.
    pub(super) fn start(with_adam: bool) -> Self {
        Self { phase: if with_adam { Phase::Adam } else { Phase::Screening }, ..Self::default() }
    }

    /// Whether the phase has just begun.
    pub(super) fn begins(&self) -> bool {
        self.steps == 0
    }

    /// Evaluations of the pairs in use in the phases before this one.
    pub(super) fn evaluations(&self) -> u32 {
        self.order_evaluations + self.trial_evaluations
    }

    /// The round of trials in progress.
    pub(super) fn round(&self) -> Option<&Round> {
        match &self.phase {
            Phase::Trial(round) => Some(round),
            _ => None,
        }
    }

    /// The block that is being tried.
    pub(super) fn trial(&self) -> Option<Block> {
        match &self.phase {
            Phase::Trial(round) => Some(round.block),
            Phase::Dust => Some(Block::Dust),
            _ => None,
        }
    }

    /// The model with the lowest validation loss, even one with a block that is not kept yet.
    pub(super) fn best(&self) -> Option<&Model> {
        self.models().min_by(|a, b| a.loss.total_cmp(&b.loss))
    }

    /// Lowest validation loss. What a trial has found counts only when it passes.
    pub(super) fn validation_loss(&self) -> Option<f64> {
        let winner = self.round().and_then(|round| round.winner.as_ref());
        winner.into_iter().chain(&self.best).map(|model| model.loss).reduce(f64::min)
    }

    /// All models that may be needed later.
    pub(super) fn models(&self) -> impl Iterator<Item = &Model> {
        let of_round = self.round().into_iter().flat_map(|round| round.found.iter().chain(&round.winner));
        of_round.chain(&self.best)
    }

    /// Whether all pairs are in use that were not left out. Before, and in trials, some suffice.
    pub(super) fn uses_all_pairs(&self) -> bool {
        self.is_screened && self.round().is_none()
    }

    /// Whether a fit by these rules can stand here.
    pub(super) fn obeys(&self, rules: &Rules) -> bool {
        !matches!(self.phase, Phase::Order { index, .. } if index >= rules.orders.len())
    }

    /// The course after the work of its phase came to a verdict.
    pub(super) fn next(mut self, rules: &Rules, verdict: Verdict) -> Self {
        self.steps += 1;
        match (&self.phase, verdict) {
            (Phase::Adam, Verdict::Adam { is_last: false }) => self,
            (Phase::Adam, Verdict::Adam { is_last: true }) => self.begin(Phase::Screening),
            (Phase::Screening, Verdict::Screened { .. }) => self.begin(match rules.evaluations {
                0 => Phase::Done,
                _ => Phase::Order { index: 0, loss_before: None },
            }),
            (Phase::Order { .. } | Phase::Trial(_) | Phase::Adoption(_), Verdict::Refined(step)) => {
                self.after_step(rules, &step)
            }
            (Phase::Trial(_), Verdict::Unseen) => self.after_refinement(rules, 0),
            (Phase::LastScreening, Verdict::Screened { others }) => {
                self.is_screened = true;
                match others {
                    true => self.begin(Phase::Adoption(TrialStage::Last)),
                    false => self.after_stage(rules, TrialStage::Last),
                }
            }
            (Phase::Dust, Verdict::Dusted(step)) => self.after_dust(rules, step),
            (phase, verdict) => unreachable!("{verdict:?} does not come of {phase:?}"),
        }
    }

    fn begin(self, phase: Phase) -> Self {
        Self { phase, steps: 0, without_gain: 0, restarts: false, ..self }
    }

    fn after_step(mut self, rules: &Rules, step: &Refined) -> Self {
        self.restarts &= !step.improved;
        if let Some(model) = step.validated {
            self.note(model);
        }
        let is_trial = self.round().is_some();
        // Far from the optimum a curvature that is a mean over several steps may be useless.
        if !step.improved && !is_trial && step.has_blocks && !self.restarts {
            self.restarts = true;
            return self;
        }
        let gain_min = if is_trial { TRIAL_STEP_GAIN_MIN } else { STEP_GAIN_MIN };
        let little = step.trusted && step.before.is_some_and(|before| step.loss > before * (1.0 - gain_min));
        let is_spent = step.evaluations >= self.evaluations_left(rules);
        let stays = self.without_gain >= STEPS_WITHOUT_GAIN_MAX;
        match !step.improved || little || self.is_tried() || is_spent || stays {
            true => self.after_refinement(rules, step.evaluations),
            false => self,
        }
    }

    /// Takes note of a model's validation loss.
    fn note(&mut self, model: Model) {
        let best = match &mut self.phase {
            Phase::Trial(round) => &mut round.found,
            _ => &mut self.best,
        };
        let lowest = best.map_or(f64::INFINITY, |best| best.loss);
        self.without_gain = if model.loss < lowest * (1.0 - VALIDATION_GAIN_MIN) { 0 } else { self.without_gain + 1 };
        if model.loss < lowest {
            *best = Some(model);
        }
    }

    /// Whether a block was tried for long enough.
    fn is_tried(&self) -> bool {
        let steps = self.steps - 1;
        self.round().is_some_and(|round| steps >= TRIAL_STEPS || steps > 0 && round.is_hopeless())
    }

    /// Number of evaluations that the refinement of this phase may take.
    fn evaluations_left(&self, rules: &Rules) -> u32 {
        match self.phase {
            Phase::Order { .. } => rules.evaluations.saturating_sub(self.order_evaluations),
            _ => rules.evaluations,
        }
    }

    /// Goes on after a refinement that took this many evaluations.
    fn after_refinement(mut self, rules: &Rules, evaluations: u32) -> Self {
        match std::mem::take(&mut self.phase) {
            Phase::Order { index, loss_before } => {
                self.order_evaluations += evaluations;
                match index {
                    0 => self.begin_stage(rules, TrialStage::First),
                    _ => self.after_order(rules, index, loss_before),
                }
            }
            Phase::Adoption(stage) => {
                self.trial_evaluations += evaluations;
                self.begin_stage(rules, stage)
            }
            Phase::Trial(round) => {
                self.trial_evaluations += evaluations;
                self.after_trial(rules, round)
            }
            phase => unreachable!("{phase:?} is no refinement"),
        }
    }

    /// Goes on to the next order of the kernel, or to pruning if the last one gained too little.
    fn after_order(self, rules: &Rules, index: usize, loss_before: Option<f64>) -> Self {
        let has_gained = match &self.best {
            _ if !rules.chooses_order => true,
            Some(best) => loss_before.is_none_or(|before| best.loss < before * (1.0 - VALIDATION_GAIN_MIN)),
            None => rules.orders[index] < ORDER_DEFAULT,
        };
        let has_next = index + 1 < rules.orders.len() && self.order_evaluations < rules.evaluations;
        if !has_gained || !has_next {
            return self.begin_stage(rules, TrialStage::Pruning);
        }
        let loss_before = self.best.map(|best| best.loss);
        self.begin(Phase::Order { index: index + 1, loss_before })
    }

    /// Goes on to the next block of the round. After the last one keeps the model of the best trial that passed, if
    /// any.
    fn after_trial(mut self, rules: &Rules, mut round: Round) -> Self {
        if !round.stage.adds() && round.is_hopeless() {
            self.needed = self.needed.with(round.block);
        }
        if round.goes_on() {
            return self.begin(Phase::Trial(round));
        }
        match round.winner {
            None => self.after_stage(rules, round.stage),
            best => Self { best, ..self }.begin(Phase::Adoption(round.stage)),
        }
    }

    /// Starts a round of trials of a stage, or goes on if there is nothing to try, or no best model to try it on.
    fn begin_stage(self, rules: &Rules, stage: TrialStage) -> Self {
        let round = self.best.and_then(|best| Round::start(stage, best, &rules.blocks, self.needed));
        match round {
            Some(round) => self.begin(Phase::Trial(round)),
            None => self.after_stage(rules, stage),
        }
    }

    fn after_stage(self, rules: &Rules, stage: TrialStage) -> Self {
        match stage {
            TrialStage::First => self.after_order(rules, 0, None),
            TrialStage::Pruning => self.begin_stage(rules, TrialStage::Last),
            TrialStage::Last if !self.is_screened => self.begin(Phase::LastScreening),
            TrialStage::Last | TrialStage::BehindDust if self.lacks_dust(rules) => self.begin(Phase::Dust),
            TrialStage::Last | TrialStage::BehindDust => self.begin_stage(rules, TrialStage::FinalPruning),
            TrialStage::FinalPruning => self.begin(Phase::Done),
        }
    }

    /// Whether dust is to be fitted: it belongs to the model, and was not fitted beside the same blocks.
    fn lacks_dust(&self, rules: &Rules) -> bool {
        let beside = self.best.map(|best| best.blocks);
        rules.blocks.contains(&Block::Dust) && beside.is_some() && beside != self.beside_dust
    }

    fn after_dust(mut self, rules: &Rules, step: Dusted) -> Self {
        if step.goes_on && step.evaluations < rules.evaluations {
            return self;
        }
        self.trial_evaluations += step.evaluations;
        let is_first = self.beside_dust.is_none();
        let gain_min = if is_first { Block::Dust.terms().gain_min } else { 0.0 };
        let kept = step.losses.filter(|(before, loss)| *loss <= before * (1.0 - gain_min));
        self.keeps_dust = kept.is_some();
        self.beside_dust = self.best.map(|best| best.blocks);
        if let (Some(best), Some((_, loss))) = (&mut self.best, kept) {
            best.loss = loss;
        }
        match is_first && self.keeps_dust {
            true => self.begin_stage(rules, TrialStage::BehindDust),
            false => self.begin_stage(rules, TrialStage::FinalPruning),
        }
    }
}
