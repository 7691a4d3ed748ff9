//! Parts of displays that are one of several kinds.

use crate::v1::{Display, Modulator, SimulatedBench, display, modulator};

impl Display {
    /// The simulated bench; `None` for a display that people or a rig photograph.
    #[must_use]
    pub fn simulated_bench(&self) -> Option<&SimulatedBench> {
        self.bench.as_ref().map(|display::Bench::SimulatedBench(bench)| bench)
    }
}

impl Modulator {
    /// A modulator of the phase with square pixels, 8 bits and a linear response.
    #[must_use]
    pub fn of_phase(width_px: u32, height_px: u32, pixel_pitch_m: f64) -> Self {
        Self { width_px, height_px, pixel_pitch_x_m: pixel_pitch_m, ..Self::default() }
    }

    /// The measured phase of each level \[rad\]; empty: the response is linear.
    #[must_use]
    pub fn response_rad(&self) -> &[f64] {
        self.kind.as_ref().map_or(&[], |modulator::Kind::Phase(phase)| &phase.response_rad)
    }
}
