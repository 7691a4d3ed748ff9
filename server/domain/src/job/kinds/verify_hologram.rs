//! Jobs that judge holograms by an independent model: request, result, memory and time.

use super::Kind;
use super::optimize_hologram::{OptimizeHologram, judging_bytes, widest};
use crate::job::estimate::{KernelSize, Need, REAL};
use crate::units::{Distance, Wavelength};
use lightpath_optics::Detector;
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use serde::{Deserialize, Serialize};

/// Memory of the tables for many rows in a thorough opinion on light that does not blur, for each frequency along y
/// \[bytes\].
const THOROUGH_BYTES_PER_VALUE_ALONG_Y: u64 = 128 * 4 * 16;

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

impl Kind for VerifyHologram {
    fn display(&self) -> &str {
        &self.display
    }
}

/// Need of a job that judges the holograms of another job.
#[must_use]
pub fn need(verified: &OptimizeHologram, kernels: &[Vec<KernelSize>]) -> Need {
    let frames = verified.subframes as usize;
    let each = kernels.iter().map(|kernels| {
        let (engine, n) = (widest(kernels), kernels[0].engine.pixels());
        let engines: u64 = kernels.iter().map(|kernel| kernel.engine.engine_bytes()).sum();
        let reading = kernels.iter().map(KernelSize::reading_bytes).max().unwrap_or(0);
        let depths = if verified.depth_map.is_some() { 2 * n } else { 0 };
        let pictures = (frames + kernels.len()) as u64 * REAL * n + depths;
        let thorough = THOROUGH_BYTES_PER_VALUE_ALONG_Y
            * engine.opinion.map_or(0, |opinion| opinion.along_axis * opinion.rows_for_each);
        let memory = engines + pictures + reading.max(judging_bytes(&engine, frames) + thorough);
        let work = kernels.iter().map(|kernel| {
            let opinions = kernel.engine.opinion_work(frames, Effort::THOROUGH.rows_max, &Detector::ALL);
            opinions + kernel.engine.quality_work(frames) + 2.0 * kernel.engine.sampling_work as f64
        });
        (memory, work.sum::<f64>())
    });
    let (stages, work): (Vec<u64>, Vec<f64>) = each.unzip();
    Need::new(stages, work.iter().sum())
}
