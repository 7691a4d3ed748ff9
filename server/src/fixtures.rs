//! What tests of this crate are about: a display, and the cheapest kind of job.

use crate::display::Display;
use crate::job::{JobSpec, NewJob, Scheduling, SimulateCapture};
use crate::units::{Distance, Wavelength};

pub(crate) const WAVELENGTH: Wavelength = Wavelength { pm: 515_000 };
pub(crate) const DISTANCE: Distance = Distance { nm: 150_000_000 };

/// A display of 64×48 px without anything special.
pub(crate) fn display(id: &str) -> Display {
    Display {
        id: id.to_owned(),
        width_px: 64,
        height_px: 48,
        pixel_pitch_m: 8e-6,
        bit_depth: 8,
        wavelengths: vec![WAVELENGTH],
        phase_response_rad: None,
        carrier: None,
        notes: String::new(),
        simulated_bench: None,
    }
}

/// A photograph of a hologram on the display `lab`; the seed tells jobs apart.
pub(crate) fn capture_job(request_id: &str, phase: &str, seed: u64) -> NewJob {
    let spec = SimulateCapture {
        display: "lab".to_owned(),
        wavelength: WAVELENGTH,
        distance: DISTANCE,
        phase: phase.to_owned(),
        seed,
        elapsed_s: 0.0,
    };
    NewJob {
        spec: JobSpec::SimulateCapture(spec),
        request_id: request_id.to_owned(),
        priority: 0,
        attempts_max: 3,
        scheduling: Scheduling::default(),
    }
}
