//! What a fit has reached, and all that its next step depends on.

use crate::display::parts::blocks::Blocks;
use crate::learning::course::Course;
use crate::learning::dust::DustFit;
use crate::numerics::Plane;
use crate::numerics::optimizer::damped::DampedState;
use serde::{Deserialize, Serialize};

/// State of the fit of a parametric model: all that the next step depends on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ParametricState {
    /// Where the fit stands in its course.
    pub(super) course: Course,
    /// The model that is being fitted.
    pub(super) fitted: Fitted,
    /// Numbers of the models of the course, and their θ.
    pub(super) models: Vec<(usize, Vec<f64>)>,
    /// Indices of the training pairs that are not left out.
    pub(super) kept: Vec<u32>,
    /// Mean training loss of each epoch, then of each refinement step.
    pub(super) loss_history: Vec<f64>,
}

impl ParametricState {
    /// Indices of the training pairs that are not left out.
    pub(in crate::learning) fn kept_pairs(&self) -> impl Iterator<Item = usize> {
        self.kept.iter().map(|&index| index as usize)
    }

    /// Mean training loss of each epoch, then of each refinement step.
    pub(in crate::learning) fn loss_history(&self) -> &[f64] {
        &self.loss_history
    }
}

/// The model that is being fitted, and what the methods that fit it remember.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Fitted {
    /// Order of the kernel.
    pub(super) order: usize,
    /// Blocks of the model, beside dust.
    pub(super) blocks: Blocks,
    /// θ, in the order of the internal layout; where the refinement in progress began.
    pub(super) parameters: Vec<f64>,
    /// Gain and offset that fit all photographs best, fitted at the start and at the end.
    pub(super) exposure: (f64, f64),
    /// A and B of the display's [dust](crate::Dust).
    pub(super) dust: Option<Plane<[i16; 2]>>,
    /// Adam's progress.
    pub(super) adam: AdamProgress,
    /// Levenberg and Marquardt's method, if it has begun.
    pub(super) refinement: Option<DampedState>,
    /// Its curvature.
    pub(super) curvature: MeanCurvature,
    /// Fit of the dust in progress.
    pub(super) dust_fit: Option<DustFit>,
}

impl Fitted {
    /// θ as it is now.
    pub(super) fn theta(&self) -> &Vec<f64> {
        self.refinement.as_ref().map_or(&self.parameters, |refinement| &refinement.parameters)
    }
}

/// Progress of Adam.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct AdamProgress {
    /// First moments.
    pub(super) first_moment: Vec<f64>,
    /// Second moments.
    pub(super) second_moment: Vec<f64>,
    /// Steps so far.
    pub(super) steps: u32,
    /// Sum of the losses of the current epoch.
    pub(super) epoch_loss: f64,
}

/// A curvature that several steps share.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct MeanCurvature {
    /// Running mean, row after row; empty when the curvature is computed from all pairs.
    pub(super) matrix: Vec<f64>,
    /// Number of steps that have used it.
    pub(super) steps: u32,
}
