//! How a phase is searched for: method, initial phase, loss.

use crate::error::ApiError;
use crate::field::Field;
use crate::jobs::learning_rate::learning_rate;
use lightpath_optics::hologram::Loss;
use lightpath_optics::photometry::Quantity;
use lightpath_optics::{Detector, HologramMethod, InitialPhase, RegionOfInterest};
use lightpath_proto::v1::{
    self,
    optimize_hologram::{
        self,
        initial_phase::{Kind, Random},
    },
};
use std::f64::consts::TAU;

/// Adam's learning rate \[rad\]: the paper's.
const LEARNING_RATE_DEFAULT: f64 = 0.1;
/// Range of random initial phases: within one radian there is little speckle.
const INITIAL_PHASE_RANGE_DEFAULT_RAD: f64 = 1.0;
/// Largest block that speckle is measured in \[px\]: larger blocks show the picture's own structure.
const SPECKLE_BLOCK_PX_MAX: u32 = 256;
const SPECKLE_BLOCK_PX_DEFAULT: u32 = 8;

/// How the phases are found; Adam alone has a learning rate.
pub(super) fn method(field: &Field, message: &v1::OptimizeHologram) -> Result<HologramMethod, ApiError> {
    let rate = field.at("learning_rate");
    let given = learning_rate(&rate, message.learning_rate)?;
    let field = field.at("method");
    let method = match v1::HologramMethod::try_from(message.method) {
        Ok(v1::HologramMethod::Adam) => {
            return Ok(HologramMethod::Adam { learning_rate: given.unwrap_or(LEARNING_RATE_DEFAULT) });
        }
        Ok(v1::HologramMethod::Unspecified | v1::HologramMethod::Lbfgs) => HologramMethod::Lbfgs,
        Ok(v1::HologramMethod::GerchbergSaxton) => HologramMethod::GerchbergSaxton,
        Ok(v1::HologramMethod::WeightedGerchbergSaxton) => HologramMethod::WeightedGerchbergSaxton,
        Ok(v1::HologramMethod::DoublePhase) => HologramMethod::DoublePhase,
        Err(_) => {
            return Err(field.invalid(format!("is {}, which is no value of that enumeration", message.method)));
        }
    };
    match given {
        Some(value) => Err(rate.invalid(format!("is {value}, but only the method adam has a learning rate"))),
        None => Ok(method),
    }
}

fn phase_range(field: &Field, value: f64) -> Result<f64, ApiError> {
    /// Values this far above 2π are rounded values of 2π.
    const ROUNDING: f64 = 1e-6;
    if (0.0..=TAU + ROUNDING).contains(&value) {
        return Ok(value.min(TAU));
    }
    Err(field.invalid(format!("is {value}, but must be 0 to 2π rad")))
}

/// What the initial phase depends on.
#[derive(Clone, Copy)]
pub(super) struct PhaseDefaults {
    pub(super) method: HologramMethod,
    pub(super) detector: Detector,
    pub(super) frames: u32,
    pub(super) wavelengths: usize,
}

impl PhaseDefaults {
    /// The initial phase where the request gives none.
    fn initial_phase(self) -> InitialPhase<Vec<String>> {
        // A random phase has vortices between the pixels, and they stay; without them L-BFGS ends some 4 dB higher. But
        // several frames must differ.
        let smooth = self.detector == Detector::Supersampled && self.method.follows_gradient() && self.frames == 1;
        if smooth || self.method == HologramMethod::DoublePhase {
            return InitialPhase::Constant { phase_rad: 0.0 };
        }
        InitialPhase::Random { range_rad: INITIAL_PHASE_RANGE_DEFAULT_RAD }
    }
}

/// Where the search begins. Phases that are given are digests, one for each wavelength.
pub(super) fn initial_phase(
    field: &Field,
    given: Option<optimize_hologram::InitialPhase>,
    defaults: PhaseDefaults,
) -> Result<InitialPhase<Vec<String>>, ApiError> {
    let range = |kind: &str, random: Random, default_rad: f64| {
        phase_range(&field.at(kind).at("range_rad"), random.range_rad.unwrap_or(default_rad))
    };
    Ok(match given.and_then(|given| given.kind) {
        None => defaults.initial_phase(),
        Some(Kind::Random(random)) => {
            InitialPhase::Random { range_rad: range("random", random, INITIAL_PHASE_RANGE_DEFAULT_RAD)? }
        }
        Some(Kind::BackPropagated(random)) => {
            if defaults.method == HologramMethod::DoublePhase {
                return Err(field.invalid("is back-propagated, but double phase begins with a phase of the image"));
            }
            InitialPhase::BackPropagated { range_rad: range("back_propagated", random, 0.0)? }
        }
        Some(Kind::Quadratic(lens)) => {
            let length = field.at("quadratic").at("focal_length_m").number(lens.focal_length_m, -1e3..=1e3)?;
            InitialPhase::Quadratic { focal_length_m: (length != 0.0).then_some(length) }
        }
        Some(Kind::Constant(constant)) => InitialPhase::Constant {
            phase_rad: field.at("constant").at("phase_rad").number(constant.phase_rad, -TAU..=TAU)?,
        },
        Some(Kind::Given(given)) => {
            let (list, wavelengths) = (field.at("given").at("phases"), defaults.wavelengths);
            if given.phases.len() != wavelengths {
                let count = given.phases.len();
                let problem = format!("has {count} entries, but must have one for each wavelength, {wavelengths}");
                return Err(list.invalid(problem));
            }
            let digests = given.phases.iter().enumerate().map(|(i, digest)| list.index(i).digest(digest));
            InitialPhase::Given(digests.collect::<Result<_, _>>()?)
        }
    })
}

pub(super) fn loss_of(
    field: &Field,
    given: Option<optimize_hologram::Loss>,
    region: RegionOfInterest,
) -> Result<Loss, ApiError> {
    let given = given.unwrap_or_default();
    let block = field.at("speckle_block_px");
    let speckle_block_px =
        block.integer_or(given.speckle_block_px, SPECKLE_BLOCK_PX_DEFAULT, 2..=SPECKLE_BLOCK_PX_MAX)? as usize;
    if given.speckle > 0.0 && speckle_block_px > region.width_px().min(region.height_px()) {
        return Err(block.invalid(format!("is {speckle_block_px}, but must fit into the region of interest")));
    }
    Ok(Loss {
        quantity: field.at("quantity").one_of(given.quantity)?.unwrap_or(Quantity::Intensity),
        total_variation: field.at("total_variation").number(given.total_variation, 0.0..=Loss::FACTOR_MAX)?,
        speckle: field.at("speckle").number(given.speckle, 0.0..=Loss::FACTOR_MAX)?,
        speckle_block_px,
    })
}
