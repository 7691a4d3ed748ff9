//! Refinement of a map by the correlation of details.
//!
//! ```text
//! T(p) ≈ α + β [ W(m(p)) + ∇W · Σ_i ∂m/∂θ_i δ_i ]
//! ```
//!
//! T and W are the details of target and photograph, m the map with its parameters θ. A linear fit gives α, β and the
//! step δ. It raises the normalized correlation of T and W, whatever gain and offset the photograph has (G.
//! Evangelidis, E. Psarakis, IEEE TPAMI 30, 1858 (2008)). Steps are damped as K. Levenberg (1944) and D. Marquardt
//! (1963) proposed.
//!
//! A target may have no details where the perspective and the distortion show most. So the refinement minimizes
//!
//! ```text
//! ln(1 − c²) + (C / n) Σ_i (θ_i / σ_i)²
//! ```
//!
//! c is the correlation, n the number of values, of which C neighbours count as one because speckle covers several. σ_i
//! is the usual size of a parameter of the perspective or the distortion.

use super::pyramid::{DETAILS_REACH, Details};
use crate::alignment::camera_map::{CameraMap, PARAMETERS};
use lightpath_optics::interrupt;
use lightpath_optics::numerics::least_squares::NormalEquations;
use rayon::prelude::*;

/// Unknowns of a step: the parameters, the photograph's gain and its offset.
const UNKNOWNS: usize = PARAMETERS + 2;
/// Rows that are summed one after the other.
const BAND: usize = 8;
/// Part of a side of the target, at each end, that is not compared: there the surroundings change the photograph's
/// details. It is as wide as the blur reaches, but at most a tenth of the side.
const RIM_MAX: f64 = 0.1;
/// Least part of the target that must lie inside the photograph.
const INSIDE_MIN: f64 = 0.5;
const STEPS_MAX: usize = 12;
/// A smaller fall of the cost ends the refinement.
const FALL_MIN: f64 = 1e-5;
/// C: values that count as one.
const ALIKE: f64 = 10.0;
/// σ: usual sizes of the perspective, the radial and the decentring distortion; the affine parameters are free.
const USUAL: [f64; PARAMETERS] = {
    let free = f64::INFINITY;
    [free, free, free, free, free, free, 0.05, 0.05, 0.05, 0.05, 0.01, 0.01]
};

/// Parameters that may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Freedom {
    Affine,
    Perspective,
    Distorted,
}

impl Freedom {
    fn parameters(self) -> usize {
        match self {
            Self::Affine => 6,
            Self::Perspective => 8,
            Self::Distorted => PARAMETERS,
        }
    }
}

/// A map and the correlation of the details under it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fit {
    pub(super) map: CameraMap,
    pub(super) correlation: f64,
}

/// Raises the correlation of target and photograph from a start near its peak.
pub(super) fn refined(target: &Details, photo: &Details, start: &CameraMap, freedom: Freedom) -> Fit {
    let mut best = Comparison::of(target, photo, start, freedom);
    let (mut map, mut damping) = (*start, 1e-3);
    for _ in 0..STEPS_MAX {
        let Some(step) = best.step(&map, damping) else { break };
        let moved = map.moved(&step);
        let next = Comparison::of(target, photo, &moved, freedom);
        let fall = best.cost(&map) - next.cost(&moved);
        if fall > 0.0 {
            (map, best, damping) = (moved, next, damping / 10.0);
        } else {
            damping *= 100.0;
        }
        if fall.abs() < FALL_MIN || damping > 1e6 {
            break;
        }
    }
    Fit { map, correlation: best.correlation() }
}

/// Sums over all values of the target's details that lie inside the photograph.
#[derive(Clone)]
struct Comparison {
    equations: NormalEquations<UNKNOWNS>,
    /// Number of values, and how many of them lie inside the photograph.
    all: f64,
    inside: f64,
    sums: [f64; 2],
    squares: [f64; 2],
    product: f64,
}

impl Comparison {
    fn empty() -> Self {
        let equations = NormalEquations::none();
        Self { equations, all: 0.0, inside: 0.0, sums: [0.0; 2], squares: [0.0; 2], product: 0.0 }
    }

    fn of(target: &Details, photo: &Details, map: &CameraMap, freedom: Freedom) -> Self {
        let (height, width) = (target.values.height_px(), target.values.width_px());
        let rim = |side: usize| (DETAILS_REACH.min((side as f64 * RIM_MAX) as usize), side);
        let ((top, bottom), (left, right)) = (rim(height), rim(width));
        let (rows, columns) = (top..bottom - top, left..right - left);
        let bands: Vec<Self> = (0..rows.len().div_ceil(BAND))
            .into_par_iter()
            .map(|band| {
                interrupt::check();
                let mut sums = Self::empty();
                let start = rows.start + band * BAND;
                for y in start..(start + BAND).min(rows.end) {
                    for x in columns.clone() {
                        sums.add(target, photo, map, freedom, (y, x));
                    }
                }
                sums
            })
            .collect();
        bands.iter().fold(Self::empty(), Self::plus)
    }

    fn add(&mut self, target: &Details, photo: &Details, map: &CameraMap, freedom: Freedom, (y, x): (usize, usize)) {
        self.all += 1.0;
        let (place, derivatives) = map.derivatives(target.point(y, x));
        let Some(sample) = photo.sample(place) else { return };
        let (t, w) = (f64::from(target.values.at(y, x)), f64::from(sample.value));
        let mut row = [0.0; UNKNOWNS];
        for (i, value) in row.iter_mut().enumerate().take(freedom.parameters()) {
            *value = f64::from(sample.slope[0]) * derivatives[0][i] + f64::from(sample.slope[1]) * derivatives[1][i];
        }
        row[PARAMETERS] = w;
        row[PARAMETERS + 1] = 1.0;
        self.equations.add(&row, t, 1.0);
        self.inside += 1.0;
        self.sums = [self.sums[0] + t, self.sums[1] + w];
        self.squares = [self.squares[0] + t * t, self.squares[1] + w * w];
        self.product += t * w;
    }

    fn plus(mut self, other: &Self) -> Self {
        self.equations.add_all(&other.equations);
        self.all += other.all;
        self.inside += other.inside;
        for i in [0, 1] {
            self.sums[i] += other.sums[i];
            self.squares[i] += other.squares[i];
        }
        self.product += other.product;
        self
    }

    /// The normalized correlation; −1 if too little of the target lies inside the photograph or has details.
    fn correlation(&self) -> f64 {
        let variance = |i: usize| self.squares[i] - self.sums[i] * self.sums[i] / self.inside;
        let both = variance(0) * variance(1);
        if self.inside < INSIDE_MIN * self.all || both.is_nan() || both <= 0.0 {
            return -1.0;
        }
        (self.product - self.sums[0] * self.sums[1] / self.inside) / both.sqrt()
    }

    /// What the refinement minimizes. A map with too little of the target in the photograph costs most.
    fn cost(&self, map: &CameraMap) -> f64 {
        let correlation = self.correlation();
        if correlation <= 0.0 {
            return f64::MAX;
        }
        let unusual: f64 = map.parameters().iter().zip(USUAL).map(|(value, usual)| (value / usual).powi(2)).sum();
        (1.0 - correlation * correlation).max(1e-12).ln() + ALIKE / self.inside * unusual
    }

    /// The change of the parameters. `None` if they are not determined.
    fn step(&self, map: &CameraMap, damping: f64) -> Option<[f64; PARAMETERS]> {
        let mut equations = self.equations.clone();
        let variance = |i: usize| self.squares[i] - self.sums[i] * self.sums[i] / self.inside;
        let gain = (self.product - self.sums[0] * self.sums[1] / self.inside) / variance(1);
        let error = variance(0) / self.inside * (1.0 - self.correlation().powi(2));
        for (i, (value, usual)) in map.parameters().iter().zip(USUAL).enumerate() {
            let mut row = [0.0; UNKNOWNS];
            row[i] = 1.0;
            let weight = ALIKE * error / (gain * usual).powi(2);
            if weight.is_finite() && weight > 0.0 && self.equations.contains(i) {
                equations.add(&row, -gain * value, weight);
            }
        }
        let solution = equations.damped(PARAMETERS, damping).solve()?;
        let gain = solution[PARAMETERS];
        (gain > 0.0).then(|| std::array::from_fn(|i| solution[i] / gain))
    }
}
