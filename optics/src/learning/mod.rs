//! Learning a [`DisplayModel`] from photographs of holograms.
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

mod along_z;
mod band_pass;
pub mod bins;
mod blocks;
mod columns;
mod course;
mod dust;
mod fit;
mod ghost;
mod jacobian;
mod layout;
mod modes;
mod order_fit;
mod order_jacobian;
mod pair;
pub mod parametric;
mod parts;
mod products;
mod schedule;
mod screening;
mod slm_gradient;
mod smooth_transfer;
mod suggestion;
mod uncertainty;

/// Sizes that determine the memory of a fit.
pub(crate) mod sizes {
    pub(crate) use super::layout::{
        FINE_SOURCE_ORDER, FURTHER_MODES, HARMONICS, MODE_ORDER, RESPONSE_VARIATION_ORDER, SOURCE_ORDER,
        VARIATION_ORDER,
    };
    pub(crate) use super::order_fit::BEYOND_ORDER;
    pub(crate) use super::parametric::CURVATURE_PX;
}

pub use along_z::interpolated;
pub use blocks::{Block, BlockStrengths, Blocks};
pub use pair::{BoxError, Pair, PairSource, compare, unsaturated_px};
pub use parts::{ModelPart, PartCost, without_each_part};
pub use suggestion::{HologramChoice, Suggestion};
pub use uncertainty::{ModelUncertainty, ResponseCovariance, StrengthUncertainty};

use crate::display::{Carrier, DisplayModel, OpticalSetup};
use crate::engine::Detector;
use crate::error::Error;
use crate::numerics::RegionOfInterest;
use bins::{BinsLearner, BinsState};
use parametric::{ParametricLearner, ParametricState};
use serde::{Deserialize, Serialize};

/// Models of a display. Each model describes the kernel; some also describe other parts of the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum KernelModel {
    /// Amplitude and phase of H at each bin where |f| < 1/4Δ, zero elsewhere; they start as uniform random numbers in
    /// [0, 1). K. Kavaklı, H. Ürey and K. Akşit, Applied Optics 61, B50 (2022).
    Paper,
    /// H as a free parameter at every bin of the padded spectrum, starting from free space.
    Dense,
    /// H = H_ideal · exp(α + iψ) with smooth α and ψ.
    Smooth,
    /// `Smooth`, and in addition the source profile, the phase response, the zero order, and those [`Block`]s of the
    /// SLM that lower the loss of the validation pairs enough.
    #[default]
    Display,
    /// `Display` with a kernel that [varies over the SLM](crate::SpatialVariation), if that lowers the loss of the
    /// validation pairs enough.
    Varying,
}

impl KernelModel {
    /// All models.
    pub const ALL: [Self; 5] = [Self::Paper, Self::Dense, Self::Smooth, Self::Display, Self::Varying];

    /// Name of the model in lower case, as it is stored.
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

    /// Whether the kernel is smooth, some dozens or hundreds of numbers: such models have an order, are refined, and
    /// can be started from.
    #[must_use]
    pub fn is_smooth(self) -> bool {
        match self {
            Self::Smooth | Self::Display | Self::Varying => true,
            Self::Paper | Self::Dense => false,
        }
    }
}

/// Options of learning: the model, and the settings of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnOptions {
    /// Model of the display.
    pub model: KernelModel,
    /// Highest total degree of α and ψ, 1 to 12; [smooth](KernelModel::is_smooth) models only. `None`: the validation
    /// pairs choose among 5, 8 and 12, and without validation pairs it is 8.
    pub order: Option<usize>,
    /// Passes of Adam over the pairs. Each step of Adam uses one pair.
    pub epochs: u32,
    /// Learning rate of Adam, above 0 and at most 10. Parametric models follow a schedule, of which it is the peak.
    pub learning_rate: f64,
    /// Most evaluations of all pairs by Levenberg and Marquardt's method after Adam; parametric models only. Each trial
    /// of a [`Block`] gets the same number once more.
    pub refinement_evaluations: u32,
    /// Seed of the order in which pairs are used, and of the random start of the `paper` model.
    pub seed: u64,
    /// Region of the photographs that is compared.
    pub region: RegionOfInterest,
    /// Model of how a camera pixel measures light.
    pub detector: Detector,
    /// The display's carrier, if it has one.
    pub carrier: Option<Carrier>,
    /// Display to start from instead of the ideal one, such as an earlier version of the kernel; parametric models
    /// only. Adam is skipped then.
    pub warm_start: Option<DisplayModel>,
}

impl LearnOptions {
    /// The recommended settings of a model: for `paper` as published, for the others as measured on simulated displays.
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
            return Err(Error::IncompatibleDistances {
                reason: "only the models smooth and display can be learned at several distances",
            });
        }
        for (i, setup) in setups.iter().enumerate() {
            if (setup.grid(), setup.wavelength_m()) != (setups[0].grid(), setups[0].wavelength_m()) {
                return Err(Error::IncompatibleDistances {
                    reason: "grid and wavelength must be the same at all distances",
                });
            }
            if setups[..i].iter().any(|other| other.distance_m() == setup.distance_m()) {
                return Err(Error::IncompatibleDistances { reason: "each distance may occur only once" });
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

/// Progress after one step of learning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LearnStep {
    /// Stage of learning that the step belongs to.
    pub stage: LearnStage,
    /// Pair evaluations so far.
    pub step: u32,
    /// Most pair evaluations that learning can take.
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

/// The training pairs and the validation pairs.
#[derive(Clone, Copy)]
pub struct LearningPairs<'a> {
    /// Pairs that the model is fitted to.
    pub training: &'a dyn PairSource,
    /// Pairs that choose the order and decide when learning ends; may be empty. Only parametric models use them.
    pub validation: &'a dyn PairSource,
}

impl std::fmt::Debug for LearningPairs<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LearningPairs({} training, {} validation)", self.training.len(), self.validation.len())
    }
}

impl<'a> LearningPairs<'a> {
    /// Training pairs without validation pairs.
    #[must_use]
    pub fn training_only(training: &'a dyn PairSource) -> Self {
        Self { training, validation: &NO_PAIRS }
    }
}

/// An empty set of pairs.
static NO_PAIRS: Vec<Pair> = Vec::new();

/// Stage of learning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearnStage {
    /// Adam over single pairs.
    Adam,
    /// Levenberg and Marquardt's method over all pairs.
    Refinement,
}

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
