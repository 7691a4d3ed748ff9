//! Optimization of phases that a display with few grey levels can show.
//!
//! ```text
//! v ← μ v − γ ∂L/∂φ,   φ ← φ + v                 where φ is free
//! φ ← Q(φ)                                       where |Q(φ) − φ| is among the smallest: settled from then on
//! ```
//!
//! Q(φ) is the phase that the display shows for the level nearest to φ. A settled pixel keeps the phase of its level.
//! In each step more pixels settle, those nearest to a level first. The free pixels compensate for the error that this
//! causes, until all pixels are settled. The same method quantizes the weights of neural networks: A. Zhou et al.,
//! "Incremental network quantization", ICLR 2017. γ is proportional to the inverse of the loss's curvature along its
//! first gradient, s·y / y·y (J. Barzilai and J. Borwein, IMA J. Numer. Anal. 8, 141, 1988).
//!
//! The gain over plain rounding has a limit. A region that covers a part ρ of the frame constrains ρ values per pixel's
//! phase. While a part f > ρ of the pixels is free, they can compensate for the whole error of settling one more pixel.
//! When f < ρ, they can compensate for f/ρ of it. The error that remains, relative to plain rounding, is
//! ∫₀^ρ (1 − f/ρ) df = ρ/2. For the middle 80 % of each axis, ρ = 0.64, this is −4.9 dB.

use super::evaluate::{Evaluate, Evaluation, ProblemSize};
use crate::display::Carrier;
use crate::display::phase_response::PhaseResponse;
use crate::error::Result;
use crate::interrupt;
use crate::metrics::Gain;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Momentum μ.
const MOMENTUM: f32 = 0.8;
/// Learning rate γ in units of the inverse curvature.
const RATE: f64 = 2.0;
/// Exponent h of the schedule: after a part τ of the steps a part 1 − (1 − τ)^h of the pixels is settled.
const SETTLING_EXPONENT: f64 = 1.5;
/// Largest change of a phase in the first step \[rad\]. γ follows from the change of the gradient along this step.
const PROBE_RAD: f32 = 0.01;
/// Number of classes of the histogram of distances from the nearest level.
const CLASSES: usize = 4096;
/// Number of values that are summed as one block.
const CHUNK: usize = 1 << 14;

/// Grey levels of a display and the phases that they show.
#[derive(Clone, Debug)]
pub struct Levels {
    response: PhaseResponse,
    carrier: Option<Carrier>,
    /// Table of the difference between the shown phase and the phase \[rad\], at phases spread evenly over 2π.
    phase_change: Vec<f32>,
}

impl Levels {
    /// Number of entries in the table: 16 for each level of a 12-bit display.
    const TABLE_LEN: usize = 1 << 16;

    /// Levels of a display with this response, which adds the carrier to each hologram.
    ///
    /// # Errors
    ///
    /// The errors of `PhaseResponse::phase_rad`; a valid response causes none.
    pub fn new(response: PhaseResponse, carrier: Option<Carrier>) -> Result<Self> {
        let phase_change_at = |i: usize| {
            let phase_rad = (i as f64 + 0.5) / Self::TABLE_LEN as f64 * TAU;
            let level = response.nearest_level(phase_rad);
            // The shown phase is taken modulo 2π so that it lies nearest to the phase that is rounded.
            let shown = response.phase_rad(level)?;
            Ok((shown - ((shown - phase_rad) / TAU).round() * TAU - phase_rad) as f32)
        };
        let phase_change = (0..Self::TABLE_LEN).map(phase_change_at).collect::<Result<_>>()?;
        Ok(Self { response, carrier, phase_change })
    }

    /// Mean distance between the phases of neighbouring levels \[rad\].
    fn spacing_rad(&self) -> f64 {
        TAU / self.response.levels() as f64
    }

    /// Class of a distance from the nearest level.
    fn class(&self, distance_rad: f32) -> usize {
        let of_half = distance_rad.abs() * (2.0 / self.spacing_rad()) as f32;
        ((of_half * CLASSES as f32) as usize).min(CLASSES - 1)
    }

    /// Writes Q of a row's phases to `shown`. The carrier is added before rounding and subtracted afterwards.
    pub(super) fn show_row(&self, y: usize, phase: &[f32], shown: &mut [f32]) {
        const TURN: f32 = std::f32::consts::TAU;
        for (x, (shown, &phase)) in shown.iter_mut().zip(phase).enumerate() {
            let grating = if self.carrier.is_some_and(|carrier| carrier.is_odd(y, x)) { PI as f32 } else { 0.0 };
            let displayed = phase + grating;
            let turns = displayed / TURN;
            // A phase slightly below a multiple of 2π may round up to it in f32.
            let entry = (((turns - turns.floor()) * Self::TABLE_LEN as f32) as usize).min(Self::TABLE_LEN - 1);
            // The table holds the difference between the shown phase and the phase in the middle of each entry.
            let middle = (turns.floor() + (entry as f32 + 0.5) / Self::TABLE_LEN as f32) * TURN;
            *shown = middle + self.phase_change[entry] - grating;
        }
    }
}

/// State of the optimization through levels between two steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rounded {
    /// Phases φ; a settled pixel has the phase of its level.
    pub(super) phase: Vec<f32>,
    /// Velocities v; NaN where φ is settled.
    pub(super) velocity: Vec<f32>,
    /// Number of steps done.
    pub(super) iteration: u32,
    pub(super) gain: f64,
    /// Factor of the gradient in the first step, later γ.
    pub(super) rate: f64,
}

impl Rounded {
    pub(super) fn new(phase: Vec<f32>, gain: f64) -> Self {
        let velocity = vec![0.0; phase.len()];
        Self { phase, velocity, iteration: 0, gain, rate: 0.0 }
    }

    /// Takes the next of `iterations` steps and returns the evaluation of the phase before it. After the last step all
    /// pixels are settled.
    pub(super) fn step(
        &mut self,
        problem: &mut dyn Evaluate,
        levels: &Levels,
        iterations: u32,
        gradient: &mut [f32],
    ) -> Evaluation {
        let evaluation = problem.evaluate(&self.phase, Gain::Given(self.gain), gradient);
        self.gain = evaluation.best_gain;
        self.iteration += 1;
        if self.iteration == 1 {
            self.probe(gradient);
        } else {
            if self.iteration == 2 {
                self.find_rate(gradient);
            }
            self.descend(gradient, levels.spacing_rad() as f32);
        }
        let ProblemSize { height_px, width_px, .. } = problem.size();
        if self.iteration >= iterations {
            self.settle(levels, height_px, width_px, CLASSES);
        } else if self.iteration > 1 {
            let done = f64::from(self.iteration - 1) / f64::from(iterations - 1);
            let settled = (1.0 - (1.0 - done).powf(SETTLING_EXPONENT)) * self.phase.len() as f64;
            let classes = self.classes_below(levels, height_px, width_px, settled as u64);
            self.settle(levels, height_px, width_px, classes);
        }
        evaluation
    }

    /// Takes a small step down the gradient and keeps it in v for [`Self::find_rate`].
    fn probe(&mut self, gradient: &[f32]) {
        let largest = gradient.par_iter().map(|g| g.abs()).reduce(|| 0.0, f32::max);
        let scale = PROBE_RAD / largest.max(f32::MIN_POSITIVE);
        self.rate = f64::from(scale);
        (&mut self.phase, &mut self.velocity, gradient).into_par_iter().for_each(|(phase, v, g)| {
            *v = -scale * g;
            *phase += *v;
        });
    }

    /// Sets γ from the change of the gradient along the first step.
    fn find_rate(&mut self, gradient: &[f32]) {
        let scale = self.rate as f32;
        let sums = self.velocity.par_chunks(CHUNK).zip(gradient.par_chunks(CHUNK)).map(|(v, gradient)| {
            v.iter().zip(gradient).fold([0.0_f64; 2], |[sy, yy], (&v, &g)| {
                // The gradient before the step was −v / scale.
                let y = f64::from(g + v / scale);
                [sy + f64::from(v) * y, yy + y * y]
            })
        });
        let [sy, yy] = sums.collect::<Vec<_>>().iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        // Without positive curvature no rate can be found, so the gradient is ignored and the phases are only rounded.
        self.rate = if sy > 0.0 { RATE * sy / yy } else { 0.0 };
        self.velocity.fill(0.0);
    }

    fn descend(&mut self, gradient: &[f32], change_max: f32) {
        let rate = self.rate as f32;
        (&mut self.phase, &mut self.velocity, gradient).into_par_iter().for_each(|(phase, v, g)| {
            if !v.is_nan() {
                *v = (MOMENTUM * *v - rate * g).clamp(-change_max, change_max);
                *phase += *v;
            }
        });
    }

    /// Number of classes of distances, nearest first, whose pixels must settle so that `settled` pixels are settled.
    fn classes_below(&self, levels: &Levels, height_px: usize, width_px: usize, settled: u64) -> usize {
        let rows = (self.phase.par_chunks(width_px), self.velocity.par_chunks(width_px)).into_par_iter().enumerate();
        // Sums of integers do not depend on the order of threads.
        let counts = rows
            .fold(
                || (vec![0_u64; CLASSES + 1], vec![0.0; width_px]),
                |(mut counts, mut shown), (i, (phase, velocity))| {
                    interrupt::check();
                    levels.show_row(i % height_px, phase, &mut shown);
                    for ((&phase, &shown), v) in phase.iter().zip(&shown).zip(velocity) {
                        let class = if v.is_nan() { CLASSES } else { levels.class(shown - phase) };
                        counts[class] += 1;
                    }
                    (counts, shown)
                },
            )
            .map(|(counts, _)| counts)
            .reduce(
                || vec![0; CLASSES + 1],
                |mut a, b| {
                    a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
                    a
                },
            );
        let mut sum = counts[CLASSES];
        let enough = counts[..CLASSES].iter().position(|count| {
            let enough = sum >= settled;
            sum += count;
            enough
        });
        enough.unwrap_or(CLASSES)
    }

    /// Settles all pixels in the nearest `classes`: they take the phase of their level and do not change again.
    fn settle(&mut self, levels: &Levels, height_px: usize, width_px: usize, classes: usize) {
        let rows = (self.phase.par_chunks_mut(width_px), self.velocity.par_chunks_mut(width_px));
        rows.into_par_iter().enumerate().for_each_init(
            || vec![0.0; width_px],
            |shown, (i, (phase, velocity))| {
                interrupt::check();
                levels.show_row(i % height_px, phase, shown);
                for ((phase, &mut shown), v) in phase.iter_mut().zip(shown).zip(velocity) {
                    if !v.is_nan() && levels.class(shown - *phase) < classes {
                        (*phase, *v) = (shown, f32::NAN);
                    }
                }
            },
        );
    }
}
