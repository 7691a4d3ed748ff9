//! A display at a wavelength and distance, read from the store and prepared for the engine.

use super::version_model::model_of;
use super::{JobContext, TaskError};
use lightpath_bench::SimulatedDisplay;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::FailureReason;
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::planning;
use lightpath_domain::slm;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_media::captures::CaptureError;
use lightpath_media::kernel_file::KernelFileError;
use lightpath_media::pictures::{self, Hologram, PictureError};
use lightpath_optics::display::phase_response::PhaseResponse;
use lightpath_optics::learning::BoxError;
use lightpath_optics::{
    Carrier, ConvolutionMethod, DisplayModel, OpticalSetup, Plane, RegionOfInterest, ValidityReport,
};

/// A display at a wavelength and distance, prepared for the engine.
#[derive(Clone, Debug)]
pub(super) struct DisplaySetup {
    /// The display as the user declared it.
    pub(super) declared: Display,
    pub(super) key: KernelKey,
    pub(super) setup: OpticalSetup,
    /// Validity of the propagation that the setup uses.
    pub(super) validity: ValidityReport,
    pub(super) response: PhaseResponse,
    pub(super) carrier: Option<Carrier>,
}

impl DisplaySetup {
    /// Reads a display. The planner chooses the propagation.
    pub(super) fn read(
        context: &JobContext,
        display: &str,
        wavelength: Wavelength,
        distance: Distance,
    ) -> Result<Self, TaskError> {
        Self::read_with(context, display, wavelength, distance, None)
    }

    /// Reads a display, with the given propagation or the planner's choice.
    pub(super) fn read_with(
        context: &JobContext,
        display: &str,
        wavelength: Wavelength,
        distance: Distance,
        propagation: Option<ConvolutionMethod>,
    ) -> Result<Self, TaskError> {
        let (display, _) = context.wait(context.store().display(display))?;
        let (setup, validity) = planning::planned(planning::setup(&display, wavelength, distance)?, propagation)?;
        let (response, carrier) = (slm::response(&display)?, display.carrier);
        let key = KernelKey { display: display.id.clone(), wavelength, distance };
        Ok(Self { declared: display, key, setup, validity, response, carrier })
    }

    /// Rows \[px\].
    pub(super) fn height_px(&self) -> usize {
        self.setup.grid().height_px()
    }

    /// Columns \[px\].
    pub(super) fn width_px(&self) -> usize {
        self.setup.grid().width_px()
    }

    /// The model of a kernel version; `None`: the model of the ideal display.
    pub(super) fn model(&self, context: &JobContext, version: Option<u32>) -> Result<DisplayModel, TaskError> {
        let Some(version) = version else { return Ok(DisplayModel::ideal(self.setup)) };
        let version = context.wait(context.store().kernel_version(&self.key, version))?;
        let model = model_of(context, &version)?;
        let of = |setup: &OpticalSetup| (setup.grid(), setup.wavelength_m(), setup.distance_m(), setup.orders());
        if of(&model.setup) != of(&self.setup) {
            let message = format!(
                "{}/versions/{} was learned for another optical setup than the display has now; learn a new version",
                self.key, version.version
            );
            return Err(TaskError::permanent(FailureReason::KernelMismatch, message));
        }
        Ok(model)
    }

    /// Loss of a kernel version on its test photographs; `None`: not known.
    pub(super) fn test_loss(&self, context: &JobContext, version: Option<u32>) -> Result<Option<f64>, TaskError> {
        let Some(version) = version else { return Ok(None) };
        let metrics = context.wait(context.store().kernel_version(&self.key, version))?.content.metrics;
        Ok((metrics.test_pairs > 0).then_some(metrics.test_loss))
    }

    /// Validity of a model's propagation: the one in the setup, or the one with which a kernel was learned.
    pub(super) fn validity_of(&self, model: &DisplayModel) -> ValidityReport {
        let validity = match model.setup.method() == self.setup.method() {
            true => self.validity.clone(),
            false => planning::assessed(&model.setup, "the kernel was learned with it"),
        };
        validity.through_kernel_of(model)
    }

    /// A stored region, which must lie inside the image.
    pub(super) fn region(&self, region: RegionOfInterest) -> Result<RegionOfInterest, TaskError> {
        Ok(region.inside(&self.setup.grid())?)
    }

    /// Grey levels for `phase` \[rad\] plus the carrier.
    pub(super) fn levels_of(&self, phase: &Plane<f32>) -> Result<Plane<u16>, TaskError> {
        let steered = self.carrier.map(|carrier| carrier.applied_to(phase));
        Ok(self.response.quantize(steered.as_ref().unwrap_or(phase))?)
    }

    /// The phase \[rad\], including the carrier, that the display shows for a hologram file.
    pub(super) fn displayed_phase(&self, file: &[u8]) -> Result<Plane<f32>, TaskError> {
        let levels = match pictures::hologram(file, self.declared.bit_depth, self.height_px(), self.width_px())? {
            Hologram::Levels(levels) => levels,
            Hologram::Phase(phase) => self.levels_of(&phase)?,
        };
        Ok(self.response.dequantize(&levels)?)
    }

    /// Removes the carrier from a displayed phase \[rad\], so that an engine can start from it.
    pub(super) fn without_carrier(&self, displayed: Plane<f32>) -> Plane<f32> {
        match self.carrier {
            // The carrier is half a turn, so adding it a second time removes it.
            Some(carrier) => carrier.applied_to(&displayed),
            None => displayed,
        }
    }
}

/// Checks that a number is finite: JSON has no NaN and no infinity.
pub(super) fn finite(name: &str, value: f64) -> Result<f64, TaskError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(TaskError::permanent(
        FailureReason::Diverged,
        format!("{name} became {value}; a smaller learning_rate may help"),
    ))
}

impl From<lightpath_optics::Error> for TaskError {
    fn from(error: lightpath_optics::Error) -> Self {
        Self::permanent(FailureReason::InvalidInput, error)
    }
}

/// Converts an error of learning, which comes from the source of pairs or from the engine.
impl From<BoxError> for TaskError {
    fn from(error: BoxError) -> Self {
        let error = match error.downcast::<Self>() {
            Ok(own) => return *own,
            Err(error) => error,
        };
        match error.downcast::<lightpath_optics::Error>() {
            Ok(error) => (*error).into(),
            Err(error) => Self::permanent(FailureReason::Learning, error),
        }
    }
}

impl From<PictureError> for TaskError {
    fn from(error: PictureError) -> Self {
        Self::permanent(FailureReason::InvalidPicture, error)
    }
}

impl From<CaptureError> for TaskError {
    fn from(error: CaptureError) -> Self {
        Self::permanent(FailureReason::InvalidPicture, error)
    }
}

impl From<KernelFileError> for TaskError {
    fn from(error: KernelFileError) -> Self {
        Self::permanent(FailureReason::InvalidKernel, error)
    }
}

/// Reads a finalized dataset and its display setup.
pub(super) fn read_dataset(context: &JobContext, id: &str) -> Result<(DisplaySetup, Dataset), TaskError> {
    let dataset = context.wait(context.store().dataset(id))?;
    if dataset.digest.is_none() {
        let message = format!("datasets/{id} is still open; finalize it first");
        return Err(TaskError::permanent(FailureReason::DatasetOpen, message));
    }
    let display = DisplaySetup::read(context, &dataset.display, dataset.wavelength, dataset.distance)?;
    Ok((display, dataset))
}

/// The simulated bench of a display; `None`: the display has none.
pub(super) fn simulated_display(display: &DisplaySetup) -> Result<Option<SimulatedDisplay>, TaskError> {
    let Some(bench) = display.declared.simulated_bench else { return Ok(None) };
    Ok(Some(SimulatedDisplay::draw(display.setup, display.carrier, bench)?))
}
