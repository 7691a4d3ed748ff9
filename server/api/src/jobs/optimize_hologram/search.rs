//! How a phase is searched for: method, initial phase, loss.

use crate::error::ApiError;
use crate::field::Field;
use crate::jobs::learning_rate::learning_rate;
use lightpath_domain::job::{Detector, Fit, InitialPhase, Loss, Method, Quantity, Region};
use lightpath_proto::v1::{
    self,
    optimize_hologram::{self, initial_phase::Kind, loss},
};
use std::f64::consts::TAU;

/// Adam's learning rate \[rad\]: the paper's.
const LEARNING_RATE_DEFAULT: f64 = 0.1;
/// Range of random initial phases: within one radian there is little speckle.
pub(super) const INITIAL_PHASE_RANGE_DEFAULT_RAD: f64 = 1.0;
/// Largest factor of a loss term: with larger ones the target counts for nothing.
const FACTOR_MAX: f64 = 1000.0;
/// Largest block that speckle is measured in \[px\]: larger blocks show the picture's own structure.
const SPECKLE_BLOCK_PX_MAX: u32 = 256;
const SPECKLE_BLOCK_PX_DEFAULT: u32 = 8;

pub(super) fn method(value: i32) -> Option<Method> {
    Some(match optimize_hologram::Method::try_from(value).ok()? {
        optimize_hologram::Method::Unspecified | optimize_hologram::Method::Lbfgs => Method::Lbfgs,
        optimize_hologram::Method::Adam => Method::Adam,
        optimize_hologram::Method::GerchbergSaxton => Method::GerchbergSaxton,
        optimize_hologram::Method::WeightedGerchbergSaxton => Method::WeightedGerchbergSaxton,
        optimize_hologram::Method::DoublePhase => Method::DoublePhase,
    })
}

pub(super) fn fit(value: i32) -> Option<Fit> {
    match optimize_hologram::Fit::try_from(value).ok()? {
        optimize_hologram::Fit::Unspecified | optimize_hologram::Fit::Contain => Some(Fit::Contain),
        optimize_hologram::Fit::Cover => Some(Fit::Cover),
        optimize_hologram::Fit::Stretch => Some(Fit::Stretch),
        optimize_hologram::Fit::Exact => Some(Fit::Exact),
    }
}

pub(super) fn learning_rate_of_adam(field: &Field, value: f64, method: Method) -> Result<f64, ApiError> {
    let given = learning_rate(field, value)?;
    if given.is_some() && method != Method::Adam {
        return Err(field.invalid(format!("is {value}, but only the method adam has a learning rate")));
    }
    Ok(given.unwrap_or(LEARNING_RATE_DEFAULT))
}

pub(super) fn phase_range(field: &Field, value: f64) -> Result<f64, ApiError> {
    /// Values this far above 2π are rounded values of 2π.
    const ROUNDING: f64 = 1e-6;
    if (0.0..=TAU + ROUNDING).contains(&value) {
        return Ok(value.min(TAU));
    }
    Err(field.invalid(format!("is {value}, but must be 0 to 2π rad")))
}

/// What an initial phase depends on.
#[derive(Clone, Copy)]
pub(super) struct PhaseDefaults {
    pub(super) method: Method,
    pub(super) detector: Detector,
    pub(super) wavelengths: usize,
}

impl PhaseDefaults {
    /// The initial phase where the request gives none.
    fn initial_phase(self, message: &v1::OptimizeHologram) -> InitialPhase {
        let follows_gradient = matches!(self.method, Method::Adam | Method::Lbfgs);
        // A random phase has vortices between the pixels, and they stay; without them L-BFGS ends some 4 dB higher. But
        // several frames must differ, and a range is given in order to be used.
        let smooth = self.detector == Detector::Supersampled
            && follows_gradient
            && message.frames <= 1
            && message.initial_phase_range_rad.is_none();
        if smooth || self.method == Method::DoublePhase {
            return InitialPhase::Constant { phase_rad: 0.0 };
        }
        InitialPhase::Random
    }
}

pub(super) fn initial_phase(
    field: &Field,
    message: &v1::OptimizeHologram,
    defaults: PhaseDefaults,
) -> Result<InitialPhase, ApiError> {
    let PhaseDefaults { method, wavelengths, .. } = defaults;
    let given = message.initial_phase.clone().unwrap_or_default();
    let kind = field.at("kind").known(given.kind, |value| Kind::try_from(value).ok())?;
    let refuse = |name, of| Err(field.at(name).invalid(format!("is given, but the kind of initial phase is not {of}")));
    if kind != Kind::Constant && given.constant_rad != 0.0 {
        return refuse("constant_rad", "constant");
    }
    if kind != Kind::Quadratic && given.focal_length_m != 0.0 {
        return refuse("focal_length_m", "quadratic");
    }
    if kind != Kind::Given && !given.phases.is_empty() {
        return refuse("phases", "given");
    }
    if method == Method::DoublePhase && kind == Kind::BackPropagated {
        return Err(field.at("kind").invalid("is back-propagated, but double phase begins with a phase of the image"));
    }
    Ok(match kind {
        Kind::Unspecified => defaults.initial_phase(message),
        Kind::Random => InitialPhase::Random,
        Kind::BackPropagated => InitialPhase::BackPropagated,
        Kind::Quadratic => {
            let value = given.focal_length_m;
            let focal_length_m = field.at("focal_length_m").number(value, -1e3..=1e3)?;
            InitialPhase::Quadratic { focal_length_m: (focal_length_m != 0.0).then_some(focal_length_m) }
        }
        Kind::Constant => {
            InitialPhase::Constant { phase_rad: field.at("constant_rad").number(given.constant_rad, -TAU..=TAU)? }
        }
        Kind::Given => {
            let list = field.at("phases");
            if given.phases.len() != wavelengths {
                let count = given.phases.len();
                return Err(
                    list.invalid(format!("has {count} entries, but must have one for each wavelength, {wavelengths}"))
                );
            }
            let digests = given.phases.iter().enumerate().map(|(i, digest)| list.index(i).digest(digest));
            InitialPhase::Given(digests.collect::<Result<_, _>>()?)
        }
    })
}

pub(super) fn loss_of(field: &Field, given: Option<optimize_hologram::Loss>, region: Region) -> Result<Loss, ApiError> {
    let given = given.unwrap_or_default();
    let quantity =
        field.at("quantity").known(given.quantity, |value| match loss::Quantity::try_from(value).ok()? {
            loss::Quantity::Unspecified | loss::Quantity::Intensity => Some(Quantity::Intensity),
            loss::Quantity::Amplitude => Some(Quantity::Amplitude),
        })?;
    let block = field.at("speckle_block_px");
    let speckle_block_px =
        block.integer_or(given.speckle_block_px, SPECKLE_BLOCK_PX_DEFAULT, 2..=SPECKLE_BLOCK_PX_MAX)?;
    if given.speckle > 0.0 && speckle_block_px > region.width_px.min(region.height_px) {
        return Err(block.invalid(format!("is {speckle_block_px}, but must fit into the region of interest")));
    }
    Ok(Loss {
        quantity,
        total_variation: field.at("total_variation").number(given.total_variation, 0.0..=FACTOR_MAX)?,
        speckle: field.at("speckle").number(given.speckle, 0.0..=FACTOR_MAX)?,
        speckle_block_px,
    })
}
