//! A reconstruction together with its target.

use crate::error::{Error, Result};
use crate::interrupt;
use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Gain that a reconstruction is multiplied by before the comparison.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gain {
    /// The gain with the smallest mean squared error.
    #[default]
    Fitted,
    /// A given gain.
    Given(f64),
}

/// Samples of a reconstruction in a region of interest, after a gain, together with the target's values.
#[derive(Clone, Debug)]
pub(crate) struct ImagePair<'a> {
    light: &'a Plane<f32>,
    target: &'a Plane<f32>,
    /// Rows of the region; these and `columns` count the target's pixels.
    rows: Range<usize>,
    columns: Range<usize>,
    /// Sub-samples along each side of a target's pixel.
    samples_per_px: usize,
    gain: f64,
    /// The target's pixels that count in sums, in its size; `None`: all of them.
    counting: Option<&'a Plane<bool>>,
}

impl<'a> ImagePair<'a> {
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] when `light` is not a whole multiple of the target's size, the same along both axes;
    /// [`Error::OutOfRange`] when the region leaves the target.
    pub(crate) fn new(
        light: &'a Plane<f32>,
        target: &'a Plane<f32>,
        roi: RegionOfInterest,
        gain: Gain,
    ) -> Result<Self> {
        let samples_per_px = (light.height_px() / target.height_px().max(1)).max(1);
        let (height_px, width_px) = (samples_per_px * target.height_px(), samples_per_px * target.width_px());
        light.expect_size("reconstruction", height_px, width_px)?;
        for (name, end, side) in [
            ("region_of_interest's bottom", roi.y_px() + roi.height_px(), target.height_px()),
            ("region_of_interest's right side", roi.x_px() + roi.width_px(), target.width_px()),
        ] {
            if end > side {
                return Err(Error::OutOfRange { name, value: end as f64, allowed: "inside the image" });
            }
        }
        let rows = roi.y_px()..roi.y_px() + roi.height_px();
        let columns = roi.x_px()..roi.x_px() + roi.width_px();
        let pair = Self { light, target, rows, columns, samples_per_px, gain: 1.0, counting: None };
        let gain = match gain {
            Gain::Fitted => pair.best_gain(),
            Gain::Given(gain) => gain,
        };
        Ok(Self { gain, ..pair })
    }

    /// The same pair with only some of the target's pixels in its sums, at the gain that is best for them.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] when `counting` is not of the target's size.
    pub(crate) fn only(self, counting: &'a Plane<bool>) -> Result<Self> {
        counting.expect_size("counting pixels", self.target.height_px(), self.target.width_px())?;
        let pair = Self { counting: Some(counting), gain: 1.0, ..self };
        Ok(Self { gain: pair.best_gain(), ..pair })
    }

    /// Compares two whole planes of the same size with gain 1.
    pub(super) fn whole(light: &'a Plane<f32>, target: &'a Plane<f32>) -> Self {
        let (rows, columns) = (0..target.height_px(), 0..target.width_px());
        Self { light, target, rows, columns, samples_per_px: 1, gain: 1.0, counting: None }
    }

    /// Number of rows of samples.
    pub(super) fn height(&self) -> usize {
        self.samples_per_px * self.rows.len()
    }

    /// Number of samples in a row.
    pub(super) fn width(&self) -> usize {
        self.samples_per_px * self.columns.len()
    }

    /// Gain that the light is multiplied by.
    pub(crate) fn gain(&self) -> f64 {
        self.gain
    }

    /// Row `y` of the samples: the light before the gain, and the row of the target's pixels that its samples lie in.
    pub(super) fn row(&self, y: usize) -> (&'a [f32], &'a [f32]) {
        let k = self.samples_per_px;
        let light = &self.light.row(k * self.rows.start + y)[k * self.columns.start..][..self.width()];
        let target = &self.target.row(self.rows.start + y / k)[self.columns.start..][..self.columns.len()];
        (light, target)
    }

    /// Writes row `y` of the samples: the light after the gain, and the target.
    #[inline(always)]
    pub(super) fn read_row(&self, y: usize, light: &mut [f64], target: &mut [f64]) {
        let (p, t) = self.row(y);
        for (light, &p) in light.iter_mut().zip(p) {
            *light = self.gain * f64::from(p);
        }
        for (target, &t) in target.chunks_exact_mut(self.samples_per_px).zip(t) {
            target.fill(f64::from(t));
        }
    }

    /// Σ `term`(light after the gain, target) over the samples that count.
    pub(super) fn sum(&self, term: impl Fn(f64, f64) -> f64 + Sync) -> f64 {
        let rows = (0..self.height()).into_par_iter().map(|y| {
            interrupt::check();
            let (p, t) = self.row(y);
            let counting = self.counting.map(|counting| {
                &counting.row(self.rows.start + y / self.samples_per_px)[self.columns.start..][..self.columns.len()]
            });
            let pixels = p.chunks_exact(self.samples_per_px).zip(t).enumerate();
            let pixels = pixels.filter(|(x, _)| counting.is_none_or(|counting| counting[*x]));
            let samples = pixels.flat_map(|(_, (p, t))| p.iter().map(move |p| (p, t)));
            samples.map(|(&p, &t)| term(self.gain * f64::from(p), f64::from(t))).sum::<f64>()
        });
        rows.collect::<Vec<_>>().iter().sum()
    }

    /// Mean of (light − target)² over the samples that count.
    pub(crate) fn mse(&self) -> f64 {
        let samples = match self.counting {
            None => (self.height() * self.width()) as f64,
            Some(_) => self.sum(|_, _| 1.0),
        };
        self.sum(|p, t| (p - t).powi(2)) / samples
    }

    /// Gain that brings the light closest to the target; 0 without light.
    pub(super) fn best_gain(&self) -> f64 {
        let energy = self.sum(|p, _| p * p);
        if energy == 0.0 { 0.0 } else { self.sum(|p, t| p * t) / energy }
    }
}
