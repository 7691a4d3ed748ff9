//! Exact conversion between the states of optimizations and bytes: a resumed job must produce the same bytes as an
//! uninterrupted one.
//!
//! The format is postcard: exact floating-point numbers, integers in as few bytes as possible, no field names. The
//! envelope of a checkpoint names the version of the code, so the states need no version number of their own.

use lightpath_domain::job::WavelengthResult;
use lightpath_optics::interrupt;
use postcard::ser_flavors::Flavor;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Room for the envelope of a checkpoint, which is appended to a state \[bytes\].
const ROOM_BYTES: usize = 64 << 10;

/// State of a hologram job besides the running optimization: the holograms of the finished wavelengths, the loss of the
/// last step, the steps taken and their time \[s\], and what computes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct HologramState {
    #[serde(with = "as_json")]
    pub(super) finished: Vec<WavelengthResult>,
    pub(super) loss: f64,
    pub(super) steps: u32,
    pub(super) compute_s: f64,
    /// The card that computes the job, or none; `None` as long as that is not chosen. Another card, or the processor,
    /// computes other bytes.
    pub(super) card: Option<Option<String>>,
    /// What computed the finished holograms, if not the processor alone by choice.
    pub(super) computed_by: Option<String>,
}

/// Writes a state as bytes. A state that cannot be written gives no bytes; the resumed job then starts from the
/// beginning.
pub(super) fn to_bytes(state: &impl Serialize) -> Vec<u8> {
    // The buffer is allocated once: growing it could copy more than a hundred megabytes.
    let size_bytes = postcard::experimental::serialized_size(state).unwrap_or(0);
    let bytes = StateBytes { bytes: Vec::with_capacity(size_bytes + ROOM_BYTES), writes: 0 };
    postcard::serialize_with_flavor(state, bytes).unwrap_or_default()
}

/// The bytes of a state. Writing them looks at the [interrupt](lightpath_optics::interrupt) of the job, because large
/// states take seconds.
struct StateBytes {
    bytes: Vec<u8>,
    writes: u32,
}

impl StateBytes {
    /// Number of writes, one for each number, between two looks.
    const WRITES_UNWATCHED: u32 = 1 << 16;
}

// Not `Extend`, which postcard gives each number byte by byte: without optimization that takes several times as long.
impl Flavor for StateBytes {
    type Output = Vec<u8>;

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.try_extend(&[byte])
    }

    fn try_extend(&mut self, more: &[u8]) -> postcard::Result<()> {
        self.writes = self.writes.wrapping_add(1);
        if self.writes.is_multiple_of(Self::WRITES_UNWATCHED) {
            interrupt::check();
        }
        self.bytes.extend_from_slice(more);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<Vec<u8>> {
        Ok(self.bytes)
    }
}

/// Reads a state from bytes; `None` if the bytes are not such a state.
pub(super) fn from_bytes<State: DeserializeOwned>(bytes: &[u8]) -> Option<State> {
    let (state, rest) = postcard::take_from_bytes(bytes).ok()?;
    rest.is_empty().then_some(state)
}

/// Stores results as JSON inside the postcard format, because they have optional fields, which postcard does not
/// support. JSON preserves their numbers exactly.
mod as_json {
    use lightpath_domain::job::WavelengthResult;
    use serde::{Deserialize, Deserializer, Serializer, de, ser};

    pub(super) fn serialize<S: Serializer>(results: &[WavelengthResult], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&serde_json::to_string(results).map_err(ser::Error::custom)?)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<WavelengthResult>, D::Error> {
        serde_json::from_str(&String::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::job::Subframe;
    use lightpath_domain::units::Wavelength;
    use lightpath_optics::hologram::{HologramMethod, HologramOptions, OptimizationState, initial_phase};
    use lightpath_optics::learning::bins::BinsState;
    use lightpath_optics::learning::parametric::ParametricState;
    use lightpath_optics::learning::{Block, KernelModel, LearnOptions, LearnState, Learner, LearningPairs, Pair};
    use lightpath_optics::{
        Detector, DisplayModel, Engine, Grid, HologramProblem, OpticalSetup, Optimization, Plane, RegionOfInterest,
    };
    use std::fmt::Debug;

    fn check_round_trip<State: Serialize + DeserializeOwned + PartialEq + Debug>(state: &State) {
        let bytes = to_bytes(state);
        assert_eq!(from_bytes::<State>(&bytes).as_ref(), Some(state));
        for end in [0, 3, 8, 11, bytes.len() - 1] {
            assert_eq!(from_bytes::<State>(&bytes[..end.min(bytes.len() - 1)]), None, "cut at {end}");
        }
        assert_eq!(from_bytes::<State>(&[&bytes[..], &[0]].concat()), None, "one byte too many");
    }

    fn optimization(method: HologramMethod) -> OptimizationState {
        let setup = OpticalSetup::try_new(Grid::try_new(16, 20, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let target = Plane::from_fn(16, 20, |y, x| ((3 * y + 5 * x) % 7) as f32 / 7.0);
        let problem = HologramProblem::new(engine, target, RegionOfInterest::middle(&setup.grid())).unwrap();
        let mut optimization =
            Optimization::start(problem, HologramOptions::new(method, 9), vec![0.5; 16 * 20]).unwrap();
        (0..4).for_each(|_| _ = optimization.step());
        optimization.state().clone()
    }

    #[test]
    fn states_of_holograms_are_read_back_exactly() {
        let finished = vec![WavelengthResult {
            wavelength: Wavelength { pm: 515_000 },
            subframes: vec![Subframe { pattern: "sha256-1".into(), phase: "sha256-2".into() }],
            planes: Vec::new(),
            intensity_scale: 0.1 + 0.2,
            loss: 1e-5,
            largest_amplitude: None,
            notes: vec!["the target is dark".to_owned()],
        }];
        let state = HologramState { finished, loss: 0.1 + 0.2, steps: 7, compute_s: 1e-3, ..HologramState::default() };
        for method in [
            HologramMethod::Adam { learning_rate: 0.1 },
            HologramMethod::Lbfgs,
            HologramMethod::WeightedGerchbergSaxton,
            HologramMethod::DoublePhase,
        ] {
            check_round_trip(&(state.clone(), optimization(method)));
        }
    }

    #[test]
    fn borrowed_and_owned_states_have_the_same_bytes() {
        let bins = BinsState { parameters: vec![0.1, 0.2], adam_steps: 3, offset: 0.01, ..BinsState::default() };
        let borrowed = LearnState::<&ParametricState, _>::Bins(&bins);
        assert_eq!(from_bytes::<LearnState>(&to_bytes(&borrowed)), Some(borrowed.into_owned()));
    }

    #[test]
    fn states_of_learning_are_read_back_exactly() {
        let setup = OpticalSetup::try_new(Grid::try_new(24, 32, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let pair = |seed| {
            let phase = initial_phase(24, 32, 6.0, seed).unwrap();
            let photo = engine.light(&phase).unwrap().map(|light| 0.2 * light);
            Pair { phase, photo }
        };
        let (training, validation): (Vec<Pair>, Vec<Pair>) = ((0..4).map(pair).collect(), (4..6).map(pair).collect());
        let pairs = LearningPairs { training: &training, validation: &validation };
        let region = RegionOfInterest::middle(&setup.grid());
        let options = LearnOptions { refinement_evaluations: 2, ..LearnOptions::new(KernelModel::Display, region) };
        let mut learner = Learner::start(setup, options, &training).unwrap();
        let mut tried = Vec::new();
        while let Some(step) = learner.step(pairs).unwrap() {
            check_round_trip::<LearnState>(&learner.state().into_owned());
            tried.extend(step.trial);
        }
        assert!(tried.contains(&Block::FineSource) && tried.contains(&Block::Dust), "{tried:?}");
        check_round_trip::<LearnState>(&LearnState::Parametric(ParametricState::default().into()));
        check_round_trip::<LearnState>(&LearnState::Bins(BinsState { parameters: vec![0.1], ..BinsState::default() }));
    }
}
