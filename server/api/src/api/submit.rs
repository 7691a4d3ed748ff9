//! From a submitted request to a job: every field checked, every default filled in, every name found.

use super::encodings::{detector, model, region};
use super::error::ApiError;
use super::field::Field;
use super::propagation::check_distance;
use super::{Api, names, required, scheduling};
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::{Detector, EvaluateKernel, Job, JobSpec, LearnKernel, NewJob, SimulateCapture};
use lightpath_domain::kernel::{KernelKey, KernelModel};
use lightpath_proto::v1::{self, job_spec};
use lightpath_store::StoreError;
use uuid::Uuid;

/// Longest request id \[bytes\]: room for a UUID and a few words.
const REQUEST_ID_BYTES_MAX: usize = 128;
/// Beyond this, a failure is not a matter of chance.
const ATTEMPTS_MAX: u32 = 20;
const ATTEMPTS_DEFAULT: u32 = 3;
const PRIORITY_MAX: i32 = 100;
/// Beyond this an optimizer's step only throws its parameters about.
const LEARNING_RATE_MAX: f64 = 10.0;
/// Thirty times the paper's.
const EPOCHS_MAX: u32 = 1000;
const REFINEMENT_EVALUATIONS_MAX: u32 = 10_000;
/// Ten years: longer than any bench stands.
const ELAPSED_S_MAX: f64 = 10.0 * 365.25 * 86_400.0;
/// Beside the first: at 1080×1920 px the free space of eight distances takes half a gigabyte.
const JOINT_DATASETS_MAX: usize = 7;
/// Polynomials beyond this are no smooth errors any more.
const ORDER_MAX: u32 = 12;

impl Api {
    /// The job that a request asks for. What it names is found, and its pictures are decoded once, so that what can be
    /// known to be wrong is refused now and not by a worker an hour later.
    pub(super) async fn new_job(&self, request: v1::SubmitJobRequest) -> Result<NewJob, ApiError> {
        let field = Field::new("spec");
        let scheduling = scheduling::scheduling(&request)?;
        for id in &scheduling.after {
            self.visible_job(id).await?;
        }
        let kind = request.spec.and_then(|spec| spec.kind);
        let attempts_max =
            Field::new("attempts_max").integer_or(request.attempts_max, ATTEMPTS_DEFAULT, 1..=ATTEMPTS_MAX)?;
        let priority = Field::new("priority").integer(request.priority, -PRIORITY_MAX..=PRIORITY_MAX)?;
        let request_id = request_id(request.request_id)?;
        let before = self.store.job_by_request(&request_id).await?;
        let spec = match required(&field, kind)? {
            job_spec::Kind::OptimizeHologram(message) => {
                let field = field.at("optimize_hologram");
                JobSpec::OptimizeHologram(Box::new(self.optimize(message, &field, before.as_ref()).await?))
            }
            job_spec::Kind::LearnKernel(message) => {
                JobSpec::LearnKernel(self.learn(message, &field.at("learn_kernel")).await?)
            }
            job_spec::Kind::SimulateCapture(message) => {
                JobSpec::SimulateCapture(self.simulate(message, &field.at("simulate_capture")).await?)
            }
            job_spec::Kind::EvaluateKernel(message) => {
                let field = field.at("evaluate_kernel");
                JobSpec::EvaluateKernel(self.evaluate(message, &field, before.as_ref()).await?)
            }
        };
        Ok(NewJob { spec, request_id, priority, attempts_max, scheduling })
    }

    async fn learn(&self, message: v1::LearnKernel, field: &Field) -> Result<LearnKernel, ApiError> {
        let at = |name| field.at(name);
        let (dataset, display) = self.finalized_dataset(&at("dataset"), &message.dataset).await?;
        check_distance(&at("dataset"), &display, dataset.wavelength, dataset.distance)?;
        let model = model(&at("model"), message.model)?;
        let refinement = message.refinement_evaluations;
        let refined = model.is_smooth();
        if !refined && refinement.is_some_and(|evaluations| evaluations > 0) {
            return Err(
                at("refinement_evaluations").invalid("is given, but only smooth, display and varying models refine")
            );
        }
        let detector = detector(&at("detector"), message.detector)?;
        if detector == Detector::Supersampled {
            return Err(at("detector").invalid("is supersampled, but a camera's pixels measure either point or pixel"));
        }
        let joint_datasets =
            self.joint_datasets(&at("joint_datasets"), &message.joint_datasets, model, &dataset).await?;
        let key = KernelKey { display: display.id.clone(), wavelength: dataset.wavelength, distance: dataset.distance };
        let epochs = at("epochs").integer(message.epochs, 0..=EPOCHS_MAX)?;
        let evaluations = at("refinement_evaluations");
        Ok(LearnKernel {
            model,
            epochs: (epochs > 0).then_some(epochs),
            refinement_evaluations: refinement
                .map(|given| evaluations.integer(given, 0..=REFINEMENT_EVALUATIONS_MAX))
                .transpose()?,
            learning_rate: learning_rate(&at("learning_rate"), message.learning_rate)?,
            seed: message.seed,
            order: (message.order > 0).then(|| at("order").integer(message.order, 1..=ORDER_MAX)).transpose()?,
            start_version: self.start_version(&at("start_version"), message.start_version, refined, &key).await?,
            detector,
            region_of_interest: region(&at("region_of_interest"), message.region_of_interest, &display)?,
            display: display.id,
            joint_datasets,
            dataset: dataset.id,
        })
    }

    /// Datasets that differ from the first in their distances alone.
    async fn joint_datasets(
        &self,
        field: &Field,
        names: &[String],
        model: KernelModel,
        first: &Dataset,
    ) -> Result<Vec<String>, ApiError> {
        if !names.is_empty() && !matches!(model, KernelModel::Smooth | KernelModel::Display) {
            return Err(field.invalid("is given, but only the models smooth and display are learned over distances"));
        }
        if names.len() > JOINT_DATASETS_MAX {
            return Err(field.invalid(format!("names {}, but must name at most {JOINT_DATASETS_MAX}", names.len())));
        }
        let mut distances = vec![first.distance];
        let mut ids = Vec::with_capacity(names.len());
        for (i, name) in names.iter().enumerate() {
            let field = field.index(i);
            let (dataset, display) = self.finalized_dataset(&field, name).await?;
            check_distance(&field, &display, dataset.wavelength, dataset.distance)?;
            if (&dataset.display, dataset.wavelength) != (&first.display, first.wavelength) {
                return Err(field.invalid(format!(
                    "is of displays/{} at {}, but must be of displays/{} at {}, as datasets/{} is",
                    dataset.display, dataset.wavelength, first.display, first.wavelength, first.id
                )));
            }
            if distances.contains(&dataset.distance) {
                let problem =
                    format!("is of {}, but another dataset is already: each must have its own", dataset.distance);
                return Err(field.invalid(problem));
            }
            distances.push(dataset.distance);
            ids.push(dataset.id);
        }
        Ok(ids)
    }

    /// A version that learning can go on from.
    async fn start_version(
        &self,
        field: &Field,
        version: u32,
        refined: bool,
        key: &KernelKey,
    ) -> Result<Option<u32>, ApiError> {
        if version == 0 {
            return Ok(None);
        }
        if !refined {
            return Err(field.invalid("is given, but only smooth, display and varying models can start from a version"));
        }
        let start = self.store.kernel_version(key, version).await?;
        if !start.content.model.is_smooth() {
            let problem = format!("is {version}, but {key}/versions/{version} has no smooth kernel; name one that has");
            return Err(field.invalid(&problem));
        }
        Ok(Some(version))
    }

    async fn simulate(&self, message: v1::SimulateCapture, field: &Field) -> Result<SimulateCapture, ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(&at("display"), &message.display).await?;
        if display.simulated_bench.is_none() {
            let fix = "but only a display that was created with a simulated_bench can be photographed by the server";
            let message = format!("{}: displays/{} has no simulated bench, {fix}", at("display"), display.id);
            return Err(ApiError::Precondition { reason: "NOT_SIMULATED", message });
        }
        let spec = SimulateCapture {
            wavelength: at("wavelength_m").wavelength_of(message.wavelength_m, &display)?,
            distance: at("distance_m").distance(message.distance_m)?,
            phase: at("phase").digest(&message.phase)?,
            seed: message.seed,
            elapsed_s: at("elapsed_s").number(message.elapsed_s, 0.0..=ELAPSED_S_MAX)?,
            display: display.id.clone(),
        };
        check_distance(&at("distance_m"), &display, spec.wavelength, spec.distance)?;
        self.check_levels(&at("phase"), &spec.phase, &display).await?;
        Ok(spec)
    }

    async fn evaluate(
        &self,
        message: v1::EvaluateKernel,
        field: &Field,
        before: Option<&Job>,
    ) -> Result<EvaluateKernel, ApiError> {
        let at = |name| field.at(name);
        let (dataset, display) = self.finalized_dataset(&at("dataset"), &message.dataset).await?;
        check_distance(&at("dataset"), &display, dataset.wavelength, dataset.distance)?;
        let region_of_interest = region(&at("region_of_interest"), message.region_of_interest, &display)?;
        let key = KernelKey { display: display.id, wavelength: dataset.wavelength, distance: dataset.distance };
        let kernel_version = self.kernel_version_for(&at("kernel"), &message.kernel, &key, before, true).await?;
        Ok(EvaluateKernel { dataset: dataset.id, display: key.display, kernel_version, region_of_interest })
    }

    /// A dataset that can be learned from, and its display.
    async fn finalized_dataset(&self, field: &Field, name: &str) -> Result<(Dataset, Display), ApiError> {
        let id = names::dataset_id(field, name)?;
        let dataset = self.dataset_named(field, &id).await?;
        if dataset.digest.is_none() {
            let (reason, fix) = match dataset.pair_count {
                0 => ("DATASET_EMPTY", "is empty; add pairs and finalize it first"),
                _ => ("DATASET_OPEN", "still takes pairs; finalize it first"),
            };
            return Err(ApiError::Precondition { reason, message: format!("{field}: datasets/{id} {fix}") });
        }
        let (display, _) = self.store.display(&dataset.display).await?;
        Ok((dataset, display))
    }

    /// The display that a field names.
    pub(super) async fn display_named(&self, field: &Field, name: &str) -> Result<Display, ApiError> {
        let id = names::display_id(field, name)?;
        match self.store.display(&id).await {
            Err(StoreError::NotFound { what }) => Err(field.missing(what, "create it first")),
            other => Ok(other?.0),
        }
    }
}

fn request_id(given: String) -> Result<String, ApiError> {
    let field = Field::new("request_id");
    if given.is_empty() {
        return Ok(Uuid::now_v7().to_string());
    }
    if given.chars().any(char::is_control) {
        return Err(field.invalid("holds control characters, but must be plain text"));
    }
    field.text(given, REQUEST_ID_BYTES_MAX)
}

/// `None` for 0, the default.
pub(super) fn learning_rate(field: &Field, value: f64) -> Result<Option<f64>, ApiError> {
    if value == 0.0 {
        return Ok(None);
    }
    if value > 0.0 && value <= LEARNING_RATE_MAX {
        return Ok(Some(value));
    }
    Err(field.invalid(format!("is {value}, but must be above 0 and at most {LEARNING_RATE_MAX}, or 0 for the default")))
}
