//! Gerchberg–Saxton with a phase-only modulator, and its weighted variant.
//!
//! ```text
//! u = A c,   c′ = c − Aᴴ[ w ( 1 − W√t / (s√p) ) u ],   φ ← phase that shows arg c′
//! weighted:  W ← W · √t / (s√p)
//! ```
//!
//! c the field on the SLM, A the propagation, p the detector's light, t the target, s the gain that fits the amplitudes best,
//! w the weights, W 1 at first. In the picture the amplitude becomes the target's and the phase stays; outside, where w = 0,
//! the light stays as it is. For a unitary A this is the round trip of R. Gerchberg and W. Saxton, Optik 35, 237 (1972);
//! written as a difference it also serves a cropped A, several sub-samples, planes and frames, whose corrections are
//! averaged. The weights raise the target where light is missing: R. Di Leonardo, F. Ianni and G. Ruocco, Optics Express
//! 15, 1913 (2007).

use super::problem::ProblemCore;
use crate::{Evaluation, Plane};
use num_complex::Complex32;
use rayon::prelude::*;

/// One round: `phase` becomes the next one, and `wanted`, W√t of each plane, its weights where the rounds are `weighted`. The
/// evaluation is that of the phase before it. `field` holds nothing from round to round.
pub(super) fn round(
    problem: &mut ProblemCore<f32>,
    weighted: bool,
    wanted: &mut [Plane<f32>],
    phase: &mut [f32],
    field: &mut Vec<Complex32>,
) -> Evaluation {
    field.resize(problem.parameters(), Complex32::ZERO);
    let evaluation = problem.excess(phase, wanted, weighted, field);
    let engine = problem.engine();
    let (height_px, width_px) = (engine.height_px(), engine.width_px());
    phase.par_chunks_mut(width_px).zip(field.par_chunks(width_px)).enumerate().for_each_init(
        || engine.convolver.scratch.take(),
        |scratch, (i, (phase, excess))| {
            let (y, field) = (i % height_px, &mut scratch.row[..width_px]);
            engine.slm.field_row(y, phase, field);
            field.iter_mut().zip(excess).for_each(|(c, &excess)| *c -= excess);
            engine.slm.phase_of_row(y, field, phase);
        },
    );
    evaluation
}
