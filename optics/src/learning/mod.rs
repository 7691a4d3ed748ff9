//! Learning a [`DisplayModel`] from photographs of holograms.
//!
//! ```text
//! min over θ of  mean over pairs of  min over s, o of  Σ w ( s · D(|H ∗ c(φ)|²) + o − photo )² / Σ w
//! ```
//!
//! φ the hologram and photo its photograph, s and o its gain and offset (those of the exposure: every photograph has its own,
//! but for `paper` and `dense`, which fit them to all photographs after each epoch), w 1 in the region of interest but 0 where the camera saturates, here as in
//! [`compare`], by which finished models are judged. Two families:
//! [`parametric`] describes the display by some dozens of numbers, [`bins`] by one for every frequency. A display that was
//! photographed at several distances can be learned as [one](Learner::start_joint), and its kernel
//! [interpolated] between them.
//!
//! Learning is a sequence of [steps](Learner::step), each of which can be the last of a session: [`Learner::state`] is all
//! that the next one depends on.

mod along_z;
pub mod bins;
mod columns;
mod fit;
mod jacobian;
mod layout;
mod pair;
pub mod parametric;
mod schedule;
mod screening;
mod smooth_transfer;
mod uncertainty;

pub use along_z::interpolated;
pub use pair::{BoxError, Pair, PairSource, compare, unsaturated_px};
pub use uncertainty::{ResponseCovariance, ResponseUncertainty};

use crate::carrier::Carrier;
use crate::{Detector, DisplayModel, Error, OpticalSetup, RegionOfInterest};
use bins::{BinsLearner, BinsState};
use parametric::{ParametricLearner, ParametricState};
use serde::{Deserialize, Serialize};

/// The ways to describe a display's kernel, and what else of the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelModel {
    /// Amplitude and phase of H, uniform random in [0, 1) at first, where |f| < 1/4Δ; zero elsewhere. K. Kavaklı,
    /// H. Ürey and K. Akşit, Applied Optics 61, B50 (2022).
    Paper,
    /// H free at every bin of the padded spectrum, starting from free space.
    Dense,
    /// H = H_ideal · exp(α + iψ), smooth α and ψ.
    Smooth,
    /// `Smooth`, and the source, the phase response and the zero order.
    #[default]
    Display,
    /// `Display`, and a kernel that [varies over the SLM](crate::SpatialVariation); left out where validation pairs do not gain
    /// by it.
    Varying,
}

impl KernelModel {
    /// Every model.
    pub const ALL: [Self; 5] = [Self::Paper, Self::Dense, Self::Smooth, Self::Display, Self::Varying];

    /// Its name in lower case, as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Dense => "dense",
            Self::Smooth => "smooth",
            Self::Display => "display",
            Self::Varying => "varying",
        }
    }

    /// Whether the kernel is smooth, some dozens or hundreds of numbers: such models have an order, are refined, and can be
    /// started from.
    #[must_use]
    pub fn is_smooth(self) -> bool {
        match self {
            Self::Smooth | Self::Display | Self::Varying => true,
            Self::Paper | Self::Dense => false,
        }
    }
}

/// What to learn, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnOptions {
    /// How the display is described.
    pub model: KernelModel,
    /// Highest total degree of α and ψ, 1 to 12; `None`: 5, 8 or 12, as validation pairs choose; 8 without any. Only of
    /// [smooth](KernelModel::is_smooth) models.
    pub order: Option<usize>,
    /// Passes over the pairs with Adam, one pair a step.
    pub epochs: u32,
    /// Adam's step, at its highest where it follows a schedule.
    pub learning_rate: f64,
    /// Evaluations of all pairs by Levenberg and Marquardt's method afterwards, at most; parametric models only. As many
    /// again for a kernel that varies.
    pub refinement_evaluations: u32,
    /// Of the order of the pairs, and of the paper model's start.
    pub seed: u64,
    /// Where the photographs count.
    pub region: RegionOfInterest,
    /// What the camera's pixels measure.
    pub detector: Detector,
    /// The display's grating.
    pub carrier: Option<Carrier>,
    /// A display to start from instead of an ideal one, such as an earlier version of the kernel; parametric models only, which
    /// then go without Adam.
    pub warm_start: Option<DisplayModel>,
}

impl LearnOptions {
    /// What works for each model: `paper` as published, the others as measured on simulated displays.
    #[must_use]
    pub fn new(model: KernelModel, region: RegionOfInterest) -> Self {
        let (epochs, learning_rate, refinement_evaluations) = match model {
            KernelModel::Paper => (30, 0.002, 0),
            KernelModel::Dense => (5, 0.02, 0),
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => (4, 0.05, 40),
        };
        Self {
            model,
            order: None,
            epochs,
            learning_rate,
            refinement_evaluations,
            seed: 0,
            region,
            detector: Detector::Pixel,
            carrier: None,
            warm_start: None,
        }
    }

    fn validate(&self, setups: &[OpticalSetup], pairs: &dyn PairSource) -> Result<(), Error> {
        let pairs_of = |plane| (0..pairs.len()).filter(|&index| pairs.plane(index) == plane).count();
        if pairs.is_empty() || setups.is_empty() || (0..setups.len()).any(|plane| pairs_of(plane) == 0) {
            return Err(Error::Empty { name: "pairs", needed: "at least one training pair is needed" });
        }
        let joint = matches!(self.model, KernelModel::Smooth | KernelModel::Display);
        if setups.len() > 1 && !joint {
            return Err(Error::Apart { what: "distance, which needs the model smooth or display" });
        }
        for (i, setup) in setups.iter().enumerate() {
            if (setup.grid(), setup.wavelength_m()) != (setups[0].grid(), setups[0].wavelength_m()) {
                return Err(Error::Apart { what: "grid or wavelength" });
            }
            if setups[..i].iter().any(|other| other.distance_m() == setup.distance_m()) {
                return Err(Error::Apart { what: "distance: each is needed once" });
            }
        }
        if !(self.learning_rate > 0.0 && self.learning_rate <= 10.0) {
            let allowed = "above 0 and at most 10";
            return Err(Error::OutOfRange { name: "learning_rate", value: self.learning_rate, allowed });
        }
        if let Some(order) = self.order
            && !(1..=12).contains(&order)
        {
            return Err(Error::OutOfRange { name: "order", value: order as f64, allowed: "1 to 12" });
        }
        Ok(())
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnStep {
    /// Adam over single pairs, or the refinement over all of them.
    pub stage: LearnStage,
    /// Pair evaluations done.
    pub step: u32,
    /// Pair evaluations at the end, at most.
    pub steps_total: u32,
    /// Of this step: one pair's with Adam, the mean over all in the refinement.
    pub loss: f64,
    /// The best on the validation pairs so far, where there are some and they have been looked at.
    pub validation_loss: Option<f64>,
    /// The kernel's order; 0 for models of bins.
    pub order: u32,
    /// The kernel varies over the SLM.
    pub varying: bool,
}

/// The pairs to learn from, and those by which learning knows when to end.
#[derive(Clone, Copy)]
pub struct Lessons<'a> {
    /// What is learned from.
    pub training: &'a dyn PairSource,
    /// By which orders are chosen and learning ends; may be empty. Only parametric models look at them.
    pub validation: &'a dyn PairSource,
}

impl std::fmt::Debug for Lessons<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Lessons({} pairs, {} to validate)", self.training.len(), self.validation.len())
    }
}

impl<'a> Lessons<'a> {
    /// Pairs to learn from alone.
    #[must_use]
    pub fn only(training: &'a dyn PairSource) -> Self {
        Self { training, validation: &NO_PAIRS }
    }
}

/// No pairs at all.
static NO_PAIRS: Vec<Pair> = Vec::new();

/// What kind of step it was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearnStage {
    /// Adam over single pairs.
    Adam,
    /// Levenberg and Marquardt's method over all pairs.
    Refinement,
}

/// All that the next step depends on: owned, or where it lies, as [`Learner::state`] gives it. Both are stored alike.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum LearnState<P = Box<ParametricState>, B = BinsState> {
    /// Of `smooth`, `display` and `varying`.
    Parametric(P),
    /// Of `paper` and `dense`.
    Bins(B),
}

impl LearnState<&ParametricState, &BinsState> {
    /// A copy of what is borrowed.
    #[must_use]
    pub fn into_owned(self) -> LearnState {
        match self {
            Self::Parametric(state) => LearnState::Parametric(Box::new(state.clone())),
            Self::Bins(state) => LearnState::Bins(state.clone()),
        }
    }
}

/// Learning under way.
#[derive(Debug)]
pub struct Learner(Family);

#[derive(Debug)]
enum Family {
    Parametric(Box<ParametricLearner>),
    Bins(Box<BinsLearner>),
}

impl Learner {
    /// Starts from the ideal display (`paper`: from random numbers).
    ///
    /// # Errors
    ///
    /// [`Error`] for options out of range, no pairs, or pairs of another size; those of the source.
    pub fn start(setup: OpticalSetup, options: LearnOptions, pairs: &dyn PairSource) -> Result<Self, BoxError> {
        Self::start_joint(&[setup], options, pairs)
    }

    /// Starts to learn one display at several distances together, from pairs of each of them (smooth and display only).
    ///
    /// # Errors
    ///
    /// As [`Self::start`], and [`Error`] for setups that differ in more than their distances, or not in these.
    pub fn start_joint(
        setups: &[OpticalSetup],
        options: LearnOptions,
        pairs: &dyn PairSource,
    ) -> Result<Self, BoxError> {
        options.validate(setups, pairs)?;
        Ok(Self(match options.model {
            KernelModel::Paper | KernelModel::Dense => {
                Family::Bins(Box::new(BinsLearner::start(setups[0], options, pairs)?))
            }
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => {
                Family::Parametric(Box::new(ParametricLearner::start(setups, options, pairs)?))
            }
        }))
    }

    /// Goes on from a state, with the same setup, options and pairs.
    ///
    /// # Errors
    ///
    /// [`Error`] for a state that does not fit the options.
    pub fn resume(setup: OpticalSetup, options: LearnOptions, state: LearnState) -> Result<Self, Error> {
        Self::resume_joint(&[setup], options, state)
    }

    /// Goes on from a state, with the same setups (one at least), options and pairs.
    ///
    /// # Errors
    ///
    /// As [`Self::resume`].
    pub fn resume_joint(setups: &[OpticalSetup], options: LearnOptions, state: LearnState) -> Result<Self, Error> {
        Ok(Self(match state {
            LearnState::Parametric(state) => {
                Family::Parametric(Box::new(ParametricLearner::resume(setups, options, *state)?))
            }
            LearnState::Bins(state) => Family::Bins(Box::new(BinsLearner::resume(setups[0], options, state)?)),
        }))
    }

    /// The next step, or `None` at the end.
    ///
    /// # Errors
    ///
    /// Those of the source, and [`Error`] for a pair of another size.
    pub fn step(&mut self, lessons: Lessons<'_>) -> Result<Option<LearnStep>, BoxError> {
        match &mut self.0 {
            Family::Parametric(learner) => learner.step(lessons),
            Family::Bins(learner) => learner.step(lessons.training),
        }
    }

    /// Places of the training pairs that count: without those whose photographs are of something else.
    #[must_use]
    pub fn kept_pairs(&self, pairs: usize) -> Vec<usize> {
        match &self.0 {
            Family::Parametric(learner) => learner.state().kept.iter().map(|&index| index as usize).collect(),
            Family::Bins(_) => (0..pairs).collect(),
        }
    }

    /// All that the next step depends on, where it lies.
    #[must_use]
    pub fn state(&self) -> LearnState<&ParametricState, &BinsState> {
        match &self.0 {
            Family::Parametric(learner) => LearnState::Parametric(learner.state()),
            Family::Bins(learner) => LearnState::Bins(learner.state()),
        }
    }

    /// The display as learned so far; of several distances, at the first.
    #[must_use]
    pub fn model(&self) -> DisplayModel {
        self.models().swap_remove(0)
    }

    /// The display as learned so far, at each of the distances.
    #[must_use]
    pub fn models(&self) -> Vec<DisplayModel> {
        match &self.0 {
            Family::Parametric(learner) => learner.models(),
            Family::Bins(learner) => vec![learner.model()],
        }
    }

    /// Mean training loss of each epoch, then of each refinement iteration.
    #[must_use]
    pub fn loss_history(&self) -> &[f64] {
        match &self.0 {
            Family::Parametric(learner) => &learner.state().loss_history,
            Family::Bins(learner) => &learner.state().loss_history,
        }
    }
}
