//! Jobs that suggest holograms to photograph: request and result.

use crate::kernel::KernelKey;
use lightpath_optics::learning::ModelPart;
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
    pub phase: String,
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
