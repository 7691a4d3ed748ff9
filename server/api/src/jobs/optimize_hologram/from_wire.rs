//! Checks of requests to optimize holograms.

use super::pictures::PictureChecks;
use super::{checks, planes, search};
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::{self, Field};
use crate::optics::from_wire::{convolution_method, region};
use crate::wrong_fields::{check_all, collect_all};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::job::{Job, JobSpec, OptimizeHologram};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::units::Wavelength;
use lightpath_optics::{Detector, HologramMethod, RegionOfInterest};
use lightpath_proto::v1;

/// Limit on the iterations, fifty times as many as a good hologram needs. It bounds the time that one job uses a
/// worker.
const ITERATIONS_MAX: u32 = 10_000;
const ITERATIONS_DEFAULT: u32 = 200;
/// Limit on the frames: the fastest phase modulators show no more within the eye's integration time.
const FRAMES_MAX: u32 = 24;

/// What depends on the display of a request.
struct Shown {
    display: Display,
    wavelengths: Vec<Wavelength>,
    region_of_interest: RegionOfInterest,
}

impl Shown {
    fn on(display: Display, field: &Field, message: &v1::OptimizeHologram) -> Result<Self, ApiError> {
        check_all! {
            wavelengths = planes::wavelengths(field, message, &display);
            region_of_interest = region(&field.at("region_of_interest"), message.region_of_interest, &display);
        }
        Ok(Self { display, wavelengths, region_of_interest })
    }
}

impl Api {
    /// Checks a request, looks up the named resources, fills in defaults, and converts the request. Returns also the
    /// largest memory for decoding one of its pictures \[bytes\]. `before` is the job of an earlier submission of the
    /// same request.
    pub(crate) async fn optimize_hologram_spec(
        &self,
        call: &Call,
        message: v1::OptimizeHologram,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<(OptimizeHologram, u64), ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(call, &at("display"), &message.display).await;
        let shown = display.and_then(|display| Shown::on(display, field, &message));
        let method = search::method(field, &message);
        let detector = at("detector").enum_value(message.detector).map(Option::unwrap_or_default);
        let frames = at("frames").integer_or(message.frames, 1, 1..=FRAMES_MAX);
        // The default and the limits of the initial phase depend on these. If one of them is wrong, its default serves.
        let phases = search::PhaseDefaults {
            method: *method.as_ref().unwrap_or(&HologramMethod::Lbfgs),
            detector: *detector.as_ref().unwrap_or(&Detector::default()),
            frames: *frames.as_ref().unwrap_or(&1),
            wavelengths: message.wavelengths_m.len().max(1),
        };
        let region = shown.as_ref().ok().map(|shown| shown.region_of_interest);
        check_all! {
            shown = shown;
            planes = planes::planes(&at("planes"), &message.planes);
            depth_map = planes::depth_map(&at("depth_map"), &message.depth_map, message.planes.len());
            target_encoding = at("target_encoding").enum_value(message.target_encoding);
            target_fit = at("target_fit").enum_value(message.target_fit);
            propagation = convolution_method(&at("propagation"), message.propagation);
            method = method;
            iterations = at("iterations").integer_or(message.iterations, ITERATIONS_DEFAULT, 1..=ITERATIONS_MAX);
            frames = frames;
            initial_phase = search::initial_phase(&at("initial_phase"), message.initial_phase, phases);
            loss = search::loss(&at("loss"), message.loss, region);
            detector = detector;
            weight_mask = planes::optional_digest(&at("weight_mask"), &message.weight_mask);
        }
        let Shown { display, wavelengths, region_of_interest } = shown;
        let mut spec = OptimizeHologram {
            display: display.id.clone(),
            wavelengths,
            planes,
            depth_map,
            target_encoding: target_encoding.unwrap_or(Encoding::Srgb),
            target_fit: target_fit.unwrap_or_default(),
            kernel_versions: Vec::new(),
            propagation,
            method,
            iterations,
            frames,
            initial_phase,
            seed: message.seed,
            loss,
            detector,
            region_of_interest,
            weight_mask,
            quantization_aware: message.quantization_aware,
        };
        collect_all([checks::method(field, &spec), checks::size(field, &spec, &display)])?;
        spec.kernel_versions = self.chosen_kernels(&at("kernel"), &message.kernel, &spec, before).await?;
        checks::propagation(field, &spec, &display)?;
        let decoding_bytes = PictureChecks { api: self, call, spec: &spec, display: &display }.check(field).await?;
        Ok((spec, decoding_bytes))
    }

    /// The kernel versions, for each wavelength one for each plane.
    async fn chosen_kernels(
        &self,
        field: &Field,
        kernel: &str,
        spec: &OptimizeHologram,
        before: Option<&Job>,
    ) -> Result<Vec<Vec<Option<u32>>>, ApiError> {
        let several = spec.wavelengths.len() * spec.planes.len() > 1;
        if several && !["", "active", "ideal"].contains(&kernel) {
            let fix = "must be empty, active or ideal: each of several wavelengths and planes has its own kernel";
            return Err(field.invalid(format!("is {:?}, but {fix}", field::shortened(kernel))));
        }
        // A repeated request has the same versions as the first time, even if `active` has moved.
        if let Some(JobSpec::OptimizeHologram(job)) = before.map(|job| &job.spec)
            && ["", "active"].contains(&kernel)
            && (&job.wavelengths, job.planes.len()) == (&spec.wavelengths, spec.planes.len())
        {
            return Ok(job.kernel_versions.clone());
        }
        let mut versions = Vec::new();
        for &wavelength in &spec.wavelengths {
            let mut wavelength_versions = Vec::new();
            for plane in &spec.planes {
                let key = KernelKey { display: spec.display.clone(), wavelength, distance: plane.distance };
                wavelength_versions.push(self.kernel_version_for(field, kernel, &key, false).await?);
            }
            versions.push(wavelength_versions);
        }
        Ok(versions)
    }
}
