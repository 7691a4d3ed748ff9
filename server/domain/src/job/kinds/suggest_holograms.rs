//! Jobs that suggest holograms to photograph: request, result, memory and time.

use super::Kind;
use crate::job::estimate::{
    KernelSize, LEARNING_FACTOR, Need, PairsSize, REAL, SAMPLED_PAIRS_MAX, STEP_FACTOR, SUGGESTED_ITERATIONS,
};
use crate::kernel::KernelKey;
use lightpath_optics::hologram::HologramMethod;
use lightpath_optics::learning::{KernelModel, ModelPart};
use lightpath_optics::memory::{EngineSize, HologramSize, LearningSize};
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Largest number of suggested holograms.
pub const SUGGESTIONS_MAX: u32 = 16;
/// Number of suggested holograms if the request does not say it.
pub const SUGGESTIONS_DEFAULT: u32 = 4;

/// Fewest holograms from which the suggested ones are chosen.
const CANDIDATES_MIN: u32 = 12;

/// Ranges of the random phases from which the holograms are optimized \[rad\]. Narrow ranges light the middle of the
/// band, wide ones all of it.
pub const PHASE_RANGES_RAD: [f64; 3] = [0.5, 2.0, TAU];

/// Number of holograms from which `holograms` are chosen, a multiple of the number of phase ranges.
#[must_use]
pub fn candidates(holograms: u32) -> u32 {
    (2 * holograms).max(CANDIDATES_MIN).next_multiple_of(PHASE_RANGES_RAD.len() as u32)
}

/// Request for the holograms whose photographs would tell most about a display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuggestHolograms {
    /// Key of the kernel.
    pub kernel: KernelKey,
    /// Number of the kernel version.
    pub version: u32,
    /// Number of holograms.
    pub holograms: u32,
    /// Seed of the pictures and of the random phases.
    pub seed: u64,
}

/// Holograms to photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuggestResult {
    /// The holograms, the one that tells most first.
    pub holograms: Vec<SuggestedHologram>,
    /// Number of photographs of holograms like those of the dataset that would tell as much.
    pub worth_photographs: f64,
}

/// A hologram to photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuggestedHologram {
    /// Artifact digest of its levels (PNG).
    pub pattern: String,
    /// Name of the test picture that it shows.
    pub picture: String,
    /// Range of the random phases from which it was optimized \[rad\].
    pub phase_range_rad: f64,
    /// Change of the error that predictions have because the kernel is uncertain, by this hologram and those before it
    /// \[dB\].
    pub error_db: f64,
    /// Part of the model about which it tells most.
    pub part: ModelPart,
    /// Change of the error by this part, through this hologram alone \[dB\].
    pub part_db: f64,
}

impl Kind for SuggestHolograms {
    fn display(&self) -> &str {
        &self.kernel.display
    }
}

/// What a job needs that suggests holograms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuggestInputs {
    /// Kernel of the version.
    pub kernel: KernelSize,
    /// Model of the version.
    pub model: KernelModel,
    /// Pairs of its dataset.
    pub pairs: PairsSize,
    /// Rows and columns of the region that is compared \[px\].
    pub region_px: [usize; 2],
}

/// Need of a job that suggests holograms.
#[must_use]
pub fn need(spec: &SuggestHolograms, inputs: &SuggestInputs) -> Need {
    let SuggestInputs { kernel, model, pairs, region_px } = *inputs;
    let (engine, n) = (kernel.engine, kernel.engine.pixels());
    let (order, blocks) = (kernel.order, kernel.blocks);
    // Transfer functions are sampled before.
    let sampled = EngineSize { sampling_bytes: 0, ..engine };
    let size = LearningSize { engine: sampled, model, order, distances: 1, region_px, blocks };
    let hologram = HologramSize::new(engine, HologramMethod::Lbfgs, SUGGESTED_ITERATIONS);
    let running = hologram.problem_bytes() + hologram.state_bytes() + hologram.scratch_bytes() + 3 * REAL * n;
    let candidates = candidates(spec.holograms);
    // The files of all candidates are kept: at most two bytes for each pixel.
    let kept = engine.engine_bytes() + size.held_bytes() + u64::from(candidates) * 2 * n;
    let stages = [kernel.reading_bytes(), kept + running.max(size.weighing_bytes() + pairs.reading_bytes(n))];
    let steps = f64::from(candidates * SUGGESTED_ITERATIONS) * STEP_FACTOR * hologram.step_work();
    let curvatures = f64::from(candidates) + (SAMPLED_PAIRS_MAX as f64).min(pairs.splits[0] as f64);
    let work = steps + LEARNING_FACTOR * curvatures * size.curvature_work() + 2.0 * engine.sampling_work as f64;
    Need::new(stages, work)
}
