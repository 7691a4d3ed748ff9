//! Fit of [`Dust`](crate::Dust): a complex factor for each pixel of the SLM, by L-BFGS.
//!
//! ```text
//! min over δ, ε of  mean over pairs of L  +  w · mean over pixels of ( δ² + ε² )
//! ```
//!
//! The factor is exp(δ + iε) and L the loss of a pair. Everything else of the display stays as it was fitted before.
//! The second term holds pixels near 1 whose light the photographs hardly show. The loss on the validation pairs
//! decides when the fit ends and whether the dust is kept.

use crate::numerics::optimizer::limited_memory::{LimitedMemory, Workspace};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Weight of the second term, relative to the loss without dust: exponents of 1 everywhere cost a hundredth of that
/// loss. Ten times as much changes the result little.
const PRIOR: f64 = 0.01;
/// Least relative decrease of the validation loss by which an evaluation counts as a gain.
const GAIN_MIN: f64 = 1e-2;
/// Number of consecutive evaluations without a gain after which the fit ends.
const WITHOUT_GAIN_MAX: u32 = 5;

/// State of a fit of dust.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct DustFit {
    search: LimitedMemory,
    /// Training loss and validation loss before the first step.
    before: Option<(f64, f64)>,
    /// The exponents with the lowest validation loss, and this loss.
    best: Option<(Vec<f32>, f64)>,
    without_gain: u32,
}

impl DustFit {
    /// Starts from exponents δ and ε of each pixel in turn.
    pub(super) fn start(exponents: Vec<f32>) -> Self {
        Self { search: LimitedMemory::new(exponents), before: None, best: None, without_gain: 0 }
    }

    pub(super) fn evaluations(&self) -> u32 {
        self.search.counts.evaluations
    }

    /// The exponents that the search has accepted last.
    pub(super) fn exponents(&self) -> &[f32] {
        &self.search.point
    }

    /// Whether the last step moved the exponents, or evaluated them for the first time.
    pub(super) fn has_moved(&self) -> bool {
        self.search.search.evaluations == 0
    }

    pub(super) fn is_consistent(&self, pixels: usize) -> bool {
        self.search.is_consistent(2 * pixels) && self.best.as_ref().is_none_or(|(best, _)| best.len() == 2 * pixels)
    }

    /// Takes a step. `evaluate(exponents, gradient)` returns the mean loss of the training pairs, and adds its
    /// gradient. Returns the loss at the point that was evaluated.
    pub(super) fn step<E>(&mut self, mut evaluate: impl FnMut(&[f32], &mut [f32]) -> Result<f64, E>) -> Result<f64, E> {
        let (mut outcome, mut first) = (Ok(f64::NAN), self.before.map(|(loss, _)| loss));
        self.search.advance(&mut Workspace::default(), |exponents, gradient| {
            gradient.fill(0.0);
            outcome = evaluate(exponents, gradient);
            let Ok(loss) = outcome else { return f64::NAN };
            let weight = PRIOR * *first.get_or_insert(loss) / (exponents.len() / 2) as f64;
            gradient.par_iter_mut().zip(exponents).for_each(|(g, &e)| *g += (2.0 * weight) as f32 * e);
            loss + weight * exponents.chunks(1024).map(squares).sum::<f64>()
        });
        outcome
    }

    /// Takes note of the validation loss at [`Self::exponents`]. False when the fit has ended.
    pub(super) fn validated(&mut self, training: f64, loss: f64) -> bool {
        let least = self.best.as_ref().map_or(f64::INFINITY, |(_, loss)| *loss);
        self.before.get_or_insert((training, loss));
        self.without_gain = if loss < least * (1.0 - GAIN_MIN) { 0 } else { self.without_gain + 1 };
        if loss < least {
            self.best = Some((self.search.point.clone(), loss));
        }
        self.without_gain < WITHOUT_GAIN_MAX && !self.search.counts.converged
    }

    /// The validation losses of the start and of the best exponents.
    pub(super) fn losses(&self) -> Option<(f64, f64)> {
        Some((self.before?.1, self.best.as_ref()?.1))
    }

    /// The exponents with the lowest validation loss.
    pub(super) fn best(&self) -> Option<&[f32]> {
        self.best.as_ref().map(|(exponents, _)| exponents.as_slice())
    }
}

/// Sum of the squares.
fn squares(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value).powi(2)).sum()
}
