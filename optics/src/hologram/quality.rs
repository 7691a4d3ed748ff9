//! Quality of a hologram's picture, measured for each detector.

use super::shown_light::ShownLight;
use super::wanted::Wanted;
use crate::engine::Engine;
use crate::error::Result;
use crate::metrics::{Gain, ImagePair, diffraction_efficiency, frame_efficiency, speckle_contrast, ssim_at_all_scales};
use crate::numerics::{Plane, RegionOfInterest};
use serde::{Deserialize, Serialize};

/// Quality of a hologram's picture for each detector.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Quality of the light at the sample points.
    pub point: DetectorQuality,
    /// Quality of the light integrated over the pixels.
    pub pixel: DetectorQuality,
    /// Quality of the light at every sub-sample, compared with the target at its pixel.
    pub supersampled: DetectorQuality,
}

/// Metrics of a hologram's light in the region of interest, for one detector. Definitions and sources are in
/// [`metrics`](crate::metrics).
///
/// PSNR, SSIM and MS-SSIM are measured at the gain with the smallest squared error. Where only some pixels of the region
/// count, PSNR and its gain are those of these pixels, and SSIM, MS-SSIM and speckle contrast, which compare
/// neighbourhoods, are `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectorQuality {
    /// Peak signal-to-noise ratio \[dB\] by [`psnr_db`](crate::metrics::psnr_db), at most [`Self::PSNR_DB_MAX`].
    pub psnr_db: f64,
    /// Structural similarity by [`ssim`](crate::metrics::ssim()); `None` in a region with a side shorter than 11
    /// samples.
    pub ssim: Option<f64>,
    /// Multi-scale structural similarity by [`ms_ssim`](crate::metrics::ms_ssim()); `None` in a region with a side
    /// shorter than 176 samples.
    pub ms_ssim: Option<f64>,
    /// Light in the region divided by the light that passes the optics
    /// ([`diffraction_efficiency`](crate::metrics::diffraction_efficiency())).
    pub diffraction_efficiency: f64,
    /// Light in the whole frame divided by the light that passes the optics.
    pub frame_efficiency: f64,
    /// Speckle contrast by [`speckle_contrast`](crate::metrics::speckle_contrast()); `None` if too little of the target
    /// is flat.
    pub speckle_contrast: Option<f64>,
}

/// Measures how well `phase` shows `target` (intensity, linear light) on the engine's display, for all three detectors.
///
/// The light is propagated twice: to the sample points, and to the sub-samples, over which a pixel integrates. The
/// engine's own detector does not matter. Measuring takes less memory than an evaluation with the pixel detector, since
/// nothing is propagated back.
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase or a target of another size than the engine's;
/// [`Error::OutOfRange`](crate::Error::OutOfRange) when the region leaves the image.
pub fn quality(engine: &Engine, phase: &Plane<f32>, target: &Plane<f32>, region: RegionOfInterest) -> Result<Quality> {
    ShownLight::of_frames(engine, std::slice::from_ref(phase))?.quality((target, region).into())
}

impl ShownLight {
    /// Measures how well the light shows what is wanted, for all three detectors.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a target of another size than the image;
    /// [`Error::OutOfRange`](crate::Error::OutOfRange) when the region leaves it.
    pub fn quality(&self, wanted: Wanted<'_>) -> Result<Quality> {
        let Wanted { target, region, .. } = wanted;
        target.expect_size("target_intensity", self.at_points.height_px(), self.at_points.width_px())?;
        let efficiency = |light: &Plane<f32>| {
            [diffraction_efficiency(light, region, self.passed), frame_efficiency(light, self.passed)]
        };
        let point = detector_quality(&self.at_points, wanted, efficiency(&self.at_points))?;
        // The sub-samples hold the same light as the pixels, so both have the same efficiency.
        let efficiency = efficiency(&self.integrated);
        let pixel = detector_quality(&self.integrated, wanted, efficiency)?;
        Ok(Quality { point, pixel, supersampled: detector_quality(&self.samples, wanted, efficiency)? })
    }

    /// The factor from the light that pixels integrate to the light that is wanted, with the smallest squared error.
    ///
    /// # Errors
    ///
    /// Those of [`Self::quality`].
    pub fn pixel_gain(&self, Wanted { target, region, belonging }: Wanted<'_>) -> Result<f64> {
        let pair = ImagePair::new(&self.integrated, target, region, Gain::Fitted)?;
        Ok(match belonging {
            Some(belonging) => pair.only(belonging)?,
            None => pair,
        }
        .gain())
    }
}

impl DetectorQuality {
    /// Largest PSNR reported \[dB\], used for a reconstruction that equals its target. Rounding in f32 keeps other
    /// reconstructions below 200 dB, and JSON has no number for infinity.
    pub const PSNR_DB_MAX: f64 = 200.0;

    /// Whether every metric is a finite number. This holds if the light is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let Self { psnr_db, ssim, ms_ssim, diffraction_efficiency, frame_efficiency, speckle_contrast } = *self;
        [psnr_db, diffraction_efficiency, frame_efficiency].iter().all(|value| value.is_finite())
            && [ssim, ms_ssim, speckle_contrast].iter().flatten().all(|value| value.is_finite())
    }
}

impl Quality {
    /// Whether every metric of every detector is a finite number. This holds if the light is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.point, self.pixel, self.supersampled].iter().all(DetectorQuality::is_finite)
    }
}

pub(super) fn detector_quality(
    light: &Plane<f32>,
    Wanted { target, region, belonging }: Wanted<'_>,
    [diffraction_efficiency, frame_efficiency]: [f64; 2],
) -> Result<DetectorQuality> {
    let pair = ImagePair::new(light, target, region, Gain::Fitted)?;
    let (pair, neighbourhoods) = match belonging {
        Some(belonging) => (pair.only(belonging)?, (None, None, None)),
        None => {
            let (ssim, ms_ssim) = ssim_at_all_scales(&pair);
            (pair, (ssim, ms_ssim, speckle_contrast(light, target, region)?))
        }
    };
    let (ssim, ms_ssim, speckle_contrast) = neighbourhoods;
    let psnr_db = -10.0 * pair.mse().log10();
    Ok(DetectorQuality {
        psnr_db: if psnr_db > DetectorQuality::PSNR_DB_MAX { DetectorQuality::PSNR_DB_MAX } else { psnr_db },
        ssim,
        ms_ssim,
        diffraction_efficiency,
        frame_efficiency,
        speckle_contrast,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, OpticalSetup};
    use crate::engine::EngineCore;
    use crate::hologram::initial::initial_phase;
    use crate::hologram::optimization::Optimization;
    use crate::hologram::options::{HologramMethod, HologramOptions};
    use crate::hologram::problem::HologramProblem;
    use crate::metrics::{diffraction_efficiency, frame_efficiency, ms_ssim, psnr_db, ssim};
    use crate::numerics::Grid;
    use crate::reference;
    use num_complex::Complex64;

    fn setup(height_px: usize, width_px: usize, distance_m: f64) -> OpticalSetup {
        OpticalSetup::try_new(Grid::try_new(height_px, width_px, 8e-6).unwrap(), 515e-9, distance_m).unwrap()
    }

    fn target(height_px: usize, width_px: usize) -> Plane<f32> {
        Plane::from_fn(height_px, width_px, |y, x| if (y / 8 + x / 12) % 2 == 0 { 0.9 } else { 0.3 })
    }

    #[test]
    fn quality_matches_metrics_of_each_detectors_light() {
        let setup = setup(60, 75, 5e-3);
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let (phase, target) = (initial_phase(60, 75, 6.0, 4).unwrap(), target(60, 75));
        let region = RegionOfInterest::middle(&setup.grid());
        let found = quality(&engine, &phase, &target, region).unwrap();
        let passed = engine.light_passed(&phase).unwrap();
        // The integral over each pixel by the midpoint rule of 12×12 points.
        let mut pixels = Plane::filled(60, 75, 0.0_f32);
        let field = phase.map(|phi| Complex64::cis(f64::from(phi)));
        let offset_m = |i: usize| ((i as f64 + 0.5) / 12.0 - 0.5) * 8e-6;
        for (i, j) in (0..12).flat_map(|i| (0..12).map(move |j| (i, j))) {
            let transfer = reference::offset(|fx, fy| setup.transfer(fx, fy), offset_m(j), offset_m(i));
            let image = reference::propagate(&field, 8e-6, transfer);
            let light = pixels.values_mut().iter_mut().zip(image.values());
            light.for_each(|(light, u)| *light += (u.norm_sqr() / 144.0) as f32);
        }
        let samples = engine.with_detector(Detector::Supersampled).samples(&phase).unwrap();
        let points = engine.with_detector(Detector::Point).light(&phase).unwrap();
        for (detector, metrics, light, within) in [
            (Detector::Point, found.point, &points, 1e-6),
            (Detector::Pixel, found.pixel, &pixels, 2e-3),
            (Detector::Supersampled, found.supersampled, &samples, 1e-6),
        ] {
            let near = |a: f64, b: f64| assert!((a - b).abs() < within * b.abs(), "{detector:?}: {a} {b}");
            near(metrics.psnr_db, psnr_db(light, &target, region, Gain::Fitted).unwrap());
            near(metrics.ssim.unwrap(), ssim(light, &target, region, Gain::Fitted).unwrap());
            near(metrics.speckle_contrast.unwrap(), speckle_contrast(light, &target, region).unwrap().unwrap());
            let light = if detector == Detector::Point { &points } else { &pixels };
            let within = if detector == Detector::Point { 1e-6 } else { 2e-3 };
            let near = |a: f64, b: f64| assert!((a - b).abs() < within * b.abs(), "{detector:?}: {a} {b}");
            near(metrics.diffraction_efficiency, diffraction_efficiency(light, region, passed));
            near(metrics.frame_efficiency, frame_efficiency(light, passed));
            assert_eq!(metrics.ms_ssim, None);
        }
    }

    #[test]
    fn only_pixels_that_belong_count_in_the_psnr() {
        let setup = setup(60, 75, 5e-3);
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let phase = initial_phase(60, 75, 6.0, 4).unwrap();
        let shown = ShownLight::of_frames(&engine, &[phase]).unwrap();
        // The light itself is the target on the left, and something else on the right.
        let light = shown.seen_by(Detector::Pixel).clone();
        let target = Plane::from_fn(60, 75, |y, x| if x < 40 { 0.5 * light.at(y, x) } else { 7.0 });
        let left = Plane::from_fn(60, 75, |_, x| x < 40);
        let region = RegionOfInterest::middle(&setup.grid());
        let of_left = shown.quality(Wanted { target: &target, region, belonging: Some(&left) }).unwrap();
        let of_all = shown.quality((&target, region).into()).unwrap();
        assert!(of_left.pixel.psnr_db > 100.0 && of_all.pixel.psnr_db < 0.0, "{of_left:?} {of_all:?}");
        assert_eq!((of_left.pixel.ssim, of_left.pixel.speckle_contrast), (None, None));
        assert_eq!(of_left.pixel.diffraction_efficiency, of_all.pixel.diffraction_efficiency);
        // Sub-samples count with their pixel.
        let columns = RegionOfInterest::try_new(&setup.grid(), 0, 0, 40, 60).unwrap();
        let alone = shown.quality((&target, columns).into()).unwrap().supersampled;
        let full = RegionOfInterest::full(&setup.grid());
        let found = shown.quality(Wanted { target: &target, region: full, belonging: Some(&left) }).unwrap();
        assert!((found.supersampled.psnr_db - alone.psnr_db).abs() < 1e-9);
        let small = Plane::filled(60, 74, true);
        assert!(shown.quality(Wanted { target: &target, region, belonging: Some(&small) }).is_err());
    }

    #[test]
    fn large_region_has_all_metrics_in_both_precisions() {
        let setup = setup(224, 240, 5e-3);
        let target = target(224, 240);
        let region = RegionOfInterest::middle(&setup.grid());
        let narrow = Engine::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let problem = HologramProblem::new(narrow.clone(), target.clone(), region).unwrap();
        let (options, start) = (
            HologramOptions::new(HologramMethod::Adam { learning_rate: 0.1 }, 20),
            initial_phase(224, 240, 1.0, 4).unwrap(),
        );
        let mut adam = Optimization::start(problem, options, start.into_vec()).unwrap();
        while adam.step().is_some() {}
        let phase = Plane::try_from_vec(224, 240, adam.phases().to_vec()).unwrap();
        let wide = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let narrow = quality(&narrow, &phase, &target, region).unwrap();
        let wide = ShownLight::of_core(&wide, &[&[phase.map(f64::from)]]).unwrap()[0]
            .quality((&target, region).into())
            .unwrap();
        for (a, b) in [(narrow.point, wide.point), (narrow.pixel, wide.pixel), (narrow.supersampled, wide.supersampled)]
        {
            // In f32 the relative error of the field is 1e-6, and every metric changes smoothly with the field.
            for (a, b) in [
                (a.psnr_db, b.psnr_db),
                (a.ssim.unwrap(), b.ssim.unwrap()),
                (a.ms_ssim.unwrap(), b.ms_ssim.unwrap()),
                (a.speckle_contrast.unwrap(), b.speckle_contrast.unwrap()),
                (a.diffraction_efficiency, b.diffraction_efficiency),
                (a.frame_efficiency, b.frame_efficiency),
            ] {
                assert!((a - b).abs() < 1e-4 * b.abs(), "{a} {b}");
            }
        }
        // The detector used in the optimization has better metrics than the detector that was not used.
        assert!(wide.point.psnr_db > wide.supersampled.psnr_db + 1.0, "{wide:?}");
        assert!(wide.point.ms_ssim > wide.supersampled.ms_ssim, "{wide:?}");
        assert!(wide.point.speckle_contrast < wide.supersampled.speckle_contrast, "{wide:?}");
        let samples = Engine::new(&DisplayModel::ideal(setup), Detector::Supersampled, None).unwrap();
        let expected = ms_ssim(&samples.samples(&phase).unwrap(), &target, region, Gain::Fitted).unwrap();
        assert!((narrow.supersampled.ms_ssim.unwrap() - expected).abs() < 1e-9);
    }

    #[test]
    fn lens_focuses_light_into_region() {
        // The aperture is half a millimetre wide and the focal length equals the distance: nearly all light meets in
        // one spot.
        let (side_px, distance_m) = (64, 20e-3);
        let setup = setup(side_px, side_px, distance_m);
        let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
        let across_m = |i: usize| (i as f64 - 31.5) * 8e-6;
        let lens = Plane::from_fn(side_px, side_px, |y, x| {
            -std::f64::consts::PI * (across_m(y).powi(2) + across_m(x).powi(2)) / (515e-9 * distance_m)
        });
        let flat = Plane::filled(side_px, side_px, 0.0);
        let region = RegionOfInterest::try_new(&setup.grid(), 26, 26, 12, 12).unwrap();
        let target = Plane::filled(side_px, side_px, 0.5_f32);
        let measured =
            |phase| ShownLight::of_core(&engine, &[&[phase]]).unwrap()[0].quality((&target, region).into()).unwrap();
        let (focused, spread) = (measured(lens), measured(flat));
        // The spot is a sinc² whose main lobe ends at λz/L = 20 µm = 2.5 px to each side. ±6 px hold 96 % of the light
        // along one axis, and 0.96² in both axes.
        for metrics in [focused.point, focused.pixel, focused.supersampled] {
            assert!((0.88..1.0).contains(&metrics.diffraction_efficiency), "{metrics:?}");
            assert!((0.97..1.0 + 1e-9).contains(&metrics.frame_efficiency), "{metrics:?}");
        }
        let share = (12.0_f64 / 64.0).powi(2);
        assert!((spread.pixel.diffraction_efficiency / share - 1.0).abs() < 0.2, "{:?}", spread.pixel);
    }

    #[test]
    fn mismatched_sizes_and_regions_are_refused() {
        let setup = setup(30, 40, 5e-3);
        let engine = Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap();
        let region = RegionOfInterest::full(&setup.grid());
        let (good, bad) = (Plane::filled(30, 40, 0.5), Plane::filled(30, 41, 0.5));
        assert!(quality(&engine, &bad, &good, region).is_err());
        assert!(quality(&engine, &good, &bad, region).is_err());
        let beyond = RegionOfInterest::full(&Grid::try_new(31, 40, 8e-6).unwrap());
        assert!(quality(&engine, &good, &good, beyond).is_err());
    }
}
