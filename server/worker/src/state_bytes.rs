//! Exact conversion between the states of optimizations and bytes: a resumed job must produce the same bytes as an
//! uninterrupted one.
//!
//! The format is postcard: exact floating-point numbers, integers in as few bytes as possible, no field names. The
//! envelope of a checkpoint names the version of the code, so the states need no version number of their own.

use lightpath_domain::job::WavelengthResult;
use lightpath_optics::interrupt;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Room for the envelope of a checkpoint, which is appended to a state \[bytes\].
const ROOM_BYTES: usize = 64 << 10;

/// State of a hologram job besides the running optimization: the holograms of the finished wavelengths, the loss of the
/// last step, and the steps taken and their time \[s\].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct HologramState {
    #[serde(with = "as_json")]
    pub(super) finished: Vec<WavelengthResult>,
    pub(super) loss: f64,
    pub(super) steps: u32,
    pub(super) compute_s: f64,
}

/// Writes a state as bytes. A state that cannot be written gives no bytes; the resumed job then starts from the
/// beginning.
pub(super) fn to_bytes(state: &impl Serialize) -> Vec<u8> {
    // The buffer is allocated once: growing it could copy more than a hundred megabytes.
    let size_bytes = postcard::experimental::serialized_size(state).unwrap_or(0);
    let bytes = StateBytes { bytes: Vec::with_capacity(size_bytes + ROOM_BYTES), writes: 0 };
    postcard::to_extend(state, bytes).map(|state| state.bytes).unwrap_or_default()
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

impl Extend<u8> for StateBytes {
    fn extend<I: IntoIterator<Item = u8>>(&mut self, more: I) {
        self.writes = self.writes.wrapping_add(1);
        if self.writes.is_multiple_of(Self::WRITES_UNWATCHED) {
            interrupt::check();
        }
        self.bytes.extend(more);
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
    use lightpath_domain::job::FrameResult;
    use lightpath_domain::units::Wavelength;
    use lightpath_optics::hologram::{HologramMethod, HologramOptions, OptimizationState};
    use lightpath_optics::learning::bins::BinsState;
    use lightpath_optics::learning::parametric::{BestModel, LastScreening, ParametricState, Round, TrialStage};
    use lightpath_optics::learning::{Block, Blocks, LearnState};
    use lightpath_optics::numerics::optimizer::damped::DampedState;
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
            frames: vec![FrameResult { phase: "sha256-1".into(), phase_npy: "sha256-2".into() }],
            planes: Vec::new(),
            intensity_scale: 0.1 + 0.2,
            loss: 1e-5,
            largest_amplitude: None,
        }];
        let state = HologramState { finished, loss: 0.1 + 0.2, steps: 7, compute_s: 1e-3 };
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
        let refinement = DampedState {
            parameters: vec![0.1, 0.7],
            loss: 1e-5,
            gradient: vec![-1.0 / 7.0, 0.0],
            damping: 1e-3,
            evaluations: 9,
            trusted: false,
        };
        let best = |order| BestModel {
            order,
            blocks: Blocks::ALL,
            parameters: vec![0.3],
            loss: 1e-4,
            loss_before: f64::INFINITY,
        };
        let parametric = ParametricState {
            parameters: vec![0.1],
            refinement: Some(refinement),
            best: Some(best(8)),
            round: Some(Round {
                stage: TrialStage::Pruning,
                before: best(5),
                block: Block::FineSource,
                steps: 2,
                untried: vec![Block::Varying],
                winner: Some(best(8)),
            }),
            adopted: true,
            blocks: Blocks::ALL,
            order: 8,
            trials: TrialStage::Last,
            kept: vec![0, 2, 3],
            curvature: vec![4.0],
            last_screening: LastScreening::Due,
            rescreened: true,
            order_index: 1,
            converged: true,
            loss_history: vec![0.3, 0.2],
            adam_steps: 5,
            ..ParametricState::default()
        };
        check_round_trip::<LearnState>(&LearnState::Parametric(parametric.into()));
        check_round_trip::<LearnState>(&LearnState::Parametric(ParametricState::default().into()));
        check_round_trip::<LearnState>(&LearnState::Bins(BinsState { parameters: vec![0.1], ..BinsState::default() }));
    }
}
