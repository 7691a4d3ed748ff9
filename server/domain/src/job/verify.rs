//! Jobs that judge holograms by an independent model: request and result.

use crate::units::{Distance, Wavelength};
use lightpath_optics::second_opinion::SecondOpinion;
use serde::{Deserialize, Serialize};

/// Request to judge the holograms of a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VerifyHologram {
    /// Id of the job that optimized the holograms.
    pub job: String,
    /// Id of its display.
    pub display: String,
}

/// Judgement of a job's holograms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct VerifyResult {
    /// Pictures of the holograms: all planes of the first wavelength, then those of the next one.
    pub planes: Vec<PlaneOpinion>,
}

/// Judgement of the picture that a hologram shows in one plane, with the phases as the display shows them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneOpinion {
    /// Wavelength of the hologram.
    pub wavelength: Wavelength,
    /// Distance from the SLM.
    pub distance: Distance,
    /// Opinions for the detectors point, pixel and supersampled.
    pub opinions: [SecondOpinion; 3],
}
