//! Optimization of a hologram for one target in one call.

use super::initial::InitialPhase;
use super::optimization::Optimization;
use super::options::{HologramMethod, HologramOptions};
use super::problem::HologramProblem;
use super::quality::{Quality, quality};
use crate::display::phase_response::wrap_f32;
use crate::display::{Detector, DisplayModel, OpticalSetup};
use crate::engine::Engine;
use crate::error::Result;
use crate::numerics::{Plane, RegionOfInterest};
use crate::propagation::ValidityReport;
use num_complex::Complex32;

/// Number of L-BFGS steps. More steps gain a few dB, which a photograph does not show.
const ITERATIONS: u32 = 100;

/// Hologram found by [`optimize`], with its simulated picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Hologram {
    /// Phase φ \[rad\] on the modulator, in [0, 2π).
    pub phase: Plane<f32>,
    /// Simulated picture, integrated over the display's pixels: intensity in linear light, scaled to the target's
    /// brightness.
    pub reconstruction: Plane<f32>,
    /// Quality of the picture in the middle 80 % of each axis, for each detector.
    pub quality: Quality,
    /// Factor that scales the light to the target's brightness.
    pub intensity_scale: f64,
    /// Propagation method that was used, and its accuracy.
    pub validity: ValidityReport,
}

impl Hologram {
    /// Field e^{iφ} that leaves an ideal modulator, as input of [`propagate`](crate::propagate()).
    #[must_use]
    pub fn field(&self) -> Plane<Complex32> {
        self.phase.map(|phase| Complex32::from_polar(1.0, phase))
    }
}

/// Finds the phase with which an ideal display shows `target`: intensity in linear light, of the setup's size.
///
/// The [planner](crate::plan) chooses the propagation method. L-BFGS takes 100 steps from the
/// [recommended](InitialPhase::recommended) initial phase, which is the same in every call. The loss compares the light
/// integrated over each pixel in the middle 80 % of each axis. For other methods, detectors, regions, several planes,
/// and learned displays see [`Optimization`].
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch), [`Error::NotFinite`](crate::Error::NotFinite),
/// [`Error::OutOfRange`](crate::Error::OutOfRange) and [`Error::Empty`](crate::Error::Empty) for a target of another
/// size, with values that are not finite, with negative values, or that is black;
/// [`Error::Unsuitable`](crate::Error::Unsuitable), with figures, if no propagation method gives an accurate image.
pub fn optimize(target: &Plane<f32>, setup: &OpticalSetup) -> Result<Hologram> {
    let (setup, validity) = setup.planned()?;
    let region = RegionOfInterest::middle(&setup.grid());
    let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None)?;
    let problem = HologramProblem::new(engine.clone(), target.clone(), region)?;
    let options = HologramOptions::new(HologramMethod::Lbfgs, ITERATIONS);
    let start = InitialPhase::recommended(options.method, Detector::Pixel, 1).phases(&problem, &setup, 0)?;
    let mut optimization = Optimization::start(problem, options, start)?;
    while optimization.step().is_some() {}
    let wrapped = optimization.phases().iter().map(|&phase| wrap_f32(f64::from(phase))).collect();
    let phase = Plane::try_from_vec(target.height_px(), target.width_px(), wrapped)?;
    let intensity_scale = optimization.measure(phase.values())?.best_gain;
    drop(optimization);
    let reconstruction = engine.light(&phase)?.map(|light| (intensity_scale * f64::from(light)) as f32);
    let quality = quality(&engine, &phase, target, region)?;
    Ok(Hologram { phase, reconstruction, quality, intensity_scale, validity })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::propagate;
    use crate::error::Error;
    use crate::metrics::{Gain, psnr_db};
    use crate::numerics::Grid;
    use crate::pictures_of_tests::picture;
    use crate::propagation::PropagationMethod;

    #[test]
    fn near_and_far_holograms_show_their_targets() {
        for distance_m in [5e-3, 30e-3] {
            let setup = OpticalSetup::try_new(Grid::try_new(90, 128, 8e-6).unwrap(), 515e-9, distance_m).unwrap();
            let target = picture(90, 128, 3);
            let hologram = optimize(&target, &setup).unwrap();
            assert_eq!(hologram.validity.method, PropagationMethod::BandResponse);
            let region = RegionOfInterest::middle(&setup.grid());
            let seen_db = psnr_db(&hologram.reconstruction, &target, region, Gain::Given(1.0)).unwrap();
            // The optimization sees four samples of a pixel, and the quality its whole integral.
            let pixel_db = hologram.quality.pixel.psnr_db;
            assert!(pixel_db > 25.0 && seen_db > pixel_db, "{seen_db} dB, {pixel_db} dB");
            let image = propagate(&hologram.field(), &setup).unwrap();
            assert_eq!(image.validity, hologram.validity);
            let at_points = psnr_db(&image.intensity(), &target, region, Gain::Fitted).unwrap();
            assert!((at_points - hologram.quality.point.psnr_db).abs() < 1e-2, "{at_points} dB");
        }
    }

    #[test]
    fn invalid_targets_are_refused() {
        let setup = OpticalSetup::try_new(Grid::try_new(16, 16, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        for (target, error) in [
            (Plane::filled(16, 17, 0.5), "target_intensity is 17×16 px"),
            (Plane::filled(16, 16, 0.0), "target_intensity is empty"),
            (Plane::filled(16, 16, -0.5), "target_intensity is -0.5"),
            (Plane::filled(16, 16, f32::NAN), "target_intensity holds a value"),
        ] {
            assert!(optimize(&target, &setup).unwrap_err().to_string().starts_with(error));
        }
        let far = OpticalSetup::try_new(setup.grid(), 515e-9, 5.0).unwrap();
        assert!(matches!(optimize(&Plane::filled(16, 16, 0.5), &far), Err(Error::Unsuitable { .. })));
    }
}
