//! Gerchberg–Saxton for a phase-only modulator, and its weighted variant.
//!
//! ```text
//! u = A c,   c′ = c − Aᴴ[ w ( 1 − W√t / (s√p) ) u ],   φ ← phase that shows arg c′
//! weighted:  W ← W · √t / (s√p)
//! ```
//!
//! c is the field on the SLM, A the propagation, p the detector's light, t the target, s the gain that fits the
//! amplitudes best, w the weights, and W starts at 1. In the picture the target's amplitude replaces the light's
//! amplitude, and the phase stays. Outside the picture, where w = 0, the light stays as it is. For a unitary A this is
//! the round trip of R. Gerchberg and W. Saxton, Optik 35, 237 (1972). Written as a difference, it also serves a
//! cropped A and several sub-samples, planes and frames, whose corrections are averaged. The factors W raise the target
//! where light is missing: R. Di Leonardo, F. Ianni and G. Ruocco, Optics Express 15, 1913 (2007). With cross-talk, φ
//! changes by the difference between the phase that shows arg c′ and the shown phase.

use super::evaluate::Evaluation;
use super::processor::ProcessorProblem;
use crate::engine::slm::Slm;
use crate::interrupt;
use crate::numerics::Plane;
use num_complex::Complex32;
use rayon::prelude::*;

/// Runs one round and returns the evaluation of the phase before it. `phase` is replaced by the next phase. `wanted`
/// holds W√t of each plane; W is updated only if `weighted` is true.
pub(super) fn round(
    problem: &mut ProcessorProblem<f32>,
    weighted: bool,
    wanted: &mut [Plane<f32>],
    phase: &mut [f32],
) -> Evaluation {
    let mut field = std::mem::take(&mut problem.field);
    field.resize(problem.parameters(), Complex32::ZERO);
    let evaluation = problem.excess(phase, wanted, weighted, &mut field);
    let engine = problem.engine();
    subtract(&engine.slm, problem.frame_len(), || engine.convolver.scratch.take(), &field, phase);
    problem.field = field;
    evaluation
}

/// Replaces the phases of all frames by those that show the phase of the modulator's field without the `excess`: the end
/// of a round of Gerchberg–Saxton, for a [`Backend`](super::Backend) that computes the excess itself.
///
/// # Panics
///
/// If the excess and the phases do not have the same length, a multiple of `frame_len`.
pub fn subtract_excess(slm: &Slm<f32>, frame_len: usize, excess: &[Complex32], phase: &mut [f32]) {
    assert!(excess.len() == phase.len() && phase.len().is_multiple_of(frame_len), "an excess for each phase");
    subtract(slm, frame_len, || vec![Complex32::ZERO; slm.width_px], excess, phase);
}

/// [`subtract_excess`] with `room`, which gives room for at least a row of the field.
pub(super) fn subtract<R: AsMut<[Complex32]>>(
    slm: &Slm<f32>,
    frame_len: usize,
    room: impl Fn() -> R + Sync + Send,
    excess: &[Complex32],
    phase: &mut [f32],
) {
    let width_px = slm.width_px;
    for (phase, excess) in phase.chunks_exact_mut(frame_len).zip(excess.chunks_exact(frame_len)) {
        let shown = slm.wraps().then(|| slm.shown(phase).into_owned());
        phase.par_chunks_mut(width_px).zip(excess.par_chunks(width_px)).enumerate().for_each_init(
            &room,
            |room, (y, (phase, excess))| {
                interrupt::check();
                let field = &mut room.as_mut()[..width_px];
                let shown = shown.as_ref().map(|shown| shown.row(y));
                if let Some(row) = shown.or_else(|| slm.displayed_row(phase)) {
                    slm.field_row(y, row, field);
                }
                field.iter_mut().zip(excess).for_each(|(c, &excess)| *c -= excess);
                match shown.filter(|_| slm.crosstalk.is_some()) {
                    Some(shown) => slm.approach_phase_of_row(y, shown, field, phase),
                    None => slm.phase_of_row(y, field, phase),
                }
            },
        );
    }
}
