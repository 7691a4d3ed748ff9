//! What is learned, and how.

use super::pair::PairSource;
use crate::display::parts::Block;
use crate::display::{Carrier, Detector, DisplayModel, OpticalSetup};
use crate::error::Error;
use crate::numerics::RegionOfInterest;
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
    /// `Smooth`, and in addition the source profile, the phase response, the zero order, and those
    /// [`Block`](super::Block)s of the SLM that lower the loss of the validation pairs enough.
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

impl Block {
    /// Whether validation pairs may choose the block in a fit of `model`.
    pub(super) fn belongs_to(self, model: KernelModel) -> bool {
        match self {
            Self::Varying => model == KernelModel::Varying,
            _ => matches!(model, KernelModel::Display | KernelModel::Varying),
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
    pub degree: Option<usize>,
    /// Passes of Adam over the pairs. Each step of Adam uses one pair.
    pub epochs: u32,
    /// Learning rate of Adam, above 0 and at most 10. Parametric models follow a schedule, of which it is the peak.
    pub learning_rate: f64,
    /// Most evaluations of all pairs by Levenberg and Marquardt's method after Adam; parametric models only. Each trial
    /// of a [`Block`](super::Block) gets the same number once more.
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
            degree: None,
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

    pub(super) fn validate(&self, setups: &[OpticalSetup], pairs: &dyn PairSource) -> Result<(), Error> {
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
        if let Some(degree) = self.degree
            && !(1..=12).contains(&degree)
        {
            return Err(Error::OutOfRange { name: "degree", value: degree as f64, allowed: "1 to 12" });
        }
        Ok(())
    }
}
