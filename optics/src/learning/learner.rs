//! A fit in progress, of any model.

use super::bins::{BinsLearner, BinsState};
use super::options::{KernelModel, LearnOptions};
use super::pair::{BoxError, LearningPairs, PairSource};
use super::parametric::{ParametricLearner, ParametricState};
use super::progress::LearnStep;
use crate::display::{DisplayModel, OpticalSetup};
use crate::error::Error;
use serde::{Deserialize, Serialize};

/// State of a fit: all that the next step depends on. It owns its data, or borrows them as [`Learner::state`] gives it;
/// both forms are serialized alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LearnState<P = Box<ParametricState>, B = BinsState> {
    /// State of the models `smooth`, `display` and `varying`.
    Parametric(P),
    /// State of the models `paper` and `dense`.
    Bins(B),
}

impl LearnState<&ParametricState, &BinsState> {
    /// Copies the borrowed state.
    #[must_use]
    pub fn into_owned(self) -> LearnState {
        match self {
            Self::Parametric(state) => LearnState::Parametric(Box::new(state.clone())),
            Self::Bins(state) => LearnState::Bins(state.clone()),
        }
    }
}

/// A fit in progress.
#[derive(Debug)]
pub struct Learner(AnyLearner);

#[derive(Debug)]
enum AnyLearner {
    Parametric(Box<ParametricLearner>),
    Bins(Box<BinsLearner>),
}

impl Learner {
    /// Starts a fit from the ideal display, or, for `paper`, from random numbers.
    ///
    /// # Errors
    ///
    /// [`Error`] for options out of range, no pairs, or pairs of another size; errors of the pair source.
    pub fn start(setup: OpticalSetup, options: LearnOptions, pairs: &dyn PairSource) -> Result<Self, BoxError> {
        Self::start_joint(&[setup], options, pairs)
    }

    /// Starts to learn one display at several distances together, from pairs of each distance; `smooth` and `display`
    /// only.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::start`], and [`Error`] for setups whose grids or wavelengths differ or whose distances
    /// repeat.
    pub fn start_joint(
        setups: &[OpticalSetup],
        options: LearnOptions,
        pairs: &dyn PairSource,
    ) -> Result<Self, BoxError> {
        options.validate(setups, pairs)?;
        Ok(Self(match options.model {
            KernelModel::Paper | KernelModel::Dense => {
                AnyLearner::Bins(Box::new(BinsLearner::start(setups[0], options, pairs)?))
            }
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => {
                AnyLearner::Parametric(Box::new(ParametricLearner::start(setups, options, pairs)?))
            }
        }))
    }

    /// Resumes a fit from its state, with the same setup, options and pairs.
    ///
    /// # Errors
    ///
    /// [`Error`] for a state that does not fit the options.
    pub fn resume(setup: OpticalSetup, options: LearnOptions, state: LearnState) -> Result<Self, Error> {
        Self::resume_joint(&[setup], options, state)
    }

    /// Resumes a joint fit from its state, with the same setups (at least one), options and pairs.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::resume`].
    pub fn resume_joint(setups: &[OpticalSetup], options: LearnOptions, state: LearnState) -> Result<Self, Error> {
        Ok(Self(match state {
            LearnState::Parametric(state) => {
                AnyLearner::Parametric(Box::new(ParametricLearner::resume(setups, options, *state)?))
            }
            LearnState::Bins(state) => AnyLearner::Bins(Box::new(BinsLearner::resume(setups[0], options, state)?)),
        }))
    }

    /// Takes the next step. `None` when learning has ended.
    ///
    /// # Errors
    ///
    /// Errors of the pair source, and [`Error`] for a pair of another size.
    pub fn step(&mut self, learning_pairs: LearningPairs<'_>) -> Result<Option<LearnStep>, BoxError> {
        match &mut self.0 {
            AnyLearner::Parametric(learner) => learner.step(learning_pairs),
            AnyLearner::Bins(learner) => learner.step(learning_pairs.training),
        }
    }

    /// Indices of the training pairs in use. Pairs whose photographs do not show their holograms are left out.
    #[must_use]
    pub fn kept_pairs(&self, pairs: usize) -> Vec<usize> {
        match &self.0 {
            AnyLearner::Parametric(learner) => learner.state().kept_pairs().collect(),
            AnyLearner::Bins(_) => (0..pairs).collect(),
        }
    }

    /// State of the fit, borrowed from the learner: all that the next step depends on.
    #[must_use]
    pub fn state(&self) -> LearnState<&ParametricState, &BinsState> {
        match &self.0 {
            AnyLearner::Parametric(learner) => LearnState::Parametric(learner.state()),
            AnyLearner::Bins(learner) => LearnState::Bins(learner.state()),
        }
    }

    /// The display as learned so far; in a joint fit, at the first distance.
    #[must_use]
    pub fn model(&self) -> DisplayModel {
        self.models().swap_remove(0)
    }

    /// The display as learned so far at each distance.
    #[must_use]
    pub fn models(&self) -> Vec<DisplayModel> {
        match &self.0 {
            AnyLearner::Parametric(learner) => learner.models(),
            AnyLearner::Bins(learner) => vec![learner.model()],
        }
    }

    /// Mean training loss of each epoch, then of each refinement iteration.
    #[must_use]
    pub fn loss_history(&self) -> &[f64] {
        match &self.0 {
            AnyLearner::Parametric(learner) => learner.state().loss_history(),
            AnyLearner::Bins(learner) => &learner.state().loss_history,
        }
    }
}
