//! Buffers of fits of light with several modes, or with a blur.

use crate::engine::{EngineCore, Real};
use crate::numerics::buffers::zeros;
use num_complex::Complex;

/// Light of all modes, and its gradient. Empty while a display has a single mode and no blur.
#[derive(Debug)]
pub(super) struct ModeBuffers<T> {
    /// Light planes.
    pub(super) lights: Vec<T>,
    /// Light planes before the blur; empty without one.
    pub(super) sharp: Vec<T>,
    /// Slopes of the loss by the light.
    pub(super) slopes: Vec<T>,
    /// Sum of what arrives at the SLM; empty with a single mode.
    pub(super) returned: Vec<Complex<T>>,
    /// Slopes of the loss by the two q of the blur.
    pub(super) by_blur: [f64; 2],
}

impl<T: Real> ModeBuffers<T> {
    pub(super) fn empty() -> Self {
        let (lights, sharp, slopes) = (Vec::new(), Vec::new(), Vec::new());
        Self { lights, sharp, slopes, returned: Vec::new(), by_blur: [0.0; 2] }
    }

    /// Buffers for an engine with its kernels.
    pub(super) fn of(engine: &EngineCore<T>) -> Self {
        if !engine.needs_all_light() {
            return Self::empty();
        }
        let light_len = engine.detector.light_planes() * engine.height_px() * engine.width_px();
        let returned_len = if engine.is_coherent() { 0 } else { engine.kernels.half_spectrum_len(&engine.convolver) };
        Self { lights: zeros(light_len), slopes: zeros(light_len), returned: zeros(returned_len), ..Self::empty() }
    }
}
