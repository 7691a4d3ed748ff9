//! Jobs: requests for work with a state.
//!
//! ```text
//!           submit             claim                 finish
//! (client) --------> QUEUED ----------> RUNNING -----------------> SUCCEEDED
//!                    ^   \ cancel        |  |  |  permanent error,
//!                    |    \--> CANCELLED <--/  |  attempts spent -> FAILED
//!                    +---------------------------/
//!                      retry after backoff, lease expired, drain
//! ```

use crate::dataset::{Encoding, Split};
use crate::kernel::{KernelMetrics, KernelModel};
use crate::units::{Distance, Wavelength};
use serde::{Deserialize, Serialize};

/// A job's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// Waits for a worker or for its time.
    Queued,
    /// A worker holds its lease.
    Running,
    /// Ended with a result.
    Succeeded,
    /// Ended without; can be queued again by hand.
    Failed,
    /// Ended because somebody asked for it.
    Cancelled,
}

impl JobState {
    /// In lower case, as people and the database write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Queued => "queued",
            Self::Running => "running",
            Self::Succeeded => "succeeded",
            Self::Failed => "failed",
            Self::Cancelled => "cancelled",
        }
    }

    /// Nothing will change any more by itself.
    #[must_use]
    pub fn has_ended(self) -> bool {
        match self {
            Self::Queued | Self::Running => false,
            Self::Succeeded | Self::Failed | Self::Cancelled => true,
        }
    }
}

/// A job as it stands in the store.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// Last part of the resource name (a UUID v7).
    pub id: String,
    /// What the submitter called the request.
    pub request_id: String,
    /// What to do.
    pub spec: JobSpec,
    /// Where it stands.
    pub state: JobState,
    /// Lower runs first.
    pub priority: i32,
    /// Attempts started so far.
    pub attempt: u32,
    /// Failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
    /// \[ms since 1970\]
    pub create_time_ms: i64,
    /// Of the latest attempt \[ms since 1970\].
    pub start_time_ms: Option<i64>,
    /// \[ms since 1970\]
    pub finish_time_ms: Option<i64>,
    /// A queued job does not start before this \[ms since 1970\].
    pub run_time_ms: i64,
    /// Of the latest attempt.
    pub progress: Option<Progress>,
    /// Why the latest attempt ended without success.
    pub error: Option<JobError>,
    /// Set when the job succeeded.
    pub result: Option<JobResult>,
    /// Somebody asked for the end of the job.
    pub cancel_requested: bool,
    /// Artifact digest of the latest checkpoint.
    pub checkpoint: Option<String>,
    /// Grows with every change.
    pub revision: u64,
}

/// What a submit brings, validated.
#[derive(Clone, Debug, PartialEq)]
pub struct NewJob {
    /// What to do.
    pub spec: JobSpec,
    /// Unique; the same request again is the same job.
    pub request_id: String,
    /// Lower runs first.
    pub priority: i32,
    /// Failed attempts, without a checkpoint between them, after which the job fails for good.
    pub attempts_max: u32,
}

/// What to do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobSpec {
    /// Find the phase that shows a target.
    OptimizeHologram(OptimizeHologram),
    /// Learn a kernel from a dataset.
    LearnKernel(LearnKernel),
    /// Photograph a hologram on a simulated display.
    SimulateCapture(SimulateCapture),
    /// Measure a kernel on a dataset.
    EvaluateKernel(EvaluateKernel),
}

impl JobSpec {
    /// Id of the display that the job is about.
    #[must_use]
    pub fn display(&self) -> &str {
        match self {
            Self::OptimizeHologram(spec) => &spec.display,
            Self::LearnKernel(spec) => &spec.display,
            Self::SimulateCapture(spec) => &spec.display,
            Self::EvaluateKernel(spec) => &spec.display,
        }
    }

    /// Id of the dataset that the job reads.
    #[must_use]
    pub fn dataset(&self) -> Option<&str> {
        match self {
            Self::LearnKernel(spec) => Some(&spec.dataset),
            Self::EvaluateKernel(spec) => Some(&spec.dataset),
            Self::OptimizeHologram(_) | Self::SimulateCapture(_) => None,
        }
    }
}

/// Find the phase that shows a target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizeHologram {
    /// Id of the display.
    pub display: String,
    /// One of the display's.
    pub wavelength: Wavelength,
    /// From the SLM to the image plane.
    pub distance: Distance,
    /// Artifact digest of the picture.
    pub target: String,
    /// How the picture's values stand for light.
    pub target_encoding: Encoding,
    /// How a picture of another size is brought to the display's.
    pub target_fit: Fit,
    /// `None`: the ideal kernel.
    pub kernel_version: Option<u32>,
    /// What counts as a pixel's light.
    pub detector: Detector,
    /// Steps of Adam.
    pub iterations: u32,
    /// Adam's step \[rad\].
    pub learning_rate: f64,
    /// Of the initial phase.
    pub seed: u64,
    /// The initial phase is uniform in [0, this) \[rad\].
    pub initial_phase_range_rad: f64,
    /// Where the picture counts.
    pub region_of_interest: Region,
}

/// How a picture of another size is brought to the display's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// Fit inside, black borders.
    Contain,
    /// Cover, crop the overhang.
    Cover,
    /// Each axis by itself.
    Stretch,
    /// Refuse any other size.
    Exact,
}

/// What counts as a pixel's light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Detector {
    /// The intensity at the sample point.
    Point,
    /// The mean over the pixel.
    Pixel,
    /// Every sub-sample by itself.
    Supersampled,
}

/// A rectangle in the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Region {
    /// \[px\]
    pub x_px: u32,
    /// \[px\]
    pub y_px: u32,
    /// \[px\]
    pub width_px: u32,
    /// \[px\]
    pub height_px: u32,
}

/// Learn a kernel from a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// How the kernel is parametrized.
    pub model: KernelModel,
    /// Passes over the training pairs; `None`: the model's default.
    pub epochs: Option<u32>,
    /// Full-batch L-BFGS evaluations afterwards; `None`: the model's default.
    pub refinement_evaluations: Option<u32>,
    /// Adam's step; `None`: the model's default.
    pub learning_rate: Option<f64>,
    /// Of the order of the pairs, and of the paper model's start.
    pub seed: u64,
    /// Highest polynomial degree of the smooth errors.
    pub order: u32,
    /// What the camera's pixels measure.
    pub detector: Detector,
    /// Where the photographs count.
    pub region_of_interest: Region,
}

/// Photograph a hologram on a simulated display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateCapture {
    /// Id of the display.
    pub display: String,
    /// One of the display's.
    pub wavelength: Wavelength,
    /// From the SLM to the camera's plane.
    pub distance: Distance,
    /// Artifact digest of the hologram.
    pub phase: String,
    /// Of the camera's noise.
    pub seed: u64,
}

/// Measure a kernel on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateKernel {
    /// Id of the dataset.
    pub dataset: String,
    /// Id of the dataset's display.
    pub display: String,
    /// `None`: the ideal kernel.
    pub kernel_version: Option<u32>,
    /// Where the photographs count.
    pub region_of_interest: Region,
}

/// What a job gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobResult {
    /// Of [`OptimizeHologram`].
    Hologram(Box<HologramResult>),
    /// Of [`LearnKernel`].
    Learn(LearnResult),
    /// Of [`SimulateCapture`].
    Capture(CaptureResult),
    /// Of [`EvaluateKernel`].
    Evaluate(EvaluateResult),
}

/// A hologram and how good it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HologramResult {
    /// Artifact digest: grey PNG of levels.
    pub phase: String,
    /// Artifact digest: float32 radians.
    pub phase_npy: String,
    /// Artifact digest: what the kernel predicts, sRGB PNG.
    pub reconstruction: String,
    /// Of the phase as optimized.
    pub quality: Quality,
    /// Of the phase as the display shows it.
    pub quantized_quality: Quality,
    /// The fitted gain.
    pub intensity_scale: f64,
    /// Of the last iteration.
    pub loss: f64,
    /// Steps done.
    pub iterations: u32,
    /// Mean over the iterations \[ms\].
    pub iteration_ms: f64,
    /// Where the picture counted.
    pub region_of_interest: Region,
}

/// How good a hologram is in the region of interest, as each detector sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "StoredQuality")]
pub struct Quality {
    /// At the sample points.
    pub point: SeenQuality,
    /// Integrated over pixels.
    pub pixel: SeenQuality,
    /// Over all sub-samples.
    pub supersampled: SeenQuality,
}

/// What one detector sees; gain fitted, peak 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeenQuality {
    /// Peak signal-to-noise ratio \[dB\].
    pub psnr_db: f64,
    /// Structural similarity; `None` where the region is too small.
    pub ssim: Option<f64>,
    /// Over five scales; `None` where the region is too small.
    pub ms_ssim: Option<f64>,
    /// Light in the region, as a part of what leaves the SLM; `None` in results of older servers.
    pub diffraction_efficiency: Option<f64>,
    /// Light in the frame, as a part of what leaves the SLM; `None` in results of older servers.
    pub frame_efficiency: Option<f64>,
    /// Grain of evenly lit areas; `None` where there are none.
    pub speckle_contrast: Option<f64>,
}

/// The forms in which results are stored.
#[derive(Deserialize)]
#[serde(untagged)]
enum StoredQuality {
    Now {
        point: Box<SeenQuality>,
        pixel: Box<SeenQuality>,
        supersampled: Box<SeenQuality>,
    },
    /// Of servers that knew no other metric.
    PsnrAlone {
        psnr_point_db: f64,
        psnr_pixel_db: f64,
        psnr_supersampled_db: f64,
    },
}

impl From<StoredQuality> for Quality {
    fn from(stored: StoredQuality) -> Self {
        let psnr_alone = |psnr_db| SeenQuality { psnr_db, ..SeenQuality::default() };
        match stored {
            StoredQuality::Now { point, pixel, supersampled } => {
                Self { point: *point, pixel: *pixel, supersampled: *supersampled }
            }
            StoredQuality::PsnrAlone { psnr_point_db, psnr_pixel_db, psnr_supersampled_db } => Self {
                point: psnr_alone(psnr_point_db),
                pixel: psnr_alone(psnr_pixel_db),
                supersampled: psnr_alone(psnr_supersampled_db),
            },
        }
    }
}

/// A learned kernel, before it has a version number: the store numbers it in the transaction that ends the job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearnResult {
    /// Resource name of the new version; filled in by the store.
    pub kernel_version: String,
    /// How good it is.
    pub metrics: KernelMetrics,
    /// Training loss after each epoch and refinement evaluation.
    pub loss_history: Vec<f64>,
}

/// A simulated photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureResult {
    /// Artifact digest.
    pub photo: String,
}

/// How well a kernel predicts each pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateResult {
    /// In the order of the pairs' ids.
    pub pairs: Vec<PairLoss>,
}

/// How well a kernel predicts one pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairLoss {
    /// The pair's id.
    pub pair: String,
    /// What the pair is used for.
    pub split: Split,
    /// In the region of interest, gain and black level fitted.
    pub loss: f64,
    /// Over the full frame, gain and black level fitted.
    pub loss_full_frame: f64,
}

/// How far a running job is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// What is being done, for people.
    pub stage: String,
    /// Steps done.
    pub step: u32,
    /// All steps.
    pub steps_total: u32,
    /// Of the latest step.
    pub loss: f64,
    /// Time left \[s\].
    pub eta_s: Option<f64>,
}

/// Why an attempt ended without success.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobError {
    /// In capitals, stable, for programs.
    pub reason: String,
    /// For people.
    pub message: String,
    /// The job will be tried again by itself.
    pub retryable: bool,
}

/// Something that happened to a job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JobEvent {
    /// Grows over all jobs; what pages are keyed by.
    pub sequence: i64,
    /// \[ms since 1970\]
    pub time_ms: i64,
    /// The attempt it belongs to; 0 before the first.
    pub attempt: u32,
    /// For people.
    pub message: String,
}

/// A worker's right to a job: every write of the worker names all of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lease {
    /// Id of the job.
    pub job: String,
    /// Number of the attempt, from 1.
    pub attempt: u32,
    /// Unique to this claim.
    pub lease_id: String,
    /// The lease is void after this, unless extended \[ms since 1970\].
    pub until_ms: i64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qualities_are_read_in_every_form_that_was_ever_stored() {
        let old = r#"{"psnr_point_db":46.3,"psnr_pixel_db":27.7,"psnr_supersampled_db":15.6}"#;
        let quality: Quality = serde_json::from_str(old).unwrap();
        assert_eq!(quality.pixel, SeenQuality { psnr_db: 27.7, ..SeenQuality::default() });
        assert_eq!((quality.point.psnr_db, quality.supersampled.psnr_db), (46.3, 15.6));
        let full = Quality { pixel: SeenQuality { ssim: Some(0.93), ..quality.pixel }, ..quality };
        assert_eq!(serde_json::from_str::<Quality>(&serde_json::to_string(&full).unwrap()).unwrap(), full);
    }
}
