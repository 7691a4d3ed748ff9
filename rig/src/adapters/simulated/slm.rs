//! The simulated SLM, its light and its shutter.

use super::faults::{Fault, draws};
use super::{Simulated, milliseconds};
use crate::device::{Levels, Light, Result, Shutter, Slm, SlmFacts};
use std::time::Instant;

/// Shows patterns after a latency, and is covered by a window now and then.
pub(super) struct SimulatedSlm(pub(super) Simulated);

/// Keeps the light from the bench.
pub(super) struct SimulatedShutter(pub(super) Simulated);

/// Purpose of the random numbers of the jitter. Those below are of the faults.
const JITTER: u64 = 100;

impl Slm for SimulatedSlm {
    fn facts(&self) -> SlmFacts {
        self.0.facts.slm.clone()
    }

    fn show(&mut self, levels: &Levels, _: Instant) -> Result<()> {
        let settings = &self.0.settings;
        let mut inside = self.0.lock();
        let (n, frame) = (inside.shows, inside.frames);
        inside.shows += 1;
        let is_covered = inside.planter.happens(Fault::CoveredPattern, n, frame);
        let shown = if is_covered { covered(levels)? } else { levels.clone() };
        let jitter_ms = settings.jitter_ms * draws(settings.faults.seed, JITTER, n).next();
        inside.before = inside.shown.replace(shown);
        inside.appears = Instant::now() + milliseconds(settings.latency_ms + jitter_ms);
        Ok(())
    }

    fn read_back(&mut self, _: Instant) -> Result<Levels> {
        let shown = self.0.lock().shown.clone();
        shown.ok_or_else(|| crate::device::DeviceError::new("nothing is shown yet"))
    }

    fn temperature_c(&mut self) -> Option<f64> {
        Some(25.0)
    }
}

impl Light for SimulatedSlm {
    fn choose(&mut self, wavelength_m: f64, _: Instant) -> Result<()> {
        self.0.lock().wavelength_m = wavelength_m;
        Ok(())
    }
}

impl Shutter for SimulatedShutter {
    fn open(&mut self, _: Instant) -> Result<()> {
        self.0.lock().is_open = true;
        Ok(())
    }

    fn close(&mut self, _: Instant) -> Result<()> {
        self.0.lock().is_open = false;
        Ok(())
    }
}

/// The pattern below a window of one level, which covers the middle of its upper half.
fn covered(levels: &Levels) -> Result<Levels> {
    let (width, height) = (levels.width_px() as usize, levels.height_px() as usize);
    let window = u16::MAX >> (16 - levels.bit_depth());
    let mut values = levels.values().to_vec();
    for row in values.chunks_exact_mut(width).take(height / 2).skip(height / 8) {
        row[width / 4..width * 3 / 4].fill(window);
    }
    Levels::try_new(levels.width_px(), levels.height_px(), levels.bit_depth(), values)
}
