//! Levenberg–Marquardt method: Gauss–Newton steps, damped until the loss decreases.
//!
//! ```text
//! ( A + λ diag A ) δ = −g,   ρ = ( L(θ) − L(θ + δ) ) / ( −gᵀδ − δᵀAδ/2 )
//! ```
//!
//! A is the Gauss–Newton matrix, g the gradient, δ the step, λ the damping, and ρ the ratio of the actual to the
//! predicted decrease of the loss L. A step that lowers the loss is accepted, and λ falls further if the prediction was
//! good (ρ near 1). Otherwise the step is rejected and λ rises. K. Madsen, H. B. Nielsen and O. Tingleff, Methods for
//! Non-Linear Least Squares Problems, 2004, section 3.2.

use crate::numerics::cholesky::Cholesky;
use serde::{Deserialize, Serialize};

/// Initial damping λ.
const DAMPING: f64 = 1e-2;
/// Smallest damping λ. A smaller value would not change the step.
const DAMPING_MIN: f64 = 1e-7;
/// Largest damping λ. With a larger value a step would not change the parameters.
const DAMPING_MAX: f64 = 1e6;
/// Largest number of trials in one step.
const TRIALS_MAX: u32 = 5;
/// Factor of the damping after a trial that failed. Far from the optimum the first damping may be far too small.
const GROWTH: f64 = 8.0;
/// Least ratio of the actual to the predicted decrease of the loss at which a step is trusted.
const TRUSTED_MIN: f64 = 0.1;
/// Part of the largest curvature that is added to every curvature. Parameters that the data do not determine then keep
/// their values.
pub(crate) const FLOOR: f64 = 1e-10;

/// State of the optimization between two steps.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DampedState {
    /// Parameters θ.
    pub parameters: Vec<f64>,
    /// Loss L at the parameters.
    pub loss: f64,
    /// Gradient of the loss at the parameters.
    pub gradient: Vec<f64>,
    /// Damping λ.
    pub damping: f64,
    /// Number of evaluations so far.
    pub evaluations: u32,
    /// Whether the last step lowered the loss by about what was predicted. If not, a small decrease does not mean that
    /// the optimum is near.
    pub trusted: bool,
}

impl DampedState {
    /// Starts at `parameters` and evaluates them.
    ///
    /// # Errors
    ///
    /// The errors of `evaluate`.
    pub fn start<E>(
        parameters: Vec<f64>,
        mut evaluate: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>,
    ) -> Result<Self, E> {
        let (loss, gradient) = evaluate(&parameters)?;
        Ok(Self { parameters, loss, gradient, damping: DAMPING, evaluations: 1, trusted: true })
    }

    /// Takes one step with the curvature matrix A, given row by row. Returns false if no better point was found.
    ///
    /// # Errors
    ///
    /// The errors of `evaluate`; the parameters then stay unchanged.
    pub fn step<E>(
        &mut self,
        curvature: &[f64],
        evaluate: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>,
    ) -> Result<bool, E> {
        self.step_within(curvature, |_| (), evaluate)
    }

    /// [`Self::step`] with parameters that have limits: `limit` moves parameters into them.
    ///
    /// # Errors
    ///
    /// The errors of `evaluate`; the parameters then stay unchanged.
    pub fn step_within<E>(
        &mut self,
        curvature: &[f64],
        limit: impl Fn(&mut [f64]),
        mut evaluate: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>,
    ) -> Result<bool, E> {
        for _ in 0..TRIALS_MAX {
            let Some((step, predicted_decrease)) = self.damped_step(curvature) else {
                self.damping = (self.damping * GROWTH).min(DAMPING_MAX);
                continue;
            };
            let mut parameters: Vec<f64> = self.parameters.iter().zip(&step).map(|(p, d)| p + d).collect();
            limit(&mut parameters);
            let (loss, gradient) = evaluate(&parameters)?;
            self.evaluations += 1;
            if loss < self.loss {
                let ratio = (self.loss - loss) / predicted_decrease;
                self.trusted = ratio >= TRUSTED_MIN;
                let factor = if self.trusted { (1.0 - (2.0 * ratio - 1.0).powi(3)).clamp(0.1, 2.0) } else { GROWTH };
                self.damping = (self.damping * factor).clamp(DAMPING_MIN, DAMPING_MAX);
                (self.parameters, self.loss, self.gradient) = (parameters, loss, gradient);
                return Ok(true);
            }
            self.damping = (self.damping * GROWTH).min(DAMPING_MAX);
        }
        Ok(false)
    }

    /// Returns to the initial damping.
    pub fn restart(&mut self) {
        self.damping = DAMPING;
    }

    /// Step δ and the predicted decrease of the loss; `None` if the damped matrix is not positive definite or no
    /// decrease is predicted.
    fn damped_step(&self, curvature: &[f64]) -> Option<(Vec<f64>, f64)> {
        let n = self.parameters.len();
        let largest = (0..n).map(|i| curvature[i * n + i]).fold(0.0, f64::max);
        let mut matrix = curvature.to_vec();
        for i in 0..n {
            matrix[i * n + i] += self.damping * curvature[i * n + i] + FLOOR * largest;
        }
        let step = Cholesky::of(matrix, n)?.solve(self.gradient.iter().map(|g| -g).collect());
        let slope: f64 = step.iter().zip(&self.gradient).map(|(d, g)| d * g).sum();
        let curvature_term: f64 = step
            .iter()
            .zip(curvature.chunks_exact(n))
            .map(|(d, row)| d * row.iter().zip(&step).map(|(a, d)| a * d).sum::<f64>())
            .sum();
        let predicted_decrease = -slope - curvature_term / 2.0;
        (predicted_decrease > 0.0).then_some((step, predicted_decrease))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Loss, gradient and curvature of Rosenbrock's function, with the residuals 10 (y − x²) and 1 − x.
    fn rosenbrock(at: &[f64]) -> (f64, Vec<f64>, Vec<f64>) {
        let (x, y) = (at[0], at[1]);
        let e = [10.0 * (y - x * x), 1.0 - x];
        let j = [[-20.0 * x, 10.0], [-1.0, 0.0]];
        let gradient = (0..2).map(|a| 2.0 * (e[0] * j[0][a] + e[1] * j[1][a])).collect();
        let product = |a: usize, b: usize| 2.0 * (j[0][a] * j[0][b] + j[1][a] * j[1][b]);
        (e[0] * e[0] + e[1] * e[1], gradient, vec![product(0, 0), product(0, 1), product(1, 0), product(1, 1)])
    }

    fn evaluate(at: &[f64]) -> Result<(f64, Vec<f64>), ()> {
        let (loss, gradient, _) = rosenbrock(at);
        Ok((loss, gradient))
    }

    #[test]
    fn minimum_of_curved_valley_is_found_with_falling_loss() {
        let mut state = DampedState::start(vec![-1.2, 1.0], evaluate).unwrap();
        let mut before = state.loss;
        while state.evaluations < 100 && state.step(&rosenbrock(&state.parameters.clone()).2, evaluate).unwrap() {
            assert!(state.loss < before);
            before = state.loss;
        }
        assert!(state.loss < 1e-16, "{:e} after {} evaluations", state.loss, state.evaluations);
        assert!(state.evaluations < 50, "{} evaluations", state.evaluations);
    }

    #[test]
    fn undetermined_parameters_stay_unchanged() {
        let parabola = |x: &[f64]| Ok::<_, ()>((x[0] * x[0], vec![2.0 * x[0], 0.0]));
        let mut state = DampedState::start(vec![3.0, 5.0], parabola).unwrap();
        for _ in 0..30 {
            state.step(&[2.0, 0.0, 0.0, 0.0], parabola).unwrap();
        }
        assert!(state.parameters[0].abs() < 1e-8 && state.parameters[1] == 5.0, "{:?}", state.parameters);
    }
}
