//! The problem on the processor, as the methods that find a hologram see it.

use super::evaluate::{Evaluate, Evaluation, ProblemSize, Project};
use super::gerchberg_saxton;
use super::processor::ProcessorProblem;
use crate::engine::slm::Slm;
use crate::metrics::Gain;
use crate::numerics::Plane;
use num_complex::Complex32;

impl Evaluate for ProcessorProblem<f32> {
    fn size(&self) -> ProblemSize {
        let (height_px, width_px) = (self.engine().height_px(), self.engine().width_px());
        ProblemSize { planes: self.planes.len(), frames: self.frames, height_px, width_px }
    }

    fn evaluate(&mut self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Evaluation {
        self.evaluate(phase, gain, gradient)
    }

    fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        self.measure(phase, gain)
    }

    fn light(&mut self, phase: &[f32]) -> Vec<f32> {
        self.light_of_first_plane(phase)
    }

    fn latest_light(&self) -> Option<&[f32]> {
        self.kept_light()
    }
}

impl Project for ProcessorProblem<f32> {
    fn slm(&self) -> &Slm<f32> {
        &self.engine().slm
    }

    fn target_amplitudes(&self) -> Vec<Plane<f32>> {
        self.target_amplitudes()
    }

    fn back_propagated(&self, image_phase: &[f32]) -> Vec<Complex32> {
        self.back_propagated(image_phase)
    }

    fn project(&mut self, phase: &mut [f32], wanted: &mut [Plane<f32>], weighted: bool) -> Evaluation {
        gerchberg_saxton::round(self, weighted, wanted, phase)
    }
}
