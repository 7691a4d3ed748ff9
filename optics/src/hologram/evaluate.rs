//! The border between the methods that find a hologram and the machines that compute for them.
//!
//! A method sees a loss and its gradient ([`Evaluate`]) or a projection ([`Project`]), never a transform. What computes
//! them (threads of the processor, the slow [`PlainProblem`](super::PlainProblem), a graphics card) knows planes,
//! frames, detectors and displays, and no method. All of them pass the tests in `conformance.rs`.
//!
//! Phases and gradients are plain vectors of the caller: the rows of one frame after the other.

use super::adam::AdamState;
use crate::engine::photometry::Sums;
use crate::engine::slm::Slm;
use crate::metrics::Gain;
use crate::numerics::Plane;
use num_complex::Complex32;
use std::fmt;

/// Numbers of planes, frames and pixels of a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProblemSize {
    /// Number of target pictures.
    pub planes: usize,
    /// Number of frames.
    pub frames: usize,
    /// Number of rows \[px\].
    pub height_px: usize,
    /// Number of columns \[px\].
    pub width_px: usize,
}

impl ProblemSize {
    /// Number of pixels of a frame.
    #[must_use]
    pub fn frame_len(self) -> usize {
        self.height_px * self.width_px
    }

    /// Number of values in a phase or a gradient, `frames · height_px · width_px`.
    #[must_use]
    pub fn parameters(self) -> usize {
        self.frames * self.frame_len()
    }
}

/// Loss and best gain of a phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Evaluation {
    /// The [loss](super::Loss) at the gain s that the caller gave, or at the best gain if none was given.
    pub loss: f64,
    /// Gain that fits best. Methods whose gain lags by one step use it in their next evaluation.
    pub best_gain: f64,
    /// The loss at [`Self::best_gain`].
    pub best_loss: f64,
}

impl Evaluation {
    pub(crate) fn new(sums: &Sums, roughness: f64) -> Self {
        let (loss, best_loss) = (sums.loss() + roughness, sums.best_loss() + roughness);
        Self { loss, best_gain: sums.best_gain(), best_loss }
    }
}

/// A problem that computes the loss of its phases.
///
/// Every call depends on its arguments only, never on earlier calls, and gives the same bits on any number of threads.
pub trait Evaluate: fmt::Debug + Send {
    /// Sizes of the problem.
    fn size(&self) -> ProblemSize;

    /// Evaluates the loss at a gain and writes its gradient ∂L/∂φ to `gradient`, whatever that held before.
    ///
    /// With [`Gain::Fitted`] these are the minimum over s of the [loss](super::Loss) and its gradient. At the gain that
    /// fits best both gradients are equal, because the derivative of the loss by the gain is 0 there.
    fn evaluate(&mut self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Evaluation;

    /// Evaluates the loss at `gain` without its gradient, which saves the propagation back.
    fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation;

    /// Computes the light of the first image plane, the mean over the frames: for each row of pixels the rows of the
    /// detector's light planes, one after the other.
    fn light(&mut self, phase: &[f32]) -> Vec<f32>;

    /// Takes steps of Adam, and calls `each` with the evaluation before each of them. `gradient` is scratch.
    ///
    /// By default these are evaluations with a step after each. A card keeps phases and moments in its own memory until
    /// the last step. The steps are the same in whatever number of calls they are taken.
    fn adam_steps(
        &mut self,
        state: &mut AdamState,
        learning_rate: f64,
        steps: u32,
        gradient: &mut [f32],
        each: &mut dyn FnMut(Evaluation),
    ) {
        for _ in 0..steps {
            let evaluation = self.evaluate(&state.phase, Gain::Given(state.gain), gradient);
            state.step(evaluation.best_gain, learning_rate, self.size().width_px, gradient);
            each(evaluation);
        }
    }

    /// The light of the latest evaluation in the form of [`Self::light`]; `None` if the evaluation kept none.
    fn latest_light(&self) -> Option<&[f32]> {
        None
    }
}

/// A problem that projects fields, for methods without a gradient and for initial phases.
pub trait Project: Evaluate {
    /// The modulator, which tells the phases that show a field.
    fn slm(&self) -> &Slm<f32>;

    /// Target amplitudes √t of each plane.
    fn target_amplitudes(&self) -> Vec<Plane<f32>>;

    /// Field of one frame on the modulator that results from propagating the targets' amplitudes backwards, with the
    /// phase `image_phase` \[rad\] in all planes.
    fn back_propagated(&self, image_phase: &[f32]) -> Vec<Complex32>;

    /// Runs one round of [Gerchberg–Saxton](super::HologramMethod::GerchbergSaxton): replaces the phase by the next
    /// phase and returns the evaluation of the phase before it. `wanted` holds W√t of each plane; W is updated only if
    /// `weighted` is true.
    fn project(&mut self, phase: &mut [f32], wanted: &mut [Plane<f32>], weighted: bool) -> Evaluation;
}
