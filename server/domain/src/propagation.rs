//! Methods for computing the propagation of light from the SLM to the image, and reports of their validity.

use serde::{Deserialize, Serialize};

/// A propagation method.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PropagationMethod {
    /// Angular spectrum over the whole frequency band.
    AngularSpectrum,
    /// Angular spectrum without the frequencies whose light lands outside the padded frame.
    BandLimited,
    /// Sampled Rayleigh–Sommerfeld impulse response.
    RayleighSommerfeld,
    /// Paraxial (Fresnel) transfer function.
    FresnelTransferFunction,
    /// Sampled paraxial (Fresnel) impulse response.
    FresnelImpulseResponse,
    /// Band-limited angular spectrum onto a window beside the axis.
    Shifted,
    /// Angular spectrum sampled at compressed frequencies.
    BandExtended,
    /// Angular spectrum onto any window.
    Scaled,
    /// Fresnel integral onto any window.
    ScaledFresnel,
    /// Far field (Fraunhofer diffraction).
    Fraunhofer,
}

/// Validity of a method for a display, wavelength and distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidityReport {
    /// The propagation method.
    pub method: PropagationMethod,
    /// Reason for this method, a text for people.
    pub explanation: String,
    /// Window that the samples of the image cover.
    pub window: ImageWindow,
    /// Distance up to which the padded frame samples the whole band along x \[m\].
    pub critical_distance_x_m: f64,
    /// Distance up to which the padded frame samples the whole band along y \[m\].
    pub critical_distance_y_m: f64,
    /// Fraction of the band along x whose light lands in the window.
    pub band_kept_x: f64,
    /// Fraction of the band along y whose light lands in the window.
    pub band_kept_y: f64,
    /// Fraction of the band in both directions whose light lands in the window.
    pub band_kept_area: f64,
    /// Fresnel number a²/(λz), where a is half the longer side of the SLM.
    pub fresnel_number: f64,
    /// Largest diffraction angle of the pixels \[rad\].
    pub diffraction_angle_rad: f64,
    /// Sideways displacement of light at the largest diffraction angle \[m\]; `None`: unbounded.
    pub spread_m: Option<f64>,
    /// Width of the part of the image that receives light at every angle \[m\].
    pub full_cone_x_m: f64,
    /// Height of the part of the image that receives light at every angle \[m\].
    pub full_cone_y_m: f64,
    /// Largest phase error of a paraxial method \[rad\].
    pub neglected_phase_rad: f64,
    /// Warnings about the method.
    pub warnings: Vec<PropagationWarning>,
}

/// A sampled part of the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageWindow {
    /// Number of columns.
    pub width_px: u32,
    /// Number of rows.
    pub height_px: u32,
    /// Distance between columns \[m\].
    pub pitch_x_m: f64,
    /// Distance between rows \[m\].
    pub pitch_y_m: f64,
    /// Horizontal position of the window's centre relative to the axis \[m\].
    pub centre_x_m: f64,
    /// Vertical position of the window's centre relative to the axis \[m\].
    pub centre_y_m: f64,
}

/// A warning about a propagation method.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PropagationWarning {
    /// Stable code in capitals, for programs.
    pub code: String,
    /// Text for people, with the numbers.
    pub text: String,
}
