//! How the light's way from the SLM to the image is computed, and how good that is.

use serde::{Deserialize, Serialize};

/// A way to compute it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PropagationMethod {
    /// The angular spectrum with all of its band.
    AngularSpectrum,
    /// The same without the light that lands beyond the padded frame.
    BandLimited,
    /// The sampled Rayleigh–Sommerfeld impulse response.
    RayleighSommerfeld,
    /// The paraxial transfer function.
    FresnelTransferFunction,
    /// The sampled paraxial impulse response.
    FresnelImpulseResponse,
    /// Band-limited, on a window beside the axis.
    Shifted,
    /// The angular spectrum at squeezed frequencies.
    BandExtended,
    /// The angular spectrum onto any window.
    Scaled,
    /// The Fresnel integral onto any window.
    ScaledFresnel,
    /// The far field.
    Fraunhofer,
}

/// A method for a display, wavelength and distance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValidityReport {
    /// The method.
    pub method: PropagationMethod,
    /// Why this one, for people.
    pub explanation: String,
    /// Where the samples of the image lie.
    pub window: ImageWindow,
    /// Up to which the padded frame samples the whole band along x \[m\].
    pub critical_distance_x_m: f64,
    /// Along y \[m\].
    pub critical_distance_y_m: f64,
    /// Part of the band along x whose light lands in the window.
    pub band_kept_x: f64,
    /// Along y.
    pub band_kept_y: f64,
    /// Over both.
    pub band_kept_area: f64,
    /// a²/(λz), a half the longer side of the SLM.
    pub fresnel_number: f64,
    /// The steepest angle at which the pixels send light \[rad\].
    pub diffraction_angle_rad: f64,
    /// How far to one side the steepest light moves \[m\]; `None`: without bound.
    pub spread_m: Option<f64>,
    /// Width of the part of the image that gets light at every angle \[m\].
    pub full_cone_x_m: f64,
    /// Its height \[m\].
    pub full_cone_y_m: f64,
    /// Largest error of the phase of a paraxial method \[rad\].
    pub neglected_phase_rad: f64,
    /// What to beware of.
    pub warnings: Vec<PropagationWarning>,
}

/// A sampled part of the image plane.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ImageWindow {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Between columns \[m\].
    pub pitch_x_m: f64,
    /// Between rows \[m\].
    pub pitch_y_m: f64,
    /// Its middle, from the axis \[m\].
    pub centre_x_m: f64,
    /// Its middle, from the axis \[m\].
    pub centre_y_m: f64,
}

/// Something to beware of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PropagationWarning {
    /// In capitals, stable, for programs.
    pub code: String,
    /// For people, with the numbers.
    pub text: String,
}
