//! Checking requests for holograms: every field checked, every default filled in, every name found.

use super::pictures::PictureChecks;
use super::{checks, planes, search};
use crate::api::Api;
use crate::datasets::from_wire::encoding;
use crate::error::ApiError;
use crate::field::{self, Field};
use crate::optics::from_wire::{convolution_method, detector, region};
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::job::{InitialPhase, Job, JobSpec, Loss, OptimizeHologram};
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1;

/// Fifty times what a good hologram takes; bounds how long one job can hold a worker.
const ITERATIONS_MAX: u32 = 10_000;
const ITERATIONS_DEFAULT: u32 = 200;
/// Most frames that are shown in turn: the fastest phase modulators show no more within the eye's integration time.
const FRAMES_MAX: u32 = 24;

impl Api {
    /// The job that a request asks for. `before` is the job that the same request made earlier.
    pub(crate) async fn optimize_hologram_spec(
        &self,
        caller: &Caller,
        message: v1::OptimizeHologram,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<OptimizeHologram, ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(caller, &at("display"), &message.display).await?;
        let wavelengths = planes::wavelengths(field, &message, &display)?;
        let (planes, depth_map) = planes::planes(field, &message)?;
        let method = at("method").known(message.method, search::method)?;
        let detector = detector(&at("detector"), message.detector)?;
        let defaults = search::PhaseDefaults { method, detector, wavelengths: wavelengths.len() };
        let initial_phase = search::initial_phase(&at("initial_phase"), &message, defaults)?;
        let range_default_rad = match initial_phase {
            InitialPhase::BackPropagated => 0.0,
            _ => search::INITIAL_PHASE_RANGE_DEFAULT_RAD,
        };
        let range_rad = message.initial_phase_range_rad.unwrap_or(range_default_rad);
        let mut spec = OptimizeHologram {
            wavelength: wavelengths[0],
            distance: planes[0].distance,
            target: planes[0].target.clone(),
            target_encoding: encoding(&at("target_encoding"), message.target_encoding, Encoding::Srgb)?,
            target_fit: at("target_fit").known(message.target_fit, search::fit)?,
            kernel_version: None,
            detector,
            iterations: at("iterations").integer_or(message.iterations, ITERATIONS_DEFAULT, 1..=ITERATIONS_MAX)?,
            learning_rate: search::learning_rate_of_adam(&at("learning_rate"), message.learning_rate, method)?,
            seed: message.seed,
            initial_phase_range_rad: search::phase_range(&at("initial_phase_range_rad"), range_rad)?,
            region_of_interest: region(&at("region_of_interest"), message.region_of_interest, &display)?,
            display: display.id.clone(),
            method,
            more_wavelengths: wavelengths[1..].to_vec(),
            plane_weight: planes[0].weight,
            more_planes: planes[1..].to_vec(),
            depth_map,
            kernel_versions: Vec::new(),
            frames: at("frames").integer_or(message.frames, 1, 1..=FRAMES_MAX)?,
            initial_phase,
            loss: Loss::default(),
            weight_mask: optional_digest(&at("weight_mask"), &message.weight_mask)?,
            quantization_aware: message.quantization_aware,
            propagation: convolution_method(&at("propagation"), message.propagation)?,
        };
        spec.loss = search::loss_of(&at("loss"), message.loss, spec.region_of_interest)?;
        checks::method(field, &spec)?;
        checks::size(field, &spec, &display)?;
        self.choose_kernels(&at("kernel"), &message.kernel, &mut spec, before).await?;
        checks::propagation(field, &spec, &display)?;
        PictureChecks { api: self, caller, spec: &spec, display: &display }.check(field).await?;
        Ok(spec)
    }

    /// One kernel, or one for each wavelength and plane.
    async fn choose_kernels(
        &self,
        field: &Field,
        kernel: &str,
        spec: &mut OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<(), ApiError> {
        let key = |wavelength, distance| KernelKey { display: spec.display.clone(), wavelength, distance };
        let (wavelengths, planes) = (spec.wavelengths(), spec.planes());
        if wavelengths.len() * planes.len() == 1 {
            let key = key(spec.wavelength, spec.distance);
            spec.kernel_version = self.kernel_version_for(field, kernel, &key, before, false).await?;
            return Ok(());
        }
        if !["", "active", "ideal"].contains(&kernel) {
            let fix = "each of several wavelengths and planes has a kernel of its own: leave it empty, or say active or ideal";
            return Err(field.invalid(format!("is {:?}, but {fix}", field::shortened(kernel))));
        }
        // A repeated submit means what it meant the first time, even if `active` has moved.
        if let Some(JobSpec::OptimizeHologram(job)) = before.map(|job| &job.spec)
            && kernel != "ideal"
            && (job.wavelengths(), job.planes().len()) == (wavelengths.clone(), planes.len())
        {
            (spec.kernel_version, spec.kernel_versions) = (job.kernel_version, job.kernel_versions.clone());
            return Ok(());
        }
        let mut versions = Vec::new();
        for wavelength in &wavelengths {
            for plane in &planes {
                let key = key(*wavelength, plane.distance);
                versions.push(self.kernel_version_for(field, kernel, &key, None, false).await?);
            }
        }
        spec.kernel_version = versions.first().copied().flatten();
        spec.kernel_versions = versions;
        Ok(())
    }
}

fn optional_digest(field: &Field, value: &str) -> Result<Option<String>, ApiError> {
    if value.is_empty() { Ok(None) } else { field.digest(value).map(Some) }
}
