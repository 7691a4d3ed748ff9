//! The border between the program and what stands on the bench.
//!
//! An adapter implements [`Slm`] and [`Camera`], and [`Shutter`] and [`Light`] where the bench has them. Its calls block, as
//! those of drivers do, and each is told when it should give up. A call that does not is left behind on its thread
//! ([`thread`]), and the program goes on. [`crate::conformance`] tests an adapter.
//!
//! ```text
//! show ──latency──> the pattern appears ──settling──> settled ──> begin of the exposure ──> frame
//! ```

mod frame;
mod levels;
pub mod thread;

pub use frame::{Frame, Justified};
pub use levels::Levels;

use std::time::{Duration, Instant};

/// What went wrong in a device: what happened, and what to do about it where that is known.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct DeviceError(pub String);

/// The result of a call of a device.
pub type Result<T> = std::result::Result<T, DeviceError>;

impl DeviceError {
    /// An error with this text.
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }
}

/// What an SLM is.
#[derive(Clone, Debug, PartialEq)]
pub struct SlmFacts {
    /// Columns \[px\].
    pub width_px: u32,
    /// Rows \[px\].
    pub height_px: u32,
    /// Bits of a level, 1 to 16.
    pub bit_depth: u32,
    /// Time from the call that shows a pattern until the pattern is settled.
    pub settling: Duration,
    /// Whether what is shown can be read back.
    pub reads_back: bool,
    /// Longest time that showing a pattern, or reading it back, may take.
    pub limit: Duration,
}

/// Shows patterns.
pub trait Slm: Send {
    /// What the SLM is. The answer is always the same.
    fn facts(&self) -> SlmFacts;

    /// Shows levels, row by row, until others are shown. Returns when they are on their way; they are settled
    /// [`SlmFacts::settling`] after the call began.
    ///
    /// # Errors
    ///
    /// The pattern could not be shown, or not before `deadline`.
    fn show(&mut self, levels: &Levels, deadline: Instant) -> Result<()>;

    /// The levels that are shown, of an SLM that [reads back](SlmFacts::reads_back).
    ///
    /// # Errors
    ///
    /// They could not be read, or not before `deadline`.
    fn read_back(&mut self, deadline: Instant) -> Result<Levels> {
        let _ = deadline;
        Err(DeviceError::new("this SLM does not read back what it shows"))
    }

    /// Temperature \[°C\], where it is measured.
    fn temperature_c(&mut self) -> Option<f64> {
        None
    }
}

/// What a camera is.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraFacts {
    /// Columns \[px\].
    pub width_px: u32,
    /// Rows \[px\].
    pub height_px: u32,
    /// Bits of a value, 1 to 16.
    pub bit_depth: u32,
    /// Where the bits are in the 16 bits of a value of [`Frame`]. The program turns them right.
    pub justified: Justified,
    /// Shortest exposure \[s\].
    pub exposure_min_s: f64,
    /// Longest exposure \[s\].
    pub exposure_max_s: f64,
    /// Number of frames after a change of the exposure until it takes effect, as measured.
    pub exposure_delay_frames: u32,
    /// Number of frames that the camera and its driver may hold back. As many are thrown away where frames have no time
    /// that says whether they are new.
    pub held_frames: u32,
    /// Longest time that a frame may take beyond its exposure.
    pub limit: Duration,
}

impl CameraFacts {
    /// The largest value of a pixel.
    #[must_use]
    pub fn white(&self) -> u16 {
        u16::MAX >> (16 - self.bit_depth.clamp(1, 16))
    }
}

/// Takes photographs.
pub trait Camera: Send {
    /// What the camera is. The answer is always the same.
    fn facts(&self) -> CameraFacts;

    /// Changes the exposure \[s\] and returns the one that the camera has chosen.
    ///
    /// # Errors
    ///
    /// The exposure could not be changed, or not before `deadline`.
    fn set_exposure(&mut self, exposure_s: f64, deadline: Instant) -> Result<f64>;

    /// The next frame. It may have begun before the call where the camera runs on its own; then its time or number should
    /// say so.
    ///
    /// # Errors
    ///
    /// There was no frame, or none before `deadline`.
    fn frame(&mut self, deadline: Instant) -> Result<Frame>;

    /// Temperature \[°C\], where it is measured.
    fn temperature_c(&mut self) -> Option<f64> {
        None
    }
}

/// Keeps the light from the bench: a shutter, or a laser that can be turned off.
pub trait Shutter: Send {
    /// Lets light through.
    ///
    /// # Errors
    ///
    /// It could not be opened before `deadline`.
    fn open(&mut self, deadline: Instant) -> Result<()>;

    /// Keeps the light back.
    ///
    /// # Errors
    ///
    /// It could not be closed before `deadline`.
    fn close(&mut self, deadline: Instant) -> Result<()>;
}

/// Chooses among several wavelengths.
pub trait Light: Send {
    /// Lights the SLM with this wavelength in vacuum \[m\], one of the rig's.
    ///
    /// # Errors
    ///
    /// It could not be chosen before `deadline`.
    fn choose(&mut self, wavelength_m: f64, deadline: Instant) -> Result<()>;
}

/// All devices of a bench.
#[allow(missing_debug_implementations)] // devices need not be printable
pub struct Devices {
    /// Shows patterns.
    pub slm: Box<dyn Slm>,
    /// Takes photographs.
    pub camera: Box<dyn Camera>,
    /// Keeps the light back, where there is one.
    pub shutter: Option<Box<dyn Shutter>>,
    /// Chooses the wavelength, where there are several.
    pub light: Option<Box<dyn Light>>,
}
