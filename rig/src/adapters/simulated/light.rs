//! The light of patterns, computed once for each.

use super::optics::{Optics, impossible};
use crate::device::{DeviceError, Levels, Result};
use lightpath_bench::SimulatedDisplay;
use lightpath_optics::Plane;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

/// Patterns whose light is kept: that before, that now, and one that a window covers.
const KEPT: usize = 6;

/// What is kept: the pattern, the wavelength \[m\], and the light on each pixel of the camera as a part of white.
type Kept = (Levels, f64, Arc<Plane<f32>>);

/// Computes the light that patterns make on the camera.
pub(super) struct LightOf {
    optics: Optics,
    /// A bench for each wavelength, drawn when it is first used.
    benches: Mutex<Vec<(f64, Arc<SimulatedDisplay>)>>,
    kept: Mutex<VecDeque<Kept>>,
}

impl LightOf {
    pub(super) fn new(optics: Optics) -> Result<Self> {
        let first = optics.wavelengths_m.first().copied().unwrap_or_default();
        let light = Self { optics, benches: Mutex::default(), kept: Mutex::default() };
        // What is not possible shows here, and not in the first photograph.
        light.bench(first)?;
        Ok(light)
    }

    /// The bench with light of a wavelength \[m\].
    pub(super) fn bench(&self, wavelength_m: f64) -> Result<Arc<SimulatedDisplay>> {
        let mut benches = self.benches.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, bench)) = benches.iter().find(|(known_m, _)| *known_m == wavelength_m) {
            return Ok(Arc::clone(bench));
        }
        let setup = self.optics.setup(wavelength_m)?;
        let drawn = SimulatedDisplay::draw(setup, self.optics.carrier, self.optics.bench).map_err(impossible)?;
        let drawn = Arc::new(drawn);
        benches.push((wavelength_m, Arc::clone(&drawn)));
        Ok(drawn)
    }

    /// The light of a pattern, as a part of white at the nominal exposure.
    pub(super) fn of(&self, levels: &Levels, wavelength_m: f64) -> Result<Arc<Plane<f32>>> {
        let is_it = |(pattern, known_m, _): &&Kept| *known_m == wavelength_m && pattern == levels;
        if let Some((_, _, light)) = self.kept.lock().unwrap_or_else(PoisonError::into_inner).iter().find(is_it) {
            return Ok(Arc::clone(light));
        }
        let (height_px, width_px) = (levels.height_px() as usize, levels.width_px() as usize);
        let plane = Plane::try_from_vec(height_px, width_px, levels.values().to_vec()).map_err(impossible)?;
        let phase = self.optics.response.dequantize(&plane).map_err(impossible)?;
        let light = self.bench(wavelength_m)?.light(&phase).map_err(|error| DeviceError(error.to_string()))?;
        let light = Arc::new(light);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        kept.push_front((levels.clone(), wavelength_m, Arc::clone(&light)));
        kept.truncate(KEPT);
        Ok(light)
    }
}
