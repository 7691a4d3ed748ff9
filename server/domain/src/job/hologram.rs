//! Hologram jobs: request and result.

use crate::dataset::Encoding;
use crate::units::{Distance, Wavelength};
use lightpath_optics::hologram::{HologramMethod, InitialPhase, Loss, Quality};
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::second_opinion::SecondOpinion;
use lightpath_optics::{Detector, RegionOfInterest, ValidityReport};
use serde::{Deserialize, Serialize};

/// Request to compute holograms. The result has one hologram for each wavelength, and each hologram shows the pictures
/// of all planes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizeHologram {
    /// Id of the display.
    pub display: String,
    /// Wavelengths of the display, at least one, each once.
    pub wavelengths: Vec<Wavelength>,
    /// Pictures to show, at least one, at different distances.
    pub planes: Vec<ImagePlane>,
    /// Artifact digest of a picture of depths. Each pixel then counts only in the plane nearest to its depth. `None`:
    /// every plane shows its whole target.
    pub depth_map: Option<String>,
    /// Encoding of light in the values of the targets.
    pub target_encoding: Encoding,
    /// Rule for a target whose size differs from the display's.
    pub target_fit: Fit,
    /// Kernel versions: for each wavelength one version for each plane; `None`: the ideal kernel.
    pub kernel_versions: Vec<Vec<Option<u32>>>,
    /// Propagation method; `None`: the method of the learned kernel, or the planner's choice for an ideal kernel.
    pub propagation: Option<ConvolutionMethod>,
    /// Method that computes the phases.
    pub method: HologramMethod,
    /// Number of iterations for each hologram.
    pub iterations: u32,
    /// Number of phases of each hologram, shown one after another.
    pub frames: u32,
    /// Initial phase of the optimization. Given phases are artifact digests of arrays, one for each wavelength.
    pub initial_phase: InitialPhase<Vec<String>>,
    /// Seed of a random initial phase.
    pub seed: u64,
    /// Loss function that compares the reconstruction with the target.
    pub loss: Loss,
    /// Rule that defines the light of a pixel.
    pub detector: Detector,
    /// Region in which the reconstruction is compared with the target.
    pub region_of_interest: RegionOfInterest,
    /// Artifact digest of a picture with the weight of each pixel; `None`: all pixels have the same weight.
    pub weight_mask: Option<String>,
    /// Whether the last part of the optimization takes the limited levels of the display into account.
    pub quantization_aware: bool,
}

/// A picture to show at a distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImagePlane {
    /// Distance from the SLM.
    pub distance: Distance,
    /// Artifact digest of the target picture.
    pub target: String,
    /// Weight of the plane relative to the other planes.
    pub weight: f64,
}

/// Rule for a picture whose size differs from the display's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// Scale the whole picture to fit inside the display, with black borders.
    #[default]
    Contain,
    /// Scale the picture to cover the display and crop the rest.
    Cover,
    /// Scale height and width independently.
    Stretch,
    /// Refuse a picture of another size.
    Exact,
}

/// Result of a hologram job: holograms and their quality.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HologramResult {
    /// One hologram for each wavelength.
    pub wavelengths: Vec<WavelengthResult>,
    /// Artifact digests of colour pictures, one for each plane; empty if the number of wavelengths is not three.
    pub colour_reconstructions: Vec<String>,
    /// Number of iterations of each hologram.
    pub iterations: u32,
    /// Mean time of an iteration \[ms\].
    pub iteration_ms: f64,
}

/// The hologram of one wavelength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WavelengthResult {
    /// Wavelength of the hologram.
    pub wavelength: Wavelength,
    /// Phases of the hologram, in the order in which they are shown.
    pub frames: Vec<FrameResult>,
    /// Reconstructions of the hologram, one for each plane.
    pub planes: Vec<PlaneResult>,
    /// Fitted gain: factor from the computed intensity to the target intensity.
    pub intensity_scale: f64,
    /// Loss of the last iteration.
    pub loss: f64,
    /// Amplitude by which the double-phase method divided the field; `None` for other methods.
    pub largest_amplitude: Option<f64>,
}

/// A phase of a hologram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameResult {
    /// Artifact digest of the phase as grey levels of the display (PNG).
    pub phase: String,
    /// Artifact digest of the phase in radians (float32, `.npy`).
    pub phase_npy: String,
}

/// Reconstruction of a hologram at a distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneResult {
    /// Distance from the SLM.
    pub distance: Distance,
    /// Artifact digest of the reconstruction that the kernel predicts (sRGB PNG).
    pub reconstruction: String,
    /// Quality of the phases as optimized.
    pub quality: Quality,
    /// Quality of the phases as the display shows them, in its limited levels.
    pub quantized_quality: Quality,
    /// Propagation method of the reconstruction, and its limits.
    pub propagation: ValidityReport,
    /// PSNR of the phases as the display shows them, on a display that shows the other diffraction orders \[dB\];
    /// `None`: not computed.
    pub other_orders_psnr_db: Option<f64>,
    /// Second opinion on the phases as the display shows them, for the job's detector; `None`: the independent model
    /// does not have this kernel, or would take much longer than the job.
    pub second_opinion: Option<SecondOpinion>,
}
