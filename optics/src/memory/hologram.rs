//! Memory and work of the optimization of a hologram.

use super::engine::EngineSize;
use super::value_bytes::{COMPLEX, REAL};
use crate::display::Detector;
use crate::hologram::{HologramMethod, SAMPLES_BYTES_MAX};
use crate::numerics::optimizer::vectors::HISTORY;

/// Size of the optimization of a hologram for one wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HologramSize {
    /// Engine of each plane.
    pub engine: EngineSize,
    /// Number of planes.
    pub planes: usize,
    /// Number of frames.
    pub frames: usize,
    /// Whether each plane has weights.
    pub weighted: bool,
    /// Whether the loss compares neighbouring pixels.
    pub rough: bool,
    /// Whether the last steps go through a display's levels.
    pub levels: bool,
    /// Method.
    pub method: HologramMethod,
    /// Number of steps.
    pub iterations: u32,
}

impl HologramSize {
    /// Optimization with one plane and one frame, without weights.
    #[must_use]
    pub fn new(engine: EngineSize, method: HologramMethod, iterations: u32) -> Self {
        Self { engine, planes: 1, frames: 1, weighted: false, rough: false, levels: false, method, iterations }
    }

    /// The phases of all frames.
    #[must_use]
    pub fn phases_bytes(&self) -> u64 {
        self.frames as u64 * self.engine.pixels() * REAL
    }

    /// Pictures of all planes, and their weights.
    #[must_use]
    pub fn pictures_bytes(&self) -> u64 {
        self.planes as u64 * self.engine.pixels() * REAL * if self.weighted { 2 } else { 1 }
    }

    /// Buffers of a [`HologramProblem`](crate::HologramProblem), without its engines: pictures, fields, light.
    #[must_use]
    pub fn problem_bytes(&self) -> u64 {
        self.new_problem_bytes() + self.light_bytes()
    }

    /// Buffers of a problem before its first evaluation.
    fn new_problem_bytes(&self) -> u64 {
        self.pictures_bytes() + self.engine.fields_bytes() + self.engine.scratch_bytes()
    }

    /// Light, slopes and samples that an evaluation in two passes keeps.
    fn light_bytes(&self) -> u64 {
        if !self.takes_two_passes() {
            return 0;
        }
        let light = self.engine.detector.light_planes() as u64 * self.engine.pixels() * REAL;
        (self.planes as u64 + 1) * light + self.engine.sharp_bytes() + self.samples_bytes().unwrap_or(0)
    }

    /// The kept samples; `None` if they would be too large.
    fn samples_bytes(&self) -> Option<u64> {
        let fields = self.fields() as u64;
        let bytes = fields * self.engine.fields_bytes() / 2;
        if fields == 1 { Some(0) } else { (bytes <= SAMPLES_BYTES_MAX as u64).then_some(bytes) }
    }

    /// Number of fields whose light is computed in an evaluation.
    fn fields(&self) -> usize {
        self.planes * self.frames * self.engine.modes
    }

    fn takes_two_passes(&self) -> bool {
        match self.method {
            HologramMethod::Lbfgs | HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => true,
            HologramMethod::Adam { .. } | HologramMethod::DoublePhase => {
                self.frames * self.engine.modes > 1 || self.rough || self.engine.blurs_light
            }
        }
    }

    /// State of the method, which a checkpoint stores.
    #[must_use]
    pub fn state_bytes(&self) -> u64 {
        let phases = self.phases_bytes();
        match self.method {
            HologramMethod::Adam { .. } => 3 * phases,
            HologramMethod::Lbfgs => {
                let steps = (self.iterations.saturating_sub(1) as usize).min(HISTORY) as u64;
                (3 + 2 * steps) * phases
            }
            HologramMethod::GerchbergSaxton | HologramMethod::WeightedGerchbergSaxton => {
                phases + self.planes as u64 * self.engine.pixels() * REAL
            }
            HologramMethod::DoublePhase => phases,
        }
    }

    /// Scratch memory of the method.
    #[must_use]
    pub fn scratch_bytes(&self) -> u64 {
        let (phases, targets) = (self.phases_bytes(), self.planes as u64 * self.engine.pixels() * REAL);
        match self.method {
            HologramMethod::Adam { .. } => phases,
            HologramMethod::Lbfgs => 2 * phases + if self.levels { phases } else { 0 },
            HologramMethod::GerchbergSaxton => 2 * phases,
            HologramMethod::WeightedGerchbergSaxton => 2 * phases + targets,
            HologramMethod::DoublePhase => 0,
        }
    }

    /// Memory while the first phases are found: the problem before its first evaluation, the phases and, if they
    /// propagate back from the targets, the phases of the image and the field that the targets send back.
    #[must_use]
    pub fn start_bytes(&self, propagates_back: bool) -> u64 {
        let begun = self.new_problem_bytes() + self.phases_bytes();
        if self.method != HologramMethod::DoublePhase && !propagates_back {
            return begun;
        }
        let n = self.engine.pixels();
        let point = self.engine.with_detector(Detector::Point);
        let targets = self.planes as u64 * n * REAL;
        let fields = point.fields_bytes() + point.scratch_bytes() + point.resampling_bytes();
        begun + self.phases_bytes() + n * COMPLEX + targets + fields
    }

    /// Work of one step.
    #[must_use]
    pub fn step_work(&self) -> f64 {
        let (fields, values) = (self.fields() as f64, self.frames as f64 * self.engine.pixels() as f64);
        let again = if self.samples_bytes().is_none() && self.takes_two_passes() { 1.0 } else { 0.0 };
        let evaluations = fields * (self.engine.evaluation_work() + again * self.engine.light_work());
        let per_value = match self.method {
            HologramMethod::Lbfgs => 24.0,
            HologramMethod::Adam { .. } => 8.0,
            _ => 16.0,
        };
        evaluations + values * per_value
    }
}
