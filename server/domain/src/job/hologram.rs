//! What a hologram job is to do, and what it gave.

use crate::dataset::Encoding;
use crate::units::{Distance, Wavelength};
use lightpath_optics::hologram::{HologramMethod, InitialPhase, Loss, Quality};
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::{Detector, RegionOfInterest, ValidityReport};
use serde::{Deserialize, Serialize};

/// Find the phases that show pictures: of each wavelength a hologram, each of which shows all planes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizeHologram {
    /// Id of the display.
    pub display: String,
    /// Wavelengths of the display, at least one, no two equal.
    pub wavelengths: Vec<Wavelength>,
    /// The pictures to show, at least one, no two at one distance.
    pub planes: Vec<ImagePlane>,
    /// Artifact digest of a picture that says which part of the targets belongs to which plane; `None`: every plane shows all
    /// of its target.
    pub depth_map: Option<String>,
    /// How the targets' values stand for light.
    pub target_encoding: Encoding,
    /// How a target of another size is brought to the display's.
    pub target_fit: Fit,
    /// The kernel versions of each wavelength, for each plane; `None`: the ideal kernel.
    pub kernel_versions: Vec<Vec<Option<u32>>>,
    /// How the light's way is computed; `None`: the planner's choice, or what the kernel was learned with.
    pub propagation: Option<ConvolutionMethod>,
    /// How the phases are found.
    pub method: HologramMethod,
    /// Steps.
    pub iterations: u32,
    /// Phases of each hologram.
    pub frames: u32,
    /// Where the search begins. Phases that are given are artifact digests of arrays, one for each wavelength.
    pub initial_phase: InitialPhase<Vec<String>>,
    /// Of what is random in the initial phase.
    pub seed: u64,
    /// How the pictures are compared.
    pub loss: Loss,
    /// What counts as a pixel's light.
    pub detector: Detector,
    /// Where the pictures count.
    pub region_of_interest: RegionOfInterest,
    /// Artifact digest: how much each pixel counts.
    pub weight_mask: Option<String>,
    /// The phases are optimized through the display's levels in the end.
    pub quantization_aware: bool,
}

/// A picture at a distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImagePlane {
    /// From the SLM.
    pub distance: Distance,
    /// Artifact digest.
    pub target: String,
    /// How much the plane counts among the others.
    pub weight: f64,
}

/// How a picture of another size is brought to the display's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fit {
    /// Fit inside, black borders.
    #[default]
    Contain,
    /// Cover, crop the overhang.
    Cover,
    /// Each axis by itself.
    Stretch,
    /// Refuse any other size.
    Exact,
}

/// Holograms and how good they are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HologramResult {
    /// One hologram for each wavelength.
    pub wavelengths: Vec<WavelengthResult>,
    /// Artifact digests, a colour picture for each plane; empty where the wavelengths are no three.
    pub colour_reconstructions: Vec<String>,
    /// Steps of each hologram.
    pub iterations: u32,
    /// Mean over the iterations \[ms\].
    pub iteration_ms: f64,
}

/// The hologram of one wavelength.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct WavelengthResult {
    /// Its wavelength.
    pub wavelength: Wavelength,
    /// Its phases.
    pub frames: Vec<FrameResult>,
    /// What it shows.
    pub planes: Vec<PlaneResult>,
    /// The fitted gain.
    pub intensity_scale: f64,
    /// Of the last iteration.
    pub loss: f64,
    /// Double phase: what the field was divided by.
    pub largest_amplitude: Option<f64>,
}

/// A phase of a hologram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameResult {
    /// Artifact digest: grey PNG of levels.
    pub phase: String,
    /// Artifact digest: float32 radians.
    pub phase_npy: String,
}

/// A picture that a hologram shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlaneResult {
    /// From the SLM.
    pub distance: Distance,
    /// Artifact digest: what the kernel predicts, sRGB PNG.
    pub reconstruction: String,
    /// Of the phases as optimized.
    pub quality: Quality,
    /// Of the phases as the display shows them.
    pub quantized_quality: Quality,
    /// How the light's way was computed.
    pub propagation: ValidityReport,
}
