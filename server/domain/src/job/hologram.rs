//! What a hologram job is to do, and what it gave.

use super::{Detector, Quality, Region};
use crate::dataset::Encoding;
use crate::propagation::{PropagationMethod, ValidityReport};
use crate::units::{Distance, Wavelength};
use serde::{Deserialize, Serialize};

/// Find the phases that show pictures: of each wavelength a hologram, each of which shows all planes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptimizeHologram {
    /// Id of the display.
    pub display: String,
    /// One of the display's: the first of them.
    pub wavelength: Wavelength,
    /// From the SLM to the image plane: the first of them.
    pub distance: Distance,
    /// Artifact digest of the picture: the first of them.
    pub target: String,
    /// How the picture's values stand for light.
    pub target_encoding: Encoding,
    /// How a picture of another size is brought to the display's.
    pub target_fit: Fit,
    /// `None`: the ideal kernel. Of the first wavelength and plane.
    pub kernel_version: Option<u32>,
    /// What counts as a pixel's light.
    pub detector: Detector,
    /// Steps.
    pub iterations: u32,
    /// Adam's step \[rad\].
    pub learning_rate: f64,
    /// Of the initial phase.
    pub seed: u64,
    /// The random part of the initial phase is uniform in [0, this) \[rad\].
    pub initial_phase_range_rad: f64,
    /// Where the picture counts.
    pub region_of_interest: Region,
    /// How the phases are found.
    #[serde(default)]
    pub method: Method,
    /// The wavelengths after the first, with their kernels.
    #[serde(default)]
    pub more_wavelengths: Vec<Wavelength>,
    /// The planes after the first.
    #[serde(default)]
    pub more_planes: Vec<ImagePlane>,
    /// How much the first plane counts among the others.
    #[serde(default = "one")]
    pub plane_weight: f64,
    /// Which part of the picture belongs to which plane; `None`: each plane has a picture of its own.
    #[serde(default)]
    pub depth_map: Option<String>,
    /// Kernels of each wavelength, for each plane, the first one too; empty for one wavelength and plane.
    #[serde(default)]
    pub kernel_versions: Vec<Option<u32>>,
    /// Phases of each hologram.
    #[serde(default = "one_frame")]
    pub frames: u32,
    /// Where the search begins.
    #[serde(default)]
    pub initial_phase: InitialPhase,
    /// How the picture is compared.
    #[serde(default)]
    pub loss: Loss,
    /// Artifact digest: how much each pixel counts.
    #[serde(default)]
    pub weight_mask: Option<String>,
    /// The phases are optimized through the display's levels in the end.
    #[serde(default)]
    pub quantization_aware: bool,
    /// How the light's way is computed; `None`: the planner's choice, or what the kernel was learned with.
    #[serde(default)]
    pub propagation: Option<PropagationMethod>,
}

fn one() -> f64 {
    1.0
}

fn one_frame() -> u32 {
    1
}

impl OptimizeHologram {
    /// All wavelengths, one hologram each.
    #[must_use]
    pub fn wavelengths(&self) -> Vec<Wavelength> {
        std::iter::once(self.wavelength).chain(self.more_wavelengths.iter().copied()).collect()
    }

    /// All planes.
    #[must_use]
    pub fn planes(&self) -> Vec<ImagePlane> {
        let first = ImagePlane { distance: self.distance, target: self.target.clone(), weight: self.plane_weight };
        std::iter::once(first).chain(self.more_planes.iter().cloned()).collect()
    }

    /// The kernel of one wavelength and plane, by their places; `None`: ideal.
    #[must_use]
    pub fn kernel_of(&self, wavelength: usize, plane: usize) -> Option<u32> {
        let place = wavelength * (1 + self.more_planes.len()) + plane;
        self.kernel_versions.get(place).copied().unwrap_or(self.kernel_version)
    }
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

/// How phases are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Adam. What jobs did before they had a choice.
    #[default]
    Adam,
    /// L-BFGS.
    Lbfgs,
    /// Gerchberg–Saxton.
    GerchbergSaxton,
    /// Gerchberg–Saxton with weights.
    WeightedGerchbergSaxton,
    /// Double phase.
    DoublePhase,
}

/// Where the search for a phase begins.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InitialPhase {
    /// Uniform in the random range.
    #[default]
    Random,
    /// Of the field that the targets send back.
    BackPropagated,
    /// A lens.
    Quadratic {
        /// \[m\]; `None`: chosen from the geometry.
        focal_length_m: Option<f64>,
    },
    /// The same everywhere.
    Constant {
        /// \[rad\]
        phase_rad: f64,
    },
    /// Artifact digests of arrays, one for each wavelength.
    Given(Vec<String>),
}

/// What is minimized.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Loss {
    /// What is compared.
    pub quantity: Quantity,
    /// Factor of the total variation.
    pub total_variation: f64,
    /// Factor of the speckle.
    pub speckle: f64,
    /// Side of its blocks \[px\].
    pub speckle_block_px: u32,
}

impl Default for Loss {
    fn default() -> Self {
        Self { quantity: Quantity::Intensity, total_variation: 0.0, speckle: 0.0, speckle_block_px: 8 }
    }
}

/// What of the light is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The light itself.
    Intensity,
    /// Its square root.
    Amplitude,
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
    /// All holograms; empty in results of older servers.
    #[serde(default)]
    pub wavelengths: Vec<WavelengthResult>,
    /// Artifact digests, a colour picture for each plane.
    #[serde(default)]
    pub colour_reconstructions: Vec<String>,
}

impl HologramResult {
    /// How the light's way to the first plane was computed with the first wavelength.
    #[must_use]
    pub fn propagation(&self) -> Option<&ValidityReport> {
        self.wavelengths.first()?.planes.first()?.propagation.as_ref()
    }
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
    /// How the light's way was computed; `None` for jobs of older servers.
    #[serde(default)]
    pub propagation: Option<ValidityReport>,
}
