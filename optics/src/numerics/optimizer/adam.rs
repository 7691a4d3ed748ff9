//! Adam, a gradient method with a step size for each parameter.
//!
//! ```text
//! m ← β₁m + (1−β₁)g,  v ← β₂v + (1−β₂)g²,  θ ← θ − η · m̂ / (√v̂ + ε)
//! ```
//!
//! θ are the parameters, g is the gradient, η the learning rate, n the number of the step, m̂ = m/(1−β₁ⁿ), v̂ =
//! v/(1−β₂ⁿ), β₁ = 0.9, β₂ = 0.999, ε = 1e−8. D. Kingma and J. Ba, ICLR 2015.

use crate::numerics::real::Number;

const BETA_1: f64 = 0.9;
const BETA_2: f64 = 0.999;
const EPSILON: f64 = 1e-8;

/// Coefficients of one step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AdamStep<T> {
    scale: T,
    first: T,
    second: T,
    rate: T,
    second_correction: T,
    epsilon: T,
}

impl<T: Number> AdamStep<T> {
    /// Coefficients of step number `iteration`, which starts at 1. Gradients are first multiplied by `gradient_scale`.
    pub(crate) fn new(learning_rate: f64, iteration: u32, gradient_scale: f64) -> Self {
        let n = iteration as i32;
        Self {
            scale: T::of(gradient_scale),
            first: T::of(BETA_1),
            second: T::of(BETA_2),
            rate: T::of(learning_rate / (1.0 - BETA_1.powi(n))),
            second_correction: T::of(1.0 / (1.0 - BETA_2.powi(n))),
            epsilon: T::of(EPSILON),
        }
    }

    #[inline(always)]
    pub(crate) fn take(self, phase: &mut [T], m: &mut [T], v: &mut [T], g: &[T]) {
        for (((phase, m), v), &g) in phase.iter_mut().zip(m).zip(v).zip(g) {
            let g = g * self.scale;
            *m = self.first * *m + (T::one() - self.first) * g;
            *v = self.second * *v + (T::one() - self.second) * g * g;
            *phase = *phase - self.rate * *m / ((*v * self.second_correction).sqrt() + self.epsilon);
        }
    }
}
