//! What jobs gave.

use super::HologramResult;
use crate::dataset::Split;
use crate::kernel::KernelMetrics;
use crate::propagation::ValidityReport;
use serde::{Deserialize, Serialize};

/// What a job gave.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum JobResult {
    /// Of [`OptimizeHologram`](super::OptimizeHologram).
    Hologram(Box<HologramResult>),
    /// Of [`LearnKernel`](super::LearnKernel).
    Learn(LearnResult),
    /// Of [`SimulateCapture`](super::SimulateCapture).
    Capture(CaptureResult),
    /// Of [`EvaluateKernel`](super::EvaluateKernel).
    Evaluate(EvaluateResult),
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
    /// How the light's way was computed; `None` for jobs of older servers.
    #[serde(default)]
    pub propagation: Option<ValidityReport>,
    /// Ids of training pairs whose photographs are not of their holograms.
    #[serde(default)]
    pub left_out_pairs: Vec<String>,
    /// The kernel's polynomial degree; 0 for the models paper and dense.
    #[serde(default)]
    pub order: u32,
    /// The kernels of the other distances that the model was learned for together, in the order of their datasets.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint: Vec<JointResult>,
}

/// The kernel of one more distance.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointResult {
    /// Resource name of the new version; filled in by the store.
    pub kernel_version: String,
    /// How good it is there.
    pub metrics: KernelMetrics,
}

/// A simulated photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaptureResult {
    /// Artifact digest.
    pub photo: String,
    /// How the light's way was computed; `None` for jobs of older servers.
    #[serde(default)]
    pub propagation: Option<ValidityReport>,
}

/// How well a kernel predicts each pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluateResult {
    /// In the order of the pairs' ids.
    pub pairs: Vec<PairLoss>,
    /// How the light's way was computed; `None` for jobs of older servers.
    #[serde(default)]
    pub propagation: Option<ValidityReport>,
}

/// How well a kernel predicts one pair.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PairLoss {
    /// The pair's id.
    pub pair: String,
    /// What the pair is used for.
    pub split: Split,
    /// In the region of interest, saturated pixels left out, gain and black level fitted.
    pub loss: f64,
    /// The same over the full frame.
    pub loss_full_frame: f64,
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
