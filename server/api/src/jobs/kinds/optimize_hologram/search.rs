//! Checks of the settings of the optimizer: method, initial phase and loss.

use crate::enumerations::WireField as _;
use crate::jobs::kinds::learning_rate::learning_rate;
use lightpath_domain::job::Judging;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{Loss, RANDOM_RANGE_RAD};
use lightpath_optics::{Detector, HologramMethod, InitialPhase, RegionOfInterest};
use lightpath_proto::v1::{
    self,
    optimize_hologram::{
        self,
        initial_phase::{Kind, Random},
    },
};
use lightpath_service::{Field, Result, check_all, collect_all};
use std::f64::consts::TAU;

/// Adam's learning rate by default \[rad\]: that of the paper.
const LEARNING_RATE_DEFAULT: f64 = 0.1;
/// Limit on the iterations, fifty times as many as a good hologram needs. It bounds the time that one job uses a
/// worker.
const ITERATIONS_MAX: u32 = 10_000;
const ITERATIONS_DEFAULT: u32 = 200;
/// Limit on the side of the blocks in which speckle is measured \[px\]: larger blocks contain structure of the picture.
const SPECKLE_BLOCK_PX_MAX: u32 = 256;
const SPECKLE_BLOCK_PX_DEFAULT: u32 = 8;

/// Checks the method and its learning rate, which only Adam has.
pub(super) fn method(field: &Field, message: &v1::OptimizeHologram) -> Result<HologramMethod> {
    let rate = field.at("learning_rate");
    let field = field.at("method");
    check_all! {
        given = learning_rate(&rate, message.learning_rate, &format!("the default {LEARNING_RATE_DEFAULT}"));
        method = field.wire_value::<v1::HologramMethod>(message.method);
    }
    let method = match method {
        v1::HologramMethod::Adam => {
            return Ok(HologramMethod::Adam { learning_rate: given.unwrap_or(LEARNING_RATE_DEFAULT) });
        }
        v1::HologramMethod::Unspecified | v1::HologramMethod::Lbfgs => HologramMethod::Lbfgs,
        v1::HologramMethod::GerchbergSaxton => HologramMethod::GerchbergSaxton,
        v1::HologramMethod::WeightedGerchbergSaxton => HologramMethod::WeightedGerchbergSaxton,
        v1::HologramMethod::DoublePhase => HologramMethod::DoublePhase,
    };
    match given {
        Some(value) => Err(rate.but(format!("is {value}"), "must be left out unless the method is adam")),
        None => Ok(method),
    }
}

/// Checks the number of iterations. Without one, given phases are judged as they are.
pub(super) fn iterations(field: &Field, message: &v1::OptimizeHologram) -> Result<u32> {
    if message.iterations != Some(0) {
        return field.integer_or(message.iterations, ITERATIONS_DEFAULT, 1..=ITERATIONS_MAX);
    }
    let is_given =
        matches!(message.initial_phase, Some(optimize_hologram::InitialPhase { kind: Some(Kind::Given(_)) }));
    let is_double_phase = message.method == v1::HologramMethod::DoublePhase as i32;
    if !is_given || is_double_phase {
        let rule = format!(
            "must be 1 to {ITERATIONS_MAX}, or 0 to judge the phases that initial_phase.given names, with another method \
             than double phase; leave it out for the default {ITERATIONS_DEFAULT}"
        );
        return Err(field.but("is 0", rule));
    }
    Ok(0)
}

/// Checks how thoroughly the holograms are judged. Without iterations there is nothing else to do.
pub(super) fn judge(field: &Field, message: &v1::OptimizeHologram) -> Result<Judging> {
    match field.enum_value(message.judge)?.unwrap_or_default() {
        Judging::None if message.iterations == Some(0) => {
            Err(field.but("is none", "must be quick or full for 0 iterations, which only judge"))
        }
        judge => Ok(judge),
    }
}

fn phase_range(field: &Field, value: f64) -> Result<f64> {
    /// Values above 2π by up to this difference are accepted as rounded values of 2π.
    const ROUNDING: f64 = 1e-6;
    if (0.0..=TAU + ROUNDING).contains(&value) {
        return Ok(value.min(TAU));
    }
    Err(field.but(format!("is {value}"), "must be 0 to 2π rad"))
}

/// The settings that determine the default and the limits of the initial phase.
#[derive(Clone, Copy)]
pub(super) struct PhaseDefaults {
    pub(super) method: HologramMethod,
    pub(super) detector: Detector,
    pub(super) subframes: u32,
    pub(super) wavelengths: usize,
}

/// Checks the initial phase. Given phases are digests, one for each wavelength.
pub(super) fn initial_phase(
    field: &Field,
    given: Option<optimize_hologram::InitialPhase>,
    defaults: PhaseDefaults,
) -> Result<InitialPhase<Vec<String>>> {
    let range = |kind: &str, random: Random, default_rad: f64| {
        phase_range(&field.at(kind).at("range_rad"), random.range_rad.unwrap_or(default_rad))
    };
    Ok(match given.and_then(|given| given.kind) {
        None => InitialPhase::recommended(defaults.method, defaults.detector, defaults.subframes),
        Some(Kind::Random(random)) => InitialPhase::Random { range_rad: range("random", random, RANDOM_RANGE_RAD)? },
        Some(Kind::BackPropagated(random)) => {
            if defaults.method == HologramMethod::DoublePhase {
                return Err(field.but("is back-propagated", "double phase needs an initial phase of the image"));
            }
            InitialPhase::BackPropagated { range_rad: range("back_propagated", random, 0.0)? }
        }
        Some(Kind::Quadratic(lens)) => InitialPhase::Quadratic {
            focal_length_m: focal_length(&field.at("quadratic").at("focal_length_m"), lens.focal_length_m)?,
        },
        Some(Kind::Constant(constant)) => InitialPhase::Constant {
            phase_rad: field.at("constant").at("phase_rad").number(constant.phase_rad, -TAU..=TAU)?,
        },
        Some(Kind::Given(given)) => {
            let (list, wavelengths) = (field.at("given").at("phases"), defaults.wavelengths);
            let (count, frames) = (given.phases.len(), wavelengths * defaults.subframes as usize);
            if count != wavelengths && count != frames {
                let rule = match frames == wavelengths {
                    true => format!("must have {wavelengths}, one for each wavelength"),
                    false => {
                        format!("must have {wavelengths}, one for each wavelength, or {frames}, one for each subframe")
                    }
                };
                return Err(list.but(format!("has {count} entries"), rule));
            }
            let digests = given.phases.iter().enumerate().map(|(i, digest)| list.index(i).digest(digest));
            InitialPhase::Given(collect_all(digests)?)
        }
    })
}

/// Checks the focal length \[m\] of a lens. Unset: one that steers by half of the band.
fn focal_length(field: &Field, length_m: Option<f64>) -> Result<Option<f64>> {
    field.if_set(length_m, "one that steers by half of the band", |length_m| match length_m {
        0.0 => Err(field.but("is 0", "must be within ±1000 m and not 0")),
        length_m => field.number(length_m, -1e3..=1e3),
    })
}

/// Checks the loss. Its blocks must fit into the region of interest, if that is known.
pub(super) fn loss(
    field: &Field,
    given: Option<optimize_hologram::Loss>,
    region: Option<RegionOfInterest>,
) -> Result<Loss> {
    let given = given.unwrap_or_default();
    let block = field.at("speckle_block_px");
    let fits = |side: u32| region.is_none_or(|region| side as usize <= region.width_px().min(region.height_px()));
    check_all! {
        quantity = field.at("quantity").enum_value(given.quantity);
        total_variation = field.at("total_variation").number(given.total_variation, 0.0..=Loss::FACTOR_MAX);
        speckle = field.at("speckle").number(given.speckle, 0.0..=Loss::FACTOR_MAX);
        side_px = block.integer_or(given.speckle_block_px, SPECKLE_BLOCK_PX_DEFAULT, 2..=SPECKLE_BLOCK_PX_MAX);
    }
    if speckle > 0.0 && !fits(side_px) {
        return Err(block.but(format!("is {side_px}"), "must fit into the region of interest"));
    }
    let quantity = quantity.unwrap_or(Quantity::Intensity);
    Ok(Loss { quantity, total_variation, speckle, speckle_block_px: side_px as usize })
}
