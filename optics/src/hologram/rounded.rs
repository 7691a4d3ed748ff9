//! Optimizing through the grey levels of a display.
//!
//! ```text
//! v ← μ v − γ ∂L/∂φ,   φ ← φ + v                 where φ is free
//! φ ← Q(φ)                                       where |Q(φ) − φ| is among the smallest: settled from then on
//! ```
//!
//! Q the phase that the display shows for the nearest of its levels. From step to step a larger part of the pixels is settled,
//! those first that are near a level anyway; the others make up for what that costs, until none is left. Network weights are
//! quantized likewise: A. Zhou et al., "Incremental network quantization", ICLR 2017. γ is the inverse of the loss's curvature
//! along its first gradient, γ = s·y / y·y (J. Barzilai and J. Borwein, IMA J. Numer. Anal. 8, 141, 1988).
//!
//! There is a bound to what that wins. A region of ρ of the frame asks ρ values of every pixel's phase. While more than ρ of the
//! pixels are free they can take back all that settling another one costs, with f < ρ of them free only f/ρ of it; what stays of
//! the error of plain rounding is ∫₀^ρ (1 − f/ρ) df = ρ/2. For the middle 80 % of each axis, ρ = 0.64, that is −4.9 dB.

use super::problem::ProblemCore;
use crate::phase_response::PhaseResponse;
use crate::{Carrier, Evaluation, Result};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// μ
const MOMENTUM: f32 = 0.8;
/// γ in units of the inverse curvature.
const RATE: f64 = 2.0;
/// The part that is settled after a part τ of the steps is 1 − (1 − τ)^this.
const HASTE: f64 = 1.5;
/// Largest change of a phase in the first step, from which γ is found \[rad\].
const PROBE_RAD: f32 = 0.01;
/// Classes in which distances from levels are counted.
const CLASSES: usize = 4096;
/// Values whose sums are taken together.
const CHUNK: usize = 1 << 14;

/// A display's levels.
#[derive(Clone, Debug)]
pub struct Levels {
    response: PhaseResponse,
    carrier: Option<Carrier>,
    /// φ_shown at phases spread evenly over a turn.
    shown: Vec<f32>,
}

impl Levels {
    /// Places in the table: a sixteenth of the finest level.
    const PLACES: usize = 1 << 16;

    /// Of a display with this response, on which the carrier is added to each hologram.
    ///
    /// # Errors
    ///
    /// None for a response that [`PhaseResponse`] made.
    pub fn new(response: PhaseResponse, carrier: Option<Carrier>) -> Result<Self> {
        let of_place = |i: usize| {
            let phase_rad = (i as f64 + 0.5) / Self::PLACES as f64 * TAU;
            let level = response.nearest_level(phase_rad);
            // Next to the phase that asks for it, so that rounding moves a phase no farther than it must.
            let shown = response.phase_rad(level)?;
            Ok((shown - ((shown - phase_rad) / TAU).round() * TAU - phase_rad) as f32)
        };
        let shown = (0..Self::PLACES).map(of_place).collect::<Result<_>>()?;
        Ok(Self { response, carrier, shown })
    }

    /// Mean distance of neighbouring levels \[rad\].
    fn spacing_rad(&self) -> f64 {
        TAU / self.response.levels() as f64
    }

    /// Which class a distance from the nearest level belongs to.
    fn class(&self, distance_rad: f32) -> usize {
        let of_half = distance_rad.abs() * (2.0 / self.spacing_rad()) as f32;
        ((of_half * CLASSES as f32) as usize).min(CLASSES - 1)
    }

    /// Q of a row, the carrier added before and taken away after.
    pub(super) fn show_row(&self, y: usize, phase: &[f32], shown: &mut [f32]) {
        const TURN: f32 = std::f32::consts::TAU;
        for (x, (shown, &phase)) in shown.iter_mut().zip(phase).enumerate() {
            let grating = if self.carrier.is_some_and(|carrier| carrier.is_odd(y, x)) { PI as f32 } else { 0.0 };
            let displayed = phase + grating;
            let turns = displayed / TURN;
            // A hair below a whole turn rounds up to one.
            let place = (((turns - turns.floor()) * Self::PLACES as f32) as usize).min(Self::PLACES - 1);
            // To the middle of the place, and from there to the level.
            let middle = (turns.floor() + (place as f32 + 0.5) / Self::PLACES as f32) * TURN;
            *shown = middle + self.shown[place] - grating;
        }
    }
}

/// Everything that a step depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Rounded {
    /// φ: a level's where it is settled.
    pub(super) phase: Vec<f32>,
    /// v; NaN where φ is settled.
    pub(super) velocity: Vec<f32>,
    /// Steps done.
    pub(super) iteration: u32,
    pub(super) gain: f64,
    /// What the first step divided its gradient by, then γ.
    pub(super) rate: f64,
}

impl Rounded {
    pub(super) fn new(phase: Vec<f32>, gain: f64) -> Self {
        let velocity = vec![0.0; phase.len()];
        Self { phase, velocity, iteration: 0, gain, rate: 0.0 }
    }

    /// The next of `iterations` steps, after the last of which everything is settled. The evaluation is that of the phase
    /// before it.
    pub(super) fn step(
        &mut self,
        problem: &mut ProblemCore<f32>,
        levels: &Levels,
        iterations: u32,
        gradient: &mut [f32],
    ) -> Evaluation {
        let evaluation = problem.evaluate(&self.phase, self.gain, gradient);
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
        let (height_px, width_px) = (problem.engine().height_px(), problem.engine().width_px());
        if self.iteration >= iterations {
            self.settle(levels, height_px, width_px, CLASSES);
        } else if self.iteration > 1 {
            let done = f64::from(self.iteration - 1) / f64::from(iterations - 1);
            let wanted = (1.0 - (1.0 - done).powf(HASTE)) * self.phase.len() as f64;
            let classes = self.classes_below(levels, height_px, width_px, wanted as u64);
            self.settle(levels, height_px, width_px, classes);
        }
        evaluation
    }

    /// A small step down the gradient, kept in v for [`Self::find_rate`].
    fn probe(&mut self, gradient: &[f32]) {
        let largest = gradient.par_iter().map(|g| g.abs()).reduce(|| 0.0, f32::max);
        let scale = PROBE_RAD / largest.max(f32::MIN_POSITIVE);
        self.rate = f64::from(scale);
        (&mut self.phase, &mut self.velocity, gradient).into_par_iter().for_each(|(phase, v, g)| {
            *v = -scale * g;
            *phase += *v;
        });
    }

    /// γ from the change of the gradient along the first step.
    fn find_rate(&mut self, gradient: &[f32]) {
        let scale = self.rate as f32;
        let sums = self.velocity.par_chunks(CHUNK).zip(gradient.par_chunks(CHUNK)).map(|(v, gradient)| {
            v.iter().zip(gradient).fold([0.0_f64; 2], |[sy, yy], (&v, &g)| {
                // The gradient before was −v / scale.
                let y = f64::from(g + v / scale);
                [sy + f64::from(v) * y, yy + y * y]
            })
        });
        let [sy, yy] = sums.collect::<Vec<_>>().iter().fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        // A loss that curves the other way has no scale to offer: what is left is rounding.
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

    /// How many of the classes of distances, nearest first, hold `wanted` pixels together with those that are settled.
    fn classes_below(&self, levels: &Levels, height_px: usize, width_px: usize, wanted: u64) -> usize {
        let rows = (self.phase.par_chunks(width_px), self.velocity.par_chunks(width_px)).into_par_iter().enumerate();
        // Whole numbers add up to the same in any order.
        let counts = rows
            .fold(
                || (vec![0_u64; CLASSES + 1], vec![0.0; width_px]),
                |(mut counts, mut shown), (i, (phase, velocity))| {
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
            let enough = sum >= wanted;
            sum += count;
            enough
        });
        enough.unwrap_or(CLASSES)
    }

    /// Brings the pixels of the nearest `classes` to their levels for good.
    fn settle(&mut self, levels: &Levels, height_px: usize, width_px: usize, classes: usize) {
        let rows = (self.phase.par_chunks_mut(width_px), self.velocity.par_chunks_mut(width_px));
        rows.into_par_iter().enumerate().for_each_init(
            || vec![0.0; width_px],
            |shown, (i, (phase, velocity))| {
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
