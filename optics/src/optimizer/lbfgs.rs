//! L-BFGS with a strong Wolfe line search.
//!
//! The inverse Hessian is built from the last steps and gradient changes by the two-loop recursion; a line search finds
//! a step t with f(t) ≤ f(0) + c₁ t f′(0) and |f′(t)| ≤ c₂ |f′(0)|. J. Nocedal and S. Wright, Numerical Optimization,
//! 2nd ed., algorithms 7.4, 7.5, 3.5 and 3.6.

use std::collections::VecDeque;

/// Sufficient decrease, c₁.
const DECREASE: f64 = 1e-4;
/// Curvature, c₂.
const CURVATURE: f64 = 0.9;
/// Steps remembered.
const HISTORY: usize = 20;
/// Evaluations in one line search.
const SEARCH_MAX: usize = 12;

/// Everything that the next iteration depends on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LbfgsState {
    /// The parameters.
    pub parameters: Vec<f64>,
    /// f at them.
    pub loss: f64,
    /// Its gradient.
    pub gradient: Vec<f64>,
    /// The last steps and gradient changes, oldest first.
    pub history: VecDeque<(Vec<f64>, Vec<f64>)>,
    /// Evaluations so far.
    pub evaluations: u32,
}

/// A point on the line of a search.
#[derive(Clone, Debug)]
struct Trial {
    step: f64,
    parameters: Vec<f64>,
    loss: f64,
    gradient: Vec<f64>,
    slope: f64,
}

impl LbfgsState {
    /// Evaluates the first point.
    ///
    /// # Errors
    ///
    /// Those of `evaluate`.
    pub fn start<E>(
        parameters: Vec<f64>,
        mut evaluate: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>,
    ) -> Result<Self, E> {
        let (loss, gradient) = evaluate(&parameters)?;
        Ok(Self { parameters, loss, gradient, history: VecDeque::new(), evaluations: 1 })
    }

    /// One iteration: a direction and a search along it. False when no better point was found, the end.
    ///
    /// # Errors
    ///
    /// Those of `evaluate`; the state is then as before.
    pub fn step<E>(&mut self, evaluate: impl FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>) -> Result<bool, E> {
        let mut direction = self.direction();
        let mut slope = dot(&direction, &self.gradient);
        if slope >= 0.0 {
            self.history.clear();
            direction = self.gradient.iter().map(|g| -g).collect();
            slope = dot(&direction, &self.gradient);
        }
        if slope == 0.0 {
            return Ok(false);
        }
        // Without history the gradient's length says nothing about the step's: begin with a small change.
        let largest = direction.iter().fold(0.0_f64, |largest, d| largest.max(d.abs()));
        let first = if self.history.is_empty() { (0.05 / largest).min(1.0) } else { 1.0 };
        let mut search = Search { state: self, direction: &direction, slope, evaluate, evaluations: 0 };
        let (found, evaluations) = (search.run(first)?, search.evaluations);
        self.evaluations += evaluations;
        let Some(found) = found else { return Ok(false) };
        self.accept(found);
        Ok(true)
    }

    fn accept(&mut self, found: Trial) {
        let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>();
        let step = difference(&found.parameters, &self.parameters);
        let change = difference(&found.gradient, &self.gradient);
        // Only pairs of positive curvature keep the inverse Hessian positive definite.
        if dot(&step, &change) > 1e-10 * dot(&change, &change).sqrt() * dot(&step, &step).sqrt() {
            if self.history.len() == HISTORY {
                self.history.pop_front();
            }
            self.history.push_back((step, change));
        }
        (self.parameters, self.loss, self.gradient) = (found.parameters, found.loss, found.gradient);
    }

    fn direction(&self) -> Vec<f64> {
        let mut q = self.gradient.clone();
        let mut weights = Vec::with_capacity(self.history.len());
        for (step, change) in self.history.iter().rev() {
            let weight = dot(step, &q) / dot(step, change);
            add_scaled(&mut q, -weight, change);
            weights.push(weight);
        }
        if let Some((step, change)) = self.history.back() {
            let scale = dot(step, change) / dot(change, change);
            q.iter_mut().for_each(|q| *q *= scale);
        }
        for ((step, change), weight) in self.history.iter().zip(weights.into_iter().rev()) {
            let correction = weight - dot(change, &q) / dot(step, change);
            add_scaled(&mut q, correction, step);
        }
        q.iter_mut().for_each(|q| *q = -*q);
        q
    }
}

/// A line search from a state along a direction.
struct Search<'a, F> {
    state: &'a LbfgsState,
    direction: &'a [f64],
    slope: f64,
    evaluate: F,
    evaluations: u32,
}

impl<E, F: FnMut(&[f64]) -> Result<(f64, Vec<f64>), E>> Search<'_, F> {
    fn run(&mut self, first: f64) -> Result<Option<Trial>, E> {
        let mut low = Trial {
            step: 0.0,
            parameters: self.state.parameters.clone(),
            loss: self.state.loss,
            gradient: self.state.gradient.clone(),
            slope: self.slope,
        };
        let mut step = first;
        for _ in 0..SEARCH_MAX {
            let trial = self.trial(step)?;
            if !self.decreases(&trial) || (low.step > 0.0 && trial.loss >= low.loss) {
                return self.zoom(low, trial);
            }
            if trial.slope.abs() <= -CURVATURE * self.slope {
                return Ok(Some(trial));
            }
            if trial.slope >= 0.0 {
                return self.zoom(trial, low);
            }
            step = (trial.step * 2.5).max(minimum_between(&low, &trial).min(trial.step * 5.0));
            low = trial;
        }
        Ok(self.better(low))
    }

    /// Shrinks an interval that holds a good step; `low` has the lower loss and sufficient decrease.
    fn zoom(&mut self, mut low: Trial, mut high: Trial) -> Result<Option<Trial>, E> {
        while (self.evaluations as usize) < SEARCH_MAX {
            let width = high.step - low.step;
            let inside = (minimum_between(&low, &high) - low.step) / width;
            // Stay off the ends, where an interpolation says nothing new.
            let inside = if inside.is_finite() { inside.clamp(0.1, 0.9) } else { 0.5 };
            let trial = self.trial(low.step + inside * width)?;
            if !self.decreases(&trial) || trial.loss >= low.loss {
                high = trial;
                continue;
            }
            if trial.slope.abs() <= -CURVATURE * self.slope {
                return Ok(Some(trial));
            }
            if trial.slope * width >= 0.0 {
                high = low;
            }
            low = trial;
        }
        Ok(self.better(low))
    }

    fn better(&self, trial: Trial) -> Option<Trial> {
        (trial.loss < self.state.loss).then_some(trial)
    }

    fn decreases(&self, trial: &Trial) -> bool {
        trial.loss <= self.state.loss + DECREASE * trial.step * self.slope
    }

    fn trial(&mut self, step: f64) -> Result<Trial, E> {
        let mut parameters = self.state.parameters.clone();
        add_scaled(&mut parameters, step, self.direction);
        let (loss, gradient) = (self.evaluate)(&parameters)?;
        self.evaluations += 1;
        let slope = dot(self.direction, &gradient);
        Ok(Trial { step, parameters, loss, gradient, slope })
    }
}

/// The minimum of the cubic through two points and their slopes.
fn minimum_between(a: &Trial, b: &Trial) -> f64 {
    let d1 = a.slope + b.slope - 3.0 * (a.loss - b.loss) / (a.step - b.step);
    let d2 = (b.step - a.step).signum() * (d1 * d1 - a.slope * b.slope).sqrt();
    b.step - (b.step - a.step) * (b.slope + d2 - d1) / (b.slope - a.slope + 2.0 * d2)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_scaled(to: &mut [f64], scale: f64, what: &[f64]) {
    for (to, what) in to.iter_mut().zip(what) {
        *to += scale * what;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(x: &[f64]) -> Result<(f64, Vec<f64>), ()> {
        let mut gradient = vec![0.0; x.len()];
        let mut loss = 0.0;
        for i in 0..x.len() - 1 {
            let (a, b) = (1.0 - x[i], x[i + 1] - x[i] * x[i]);
            loss += a * a + 100.0 * b * b;
            gradient[i] += -2.0 * a - 400.0 * x[i] * b;
            gradient[i + 1] += 200.0 * b;
        }
        Ok((loss, gradient))
    }

    #[test]
    fn finds_the_minimum_of_a_curved_valley() {
        let mut state = LbfgsState::start(vec![-1.2, 1.0, -0.5, 2.0], rosenbrock).unwrap();
        while state.evaluations < 200 && state.step(rosenbrock).unwrap() {}
        assert!(state.loss < 1e-16, "loss {:e} after {} evaluations", state.loss, state.evaluations);
        assert!(state.parameters.iter().all(|x| (x - 1.0).abs() < 1e-7));
    }

    #[test]
    fn ends_at_a_minimum_and_never_goes_up() {
        let parabola = |x: &[f64]| Ok::<_, ()>((x[0] * x[0], vec![2.0 * x[0]]));
        let mut state = LbfgsState::start(vec![3.0], parabola).unwrap();
        let mut before = state.loss;
        while state.step(parabola).unwrap() {
            assert!(state.loss < before);
            before = state.loss;
        }
        assert!(state.loss < 1e-12);
    }
}
