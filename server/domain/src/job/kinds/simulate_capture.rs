//! Jobs that photograph a hologram on a simulated display: request, result, memory and time.

use super::Kind;
use crate::job::estimate::{Need, REAL};
use crate::units::{Distance, Wavelength};
use lightpath_bench::{BenchSize, SimulatedBench};
use lightpath_optics::ValidityReport;
use lightpath_optics::memory::EngineSize;
use serde::{Deserialize, Serialize};

/// Request to photograph a hologram on a simulated display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateCapture {
    /// Id of the display.
    pub display: String,
    /// Wavelength: one of the display's wavelengths.
    pub wavelength: Wavelength,
    /// Distance from the SLM to the plane of the camera.
    pub distance: Distance,
    /// Artifact digest of the pattern.
    pub pattern: String,
    /// Seed of the camera's noise.
    pub seed: u64,
    /// Time since the bench was set up \[s\], for its drift.
    pub elapsed_s: f64,
}

/// Simulated photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureResult {
    /// Artifact digest of the photograph.
    pub photo: String,
    /// Propagation method of the simulation, and its limits.
    pub propagation: ValidityReport,
}

impl Kind for SimulateCapture {
    fn display(&self) -> &str {
        &self.display
    }
}

/// Need of a job that photographs a hologram on a simulated display.
#[must_use]
pub fn need(engine: EngineSize, bench: &SimulatedBench, decoding_bytes: u64) -> Need {
    let (n, size) = (engine.pixels(), BenchSize::new(engine, *bench));
    let stages = [decoding_bytes + 2 * REAL * n, size.simulation_bytes() + 3 * REAL * n];
    Need::new(stages, 2.0 * size.simulation_work())
}
