//! A simulated bench: an SLM and a camera that exist only in the engine, with faults that are planted on purpose.
//!
//! The light is that of [`lightpath_bench`]. Time passes as at a real bench: a pattern appears after the latency, with
//! jitter, and a frame takes its exposure. What was planted is written down ([`Simulated::planted`]), so that a test can
//! compare it with what was noticed.

mod camera;
mod faults;
mod light;
mod optics;
mod slm;

pub use faults::{Fault, Faults, Planted};
pub use optics::Optics;

use crate::device::{Devices, Levels, Result};
use camera::SimulatedCamera;
use faults::Planter;
use light::LightOf;
use serde::Deserialize;
use slm::{SimulatedShutter, SimulatedSlm};
use std::fmt;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// What a simulated bench is, in the rig's file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// File with the flaws of the bench, as `docs/bench.toml` describes them. Without it the bench has those of a display
    /// in need of alignment.
    pub bench: Option<PathBuf>,
    /// Distance between the centres of the SLM's pixels, such as `8um`. Without it, that of the server's display.
    pub pixel_pitch: Option<String>,
    /// Time until a pattern appears \[ms\].
    pub latency_ms: f64,
    /// Largest further time, at random \[ms\].
    pub jitter_ms: f64,
    /// Exposure with which a speckled picture fills the camera's range \[ms\].
    pub nominal_exposure_ms: f64,
    /// Whether the SLM reads back what it shows.
    pub reads_back: bool,
    /// Whether there is a shutter.
    pub shutter: bool,
    /// Longest time of a frame beyond its exposure \[s\]. The light of a pattern is computed within it.
    pub frame_limit_s: f64,
    /// Faults that are planted.
    pub faults: Faults,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            bench: None,
            pixel_pitch: None,
            latency_ms: 0.0,
            jitter_ms: 0.0,
            nominal_exposure_ms: 10.0,
            reads_back: true,
            shutter: true,
            frame_limit_s: 120.0,
            faults: Faults::default(),
        }
    }
}

/// What the devices say of themselves, which is not always what they do.
#[derive(Clone, Debug)]
pub struct Facts {
    /// Of the SLM.
    pub slm: crate::device::SlmFacts,
    /// Of the camera.
    pub camera: crate::device::CameraFacts,
}

/// A simulated bench. Cheap to clone; clones are the same bench.
#[derive(Clone)]
pub struct Simulated {
    settings: Arc<Settings>,
    facts: Arc<Facts>,
    inside: Arc<Mutex<Inside>>,
    light: Arc<LightOf>,
}

/// What happens at the bench.
struct Inside {
    /// What the panel shows, and what it showed before.
    shown: Option<Levels>,
    before: Option<Levels>,
    appears: Instant,
    is_open: bool,
    wavelength_m: f64,
    /// Patterns and frames so far.
    shows: u64,
    frames: u64,
    planter: Planter,
}

impl Simulated {
    /// Sets up the bench.
    ///
    /// # Errors
    ///
    /// The optics or the flaws are not possible.
    pub fn new(settings: Settings, facts: Facts, optics: Optics) -> Result<Self> {
        let wavelength_m = optics.wavelengths_m.first().copied().unwrap_or_default();
        let light = Arc::new(LightOf::new(optics)?);
        let inside = Inside {
            shown: None,
            before: None,
            appears: Instant::now(),
            is_open: !settings.shutter,
            wavelength_m,
            shows: 0,
            frames: 0,
            planter: Planter::new(settings.faults.clone()),
        };
        let (settings, facts) = (Arc::new(settings), Arc::new(facts));
        Ok(Self { settings, facts, inside: Arc::new(Mutex::new(inside)), light })
    }

    /// The devices. They can be asked for again: they are the same.
    #[must_use]
    pub fn devices(&self) -> Devices {
        let shutter = || Box::new(SimulatedShutter(self.clone())) as Box<dyn crate::device::Shutter>;
        Devices {
            slm: Box::new(SimulatedSlm(self.clone())),
            camera: Box::new(SimulatedCamera::new(self.clone())),
            shutter: self.settings.shutter.then(shutter),
            light: Some(Box::new(SimulatedSlm(self.clone()))),
        }
    }

    /// What was planted so far, in the order in which it happened.
    #[must_use]
    pub fn planted(&self) -> Vec<Planted> {
        self.lock().planter.planted.clone()
    }

    /// What the panel shows now, and whether the shutter is open.
    #[must_use]
    pub fn shows(&self) -> (Option<Levels>, bool) {
        let inside = self.lock();
        (inside.shown.clone(), inside.is_open)
    }

    fn lock(&self) -> MutexGuard<'_, Inside> {
        // Nothing panics while the lock is held.
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl fmt::Debug for Simulated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Simulated").field("facts", &self.facts).finish_non_exhaustive()
    }
}

fn milliseconds(ms: f64) -> Duration {
    Duration::from_secs_f64(ms.max(0.0) / 1e3)
}
