//! Measurements of a pair.

use super::fingerprint;
use super::reading::{CaptureError, Captures};
use crate::pictures::{Photo, SATURATION};
use lightpath_camera::alignment::Registration;
use lightpath_domain::dataset::{Pair, PairChecks};
use lightpath_domain::digests::digest_of;
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{Detector, DisplayModel, Engine, Plane, RegionOfInterest};

/// Smallest correlation of photograph and reconstruction at which vignetting is measured. Below it, their brightness
/// cannot be compared.
const CORRELATION_FOR_VIGNETTING: f64 = 0.5;

/// Computes reconstructions of holograms on the ideal display. Clones are cheap.
#[derive(Clone, Debug)]
pub struct Reconstructor {
    engine: Engine,
}

impl Reconstructor {
    /// Builds the reconstructor for a dataset's display, wavelength and distance.
    ///
    /// # Errors
    ///
    /// [`CaptureError::Optics`] for a distance at which no image can be computed.
    pub fn of(captures: &Captures) -> Result<Self, CaptureError> {
        let (setup, _) = captures.setup().planned()?;
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, captures.carrier())?;
        Ok(Self { engine })
    }

    /// Light in each pixel of the reconstruction of a phase \[rad\].
    ///
    /// # Errors
    ///
    /// [`CaptureError::Optics`] for a phase of another size than the display.
    pub fn light(&self, phase: &Plane<f32>) -> Result<Plane<f32>, CaptureError> {
        Ok(self.engine.light(phase)?)
    }
}

/// Measures a pair. Without a reconstructor, the photograph is not compared with the hologram.
///
/// # Errors
///
/// [`CaptureError`] for a hologram or a photograph that cannot be read or has the wrong size.
pub fn check(
    captures: &Captures,
    reconstructor: Option<&Reconstructor>,
    pair: &Pair,
    phase_file: &[u8],
    photo_file: &[u8],
) -> Result<PairChecks, CaptureError> {
    let phase = captures.phase(phase_file)?;
    let Photo { light: camera, largest } = captures.camera(pair, photo_file)?;
    let photo_px = [camera.width_px() as u32, camera.height_px() as u32];
    let photo_values = values_digest(&camera);
    let photo = captures.on_grid(camera)?;
    let region = RegionOfInterest::middle(&captures.setup().grid());
    let black_level = pair.exposure.black_level;
    let floor = (-black_level / (1.0 - black_level)) as f32 + 1e-5;
    let mut checks = PairChecks {
        photo_px,
        largest,
        phase_values: values_digest(&phase),
        photo_values,
        seen: fingerprint::of(&photo, region),
        map: captures.stored_map(),
        ..statistics(&photo, region, floor)
    };
    let Some(reconstructor) = reconstructor else { return Ok(checks) };
    let expected = reconstructor.light(&phase)?;
    checks.expected = fingerprint::of(&expected, region);
    checks.correlation = fingerprint::correlation(&checks.seen, &checks.expected);
    if checks.correlation.is_some_and(|correlation| correlation > CORRELATION_FOR_VIGNETTING) {
        checks.vignetting = fingerprint::vignetting(&photo, &expected, region);
    }
    if let Some(mut tiles) = Tiles::cover(region) {
        tiles.add(&expected, &photo, SATURATION);
        let registration = Registration::of(&tiles, region);
        checks.misalignment_px = registration.map(|found| found.misalignment_px);
        checks.shift_px = registration.map(|found| found.shift_px);
        checks.turn_px = registration.map(|found| found.turn_px);
        checks.turn_uncertainty_px = registration.map(|found| found.turn_uncertainty_px);
        checks.stretch_px = registration.map(|found| found.stretch_px);
    }
    Ok(checks)
}

fn statistics(photo: &Plane<f32>, region: RegionOfInterest, floor: f32) -> PairChecks {
    let rows = region.y_px()..region.y_px() + region.height_px();
    let mut light: Vec<f32> =
        rows.flat_map(|y| photo.row(y)[region.x_px()..][..region.width_px()].iter().copied()).collect();
    let count = light.len() as f64;
    let fraction = |matches: &dyn Fn(f32) -> bool| light.iter().filter(|&&v| matches(v)).count() as f64 / count;
    let saturated = fraction(&|value| value >= SATURATION);
    let black = fraction(&|value| value <= floor);
    let mean = light.iter().map(|&value| f64::from(value)).sum::<f64>() / count;
    let variance = light.iter().map(|&value| (f64::from(value) - mean).powi(2)).sum::<f64>() / count;
    let at = light.len() - 1 - light.len() / 1000;
    let (_, &mut brightest, _) = light.select_nth_unstable_by(at, f32::total_cmp);
    let contrast = if mean > 1e-9 { variance.sqrt() / mean } else { 0.0 };
    PairChecks { saturated, black, brightest: brightest.into(), contrast, ..PairChecks::default() }
}

fn values_digest(plane: &Plane<f32>) -> String {
    let bytes: Vec<u8> = plane.values().iter().flat_map(|value| value.to_le_bytes()).collect();
    digest_of(&bytes)
}
