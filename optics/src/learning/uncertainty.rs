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
use super::strengths::BlockStrengths;
use crate::display::parts::Block;
use crate::display::parts::ModelPart;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::phase_response::HARMONICS;
use crate::display::parts::response_variation::RESPONSE_VARIATION_ORDER;
use crate::display::{Carrier, Detector, DisplayModel, KernelShape, LightBlur, ResponseVariation};
use crate::error::Error;
use crate::numerics::RegionOfInterest;
use crate::numerics::chebyshev::position;
use crate::numerics::cholesky::Cholesky;
use crate::numerics::gaussian_blur::sigma_px_of_ratio;
use crate::numerics::optimizer::damped::FLOOR;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Fewest pairs from which the scatter between pairs can be estimated.
const PAIRS_MIN: usize = 3;
/// Change of a parameter by which the slope of a strength is computed.
const CHANGE: f64 = 1e-4;
/// Number of standard deviations that a part can have without being noticed.
const HIDDEN_DEVIATIONS: f64 = 2.0;

/// Estimator of the uncertainty of a learned model. Pairs are added one after the other.
#[derive(Debug)]
pub struct ModelUncertainty {
    model: DisplayModel,
    /// Layout of the model. That of the fit has cross-talk and an uneven response besides.
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

/// Uncertainty of the strengths of a model's blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StrengthUncertainty {
    /// One standard deviation of the strength of each block that the model has; `None` for dust, and for blocks that it
    /// lacks.
    pub deviations: BlockStrengths,
    /// Two standard deviations of the strength of cross-talk and of an uneven response, if the model lacks them: with
    /// less, the photographs would look the same.
    pub hidden: BlockStrengths,
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
        let blocks = layout.blocks.with(Block::Crosstalk).with(Block::UnevenResponse);
        let extended = Layout::of(KernelModel::Display, layout.kernel.order(), blocks).on(&model.setup);
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
        let changes: [Vec<f64>; 2 * HARMONICS] = std::array::from_fn(|i| scatter.changes(&[(first + i, 1.0)]));
        Some(ResponseCovariance {
            matrix: std::array::from_fn(|a| std::array::from_fn(|b| scatter.covariance(&changes[a], &changes[b]))),
        })
    }

    /// The uncertainty of the strengths of the model's blocks. `None` for fewer than three pairs, or pairs that do not
    /// determine the model.
    #[must_use]
    pub fn strengths(&self) -> Option<StrengthUncertainty> {
        let (all, has) = (self.fit.layout, self.layout.blocks);
        let scatter = self.scatter(0..0)?;
        let variation = |scatter: &Scatter<'_>| scatter.response_variation(&all);
        let of_light = |axis: usize| {
            self.deviation(&scatter, all.range(ModelPart::PartialCoherence), |strengths| {
                strengths.image_spread_px?.get(axis).copied()
            })
        };
        let deviations = BlockStrengths {
            surface_rms_rad: self
                .deviation(&scatter, all.range(ModelPart::Source), |strengths| strengths.surface_rms_rad),
            crosstalk_px: has
                .contains(Block::Crosstalk)
                .then(|| scatter.sigma_px(all.start(ModelPart::Crosstalk), self.model.crosstalk.ratios())),
            light_blur_px: has
                .contains(Block::LightBlur)
                .then(|| scatter.sigma_px(all.start(ModelPart::LightBlur), self.model.light_blur.ratios())),
            response_variation_rms: has.contains(Block::UnevenResponse).then(|| variation(&scatter)),
            image_spread_px: of_light(0).zip(of_light(1)).map(|(x, y)| [x, y]),
            ghost_share: self.deviation(&scatter, all.range(ModelPart::Ghost), |strengths| strengths.ghost_share),
            ..BlockStrengths::default()
        };
        let with = |range: Range<usize>| self.scatter(range);
        let hidden = BlockStrengths {
            crosstalk_px: match has.contains(Block::Crosstalk) {
                true => None,
                false => with(all.range(ModelPart::Crosstalk)).map(|scatter| scatter.hidden_crosstalk_px(&all)),
            },
            response_variation_rms: match has.contains(Block::UnevenResponse) {
                true => None,
                false => {
                    with(all.range(ModelPart::UnevenResponse)).map(|scatter| HIDDEN_DEVIATIONS * variation(&scatter))
                }
            },
            ..BlockStrengths::default()
        };
        Some(StrengthUncertainty { deviations, hidden })
    }

    /// Standard deviation of a strength that depends on a range of θ; `None` if the model lacks its block.
    fn deviation(
        &self,
        scatter: &Scatter<'_>,
        range: Range<usize>,
        strength: impl Fn(&BlockStrengths) -> Option<f64>,
    ) -> Option<f64> {
        strength(&BlockStrengths::of(&self.model))?;
        let (layout, theta) = (&self.fit.layout, self.fit.layout.parameters(&self.model));
        let at = |position: usize, change: f64| {
            let mut theta = theta.clone();
            theta[position] += change;
            strength(&BlockStrengths::of(&layout.model(&self.model.setup, (1.0, 0.0), &theta)))
        };
        let slope = |position| Some((at(position, CHANGE)? - at(position, -CHANGE)?) / (2.0 * CHANGE));
        let slopes: Option<Vec<(usize, f64)>> =
            range.map(|position| slope(position).map(|slope| (position, slope))).collect();
        Some(scatter.deviation(&slopes?))
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
    /// First-order change, when a pair is left out, of a function with these slopes by parameters, times P.
    fn changes(&self, slopes: &[(usize, f64)]) -> Vec<f64> {
        let slope = |at: &usize| slopes.iter().filter(|(of, _)| of == at).map(|(_, slope)| slope).sum();
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

    /// Standard deviation of a function with these slopes by parameters.
    fn deviation(&self, slopes: &[(usize, f64)]) -> f64 {
        let changes = self.changes(slopes);
        self.covariance(&changes, &changes).sqrt()
    }

    /// Standard deviation of the q of a blur along x and along y, which begin at a position of θ.
    fn ratios(&self, start: usize) -> [f64; 2] {
        [0, 1].map(|axis| self.deviation(&[(start + axis, 1.0)]))
    }

    /// Standard deviation of the σ of a blur along x and along y \[px\], whose `ratios` q begin at a position of θ:
    /// half the distance between the σ of the limits of q, because σ changes infinitely fast at q = 0.
    fn sigma_px(&self, start: usize, ratios: [f64; 2]) -> [f64; 2] {
        let deviations = self.ratios(start);
        let moved = |by: f64| sigma_px(std::array::from_fn(|axis| ratios[axis] + by * deviations[axis]));
        let (most, least) = (moved(1.0), moved(-1.0));
        std::array::from_fn(|axis| (most[axis] - least[axis]) / 2.0)
    }

    /// σ of the most cross-talk that could be hidden along x and along y \[px\].
    fn hidden_crosstalk_px(&self, layout: &Layout) -> [f64; 2] {
        sigma_px(self.ratios(layout.start(ModelPart::Crosstalk)).map(|deviation| HIDDEN_DEVIATIONS * deviation))
    }

    /// Root mean square over the SLM of the standard deviation of the response's variation v.
    fn response_variation(&self, layout: &Layout) -> f64 {
        /// Number of places along each axis.
        const SIDE: usize = 8;
        let range = layout.range(ModelPart::UnevenResponse);
        let variance = |x: f64, y: f64| {
            let slope = |term: usize| {
                let mut coefficients = vec![0.0; range.len()];
                coefficients[term] = 1.0;
                ResponseVariation { order: RESPONSE_VARIATION_ORDER, coefficients }.value(x, y)
            };
            let slopes: Vec<_> = (0..range.len()).map(|term| (range.start + term, slope(term))).collect();
            self.deviation(&slopes).powi(2)
        };
        let places = (0..SIDE * SIDE).map(|i| (position(i % SIDE, SIDE), position(i / SIDE, SIDE)));
        (places.map(|(x, y)| variance(x, y)).sum::<f64>() / (SIDE * SIDE) as f64).sqrt()
    }
}

/// σ along x and along y \[px\] of a blur with these q, moved into the limits of a blur of the light.
fn sigma_px(ratios: [f64; 2]) -> [f64; 2] {
    ratios.map(|q| sigma_px_of_ratio(q.clamp(0.0, LightBlur::RATIO_MAX)))
}

/// The layout of a learned model with a phase response; `None` for a model of another shape.
pub(super) fn layout_of(model: &DisplayModel) -> Option<Layout> {
    let KernelShape::Smooth(kernel) = &model.kernel else { return None };
    let layout = Layout::of(KernelModel::Display, kernel.order, Blocks::of(model)).on(&model.setup);
    let is_of_layout = (model.source.order, model.response.len())
        == (layout.source.order(), layout.range(ModelPart::PhaseResponse).len() / 2)
        && [0, layout.range(ModelPart::UnevenResponse).len()].contains(&model.response_variation.coefficients.len())
        && model.coherence.modes().len() == layout.modes
        && model.coherence.modes().iter().all(|mode| mode.errors.order == layout.mode.order());
    is_of_layout.then_some(layout)
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
