//! Displays: a phase-only SLM and the optics behind it.

use crate::units::Wavelength;
use lightpath_optics::{Carrier, SimulatedBench};
use serde::{Deserialize, Serialize};

/// A display's properties, validated. Its id is the last part of its resource name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Display {
    /// 1 to 63 characters of a-z, 0-9 and '-', starting with a letter.
    pub id: String,
    /// SLM columns \[px\].
    pub width_px: u32,
    /// SLM rows \[px\].
    pub height_px: u32,
    /// Distance between pixel centres \[m\].
    pub pixel_pitch_m: f64,
    /// Grey levels are 0 to 2^bit_depth − 1.
    pub bit_depth: u32,
    /// At least one, ascending, no two equal.
    pub wavelengths: Vec<Wavelength>,
    /// Phase \[rad\] of each grey level; `None`: level · 2π / 2^bit_depth.
    pub phase_response_rad: Option<Vec<f64>>,
    /// Grating added after optimization.
    pub carrier: Option<Carrier>,
    /// Free text.
    pub notes: String,
    /// Set for a display that exists only as a simulation.
    pub simulated_bench: Option<SimulatedBench>,
}
