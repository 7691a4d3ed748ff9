//! Uncertainty of a learned model.
//!
//! ```text
//! C = A⁻¹ [ Σ_p (g_p − ḡ)(g_p − ḡ)ᵀ ] A⁻¹ / (P (P − 1)),   var f(θ) = vᵀ C v,   v = ∂f/∂θ
//! ```
//!
//! g_p is the gradient of pair p's loss at the learned θ, ḡ the mean over the P pairs, A the curvature of the loss. To
//! first order, this is the scatter of the fits that leave out one photograph each. It needs no model of the noise,
//! includes what the model cannot describe, and counts each photograph once, whatever its number of pixels. H. White,
//! Econometrica 50, 1 (1982).
//!
//! θ can have parameters that the model lacks, such as cross-talk, with the value 0. Their scatter says how much of
//! them the photographs could hide.

use super::fit::Fit;
use super::layout::Layout;
use super::options::KernelModel;
use super::pair::{Example, Pair};
use super::parametric::{CURVATURE_PAIRS, CURVATURE_PX};
use super::strengths::PartStrength;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::phase_response::HARMONICS;
use crate::display::parts::{ModelPart, THETA};
use crate::display::{Carrier, Detector, DisplayModel, KernelShape};
use crate::error::Error;
use crate::numerics::RegionOfInterest;
use crate::numerics::cholesky::Cholesky;
use crate::numerics::optimizer::damped::FLOOR;
use std::ops::Range;

/// Fewest pairs from which the scatter between pairs can be estimated.
const PAIRS_MIN: usize = 3;
/// Number of standard deviations that a part can have without being noticed.
const HIDDEN_DEVIATIONS: f64 = 2.0;

/// Estimator of the uncertainty of a learned model. Pairs are added one after the other.
#[derive(Debug)]
pub struct ModelUncertainty {
    model: DisplayModel,
    /// Layout of the model. That of the fit has besides what photographs can hide.
    layout: Layout,
    fit: Fit<f32>,
    region: RegionOfInterest,
    /// Sum of the curvatures of the first pairs, row after row.
    curvature: Vec<f64>,
    /// Gradient of each pair's loss.
    gradients: Vec<Vec<f64>>,
}

/// Covariance of the coefficients [a_k, b_k] of a phase response.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCovariance {
    /// Covariance matrix \[rad²\], row after row.
    matrix: [[f64; 2 * HARMONICS]; 2 * HARMONICS],
}

/// Scatter of some parameters between fits that leave out one pair each.
struct Scatter<'a> {
    positions: Vec<usize>,
    curvature: Cholesky,
    gradients: &'a [Vec<f64>],
    mean: Vec<f64>,
}

impl ModelUncertainty {
    /// An estimator for pairs that `model` was learned from. `None` for a model without a learned response, or of
    /// another shape.
    ///
    /// # Errors
    ///
    /// The errors of [`DisplayModel::validate`].
    pub fn of(
        model: &DisplayModel,
        detector: Detector,
        carrier: Option<Carrier>,
        region: RegionOfInterest,
    ) -> Result<Option<Self>, Error> {
        model.validate()?;
        let Some(layout) = layout_of(model) else { return Ok(None) };
        let extended =
            Layout::of(KernelModel::Display, layout.kernel.order(), layout.blocks.with_hidden()).on(&model.setup);
        let fit = Fit::of_model(model, extended, detector, carrier)?;
        let curvature = vec![0.0; extended.len() * extended.len()];
        Ok(Some(Self { model: model.clone(), layout, fit, region, curvature, gradients: Vec::new() }))
    }

    /// Adds a pair.
    ///
    /// # Errors
    ///
    /// [`Error`] for a pair of another size, with values that are not finite, or without an unsaturated pixel in the
    /// region.
    pub fn add(&mut self, pair: &Pair) -> Result<(), Error> {
        let example = Example::new(pair, &self.fit.engine, self.region)?;
        self.gradients.push(self.fit.evaluate(&example).1);
        let before = self.gradients.len() - 1;
        if before < CURVATURE_PAIRS {
            let stride = (self.region.pixels() / CURVATURE_PX).max(1);
            let curvature = self.fit.curvature(&example, before * stride / CURVATURE_PAIRS, stride);
            self.curvature.iter_mut().zip(curvature.matrix).for_each(|(sum, value)| *sum += value);
        }
        Ok(())
    }

    /// The covariance of the phase response. `None` for fewer than three pairs, or pairs that do not determine the
    /// response.
    #[must_use]
    pub fn response(&self) -> Option<ResponseCovariance> {
        let (scatter, first) = (self.scatter(0..0)?, self.fit.layout.start(ModelPart::PhaseResponse));
        let changes: [Vec<f64>; 2 * HARMONICS] = std::array::from_fn(|i| scatter.changes(first + i, &[1.0]));
        Some(ResponseCovariance {
            matrix: std::array::from_fn(|a| std::array::from_fn(|b| scatter.covariance(&changes[a], &changes[b]))),
        })
    }

    /// How strong the parts are that only some displays need, how certain that is, and what the photographs could hide.
    /// `None` for fewer than three pairs, or pairs that do not determine the model.
    #[must_use]
    pub fn strengths(&self) -> Option<Vec<PartStrength>> {
        let own = self.scatter(0..0)?;
        let mut strengths = PartStrength::all_of(&self.model);
        for PartStrength { part, kept, measures } in &mut strengths {
            let (row, range) = (part.row(), self.fit.layout.range(*part));
            if *kept {
                let deviation = |slopes: &[f64]| own.deviation(range.start, slopes);
                let stds = row.deviations(&self.fit.layout, &self.model, &deviation);
                measures.iter_mut().zip(stds.into_iter().flatten()).for_each(|(measure, std)| measure.std = Some(std));
            } else if let Some(hidden) = row.hidden()
                && let Some(scatter) = self.scatter(range.clone())
            {
                let most = |slopes: &[f64]| HIDDEN_DEVIATIONS * scatter.deviation(range.start, slopes);
                measures.iter_mut().zip(hidden(&most)).for_each(|(measure, most)| measure.hidden = Some(most));
            }
        }
        Some(strengths)
    }

    /// The scatter of the model's own parameters and of those in a range. `None` for fewer than three pairs, or pairs
    /// that do not determine them.
    fn scatter(&self, besides: Range<usize>) -> Option<Scatter<'_>> {
        let pairs = self.gradients.len();
        if pairs < PAIRS_MIN {
            return None;
        }
        let own = self.layout.converted(&vec![1.0; self.layout.len()], &self.fit.layout);
        let positions: Vec<usize> = (0..own.len()).filter(|at| own[*at] == 1.0 || besides.contains(at)).collect();
        let (n, all) = (positions.len(), own.len());
        let at = |a: usize, b: usize| self.curvature[a * all + b] / CURVATURE_PAIRS.min(pairs) as f64;
        let mut curvature: Vec<f64> =
            positions.iter().flat_map(|&a| positions.iter().map(move |&b| at(a, b))).collect();
        let largest = (0..n).map(|i| curvature[i * n + i]).fold(0.0, f64::max);
        (0..n).for_each(|i| curvature[i * n + i] += FLOOR * largest);
        let mean = (0..all).map(|i| self.gradients.iter().map(|g| g[i]).sum::<f64>() / pairs as f64).collect();
        Some(Scatter { positions, curvature: Cholesky::of(curvature, n)?, gradients: &self.gradients, mean })
    }
}

impl Scatter<'_> {
    /// First-order change, when a pair is left out, of a function with these slopes by parameters from `start` on, times
    /// P.
    fn changes(&self, start: usize, slopes: &[f64]) -> Vec<f64> {
        let slope = |at: &usize| at.checked_sub(start).and_then(|at| slopes.get(at)).copied().unwrap_or(0.0);
        let row = self.curvature.solve(self.positions.iter().map(slope).collect());
        let change = |gradient: &Vec<f64>| {
            self.positions.iter().zip(&row).map(|(&at, a)| a * (gradient[at] - self.mean[at])).sum()
        };
        self.gradients.iter().map(change).collect()
    }

    /// Covariance of two functions with these changes.
    fn covariance(&self, a: &[f64], b: &[f64]) -> f64 {
        let pairs = self.gradients.len();
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / (pairs * (pairs - 1)) as f64
    }

    /// Standard deviation of a function with these slopes by parameters from `start` on.
    fn deviation(&self, start: usize, slopes: &[f64]) -> f64 {
        let changes = self.changes(start, slopes);
        self.covariance(&changes, &changes).sqrt()
    }
}

/// The layout of a learned model with a phase response; `None` for a model of another shape.
pub(super) fn layout_of(model: &DisplayModel) -> Option<Layout> {
    let KernelShape::Smooth(kernel) = &model.kernel else { return None };
    let layout = Layout::of(KernelModel::Display, kernel.order, Blocks::of(model)).on(&model.setup);
    let has_form = THETA.into_iter().all(|part| part.row().has_form_of(&layout, model));
    has_form.then_some(layout)
}

impl ResponseCovariance {
    /// Standard deviation of r(φ) \[rad\] for a wanted phase φ \[rad\].
    #[must_use]
    pub fn deviation_rad(&self, phase_rad: f64) -> f64 {
        let slope: [f64; 2 * HARMONICS] = std::array::from_fn(|i| {
            let (sine, cosine) = ((i / 2 + 1) as f64 * phase_rad).sin_cos();
            if i % 2 == 0 { sine } else { cosine }
        });
        let row = |row: &[f64; 2 * HARMONICS]| row.iter().zip(&slope).map(|(c, v)| c * v).sum::<f64>();
        self.matrix.iter().zip(&slope).map(|(c, v)| row(c) * v).sum::<f64>().max(0.0).sqrt()
    }
}
