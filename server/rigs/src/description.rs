//! What a rig says of its bench.

use lightpath_domain::units::{Distance, Wavelength};

/// A bench.
#[derive(Clone, Debug, PartialEq)]
pub struct RigDescription {
    /// Program of the rig, and what it drives.
    pub program: String,
    /// What shows patterns.
    pub slm: Slm,
    /// What photographs.
    pub camera: Camera,
    /// Whether the rig can keep the light from the camera.
    pub has_shutter: bool,
    /// Wavelengths of the light, each one of the display's.
    pub wavelengths: Vec<Wavelength>,
    /// Distance from the SLM to the plane on which the camera is focused.
    pub distance: Distance,
}

/// What shows patterns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slm {
    /// Columns \[px\].
    pub width_px: u32,
    /// Rows \[px\].
    pub height_px: u32,
    /// Number of bits of a level.
    pub bit_depth: u32,
    /// Time until a pattern is settled \[s\].
    pub settling_time_s: f64,
    /// Whether the rig reads back what is shown.
    pub reads_back: bool,
}

/// What photographs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Columns \[px\].
    pub width_px: u32,
    /// Rows \[px\].
    pub height_px: u32,
    /// Number of bits of a value.
    pub bit_depth: u32,
    /// Shortest exposure \[s\].
    pub exposure_min_s: f64,
    /// Longest exposure \[s\].
    pub exposure_max_s: f64,
    /// Number of frames after a change of the exposure until it takes effect.
    pub exposure_delay_frames: u32,
}
