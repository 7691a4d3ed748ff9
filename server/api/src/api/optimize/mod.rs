//! From a request for holograms to what they are to be: every field checked, every default filled in.

mod checks;
mod places;
mod ways;

use super::Api;
use super::encodings::{detector, encoding, region};
use super::error::ApiError;
use super::field::{self, Field};
use super::propagation::convolution;
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::job::{InitialPhase, Job, JobSpec, Loss, OptimizeHologram};
use lightpath_domain::kernel::KernelKey;
use lightpath_proto::v1;

/// Fifty times what a good hologram takes; bounds how long one job can hold a worker.
const ITERATIONS_MAX: u32 = 10_000;
const ITERATIONS_DEFAULT: u32 = 200;
/// A second of the fastest phase modulators at the rate of the eye.
const FRAMES_MAX: u32 = 24;

impl Api {
    pub(super) async fn optimize(
        &self,
        message: v1::OptimizeHologram,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<OptimizeHologram, ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(&at("display"), &message.display).await?;
        let wavelengths = places::wavelengths(field, &message, &display)?;
        let (planes, depth_map) = places::planes(field, &message)?;
        let method = at("method").known(message.method, ways::method)?;
        let detector = detector(&at("detector"), message.detector)?;
        let begins = ways::Begins { method, detector, wavelengths: wavelengths.len() };
        let initial_phase = ways::initial_phase(&at("initial_phase"), &message, begins)?;
        let range_default_rad = match initial_phase {
            InitialPhase::BackPropagated => 0.0,
            _ => ways::INITIAL_PHASE_RANGE_DEFAULT_RAD,
        };
        let range_rad = message.initial_phase_range_rad.unwrap_or(range_default_rad);
        let mut spec = OptimizeHologram {
            wavelength: wavelengths[0],
            distance: planes[0].distance,
            target: planes[0].target.clone(),
            target_encoding: encoding(&at("target_encoding"), message.target_encoding, Encoding::Srgb)?,
            target_fit: at("target_fit").known(message.target_fit, ways::fit)?,
            kernel_version: None,
            detector,
            iterations: at("iterations").integer_or(message.iterations, ITERATIONS_DEFAULT, 1..=ITERATIONS_MAX)?,
            learning_rate: ways::adams_rate(&at("learning_rate"), message.learning_rate, method)?,
            seed: message.seed,
            initial_phase_range_rad: ways::phase_range(&at("initial_phase_range_rad"), range_rad)?,
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
            propagation: convolution(&at("propagation"), message.propagation)?,
        };
        spec.loss = ways::loss_of(&at("loss"), message.loss, spec.region_of_interest)?;
        checks::method(field, &spec)?;
        checks::size(field, &spec, &display)?;
        self.choose_kernels(&at("kernel"), &message.kernel, &mut spec, before).await?;
        checks::propagation(field, &spec, &display)?;
        self.check_pictures(field, &spec, &display).await?;
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

    /// Decodes every picture once, so that what is wrong with one is said now.
    async fn check_pictures(&self, field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
        let planes = spec.planes();
        let one = planes.len() == 1 || spec.depth_map.is_some();
        for (p, plane) in planes.iter().enumerate().take(if one { 1 } else { planes.len() }) {
            let field = if one { field.at("target") } else { field.at("planes").index(p).at("target") };
            self.check_target(&field, spec, &plane.target, display).await?;
        }
        if let Some(map) = &spec.depth_map {
            self.check_grey(&field.at("depth_map").at("map"), spec, map, display).await?;
        }
        if let Some(mask) = &spec.weight_mask {
            self.check_mask(&field.at("weight_mask"), spec, mask, display).await?;
        }
        if let InitialPhase::Given(phases) = &spec.initial_phase {
            for (i, phase) in phases.iter().enumerate() {
                let field = field.at("initial_phase").at("phases").index(i);
                self.check_phase(&field, phase, spec.frames, display).await?;
            }
        }
        Ok(())
    }
}

fn optional_digest(field: &Field, value: &str) -> Result<Option<String>, ApiError> {
    if value.is_empty() { Ok(None) } else { field.digest(value).map(Some) }
}
