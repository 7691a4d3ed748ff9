//! The states of optimizations as bytes, exactly: a resumed job must end with the bytes of an uninterrupted one.
//!
//! Little-endian numbers in a fixed order; arrays behind their length. The envelope of a checkpoint says which version
//! of the code wrote them, so nothing here needs a version of its own.

use lightpath_domain::job::WavelengthResult;
use lightpath_optics::hologram::OptimizationState;
use lightpath_optics::learning::LearnState;
use lightpath_optics::learning::bins::BinsState;
use lightpath_optics::learning::parametric::{Best, ParametricState};
use lightpath_optics::optimizer::damped::DampedState;

/// For what stands beside a state's vectors, its envelope included.
const ROOM_BYTES: usize = 64 << 10;

/// Holograms under way: those of the wavelengths that are done, the one that is being found, the loss of its last step, and
/// the steps taken and their time \[s\].
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct HologramState {
    pub(super) finished: Vec<WavelengthResult>,
    pub(super) current: Option<OptimizationState>,
    pub(super) loss: f64,
    pub(super) steps: u32,
    pub(super) compute_s: f64,
}

impl HologramState {
    /// Of this state with another one under way.
    pub(super) fn to_bytes<V: AsRef<[f32]>>(&self, current: Option<&OptimizationState<V>>) -> Vec<u8> {
        let mut bytes = Writer::default();
        let vectors = current.map_or(&[][..], |current| &current.vectors);
        // All at once: growing would copy what may be more than a hundred megabytes.
        bytes.0.reserve(vectors.iter().map(|values| 4 * values.as_ref().len() + 8).sum::<usize>() + ROOM_BYTES);
        // Results are numbers and names; numbers in JSON come back exactly.
        bytes.text(&serde_json::to_string(&self.finished).unwrap_or_default());
        bytes.u32(u32::from(current.is_some()));
        bytes.u32(vectors.len() as u32);
        vectors.iter().for_each(|values| bytes.f32s(values.as_ref()));
        bytes.f64s(current.map_or(&[], |current| &current.numbers));
        [self.loss, self.compute_s].into_iter().for_each(|value| bytes.f64(value));
        bytes.u32(self.steps);
        bytes.0
    }

    /// `None` where the bytes are no such state.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let mut bytes = Reader(bytes);
        let finished = serde_json::from_str(&bytes.text()?).ok()?;
        let (is_some, count) = (bytes.u32()? != 0, bytes.u32()?);
        let vectors = (0..count).map(|_| bytes.f32s()).collect::<Option<Vec<_>>>()?;
        let numbers = bytes.f64s()?;
        let current = is_some.then_some(OptimizationState { vectors, numbers });
        let (loss, compute_s, steps) = (bytes.f64()?, bytes.f64()?, bytes.u32()?);
        let state = Self { finished, current, loss, steps, compute_s };
        bytes.0.is_empty().then_some(state)
    }
}

const PARAMETRIC: u32 = 1;
const BINS: u32 = 2;

pub(super) fn learn_state_to_bytes(state: &LearnState) -> Vec<u8> {
    let mut bytes = Writer::default();
    match state {
        LearnState::Parametric(state) => {
            bytes.u32(PARAMETRIC);
            write_parametric(&mut bytes, state);
        }
        LearnState::Bins(state) => {
            bytes.u32(BINS);
            write_bins(&mut bytes, state);
        }
    }
    bytes.0
}

/// `None` where the bytes are no such state.
pub(super) fn learn_state_from_bytes(bytes: &[u8]) -> Option<LearnState> {
    let mut bytes = Reader(bytes);
    let state = match bytes.u32()? {
        PARAMETRIC => LearnState::Parametric(Box::new(read_parametric(&mut bytes)?)),
        BINS => LearnState::Bins(read_bins(&mut bytes)?),
        _ => return None,
    };
    bytes.0.is_empty().then_some(state)
}

fn write_parametric(bytes: &mut Writer, state: &ParametricState) {
    let ParametricState {
        parameters,
        first_moment,
        second_moment,
        adam_steps,
        epoch_loss,
        gain,
        offset,
        kept,
        rescreened,
        rung,
        varying,
        refinement,
        curvature,
        evaluations,
        best,
        uniform,
        in_vain,
        converged,
        loss_history,
    } = state;
    [parameters, first_moment, second_moment, loss_history, curvature]
        .into_iter()
        .for_each(|values| bytes.f64s(values));
    [*epoch_loss, *gain, *offset].into_iter().for_each(|value| bytes.f64(value));
    [*adam_steps, *rung, *evaluations, *in_vain].into_iter().for_each(|value| bytes.u32(value));
    [*rescreened, *converged, *varying, refinement.is_some(), best.is_some(), uniform.is_some()]
        .into_iter()
        .for_each(|is| bytes.u32(u32::from(is)));
    bytes.u32(kept.len() as u32);
    kept.iter().for_each(|&index| bytes.u32(index));
    if let Some(DampedState { parameters, loss, gradient, damping, evaluations }) = refinement {
        [parameters, gradient].into_iter().for_each(|values| bytes.f64s(values));
        [*loss, *damping].into_iter().for_each(|value| bytes.f64(value));
        bytes.u32(*evaluations);
    }
    for Best { order, varying, parameters, loss, loss_before } in best.iter().chain(uniform) {
        [*order, u32::from(*varying)].into_iter().for_each(|value| bytes.u32(value));
        bytes.f64s(parameters);
        [*loss, *loss_before].into_iter().for_each(|value| bytes.f64(value));
    }
}

fn read_parametric(bytes: &mut Reader<'_>) -> Option<ParametricState> {
    let [parameters, first_moment, second_moment, loss_history, curvature] =
        [bytes.f64s()?, bytes.f64s()?, bytes.f64s()?, bytes.f64s()?, bytes.f64s()?];
    let (epoch_loss, gain, offset) = (bytes.f64()?, bytes.f64()?, bytes.f64()?);
    let (adam_steps, rung, evaluations, in_vain) = (bytes.u32()?, bytes.u32()?, bytes.u32()?, bytes.u32()?);
    let mut flag = || Some(bytes.u32()? != 0);
    let [rescreened, converged, varying, refined, has_best, had_uniform] =
        [flag()?, flag()?, flag()?, flag()?, flag()?, flag()?];
    let count = bytes.u32()?;
    let kept = (0..count).map(|_| bytes.u32()).collect::<Option<Vec<_>>>()?;
    let refinement = if refined { Some(read_damped(bytes)?) } else { None };
    let best = if has_best { Some(read_best(bytes)?) } else { None };
    let uniform = if had_uniform { Some(read_best(bytes)?) } else { None };
    Some(ParametricState {
        parameters,
        first_moment,
        second_moment,
        adam_steps,
        epoch_loss,
        gain,
        offset,
        kept,
        rescreened,
        rung,
        varying,
        refinement,
        curvature,
        evaluations,
        best,
        uniform,
        in_vain,
        converged,
        loss_history,
    })
}

fn read_damped(bytes: &mut Reader<'_>) -> Option<DampedState> {
    let (parameters, gradient) = (bytes.f64s()?, bytes.f64s()?);
    let (loss, damping, evaluations) = (bytes.f64()?, bytes.f64()?, bytes.u32()?);
    Some(DampedState { parameters, loss, gradient, damping, evaluations })
}

fn read_best(bytes: &mut Reader<'_>) -> Option<Best> {
    let (order, varying, parameters) = (bytes.u32()?, bytes.u32()? != 0, bytes.f64s()?);
    let (loss, loss_before) = (bytes.f64()?, bytes.f64()?);
    Some(Best { order, varying, parameters, loss, loss_before })
}

fn write_bins(bytes: &mut Writer, state: &BinsState) {
    let BinsState { parameters, first_moment, second_moment, adam_steps, epoch_loss, gain, offset, loss_history } =
        state;
    [parameters, first_moment, second_moment].into_iter().for_each(|values| bytes.f32s(values));
    bytes.u32(*adam_steps);
    [*epoch_loss, *gain, *offset].into_iter().for_each(|value| bytes.f64(value));
    bytes.f64s(loss_history);
}

fn read_bins(bytes: &mut Reader<'_>) -> Option<BinsState> {
    Some(BinsState {
        parameters: bytes.f32s()?,
        first_moment: bytes.f32s()?,
        second_moment: bytes.f32s()?,
        adam_steps: bytes.u32()?,
        epoch_loss: bytes.f64()?,
        gain: bytes.f64()?,
        offset: bytes.f64()?,
        loss_history: bytes.f64s()?,
    })
}

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn u32(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.0.extend_from_slice(&(text.len() as u64).to_le_bytes());
        self.0.extend_from_slice(text.as_bytes());
    }

    fn f32s(&mut self, values: &[f32]) {
        self.0.reserve(4 * values.len() + 8);
        self.0.extend_from_slice(&(values.len() as u64).to_le_bytes());
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }

    fn f64s(&mut self, values: &[f64]) {
        self.0.reserve(8 * values.len() + 8);
        self.0.extend_from_slice(&(values.len() as u64).to_le_bytes());
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.array().map(f64::from_le_bytes)
    }

    fn text(&mut self) -> Option<String> {
        let bytes: Vec<u8> = self.values::<1>()?.iter().map(|[byte]| *byte).collect();
        String::from_utf8(bytes).ok()
    }

    fn f32s(&mut self) -> Option<Vec<f32>> {
        Some(self.values::<4>()?.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect())
    }

    fn f64s(&mut self) -> Option<Vec<f64>> {
        Some(self.values::<8>()?.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (array, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*array)
    }

    fn values<const N: usize>(&mut self) -> Option<&[[u8; N]]> {
        let count = usize::try_from(u64::from_le_bytes(self.array()?)).ok()?;
        let (values, rest) = self.0.split_at_checked(count.checked_mul(N)?)?;
        self.0 = rest;
        Some(values.as_chunks().0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::job::FrameResult;
    use lightpath_domain::units::Wavelength;

    #[test]
    fn states_come_back_exactly() {
        let current = OptimizationState {
            vectors: vec![vec![0.1, -2.5], vec![1e-30, 3.0], vec![f32::MIN_POSITIVE]],
            numbers: vec![1.0 / 3.0, f64::INFINITY, -0.0],
        };
        let finished = vec![WavelengthResult {
            wavelength: Wavelength { pm: 515_000 },
            frames: vec![FrameResult { phase: "sha256-1".into(), phase_npy: "sha256-2".into() }],
            planes: Vec::new(),
            intensity_scale: 0.1 + 0.2,
            loss: 1e-5,
            largest_amplitude: None,
        }];
        let state = HologramState { finished, loss: 0.1 + 0.2, steps: 7, compute_s: 1e-3, current: None };
        let bytes = state.to_bytes(Some(&current));
        let whole = HologramState { current: Some(current), ..state };
        assert_eq!(HologramState::from_bytes(&bytes), Some(whole));
        for end in [0, 3, 8, 11, bytes.len() - 1] {
            assert_eq!(HologramState::from_bytes(&bytes[..end]), None, "cut at {end}");
        }

        let refinement = DampedState {
            parameters: vec![0.1, 0.7],
            loss: 1e-5,
            gradient: vec![-1.0 / 7.0, 0.0],
            damping: 1e-3,
            evaluations: 9,
        };
        let best = |order| Best { order, varying: true, parameters: vec![0.3], loss: 1e-4, loss_before: f64::INFINITY };
        let parametric = ParametricState {
            parameters: vec![0.1],
            refinement: Some(refinement),
            best: Some(best(8)),
            uniform: Some(best(5)),
            varying: true,
            kept: vec![0, 2, 3],
            curvature: vec![4.0],
            rescreened: true,
            rung: 1,
            converged: true,
            loss_history: vec![0.3, 0.2],
            adam_steps: 5,
            ..ParametricState::default()
        };
        let bins = BinsState { parameters: vec![0.1, 0.2], adam_steps: 3, offset: 0.01, ..BinsState::default() };
        let plain = ParametricState::default();
        for state in
            [LearnState::Parametric(parametric.into()), LearnState::Parametric(plain.into()), LearnState::Bins(bins)]
        {
            let bytes = learn_state_to_bytes(&state);
            assert_eq!(learn_state_from_bytes(&bytes), Some(state));
            assert_eq!(learn_state_from_bytes(&bytes[..bytes.len() - 1]), None);
        }
    }
}
