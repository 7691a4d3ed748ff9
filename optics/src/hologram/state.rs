//! Optimizations as numbers: saved and restored, they go on to the same bits.

use super::adam::AdamState;
use super::gerchberg_saxton::GerchbergSaxton;
use super::optimization::{HologramMethod, Optimization, Options, Run};
use super::problem::HologramProblem;
use super::rounded::Rounded;
use crate::optimizer::limited_memory::{Counts, LimitedMemory, Search, Workspace};
use crate::{Error, Plane, Result};

/// Everything that the next step depends on, beside the problem and its options.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OptimizationState<V = Vec<f32>> {
    /// Phases, moments and the like, in the method's own order.
    pub vectors: Vec<V>,
    /// Iterations, gains and the like, likewise; every number is exact.
    pub numbers: Vec<f64>,
}

/// Which kind of run a state is of: its first number.
const ADAM: f64 = 1.0;
const LBFGS: f64 = 2.0;
const GERCHBERG_SAXTON: f64 = 3.0;
const DOUBLE_PHASE: f64 = 4.0;
const ROUNDED: f64 = 5.0;

impl OptimizationState<&[f32]> {
    /// A copy of what is borrowed.
    #[must_use]
    pub fn into_owned(self) -> OptimizationState {
        OptimizationState { vectors: self.vectors.into_iter().map(<[f32]>::to_vec).collect(), numbers: self.numbers }
    }
}

impl Optimization {
    /// Everything that the next step depends on, where it lies.
    #[must_use]
    pub fn state(&self) -> OptimizationState<&[f32]> {
        let iteration = f64::from(self.iteration);
        let (vectors, numbers) = match &self.run {
            Run::Adam(state) => (
                vec![&state.phase[..], &state.first_moment, &state.second_moment],
                vec![ADAM, iteration, f64::from(state.iteration), state.gain],
            ),
            Run::Lbfgs { state, gain, .. } => {
                let (vectors, numbers) = state.to_numbers();
                (vectors, [vec![LBFGS, iteration, *gain], numbers].concat())
            }
            Run::GerchbergSaxton { rounds, phase } => {
                let wanted = rounds.wanted.iter().map(Plane::values);
                (std::iter::once(&phase[..]).chain(wanted).collect(), vec![GERCHBERG_SAXTON, iteration])
            }
            Run::DoublePhase { phase, largest_amplitude } => {
                (vec![&phase[..]], vec![DOUBLE_PHASE, iteration, *largest_amplitude])
            }
            Run::Rounded(state) => (
                vec![&state.phase[..], &state.velocity],
                vec![ROUNDED, iteration, f64::from(state.iteration), state.gain, state.rate],
            ),
        };
        OptimizationState { vectors, numbers }
    }

    /// Goes on from where [`Self::state`] was taken, with the same problem and options.
    ///
    /// # Errors
    ///
    /// [`Error`] for options out of range, or a state that is not of this problem and these options.
    pub fn resume(problem: HologramProblem, options: Options, state: OptimizationState) -> Result<Self> {
        options.validate()?;
        let OptimizationState { vectors, numbers } = state;
        let len = problem.parameters();
        let frame_len = len / problem.frames();
        let fits = vectors.first().is_some_and(|first| first.len() == len)
            && vectors.iter().all(|vector| vector.len() == len || vector.len() == frame_len);
        let [kind, iteration, rest @ ..] = numbers.as_slice() else { return Err(mismatch(numbers.len())) };
        let count = vectors.len();
        let run = match (*kind, options.method, rest) {
            _ if !fits => None,
            (ADAM, HologramMethod::Adam { .. }, &[steps, gain]) => {
                three(vectors).map(|[phase, first_moment, second_moment]| {
                    Run::Adam(AdamState { phase, first_moment, second_moment, iteration: steps as u32, gain })
                })
            }
            (LBFGS, HologramMethod::Lbfgs, &[gain, ref numbers @ ..]) => LimitedMemory::from_numbers(vectors, numbers)
                .map(|state| Run::Lbfgs { state: Box::new(state), workspace: Workspace::default(), gain }),
            (GERCHBERG_SAXTON, HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton, &[])
                if count == problem.planes() + 1 =>
            {
                let mut vectors = vectors.into_iter();
                let phase = vectors.next().unwrap_or_default();
                let (height_px, width_px) = (problem.engine().height_px(), problem.engine().width_px());
                let wanted = vectors.map(|values| Plane::try_from_vec(height_px, width_px, values));
                let wanted = wanted.collect::<Result<Vec<_>>>()?;
                let weighted = options.method == HologramMethod::WeightedGerchbergSaxton;
                let rounds = GerchbergSaxton::new(&problem, weighted, Some(wanted));
                Some(Run::GerchbergSaxton { rounds, phase })
            }
            (DOUBLE_PHASE, HologramMethod::DoublePhase, &[largest_amplitude]) => {
                vectors.into_iter().next().map(|phase| Run::DoublePhase { phase, largest_amplitude })
            }
            (ROUNDED, _, &[steps, gain, rate]) if options.levels.is_some() && count == 2 => {
                let mut vectors = vectors.into_iter();
                let (phase, velocity) = (vectors.next().unwrap_or_default(), vectors.next().unwrap_or_default());
                Some(Run::Rounded(Rounded { phase, velocity, iteration: steps as u32, gain, rate }))
            }
            _ => None,
        };
        let Some(run) = run else { return Err(mismatch(count)) };
        Ok(Self::with(problem, options, run, *iteration as u32))
    }
}

fn three(vectors: Vec<Vec<f32>>) -> Option<[Vec<f32>; 3]> {
    vectors.try_into().ok()
}

fn mismatch(vectors: usize) -> Error {
    Error::OutOfRange { name: "state", value: vectors as f64, allowed: "one of this problem, method and size" }
}

impl LimitedMemory {
    fn to_numbers(&self) -> (Vec<&[f32]>, Vec<f64>) {
        let vectors = [&self.point, &self.gradient, &self.direction].into_iter();
        let vectors = vectors.chain(&self.steps).chain(&self.changes).map(Vec::as_slice).collect();
        let Counts { evaluations, filled, next, converged } = self.counts;
        let Search { step, low, high, slope, evaluations: searched } = self.search;
        let counts = [evaluations, filled, next, u32::from(converged), searched].map(f64::from);
        let mut numbers = vec![self.loss, step, low, high, slope];
        numbers.extend(counts);
        numbers.extend(&self.products);
        (vectors, numbers)
    }

    fn from_numbers(vectors: Vec<Vec<f32>>, numbers: &[f64]) -> Option<Self> {
        let &[loss, step, low, high, slope, evaluations, filled, next, converged, searched, ref products @ ..] =
            numbers
        else {
            return None;
        };
        let mut vectors = vectors.into_iter();
        let (point, gradient, direction) = (vectors.next()?, vectors.next()?, vectors.next()?);
        let mut steps: Vec<_> = vectors.collect();
        let len = point.len();
        if steps.len() % 2 != 0 || [&gradient, &direction].into_iter().chain(&steps).any(|v| v.len() != len) {
            return None;
        }
        let changes = steps.split_off(steps.len() / 2);
        let counts = Counts {
            evaluations: evaluations as u32,
            filled: filled as u32,
            next: next as u32,
            converged: converged != 0.0,
        };
        let search = Search { step, low, high, slope, evaluations: searched as u32 };
        let products = products.to_vec();
        let state = Self { point, loss, gradient, direction, steps, changes, counts, search, products };
        state.is_whole().then_some(state)
    }
}
