//! Which holograms to photograph next.
//!
//! ```text
//! A = Σ_p A_p over the photographed holograms,   E(A) = tr( M A⁻¹ ),   M = mean of A_c over the candidates
//! ```
//!
//! A_p is the curvature of a photograph's loss by θ at the learned model. With noise, θ scatters as A⁻¹, and
//! predictions of holograms like the candidates are wrong by E(A) on average. The next hologram is the candidate whose
//! A_c lowers E most, then the one after it: the sequential design of V. V. Fedorov, Theory of Optimal Experiments
//! (1972), with the mean variance of predictions as its criterion. The photographs need not be taken to know A_c.

use super::fit::Fit;
use super::layout::Layout;
use super::pair::{Example, Pair};
use super::parametric::CURVATURE_PX;
use super::uncertainty::layout_of;
use crate::display::parts::ModelPart;
use crate::display::{Carrier, Detector, DisplayModel};
use crate::error::Error;
use crate::numerics::cholesky::Cholesky;
use crate::numerics::optimizer::damped::FLOOR;
use crate::numerics::{Plane, RegionOfInterest};
use std::ops::Range;

/// Value of the brightest pixel of a photograph, as it is usually exposed.
const BRIGHTEST: f32 = 0.9;
/// Number of offsets of the rows from which curvatures are estimated.
const OFFSETS: usize = 4;

/// Chooses among candidates the holograms whose photographs tell most about a learned model.
#[derive(Debug)]
pub struct HologramChoice {
    layout: Layout,
    fit: Fit<f32>,
    region: RegionOfInterest,
    /// Curvatures of photographed holograms, each row after row.
    photographed: Vec<Vec<f64>>,
    /// Curvatures of the candidates.
    candidates: Vec<Vec<f64>>,
}

/// A hologram to photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suggestion {
    /// Index of the candidate.
    pub candidate: usize,
    /// Change of the mean error of predictions by what the photographs leave uncertain, together with the suggestions
    /// before it \[dB\]. Below 0.
    pub error_db: f64,
    /// The part of the display whose uncertainty this hologram lowers most.
    pub part: ModelPart,
    /// Change of the prediction's error by this part's uncertainty through this hologram alone \[dB\]. Below 0.
    pub part_db: f64,
}

impl HologramChoice {
    /// A choice for a learned model. `None` for a model without a learned response, or of another shape.
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
        let fit = Fit::of_model(model, layout, detector, carrier)?;
        Ok(Some(Self { layout, fit, region, photographed: Vec::new(), candidates: Vec::new() }))
    }

    /// Adds a hologram that has been photographed: its phase \[rad\].
    ///
    /// # Errors
    ///
    /// [`Error`] for a phase of another size, or that sends no light into the region.
    pub fn add_photographed(&mut self, phase: Plane<f32>) -> Result<(), Error> {
        let curvature = self.curvature(phase, self.photographed.len())?;
        self.photographed.push(curvature);
        Ok(())
    }

    /// Adds a hologram that could be photographed: its phase \[rad\].
    ///
    /// # Errors
    ///
    /// As [`Self::add_photographed`].
    pub fn add_candidate(&mut self, phase: Plane<f32>) -> Result<(), Error> {
        let curvature = self.curvature(phase, self.candidates.len())?;
        self.candidates.push(curvature);
        Ok(())
    }

    /// The best `count` candidates in their order, after `photographed` holograms have been photographed, of which the
    /// added ones are a sample. Fewer than `count` if there are fewer candidates; none without holograms of both kinds.
    #[must_use]
    pub fn best(&self, photographed: usize, count: usize) -> Vec<Suggestion> {
        let n = self.layout.len();
        let scale = photographed as f64 / self.photographed.len().max(1) as f64;
        let mut known = sum(&self.photographed, scale, n);
        let typical = sum(&self.candidates, 1.0 / self.candidates.len().max(1) as f64, n);
        let Some(mut before) = inverse(&known, n) else { return Vec::new() };
        let start = error(&typical, &before, n, 0..n);
        let (mut left, mut chosen): (Vec<usize>, Vec<Suggestion>) = ((0..self.candidates.len()).collect(), Vec::new());
        while chosen.len() < count {
            let with = |&candidate: &usize| {
                let both: Vec<f64> = known.iter().zip(&self.candidates[candidate]).map(|(a, b)| a + b).collect();
                let after = inverse(&both, n)?;
                Some((candidate, error(&typical, &after, n, 0..n), both, after))
            };
            let best = left.iter().filter_map(with).min_by(|a, b| a.1.total_cmp(&b.1));
            let Some((candidate, remaining, both, after)) = best else { break };
            let part_db = |range: &Range<usize>| {
                decibels(error(&typical, &after, n, range.clone()), error(&typical, &before, n, range.clone()))
            };
            let parts = self.layout.parts().into_iter().map(|(part, range)| (part, part_db(&range)));
            let Some((part, part_db)) = parts.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            chosen.push(Suggestion { candidate, error_db: decibels(remaining, start), part, part_db });
            left.retain(|&other| other != candidate);
            (known, before) = (both, after);
        }
        chosen
    }

    /// Curvature of the loss of a hologram's photograph, as the model predicts the photograph.
    fn curvature(&mut self, phase: Plane<f32>, index: usize) -> Result<Vec<f64>, Error> {
        let light = self.fit.engine.light(&phase)?;
        let rows = (0..light.height_px()).filter_map(|y| Some(&light.row(y)[self.region.columns(y)?]));
        let brightest = rows.flatten().copied().fold(0.0, f32::max);
        let photo = light.map(|light| BRIGHTEST * light / brightest);
        let example = Example::new(&Pair { phase, photo }, &self.fit.engine, self.region)?;
        let stride = (self.region.pixels() / CURVATURE_PX).max(1);
        Ok(self.fit.curvature(&example, index % OFFSETS * stride / OFFSETS, stride).matrix)
    }
}

/// Sum of matrices of `n` rows, times a factor.
fn sum(matrices: &[Vec<f64>], factor: f64, n: usize) -> Vec<f64> {
    let mut sum = vec![0.0; n * n];
    matrices.iter().for_each(|matrix| sum.iter_mut().zip(matrix).for_each(|(sum, value)| *sum += factor * value));
    sum
}

/// Inverse of a curvature. Parameters that no photograph determines are held near their values.
fn inverse(curvature: &[f64], n: usize) -> Option<Vec<f64>> {
    let largest = (0..n).map(|i| curvature[i * n + i]).fold(0.0, f64::max);
    let mut held = curvature.to_vec();
    (0..n).for_each(|i| held[i * n + i] += FLOOR * largest);
    Some(Cholesky::of(held, n)?.inverse())
}

/// tr( M C ) over the parameters of a range.
fn error(typical: &[f64], covariance: &[f64], n: usize, range: Range<usize>) -> f64 {
    let row = |i: usize| i * n + range.start..i * n + range.end;
    range.clone().map(|i| typical[row(i)].iter().zip(&covariance[row(i)]).map(|(m, c)| m * c).sum::<f64>()).sum()
}

fn decibels(after: f64, before: f64) -> f64 {
    10.0 * (after / before).log10()
}
