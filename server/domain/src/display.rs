//! Displays: a phase-only SLM and the optics behind it.

use crate::units::Wavelength;
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

/// A binary grating of half the diffraction order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Carrier {
    /// π on every other column.
    HalfOrderX,
    /// π on every other row.
    HalfOrderY,
}

/// What a simulated bench is drawn from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SimulatedBench {
    /// The same seed and properties give the same bench.
    pub seed: u64,
    /// Scales every optical imperfection.
    pub strength: f64,
    /// Standard deviation of the read noise, fraction of full scale.
    pub camera_noise: f64,
    /// The camera is shifted by up to this, in x and in y \[px\].
    pub misalignment_px: f64,
    /// The camera is turned by this \[degrees\].
    #[serde(default)]
    pub rotation_deg: f64,
    /// Standard deviation of the camera lens's blur \[px\].
    #[serde(default)]
    pub blur_px: f64,
    /// Electrons of a full camera pixel; 0: not said.
    #[serde(default)]
    pub full_well_electrons: f64,
    /// Contrast of fixed speckle.
    #[serde(default)]
    pub speckle_contrast: f64,
    /// Standard deviation of the modulator's blur \[px\].
    #[serde(default)]
    pub crosstalk_px: f64,
    /// The part by which the modulator's phase swings.
    #[serde(default)]
    pub flicker: f64,
    /// How far the image wanders in an hour \[px\].
    #[serde(default)]
    pub drift_px_per_hour: f64,
    /// The part of its light that the source loses in an hour.
    #[serde(default)]
    pub dimming_per_hour: f64,
    /// By this the camera's rail is turned from the axis \[degrees\].
    #[serde(default)]
    pub rail_tilt_deg: f64,
    /// Where the aberrations are as drawn \[m\]; 0: everywhere.
    #[serde(default)]
    pub aberrations_at_m: f64,
    /// Aberrations that depend on the place on the modulator, at most \[rad\].
    #[serde(default)]
    pub field_aberration_rad: f64,
}

impl SimulatedBench {
    /// A bench with no other imperfections than these.
    #[must_use]
    pub fn new(seed: u64, strength: f64, camera_noise: f64, misalignment_px: f64) -> Self {
        Self { seed, strength, camera_noise, misalignment_px, ..Self::default() }
    }
}
