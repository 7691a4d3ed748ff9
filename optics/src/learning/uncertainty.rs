//! Uncertainty of a learned phase response.
//!
//! ```text
//! C = A⁻¹ [ Σ_p (g_p − ḡ)(g_p − ḡ)ᵀ ] A⁻¹ / (P (P − 1)),   var r(φ) = vᵀ C v,   v = ∂r/∂θ: sin kφ at a_k, cos kφ at b_k, else 0
//! ```
//!
//! g_p is the gradient of pair p's loss at the learned θ, ḡ the mean over the P pairs, A the curvature of the loss. To
//! first order, this is the scatter of the fits that leave out one photograph each. It needs no model of the noise,
//! includes what the model cannot describe, and counts each photograph once, whatever its number of pixels. H. White,
//! Econometrica 50, 1 (1982).

use super::fit::Fit;
use super::layout::{HARMONICS, Layout};
use super::pair::{Example, Pair};
use super::parametric::{CURVATURE_PAIRS, CURVATURE_PX};
use super::{Blocks, KernelModel};
use crate::carrier::Carrier;
use crate::optimizer::damped::{FLOOR, solve};
use crate::{Detector, DisplayModel, Error, KernelShape, RegionOfInterest};

/// Fewest pairs from which the scatter between pairs can be estimated.
const PAIRS_MIN: usize = 3;

/// Estimator of the uncertainty of a model's phase response. Pairs are added one after the other.
#[derive(Debug)]
pub struct ResponseUncertainty {
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

impl ResponseUncertainty {
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
        let KernelShape::Smooth(kernel) = &model.kernel else { return Ok(None) };
        let layout = Layout::of(KernelModel::Display, kernel.order, Blocks::of(model));
        let is_of_layout = (model.source.order, model.response.len()) == (layout.source.order(), layout.harmonics)
            && [0, layout.response_variation].contains(&model.response_variation.coefficients.len())
            && model.coherence.modes().len() == layout.modes
            && model.coherence.modes().iter().all(|mode| mode.errors.order == layout.mode.order());
        if !is_of_layout {
            return Ok(None);
        }
        let mut fit = Fit::new(vec![model.setup], layout, detector, carrier)?;
        fit.set(0, &layout.parameters(model));
        let curvature = vec![0.0; layout.len() * layout.len()];
        Ok(Some(Self { fit, region, curvature, gradients: Vec::new() }))
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

    /// The covariance estimated from the pairs. `None` for fewer than three pairs, or pairs that do not determine the
    /// response.
    #[must_use]
    pub fn covariance(&self) -> Option<ResponseCovariance> {
        let pairs = self.gradients.len();
        if pairs < PAIRS_MIN {
            return None;
        }
        let (n, first) = (self.fit.layout.len(), self.fit.layout.response());
        let mut curvature: Vec<f64> =
            self.curvature.iter().map(|sum| sum / CURVATURE_PAIRS.min(pairs) as f64).collect();
        let largest = (0..n).map(|i| curvature[i * n + i]).fold(0.0, f64::max);
        (0..n).for_each(|i| curvature[i * n + i] += FLOOR * largest);
        let mean: Vec<f64> =
            (0..n).map(|i| self.gradients.iter().map(|gradient| gradient[i]).sum::<f64>() / pairs as f64).collect();

        // First-order change of each coefficient when a pair is left out, times P.
        let mut changes = Vec::with_capacity(2 * HARMONICS);
        for coefficient in first..first + 2 * HARMONICS {
            let unit = (0..n).map(|i| f64::from(u8::from(i == coefficient))).collect();
            let row = solve(curvature.clone(), unit)?;
            let along = |gradient: &Vec<f64>| -> f64 {
                row.iter().zip(gradient.iter().zip(&mean)).map(|(a, (g, mean))| a * (g - mean)).sum()
            };
            changes.push(self.gradients.iter().map(along).collect::<Vec<f64>>());
        }
        let scale = 1.0 / (pairs * (pairs - 1)) as f64;
        let product = |a: usize, b: usize| changes[a].iter().zip(&changes[b]).map(|(a, b)| a * b).sum::<f64>() * scale;
        Some(ResponseCovariance { matrix: std::array::from_fn(|a| std::array::from_fn(|b| product(a, b))) })
    }
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
