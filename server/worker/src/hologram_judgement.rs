//! Judging a finished hologram: how well it shows the picture of an image plane, by several models.

use crate::display_setup::{DisplaySetup, finite};
use crate::hologram_setup::{HologramSetup, PlaneSetup};
use crate::{JobContext, TaskError};
use lightpath_domain::expected_psnr::ExpectedPsnr;
use lightpath_domain::job::{JudgedBy, Judging, OptimizeHologram};
use lightpath_optics::hologram::{DetectorQuality, Quality, ShownLight, Wanted, pixel_psnr_db};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{DisplayModel, Plane};

/// The judge of a hologram in an image plane.
pub(super) struct Judge<'a> {
    pub(super) context: &'a JobContext,
    pub(super) spec: &'a OptimizeHologram,
    pub(super) setup: &'a HologramSetup,
    pub(super) plane: &'a PlaneSetup,
}

/// What the judge found, as far as the job asks.
#[derive(Default)]
pub(super) struct Judged {
    /// Of the phases as optimized.
    pub(super) quality: Option<Quality>,
    /// Of the phases as the display shows them.
    pub(super) quantized_quality: Option<Quality>,
    /// By the best model of the display; `None`: the kernel of the hologram is the best model.
    pub(super) judged_by: Option<JudgedBy>,
    pub(super) in_photograph: Option<ExpectedPsnr>,
    pub(super) other_orders_psnr_db: Option<f64>,
    pub(super) second_opinion: Option<SecondOpinion>,
}

impl Judge<'_> {
    /// Judges phases as they were optimized, and as the display shows them.
    pub(super) fn judged(
        &self,
        phases: &[Plane<f32>],
        displayed: &[Plane<f32>],
        wanted: Wanted<'_>,
    ) -> Result<Judged, TaskError> {
        if self.spec.judge == Judging::None {
            return Ok(Judged::default());
        }
        let plane = self.plane;
        let mut shown = ShownLight::of_sets(&plane.engine, &[phases, displayed])?;
        let quality = all_finite(shown[0].quality(wanted)?)?;
        let quantized = shown.remove(1);
        drop(shown);
        let quantized_quality = all_finite(quantized.quality(wanted)?)?;
        let pixel_gain = quantized.pixel_gain(wanted)?;
        let is_full = self.spec.judge == Judging::Full;
        let second_opinion = if is_full { self.second_opinion(displayed, &quantized, wanted)? } else { None };
        drop(quantized);
        let (judged_by, in_photograph) = match self.by_best_model(displayed, wanted)? {
            Some((judged, expected)) => (Some(judged), expected),
            None => (None, expected(plane, &plane.model, &quantized_quality, pixel_gain)),
        };
        let other_orders_psnr_db = if is_full { self.other_orders_psnr_db(displayed, wanted)? } else { None };
        let (quality, quantized_quality) = (Some(quality), Some(quantized_quality));
        Ok(Judged { quality, quantized_quality, judged_by, in_photograph, other_orders_psnr_db, second_opinion })
    }

    fn second_opinion(
        &self,
        displayed: &[Plane<f32>],
        shown: &ShownLight,
        wanted: Wanted<'_>,
    ) -> Result<Option<SecondOpinion>, TaskError> {
        let display = (&self.plane.model, self.setup.display.carrier);
        let opinion = SecondOpinion::of(display, displayed, shown, self.spec.detector, wanted, Effort::CHEAP)?;
        if let Some(opinion) = opinion {
            finite("the second opinion", opinion.engine_psnr_db + opinion.independent_psnr_db)?;
        }
        Ok(opinion)
    }

    /// Quality of the displayed phases by the best model of the display, and what a photograph is expected to show; `None`:
    /// the kernel of the hologram is the best model.
    fn by_best_model(
        &self,
        displayed: &[Plane<f32>],
        wanted: Wanted<'_>,
    ) -> Result<Option<(JudgedBy, Option<ExpectedPsnr>)>, TaskError> {
        let Self { context, spec, setup, plane } = *self;
        let Some(version) = plane.judging_version else { return Ok(None) };
        let (wavelength, distance) = (setup.wavelength, plane.plane.distance);
        let display = DisplaySetup::read_with(context, &spec.display, wavelength, distance, spec.propagation)?;
        let model = display.model(context, Some(version))?;
        let engine = context.engines().engine(&model, spec.detector, display.carrier)?;
        let shown = ShownLight::of_sets(&engine, &[displayed])?;
        let quality = all_finite(shown[0].quality(wanted)?)?;
        let expected = expected(plane, &model, &quality, shown[0].pixel_gain(wanted)?);
        Ok(Some((JudgedBy { key: display.key, version, quality }, expected)))
    }

    /// What the hologram would show on a display of the other kind. A carrier needs optics that filter the orders.
    fn other_orders_psnr_db(&self, phases: &[Plane<f32>], wanted: Wanted<'_>) -> Result<Option<f64>, TaskError> {
        let model = self.plane.with_other_orders.as_ref().filter(|_| self.setup.display.carrier.is_none());
        let Some(model) = model else { return Ok(None) };
        let psnr_db = pixel_psnr_db(self.context.engines(), model, phases, wanted)?;
        Ok(Some(finite("the quality with the other orders", psnr_db.min(DetectorQuality::PSNR_DB_MAX))?))
    }
}

/// What a photograph is expected to show, by the best model of the display. `gain` is the factor from the light that its
/// pixels integrate to the target. `None`: the error of the model on test photographs is not known.
fn expected(plane: &PlaneSetup, model: &DisplayModel, quality: &Quality, gain: f64) -> Option<ExpectedPsnr> {
    let expected = ExpectedPsnr::of(quality.pixel.psnr_db, plane.test_loss?, gain / model.gain);
    // A model without light has no gain.
    expected.psnr_db.is_finite().then_some(expected)
}

/// Checks that all numbers of a quality are finite: JSON has no NaN and no infinity.
fn all_finite(quality: Quality) -> Result<Quality, TaskError> {
    for values in [quality.point, quality.pixel, quality.supersampled] {
        let required = [values.psnr_db, values.diffraction_efficiency, values.frame_efficiency];
        let optional = [values.ssim, values.ms_ssim, values.speckle_contrast];
        for value in required.into_iter().chain(optional.into_iter().flatten()) {
            finite("the quality", value)?;
        }
    }
    Ok(quality)
}
