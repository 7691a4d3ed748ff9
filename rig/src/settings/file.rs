//! The fields of the rig's file.

use crate::adapters::{command, folder, simulated};
use crate::device::Justified;
use serde::Deserialize;
use std::path::PathBuf;

/// All fields. `lightpath-rig init` writes a file that explains them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// URL of the server, such as `https://lab:7070`.
    pub server: Option<String>,
    /// Id of the display.
    pub display: Option<String>,
    /// Distance of the camera's plane from the SLM, such as `150mm`.
    pub distance: String,
    /// Wavelengths in vacuum, such as `515nm`.
    pub wavelengths: Vec<String>,
    /// What drives the devices.
    pub adapter: Adapter,
    /// Folder in which the rig keeps what it must remember.
    #[serde(default = "state_folder")]
    pub state_folder: PathBuf,
    /// The SLM.
    pub slm: SlmSection,
    /// The camera.
    pub camera: CameraSection,
    /// What no request can exceed.
    pub limits: LimitsSection,
    /// The safe state.
    #[serde(default)]
    pub safe: SafeSection,
    /// The simulated bench.
    #[serde(default)]
    pub simulated: simulated::Settings,
    /// Folders for somebody who photographs.
    #[serde(default)]
    pub folder: folder::Settings,
    /// Programs that show and photograph.
    pub command: Option<command::Settings>,
}

/// What drives the devices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Adapter {
    /// A bench that exists only in the engine.
    Simulated,
    /// Somebody who photographs.
    Folder,
    /// Programs.
    Command,
}

/// What the SLM is.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // the example of the file explains each field
pub struct SlmSection {
    pub width_px: u32,
    pub height_px: u32,
    pub bit_depth: u32,
    pub settling_time_ms: f64,
}

/// What the camera is.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // the example of the file explains each field
pub struct CameraSection {
    pub width_px: u32,
    pub height_px: u32,
    pub bit_depth: u32,
    #[serde(default = "right")]
    pub justified: Justified,
    pub exposure_min_ms: f64,
    pub exposure_max_ms: f64,
    #[serde(default)]
    pub exposure_delay_frames: u32,
    #[serde(default)]
    pub held_frames: u32,
}

/// What no request can exceed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs)] // the example of the file explains each field
pub struct LimitsSection {
    pub exposure_max_ms: f64,
    pub frames_max: u32,
    pub duty_percent: Option<f64>,
}

/// The safe state.
#[derive(Clone, Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[allow(missing_docs)] // the example of the file explains each field
pub struct SafeSection {
    pub pattern: Option<PathBuf>,
    pub level: Option<u16>,
    pub lost_link_s: f64,
}

impl Default for SafeSection {
    fn default() -> Self {
        Self { pattern: None, level: None, lost_link_s: 60.0 }
    }
}

fn state_folder() -> PathBuf {
    "rig-state".into()
}

fn right() -> Justified {
    Justified::Right
}
