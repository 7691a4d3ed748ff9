//! The engine's entry points in single precision, compiled in this crate.
//!
//! The engine is generic over its precision and its source of pairs, so its code is made where it is called. In a
//! development build that is a crate without optimizations, and some fifty times slower. These functions do nothing but
//! call the engine; but they name its types, so that it runs as optimized as this crate is, whoever calls.

use crate::hologram::Quality;
use crate::learning::{LearnOptions, LearnStep, Learner, Pair, PairSource};
use crate::{
    Adam, AdamState, Carrier, Detector, DisplayModel, Engine, Evaluation, HologramProblem, OpticalSetup, Plane,
    RegionOfInterest, Result, hologram,
};

/// Whatever goes wrong while pairs are read, or learned from: one of this crate's errors, or the source's own.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// Pairs from anywhere.
pub type AnyPairs<'a> = &'a dyn PairSource<Error = BoxError>;

/// [`Engine::new`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn engine(model: &DisplayModel, detector: Detector, carrier: Option<Carrier>) -> Result<Engine> {
    Engine::new(model, detector, carrier)
}

/// [`Engine::light`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn light(engine: &Engine, phase: &Plane<f32>) -> Result<Plane<f32>> {
    engine.light(phase)
}

/// [`HologramProblem::new`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn hologram_problem(engine: Engine, target: Plane<f32>, region: RegionOfInterest) -> Result<HologramProblem> {
    HologramProblem::new(engine, target, region)
}

/// [`hologram::quality`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn quality(engine: &Engine, phase: &Plane<f32>, target: &Plane<f32>, region: RegionOfInterest) -> Result<Quality> {
    hologram::quality(engine, phase, target, region)
}

/// [`Adam::start`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn start_adam(problem: HologramProblem, learning_rate: f64, phase: Plane<f32>) -> Result<Adam> {
    Adam::start(problem, learning_rate, phase)
}

/// [`Adam::resume`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn resume_adam(problem: HologramProblem, learning_rate: f64, state: AdamState) -> Result<Adam> {
    Adam::resume(problem, learning_rate, state)
}

/// [`Adam::step`]
#[inline(never)]
pub fn step_adam(adam: &mut Adam) -> Evaluation {
    adam.step()
}

/// [`Learner::start`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn start_learning(
    setup: OpticalSetup,
    options: LearnOptions,
    pairs: AnyPairs<'_>,
) -> std::result::Result<Learner, BoxError> {
    Learner::start(setup, options, &Erased(pairs))
}

/// [`Learner::step`]
///
/// # Errors
///
/// As there.
#[inline(never)]
pub fn step_learning(learner: &mut Learner, pairs: AnyPairs<'_>) -> std::result::Result<Option<LearnStep>, BoxError> {
    learner.step(&Erased(pairs))
}

/// A source of a known type that asks one of any type.
struct Erased<'a>(AnyPairs<'a>);

impl PairSource for Erased<'_> {
    type Error = BoxError;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn pair(&self, index: usize) -> std::result::Result<Pair, BoxError> {
        self.0.pair(index)
    }
}
