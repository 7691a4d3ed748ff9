//! Displays: a phase-only SLM and the optics behind it.

use crate::units::Wavelength;
use lightpath_bench::SimulatedBench;
use lightpath_optics::{Carrier, Orders};
use serde::{Deserialize, Serialize};

/// Validated properties of a display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Display {
    /// Id, the last part of the resource name: 1 to 63 characters of a-z, 0-9 and '-', starting with a letter.
    pub id: String,
    /// SLM columns \[px\].
    pub width_px: u32,
    /// SLM rows \[px\].
    pub height_px: u32,
    /// Distance between the centres of neighbouring pixels \[m\].
    pub pixel_pitch_m: f64,
    /// Bits per grey level: grey levels are 0 to 2^bit_depth − 1.
    pub bit_depth: u32,
    /// Wavelengths: at least one, ascending, all different.
    pub wavelengths: Vec<Wavelength>,
    /// Phase \[rad\] of each grey level; `None`: level · 2π / 2^bit_depth.
    pub phase_response_rad: Option<Vec<f64>>,
    /// Grating added after optimization; `None`: no grating.
    pub carrier: Option<Carrier>,
    /// Diffraction orders of the pixels that reach the image.
    pub orders: Orders,
    /// Side of the part of a pixel in which the camera sees light, in pixel pitches; 1: all of the pixel.
    pub camera_fill_factor: f64,
    /// Notes of the user.
    pub notes: String,
    /// Simulated bench; `None`: a real display.
    pub simulated_bench: Option<SimulatedBench>,
}
