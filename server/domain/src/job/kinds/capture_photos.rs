//! Jobs that photograph patterns at the bench of a display: request, result, memory and time.

use super::Kind;
use crate::job::estimate::{Need, REAL};
use crate::units::{Distance, Wavelength};
use lightpath_optics::memory::EngineSize;
use serde::{Deserialize, Serialize};

/// Request to photograph patterns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapturePhotos {
    /// Id of the display, at whose bench a rig runs.
    pub display: String,
    /// Wavelength: one of the display's wavelengths.
    pub wavelength: Wavelength,
    /// Distance from the SLM to the plane of the camera.
    pub distance: Distance,
    /// What is photographed, in this order.
    pub patterns: Vec<NamedPattern>,
    /// Id of the dataset whose alignment says where the camera sees the display; `None`: the photographs are not compared with
    /// what their patterns should show.
    pub aligned_by: Option<String>,
    /// Exposure of all photographs \[s\]; `None`: it is searched with the first pattern, and shortened for those that saturate.
    pub exposure_s: Option<f64>,
    /// Number of exposures of which each photograph is the mean.
    pub exposures: u32,
}

/// A pattern with the name that its photograph gets.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedPattern {
    /// Name, unique in the job.
    pub id: String,
    /// Artifact digest of the pattern.
    pub pattern: String,
}

/// The photographs of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CapturePhotosResult {
    /// Program of the rig, and what it drives.
    pub rig: String,
    /// Mean of a photograph with the shutter closed, as a part of full scale; `None`: the rig has no shutter.
    pub black_level: Option<f64>,
    /// One photograph of each pattern, in the order of the request.
    pub photos: Vec<CapturedPhoto>,
    /// Photographs that were not of their pattern, and were taken again.
    pub retaken: Vec<Retaken>,
}

/// A photograph, and what shows that it is of its pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapturedPhoto {
    /// Name of the pattern.
    pub id: String,
    /// Artifact digest of the photograph.
    pub photo: String,
    /// Number of its first frame, as the camera counts.
    pub frame: u64,
    /// Begin of its exposure \[ms since 1970\].
    pub exposure_time_ms: i64,
    /// Exposure \[s\].
    pub exposure_s: f64,
    /// Correlation with what the pattern should show; `None`: they were not compared.
    pub correlation: Option<f64>,
    /// The highest correlation with what another pattern of the job should show; `None`: they were not compared.
    pub other_correlation: Option<f64>,
    /// Temperature at the bench \[°C\]; `None`: not measured.
    pub temperature_c: Option<f64>,
}

/// A photograph that was refused.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Retaken {
    /// Name of the pattern.
    pub id: String,
    /// What was wrong with the photograph.
    pub reason: String,
}

impl Kind for CapturePhotos {
    fn display(&self) -> &str {
        &self.display
    }

    fn datasets(&self) -> &[String] {
        self.aligned_by.as_slice()
    }

    fn needs_rig(&self) -> bool {
        true
    }
}

/// Need of a job that photographs `patterns` patterns. `decoding_bytes` is the memory for decoding a photograph, and
/// `photo_s` the time for one at the bench \[s\].
#[must_use]
pub fn need(engine: EngineSize, decoding_bytes: u64, patterns: usize, photo_s: f64) -> Need {
    let n = engine.pixels();
    // A pattern, a photograph, its copy on the display's grid, and what the pattern should show.
    let stages =
        [engine.engine_bytes() + engine.scratch_bytes() + decoding_bytes + engine.light_bytes() + 4 * REAL * n];
    Need::new(stages, 2.0 * engine.light_work() * patterns as f64).and_waiting(photo_s * patterns as f64)
}
